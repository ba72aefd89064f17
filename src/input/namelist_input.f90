!> Reads input text and the `--set` overrides: text to statements to values to settings.
!> Every problem is collected; the settings are only of use if there is none.
module namelist_input
  use input_problems, only: problem_list_t
  use input_settings, only: resolve_settings
  use input_text, only: unix_lines
  use input_words, only: store_values
  use namelist_scanner, only: group_start, plain, scanner_t, setting, statement_t, token_t
  use input_groups, only: group_t, value_t
  use variables, only: full_names, group_names, is_repeated, row_of, table, track_of, variables_of
  use settings, only: settings_t
  use texts, only: joined, lower_case, place_of, shown, suggestion, text_t, written
  implicit none
  private
  public :: read_groups, read_settings

  integer, parameter :: most_instances = 5000           !! of each of the repeated groups
  character(len=*), parameter :: eol = new_line("a")

  !> The groups while they are being read; those that cannot be repeated exist from the start.
  type :: reading_t
    integer :: count = 0
    integer :: instances(size(group_names)) = 0  !! of each group
    logical :: complete = .true.                 !! .false.: parts of the text were skipped
    type(group_t), allocatable :: groups(:)
    type(problem_list_t) :: problems
  end type reading_t

contains

  !> Reads the text of an input file, applies the overrides and resolves the settings. After text that could
  !> not be understood the settings stay empty: what would be missing in them is there, in the skipped parts.
  subroutine read_settings(text, overrides, settings, groups, problems)
    character(len=*), intent(in) :: text
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    type(settings_t), intent(out) :: settings
    type(group_t), allocatable, intent(out) :: groups(:)  !! every value as used
    type(problem_list_t), intent(out) :: problems
    logical :: complete

    call read_groups(text, overrides, groups, problems, complete)
    if (complete) call resolve_settings(groups, settings, problems)
  end subroutine read_settings

  !> Reads the text and applies the overrides: every value as given, or its default.
  subroutine read_groups(text, overrides, groups, problems, complete)
    character(len=*), intent(in) :: text
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    type(group_t), allocatable, intent(out) :: groups(:)
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete                                !! .false.: parts of the text were skipped
    type(reading_t) :: reading
    integer :: k

    call open_reading(reading, count([(text(k:k) == "&", k=1, len(text))]))
    call read_statements(reading, unix_lines(text))
    do k = 1, reading%count
      call name_instance(reading%groups(k))
    end do
    do k = 1, size(overrides)
      call override(reading, overrides(k)%text, -k)
    end do
    call put_in_order(reading, groups)
    problems = reading%problems
    complete = reading%complete
  end subroutine read_groups

  !> Adds the groups that exist once, and makes room for the others.
  subroutine open_reading(reading, most)
    type(reading_t), intent(out) :: reading
    integer, intent(in) :: most                           !! groups that the file may hold
    integer :: k

    allocate (reading%groups(size(group_names) + min(most, count(is_repeated(group_names))*most_instances)))
    do k = 1, size(group_names)
      if (.not. is_repeated(group_names(k))) call add_group(reading, group_names(k), 0)
    end do
  end subroutine open_reading

  !> The groups in the order of the table, those of one name side by side.
  pure subroutine put_in_order(reading, groups)
    type(reading_t), intent(in) :: reading
    type(group_t), allocatable, intent(out) :: groups(:)
    integer :: j, k, n

    allocate (groups(reading%count))
    n = 0
    do j = 1, size(group_names)
      do k = 1, reading%count
        if (reading%groups(k)%name /= group_names(j)) cycle
        n = n + 1
        groups(n) = reading%groups(k)
      end do
    end do
  end subroutine put_in_order

  !> Adds a group with the defaults of the table.
  subroutine add_group(reading, name, line)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: name
    integer, intent(in) :: line
    integer :: k
    integer, allocatable :: rows(:)

    reading%count = reading%count + 1
    rows = pack([(k, k=1, size(table))], table%group == name)
    associate (group => reading%groups(reading%count), instances => reading%instances(place_of(name, group_names)))
      instances = instances + 1
      group%name = name
      group%number = instances
      group%line = line
      allocate (group%values(size(rows)))
      do k = 1, size(rows)
        group%values(k)%row = rows(k)
        call reset(group%values(k), reading%problems)
      end do
    end associate
  end subroutine add_group

  !> Leaves a variable as if it were not in the file.
  subroutine reset(slot, problems)
    type(value_t), intent(inout) :: slot
    type(problem_list_t), intent(inout) :: problems

    associate (row => table(slot%row))
      slot = value_t(row=slot%row, name=row%name, kind=row%kind)
      if (row%status == "default" .or. row%status == "fallback") call assign_text(slot, trim(row%value), 0, problems)
      slot%given = .false.
    end associate
  end subroutine reset

  !> Stores a value that is not from the file: a default, or that of an override, where text needs no quotes.
  subroutine assign_text(slot, text, line, problems)
    type(value_t), intent(inout) :: slot
    character(len=*), intent(in) :: text
    integer, intent(in) :: line                           !! -k: override k; 0: a default
    type(problem_list_t), intent(inout) :: problems
    type(scanner_t) :: scanner
    type(statement_t) :: statement

    scanner%text = text//eol
    statement%line = line
    statement%where = trim(table(slot%row)%group)//"."//slot%name
    if (slot%kind == "text" .and. table(slot%row)%size == 1 .and. scan(text, "'""") /= 1) then
      statement%tokens = [token_t(first=1, last=len(text))]
    else
      call scanner%read_values(statement, problems)
      if (statement%sound .and. scanner%at <= len(text)) then
        call problems%add(line, statement%where, "unexpected "//shown(text(scanner%at:)))
        statement%sound = .false.
      end if
    end if
    call store_values(slot, scanner, statement, problems)
  end subroutine assign_text

  !> Reads the whole text.
  subroutine read_statements(reading, text)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: text
    type(scanner_t) :: scanner
    type(statement_t) :: statement
    integer :: group

    scanner%text = text
    group = 0
    do while (.not. reading%problems%is_full())
      call scanner%next_statement(statement, reading%problems)
      if (group > 0 .and. statement%kind /= setting) reading%groups(group)%last = scanner%closed
      select case (statement%kind)
      case (group_start)
        call enter_group(reading, statement, group)
      case (setting)
        if (group > 0) call take_assignment(reading%groups(group), scanner, statement, reading%problems)
      case default   ! the end of the text
        exit
      end select
    end do
    if (scanner%lost) reading%complete = .false.
  end subroutine read_statements

  !> Finds the group to which the following assignments belong; 0 if its name is unknown.
  subroutine enter_group(reading, statement, group)
    type(reading_t), intent(inout) :: reading
    type(statement_t), intent(in) :: statement
    integer, intent(out) :: group

    associate (name => statement%name, line => statement%line, groups => reading%groups(:reading%count))
      group = 0
      if (all(group_names /= name)) then
        reading%complete = .false.
        call reading%problems%add(line, "&"//plain(name), "unknown group; "//suggestion(name, group_names))
      else if (.not. is_repeated(name)) then
        group = place_of(name, groups%name)
        if (groups(group)%line > 0) call reading%problems%add(line, name, &
          "a second group of this name; the first is in line "//written(groups(group)%line))
        if (groups(group)%line == 0) groups(group)%line = line
      else if (reading%instances(place_of(name, group_names)) == most_instances) then
        call reading%problems%add(line, name, "more than "//written(most_instances)//" groups of this name")
      else
        call add_group(reading, name, line)
        group = reading%count
      end if
      if (group > 0) reading%groups(group)%first = statement%first
    end associate
  end subroutine enter_group

  !> Stores the values of one assignment.
  subroutine take_assignment(group, scanner, statement, problems)
    type(group_t), intent(inout) :: group
    type(scanner_t), intent(in) :: scanner
    type(statement_t), intent(in) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: row, elements

    row = row_of(group%name, statement%name)
    if (row == 0) then
      call report_unknown(group%name, statement%name, statement%line, problems)
      return
    end if
    elements = -1
    if (statement%element > 0) elements = ibset(0, min(statement%element, 30))
    associate (slot => group%values(row))
      if (iand(slot%elements, elements) /= 0) then
        call problems%add(statement%line, statement%where, "is set twice; the first time in line "//written(slot%line))
      else
        slot%elements = ior(slot%elements, elements)
        call store_values(slot, scanner, statement, problems)
      end if
    end associate
  end subroutine take_assignment

  !> The variable may be misspelt, or belong to another group.
  subroutine report_unknown(group, name, line, problems)
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: line
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: advice

    advice = suggestion(name, variables_of(group))
    if (full_names(name) /= "") advice = "did you mean "//full_names(name)//"?"
    call problems%add(line, trim(group)//"."//plain(name), "unknown variable; "//advice)
  end subroutine report_unknown

  !> Gives a name to an obstacle or species that has none.
  subroutine name_instance(group)
    type(group_t), intent(inout) :: group

    if (.not. is_repeated(group%name)) return
    if (group%text_of("name") == "") call group%put_text("name", trim(group%name)//written(group%number))
    group%instance = group%text_of("name")
  end subroutine name_instance

  !> Applies one `GROUP.VARIABLE=VALUE` or `GROUP.NAME.VARIABLE=VALUE`. Without a value the variable
  !> gets its default back.
  subroutine override(reading, text, line)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: text
    integer, intent(in) :: line                           !! -k for override k
    character(len=:), allocatable :: group, instance, name, advice
    integer :: equals, k, row

    equals = index(text, "=")
    call split_path(text(:max(equals - 1, 0)), group, instance, name)
    row = row_of(group, name)
    if (group == "" .or. name == "") then
      advice = ", as in run.seed=7"
      if (full_names(name) /= "") advice = "; did you mean "//full_names(name)//"?"
      call reading%problems%add(line, "override", "expects GROUP.VARIABLE=VALUE"//advice)
    else if (all(group_names /= group)) then
      call reading%problems%add(line, plain(group), "unknown group; "//suggestion(group, group_names))
    else if (row == 0) then
      call report_unknown(group, name, line, reading%problems)
    else
      call find_group(reading, group, instance, line, k)
      if (k == 0) return
      if (equals == len(text)) then
        call reset(reading%groups(k)%values(row), reading%problems)
      else
        call assign_text(reading%groups(k)%values(row), text(equals + 1:), line, reading%problems)
        call replace_cadence(reading%groups(k), name, reading%problems)
      end if
      call name_instance(reading%groups(k))
    end if
  end subroutine override

  !> A cadence set by an override takes the place of that which the file has for the same samples.
  subroutine replace_cadence(group, name, problems)
    type(group_t), intent(inout) :: group
    character(len=*), intent(in) :: name                  !! of the variable that is set
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    if (track_of(name) == "") return
    do k = 1, size(group%values)
      associate (slot => group%values(k))
        if (slot%line > 0 .and. slot%name /= name .and. track_of(slot%name) == track_of(name)) call reset(slot, problems)
      end associate
    end do
  end subroutine replace_cadence

  !> Cuts at the first and the last dot: `species.bed.mass`; the group and variable in lower case.
  pure subroutine split_path(path, group, instance, name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: group, instance, name
    integer :: first, last

    first = index(path, ".")
    last = index(path, ".", back=.true.)
    group = lower_case(trim(adjustl(path(:first - 1))))
    name = lower_case(trim(adjustl(path(last + 1:))))
    instance = ""
    if (last > first) instance = path(first + 1:last - 1)
  end subroutine split_path

  !> Finds the group that an override means; 0, and a problem, if there is none.
  subroutine find_group(reading, group, instance, line, found)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: group, instance
    integer, intent(in) :: line
    integer, intent(out) :: found
    logical, dimension(reading%count) :: of_group, matches

    of_group = reading%groups(:reading%count)%name == group
    matches = of_group .and. (instance == "" .or. reading%groups(:reading%count)%instance == instance)
    found = 0
    if (count(matches) == 1) then
      found = findloc(matches, .true., dim=1)
      return
    end if
    associate (names => pack(reading%groups(:reading%count)%instance, of_group))
      if (size(names) == 0) then
        call reading%problems%add(line, group, "the input has no &"//group)
      else if (instance == "") then
        call reading%problems%add(line, group, "which one? write "//group//"."//trim(names(1))// &
          ".VARIABLE; known: "//joined(names, ", "))
      else
        call reading%problems%add(line, group//"."//instance, "unknown or not unique; "//suggestion(instance, names))
      end if
    end associate
  end subroutine find_group

end module namelist_input
