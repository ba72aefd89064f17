!> Which obstacles reach into which cell, so that a disk asks only those that it can meet in its own.
module obstacle_lists
  use kinds, only: int16, int32, real64
  use box_geometry, only: box_t, nearest_image, next_obstacle, obstacle_t
  use disks, only: disk_t
  implicit none
  private
  public :: obstacle_lists_t

  real(real64), parameter :: spare_width = 1.0e-6_real64    !! relative, above all rounding

  type :: obstacle_lists_t
    private
    integer(int32) :: n(2) = 0                     !! columns and rows of cells
    real(real64) :: width(2) = 0.0_real64          !! from cell to cell [length]
    real(real64) :: half(2) = 0.0_real64           !! of a cell's extent [length]
    integer(int32), allocatable :: start(:)        !! (cells+1) first entry of a cell in `list`
    integer(int32), allocatable :: list(:)         !! obstacles that reach into the cell, ascending
    type(obstacle_t), allocatable :: listed(:)     !! what these lists were made for,
    real(real64) :: listed_radius = 0.0_real64     !! and for disks of which size [length]
  contains
    procedure :: renew
    procedure :: next_contact
    procedure :: reach_into
  end type obstacle_lists_t

contains

  !> The earlier of an event known already and the contacts with the obstacles in reach of the disk's cell.
  pure subroutine next_contact(self, box, disk, cell, t, code)
    class(obstacle_lists_t), intent(in) :: self
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int16), intent(in) :: cell(2)          !! column and row, from 1
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: c

    c = cell(1) + self%n(1)*(cell(2) - 1)
    call next_obstacle(box, disk, self%list(self%start(c):self%start(c + 1) - 1), t, code)
  end subroutine next_contact

  !> Whether there are obstacles in reach of a cell.
  pure function reach_into(self, cell) result(yes)
    class(obstacle_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, from 1
    logical :: yes
    integer(int32) :: c

    c = cell(1) + self%n(1)*(cell(2) - 1)
    yes = self%start(c + 1) > self%start(c)
  end function reach_into

  !> Whether the lists of obstacles are up to date.
  pure function hold(self, box, radius, n) result(yes)
    class(obstacle_lists_t), intent(in) :: self
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius
    integer(int32), intent(in) :: n(2)
    logical :: yes
    integer :: m

    yes = .false.
    if (.not. allocated(self%listed)) return
    if (size(self%listed) /= size(box%obstacle) .or. self%listed_radius /= radius .or. any(self%n /= n)) return
    do m = 1, size(box%obstacle)
      associate (a => self%listed(m), b => box%obstacle(m))
        if (any(a%centre /= b%centre) .or. a%radius /= b%radius .or. (a%inside .neqv. b%inside)) return
      end associate
    end do
    yes = .true.
  end function hold

  !> Lists, unless the lists are up to date, which obstacles a disk can touch with its centre in each cell.
  subroutine renew(self, box, radius, n, width, overlap)
    class(obstacle_lists_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius             !! largest of the disks [length]
    integer(int32), intent(in) :: n(2)             !! columns and rows of cells
    real(real64), intent(in) :: width(2)           !! from cell to cell [length]
    real(real64), intent(in) :: overlap(2)         !! of neighbouring cells [length]
    integer(int32) :: c, m, entries, count_c

    if (hold(self, box, radius, n)) return
    self%n = n
    self%width = width
    self%half = 0.5_real64*(width + overlap)
    if (allocated(self%start)) deallocate (self%start, self%list)
    self%listed = box%obstacle
    self%listed_radius = radius
    allocate (self%start(product(n) + 1), self%list(0))
    self%start = 0
    do m = 1, size(box%obstacle, kind=int32)       ! count,
      call enter_obstacle(self, box, m, counting=.true.)
    end do
    entries = 0
    do c = 1, size(self%start, kind=int32)         ! make room,
      count_c = self%start(c)
      self%start(c) = entries + 1
      entries = entries + count_c
    end do
    deallocate (self%list)
    allocate (self%list(entries))
    do m = 1, size(box%obstacle, kind=int32)       ! fill: each cell's entries move its start to its end
      call enter_obstacle(self, box, m, counting=.false.)
    end do
    self%start = eoshift(self%start, -1, boundary=1_int32)
  end subroutine renew

  !> Counts obstacle m in every cell that it reaches into, or puts it into their lists.
  subroutine enter_obstacle(self, box, m, counting)
    class(obstacle_lists_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m
    logical, intent(in) :: counting
    logical :: column(self%n(1)), row(self%n(2))
    integer(int32) :: ix, iy, c

    column = slices_near(self, box, m, 1)
    row = slices_near(self, box, m, 2)
    do iy = 1, self%n(2)
      if (.not. row(iy)) cycle
      do ix = 1, self%n(1)
        if (.not. column(ix)) cycle
        if (.not. in_reach(self, box, box%obstacle(m), self%listed_radius, ix, iy)) cycle
        c = ix + self%n(1)*(iy - 1)
        if (.not. counting) self%list(self%start(c)) = m
        self%start(c) = self%start(c) + 1
      end do
    end do
  end subroutine enter_obstacle

  !> Columns (axis 1) or rows in which a disk may touch obstacle m, of others it is certain that it cannot;
  !> for a container all.
  pure function slices_near(self, box, m, axis) result(near)
    class(obstacle_lists_t), intent(in) :: self
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m
    integer, intent(in) :: axis
    logical :: near(self%n(axis))
    real(real64) :: middle(2)
    integer(int32) :: k

    do k = 1, self%n(axis)
      middle = box%lower + (k - 0.5_real64)*self%width - box%obstacle(m)%centre
      middle = middle - nearest_image(box, middle)
      near(k) = box%obstacle(m)%inside .or. abs(middle(axis)) &
        <= (self%half(axis) + box%obstacle(m)%radius + self%listed_radius)*(1 + 2*spare_width)
    end do
  end function slices_near

  !> Whether a disk whose centre is in the cell can touch the obstacle.
  pure function in_reach(self, box, obstacle, radius, ix, iy) result(yes)
    class(obstacle_lists_t), intent(in) :: self
    type(box_t), intent(in) :: box
    type(obstacle_t), intent(in) :: obstacle
    real(real64), intent(in) :: radius
    integer(int32), intent(in) :: ix, iy
    logical :: yes
    real(real64) :: middle(2), gap(2), far(2), spare

    middle = box%lower + ([ix, iy] - 0.5_real64)*self%width - obstacle%centre
    if (.not. obstacle%inside) middle = middle - nearest_image(box, middle)
    spare = 1 + spare_width
    gap = max(abs(middle) - self%half*spare, 0.0_real64)
    far = abs(middle) + self%half*spare
    if (obstacle%inside) then
      yes = norm2(far) >= (obstacle%radius - radius)/spare
    else
      yes = norm2(gap) <= (obstacle%radius + radius)*spare
    end if
  end function in_reach

end module obstacle_lists
