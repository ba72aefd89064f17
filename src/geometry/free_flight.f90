!> Kinematics of free flight as pure functions: the position of a disk after some time, and the time until it touches a line or a
!> circle. Times count from the state that is passed in. Contacts of two disks are predicted in `neighbour_search`.
module free_flight
  use kinds, only: never, real64
  implicit none
  private
  public :: flight, flight_velocity, time_to_line, time_to_circle, slowest

  !> Speeds below this value count as rest, because times would overflow. [length/time]
  real(real64), parameter :: slowest = 1/never

contains

  !> Position after the time s on the parabola x + v s + g s**2/2, for one coordinate.
  elemental function flight(x, v, g, s) result(there)
    real(real64), intent(in) :: x         !! [length]
    real(real64), intent(in) :: v         !! [length/time]
    real(real64), intent(in) :: g         !! acceleration [length/time**2]
    real(real64), intent(in) :: s         !! [time]
    real(real64) :: there

    there = x + (v + 0.5_real64*g*s)*s
  end function flight

  !> Velocity after the time s, for one component.
  elemental function flight_velocity(v, g, s) result(then)
    real(real64), intent(in) :: v, g, s
    real(real64) :: then

    then = v + g*s
  end function flight_velocity

  !> Time until a line at `distance` ahead is crossed in the forward direction; `never` if it is not crossed.
  !> Each branch uses the form of the root of the quadratic that is free of cancellation.
  pure function time_to_line(distance, speed, acceleration) result(s)
    real(real64), intent(in) :: distance      !! along the normal; negative if the line is behind [length]
    real(real64), intent(in) :: speed         !! along the normal [length/time]
    real(real64), intent(in) :: acceleration  !! along the normal [length/time**2]
    real(real64) :: s, root

    s = never
    if (acceleration > 0) then
      root = sqrt(max(speed**2 + 2*acceleration*distance, 0.0_real64))
      if (speed > 0) then
        s = 2*distance/(speed + root)
      else
        s = (root - speed)/acceleration
      end if
    else if (speed > slowest) then
      if (acceleration < 0) then
        root = speed**2 + 2*acceleration*distance
        if (root >= 0) s = 2*distance/(speed + sqrt(root))
      else
        s = distance/speed
      end if
    end if
  end function time_to_line

  !> Time until the centre of a disk reaches a circle of radius rho around the origin, from outside or, with `inside`, from
  !> inside. Zero if the disk is already on the circle (or beyond it, by rounding) and moves further.
  pure function time_to_circle(d, v, g, rho, inside) result(s)
    real(real64), intent(in) :: d(2)      !! centre of the disk relative to that of the circle [length]
    real(real64), intent(in) :: v(2)      !! [length/time]
    real(real64), intent(in) :: g(2)      !! [length/time**2]
    real(real64), intent(in) :: rho       !! [length]
    logical, intent(in) :: inside
    real(real64) :: s, b, c, speed2, disc

    if (any(abs(g) > 0)) then
      s = time_to_circle_falling(d, v, g, rho, inside)
      return
    end if
    s = never
    b = d(1)*v(1) + d(2)*v(2)
    c = d(1)*d(1) + d(2)*d(2) - rho*rho
    speed2 = v(1)*v(1) + v(2)*v(2)
    disc = rho*rho*speed2 - (d(1)*v(2) - d(2)*v(1))**2
    if (inside) then
      if (.not. speed2 > 0) return
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

  !> The same on a parabola. F(s) = |d + v s + g s**2/2|**2 - rho**2 is a quartic. It is monotonic between the roots of F', which in
  !> turn are bracketed by the roots of the quadratic F''. Each root is therefore found by bisection in an interval that contains
  !> exactly one root, and the first contact cannot be missed. F itself is evaluated from the actual position, so that a small
  !> circle is not lost in the square of its distance.
  pure function time_to_circle_falling(d, v, g, rho, inside) result(s)
    real(real64), intent(in) :: d(2), v(2), g(2), rho
    logical, intent(in) :: inside
    real(real64) :: s, cubic(0:3), edge(0:4), a, b, c, disc, bend(2), bound, ends(4)
    integer :: k, n

    cubic = [2*dot_product(d, v), 2*(dot_product(v, v) + dot_product(d, g)), 3*dot_product(v, g), dot_product(g, g)]
    bound = root_bound(cubic, rho/sqrt(cubic(3)))
    a = 3*cubic(3); b = cubic(2); c = cubic(1)         ! F'' = a s**2 + 2 b s + c
    disc = max(b*b - a*c, 0.0_real64)
    bend = [(-b - sign(sqrt(disc), a))/a, (-b + sign(sqrt(disc), a))/a]

    ends = [0.0_real64, min(max(bend, 0.0_real64), bound), bound]
    edge(0) = 0                                        ! edges of the intervals in which F is monotonic
    n = 0
    do k = 1, 3
      if ((value(cubic, ends(k)) > 0) .eqv. (value(cubic, ends(k + 1)) > 0)) cycle
      n = n + 1
      edge(n) = root_between(cubic, ends(k), ends(k + 1))
    end do
    n = n + 1
    edge(n) = edge(n - 1) + bound
    do while (inside .and. apart(edge(n)) > 0)
      edge(n) = 2*edge(n)
    end do
    s = never
    do k = 1, n
      if (apart(edge(k)) > 0 .or. apart(edge(k)) >= apart(edge(k - 1))) cycle
      s = last_apart(edge(k - 1), edge(k))
      return
    end do

  contains

    !> F, or -F if the disk is inside. A contact is a zero crossing from positive to negative values.
    pure function apart(s) result(f)
      real(real64), intent(in) :: s
      real(real64) :: f, x(2)

      x = flight(d, v, g, s)
      f = x(1)*x(1) + x(2)*x(2) - rho*rho
      if (inside) f = -f
    end function apart

    !> The last time before contact, if the centre crosses the circle once between lo and hi. Bisection to the last bit uses the
    !> distance itself, which is more precise than the polynomial.
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

  !> A power of two larger than all roots of a cubic (Fujiwara's bound), and larger than the square root of `time2`, which is
  !> used if all roots are zero. With powers of two, results scale exactly when the units change by a power of two.
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

  !> The root of `poly` between lo and hi, where it has one change of sign. Found by bisection to the last bit.
  pure function root_between(poly, lo, hi) result(s)
    real(real64), intent(in) :: poly(0:), lo, hi
    real(real64) :: s, left, right
    logical :: sign_left

    left = lo
    right = hi
    sign_left = value(poly, left) > 0
    do
      s = 0.5_real64*(left + right)
      if (s <= left .or. s >= right) exit
      if ((value(poly, s) > 0) .eqv. sign_left) then
        left = s
      else
        right = s
      end if
    end do
    s = left                                           ! the end of the interval before contact
  end function root_between

  !> Value of a polynomial by Horner's rule.
  pure function value(poly, s) result(p)
    real(real64), intent(in) :: poly(0:)
    real(real64), intent(in) :: s
    real(real64) :: p
    integer :: k

    p = 0
    do k = ubound(poly, 1), 0, -1
      p = p*s + poly(k)
    end do
  end function value

end module free_flight
