!> What collisions have gathered since the start of the run. Sums are exact: they come out the same in whatever order, and
!> in whatever parts of a simulation, they are gathered.
module tally
  use exact_sums, only: exact_sum_t
  use kinds, only: int64, never, real64
  implicit none
  private
  public :: carried, tally_t

  !> What one term of a sum may amount to, and so how fine it must be: see `simulation_state: choose_units`.
  integer, parameter, public :: energies = 1, impulses = 2, moments = 3, transfers = 4, passages = 5

  type :: sum_t
    character(len=16) :: name
    integer :: kind                                !! energies, ...
  end type sum_t

  !> The sums over collisions, each by its number. Units, checkpoints, domains and their merging go by this list.
  integer, parameter, public :: virial = 1, dissipated = 2, heat = 3, work = 4, drive_energy = 5, stress = 6
  integer, parameter, public :: heat_virial = 10, flights = 12     ! after the four of the stress, the two of heat
  type(sum_t), parameter :: sums(*) = [ &
    sum_t("virial", moments), &                    ! impulse times distance over pair collisions [energy]
    sum_t("dissipated", energies), &               ! kinetic energy lost [energy]
    sum_t("heat", energies), &                     ! given to disks by thermal walls [energy]
    sum_t("work", energies), &                     ! done on disks by what moves them [energy]
    sum_t("drive_energy", energies), &             ! given to disks by kicks [energy]
    sum_t("stress_xx", moments), sum_t("stress_xy", moments), &   ! change of momentum times distance over pairs [energy]
    sum_t("stress_yx", moments), sum_t("stress_yy", moments), &
    sum_t("heat_virial_x", transfers), sum_t("heat_virial_y", transfers), &      ! energy times distance [energy length]
    sum_t("flights_xx", passages), sum_t("flights_xy", passages), sum_t("flights_yy", passages), &   ! see `carried`
    sum_t("flights_x", transfers), sum_t("flights_y", transfers)]

  !> And those at each surface of the box: the impulse given to it [mass length/time], and the energy that disks have gained.
  integer, parameter, public :: impulse = 1, gain = 3

  type :: tally_t
    integer(int64) :: events = 0                   !! collisions of any kind
    integer(int64) :: collisions = 0               !! of pairs
    integer(int64) :: stuck = 0                    !! of these, see `encounters: note_stuck`
    real(real64) :: collapse = never               !! the first moment of a collapse, since the start of the run [time]
    type(exact_sum_t) :: sum(size(sums))
    integer(int64), allocatable :: hits(:)         !! (surfaces) collisions at each
    type(exact_sum_t), allocatable :: at_surface(:, :)     !! (3,surfaces) impulse along x, y; gain
  contains
    procedure :: make_room
    procedure :: choose_units
    procedure :: total
    procedure :: include
    procedure :: clear
  end type tally_t

contains

  !> Makes room for what happens at n surfaces, unless there is.
  pure subroutine make_room(self, n)
    class(tally_t), intent(inout) :: self
    integer, intent(in) :: n

    if (allocated(self%hits)) return
    allocate (self%hits(n), source=0_int64)
    allocate (self%at_surface(gain, n))
  end subroutine make_room

  !> Makes the sums fine enough for terms up to these bounds.
  pure subroutine choose_units(self, bound)
    class(tally_t), intent(inout) :: self
    real(real64), intent(in) :: bound(:)           !! by kind

    call self%sum%choose_unit(bound(sums%kind))
    call self%at_surface(:gain - 1, :)%choose_unit(bound(impulses))
    call self%at_surface(gain, :)%choose_unit(bound(energies))
  end subroutine choose_units

  !> What a disk carries per time while it flies: momentum, xx, xy and yy [energy]; kinetic energy along x and y [energy
  !> length/time]. Over time that is the part of Helfand's moments (Phys. Rev. 119, 1 (1960)) which collisions do not hand on.
  pure function carried(mass, v)
    real(real64), intent(in) :: mass
    real(real64), intent(in) :: v(2)               !! [length/time]
    real(real64) :: carried(5)

    carried = mass*[v(1)*v(1), v(1)*v(2), v(2)*v(2), 0.5_real64*dot_product(v, v)*v]
  end function carried

  !> A sum so far.
  elemental function total(self, k)
    class(tally_t), intent(in) :: self
    integer, intent(in) :: k                       !! number in `sums`
    real(real64) :: total

    total = self%sum(k)%value()
  end function total

  !> Adds what has been gathered elsewhere, in the same units.
  pure subroutine include(self, other)
    class(tally_t), intent(inout) :: self
    type(tally_t), intent(in) :: other

    self%events = self%events + other%events
    self%collisions = self%collisions + other%collisions
    self%stuck = self%stuck + other%stuck
    self%collapse = min(self%collapse, other%collapse)
    call self%sum%include(other%sum)
    self%hits = self%hits + other%hits
    call self%at_surface%include(other%at_surface)
  end subroutine include

  !> Begins anew in the same units.
  pure subroutine clear(self)
    class(tally_t), intent(inout) :: self

    self%events = 0
    self%collisions = 0
    self%stuck = 0
    self%collapse = never
    call self%sum%clear()
    self%hits = 0
    call self%at_surface%clear()
  end subroutine clear

end module tally
