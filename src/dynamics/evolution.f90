!> The seam between the main loop and the ways to move on in time.
module evolution
  use kinds, only: int64, never, real64
  use errors, only: error_t
  use event_log, only: event_log_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: evolution_t, limits_t

  !> Where to pause; the first that is met counts. What is not set is out of reach.
  type :: limits_t
    real(real64) :: time = never                         !! since the start of the run
    integer(int64) :: collisions = huge(0_int64)
    integer(int64) :: events = huge(0_int64)
    real(real64) :: dissipated = huge(0.0_real64)        !! [energy]
    logical :: epochs = .false.                          !! whenever the epoch has moved
    integer(int64) :: turns = huge(0_int64)              !! of the loop, so that the caller can check other things
  contains
    procedure :: reached
  end type limits_t

  type, abstract :: evolution_t
    logical :: idle = .false.     !! nothing will ever happen again
    type(event_log_t) :: log      !! collisions to be written; the caller empties it
  contains
    procedure :: warning
    procedure(start_evolution), deferred :: start
    procedure(advance_evolution), deferred :: advance
  end type evolution_t

  abstract interface
    !> Prepares to go on from `sim`, new or restored: all that is not in the state is derived from it here.
    subroutine start_evolution(self, sim)
      import :: evolution_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
    end subroutine start_evolution

    !> Moves on until a limit is met or the log is full. Where it pauses leaves no trace in the trajectory.
    subroutine advance_evolution(self, sim, limits, error)
      import :: error_t, evolution_t, limits_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      type(limits_t), intent(in) :: limits
      type(error_t), allocatable, intent(out) :: error
    end subroutine advance_evolution
  end interface

contains

  !> Whether a count or the dissipated energy is at its limit. Time is not tested: all that happens at the very
  !> limit of time belongs to the part before it.
  pure function reached(self, sim) result(yes)
    class(limits_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%events >= self%events .or. sim%collisions >= self%collisions .or. sim%dissipated%value() >= self%dissipated
  end function reached

  !> What is legal but rarely meant in a simulation with this dynamics; empty if nothing.
  pure function warning(self, sim) result(text)
    class(evolution_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
  end function warning

end module evolution
