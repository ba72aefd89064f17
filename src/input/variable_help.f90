!> What the program says of its variables: the reference file, and the answers to `--explain`.
module variable_help
  use errors, only: error_t, exit_usage, fail
  use variables, only: allowed, group_names, name_length, variable_t, table, wall_groups
  use texts, only: lower_case, shown, suggestion
  implicit none
  private
  public :: defaults_text, explain

  integer, parameter :: comment_column = 40                !! of the reference file

contains

  !> The reference input file: every variable with its default. It is a valid input itself.
  pure function defaults_text() result(text)
    character(len=:), allocatable :: text
    character(len=1), parameter :: eol = new_line("a")
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

  !> A variable in the reference file; a choice has a second line that lists its words.
  pure function reference_line(row) result(line)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: line
    character(len=:), allocatable :: indent

    indent = "  "
    if (row%status /= "default" .and. row%status /= "example") indent = "  ! "
    if (any(wall_groups == row%group)) indent = "!   "
    line = padded(indent//trim(row%name)//" = "//trim(row%value))//" ! "
    if (row%status == "example") line = line//"an example: "
    line = line//trim(row%help)
    if (row%unit /= "") line = line//" ["//trim(row%unit)//"]"
    if (row%choices == "") return
    line = line//new_line("a")//padded(margin(row%group))//" ! "//allowed(row)
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
      if (text /= "") text = text//new_line("a")
      text = text//explanation(table(k))
    end do
    if (text /= "") return
    call fail(error, exit_usage, "--explain "//shown(name)//": unknown variable; " &
      //suggestion(wanted, [character(len=len(full)) :: table%name, full, group_names], group_names))
  end subroutine explain

  !> Name and unit of a variable, its meaning, what is allowed, and its default or an example.
  pure function explanation(row) result(text)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: text
    character(len=*), parameter :: indent = new_line("a")//"    "

    text = trim(row%group)//"."//trim(row%name)
    if (row%unit /= "") text = text//"  ["//trim(row%unit)//"]"
    text = text//indent//trim(row%help)//indent//"allowed: "//allowed(row)//indent
    if (row%status == "default" .or. row%status == "fallback") then
      text = text//"default: "//trim(row%value)
    else
      text = text//"example: "//trim(row%value)
    end if
  end function explanation

end module variable_help
