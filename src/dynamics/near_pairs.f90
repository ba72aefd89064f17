!> Which disks overlap at the positions of a time step, with obstacles and with each other. Either all pairs are tested,
!> or only those near each other: others cannot touch before a disk has moved by half the `skin`, so one list serves
!> many steps (Verlet, Phys. Rev. 159, 98 (1967)).
module near_pairs
  use kinds, only: int32, pi, real64
  use partners, only: obstacle_code, obstacle_number
  use shapes, only: spare
  use box_geometry, only: box_t, obstacle_gap
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  use signals, only: stop_requested
  implicit none
  private
  public :: near_pairs_t, pair_list_t, find_all_contacts

  integer, parameter :: steps_per_list = 16                !! that a list should serve
  real(real64), parameter :: pairs_per_disk = 4.0_real64   !! in a list, at most, at the mean density
  real(real64), parameter :: least_skin = 0.2_real64       !! [mean diameter]
  real(real64), parameter :: cells_per_disk = 4.0_real64   !! at most

  !> A disk and what it meets.
  type :: pair_t
    integer(int32) :: i = 0
    integer(int32) :: partner = 0              !! a disk > i, or the code of an obstacle
    real(real64) :: sigma = 0.0_real64         !! distance of the centres of two disks at contact [length]
  end type pair_t

  !> First the obstacles in order, each with its disks ascending; then pairs of disks, ascending in i, then in the
  !> partner.
  type :: pair_list_t
    integer :: n = 0
    type(pair_t), allocatable :: pair(:)       !! (n, and room for more)
  end type pair_list_t

  type :: near_pairs_t
    private
    type(pair_list_t) :: list                  !! the pairs near each other, while that is known
    real(real64) :: skin = -1.0_real64         !! gap up to which they are; < 0: unknown [length]
    real(real64), allocatable :: from(:, :)    !! (2,disks) where they were when listed [length]
  contains
    procedure :: start
    procedure :: find_contacts
    procedure :: shift
  end type near_pairs_t

  !> Disks sorted by cell, row after row.
  type :: bins_t
    integer(int32) :: n(2) = 0                 !! columns, rows
    real(real64) :: width(2) = 0.0_real64      !! [length]
    integer(int32), allocatable :: first(:)    !! (bins+1) place of a cell's first disk
    integer(int32), allocatable :: disk(:)     !! (disks) its number
    real(real64), allocatable :: x(:, :)       !! (2,disks) [length]
    real(real64), allocatable :: radius(:)     !! (disks) [length]
  end type bins_t

contains

  !> Forgets the disks of before.
  subroutine start(self)
    class(near_pairs_t), intent(inout) :: self

    self%skin = -1
  end subroutine start

  !> Lists the overlaps when the disks are at x, testing all pairs. After a stop has been requested the list is not
  !> complete.
  subroutine find_all_contacts(sim, x, interruptible, contacts)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)        !! (2,disks) [length]
    logical, intent(in) :: interruptible       !! a request to stop ends the search: the caller discards the step
    type(pair_list_t), intent(inout) :: contacts

    call empty(contacts)
    call add_obstacles(contacts, sim, x, 0.0_real64)
    call add_overlaps(contacts, sim, x, interruptible)
  end subroutine find_all_contacts

  !> The same from the list of near pairs.
  subroutine find_contacts(self, sim, x, step, contacts)
    class(near_pairs_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)        !! (2,disks) [length]
    real(real64), intent(in) :: step           !! [time]
    type(pair_list_t), intent(inout) :: contacts

    call empty(contacts)
    if (.not. holds(self, x)) call make_list(self, sim, x, step)
    call add_overlaps_listed(contacts, self%list, sim, x)
  end subroutine find_contacts

  !> Notes that disk i has been moved by a period.
  subroutine shift(self, i, dx)
    class(near_pairs_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: dx(2)          !! [length]

    if (self%skin >= 0) self%from(:, i) = self%from(:, i) + dx
  end subroutine shift

  !> Adds the overlaps among all pairs of disks.
  subroutine add_overlaps(contacts, sim, x, interruptible)
    type(pair_list_t), intent(inout) :: contacts
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)
    logical, intent(in) :: interruptible
    real(real64) :: period(2), sigma
    integer(int32) :: i, j

    period = sim%box%periods()
    do i = 1, sim%n_disks() - 1
      if (interruptible) then
        if (stop_requested()) return
      end if
      do j = i + 1, sim%n_disks()
        sigma = sim%disk(i)%radius + sim%disk(j)%radius
        if (distance2(x(:, i), x(:, j), period) < sigma*sigma) call append(contacts, pair_t(i, j, sigma))
      end do
    end do
  end subroutine add_overlaps

  !> Adds the overlaps among the pairs in a list.
  pure subroutine add_overlaps_listed(contacts, list, sim, x)
    type(pair_list_t), intent(inout) :: contacts
    type(pair_list_t), intent(in) :: list
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)
    real(real64) :: period(2)
    integer :: k
    logical :: overlap

    period = sim%box%periods()
    do k = 1, list%n
      associate (p => list%pair(k))
        if (p%partner > 0) then
          overlap = distance2(x(:, p%i), x(:, p%partner), period) < p%sigma*p%sigma
        else
          overlap = obstacle_gap(sim%box, obstacle_number(p%partner), x(:, p%i), sim%disk(p%i)%radius) < 0
        end if
        if (overlap) call append(contacts, p)
      end associate
    end do
  end subroutine add_overlaps_listed

  !> Adds the disks whose rim is less than some length away from an obstacle. Obstacles are few: no bins.
  pure subroutine add_obstacles(list, sim, x, length)
    type(pair_list_t), intent(inout) :: list
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :)
    real(real64), intent(in) :: length
    integer(int32) :: i, m

    do m = 1, sim%box%n_obstacles()
      do i = 1, sim%n_disks()
        if (obstacle_gap(sim%box, m, x(:, i), sim%disk(i)%radius) < length) &
          call append(list, pair_t(i, obstacle_code(m)))
      end do
    end do
  end subroutine add_obstacles

  !> Squared distance of the nearest images of two points in the box.
  pure function distance2(a, b, period) result(d2)
    real(real64), intent(in) :: a(2), b(2)     !! [length]
    real(real64), intent(in) :: period(2)      !! `never` between walls [length]
    real(real64) :: d2, dx, dy

    dx = abs(b(1) - a(1))
    dy = abs(b(2) - a(2))
    dx = min(dx, abs(period(1) - dx))
    dy = min(dy, abs(period(2) - dy))
    d2 = dx*dx + dy*dy
  end function distance2

  !> Empties a list.
  pure subroutine empty(list)
    type(pair_list_t), intent(inout) :: list

    list%n = 0
    if (.not. allocated(list%pair)) allocate (list%pair(100))
  end subroutine empty

  !> Appends a pair to a list.
  pure subroutine append(list, pair)
    type(pair_list_t), intent(inout) :: list
    type(pair_t), intent(in) :: pair
    type(pair_t), allocatable :: longer(:)

    if (list%n == size(list%pair)) then
      allocate (longer(2*list%n))
      longer(:list%n) = list%pair
      call move_alloc(longer, list%pair)
    end if
    list%n = list%n + 1
    list%pair(list%n) = pair
  end subroutine append

  !> Whether the list is still valid for disks at x: none has moved by half the skin.
  pure function holds(self, x) result(yes)
    class(near_pairs_t), intent(in) :: self
    real(real64), intent(in) :: x(:, :)
    logical :: yes
    real(real64) :: farthest2
    integer :: i

    yes = .false.
    if (self%skin < 0) return
    farthest2 = 0
    do i = 1, size(x, 2)
      farthest2 = max(farthest2, (x(1, i) - self%from(1, i))**2 + (x(2, i) - self%from(2, i))**2)
    end do
    yes = 4*farthest2 < (self%skin*(1 - spare))**2
  end function holds

  !> Lists the near pairs when the disks are at x.
  subroutine make_list(self, sim, x, step)
    class(near_pairs_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :), step
    type(bins_t) :: bins
    integer(int32) :: i
    integer :: n_obstacles

    self%from = x
    self%skin = wanted_skin(sim, step)
    call empty(self%list)
    call add_obstacles(self%list, sim, x, self%skin)
    n_obstacles = self%list%n
    call sort_into_bins(bins, sim, x, self%skin)
    do i = 1, sim%n_disks()
      call add_smaller_neighbours(self%list, bins, sim%box, i, x(:, i), sim%disk(i)%radius, self%skin)
    end do
    call sort_pairs(self%list%pair(n_obstacles + 1:self%list%n), sim%n_disks())
  end subroutine make_list

  !> Wide enough to serve many steps, not so wide that most pairs are far apart. Affects the cost only.
  pure function wanted_skin(sim, step) result(skin)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: step
    real(real64) :: skin, diameter, reach, fastest2, v(2)
    integer(int32) :: i

    fastest2 = 0
    do i = 1, sim%n_disks()
      v = sim%velocity(i)
      fastest2 = max(fastest2, v(1)*v(1) + v(2)*v(2))
    end do
    diameter = 2*sum(sim%disk%radius)/sim%n_disks()
    reach = sqrt(2*pairs_per_disk/pi*product(sim%box%edges())/sim%n_disks())
    skin = max(min(2*steps_per_list*step*sqrt(fastest2), reach - diameter), least_skin*diameter)
  end function wanted_skin

  !> Bins are as wide as a mean disk and the skin; wider in a vast box.
  subroutine sort_into_bins(bins, sim, x, skin)
    type(bins_t), intent(inout) :: bins
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: x(:, :), skin
    integer(int32) :: cell(size(x, 2)), place(size(x, 2)), c(2), i, n
    real(real64) :: edges(2), width

    n = sim%n_disks()
    edges = sim%box%edges()
    width = max(skin + 2*sum(sim%disk%radius)/n, sqrt(product(edges)/(cells_per_disk*n)))
    bins%n = int(min(max(edges/width, 1.0_real64), cells_per_disk*n), int32)
    bins%width = edges/bins%n
    allocate (bins%disk(n), bins%x(2, n), bins%radius(n))
    do i = 1, n
      c = modulo(column_and_row(bins, sim%box, x(:, i)), bins%n)
      cell(i) = 1 + c(1) + bins%n(1)*c(2)
    end do
    call sort_by_count(cell, product(bins%n), bins%first, place)
    do i = 1, n
      bins%disk(place(i)) = i
      bins%x(:, place(i)) = x(:, i)
      bins%radius(place(i)) = sim%disk(i)%radius
    end do
  end subroutine sort_into_bins

  !> The bin at x, from (0,0): bins continue beyond a periodic side, the last one continues beyond a wall.
  pure function column_and_row(bins, box, x) result(c)
    type(bins_t), intent(in) :: bins
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: x(2)           !! [length]
    integer(int32) :: c(2)
    real(real64) :: place
    integer :: axis

    do axis = 1, 2
      place = (x(axis) - box%lower(axis))/bins%width(axis)
      if (.not. box%periodic(axis)) place = max(0.0_real64, min(place, bins%n(axis) - 1.0_real64))
      c(axis) = floor(place, int32)
    end do
  end function column_and_row

  !> Adds the pairs of disk i with disks near it that are smaller, or equal with a higher number. So a small disk
  !> searches only bins close by, however large the largest disk is.
  subroutine add_smaller_neighbours(list, bins, box, i, x, radius, skin)
    type(pair_list_t), intent(inout) :: list
    type(bins_t), intent(in) :: bins
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: x(2), radius, skin  !! [length]
    integer(int32) :: low(2), high(2), from, to, row, y
    real(real64) :: reach

    reach = (2*radius + skin)*(1 + spare)
    low = column_and_row(bins, box, x - reach)
    high = min(column_and_row(bins, box, x + reach), low + bins%n - 1)   ! each cell once
    from = 1 + modulo(low(1), bins%n(1))
    to = from + high(1) - low(1)
    do y = low(2), high(2)
      row = bins%n(1)*modulo(y, bins%n(2))
      call add_run(row + from, row + min(to, bins%n(1)))
      call add_run(row + 1, row + to - bins%n(1))   ! what goes on behind a periodic side
    end do

  contains

    !> The same for bins c to d of a row.
    subroutine add_run(c, d)
      integer(int32), intent(in) :: c, d
      integer(int32) :: k, j
      real(real64) :: sigma, period(2)

      if (d < c) return
      period = box%periods()
      do k = bins%first(c), bins%first(d + 1) - 1
        j = bins%disk(k)
        if (bins%radius(k) > radius .or. (j <= i .and. .not. bins%radius(k) < radius)) cycle
        sigma = radius + bins%radius(k)
        if (distance2(x, bins%x(:, k), period) > (sigma + skin)**2) cycle
        call append(list, pair_t(min(i, j), max(i, j), sigma))
      end do
    end subroutine add_run
  end subroutine add_smaller_neighbours

  !> Sorts pairs of disks by i, then by partner.
  subroutine sort_pairs(pair, n_disks)
    type(pair_t), intent(inout) :: pair(:)
    integer(int32), intent(in) :: n_disks
    integer(int32), allocatable :: first(:), place(:)

    allocate (place(size(pair)))
    call sort_by_count(pair%partner, n_disks, first, place)
    pair(place) = pair
    call sort_by_count(pair%i, n_disks, first, place)
    pair(place) = pair
  end subroutine sort_pairs

end module near_pairs
