!> The container: four sides, walls or periodic by axis, fixed obstacles, and the acceleration in it.
!> Times of contact are pure functions of a disk's own state, counted from the epoch like its clock.
module box_geometry
  use disks, only: disk_t
  use free_flight, only: time_to_line
  use kinds, only: int32, never, real64
  use partners, only: axis_of, is_side, n_sides, obstacle_code, obstacle_number, sense_of
  use shapes, only: shape_t
  implicit none
  private
  public :: box_t, obstacle_t
  public :: side_time, next_side, next_obstacle, obstacle_gap, wall_normal, free_area

  type :: obstacle_t
    character(len=:), allocatable :: name
    class(shape_t), allocatable :: shape
  end type obstacle_t

  type :: box_t
    real(real64) :: lower(2) = 0.0_real64       !! [length]
    real(real64) :: upper(2) = 1.0_real64       !! [length]
    logical :: periodic(2) = .false.            !! by axis
    real(real64) :: gravity(2) = 0.0_real64     !! [length/time**2]
    type(obstacle_t), allocatable :: obstacle(:)
  contains
    procedure :: edges
    procedure :: periods
    procedure :: falling
    procedure :: n_obstacles
  end type box_t

contains

  !> Lengths of the sides.
  pure function edges(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = self%upper - self%lower
  end function edges

  !> The same, but `never` where the sides are walls.
  pure function periods(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = merge(self%upper - self%lower, never, self%periodic)
  end function periods

  !> Whether disks fly on parabolas.
  pure function falling(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = any(abs(self%gravity) > 0)
  end function falling

  !> Number of obstacles.
  pure function n_obstacles(self) result(n)
    class(box_t), intent(in) :: self
    integer(int32) :: n

    n = 0
    if (allocated(self%obstacle)) n = size(self%obstacle, kind=int32)
  end function n_obstacles

  !> When the disk's rim meets a wall, or its centre a periodic side. A gap that rounding made negative
  !> counts as zero: a disk that has arrived and moves on outwards turns now and never leaks.
  pure function side_time(box, disk, side) result(t)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! 0, -1, -2, -3: left, right, bottom, top
    real(real64) :: t, gap, inset
    integer :: axis

    axis = axis_of(side)
    inset = merge(0.0_real64, disk%radius, box%periodic(axis))
    if (sense_of(side) < 0) then
      gap = max(disk%x(axis) - (box%lower(axis) + inset), 0.0_real64)
      t = disk%clock + time_to_line(gap, -disk%v(axis), -box%gravity(axis))
    else
      gap = max((box%upper(axis) - inset) - disk%x(axis), 0.0_real64)
      t = disk%clock + time_to_line(gap, disk%v(axis), box%gravity(axis))
    end if
  end function side_time

  !> The side met first; of two at the same moment the one named first.
  pure subroutine next_side(box, disk, t, side)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: side
    integer(int32) :: k
    real(real64) :: t_k

    t = never
    side = 0
    do k = 0, 1 - n_sides, -1
      t_k = side_time(box, disk, k)
      if (t_k < t) then
        t = t_k
        side = k
      end if
    end do
  end subroutine next_side

  !> The earlier of a known event and the contacts with the obstacles listed. A disk stays in the box until it
  !> passes a periodic side, so the images of an obstacle one period away are enough; what encloses the disks has none.
  !> What is met from outside is convex: a disk that leaves it on a straight line does not return, whatever rounding says.
  pure subroutine next_obstacle(box, disk, last, list, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: last          !! code of the obstacle that it left last, if nothing has happened since
    integer(int32), intent(in) :: list(:)       !! numbers of the obstacles in question, ascending
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64) :: t_m, d(2), left(2)
    integer :: k, image_x, image_y, reach(2)

    do k = 1, size(list)
      associate (shape => box%obstacle(list(k))%shape)
        reach = merge(1, 0, box%periodic .and. .not. shape%encloses)
        t_m = never
        left = never                            ! the image that it leaves
        if (last == obstacle_code(list(k)) .and. .not. (shape%encloses .or. box%falling())) &
          left = shape%from_nearest(disk%x, box%periods())
        do image_y = -reach(2), reach(2)
          do image_x = -reach(1), reach(1)
            d = disk%x - (shape%middle + [image_x, image_y]*box%edges())
            if (all(abs(d - left) < 0.5_real64*box%edges())) cycle
            t_m = min(t_m, disk%clock + shape%contact_time(d, disk%v, box%gravity, disk%radius))
          end do
        end do
      end associate
      if (t_m < t) then
        t = t_m
        code = obstacle_code(list(k))
      end if
    end do
  end subroutine next_obstacle

  !> Distance between the m-th obstacle and the rim of a disk at x; negative if they overlap.
  pure function obstacle_gap(box, m, x, radius) result(length)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m
    real(real64), intent(in) :: x(2), radius    !! [length]
    real(real64) :: length

    associate (shape => box%obstacle(m)%shape)
      length = shape%gap(shape%from_nearest(x, box%periods()), radius)
    end associate
  end function obstacle_gap

  !> Unit vector from a side or obstacle to a disk at x that touches it.
  pure function wall_normal(box, code, x) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64) :: normal(2)

    if (is_side(code)) then
      normal = 0
      normal(axis_of(code)) = -sense_of(code)
    else
      associate (shape => box%obstacle(obstacle_number(code))%shape)
        normal = shape%normal(shape%from_nearest(x, box%periods()))
      end associate
    end if
  end function wall_normal

  !> Where disks can be: the box less the obstacles, or the smallest outline that encloses them.
  pure function free_area(box) result(area)
    type(box_t), intent(in) :: box
    real(real64) :: area                        !! [length**2]
    integer :: m

    area = product(box%edges())
    do m = 1, box%n_obstacles()
      if (box%obstacle(m)%shape%encloses) area = min(area, box%obstacle(m)%shape%area())
    end do
    do m = 1, box%n_obstacles()
      if (.not. box%obstacle(m)%shape%encloses) area = area - box%obstacle(m)%shape%area()
    end do
  end function free_area

end module box_geometry
