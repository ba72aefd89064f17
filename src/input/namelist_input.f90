!> Reads the input text and the overrides of `--set`, and converts their tokens to assignments and values. All problems are
!> collected and reported together.
module namelist_input
  use input_groups, only: group_t, value_t
  use input_problems, only: most_problems, problem_list_t
  use input_words, only: store_values
  use input_text, only: assignment_t, content, cut, ending, plain, token_t, unclosed, unix_lines, word
  use partners, only: n_sides, side_name
  use old_names, only: new_name
  use texts, only: digits, eol, joined, lower_case, shown, suggestion, text_t, written
  use variables, only: full_names, group_names, is_repeated, obstacle_groups, row_of, table, track_of, variables_of
  implicit none
  private
  public :: read_groups

  !> `most_instances`: largest number of groups with the same name. `most_repeats`: largest repeat count n in n*value.
  integer, parameter :: most_instances = 5000, most_repeats = 10000000

contains

  !> Reads the text and applies the overrides. Variables that are not set have their default values.
  subroutine read_groups(text, overrides, groups, problems, complete)
    character(len=*), intent(in) :: text
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    type(group_t), allocatable, intent(out) :: groups(:)  !! groups in the order of the table; groups of the same name are adjacent
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete                                !! .false. if parts of the text could not be read
    type(value_t) :: defaults(size(table))
    type(group_t), allocatable :: found(:)                          ! groups in the order of the text
    integer :: n, i, j, k                                           ! n: number of groups found so far
    ! The text that is being read: a default, the input text, or an override.
    character(len=:), allocatable :: source
    type(token_t), allocatable :: token(:)                          ! tokens of `source`
    integer :: at                                                   ! index of the next token
    character(len=:), allocatable :: own                            ! name of the group that is being read, for messages
    integer :: group  ! index of the group that is being read; 0 if its name is unknown
    ! First line of the group that is being read; 0 between groups.
    integer :: opened
    logical :: too_many                                             ! .true. if too many groups have the same name
    logical :: quote_open  ! .true. if a quoted text is not closed; the text may contain the / of the group

    complete = .true.
    too_many = .false.
    n = 0
    do k = 1, size(table)
      defaults(k) = value_t(row=k, name=table(k)%name, kind=table(k)%kind)
      if (table(k)%status == "default" .or. table(k)%status == "fallback") call assign_text(defaults(k), trim(table(k)%value), 0, 0)
      defaults(k)%given = .false.
    end do
    allocate (found(size(group_names) + n_sides + min(count([(text(k:k) == "&", k=1, len(text))]), &
      count(is_repeated(group_names))*most_instances)))
    do k = 1, size(group_names)  ! groups that cannot be repeated always exist, even if the text does not contain them
      if (.not. is_repeated(group_names(k))) call add_group(group_names(k), 0, 1)
    end do
    call open_source(unix_lines(text))
    call read_text()
    do k = 1, n
      call name_instance(found(k))
    end do
    do k = 1, merge(0, size(overrides), too_many)
      call override(overrides(k)%text, -k)
    end do
    allocate (groups(n))
    i = 0
    do j = 1, size(group_names)
      do k = 1, n
        if (found(k)%name /= group_names(j)) cycle
        i = i + 1
        groups(i) = found(k)
      end do
    end do

  contains

    !> Starts to read the tokens of a different text.
    subroutine open_source(text)
      character(len=*), intent(in) :: text

      source = text
      call cut(source, token)
      at = 1
    end subroutine open_source

    !> Whether the next tokens have the given kinds.
    function follow(kinds)
      character(len=*), intent(in) :: kinds
      logical :: follow
      integer :: i

      follow = all([(token(at + i - 1)%kind == kinds(i:i), i=1, len(kinds))])
    end function follow

    !> Adds a group with the defaults of the table.
    subroutine add_group(name, line, number)
      character(len=*), intent(in) :: name
      !> `line` is the first line of the group, and `number` is its number among the groups of the same name.
      integer, intent(in) :: line, number
      integer, allocatable :: rows(:)
      integer :: v

      n = n + 1
      rows = pack([(v, v=1, size(table))], table%group == name)
      associate (group => found(n))
        group%name = name
        group%number = number
        group%line = line
        allocate (group%values(size(rows)))
        do v = 1, size(rows)
          group%values(v) = defaults(rows(v))
        end do
      end associate
    end subroutine add_group

    !> Stores a value that does not come from the input file: a default or an override. A text in a default or an override needs no
    !> quotation marks.
    subroutine assign_text(slot, text, line, element)
      type(value_t), intent(inout) :: slot
      character(len=*), intent(in) :: text
      integer, intent(in) :: line  !! the negative integer -k if override number k contains the value; 0 for a default
      integer, intent(in) :: element                      !! index of the element; 0 for all values of the variable
      type(assignment_t) :: assignment

      call open_source(text//eol)
      assignment%line = line
      assignment%element = element
      assignment%where = trim(table(slot%row)%group)//"."//slot%name
      if (slot%kind == "text" .and. table(slot%row)%size == 1 .and. scan(text, "'""") /= 1) then
        assignment%tokens = [token_t(word, 1, len(text), 0, 1)]
      else
        call read_values(assignment)
        if (assignment%sound .and. token(at)%kind /= ending) call complain(assignment, "unexpected "//shown(rest_of_line()))
      end if
      call store_values(slot, source, assignment, problems)
    end subroutine assign_text

    !> Reads the whole input text.
    subroutine read_text()
      opened = 0
      do while (problems%count < most_problems .and. .not. too_many)
        if (opened == 0) then
          if (token(at)%kind == ending) return
          call between_groups()
          cycle
        end if
        select case (token(at)%kind)
        case ("/")
          if (group > 0) found(group)%last = token(at)%first
          at = at + 1
          opened = 0
        case ("&", ending)
          if (follow("&"//word) .and. lower_case(content(source, token(at + 1))) == "end") then
            call problems%add(token(at)%line, own, "a group ends with /, not with &end")
            at = at + 2
          else if (.not. quote_open) then                 ! an unclosed quoted text may contain the end of the group
            call problems%add(opened, own, "the closing / is missing")
          end if
          opened = 0
        case (word)
          call read_assignment()
        case default
          call problems%add(token(at)%line, own, "unexpected "//shown(rest_of_line())//"; a variable is set as name = value")
          call skip_line()
        end select
      end do
    end subroutine read_text

    !> Reads the text between groups, in which only `&name` is allowed. Text other than the name of a group is reported, and skipped
    !> up to the next line that begins with &.
    subroutine between_groups()
      character(len=:), allocatable :: problem

      problem = "text outside a group; a group is &name ... /, a comment begins with !"
      if (token(at)%kind == "&") problem = "the name of a group follows directly after &, without quotes"
      if (follow("&"//word) .and. token(at)%last + 1 == token(at + 1)%first) then
        opened = token(at)%line
        call enter_group(lower_case(content(source, token(at + 1))))
        quote_open = .false.
        at = at + 2
        return
      end if
      call problems%add(token(at)%line, shown(rest_of_line()), problem)
      do
        call skip_line()
        if (scan(token(at)%kind, "&"//ending) > 0) return
      end do
    end subroutine between_groups

    !> Skips the rest of a line that cannot be interpreted.
    subroutine skip_line()
      integer :: line

      complete = .false.
      line = token(at)%line
      do while (token(at)%line == line .and. token(at)%kind /= ending)
        at = at + 1
      end do
    end subroutine skip_line

    !> The text from the next token to the end of its line.
    function rest_of_line() result(text)
      character(len=:), allocatable :: text

      associate (first => token(at)%first)
        text = source(first:first + index(source(first:), eol) - 2)
      end associate
    end function rest_of_line

    !> Reads `name = values`.
    subroutine read_assignment()
      type(assignment_t) :: assignment
      character(len=:), allocatable :: name

      name = lower_case(content(source, token(at)))
      assignment%line = token(at)%line
      assignment%where = own//"."//plain(name)
      at = at + 1
      if (token(at)%kind == "(") call read_element(assignment)
      if (.not. assignment%sound) then
        call skip_line()
      else if (token(at)%kind /= "=") then
        call problems%add(assignment%line, assignment%where, "= is missing after the name; a comment begins with !")
        complete = .false.
        if (token(at)%line == assignment%line) call skip_line()
      else
        at = at + 1
        call read_values(assignment)
        if (group > 0) call take_assignment(found(group), name, assignment)
      end if
    end subroutine read_assignment

    !> Reads the index of an element, such as `(2)` in `name(2) = value`.
    subroutine read_element(assignment)
      type(assignment_t), intent(inout) :: assignment
      integer :: status

      if (follow("("//word//")")) then
        associate (number => source(token(at + 1)%first:token(at + 1)%last))
          status = 1
          if (verify(number, digits) == 0) read (number, *, iostat=status) assignment%element
          if (status /= 0) assignment%element = 0
        end associate
      end if
      if (assignment%element > 0) then
        at = at + 3
      else
        call complain(assignment, "brackets must contain the number of one value, as in name(2) = value")
      end if
    end subroutine read_element

    !> Reports a problem of an assignment.
    subroutine complain(assignment, what)
      type(assignment_t), intent(inout) :: assignment
      character(len=*), intent(in) :: what

      call problems%add(merge(token(at)%line, assignment%line, assignment%line > 0), assignment%where, what)
      assignment%sound = .false.
    end subroutine complain

    !> Reads the values after `=`, up to the next name, the next `/` or `&`, or the end of the text.
    subroutine read_values(assignment)
      type(assignment_t), intent(inout) :: assignment
      logical :: after_comma
      integer :: first

      first = at
      after_comma = .true.
      do while (scan(token(at)%kind, "/&"//ending) == 0 .and. .not. (follow(word//"=") .or. follow(word//"("//word//")=")))
        select case (token(at)%kind)
        case (",")
          if (after_comma) call complain(assignment, "a value is missing before the comma")
        case (word)
          call read_repeats(assignment)
        case (unclosed)
          call complain(assignment, "the closing quote "//source(token(at)%first:token(at)%first)//" is missing")
          quote_open = .true.
          complete = .false.
        case ("'", """")
        case default
          call complain(assignment, "unexpected "//shown(content(source, token(at))))
        end select
        after_comma = token(at)%kind == ","
        at = at + 1
      end do
      if (all(token(first:at - 1)%kind == ",") .and. assignment%sound) call complain(assignment, "it has no value")
      assignment%tokens = pack(token(first:at - 1), token(first:at - 1)%kind /= ",")
    end subroutine read_values

    !> Reads a value with a repeat count, as in `3*value`. The value may be a quoted text.
    subroutine read_repeats(assignment)
      type(assignment_t), intent(inout) :: assignment
      integer :: star, status

      associate (own => token(at), next => token(at + 1))
        star = index(source(own%first:own%last), "*")
        if (star < 2) return
        associate (count => source(own%first:own%first + star - 2))
          if (verify(count, digits) > 0) return
          status = 1
          if (len(count) <= 8) read (count, *, iostat=status) own%repeats
        end associate
        if (status /= 0 .or. own%repeats < 1 .or. own%repeats > most_repeats) call complain(assignment, &
          "the repeat count of "//shown(source(own%first:own%last))//" is out of range")
        own%first = own%first + star
        if (own%first <= own%last) return
        if (scan(next%kind, "'"""//unclosed) > 0 .and. next%first == own%first) then
          next%repeats = own%repeats
          own%kind = ","                                  ! the kind `,` means that the repeat count in the token has been read
        else
          call complain(assignment, "a value is missing after the *")
        end if
      end associate
    end subroutine read_repeats

    !> Finds the group to which the following assignments belong.
    subroutine enter_group(name)
      character(len=*), intent(in) :: name
      integer :: instances

      own = plain(name)
      do group = n, 1, -1                                 ! `group` becomes 0 if no group has the name
        if (found(group)%name == name) exit
      end do
      instances = 0
      if (group > 0) instances = found(group)%number
      if (all(group_names /= name)) then
        complete = .false.
        call problems%add(opened, "&"//own, "unknown group; "//suggestion(name, group_names))
      else if (.not. is_repeated(name)) then
        if (found(group)%line > 0) call problems%add(opened, name, &
          "a second group of this name; the first is in line "//written(found(group)%line))
        if (found(group)%line == 0) found(group)%line = opened
      else if (instances < most_instances) then
        call add_group(name, opened, instances + 1)
        group = n
      else
        problems = problem_list_t()                       ! the rest of the text is not read, and other problems are not reported
        call problems%add(opened, name, "more than "//written(most_instances)//" groups of this name" &
          //trim(merge("; a file may hold many obstacles (file)", repeat(" ", 39), any(obstacle_groups == name))))
        too_many = .true.
        complete = .false.
        group = 0
      end if
      if (group > 0) found(group)%first = token(at)%first
    end subroutine enter_group

    !> Stores the values of one assignment.
    subroutine take_assignment(group, name, assignment)
      type(group_t), intent(inout) :: group
      character(len=*), intent(in) :: name
      type(assignment_t), intent(in) :: assignment
      integer :: row, elements

      row = row_of(group%name, name)
      if (row == 0) then
        call report_unknown(group%name, name, assignment%line)
        return
      end if
      elements = -1
      if (assignment%element > 0) elements = ibset(0, min(assignment%element, 30))
      associate (slot => group%values(row))
        if (iand(slot%elements, elements) /= 0) then
          call problems%add(assignment%line, assignment%where, "is set twice; the first time in line "//written(slot%line))
        else
          slot%elements = ior(slot%elements, elements)
          call store_values(slot, source, assignment, problems)
        end if
      end associate
    end subroutine take_assignment

    !> Reports an unknown variable. The message suggests the correct name if the given name is misspelt, if an earlier version used
    !> the name, or if the variable belongs to another group.
    subroutine report_unknown(group, name, line)
      character(len=*), intent(in) :: group, name
      integer, intent(in) :: line
      character(len=:), allocatable :: advice

      advice = new_name(group, name, "")
      if (advice /= "") then
        call problems%add(line, trim(group)//"."//plain(name), "is called "//advice//" now")
        return
      end if
      advice = suggestion(name, variables_of(group))
      if (full_names(name) /= "") advice = "did you mean "//full_names(name)//"?"
      call problems%add(line, trim(group)//"."//plain(name), "unknown variable; "//advice)
    end subroutine report_unknown

    !> Sets the default name of an obstacle or species whose name is not given.
    subroutine name_instance(group)
      type(group_t), intent(inout) :: group

      if (.not. is_repeated(group%name)) return
      if (group%text_of("name") == "") call group%put_text("name", trim(group%name)//written(group%number))
      group%instance = group%text_of("name")
    end subroutine name_instance

    !> Applies an override `GROUP.VARIABLE=VALUE` or `GROUP.NAME.VARIABLE=VALUE`. VARIABLE may be one element of an array, as in
    !> `gravity(2)`. An empty VALUE restores the default.
    subroutine override(text, line)
      character(len=*), intent(in) :: text
      integer, intent(in) :: line                         !! the negative integer -k, where k is the number of the override
      character(len=:), allocatable :: group, instance, name, advice
      integer :: equals, first, last, row, g, element

      equals = index(text, "=")
      first = index(text(:max(equals - 1, 0)), ".")
      last = index(text(:max(equals - 1, 0)), ".", back=.true.)
      group = lower_case(trim(adjustl(text(:first - 1))))
      name = lower_case(trim(adjustl(text(last + 1:equals - 1))))
      instance = ""
      if (last > first) instance = text(first + 1:last - 1)
      call split_element(name, element)
      row = row_of(group, name)
      if (group == "" .or. name == "") then
        advice = ", as in run.seed=7"
        if (full_names(name) /= "") advice = "; did you mean "//full_names(name)//"?"
        call problems%add(line, "override", "expects GROUP.VARIABLE=VALUE"//advice)
      else if (all(group_names /= group)) then
        advice = suggestion(group, group_names)
        g = findloc(found(:n)%instance, text(:first - 1), dim=1)
        if (g > 0) advice = "did you mean "//trim(found(g)%name)//"."//text(:equals - 1)//"?"
        call problems%add(line, plain(group), "unknown group; "//advice)
      else if (row == 0) then
        call report_unknown(group, name, line)
      else
        call find_group(group, instance, line, g)
        if (g == 0) return
        if (equals == len(text) .and. element == 0) then
          found(g)%values(row) = defaults(found(g)%values(row)%row)
        else
          call assign_text(found(g)%values(row), text(equals + 1:), line, element)
          call replace_cadence(found(g), name)
        end if
        call name_instance(found(g))
      end if
    end subroutine override

    !> Separates the index of an element from the name of a variable. Parentheses that do not contain a number remain part of the
    !> name.
    subroutine split_element(name, element)
      character(len=:), allocatable, intent(inout) :: name
      integer, intent(out) :: element                     !! index of the element; set to 0 if the name has no index
      integer :: bracket

      element = 0
      bracket = index(name, "(")
      if (bracket == 0 .or. index(name, ")") /= len(name)) return
      associate (number => name(bracket + 1:len(name) - 1))
        if (number == "" .or. verify(number, digits) > 0 .or. len(number) > 8) return
        read (number, *) element
      end associate
      if (element > 0) name = name(:bracket - 1)
    end subroutine split_element

    !> Removes the sampling interval that the file sets if an override sets an interval of a different kind for the same samples.
    !> The interval in the override thus replaces the interval in the file.
    subroutine replace_cadence(group, name)
      type(group_t), intent(inout) :: group
      character(len=*), intent(in) :: name                !! name of the variable that the override sets
      integer :: v

      if (track_of(name) == "") return
      do v = 1, size(group%values)
        associate (slot => group%values(v))
          if (slot%line > 0 .and. slot%name /= name .and. track_of(slot%name) == track_of(name)) &
            slot = defaults(slot%row)
        end associate
      end do
    end subroutine replace_cadence

    !> Finds the group to which an override refers. If the override refers to a side without a group, the group is created. If any
    !> other override does not match exactly one group, the problem is reported and g is set to 0.
    subroutine find_group(group, instance, line, g)
      character(len=*), intent(in) :: group, instance
      integer, intent(in) :: line
      integer, intent(out) :: g
      logical, dimension(n) :: of_group, matches

      of_group = found(:n)%name == group
      matches = of_group .and. (instance == "" .or. found(:n)%instance == instance)
      g = findloc(matches, .true., dim=1)
      if (count(matches) == 1) return
      if (group == "side" .and. any(side_name == instance) .and. .not. any(matches)) then
        call add_group(group, 0, count(of_group) + 1)
        g = n
        call assign_text(found(g)%values(row_of(group, "name")), instance, line, 0)
        return
      end if
      g = 0
      associate (names => pack(found(:n)%instance, of_group))
        if (size(names) == 0) then
          call problems%add(line, group, "the input has no &"//group)
        else if (instance == "") then
          call problems%add(line, group, "several groups have this name; write "//group//"."//trim(names(1)) &
            //".VARIABLE; known: "//joined(names, ", "))
        else if (any(matches)) then
          call problems%add(line, group//"."//instance, "several groups have this name")
        else
          call problems%add(line, group//"."//instance, "the input has no &"//group//" with this name; " &
            //suggestion(instance, names))
        end if
      end associate
    end subroutine find_group
  end subroutine read_groups

end module namelist_input
