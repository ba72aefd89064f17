!> Contact law of walls, with its variables in `&side`, `&obstacle` and `&wall`, and in `&contact`.
module wall_law
  use kinds, only: real64
  use restitution_law, only: normal_law_t
  use tangential_law, only: own_tangential_rows, tangential_law_t
  use variable_rows, only: choice_t, in_motion, positive, unit_interval, variable_t, wall_groups
  implicit none
  private
  public :: normal_rule, rule_choices, wall_law_rows, wall_law_t, wall_rebound, wall_restitution_row, wall_rule_row, wall_rules

  !> Names of the wall rules in the input. The coefficient of restitution multiplies both velocity
  !> components of the disk ('velocity') or only the normal component ('normal'). Elsewhere in the
  !> program a rule is represented by its index in this list.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! index of the rule 'normal'
  !> Meanings of the rules. They apply to the variable `rule` of a single wall and to the variable
  !> `wall_rule` of all walls.
  type(choice_t), parameter :: meanings(*) = [ &
    choice_t("", "velocity", "A collision with the boundary multiplies both components of the velocity by the coefficient of " &
      //"restitution, and reverses the normal component. A single disk without gravity follows the same path as in elastic " &
      //"collisions, at decreasing speed."), &
    choice_t("", "normal", "The normal component of the velocity is reversed and multiplied by the coefficient of " &
      //"restitution. The tangential component does not change (smooth wall), unless tangential_restitution makes the wall " &
      //"rough.")]
  character(len=*), parameter :: rule_variables(2) = [character(len=9) :: "rule", "wall_rule"]
  integer :: k, r
  type(choice_t), parameter :: rule_choices(*) = [((choice_t(rule_variables(k), meanings(r)%word, meanings(r)%meaning), &
    r=1, size(meanings)), k=1, size(rule_variables))]

  type(variable_t), parameter :: wall_restitution_row = &
    variable_t("contact", "wall_restitution", "real", 1, "optional", "1", &
      "Coefficient of restitution of collisions with sides and obstacles, except thermal boundaries and boundaries with a " &
      //"coefficient of their own (restitution in &side, &obstacle or &wall).", &
      unit_interval, may_change=in_motion, &
      otherwise="contact.restitution")

  type(variable_t), parameter :: wall_rule_row = &
    variable_t("contact", "wall_rule", "text", 1, "default", "'velocity'", &
      "Collision rule of sides and obstacles, except thermal boundaries and boundaries with a rule of their own (rule in " &
      //"&side, &obstacle or &wall).", choices=wall_rules, may_change=in_motion)

  !> Variables that the groups `&side`, `&obstacle` and `&wall` have in common.
  type(variable_t), parameter :: law_rows(*) = [ &
    variable_t("", "restitution", "real", 1, "optional", "0.9", &
      "Coefficient of restitution of disks colliding with this boundary: 1 is elastic, 0 perfectly inelastic. The collision rule " &
      //"(rule) determines whether the coefficient applies to both components of the velocity or only to the normal component. " &
      //"This variable is not available for a thermal boundary (temperature).", unit_interval, &
      may_change=in_motion, otherwise="contact.wall_restitution"), &
    variable_t("", "rule", "text", 1, "optional", "'normal'", &
      "Collision rule of this boundary. This variable is not available for a thermal boundary (temperature).", choices=wall_rules, &
      may_change=in_motion, otherwise="contact.wall_rule"), &
    own_tangential_rows, &
    variable_t("", "temperature", "real", 1, "optional", "1", &
      "Temperature kT of a thermal boundary. Disks leave a thermal boundary with random velocities, as if they came from a gas " &
      //"at this temperature. A thermal boundary can slide (surface_velocity), but has no restitution and cannot move.", &
      positive, "energy", excludes="restitution rule tangential_restitution friction motion", may_change=in_motion, &
      otherwise="none; the boundary is not thermal"), &
    variable_t("", "surface_velocity", "real", 1, "fallback", "0", &
      "Tangential velocity of the surface, as of a conveyor belt; the boundary itself stays in place. Positive velocities " &
      //"point along +x on the bottom and top side, along +y on the left and right side, from the first to the second point " &
      //"of a wall, and counter-clockwise on a circle or an arc. Values other than 0 need a thermal (temperature) or rough " &
      //"boundary (tangential_restitution > -1).", unit="length/time", may_change=in_motion)]

  integer :: g
  type(variable_t), parameter :: wall_law_rows(*) = [((variable_t(wall_groups(g), law_rows(r)%name, law_rows(r)%kind, &
    law_rows(r)%size, law_rows(r)%status, law_rows(r)%value, law_rows(r)%help, law_rows(r)%range, law_rows(r)%unit, &
    law_rows(r)%choices, law_rows(r)%goes_with, law_rows(r)%excludes, law_rows(r)%may_change, law_rows(r)%otherwise), &
    r=1, size(law_rows)), g=1, size(wall_groups))]

  !> Contact law of a wall.
  type, extends(normal_law_t) :: wall_law_t
    integer :: rule = 1                              !! index of the rule in `wall_rules`
    type(tangential_law_t) :: tangential = tangential_law_t()
    real(real64) :: temperature = 0.0_real64         !! kT of a thermal wall; 0 for other walls [energy]
    real(real64) :: speed = 0.0_real64               !! tangential velocity of the surface [length/time]
  contains
    procedure :: stops_disks
  end type wall_law_t

contains

  !> True if collisions are perfectly inelastic, so that disks do not rebound.
  elemental function stops_disks(self) result(yes)
    class(wall_law_t), intent(in) :: self
    logical :: yes

    yes = self%restitution <= 0
  end function stops_disks

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
    restitution = merge(1.0_real64, law%coefficient_at(abs(approach)), elastic)
    if (law%rule == normal_rule) then
      after = v + (restitution*abs(approach) - approach)*normal
    else
      after = restitution*(v + (abs(approach) - approach)*normal)
    end if
  end function wall_rebound

end module wall_law
