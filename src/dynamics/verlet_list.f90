!> Verlet lists: close pairs of two disks, or of a disk and an obstacle. Pairs that are not listed
!> cannot touch before a disk has moved by half the `skin`, so a list is valid for many steps
!> (Verlet, Physical Review 159, 98 (1967)). Loops executed in every step have no branches, so that
!> the compiler can vectorise them.
module verlet_list
  use kinds, only: int32, pi, real64
  use box_geometry, only: box_t, obstacle_gap
  use grid, only: grid_t
  use partners, only: obstacle_code, obstacle_number
  use shapes, only: spare
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  implicit none
  private
  public :: verlet_list_t

  !> Intended number of steps for which a list is valid.
  integer, parameter :: steps_per_list = 16
  !> Intended maximum number of pairs per disk in a list, at the mean density.
  real(real64), parameter :: pairs_per_disk = 4.0_real64
  real(real64), parameter :: least_skin = 0.2_real64       !! minimum skin [mean diameters]
  real(real64), parameter :: cells_per_disk = 4.0_real64   !! maximum number of bins per disk

  !> Pairs that may touch. Pairs of a disk and an obstacle come first, sorted by obstacle and then
  !> by disk. Pairs of two disks follow, sorted by the first and then by the second disk.
  type :: verlet_list_t
    integer(int32) :: n = 0
    integer(int32), allocatable :: i(:)        !! index of the first disk of each pair; size at least n
    !> Index of the second disk of each pair, larger than i, or boundary id of an obstacle; size at
    !> least n.
    integer(int32), allocatable :: partner(:)
    integer(int32), allocatable :: hit(:)      !! 1 for each overlapping pair, otherwise 0; size at least n
    integer(int32), private :: n_obstacles = 0 !! number of pairs with obstacles
    logical, private :: known = .false.
    real(real64), private :: skin = 0.0_real64 !! maximum gap between the members of a listed pair [length]
    !> Positions when the list was made; shape (disks, 2) [length].
    real(real64), allocatable, private :: from(:, :)
  contains
    procedure :: update
    procedure :: mark_overlaps
    procedure :: shift
    procedure :: remove
  end type verlet_list_t

contains

  !> Updates the reference position of disk i after a shift by a period.
  subroutine shift(self, i, dx)
    class(verlet_list_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: dx(2)          !! [length]

    if (self%known) self%from(i, :) = self%from(i, :) + dx
  end subroutine shift

  !> Removes the pairs of disk i.
  pure subroutine remove(self, i)
    class(verlet_list_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: k, n

    n = 0
    self%n_obstacles = self%n_obstacles - count(self%i(:self%n_obstacles) == i, kind=int32)
    do k = 1, self%n
      if (self%i(k) == i .or. self%partner(k) == i) cycle
      n = n + 1
      self%i(n) = self%i(k)
      self%partner(n) = self%partner(k)
    end do
    self%n = n
  end subroutine remove

  !> Makes a new list, unless all disks have moved by less than half the skin since the last one.
  !> With `all_pairs`, a new list is made in every step by testing all pairs. After a stop request
  !> the procedure returns early, with an incomplete list.
  subroutine update(self, sim, x, step, all_pairs)
    class(verlet_list_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), contiguous, intent(in) :: x(:, :)   !! positions; shape (disks, 2) [length]
    real(real64), intent(in) :: step           !! length of a step [time]
    logical, intent(in) :: all_pairs
    ! width of a bin: a mean diameter plus the skin; more in a very large box [length]
    real(real64) :: width
    type(grid_t) :: bins
    integer(int32) :: i, k, still              ! still: number of disks that moved by less than half the skin

    if (self%known) then
      still = 0
      !GCC$ VECTOR
      do i = 1, size(x, 1, kind=int32)
        still = still + merge(1, 0, (x(i, 1) - self%from(i, 1))**2 + (x(i, 2) - self%from(i, 2))**2 &
          < (0.5_real64*self%skin*(1 - spare))**2)
      end do
      if (still == size(x, 1)) return
    end if
    self%known = .not. all_pairs
    self%from = x
    self%skin = wanted_skin()
    self%n = 0
    if (.not. allocated(self%i)) allocate (self%i(100), self%partner(100), self%hit(100))
    do k = 1, sim%box%n_obstacles()
      do i = 1, sim%n_disks()
        if (.not. sim%is_inside(i)) cycle
        if (obstacle_gap(sim%box%box_t, k, [x(i, 1), x(i, 2)], sim%disk(i)%radius) <= self%skin) &
          call append(self, i, obstacle_code(k))
      end do
    end do
    self%n_obstacles = self%n
    if (all_pairs) then
      call test_all_pairs(self, sim, x, sim%disk%radius, sim%box%periods())
      return
    end if
    width = max(self%skin + 2*sum(sim%disk%radius)/sim%n_disks(), &
      sqrt(product(sim%box%edges())/(cells_per_disk*sim%n_disks())))
    call bins%divide(sim%box%lower, sim%box%edges(), &
      int(max(min(sim%box%edges()/width, cells_per_disk*sim%n_disks()), 1.0_real64), int32))
    call list_disks(self, sim, x, bins)
  contains

    !> Width of the skin for which a list is valid for many steps without containing too many
    !> distant pairs. The width affects only the speed of the program.
    pure function wanted_skin() result(skin)
      real(real64) :: skin, diameter, reach, fastest
      integer(int32) :: i

      fastest = 0
      do i = 1, sim%n_disks()
        fastest = max(fastest, sum(sim%velocity(i)**2))
      end do
      diameter = 2*sum(sim%disk%radius)/sim%n_disks()
      reach = sqrt(2*pairs_per_disk/pi*product(sim%box%edges())/sim%n_disks())
      skin = max(min(2*steps_per_list*step*sqrt(fastest), reach - diameter), least_skin*diameter)
    end function wanted_skin
  end subroutine update

  !> Sets `hit` to 1 for pairs that overlap, and to 0 for all others.
  pure subroutine mark_overlaps(self, box, x, radius)
    class(verlet_list_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    real(real64), contiguous, intent(in) :: x(:, :)     !! positions; shape (disks, 2) [length]
    real(real64), contiguous, intent(in) :: radius(:)   !! radius of each disk [length]
    real(real64) :: period(2)
    integer :: k

    period = box%periods()
    associate (i => self%i, j => self%partner)
      do k = 1, self%n_obstacles
        self%hit(k) = merge(1, 0, obstacle_gap(box, obstacle_number(j(k)), [x(i(k), 1), x(i(k), 2)], radius(i(k))) < 0)
      end do
      !GCC$ VECTOR
      do k = self%n_obstacles + 1, self%n
        self%hit(k) = near(x(j(k), 1) - x(i(k), 1), x(j(k), 2) - x(i(k), 2), radius(i(k)) + radius(j(k)), period(1), period(2))
      end do
    end associate
  end subroutine mark_overlaps

  !> Adds the pairs of close disks. The partners of a disk are searched for among smaller disks, and
  !> among equal disks with higher indices. The search for a small disk then covers few bins,
  !> however large the largest disk is. The grid of bins is treated as periodic along both axes.
  !> Disks at opposite walls are nevertheless not paired, because their true distance is too large.
  subroutine list_disks(self, sim, x, bins)
    type(verlet_list_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)
    type(grid_t), intent(in) :: bins
    integer(int32) :: bin(size(x, 1)), member(size(x, 1)), low(2), high(2), i, iy, row, from, to, first_pair
    integer(int32), allocatable :: first(:)
    real(real64) :: period(2), centre(2), reach

    period = sim%box%periods()
    do i = 1, size(x, 1, kind=int32)
      low = modulo(floor(bins%in_cells(in_box([x(i, 1), x(i, 2)])), int32), bins%n)
      bin(i) = 1 + low(1) + bins%n(1)*low(2)
    end do
    call sort_by_count(bin, product(bins%n), first, member)
    first_pair = self%n + 1
    do i = 1, size(x, 1, kind=int32)
      if (.not. sim%is_inside(i)) cycle
      centre = [x(i, 1), x(i, 2)]
      reach = (2*sim%disk(i)%radius + self%skin)*(1 + spare)
      low = floor(bins%in_cells(in_box(centre) - reach), int32)
      ! the range contains no bin twice
      high = min(floor(bins%in_cells(in_box(centre) + reach), int32), low + bins%n - 1)
      from = 1 + modulo(low(1), bins%n(1))
      to = from + high(1) - low(1)
      do iy = low(2), high(2)
        row = bins%n(1)*modulo(iy, bins%n(2))
        call add_run(row + from, row + min(to, bins%n(1)))
        call add_run(row + 1, row + to - bins%n(1))           ! part of the row beyond the periodic side
      end do
    end do
    call sort_pairs(self%i(first_pair:self%n), self%partner(first_pair:self%n), size(x, 1, kind=int32))

  contains

    !> Periodic image of a point inside the box. The image is computed with real numbers, because a
    !> disk may have crossed more periods than an integer can represent.
    pure function in_box(point) result(image)
      real(real64), intent(in) :: point(2)
      real(real64) :: image(2)

      image = sim%box%lower + modulo(point - sim%box%lower, sim%box%edges())
    end function in_box

    !> Adds the pairs of disk i with disks in bins c to d of a row.
    subroutine add_run(c, d)
      integer(int32), intent(in) :: c, d
      integer(int32) :: k, j

      if (d < c) return
      do k = first(c), first(d + 1) - 1
        j = member(k)
        if (sim%disk(j)%radius > sim%disk(i)%radius .or. (j <= i .and. .not. sim%disk(j)%radius < sim%disk(i)%radius)) cycle
        if (.not. sim%is_inside(j)) cycle
        if (near(x(j, 1) - centre(1), x(j, 2) - centre(2), sim%disk(i)%radius + sim%disk(j)%radius + self%skin, &
          period(1), period(2)) > 0) call append(self, min(i, j), max(i, j))
      end do
    end subroutine add_run
  end subroutine list_disks

  !> Tests all pairs of disks and adds those separated by less than the skin. A stop request ends
  !> the procedure early.
  subroutine test_all_pairs(self, sim, x, radius, period)
    type(verlet_list_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), contiguous, intent(in) :: x(:, :), radius(:)   !! [length]
    real(real64), intent(in) :: period(2)                        !! [length]
    integer(int32) :: near_i(64), i, j, k, n

    do i = 1, size(radius, kind=int32)
      if (stop_requested()) return
      do j = i, size(radius, kind=int32) - 1, size(near_i)
        n = min(size(near_i, kind=int32), size(radius, kind=int32) - j)
        !GCC$ VECTOR
        do k = 1, n
          near_i(k) = near(x(j + k, 1) - x(i, 1), x(j + k, 2) - x(i, 2), radius(i) + radius(j + k) + self%skin, &
            period(1), period(2))
        end do
        if (sum(near_i(:n)) == 0) cycle
        do k = 1, n
          if (near_i(k) > 0 .and. sim%is_inside(i) .and. sim%is_inside(j + k)) call append(self, i, j + k)
        end do
      end do
    end do
  end subroutine test_all_pairs

  !> 1 if the distance between the nearest images of two points in the box is less than sigma,
  !> otherwise 0.
  elemental function near(dx, dy, sigma, period_x, period_y) result(yes)
    real(real64), intent(in) :: dx, dy, sigma, period_x, period_y    !! [length]
    integer(int32) :: yes
    real(real64) :: a, b

    a = min(abs(dx), abs(period_x - abs(dx)))
    b = min(abs(dy), abs(period_y - abs(dy)))
    yes = merge(1, 0, a*a + b*b < sigma*sigma)
  end function near

  !> Appends a pair.
  pure subroutine append(self, i, partner)
    type(verlet_list_t), intent(inout) :: self
    integer(int32), intent(in) :: i, partner

    if (self%n == size(self%i)) then
      self%i = [self%i, self%i]
      self%partner = [self%partner, self%partner]
      self%hit = self%i
    end if
    self%n = self%n + 1
    self%i(self%n) = i
    self%partner(self%n) = partner
  end subroutine append

  !> Sorts pairs of disks by the first disk `i`, then by the second disk `partner`.
  subroutine sort_pairs(i, partner, n_disks)
    integer(int32), intent(inout) :: i(:), partner(:)
    integer(int32), intent(in) :: n_disks
    integer(int32), allocatable :: first(:), order(:)

    allocate (order(size(i)))
    call sort_by_count(partner, n_disks, first, order)
    i = i(order)
    partner = partner(order)
    call sort_by_count(i, n_disks, first, order)
    i = i(order)
    partner = partner(order)
  end subroutine sort_pairs

end module verlet_list
