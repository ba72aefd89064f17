!> Creates the simulation described by an input, with the initial positions and velocities of all
!> disks.
module initial_state
  use kinds, only: int32, real64
  use box_state, only: box_state_t
  use disks, only: disks_before
  use errors, only: error_t
  use initial_positions, only: place_disks
  use input_groups, only: range_of
  use input_problems, only: problem_list_t
  use settings, only: run_input_t, settings_t, species_settings_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use texts, only: written
  use starting_velocities, only: draw_initial_velocities
  implicit none
  private
  public :: check_speeds, create_simulation, describe_system

  !> Maximum magnitude of a number that is squared; double precision ends at about 1e308.
  real(real64), parameter :: most = 1.0e130_real64
  real(real64), parameter :: widest = 1.0e30_real64*(1 + 1.0e-12_real64)   !! maximum ratio of two masses

contains

  !> Creates the simulation described by the input. The tables of disks read from files are
  !> deallocated.
  subroutine create_simulation(input, line, sim, error, unrelaxed)
    type(run_input_t), intent(inout) :: input
    class(status_line_t), intent(inout) :: line             !! status line for the progress of the placement
    type(simulation_t), intent(out) :: sim
    type(error_t), allocatable, intent(out) :: error
    !> .true. to skip the placement of 'relaxed' species; a mere check of the input (--check) needs
    !> no positions.
    logical, intent(in), optional :: unrelaxed
    type(problem_list_t) :: problems
    logical :: without_placement
    integer :: s(2)

    without_placement = .false.
    if (present(unrelaxed)) without_placement = unrelaxed

    s = range_of(input%groups, ["species"])
    associate (settings => input%settings, groups => input%groups(s(1):s(2)))
      call describe_system(settings, sim)
      call sim%list_disks()
      call let_wait(settings%species, sim)
      if (allocated(sim%drive)) call sim%drive%prepare(sim)
      call place_disks(settings%species, groups, settings%run%seed, without_placement, line, sim, problems)
      if (problems%count == 0) call draw_initial_velocities(settings, groups, sim, problems)
      if (problems%count == 0) call check_speeds(sim, problems)
      if (problems%count == 0) call sim%start_sums()
    end associate
    call problems%report(input%path, error, input%overrides)
  end subroutine create_simulation

  !> Marks the disks that wait outside the box at the start: the last disks of each species.
  pure subroutine let_wait(species, sim)
    type(species_settings_t), intent(in) :: species(:)
    !> Simulation with its disks in the order of the input.
    type(simulation_t), intent(inout) :: sim
    integer :: s

    if (.not. allocated(sim%waits)) return
    do s = 1, size(species)
      associate (last => disks_before(species, s + 1), n => species(s)%waiting)
        sim%waits(last - n + 1:last) = .true.
        sim%tally%inside(s) = species(s)%count - n
      end associate
    end do
  end subroutine let_wait

  !> Reports an error if products of lengths, speeds and masses could overflow or underflow in the
  !> prediction or execution of collisions. The simulation would then miss collisions.
  subroutine check_speeds(sim, problems)
    type(simulation_t), intent(in) :: sim
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: speed, longest, shortest, mass(2)
    integer(int32) :: i

    longest = maxval(abs([sim%box%lower, sim%box%upper]))
    shortest = minval(sim%disk%radius)
    mass = [huge(mass), 0.0_real64]
    speed = 0
    do i = 1, sim%n_disks()
      mass = [min(mass(1), sim%mass_of(i)), max(mass(2), sim%mass_of(i))]
      speed = max(speed, maxval(abs(sim%disk(i)%v)))
    end do
    speed = speed + sim%box%highest_speed() + sqrt(sim%box%highest_temperature()/mass(1))
    speed = speed + sqrt(2*maxval(abs(sim%box%gravity)))*sqrt(longest)
    if (mass(2) > widest*mass(1)) call problems%add(0, "species.mass", "masses from "//written(mass(1))//" to " &
      //written(mass(2))//"; allowed: a ratio of up to 1e30, with which sums over collisions are exact")
    if (.not. speed > 0) return
    if (longest*speed > most .or. shortest*speed < 1/most .or. longest/speed > most .or. shortest/speed < 1/most) then
      call problems%add(0, "species.radius", "lengths from "//written(shortest)//" to "//written(longest)//" with speeds up to " &
        //written(speed)//": their products are out of range; choose other units of length and time")
    else if (mass(2)*speed > most/speed/sim%n_disks() .or. mass(1)*speed < 1/most/speed) then
      call problems%add(0, "species.mass", "masses from "//written(mass(1))//" to "//written(mass(2))//" with speeds up to " &
        //written(speed)//": their energies are out of range; choose other units of mass and time")
    end if
  end subroutine check_speeds

  !> Sets all components of a simulation except the disks: the box, the contact law, the species,
  !> and others.
  subroutine describe_system(settings, sim)
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(inout) :: sim

    sim%box = box_state_t(settings%box)
    sim%system_t = settings%system_t
    sim%seed = settings%run%seed
    sim%species = settings%species%species_t
    if (allocated(settings%schedule)) sim%schedule = settings%schedule
  end subroutine describe_system

end module initial_state
