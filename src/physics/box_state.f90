!> The state of the box during a run: the time origin, and the positions and velocities of pistons.
!> The positions of all sides, and the times when disks reach them, are functions of this state.
!> The time when a disk reaches a side depends only on the states of the disk and the side.
module box_state
  use box_geometry, only: box_t, obstacle_t, spans
  use box_side, only: side_t
  use disks, only: disk_t
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: int32, never, real64
  use partners, only: axis_of, is_side, n_sides, sense_of
  use side_motion, only: side_state_t
  implicit none
  private
  public :: bounds, box_state_t, centre_range, next_side, normal_surface_velocity, separate_from_sides, side_time

  !> Rounding error of the gap between a disk and a moving side, relative to the magnitude of the
  !> coordinates.
  real(real64), parameter :: relative_error = 16*epsilon(1.0_real64)

  !> A box during a run. All times, including the clocks of disks, are relative to the time origin
  !> `epoch`.
  type, extends(box_t) :: box_state_t
    real(real64) :: epoch = 0.0_real64          !! time origin, measured from the start of the run [time]
    type(side_state_t) :: piston(n_sides)       !! state of each side if it is a piston
  contains
    procedure :: side_position
    procedure :: side_velocity
    procedure :: specify
    procedure :: change
  end type box_state_t

  interface box_state_t
    module procedure box_at_start
  end interface box_state_t

contains

  !> The state of a box at the start of a run. Pistons are at rest.
  function box_at_start(box) result(state)
    type(box_t), intent(in) :: box
    type(box_state_t) :: state

    state%box_t = box
    state%piston%position = merge(box%side%offset(), 0.0_real64, box%side%is_piston())
  end function box_at_start

  !> Replaces the specification of the box, except its obstacles, which never change during a run.
  subroutine specify(self, box)
    class(box_state_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    type(obstacle_t), allocatable :: obstacle(:)

    call move_alloc(self%obstacle, obstacle)
    self%box_t = box
    call move_alloc(obstacle, self%obstacle)
  end subroutine specify

  !> Replaces the specification of the box at the time t of a run. A side with a new motion starts
  !> it at its present position, and an unchanged motion continues. A piston keeps the present
  !> velocity of its side.
  subroutine change(self, box, t)
    class(box_state_t), intent(inout) :: self
    type(box_t), intent(in) :: box              !! new specification; its obstacles are not used
    real(real64), intent(in) :: t               !! relative to the time origin `epoch` [time]
    type(side_t) :: before(n_sides)
    type(side_state_t) :: now(n_sides)
    integer :: k

    before = self%side
    do k = 1, n_sides
      now(k) = side_state_t(position=self%side_position(k, t), clock=t)
      if (before(k)%moves()) now(k)%velocity = self%side_velocity(k, t)
    end do
    call self%specify(box)
    call self%side%follow(before, now%position, self%epoch + t)
    self%piston = merge(now, side_state_t(), self%side%is_piston())
  end subroutine change

  !> Inward displacement of side k from its mean position at a given time.
  pure function side_position(self, k, t) result(x)
    class(box_state_t), intent(in) :: self
    integer, intent(in) :: k
    real(real64), intent(in) :: t               !! relative to the time origin `epoch` [time]
    real(real64) :: x                           !! [length]

    x = self%side(k)%position(self%epoch, t, self%piston(k))
  end function side_position

  !> Inward velocity of side k at a given time.
  pure function side_velocity(self, k, t) result(v)
    class(box_state_t), intent(in) :: self
    integer, intent(in) :: k
    real(real64), intent(in) :: t               !! relative to the time origin `epoch` [time]
    real(real64) :: v                           !! [length/time]

    v = self%side(k)%velocity(self%epoch, t, self%piston(k))
  end function side_velocity

  !> Positions of the sides at a given time.
  pure subroutine bounds(box, t, lower, upper)
    type(box_state_t), intent(in) :: box
    real(real64), intent(in) :: t               !! relative to the time origin `box%epoch` [time]
    real(real64), intent(out) :: lower(2), upper(2)     !! (left, bottom) and (right, top) sides [length]
    real(real64) :: inwards(n_sides)
    integer :: k

    do k = 1, n_sides
      inwards(k) = box%side_position(k, t)
    end do
    lower = box%lower + inwards([1, 3])
    upper = box%upper - inwards([2, 4])
  end subroutine bounds

  !> Corners of the rectangle available to the centres of disks in a region at a given time. A disk
  !> with its centre in this rectangle is completely inside the region and overlaps no side. This
  !> also holds if a side is displaced from its mean position.
  pure subroutine centre_range(region, box, radius, lower, upper, t)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_state_t), intent(in) :: box
    real(real64), intent(in) :: radius              !! [length]
    real(real64), intent(out) :: lower(2), upper(2)
    !> Time relative to the time origin `box%epoch`; default: 0 [time].
    real(real64), intent(in), optional :: t
    real(real64) :: inset(2), low(2), high(2), at

    at = 0
    if (present(t)) at = t
    call bounds(box, at, low, high)
    inset = merge(0.0_real64, radius, spans(region, box%box_t))
    lower = max(region([1, 3]), low) + inset
    ! rounding errors must not put `upper` below `lower`
    upper = max(min(region([2, 4]), high) - inset, lower)
  end subroutine centre_range

  !> Time when a disk touches a wall, or its centre reaches a periodic or open side. A gap made
  !> negative by rounding is set to zero. A disk moving outwards at a wall is then reflected
  !> immediately and cannot leave the box. At a moving side, gaps below the rounding error are also
  !> set to zero. Otherwise the bounces between disk and side could become ever shorter, and their
  !> sequence would be infinite.
  pure function side_time(box, disk, side) result(t)
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! code of the side: 0 left, -1 right, -2 bottom, -3 top
    real(real64) :: t, gap, inset
    integer :: axis, sense

    axis = axis_of(side)
    sense = sense_of(side)
    inset = merge(0.0_real64, disk%radius, box%periodic(axis) .or. box%open(1 - side))
    if (sense < 0) then
      gap = disk%x(axis) - (box%lower(axis) + inset)
    else
      gap = (box%upper(axis) - inset) - disk%x(axis)
    end if
    if (box%side(1 - side)%moves()) then
      t = moving_side_time(box, disk, side, gap)
    else
      t = disk%clock + time_to_line(max(gap, 0.0_real64), sense*disk%v(axis), sense*box%gravity(axis))
    end if
  end function side_time

  !> Time when a disk touches a moving side.
  pure function moving_side_time(box, disk, side, distance) result(t)
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! code of the side
    real(real64), intent(in) :: distance        !! distance between the disk and the edge of the box [length]
    real(real64) :: t, gap, tau, v, g, since, after
    integer :: axis

    axis = axis_of(side)
    v = -sense_of(side)*disk%v(axis)
    g = -sense_of(side)*box%gravity(axis)
    gap = distance
    associate (motion => box%side(1 - side)%motion, state => box%piston(1 - side))
      since = disk%clock
      if (motion%is_piston()) then              ! the contact must not precede the clock of disk or piston
        since = max(since, state%clock)
        after = since - disk%clock
        gap = gap + flight(0.0_real64, v, g, after)
        v = flight_velocity(v, g, after)
      end if
      tau = motion%local_time(box%epoch, since, state)
      gap = gap - motion%position(tau, state)
      if (gap < gap_rounding_error(disk, axis, motion%reach)) gap = 0
      t = since + motion%contact_time(tau, gap, v, g, state)
    end associate
  end function moving_side_time

  !> The first side reached by a disk. If the disk reaches two sides at the same time, left precedes
  !> right, and both precede bottom and top.
  pure subroutine next_side(box, disk, t, side)
    type(box_state_t), intent(in) :: box
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

  !> Moves a disk away from moving sides that it would touch before the time `now`. A new time
  !> origin changes the position and velocity of a moving side by rounding errors. These errors can
  !> shift the predicted contact of a disk close to the side to a time before `now`. The
  !> displacement of the disk is of the order of these errors.
  pure subroutine separate_from_sides(box, disk, now)
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: now             !! relative to the time origin `box%epoch` [time]
    real(real64) :: step
    integer(int32) :: side

    do side = 0, 1 - n_sides, -1
      if (.not. box%side(1 - side)%moves()) cycle
      associate (x => disk%x(axis_of(side)))
        step = gap_rounding_error(disk, axis_of(side), box%side(1 - side)%motion%reach)
        do while (side_time(box, disk, side) < now)
          x = x - sense_of(side)*step
          step = 2*step
        end do
      end associate
    end do
  end subroutine separate_from_sides

  !> Normal velocity of a surface; zero for obstacles, which do not move.
  pure function normal_surface_velocity(box, code, normal, t) result(u)
    type(box_state_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: normal(2)       !! unit vector from the surface to a disk
    real(real64), intent(in) :: t               !! relative to the time origin `box%epoch` [time]
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    if (.not. is_side(code)) return
    if (allocated(box%side(1 - code)%motion)) u = box%side_velocity(1 - code, t)*normal
  end function normal_surface_velocity

  !> Rounding error of the gap between a disk and a moving side.
  pure function gap_rounding_error(disk, axis, reach) result(gap)
    type(disk_t), intent(in) :: disk
    integer, intent(in) :: axis
    real(real64), intent(in) :: reach           !! maximum displacement of the side [length]
    real(real64) :: gap                         !! [length]

    gap = relative_error*(abs(disk%x(axis)) + disk%radius + reach)
  end function gap_rounding_error

end module box_state
