!> Tangential interaction of rough surfaces, with its variables in `&contact`, `&side`, `&obstacle`
!> and `&wall`.
module tangential_law
  use kinds, only: real64
  use variable_rows, only: in_motion, not_negative, tangential, variable_t
  implicit none
  private
  public :: own_tangential_rows, tangential_impulse, tangential_law_t, tangential_rows, wall_tangential_rows

  !> Variables of disk-disk collisions.
  type(variable_t), parameter :: tangential_rows(*) = [ &
    variable_t("contact", "tangential_restitution", "real", 1, "default", "-1", &
      "Coefficient of tangential restitution of disk-disk collisions: -1 for smooth surfaces, 0 if collisions stop the slip, 1 " &
      //"if they reverse it. With values above -1 the disks are rough and rotate. Values between -1 and 1 dissipate energy " &
      //"even in collisions that the TC model (contact_time) makes elastic. With such values, grains resting in a dense " &
      //"bed collapse or collide millions of times; use -1 or 1 for these grains.", &
      tangential, may_change=in_motion), &
    variable_t("contact", "friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of disk-disk collisions: upper limit of the ratio of tangential to normal impulse. Friction " &
      //"needs rough disks (tangential_restitution > -1). Friction dissipates energy even in collisions that the TC model " &
      //"(contact_time) makes elastic. With friction, grains resting in a dense bed collapse or collide millions of times; use " &
      //"tangential_restitution = 1 without friction for these grains.", &
      not_negative, may_change=in_motion, &
      otherwise="the tangential impulse has no limit")]

  !> Variables of all walls in `&contact`.
  type(variable_t), parameter :: wall_tangential_rows(*) = [ &
    variable_t("contact", "wall_tangential_restitution", "real", 1, "optional", "0.5", &
      "Coefficient of tangential restitution of collisions with sides and obstacles: -1 for smooth surfaces, 0 if collisions " &
      //"stop the slip, 1 if they reverse it. A tangential_restitution in &side, &obstacle or &wall overrides this value.", &
      tangential, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.tangential_restitution"), &
    variable_t("contact", "wall_friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of collisions with sides and obstacles, except those with a value of their own (friction in " &
      //"&side, &obstacle or &wall). Friction needs rough boundaries (wall_tangential_restitution > -1).", &
      not_negative, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.friction")]

  !> Variables of a single wall.
  type(variable_t), parameter :: own_tangential_rows(*) = [ &
    variable_t("", "tangential_restitution", "real", 1, "optional", "0.5", &
      "Coefficient of tangential restitution of this boundary: -1 for smooth surfaces, 0 if collisions stop the slip, 1 if " &
      //"they reverse it. With values above -1 the boundary is rough, and the disks rotate.", tangential, goes_with="rule normal", &
      may_change=in_motion, otherwise="contact.wall_tangential_restitution"), &
    variable_t("", "friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of this boundary: upper limit of the ratio of tangential to normal impulse. Friction needs a " &
      //"rough boundary (tangential_restitution > -1).", not_negative, goes_with="rule normal", &
      may_change=in_motion, otherwise="contact.wall_friction")]

  !> Tangential interaction of two rough surfaces (Walton 1993, and Luding, Huthmann, McNamara and
  !> Zippelius, Physical Review E 57, 3416 (1998)).
  type :: tangential_law_t
    real(real64) :: restitution = -1.0_real64        !! tangential restitution, from -1 (smooth) to 1
    !> Coulomb friction coefficient; huge() if the impulse is unlimited.
    real(real64) :: friction = huge(1.0_real64)
  contains
    procedure :: is_rough
  end type tangential_law_t

contains

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

end module tangential_law
