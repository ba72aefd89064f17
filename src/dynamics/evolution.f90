!> Abstract type of the kinds of dynamics (event-driven, time-stepped, parallel), which the timeline calls.
module evolution
  use kinds, only: int32, int64, never, real64
  use errors, only: error_t
  use event_log, only: event_log_t
  use simulation_state, only: simulation_t
  use tally, only: dissipated, tally_t
  implicit none
  private
  public :: evolution_t, limits_t

  !> Limits at which the dynamics stops and returns to its caller: the first limit that is reached determines the stop. By default
  !> each limit has a value that no simulation reaches.
  type :: limits_t
    !> Limit of the simulated time, measured from the start of the run or, in calls of the procedures of `evolution_t`, from the
    !> time origin `box%epoch` [time]
    real(real64) :: time = never
    integer(int64) :: collisions = huge(0_int64)
    integer(int64) :: events = huge(0_int64)
    real(real64) :: dissipated = huge(0.0_real64)        !! dissipated energy [energy]
    logical :: at_rest = .false.                         !! whether the dynamics returns when all disks are at rest
    !> Number of iterations of the event loop after which the dynamics returns, so that the caller can check signals and the wall
    !> clock.
    integer(int64) :: iterations = huge(0_int64)
    real(real64) :: sampled = 0.0_real64                 !! time of the latest sample; the run does not end before this time
  contains
    procedure :: reached
    procedure :: outgrown
    procedure :: watches
  end type limits_t

  type, abstract :: evolution_t
    logical :: idle = .false.     !! whether no event will ever occur again
    logical :: arrived = .false.  !! whether `advance` has reached its time limit and executed all events up to this limit
    integer(int64) :: iterations_left = 0  !! number of allowed iterations that the last call of `advance` did not use
    integer(int64) :: serial_events = 0    !! number of events executed by the serial engine of a parallel run
    !> Disk and partner of the last executed event or, if the time limit was reached, of the first event after the time limit.
    integer(int32) :: last_event(2) = 0
  contains
    procedure :: warning
    procedure :: pause_at
    procedure :: renew
    procedure(start_evolution), deferred :: start
    procedure(advance_evolution), deferred :: advance
  end type evolution_t

  abstract interface
    !> Prepares the dynamics to continue from the state `sim`, which is the initial state or a state from a checkpoint. All data of
    !> the dynamics that are not part of the state are derived from the state.
    subroutine start_evolution(self, sim)
      import :: evolution_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
    end subroutine start_evolution

    !> Advances the simulation until a limit is reached or the log is full. The trajectory does not depend on the times at which the
    !> procedure returns.
    subroutine advance_evolution(self, sim, limits, error, log)
      import :: error_t, event_log_t, evolution_t, limits_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      type(limits_t), intent(in) :: limits
      type(error_t), allocatable, intent(out) :: error
      type(event_log_t), intent(inout), optional :: log    !! log of the collisions; without this argument collisions are not logged
    end subroutine advance_evolution
  end interface

contains

  !> Whether a limit other than the time limit is reached. The function does not test the time limit, because events at exactly the
  !> time limit are still executed.
  pure function reached(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%events >= self%events .or. tally%collisions >= self%collisions .or. self%outgrown(tally)
  end function reached

  !> Whether a quantity that can change in any collision, such as the dissipated energy, has reached its limit. A quantity with a
  !> limit must never decrease during a run. A parallel run, which advances by time windows, detects only at the end of a window
  !> that a quantity has exceeded its limit. A parallel run then repeats the window to find the collision at which the limit was
  !> reached.
  pure function outgrown(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%total(dissipated) >= self%dissipated
  end function outgrown

  !> Whether the run has a limit on a quantity that can change in any collision, such as the dissipated energy.
  pure function watches(self) result(yes)
    class(limits_t), intent(in) :: self
    logical :: yes

    yes = self%dissipated < huge(self%dissipated)
  end function watches

  !> A warning about settings that are valid but rarely sensible with this dynamics; empty if there is nothing to report.
  pure function warning(self, sim) result(text)
    class(evolution_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
  end function warning

  !> The earliest time, not before `time`, at which the dynamics can pause for an action on all disks. Time-stepped dynamics can
  !> pause only between two steps.
  pure function pause_at(self, time) result(t)
    class(evolution_t), intent(in) :: self
    real(real64), intent(in) :: time              !! time since the start of the run
    real(real64) :: t                             !! time since the start of the run

    t = time
  end function pause_at

  !> Prepares the dynamics to continue after the caller has changed the state of some disks at the present time.
  subroutine renew(self, sim, changed)
    class(evolution_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)      !! indices of the changed disks

    call self%start(sim)
  end subroutine renew

end module evolution
