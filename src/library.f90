!> The C interface, documented in `ricochet.h`. A handle represents an open simulation. The
!> functions print nothing, never end the process, and share no data between handles.
module library
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_int64_t, c_loc, &
    c_null_char, c_null_ptr, c_ptr
  use changes, only: change_system, change_velocities, text_of_change
  use errors, only: error_t, exit_usage, fail
  use event_log, only: event_log_t
  use evolution, only: evolution_t, limits_t
  use initial_state, only: check_speeds
  use input_groups, only: group_t, most_written, same_value
  use input_problems, only: problem_list_t
  use kinds, only: int32, int64, never, real64
  use sample_numbers, only: sample_t
  use sample_values, only: frame_column_t, frame_columns, frame_sample
  use observables, only: observable_list_t, observed
  use run_input, only: changed_input, changes_nothing, fixed_variable, fold_changes, input_from_text, plan_changes
  use run_setup, only: choose_evolution, new_simulation, start_threads
  use settings, only: run_input_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use standstill, only: collapse_note, report_rest
  use stop_rules, only: coldness, stop_rule_t
  use system, only: seconds
  use team, only: make_team
  use texts, only: eol, growing_text_t, lines_of, text_t, written, written_exactly
  use timeline, only: adapted_iterations, advance_once
  use variable_help, only: input_of, quoted
  use variables, only: change_of, in_motion, obstacle_groups, row_of
  implicit none
  private
  public :: advance_to, answer, begin, check_files, goal_of, renew_changed, session_of, session_t, text_of

  integer(c_int), parameter :: going_on = 1          !! returned if no limit has been reached yet
  !> Number of events kept when a full log is shortened.
  integer, parameter :: least_logged = 1000000

  type :: session_t
    type(run_input_t) :: input
    type(simulation_t) :: sim
    class(evolution_t), allocatable :: evolution
    type(stop_rule_t) :: rule
    integer(int64) :: iterations = 1     !! number of iterations of the loop between two readings of the clock
    logical :: logged = .false.                       !! .true. if events are logged
    type(event_log_t) :: log      !! latest events; if the log is too long, the oldest are deleted
  end type session_t

contains

  !> See ricochet.h.
  function open_simulation(text, overrides, threads, message, room, code) bind(C, name="ricochet_open") result(handle)
    character(kind=c_char), intent(in) :: text(*), overrides(*)
    integer(c_int), value :: threads, room
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), intent(out) :: code
    type(c_ptr) :: handle
    type(session_t), pointer :: session
    type(status_line_t) :: silent
    type(error_t), allocatable :: error
    type(text_t), allocatable :: lines(:)

    allocate (session)
    call lines_of(text_of(overrides), lines)
    call input_from_text(text_of(text), "input", lines, session%input, error, stepped=.true.)
    if (.not. allocated(error)) call new_simulation(session%input, silent, session%sim, error)
    handle = begin(session, threads, error)
    code = answer(error, message, room)
  end function open_simulation

  !> Starts the engine of a new simulation and returns its handle. After an error, the simulation is
  !> deallocated.
  function begin(session, threads, error) result(handle)
    type(session_t), pointer, intent(inout) :: session
    !> Number of threads; 0 for the number in the input, which is one by default.
    integer(c_int), intent(in) :: threads
    type(error_t), allocatable, intent(in) :: error
    type(c_ptr) :: handle
    character(len=:), allocatable :: warning

    handle = c_null_ptr
    if (allocated(error)) then
      deallocate (session)
      return
    end if
    associate (wanted => session%input%settings%run%threads)
      if (threads > 0) wanted = threads
      wanted = max(wanted, 1)
    end associate
    call start_threads(session%input%settings, warning)
    call choose_evolution(session%input%settings, session%evolution)
    session%rule = session%input%settings%stop%applied_to(session%sim)
    session%logged = session%input%settings%output%event_log
    call session%evolution%start(session%sim)
    handle = c_loc(session)
  end function begin

  !> See ricochet.h.
  subroutine close_simulation(handle) bind(C, name="ricochet_close")
    type(c_ptr), value :: handle
    type(session_t), pointer :: session

    if (.not. c_associated(handle)) return
    session => session_of(handle)
    deallocate (session)
  end subroutine close_simulation

  !> See ricochet.h.
  function advance(handle, time, collisions, events, patience, message, room) bind(C, name="ricochet_advance") result(code)
    type(c_ptr), value :: handle
    real(c_double), value :: time, patience
    integer(c_int64_t), value :: collisions, events
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(error_t), allocatable :: error
    type(stop_rule_t) :: rule

    session => session_of(handle)
    rule = goal_of(session, time, collisions, events)
    call advance_to(session, rule, patience, code, error)
    if (code == 0) call report_rest(session%sim, rule%limits_t, error)
    if (allocated(error) .or. code /= going_on) code = answer(error, message, room)
  end function advance

  !> Converts the arguments of `advance` to a stop rule. Without any limit, the stop rule of the
  !> input applies.
  pure function goal_of(session, time, collisions, events) result(rule)
    type(session_t), intent(in) :: session
    real(real64), intent(in) :: time                  !! time since the start of the run [time]
    integer(int64), intent(in) :: collisions, events
    type(stop_rule_t) :: rule

    rule = session%rule
    if (.not. (time < never .or. ieee_is_nan(time) .or. min(collisions, events) < huge(events))) return
    rule%limits_t = limits_t(time=time, collisions=collisions, events=events, at_rest=rule%at_rest)
    if (time >= never) rule%time = never
  end function goal_of

  !> Advances a simulation until a stop rule is met, or until `patience` seconds have passed; `code`
  !> is then `going_on`.
  subroutine advance_to(session, rule, patience, code, error)
    type(session_t), intent(inout) :: session
    type(stop_rule_t), intent(in) :: rule
    real(real64), intent(in) :: patience              !! wall-clock time after which the procedure returns [s]
    integer(c_int), intent(out) :: code
    type(error_t), allocatable, intent(out) :: error
    type(limits_t) :: limits
    real(real64) :: began, looked                     ! start of the call and of the present step [s]

    code = going_on
    if (ieee_is_nan(rule%time)) then
      call fail(error, exit_usage, "time: NaN is not a time")
      return
    end if
    call make_team(session%input%settings%run%threads)
    began = seconds()
    do while (.not. rule%is_over(session%sim, session%evolution))
      looked = seconds()
      if (.not. looked - began <= patience) return
      limits = rule%limits_t
      limits%iterations = session%iterations
      if (session%logged) then
        call advance_once(session%evolution, session%sim, limits, error, session%log)
        call session%log%keep(least_logged)
      else
        call advance_once(session%evolution, session%sim, limits, error)
      end if
      if (allocated(error)) return
      session%iterations = adapted_iterations(session%iterations, seconds() - looked, session%evolution%iterations_left > 0)
    end do
    code = 0
  end subroutine advance_to

  !> See ricochet.h. The changed input replaces the stored input, on which later changes and saved
  !> files are based.
  function change(handle, overrides, message, room) bind(C, name="ricochet_change") result(code)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(in) :: overrides(*)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(run_input_t) :: before, input
    type(simulation_t) :: changed
    type(error_t), allocatable :: error
    type(text_t), allocatable :: lines(:)
    type(problem_list_t) :: problems
    character(len=:), allocatable :: problem
    integer :: k

    session => session_of(handle)
    call lines_of(text_of(overrides), lines)
    do k = 1, size(lines)
      if (fixed_variable(lines(k)%text) /= "" .and. .not. allocated(error)) &
        call fail(error, exit_usage, fixed_variable(lines(k)%text)//": cannot change in a running simulation")
    end do
    if (.not. allocated(error)) call input_in_force(session, before, error)
    if (.not. allocated(error)) then
      call changed_input(before, lines, session%sim%box, session%sim%now, input, problems, stepped=.true.)
      if (problems%count == 0) call plan_changes(input, problems, stepped=.true.)
      call problems%report(before%path, error, lines)
    end if
    if (.not. allocated(error)) call check_files(before%groups, input%groups, error)
    if (.not. allocated(error)) then
      code = 0
      if (changes_nothing(before, input, stepped=.true.)) return
      changed = session%sim
      call change_system(changed, input%settings%box, input%settings%system_t, problem)
      if (problem /= "") call fail(error, exit_usage, problem)
    end if
    if (.not. allocated(error)) call check_motion(changed, input%path, error)
    if (.not. allocated(error)) then
      input%text = input_of(input%given_groups)
      input%overrides = lines(:0)
      input%changes = changes_of(session)
      do k = 1, size(lines)
        input%changes = input%changes//written_exactly(session%sim%time())//" "//lines(k)%text//eol
      end do
      input%settings%run%threads = session%input%settings%run%threads
      session%input = input
      call take_schedule(input, changed)
      call renew(session, changed)
    end if
    code = answer(error, message, room)
  end function change

  !> See ricochet.h. The change is added to the text of the input as a group `&change`.
  function schedule(handle, time, overrides, message, room) bind(C, name="ricochet_schedule") result(code)
    type(c_ptr), value :: handle
    real(c_double), value :: time
    character(kind=c_char), intent(in) :: overrides(*)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(run_input_t) :: input
    type(simulation_t) :: changed
    type(error_t), allocatable :: error
    type(text_t), allocatable :: lines(:)
    character(len=:), allocatable :: text
    integer :: k

    session => session_of(handle)
    call lines_of(text_of(overrides), lines)
    text = session%input%text//eol//"&change time = "//written_exactly(time)//" set ="
    do k = 1, size(lines)
      text = text//" "//quoted(lines(k)%text)
    end do
    if (.not. time < never .or. session%sim%has_reached(time)) call fail(error, exit_usage, "time: "//written(time) &
      //" is not a time after the present time, "//written(session%sim%time()))
    if (.not. allocated(error)) call input_from_text(text//"/"//eol, session%input%path, session%input%overrides, input, error, &
      stepped=.true.)
    if (.not. allocated(error)) call check_files(session%input%groups, input%groups, error)
    if (.not. allocated(error)) then
      input%changes = session%input%changes
      input%settings%run%threads = session%input%settings%run%threads
      session%input = input
      changed = session%sim
      changed%features = input%settings%features
      call changed%fit_series()
      call changed%open_up()
      changed%schedule = input%settings%schedule
      call renew(session, changed)
    end if
    code = answer(error, message, room)
  end function schedule

  !> Input for the present system. In contrast to `session%input`, it includes the scheduled changes
  !> that have been made.
  subroutine input_in_force(session, input, error)
    type(session_t), intent(in) :: session
    type(run_input_t), intent(out) :: input
    type(error_t), allocatable, intent(out) :: error

    input = session%input
    if (session%sim%changes_made > 0) call fold_changes(input, session%sim%changes_made, session%sim%box, error)
  end subroutine input_in_force

  !> Replaces the scheduled changes of a simulation by the changes of an input. None of these
  !> changes has been made yet.
  subroutine take_schedule(input, sim)
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim

    sim%changes_made = 0
    if (allocated(sim%schedule)) deallocate (sim%schedule)
    if (allocated(input%settings%schedule)) sim%schedule = input%settings%schedule
  end subroutine take_schedule

  !> Reports an obstacle file or initial-configuration file that has changed since the simulation
  !> was created. Each change and each save reads the input again. If a file has changed, obstacles
  !> would jump in the running simulation, and the saved file would describe different disks.
  subroutine check_files(groups, again, error)
    type(group_t), intent(in) :: groups(:)            !! groups of the input of the simulation
    type(group_t), intent(in) :: again(:)             !! groups of the same input, just read again
    type(error_t), allocatable, intent(out) :: error
    integer :: g, k, old

    do g = 1, size(again)
      if (row_of(again(g)%name, "file") == 0) cycle
      if (.not. again(g)%given("file")) cycle
      old = findloc(groups%name == again(g)%name .and. groups%instance == again(g)%instance, .true., dim=1)
      do k = 1, size(again(g)%values)
        associate (name => trim(again(g)%name)//"."//trim(again(g)%instance)//".")
          if (change_of(name//trim(again(g)%values(k)%name)) == in_motion) cycle
          if (same_value(again(g)%values(k), groups(old)%values(k))) cycle
          call fail(error, exit_usage, name//"file: "//again(g)%text_of("file")//" has changed since the simulation was created (" &
            //name//trim(again(g)%values(k)%name)//" is different); restore the file")
          return
        end associate
      end do
    end do
  end subroutine check_files

  !> See ricochet.h.
  function give_velocities(handle, values, message, room) bind(C, name="ricochet_set_velocities") result(code)
    type(c_ptr), value :: handle
    real(c_double), intent(in) :: values(*)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), value :: room
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(simulation_t) :: changed
    type(error_t), allocatable :: error
    real(real64), allocatable :: v(:, :)              ! (2,n) [length/time]
    integer(int32) :: i

    session => session_of(handle)
    changed = session%sim
    v = reshape(values(:2*changed%n_disks()), [2, int(changed%n_disks())])
    do i = 1, changed%n_disks()                       ! velocities of waiting disks have no effect
      if (.not. changed%is_inside(i)) v(:, changed%tag(i)%id) = changed%velocity(i)
    end do
    if (.not. all(ieee_is_finite(v))) then
      call fail(error, exit_usage, "velocity: some values are NaN or infinite")
      code = answer(error, message, room)
      return
    end if
    code = 0
    if (all([(abs(v(:, changed%tag(i)%id) - changed%velocity(i)) <= 0, i=1, changed%n_disks())])) return
    call change_velocities(changed, v)
    call check_motion(changed, session%input%path, error)
    if (.not. allocated(error)) call renew_changed(session, changed, "velocity", error)
    code = answer(error, message, room)
  end function give_velocities

  !> Text with all changes of the simulation so far.
  function changes_of(session) result(list)
    type(session_t), intent(in) :: session
    character(len=:), allocatable :: list
    integer :: k

    list = ""
    if (allocated(session%input%changes)) list = session%input%changes
    do k = 1, int(session%sim%changes_made)
      list = list//text_of_change(session%sim%schedule(k))
    end do
  end function changes_of

  !> Reports speeds and energies that are out of range after a change.
  subroutine check_motion(sim, path, error)
    type(simulation_t), intent(in) :: sim
    character(len=*), intent(in) :: path              !! path of the input
    type(error_t), allocatable, intent(out) :: error
    type(problem_list_t) :: problems

    call check_speeds(sim, problems)
    call problems%report(path, error)
  end subroutine check_motion

  !> Replaces the state of the simulation by a changed state, and adds the change to the list of
  !> changes.
  subroutine renew_changed(session, sim, what, error)
    type(session_t), intent(inout) :: session
    type(simulation_t), intent(inout) :: sim
    character(len=*), intent(in) :: what              !! name of the changed quantity
    type(error_t), allocatable, intent(out) :: error
    type(run_input_t) :: input

    call input_in_force(session, input, error)
    if (allocated(error)) return
    input%changes = changes_of(session)//written_exactly(sim%time())//" "//what//eol
    session%input = input
    call take_schedule(input, sim)
    call renew(session, sim)
  end subroutine renew_changed

  !> Replaces the state of the simulation by a changed state.
  subroutine renew(session, sim)
    type(session_t), intent(inout) :: session
    type(simulation_t), intent(in) :: sim

    session%sim = sim
    session%rule = session%input%settings%stop%applied_to(session%sim)
    call choose_evolution(session%input%settings, session%evolution)
    call session%evolution%start(session%sim)
  end subroutine renew

  !> See ricochet.h.
  function time_of(handle) bind(C, name="ricochet_time") result(time)
    type(c_ptr), value :: handle
    real(c_double) :: time
    type(session_t), pointer :: session

    session => session_of(handle)
    time = session%sim%time()
  end function time_of

  !> See ricochet.h.
  subroutine count_all(handle, counts) bind(C, name="ricochet_count")
    type(c_ptr), value :: handle
    integer(c_int64_t), intent(out) :: counts(3)
    type(session_t), pointer :: session

    session => session_of(handle)
    counts = [int(session%sim%n_disks(), int64), session%sim%tally%collisions, session%sim%tally%events]
  end subroutine count_all

  !> See ricochet.h.
  function copy_column(handle, name, values) bind(C, name="ricochet_column") result(width)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(in) :: name(*)
    real(c_double), intent(inout) :: values(*)
    integer(c_int) :: width
    type(session_t), pointer :: session
    type(sample_t) :: sample
    type(frame_column_t), allocatable :: list(:)
    integer :: n

    session => session_of(handle)
    associate (sim => session%sim)
      n = sim%n_disks()
      width = 1
      select case (text_of(name))
      case ("radius")
        values(sim%tag%id) = sim%disk%radius
      case ("mass")
        values(sim%tag%id) = sim%masses()
      case ("species")
        values(sim%tag%id) = sim%tag%species
      case default
        width = 0
      end select
      if (width > 0) return
      call make_team(session%input%settings%run%threads)
      list = frame_columns(sim, sim%box%periodic)
      list = pack(list, list%name == text_of(name))
      if (size(list) == 0) return
      width = list(1)%width
      sample = frame_sample(sim, 0_int64, list)
      ! The first integer of a sample is the step, the first real is the time.
      if (list(1)%is_count) then
        values(:width*n) = real(sample%integers(2:, 1), real64)
      else
        values(:width*n) = sample%reals(2:, 1)
      end if
    end associate
  end function copy_column

  !> See ricochet.h.
  function copy_observables(handle, names, room, values) bind(C, name="ricochet_observables") result(length)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(inout) :: names(*)
    integer(c_int), value :: room
    real(c_double), intent(inout) :: values(*)
    integer(c_int) :: length
    type(session_t), pointer :: session
    type(observable_list_t) :: list
    character(len=:), allocatable :: text
    integer :: k

    session => session_of(handle)
    list = observed(session%sim)
    text = ""
    do k = 1, list%n
      text = text//trim(list%row(k)%name)//" "//written(merge(-1, 1, list%row(k)%is_count)*list%row(k)%width)//eol
    end do
    length = len(text)
    if (room <= length) return
    call give(text, names, room)
    associate (now => list%values())
      values(:size(now)) = now
    end associate
  end function copy_observables

  !> See ricochet.h.
  function copy_text(handle, what, text, room) bind(C, name="ricochet_text") result(length)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(in) :: what(*)
    character(kind=c_char), intent(inout) :: text(*)
    integer(c_int), value :: room
    integer(c_int) :: length
    type(session_t), pointer :: session
    type(run_input_t) :: input
    type(error_t), allocatable :: error
    character(len=:), allocatable :: words

    session => session_of(handle)
    if (session%sim%changes_made > 0 .and. any(text_of(what) == ["input     ", "parameters"])) &
      call input_in_force(session, input, error)
    if (allocated(input%groups)) then
      words = described(session, input, text_of(what))
    else
      words = described(session, session%input, text_of(what))
    end if
    length = len(words)
    if (room > length) call give(words, text, room)
  end function copy_text

  !> Text that describes the simulation; see ricochet.h.
  function described(session, input, what) result(text)
    type(session_t), intent(in) :: session
    type(run_input_t), intent(in) :: input            !! input for the present system
    character(len=*), intent(in) :: what
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: g, k, most

    select case (what)
    case ("input", "saved input")
      call growing%add(input_of(input%given_groups))
    case ("parameters")
      do g = 1, size(input%groups)
        associate (group => input%groups(g))
          do k = 1, size(group%values)
            if (.not. group%values(k)%is_set()) cycle
            most = most_written
            ! Obstacles are written with all values. The text would otherwise not describe obstacles
            ! that were read from a file.
            if (any(obstacle_groups == group%name)) most = huge(most)
            call growing%add(group%value_line(k, most)//eol)
          end do
        end associate
      end do
    case ("changes")
      call growing%add(changes_of(session))
    case default
      call growing%add(collapse_note(session%sim))
      if (session%rule%too_cold(session%sim)) call growing%add(trim(merge("; ", "  ", growing%text() /= ""))//coldness)
    end select
    text = growing%text()
  end function described

  !> The simulation of a handle.
  function session_of(handle) result(session)
    type(c_ptr), intent(in) :: handle
    type(session_t), pointer :: session

    call c_f_pointer(handle, session)
  end function session_of

  !> Copies an error message to a C buffer and returns the exit code; 0 without an error.
  function answer(error, message, room) result(code)
    type(error_t), allocatable, intent(in) :: error
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), intent(in) :: room
    integer(c_int) :: code

    code = 0
    call give("", message, room)
    if (.not. allocated(error)) return
    code = error%code
    call give(error%message, message, room)
  end function answer

  !> Copies a string to a C buffer; a string that does not fit is truncated.
  subroutine give(text, buffer, room)
    character(len=*), intent(in) :: text
    character(kind=c_char), intent(inout) :: buffer(*)
    integer(c_int), intent(in) :: room      !! size of the buffer, including the terminating zero [bytes]
    integer :: k

    if (room < 1) return
    do k = 1, min(len(text), room - 1)
      buffer(k) = text(k:k)
    end do
    buffer(min(len(text), room - 1) + 1) = c_null_char
  end subroutine give

  !> Converts a C string to a Fortran string.
  function text_of(bytes) result(text)
    character(kind=c_char), intent(in) :: bytes(*)
    character(len=:), allocatable :: text
    integer :: k, n

    n = 0
    do while (bytes(n + 1) /= c_null_char)
      n = n + 1
    end do
    allocate (character(len=n) :: text)
    do k = 1, n
      text(k:k) = bytes(k)
    end do
  end function text_of

end module library
