!> Reads obstacles from a text file: a line of column names, then one line per obstacle, `x y radius` for circles or `x1 y1 x2 y2`
!> for straight walls. Empty lines, and text from a # to the end of its line, are ignored. The module can also read obstacles from
!> an HDF5 file with the datasets `centre` and `radius`, or `from` and `to`.
module obstacle_file
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use kinds, only: int64, real64
  use errors, only: error_t, exit_files, exit_usage, fail
  use input_text, only: byte_order_mark, find_words, longest_line
  use input_words, only: read_real
  use system, only: read_file
  use table_file, only: read_table
  use texts, only: counted, eol, joined, lower_case, place_of, shown, written
  use variables, only: largest, smallest
  implicit none
  private
  public :: origin_of_row, read_obstacles

  integer, parameter, public :: most_rows = 1000000
  character(len=6), parameter :: of_circles(*) = [character(len=6) :: "x", "y", "radius"]
  character(len=6), parameter :: of_walls(*) = [character(len=6) :: "x1", "y1", "x2", "y2"]

contains

  !> Whether a path has the name of an HDF5 file.
  pure function is_hdf5(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = index(path//"|", ".h5|") > 0
  end function is_hdf5

  !> Reads the obstacles from a file. If the file is invalid, the error contains the problem and its location in the file.
  subroutine read_obstacles(path, walls, rows, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: walls                           !! .true. for straight walls, .false. for circles
    !> (columns,n) numbers that describe each obstacle, in the order of `of_circles` or `of_walls` [length]
    real(real64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error

    if (is_hdf5(path)) then
      call read_hdf5(path, walls, rows, error)
    else
      call read_text(path, walls, rows, error)
    end if
    if (size(rows, 2) == 0 .and. .not. allocated(error)) call fail(error, exit_usage, path//": contains no obstacles")
  end subroutine read_obstacles

  !> Reads the obstacles from an HDF5 file and checks the numbers.
  subroutine read_hdf5(path, walls, rows, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: walls
    real(real64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    logical :: wrong
    integer :: k, c

    if (walls) call read_table(path, ["from", "to  "], [2, 2], most_rows, rows, error)
    if (.not. walls) call read_table(path, ["centre", "radius"], [2, 1], most_rows, rows, error)
    if (allocated(error)) return
    do k = 1, size(rows, 2)
      do c = 1, size(rows, 1)
        wrong = .not. ieee_is_finite(rows(c, k))           ! debug builds stop if NaN is compared
        if (.not. wrong) wrong = abs(rows(c, k)) > largest .or. (c == 3 .and. .not. walls .and. rows(c, k) < smallest)
        if (.not. wrong) cycle
        call fail(error, exit_usage, path//": row "//written(k)//": "//written(rows(c, k))//" is out of range")
        return
      end do
    end do
  end subroutine read_hdf5

  !> Reads the obstacles from a text file.
  subroutine read_text(path, walls, rows, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: walls                           !! .true. for straight walls, .false. for circles
    !> (columns,n) numbers that describe each obstacle, in the order of `of_circles` or `of_walls` [length]
    real(real64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text, line, problem
    character(len=6), allocatable :: names(:)
    integer, allocatable :: column(:)  ! index in `names` of each column of the file; empty until the first line has been read
    integer :: first(longest_line), last(longest_line)     ! first and last position of each word in the line
    integer(int64) :: past
    integer :: number, n, n_words

    if (walls) allocate (names, source=of_walls)
    if (.not. walls) allocate (names, source=of_circles)
    call read_file(path, text, problem)
    if (problem /= "") then
      call fail(error, exit_files, path//": cannot be read: "//problem)
      return
    end if
    allocate (rows(size(names), 64), column(0))
    n = 0
    number = 0
    past = 1
    do while (past <= len(text, int64) .and. problem == "")
      call next_line(text, past, line)
      number = number + 1
      if (len(line) > longest_line) problem = "the line is too long"
      if (problem == "") call find_words(line, first, last, n_words)
      if (problem /= "" .or. n_words == 0) cycle
      if (size(column) == 0) then
        call read_names()
      else
        call read_row()
      end if
    end do
    if (problem /= "") then
      call fail(error, exit_usage, path//":"//written(number)//": "//problem)
    end if
    rows = rows(:, :n)

  contains

    !> Reads the first line, which contains the names of the columns in any order.
    subroutine read_names()
      integer :: k

      do k = 1, n_words
        column = [column, place_of(lower_case(line(first(k):last(k))), names)]
      end do
      do k = 1, size(names)
        if (size(column) /= size(names) .or. count(column == k) /= 1) &
          problem = "the first line must name the columns, "//joined(names, " ")
      end do
    end subroutine read_names

    !> Reads a line that describes one obstacle.
    subroutine read_row()
      real(real64) :: value(size(names))
      integer :: k

      if (n_words /= size(column)) then
        problem = counted(int(n_words, int64), "value")//"; expected: "//joined(names(column), " ")
        return
      end if
      do k = 1, n_words
        associate (word => line(first(k):last(k)))
          call read_real(word, value(column(k)), problem)
          if (problem /= "") problem = shown(word)//" "//problem
        end associate
        if (problem /= "") return
      end do
      if (.not. (walls .or. value(3) > 0)) problem = written(value(3))//" is not a radius; allowed: a number > 0"
      if (n == most_rows) problem = "more than "//written(most_rows)//" obstacles"
      if (problem /= "") return
      if (n == size(rows, 2)) rows = reshape(rows, [size(rows, 1), 2*n], pad=[0.0_real64])
      n = n + 1
      rows(:, n) = value
    end subroutine read_row
  end subroutine read_text

  !> Location of the n-th obstacle in its file, for messages.
  function origin_of_row(path, n) result(place)
    character(len=*), intent(in) :: path
    integer, intent(in) :: n
    character(len=:), allocatable :: place
    integer :: number, rows, n_words
    character(len=:), allocatable :: text, line, problem
    integer :: first(longest_line), last(longest_line)
    integer(int64) :: past

    place = path//": row "//written(n)
    if (is_hdf5(path)) return
    call read_file(path, text, problem)
    number = 0
    rows = -1                                              ! the first line contains the names of columns
    past = 1
    do while (past <= len(text, int64) .and. rows < n)
      call next_line(text, past, line)
      number = number + 1
      call find_words(line, first, last, n_words)
      if (n_words > 0) rows = rows + 1
    end do
    place = path//":"//written(number)
  end function origin_of_row

  !> Reads the next line of a text.
  subroutine next_line(text, past, line)
    character(len=*), intent(in) :: text
    integer(int64), intent(inout) :: past                  !! in: first position of the line; out: first position of the next line
    character(len=:), allocatable, intent(out) :: line
    integer(int64) :: begin

    begin = past
    past = begin + index(text(begin:), eol, kind=int64)
    if (past == begin) past = len(text, int64) + 2         ! the last line may lack a line feed
    line = text(begin:past - 2)
    if (begin == 1 .and. index(line, byte_order_mark) == 1) line = line(len(byte_order_mark) + 1:)
  end subroutine next_line

end module obstacle_file
