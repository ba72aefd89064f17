!> When a run ends: when the first of the rules in the input is met, or when rounding errors dominate.
!>
!> In a periodic box inelastic disks cool until they all drift together, with only the common momentum that rounding
!> left. The temperature has lost all its digits long before that, so the run ends when the gas is that cold. This
!> is checked whenever the epoch has moved, so that the end depends on the trajectory alone.
module stop_rules
  use kinds, only: int32, int64, never, real64
  use evolution, only: limits_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: stop_rule_t, stop_settings_t

  real(real64), parameter :: coldest = 1.0e-25_real64        !! temperature over the first one

  !> Rules that are not given are `never` (times), `huge` (counts) or 0 (fraction).
  type :: stop_settings_t
    real(real64) :: time
    integer(int64) :: collisions
    real(real64) :: collisions_per_disk
    integer(int64) :: events
    real(real64) :: energy_fraction
    real(real64) :: wall_clock                        !! [s]
  end type stop_settings_t

  type :: stop_rule_t
    type(limits_t) :: limits
    real(real64) :: wall_clock = never       !! [s]
  contains
    procedure :: met
    procedure :: too_cold
    procedure :: share
  end type stop_rule_t

  interface stop_rule_t
    module procedure new_stop_rule
  end interface stop_rule_t

contains

  !> The rules of the input, in terms of the state they are compared with.
  pure function new_stop_rule(settings, sim) result(rule)
    type(stop_settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t) :: rule
    real(real64) :: collisions

    rule%limits%time = settings%time
    rule%limits%collisions = settings%collisions
    rule%limits%events = settings%events
    rule%wall_clock = settings%wall_clock
    collisions = 0.5_real64*settings%collisions_per_disk*sim%n_disks()
    if (collisions < 9.0e18_real64) rule%limits%collisions = min(rule%limits%collisions, ceiling(collisions, int64))
    if (settings%energy_fraction > 0) rule%limits%dissipated = (1 - settings%energy_fraction)*sim%start_energy
    if (all(sim%box%periodic) .and. sim%box%n_obstacles() == 0 .and. any(sim%law%restitution < 1)) &
      rule%limits%epochs = .true.
  end function new_stop_rule

  !> Whether a rule is met, wall clock aside.
  pure function met(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%time() >= self%limits%time .or. self%limits%reached(sim)
  end function met

  !> Whether the motion relative to the common motion had practically died out when the epoch began.
  pure function too_cold(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .false.
    if (self%limits%epochs .and. sim%events > 0 .and. sim%events == sim%epoch_events) &
      yes = relative_energy(sim) <= coldest*sim%start_energy
  end function too_cold

  !> Kinetic energy relative to the common motion. Two passes, because the difference of two large sums would lose digits.
  pure function relative_energy(sim) result(energy)
    type(simulation_t), intent(in) :: sim
    real(real64) :: energy                          !! [energy]
    real(real64) :: drift(2), mass(sim%n_disks())
    integer(int32) :: i

    mass = sim%masses()
    drift = 0
    do i = 1, sim%n_disks()
      drift = drift + mass(i)*sim%velocity(i)
    end do
    drift = drift/sum(mass)
    energy = 0
    do i = 1, sim%n_disks()
      energy = energy + 0.5_real64*mass(i)*sum((sim%velocity(i) - drift)**2)
    end do
  end function relative_energy

  !> How much of the run is done, from 0 to 1, by the rule that is closest to being met.
  pure function share(self, sim, elapsed) result(done)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: elapsed      !! by the wall clock [s]
    real(real64) :: done
    real(real64), parameter :: least = 1/never     ! a limit may be 0

    done = max(sim%time()/max(self%limits%time, least), real(sim%collisions, real64)/max(self%limits%collisions, 1_int64), &
      real(sim%events, real64)/max(self%limits%events, 1_int64), sim%dissipated%value()/max(self%limits%dissipated, least), &
      elapsed/max(self%wall_clock, least))
    done = min(max(done, 0.0_real64), 1.0_real64)
  end function share

end module stop_rules
