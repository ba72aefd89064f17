!> Determines when a run ends: a stop rule of the input is met, or rounding errors dominate the
!> velocities of the disks.
!>
!> Inelastic disks in a periodic box would cool for ever. Such a run ends when rounding errors
!> dominate the temperature. The test is made at the start of epochs, so that the end of the run
!> depends only on the trajectory. The present kinetic energy is compared with the kinetic energy at
!> the time when the velocities were last set. The latter energy determines the magnitude of the
!> rounding errors.
module stop_rules
  use kinds, only: int32, int64, never, real64
  use entries, only: awaits_entry
  use evolution, only: evolution_t, limits_t
  use rest, only: has_come_to_rest, is_at_rest, stands_still
  use simulation_state, only: simulation_t
  use tally, only: dissipated
  use timeline, only: next_action
  implicit none
  private
  public :: coldness, stop_rule_t, whole_collisions

  !> Temperature at which a run ends, relative to the initial temperature.
  real(real64), parameter :: coldest = 1.0e-25_real64
  character(len=*), parameter :: coldness = "cooled to 1e-25 of the initial temperature"

  !> The stop rules of the input. The default values are never reached.
  type, extends(limits_t) :: stop_rule_t
    real(real64) :: collisions_per_disk = never
    real(real64) :: energy_fraction = 0.0_real64      !! remaining fraction of the initial energy
    real(real64) :: wall_clock = never                !! [s]
  contains
    procedure :: applied_to
    procedure :: is_met
    procedure :: too_cold
    procedure :: is_over
    procedure :: share
  end type stop_rule_t

contains

  !> The stop rules for a simulation, whose number of disks and initial energy determine the limits
  !> on collisions and on the dissipated energy.
  pure function applied_to(self, sim) result(rule)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t) :: rule

    rule = self
    rule%collisions = min(rule%collisions, whole_collisions(0.5_real64*rule%collisions_per_disk*sim%n_disks()))
    if (rule%energy_fraction > 0) rule%dissipated = (1 - rule%energy_fraction)*sim%start_energy
  end function applied_to

  !> A real number of collisions, rounded up to an integer. If the number exceeds an integer only by
  !> rounding errors, it is rounded down. The result is huge(n) if the number exceeds the range of
  !> 64-bit integers.
  pure function whole_collisions(number) result(n)
    real(real64), intent(in) :: number
    integer(int64) :: n

    n = huge(n)
    if (number < 9.0e18_real64) n = ceiling(number - 4*spacing(number), int64)
  end function whole_collisions

  !> True if a stop rule other than the wall-clock limit is met.
  pure function is_met(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%has_reached(self%time) .or. self%reached(sim%tally)
    if (yes .or. .not. self%at_rest .or. awaits_entry(sim)) return
    yes = has_come_to_rest(sim)
    if (.not. yes) yes = stands_still(sim) .and. is_at_rest(sim)
  end function is_met

  !> True if, at the start of an epoch, rounding errors dominate the kinetic energy relative to the
  !> mean velocity. Only a system that would cool for ever, inelastic disks in a periodic box, can
  !> become so cold.
  pure function too_cold(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .false.
    if (.not. (sim%tally%events > 0 .and. sim%tally%events == sim%epoch_events)) return
    if (all(sim%box%periodic) .and. .not. sim%box%has_obstacles() .and. sim%law%loses_energy() .and. .not. sim%is_driven()) &
      yes = relative_energy(sim) < coldest*sim%reference_energy
  end function too_cold

  !> True if a run is finished. A stop rule is met, rounding errors dominate the velocities, or the
  !> run has no time limit and no further event can occur. Failures are reported by `timeline` and
  !> the evolution instead.
  pure function is_over(self, sim, evolution) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    class(evolution_t), intent(in) :: evolution
    logical :: yes

    yes = self%is_met(sim) .or. self%too_cold(sim)
    if (.not. yes .and. evolution%idle) &
      yes = self%rests(sim) .or. .not. min(self%time, next_action(evolution, sim)) < never
  end function is_over

  !> Kinetic energy relative to the mean velocity. The mean velocity is computed in a separate pass
  !> over the disks, because a difference of two large sums would lose precision.
  pure function relative_energy(sim) result(energy)
    type(simulation_t), intent(in) :: sim
    real(real64) :: energy                          !! [energy]
    real(real64) :: drift(2), mass(sim%n_disks())
    integer(int32) :: i

    mass = merge(sim%masses(), 0.0_real64, [(sim%is_inside(i), i=1, sim%n_disks())])
    drift = 0
    do i = 1, sim%n_disks()
      drift = drift + mass(i)*sim%velocity(i)
    end do
    drift = drift/max(sum(mass), tiny(mass))
    energy = 0
    do i = 1, sim%n_disks()
      energy = energy + 0.5_real64*mass(i)*sum((sim%velocity(i) - drift)**2)
    end do
  end function relative_energy

  !> Completed fraction of the run, from 0 to 1. For each stop rule, the present value is divided by
  !> the limit; the result is the maximum of these ratios.
  pure function share(self, sim, elapsed) result(done)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: elapsed      !! wall-clock time [s]
    real(real64) :: done
    real(real64), parameter :: least = 1/never     ! avoids a division by 0

    done = max(sim%time()/max(self%time, least), &
      real(sim%tally%collisions, real64)/max(self%collisions, 1_int64), &
      real(sim%tally%events, real64)/max(self%events, 1_int64), &
      sim%tally%total(dissipated)/max(self%dissipated, least), elapsed/max(self%wall_clock, least))
    done = min(max(done, 0.0_real64), 1.0_real64)
  end function share

end module stop_rules
