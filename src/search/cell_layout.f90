!> Columns and rows of the cells in which disks are searched. They are the cells of the whole box,
!> whose width is chosen here, or the cells of a domain of a parallel run.
module cell_layout
  use kinds, only: int16, int32, never, real64
  use box_geometry, only: box_t
  use disks, only: disk_t
  use shapes, only: spare
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: all_cells, cell_layout_t, whole_box

  !> With fewer disks per cell, a prediction tests fewer candidates, but disks cross cells more
  !> often. Intended mean number of disks per cell in a dilute system.
  real(real64), parameter :: disks_per_cell = 0.6_real64
  !> Maximum number of big disks, each of which is tested against all others.
  integer(int32), parameter :: most_big_disks = 256

  !> A rectangular block of cells. Usually the block contains all cells of the box. In a parallel
  !> run it contains the cells of a domain and its halo, possibly across a periodic side. A disk
  !> that crosses an outer face leaves the block, unless the face is a side of the box.
  type :: cell_layout_t
    integer(int32) :: whole(2) = 0                 !! numbers of columns and rows in the whole box
    !> First column and row of the block; below 1 if the block starts beyond a periodic side of the
    !> box.
    integer(int32) :: first(2) = 1
    integer(int32) :: n(2) = 0                     !! numbers of columns and rows in the block
    real(real64) :: small = 0.0_real64      !! maximum radius for which the cells are wide enough [length]
    real(real64) :: reach = 0.0_real64    !! maximum distance between the centres of disks in contact [length]
    real(real64) :: lower(2) = 0.0_real64          !! lower left corner of the box [length]
    real(real64) :: width(2) = 0.0_real64          !! distance between adjacent cells [length]
    ! Along an axis with a periodic side inside the block, `last` is the column or row just before
    ! this side, and `next` is the column or row just behind it. Along an axis without such a side,
    ! both are 0.
    integer(int32) :: last(2) = 0
    integer(int32) :: next(2) = 0
  contains
    procedure :: find_sides
    procedure :: cell_at
    procedure :: place_of
    procedure :: holds
    procedure :: at_seam
    procedure :: covers
    procedure :: step
    procedure :: equals
  end type cell_layout_t

contains

  !> Chooses the cells for all disks and obstacles of a simulation. Obstacles count as disks,
  !> because each disk is also tested against the obstacles in its cell.
  pure function whole_box(sim, undivided) result(layout)
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: undivided
    type(cell_layout_t) :: layout
    real(real64) :: small, reach, width

    small = merge(maxval(sim%disk%radius), largest_small_radius(sim%disk), undivided .or. sim%box%is_sheared())
    reach = 2*small*(1 + spare)
    width = max(sqrt(disks_per_cell*product(sim%box%edges())/(sim%n_disks() + sim%box%n_obstacles())), reach)
    if (undivided) width = never
    layout = all_cells(sim%box%box_t, int(min(max(sim%box%edges()/width, 1.0_real64), 32000.0_real64), int32), reach)
    layout%small = small
  end function whole_box

  !> Radius that determines the width of the cells. It is the maximum of all radii or, if a few
  !> disks are much bigger, the maximum radius of the small disks.
  pure function largest_small_radius(disk) result(radius)
    type(disk_t), intent(in) :: disk(:)
    real(real64) :: radius, next
    integer :: n_bigger

    radius = maxval(disk%radius)
    do
      next = maxval(disk%radius, mask=disk%radius <= 0.5_real64*radius)
      n_bigger = count(disk%radius > next)
      if (.not. next > 0 .or. n_bigger > most_big_disks .or. 20*n_bigger > size(disk)) exit
      radius = next
    end do
  end function largest_small_radius

  !> The block of all cells of a box with n(1) columns and n(2) rows.
  pure function all_cells(box, n, reach) result(layout)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: n(2)
    real(real64), intent(in) :: reach     !! maximum distance between the centres of disks in contact [length]
    type(cell_layout_t) :: layout

    layout%whole = n
    layout%n = n
    layout%reach = reach
    layout%lower = box%lower
    ! The cells are made slightly wider, so that rounding errors cannot put the last face inside the
    ! box.
    layout%width = box%edges()/n*(1 + 4*epsilon(reach))
    call layout%find_sides(box%periodic)
  end function all_cells

  !> Finds the columns and rows beside periodic sides inside the block.
  pure subroutine find_sides(self, periodic)
    class(cell_layout_t), intent(inout) :: self
    logical, intent(in) :: periodic(2)

    self%last = modulo(self%whole - self%first, self%whole) + 1
    self%next = modulo(self%last, self%whole) + 1
    where (.not. periodic .or. self%last > self%n .or. self%next > self%n)
      self%last = 0
      self%next = 0
    end where
  end subroutine find_sides

  !> Column and row, within the block, of a point of the box; greater than `n` outside the block.
  pure function cell_at(self, x) result(cell)
    class(cell_layout_t), intent(in) :: self
    real(real64), intent(in) :: x(2)               !! [length]
    integer(int32) :: cell(2)

    cell = min(max(int((x - self%lower)/self%width, int32) + 1, 1), self%whole)
    if (self%first(1) /= 1 .or. self%first(2) /= 1) cell = modulo(cell - self%first, self%whole) + 1
  end function cell_at

  !> Converts a column or row number of the block to the number in the grid of the whole box.
  elemental function place_of(self, cell, axis) result(place)
    class(cell_layout_t), intent(in) :: self
    integer(int32), intent(in) :: cell
    integer, intent(in) :: axis
    integer(int32) :: place

    place = modulo(self%first(axis) + cell - 2, self%whole(axis)) + 1
  end function place_of

  !> True if a cell belongs to the block.
  pure function holds(self, cell) result(yes)
    class(cell_layout_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = all(cell >= 1 .and. cell <= self%n)
  end function holds

  !> True if all given cells, numbered as in the grid of the whole box, belong to the block.
  pure function covers(self, cell) result(yes)
    class(cell_layout_t), intent(in) :: self
    integer(int16), intent(in) :: cell(:, :)       !! shape (2, n)
    logical :: yes(size(cell, 2))

    yes = modulo(cell(1, :) - self%first(1), self%whole(1)) < self%n(1) &
      .and. modulo(cell(2, :) - self%first(2), self%whole(2)) < self%n(2)
  end function covers

  !> True if any of the eight neighbours of a cell is beyond a periodic side.
  pure function at_seam(self, cell) result(yes)
    class(cell_layout_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = any(cell == self%last .or. cell == self%next)
  end function at_seam

  !> Finds the column or row that is `ahead` steps away from a given column or row, and the number
  !> of periodic sides between them.
  pure subroutine step(self, axis, cell, ahead, there, periods)
    class(cell_layout_t), intent(in) :: self
    integer, intent(in) :: axis
    integer(int32), intent(in) :: cell, ahead
    integer(int32), intent(out) :: there, periods

    there = cell + ahead
    periods = 0
    associate (last => self%last(axis), n => self%n(axis))
      if (last == 0) return
      ! the periodic side is inside the block
      if (last < n) periods = merge(1, 0, there > last) - merge(1, 0, cell > last)
      if (last < n) return
      do while (there > n)
        there = there - n
        periods = periods + 1
      end do
      do while (there < 1)
        there = there + n
        periods = periods - 1
      end do
    end associate
  end subroutine step

  !> True if two blocks consist of the same cells and were chosen for disks of the same sizes.
  pure function equals(self, other) result(yes)
    class(cell_layout_t), intent(in) :: self
    type(cell_layout_t), intent(in) :: other
    logical :: yes

    yes = all(self%whole == other%whole) .and. all(self%first == other%first) .and. all(self%n == other%n) &
      .and. abs(self%small - other%small) <= 0 .and. abs(self%reach - other%reach) <= 0 &
      .and. all(abs(self%lower - other%lower) <= 0) .and. all(abs(self%width - other%width) <= 0)
  end function equals

end module cell_layout
