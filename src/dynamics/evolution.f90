!> Abstract type of all dynamics (event-driven, time-stepped, parallel), as used by the timeline.
module evolution
  use kinds, only: int32, int64, never, real64, unlimited
  use entries, only: awaits_entry
  use errors, only: error_t
  use event_log, only: event_log_t
  use rest, only: is_at_rest
  use simulation_state, only: simulation_t
  use tally, only: dissipated, tally_t
  implicit none
  private
  public :: evolution_t, limits_t

  !> Limits at which the dynamics returns to its caller, whichever is reached first. The default
  !> values are never reached.
  type :: limits_t
    !> Limit of the simulation time, measured from the start of the run or, in the procedures of
    !> `evolution_t`, from the time origin `box%epoch` [time].
    real(real64) :: time = never
    integer(int64) :: collisions = unlimited
    integer(int64) :: events = unlimited
    real(real64) :: dissipated = huge(0.0_real64)        !! dissipated energy [energy]
    logical :: at_rest = .false.      !! whether the dynamics returns when all disks are at rest
    !> Number of disks in the box at which the dynamics returns after a departure; -1 for no limit.
    integer(int64) :: disks_inside = -1
    !> Number of iterations of the event loop after which the dynamics returns, so that the caller
    !> can check signals and the wall clock.
    integer(int64) :: iterations = unlimited
    !> Time of the latest sample; the run does not end earlier [time].
    real(real64) :: sampled = 0.0_real64
  contains
    procedure :: reached
    procedure :: outgrown
    procedure :: watches
    procedure :: rests
  end type limits_t

  type, abstract :: evolution_t
    logical :: idle = .false.     !! whether no event will ever occur again
    !> Whether `advance` has executed all events up to its time limit.
    logical :: arrived = .false.
    !> Allowed iterations not used by the last call of `advance`.
    integer(int64) :: iterations_left = 0
    integer(int64) :: serial_events = 0    !! events executed by the serial engine of a parallel run
    !> Disk and partner of the last executed event. At the time limit, disk and partner of the first
    !> event after the limit.
    integer(int32) :: last_event(2) = 0
  contains
    procedure :: warning
    procedure :: pause_at
    procedure :: renew
    procedure(start_evolution), deferred :: start
    procedure(advance_evolution), deferred :: advance
  end type evolution_t

  abstract interface
    !> Prepares the dynamics for continuing from the state `sim`, which is the initial state or the
    !> state of a checkpoint. All data of the dynamics that are not part of the state are derived
    !> from it.
    subroutine start_evolution(self, sim)
      import :: evolution_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
    end subroutine start_evolution

    !> Advances the simulation until a limit is reached or the log is full. The trajectory does not
    !> depend on when the procedure returns.
    subroutine advance_evolution(self, sim, limits, error, log)
      import :: error_t, event_log_t, evolution_t, limits_t, simulation_t
      class(evolution_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      type(limits_t), intent(in) :: limits
      type(error_t), allocatable, intent(out) :: error
      !> Log of the collisions; without it, collisions are not logged.
      type(event_log_t), intent(inout), optional :: log
    end subroutine advance_evolution
  end interface

contains

  !> True if a limit other than the time limit is reached. The time limit is not tested, because
  !> events at exactly this time are still executed.
  pure function reached(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%events >= self%events .or. tally%collisions >= self%collisions .or. self%outgrown(tally)
    if (self%disks_inside >= 0) yes = yes .or. tally%has_at_most(self%disks_inside)
  end function reached

  !> True if a quantity such as the dissipated energy, which can change in any collision, has
  !> reached its limit. Such a quantity must never decrease during a run. A parallel run detects
  !> only at the end of a time window that a limit was exceeded. It then repeats the window to find
  !> the collision at which the limit was reached.
  pure function outgrown(self, tally) result(yes)
    class(limits_t), intent(in) :: self
    type(tally_t), intent(in) :: tally
    logical :: yes

    yes = tally%total(dissipated) >= self%dissipated
  end function outgrown

  !> True if the run limits a quantity such as the dissipated energy, which can change in any
  !> collision.
  pure function watches(self) result(yes)
    class(limits_t), intent(in) :: self
    logical :: yes

    yes = self%dissipated < huge(self%dissipated)
  end function watches

  !> True if the disks are at rest and this ends the run. The test is needed without gravity,
  !> because disks at rest then have no events. No epoch ends, and the test at the end of an epoch
  !> is never made.
  pure function rests(self, sim) result(yes)
    class(limits_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%at_rest .and. .not. awaits_entry(sim)
    if (yes) yes = is_at_rest(sim)
  end function rests

  !> Warning about settings that are valid but rarely sensible with this dynamics; empty if there
  !> are none.
  pure function warning(self, sim) result(text)
    class(evolution_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
  end function warning

  !> Earliest time, not before `time`, at which the dynamics can pause for an action on all disks.
  !> Time-stepped dynamics pauses only between steps.
  pure function pause_at(self, time) result(t)
    class(evolution_t), intent(in) :: self
    real(real64), intent(in) :: time              !! since the start of the run [time]
    real(real64) :: t                             !! since the start of the run [time]

    t = time
  end function pause_at

  !> Prepares the dynamics for continuing after the caller has changed the state of some disks at
  !> the present time.
  subroutine renew(self, sim, changed)
    class(evolution_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)      !! indices of the changed disks

    call self%start(sim)
  end subroutine renew

end module evolution
