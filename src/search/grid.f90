!> Grids of equal cells for searches outside the event loop: the placement of disks, obstacles near
!> a point, time steps, and the sorting of disks in memory. The event loop uses a separate grid of
!> overlapping cells (`cell_layout`). Both grids use the lists of objects in cells defined here.
module grid
  use kinds, only: int32, real64
  implicit none
  private
  public :: cell_lists_t, entry_t, grid_t, split_block

  type :: grid_t
    integer(int32) :: n(2) = 0                      !! numbers of columns and rows
    real(real64) :: lower(2) = 0.0_real64           !! lower left corner [length]
    real(real64) :: extent(2) = 1.0_real64          !! edges; 1 if an edge is 0 [length]
    real(real64) :: density(2) = 0.0_real64         !! number of cells per length, for each axis [1/length]
  contains
    procedure :: divide
    procedure, non_overridable :: in_cells
    procedure :: cell
    procedure :: block
  end type grid_t

  !> Entry in the list of a cell: an obstacle or a big disk.
  type :: entry_t
    integer(int32) :: code = 0      !! index of a disk (> 0), or boundary id of an obstacle (<= 0)
    integer(int32) :: image(2) = 0                  !! index of the periodic image that reaches into the cell
    integer(int32) :: next = 0                      !! next entry in the same list; 0 at the end
  end type entry_t

  !> Lists of the objects that reach into each cell.
  type :: cell_lists_t
    !> First entry in the list of each cell; 0 for an empty list; shape (columns, rows). Not
    !> allocated without objects.
    integer(int32), allocatable :: first(:, :)
    type(entry_t), allocatable :: entry(:)
    integer(int32), private :: vacant = 0           !! first entry in the list of free entries
  contains
    procedure :: open => open_lists
    procedure :: prepend
    procedure :: append
    procedure :: remove
    procedure, private :: new_entry
  end type cell_lists_t

contains

  !> Divides a rectangle, whose width may be 0, into n(1) columns and n(2) rows.
  pure subroutine divide(self, lower, extent, n)
    class(grid_t), intent(inout) :: self
    real(real64), intent(in) :: lower(2), extent(2) !! lower left corner and edges of the rectangle [length]
    integer(int32), intent(in) :: n(2)

    self%n = n
    self%lower = lower
    self%extent = merge(extent, 1.0_real64, extent > 0)
    self%density = merge(n/self%extent, 0.0_real64, extent > 0)
  end subroutine divide

  !> Position of a point in units of cells; 0 at the lower left corner of the grid.
  pure function in_cells(self, p) result(position)
    class(grid_t), intent(in) :: self
    real(real64), intent(in) :: p(2)                !! [length]
    real(real64) :: position(2)

    position = (p - self%lower)/self%extent*self%n
  end function in_cells

  !> Column and row, counted from 1, of the cell that contains a point. If the point is outside the
  !> grid, the nearest cell is returned.
  pure function cell(self, p) result(c)
    class(grid_t), intent(in) :: self
    real(real64), intent(in) :: p(2)                !! [length]
    integer(int32) :: c(2)

    c = 1 + int(min(max(self%in_cells(p), 0.0_real64), self%n - 1.0_real64), int32)
  end function cell

  !> First and last cell of the block of cells within a given distance of a point along both axes,
  !> clipped at the border of the grid.
  pure function block(self, p, reach) result(corner)
    class(grid_t), intent(in) :: self
    real(real64), intent(in) :: p(2), reach         !! [length]
    integer(int32) :: corner(2, 2)                  !! shape (axis, first or last cell)

    corner(:, 1) = self%cell(p - reach)
    corner(:, 2) = self%cell(p + reach)
  end function block

  !> Splits a block of several cells into two halves along its longer axis.
  pure subroutine split_block(low, high, last, first)
    integer(int32), intent(in) :: low(2), high(2)   !! first and last cell of the block
    integer(int32), intent(out) :: last(2)          !! last cell of the half that starts with `low`
    integer(int32), intent(out) :: first(2)         !! first cell of the half that ends with `high`
    integer(int32) :: axis

    axis = merge(1, 2, high(1) - low(1) >= high(2) - low(2))
    last = high
    last(axis) = low(axis) + (high(axis) - low(axis))/2
    first = low
    first(axis) = last(axis) + 1
  end subroutine split_block

  !> Creates empty lists for n(1) columns and n(2) rows of cells.
  pure subroutine open_lists(self, n)
    class(cell_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: n(2)

    if (allocated(self%first)) deallocate (self%first, self%entry)
    allocate (self%first(n(1), n(2)), source=0_int32)
    allocate (self%entry(0))
    self%vacant = 0
  end subroutine open_lists

  !> Takes an entry from the list of free entries. If there is none, the array is enlarged.
  pure subroutine new_entry(self, code, image, e)
    class(cell_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: code, image(2)
    integer(int32), intent(out) :: e                !! index of the entry
    type(entry_t), allocatable :: more(:)
    integer(int32) :: n

    if (self%vacant == 0) then
      n = size(self%entry, kind=int32)
      allocate (more(2*n + 64))
      more(:n) = self%entry
      more(n + 1:)%next = [(e, e=n + 2, size(more, kind=int32)), 0]
      call move_alloc(more, self%entry)
      self%vacant = n + 1
    end if
    e = self%vacant
    self%vacant = self%entry(e)%next
    self%entry(e) = entry_t(code, image)
  end subroutine new_entry

  !> Adds an object at the beginning of the list of a cell.
  pure subroutine prepend(self, cell, code, image)
    class(cell_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: cell(2)           !! column and row, counted from 1
    integer(int32), intent(in) :: code, image(2)    !! see `entry_t`
    integer(int32) :: e

    call self%new_entry(code, image, e)
    self%entry(e)%next = self%first(cell(1), cell(2))
    self%first(cell(1), cell(2)) = e
  end subroutine prepend

  !> Adds an object at the end of the list of a cell.
  pure subroutine append(self, cell, code, image)
    class(cell_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: cell(2), code, image(2)
    integer(int32) :: e, last

    call self%new_entry(code, image, e)
    last = self%first(cell(1), cell(2))
    if (last == 0) then
      self%first(cell(1), cell(2)) = e
      return
    end if
    do while (self%entry(last)%next > 0)
      last = self%entry(last)%next
    end do
    self%entry(last)%next = e
  end subroutine append

  !> Removes the first entry of an object from the list of a cell.
  pure subroutine remove(self, cell, code)
    class(cell_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: cell(2), code
    integer(int32) :: e, before

    associate (first => self%first(cell(1), cell(2)))
      before = 0
      e = first
      do while (self%entry(e)%code /= code)
        before = e
        e = self%entry(e)%next
      end do
      if (before == 0) first = self%entry(e)%next
      if (before > 0) self%entry(before)%next = self%entry(e)%next
    end associate
    self%entry(e)%next = self%vacant
    self%vacant = e
  end subroutine remove

end module grid
