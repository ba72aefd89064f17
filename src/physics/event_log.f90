!> Collisions that have not been written yet: the dynamics appends them, its caller takes them.
module event_log
  use kinds, only: real64
  implicit none
  private
  public :: event_log_t, is_full

  integer, parameter :: record_length = 6, first_room = 1024

  type :: event_log_t
    integer :: most = huge(0)                     !! the dynamics pauses when there are so many
    integer :: n = 0                              !! collisions in the list
    !> (6,n, and room for more) Time since the start of the run, ids i and j in the order of the input, and the change of
    !> momentum of i: its size and its components [mass length/time]. Instead of j the code of a surface: see `partners`.
    real(real64), allocatable :: record(:, :)
  contains
    procedure :: append
  end type event_log_t

contains

  !> Whether there is a log that should be emptied.
  pure function is_full(log) result(yes)
    type(event_log_t), intent(in), optional :: log
    logical :: yes

    yes = .false.
    if (present(log)) yes = log%n >= log%most
  end function is_full

  !> Lists a collision.
  pure subroutine append(self, record)
    class(event_log_t), intent(inout) :: self
    real(real64), intent(in) :: record(record_length)

    if (.not. allocated(self%record)) allocate (self%record(record_length, first_room))
    if (self%n == size(self%record, 2)) self%record = reshape(self%record, [record_length, 2*self%n], pad=[0.0_real64])
    self%n = self%n + 1
    self%record(:, self%n) = record
  end subroutine append

end module event_log
