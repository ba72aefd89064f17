!> Which disks overlap at the positions of a time step, with obstacles and with each other. Only those near each other
!> are tested: others cannot touch before a disk has moved by half the `skin`, so one list of them serves many steps
!> (Verlet, Phys. Rev. 159, 98 (1967)).
module near_pairs
  use kinds, only: int32, pi, real64
  use box_geometry, only: box_t, obstacle_gap
  use pair_lists, only: add_overlaps, append, empty, find_near, list_obstacles, list_pairs, pair_list_t, places_t
  use partners, only: obstacle_number
  use shapes, only: spare
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  implicit none
  private
  public :: list_by_bins, near_pairs_t

  integer, parameter :: steps_per_list = 16                !! that a list should serve
  real(real64), parameter :: pairs_per_disk = 4.0_real64   !! in a list, at most, at the mean density
  real(real64), parameter :: least_skin = 0.2_real64       !! [mean diameter]
  real(real64), parameter :: cells_per_disk = 4.0_real64   !! at most
  integer(int32), parameter :: few_disks = 300             !! for up to so many testing all pairs is faster than bins

  type :: near_pairs_t
    private
    type(pair_list_t) :: list                  !! the pairs near each other, while that is known
    real(real64) :: skin = -1.0_real64         !! gap up to which they are; < 0: unknown [length]
    real(real64), allocatable :: from(:, :)    !! (disks,2) where they were when listed [length]
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
    type(places_t) :: at                       !! in this order
  end type bins_t

contains

  !> Forgets the disks of before.
  subroutine start(self)
    class(near_pairs_t), intent(inout) :: self

    self%skin = -1
  end subroutine start

  !> Lists the overlaps, from the list of near pairs.
  subroutine find_contacts(self, sim, at, step, contacts)
    class(near_pairs_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: step           !! [time]
    type(pair_list_t), intent(inout) :: contacts
    integer(int32) :: k, i, code

    if (.not. holds(self, at%x)) call make_list(self, sim, at, step)
    call empty(contacts)
    do k = 1, self%list%n
      i = self%list%i(k)
      code = self%list%partner(k)
      if (code > 0) exit
      if (obstacle_gap(sim%box, obstacle_number(code), at%centre(i), at%radius(i)) < 0) call append(contacts, i, code)
    end do
    call add_overlaps(contacts, self%list, k, at)
  end subroutine find_contacts

  !> Notes that disk i has been moved by a period.
  subroutine shift(self, i, dx)
    class(near_pairs_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: dx(2)          !! [length]

    if (self%skin >= 0) self%from(i, :) = self%from(i, :) + dx
  end subroutine shift

  !> Whether the list is still valid for disks at x: none has moved by half the skin.
  pure function holds(self, x) result(yes)
    class(near_pairs_t), intent(in) :: self
    real(real64), contiguous, intent(in) :: x(:, :)
    logical :: yes
    real(real64) :: limit
    integer(int32) :: i, n_far

    yes = .false.
    if (self%skin < 0) return
    limit = (0.5_real64*self%skin*(1 - spare))**2
    n_far = 0
    !GCC$ VECTOR
    do i = 1, size(x, 1)
      n_far = n_far + merge(0, 1, (x(i, 1) - self%from(i, 1))**2 + (x(i, 2) - self%from(i, 2))**2 < limit)
    end do
    yes = n_far == 0
  end function holds

  !> Lists the near pairs.
  subroutine make_list(self, sim, at, step)
    class(near_pairs_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: step

    self%from = at%x
    self%skin = wanted_skin(sim, step)
    if (sim%n_disks() <= few_disks) then
      call list_pairs(self%list, sim%box, at, self%skin, interruptible=.false.)
    else
      call list_by_bins(self%list, sim%box, at, self%skin)
    end if
  end subroutine make_list

  !> What `list_pairs` lists, in less time if the disks are many.
  subroutine list_by_bins(list, box, at, gap)
    type(pair_list_t), intent(inout) :: list
    type(box_t), intent(in) :: box
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: gap
    type(bins_t) :: bins
    integer(int32), allocatable :: found(:)
    integer(int32) :: i, n_obstacles

    call list_obstacles(list, box, at, gap)
    n_obstacles = list%n
    call sort_into_bins(bins, box, at, gap)
    allocate (found(size(at%radius)))
    do i = 1, size(found, kind=int32)
      call add_smaller_neighbours(list, bins, box, i, at, gap, found)
    end do
    call sort_pairs(list%i(n_obstacles + 1:list%n), list%partner(n_obstacles + 1:list%n), size(found, kind=int32))
  end subroutine list_by_bins

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

  !> Bins are as wide as a mean disk and the gap; wider in a vast box.
  subroutine sort_into_bins(bins, box, at, gap)
    type(bins_t), intent(inout) :: bins
    type(box_t), intent(in) :: box
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: gap
    integer(int32) :: cell(size(at%radius)), place(size(at%radius)), c(2), i, n
    real(real64) :: edges(2), width

    n = size(at%radius, kind=int32)
    edges = box%edges()
    width = max(gap + 2*sum(at%radius)/n, sqrt(product(edges)/(cells_per_disk*n)))
    bins%n = int(min(max(edges/width, 1.0_real64), cells_per_disk*n), int32)
    bins%width = edges/bins%n
    do i = 1, n
      c = modulo(column_and_row(bins, box, at%centre(i)), bins%n)
      cell(i) = 1 + c(1) + bins%n(1)*c(2)
    end do
    call sort_by_count(cell, product(bins%n), bins%first, place)
    allocate (bins%disk(n), bins%at%x(n, 2), bins%at%radius(n))
    bins%disk(place) = [(i, i=1, n)]
    bins%at%x(place, :) = at%x
    bins%at%radius(place) = at%radius
    bins%at%period = at%period
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
  subroutine add_smaller_neighbours(list, bins, box, i, at, gap, found)
    type(pair_list_t), intent(inout) :: list
    type(bins_t), intent(in) :: bins
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: i
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: gap
    integer(int32), contiguous, intent(inout) :: found(:)    !! (disks) work space
    integer(int32) :: low(2), high(2), from, to, row, y
    real(real64) :: reach

    reach = (2*at%radius(i) + gap)*(1 + spare)
    low = column_and_row(bins, box, at%centre(i) - reach)
    high = min(column_and_row(bins, box, at%centre(i) + reach), low + bins%n - 1)   ! each cell once
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
      integer(int32) :: k, j, n

      if (d < c) return
      call find_near(bins%at, bins%first(c), bins%first(d + 1) - 1, at%centre(i), at%radius(i) + gap, found, n)
      do k = 1, n
        j = bins%disk(found(k))
        if (at%radius(j) < at%radius(i) .or. (j > i .and. .not. at%radius(j) > at%radius(i))) &
          call append(list, min(i, j), max(i, j))
      end do
    end subroutine add_run
  end subroutine add_smaller_neighbours

  !> Sorts pairs of disks by i, then by partner.
  subroutine sort_pairs(i, partner, n_disks)
    integer(int32), intent(inout) :: i(:), partner(:)
    integer(int32), intent(in) :: n_disks
    integer(int32), allocatable :: first(:), place(:)

    allocate (place(size(i)))
    call sort_by_count(partner, n_disks, first, place)
    i(place) = i
    partner(place) = partner
    call sort_by_count(i, n_disks, first, place)
    i(place) = i
    partner(place) = partner
  end subroutine sort_pairs

end module near_pairs
