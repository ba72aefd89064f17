!> Lists of obstacles for all cells of the box. The list of a cell contains the obstacles that a
!> disk centred in the cell may overlap. The cost of testing a point for overlaps then does not
!> depend on the number of obstacles. The cost of making the lists is proportional to this number.
module obstacle_cells
  use box_geometry, only: box_t
  use grid, only: cell_lists_t, grid_t, split_block
  use kinds, only: int32, real64
  use partners, only: obstacle_code
  use shapes, only: shape_t, spare
  implicit none
  private
  public :: obstacle_cells_t

  !> Lists with obstacles in ascending order of their indices.
  type, extends(cell_lists_t) :: obstacle_cells_t
    !> Maximum disk radius for which the lists are valid [length].
    real(real64), private :: radius = -1.0_real64
    type(grid_t), private :: grid
  contains
    procedure :: serve
    procedure :: first_near
  end type obstacle_cells_t

contains

  !> Makes the lists for disks up to a given radius, unless the existing lists are valid for these
  !> disks.
  subroutine serve(self, box, radius)
    class(obstacle_cells_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius              !! [length]
    real(real64) :: wide, side
    integer(int32) :: k, bounded

    if (radius <= self%radius .or. .not. box%has_obstacles()) return
    wide = 0
    bounded = 0
    do k = 1, box%n_obstacles()
      if (box%obstacle(k)%shape%encloses) cycle
      wide = wide + maxval(box%obstacle(k)%shape%extent)
      bounded = bounded + 1
    end do
    side = max(sqrt(product(box%edges())/box%n_obstacles()), wide/max(bounded, 1) + radius)
    self%radius = radius
    call self%grid%divide(box%lower, box%edges(), int(max(min(box%edges()/side, 32000.0_real64), 1.0_real64), int32))
    call self%open(self%grid%n)
    do k = box%n_obstacles(), 1, -1                 ! descending: each list starts with the latest entry
      call enter(self, obstacle_code(k), box%obstacle(k)%shape, box%periodic)
    end do
  end subroutine serve

  !> First entry in the list of the cell that contains a point; 0 if no obstacle is near the cell.
  pure function first_near(self, p) result(e)
    class(obstacle_cells_t), intent(in) :: self
    real(real64), intent(in) :: p(2)                !! [length]
    integer(int32) :: e, c(2)

    e = 0
    if (.not. allocated(self%first)) return
    c = self%grid%cell(p)
    e = self%first(c(1), c(2))
  end function first_near

  !> Adds an obstacle to the lists of all cells that may contain the centre of an overlapping disk.
  subroutine enter(self, code, shape, periodic)
    type(obstacle_cells_t), intent(inout) :: self
    integer(int32), intent(in) :: code
    class(shape_t), intent(in) :: shape
    logical, intent(in) :: periodic(2)
    real(real64) :: side(2), room(2)
    integer(int32) :: low(2), high(2)

    side = 1/self%grid%density
    room = (shape%extent + self%radius)*(1 + spare) + spare*side
    associate (whole => self%grid%n)
      low = floor(max(self%grid%in_cells(shape%middle - room), -1.0_real64*whole), int32)
      high = floor(min(self%grid%in_cells(shape%middle + room), 2.0_real64*whole), int32)
      if (shape%encloses) low = 0
      if (shape%encloses) high = whole - 1
      where (.not. periodic)
        low = min(max(low, 0), whole - 1)
        high = min(max(high, 0), whole - 1)
      end where
    end associate
    call enter_block(low, high)

  contains

    !> Adds the obstacle to the lists in a block of cells. The block is halved recursively until it
    !> is a single cell or is not crossed by the outline of the obstacle. In a block that is not
    !> crossed, disks overlap the obstacle at every position or at none.
    recursive subroutine enter_block(low, high)
      !> First and last column and row of the block, counted from 0. The block may extend beyond
      !> periodic sides.
      integer(int32), intent(in) :: low(2), high(2)
      real(real64) :: d(2), half(2)
      integer(int32) :: last(2), first(2), i, j

      half = 0.5_real64*(high - low + 1)*side*(1 + spare)
      d = self%grid%lower + 0.5_real64*(low + high + 1)*side - shape%middle
      if (.not. shape%reaches(d, half, self%radius)) then
        if (.not. shape%covers(d, [0.0_real64, 0.0_real64], self%radius)) return
      else if (any(high > low)) then
        call split_block(low, high, last, first)
        call enter_block(low, last)
        call enter_block(first, high)
        return
      end if
      do j = low(2), high(2)
        do i = low(1), high(1)
          call enter_cell(modulo([i, j], self%grid%n) + 1)
        end do
      end do
    end subroutine enter_block

    !> Adds the obstacle to the list of a cell, unless another periodic image has already been
    !> added.
    subroutine enter_cell(cell)
      integer(int32), intent(in) :: cell(2)         !! column and row, counted from 1

      associate (e => self%first(cell(1), cell(2)))
        if (e > 0) then
          if (self%entry(e)%code == code) return
        end if
      end associate
      call self%prepend(cell, code, [0, 0])
    end subroutine enter_cell
  end subroutine enter

end module obstacle_cells
