!> Reads an input file and the `--set` overrides: text to statements to values to settings.
!> Every problem is collected; either there are none and the settings hold, or all are reported.
module namelist_input
  use kinds, only: int64
  use errors, only: error_t, exit_files, exit_usage, fail
  use input_problems, only: problem_list_t
  use input_settings, only: resolve_settings
  use input_values, only: store_values
  use namelist_scanner, only: group_start, scanner_t, setting, statement_t, token_t
  use parameter_values, only: parameter_group_t, parameter_value_t, text_length
  use parameters, only: group_names, is_repeated, row_of, table, variables_of
  use settings, only: settings_t
  use similar_files, only: similar_file
  use system, only: is_folder
  use texts, only: joined, lower_case, shown, suggestion, text_t, written
  implicit none
  private
  public :: read_settings, settings_from_text

  integer(int64), parameter :: largest_file = 4194304   !! bytes
  integer, parameter :: most_instances = 5000           !! of each of the two repeated groups
  character(len=*), parameter :: eol = new_line("a")

  !> The groups while they are being read; those that cannot be repeated are there from the start.
  type :: reading_t
    integer :: count = 0
    logical :: complete = .true.                 !! .false.: parts of the text were skipped
    type(parameter_group_t), allocatable :: groups(:)
    type(problem_list_t) :: problems
  end type reading_t

contains

  !> Reads the file `path`, applies the overrides and checks everything.
  subroutine read_settings(path, overrides, settings, groups, input_text, error)
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)             !! GROUP.VARIABLE=VALUE
    type(settings_t), intent(out) :: settings
    type(parameter_group_t), allocatable, intent(out) :: groups(:)  !! every value as used
    character(len=:), allocatable, intent(out) :: input_text        !! the file as it is
    type(error_t), allocatable, intent(out) :: error

    call read_text(path, input_text, error)
    if (allocated(error)) return
    call settings_from_text(input_text, path, overrides, settings, groups, error)
  end subroutine read_settings

  !> The same for a text; `path` only names it in messages.
  subroutine settings_from_text(text, path, overrides, settings, groups, error)
    character(len=*), intent(in) :: text
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)
    type(settings_t), intent(out) :: settings
    type(parameter_group_t), allocatable, intent(out) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    type(reading_t) :: reading
    integer :: k

    call open_reading(reading, count([(text(k:k) == "&", k=1, len(text))]))
    call read_statements(reading, unix_lines(text))
    call name_instances(reading)
    do k = 1, size(overrides)
      call override(reading, overrides(k)%text, -k)
      call name_instances(reading)
    end do
    call put_in_order(reading, groups)
    if (reading%complete) call resolve_settings(groups, settings, reading%problems)
    if (reading%problems%count > 0) then
      call fail(error, exit_usage, reading%problems%report(path, overrides))
    end if
  end subroutine settings_from_text

  !> The bytes of a regular file. Nothing is opened before its size is known: opening a pipe hangs.
  subroutine read_text(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=200) :: reason
    integer(int64) :: bytes
    integer :: unit, status, odd
    logical :: exists

    inquire (file=path, exist=exists, size=bytes)
    if (.not. exists) then
      call fail(error, exit_files, path//": there is no such file"//meant(path))
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder, not an input file")
    else if (bytes <= 0) then
      call fail(error, exit_usage, path//": is empty, or a pipe or a device instead of a file")
    else if (bytes > largest_file) then
      call fail(error, exit_usage, path//": has "//written(bytes)// &
        " bytes; an input file has at most "//written(largest_file))
    end if
    if (allocated(error)) return
    allocate (character(len=bytes) :: text)
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", &
      status="old", iostat=status, iomsg=reason)
    if (status == 0) read (unit, iostat=status, iomsg=reason) text
    if (status /= 0) then
      call fail(error, exit_files, path//": cannot be read: "//trim(reason))
      return
    end if
    close (unit)
    odd = first_odd_byte(text)
    if (odd > 0) call fail(error, exit_usage, path//": is not a text file: byte "//written(odd)// &
      " is a control character, code "//written(iachar(text(odd:odd))))
  end subroutine read_text

  !> What to say of a file that is not there.
  function meant(path) result(advice)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: advice

    advice = similar_file(path, ".nml")
    if (advice /= "") advice = "; did you mean "//advice//"?"
  end function meant

  !> Position of the first byte that no text file has; 0 if there is none.
  pure function first_odd_byte(text) result(position)
    character(len=*), intent(in) :: text
    integer :: position

    do position = 1, len(text)
      select case (iachar(text(position:position)))
      case (0:8, 11:12, 14:31, 127)
        return
      case default
        cycle
      end select
    end do
    position = 0
  end function first_odd_byte

  !> The text with line feeds alone as line ends, without byte order mark, ending in a line feed.
  pure function unix_lines(text) result(lines)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: lines
    character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)
    character(len=*), parameter :: carriage_return = achar(13)
    integer :: i, n, first

    allocate (character(len=len(text) + 1) :: lines)
    first = 1
    if (text(:min(3, len(text))) == byte_order_mark) first = 4
    n = 0
    do i = first, len(text)
      if (i > 1 .and. text(i:i) == eol) then
        if (text(i - 1:i - 1) == carriage_return) cycle
      end if
      n = n + 1
      lines(n:n) = text(i:i)
      if (text(i:i) == carriage_return) lines(n:n) = eol
    end do
    lines = lines(:n)//eol
  end function unix_lines

  subroutine open_reading(reading, most)
    type(reading_t), intent(out) :: reading
    integer, intent(in) :: most                           !! groups that the file may hold
    integer :: k

    allocate (reading%groups(size(group_names) + min(most, 2*most_instances)))
    do k = 1, size(group_names)
      if (.not. is_repeated(group_names(k))) call add_group(reading, group_names(k), 0)
    end do
  end subroutine open_reading

  !> The groups in the order of the table, those of one name side by side.
  pure subroutine put_in_order(reading, groups)
    type(reading_t), intent(in) :: reading
    type(parameter_group_t), allocatable, intent(out) :: groups(:)
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

  !> Adds a group with the defaults of the table, which are written there as in a file.
  subroutine add_group(reading, name, line)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: name
    integer, intent(in) :: line
    integer :: k, row

    reading%count = reading%count + 1
    associate (group => reading%groups(reading%count))
      group%name = name
      group%line = line
      allocate (group%values(count(table%group == name)))
      row = 0
      do k = 1, size(table)
        if (table(k)%group /= name) cycle
        row = row + 1
        group%values(row)%row = k
        call reset(group%values(row), reading%problems)
      end do
    end associate
  end subroutine add_group

  !> Stores a value that does not come from the file: a default, or that of an override, where
  !> texts need no quotes.
  subroutine assign_text(slot, text, line, problems)
    type(parameter_value_t), intent(inout) :: slot
    character(len=*), intent(in) :: text
    integer, intent(in) :: line                           !! -k: override k
    type(problem_list_t), intent(inout) :: problems
    type(scanner_t) :: scanner
    type(token_t), allocatable :: tokens(:)
    character(len=:), allocatable :: where
    logical :: sound

    scanner%text = text//eol
    scanner%line = line
    where = trim(table(slot%row)%group)//"."//slot%name
    if (slot%kind == "text" .and. table(slot%row)%size == 1 .and. scan(text, "'""") /= 1) then
      tokens = [token_t(first=1, last=len(text), line=line)]
    else
      allocate (tokens(0))
      call scanner%read_values(tokens, sound, where, problems)
      scanner%line = line
      if (sound .and. scanner%at <= len(text)) then
        call problems%add(line, where, "unexpected "//shown(text(scanner%at:)))
        sound = .false.
      end if
      slot%faulty = .not. sound
      if (slot%faulty) return
    end if
    call store_values(slot, table(slot%row), scanner, tokens, 0, line, .true., where, problems)
  end subroutine assign_text

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

  !> Which group the following assignments belong to; 0 if its name is unknown.
  subroutine enter_group(reading, statement, group)
    type(reading_t), intent(inout) :: reading
    type(statement_t), intent(in) :: statement
    integer, intent(out) :: group
    integer :: k

    group = 0
    if (all(group_names /= statement%name)) reading%complete = .false.
    if (statement%name == "") then
      call reading%problems%add(statement%line, "&", "the name of a group follows directly after &")
    else if (all(group_names /= statement%name)) then
      call reading%problems%add(statement%line, "&"//shown(statement%name), "unknown group; "// &
        suggestion(statement%name, group_names))
    else if (is_repeated(statement%name)) then
      if (count(reading%groups(:reading%count)%name == statement%name) == most_instances) then
        call reading%problems%add(statement%line, statement%name, "more than "// &
          written(most_instances)//" groups of this name")
        return
      end if
      call add_group(reading, statement%name, statement%line)
      group = reading%count
    else
      do k = 1, reading%count
        if (reading%groups(k)%name == statement%name) group = k
      end do
      associate (line => reading%groups(group)%line)
        if (line > 0) call reading%problems%add(statement%line, statement%name, &
          "a second group of this name; the first is in line "//written(line))
        if (line == 0) line = statement%line
      end associate
    end if
  end subroutine enter_group

  subroutine take_assignment(group, scanner, statement, problems)
    type(parameter_group_t), intent(inout) :: group
    type(scanner_t), intent(in) :: scanner
    type(statement_t), intent(in) :: statement
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: where
    integer :: row, elements

    row = row_of(group%name, statement%name)
    if (row == 0) then
      call report_unknown(group%name, statement%name, statement%line, problems)
      return
    end if
    where = trim(group%name)//"."//statement%name
    elements = -1
    if (statement%element > 0) elements = ibset(0, min(statement%element, 30))
    associate (slot => group%values(row))
      if (iand(slot%elements, elements) /= 0) then
        call problems%add(statement%line, where, "is set a second time; the first is in line "//written(slot%line))
        return
      end if
      slot%elements = ior(slot%elements, elements)
      if (statement%sound) then
        call store_values(slot, table(slot%row), scanner, statement%tokens, statement%element, &
          statement%line, .false., where, problems)
      else
        slot%faulty = .true.
        slot%line = statement%line
      end if
    end associate
  end subroutine take_assignment

  !> The variable may be misspelt, or belong to another group.
  subroutine report_unknown(group, name, line, problems)
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: line
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: advice, word
    integer :: k

    advice = suggestion(name, variables_of(group))
    do k = size(table), 1, -1
      if (table(k)%name == name) advice = "it belongs to &"//trim(table(k)%group)
    end do
    word = name
    if (len(name) > 30) word = shown(name)
    call problems%add(line, trim(group)//"."//word, "unknown variable; "//advice)
  end subroutine report_unknown

  !> Every obstacle and species has a name from here on.
  subroutine name_instances(reading)
    type(reading_t), intent(inout) :: reading
    integer :: k, j, n

    do j = 1, size(group_names)
      if (.not. is_repeated(group_names(j))) cycle
      n = 0
      do k = 1, reading%count
        associate (group => reading%groups(k))
          if (group%name /= group_names(j)) cycle
          n = n + 1
          if (group%text_of("name") == "") call group%put_text("name", trim(group%name)//written(n))
          group%instance = group%text_of("name")
        end associate
      end do
    end do
  end subroutine name_instances

  !> Applies one `GROUP.VARIABLE=VALUE` or `GROUP.NAME.VARIABLE=VALUE`. Without a value the variable
  !> has its default again.
  subroutine override(reading, text, line)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: text
    integer, intent(in) :: line                           !! -k for override k
    character(len=:), allocatable :: group, instance, name
    integer :: equals, k, row

    equals = index(text, "=")
    call split_path(text(:max(equals - 1, 0)), group, instance, name)
    if (equals == 0 .or. group == "" .or. name == "") then
      call reading%problems%add(line, "override", "expects GROUP.VARIABLE=VALUE, as in run.seed=7")
      return
    end if
    if (all(group_names /= group)) then
      call reading%problems%add(line, group, "unknown group; "//suggestion(group, group_names))
      return
    end if
    row = row_of(group, name)
    if (row == 0) then
      call report_unknown(group, name, line, reading%problems)
      return
    end if
    call find_group(reading, group, instance, line, k)
    if (k == 0) return
    if (equals == len(text)) then
      call reset(reading%groups(k)%values(row), reading%problems)
    else
      call assign_text(reading%groups(k)%values(row), text(equals + 1:), line, reading%problems)
    end if
  end subroutine override

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

  !> The group that an override means; 0, and a problem, if there is none.
  subroutine find_group(reading, group, instance, line, found)
    type(reading_t), intent(inout) :: reading
    character(len=*), intent(in) :: group, instance
    integer, intent(in) :: line
    integer, intent(out) :: found
    character(len=text_length), allocatable :: names(:)
    integer :: k, matches

    found = 0
    matches = 0
    allocate (names(0))
    do k = reading%count, 1, -1
      if (reading%groups(k)%name /= group) cycle
      names = [character(len=text_length) :: reading%groups(k)%instance, names]
      if (instance /= "" .and. instance /= reading%groups(k)%instance) cycle
      matches = matches + 1
      found = k
    end do
    if (matches == 1) return
    if (size(names) == 0) then
      call reading%problems%add(line, group, "the input has no &"//group)
    else if (instance == "") then
      call reading%problems%add(line, group, "which one? as in "//group//"."//trim(names(1))// &
        ".mass; known: "//joined(names, ", "))
    else
      call reading%problems%add(line, group//"."//instance, "unknown or not unique; "//suggestion(instance, names))
    end if
    found = 0
  end subroutine find_group

  !> As if the variable were not in the file.
  subroutine reset(slot, problems)
    type(parameter_value_t), intent(inout) :: slot
    type(problem_list_t), intent(inout) :: problems

    slot = parameter_value_t(row=slot%row, name=table(slot%row)%name, kind=table(slot%row)%kind)
    if (table(slot%row)%status == "default" .or. table(slot%row)%status == "fallback") &
      call assign_text(slot, trim(table(slot%row)%value), 0, problems)
    slot%given = .false.
  end subroutine reset

end module namelist_input
