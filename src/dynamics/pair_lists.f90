!> Lists of disks that are near each other or an obstacle, or overlap.
!>
!> Distances are compared in vector registers, for which the directives ask: one loop marks what is near, without a
!> branch, and another lists it.
module pair_lists
  use kinds, only: int32, real64
  use box_geometry, only: box_t, obstacle_gap
  use partners, only: obstacle_code
  use signals, only: stop_requested
  implicit none
  private
  public :: add_overlaps, append, empty, find_near, list_obstacles, list_pairs, pair_list_t, places_t

  !> Where disks are, and how large; coordinate by coordinate, for vector registers.
  type :: places_t
    real(real64), allocatable :: x(:, :)       !! (disks,2) [length]
    real(real64), allocatable :: radius(:)     !! (disks) [length]
    real(real64) :: period(2)                  !! of the box; `never` between walls [length]
  contains
    procedure :: centre
  end type places_t

  !> Who meets whom: first the obstacles in order, each with its disks ascending; then pairs of disks, ascending in i,
  !> then in the partner.
  type :: pair_list_t
    integer(int32) :: n = 0
    integer(int32), allocatable :: i(:)        !! (n, and room for more) a disk
    integer(int32), allocatable :: partner(:)  !! (n, and room for more) a disk > i, or the code of an obstacle
  end type pair_list_t

contains

  !> The centre of disk i.
  pure function centre(self, i) result(x)
    class(places_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: x(2)                       !! [length]

    x = [self%x(i, 1), self%x(i, 2)]
  end function centre

  !> Lists what is nearer to each other than `gap`, by testing all pairs.
  subroutine list_pairs(list, box, at, gap, interruptible)
    type(pair_list_t), intent(inout) :: list
    type(box_t), intent(in) :: box
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: gap            !! [length]
    logical, intent(in) :: interruptible       !! a request to stop ends the search: then the list is not complete
    integer(int32) :: found(size(at%radius)), i, k, n

    call list_obstacles(list, box, at, gap)
    do i = 1, size(found, kind=int32) - 1
      if (interruptible) then
        if (stop_requested()) return
      end if
      call find_near(at, i + 1, size(found, kind=int32), at%centre(i), at%radius(i) + gap, found, n)
      do k = 1, n
        call append(list, i, found(k))
      end do
    end do
  end subroutine list_pairs

  !> Begins a list with the disks whose rim is less than `gap` away from an obstacle. Obstacles are few: no bins.
  pure subroutine list_obstacles(list, box, at, gap)
    type(pair_list_t), intent(inout) :: list
    type(box_t), intent(in) :: box
    type(places_t), intent(in) :: at
    real(real64), intent(in) :: gap
    integer(int32) :: i, m

    call empty(list)
    do m = 1, box%n_obstacles()
      do i = 1, size(at%radius, kind=int32)
        if (obstacle_gap(box, m, at%centre(i), at%radius(i)) < gap) call append(list, i, obstacle_code(m))
      end do
    end do
  end subroutine list_obstacles

  !> Empties a list.
  pure subroutine empty(list)
    type(pair_list_t), intent(inout) :: list

    list%n = 0
    if (.not. allocated(list%i)) allocate (list%i(100), list%partner(100))
  end subroutine empty

  !> Appends a pair to a list.
  pure subroutine append(list, i, partner)
    type(pair_list_t), intent(inout) :: list
    integer(int32), intent(in) :: i, partner

    if (list%n == size(list%i)) then
      list%i = [list%i, list%i]
      list%partner = [list%partner, list%partner]
    end if
    list%n = list%n + 1
    list%i(list%n) = i
    list%partner(list%n) = partner
  end subroutine append

  !> Adds the overlaps among the pairs of disks in a list, which begin with entry `first`.
  pure subroutine add_overlaps(contacts, list, first, at)
    type(pair_list_t), intent(inout) :: contacts
    type(pair_list_t), intent(in) :: list
    integer(int32), intent(in) :: first
    type(places_t), intent(in) :: at
    integer(int32) :: hit(list%n - first + 1), k

    if (size(hit) == 0) return
    call mark_overlaps(list%i(first), list%partner(first), at%x(1, 1), at%x(1, 2), at%radius, at%period, hit)
    if (sum(hit) == 0) return
    do k = 1, size(hit, kind=int32)
      if (hit(k) > 0) call append(contacts, list%i(first + k - 1), list%partner(first + k - 1))
    end do
  end subroutine add_overlaps

  !> Marks with 1 the pairs that overlap.
  pure subroutine mark_overlaps(i, j, x, y, radius, period, hit)
    integer(int32), intent(in) :: i(*), j(*)   !! (pairs)
    real(real64), intent(in) :: x(*), y(*), radius(*), period(2)    !! [length]
    integer(int32), contiguous, intent(out) :: hit(:)               !! (pairs)
    real(real64) :: period_x, period_y
    integer :: k

    period_x = period(1); period_y = period(2)
    !GCC$ VECTOR
    do k = 1, size(hit)
      hit(k) = overlap(x(j(k)) - x(i(k)), y(j(k)) - y(i(k)), radius(i(k)) + radius(j(k)), period_x, period_y)
    end do
  end subroutine mark_overlaps

  !> Finds the disks at the places `first` to `last` whose rim is nearer to `centre` than `reach`.
  pure subroutine find_near(at, first, last, centre, reach, found, n)
    type(places_t), intent(in) :: at
    integer(int32), intent(in) :: first, last
    real(real64), intent(in) :: centre(2), reach    !! [length]
    integer(int32), contiguous, intent(inout) :: found(:)    !! (n) places, ascending; room for all
    integer(int32), intent(out) :: n
    integer(int32) :: k, hit, among

    n = 0
    among = last - first + 1
    if (among == 0) return
    call mark_near(at%x(first, 1), at%x(first, 2), at%radius(first), centre, reach, at%period, found(:among))
    if (sum(found(:among)) == 0) return
    do k = 1, among
      hit = found(k)
      found(n + 1) = first + k - 1
      n = n + hit
    end do
  end subroutine find_near

  !> Marks with 1 the disks whose rim is near a centre.
  pure subroutine mark_near(x, y, radius, centre, reach, period, hit)
    real(real64), intent(in) :: x(*), y(*), radius(*), centre(2), reach, period(2)    !! [length]
    integer(int32), contiguous, intent(out) :: hit(:)               !! (disks)
    real(real64) :: x_0, y_0, period_x, period_y
    integer :: k

    x_0 = centre(1); y_0 = centre(2); period_x = period(1); period_y = period(2)
    !GCC$ VECTOR
    do k = 1, size(hit)
      hit(k) = overlap(x(k) - x_0, y(k) - y_0, radius(k) + reach, period_x, period_y)
    end do
  end subroutine mark_near

  !> 1 if the nearest images of two points in the box are nearer to each other than sigma, else 0.
  elemental function overlap(dx, dy, sigma, period_x, period_y) result(hit)
    real(real64), intent(in) :: dx, dy, sigma
    real(real64), intent(in) :: period_x, period_y
    integer(int32) :: hit
    real(real64) :: near_x, near_y

    near_x = min(abs(dx), abs(period_x - abs(dx)))
    near_y = min(abs(dy), abs(period_y - abs(dy)))
    hit = merge(1, 0, near_x*near_x + near_y*near_y < sigma*sigma)
  end function overlap

end module pair_lists
