!> All that is wrong with an input, collected so that it can be reported at once.
module input_problems
  use texts, only: text_t, written
  implicit none
  private
  public :: problem_list_t

  integer, parameter :: most = 100   !! problems worth reading
  integer, parameter :: after_all_lines = 1000000000

  type :: problem_t
    integer :: line                    !! > 0 of the file, 0 the file as a whole, -k override k
    character(len=:), allocatable :: text
  end type problem_t

  type :: problem_list_t
    integer :: count = 0
    logical :: cut_short = .false.              !! there were more than the list takes
    type(problem_t) :: items(most)
  contains
    procedure :: add
    procedure :: is_full
    procedure :: report
  end type problem_list_t

contains

  !> Adds `where: what`; what the list already says at this place is not said again.
  pure subroutine add(self, line, where, what)
    class(problem_list_t), intent(inout) :: self
    integer, intent(in) :: line                 !! as in `problem_t`
    character(len=*), intent(in) :: where       !! group or group.variable
    character(len=*), intent(in) :: what        !! what is wrong, what is allowed
    character(len=:), allocatable :: text
    integer :: k

    text = trim(where)//": "//trim(what)
    do k = 1, self%count
      if (self%items(k)%line == line .and. self%items(k)%text == text) return
    end do
    if (self%is_full()) then
      self%cut_short = .true.
      return
    end if
    self%count = self%count + 1
    self%items(self%count)%line = line
    self%items(self%count)%text = text
  end subroutine add

  pure function is_full(self)
    class(problem_list_t), intent(in) :: self
    logical :: is_full

    is_full = self%count == most
  end function is_full

  !> One line per problem: those of the file by line number, then those of the overrides.
  pure function report(self, path, overrides) result(text)
    class(problem_list_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)
    character(len=:), allocatable :: text
    integer :: order(self%count), k, j, moving

    order = [(k, k=1, self%count)]
    do k = 2, self%count
      moving = order(k)
      do j = k - 1, 1, -1
        if (rank_of(self%items(order(j))%line) <= rank_of(self%items(moving)%line)) exit
        order(j + 1) = order(j)
      end do
      order(j + 1) = moving
    end do
    text = ""
    do k = 1, self%count
      associate (problem => self%items(order(k)))
        if (k > 1) text = text//new_line("a")
        if (problem%line > 0) then
          text = text//path//":"//written(problem%line)//": "//problem%text
        else if (problem%line == 0) then
          text = text//path//": "//problem%text
        else
          text = text//"--set "//overrides(-problem%line)%text//": "//problem%text
        end if
      end associate
    end do
    if (self%cut_short) then
      text = text//new_line("a")//path//": more problems than these "//written(most)
    end if
  end function report

  !> Sorts lines as they are reported: 1, 2, 3, ..., the whole file (0), overrides (-1, -2, ...).
  pure function rank_of(line) result(rank)
    integer, intent(in) :: line
    integer :: rank

    rank = line
    if (line <= 0) rank = after_all_lines - line
  end function rank_of

end module input_problems
