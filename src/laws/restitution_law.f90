!> Dependence of the coefficient of restitution on the impact speed: the laws that an input can
!> choose, with their variables in `&contact`. A new law is a keyword of `restitution_laws`, its
!> meaning in `law_choices`, and its function in `restitution_at`.
module restitution_law
  use kinds, only: real64
  use variable_rows, only: choice_t, in_motion, positive, variable_t
  implicit none
  private
  public :: chosen_restitution_law, law_choices, normal_law_t, restitution_law_rows, restitution_law_t, series_terms

  !> Keywords of the laws by which restitution depends on the impact velocity. For each law,
  !> `series_terms` is the coefficient c of the series in `restitution_law_t` (3/5 for viscoelastic
  !> spheres), or `no_series` if collisions below the reference velocity are elastic.
  character(len=*), parameter :: restitution_laws = "constant power viscoelastic elastic_below"
  real(real64), parameter :: no_series = -1.0_real64
  real(real64), parameter :: series_terms(4) = [0.0_real64, 0.0_real64, 0.6_real64, no_series]
  type(choice_t), parameter :: law_choices(*) = [ &
    choice_t("restitution_law", "constant", "Coefficients of restitution do not depend on the impact speed."), &
    choice_t("restitution_law", "power", "Below reference_speed, 1 - e is proportional to g**(1/5), where e is the " &
      //"coefficient of restitution and g is the impact speed."), &
    choice_t("restitution_law", "viscoelastic", "Disks are viscoelastic bodies: below reference_speed, the coefficient of " &
      //"restitution is e = 1 - y + 3/5 y**2, where y is proportional to g**(1/5) and g is the impact speed. The coefficients of " &
      //"restitution in the input must be at least 7/12."), &
    choice_t("restitution_law", "elastic_below", "Collisions at impact speeds below reference_speed are elastic. With this law " &
      //"smooth disks never undergo inelastic collapse, and never come to rest.")]

  type(variable_t), parameter :: restitution_law_rows(*) = [ &
    variable_t("contact", "restitution_law", "text", 1, "default", "'constant'", &
      "Dependence of all coefficients of restitution on the impact speed g, the normal component of the relative velocity.", &
      choices=restitution_laws, may_change=in_motion), &
    variable_t("contact", "reference_speed", "real", 1, "required", "1", &
      "Reference value g0 of the impact speed. At impact speeds above g0 the coefficients of restitution have the values in the " &
      //"input. At impact speeds below g0 the coefficients are closer to 1, or equal to 1 with restitution_law = " &
      //"'elastic_below'. With 'power' and 'viscoelastic', choose g0 above the impact speeds that occur; with 'elastic_below', " &
      //"choose g0 well below these speeds.", &
      positive, "length/time", goes_with="restitution_law power viscoelastic elastic_below", may_change=in_motion)]

  !> Coefficient of restitution that approaches 1 at small impact velocities (Ramirez, Poschel,
  !> Brilliantov and Schwager, Physical Review E 60, 4465 (1999)). Below a reference velocity g0 the
  !> coefficient is 1 - y + c y**2 with y = y0 (g/g0)**(1/5); above g0 it is constant. The constant
  !> y0 is chosen such that the coefficient at g0 is the value of the input. With c = `no_series`
  !> the coefficient is 1 below g0.
  type :: restitution_law_t
    !> Reference impact velocity g0; 0 for constant restitution [length/time].
    real(real64) :: speed = 0.0_real64
    real(real64) :: c = 0.0_real64      !! coefficient c of the series 1 - y + c y**2 (see `series_terms`)
  contains
    procedure :: restitution_at
    procedure :: least
    procedure :: has_elastic_range
  end type restitution_law_t

  !> Normal contact law of two surfaces.
  type :: normal_law_t
    !> Coefficient of restitution at the reference velocity of `by_speed`.
    real(real64) :: restitution = 1.0_real64
    type(restitution_law_t) :: by_speed = restitution_law_t()
  contains
    procedure :: is_inelastic
    procedure :: coefficient_at
  end type normal_law_t

contains

  !> True if the restitution dissipates energy.
  elemental function is_inelastic(self) result(yes)
    class(normal_law_t), intent(in) :: self
    logical :: yes

    yes = self%restitution < 1
  end function is_inelastic

  !> Coefficient of restitution at an impact velocity.
  elemental function coefficient_at(self, g) result(xi)
    class(normal_law_t), intent(in) :: self
    real(real64), intent(in) :: g                    !! normal impact velocity [length/time]
    real(real64) :: xi

    xi = self%by_speed%restitution_at(self%restitution, g)
  end function coefficient_at

  !> The law with the given keyword; without a keyword, the law of constant restitution.
  pure function chosen_restitution_law(word, speed) result(law)
    character(len=*), intent(in) :: word
    real(real64), intent(in) :: speed                !! reference impact velocity [length/time]
    type(restitution_law_t) :: law

    law%speed = speed
    law%c = series_terms(max(1, findloc(law_choices%word, word, dim=1)))
  end function chosen_restitution_law

  !> Coefficient of restitution at an impact velocity.
  elemental function restitution_at(self, restitution, g) result(xi)
    class(restitution_law_t), intent(in) :: self
    real(real64), intent(in) :: restitution      !! coefficient of restitution at the reference velocity g0
    real(real64), intent(in) :: g                    !! normal impact velocity [length/time]
    real(real64) :: xi, y

    xi = restitution
    if (.not. g < self%speed) return
    if (self%has_elastic_range()) xi = 1                   ! y = 0
    y = 2*(1 - xi)/(1 + sqrt(max(0.0_real64, 1 - 4*self%c*(1 - xi))))*(g/self%speed)**0.2_real64
    xi = 1 - y + self%c*y**2
  end function restitution_at

  !> Minimum coefficient of restitution in the input for which the series 1 - y + c y**2 decreases
  !> up to g0. At this value, the series has its minimum exactly at g0.
  elemental function least(self) result(xi)
    class(restitution_law_t), intent(in) :: self
    real(real64) :: xi

    xi = 0
    if (self%c > 0) xi = 1 - 1/(4*self%c)
  end function least

  !> True if collisions below the reference velocity g0 are elastic.
  elemental function has_elastic_range(self) result(yes)
    class(restitution_law_t), intent(in) :: self
    logical :: yes

    yes = self%c < 0 .and. self%speed > 0
  end function has_elastic_range

end module restitution_law
