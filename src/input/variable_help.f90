!> Texts about the input variables: the reference input file, the output of `--explain`, and JSON
!> for other programs (the table of variables, and an input with its values).
module variable_help
  use choices, only: meaning_of
  use errors, only: error_t, exit_usage, fail
  use input_groups, only: group_t, json_text
  use looked_up_words, only: meant_variables, word_length
  use old_names, only: present_names
  use variables, only: allowed, either, excluded_by, first_sentence, group_names, in_motion, is_repeated, largest, name_length, &
    on_resume, smallest, table, variable_t, wall_groups, words_of
  use texts, only: eol, growing_text_t, joined, lower_case, shown, suggestion, wrapped, written, written_exactly
  implicit none
  private
  public :: defaults_text, explain, groups_text, input_of, quoted, variables_text

  integer, parameter :: comment_column = 40                !! column of the comments in the reference file
  integer, parameter :: help_width = 100                   !! line width of the help

contains

  !> The reference input file: a valid input that contains every variable with its default.
  pure function defaults_text() result(text)
    character(len=:), allocatable :: text
    integer :: g, k

    text = "! Every variable of Ricochet with its default; a file needs only what differs."//eol// &
      "! A variable that is commented out or called an example has no default, or not in all cases."//eol// &
      "! ricochet --explain VARIABLE says more about each."//eol// &
      "! Groups may be in any order; &side, &obstacle, &wall, &species, &source and &change may be repeated."//eol
    do g = 1, size(group_names)
      text = text//eol//margin(group_names(g))//"&"//trim(group_names(g))//eol
      do k = 1, size(table)
        if (table(k)%group == group_names(g)) text = text//reference_line(table(k))//eol
      end do
      text = text//margin(group_names(g))//"/"//eol
    end do
  end function defaults_text

  !> Prefix of the lines of a group in the reference file. Groups of boundaries and changes are
  !> commented out.
  pure function margin(group)
    character(len=*), intent(in) :: group
    character(len=:), allocatable :: margin

    margin = ""
    if (any(wall_groups == group) .or. group == "source" .or. group == "change") margin = "! "
  end function margin

  !> Lines of a variable in the reference file, with the first sentence of its help text and its
  !> keywords, if it has any.
  pure function reference_line(row) result(line)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: line
    character(len=:), allocatable :: indent, meaning, next

    indent = "  "
    if (row%status /= "default" .and. row%status /= "example") indent = "  ! "
    if (margin(row%group) /= "") indent = "!   "
    next = padded(margin(row%group))//" ! "
    meaning = first_sentence(row%help)
    if (row%status == "example") meaning = "Example. "//meaning
    if (row%unit /= "") meaning = meaning//" ["//trim(row%unit)//"]"
    line = padded(indent//trim(row%name)//" = "//trim(row%value))//" ! "//wrapped(meaning, help_width, next)
    if (row%choices /= "") line = line//eol//next//allowed(row)
  end function reference_line

  !> Pads a line with blanks up to the column of comments.
  pure function padded(text)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: padded

    padded = text//repeat(" ", max(comment_column - len(text), 0))
  end function padded

  !> Output of `--explain`. The topic is a variable, with or without its group, or a group. Any
  !> other topic is searched for in names, keywords and help texts. The variables that a user may
  !> mean by the topic are listed, too.
  pure subroutine explain(name, text, error)
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: wanted, now, meant
    character(len=name_length + 9) :: names(size(table)), full(size(table))
    logical :: of_group(size(table))
    integer :: k

    wanted = bare(lower_case(trim(name)))
    do k = 1, size(table)
      names(k) = table(k)%name
      full(k) = trim(table(k)%group)//"."//table(k)%name
      of_group(k) = table(k)%group == wanted
    end do
    text = explanations(pack([(k, k=1, size(table))], of_group))// &
      explanations(pack([(k, k=1, size(table))], names == wanted .or. full == wanted))
    if (text /= "") then
      text = text(:len(text) - len(eol))
      if (size(meant_variables(wanted)) > 0) text = text//eol//"see also"//eol//summaries(meant_variables(wanted))
      return
    end if
    now = present_names(wanted, of_choices=.false.)
    if (now == "") text = matches(wanted)
    meant = summaries(meant_variables(wanted))
    if (meant /= "" .and. text /= "") text = eol//text
    text = meant//text
    if (text /= "") return
    if (now == "") now = present_names(wanted, of_choices=.true.)
    if (now /= "") then
      call fail(error, exit_usage, "--explain "//shown(name)//": is called "//now//" now")
    else
      call fail(error, exit_usage, "--explain "//shown(name)//": no variable, choice or help contains this (the pages " &
        //"in docs/ have a search: make docs); " &
        //suggestion(wanted, [character(len=len(full)) :: names, full, group_names], group_names))
    end if
  end subroutine explain

  !> Explanations of several variables.
  pure function explanations(rows) result(text)
    integer, intent(in) :: rows(:)                         !! row numbers in the table of variables
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, size(rows)
      text = text//explanation(rows(k))//eol
    end do
  end function explanations

  !> Name of a variable without the index of an element and without the name of a species or
  !> boundary. For example, `species.gas.velocity(2)` becomes `species.velocity`.
  pure function bare(name)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: bare
    integer :: first, last

    bare = name(:index(name//"(", "(") - 1)
    first = index(bare, ".")
    last = index(bare, ".", back=.true.)
    if (last > first) bare = bare(:first)//bare(last + 1:)
  end function bare

  !> One line for each of several variables, with the first sentence of its help text.
  pure function summaries(names) result(text)
    character(len=word_length), intent(in) :: names(:)     !! full names
    character(len=:), allocatable :: text
    integer :: n, k

    text = ""
    do n = 1, size(names)
      do k = 1, size(table)
        associate (full => trim(table(k)%group)//"."//trim(table(k)%name))
          if (full == names(n)) text = text//eol//full//": "//first_sentence(table(k)%help)
        end associate
      end do
    end do
    text = text(min(len(eol), len(text)) + 1:)
  end function summaries

  !> Search results of `--explain`: all variables with the wanted text in the name or help text, and
  !> all keywords with the wanted text in the keyword or its meaning.
  pure function matches(wanted) result(text)
    character(len=*), intent(in) :: wanted                 !! the wanted text in lower case
    character(len=:), allocatable :: text
    integer :: k, c

    text = ""
    do k = 1, size(table)
      associate (row => table(k), full => trim(table(k)%group)//"."//trim(table(k)%name), words => words_of(table(k)%choices))
        if (has(full) .or. has(row%help)) text = text//eol//full//": "//first_sentence(row%help)
        do c = 1, size(words)
          if (has(words(c)) .or. has(meaning_of(row%name, words(c)))) text = text//eol//full//" = '"//trim(words(c))//"': " &
            //meaning_of(row%name, words(c))
        end do
      end associate
    end do
    text = text(len(eol) + 1:)
  contains

    !> True if a text contains the wanted text. Underscores and blanks are equivalent, as in
    !> `packing_fraction` and `packing fraction`.
    pure function has(where) result(yes)
      character(len=*), intent(in) :: where
      logical :: yes

      yes = index(spaced(lower_case(where)), spaced(wanted)) > 0
    end function has

    !> Replaces underscores by blanks.
    pure function spaced(name)
      character(len=*), intent(in) :: name
      character(len=len(name)) :: spaced
      integer :: i

      spaced = name
      do i = 1, len(name)
        if (name(i:i) == "_") spaced(i:i) = " "
      end do
    end function spaced
  end function matches

  !> Explanation of a variable, with one line for each property.
  pure function explanation(k) result(text)
    integer, intent(in) :: k                               !! row number in the table of variables
    character(len=:), allocatable :: text
    character(len=*), parameter :: indent = eol//"    "
    integer :: c

    associate (row => table(k), words => words_of(table(k)%choices))
      text = trim(row%group)//"."//trim(row%name)
      if (row%unit /= "") text = text//"  ["//trim(row%unit)//"]"
      text = text//indent//wrapped(row%help, help_width, indent(2:))//indent//"allowed: "//allowed(row)
      do c = 1, size(words)
        text = text//indent//"  "//wrapped("'"//trim(words(c))//"': "//meaning_of(row%name, words(c)), help_width, &
          indent(2:)//"    ")
      end do
      text = text//indent//"default: "//default_of(row)
      if (row%status /= "default" .and. row%status /= "fallback") text = text//indent//"example: "//trim(row%value)
      if (condition_of(row) /= "") text = text//indent//"applies with: "//condition_of(row)
      if (size(excluded_by(k)) > 0) text = text//indent//"not together with: "//joined(excluded_by(k), ", ")
      text = text//indent//change_text(row)
    end associate
  end function explanation

  !> Default of a variable, or a description of the behaviour if the variable is not set.
  pure function default_of(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text

    if (row%status == "default" .or. row%status == "fallback") then
      text = trim(row%value)
    else if (row%otherwise /= "") then
      text = trim(row%otherwise)
    else
      text = "none; must be given"
      if (row%goes_with /= "") text = text//" where it applies"
    end if
  end function default_of

  !> Condition under which a variable has an effect, such as a choice made by another variable;
  !> empty if it always has an effect. In `&species`, setting the variable implies the choice if the
  !> user has not made one.
  pure function condition_of(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text

    text = ""
    if (row%goes_with == "") return
    associate (words => words_of(row%goes_with))
      text = trim(row%group)//"."//trim(words(1))//" = "//either(words(2:))
      if (row%group == "species") text = text//"; if "//trim(words(1))//" is not given, "//trim(row%name)//" sets " &
        //trim(words(1))//" = '"//trim(words(2))//"'"
    end associate
  end function condition_of

  !> States when a variable may be changed after the start of a run.
  pure function change_text(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text

    text = "fixed during a run: another value needs a new run"
    if (row%may_change == on_resume) text = "may change on --resume"
    if (row%may_change == in_motion) text = "may change in a running simulation (&change, Python, laboratory page); fixed on " &
      //"--resume"
  end function change_text

  !> Converts the table of variables to JSON: one object per group, which contains one object per
  !> variable.
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
        text = text//between//"  "//json_text(table(k)%name)//": {"//row_text(k)//"}"
        between = ","//eol
      end do
      text = text//"}"
    end do
    text = text//eol//"}"
  end function variables_text

  !> Converts a row of the table of variables to JSON. The bounds of a number are called `from` and
  !> `to` if the bounds themselves are allowed. Otherwise they are called `above` and `below`.
  pure function row_text(k) result(text)
    integer, intent(in) :: k                               !! row number in the table of variables
    character(len=:), allocatable :: text, value, meanings
    type(variable_t) :: row
    character(len=len(table%goes_with)) :: words(size(words_of(table(k)%goes_with)))
    character(len=len(table%choices)) :: choices(size(words_of(table(k)%choices)))
    logical :: has_default, is_example, positive
    integer :: i

    row = table(k)
    choices = words_of(row%choices)
    meanings = ""
    do i = 1, size(choices)
      meanings = meanings//", "//json_text(choices(i))//": "//json_text(meaning_of(row%name, choices(i)))
    end do
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
    text = text//member("choices", row%choices /= "", list(choices))// &
      member("meanings", row%choices /= "", "{"//meanings(min(3, len(meanings) + 1):)//"}")// &
      member("otherwise", row%otherwise /= "", json_text(row%otherwise))// &
      member("unit", row%unit /= "", json_text(row%unit))//member("help", .true., json_text(row%help))// &
      member("allowed", .true., json_text(allowed(row)))//", ""goes_with"": {"
    if (size(words) > 0) text = text//json_text(words(1))//": "//list(words(2:))
    text = text//"}"//member("excludes", size(excluded_by(k)) > 0, list(excluded_by(k)))// &
      member("repeated", .true., trim(merge("true ", "false", is_repeated(row%group))))// &
      member("resumable", .true., trim(merge("true ", "false", row%may_change == on_resume)))// &
      member("changeable", .true., trim(merge("true ", "false", row%may_change == in_motion)))
  end function row_text

  !> Converts the groups of an input to JSON, in the order of the file and only with the variables
  !> set by the user. `from` and `to` are the positions of the first and the last byte of the group
  !> in the file, or null if the file does not contain the group. Positions start at 0 and refer to
  !> the text without a byte order mark and with line feeds as line ends.
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

  !> Converts groups, as read from an input, to the text of an equivalent input file.
  pure function input_of(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: g, k, i

    do g = 1, size(groups)
      if (.not. any(groups(g)%values%given)) cycle
      call growing%add("&"//trim(groups(g)%name)//eol)
      do k = 1, size(groups(g)%values)
        associate (value => groups(g)%values(k))
          if (.not. (value%given .and. value%is_set())) cycle
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

    !> Formats an integer, a logical or a string as in an input file. Strings are quoted.
    pure function word(kind, value)
      character(len=*), intent(in) :: kind, value
      character(len=:), allocatable :: word

      word = trim(value)
      if (kind == "text") word = quoted(word)
    end function word
  end function input_of

  !> Quotes a string as in an input file.
  pure function quoted(text)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: quoted
    integer :: c

    quoted = "'"
    do c = 1, len(text)
      quoted = quoted//text(c:c)
      if (text(c:c) == "'") quoted = quoted//"'"
    end do
    quoted = quoted//"'"
  end function quoted

  !> The JSON text `, "name": value`, or `, "name": null` without a value.
  pure function member(name, is_there, value) result(text)
    character(len=*), intent(in) :: name, value
    logical, intent(in) :: is_there
    character(len=:), allocatable :: text

    text = ", "//json_text(name)//": null"
    if (is_there) text = text(:len(text) - 4)//value
  end function member

  !> Converts a list of words to a JSON array.
  pure function list(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text

    text = "[]"
    if (size(words) > 0) text = "["""//joined(words, """, """)//"""]"
  end function list

end module variable_help
