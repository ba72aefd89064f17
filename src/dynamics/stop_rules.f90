!> Determines when a run ends: when one of the stop rules in the input is met, or when rounding errors dominate the velocities of
!> the disks.
!>
!> Inelastic disks in a periodic box cool without end. A run with inelastic disks in a periodic box ends when rounding errors
!> dominate the temperature. The test for a negligible temperature is made at the start of each epoch, so that the end of the run
!> depends on the trajectory alone. The present kinetic energy is compared with the kinetic energy at the time when the velocities
!> were last set, because the earlier energy determines the magnitude of the rounding errors.
module stop_rules
  use kinds, only: int32, int64, never, real64
  use epochs, only: has_come_to_rest, is_at_rest, stands_still
  use evolution, only: evolution_t, limits_t
  use simulation_state, only: simulation_t
  use tally, only: dissipated
  use timeline, only: next_kick
  implicit none
  private
  public :: coldness, stop_rule_t, stop_settings_t, whole_collisions

  real(real64), parameter :: coldest = 1.0e-25_real64        !! temperature at which a run ends, divided by the initial temperature
  character(len=*), parameter :: coldness = "cooled to 1e-25 of the initial temperature"

  !> The values of the stop rules in the input. By default each limit has a value that no simulation reaches.
  type :: stop_settings_t
    real(real64) :: time = never
    integer(int64) :: collisions = huge(0_int64)
    real(real64) :: collisions_per_disk = never
    integer(int64) :: events = huge(0_int64)
    real(real64) :: energy_fraction = 0.0_real64
    logical :: at_rest = .false.                      !! whether the run ends when all disks are at rest
    real(real64) :: wall_clock = never                !! [s]
  end type stop_settings_t

  type :: stop_rule_t
    type(limits_t) :: limits
    real(real64) :: wall_clock = never       !! [s]
    logical :: cools = .false.               !! whether the disks cool without end: inelastic disks in a periodic box
  contains
    procedure :: is_met
    procedure :: rests
    procedure :: too_cold
    procedure :: is_over
    procedure :: share
  end type stop_rule_t

  interface stop_rule_t
    module procedure new_stop_rule
  end interface stop_rule_t

contains

  !> The stop rules of the input, converted to limits on quantities of the simulation.
  pure function new_stop_rule(settings, sim) result(rule)
    type(stop_settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t) :: rule

    rule%limits%time = settings%time
    rule%limits%collisions = min(settings%collisions, &
      whole_collisions(0.5_real64*settings%collisions_per_disk*sim%n_disks()))
    rule%limits%events = settings%events
    rule%limits%at_rest = settings%at_rest
    rule%wall_clock = settings%wall_clock
    if (settings%energy_fraction > 0) rule%limits%dissipated = (1 - settings%energy_fraction)*sim%start_energy
    rule%cools = all(sim%box%periodic) .and. .not. sim%box%has_obstacles() .and. sim%law%loses_energy() &
      .and. .not. sim%is_driven()
  end function new_stop_rule

  !> A real number of collisions, rounded up to an integer. A number of collisions that exceeds an integer only by a few rounding
  !> errors is rounded to this integer. The result is huge(n) if the number exceeds the range of 64-bit integers.
  pure function whole_collisions(number) result(n)
    real(real64), intent(in) :: number
    integer(int64) :: n

    n = huge(n)
    if (number < 9.0e18_real64) n = ceiling(number - 4*spacing(number), int64)
  end function whole_collisions

  !> Whether a stop rule other than the limit of wall-clock time is met.
  pure function is_met(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%has_reached(self%limits%time) .or. self%limits%reached(sim%tally)
    if (yes .or. .not. self%limits%at_rest) return
    yes = has_come_to_rest(sim)
    if (.not. yes) yes = stands_still(sim) .and. is_at_rest(sim)
  end function is_met

  !> Whether the disks are at rest and the input contains the stop rule `at_rest`. The function `rests` is needed in simulations
  !> without gravity, in which disks at rest have no events. Without events no epoch ends, and the test for rest at the end of an
  !> epoch is never made.
  pure function rests(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%limits%at_rest
    if (yes) yes = is_at_rest(sim)
  end function rests

  !> Whether rounding errors dominate the kinetic energy of the motion relative to the mean velocity, at the start of an epoch.
  pure function too_cold(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .false.
    if (self%cools .and. sim%tally%events > 0 .and. sim%tally%events == sim%epoch_events) &
      yes = relative_energy(sim) < coldest*sim%reference_energy
  end function too_cold

  !> Whether a run is finished. A run is finished when a stop rule is met, when rounding errors dominate the velocities of the
  !> disks, or, if the run has no time limit, when no event will occur any more. The function does not test for failures, because
  !> `timeline` and the evolution report failures.
  pure function is_over(self, sim, evolution) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    class(evolution_t), intent(in) :: evolution
    logical :: yes

    yes = self%is_met(sim) .or. self%too_cold(sim)
    if (.not. yes .and. evolution%idle) &
      yes = self%rests(sim) .or. .not. min(self%limits%time, next_kick(evolution, sim)) < never
  end function is_over

  !> Kinetic energy of the motion relative to the mean velocity. The mean velocity is computed first, in a separate pass over the
  !> disks, because a difference of two large sums would lose precision.
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

  !> Completed fraction of the run, from 0 to 1. The result is the largest ratio of a present value to its limit, among all stop
  !> rules of the run.
  pure function share(self, sim, elapsed) result(done)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: elapsed      !! wall-clock time [s]
    real(real64) :: done
    real(real64), parameter :: least = 1/never     ! avoids a division by 0

    done = max(sim%time()/max(self%limits%time, least), &
      real(sim%tally%collisions, real64)/max(self%limits%collisions, 1_int64), &
      real(sim%tally%events, real64)/max(self%limits%events, 1_int64), &
      sim%tally%total(dissipated)/max(self%limits%dissipated, least), elapsed/max(self%wall_clock, least))
    done = min(max(done, 0.0_real64), 1.0_real64)
  end function share

end module stop_rules
