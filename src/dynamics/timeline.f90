!> Executes the actions that affect all disks at once, in a fixed order. At equal times, collisions
!> come first. Scheduled changes, entries of disks and kicks follow in this order, and finally the
!> actions of the caller (samples, end of the run). The time origin moves at the end of an epoch,
!> when no other action is in progress.
module timeline
  use changes, only: make_scheduled_change
  use entries, only: entry_time, let_disks_enter
  use epochs, only: are_crushed, ends_by_event, ends_by_kick, last_time, most_events, move_epoch
  use errors, only: error_t, exit_broken, fail
  use event_log, only: event_log_t, is_full
  use evolution, only: evolution_t, limits_t
  use kinds, only: int32, int64, never, real64
  use rest, only: has_come_to_rest, is_at_rest, last_encounter, stands_still
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use standstill, only: fail_at_standstill
  use texts, only: about
  implicit none
  private
  public :: adapted_iterations, advance, advance_once, next_action

  !> Intended wall-clock time between two checks of signals and of the clock [s].
  real(real64), parameter :: pause_interval = 0.05_real64

contains

  !> Advances the simulation until a limit is reached, or until no further event can occur.
  subroutine advance(evolution, sim, limits, error, log)
    class(evolution_t), intent(inout) :: evolution
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log

    do while (.not. (limits%reached(sim%tally) .or. sim%has_reached(limits%time) .or. is_full(log)))
      call advance_once(evolution, sim, limits, error, log)
      if (allocated(error)) return
      if (evolution%idle) then
        if (limits%rests(sim) .or. .not. limits%time < never) return
      end if
      if (stop_requested()) return
    end do
  end subroutine advance

  !> Advances the simulation until a limit is reached, a change, an entry or a kick is due, a disk
  !> leaves the box, or the epoch ends. Then executes the due action or starts the next epoch. The
  !> trajectory does not depend on when the procedure returns.
  subroutine advance_once(evolution, sim, limits, error, log)
    class(evolution_t), intent(inout) :: evolution
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    type(limits_t) :: goal
    real(real64) :: due, until, source_time, kick_time, before     ! [time]
    integer(int64) :: events
    integer(int32), allocatable :: kicked(:)
    logical :: arrived, changed, epoch_is_over, by_event

    events = sim%tally%events
    before = sim%time()
    source_time = next_entry(evolution, sim)
    kick_time = next_kick(evolution, sim)
    due = min(limits%time, next_action(evolution, sim))
    goal = limits
    until = due - sim%box%epoch
    ! rounding up ensures that `due` is reached
    if (sim%box%epoch + until < due) until = nearest(until, 1.0_real64)
    goal%time = until
    by_event = .false.
    if (sim%epoch_end > 0) then                    ! time-stepped dynamics has no epochs
      by_event = ends_by_event(sim)
      goal%time = min(goal%time, sim%epoch_end)
      goal%events = min(goal%events, merge(events + 1, most_events(sim), by_event))
    end if
    call evolution%advance(sim, goal, error, log)
    arrived = evolution%arrived
    if (sim%epoch_end > 0 .and. .not. allocated(error)) then
      by_event = by_event .and. sim%tally%events > events
      epoch_is_over = by_event .or. sim%tally%events >= most_events(sim)
      if (arrived .and. evolution%idle) then
        call wait()
      else if (arrived .and. until > sim%epoch_end) then
        epoch_is_over = .true.
        arrived = .false.                          ! stopped at the end of the epoch, before the intended time
      end if
      if (epoch_is_over) call end_epoch()
    end if
    changed = .false.
    if (arrived) call make_changes(evolution, sim, changed, error)
    arrived = arrived .and. .not. changed
    do while (arrived .and. sim%time() >= source_time .and. next_entry(evolution, sim) <= source_time)
      call let_disks_enter(sim, next_source(evolution, sim), kicked)
      call continue_with(kicked, .true.)
    end do
    do while (arrived .and. sim%time() >= kick_time .and. next_kick(evolution, sim) <= kick_time)
      sim%n_kicks = sim%n_kicks + 1
      call sim%drive%kick(sim, kicked)
      call continue_with(kicked, sim%drive%moves_disks())
    end do
    sim%events_done = arrived .or. &
      (sim%events_done .and. sim%tally%events == events .and. .not. (sim%time() > before .or. changed))
  contains

    !> Continues after a change of the velocities of some disks and, if `moved`, of their positions.
    subroutine continue_with(disks, moved)
      integer(int32), intent(in) :: disks(:)         !! indices of the changed disks
      logical, intent(in) :: moved

      if (ends_by_kick(sim, disks)) then
        call move_epoch(sim, .true.)
        call evolution%start(sim)
      else if (.not. moved) then
        call evolution%renew(sim, disks)
      else if (size(disks) > 0) then
        call evolution%start(sim)
      end if
    end subroutine continue_with

    !> If no further event can occur, advances the time to the next action or, without one or if the
    !> disks have come to rest, to the last collision or sample.
    subroutine wait()
      if (due < last_time .and. .not. limits%rests(sim)) then
        sim%now = max(sim%now, until)
      else      ! a stale event or the end of an epoch may have advanced the time
        sim%now = max(maxval(sim%disk%clock), limits%sampled - sim%box%epoch)
      end if
    end subroutine wait

    !> Starts the next epoch. If the disks are crushed or events no longer advance the time, this is
    !> reported instead.
    subroutine end_epoch()
      if (are_crushed(sim)) then
        call fail(error, exit_broken, "side.end_time: the side crushes the disks, whose energy has grown a million times; " &
          //"choose a time before "//about(sim%time()))
      else if (stands_still(sim) .or. has_come_to_rest(sim)) then
        if (limits%at_rest .and. is_at_rest(sim)) return
        call fail_at_standstill(sim, merge(last_encounter(sim), evolution%last_event, is_at_rest(sim)), error)
      else
        call move_epoch(sim, by_event)
        call evolution%start(sim)
      end if
    end subroutine end_epoch
  end subroutine advance_once

  !> Number of iterations of the event loop that take about the wall-clock time `pause_interval`.
  !> The number is increased only after a call that used all its iterations. It is not increased
  !> after calls that reach a limit early. Otherwise it would grow without bound in a run with many
  !> samples, and signals would remain unchecked for hours after the last sample.
  pure function adapted_iterations(iterations, elapsed, cut_short) result(n)
    integer(int64), intent(in) :: iterations
    real(real64), intent(in) :: elapsed               !! wall-clock time of the iterations [s]
    logical, intent(in) :: cut_short      !! whether a limit was reached before all iterations were used
    integer(int64) :: n

    n = iterations
    if (elapsed < 0.5_real64*pause_interval .and. .not. cut_short) n = min(2*iterations, 2_int64**40)
    if (elapsed > 2*pause_interval) n = max(iterations/2, 1_int64)
  end function adapted_iterations

  !> Makes the changes that are due. Further events can then occur at the present time, before any
  !> other action. A kick at the present time follows the changes, unless it has already been
  !> applied.
  subroutine make_changes(evolution, sim, changed, error)
    class(evolution_t), intent(inout) :: evolution
    type(simulation_t), intent(inout) :: sim
    logical, intent(out) :: changed
    type(error_t), allocatable, intent(inout) :: error
    logical :: kicked

    changed = .false.
    kicked = has_kicked(evolution, sim)
    do while (sim%time() >= next_change(evolution, sim) .and. .not. allocated(error))
      call make_scheduled_change(sim, error)
      changed = .true.
    end do
    if (.not. changed) return
    ! `change_system` has counted the kicks up to the present time
    do while (has_kicked(evolution, sim) .and. .not. kicked)
      sim%n_kicks = sim%n_kicks - 1
    end do
    call evolution%start(sim)
  end subroutine make_changes

  !> True if the last kick was at the present time.
  pure function has_kicked(evolution, sim) result(yes)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = allocated(sim%drive) .and. sim%n_kicks > 0
    if (yes) yes = evolution%pause_at(sim%kick_time(sim%n_kicks)) >= sim%time()
  end function has_kicked

  !> Time of the next scheduled change, entry or kick.
  pure function next_action(evolution, sim) result(t)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    real(real64) :: t      !! time since the start of the run; `never` without such an action

    t = min(next_change(evolution, sim), next_entry(evolution, sim), next_kick(evolution, sim))
  end function next_action

  !> Time of the next scheduled change, made after all collisions and before all other actions at
  !> the same time.
  pure function next_change(evolution, sim) result(t)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    real(real64) :: t      !! time since the start of the run; `never` without a change

    t = never
    if (.not. allocated(sim%schedule)) return
    if (sim%changes_made < size(sim%schedule)) t = evolution%pause_at(sim%schedule(sim%changes_made + 1)%time)
  end function next_change

  !> Time when a source acts next.
  pure function next_entry(evolution, sim) result(t)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    real(real64) :: t      !! time since the start of the run; `never` without a source
    integer :: s

    t = never
    s = next_source(evolution, sim)
    if (s > 0) t = evolution%pause_at(entry_time(sim, s))
  end function next_entry

  !> Index of the source that acts next; 0 if no source will act any more. Of several sources that
  !> act at the same time, the first in the file is chosen. With time steps, all sources due within
  !> a step act at its end, in the order of the file.
  pure function next_source(evolution, sim) result(next)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    integer :: next, s
    real(real64) :: t, earliest                    ! [time]

    next = 0
    if (.not. allocated(sim%source)) return
    earliest = never
    do s = 1, size(sim%source)
      t = entry_time(sim, s)
      if (t < never) t = evolution%pause_at(t)
      if (.not. t < earliest) cycle
      earliest = t
      next = s
    end do
  end function next_source

  !> Time of the next kick, applied after all collisions and before samples at the same time.
  pure function next_kick(evolution, sim) result(t)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    real(real64) :: t                              !! time since the start of the run; `never` without kicks

    t = evolution%pause_at(sim%kick_time(sim%n_kicks + 1))
    if (evolution%idle .and. allocated(sim%drive)) then
      if (.not. sim%drive%can_act(sim)) t = never
    end if
  end function next_kick

end module timeline
