!> Spatial decomposition of a simulation into domains. The columns of cells are grouped into slabs,
!> and each slab is divided into rectangles with about equal numbers of disks. Each rectangle is a
!> domain. Together with the halo of cells around it, it forms the extended domain, whose
!> cells are the `layout`.
module domain_cuts
  use kinds, only: int16, int32, real64
  use cell_layout, only: cell_layout_t
  implicit none
  private
  public :: domain_cuts_t

  type :: domain_cuts_t
    type(cell_layout_t) :: whole
    integer(int32) :: halo = 0
    integer(int32) :: n = 0                        !! number of domains
    !> First and last column and row of each domain; shape (2, n)
    integer(int32), allocatable :: low(:, :), high(:, :)
    integer(int32), allocatable, private :: slab_of(:)     !! slab of each column
    integer(int32), allocatable, private :: domain_of(:, :)!! domain of each row in each slab
  contains
    procedure :: cut
    procedure :: layout_of
    procedure :: neighbours_of
  end type domain_cuts_t

contains

  !> Divides the box into at most `wanted` domains for a given number of threads. Each domain is
  !> wider than two halos.
  subroutine cut(self, whole, periodic, cell, wanted, threads, halo)
    class(domain_cuts_t), intent(inout) :: self
    type(cell_layout_t), intent(in) :: whole
    logical, intent(in) :: periodic(2)
    integer(int16), intent(in) :: cell(:, :)       !! cell of each disk; shape (2, disks)
    integer(int32), intent(in) :: wanted, threads, halo
    ! first cell of each piece, followed by the number of cells plus 1
    integer(int32), allocatable :: slab(:), piece(:)
    integer(int32), allocatable :: weight(:), weights(:, :)
    integer(int32) :: n(2), i, s, k, r

    self%whole = whole
    self%halo = halo
    n = numbers()
    self%n = product(n)
    if (allocated(self%low)) deallocate (self%low, self%high, self%slab_of, self%domain_of)
    allocate (self%low(2, self%n), self%high(2, self%n), self%slab_of(whole%n(1)), self%domain_of(whole%n(2), n(1)))
    allocate (weight(whole%n(1)), weights(whole%n(2), n(1)), source=0_int32)
    do i = 1, size(cell, 2, kind=int32)
      weight(cell(1, i)) = weight(cell(1, i)) + 1
    end do
    slab = pieces(weight, n(1), 2*halo + 1)
    do s = 1, n(1)
      self%slab_of(slab(s):slab(s + 1) - 1) = s
    end do
    do i = 1, size(cell, 2, kind=int32)
      s = self%slab_of(cell(1, i))
      weights(cell(2, i), s) = weights(cell(2, i), s) + 1
    end do
    do s = 1, n(1)
      piece = pieces(weights(:, s), n(2), 2*halo + 1)
      do r = 1, n(2)
        k = r + n(2)*(s - 1)
        self%low(:, k) = [slab(s), piece(r)]
        self%high(:, k) = [slab(s + 1), piece(r + 1)] - 1
        self%domain_of(self%low(2, k):self%high(2, k), s) = k
      end do
    end do
  contains

    !> Chooses the number of slabs and the number of domains in each slab. The estimated work is
    !> minimised under two conditions. The total number of domains must not be much smaller than
    !> `wanted`, and no domain must be too narrow.
    pure function numbers() result(n)
      integer(int32) :: n(2), most(2), columns, rows

      most = max(self%whole%n/(2*self%halo + 1), 1)
      n = 1
      do columns = 1, min(wanted, most(1))
        rows = min(wanted/columns, most(2))
        if (3*columns*rows < 2*min(wanted, product(most))) cycle
        if (all(n == 1) .or. work([columns, rows]) < work(n)) n = [columns, rows]
      end do
    end function numbers

    !> Estimated work of one thread for domains of equal size: the number of domains per thread
    !> times the number of cells in the largest extended domain.
    pure function work(n)
      integer(int32), intent(in) :: n(2)
      real(real64) :: work

      work = product(real(self%whole%n, real64)/n + merge(2*self%halo, 0, n > merge(1, 2, periodic)) &
        + merge(self%halo, 0, n == 2 .and. .not. periodic))*((product(n) + threads - 1)/threads)
    end function work
  end subroutine cut

  !> Divides a line of cells into n pieces of about equal weight, each with at least `least` cells.
  !> The result contains the first cell of each piece, followed by the number of cells plus 1.
  pure function pieces(weight, n, least) result(first)
    integer(int32), intent(in) :: weight(:), n, least
    integer(int32) :: first(n + 1), k, place
    real(real64) :: sum_so_far, total

    first(1) = 1
    first(n + 1) = size(weight, kind=int32) + 1
    total = sum(real(weight, real64))
    place = 1
    sum_so_far = 0
    do k = 2, n
      do while (place <= size(weight))
        if (sum_so_far + 0.5_real64*weight(place) > total*(k - 1)/n) exit
        sum_so_far = sum_so_far + weight(place)
        place = place + 1
      end do
      first(k) = min(max(place, first(k - 1) + least), first(n + 1) - (n + 1 - k)*least)
    end do
  end function pieces

  !> Extended domain of domain k, as a block of cells.
  pure function layout_of(self, k, periodic) result(layout)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: k
    logical, intent(in) :: periodic(2)
    type(cell_layout_t) :: layout
    integer(int32) :: last(2)

    layout = self%whole
    layout%first = self%low(:, k) - self%halo
    last = self%high(:, k) + self%halo
    where (.not. periodic .or. (self%low(:, k) == 1 .and. self%high(:, k) == self%whole%n))
      layout%first = max(layout%first, 1)
      last = min(last, self%whole%n)
    end where
    layout%n = last - layout%first + 1
    call layout%find_sides(periodic)
  end function layout_of

  !> Indices of the domains that own disks in the halo of domain k.
  pure function neighbours_of(self, k, layout) result(list)
    class(domain_cuts_t), intent(in) :: self
    integer(int32), intent(in) :: k
    type(cell_layout_t), intent(in) :: layout
    integer(int32), allocatable :: list(:)
    logical :: near(self%n), slab(size(self%domain_of, 2))
    integer(int32) :: ix, iy, m

    slab = .false.
    do ix = 1, layout%n(1)
      slab(self%slab_of(layout%place_of(ix, 1))) = .true.
    end do
    near = .false.
    do m = 1, size(slab, kind=int32)
      if (.not. slab(m)) cycle
      do iy = 1, layout%n(2)
        near(self%domain_of(layout%place_of(iy, 2), m)) = .true.
      end do
    end do
    near(k) = .false.
    list = pack([(m, m=1, self%n)], near)
  end function neighbours_of

end module domain_cuts
