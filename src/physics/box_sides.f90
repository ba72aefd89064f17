!> Positions of the sides of the box, and the times when disks reach them. Each such time depends
!> only on the state of the disk. All times, including the clocks of disks, are relative to the time
!> origin `box%epoch`.
module box_sides
  use box_geometry, only: box_t
  use disks, only: disk_t
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: int32, never, real64
  use partners, only: axis_of, n_sides, sense_of
  implicit none
  private
  public :: bounds, centre_range, separate_from_sides, next_side, side_time, spans

  !> Rounding error of the gap between a disk and a moving side, relative to the magnitude of the
  !> coordinates.
  real(real64), parameter :: relative_error = 16*epsilon(1.0_real64)

contains

  !> Positions of the sides at a given time.
  pure subroutine bounds(box, t, lower, upper)
    type(box_t), intent(in) :: box
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

  !> True for each periodic axis along which the region spans the whole period. Along such an axis
  !> disks may overlap the edges of the region.
  pure function spans(region, box) result(yes)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    logical :: yes(2)

    yes = box%periodic .and. region([1, 3]) <= box%lower .and. region([2, 4]) >= box%upper
  end function spans

  !> Corners of the rectangle available to the centres of disks in a region at a given time. A disk
  !> with its centre in this rectangle is completely inside the region and overlaps no side. This
  !> also holds if a side is displaced from its mean position.
  pure subroutine centre_range(region, box, radius, lower, upper, t)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius              !! [length]
    real(real64), intent(out) :: lower(2), upper(2)
    !> Time relative to the time origin `box%epoch`; default: 0 [time].
    real(real64), intent(in), optional :: t
    real(real64) :: inset(2), low(2), high(2), at

    at = 0
    if (present(t)) at = t
    call bounds(box, at, low, high)
    inset = merge(0.0_real64, radius, spans(region, box))
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
    type(box_t), intent(in) :: box
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
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: side          !! code of the side
    real(real64), intent(in) :: distance        !! distance between the disk and the edge of the box [length]
    real(real64) :: t, gap, tau, v, g, since, after
    integer :: axis

    axis = axis_of(side)
    v = -sense_of(side)*disk%v(axis)
    g = -sense_of(side)*box%gravity(axis)
    gap = distance
    associate (motion => box%side(1 - side)%motion, state => box%side(1 - side)%state)
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

  !> Moves a disk away from moving sides that it would touch before the time `now`. A new time
  !> origin changes the position and velocity of a moving side by rounding errors. These errors can
  !> shift the predicted contact of a disk close to the side to a time before `now`. The
  !> displacement of the disk is of the order of these errors.
  pure subroutine separate_from_sides(box, disk, now)
    type(box_t), intent(in) :: box
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

  !> Rounding error of the gap between a disk and a moving side.
  pure function gap_rounding_error(disk, axis, reach) result(gap)
    type(disk_t), intent(in) :: disk
    integer, intent(in) :: axis
    real(real64), intent(in) :: reach           !! maximum displacement of the side [length]
    real(real64) :: gap                         !! [length]

    gap = relative_error*(abs(disk%x(axis)) + disk%radius + reach)
  end function gap_rounding_error

end module box_sides
