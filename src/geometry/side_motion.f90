!> Motion of a side of the box, and the time at which the side touches a disk in free flight. All positions, velocities and
!> accelerations are components along the inner normal of the side.
!>
!> In a time interval in which the acceleration of a disk relative to the side does not change its sign, the gap between disk and
!> side is a convex or concave function of time. The first zero of a convex or concave function can be enclosed in an interval
!> without other zeros. A period of the motion consists of a few intervals in which the gap is convex or concave. No contact can
!> therefore be missed, even if side and disk stay close together for a long time.
module side_motion
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: never, pi, real64
  implicit none
  private
  public :: motions, side_motion_t, side_state_t

  !> Kinds of motion of a side, with the names that the input uses. Elsewhere in the program a kind of motion is represented by its
  !> position in the list `motions`.
  character(len=*), parameter :: motions = "still sine parabolic sawtooth constant_velocity piston"
  integer, parameter, public :: still = 1, sine = 2, parabolic = 3, sawtooth = 4, constant_velocity = 5, piston = 6
  !> Angle below which differences of sines are calculated by a power series, to avoid cancellation [radian]
  real(real64), parameter :: small_angle = 0.5_real64
  !> Length of a negligible time interval, as a fraction of the period. An acceleration that acts only for a negligible time changes
  !> the gap by less than the rounding error of the gap.
  real(real64), parameter :: negligible = 1.0e-10_real64
  !> Number of successive intervals from `curvature_interval` that together cover at least one period of the motion, even if some of
  !> the intervals are negligibly short.
  integer, parameter :: intervals_in_reach = 6

  !> The state of a side that is a piston. Collisions with disks change the state of a piston.
  type :: side_state_t
    real(real64) :: position = 0.0_real64            !! displacement inwards from the mean position, at the time `clock` [length]
    real(real64) :: velocity = 0.0_real64            !! velocity inwards, at the time `clock` [length/time]
    real(real64) :: clock = 0.0_real64               !! time of position and velocity, relative to `box%epoch` [time]
  end type side_state_t

  type :: side_motion_t
    integer :: kind = still                          !! position in `motions`
    real(real64) :: offset = 0.0_real64              !! displacement inwards of the side at the start of its motion [length]
    !> A length that depends on the kind of motion: the amplitude of an oscillation, the sum of `offset` and the length of the path
    !> of a motion at constant velocity, or, for a piston, the width of the box. [length]
    real(real64) :: amplitude = 0.0_real64
    real(real64) :: period = 1.0_real64              !! [time]
    real(real64) :: phase = 0.0_real64               !! phase at t = 0, in units of the period
    !> Velocity inwards, for a sawtooth motion or a motion at constant velocity [length/time]
    real(real64) :: prescribed_velocity = 0.0_real64
    real(real64) :: start_time = 0.0_real64          !! start of a motion at constant velocity [time]
    real(real64) :: end_time = 0.0_real64            !! end of a motion at constant velocity [time]
    ! The components `mass` and `pull` apply to a piston, which is moved by a force and by collisions with disks.
    real(real64) :: mass = 1.0_real64                !! [mass]
    real(real64) :: pull = 0.0_real64                !! acceleration inwards due to the force [length/time**2]
  contains
    procedure :: moves
    procedure :: moves_permanently
    procedure :: innermost_position
    procedure :: highest_speed
    procedure :: local_time
    procedure :: position
    procedure :: velocity
    procedure :: contact_time
    procedure, private :: acceleration, displacement, is_short, excess_displacement, velocity_change, curvature_interval
  end type side_motion_t

contains

  !> Whether the position of the side changes at any time.
  elemental function moves(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = self%kind == sine .or. self%kind == parabolic .or. self%moves_permanently()
  end function moves

  !> Whether the position of the side, and therefore the accessible area, changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = self%kind == constant_velocity .or. self%kind == piston
  end function moves_permanently

  !> Largest displacement inwards from the mean position; for a piston the initial displacement.
  elemental function innermost_position(self) result(x)
    class(side_motion_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = self%amplitude
    if (self%moves_permanently()) x = self%offset
    if (self%kind == constant_velocity) x = x + max(0.0_real64, self%prescribed_velocity*(self%end_time - self%start_time))
  end function innermost_position

  !> Highest speed of the side; for a piston the speed of free fall through the box.
  elemental function highest_speed(self) result(speed)
    class(side_motion_t), intent(in) :: self
    real(real64) :: speed                            !! [length/time]

    speed = abs(self%prescribed_velocity)
    if (self%kind == sine) speed = 2*pi*self%amplitude/self%period
    if (self%kind == parabolic) speed = 8*self%amplitude/self%period
    if (self%kind == piston) speed = sqrt(2*abs(self%pull)*self%amplitude)
  end function highest_speed

  !> Local time of the motion at the time epoch + t of the run. The local time of an oscillation is measured from the start of the
  !> present period, the local time of a motion at constant velocity from the start of the motion, and the local time of a piston
  !> from the last change of the state of the piston. Remainders modulo the period are exact, so that the precision does not
  !> decrease at late times.
  elemental function local_time(self, epoch, t, state) result(tau)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t             !! [time]
    type(side_state_t), intent(in), optional :: state     !! state of the side, if the side is a piston
    real(real64) :: tau                              !! [time]

    if (self%kind == piston) then
      tau = t - state%clock
    else if (self%kind == constant_velocity) then
      tau = (epoch - self%start_time) + t
    else
      tau = modulo(modulo(epoch, self%period) + modulo(t, self%period) + self%phase*self%period, self%period)
    end if
  end function local_time

  !> Displacement of the side inwards from its mean position.
  elemental function position(self, tau, state) result(x)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! time as returned by `local_time` [time]
    type(side_state_t), intent(in), optional :: state     !! state of the side, if the side is a piston
    real(real64) :: x                                !! [length]
    real(real64) :: s

    x = 0
    s = modulo(tau, self%period)/self%period
    if (self%kind == sine) then
      x = self%amplitude*sin(2*pi*s)
    else if (self%kind == parabolic) then
      x = 16*self%amplitude*merge(s*(0.5_real64 - s), (s - 0.5_real64)*(s - 1), s < 0.5_real64)
    else if (self%kind == constant_velocity) then
      x = self%offset + self%prescribed_velocity*min(max(tau, 0.0_real64), self%end_time - self%start_time)
    else if (self%kind == piston) then
      x = flight(state%position, state%velocity, self%pull, tau)
    end if
  end function position

  !> Velocity of the side inwards.
  elemental function velocity(self, tau, state) result(v)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! time as returned by `local_time` [time]
    type(side_state_t), intent(in), optional :: state     !! state of the side, if the side is a piston
    real(real64) :: v                                !! [length/time]
    real(real64) :: s

    v = self%prescribed_velocity
    s = modulo(tau, self%period)/self%period
    if (self%kind == sine) then
      v = self%highest_speed()*cos(2*pi*s)
    else if (self%kind == parabolic) then
      v = self%highest_speed()*merge(1 - 4*s, 4*s - 3, s < 0.5_real64)
    else if (self%kind == constant_velocity .and. (tau < 0 .or. tau >= self%end_time - self%start_time)) then
      v = 0
    else if (self%kind == piston) then
      v = flight_velocity(state%velocity, self%pull, tau)
    end if
  end function velocity

  !> Acceleration of the side inwards, just after a given time.
  elemental function acceleration(self, tau) result(a)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! time as returned by `local_time` [time]
    real(real64) :: a                                !! [length/time**2]

    a = 0
    if (self%kind == sine) then
      a = -(2*pi/self%period)**2*self%position(tau)
    else if (self%kind == parabolic) then
      a = sign(32*self%amplitude/self%period**2, modulo(tau, self%period) - 0.5_real64*self%period)
    end if
  end function acceleration

  !> Displacement of the side between the times tau and tau + s.
  elemental function displacement(self, tau, s) result(distance)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: distance                         !! [length]
    real(real64) :: half

    half = pi*modulo(s, self%period)/self%period
    if (self%kind == sine) then
      distance = 2*self%amplitude*cos(2*pi*tau/self%period + half)*sin(half)
    else
      distance = self%position(tau + modulo(s, self%period)) - self%position(tau)
    end if
  end function displacement

  !> Whether the duration s is so short that the formula of `excess_displacement` is valid.
  elemental function is_short(self, tau, s) result(yes)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    logical :: yes

    if (self%kind == sine) then
      yes = s < small_angle*self%period/(2*pi)
    else                                             ! the motion of the side must follow a single parabola from tau to tau + s
      yes = s <= 0.5_real64*self%period - modulo(tau, 0.5_real64*self%period)
    end if
  end function is_short

  !> Displacement of the side between the times tau and tau + s, minus the displacement that the side would have if it kept its
  !> velocity at the time tau. The formula avoids cancellation between the two displacements.
  elemental function excess_displacement(self, tau, s) result(distance)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: distance                         !! [length]
    real(real64) :: angle, angle2

    if (self%kind == sine) then
      angle = 2*pi*s/self%period
      angle2 = angle*angle
      distance = angle*angle2/6*(1 - angle2/20*(1 - angle2/42*(1 - angle2/72*(1 - angle2/110*(1 - angle2/156)))))  ! x - sin x
      distance = -self%amplitude*(cos(2*pi*tau/self%period)*distance + 2*sin(2*pi*tau/self%period)*sin(0.5_real64*angle)**2)
    else
      distance = 0.5_real64*self%acceleration(tau)*s*s
    end if
  end function excess_displacement

  !> Change of the velocity of the side between the times tau and tau + s.
  elemental function velocity_change(self, tau, s) result(v)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: v                                !! [length/time]
    real(real64) :: half

    half = pi*modulo(s, self%period)/self%period
    if (self%kind == sine) then
      v = -2*self%highest_speed()*sin(2*pi*tau/self%period + half)*sin(half)
    else if (self%is_short(tau, s)) then
      v = self%acceleration(tau)*s
    else
      v = self%velocity(tau + modulo(s, self%period)) - self%velocity(tau)
    end if
  end function velocity_change

  !> Duration of the longest interval, starting at the time tau, in which the gap to a disk with the acceleration g is a convex or
  !> concave function of time. The interval ends when the acceleration of the side equals g or, at the latest, after half a period.
  elemental function curvature_interval(self, tau, g) result(s)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! time as returned by `local_time` [time]
    real(real64), intent(in) :: g                    !! [length/time**2]
    real(real64) :: s                                !! [time]
    real(real64) :: bend(2), ratio

    bend = [0.0_real64, 0.5_real64]                  ! times in units of the period
    if (self%kind == sine) then
      ratio = g/(self%amplitude*(2*pi/self%period)**2)
      if (abs(ratio) < 1) bend = bend + [-1, 1]*asin(ratio)/(2*pi)
    end if
    bend = modulo(bend*self%period - tau, self%period)
    where (bend < negligible*self%period) bend = self%period
    s = minval(bend)
  end function curvature_interval

  !> Time until the side touches the boundary of a disk on a parabolic path; the result is `never` if there is no contact. If a disk
  !> stays within the range of motion of the side for a whole period, the side touches the disk, unless the disk is slow and at the
  !> very end of the range. After a period without contact, the search therefore skips an increasing number of periods.
  pure function contact_time(self, tau, gap, v, g, state) result(s)
    class(side_motion_t), intent(in) :: self         !! a moving side
    real(real64), intent(in) :: tau                  !! local time from which the result `s` is measured [time]
    real(real64), intent(in) :: gap                  !! gap between the side and the boundary of the disk, not negative [length]
    real(real64), intent(in) :: v                    !! velocity of the disk [length/time]
    real(real64), intent(in) :: g                    !! acceleration of the disk [length/time**2]
    type(side_state_t), intent(in), optional :: state     !! state of the side, if the side is a piston
    real(real64) :: s, from, to, above, entry
    integer :: intervals

    if (self%kind == constant_velocity) then
      s = contact_time_of_stroke(self, tau, gap, v, g)
      return
    else if (self%kind == piston) then
      s = time_to_line(gap, self%velocity(tau, state) - v, self%pull - g)
      return
    end if
    above = gap + self%position(tau) - self%amplitude  ! distance of the disk from the range of motion of the side
    entry = time_to_line(above, -v, -g)  ! time at which the disk enters the range of motion of the side for the last time
    s = never
    from = 0
    intervals = 0
    do
      if (flight(above, v, g, from) > 0) then
        if (from < entry) then
          from = entry
          intervals = 0
        else if (.not. flight_velocity(v, g, from) < 0) then
          return
        end if
      end if
      if (.not. from < never) return
      to = from + self%curvature_interval(modulo(tau + modulo(from, self%period), self%period), g)
      s = contact_time_between(self, tau, gap, v, g, from, to)
      if (s < never) return
      intervals = intervals + 1
      from = to
      if (modulo(intervals, intervals_in_reach) == 0) from = scale(to, 1) + self%period
    end do
  end function contact_time

  !> Time until contact with a side that is at rest, then moves at constant velocity, and then is at rest again.
  pure function contact_time_of_stroke(motion, tau, gap, v, g) result(s)
    class(side_motion_t), intent(in) :: motion
    real(real64), intent(in) :: tau, gap, v, g       !! as in `contact_time`
    real(real64) :: s, from, to(3), gap_at
    integer :: k

    to = [-tau, (motion%end_time - motion%start_time) - tau, never]
    from = 0
    do k = 1, 3
      if (.not. to(k) > from) cycle
      gap_at = gap + (flight(0.0_real64, v, g, from) - (motion%position(tau + from) - motion%position(tau)))
      s = from + time_to_line(max(gap_at, 0.0_real64), merge(motion%prescribed_velocity, 0.0_real64, k == 2) - (v + g*from), -g)
      if (s <= to(k)) return
      from = to(k)
    end do
    s = never
  end function contact_time_of_stroke

  !> Time of contact within an interval in which the gap is convex or concave; the result is `never` if there is no contact.
  pure function contact_time_between(motion, tau, gap, v, g, from, to) result(s)
    class(side_motion_t), intent(in) :: motion
    real(real64), intent(in) :: tau, gap, v, g       !! as in `contact_time`
    real(real64), intent(in) :: from, to             !! the interval [time]
    real(real64) :: s, curvature, low, high, relative

    relative = v - motion%velocity(tau)
    curvature = g - motion%acceleration(tau + modulo(from, motion%period) + 0.5_real64*(to - from))
    if (motion%kind == parabolic) then
      s = from + time_to_line(max(gap_at(from), 0.0_real64), -gap_rate(from), -curvature)
      if (s > to) s = never
      return
    end if
    s = from
    if (.not. gap_at(from) > 0 .and. gap_rate(from) < 0) return
    s = never
    high = to
    if (curvature > 0) then                          ! the gap is smallest when its rate of change is 0
      if (.not. gap_rate(from) < 0) return
      low = from
      if (gap_rate(to) > 0) call bisect(.true., low, high)
    end if
    if (.not. gap_at(high) < 0) return
    low = from
    call bisect(.false., low, high)
    s = low

  contains

    !> Gap between side and disk after the time t.
    pure function gap_at(t) result(distance)
      real(real64), intent(in) :: t
      real(real64) :: distance

      if (motion%is_short(tau, t)) then
        distance = gap + (relative*t + (0.5_real64*g*t*t - motion%excess_displacement(tau, t)))
      else
        distance = gap + (flight(0.0_real64, v, g, t) - motion%displacement(tau, t))
      end if
    end function gap_at

    !> Rate of change of the gap between side and disk after the time t.
    pure function gap_rate(t) result(speed)
      real(real64), intent(in) :: t
      real(real64) :: speed

      speed = relative + (g*t - motion%velocity_change(tau, t))
    end function gap_rate

    !> Bisects an interval until `left` and `right` are adjacent floating-point numbers. If `to_smallest` is .true., the gap
    !> increases at the time `right`; otherwise the gap is negative at the time `right`.
    pure subroutine bisect(to_smallest, left, right)
      logical, intent(in) :: to_smallest
      real(real64), intent(inout) :: left, right
      real(real64) :: middle
      logical :: beyond

      do
        middle = 0.5_real64*(left + right)
        if (middle <= left .or. middle >= right) exit
        if (to_smallest) then
          beyond = gap_rate(middle) > 0
        else
          beyond = gap_at(middle) < 0
        end if
        if (beyond) right = middle
        if (.not. beyond) left = middle
      end do
    end subroutine bisect
  end function contact_time_between

end module side_motion
