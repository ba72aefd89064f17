!> Collisions that have not been written yet: the dynamics appends them, the output empties the list.
module event_log
  use kinds, only: int32, real64
  implicit none
  private
  public :: event_log_t, log_capacity

  integer, parameter :: record_length = 6
  integer, parameter :: log_capacity = 8192     !! collisions, twice what is written at once

  !> A log without records is switched off. The dynamics should pause when it is full.
  type :: event_log_t
    integer :: n = 0                              !! collisions in the list
    !> (6,:) Time since the start of the run, ids i and j in the order of the input, and the change of momentum of i: its
    !> size and its components [mass length/time]. Instead of j: 0, -1, -2, -3 the left, right, bottom, top side, -4, ...
    !> obstacles.
    real(real64), allocatable :: record(:, :)
  contains
    procedure :: is_on
    procedure :: is_full
    procedure :: append
    procedure :: append_record
    procedure :: take
    procedure :: clear
  end type event_log_t

  interface event_log_t
    module procedure new_event_log
  end interface event_log_t

contains

  !> An empty log that is switched on.
  pure function new_event_log(capacity) result(log)
    integer, intent(in) :: capacity
    type(event_log_t) :: log

    allocate (log%record(record_length, capacity))
  end function new_event_log

  !> Whether collisions are to be listed.
  pure function is_on(self) result(yes)
    class(event_log_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%record)
  end function is_on

  !> Whether it is time to empty the list. Half of it is kept free for a time step, which is never split.
  pure function is_full(self) result(yes)
    class(event_log_t), intent(in) :: self
    logical :: yes

    yes = .false.
    if (self%is_on()) yes = 2*self%n >= size(self%record, 2)
  end function is_full

  !> Lists a collision.
  pure subroutine append(self, time, i, j, impulse, change)
    class(event_log_t), intent(inout) :: self
    real(real64), intent(in) :: time
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: impulse, change(2)

    call self%append_record([time, real(i, real64), real(j, real64), impulse, change])
  end subroutine append

  !> Lists a collision from another list. The list grows only if one time step needs more than the free half.
  pure subroutine append_record(self, record)
    class(event_log_t), intent(inout) :: self
    real(real64), intent(in) :: record(record_length)
    real(real64), allocatable :: longer(:, :)

    if (self%n == size(self%record, 2)) then
      allocate (longer(record_length, 2*self%n))
      longer(:, :self%n) = self%record
      call move_alloc(longer, self%record)
    end if
    self%n = self%n + 1
    self%record(:, self%n) = record
  end subroutine append_record

  !> Takes over another log, which is off from then on.
  pure subroutine take(self, other)
    class(event_log_t), intent(inout) :: self
    type(event_log_t), intent(inout) :: other

    self%n = other%n
    other%n = 0
    if (allocated(self%record)) deallocate (self%record)
    if (allocated(other%record)) call move_alloc(other%record, self%record)
  end subroutine take

  !> Empties the list.
  pure subroutine clear(self)
    class(event_log_t), intent(inout) :: self

    self%n = 0
  end subroutine clear

end module event_log
