!> Changes a running simulation: forces, contact laws, motions of sides, positions and velocities.
!> Each change is applied to all disks at the present time, and the resulting change of the energy
!> is counted as work. Scheduled changes are made by `timeline` when they are due.
module changes
  use box_geometry, only: box_t
  use box_state, only: bounds, box_state_t
  use disks, only: advance_disk
  use epochs, only: restart_epoch
  use errors, only: error_t, exit_broken, fail
  use kinds, only: int32, int64, never, real64
  use partners, only: n_sides
  use observables, only: total_energy
  use sample_values, only: wrap
  use simulation_state, only: change_t, simulation_t, system_t
  use tally, only: work
  use texts, only: eol, written, written_exactly
  implicit none
  private
  public :: change_positions, change_system, change_velocities, make_scheduled_change, missing_data
  public :: text_of_change

contains

  !> Makes the next scheduled change.
  subroutine make_scheduled_change(sim, error)
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem

    sim%changes_made = sim%changes_made + 1
    associate (change => sim%schedule(sim%changes_made))
      if (change%is_empty) return
      call change_system(sim, change%box, change%system, problem)
      if (problem /= "") call fail(error, exit_broken, change%origin//": "//problem)
    end associate
  end subroutine make_scheduled_change

  !> A line `TIME GROUP.VARIABLE=VALUE` for each variable of a change.
  pure function text_of_change(change) result(text)
    type(change_t), intent(in) :: change
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, size(change%lines)
      text = text//written_exactly(change%time)//" "//change%lines(k)%text//eol
    end do
  end function text_of_change

  !> At the present time, replaces the box, the contact law and the driving of a simulation by the
  !> box, contact law and driving of another input. The other input describes the same disks. Sides
  !> start new motions from their present positions. At the present time, the old and the new law of
  !> motion must therefore give the same position.
  subroutine change_system(sim, box, system, problem)
    type(simulation_t), intent(inout) :: sim
    type(box_t), intent(in) :: box
    type(system_t), intent(in) :: system
    !> Reason why the system was not replaced; empty after success.
    character(len=:), allocatable, intent(out) :: problem
    type(box_state_t) :: new_box
    real(real64) :: before                                   ! energy before the change [energy]
    real(real64) :: here(2, 2), there(2, 2)                  ! old and new positions of the sides [length]
    logical :: own_sizes

    new_box = sim%box
    call new_box%change(box, sim%now)
    call bounds(sim%box, sim%now, here(:, 1), here(:, 2))
    call bounds(new_box, sim%now, there(:, 1), there(:, 2))
    problem = missing_data(sim%system_t, system)
    if (problem == "" .and. any(abs(there - here) > 1.0e-12_real64*minval(sim%box%edges()))) &
      problem = "a side would jump: at this time the new motion must have the position of the old one"
    if (problem == "" .and. (system%features%open .neqv. sim%features%open)) problem = "side.open can change during a run only " &
      //"if the input has a source, waiting disks, a side with the variable open, or a &change of open"
    if (problem == "") problem = disk_in_the_way(sim, new_box%box_t)
    if (problem /= "") return
    before = total_energy(sim)
    call advance_all(sim)
    own_sizes = sim%features%own_sizes
    sim%box = new_box
    sim%system_t = system
    sim%features%own_sizes = own_sizes
    call sim%fit_series()
    call count_kicks()
    if (allocated(sim%source_time)) sim%source_time = max(sim%source_time, nearest(sim%time(), -1.0_real64))
    call restart_epoch(sim)
    call book(sim, before)
  contains

    !> Sets `kicks` to the number of kicks that the new driving would have applied since the start
    !> of the run. This number determines the time and the random numbers of the next kick.
    subroutine count_kicks()
      if (.not. allocated(sim%drive)) return
      sim%n_kicks = int(min(sim%time()/sim%drive%interval, 2.0_real64**62), int64)
      do while (sim%kick_time(sim%n_kicks + 1) <= sim%time())
        sim%n_kicks = sim%n_kicks + 1
      end do
      do while (sim%kick_time(sim%n_kicks) > sim%time())
        sim%n_kicks = sim%n_kicks - 1
      end do
    end subroutine count_kicks
  end subroutine change_system

  !> Reason why an open side cannot be closed: a disk overlaps it. Empty if every side that is being
  !> closed is free.
  pure function disk_in_the_way(sim, box) result(problem)
    type(simulation_t), intent(in) :: sim
    type(box_t), intent(in) :: box                           !! box after the change
    character(len=:), allocatable :: problem
    real(real64) :: x(2), gap(n_sides)                       ! [length]
    integer(int32) :: i, first
    integer :: k

    problem = ""
    if (.not. any(sim%box%open .and. .not. box%open)) return
    first = 0
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      x = sim%position(i)
      gap([1, 3]) = x - box%lower
      gap([2, 4]) = box%upper - x
      if (.not. any(sim%box%open .and. .not. box%open .and. gap < sim%disk(i)%radius)) cycle
      if (first > 0) then
        if (sim%tag(first)%id < sim%tag(i)%id) cycle
      end if
      first = i
      k = findloc(sim%box%open .and. .not. box%open .and. gap < sim%disk(i)%radius, .true., dim=1)
    end do
    if (first > 0) problem = "side."//box%surface(k)%name//".open: disk "//written(sim%tag(first)%id) &
      //" overlaps the line of the side, which can be closed only when no disk does"
  end function disk_in_the_way

  !> Data that another system requires but the disks lack, worded as part of a message; empty if
  !> nothing is missing.
  pure function missing_data(one, other) result(problem)
    type(system_t), intent(in) :: one, other
    character(len=:), allocatable :: problem

    problem = ""
    if ((one%features%rotation .neqv. other%features%rotation) .or. &
      (one%features%orientation .neqv. other%features%orientation) .or. &
      (one%law%contact_time > 0 .neqv. other%law%contact_time > 0) .or. &
      one%kick_counter() /= other%kick_counter()) &
      problem = "the change needs data that the disks do not have: rotation, orientation, contact_time > 0 and " &
        //"drive.kind = 'recycle' must be there from the start"
  end function missing_data

  !> Sets the velocities of all disks.
  subroutine change_velocities(sim, v)
    type(simulation_t), intent(inout) :: sim
    !> New velocities in the order of ids; shape (2, n) [length/time].
    real(real64), intent(in) :: v(:, :)
    real(real64) :: before, old(2)      ! energy before the change [energy]; old velocity [length/time]
    integer(int32) :: i

    before = total_energy(sim)
    call advance_all(sim)
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      old = sim%disk(i)%v
      sim%disk(i)%v = v(:, sim%tag(i)%id)
      call sim%record_velocity_change(i, old, sim%now)
    end do
    sim%reference_energy = sim%kinetic_energy()
    call restart_epoch(sim)
    call book(sim, before)
  end subroutine change_velocities

  !> Sets the positions of all disks, without testing for overlaps. A position beyond a periodic
  !> side belongs to a periodic image of the disk.
  subroutine change_positions(sim, x)
    type(simulation_t), intent(inout) :: sim
    !> New positions in the order of ids; shape (2, n) [length].
    real(real64), intent(in) :: x(:, :)
    ! Energy before the change [energy]; old position [length]; velocity [length/time]
    real(real64) :: before, old(2), v(2), image(2)
    integer(int32) :: i

    before = total_energy(sim)
    call advance_all(sim)
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      image = 0
      if (any(sim%box%periodic)) image = sim%extra(i)%image
      old = sim%disk(i)%x
      v = sim%disk(i)%v
      call wrap(sim, old, v, image)      ! shifts the old position by whole periods into the box
      sim%disk(i)%x = x(:, sim%tag(i)%id)
      call wrap(sim, sim%disk(i)%x, v, image)
      if (any(sim%box%periodic)) sim%extra(i)%image = image
    end do
    call restart_epoch(sim)
    call book(sim, before)
  end subroutine change_positions

  !> Advances all disks to the present time under the old forces, so that all clocks are equal, and
  !> erases their last collision partners. With its new velocity a disk may collide with its last
  !> partner again immediately. If the partner were not erased, this collision would be mistaken for
  !> a rounding error of the previous collision.
  subroutine advance_all(sim)
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      call sim%rotate_to(i, sim%now)
      call advance_disk(sim%disk(i), sim%box%gravity, sim%now)
      sim%tag(i)%last_partner = 0
    end do
  end subroutine advance_all

  !> Counts the change of the total energy since `before` as work on the disks. The units of the
  !> exact sums are chosen as in a run that starts with the new system.
  subroutine book(sim, before)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: before                       !! total energy before the change [energy]

    sim%changes = sim%changes + 1
    if (.not. sim%has_collapsed()) sim%tally%collapse = never       ! the change prevents an imminent collapse
    if (allocated(sim%series)) sim%series%known_until = 0
    sim%typical_speed2 = max(sim%typical_speed2, sim%mean_square_speed())
    call sim%choose_units()
    call sim%tally%sum(work)%add(total_energy(sim) - before)
  end subroutine book

end module changes
