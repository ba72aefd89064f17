!> A list of collisions that waits to be written: the dynamics fills it, the output empties it.
module event_log
  use kinds, only: int32, real64
  implicit none
  private
  public :: event_log_t

  !> The dynamics must pause when the log is full. A log without room asks for nothing: nobody listens.
  type :: event_log_t
    integer :: n = 0                              !! collisions in the list
    real(real64), allocatable :: time(:)          !! since the start of the run [time]
    real(real64), allocatable :: impulse(:)       !! |change of momentum| [mass length/time]
    integer(int32), allocatable :: pair(:, :)     !! (2,:) ids in file order; instead of the second: 0, -1,
                                                  !! -2, -3 left, right, bottom, top side, -4, ... obstacles
  contains
    procedure :: is_on
    procedure :: is_full
    procedure :: append
    procedure :: clear
  end type event_log_t

  interface event_log_t
    module procedure new_event_log
  end interface event_log_t

contains

  pure function new_event_log(capacity) result(log)
    integer, intent(in) :: capacity
    type(event_log_t) :: log

    allocate (log%time(capacity), log%impulse(capacity), log%pair(2, capacity))
  end function new_event_log

  !> Whether collisions are to be listed.
  pure function is_on(self) result(yes)
    class(event_log_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%time)
  end function is_on

  pure function is_full(self) result(yes)
    class(event_log_t), intent(in) :: self
    logical :: yes

    yes = .false.
    if (self%is_on()) yes = self%n >= size(self%time)
  end function is_full

  pure subroutine append(self, time, i, j, impulse)
    class(event_log_t), intent(inout) :: self
    real(real64), intent(in) :: time
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: impulse

    self%n = self%n + 1
    self%time(self%n) = time
    self%pair(:, self%n) = [i, j]
    self%impulse(self%n) = impulse
  end subroutine append

  pure subroutine clear(self)
    class(event_log_t), intent(inout) :: self

    self%n = 0
  end subroutine clear

end module event_log
