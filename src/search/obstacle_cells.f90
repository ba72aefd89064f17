!> Which obstacles may keep a disk away from a point: lists by cells of the box, so that a question about one point costs
!> the same however many obstacles there are, and making the lists is linear in their number.
module obstacle_cells
  use box_geometry, only: box_t
  use kinds, only: int32, real64
  use shapes, only: shape_t, spare
  implicit none
  private
  public :: obstacle_cells_t

  !> An obstacle in the list of a cell.
  type :: entry_t
    integer(int32) :: obstacle = 0                  !! its number in the box
    integer(int32) :: next = 0                      !! entry in the same list, of a larger number; 0: none
  end type entry_t

  type :: obstacle_cells_t
    real(real64), private :: radius = -1.0_real64   !! of the largest disk that the lists are made for [length]
    real(real64), private :: lower(2) = 0.0_real64  !! corner of the box [length]
    real(real64), private :: side(2) = 0.0_real64   !! of a cell [length]
    integer(int32), allocatable, private :: head(:, :)  !! (columns,rows) first entry of a cell, 0: none; not there without obstacles
    integer(int32), private :: n_entries = 0
    type(entry_t), allocatable :: entry(:)
  contains
    procedure :: serve
    procedure :: first_near
  end type obstacle_cells_t

contains

  !> Makes the lists for disks of up to some radius, unless they serve these already.
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
    do k = box%n_obstacles(), 1, -1                 ! so that lists begin with the smallest number
      call enter(self, k, box%obstacle(k)%shape, box%periodic)
    end do
  end subroutine serve

  !> The first entry of the list for a point; 0 if no obstacle is near it.
  pure function first_near(self, p) result(e)
    class(obstacle_cells_t), intent(in) :: self
    real(real64), intent(in) :: p(2)                !! [length]
    integer(int32) :: e, c(2)

    e = 0
    if (.not. allocated(self%head)) return
    c = 1 + int(min(max((p - self%lower)/self%side, 0.0_real64), shape(self%head) - 1.0_real64), int32)
    e = self%head(c(1), c(2))
  end function first_near

  !> Enters an obstacle into the lists of all cells with a point that it keeps the centre of a disk from.
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

    !> Does so in a block of cells. It is halved until it is one cell, or the outline does not pass through it: then all its
    !> points are alike.
    recursive subroutine enter_block(low, high)
      integer(int32), intent(in) :: low(2), high(2) !! first and last column and row, from 0, beyond periodic sides too
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

    !> Does so in one cell, where it may have been entered by another of its images.
    subroutine enter_cell(cell)
      integer(int32), intent(in) :: cell(2)         !! column and row, from 1
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
