!> The part of the C interface `ricochet.h` for single events, copies of simulations, and positions
!> of disks.
module library_events
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t, c_ptr
  use changes, only: change_positions
  use errors, only: error_t, exit_usage, fail
  use event_log, only: event_log_t
  use evolution, only: evolution_t, limits_t
  use kinds, only: int32, int64, never, real64
  use library, only: advance_to, answer, begin, goal_of, renew_changed, session_of, session_t
  use moved_disks, only: check_positions
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use timeline, only: advance_once, next_action
  implicit none
  private

  !> Number of events and kicks after which `next_events` ends its search; increased by 100 for each
  !> requested event.
  integer(int64), parameter :: longest_look = 2000000

contains

  !> See ricochet.h.
  function copy(handle, message, room, code) bind(C, name="ricochet_copy") result(twin)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int), intent(out) :: code
    type(c_ptr) :: twin
    type(session_t), pointer :: session, other
    type(error_t), allocatable :: error

    session => session_of(handle)
    allocate (other)
    other%input = session%input
    other%sim = session%sim
    other%log = session%log
    twin = begin(other, 0_c_int, error)
    code = answer(error, message, room)
  end function copy

  !> See ricochet.h. Unless the input requests an event log, the log is emptied first.
  function advance_event(handle, time, collisions, events, patience, message, room) bind(C, name="ricochet_advance_event") &
    result(code)
    type(c_ptr), value :: handle
    real(c_double), value :: time, patience
    integer(c_int64_t), value :: collisions, events
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(stop_rule_t) :: rule
    type(error_t), allocatable :: error

    session => session_of(handle)
    rule = goal_of(session, time, collisions, events)
    rule%events = min(rule%events, session%sim%tally%events + 1)
    if (.not. session%input%settings%output%event_log) session%log%n = 0
    session%logged = .true.
    call advance_to(session, rule, patience, code, error)
    session%logged = session%input%settings%output%event_log
    if (allocated(error) .or. code == 0) code = answer(error, message, room)
  end function advance_event

  !> See ricochet.h.
  function last_events(handle, most, records) bind(C, name="ricochet_last_events") result(n)
    type(c_ptr), value :: handle
    integer(c_int), value :: most
    real(c_double), intent(inout) :: records(6, *)
    integer(c_int) :: n
    type(session_t), pointer :: session

    session => session_of(handle)
    n = min(max(most, 0), session%log%n)
    if (n > 0) records(:, :n) = session%log%record(:, session%log%n - n + 1:session%log%n)
  end function last_events

  !> See ricochet.h. The prediction advances a copy of the simulation, because other collisions or
  !> kicks may change the present velocities first.
  function next_events(handle, most, records) bind(C, name="ricochet_next_events") result(n)
    type(c_ptr), value :: handle
    integer(c_int), value :: most
    real(c_double), intent(inout) :: records(6, *)
    integer(c_int) :: n
    type(session_t), pointer :: session
    type(simulation_t) :: ahead
    class(evolution_t), allocatable :: evolution
    type(event_log_t) :: log
    type(limits_t) :: limits
    type(error_t), allocatable :: error
    integer(int64) :: looked

    session => session_of(handle)
    n = -1
    if (session%input%settings%run%dynamics == "steps") return
    ahead = session%sim
    allocate (evolution, source=session%evolution)
    call evolution%start(ahead)
    log%most = max(most, 0)
    looked = 0
    do while (log%n < most .and. looked < longest_look + 100_int64*most)
      limits%iterations = 1000
      call advance_once(evolution, ahead, limits, error, log)
      if (allocated(error) .or. (evolution%idle .and. .not. next_action(evolution, ahead) < never)) exit
      looked = looked + max(limits%iterations - evolution%iterations_left, int(ahead%n_disks(), int64))
    end do
    n = min(log%n, log%most)
    if (n > 0) records(:, :n) = log%record(:, :n)
  end function next_events

  !> See ricochet.h.
  function give_positions(handle, values, message, room) bind(C, name="ricochet_set_positions") result(code)
    type(c_ptr), value :: handle
    real(c_double), intent(in) :: values(*)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(simulation_t) :: changed
    type(error_t), allocatable :: error
    real(real64), allocatable :: x(:, :)              ! shape (2, n) [length]
    integer(int32) :: i

    session => session_of(handle)
    changed = session%sim
    x = reshape(values(:2*changed%n_disks()), [2, int(changed%n_disks())])
    do i = 1, changed%n_disks()                       ! positions of waiting disks have no effect
      if (.not. changed%is_inside(i)) x(:, changed%tag(i)%id) = changed%disk(i)%x
    end do
    if (changed%box%is_sheared()) then
      call fail(error, exit_usage, "position: cannot be set in a sheared box")
    else if (.not. all(abs(x) < huge(1_int32))) then
      call fail(error, exit_usage, "position: some values are NaN, infinite or far outside the box")
    else
      call change_positions(changed, x)
      call check_positions(changed, error)
    end if
    if (.not. allocated(error)) call renew_changed(session, changed, "position", error)
    code = answer(error, message, room)
  end function give_positions

end module library_events
