!> Reads input text and the `--set` overrides: text to statements to values. Every problem is collected.
module namelist_input
  use input_groups, only: group_t, value_t
  use input_problems, only: problem_list_t
  use input_text, only: unix_lines
  use input_words, only: store_values
  use namelist_scanner, only: group_start, plain, scanner_t, setting, statement_t, token_t
  use texts, only: joined, lower_case, place_of, shown, suggestion, text_t, written
  use variables, only: full_names, group_names, is_repeated, row_of, table, track_of, variables_of
  implicit none
  private
  public :: read_groups

  integer, parameter :: most_instances = 5000           !! of each of the repeated groups
  character(len=*), parameter :: eol = new_line("a")

contains

  !> Reads the text and applies the overrides: every value as given, or its default.
  subroutine read_groups(text, overrides, groups, problems, complete)
    character(len=*), intent(in) :: text
    type(text_t), intent(in) :: overrides(:)                        !! GROUP.VARIABLE=VALUE
    type(group_t), allocatable, intent(out) :: groups(:)            !! in the order of the table, those of one name side by side
    type(problem_list_t), intent(out) :: problems
    logical, intent(out) :: complete                                !! .false.: parts of the text were skipped
    type(group_t), allocatable :: found(:)                          ! in the order of the text
    integer :: n, instances(size(group_names)), i, j, k             ! n: groups found; instances: of each name

    complete = .true.
    n = 0
    instances = 0
    allocate (found(size(group_names) + min(count([(text(k:k) == "&", k=1, len(text))]), &
      count(is_repeated(group_names))*most_instances)))
    do k = 1, size(group_names)                                     ! groups that cannot be repeated exist from the start
      if (.not. is_repeated(group_names(k))) call add_group(group_names(k), 0)
    end do
    call read_statements(unix_lines(text))
    do k = 1, n
      call name_instance(found(k))
    end do
    do k = 1, size(overrides)
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

    !> Adds a group with the defaults of the table.
    subroutine add_group(name, line)
      character(len=*), intent(in) :: name
      integer, intent(in) :: line
      integer, allocatable :: rows(:)
      integer :: v

      n = n + 1
      rows = pack([(v, v=1, size(table))], table%group == name)
      associate (group => found(n), number => instances(place_of(name, group_names)))
        number = number + 1
        group%name = name
        group%number = number
        group%line = line
        allocate (group%values(size(rows)))
        do v = 1, size(rows)
          group%values(v)%row = rows(v)
          call reset(group%values(v))
        end do
      end associate
    end subroutine add_group

    !> Leaves a variable as if it were not in the file.
    subroutine reset(slot)
      type(value_t), intent(inout) :: slot

      associate (row => table(slot%row))
        slot = value_t(row=slot%row, name=row%name, kind=row%kind)
        if (row%status == "default" .or. row%status == "fallback") call assign_text(slot, trim(row%value), 0)
        slot%given = .false.
      end associate
    end subroutine reset

    !> Stores a value that is not from the file: a default, or that of an override, where text needs no quotes.
    subroutine assign_text(slot, text, line)
      type(value_t), intent(inout) :: slot
      character(len=*), intent(in) :: text
      integer, intent(in) :: line                         !! -k: override k; 0: a default
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
    subroutine read_statements(text)
      character(len=*), intent(in) :: text
      type(scanner_t) :: scanner
      type(statement_t) :: statement
      integer :: group                                    ! to which assignments belong; 0: its name is unknown

      scanner%text = text
      group = 0
      do while (.not. problems%is_full())
        call scanner%next_statement(statement, problems)
        if (group > 0 .and. statement%kind /= setting) found(group)%last = scanner%closed
        if (statement%kind == group_start) then
          call enter_group(statement, group)
        else if (statement%kind /= setting) then
          exit                                            ! the end of the text
        else if (group > 0) then
          call take_assignment(found(group), scanner, statement)
        end if
      end do
      if (scanner%lost) complete = .false.
    end subroutine read_statements

    !> Finds the group to which the following assignments belong.
    subroutine enter_group(statement, group)
      type(statement_t), intent(in) :: statement
      integer, intent(out) :: group

      associate (name => statement%name, line => statement%line)
        group = 0
        if (all(group_names /= name)) then
          complete = .false.
          call problems%add(line, "&"//plain(name), "unknown group; "//suggestion(name, group_names))
        else if (.not. is_repeated(name)) then
          group = place_of(name, found(:n)%name)
          if (found(group)%line > 0) call problems%add(line, name, &
            "a second group of this name; the first is in line "//written(found(group)%line))
          if (found(group)%line == 0) found(group)%line = line
        else if (instances(place_of(name, group_names)) == most_instances) then
          call problems%add(line, name, "more than "//written(most_instances)//" groups of this name")
        else
          call add_group(name, line)
          group = n
        end if
        if (group > 0) found(group)%first = statement%first
      end associate
    end subroutine enter_group

    !> Stores the values of one assignment.
    subroutine take_assignment(group, scanner, statement)
      type(group_t), intent(inout) :: group
      type(scanner_t), intent(in) :: scanner
      type(statement_t), intent(in) :: statement
      integer :: row, elements

      row = row_of(group%name, statement%name)
      if (row == 0) then
        call report_unknown(group%name, statement%name, statement%line)
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
    subroutine report_unknown(group, name, line)
      character(len=*), intent(in) :: group, name
      integer, intent(in) :: line
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
    subroutine override(text, line)
      character(len=*), intent(in) :: text
      integer, intent(in) :: line                         !! -k for override k
      character(len=:), allocatable :: group, instance, name, advice
      integer :: equals, first, last, row, g

      equals = index(text, "=")
      first = index(text(:max(equals - 1, 0)), ".")
      last = index(text(:max(equals - 1, 0)), ".", back=.true.)
      group = lower_case(trim(adjustl(text(:first - 1))))
      name = lower_case(trim(adjustl(text(last + 1:equals - 1))))
      instance = ""
      if (last > first) instance = text(first + 1:last - 1)
      row = row_of(group, name)
      if (group == "" .or. name == "") then
        advice = ", as in run.seed=7"
        if (full_names(name) /= "") advice = "; did you mean "//full_names(name)//"?"
        call problems%add(line, "override", "expects GROUP.VARIABLE=VALUE"//advice)
      else if (all(group_names /= group)) then
        call problems%add(line, plain(group), "unknown group; "//suggestion(group, group_names))
      else if (row == 0) then
        call report_unknown(group, name, line)
      else
        call find_group(group, instance, line, g)
        if (g == 0) return
        if (equals == len(text)) then
          call reset(found(g)%values(row))
        else
          call assign_text(found(g)%values(row), text(equals + 1:), line)
          call replace_cadence(found(g), name)
        end if
        call name_instance(found(g))
      end if
    end subroutine override

    !> A cadence set by an override takes the place of that which the file has for the same samples.
    subroutine replace_cadence(group, name)
      type(group_t), intent(inout) :: group
      character(len=*), intent(in) :: name                !! of the variable that is set
      integer :: v

      if (track_of(name) == "") return
      do v = 1, size(group%values)
        associate (slot => group%values(v))
          if (slot%line > 0 .and. slot%name /= name .and. track_of(slot%name) == track_of(name)) call reset(slot)
        end associate
      end do
    end subroutine replace_cadence

    !> Finds the group that an override means; 0, and a problem, if there is none.
    subroutine find_group(group, instance, line, g)
      character(len=*), intent(in) :: group, instance
      integer, intent(in) :: line
      integer, intent(out) :: g
      logical, dimension(n) :: of_group, matches

      of_group = found(:n)%name == group
      matches = of_group .and. (instance == "" .or. found(:n)%instance == instance)
      g = findloc(matches, .true., dim=1)
      if (count(matches) == 1) return
      g = 0
      associate (names => pack(found(:n)%instance, of_group))
        if (size(names) == 0) then
          call problems%add(line, group, "the input has no &"//group)
        else if (instance == "") then
          call problems%add(line, group, "which one? write "//group//"."//trim(names(1))//".VARIABLE; known: "//joined(names, ", "))
        else
          call problems%add(line, group//"."//instance, "unknown or not unique; "//suggestion(instance, names))
        end if
      end associate
    end subroutine find_group
  end subroutine read_groups

end module namelist_input
