!> When a run ends: the first of the rules in the input that is met.
module stop_rules
  use kinds, only: int64, never, real64
  use evolution, only: limits_t
  use settings, only: stop_settings_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: stop_rule_t

  type :: stop_rule_t
    type(limits_t) :: limits
    real(real64) :: wall_clock = never       !! [s]
  contains
    procedure :: met
    procedure :: share
  end type stop_rule_t

  interface stop_rule_t
    module procedure new_stop_rule
  end interface stop_rule_t

contains

  !> The rules that `settings` asks for, in terms of the state they are compared with.
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
    if (collisions < 9.0e18_real64) rule%limits%collisions = &
      min(rule%limits%collisions, ceiling(collisions, int64))
    if (settings%energy_fraction > 0) rule%limits%dissipated = &
      (1 - settings%energy_fraction)*sim%start_energy
  end function new_stop_rule

  !> Whether the simulation has come to its end, wall clock aside.
  pure function met(self, sim) result(yes)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes
    yes = sim%time() >= self%limits%time .or. sim%collisions >= self%limits%collisions &
      .or. sim%events >= self%limits%events .or. sim%dissipated >= self%limits%dissipated
  end function met

  !> How much of the run is done, from 0 to 1, by the rule that is nearest to its end.
  pure function share(self, sim, elapsed) result(done)
    class(stop_rule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: elapsed      !! by the wall clock [s]
    real(real64) :: done
    done = max(sim%time()/self%limits%time, real(sim%collisions, real64)/self%limits%collisions, &
      real(sim%events, real64)/self%limits%events, sim%dissipated/max(self%limits%dissipated, tiny(done)), &
      elapsed/max(self%wall_clock, tiny(done)))
    done = min(max(done, 0.0_real64), 1.0_real64)
  end function share

end module stop_rules
