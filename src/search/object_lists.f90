!> Obstacles and big disks that reach into each cell. Big disks are a few disks much larger than all
!> others.
!>
!> The width of the cells is chosen for the small disks. A cell lists each big disk that a small
!> disk in the cell could touch, as long as the big disk stays within a margin around its reference
!> position. A prediction for a big disk tests the small disks in the cells along its rim. The cost
!> of every prediction therefore depends only on the sizes of nearby disks.
module object_lists
  use kinds, only: int16, int32, real64
  use cell_faces, only: cell_faces_t
  use cell_layout, only: cell_layout_t
  use circles, only: new_circle
  use disks, only: disk_t
  use grid, only: cell_lists_t, split_block
  use partners, only: obstacle_code
  use shapes, only: shape_t, spare
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: place_t, object_lists_t

  !> A cell into which an obstacle or a big disk reaches.
  type :: place_t
    integer(int32) :: cell(2) = 0                !! column and row
    integer(int32) :: image(2) = 0      !! index of the object's periodic image that reaches into the cell
  end type place_t

  type :: big_disk_t
    integer(int32) :: disk = 0                   !! index of the disk
    real(real64) :: centre(2) = 0.0_real64       !! reference position [length]
    type(place_t), allocatable :: rim(:)         !! cells in which small disks may touch the big disk
    !> Boundary ids of the obstacles that the big disk may touch, in descending order.
    integer(int32), allocatable :: obstacles(:)
  end type big_disk_t

  !> Lists in which obstacles precede big disks, in ascending order of their indices.
  type, extends(cell_lists_t) :: object_lists_t
    type(big_disk_t), allocatable :: big(:)
    real(real64) :: margin = 0.0_real64      !! margin around the reference positions of big disks [length]
    type(cell_layout_t), private :: layout       !! block of cells for which the lists of obstacles were made
    !> Lower left and upper right corner of the rectangle of all cells of the box [length].
    real(real64), private :: span(2, 2) = 0.0_real64
  contains
    procedure :: serves
    procedure :: renew
    procedure :: renew_big
    procedure :: rims
    procedure :: first_in
    procedure :: has_any
    procedure :: number_of
    procedure :: follow
  end type object_lists_t

contains

  !> True if the lists of obstacles were made for the cells of the given block.
  pure function serves(self, layout, faces) result(yes)
    class(object_lists_t), intent(in) :: self
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces
    logical :: yes

    yes = allocated(self%entry)
    if (yes) yes = self%layout%equals(layout) .and. all(abs(span_of(layout, faces) - self%span) <= 0)
  end function serves

  !> Lower left and upper right corner of the rectangle of all cells of the box.
  pure function span_of(layout, faces) result(span)
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces
    real(real64) :: span(2, 2), other(2)           !! [length]

    call faces%rectangle([1, 1], layout%whole, span(:, 1), other)
    call faces%rectangle(layout%whole, layout%whole, other, span(:, 2))
  end function span_of

  !> Lists the obstacles and the big disks, which are too large for the cells.
  subroutine renew(self, sim, layout, faces)
    class(object_lists_t), intent(out) :: self
    type(simulation_t), intent(in) :: sim
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces
    type(place_t), allocatable :: places(:)
    integer(int32) :: k

    if (sim%box%has_obstacles() .or. any(sim%disk%radius > layout%small)) then
      self%margin = 0.5_real64*minval(faces%width)
      call self%open(layout%n)
      self%layout = layout
      self%span = span_of(layout, faces)
    end if
    do k = 1, sim%box%n_obstacles()
      call find_places(sim%box%obstacle(k)%shape, 0.0_real64, layout, faces, places)
      call enter(self, obstacle_code(k), places)
    end do
    call self%renew_big(sim, layout, faces)
  end subroutine renew

  !> Renews the lists of big disks after a possible change of the indices of the disks.
  subroutine renew_big(self, sim, layout, faces)
    class(object_lists_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces
    integer(int32) :: i, k

    if (allocated(self%big)) then
      do k = 1, size(self%big, kind=int32)
        call leave(self, self%big(k)%disk, self%big(k)%rim)
      end do
      deallocate (self%big)
    end if
    associate (disks => pack([(i, i=1, sim%n_disks())], &
      [(sim%disk(i)%radius > layout%small .and. sim%is_inside(i), i=1, sim%n_disks())]))
      allocate (self%big(size(disks)))
      self%big%disk = disks
    end associate
    do k = 1, size(self%big, kind=int32)
      allocate (self%big(k)%rim(0))
      call self%follow(sim, k, layout, faces)
    end do
  end subroutine renew_big

  !> Cells in which small disks may touch big disks.
  pure function rims(self) result(places)
    class(object_lists_t), intent(in) :: self
    type(place_t), allocatable :: places(:)
    integer :: k

    allocate (places(0))
    do k = 1, size(self%big)
      places = [places, self%big(k)%rim]
    end do
  end function rims

  !> Index of the first entry in the list of a cell; 0 if neither an obstacle nor a big disk reaches
  !> into it.
  pure function first_in(self, cell) result(e)
    class(object_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, counted from 1
    integer(int32) :: e

    e = 0
    if (allocated(self%first)) e = self%first(cell(1), cell(2))
  end function first_in

  !> True if any obstacle or big disk reaches into a cell.
  pure function has_any(self, cell) result(yes)
    class(object_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, counted from 1
    logical :: yes

    yes = self%first_in(cell) > 0
  end function has_any

  !> Index of disk i among the big disks; 0 if it is not big.
  pure function number_of(self, i) result(k)
    class(object_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: k

    do k = size(self%big, kind=int32), 1, -1
      if (self%big(k)%disk == i) exit
    end do
  end function number_of

  !> Makes the present position of big disk k its reference position, and renews its entries in the
  !> lists.
  subroutine follow(self, sim, k, layout, faces)
    class(object_lists_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: k
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces

    associate (big => self%big(k))
      call leave(self, big%disk, big%rim)
      big%centre = sim%position(big%disk)
      call find_places(new_circle(big%centre, sim%disk(big%disk)%radius, .false.), self%margin, layout, faces, big%rim)
      big%obstacles = obstacles_along(self, big%rim)
      call enter(self, big%disk, big%rim)
    end associate
  end subroutine follow

  !> Boundary ids, in descending order, of the obstacles that reach into the given cells. If these
  !> are all cells into which a big disk reaches, the result includes every obstacle that the disk
  !> can touch. Both objects reach into the cell of their point of contact.
  pure function obstacles_along(self, places) result(codes)
    class(object_lists_t), intent(in) :: self
    type(place_t), intent(in) :: places(:)
    integer(int32), allocatable :: codes(:)
    integer(int32) :: e, m, code

    allocate (codes(0))
    do m = 1, size(places, kind=int32)
      e = self%first(places(m)%cell(1), places(m)%cell(2))
      do while (e > 0)
        code = self%entry(e)%code
        if (code <= 0 .and. all(codes /= code)) codes = [pack(codes, codes > code), code, pack(codes, codes < code)]
        e = self%entry(e)%next
      end do
    end do
  end function obstacles_along

  !> Finds the cells in which a small disk may touch the outline of a shape displaced by up to
  !> `margin`.
  subroutine find_places(shape, margin, layout, faces, places)
    class(shape_t), intent(in) :: shape
    real(real64), intent(in) :: margin             !! [length]
    type(cell_layout_t), intent(in) :: layout
    type(cell_faces_t), intent(in) :: faces
    type(place_t), allocatable, intent(out) :: places(:)
    real(real64) :: middle(2), room(2)
    integer(int32) :: low(2), high(2), n

    middle = shape%middle - layout%lower
    room = (0.5_real64*(faces%width + faces%overlap) + shape%extent + layout%small + margin)*(1 + spare)
    low = ceiling((middle - room)/faces%width + 0.5_real64)
    high = floor((middle + room)/faces%width + 0.5_real64)
    if (shape%encloses) low = 1
    if (shape%encloses) high = layout%whole
    where (.not. faces%periodic)
      low = min(max(low, 1), layout%whole)
      high = min(max(high, 1), layout%whole)
    end where
    allocate (places(32))
    n = 0
    if (all(low <= high)) call search_block(low, high)
    places = places(:n)

  contains

    !> Adds the cells of a block in which a small disk may touch the outline of the shape. The block
    !> is halved recursively until it is a single cell or lies completely on one side of the
    !> outline.
    recursive subroutine search_block(low, high)
      integer(int32), intent(in) :: low(2), high(2)  !! first and last column and row
      real(real64) :: lower(2), upper(2), beyond(2), half(2), d(2)
      integer(int32) :: cell(2), last(2), first(2)

      call faces%rectangle(low, layout%whole, lower, beyond)
      call faces%rectangle(high, layout%whole, beyond, upper)
      half = 0.5_real64*(upper - lower)*(1 + spare) + margin
      d = 0.5_real64*(lower + upper) - middle
      if (.not. shape%reaches(d, half, layout%small) .or. shape%covers(d, half, 0.0_real64)) return
      if (any(high > low)) then
        call split_block(low, high, last, first)
        call search_block(low, last)
        call search_block(first, high)
        return
      end if
      cell = modulo(low - layout%first, layout%whole) + 1
      if (any(cell > layout%n)) return
      if (n == size(places)) places = [places, places]
      n = n + 1
      places(n) = place_t(cell, -floor(real(low - 1, real64)/layout%whole))
    end subroutine search_block
  end subroutine find_places

  !> Appends an obstacle or a big disk to the lists of several cells.
  pure subroutine enter(self, code, places)
    class(object_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: code
    type(place_t), intent(in) :: places(:)
    integer :: m

    do m = 1, size(places)
      call self%append(places(m)%cell, code, places(m)%image)
    end do
  end subroutine enter

  !> Removes a big disk from the lists of several cells.
  pure subroutine leave(self, code, places)
    class(object_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: code
    type(place_t), intent(in) :: places(:)
    integer :: m

    do m = 1, size(places)
      call self%remove(places(m)%cell, code)
    end do
  end subroutine leave

end module object_lists
