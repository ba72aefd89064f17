!> How fast a simulation goes on, from which the length of windows follows.
module pace
  use kinds, only: int64, real64
  implicit none
  private
  public :: pace_t

  !> How fast things happen, as far as it is known.
  type :: pace_t
    real(real64) :: events = 0.0_real64            !! per time; 0: not known yet [1/time]
    real(real64) :: turns = 10.0_real64            !! of engines, per event
  contains
    procedure :: learn
  end type pace_t

contains

  !> Learns from what has happened in a time.
  pure subroutine learn(self, events, turns, time)
    class(pace_t), intent(inout) :: self
    integer(int64), intent(in) :: events, turns
    real(real64), intent(in) :: time               !! [time]

    if (.not. (events > 0 .and. time > 0)) return
    self%events = events/time
    self%turns = max(turns/real(events, real64), 1.0_real64)
  end subroutine learn

end module pace
