!> Reads and checks the input of a run, and plans the changes of the system during the run
!> (`&change`). Each change, scheduled or made in a simulation in memory, replaces some values in a
!> copy of the given groups. The copy is converted to settings like the groups of an input file.
module run_input
  use box_state, only: box_state_t
  use changes, only: missing_data
  use errors, only: error_t
  use input_fit, only: check_fit, complete_settings
  use input_groups, only: group_t, range_of, same_values
  use input_problems, only: problem_list_t
  use input_settings, only: check_interval, resolve_settings
  use input_surfaces, only: put_positions
  use input_text, only: read_text
  use kinds, only: int64, real64
  use namelist_input, only: override_groups, read_groups
  use settings, only: run_input_t, settings_t
  use side_motion, only: side_state_t
  use simulation_state, only: change_t
  use system, only: print_text
  use texts, only: digits, letters, lower_case, shown, text_t, written
  use variable_help, only: groups_text, input_of
  use variables, only: change_of, in_motion, row_of, table, words_of
  implicit none
  private
  public :: changed_input, changes_nothing, fixed_variable, fold_changes, input_from_text, plan_changes, read_input

contains

  !> Reads the input file `path`, applies the overrides and checks the result. With `printed`, all
  !> readable parts of the input are printed, even if the input is invalid.
  subroutine read_input(path, overrides, input, error, printed)
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE for each override
    type(run_input_t), intent(out) :: input
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: printed
    character(len=:), allocatable :: text

    call read_text(path, text, error)
    if (.not. allocated(error)) call input_from_text(text, path, overrides, input, error, printed)
  end subroutine read_input

  !> Version of `read_input` for a text instead of a file; `path` appears only in messages. All
  !> problems are collected in one error.
  subroutine input_from_text(text, path, overrides, input, error, printed, stepped)
    character(len=*), intent(in) :: text
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)
    type(run_input_t), intent(out) :: input
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: printed
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    type(problem_list_t) :: problems
    logical :: complete

    input%path = path
    input%text = text
    input%overrides = overrides
    call read_groups(text, overrides, input%given_groups, problems, complete)
    if (present(printed)) call print_text(groups_text(input%given_groups), error)
    if (allocated(error)) return
    call resolve_input(input, complete, problems, stepped)
    if (problems%count == 0) call plan_changes(input, problems, stepped)
    call problems%report(path, error, overrides)
  end subroutine input_from_text

  !> Converts the groups of an input to settings. With `box` and `t`, the input changes a running
  !> simulation.
  subroutine resolve_input(input, complete, problems, stepped, box, t)
    type(run_input_t), intent(inout) :: input
    logical, intent(inout) :: complete      !! .false. if part of the text could not be read
    type(problem_list_t), intent(inout) :: problems                 !! further problems are added to the list
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    type(box_state_t), intent(in), optional :: box                  !! see `take_wall_laws`
    real(real64), intent(in), optional :: t                         !! see `take_wall_laws`

    input%groups = input%given_groups
    if (.not. complete) return  ! variables in unreadable parts of the text are not missing
    call resolve_settings(input%groups, input%settings, problems, stepped, box, t)
    call complete_settings(input%settings, input%groups, problems, complete)
    if (complete) call check_fit(input%settings, input%groups, problems, present(box))
  end subroutine resolve_input

  !> Determines the system after each change in the input, and reports impossible changes.
  subroutine plan_changes(input, problems, stepped)
    type(run_input_t), intent(inout) :: input
    type(problem_list_t), intent(inout) :: problems
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    type(run_input_t) :: present_input
    integer, allocatable :: order(:)                                ! indices of the groups, sorted by time
    integer :: k

    if (allocated(input%settings%schedule)) deallocate (input%settings%schedule)
    call order_changes(input%groups, order, problems)
    if (size(order) == 0 .or. problems%count > 0) return
    present_input = input
    allocate (input%settings%schedule(size(order)))
    do k = 1, size(order)
      call plan_change(present_input, input%groups(order(k)), input%settings%schedule(k), problems, stepped)
    end do
    if (problems%count > 0) return
    do k = 1, size(order)
      call input%settings%features%unite(input%settings%schedule(k)%system%features)
    end do
    do k = 1, size(order)
      input%settings%schedule(k)%system%features = input%settings%features
    end do
  end subroutine plan_changes

  !> Sorts the changes by time; simultaneous changes stay in the order of the file. Incomplete
  !> changes, and names that are invalid or used twice, are reported.
  subroutine order_changes(groups, order, problems)
    type(group_t), intent(in) :: groups(:)
    integer, allocatable, intent(out) :: order(:)
    type(problem_list_t), intent(inout) :: problems
    integer, parameter :: longest_name = 40
    character(len=:), allocatable :: name
    real(real64) :: time
    integer :: range(2), j, k

    range = range_of(groups, ["change"])
    allocate (order(0))
    do k = range(1), range(2)
      name = trim(groups(k)%instance)
      associate (group => groups(k))
        call group%demand("time", problems)
        call group%demand("set", problems)
        if (verify(name, letters//digits//"_-") > 0 .or. len(name) > longest_name) call group%complain("name", shown(name) &
          //" is not a name; allowed: up to "//written(longest_name)//" letters, digits, _ and -", problems)
        if (any(groups(range(1):k - 1)%instance == name)) call group%complain("name", "a second change is called "//shown(name), &
          problems)
        time = group%real_of("time", 0.0_real64)
      end associate
      do j = size(order), 1, -1
        if (groups(order(j))%real_of("time", 0.0_real64) <= time) exit
      end do
      order = [order(:j), k, order(j + 1:)]
    end do
  end subroutine order_changes

  !> Determines the system after a change.
  subroutine plan_change(before, group, change, problems, stepped)
    type(run_input_t), intent(inout) :: before      !! input before the change; on return, after the change
    type(group_t), intent(in) :: group                              !! group of the change
    type(change_t), intent(out) :: change
    type(problem_list_t), intent(inout) :: problems
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    type(run_input_t) :: after
    type(problem_list_t) :: own
    character(len=:), allocatable :: problem
    integer :: k, line

    associate (slot => group%values(row_of("change", "set")))
      line = merge(group%line, slot%line, slot%line <= 0)
      change%lines = [(text_t(trim(adjustl(slot%texts(k)))), k=1, size(slot%texts))]
    end associate
    change%name = trim(group%instance)
    change%time = group%real_of("time", 0.0_real64)
    change%origin = before%path//":"//written(line)//": change."//change%name
    do k = 1, size(change%lines)
      if (fixed_variable(change%lines(k)%text) /= "") &
        call own%add(0, fixed_variable(change%lines(k)%text), "cannot change in a running simulation")
    end do
    if (own%count == 0) &
      call changed_input(before, change%lines, foreseen_box(before, change%time), change%time, after, own, stepped)
    if (own%count == 0) then
      problem = missing_data(before%settings%system_t, after%settings%system_t)
      if (problem /= "") call own%add(0, "set", problem)
    end if
    do k = 1, own%count
      call problems%add(group%values(row_of("change", "set"))%line, "change."//change%name, own%items(k)%text)
    end do
    if (own%count > 0) return
    change%is_empty = changes_nothing(before, after, stepped)
    change%system = after%settings%system_t
    change%box = after%settings%box
    deallocate (change%box%obstacle)
    before = after
  end subroutine plan_change

  !> The box of an input at the time t since the start. The position of a piston is not known in
  !> advance and is assumed to be at the edge of the box.
  pure function foreseen_box(input, t) result(box)
    type(run_input_t), intent(in) :: input
    real(real64), intent(in) :: t           !! [time]
    type(box_state_t) :: box

    box%box_t = input%settings%box
    box%piston = side_state_t(clock=t)
  end function foreseen_box

  !> Changes values of an input. A side with a new motion starts it at its present position.
  subroutine changed_input(before, lines, box, t, after, problems, stepped)
    type(run_input_t), intent(in) :: before
    type(text_t), intent(in) :: lines(:)      !! changes of the form GROUP.VARIABLE=VALUE
    type(box_state_t), intent(in) :: box                            !! box before the change
    real(real64), intent(in) :: t                                   !! time relative to `box%epoch` [time]
    type(run_input_t), intent(out) :: after
    type(problem_list_t), intent(inout) :: problems
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    logical :: complete

    after%path = before%path
    after%overrides = lines
    after%given_groups = before%given_groups
    call override_groups(after%given_groups, lines, problems, complete)
    call drop_former_motion(before%given_groups, after%given_groups)
    call resolve_input(after, complete, problems, stepped, box, t)
    if (problems%count > 0) return
    call put_positions(after%given_groups, after%settings%box)
    call put_positions(after%groups, after%settings%box)
    call check_entries(after, box%epoch + t, problems)
  end subroutine changed_input

  !> Reports a source whose interval is too short, because its entries up to the time of a change
  !> cannot be counted exactly. The check of the input tests only times that are known without a
  !> change.
  subroutine check_entries(input, t, problems)
    type(run_input_t), intent(in) :: input
    real(real64), intent(in) :: t                                   !! time since the start [time]
    type(problem_list_t), intent(inout) :: problems
    integer :: range(2), k

    range = range_of(input%groups, ["source"])
    do k = 1, range(2) - range(1) + 1
      associate (source => input%settings%source(k), group => input%groups(range(1) + k - 1))
        if (source%end_time >= t) call check_interval(source, group, t, "this change", problems)
      end associate
    end do
  end subroutine check_entries

  !> Replaces an input by the input for the system after the first scheduled changes, which are then
  !> no longer scheduled.
  subroutine fold_changes(input, made, box, error)
    type(run_input_t), intent(inout) :: input
    integer(int64), intent(in) :: made                              !! number of changes
    type(box_state_t), intent(in) :: box                            !! present box
    type(error_t), allocatable, intent(out) :: error
    type(run_input_t) :: before, after
    type(problem_list_t) :: problems
    integer :: k

    after = input
    do k = 1, int(made)
      before = after
      associate (change => input%settings%schedule(k))
        call changed_input(before, change%lines, foreseen_box(before, change%time), change%time, after, problems, stepped=.true.)
      end associate
    end do
    call fold(after%given_groups)
    call fold(after%groups)
    after%text = input_of(after%given_groups)
    deallocate (after%overrides)
    allocate (after%overrides(0))
    after%settings%run%threads = input%settings%run%threads
    if (problems%count == 0) call plan_changes(after, problems, stepped=.true.)
    call problems%report(input%path, error)
    if (.not. allocated(error)) input = after
  contains

    !> Moves the sides of an input to their present positions, and removes the changes made.
    subroutine fold(groups)
      type(group_t), allocatable, intent(inout) :: groups(:)
      logical :: left(size(groups))
      integer :: g, v

      call put_positions(groups, box%box_t)
      v = row_of("change", "name")
      left = .true.
      do g = 1, size(groups)
        if (groups(g)%name /= "change") cycle
        left(g) = .not. any([(input%settings%schedule(k)%name == groups(g)%instance, k=1, int(made))])
        groups(g)%values(v)%given = .true.      ! the number of a change may differ from its name
      end do
      groups = pack(groups, left)
    end subroutine fold
  end subroutine fold_changes

  !> Name of the variable of a change that must not change in a running simulation; empty if it may.
  !> Unknown variables are reported by `read_groups` instead.
  pure function fixed_variable(line) result(name)
    character(len=*), intent(in) :: line              !! change of the form GROUP.VARIABLE=VALUE
    character(len=:), allocatable :: name, plain

    name = ""
    plain = lower_case(trim(adjustl(line(:index(line, "=") - 1))))
    plain = plain(:index(plain//"(", "(") - 1)        ! box.gravity(2) becomes box.gravity
    if (row_of(plain(:index(plain, ".") - 1), plain(index(plain, ".", back=.true.) + 1:)) == 0) return
    if (change_of(plain) /= in_motion) name = line(:index(line, "=") - 1)
  end function fixed_variable

  !> True if a changed input has the same values as the present one. A side without a group in the
  !> present input has default values.
  function changes_nothing(before, after, stepped) result(yes)
    type(run_input_t), intent(in) :: before, after
    logical, intent(in), optional :: stepped          !! see `resolve_settings`
    logical :: yes, complete
    type(group_t), allocatable :: groups(:)           ! groups of the present input
    type(settings_t) :: settings
    type(problem_list_t) :: problems
    type(text_t), allocatable :: sides(:)             ! overrides that create the missing groups of sides
    integer :: g

    allocate (sides(0))
    do g = 1, size(after%groups)
      associate (group => after%groups(g), now => before%groups)
        if (any(now%name == group%name .and. now%instance == group%instance)) cycle
        ! An override without a value creates the group of a side, with the default values.
        sides = [sides, text_t("side."//trim(group%instance)//".motion=")]
      end associate
    end do
    groups = before%given_groups
    call override_groups(groups, sides, problems, complete)
    call resolve_settings(groups, settings, problems, stepped)
    call complete_settings(settings, groups, problems, complete)
    yes = problems%count == 0
    if (yes) yes = same_values(groups, after%groups)
  end function changes_nothing

  !> Drops the variables of a side that have no effect with its new motion, such as the force on a
  !> former piston. Variables set by the change itself are kept, and reported as an error.
  subroutine drop_former_motion(before, groups)
    type(group_t), intent(in) :: before(:)            !! groups of the present input
    type(group_t), intent(inout) :: groups(:)         !! groups of the changed input
    integer :: g, v, old

    do g = 1, size(groups)
      old = findloc(before%name == "side" .and. before%instance == groups(g)%instance, .true., dim=1)
      if (groups(g)%name /= "side" .or. old == 0) cycle
      if (before(old)%text_of("motion") == groups(g)%text_of("motion")) cycle
      do v = 1, size(groups(g)%values)
        associate (slot => groups(g)%values(v), words => words_of(table(groups(g)%values(v)%row)%goes_with))
          if (.not. any(words == "motion") .or. slot%line < 0) cycle    ! overrides have negative line numbers
          slot%given = slot%given .and. any(words == groups(g)%text_of("motion"))
        end associate
      end do
    end do
  end subroutine drop_former_motion

end module run_input
