!> Counters and sums over all collisions since the start of the run. The sums are exact: they depend
!> neither on the order of their terms nor on the domains in which the terms were added.
module tally
  use exact_sums, only: exact_sum_t
  use kinds, only: int32, int64, never, real64
  use partners, only: n_sides
  implicit none
  private
  public :: kinetic_flux, tally_t

  !> Kinds of terms, by physical dimension. The unit of a sum depends on the kind of its terms (see
  !> `simulation_state: choose_units`).
  integer, parameter, public :: energies = 1, impulses = 2, virials = 3, energy_transfers = 4, momentum_transfers = 5

  type :: sum_t
    character(len=16) :: name
    integer :: kind                                !! kind of the terms of the sum, such as `energies`
  end type sum_t

  !> Indices of the sums over collisions in the list `sums`. This list determines the units of the
  !> sums, and their order in checkpoints and in the exchange between domains.
  integer, parameter, public :: virial = 1, dissipated = 2, heat = 3, work = 4, drive_energy = 5, stress = 6
  ! stress has four components, heat_virial two
  integer, parameter, public :: heat_virial = 10, flux_changes = 12
  type(sum_t), parameter :: sums(*) = [ &
    sum_t("virial", virials), &      ! impulse times distance in disk-disk collisions [energy time]
    sum_t("dissipated", energies), &               ! dissipated kinetic energy [energy]
    sum_t("heat", energies), &                     ! energy transferred to disks by thermal walls [energy]
    sum_t("work", energies), &                     ! work done on disks by moving boundaries [energy]
    sum_t("drive_energy", energies), &             ! energy transferred to disks by kicks [energy]
    ! Sums over disk-disk collisions of momentum change times distance [energy time].
    sum_t("stress_xx", virials), sum_t("stress_xy", virials), sum_t("stress_yx", virials), sum_t("stress_yy", virials), &
    ! Sums over disk-disk collisions of energy transfer times distance [energy length].
    sum_t("heat_virial_x", energy_transfers), sum_t("heat_virial_y", energy_transfers), &
    ! Sums over all changes of `kinetic_flux`: change of the flux times the time of the change
    ! [energy time], [energy length].
    sum_t("flux_xx", momentum_transfers), sum_t("flux_xy", momentum_transfers), sum_t("flux_yy", momentum_transfers), &
    sum_t("flux_x", energy_transfers), sum_t("flux_y", energy_transfers)]

  !> Sums for each surface of the box: the impulse on the surface [mass length/time], and the energy
  !> gained by disks in collisions with it [energy].
  integer, parameter, public :: impulse = 1, gain = 3

  !> Indices of the energies of departing and entering disks in `flow`.
  integer, parameter, public :: outflow = 1, inflow = 2

  !> Maximum number of simultaneous collisions in a finite series, divided by the square of the
  !> number of disks. This maximum applies if the coefficient of restitution is at least 3 % above
  !> the value below which a row of disks collapses. The largest value found is 9.7, in rows of up
  !> to 12 equal touching disks, free or at a wall.
  integer(int64), parameter :: longest_finite = 10

  type :: tally_t
    integer(int64) :: events = 0                   !! number of events
    integer(int64) :: collisions = 0               !! number of disk-disk collisions
    !> Number of collisions in which both disks had already collided earlier at exactly the same
    !> time (see `collapses`).
    integer(int64) :: simultaneous = 0
    !> Numbers of collisions and of disks in the longest series with more collisions than
    !> `longest_finite` allows; 0 if there is none.
    integer(int64) :: series(2) = 0
    !> Time of the first inelastic collapse since the start of the run, known shortly before the
    !> collapse [time].
    real(real64) :: collapse = never
    !> Number of collisions in a domain that only the serial engine can examine.
    integer(int64) :: unexamined = 0
    type(exact_sum_t) :: sum(size(sums))
    integer(int64), allocatable :: surface_collisions(:)  !! number of collisions with each surface
    !> Impulse along x and y, and energy gained by disks, for each surface; shape (3, surfaces).
    type(exact_sum_t), allocatable :: surface_sums(:, :)
    ! Components of open systems.
    integer(int64), allocatable :: inside(:)       !! number of disks of each species in the box
    integer(int64), allocatable :: entered(:)      !! number of disks that entered through each source
    integer(int64) :: left(n_sides) = 0            !! number of disks that left through each side
    type(exact_sum_t) :: flow(inflow)              !! energy of the disks that left and entered [energy]
  contains
    procedure :: make_room
    procedure :: has_at_most
    procedure :: choose_units
    procedure :: total
    procedure :: note_series
    procedure :: include
    procedure :: clear
  end type tally_t

contains

  !> Allocates the sums for n surfaces, unless they are already allocated.
  pure subroutine make_room(self, n)
    class(tally_t), intent(inout) :: self
    integer, intent(in) :: n

    if (allocated(self%surface_collisions)) return
    allocate (self%surface_collisions(n), source=0_int64)
    allocate (self%surface_sums(gain, n))
  end subroutine make_room

  !> True if at most n disks are in the box after at least one disk has left it.
  pure function has_at_most(self, n) result(yes)
    class(tally_t), intent(in) :: self
    integer(int64), intent(in) :: n
    logical :: yes

    yes = any(self%left > 0)
    if (yes) yes = sum(self%inside) <= n
  end function has_at_most

  !> Chooses the units of the sums. All sums of one kind have the same unit, which depends on a
  !> bound for their terms (see `exact_sums: choose_unit`).
  pure subroutine choose_units(self, bound)
    class(tally_t), intent(inout) :: self
    real(real64), intent(in) :: bound(:)           !! bound for the terms of each kind

    call self%sum%choose_unit(bound(sums%kind))
    call self%surface_sums(:gain - 1, :)%choose_unit(bound(impulses))
    call self%surface_sums(gain, :)%choose_unit(bound(energies))
    call self%flow%choose_unit(bound(energies))
  end subroutine choose_units

  !> Fluxes of a disk in free flight: the components xx, xy and yy of the momentum flux [energy],
  !> and the components x and y of the kinetic energy flux [energy length/time]. The time integrals
  !> of these fluxes are the kinetic parts of the Helfand moments (Physical Review 119, 1 (1960)).
  pure function kinetic_flux(mass, v)
    real(real64), intent(in) :: mass
    real(real64), intent(in) :: v(2)               !! [length/time]
    real(real64) :: kinetic_flux(5)

    kinetic_flux = mass*[v(1)*v(1), v(1)*v(2), v(2)*v(2), 0.5_real64*dot_product(v, v)*v]
  end function kinetic_flux

  !> Value of sum k.
  elemental function total(self, k)
    class(tally_t), intent(in) :: self
    integer, intent(in) :: k                       !! index in `sums`
    real(real64) :: total

    total = self%sum(k)%value()
  end function total

  !> Records the numbers of collisions and disks of a series of simultaneous collisions. Only the
  !> longest series is recorded. It must be longer than any finite series in a row of as many equal
  !> disks.
  pure subroutine note_series(self, collisions, disks)
    class(tally_t), intent(inout) :: self
    integer(int64), intent(in) :: collisions
    integer(int32), intent(in) :: disks

    if (collisions > max(longest_finite*int(disks, int64)**2, self%series(1))) self%series = [collisions, int(disks, int64)]
  end subroutine note_series

  !> Adds the counters and sums of another tally with the same units, which belongs to a domain.
  !> Domains do not examine series of simultaneous collisions.
  pure subroutine include(self, other)
    class(tally_t), intent(inout) :: self
    type(tally_t), intent(in) :: other

    self%events = self%events + other%events
    self%collisions = self%collisions + other%collisions
    call self%sum%include(other%sum)
    self%surface_collisions = self%surface_collisions + other%surface_collisions
    call self%surface_sums%include(other%surface_sums)
  end subroutine include

  !> Sets all counters and sums to zero. The units of the sums do not change.
  pure subroutine clear(self)
    class(tally_t), intent(inout) :: self

    self%events = 0
    self%collisions = 0
    self%simultaneous = 0
    self%series = 0
    self%collapse = never
    self%unexamined = 0
    call self%sum%clear()
    self%surface_collisions = 0
    call self%surface_sums%clear()
  end subroutine clear

end module tally
