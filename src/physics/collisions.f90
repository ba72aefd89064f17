!> Contact laws: the restitution of each pair of species, the contact laws of walls, and the TC model.
module collisions
  use kinds, only: real64
  implicit none
  private
  public :: contact_law_t, normal_rule, pair_impulse, restitution_laws, series_terms, speed_law_t
  public :: tangential_impulse, tangential_law_t, wall_law_t, wall_rebound, wall_rules

  !> Names of the wall rules in the input. With the rule 'velocity' the coefficient of restitution of a wall multiplies both
  !> components of the velocity of the disk, with the rule 'normal' only the normal component. Elsewhere in the program a wall rule
  !> is represented by its position in the list `wall_rules`.
  character(len=*), parameter :: wall_rules = "velocity normal"
  integer, parameter :: normal_rule = 2              !! position of the rule 'normal' in `wall_rules`

  !> Names in the input for the laws by which the coefficient of restitution depends on the impact velocity. For each law,
  !> `series_terms` contains the coefficient c of the series in `speed_law_t`, which is 3/5 for viscoelastic spheres.
  character(len=*), parameter :: restitution_laws = "constant power viscoelastic"
  real(real64), parameter :: series_terms(3) = [0.0_real64, 0.0_real64, 0.6_real64]

  !> Coefficient of restitution that increases towards 1 for small impact velocities (Ramirez, Poschel, Brilliantov and Schwager,
  !> Physical Review E 60, 4465 (1999)). At impact velocities g below a reference velocity g0, the coefficient of restitution is 1 -
  !> y + c y**2 with y = y0 (g/g0)**(1/5). The constant y0 follows from the condition that the coefficient of restitution at the
  !> reference velocity g0 has the value in the input. At all impact velocities above g0 the coefficient of restitution also has the
  !> value in the input.
  type :: speed_law_t
    real(real64) :: speed = 0.0_real64               !! reference impact velocity g0; 0 if the restitution is constant [length/time]
    real(real64) :: c = 0.0_real64                   !! coefficient c of the series 1 - y + c y**2: see `series_terms`
  contains
    procedure :: restitution_at
    procedure :: least
  end type speed_law_t

  !> Tangential interaction of two rough surfaces (Walton 1993, and Luding, Huthmann, McNamara and Zippelius, Physical Review E 57,
  !> 3416 (1998)).
  type :: tangential_law_t
    real(real64) :: restitution = -1.0_real64        !! tangential restitution, from -1 (smooth) to 1
    real(real64) :: friction = huge(1.0_real64)      !! Coulomb friction coefficient; set to huge() if the impulse is not limited
  contains
    procedure :: is_rough
  end type tangential_law_t

  !> The contact law of a wall.
  type :: wall_law_t
    real(real64) :: restitution = 1.0_real64
    integer :: rule = 1                              !! position in `wall_rules`
    type(speed_law_t) :: by_speed = speed_law_t()
    type(tangential_law_t) :: tangential = tangential_law_t()
    real(real64) :: temperature = 0.0_real64         !! kT of a thermal wall; 0 if the wall is not thermal [energy]
    real(real64) :: speed = 0.0_real64               !! tangential velocity of the surface [length/time]
  end type wall_law_t

  !> The contact law of two disks, and the contact duration of all collisions.
  type :: contact_law_t
    real(real64), allocatable :: restitution(:, :)   !! (species,species) coefficient of restitution, symmetric
    type(speed_law_t) :: by_speed = speed_law_t()    !! dependence on the impact velocity
    !> Contact duration t_c of the TC model (Luding and McNamara, Granular Matter 1, 113 (1998)): a collision is elastic if either
    !> partner had its previous collision less than t_c earlier [time]
    real(real64) :: contact_time = 0.0_real64
    type(tangential_law_t) :: tangential = tangential_law_t()  !! tangential interaction of two disks
    real(real64) :: inertia = 0.5_real64             !! moment of inertia divided by mass times radius squared
  contains
    procedure :: loses_energy
    procedure :: can_collapse
  end type contact_law_t

contains

  !> Whether collisions of disks can dissipate energy.
  pure function loses_energy(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = any(self%restitution < 1) .or. self%tangential%is_rough()
  end function loses_energy

  !> Whether an inelastic collapse is possible. The TC model prevents the collapse of smooth disks.
  pure function can_collapse(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%restitution) .and. .not. self%contact_time > 0
    if (yes) yes = any(self%restitution < 1)
  end function can_collapse

  !> Coefficient of restitution at an impact velocity.
  elemental function restitution_at(self, restitution, g) result(xi)
    class(speed_law_t), intent(in) :: self
    real(real64), intent(in) :: restitution          !! coefficient of restitution at the reference velocity g0
    real(real64), intent(in) :: g                    !! normal impact velocity [length/time]
    real(real64) :: xi, y

    xi = restitution
    if (.not. g < self%speed) return
    y = 2*(1 - xi)/(1 + sqrt(max(0.0_real64, 1 - 4*self%c*(1 - xi))))*(g/self%speed)**0.2_real64
    xi = 1 - y + self%c*y**2
  end function restitution_at

  !> Smallest coefficient of restitution in the input with which the series 1 - y + c y**2 decreases at all impact velocities up to
  !> the reference velocity g0. With the smallest coefficient, the series has its minimum exactly at g0.
  elemental function least(self) result(xi)
    class(speed_law_t), intent(in) :: self
    real(real64) :: xi

    xi = 0
    if (self%c > 0) xi = 1 - 1/(4*self%c)
  end function least

  !> Impulse on disk i, as a multiple q of the separation vector dx = x_j - x_i. In the collision v_i changes by q dx/m_i, and v_j
  !> changes by -q dx/m_j. The actual distance of the disks is used instead of the sum of their radii, so that energy is conserved
  !> up to rounding errors.
  pure function pair_impulse(b, distance2, mass_i, mass_j, restitution) result(q)
    real(real64), intent(in) :: b                    !! dx . dv [length**2/time]
    real(real64), intent(in) :: distance2            !! dx . dx [length**2]
    real(real64), intent(in) :: mass_i, mass_j       !! [mass]
    real(real64), intent(in) :: restitution
    real(real64) :: q

    q = (1 + restitution)*b/distance2*(mass_i*mass_j/(mass_i + mass_j))
  end function pair_impulse

  !> Whether the surfaces are rough, so that tangential impulses occur.
  elemental function is_rough(self) result(yes)
    class(tangential_law_t), intent(in) :: self
    logical :: yes

    yes = self%restitution > -1
  end function is_rough

  !> Tangential impulse on a body whose surface slips at a contact. The impulse multiplies the slip velocity by -beta, where beta is
  !> the tangential restitution, unless Coulomb's law limits the impulse.
  pure function tangential_impulse(law, inertia, mass, slip, normal_impulse) result(impulse)
    type(tangential_law_t), intent(in) :: law
    real(real64), intent(in) :: inertia  !! moment of inertia divided by mass times radius squared, equal for both bodies
    real(real64), intent(in) :: mass                 !! reduced mass [mass]
    real(real64), intent(in) :: slip                 !! tangential velocity of the surface at the contact [length/time]
    real(real64), intent(in) :: normal_impulse       !! magnitude of the normal impulse in the collision [mass length/time]
    real(real64) :: impulse

    impulse = -inertia/(1 + inertia)*mass*(1 + law%restitution)*slip
    if (law%friction >= huge(law%friction)) return
    if (abs(impulse) > law%friction*normal_impulse) impulse = sign(law%friction*normal_impulse, impulse)
  end function tangential_impulse

  !> Velocity after a collision with a wall at rest. After the collision the normal velocity always points away from the wall, even
  !> if the disk already moved away from the wall before the collision. A second collision caused by rounding errors therefore
  !> cannot move a disk through the wall.
  pure function wall_rebound(law, v, normal, elastic) result(after)
    type(wall_law_t), intent(in) :: law
    real(real64), intent(in) :: v(2)                 !! [length/time]
    real(real64), intent(in) :: normal(2)            !! unit vector from the wall to the disk
    logical, intent(in) :: elastic                   !! whether the previous contact of the disk still lasts (TC model)
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
