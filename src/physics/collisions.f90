!> Contact laws: restitution for each pair of species, contact laws of walls, and the TC model.
module collisions
  use kinds, only: real64
  use variable_rows, only: choice_t
  implicit none
  private
  public :: contact_law_t, law_choices, normal_rule, pair_impulse, restitution_laws, rule_choices, series_terms, speed_law_t
  public :: tangential_impulse, tangential_law_t, wall_law_t, wall_rebound, wall_rules

  !> Names of the wall rules in the input. The coefficient of restitution multiplies both velocity
  !> components of the disk ('velocity') or only the normal component ('normal'). Elsewhere in the
  !> program a rule is represented by its index in this list.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! index of the rule 'normal'
  !> Meanings of the rules. They apply to the variable `rule` of a single wall and to the variable
  !> `wall_rule` of all walls.
  type(choice_t), parameter :: meanings(*) = [ &
    choice_t("", "velocity", "Both components of the velocity are multiplied by the coefficient of restitution, and the " &
      //"normal component is reversed. A single disk without gravity follows the same path as in elastic collisions, at " &
      //"decreasing speed."), &
    choice_t("", "normal", "The normal component of the velocity is reversed and multiplied by the coefficient of " &
      //"restitution. The tangential component does not change (smooth wall), unless tangential_restitution makes the wall " &
      //"rough.")]
  character(len=*), parameter :: rule_variables(2) = [character(len=9) :: "rule", "wall_rule"]
  integer :: k, r
  type(choice_t), parameter :: rule_choices(*) = [((choice_t(rule_variables(k), meanings(r)%word, meanings(r)%meaning), &
    r=1, size(meanings)), k=1, size(rule_variables))]

  !> Keywords of the laws by which restitution depends on the impact velocity. For each law,
  !> `series_terms` is the coefficient c of the series in `speed_law_t` (3/5 for viscoelastic
  !> spheres), or `no_series` if collisions below the reference velocity are elastic.
  character(len=*), parameter :: restitution_laws = "constant power viscoelastic elastic_below"
  real(real64), parameter :: no_series = -1.0_real64
  real(real64), parameter :: series_terms(4) = [0.0_real64, 0.0_real64, 0.6_real64, no_series]
  type(choice_t), parameter :: law_choices(*) = [ &
    choice_t("restitution_law", "constant", "Coefficients of restitution do not depend on the impact speed."), &
    choice_t("restitution_law", "power", "Below reference_speed, 1 - e is proportional to g**(1/5), where e is the " &
      //"coefficient of restitution and g is the impact speed."), &
    choice_t("restitution_law", "viscoelastic", "Viscoelastic bodies: below reference_speed, the coefficient of restitution " &
      //"is e = 1 - y + 3/5 y**2, where y is proportional to g**(1/5) and g is the impact speed. The coefficients " &
      //"of restitution in the input must be at least 7/12."), &
    choice_t("restitution_law", "elastic_below", "Collisions at impact speeds below reference_speed are elastic. Smooth disks " &
      //"then never undergo inelastic collapse, and never come to rest.")]

  !> Coefficient of restitution that approaches 1 at small impact velocities (Ramirez, Poschel,
  !> Brilliantov and Schwager, Physical Review E 60, 4465 (1999)). Below a reference velocity g0 the
  !> coefficient is 1 - y + c y**2 with y = y0 (g/g0)**(1/5); above g0 it is constant. The constant
  !> y0 is chosen such that the coefficient at g0 is the value of the input. With c = `no_series`
  !> the coefficient is 1 below g0.
  type :: speed_law_t
    !> Reference impact velocity g0; 0 for constant restitution [length/time].
    real(real64) :: speed = 0.0_real64
    real(real64) :: c = 0.0_real64      !! coefficient c of the series 1 - y + c y**2 (see `series_terms`)
  contains
    procedure :: restitution_at
    procedure :: least
    procedure :: has_elastic_range
  end type speed_law_t

  !> Tangential interaction of two rough surfaces (Walton 1993, and Luding, Huthmann, McNamara and
  !> Zippelius, Physical Review E 57, 3416 (1998)).
  type :: tangential_law_t
    real(real64) :: restitution = -1.0_real64        !! tangential restitution, from -1 (smooth) to 1
    !> Coulomb friction coefficient; huge() if the impulse is unlimited.
    real(real64) :: friction = huge(1.0_real64)
  contains
    procedure :: is_rough
  end type tangential_law_t

  !> Contact law of a wall.
  type :: wall_law_t
    real(real64) :: restitution = 1.0_real64
    integer :: rule = 1                              !! index of the rule in `wall_rules`
    type(speed_law_t) :: by_speed = speed_law_t()
    type(tangential_law_t) :: tangential = tangential_law_t()
    real(real64) :: temperature = 0.0_real64         !! kT of a thermal wall; 0 for other walls [energy]
    real(real64) :: speed = 0.0_real64               !! tangential velocity of the surface [length/time]
  end type wall_law_t

  !> Contact law of disk-disk collisions, and contact duration of all collisions.
  type :: contact_law_t
    !> Symmetric matrix of the coefficients of restitution for all pairs of species.
    real(real64), allocatable :: restitution(:, :)
    type(speed_law_t) :: by_speed = speed_law_t()    !! dependence on the impact velocity
    !> Contact duration t_c of the TC model (Luding and McNamara, Granular Matter 1, 113 (1998)): a
    !> collision is elastic if either partner had its previous collision less than t_c earlier
    !> [time].
    real(real64) :: contact_time = 0.0_real64
    type(tangential_law_t) :: tangential = tangential_law_t()  !! tangential interaction of two disks
    real(real64) :: inertia = 0.5_real64             !! moment of inertia divided by mass times radius squared
  contains
    procedure :: loses_energy
    procedure :: can_collapse
  end type contact_law_t

contains

  !> True if disk-disk collisions can dissipate energy.
  pure function loses_energy(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = any(self%restitution < 1) .or. self%tangential%is_rough()
  end function loses_energy

  !> True if an inelastic collapse is possible. For smooth disks it is prevented by the TC model,
  !> and by laws with elastic collisions below a reference velocity.
  pure function can_collapse(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%restitution) .and. .not. (self%contact_time > 0 .or. self%by_speed%has_elastic_range())
    if (yes) yes = any(self%restitution < 1)
  end function can_collapse

  !> Coefficient of restitution at an impact velocity.
  elemental function restitution_at(self, restitution, g) result(xi)
    class(speed_law_t), intent(in) :: self
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
    class(speed_law_t), intent(in) :: self
    real(real64) :: xi

    xi = 0
    if (self%c > 0) xi = 1 - 1/(4*self%c)
  end function least

  !> True if collisions below the reference velocity g0 are elastic.
  elemental function has_elastic_range(self) result(yes)
    class(speed_law_t), intent(in) :: self
    logical :: yes

    yes = self%c < 0 .and. self%speed > 0
  end function has_elastic_range

  !> Impulse on disk i, as a multiple q of the separation vector dx = x_j - x_i. The velocity v_i
  !> changes by q dx/m_i, and v_j changes by -q dx/m_j. The actual distance of the disks is used
  !> instead of the sum of their radii. Energy is then conserved up to rounding errors.
  pure function pair_impulse(b, distance2, mass_i, mass_j, restitution) result(q)
    real(real64), intent(in) :: b                    !! dx . dv [length**2/time]
    real(real64), intent(in) :: distance2            !! dx . dx [length**2]
    real(real64), intent(in) :: mass_i, mass_j       !! [mass]
    real(real64), intent(in) :: restitution
    real(real64) :: q

    q = (1 + restitution)*b/distance2*(mass_i*mass_j/(mass_i + mass_j))
  end function pair_impulse

  !> True if the surfaces are rough, so that tangential impulses occur.
  elemental function is_rough(self) result(yes)
    class(tangential_law_t), intent(in) :: self
    logical :: yes

    yes = self%restitution > -1
  end function is_rough

  !> Tangential impulse on a body whose surface slips at a contact. The slip velocity is multiplied
  !> by -beta, where beta is the tangential restitution, unless Coulomb's law limits the impulse.
  pure function tangential_impulse(law, inertia, mass, slip, normal_impulse) result(impulse)
    type(tangential_law_t), intent(in) :: law
    !> Moment of inertia divided by mass times radius squared, equal for both bodies.
    real(real64), intent(in) :: inertia
    real(real64), intent(in) :: mass                 !! reduced mass [mass]
    real(real64), intent(in) :: slip      !! tangential velocity of the surface at the contact [length/time]
    real(real64), intent(in) :: normal_impulse       !! magnitude of the normal impulse [mass length/time]
    real(real64) :: impulse

    impulse = -inertia/(1 + inertia)*mass*(1 + law%restitution)*slip
    if (law%friction >= huge(law%friction)) return
    if (abs(impulse) > law%friction*normal_impulse) impulse = sign(law%friction*normal_impulse, impulse)
  end function tangential_impulse

  !> Velocity after a collision with a wall at rest. The normal component points away from the wall
  !> even if the disk was already moving away. A second collision due to rounding errors therefore
  !> cannot push the disk through the wall.
  pure function wall_rebound(law, v, normal, elastic) result(after)
    type(wall_law_t), intent(in) :: law
    real(real64), intent(in) :: v(2)                 !! [length/time]
    real(real64), intent(in) :: normal(2)            !! unit vector from the wall to the disk
    logical, intent(in) :: elastic    !! whether the previous contact of the disk has not ended yet (TC model)
    real(real64) :: after(2), approach, restitution

    approach = v(1)*normal(1) + v(2)*normal(2)
    restitution = merge(1.0_real64, law%by_speed%restitution_at(law%restitution, abs(approach)), elastic)
    if (law%rule == normal_rule) then
      after = v + (restitution*abs(approach) - approach)*normal
    else
      after = restitution*(v + (abs(approach) - approach)*normal)
    end if
  end function wall_rebound

end module collisions
