!> What the program says of its variables: the reference file, the answers to `--explain`, and JSON for other programs: the
!> table of variables, and an input as the program has understood it.
module variable_help
  use errors, only: error_t, exit_usage, fail
  use input_groups, only: group_t, json_text
  use old_names, only: present_names
  use variables, only: allowed, group_names, in_motion, is_repeated, largest, name_length, on_resume, smallest, table, &
    variable_t, wall_groups, words_of
  use texts, only: eol, growing_text_t, joined, lower_case, shown, suggestion, wrapped, written, written_exactly
  implicit none
  private
  public :: defaults_text, explain, groups_text, input_of, variables_text

  integer, parameter :: comment_column = 40                !! of the reference file
  integer, parameter :: help_width = 100                   !! of a line of help

contains

  !> The reference input file: every variable with its default. It is a valid input itself.
  pure function defaults_text() result(text)
    character(len=:), allocatable :: text
    integer :: g, k

    text = "! Every variable of Ricochet with its default; a file needs only what differs."//eol// &
      "! A variable that is commented out or called an example has no default, or not in all cases."//eol// &
      "! Groups may be in any order; &side, &obstacle, &wall and &species may be repeated."//eol
    do g = 1, size(group_names)
      text = text//eol//margin(group_names(g))//"&"//trim(group_names(g))//eol
      do k = 1, size(table)
        if (table(k)%group == group_names(g)) text = text//reference_line(table(k))//eol
      end do
      text = text//margin(group_names(g))//"/"//eol
    end do
  end function defaults_text

  !> The groups of walls are comments.
  pure function margin(group)
    character(len=*), intent(in) :: group
    character(len=:), allocatable :: margin

    margin = ""
    if (any(wall_groups == group)) margin = "! "
  end function margin

  !> A variable in the reference file. Its help continues in comment lines, and a choice has one more that lists its words.
  pure function reference_line(row) result(line)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: line
    character(len=:), allocatable :: indent, meaning, next

    indent = "  "
    if (row%status /= "default" .and. row%status /= "example") indent = "  ! "
    if (any(wall_groups == row%group)) indent = "!   "
    next = padded(margin(row%group))//" ! "
    meaning = trim(row%help)
    if (row%status == "example") meaning = "an example: "//meaning
    if (row%unit /= "") meaning = meaning//" ["//trim(row%unit)//"]"
    line = padded(indent//trim(row%name)//" = "//trim(row%value))//" ! "//wrapped(meaning, help_width, next)
    if (row%choices /= "") line = line//eol//next//allowed(row)
  end function reference_line

  !> A text with blanks up to the comments, if it is not longer.
  pure function padded(text)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: padded

    padded = text//repeat(" ", max(comment_column - len(text), 0))
  end function padded

  !> Answers `--explain`: a variable with or without its group, or a whole group.
  pure subroutine explain(name, text, error)
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=len(name)) :: wanted
    character(len=name_length + 9) :: full(size(table))
    integer :: k

    wanted = lower_case(name)
    text = ""
    do k = 1, size(table)
      full(k) = trim(table(k)%group)//"."//table(k)%name
      if (all([character(len=len(full)) :: table(k)%name, table(k)%group, full(k)] /= wanted)) cycle
      if (text /= "") text = text//eol
      text = text//explanation(table(k))
    end do
    if (text /= "") return
    if (present_names(trim(wanted)) /= "") then
      call fail(error, exit_usage, "--explain "//shown(name)//": is called "//present_names(trim(wanted))//" now")
      return
    end if
    call fail(error, exit_usage, "--explain "//shown(name)//": unknown variable; " &
      //suggestion(wanted, [character(len=len(full)) :: table%name, full, group_names], group_names))
  end subroutine explain

  !> Name and unit of a variable, its meaning, what is allowed, and its default or an example.
  pure function explanation(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text
    character(len=*), parameter :: indent = eol//"    "

    text = trim(row%group)//"."//trim(row%name)
    if (row%unit /= "") text = text//"  ["//trim(row%unit)//"]"
    text = text//indent//wrapped(row%help, help_width, indent(2:))//indent//"allowed: "//allowed(row)//indent
    if (row%status == "default" .or. row%status == "fallback") then
      text = text//"default: "//trim(row%value)
    else
      text = text//"example: "//trim(row%value)
    end if
    if (row%may_change == on_resume) text = text//indent//"may change on --resume"
    if (row%may_change == in_motion) text = text//indent//"may change in a running simulation"
  end function explanation

  !> The table: an object for each group, and in it one for each variable.
  pure function variables_text() result(text)
    character(len=:), allocatable :: text, between
    integer :: g, k

    text = "{"
    between = eol
    do g = 1, size(group_names)
      text = text//between//json_text(group_names(g))//": {"
      between = eol
      do k = 1, size(table)
        if (table(k)%group /= group_names(g)) cycle
        text = text//between//"  "//json_text(table(k)%name)//": {"//row_text(table(k))//"}"
        between = ","//eol
      end do
      text = text//"}"
    end do
    text = text//eol//"}"
  end function variables_text

  !> A row of the table. Of a number `above` and `below` are excluded, `from` and `to` allowed.
  pure function row_text(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text, value
    character(len=len(row%goes_with)) :: words(size(words_of(row%goes_with)))
    logical :: has_default, is_example, positive
    integer :: i

    value = trim(row%value)
    do i = 1, len(value)
      if (value(i:i) == "'") value(i:i) = """"
    end do
    if (row%kind == "logical") value = value(2:len(value) - 1)
    if (row%size /= 1) value = "["//value//"]"
    has_default = row%status == "default" .or. row%status == "fallback"
    is_example = .not. has_default
    words = words_of(row%goes_with)
    associate (low => row%range%lower, high => row%range%upper)
      positive = low > 0 .and. low <= smallest
      text = """type"": "//json_text(row%kind)//member("size", .true., written(row%size))// &
        member("default", has_default, value)//member("example", is_example, value)// &
        member("needed", .true., trim(merge("true ", "false", row%status == "example")))// &
        member("above", positive, "0")//member("from", low > -largest .and. .not. positive, written(low))// &
        member("below", high < 1, "1")//member("to", high >= 1 .and. high < largest, written(high))
    end associate
    text = text//member("choices", row%choices /= "", list(words_of(row%choices)))// &
      member("unit", row%unit /= "", json_text(row%unit))//member("help", .true., json_text(row%help))// &
      member("allowed", .true., json_text(allowed(row)))//", ""goes_with"": {"
    if (size(words) > 0) text = text//json_text(words(1))//": "//list(words(2:))
    text = text//"}"//member("excludes", row%excludes /= "", list(words_of(row%excludes)))// &
      member("repeated", .true., trim(merge("true ", "false", is_repeated(row%group))))// &
      member("resumable", .true., trim(merge("true ", "false", row%may_change == on_resume)))// &
      member("changeable", .true., trim(merge("true ", "false", row%may_change == in_motion)))
  end function row_text

  !> The groups of an input in the order of the file, each with what is given in it. `from` and `to` are its place in the
  !> bytes of the file, counted from 0, without byte order mark and with line feeds as line ends; null: not in the file.
  pure function groups_text(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    character(len=:), allocatable :: between
    logical :: waiting(size(groups))
    integer :: g, k, n

    between = ""
    waiting = [(groups(g)%line > 0 .or. any(groups(g)%values%given), g=1, size(groups))]
    do n = 1, count(waiting)
      g = minloc(merge(groups%first, huge(g), groups%line > 0), dim=1, mask=waiting)
      waiting(g) = .false.
      call growing%add(trim(merge(",", " ", n > 1))//eol)
      associate (group => groups(g), is_there => groups(g)%line > 0)
        call growing%add("{""group"": "//json_text(group%name)//member("name", group%instance /= "", json_text(group%instance)) &
          //member("from", is_there, written(group%first - 1))//member("to", is_there, written(group%last))//", ""values"": {")
        between = ""
        do k = 1, size(group%values)
          if (.not. (group%values(k)%given .and. group%values(k)%is_set())) cycle
          call growing%add(between//json_text(group%values(k)%name)//": "//group%values(k)%json())
          between = ", "
        end do
        call growing%add("}}")
      end associate
    end do
    text = "["//growing%text()//eol//"]"
  end function groups_text

  !> An input file that says the same. Sizes of species are as used, and so relative to nothing.
  pure function input_of(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: g, k, i
    logical :: relative

    do g = 1, size(groups)
      if (.not. any(groups(g)%values%given)) cycle
      relative = any(groups(g)%values%name == "relative_to" .and. groups(g)%values%given)
      call growing%add("&"//trim(groups(g)%name)//eol)
      do k = 1, size(groups(g)%values)
        associate (value => groups(g)%values(k))
          if (.not. value%is_set() .or. value%name == "relative_to") cycle
          if (.not. (value%given .or. (relative .and. any(value%name == ["mass  ", "radius"])))) cycle
          call growing%add("  "//trim(value%name)//" = ")
          if (allocated(value%reals)) then
            do i = 1, size(value%reals)
              if (i > 1) call growing%add(", ")
              call growing%add(written_exactly(value%reals(i)))
            end do
          else
            do i = 1, size(value%texts)
              if (i > 1) call growing%add(", ")
              call growing%add(word(value%kind, value%texts(i)))
            end do
          end if
          call growing%add(eol)
        end associate
      end do
      call growing%add("/"//eol)
    end do
    text = growing%text()
  contains

    !> A value that is no real number: texts in quotes.
    pure function word(kind, value)
      character(len=*), intent(in) :: kind, value
      character(len=:), allocatable :: word
      integer :: c

      word = trim(value)
      if (kind /= "text") return
      word = "'"
      do c = 1, len_trim(value)
        word = word//value(c:c)
        if (value(c:c) == "'") word = word//"'"
      end do
      word = word//"'"
    end function word
  end function input_of

  !> `, "name": value`, with null instead of a value that is not there.
  pure function member(name, is_there, value) result(text)
    character(len=*), intent(in) :: name, value
    logical, intent(in) :: is_there
    character(len=:), allocatable :: text

    text = ", "//json_text(name)//": null"
    if (is_there) text = text(:len(text) - 4)//value
  end function member

  !> A list of words.
  pure function list(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text

    text = "[]"
    if (size(words) > 0) text = "["""//joined(words, """, """)//"""]"
  end function list

end module variable_help
