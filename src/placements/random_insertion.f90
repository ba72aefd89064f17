!> Random sequential insertion: each disk is inserted at a random point. The point is drawn
!> uniformly from all points where the disk fits between the disks inserted earlier. The region is
!> divided into small rectangles called voxels. A voxel is eliminated if a single disk prevents the
!> centre of a new disk from lying anywhere in it. Points are drawn only from the remaining voxels,
!> which are halved along both axes when attempts fail too often. Attempts in eliminated voxels
!> would always fail. The distribution is therefore the same as in simple insertion, but saturation
!> can be reached (Zhang and Torquato, 2013, doi:10.1103/PhysRevE.88.053312).
!>
!> Disks of different radii are inserted in the order of decreasing radius. For different radii the
!> insertion ends after many failed attempts. No voxels are eliminated then, because a voxel without
!> space for one disk may have space for a smaller one.
module random_insertion
  use kinds, only: int32, real64
  use memory_hints, only: prefetch
  use packing, only: packing_t
  use random_stream, only: random_stream_t
  use sorting, only: sort_by_count
  use status_line, only: status_line_t
  implicit none
  private
  public :: insert_at_random, largest_first

  !> Number of disks between two updates of the status line.
  integer(int32), parameter :: disks_per_look = 1024
  !> Number of attempts whose random numbers are drawn in advance.
  integer(int32), parameter :: drawn_ahead = 8
  !> Maximum number of attempts for one disk if the radii differ.
  integer(int32), parameter :: most_attempts = 300000

  !> Remaining voxels, in which the centre of another disk may fit.
  type :: voxels_t
    real(real64) :: origin(2) = 0.0_real64          !! [length]
    real(real64) :: side(2) = 0.0_real64            !! [length]
    integer(int32) :: n = 0                         !! number of remaining voxels
    !> Column and row of each voxel, starting at 0; shape (2, n)
    integer(int32), allocatable :: column_row(:, :)
  end type voxels_t

  !> Random numbers of an attempt, and the subsequent state of the random stream.
  type :: attempt_t
    real(real64) :: voxel = 0.0_real64              !! random number in [0, 1) that selects the voxel
    real(real64) :: place(2) = 0.0_real64           !! position in the voxel, as fractions of its edges
    type(random_stream_t) :: after
  end type attempt_t

contains

  !> Inserts the disks of a species from disk `first` on, until all are placed or no space is left.
  subroutine insert_at_random(packing, s, first, size_of, stream, line, placed)
    type(packing_t), intent(inout) :: packing
    integer(int32), intent(in) :: s                 !! index of a species for which `open_species` was called
    integer(int32), intent(in) :: first
    real(real64), intent(in) :: size_of(:)          !! radius of each disk [length]
    type(random_stream_t), intent(inout) :: stream
    class(status_line_t), intent(inout) :: line     !! status line for the progress
    integer(int32), intent(out) :: placed           !! number of disks inserted
    type(voxels_t) :: voxels
    integer(int32) :: i, j, k, n(2), blocker, failures, count, order(size(size_of))
    integer(int32) :: attempts                      ! number of attempts made, modulo `drawn_ahead`
    ! the next attempts, drawn early so that their data can be prefetched
    type(attempt_t) :: coming(0:drawn_ahead - 1)
    ! state of the random stream after the latest attempt
    type(random_stream_t) :: last
    real(real64) :: p(2), radius, lower(2), upper(2)
    logical :: equal

    equal = .not. minval(size_of) < maxval(size_of)
    order = largest_first(size_of)
    count = packing%layer(s)%count
    lower = packing%layer(s)%lower
    upper = packing%layer(s)%upper
    n = shape(packing%layer(s)%head)
    voxels%origin = lower
    voxels%side = (upper - lower)/n
    allocate (voxels%column_row(2, product(n)))
    do j = 0, n(2) - 1
      do i = 0, n(1) - 1
        voxels%n = voxels%n + 1
        voxels%column_row(:, voxels%n) = [i, j]
      end do
    end do
    placed = 0
    failures = 0
    last = stream
    attempts = 0
    do k = 0, drawn_ahead - 1
      call draw_attempt(stream, coming(k))
    end do
    do while (placed < count .and. voxels%n > 0)
      radius = size_of(order(placed + 1))
      associate (attempt => coming(attempts))
        k = chosen(voxels, attempt)
        p = place(attempt)
        last = attempt%after
        call draw_attempt(stream, attempt)
      end associate
      attempts = modulo(attempts + 1, drawn_ahead)
      call load_ahead()
      call packing%find_blocker(p, [0.0_real64, 0.0_real64], radius, blocker)
      if (blocker == 0) then
        blocker = first - 1 + order(placed + 1)
        call packing%add(blocker, s, p, radius)
        placed = placed + 1
        if (.not. equal) failures = 0
        if (modulo(placed, disks_per_look) == 0) call line%show_share("placing disks", real(placed, real64)/count)
      else
        failures = failures + 1
      end if
      if (failures == most_attempts .and. .not. equal) exit
      if (.not. equal) cycle
      if (packing%covers(blocker, middle(voxels, k), 0.5_real64*voxels%side, radius)) then
        voxels%column_row(:, k) = voxels%column_row(:, voxels%n)       ! the last voxel fills the gap
        voxels%n = voxels%n - 1
      end if
      ! Dividing the voxels pays off only when the number of failed attempts is about twice the
      ! number of voxels, because the division of a voxel requires four searches.
      if (failures > 2*voxels%n) then
        call halve(voxels, packing, radius)
        call line%show_share("placing disks", real(placed, real64)/count)
        failures = 0
      end if
    end do
    stream = last

  contains

    !> Point where an attempt places the centre of the new disk.
    pure function place(attempt) result(p)
      type(attempt_t), intent(in) :: attempt
      real(real64) :: p(2)

      p = min(max(voxels%origin + (voxels%column_row(:, chosen(voxels, attempt)) + attempt%place)*voxels%side, lower), upper)
    end function place

    !> Prefetches data for future attempts: the voxel of the attempt drawn last, and the cells and
    !> disks near the points of two earlier attempts. Consecutive attempts access distant parts of
    !> memory, so this saves time if the data exceed the cache.
    subroutine load_ahead()
      associate (far => coming(modulo(attempts - 1, drawn_ahead)), near => coming(modulo(attempts + 3, drawn_ahead)), &
          next => coming(modulo(attempts + 1, drawn_ahead)))
        call prefetch(voxels%column_row(1, max(chosen(voxels, far), 1)))
        call packing%load_cells(s, place(near))
        call packing%load_disks(s, place(next))
      end associate
    end subroutine load_ahead
  end subroutine insert_at_random

  !> Draws the random numbers of an attempt.
  pure subroutine draw_attempt(stream, attempt)
    type(random_stream_t), intent(inout) :: stream
    type(attempt_t), intent(out) :: attempt

    call stream%draw_uniform(attempt%voxel)
    call stream%draw_uniform(attempt%place(1))
    call stream%draw_uniform(attempt%place(2))
    attempt%after = stream
  end subroutine draw_attempt

  !> Index of the voxel selected by an attempt, from its random number, as in `draw_index`.
  pure function chosen(voxels, attempt) result(k)
    type(voxels_t), intent(in) :: voxels
    type(attempt_t), intent(in) :: attempt
    integer(int32) :: k

    k = 1 + int(voxels%n*attempt%voxel, int32)
  end function chosen

  !> Permutation that sorts the disks by decreasing radius. Radii are compared with a resolution of
  !> a thousandth of their range. Within this resolution disks keep their original order.
  pure function largest_first(radius) result(order)
    real(real64), intent(in) :: radius(:)           !! [length]
    integer(int32), parameter :: classes = 1000
    integer(int32) :: order(size(radius))
    integer(int32), allocatable :: first(:)

    call sort_by_count(1 + int(classes*(maxval(radius) - radius)/max(maxval(radius) - minval(radius), tiny(radius)), int32), &
      classes + 1, first, order)
  end function largest_first

  !> Centre of voxel k.
  pure function middle(voxels, k) result(p)
    type(voxels_t), intent(in) :: voxels
    integer(int32), intent(in) :: k
    real(real64) :: p(2)

    p = voxels%origin + (voxels%column_row(:, k) + 0.5_real64)*voxels%side
  end function middle

  !> Divides each voxel into four and eliminates new voxels that are excluded completely by a single
  !> disk or obstacle.
  pure subroutine halve(voxels, packing, radius)
    type(voxels_t), intent(inout) :: voxels
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: radius
    integer(int32), allocatable :: parent(:, :)
    integer(int32) :: k, quarter, n, blocker

    n = voxels%n
    if (maxval(voxels%column_row(:, :n)) >= ishft(huge(n), -1)) then
      ! the numbers of columns and rows of smaller voxels would exceed 32 bits
      voxels%n = 0
      return
    end if
    call move_alloc(voxels%column_row, parent)
    allocate (voxels%column_row(2, 4*n))
    voxels%n = 0
    voxels%side = 0.5_real64*voxels%side
    do k = 1, n
      do quarter = 0, 3
        voxels%n = voxels%n + 1
        voxels%column_row(:, voxels%n) = 2*parent(:, k) + [modulo(quarter, 2), quarter/2]
        call packing%find_blocker(middle(voxels, voxels%n), 0.5_real64*voxels%side, radius, blocker)
        if (blocker /= 0) voxels%n = voxels%n - 1
      end do
    end do
  end subroutine halve

end module random_insertion
