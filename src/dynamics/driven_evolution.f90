!> Another dynamics, interrupted by kicks. Kick k comes at k times the interval, after all collisions of that moment and
!> before anything else is done at it: so neither samples nor a restart can tell where it was.
module driven_evolution
  use kinds, only: int32
  use errors, only: error_t
  use evolution, only: evolution_t, limits_t
  use kicks, only: kick
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: driven_evolution_t

  type, extends(evolution_t) :: driven_evolution_t
    class(evolution_t), allocatable :: free        !! the dynamics between kicks
  contains
    procedure :: warning
    procedure :: start
    procedure :: advance
  end type driven_evolution_t

contains

  !> That of the dynamics between kicks.
  pure function warning(self, sim) result(text)
    class(driven_evolution_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = self%free%warning(sim)
  end function warning

  !> Prepares the dynamics between kicks. Whatever it finds, something will happen again: the next kick.
  subroutine start(self, sim)
    class(driven_evolution_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    call self%free%start(sim)
  end subroutine start

  !> Moves on to a limit, or through the kicks of the next moment that has any.
  subroutine advance(self, sim, limits, error)
    class(driven_evolution_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(limits_t) :: until_kick
    integer(int32), allocatable :: kicked(:)

    until_kick = limits
    associate (next => self%free%pause_at(sim%drive%time_of(sim%kicks + 1)))
      until_kick%time = min(limits%time, next)
      do
        call self%free%log%take(self%log)
        call self%free%advance(sim, until_kick, error)
        call self%log%take(self%free%log)
        if (allocated(error)) return
        self%arrived = self%free%arrived
        if (limits%reached(sim%tally)) return
        if (self%arrived .or. sim%time() < next) exit
        if (self%log%is_full()) return
        if (stop_requested()) return
      end do
      if (.not. self%arrived .or. limits%time < next) return
      do while (self%free%pause_at(sim%drive%time_of(sim%kicks + 1)) <= next)
        call kick(sim, kicked)
        call self%free%renew(sim, kicked)
      end do
      self%arrived = .not. next < limits%time
    end associate
  end subroutine advance

end module driven_evolution
