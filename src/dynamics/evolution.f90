!> The seam between the timeline and the ways to move on in time.
module evolution
  use kinds, only: int32, int64, never, real64
  use errors, only: error_t
  use event_log, only: event_log_t
  use simulation_state, only: simulation_t
  use tally, only: dissipated, tally_t
  implicit none
  private
  public :: evolution_t, limits_t

  !> Where to pause; the first that is met counts. What is not set is out of reach.
  type :: limits_t
    real(real64) :: time = never                         !! since the start of the run; for an evolution, since the epoch
    integer(int64) :: collisions = huge(0_int64)
    integer(int64) :: events = huge(0_int64)
    real(real64) :: dissipated = huge(0.0_real64)        !! energy
    logical :: at_rest = .false.                         !! where all disks have come to rest
    integer(int64) :: turns = huge(0_int64)              !! of the loop, so that the caller can check other things
    real(real64) :: sampled = 0.0_real64                 !! the time of the latest sample: the end is not before it
  contains
    procedure :: reached
    procedure :: outgrown
    procedure :: watches
  end type limits_t

  type, abstract :: evolution_t
    logical :: idle = .false.     !! nothing will ever happen again
    logical :: arrived = .false.  !! at the limit of time of the last advance, with all that happens up to it behind
    integer(int64) :: turns_left = 0       !! of those that the last advance was allowed
    integer(int64) :: alone = 0            !! events on one core, where there are more
    integer(int32) :: last_event(2) = 0    !! disk and partner of the last event, or of the first one beyond the limit of time
  contains
    procedure :: warning
    procedure :: pause_at
    procedure :: renew
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
    subroutine advance_evolution(self, sim, limits, error, log)
      import :: error_t, event_log_t, evolution_t, limits_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      type(limits_t), intent(in) :: limits
      type(error_t), allocatable, intent(out) :: error
      type(event_log_t), intent(inout), optional :: log    !! of the collisions; without it there is none
    end subroutine advance_evolution
  end interface

contains

  !> Whether a limit other than that of time is met: all that happens at the very limit of time belongs to the part before.
  pure function reached(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%events >= self%events .or. tally%collisions >= self%collisions .or. self%outgrown(tally)
  end function reached

  !> Whether a limit of what any collision may bring there is met. It must never decrease: a run that is past the limit has met
  !> it on the way, and goes back to find out in which collision.
  pure function outgrown(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%total(dissipated) >= self%dissipated
  end function outgrown

  !> Whether there is such a limit.
  pure function watches(self) result(yes)
    class(limits_t), intent(in) :: self
    logical :: yes

    yes = self%dissipated < huge(self%dissipated)
  end function watches

  !> What is legal but rarely meant in a simulation with this dynamics; empty if nothing.
  pure function warning(self, sim) result(text)
    class(evolution_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
  end function warning

  !> The first moment from a time on at which what happens to all disks can come between two parts of the dynamics.
  pure function pause_at(self, time) result(t)
    class(evolution_t), intent(in) :: self
    real(real64), intent(in) :: time              !! since the start of the run
    real(real64) :: t                             !! likewise

    t = time
  end function pause_at

  !> Goes on after the state of some disks has been changed from outside, now.
  subroutine renew(self, sim, changed)
    class(evolution_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)      !! their numbers

    call self%start(sim)
  end subroutine renew

end module evolution
