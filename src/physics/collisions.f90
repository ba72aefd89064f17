!> The contact laws: restitution by pair of species, laws of walls, the TC model.
module collisions
  use kinds, only: real64
  implicit none
  private
  public :: contact_law_t, grip_t, normal_rule, pair_impulse, restitution_laws, series_terms, speed_law_t, tangential_impulse
  public :: wall_law_t, wall_rebound, wall_rules

  !> The rules for walls by their names in the input; a rule is its number in this list.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! a smooth wall

  !> How restitution depends on the speed of approach, by names in the input; and the coefficient c of `speed_law_t` for each,
  !> 3/5 in the series of viscoelastic bodies.
  character(len=*), parameter :: restitution_laws = "constant power viscoelastic"
  real(real64), parameter :: series_terms(3) = [0.0_real64, 0.0_real64, 0.6_real64]

  !> Soft contacts lose less (Ramirez, Poschel, Brilliantov and Schwager, Phys. Rev. E 60, 4465 (1999)): below the speed g0 the
  !> restitution is 1 - y + c y**2, y = y0 (g/g0)**(1/5). The law has y0 such that it is that of the input at g0, as it is above.
  type :: speed_law_t
    real(real64) :: speed = 0.0_real64               !! g0 along the normal; 0: constant [length/time]
    real(real64) :: c = 0.0_real64                   !! in `series_terms`
  contains
    procedure :: restitution_at
    procedure :: least
  end type speed_law_t

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
    type(speed_law_t) :: by_speed = speed_law_t()
    type(grip_t) :: grip = grip_t()
    real(real64) :: temperature = 0.0_real64         !! kT of a thermal wall; 0: it is none [energy]
    real(real64) :: speed = 0.0_real64               !! of the surface along the wall [length/time]
  end type wall_law_t

  !> What happens when two disks touch, and when a contact is over.
  type :: contact_law_t
    real(real64), allocatable :: restitution(:, :)   !! (s,s) by pair of species, symmetric
    type(speed_law_t) :: by_speed = speed_law_t()    !! of two disks
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

  !> The restitution of a contact.
  elemental function restitution_at(self, restitution, g) result(xi)
    class(speed_law_t), intent(in) :: self
    real(real64), intent(in) :: restitution          !! at g0
    real(real64), intent(in) :: g                    !! speed of approach along the normal [length/time]
    real(real64) :: xi, y

    xi = restitution
    if (.not. g < self%speed) return
    y = 2*(1 - xi)/(1 + sqrt(max(0.0_real64, 1 - 4*self%c*(1 - xi))))*(g/self%speed)**0.2_real64
    xi = 1 - y + self%c*y**2
  end function restitution_at

  !> The least restitution at g0: there the series ends to fall.
  elemental function least(self) result(xi)
    class(speed_law_t), intent(in) :: self
    real(real64) :: xi

    xi = 0
    if (self%c > 0) xi = 1 - 1/(4*self%c)
  end function least

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

    approach = v(1)*normal(1) + v(2)*normal(2)
    restitution = merge(1.0_real64, law%by_speed%restitution_at(law%restitution, abs(approach)), elastic)
    if (law%rule == normal_rule) then
      after = v + (restitution*abs(approach) - approach)*normal
    else
      after = restitution*(v + (abs(approach) - approach)*normal)
    end if
  end function wall_rebound

end module collisions
