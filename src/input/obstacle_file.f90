!> Reads obstacles from a text file: a line with the column names, then one line per obstacle with
!> `x y radius` for circles or `x1 y1 x2 y2` for straight walls. Empty lines are ignored, and so is
!> text from a # to the end of its line. Obstacles can also be read from an HDF5 file that contains
!> the datasets `centre` and `radius`, or `from` and `to`.
module obstacle_file
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use kinds, only: real64
  use errors, only: error_t, exit_usage, fail
  use table_file, only: read_table
  use text_table, only: text_table_t
  use texts, only: joined, lower_case, place_of, written
  use variables, only: largest, smallest
  implicit none
  private
  public :: origin_of_row, read_obstacles

  integer, parameter, public :: most_rows = 1000000
  character(len=6), parameter :: of_circles(*) = [character(len=6) :: "x", "y", "radius"]
  character(len=6), parameter :: of_walls(*) = [character(len=6) :: "x1", "y1", "x2", "y2"]

contains

  !> True if the path has the extension of an HDF5 file.
  pure function is_hdf5(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = index(path//"|", ".h5|") > 0
  end function is_hdf5

  !> Reads the obstacles from a file. If the file is invalid, the error states the problem and its
  !> location.
  subroutine read_obstacles(path, walls, rows, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: walls                           !! .true. for straight walls, .false. for circles
    !> Numbers that describe each obstacle, in the order of `of_circles` or `of_walls`; shape
    !> (columns, n) [length].
    real(real64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error

    if (is_hdf5(path)) then
      call read_hdf5(path, walls, rows, error)
    else
      call read_text(path, walls, rows, error)
    end if
    if (size(rows, 2) == 0 .and. .not. allocated(error)) call fail(error, exit_usage, path//": contains no obstacles")
  end subroutine read_obstacles

  !> Reads obstacles from an HDF5 file and checks the numbers.
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
        wrong = .not. ieee_is_finite(rows(c, k))           ! debug builds stop when NaN is compared
        if (.not. wrong) wrong = abs(rows(c, k)) > largest .or. (c == 3 .and. .not. walls .and. rows(c, k) < smallest)
        if (.not. wrong) cycle
        call fail(error, exit_usage, path//": row "//written(k)//": "//written(rows(c, k))//" is out of range")
        return
      end do
    end do
  end subroutine read_hdf5

  !> Reads obstacles from a text file.
  subroutine read_text(path, walls, rows, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: walls                           !! .true. for straight walls, .false. for circles
    !> Numbers that describe each obstacle, in the order of `of_circles` or `of_walls`; shape
    !> (columns, n) [length].
    real(real64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(text_table_t) :: file
    character(len=6), allocatable :: names(:)
    ! index in `names` of each column of the file; empty before the first line is read
    integer, allocatable :: column(:)
    logical :: there

    if (walls) allocate (names, source=of_walls)
    if (.not. walls) allocate (names, source=of_circles)
    call file%open(path, size(names), error)
    allocate (column(0))
    do while (.not. allocated(error))
      call file%advance(there)
      if (.not. there) exit
      if (size(column) == 0) then
        call read_names(file, names, column)
      else
        call read_row(file, names, column)
      end if
    end do
    if (.not. allocated(error)) call file%close(error)
    call move_alloc(file%rows, rows)
  end subroutine read_text

  !> Reads the first line, which contains the column names in any order.
  subroutine read_names(file, names, column)
    type(text_table_t), intent(inout) :: file
    character(len=*), intent(in) :: names(:)
    integer, allocatable, intent(inout) :: column(:)
    integer :: k

    column = [(place_of(lower_case(file%word(k)), names), k=1, file%n_words)]
    do k = 1, size(names)
      if (size(column) /= size(names) .or. count(column == k) /= 1) &
        file%problem = "the first line must name the columns, "//joined(names, " ")
    end do
  end subroutine read_names

  !> Reads a line with the numbers of one obstacle.
  subroutine read_row(file, names, column)
    type(text_table_t), intent(inout) :: file
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: column(:)
    real(real64) :: value(size(names))
    integer :: k

    call file%require(names(column))
    do k = 1, file%n_words
      if (file%problem /= "") return
      call file%read_number(k, value(column(k)))
    end do
    if (file%problem /= "") return
    if (size(names) == 3 .and. .not. value(size(names)) > 0) &
      file%problem = written(value(3))//" is not a radius; allowed: a number > 0"
    if (file%n == most_rows) file%problem = "more than "//written(most_rows)//" obstacles"
    if (file%problem == "") call file%append(value)
  end subroutine read_row

  !> Location of the n-th obstacle in its file, for messages.
  function origin_of_row(path, n) result(place)
    character(len=*), intent(in) :: path
    integer, intent(in) :: n
    character(len=:), allocatable :: place
    type(text_table_t) :: file
    type(error_t), allocatable :: error
    integer :: k
    logical :: there

    place = path//": row "//written(n)
    if (is_hdf5(path)) return
    call file%open(path, 0, error)
    do k = 0, n                                            ! the first line contains the column names
      call file%advance(there)
    end do
    place = path//":"//written(file%number)
  end function origin_of_row

end module obstacle_file
