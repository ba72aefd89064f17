!> Whether what a checkpoint holds can be the state of a run, beyond the range of each value: a right checksum only says
!> that nobody has changed the file since it was sealed. What is wrong is named by its dataset.
module checkpoint_checks
  use cadence, only: cadence_t
  use disks, only: species_by_id
  use kinds, only: int32, int64, most_exact, never, real64
  use progress, only: progress_t
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use tally, only: dissipated, drive_energy, heat, work
  use texts, only: written
  implicit none
  private
  public :: flaw_of_state, flaw_of_progress

  real(real64), parameter :: rounding = 1.0e-6_real64       !! relative, more than that of any run

contains

  !> What cannot be right in a state whose values are all in their ranges; empty if nothing.
  pure function flaw_of_state(sim, settings) result(flaw)
    type(simulation_t), intent(in) :: sim
    type(settings_t), intent(in) :: settings
    character(len=:), allocatable :: flaw
    real(real64) :: dt                            ! [time]

    flaw = flaw_of_tags(sim, settings)
    if (flaw == "") flaw = flaw_of_counts(sim)
    dt = merge(settings%run%dt, 0.0_real64, settings%run%dynamics == "steps")
    if (flaw == "" .and. dt > 0 .and. sim%time() > most_exact*dt) flaw = "now is more than 2**53 steps of time"
    if (flaw == "") flaw = flaw_of_kicks(sim, dt)
    if (flaw == "") flaw = flaw_of_motion(sim, dt)
  end function flaw_of_state

  !> Each disk of the input must be there once, be of its species, and not be larger than the largest of it.
  pure function flaw_of_tags(sim, settings) result(flaw)
    type(simulation_t), intent(in) :: sim
    type(settings_t), intent(in) :: settings
    character(len=:), allocatable :: flaw
    integer(int32), allocatable :: species(:)
    integer(int32) :: i

    allocate (species, source=species_by_id(sim%species))
    flaw = ""
    do i = 1, sim%n_disks()
      associate (tag => sim%tag(i))
        if (species(tag%id) == 0) then
          flaw = in_row("id", i)//" is "//written(tag%id)//" a second time"
        else if (species(tag%id) /= tag%species) then
          flaw = in_row("species", i)//" is "//written(tag%species)//", but disk "//written(tag%id) &
            //" is of species "//written(species(tag%id))
        else if (sim%disk(i)%radius > settings%species(tag%species)%radius) then
          flaw = in_row("radius", i)//" is "//written(sim%disk(i)%radius)//"; possible: up to " &
            //written(settings%species(tag%species)%radius)
        end if
        if (flaw /= "") return
        species(tag%id) = 0
      end associate
    end do
  end function flaw_of_tags

  !> Collisions are counted in several ways, which must agree.
  pure function flaw_of_counts(sim) result(flaw)
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: flaw
    real(real64) :: own                           ! a sum of integers might overflow

    own = sum(real(sim%tag%collisions, real64))
    flaw = ""
    associate (fixed => sum(sim%tally%surface%collisions))
      if (sim%tally%events /= sim%tally%collisions + fixed) then
        flaw = "events is "//written(sim%tally%events)//", but "//written(sim%tally%collisions + fixed)//" are counted by kind"
      else if (own < 2*sim%tally%collisions + fixed .or. own > 2*sim%tally%collisions + fixed) then
        flaw = "disks/collisions add up to "//written(own)//" instead of "//written(2*sim%tally%collisions + fixed)
      else if (sim%epoch_events > sim%tally%events) then
        flaw = "epoch_events is "//written(sim%epoch_events)//" after "//written(sim%tally%events)//" events"
      else if (sim%epoch_end <= sim%epoch_begin .and. max(sim%epoch_begin, sim%epoch_end, sim%blink) > 0) then
        flaw = "epoch_begin is "//written(sim%epoch_begin)//", epoch_end "//written(sim%epoch_end)
      else if (sim%last_advance > sim%now) then
        flaw = "last_advance is "//written(sim%last_advance)//", now "//written(sim%now)
      else if (sim%events_then > sim%tally%events) then
        flaw = "events_then is "//written(sim%events_then)//" after "//written(sim%tally%events)//" events"
      end if
    end associate
  end function flaw_of_counts

  !> The kicks so far are those of the time that has passed; one that is due now may be still to come. With time steps a
  !> kick waits for the end of its step.
  pure function flaw_of_kicks(sim, dt) result(flaw)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: dt                !! 0: events are exact
    character(len=:), allocatable :: flaw
    real(real64) :: early

    flaw = ""
    early = dt + rounding*sim%time()
    if (merge(sim%drive%time_of(sim%kicks), 0.0_real64, sim%kicks > 0) > sim%time() + early &
      .or. sim%drive%time_of(sim%kicks + 1) < sim%time() - early) &
      flaw = "kicks is "//written(sim%kicks)//" at time "//written(sim%time())
  end function flaw_of_kicks

  !> There is as much kinetic energy as collisions have left and what acts on the disks may have given; so no disk has gone
  !> farther than a speed allows, left the box, or collided in the future. What a driven disk had gained and lost again
  !> nobody knows: it may have gone anywhere. With time steps a disk goes beyond a wall by less than a step, and may sink
  !> by what it falls in each.
  pure function flaw_of_motion(sim, dt) result(flaw)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: dt                !! 0: events are exact
    character(len=:), allocatable :: flaw
    real(real64) :: sunk(2), energy, fall
    integer(int32) :: i
    logical :: driven

    driven = sim%is_driven()
    sunk = 0.5_real64*abs(sim%box%gravity)*dt*sim%now
    fall = sum(sim%masses())*sum(abs(sim%box%gravity)*(sim%box%edges() + sum(sim%box%reach(), dim=2) + sunk))
    flaw = ""
    do i = 1, sim%n_disks()
      associate (speed => merge(never, sqrt(2*(sim%start_energy + fall)/sim%mass_of(i)), driven))
        call check_place(sim, i, speed, sim%box%reach() + spread(dt*speed + sunk, 2, 2), flaw)
      end associate
      if (flaw /= "") return
    end do
    energy = sim%kinetic_energy()
    associate (left => sim%start_energy - sim%tally%total(dissipated) + sum(sim%tally%total([heat, work, drive_energy])), &
      terms => sim%start_energy + sum(abs(sim%tally%total([dissipated, heat, work, drive_energy]))))
      if (abs(energy - left) > rounding*terms + (1 + rounding)*fall) &
        flaw = "start_energy less dissipated is "//written(left)//", but the disks have "//written(energy)
    end associate
  end function flaw_of_motion

  !> The same of one disk. Without a flaw the text is not touched, as there may be many disks.
  pure subroutine check_place(sim, i, speed, beyond, flaw)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: speed             !! that it cannot have had [length/time]
    real(real64), intent(in) :: beyond(2, 2)      !! how far it may be beyond the sides: `box_t%reach` and more [length]
    character(len=:), allocatable, intent(inout) :: flaw
    real(real64) :: x(2), reach(2, 2), periods(2)

    associate (disk => sim%disk(i), edges => sim%box%edges())
      periods = merge(2 + speed*sim%time()/edges, 0.0_real64, sim%box%periodic)
      if (disk%clock > sim%now .or. disk%clock < -sim%epoch*(1 + rounding)) then
        flaw = in_row("clock", i)//" is "//written(disk%clock)//"; possible: "//written(-sim%epoch)//" to "//written(sim%now)
      else if (any(abs(sim%image(i)) > periods)) then
        flaw = in_row("image1, image2", i)//": the disk cannot have gone so far"
      else
        x = sim%position(i)
        reach = beyond + spread(disk%radius + rounding*edges, 2, 2)
        if (any(x < sim%box%lower - reach(:, 1) .or. x > sim%box%upper + reach(:, 2))) flaw = in_row("x1, x2", i) &
          //": the disk is outside the box, at "//written(x(1))//", "//written(x(2))
      end if
    end associate
  end subroutine check_place

  !> A row of a dataset of the disks.
  pure function in_row(name, i) result(text)
    character(len=*), intent(in) :: name
    integer(int32), intent(in) :: i
    character(len=:), allocatable :: text

    text = "disks/"//name//", row "//written(i)
  end function in_row

  !> What cannot be right in the progress of the output of a sound state; empty if nothing.
  pure function flaw_of_progress(progress, sim, event_log) result(flaw)
    type(progress_t), intent(in) :: progress
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: event_log              !! collisions are written
    character(len=:), allocatable :: flaw
    integer(int64) :: events

    events = merge(sim%tally%events, 0_int64, event_log)
    flaw = flaw_of_cadence(progress%frames, "frames", sim)
    if (flaw == "") flaw = flaw_of_cadence(progress%observables, "observables", sim)
    if (flaw == "" .and. progress%events /= events) &
      flaw = "progress/events is "//written(progress%events)//" instead of "//written(events)
  end function flaw_of_progress

  !> The last sample lies in the past, and the next ones can be counted. It may have been due by another cadence.
  pure function flaw_of_cadence(cadence, name, sim) result(flaw)
    type(cadence_t), intent(in) :: cadence
    character(len=*), intent(in) :: name
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: flaw

    flaw = ""
    if (cadence%last_time > sim%time() .or. cadence%last_events > sim%tally%events .or. &
      sim%time() > most_exact*cadence%every_time) flaw = "progress/"//name//": the last sample is of time " &
      //written(cadence%last_time)//" and event "//written(cadence%last_events)//", the state of time " &
      //written(sim%time())//" and event "//written(sim%tally%events)
  end function flaw_of_cadence

end module checkpoint_checks
