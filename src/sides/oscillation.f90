!> Oscillations of a side about its mean position.
!>
!> As long as the acceleration of a disk relative to the side keeps its sign, the gap between them
!> is a convex or concave function of time. The first zero of such a function can be bracketed. A
!> period of the oscillation consists of a few such intervals. Therefore no contact can be missed,
!> even if side and disk stay close together for a long time.
module oscillation
  use fields, only: fields_t
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: never, real64
  use side_motion, only: side_motion_t, side_state_t
  use texts, only: written
  use variable_rows, only: largest
  implicit none
  private
  public :: gap_after, negligible, oscillation_t

  !> Duration of a negligible time interval, as a fraction of the period. An acceleration during a
  !> shorter time changes the gap by less than its rounding error.
  real(real64), parameter :: negligible = 1.0e-10_real64
  !> Number of successive intervals from `curvature_interval` that cover at least one period of the
  !> motion, even if some of them are negligibly short.
  integer, parameter :: intervals_in_reach = 6

  !> An oscillation of amplitude `reach`.
  type, abstract, extends(side_motion_t) :: oscillation_t
    real(real64) :: period = 1.0_real64              !! [time]
    real(real64) :: phase = 0.0_real64               !! phase at t = 0, in units of the period
  contains
    procedure :: read => read_oscillation
    procedure :: check
    procedure :: culprit
    procedure :: innermost_position
    procedure :: local_time
    procedure :: position
    procedure :: velocity
    procedure :: contact_time
    procedure(value_in_period), deferred :: displaced_by
    procedure(value_in_period), deferred :: velocity_at
    procedure(value_in_period), deferred :: acceleration
    procedure(change_between), deferred :: displacement
    procedure(change_between), deferred :: velocity_change
    procedure(change_between), deferred :: excess_displacement
    procedure(is_short), deferred :: is_short
    procedure(curvature_interval), deferred :: curvature_interval
    procedure :: first_contact
  end type oscillation_t

  abstract interface

    !> Inward displacement [length], velocity or acceleration, just after a given time.
    elemental function value_in_period(self, tau) result(x)
      import :: oscillation_t, real64
      class(oscillation_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! time as returned by `local_time` [time]
      real(real64) :: x
    end function value_in_period

    !> Displacement of the side between the times tau and tau + s, its change of velocity, or its
    !> displacement relative to uniform motion with the velocity at tau. The latter is calculated
    !> without subtracting two nearly equal displacements.
    elemental function change_between(self, tau, s) result(x)
      import :: oscillation_t, real64
      class(oscillation_t), intent(in) :: self
      real(real64), intent(in) :: tau, s             !! [time]
      real(real64) :: x
    end function change_between

    !> True if the duration s is short enough for the formula of `excess_displacement`.
    elemental function is_short(self, tau, s) result(yes)
      import :: oscillation_t, real64
      class(oscillation_t), intent(in) :: self
      real(real64), intent(in) :: tau, s             !! [time]
      logical :: yes
    end function is_short

    !> Duration of the longest interval from the time tau on during which the gap to a disk of
    !> acceleration g is a convex or a concave function of time. The interval ends when the
    !> acceleration of the side equals g, or after half a period.
    elemental function curvature_interval(self, tau, g) result(s)
      import :: oscillation_t, real64
      class(oscillation_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! time as returned by `local_time` [time]
      real(real64), intent(in) :: g                  !! acceleration of the disk [length/time**2]
      real(real64) :: s                              !! [time]
    end function curvature_interval
  end interface

contains

  !> Reads the variables of an oscillation.
  subroutine read_oscillation(self, fields, width)
    class(oscillation_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields
    real(real64), intent(in) :: width                !! unused

    call fields%read("amplitude", self%reach)
    call fields%read("period", self%period)
    call fields%read("phase", self%phase)
  end subroutine read_oscillation

  !> Reports an oscillation that is too fast.
  subroutine check(self, fields)
    class(oscillation_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields

    if (self%highest_speed() > largest) call fields%complain("period", "the side moves at up to "// &
      written(self%highest_speed())//"; allowed: up to "//written(largest))
  end subroutine check

  !> See `side_motion`.
  pure function culprit(self) result(name)
    class(oscillation_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "amplitude"
  end function culprit

  !> Amplitude of the oscillation.
  elemental function innermost_position(self) result(x)
    class(oscillation_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = self%reach
  end function innermost_position

  !> Time since the start of the present period. Remainders modulo the period are exact, so that
  !> late times are as precise as early ones.
  elemental function local_time(self, epoch, t, state) result(tau)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t             !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: tau                              !! [time]

    tau = modulo(modulo(epoch, self%period) + modulo(t, self%period) + self%phase*self%period, self%period)
  end function local_time

  !> Inward displacement of the side from its mean position.
  elemental function position(self, tau, state) result(x)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length]

    x = self%displaced_by(tau)
  end function position

  !> Inward velocity of the side.
  elemental function velocity(self, tau, state) result(x)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length/time]

    x = self%velocity_at(tau)
  end function velocity

  !> Time until the side touches a disk. A disk that stays within the range of the oscillation for a
  !> whole period is touched by the side, unless it is slow and at the very end of this range. After
  !> each period without contact, the search therefore skips an increasing number of periods.
  pure function contact_time(self, tau, gap, v, g, state) result(s)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap, v, g       !! see `side_motion`
    type(side_state_t), intent(in) :: state
    real(real64) :: s, from, to, above, entry
    integer :: intervals

    ! distance of the disk from the range of the oscillation
    above = gap + self%displaced_by(tau) - self%reach
    entry = time_to_line(above, -v, -g)  ! time at which the disk enters this range for the last time
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
      s = self%first_contact(tau, gap, [v, g], from, to)
      if (s < never) return
      intervals = intervals + 1
      from = to
      if (modulo(intervals, intervals_in_reach) == 0) from = scale(to, 1) + self%period
    end do
  end function contact_time

  !> Time of contact in an interval in which the gap is a convex or concave function of time. The
  !> result is `never` if there is no contact.
  pure function first_contact(self, tau, gap, disk, from, to) result(s)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap             !! as in `contact_time`
    !> Velocity [length/time] and acceleration [length/time**2] of the disk.
    real(real64), intent(in) :: disk(2)
    real(real64), intent(in) :: from, to             !! start and end of the interval [time]
    real(real64) :: s, curvature, low, high, relative

    relative = disk(1) - self%velocity_at(tau)
    curvature = disk(2) - self%acceleration(tau + modulo(from, self%period) + 0.5_real64*(to - from))
    s = from
    if (.not. gap_at(from) > 0 .and. gap_rate(from) < 0) return
    s = never
    high = to
    if (curvature > 0) then                          ! the gap has its minimum where its rate of change is 0
      if (.not. gap_rate(from) < 0) return
      low = from
      if (gap_rate(to) > 0) call bisect(.true., low, high)
    end if
    if (.not. gap_at(high) < 0) return
    low = from
    call bisect(.false., low, high)
    s = low

  contains

    !> Gap between side and disk at the time tau + t.
    pure function gap_at(t) result(distance)
      real(real64), intent(in) :: t
      real(real64) :: distance

      distance = gap_after(self, tau, gap, disk, t)
    end function gap_at

    !> Rate of change of the gap between side and disk at the time tau + t.
    pure function gap_rate(t) result(speed)
      real(real64), intent(in) :: t
      real(real64) :: speed

      speed = relative + (disk(2)*t - self%velocity_change(tau, t))
    end function gap_rate

    !> Bisects an interval until `left` and `right` are adjacent floating-point numbers. At the time
    !> `right` the gap increases if `to_smallest` is .true.; otherwise the gap is negative.
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
  end function first_contact

  !> Gap between side and disk at the time tau + t.
  pure function gap_after(self, tau, gap, disk, t) result(distance)
    class(oscillation_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap             !! as in `contact_time`
    !> Velocity [length/time] and acceleration [length/time**2] of the disk.
    real(real64), intent(in) :: disk(2)
    real(real64), intent(in) :: t                    !! [time]
    real(real64) :: distance                         !! [length]

    if (self%is_short(tau, t)) then
      distance = gap + ((disk(1) - self%velocity_at(tau))*t + (0.5_real64*disk(2)*t*t - self%excess_displacement(tau, t)))
    else
      distance = gap + (flight(0.0_real64, disk(1), disk(2), t) - self%displacement(tau, t))
    end if
  end function gap_after

end module oscillation
