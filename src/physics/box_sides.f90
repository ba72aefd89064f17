!> Positions of the sides of the box, and the times at which disks reach the sides. The time at which a disk reaches a side is a
!> pure function of the state of the disk. All times, including the clocks of disks, are relative to the time origin `box%epoch`.
module box_sides
  use box_geometry, only: box_t
  use disks, only: disk_t
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: int32, never, real64
  use partners, only: axis_of, n_sides, sense_of
  use side_motion, only: piston, side_motion_t
  implicit none
  private
  public :: bounds, centre_range, separate_from_sides, next_side, side_time, spans

  !> Rounding error of the gap between a disk and a moving side, relative to the magnitude of the coordinates.
  real(real64), parameter :: rounding = 16*epsilon(1.0_real64)

contains

  !> Positions of the sides at a given time.
  pure subroutine bounds(box, t, lower, upper)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: t               !! time relative to the time origin `box%epoch` [time]
    real(real64), intent(out) :: lower(2), upper(2)     !! (left, bottom) and (right, top) sides [length]
    real(real64) :: inwards(n_sides)
    integer :: k

    inwards = 0
    do k = 1, n_sides
      if (box%surface(k)%motion%moves()) inwards(k) = box%side_position(k, t)
    end do
    lower = box%lower + inwards([1, 3])
    upper = box%upper - inwards([2, 4])
  end subroutine bounds

  !> Whether the region extends over the whole period of the box along each axis; .false. along an axis that is not periodic. Disks
  !> may extend beyond the region along an axis for which the result is .true.
  pure function spans(region, box) result(yes)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    logical :: yes(2)

    yes = box%periodic .and. region([1, 3]) <= box%lower .and. region([2, 4]) >= box%upper
  end function spans

  !> Corners of the rectangle that the centre of a disk in a region may occupy at a given time. If the centre of a disk is in the
  !> rectangle, the disk is completely inside the region and does not overlap a side, even if the position of the side at this time
  !> differs from its mean position.
  pure subroutine centre_range(region, box, radius, lower, upper, t)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius              !! [length]
    real(real64), intent(out) :: lower(2), upper(2)
    !> Time relative to the time origin `box%epoch`; the default is 0 [time]
    real(real64), intent(in), optional :: t
    real(real64) :: inset(2), low(2), high(2), at

    at = 0
    if (present(t)) at = t
    call bounds(box, at, low, high)
    inset = merge(0.0_real64, radius, spans(region, box))
    lower = max(region([1, 3]), low) + inset
    upper = max(min(region([2, 4]), high) - inset, lower)    ! rounding errors must not make `upper` smaller than `lower`
  end subroutine centre_range

  !> Time when the boundary of a disk touches a wall, or its centre reaches a periodic side. A gap that is negative because of
  !> rounding is set to zero, so that a disk that moves outwards at a wall is reflected immediately and cannot leave the box. At a
  !> moving side, a gap smaller than the rounding error is also set to zero, because a series of ever shorter bounces between a disk
  !> and a moving side would otherwise be infinite.
  pure function side_time(box, disk, side) result(t)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! code of the side: 0 left, -1 right, -2 bottom, -3 top
    real(real64) :: t, gap, inset, tau, v, since, after
    integer :: axis, sense

    axis = axis_of(side)
    sense = sense_of(side)
    inset = merge(0.0_real64, disk%radius, box%periodic(axis))
    if (sense < 0) then
      gap = disk%x(axis) - (box%lower(axis) + inset)
    else
      gap = (box%upper(axis) - inset) - disk%x(axis)
    end if
    associate (motion => box%surface(1 - side)%motion, state => box%side(1 - side))
      if (motion%moves()) then
        since = disk%clock
        v = -sense*disk%v(axis)
        if (motion%kind == piston) then             ! the contact cannot precede the clock of the disk or of the piston
          since = max(since, state%clock)
          after = since - disk%clock
          gap = gap + flight(0.0_real64, v, -sense*box%gravity(axis), after)
          v = flight_velocity(v, -sense*box%gravity(axis), after)
        end if
        tau = motion%local_time(box%epoch, since, state)
        gap = gap - motion%position(tau, state)
        if (gap < gap_rounding_error(disk, axis, motion)) gap = 0
        t = since + motion%contact_time(tau, gap, v, -sense*box%gravity(axis), state)
      else
        t = disk%clock + time_to_line(max(gap, 0.0_real64), sense*disk%v(axis), sense*box%gravity(axis))
      end if
    end associate
  end function side_time

  !> The first side that a disk reaches. If a disk reaches two sides at the same time, the side that comes first in the order left,
  !> right, bottom, top is chosen.
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

  !> Moves a disk away from the moving sides that the disk would touch before the time `now`. A change of the time origin rounds the
  !> position and velocity of a moving side. If a disk nearly touches a moving side, the rounding can shift the predicted contact to
  !> a time before `now`. The disk is moved only by a distance of the order of the rounding errors of positions.
  pure subroutine separate_from_sides(box, disk, now)
    type(box_t), intent(in) :: box
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: now             !! time relative to the time origin `box%epoch` [time]
    real(real64) :: step
    integer(int32) :: side

    do side = 0, 1 - n_sides, -1
      associate (motion => box%surface(1 - side)%motion, x => disk%x(axis_of(side)))
        if (.not. motion%moves()) cycle
        step = gap_rounding_error(disk, axis_of(side), motion)
        do while (side_time(box, disk, side) < now)
          x = x - sense_of(side)*step
          step = 2*step
        end do
      end associate
    end do
  end subroutine separate_from_sides

  !> Rounding error of the gap between a disk and a moving side.
  pure function gap_rounding_error(disk, axis, motion) result(gap)
    type(disk_t), intent(in) :: disk
    integer, intent(in) :: axis
    type(side_motion_t), intent(in) :: motion
    real(real64) :: gap                         !! [length]

    gap = rounding*(abs(disk%x(axis)) + disk%radius + motion%amplitude)
  end function gap_rounding_error

end module box_sides
