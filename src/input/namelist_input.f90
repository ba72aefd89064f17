!> Parses the input text and the overrides of `--set`: tokens become assignments, and assignments
!> become values. All problems are collected and reported together.
module namelist_input
  use input_groups, only: group_t, value_t
  use input_problems, only: most_problems, problem_list_t
  use input_words, only: store_values
  use input_text, only: assignment_t, content, cut, ending, plain, split_element, token_t, unclosed, unix_lines, word
  use looked_up_words, only: advice_about
  use partners, only: n_sides, side_name
  use old_names, only: new_name
  use texts, only: did_you_mean, digits, eol, joined, lower_case, nearest_word, shown, suggestion, text_t, written
  use variables, only: group_names, is_repeated, obstacle_groups, row_of, table, track_of, variables_of
  implicit none
  private
  public :: override_groups, read_groups

  !> Maximum number of groups with the same name, and maximum repeat count n in n*value.
  integer, parameter :: most_instances = 5000, most_repeats = 10000000

  !> Parser of the input, with the groups read so far.
  type :: reader_t
    type(group_t), allocatable :: found(:)          !! groups in the order of the text; size at least n
    integer :: n = 0                                !! number of groups found so far
    type(problem_list_t) :: problems
    logical :: complete = .true.                    !! .false. if part of the text could not be read
    logical :: too_many = .false.                   !! .true. if too many groups have the same name
    type(value_t), allocatable :: defaults(:)       !! values of unset variables
    character(len=:), allocatable :: source         !! default, input text or override being read
    type(token_t), allocatable :: token(:)          !! tokens of `source`
    integer :: at = 1                               !! index of the next token
    character(len=:), allocatable :: own            !! name of the group being read, for messages
    integer :: group = 0                            !! index of the group being read; 0 if unknown
    !> First line of the group being read; 0 between groups.
    integer :: opened = 0
    !> .true. after an unclosed quotation, which may contain the / of the group.
    logical :: quote_open = .false.
  contains
    procedure :: find_defaults
    procedure :: finish
    procedure :: open_source
    procedure :: follow
    procedure :: rest_of_line
    procedure :: skip_line
    procedure :: complain
    procedure :: read_text
    procedure :: between_groups
    procedure :: enter_group
    procedure :: add_group
    procedure :: read_assignment
    procedure :: read_element
    procedure :: read_values
    procedure :: read_repeats
    procedure :: take_assignment
    procedure :: report_unknown
    procedure :: assign_text
    procedure :: override
    procedure :: find_group
    procedure :: replace_cadence
  end type reader_t

contains

  !> Parses the input text and applies the overrides. Unset variables receive their defaults.
  subroutine read_groups(text, overrides, groups, problems, complete)
    character(len=*), intent(in) :: text
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    !> Groups in the order of the table; groups of the same name are adjacent.
    type(group_t), allocatable, intent(out) :: groups(:)
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete      !! .false. if part of the text could not be read
    type(reader_t) :: reader
    integer :: k

    call reader%find_defaults()
    allocate (reader%found(size(group_names) + n_sides + min(count([(text(k:k) == "&", k=1, len(text))]), &
      count(is_repeated(group_names))*most_instances)))
    do k = 1, size(group_names)  ! groups that cannot be repeated exist even if absent from the text
      if (.not. is_repeated(group_names(k))) call reader%add_group(group_names(k), 0, 1)
    end do
    call reader%open_source(unix_lines(text))
    call reader%read_text()
    do k = 1, reader%n
      call reader%found(k)%name_instance()
    end do
    call reader%finish(overrides, groups, problems, complete)
  end subroutine read_groups

  !> Applies overrides to the groups that `read_groups` returned for an input.
  subroutine override_groups(groups, overrides, problems, complete)
    type(group_t), allocatable, intent(inout) :: groups(:)
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete                                !! .false. if a quotation is unclosed
    type(reader_t) :: reader
    integer :: g

    call reader%find_defaults()
    reader%n = size(groups)
    allocate (reader%found(size(groups) + n_sides))
    reader%found(:reader%n) = groups
    do g = 1, reader%n                    ! negative line numbers denote the overrides to be applied
      reader%found(g)%values%line = max(reader%found(g)%values%line, 0)
    end do
    call reader%finish(overrides, groups, problems, complete)
  end subroutine override_groups

  !> Applies the overrides, and returns the groups with their problems.
  subroutine finish(self, overrides, groups, problems, complete)
    class(reader_t), intent(inout) :: self
    type(text_t), intent(in) :: overrides(:)
    type(group_t), allocatable, intent(out) :: groups(:)            !! as in `read_groups`
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete
    integer :: i, j, k

    do k = 1, merge(0, size(overrides), self%too_many)
      call self%override(overrides(k)%text, -k)
    end do
    problems = self%problems
    complete = self%complete
    allocate (groups(self%n))
    i = 0
    do j = 1, size(group_names)
      do k = 1, self%n
        if (self%found(k)%name /= group_names(j)) cycle
        i = i + 1
        groups(i) = self%found(k)
      end do
    end do
  end subroutine finish

  !> Determines the values of unset variables.
  subroutine find_defaults(self)
    class(reader_t), intent(inout) :: self
    type(value_t) :: slot
    integer :: k

    allocate (self%defaults(size(table)))
    do k = 1, size(table)
      slot = value_t(row=k, name=table(k)%name, kind=table(k)%kind)
      if (table(k)%status == "default" .or. table(k)%status == "fallback") &
        call self%assign_text(slot, trim(table(k)%value), 0, 0)
      slot%given = .false.
      self%defaults(k) = slot
    end do
  end subroutine find_defaults

  !> Starts reading the tokens of another text.
  subroutine open_source(self, text)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: text

    self%source = text
    call cut(self%source, self%token)
    self%at = 1
  end subroutine open_source

  !> True if the next tokens are of the given kinds.
  function follow(self, kinds)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: kinds
    logical :: follow
    integer :: i

    follow = all([(self%token(self%at + i - 1)%kind == kinds(i:i), i=1, len(kinds))])
  end function follow

  !> Adds a group with the defaults of the table.
  subroutine add_group(self, name, line, number)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> First line of the group, and its number among the groups of the same name.
    integer, intent(in) :: line, number
    integer, allocatable :: rows(:)
    integer :: v

    self%n = self%n + 1
    rows = pack([(v, v=1, size(table))], table%group == name)
    associate (group => self%found(self%n))
      group%name = name
      group%number = number
      group%line = line
      allocate (group%values(size(rows)))
      do v = 1, size(rows)
        group%values(v) = self%defaults(rows(v))
      end do
    end associate
  end subroutine add_group

  !> Stores a default or an override. Strings in both need no quotes.
  subroutine assign_text(self, slot, text, line, element)
    class(reader_t), intent(inout) :: self
    type(value_t), intent(inout) :: slot
    character(len=*), intent(in) :: text
    integer, intent(in) :: line  !! -k for override number k; 0 for a default
    integer, intent(in) :: element                      !! index of an array element; 0 for the whole variable
    type(assignment_t) :: assignment

    call self%open_source(text//eol)
    assignment%line = line
    assignment%element = element
    assignment%where = trim(table(slot%row)%group)//"."//slot%name
    if (slot%kind == "text" .and. table(slot%row)%size == 1 .and. scan(text, "'""") /= 1) then
      assignment%tokens = [token_t(word, 1, len(text), 0, 1)]
    else
      call self%read_values(assignment)
      if (assignment%sound .and. self%token(self%at)%kind /= ending) &
        call self%complain(assignment, "unexpected "//shown(self%rest_of_line()))
    end if
    call store_values(slot, self%source, assignment, self%problems)
  end subroutine assign_text

  !> Parses the entire input text.
  subroutine read_text(self)
    class(reader_t), intent(inout) :: self

    self%opened = 0
    do while (self%problems%count < most_problems .and. .not. self%too_many)
      if (self%opened == 0) then
        if (self%token(self%at)%kind == ending) return
        call self%between_groups()
        cycle
      end if
      select case (self%token(self%at)%kind)
      case ("/")
        if (self%group > 0) self%found(self%group)%last = self%token(self%at)%first
        self%at = self%at + 1
        self%opened = 0
      case ("&", ending)
        if (self%follow("&"//word) .and. lower_case(content(self%source, self%token(self%at + 1))) == "end") then
          call self%problems%add(self%token(self%at)%line, self%own, "a group ends with /, not with &end")
          self%at = self%at + 2
        else if (.not. self%quote_open) then      ! an unclosed quotation may contain the end of the group
          call self%problems%add(self%opened, self%own, "the closing / is missing")
        end if
        self%opened = 0
      case (word)
        call self%read_assignment()
      case default
        call self%problems%add(self%token(self%at)%line, self%own, "unexpected "//shown(self%rest_of_line()) &
          //"; a variable is set as name = value")
        call self%skip_line()
      end select
    end do
  end subroutine read_text

  !> Parses the text between two groups, where only `&name` is allowed. Other text is reported and
  !> skipped up to the next line that starts with &.
  subroutine between_groups(self)
    class(reader_t), intent(inout) :: self
    character(len=:), allocatable :: problem

    problem = "text outside a group; a group is &name ... /, a comment begins with !"
    if (self%token(self%at)%kind == "&") problem = "the name of a group follows directly after &, without quotes"
    if (self%follow("&"//word) .and. self%token(self%at)%last + 1 == self%token(self%at + 1)%first) then
      self%opened = self%token(self%at)%line
      call self%enter_group(lower_case(content(self%source, self%token(self%at + 1))))
      self%quote_open = .false.
      self%at = self%at + 2
      return
    end if
    call self%problems%add(self%token(self%at)%line, shown(self%rest_of_line()), problem)
    do
      call self%skip_line()
      if (scan(self%token(self%at)%kind, "&"//ending) > 0) return
    end do
  end subroutine between_groups

  !> Skips the rest of a line that cannot be parsed.
  subroutine skip_line(self)
    class(reader_t), intent(inout) :: self
    integer :: line

    self%complete = .false.
    line = self%token(self%at)%line
    do while (self%token(self%at)%line == line .and. self%token(self%at)%kind /= ending)
      self%at = self%at + 1
    end do
  end subroutine skip_line

  !> Text from the next token to the end of its line.
  function rest_of_line(self) result(text)
    class(reader_t), intent(in) :: self
    character(len=:), allocatable :: text

    associate (first => self%token(self%at)%first)
      text = self%source(first:first + index(self%source(first:), eol) - 2)
    end associate
  end function rest_of_line

  !> Parses `name = values`.
  subroutine read_assignment(self)
    class(reader_t), intent(inout) :: self
    type(assignment_t) :: assignment
    character(len=:), allocatable :: name

    name = lower_case(content(self%source, self%token(self%at)))
    assignment%line = self%token(self%at)%line
    assignment%where = self%own//"."//plain(name)
    self%at = self%at + 1
    if (self%token(self%at)%kind == "(") call self%read_element(assignment)
    if (.not. assignment%sound) then
      call self%skip_line()
    else if (self%token(self%at)%kind /= "=") then
      call self%problems%add(assignment%line, assignment%where, "= is missing after the name; a comment begins with !")
      self%complete = .false.
      if (self%token(self%at)%line == assignment%line) call self%skip_line()
    else
      self%at = self%at + 1
      call self%read_values(assignment)
      if (self%group > 0) call self%take_assignment(name, assignment)
    end if
  end subroutine read_assignment

  !> Parses the index of an array element, such as `(2)` in `name(2) = value`.
  subroutine read_element(self, assignment)
    class(reader_t), intent(inout) :: self
    type(assignment_t), intent(inout) :: assignment
    integer :: status

    if (self%follow("("//word//")")) then
      associate (number => self%source(self%token(self%at + 1)%first:self%token(self%at + 1)%last))
        status = 1
        if (verify(number, digits) == 0) read (number, *, iostat=status) assignment%element
        if (status /= 0) assignment%element = 0
      end associate
    end if
    if (assignment%element > 0) then
      self%at = self%at + 3
    else
      call self%complain(assignment, "brackets must contain the number of one value, as in name(2) = value")
    end if
  end subroutine read_element

  !> Reports a problem with an assignment.
  subroutine complain(self, assignment, what)
    class(reader_t), intent(inout) :: self
    type(assignment_t), intent(inout) :: assignment
    character(len=*), intent(in) :: what

    call self%problems%add(merge(self%token(self%at)%line, assignment%line, assignment%line > 0), assignment%where, what)
    assignment%sound = .false.
  end subroutine complain

  !> Parses the values after `=`, up to the next name, the next `/` or `&`, or the end of the text.
  subroutine read_values(self, assignment)
    class(reader_t), intent(inout) :: self
    type(assignment_t), intent(inout) :: assignment
    logical :: after_comma
    integer :: first

    first = self%at
    after_comma = .true.
    do while (scan(self%token(self%at)%kind, "/&"//ending) == 0 &
        .and. .not. (self%follow(word//"=") .or. self%follow(word//"("//word//")=")))
      select case (self%token(self%at)%kind)
      case (",")
        if (after_comma) call self%complain(assignment, "a value is missing before the comma")
      case (word)
        call self%read_repeats(assignment)
      case (unclosed)
        associate (first => self%token(self%at)%first)
          call self%complain(assignment, "the closing quote "//self%source(first:first)//" is missing")
        end associate
        self%quote_open = .true.
        self%complete = .false.
      case ("'", """")
      case default
        call self%complain(assignment, "unexpected "//shown(content(self%source, self%token(self%at))))
      end select
      after_comma = self%token(self%at)%kind == ","
      self%at = self%at + 1
    end do
    if (all(self%token(first:self%at - 1)%kind == ",") .and. assignment%sound) call self%complain(assignment, "it has no value")
    assignment%tokens = pack(self%token(first:self%at - 1), self%token(first:self%at - 1)%kind /= ",")
  end subroutine read_values

  !> Parses a value with a repeat count, as in `3*value`. The value may be a quoted string.
  subroutine read_repeats(self, assignment)
    class(reader_t), intent(inout) :: self
    type(assignment_t), intent(inout) :: assignment
    integer :: star, status

    associate (own => self%token(self%at), next => self%token(self%at + 1))
      star = index(self%source(own%first:own%last), "*")
      if (star < 2) return
      associate (count => self%source(own%first:own%first + star - 2))
        if (verify(count, digits) > 0) return
        status = 1
        if (len(count) <= 8) read (count, *, iostat=status) own%repeats
      end associate
      if (status /= 0 .or. own%repeats < 1 .or. own%repeats > most_repeats) call self%complain(assignment, &
        "the repeat count of "//shown(self%source(own%first:own%last))//" is out of range")
      own%first = own%first + star
      if (own%first <= own%last) return
      if (scan(next%kind, "'"""//unclosed) > 0 .and. next%first == own%first) then
        next%repeats = own%repeats
        own%kind = ","                                  ! kind `,`: the repeat count was read
      else
        call self%complain(assignment, "a value is missing after the *")
      end if
    end associate
  end subroutine read_repeats

  !> Starts the group to which the following assignments belong.
  subroutine enter_group(self, name)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer :: instances, g

    self%own = plain(name)
    do g = self%n, 1, -1                                ! `g` ends at 0 if there is no such group
      if (self%found(g)%name == name) exit
    end do
    self%group = g
    instances = 0
    if (self%group > 0) instances = self%found(self%group)%number
    if (all(group_names /= name)) then
      self%complete = .false.
      call self%problems%add(self%opened, "&"//self%own, "unknown group; "//advice_about(name, suggestion(name, group_names)))
    else if (.not. is_repeated(name)) then
      if (self%found(self%group)%line > 0) call self%problems%add(self%opened, name, &
        "a second group of this name; the first is in line "//written(self%found(self%group)%line))
      if (self%found(self%group)%line == 0) self%found(self%group)%line = self%opened
    else if (instances < most_instances) then
      call self%add_group(name, self%opened, instances + 1)
      self%group = self%n
    else
      self%problems = problem_list_t()                    ! reading ends here; other problems are not reported
      call self%problems%add(self%opened, name, "more than "//written(most_instances)//" groups of this name" &
        //trim(merge("; a file may hold many obstacles (file)", repeat(" ", 39), any(obstacle_groups == name))))
      self%too_many = .true.
      self%complete = .false.
      self%group = 0
    end if
    if (self%group > 0) self%found(self%group)%first = self%token(self%at)%first
  end subroutine enter_group

  !> Stores the values of one assignment.
  subroutine take_assignment(self, name, assignment)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(assignment_t), intent(in) :: assignment
    integer :: row, elements

    associate (group => self%found(self%group))
      row = row_of(group%name, name)
      if (row == 0) then
        call self%report_unknown(trim(group%name), name, assignment%line, self%group)
        return
      end if
      elements = -1
      if (assignment%element > 0) elements = ibset(0, min(assignment%element, 30))
      associate (slot => group%values(row))
        if (iand(slot%elements, elements) /= 0) then
          call self%problems%add(assignment%line, assignment%where, "is set twice; the first time in line "//written(slot%line))
        else
          slot%elements = ior(slot%elements, elements)
          call store_values(slot, self%source, assignment, self%problems)
        end if
      end associate
    end associate
  end subroutine take_assignment

  !> Reports an unknown variable. The message suggests the correct name if the variable is misspelt,
  !> was renamed, or belongs to another group. A misspelt or renamed variable is marked as faulty.
  !> Therefore it is not also reported as missing.
  subroutine report_unknown(self, group, name, line, g)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: line
    integer, intent(in) :: g                            !! index of the group; 0 if unknown
    character(len=:), allocatable :: meant, problem
    integer :: row

    meant = new_name(group, name, "")
    problem = "is called "//meant//" now"
    if (meant == "") then
      meant = nearest_word(name, variables_of(group))
      problem = "unknown variable; "//advice_about(name, suggestion(name, variables_of(group), to_see_all="--explain "//group))
    end if
    call self%problems%add(line, group//"."//plain(name), problem)
    row = row_of(group, meant)
    if (g == 0 .or. row == 0) return
    associate (slot => self%found(g)%values(row))
      if (slot%given) return
      slot%line = line
      slot%given = .true.
      slot%faulty = .true.
    end associate
  end subroutine report_unknown

  !> Applies an override `GROUP.VARIABLE=VALUE` or `GROUP.NAME.VARIABLE=VALUE`. VARIABLE may be an
  !> element of an array, such as `gravity(2)`. An empty VALUE restores the default.
  subroutine override(self, text, line)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    integer, intent(in) :: line                         !! -k for override number k
    type(value_t) :: slot
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
      call self%problems%add(line, "override", "expects GROUP.VARIABLE=VALUE; "//advice_about(name, "an example is run.seed=7"))
    else if (all(group_names /= group)) then
      advice = suggestion(group, group_names)
      g = findloc(self%found(:self%n)%instance, text(:first - 1), dim=1)
      if (g > 0) advice = did_you_mean(trim(self%found(g)%name)//"."//text(:equals - 1))
      call self%problems%add(line, plain(group), "unknown group; "//advice)
    else
      g = 0       ! an unknown variable of several groups is not called ambiguous as well
      if (row > 0 .or. instance /= "" .or. count(self%found(:self%n)%name == group) == 1) &
        call self%find_group(group, instance, line, g)
      if (row == 0) call self%report_unknown(group, name, line, g)
      if (row == 0 .or. g == 0) return
      if (equals == len(text) .and. element == 0) then
        self%found(g)%values(row) = self%defaults(self%found(g)%values(row)%row)
      else
        slot = self%found(g)%values(row)
        call self%assign_text(slot, text(equals + 1:), line, element)
        self%found(g)%values(row) = slot
        call self%replace_cadence(g, name)
      end if
      call self%found(g)%name_instance()
    end if
  end subroutine override

  !> Removes the sampling interval that the file sets, if an override sets an interval of another
  !> kind for the same samples. The override then replaces it.
  subroutine replace_cadence(self, g, name)
    class(reader_t), intent(inout) :: self
    integer, intent(in) :: g                            !! index of the group
    character(len=*), intent(in) :: name                !! variable set by the override
    integer :: v

    if (track_of(name) == "") return
    do v = 1, size(self%found(g)%values)
      associate (slot => self%found(g)%values(v))
        if (slot%line > 0 .and. slot%name /= name .and. track_of(slot%name) == track_of(name)) &
          slot = self%defaults(slot%row)
      end associate
    end do
  end subroutine replace_cadence

  !> Finds the group to which an override refers. A missing group of a side is created. Any other
  !> override must match exactly one group; otherwise a problem is reported and g is set to 0.
  subroutine find_group(self, group, instance, line, g)
    class(reader_t), intent(inout) :: self
    character(len=*), intent(in) :: group, instance
    integer, intent(in) :: line
    integer, intent(out) :: g
    logical, dimension(self%n) :: of_group, matches
    type(value_t) :: slot

    of_group = self%found(:self%n)%name == group
    matches = of_group .and. (instance == "" .or. self%found(:self%n)%instance == instance)
    g = findloc(matches, .true., dim=1)
    if (count(matches) == 1) return
    if (group == "side" .and. any(side_name == instance) .and. .not. any(matches)) then
      call self%add_group(group, 0, count(of_group) + 1)
      g = self%n
      slot = self%found(g)%values(row_of(group, "name"))
      call self%assign_text(slot, instance, line, 0)
      self%found(g)%values(row_of(group, "name")) = slot
      return
    end if
    g = 0
    associate (names => pack(self%found(:self%n)%instance, of_group))
      if (size(names) == 0) then
        call self%problems%add(line, group, "the input has no &"//group)
      else if (instance == "") then
        call self%problems%add(line, group, "several groups have this name; write "//group//"."//trim(names(1)) &
          //".VARIABLE; known: "//joined(names, ", "))
      else if (any(matches)) then
        call self%problems%add(line, group//"."//instance, "several groups have this name")
      else
        call self%problems%add(line, group//"."//instance, "the input has no &"//group//" with this name; " &
          //suggestion(instance, names))
      end if
    end associate
  end subroutine find_group

end module namelist_input
