!> Where a simulation is cut into domains: slabs of columns of cells, each cut into rectangles, so that all hold about as
!> many disks. Each domain's patch is its rectangle and the cells around it, as many as the halo is wide.
module domain_cuts
  use kinds, only: int32, real64
  use cell_faces, only: patch_t
  use cell_grid, only: whole_box
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: domain_cuts_t

  !> First cells of consecutive pieces, and the first beyond the last.
  type :: cuts_t
    integer(int32), allocatable :: first(:)
  end type cuts_t

  type :: domain_cuts_t
    type(patch_t) :: whole
    integer(int32) :: halo = 0
    integer(int32) :: n = 0                        !! domains
    integer(int32), allocatable :: low(:, :), high(:, :)   !! (2,n) columns, rows of each
    integer(int32), allocatable, private :: slab_of(:)     !! (columns)
    integer(int32), allocatable, private :: domain_of(:, :)!! (rows,slabs)
  contains
    procedure :: cut
    procedure :: patch_of
    procedure :: neighbours_of
    procedure :: list_members
  end type domain_cuts_t

contains

  !> Cuts the box into at most `wanted` domains, none narrower than two halos. The disks must lie in it somewhere.
  subroutine cut(self, sim, wanted, halo)
    class(domain_cuts_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: wanted, halo
    type(cuts_t) :: slabs
    type(cuts_t), allocatable :: pieces(:)
    integer(int32), allocatable :: cell(:, :), weight(:)
    integer(int32) :: n(2), i, s, k, r

    self%whole = whole_box(sim)
    self%halo = halo
    n = numbers(self, sim%box%periodic, wanted)
    allocate (cell(2, sim%n_disks()))
    do i = 1, sim%n_disks()
      cell(:, i) = self%whole%cell_at(sim%position(i))
    end do
    allocate (weight(self%whole%n(1)))
    weight = 0
    do i = 1, sim%n_disks()
      weight(cell(1, i)) = weight(cell(1, i)) + 1
    end do
    call divide(weight, n(1), 2*halo + 1, slabs)
    if (allocated(self%slab_of)) deallocate (self%slab_of, self%domain_of)
    allocate (self%slab_of(self%whole%n(1)), self%domain_of(self%whole%n(2), n(1)), pieces(n(1)))
    do s = 1, n(1)
      self%slab_of(slabs%first(s):slabs%first(s + 1) - 1) = s
    end do
    self%n = product(n)
    if (allocated(self%low)) deallocate (self%low, self%high)
    allocate (self%low(2, self%n), self%high(2, self%n))
    deallocate (weight)
    allocate (weight(self%whole%n(2)))
    k = 0
    do s = 1, n(1)
      weight = 0
      do i = 1, sim%n_disks()
        if (self%slab_of(cell(1, i)) == s) weight(cell(2, i)) = weight(cell(2, i)) + 1
      end do
      call divide(weight, n(2), 2*halo + 1, pieces(s))
      do r = 1, n(2)
        k = k + 1
        self%low(:, k) = [slabs%first(s), pieces(s)%first(r)]
        self%high(:, k) = [slabs%first(s + 1), pieces(s)%first(r + 1)] - 1
        self%domain_of(self%low(2, k):self%high(2, k), s) = k
      end do
    end do
  end subroutine cut

  !> How many slabs, and domains in each: as square as can be, and none too narrow.
  pure function numbers(self, periodic, wanted) result(n)
    class(domain_cuts_t), intent(in) :: self
    logical, intent(in) :: periodic(2)
    integer(int32), intent(in) :: wanted
    integer(int32) :: n(2), most(2), columns

    most = max(self%whole%n/(2*self%halo + 1), 1)
    n = 1
    do columns = 1, min(wanted, most(1))
      if (crowding(self, [columns, min(wanted/columns, most(2))], periodic, wanted) &
        < crowding(self, n, periodic, wanted)) n = [columns, min(wanted/columns, most(2))]
    end do
  end function numbers

  !> What is to be small: the largest number of cells in a patch, as if cuts were even, with a penalty for few domains.
  pure function crowding(self, n, periodic, wanted)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: n(2), wanted
    logical, intent(in) :: periodic(2)
    real(real64) :: crowding

    crowding = product(real(self%whole%n, real64)/n + merge(2*self%halo, 0, n > merge(1, 2, periodic)) &
      + merge(self%halo, 0, n == 2 .and. .not. periodic))*real(wanted, real64)/product(n)
  end function crowding

  !> Cuts a line of cells into n pieces of about equal weight, each at least `least` cells long.
  pure subroutine divide(weight, n, least, cuts)
    integer(int32), intent(in) :: weight(:), n, least
    type(cuts_t), intent(out) :: cuts
    integer(int32) :: k, place
    real(real64) :: sum_so_far, total

    allocate (cuts%first(n + 1))
    cuts%first(1) = 1
    cuts%first(n + 1) = size(weight, kind=int32) + 1
    total = sum(real(weight, real64))
    place = 1
    sum_so_far = 0
    do k = 2, n
      do while (place <= size(weight))
        if (sum_so_far + 0.5_real64*weight(place) > total*(k - 1)/n) exit
        sum_so_far = sum_so_far + weight(place)
        place = place + 1
      end do
      cuts%first(k) = min(max(place, cuts%first(k - 1) + least), cuts%first(n + 1) - (n + 1 - k)*least)
    end do
  end subroutine divide

  !> The patch of the k-th domain.
  pure function patch_of(self, k, periodic) result(patch)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: k
    logical, intent(in) :: periodic(2)
    type(patch_t) :: patch
    integer(int32) :: last(2)

    patch = self%whole
    patch%first = self%low(:, k) - self%halo
    last = self%high(:, k) + self%halo
    where (.not. periodic .or. (self%low(:, k) == 1 .and. self%high(:, k) == self%whole%n))
      patch%first = max(patch%first, 1)
      last = min(last, self%whole%n)
    end where
    patch%n = last - patch%first + 1
    call patch%find_sides(periodic)
  end function patch_of

  !> The domains with disks in the patch of the k-th.
  pure function neighbours_of(self, k, patch) result(list)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: k
    type(patch_t), intent(in) :: patch
    integer(int32), allocatable :: list(:)
    logical :: near(self%n)
    integer(int32) :: ix, iy, m

    near = .false.
    do ix = 1, patch%n(1)
      do iy = 1, patch%n(2)
        near(self%domain_of(patch%place_of(iy, 2), self%slab_of(patch%place_of(ix, 1)))) = .true.
      end do
    end do
    near(k) = .false.
    list = pack([(m, m=1, self%n)], near)
  end function neighbours_of

  !> Lists the disks in the patch of each domain.
  subroutine list_members(self, sim, patch, first, member)
    class(domain_cuts_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(patch_t), intent(in) :: patch(:)
    integer(int32), allocatable, intent(out) :: first(:)     !! (n+1) of each domain in `member`
    integer(int32), allocatable, intent(out) :: member(:)
    integer(int32), allocatable :: next(:)
    integer(int32) :: i, k, pass, cell(2), n_near, near(16)

    allocate (first(self%n + 1), next(self%n))
    next = 0
    do pass = 1, 2
      do i = 1, sim%n_disks()
        cell = self%whole%cell_at(sim%position(i))
        call find_near(self, cell, n_near, near)
        do k = 1, n_near
          if (any(modulo(cell - patch(near(k))%first, self%whole%n) >= patch(near(k))%n)) cycle
          if (pass == 2) member(next(near(k))) = i
          next(near(k)) = next(near(k)) + 1
        end do
      end do
      if (pass == 2) exit
      first(1) = 1
      do k = 1, self%n
        first(k + 1) = first(k) + next(k)
      end do
      next = first(:self%n)
      allocate (member(first(self%n + 1) - 1))
    end do
  end subroutine list_members

  !> The domains whose patches may contain a cell: those of the cells one halo away, each once.
  pure subroutine find_near(self, cell, n, near)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: cell(2)
    integer(int32), intent(out) :: n
    integer(int32), intent(out) :: near(16)        !! (n)
    integer(int32) :: column, row, dx, dy, candidate

    n = 0
    do dx = -1, 1
      column = modulo(cell(1) + dx*self%halo - 1, self%whole%n(1)) + 1
      do dy = -1, 1
        row = modulo(cell(2) + dy*self%halo - 1, self%whole%n(2)) + 1
        candidate = self%domain_of(row, self%slab_of(column))
        if (any(near(:n) == candidate)) cycle
        n = n + 1
        near(n) = candidate
      end do
    end do
  end subroutine find_near

end module domain_cuts
