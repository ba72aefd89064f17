!> The contact laws: restitution by pair of species, laws of walls, the TC model.
module collisions
  use kinds, only: real64
  implicit none
  private
  public :: contact_law_t, grip_t, normal_rule, pair_impulse, tangential_impulse
  public :: wall_law_t, wall_rebound, wall_rules

  !> The rules for walls by their names in the input; a rule is its number in this list.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! a smooth wall

  !> How two rough surfaces act on each other along their tangent (Walton 1993; Luding, Huthmann, McNamara and Zippelius,
  !> Phys. Rev. E 57, 3416 (1998)).
  type :: grip_t
    real(real64) :: restitution = -1.0_real64        !! of the tangential velocity, from -1 (smooth) to 1
    real(real64) :: friction = huge(1.0_real64)      !! Coulomb's coefficient; huge: no limit
  contains
    procedure :: is_rough
  end type grip_t

  !> What happens at a wall; each may have a law of its own.
  type :: wall_law_t
    real(real64) :: restitution = 1.0_real64
    integer :: rule = 1                              !! in `wall_rules`
    type(grip_t) :: grip = grip_t()
    real(real64) :: temperature = 0.0_real64         !! kT of a thermal wall; 0: it is none [energy]
    real(real64) :: speed = 0.0_real64               !! of the surface along the wall [length/time]
  end type wall_law_t

  !> What happens when two disks touch, and when a contact is over.
  type :: contact_law_t
    real(real64), allocatable :: restitution(:, :)   !! (s,s) by pair of species, symmetric
    !> TC model (Luding and McNamara, Granular Matter 1, 113 (1998)): a contact is elastic if a partner
    !> had its last one less than this time ago. [time]
    real(real64) :: contact_time = 0.0_real64
    type(grip_t) :: grip = grip_t()                  !! of two disks
    real(real64) :: inertia = 0.5_real64             !! moment of inertia over mass times radius squared
  contains
    procedure :: loses_energy
  end type contact_law_t

contains

  !> Whether contacts of disks can cost energy.
  pure function loses_energy(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = any(self%restitution < 1) .or. self%grip%is_rough()
  end function loses_energy

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

  !> Whether the grip can change anything.
  elemental function is_rough(self) result(yes)
    class(grip_t), intent(in) :: self
    logical :: yes

    yes = self%restitution > -1
  end function is_rough

  !> Impulse along the tangent on a body of a reduced mass whose surface slips: it changes the slip to -beta times what it
  !> was, unless Coulomb's law limits the force.
  pure function tangential_impulse(law, inertia, mass, slip, normal_impulse) result(impulse)
    type(grip_t), intent(in) :: law
    real(real64), intent(in) :: inertia              !! over mass times radius squared, of both bodies
    real(real64), intent(in) :: mass                 !! reduced [mass]
    real(real64), intent(in) :: slip                 !! velocity of the surface along the tangent [length/time]
    real(real64), intent(in) :: normal_impulse       !! of the same contact, not negative [mass length/time]
    real(real64) :: impulse

    impulse = -inertia/(1 + inertia)*mass*(1 + law%restitution)*slip
    if (law%friction >= huge(law%friction)) return
    if (abs(impulse) > law%friction*normal_impulse) impulse = sign(law%friction*normal_impulse, impulse)
  end function tangential_impulse

  !> Velocity after contact with a fixed wall. The normal velocity points towards the disk's side whatever
  !> its sign was, so that a double hit by rounding cannot send a disk out.
  pure function wall_rebound(law, v, normal, elastic) result(after)
    type(wall_law_t), intent(in) :: law
    real(real64), intent(in) :: v(2)                 !! [length/time]
    real(real64), intent(in) :: normal(2)            !! unit vector from the wall to the disk
    logical, intent(in) :: elastic                   !! the last contact is not over yet
    real(real64) :: after(2), approach, restitution

    restitution = merge(1.0_real64, law%restitution, elastic)
    approach = v(1)*normal(1) + v(2)*normal(2)
    if (law%rule == normal_rule) then
      after = v + (restitution*abs(approach) - approach)*normal
    else
      after = restitution*(v + (abs(approach) - approach)*normal)
    end if
  end function wall_rebound

end module collisions
