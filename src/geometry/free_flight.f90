!> Kinematics of free flight: the position of a disk after a given time, and the time until it
!> touches a line or a circle. Times are measured from the given state of the disk. Disk-disk
!> contacts are in `event_prediction`.
module free_flight
  use kinds, only: never, real64
  implicit none
  private
  public :: flight, flight_velocity, time_to_line, time_to_circle, later_time_to_circle, negligible_speed

  !> Maximum speed that is treated as zero, because contact times would overflow [length/time].
  real(real64), parameter :: negligible_speed = 1/never

  !> Relative safety margin of tests that rule out contacts; larger than all rounding errors. Such a
  !> test never rules out a contact that occurs. It may fail to rule out a contact that does not
  !> occur.
  real(real64), parameter :: spare = 1.0e-6_real64
  !> Maximum number of times that a time interval is halved to find a lower bound of the distance in
  !> each part.
  integer, parameter :: most_halvings = 3

contains

  !> Coordinate after the time s on a parabolic path, x + v s + g s**2/2.
  elemental function flight(x, v, g, s) result(there)
    real(real64), intent(in) :: x         !! [length]
    real(real64), intent(in) :: v         !! [length/time]
    real(real64), intent(in) :: g         !! acceleration [length/time**2]
    real(real64), intent(in) :: s         !! [time]
    real(real64) :: there

    there = x + (v + 0.5_real64*g*s)*s
  end function flight

  !> Velocity component after the time s, v + g s.
  elemental function flight_velocity(v, g, s) result(then)
    real(real64), intent(in) :: v, g, s
    real(real64) :: then

    then = v + g*s
  end function flight_velocity

  !> Time until a point crosses a line in the forward direction; the result is `never` if the point
  !> does not cross it. In each branch, the root of the quadratic equation is calculated by the
  !> formula without cancellation.
  pure function time_to_line(distance, speed, acceleration) result(s)
    real(real64), intent(in) :: distance  !! distance to the line; negative behind the point [length]
    real(real64), intent(in) :: speed         !! velocity component towards the line [length/time]
    real(real64), intent(in) :: acceleration  !! acceleration component towards the line [length/time**2]
    real(real64) :: s, root

    s = never
    if (acceleration > 0) then
      root = sqrt(max(speed**2 + 2*acceleration*distance, 0.0_real64))
      if (speed > 0) then
        s = 2*distance/(speed + root)
      else
        s = (root - speed)/acceleration
      end if
    else if (speed > negligible_speed) then
      if (acceleration < 0) then
        root = speed**2 + 2*acceleration*distance
        if (root >= 0) s = 2*distance/(speed + sqrt(root))
      else
        s = distance/speed
      end if
    end if
  end function time_to_line

  !> Time until the centre of a disk reaches a circle of radius rho about the origin. The disk comes
  !> from inside if `inside` is .true., otherwise from outside. The result is 0 if the centre is
  !> already on the circle, or beyond it owing to rounding, and would cross it.
  pure function time_to_circle(d, v, g, rho, inside, within) result(s)
    real(real64), intent(in) :: d(2)      !! centre of the disk relative to the centre of the circle [length]
    real(real64), intent(in) :: v(2)      !! [length/time]
    real(real64), intent(in) :: g(2)      !! [length/time**2]
    real(real64), intent(in) :: rho       !! [length]
    logical, intent(in) :: inside
    !> Latest time of interest: for a later contact the result may be `never` [time].
    real(real64), intent(in), optional :: within
    real(real64) :: s, b, c, speed2, disc

    s = never
    if (any(abs(g) > 0)) then
      if (present(within) .and. .not. inside) then
        if (misses_circle(d, v, g, rho, within)) return
      end if
      s = time_to_circle_falling(d, v, g, rho, inside, 0)
      return
    end if
    b = d(1)*v(1) + d(2)*v(2)
    c = d(1)*d(1) + d(2)*d(2) - rho*rho
    speed2 = v(1)*v(1) + v(2)*v(2)
    disc = rho*rho*speed2 - (d(1)*v(2) - d(2)*v(1))**2
    if (inside) then
      if (.not. speed2 > 0) return
      ! Inside the circle this form is free of cancellation. If a disk moves along the circle, b and
      ! c are rounding errors. The other form of the discriminant can then vanish. The contact time,
      ! which is about 0, would then be the ratio of two rounding errors.
      if (c < 0) disc = b*b - speed2*c
      disc = sqrt(max(disc, 0.0_real64))
      if (b > 0) then
        s = max(-c, 0.0_real64)/(disc + b)
      else
        s = (disc - b)/speed2
      end if
    else if (b < 0 .and. disc > 0) then
      s = max(c, 0.0_real64)/(sqrt(disc) - b)
    end if
  end function time_to_circle

  !> True if an accelerated point certainly does not enter a circle about the origin during a given
  !> time. The point may start on the circle. The squared distance from the origin minus the squared
  !> radius is a quartic polynomial in time. The values of a polynomial in an interval are never
  !> below the smallest of its Bernstein coefficients. If the interval is halved repeatedly, the
  !> coefficients converge to the values.
  pure function misses_circle(d, v, g, rho, within) result(yes)
    real(real64), intent(in) :: d(2), v(2), g(2), rho, within
    logical :: yes
    real(real64) :: c(0:4), step(4), slack

    yes = .false.
    if (within > sqrt(never)) return                   ! the length of the path might overflow
    step(1) = 0.5_real64*within*(d(1)*v(1) + d(2)*v(2))
    step(2) = within**2*((v(1)*v(1) + v(2)*v(2)) + (d(1)*g(1) + d(2)*g(2)))/6
    step(3) = 0.25_real64*within**3*(v(1)*g(1) + v(2)*g(2))
    step(4) = 0.25_real64*within**4*(g(1)*g(1) + g(2)*g(2))
    c(0) = d(1)*d(1) + d(2)*d(2) - rho*rho
    c(1) = c(0) + step(1)
    c(2) = c(1) + step(1) + step(2)
    c(3) = c(2) + step(1) + 2*step(2) + step(3)
    c(4) = c(3) + step(1) + 3*step(2) + 3*step(3) + step(4)
    slack = spare*((abs(d(1)) + abs(d(2)) + within*(abs(v(1)) + abs(v(2)) + within*(abs(g(1)) + abs(g(2)))))**2 + rho*rho)
    yes = is_positive(c, .true., 0)

  contains

    !> True if the quartic polynomial with the given Bernstein coefficients is certainly positive in
    !> the whole interval. If `from_start` is .true., it may be 0 or negative at the start of the
    !> interval.
    pure recursive function is_positive(c, from_start, halvings) result(yes)
      real(real64), intent(in) :: c(0:4)
      logical, intent(in) :: from_start
      integer, intent(in) :: halvings
      logical :: yes
      real(real64) :: two(3), three(2), middle

      yes = min(c(1), c(2), c(3), c(4)) > slack .and. (from_start .or. c(0) > slack)
      if (yes .or. c(4) <= slack .or. halvings == most_halvings) return
      two = 0.25_real64*(c(:2) + 2*c(1:3) + c(2:))
      three = 0.5_real64*(two(:2) + two(2:))
      middle = 0.5_real64*(three(1) + three(2))
      if (middle <= slack) return
      yes = is_positive([c(0), 0.5_real64*(c(0) + c(1)), two(1), three(1), middle], from_start, halvings + 1)
      if (yes) yes = is_positive([middle, three(2), two(3), 0.5_real64*(c(3) + c(4)), c(4)], .false., halvings + 1)
    end function is_positive
  end function misses_circle

  !> Version of `time_to_circle` that skips a given number of earlier contacts. At these contacts
  !> the point passes through the circle. A straight path crosses a circle at most once inwards and
  !> once outwards.
  pure function later_time_to_circle(d, v, g, rho, inside, skipped) result(s)
    real(real64), intent(in) :: d(2), v(2), g(2), rho
    logical, intent(in) :: inside
    integer, intent(in) :: skipped        !! number of contacts to be skipped, at least 1
    real(real64) :: s

    s = never
    if (any(abs(g) > 0)) s = time_to_circle_falling(d, v, g, rho, inside, skipped)
  end function later_time_to_circle

  !> Version of `time_to_circle` for parabolic paths. F(s) = |d + v s + g s**2/2|**2 - rho**2 is a
  !> quartic polynomial that vanishes at a contact. F is monotonic between the roots of its
  !> derivative F', and F' between the roots of F''. Each bisection therefore starts with an
  !> interval that contains exactly one root, so that the first contact cannot be missed. F is
  !> calculated from the position at the time s. Polynomial coefficients are not used, because their
  !> rounding errors could exceed the squared radius of a small circle.
  pure function time_to_circle_falling(d, v, g, rho, inside, skipped) result(s)
    real(real64), intent(in) :: d(2), v(2), g(2), rho
    logical, intent(in) :: inside
    integer, intent(in) :: skipped        !! number of earlier contacts to be skipped
    real(real64) :: s, cubic(0:3), from, to, a, b, c, disc, bend(2), bound, ends(5)
    integer :: k, passed

    passed = 0
    cubic = [2*dot_product(d, v), 2*(dot_product(v, v) + dot_product(d, g)), 3*dot_product(v, g), dot_product(g, g)]
    bound = root_bound(cubic, rho/sqrt(cubic(3)))
    a = 3*cubic(3); b = cubic(2); c = cubic(1)         ! F'' = a s**2 + 2 b s + c
    disc = max(b*b - a*c, 0.0_real64)
    bend = [(-b - sign(sqrt(disc), a))/a, (-b + sign(sqrt(disc), a))/a]

    ends = [0.0_real64, min(max(bend, 0.0_real64), bound), bound, bound]
    s = never
    from = 0                                           ! ends of an interval in which F is monotonic
    do k = 1, 4
      if (k < 4) then
        if ((value(cubic, ends(k)) > 0) .eqv. (value(cubic, ends(k + 1)) > 0)) cycle
        to = root_between(cubic, ends(k), ends(k + 1))
      else
        to = from + bound
        do while (inside .and. apart(to) > 0)
          to = 2*to
        end do
      end if
      if (.not. (apart(to) > 0 .or. apart(to) >= apart(from))) then
        if (passed == skipped) then
          s = last_apart(from, to)
          return
        end if
        passed = passed + 1
      end if
      from = to
    end do

  contains

    !> F or, inside the circle, -F: changes from positive to negative at a contact.
    pure function apart(s) result(f)
      real(real64), intent(in) :: s
      real(real64) :: f, x(2)

      x = flight(d, v, g, s)
      f = x(1)*x(1) + x(2)*x(2) - rho*rho
      if (inside) f = -f
    end function apart

    !> Latest floating-point number before a contact, if the centre of the disk crosses the circle
    !> exactly once between the times lo and hi. The bisection uses the distance from the origin,
    !> which is more precise than the coefficients of the polynomial.
    pure function last_apart(lo, hi) result(left)
      real(real64), intent(in) :: lo, hi
      real(real64) :: left, middle, right, x(2)

      left = lo
      right = hi
      do
        middle = 0.5_real64*(left + right)
        if (middle <= left .or. middle >= right) exit
        x = flight(d, v, g, middle)
        if (x(1)*x(1) + x(2)*x(2) > rho*rho .neqv. inside) then
          left = middle
        else
          right = middle
        end if
      end do
    end function last_apart
  end function time_to_circle_falling

  !> A power of two that exceeds all roots of a cubic polynomial (Fujiwara's bound) and the square
  !> root of `time2`. The square root matters only if all roots are zero. With a power of two, a
  !> change of units by another power of two scales all results exactly.
  pure function root_bound(cubic, time2) result(bound)
    real(real64), intent(in) :: cubic(0:3), time2
    real(real64) :: bound
    integer :: k, power

    power = ceiling(exponent(time2)/2.0_real64)
    do k = 1, 3
      if (abs(cubic(3 - k)) > 0) power = max(power, ceiling(exponent(cubic(3 - k)/cubic(3))/real(k, real64)))
    end do
    bound = scale(2.0_real64, power)
  end function root_bound

  !> Root of a cubic polynomial between lo and hi, found by bisection to the last bit. The
  !> polynomial must change sign exactly once between lo and hi.
  pure function root_between(cubic, lo, hi) result(s)
    real(real64), intent(in) :: cubic(0:3), lo, hi
    real(real64) :: s, left, right
    logical :: sign_left

    left = lo
    right = hi
    sign_left = value(cubic, left) > 0
    do
      s = 0.5_real64*(left + right)
      if (s <= left .or. s >= right) exit
      if ((value(cubic, s) > 0) .eqv. sign_left) then
        left = s
      else
        right = s
      end if
    end do
    s = left  ! largest number with the same sign of `cubic` as at lo
  end function root_between

  !> Value of a cubic polynomial by Horner's method.
  pure function value(cubic, s) result(p)
    real(real64), intent(in) :: cubic(0:3)
    real(real64), intent(in) :: s
    real(real64) :: p

    p = ((cubic(3)*s + cubic(2))*s + cubic(1))*s + cubic(0)
  end function value

end module free_flight
