!> The text of an input file.
module input_text
  use kinds, only: int64
  use errors, only: error_t, exit_files, exit_usage, fail
  use system, only: file_size, is_folder, opening_problem, read_bytes
  use texts, only: written
  implicit none
  private
  public :: read_text, unix_lines, byte_order_mark

  integer(int64), parameter :: largest_file = 4194304   !! bytes
  integer, private :: i
  character(len=1), parameter :: control(*) = [(achar(i), i=0, 8), achar(11), achar(12), (achar(i), i=14, 31), achar(127)]
  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

contains

  !> The bytes of a regular file.
  subroutine read_text(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: bytes, n
    integer :: odd

    bytes = file_size(path)
    if (bytes < 0) then
      call fail(error, exit_files, path//": there is no such file")
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder, not an input file")
    else if (bytes == 0) then
      call fail(error, exit_usage, path//": is empty, or a pipe or a device instead of a file")
    else if (bytes > largest_file) then
      call fail(error, exit_usage, path//": has "//written(bytes)// &
        " bytes; an input file has at most "//written(largest_file))
    end if
    if (allocated(error)) return
    allocate (character(len=bytes) :: text)
    call read_bytes(path, 1_int64, text, n)
    if (n < 0) then
      call fail(error, exit_files, path//": cannot be read: "//opening_problem(path, writable=.false.))
      return
    end if
    text = text(:n)
    odd = scan(text, transfer(control, repeat(" ", size(control))))
    if (odd > 0) call fail(error, exit_usage, path//": is not a text file: byte "//written(odd)// &
      " is a control character, code "//written(iachar(text(odd:odd))))
  end subroutine read_text

  !> The text with line feeds as the only line ends, without byte order mark, ending in a line feed.
  pure function unix_lines(text) result(lines)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: lines
    character(len=*), parameter :: carriage_return = achar(13), eol = new_line("a")
    integer :: i, n, first

    allocate (character(len=len(text) + 1) :: lines)
    first = 1
    if (index(text, byte_order_mark) == 1) first = 4
    n = 0
    do i = first, len(text)
      if (i > 1 .and. text(i:i) == eol) then
        if (text(i - 1:i - 1) == carriage_return) cycle
      end if
      n = n + 1
      lines(n:n) = text(i:i)
      if (text(i:i) == carriage_return) lines(n:n) = eol
    end do
    lines = lines(:n)//eol
  end function unix_lines

end module input_text
