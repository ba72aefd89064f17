!> Disks from a text file: a line `x y` or `x y vx vy` for each. Empty lines, and text from a # to the end
!> of its line, are comments.
module position_file
  use kinds, only: int64, real64
  use errors, only: error_t, exit_files, exit_usage, fail
  use input_text, only: byte_order_mark
  use input_values, only: read_real
  use system, only: opening_problem
  use texts, only: counted, shown, written
  implicit none
  private
  public :: count_positions, read_positions

  integer, parameter :: longest_line = 1024

contains

  !> Counts the disks.
  subroutine count_positions(path, count, error)
    character(len=*), intent(in) :: path
    integer, intent(out) :: count
    type(error_t), allocatable, intent(out) :: error
    real(real64) :: table(2, 0)
    integer :: lines(0)

    call read_lines(path, table, lines, count, error)
  end subroutine count_positions

  !> Reads exactly `count` disks.
  subroutine read_positions(path, count, table, lines, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: count
    real(real64), intent(out) :: table(:, :)                !! (columns,count) x, y, or x, y, vx, vy
    integer, allocatable, intent(out) :: lines(:)           !! (count) in which the disks stand
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    table = 0
    allocate (lines(count), source=0)
    call read_lines(path, table, lines, n, error)
    if (n /= count .and. .not. allocated(error)) &
      call fail(error, exit_usage, path//": "//counted(int(n, int64), "disk")//", but species.count is "//written(count))
  end subroutine read_positions

  !> Reads the disks for which the table has room, and counts them all.
  subroutine read_lines(path, table, lines, n, error)
    character(len=*), intent(in) :: path
    real(real64), intent(inout) :: table(:, :)
    integer, intent(inout) :: lines(:)
    integer, intent(out) :: n
    type(error_t), allocatable, intent(out) :: error
    character(len=longest_line) :: line
    character(len=256) :: reason
    character(len=:), allocatable :: problem
    integer :: unit, status, number, before

    n = 0
    problem = opening_problem(path, writable=.false.)
    if (problem == "") then
      open (newunit=unit, file=path, status="old", action="read", iostat=status, iomsg=reason)
      if (status /= 0) problem = trim(reason)
    end if
    if (problem /= "") then
      call fail(error, exit_files, path//": cannot be read: "//problem)
      return
    end if
    number = 0
    do
      read (unit, "(a)", iostat=status, iomsg=reason) line
      if (status /= 0) exit
      number = number + 1
      before = n
      if (number == 1 .and. index(line, byte_order_mark) == 1) line = line(len(byte_order_mark) + 1:)
      if (len_trim(line) == longest_line) then
        problem = "the line is too long"
      else
        call read_line(line, n, table, problem)
      end if
      if (n > before .and. n <= size(lines)) lines(n) = number
      if (problem == "") cycle
      call fail(error, exit_usage, path//":"//written(number)//": "//problem)
      exit
    end do
    close (unit)
    if (allocated(error)) return
    if (.not. is_iostat_end(status)) call fail(error, exit_files, path//": "//trim(reason))
  end subroutine read_lines

  !> Appends the disk of a line, if there is one, to the table. Columns that are not needed are also
  !> checked.
  subroutine read_line(line, n, table, problem)
    character(len=*), intent(in) :: line
    integer, intent(inout) :: n                             !! disks so far, also those beyond the table
    real(real64), intent(inout) :: table(:, :)
    character(len=:), allocatable, intent(out) :: problem
    character(len=*), parameter :: blanks = " ,"//achar(9)//achar(13)
    real(real64) :: value(4)
    integer :: first, past, last, columns

    last = index(line//"#", "#") - 1
    columns = 0
    first = 1
    problem = ""
    value = 0
    do
      first = first - 1 + verify(line(first:last)//"x", blanks)
      if (first > last) exit
      past = first - 1 + scan(line(first:last)//" ", blanks)
      columns = columns + 1
      if (columns <= 4) call read_real(line(first:past - 1), value(columns), problem)
      if (problem /= "") then
        problem = shown(line(first:past - 1))//" "//problem
        return
      end if
      first = past
    end do
    if (columns == 0) return
    if (columns /= 2 .and. columns /= 4) then
      problem = written(columns)//" numbers; allowed: x y, or x y vx vy"
    else if (columns < size(table, 1)) then
      problem = "there are no velocities; velocities = 'file' needs x y vx vy"
    end if
    n = n + 1
    if (n <= size(table, 2)) table(:, n) = value(:size(table, 1))
  end subroutine read_line

end module position_file
