!> Sinusoidal oscillation of a side.
module sine
  use kinds, only: pi, real64
  use oscillation, only: negligible, oscillation_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: choices, sine_t, word

  character(len=*), parameter :: word = "sine"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("motion", word, "The side oscillates sinusoidally about its mean position.")]

  !> Angle below which differences of sines are calculated by a power series, to avoid cancellation
  !> [radian].
  real(real64), parameter :: small_angle = 0.5_real64

  type, extends(oscillation_t) :: sine_t
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
  end type sine_t

contains

  !> Maximum speed of the side.
  elemental function highest_speed(self) result(x)
    class(sine_t), intent(in) :: self
    real(real64) :: x                                !! [length/time]

    x = 2*pi*self%reach/self%period
  end function highest_speed

  !> Inward displacement of the side from its mean position.
  elemental function displaced_by(self, tau) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length]

    x = self%reach*sin(2*pi*(modulo(tau, self%period)/self%period))
  end function displaced_by

  !> Inward velocity of the side.
  elemental function velocity_at(self, tau) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length/time]

    x = highest_speed(self)*cos(2*pi*(modulo(tau, self%period)/self%period))
  end function velocity_at

  !> Inward acceleration of the side.
  elemental function acceleration(self, tau) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64) :: x                                !! [length/time**2]

    x = -(2*pi/self%period)**2*displaced_by(self, tau)
  end function acceleration

  !> Displacement of the side between the times tau and tau + s.
  elemental function displacement(self, tau, s) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length]
    real(real64) :: half

    half = pi*modulo(s, self%period)/self%period
    x = 2*self%reach*cos(2*pi*tau/self%period + half)*sin(half)
  end function displacement

  !> Change of velocity of the side between the times tau and tau + s.
  elemental function velocity_change(self, tau, s) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length/time]
    real(real64) :: half

    half = pi*modulo(s, self%period)/self%period
    x = -2*highest_speed(self)*sin(2*pi*tau/self%period + half)*sin(half)
  end function velocity_change

  !> Displacement between the times tau and tau + s relative to uniform motion with the velocity at
  !> tau.
  elemental function excess_displacement(self, tau, s) result(x)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    real(real64) :: x                                !! [length]
    real(real64) :: angle, angle2

    angle = 2*pi*s/self%period
    angle2 = angle*angle
    ! angle - sin(angle)
    x = angle*angle2/6*(1 - angle2/20*(1 - angle2/42*(1 - angle2/72*(1 - angle2/110*(1 - angle2/156)))))
    x = -self%reach*(cos(2*pi*tau/self%period)*x + 2*sin(2*pi*tau/self%period)*sin(0.5_real64*angle)**2)
  end function excess_displacement

  !> True if the power series of `excess_displacement` is accurate.
  elemental function is_short(self, tau, s) result(yes)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau, s               !! [time]
    logical :: yes

    yes = s < small_angle*self%period/(2*pi)
  end function is_short

  !> See `oscillation`.
  elemental function curvature_interval(self, tau, g) result(s)
    class(sine_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    real(real64), intent(in) :: g                    !! [length/time**2]
    real(real64) :: s                                !! [time]
    real(real64) :: bend(2), ratio

    bend = [0.0_real64, 0.5_real64]                  ! zeros of the acceleration, in units of the period
    ratio = g/(self%reach*(2*pi/self%period)**2)
    if (abs(ratio) < 1) bend = bend + [-1, 1]*asin(ratio)/(2*pi)
    bend = modulo(bend*self%period - tau, self%period)
    where (bend < negligible*self%period) bend = self%period
    s = minval(bend)
  end function curvature_interval

end module sine
