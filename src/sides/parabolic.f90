!> Oscillation with piecewise constant acceleration: a series of parabolas that resembles a sine.
module parabolic
  use free_flight, only: time_to_line
  use kinds, only: never, real64
  use oscillation, only: gap_after, negligible, oscillation_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: choices, parabolic_t, word

  character(len=*), parameter :: word = "parabolic"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("motion", word, "The side oscillates about its mean position with piecewise constant acceleration, close to a " &
      //"sine.")]

  type, extends(oscillation_t) :: parabolic_t
  contains
    procedure :: highest_speed
    procedure :: displaced_by
    procedure :: velocity_at
    procedure :: acceleration
    procedure :: displacement
    procedure :: velocity_change
    procedure :: excess_displacement
    procedure :: is_short
    procedure :: curvature_interval
    procedure :: first_contact
  end type parabolic_t

contains

  !> Maximum speed of the side.
  elemental function highest_speed(self) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64) :: x                                !! [length/time]

    x = 8*self%reach/self%period
  end function highest_speed

  !> Inward displacement of the side from its mean position.
  elemental function displaced_by(self, tau) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length]
    real(real64) :: s

    s = modulo(tau, self%period)/self%period
    x = 16*self%reach*merge(s*(0.5_real64 - s), (s - 0.5_real64)*(s - 1), s < 0.5_real64)
  end function displaced_by

  !> Inward velocity of the side.
  elemental function velocity_at(self, tau) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length/time]
    real(real64) :: s

    s = modulo(tau, self%period)/self%period
    x = highest_speed(self)*merge(1 - 4*s, 4*s - 3, s < 0.5_real64)
  end function velocity_at

  !> Inward acceleration of the side, just after the time tau.
  elemental function acceleration(self, tau) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length/time**2]

    x = sign(32*self%reach/self%period**2, modulo(tau, self%period) - 0.5_real64*self%period)
  end function acceleration

  !> Displacement of the side between the times tau and tau + s.
  elemental function displacement(self, tau, s) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length]

    x = displaced_by(self, tau + modulo(s, self%period)) - displaced_by(self, tau)
  end function displacement

  !> Change of velocity of the side between the times tau and tau + s.
  elemental function velocity_change(self, tau, s) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length/time]

    if (is_short(self, tau, s)) then
      x = acceleration(self, tau)*s
    else
      x = velocity_at(self, tau + modulo(s, self%period)) - velocity_at(self, tau)
    end if
  end function velocity_change

  !> Displacement between the times tau and tau + s relative to uniform motion with the velocity at
  !> tau.
  elemental function excess_displacement(self, tau, s) result(x)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length]

    x = 0.5_real64*acceleration(self, tau)*s*s
  end function excess_displacement

  !> True if the side follows a single parabola from tau to tau + s.
  elemental function is_short(self, tau, s) result(yes)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    logical :: yes

    yes = s <= 0.5_real64*self%period - modulo(tau, 0.5_real64*self%period)
  end function is_short

  !> Time until the acceleration of the side changes sign.
  elemental function curvature_interval(self, tau, g) result(s)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64), intent(in) :: g                    !! [length/time**2]
    real(real64) :: s                                !! [time]
    real(real64) :: bend(2)

    bend = modulo([0.0_real64, 0.5_real64]*self%period - tau, self%period)
    where (bend < negligible*self%period) bend = self%period
    s = minval(bend)
  end function curvature_interval

  !> Time of contact in an interval in which side and disk both move along parabolas.
  pure function first_contact(self, tau, gap, disk, from, to) result(s)
    class(parabolic_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap             !! as in `contact_time`
    !> Velocity [length/time] and acceleration [length/time**2] of the disk.
    real(real64), intent(in) :: disk(2)
    real(real64), intent(in) :: from, to             !! start and end of the interval [time]
    real(real64) :: s, rate, curvature

    rate = (disk(1) - velocity_at(self, tau)) + (disk(2)*from - velocity_change(self, tau, from))
    curvature = disk(2) - acceleration(self, tau + modulo(from, self%period) + 0.5_real64*(to - from))
    s = from + time_to_line(max(gap_after(self, tau, gap, disk, from), 0.0_real64), -rate, -curvature)
    if (s > to) s = never
  end function first_contact

end module parabolic
