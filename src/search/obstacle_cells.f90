!> For each cell of the box, a list of the obstacles that a disk with its centre in the cell may overlap. With lists of nearby
!> obstacles, the cost of a test for overlaps at one point does not depend on the number of obstacles. The cost of making the lists
!> is proportional to the number of obstacles.
module obstacle_cells
  use box_geometry, only: box_t
  use kinds, only: int32, real64
  use shapes, only: shape_t, spare
  implicit none
  private
  public :: obstacle_cells_t

  !> An obstacle in the list of a cell.
  type :: entry_t
    integer(int32) :: obstacle = 0                  !! index of the obstacle in the box
    !> Next entry in the same list, for an obstacle with a larger index; 0 at the end of the list.
    integer(int32) :: next = 0
  end type entry_t

  type :: obstacle_cells_t
    real(real64), private :: radius = -1.0_real64   !! largest radius of disks for which the lists are valid [length]
    real(real64), private :: lower(2) = 0.0_real64  !! lower left corner of the box [length]
    real(real64), private :: side(2) = 0.0_real64   !! edges of a cell [length]
    integer(int32), allocatable, private :: head(:, :)  !! (columns,rows) first entry of each cell; 0 if the list is empty
    integer(int32), private :: n_entries = 0
    type(entry_t), allocatable :: entry(:)
  contains
    procedure :: serve
    procedure :: first_near
  end type obstacle_cells_t

contains

  !> Makes the lists for disks up to a given radius, unless the existing lists are already valid for these disks.
  subroutine serve(self, box, radius)
    class(obstacle_cells_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius              !! [length]
    real(real64) :: wide, side
    integer(int32) :: n(2), k, bounded

    if (radius <= self%radius .or. .not. box%has_obstacles()) return
    wide = 0
    bounded = 0
    do k = 1, box%n_obstacles()
      if (box%obstacle(k)%shape%encloses) cycle
      wide = wide + maxval(box%obstacle(k)%shape%extent)
      bounded = bounded + 1
    end do
    side = max(sqrt(product(box%edges())/box%n_obstacles()), wide/max(bounded, 1) + radius)
    n = int(max(min(box%edges()/side, 32000.0_real64), 1.0_real64), int32)
    self%radius = radius
    self%lower = box%lower
    self%side = box%edges()/n
    if (allocated(self%head)) deallocate (self%head)
    allocate (self%head(n(1), n(2)), source=0_int32)
    if (.not. allocated(self%entry)) allocate (self%entry(2*box%n_obstacles()))
    self%n_entries = 0
    do k = box%n_obstacles(), 1, -1                 ! descending, because each list begins with the entry added last
      call enter(self, k, box%obstacle(k)%shape, box%periodic)
    end do
  end subroutine serve

  !> First entry of the list for the cell that contains a point; 0 if no obstacle is near the cell.
  pure function first_near(self, p) result(e)
    class(obstacle_cells_t), intent(in) :: self
    real(real64), intent(in) :: p(2)                !! [length]
    integer(int32) :: e, c(2)

    e = 0
    if (.not. allocated(self%head)) return
    c = 1 + int(min(max((p - self%lower)/self%side, 0.0_real64), shape(self%head) - 1.0_real64), int32)
    e = self%head(c(1), c(2))
  end function first_near

  !> Adds an obstacle to the lists of all cells in which the centre of a disk may be when the disk overlaps the obstacle.
  subroutine enter(self, number, shape, periodic)
    type(obstacle_cells_t), intent(inout) :: self
    integer(int32), intent(in) :: number
    class(shape_t), intent(in) :: shape
    logical, intent(in) :: periodic(2)
    real(real64) :: middle(2), room(2)
    integer(int32) :: low(2), high(2), whole(2)

    whole = ubound(self%head)
    middle = shape%middle - self%lower
    room = (shape%extent + self%radius)*(1 + spare) + spare*self%side
    low = floor(max(middle - room, -whole*self%side)/self%side, int32)
    high = floor(min(middle + room, 2*whole*self%side)/self%side, int32)
    if (shape%encloses) low = 0
    if (shape%encloses) high = whole - 1
    where (.not. periodic)
      low = min(max(low, 0), whole - 1)
      high = min(max(high, 0), whole - 1)
    end where
    call enter_block(low, high)

  contains

    !> Adds the obstacle to the lists in a block of cells. The block is halved recursively until the block is a single cell, or
    !> until the outline of the obstacle does not cross the block. If the outline does not cross a block, a disk overlaps the
    !> obstacle either at every position in the block or at no position.
    recursive subroutine enter_block(low, high)
      !> First and last column and row of the block, counted from 0. The block may extend beyond periodic sides.
      integer(int32), intent(in) :: low(2), high(2)
      real(real64) :: d(2), half(2)
      integer(int32) :: last(2), first(2), axis, i, j

      half = 0.5_real64*(high - low + 1)*self%side*(1 + spare)
      d = 0.5_real64*(low + high + 1)*self%side - middle
      if (.not. shape%reaches(d, half, self%radius)) then
        if (.not. shape%covers(d, [0.0_real64, 0.0_real64], self%radius)) return
      else if (any(high > low)) then
        axis = merge(1, 2, high(1) - low(1) >= high(2) - low(2))
        last = high
        last(axis) = low(axis) + (high(axis) - low(axis))/2
        first = low
        first(axis) = last(axis) + 1
        call enter_block(low, last)
        call enter_block(first, high)
        return
      end if
      do j = low(2), high(2)
        do i = low(1), high(1)
          call enter_cell(modulo([i, j], whole) + 1)
        end do
      end do
    end subroutine enter_block

    !> Adds the obstacle to the list of one cell, unless the list already contains the obstacle because of another periodic image.
    subroutine enter_cell(cell)
      integer(int32), intent(in) :: cell(2)         !! column and row, counted from 1
      type(entry_t), allocatable :: more(:)
      integer(int32) :: e

      e = self%head(cell(1), cell(2))
      if (e > 0) then
        if (self%entry(e)%obstacle == number) return
      end if
      if (self%n_entries == size(self%entry)) then
        allocate (more(2*self%n_entries))
        more(:self%n_entries) = self%entry
        call move_alloc(more, self%entry)
      end if
      self%n_entries = self%n_entries + 1
      self%entry(self%n_entries) = entry_t(number, e)
      self%head(cell(1), cell(2)) = self%n_entries
    end subroutine enter_cell
  end subroutine enter

end module obstacle_cells
