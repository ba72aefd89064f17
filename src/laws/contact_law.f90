!> Contact law of disk-disk collisions, with its variables in `&contact`: restitution for each pair
!> of species, and the TC model.
module contact_law
  use kinds, only: int32, real64
  use restitution_law, only: normal_law_t, restitution_law_rows, restitution_law_t
  use tangential_law, only: tangential_law_t, tangential_rows, wall_tangential_rows
  use variable_rows, only: in_motion, moment, not_negative, unit_interval, variable_t
  use wall_law, only: wall_restitution_row, wall_rule_row
  implicit none
  private
  public :: contact_law_t, contact_rows, elastic_contacts, pair_impulse

  type(variable_t), parameter :: restitution_row = &
    variable_t("contact", "restitution", "real", 1, "default", "1", &
      "Coefficient of restitution of disk-disk collisions: 1 is elastic, 0 perfectly inelastic. Collisions reverse the " &
      //"relative velocity along the line of centres and multiply it by this coefficient.", unit_interval, may_change=in_motion)

  type(variable_t), parameter :: contact_time_row = &
    variable_t("contact", "contact_time", "real", 1, "default", "0", &
      "Contact duration t_c of the TC model, which prevents inelastic collapse: a collision is elastic if one of its partners " &
      //"collided less than t_c ago. With t_c = 0 the model is switched off. Choose t_c far below the mean time between " &
      //"collisions and, for grains of diameter d resting under gravity g, below sqrt(d/g). The model does not prevent the " &
      //"collapse of resting grains with friction or with a tangential restitution between -1 and 1, because their tangential " &
      //"motion still loses energy in collisions that the model makes elastic along the normal. The TC model is not available " &
      //"with stop.at_rest.", &
      not_negative, "time", may_change=in_motion)

  type(variable_t), parameter :: inertia_row = &
    variable_t("contact", "inertia", "real", 1, "default", "0.5", &
      "Moment of inertia of a disk in units of mass times radius squared: 0.5 for a uniform disk, 1 for a ring. The value " &
      //"matters only for rotating disks, that is, with rough disks or boundaries, or with initial angular velocities.", &
      moment, may_change=in_motion)

  type(variable_t), parameter :: pair_restitution_row = &
    variable_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      "Symmetric n x n matrix of the coefficients of restitution of n species (1-1, 1-2, ..., 2-1, 2-2, ...), given instead of " &
      //"contact.restitution. The species are in the order of the input file.", &
      unit_interval, &
      may_change=in_motion, otherwise="contact.restitution for all pairs")

  !> All variables of the group `&contact`.
  type(variable_t), parameter :: contact_rows(*) = [restitution_row, wall_restitution_row, restitution_law_rows, wall_rule_row, &
    contact_time_row, tangential_rows, inertia_row, wall_tangential_rows, pair_restitution_row]

  !> Contact law of disk-disk collisions, and contact duration of all collisions.
  type :: contact_law_t
    !> Symmetric matrix of the coefficients of restitution for all pairs of species.
    real(real64), allocatable :: restitution(:, :)
    type(restitution_law_t) :: by_speed = restitution_law_t()    !! dependence on the impact velocity
    !> Contact duration t_c of the TC model (Luding and McNamara, Granular Matter 1, 113 (1998)): a
    !> collision is elastic if either partner had its previous collision less than t_c earlier
    !> [time].
    real(real64) :: contact_time = 0.0_real64
    type(tangential_law_t) :: tangential = tangential_law_t()  !! tangential interaction of two disks
    real(real64) :: inertia = 0.5_real64             !! moment of inertia divided by mass times radius squared
  contains
    procedure :: between
    procedure :: is_inelastic
    procedure :: loses_energy
    procedure :: can_collapse
  end type contact_law_t

contains

  !> Law of elastic, smooth disks of n species.
  pure function elastic_contacts(n) result(law)
    integer, intent(in) :: n
    type(contact_law_t) :: law

    allocate (law%restitution(n, n), source=1.0_real64)
  end function elastic_contacts

  !> Normal contact law of disks of two species.
  elemental function between(self, a, b) result(law)
    class(contact_law_t), intent(in) :: self
    integer(int32), intent(in) :: a, b               !! indices of the species
    type(normal_law_t) :: law

    law = normal_law_t(self%restitution(a, b), self%by_speed)
  end function between

  !> True if the restitution of any pair of species dissipates energy.
  pure function is_inelastic(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = any(self%restitution < 1)
  end function is_inelastic

  !> True if disk-disk collisions can dissipate energy.
  pure function loses_energy(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = self%is_inelastic() .or. self%tangential%is_rough()
  end function loses_energy

  !> True if an inelastic collapse is possible. For smooth disks it is prevented by the TC model,
  !> and by laws with elastic collisions below a reference velocity.
  pure function can_collapse(self) result(yes)
    class(contact_law_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%restitution) .and. .not. (self%contact_time > 0 .or. self%by_speed%has_elastic_range())
    if (yes) yes = self%is_inelastic()
  end function can_collapse

  !> Impulse on disk i, as a multiple q of the separation vector dx = x_j - x_i. The velocity v_i
  !> changes by q dx/m_i, and v_j changes by -q dx/m_j. The actual distance of the disks is used
  !> instead of the sum of their radii, so that elastic collisions conserve energy up to rounding
  !> errors.
  pure function pair_impulse(b, distance2, mass_i, mass_j, restitution) result(q)
    real(real64), intent(in) :: b                    !! dx . dv [length**2/time]
    real(real64), intent(in) :: distance2            !! dx . dx [length**2]
    real(real64), intent(in) :: mass_i, mass_j       !! [mass]
    real(real64), intent(in) :: restitution
    real(real64) :: q

    q = (1 + restitution)*b/distance2*(mass_i*mass_j/(mass_i + mass_j))
  end function pair_impulse

end module contact_law
