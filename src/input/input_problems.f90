!> Collects all problems of an input, to be reported together.
module input_problems
  use errors, only: error_t, exit_files, exit_usage
  use texts, only: legible, text_t, written
  implicit none
  private
  public :: problem_list_t

  integer, parameter, public :: most_problems = 100          !! maximum number of problems in a report
  !> Rank of a problem with the whole file; larger than any line number.
  integer, parameter :: whole_file = 1000000000

  type :: problem_t
    !> Line number in the input file; 0 for the whole file; -k for override number k.
    integer :: line
    character(len=:), allocatable :: text
  end type problem_t

  !> List of problems in the order in which they are reported. Problems with single lines come
  !> first, by line number; problems with the whole file and then problems with overrides follow.
  type :: problem_list_t
    integer :: count = 0
    integer :: unreadable = 0                   !! number of problems with unreadable files
    logical :: cut_short = .false.              !! .true. if further problems did not fit into the list
    type(problem_t) :: items(most_problems)
  contains
    procedure :: add
    procedure :: report
  end type problem_list_t

contains

  !> Adds the problem `where: what` to the list, unless the list already contains it.
  pure subroutine add(self, line, where, what)
    class(problem_list_t), intent(inout) :: self
    integer, intent(in) :: line                 !! as in `problem_t`
    character(len=*), intent(in) :: where       !! group or group.variable
    character(len=*), intent(in) :: what        !! the problem, and the allowed values
    character(len=:), allocatable :: text
    integer :: k

    text = trim(where)//": "//trim(what)
    do k = 1, self%count
      if (self%items(k)%line == line .and. self%items(k)%text == text) return
    end do
    if (self%count == most_problems) then
      self%cut_short = .true.
      return
    end if
    do k = self%count, 1, -1
      if (rank(self%items(k)%line) <= rank(line)) exit
      self%items(k + 1) = self%items(k)
    end do
    self%items(k + 1)%line = line
    self%items(k + 1)%text = text
    self%count = self%count + 1
  end subroutine add

  !> Rank of a line number in the order of the report.
  pure function rank(line)
    integer, intent(in) :: line
    integer :: rank

    rank = merge(line, whole_file - line, line > 0)
  end function rank

  !> Converts all problems to one error. Each problem becomes a line of the form path:line:
  !> group.variable: problem, allowed values.
  subroutine report(self, path, error, overrides)
    class(problem_list_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(text_t), intent(in), optional :: overrides(:)    !! overrides as texts, quoted in the message
    character(len=:), allocatable :: text, place
    integer :: k

    if (self%count == 0) return
    text = ""
    do k = 1, self%count
      associate (problem => self%items(k))
        place = path
        if (problem%line > 0) place = path//":"//written(problem%line)
        if (problem%line < 0 .and. present(overrides)) place = "--set "//overrides(-problem%line)%text
        text = text//new_line("a")//legible(place//": "//problem%text)
      end associate
    end do
    if (self%cut_short) text = text//new_line("a")//legible(path)//": there are more problems than these "//written(most_problems)
    allocate (error)                            ! `fail` accepts only a single line
    error%message = text(2:)
    error%code = merge(exit_files, exit_usage, self%unreadable == self%count)
  end subroutine report

end module input_problems
