!> The contact law: restitution by pair of species and for walls, the wall rules, the TC model.
module collisions
  use kinds, only: int64, real64
  implicit none
  private
  public :: contact_law_t, pair_impulse, still_in_contact, wall_rebound, wall_rules

  !> The rules for walls by their names in the input; a rule is its number in this list.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! a smooth wall

  type :: contact_law_t
    real(real64), allocatable :: restitution(:, :)   !! (s,s) by pair of species, symmetric
    real(real64) :: wall_restitution = 1.0_real64
    integer :: wall_rule = 1                         !! in `wall_rules`
    !> TC model (Luding and McNamara, Granular Matter 1, 113 (1998)): a contact is elastic if a partner
    !> had its last one less than this time ago. [time]
    real(real64) :: contact_time = 0.0_real64
  end type contact_law_t

contains

  !> Whether the last contact of a disk is not over yet, so that the next one is elastic (TC model).
  elemental function still_in_contact(law, collisions, elapsed) result(yes)
    type(contact_law_t), intent(in) :: law
    integer(int64), intent(in) :: collisions         !! of the disk, so far
    real(real64), intent(in) :: elapsed              !! since the last of them [time]
    logical :: yes

    yes = collisions > 0 .and. elapsed < law%contact_time
  end function still_in_contact

  !> Impulse on disk i divided by the separation vector dx = x_j - x_i: v_i grows by q dx/m_i, v_j by
  !> -q dx/m_j. It takes the true distance, not the nominal one: energy is kept to rounding.
  pure function pair_impulse(b, distance2, mass_i, mass_j, restitution) result(q)
    real(real64), intent(in) :: b                    !! dx . dv [length**2/time]
    real(real64), intent(in) :: distance2            !! dx . dx [length**2]
    real(real64), intent(in) :: mass_i, mass_j       !! [mass]
    real(real64), intent(in) :: restitution
    real(real64) :: q

    q = (1 + restitution)*b/distance2*(mass_i*mass_j/(mass_i + mass_j))
  end function pair_impulse

  !> Velocity after contact with a fixed wall. The normal velocity points towards the disk's side whatever
  !> its sign was, so that a double hit by rounding cannot send a disk out.
  pure function wall_rebound(v, normal, restitution, rule) result(after)
    real(real64), intent(in) :: v(2)                 !! [length/time]
    real(real64), intent(in) :: normal(2)            !! unit vector from the wall to the disk
    real(real64), intent(in) :: restitution
    integer, intent(in) :: rule                      !! in `wall_rules`
    real(real64) :: after(2), approach

    approach = v(1)*normal(1) + v(2)*normal(2)
    if (rule == normal_rule) then
      after = v + (restitution*abs(approach) - approach)*normal
    else
      after = restitution*(v + (abs(approach) - approach)*normal)
    end if
  end function wall_rebound

end module collisions
