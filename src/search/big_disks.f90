!> Few big disks among many small ones. The cells are made for the small ones; a big disk is registered in every cell
!> from which a small one could touch it while it stays within a margin of where it was registered. So a small disk
!> finds big ones in its own cell, and a big disk searches the ring of cells along its rim: no disk pays for sizes
!> that do not occur nearby.
module big_disks
  use kinds, only: int32, real64
  use cell_faces, only: cell_faces_t
  use disks, only: disk_t
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: big_disks_t, largest_small_radius, ring_cell_t

  integer(int32), parameter :: most_big_disks = 256    !! they test each other all with all

  !> A cell along the rim of a big disk.
  type :: ring_cell_t
    integer(int32) :: cell(2) = 0                !! column, row
    integer(int32) :: image(2) = 0               !! periods from the disk to where it is seen from the cell
  end type ring_cell_t

  type :: ring_t
    type(ring_cell_t), allocatable :: at(:)
  end type ring_t

  !> A big disk in the list of a cell.
  type :: listing_t
    integer(int32) :: number = 0                 !! of the big disk
    integer(int32) :: image(2) = 0
    integer(int32) :: next = 0                   !! entry in the same list; 0: none
  end type listing_t

  type :: big_disks_t
    integer(int32) :: count = 0
    integer(int32), allocatable :: disk(:)       !! (count) which disks they are
    real(real64), allocatable :: centre(:, :)    !! (2,count) where they were registered [length]
    type(ring_t), allocatable :: ring(:)         !! (count)
    real(real64) :: small = 0.0_real64           !! largest radius of the other disks [length]
    real(real64) :: margin = 0.0_real64          !! [length]
    integer(int32), allocatable :: first(:, :)   !! (columns,rows) first entry of a cell; 0: none
    type(listing_t), allocatable :: listing(:)
    integer(int32), private :: free = 0          !! first of the entries not in use
  contains
    procedure :: start
    procedure :: number_of
    procedure :: register
  end type big_disks_t

contains

  !> The largest radius among the disks that cells should be made for: all, unless a few are much bigger.
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

  !> Finds the disks bigger than `small` and registers them in n(1) columns and n(2) rows of cells.
  subroutine start(self, sim, small, n, faces)
    class(big_disks_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: small            !! [length]
    integer(int32), intent(in) :: n(2)
    type(cell_faces_t), intent(in) :: faces
    integer(int32) :: i, k

    self%disk = pack([(i, i=1, sim%n_disks())], sim%disk%radius > small)
    self%count = size(self%disk, kind=int32)
    self%small = small
    if (self%count == 0) return
    self%margin = 0.5_real64*minval(faces%width)
    if (allocated(self%ring)) deallocate (self%ring, self%centre, self%first, self%listing)
    allocate (self%ring(self%count), self%centre(2, self%count), self%first(n(1), n(2)), self%listing(0))
    self%first = 0
    self%free = 0
    do k = 1, self%count
      allocate (self%ring(k)%at(0))
      call self%register(sim, k, faces)
    end do
  end subroutine start

  !> Which of the big disks disk i is; 0 if none.
  pure function number_of(self, i) result(k)
    class(big_disks_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: k

    do k = self%count, 1, -1
      if (self%disk(k) == i) exit
    end do
  end function number_of

  !> Moves the registration of the k-th big disk to where it is now.
  subroutine register(self, sim, k, faces)
    class(big_disks_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: k
    type(cell_faces_t), intent(in) :: faces
    integer :: m

    do m = 1, size(self%ring(k)%at)
      call unlist(self, self%ring(k)%at(m)%cell, k)
    end do
    self%centre(:, k) = sim%position(self%disk(k))
    call find_ring(self, sim, k, faces)
    do m = 1, size(self%ring(k)%at)
      call list_in(self, self%ring(k)%at(m), k)
    end do
  end subroutine register

  !> The cells that a small disk's centre can be in when it touches the k-th big disk: those that meet the
  !> annulus between the rim and one small radius outside it, both widened by the margin.
  subroutine find_ring(self, sim, k, faces)
    class(big_disks_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: k
    type(cell_faces_t), intent(in) :: faces
    type(ring_cell_t), allocatable :: found(:)
    real(real64) :: inner, outer, centre(2), corner(2, 2), half(2)
    integer(int32) :: low(2), high(2), n(2), ix, iy, m, period(2)

    inner = sim%disk(self%disk(k))%radius - self%margin
    outer = inner + self%small + 2*self%margin
    n = shape(self%first)
    centre = self%centre(:, k) - sim%box%lower
    half = 0.5_real64*(faces%width + faces%overlap)
    low = floor((centre - outer - half)/faces%width + 0.5_real64) + 1
    high = floor((centre + outer + half)/faces%width - 0.5_real64) + 1
    low = merge(low, min(max(low, 1), n), sim%box%periodic)
    high = merge(high, max(min(high, n), 1), sim%box%periodic)
    allocate (found(product(max(high - low + 1, 0))))
    m = 0
    do iy = low(2), high(2)
      do ix = low(1), high(1)
        call faces%rectangle([ix, iy], n, corner(:, 1), corner(:, 2))
        if (magnitude(max(corner(:, 1) - centre, centre - corner(:, 2), 0.0_real64)) > outer) cycle
        if (magnitude(max(abs(corner(:, 1) - centre), abs(corner(:, 2) - centre))) < inner) cycle
        period = floor(real([ix, iy] - 1, real64)/n)
        m = m + 1
        found(m) = ring_cell_t([ix, iy] - period*n, -period)
      end do
    end do
    self%ring(k)%at = found(:m)
  end subroutine find_ring

  !> Adds the k-th big disk to the list of a cell.
  subroutine list_in(self, place, k)
    class(big_disks_t), intent(inout) :: self
    type(ring_cell_t), intent(in) :: place
    integer(int32), intent(in) :: k
    type(listing_t), allocatable :: more(:)
    integer(int32) :: e, n

    if (self%free == 0) then
      n = size(self%listing, kind=int32)
      allocate (more(2*n + 64))
      more(:n) = self%listing
      more(n + 1:)%next = [(e, e=n + 2, size(more, kind=int32)), 0]
      call move_alloc(more, self%listing)
      self%free = n + 1
    end if
    e = self%free
    self%free = self%listing(e)%next
    self%listing(e) = listing_t(k, place%image, self%first(place%cell(1), place%cell(2)))
    self%first(place%cell(1), place%cell(2)) = e
  end subroutine list_in

  !> Removes the k-th big disk from the list of a cell, once.
  subroutine unlist(self, cell, k)
    class(big_disks_t), intent(inout) :: self
    integer(int32), intent(in) :: cell(2), k
    integer(int32) :: e, before

    before = 0
    e = self%first(cell(1), cell(2))
    do while (self%listing(e)%number /= k)
      before = e
      e = self%listing(e)%next
    end do
    if (before == 0) then
      self%first(cell(1), cell(2)) = self%listing(e)%next
    else
      self%listing(before)%next = self%listing(e)%next
    end if
    self%listing(e)%next = self%free
    self%free = e
  end subroutine unlist

end module big_disks
