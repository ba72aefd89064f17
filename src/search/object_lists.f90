!> Lists the obstacles and the big disks that reach into each cell. A disk is called big if it is one of a few disks that are much
!> larger than all others.
!>
!> The width of the cells is chosen for the small disks. A big disk is listed in each cell in which a small disk could touch the big
!> disk. The entries of a big disk are valid while the disk stays within a margin around its reference position, which is the
!> position for which the entries were made. The list of a cell contains the big disks that a small disk in the cell may touch. A
!> prediction for a big disk tests the small disks in the cells along the boundary of the big disk. The cost of a prediction for a
!> disk depends only on the sizes of nearby disks.
module object_lists
  use kinds, only: int16, int32, real64
  use cell_faces, only: cell_faces_t, patch_t
  use circles, only: new_circle
  use disks, only: disk_t
  use partners, only: obstacle_code
  use shapes, only: shape_t, spare
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: entry_t, largest_small_radius, place_t, object_lists_t

  integer(int32), parameter :: most_big_disks = 256    !! largest number of big disks; each is tested against all other big disks

  !> A cell into which an obstacle or a big disk reaches.
  type :: place_t
    integer(int32) :: cell(2) = 0                !! column and row
    integer(int32) :: image(2) = 0               !! index of the periodic image of the object that reaches into the cell
  end type place_t

  !> An entry in the list of a cell: an obstacle or a big disk.
  type :: entry_t
    integer(int32) :: code = 0                   !! index of a big disk (> 0), or code of an obstacle (<= 0)
    integer(int32) :: image(2) = 0
    integer(int32) :: next = 0                   !! next entry in the same list; 0 at the end of the list
  end type entry_t

  type :: big_disk_t
    integer(int32) :: disk = 0                   !! index of the disk
    real(real64) :: centre(2) = 0.0_real64       !! reference position [length]
    type(place_t), allocatable :: rim(:)         !! cells in which small disks may touch the big disk
    integer(int32), allocatable :: obstacles(:)  !! codes of the obstacles that the big disk may touch, in descending order
  end type big_disk_t

  type :: object_lists_t
    type(big_disk_t), allocatable :: big(:)
    real(real64) :: margin = 0.0_real64          !! margin around the reference positions of big disks [length]
    !> (columns,rows) first entry in the list of each cell; 0 for an empty list. The array is not allocated if there are neither
    !> obstacles nor big disks.
    integer(int32), allocatable :: first(:, :)
    type(entry_t), allocatable :: entry(:)
    integer(int32), private :: vacant = 0        !! first entry in the list of free entries
    type(patch_t), private :: patch              !! patch of cells for which the lists of obstacles were made
    !> Lower left and upper right corner of the rectangle that contains all cells of the box [length]
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

  !> The radius that determines the width of the cells: the largest radius of all disks, or the largest radius of the small disks if
  !> a few disks are much bigger.
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

  !> Whether the lists of obstacles have already been made for the cells of the given patch.
  pure function serves(self, patch, faces) result(yes)
    class(object_lists_t), intent(in) :: self
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    logical :: yes

    yes = allocated(self%entry)
    if (yes) yes = self%patch%equals(patch) .and. all(abs(span_of(patch, faces) - self%span) <= 0)
  end function serves

  !> The lower left and the upper right corner of the rectangle that contains all cells of the box.
  pure function span_of(patch, faces) result(span)
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    real(real64) :: span(2, 2), other(2)           !! [length]

    call faces%rectangle([1, 1], patch%whole, span(:, 1), other)
    call faces%rectangle(patch%whole, patch%whole, other, span(:, 2))
  end function span_of

  !> Makes the lists of obstacles and big disks. Big disks are disks for which the cells are not wide enough.
  subroutine renew(self, sim, patch, faces)
    class(object_lists_t), intent(out) :: self
    type(simulation_t), intent(in) :: sim
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    type(place_t), allocatable :: places(:)
    integer(int32) :: k

    if (sim%box%has_obstacles() .or. any(sim%disk%radius > patch%small)) then
      self%margin = 0.5_real64*minval(faces%width)
      allocate (self%first(patch%n(1), patch%n(2)), source=0_int32)
      allocate (self%entry(0))
      self%patch = patch
      self%span = span_of(patch, faces)
    end if
    do k = 1, sim%box%n_obstacles()
      call find_places(sim%box%obstacle(k)%shape, 0.0_real64, patch, faces, places)
      call enter(self, obstacle_code(k), places)
    end do
    call self%renew_big(sim, patch, faces)
  end subroutine renew

  !> Renews the lists of big disks, because the indices of the disks may have changed.
  subroutine renew_big(self, sim, patch, faces)
    class(object_lists_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    integer(int32) :: i, k

    if (allocated(self%big)) then
      do k = 1, size(self%big, kind=int32)
        call leave(self, self%big(k)%disk, self%big(k)%rim)
      end do
      deallocate (self%big)
    end if
    associate (disks => pack([(i, i=1, sim%n_disks())], sim%disk%radius > patch%small))
      allocate (self%big(size(disks)))
      self%big%disk = disks
    end associate
    do k = 1, size(self%big, kind=int32)
      allocate (self%big(k)%rim(0))
      call self%follow(sim, k, patch, faces)
    end do
  end subroutine renew_big

  !> The cells in which small disks may touch big disks.
  pure function rims(self) result(places)
    class(object_lists_t), intent(in) :: self
    type(place_t), allocatable :: places(:)
    integer :: k

    allocate (places(0))
    do k = 1, size(self%big)
      places = [places, self%big(k)%rim]
    end do
  end function rims

  !> Index of the first entry in the list of a cell; 0 if neither an obstacle nor a big disk reaches into the cell.
  pure function first_in(self, cell) result(e)
    class(object_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, counted from 1
    integer(int32) :: e

    e = 0
    if (allocated(self%first)) e = self%first(cell(1), cell(2))
  end function first_in

  !> Whether any obstacle or big disk reaches into a cell.
  pure function has_any(self, cell) result(yes)
    class(object_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, counted from 1
    logical :: yes

    yes = self%first_in(cell) > 0
  end function has_any

  !> Index of disk i among the big disks; 0 if disk i is not a big disk.
  pure function number_of(self, i) result(k)
    class(object_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: k

    do k = size(self%big, kind=int32), 1, -1
      if (self%big(k)%disk == i) exit
    end do
  end function number_of

  !> Makes the present position of the k-th big disk its reference position, and renews the entries of this disk in the lists.
  subroutine follow(self, sim, k, patch, faces)
    class(object_lists_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: k
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces

    associate (big => self%big(k))
      call leave(self, big%disk, big%rim)
      big%centre = sim%position(big%disk)
      call find_places(new_circle(big%centre, sim%disk(big%disk)%radius, .false.), self%margin, patch, faces, big%rim)
      big%obstacles = obstacles_along(self, big%rim)
      call enter(self, big%disk, big%rim)
    end associate
  end subroutine follow

  !> Codes of the obstacles that reach into the given cells, in descending order. If a big disk touches an obstacle, the point of
  !> contact is in a cell into which both the big disk and the obstacle reach.
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

  !> Finds the cells in which a small disk may touch the outline of a shape that has moved by up to `margin`.
  subroutine find_places(shape, margin, patch, faces, places)
    class(shape_t), intent(in) :: shape
    real(real64), intent(in) :: margin             !! [length]
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    type(place_t), allocatable, intent(out) :: places(:)
    real(real64) :: middle(2), room(2)
    integer(int32) :: low(2), high(2), n

    middle = shape%middle - patch%lower
    room = (0.5_real64*(faces%width + faces%overlap) + shape%extent + patch%small + margin)*(1 + spare)
    low = ceiling((middle - room)/faces%width + 0.5_real64)
    high = floor((middle + room)/faces%width + 0.5_real64)
    if (shape%encloses) low = 1
    if (shape%encloses) high = patch%whole
    where (.not. faces%periodic)
      low = min(max(low, 1), patch%whole)
      high = min(max(high, 1), patch%whole)
    end where
    allocate (places(32))
    n = 0
    if (all(low <= high)) call search_block(low, high)
    places = places(:n)

  contains

    !> Adds the cells of a block in which a small disk may touch the outline of the shape. The block is halved recursively until the
    !> block is a single cell, or until the outline does not cross the block.
    recursive subroutine search_block(low, high)
      integer(int32), intent(in) :: low(2), high(2)  !! first and last column and row
      real(real64) :: lower(2), upper(2), beyond(2), half(2), d(2)
      integer(int32) :: cell(2), last(2), first(2), axis

      call faces%rectangle(low, patch%whole, lower, beyond)
      call faces%rectangle(high, patch%whole, beyond, upper)
      half = 0.5_real64*(upper - lower)*(1 + spare) + margin
      d = 0.5_real64*(lower + upper) - middle
      if (.not. shape%reaches(d, half, patch%small) .or. shape%covers(d, half, 0.0_real64)) return
      if (any(high > low)) then
        axis = merge(1, 2, high(1) - low(1) >= high(2) - low(2))
        last = high
        last(axis) = low(axis) + (high(axis) - low(axis))/2
        first = low
        first(axis) = last(axis) + 1
        call search_block(low, last)
        call search_block(first, high)
        return
      end if
      cell = modulo(low - patch%first, patch%whole) + 1
      if (any(cell > patch%n)) return
      if (n == size(places)) places = [places, places]
      n = n + 1
      places(n) = place_t(cell, -floor(real(low - 1, real64)/patch%whole))
    end subroutine search_block
  end subroutine find_places

  !> Appends an obstacle or a big disk to the lists of some cells. In each list obstacles come first, in ascending order of their
  !> indices.
  pure subroutine enter(self, code, places)
    class(object_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: code
    type(place_t), intent(in) :: places(:)
    type(entry_t), allocatable :: more(:)
    integer(int32) :: e, last, m, n

    do m = 1, size(places, kind=int32)
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
      self%entry(e) = entry_t(code, places(m)%image)
      associate (first => self%first(places(m)%cell(1), places(m)%cell(2)))
        last = first
        if (first == 0) first = e
      end associate
      if (last == 0) cycle
      do while (self%entry(last)%next > 0)
        last = self%entry(last)%next
      end do
      self%entry(last)%next = e
    end do
  end subroutine enter

  !> Removes a big disk from the lists of some cells.
  pure subroutine leave(self, code, places)
    class(object_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: code
    type(place_t), intent(in) :: places(:)
    integer(int32) :: e, before, m

    do m = 1, size(places, kind=int32)
      associate (first => self%first(places(m)%cell(1), places(m)%cell(2)))
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
    end do
  end subroutine leave

end module object_lists
