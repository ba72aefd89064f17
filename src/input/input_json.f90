!> JSON for other programs: the table of variables, and an input as the program has understood it.
module input_json
  use input_groups, only: group_t, json_text
  use variables, only: allowed, free_to_change, group_names, is_repeated, largest, variable_t, smallest, table, words_of
  use texts, only: growing_text_t, joined, written
  implicit none
  private
  public :: groups_text, variables_text

  character(len=1), parameter :: eol = new_line("a")

contains

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
        member("needed", .true., truth(row%status == "example"))// &
        member("above", positive, "0")//member("from", low > -largest .and. .not. positive, written(low))// &
        member("below", high < 1, "1")//member("to", high >= 1 .and. high < largest, written(high))
    end associate
    text = text//member("choices", row%choices /= "", list(words_of(row%choices)))// &
      member("unit", row%unit /= "", json_text(row%unit))//member("help", .true., json_text(row%help))// &
      member("allowed", .true., json_text(allowed(row)))//", ""goes_with"": {"
    if (size(words) > 0) text = text//json_text(words(1))//": "//list(words(2:))
    text = text//"}"//member("excludes", row%excludes /= "", list(words_of(row%excludes)))// &
      member("repeated", .true., truth(is_repeated(row%group)))// &
      member("resumable", .true., truth(free_to_change(trim(row%group)//"."//row%name)))
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

  !> A logical.
  pure function truth(yes) result(word)
    logical, intent(in) :: yes
    character(len=:), allocatable :: word

    word = trim(merge("true ", "false", yes))
  end function truth

end module input_json
