!> The state at the start: the system of the input, with every disk placed and its velocity drawn.
!> Positions and velocities of each species have random streams of their own, so that a change of one
!> does not change what the others draw.
module initial_state
  use kinds, only: int32, real64
  use errors, only: error_t
  use placement, only: place_disks
  use random_stream, only: random_stream_t
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use texts, only: written
  use starting_velocities, only: draw_velocities, remove_drift, scale_to_temperature
  implicit none
  private
  public :: create_simulation, describe_system, restless_disk

  integer, parameter :: purpose = 2                         !! of this module's random streams

contains

  !> Builds the simulation that the settings describe.
  subroutine create_simulation(settings, line, sim, error)
    type(settings_t), intent(in) :: settings
    class(status_line_t), intent(inout) :: line             !! shows how far the placement is
    type(simulation_t), intent(out) :: sim
    type(error_t), allocatable, intent(out) :: error

    call describe_system(settings, sim)
    call list_disks(sim)
    call place_disks(settings%species, settings%run%seed, line, sim, error)
    if (allocated(error)) return
    call set_in_motion(settings, sim, error)
    call sim%start_sums()
  end subroutine create_simulation

  !> Box, contact law and species.
  pure subroutine describe_system(settings, sim)
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(inout) :: sim
    integer :: s

    sim%box = settings%box
    sim%law = settings%law
    sim%own_sizes = any(settings%species%mass_in_file .or. settings%species%radius_in_file)
    allocate (sim%species(size(settings%species)))
    do s = 1, size(sim%species)
      sim%species(s) = settings%species(s)%species_t
    end do
  end subroutine describe_system

  !> The disks by their species, in the order of the input; sizes of their own come with their places.
  subroutine list_disks(sim)
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: s, i, k

    call sim%make_room(sum(sim%species%count))
    k = 0
    do s = 1, size(sim%species, kind=int32)
      do i = 1, sim%species(s)%count
        k = k + 1
        sim%tag(k)%species = s
        sim%tag(k)%id = k
      end do
    end do
  end subroutine list_disks

  !> Velocities by the rules of the species. Where nothing takes up momentum, the total is zero.
  subroutine set_in_motion(settings, sim, error)
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(inout) :: error
    type(random_stream_t) :: stream
    real(real64) :: mass(size(sim%disk))
    logical :: balanced
    integer :: s, first

    mass = sim%masses()
    balanced = all(sim%box%periodic) .and. sim%box%n_obstacles() == 0 .and. .not. sim%box%falling()
    first = 1
    do s = 1, size(settings%species)
      associate (species => settings%species(s), last => first + settings%species(s)%count - 1)
        call stream%seed(settings%run%seed, [s, purpose])
        call draw_velocities(species, mass(first:last), stream, balanced, sim%disk(first:last))
        first = last + 1
      end associate
    end do
    if (balanced) call remove_drift(settings%species, sim)
    first = 1
    do s = 1, size(settings%species)
      associate (species => settings%species(s), last => first + settings%species(s)%count - 1)
        if (species%exact_temperature >= 0 .and. .not. allocated(error)) &
          call scale_to_temperature(species, mass(first:last), sim%disk(first:last), error)
        first = last + 1
      end associate
    end do
  end subroutine set_in_motion

  !> Warns of a disk that starts so low above the floor that it would hardly do anything but bounce; empty if there is none.
  pure function restless_disk(sim) result(text)
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text
    real(real64), parameter :: lowest = 1.0e-7_real64         ! height over radius
    real(real64) :: height, speed
    integer(int32) :: i
    integer :: axis

    text = ""
    do axis = 1, 2
      associate (g => sim%box%gravity(axis))
        do i = 1, merge(sim%n_disks(), 0, abs(g) > 0)
          height = sim%disk(i)%x(axis) - sim%box%lower(axis) - sim%disk(i)%radius
          if (g > 0) height = sim%box%upper(axis) - sim%disk(i)%x(axis) - sim%disk(i)%radius
          speed = sqrt(sim%disk(i)%v(axis)**2 + 2*abs(g)*max(height, 0.0_real64))
          if (.not. speed > 0 .or. speed**2 > 2*abs(g)*lowest*sim%disk(i)%radius) cycle
          text = "disk "//written(sim%tag(i)%id)//" starts "//written(height)//" above what it falls on: it bounces " &
            //written(abs(g)/(2*speed))//" times per unit of time; start it higher, or on the wall with dynamics = 'steps'"
          return
        end do
      end associate
    end do
  end function restless_disk

end module initial_state
