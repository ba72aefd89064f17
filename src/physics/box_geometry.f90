!> The container: four sides, walls or periodic by axis, circular obstacles, and the acceleration in it.
!> Times of contact are pure functions of a disk's own state, counted from the epoch like its clock.
module box_geometry
  use kinds, only: int32, never, real64
  use disks, only: disk_t
  use free_flight, only: time_to_circle, time_to_line
  implicit none
  private
  public :: box_t, obstacle_t, first_obstacle, n_sides
  public :: side_time, obstacle_time, next_side, next_obstacle, obstacle_reach, from_obstacle, nearest_image

  integer(int32), parameter :: n_sides = 4
  !> What a disk meets, as one number: > 0 a disk; 0, -1, -2, -3 the left, right, bottom and top side;
  !> from `first_obstacle` downwards the obstacles.
  integer(int32), parameter :: first_obstacle = -4

  !> A fixed circle: disks bounce off its outside, or are kept inside it.
  type :: obstacle_t
    character(len=:), allocatable :: name
    real(real64) :: centre(2) = 0.0_real64      !! [length]
    real(real64) :: radius = 0.0_real64         !! [length]
    logical :: inside = .false.                 !! disks are kept inside
  end type obstacle_t

  type :: box_t
    real(real64) :: lower(2) = 0.0_real64       !! [length]
    real(real64) :: upper(2) = 1.0_real64       !! [length]
    logical :: periodic(2) = .false.            !! by axis
    real(real64) :: gravity(2) = 0.0_real64     !! [length/time**2]
    type(obstacle_t), allocatable :: obstacle(:)
  contains
    procedure :: edges
    procedure :: falling
    procedure :: obstructed
  end type box_t

contains

  !> Lengths of the sides.
  pure function edges(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = self%upper - self%lower
  end function edges

  !> Whether disks fly on parabolas.
  pure function falling(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = any(abs(self%gravity) > 0)
  end function falling

  !> Whether there are obstacles.
  pure function obstructed(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = .false.
    if (allocated(self%obstacle)) yes = size(self%obstacle) > 0
  end function obstructed

  !> When the disk's rim meets a wall, or its centre a periodic side. A gap that rounding made negative
  !> counts as zero: a disk that has arrived and moves on outwards turns now and never leaks.
  pure function side_time(box, disk, side) result(t)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! 0, -1, -2, -3: left, right, bottom, top
    real(real64) :: t, gap, inset
    integer :: axis

    axis = 1 - side/2
    inset = merge(0.0_real64, disk%radius, box%periodic(axis))
    if (modulo(side, 2) == 0) then
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

  !> Distance between the obstacle's centre and the disk's at contact.
  pure function obstacle_reach(obstacle, radius) result(rho)
    type(obstacle_t), intent(in) :: obstacle
    real(real64), intent(in) :: radius
    real(real64) :: rho

    rho = merge(obstacle%radius - radius, obstacle%radius + radius, obstacle%inside)
  end function obstacle_reach

  !> When the disk meets the m-th obstacle. A disk stays in the box until it passes a periodic side, so the
  !> images of the obstacle one period away are enough; a container has none, it holds its disks.
  pure function obstacle_time(box, disk, m) result(t)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer, intent(in) :: m
    real(real64) :: t
    integer :: image_x, image_y, reach(2)

    t = never
    associate (o => box%obstacle(m))
      reach = merge(1, 0, box%periodic .and. .not. o%inside)
      do image_y = -reach(2), reach(2)
        do image_x = -reach(1), reach(1)
          t = min(t, disk%clock + time_to_circle(disk%x - (o%centre + [image_x, image_y]*box%edges()), &
            disk%v, box%gravity, obstacle_reach(o, disk%radius), o%inside))
        end do
      end do
    end associate
  end function obstacle_time

  !> From the m-th obstacle's centre, or its nearest image's, to x.
  pure function from_obstacle(box, m, x) result(d)
    type(box_t), intent(in) :: box
    integer, intent(in) :: m
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64) :: d(2)

    d = x - box%obstacle(m)%centre
    if (any(box%periodic) .and. .not. box%obstacle(m)%inside) d = d - nearest_image(box, d)
  end function from_obstacle

  !> The whole periods in a separation: dx less these leads to the nearest image.
  pure function nearest_image(box, dx) result(shift)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: dx(2)           !! [length]
    real(real64) :: shift(2), edges(2)

    edges = box%edges()
    shift = 0
    if (abs(dx(1)) < 0.5_real64*edges(1) .and. abs(dx(2)) < 0.5_real64*edges(2)) return    ! nearly always
    shift = merge(edges*anint(dx/edges), 0.0_real64, box%periodic)
  end function nearest_image

  !> The earlier of an event known already and the contacts with the obstacles listed.
  pure subroutine next_obstacle(box, disk, list, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: list(:)       !! numbers of the obstacles in question, ascending
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64) :: t_m
    integer :: k

    do k = 1, size(list)
      t_m = obstacle_time(box, disk, int(list(k)))
      if (t_m < t) then
        t = t_m
        code = first_obstacle + 1 - list(k)
      end if
    end do
  end subroutine next_obstacle

end module box_geometry
