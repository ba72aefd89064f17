!> Event log: collisions that have not been written to the output file yet. The dynamics appends
!> collisions; the caller writes them and empties the log.
module event_log
  use kinds, only: real64
  implicit none
  private
  public :: event_log_t, is_full

  integer, parameter :: record_length = 6, first_room = 1024

  type :: event_log_t
    !> Number of entries at which the dynamics returns to the caller.
    integer :: most = huge(0)
    integer :: n = 0                              !! number of entries
    !> One column per collision: the time since the start of the run [time], the ids of disks i and
    !> j, and the magnitude and the two components of the momentum change of disk i [mass
    !> length/time]. For collisions with walls, the boundary id replaces the id of disk j (see
    !> `partners`). The shape is (6, at least n).
    real(real64), allocatable :: record(:, :)
  contains
    procedure :: append
    procedure :: keep
  end type event_log_t

contains

  !> True if the log is full and has to be emptied; .false. without a log.
  pure function is_full(log) result(yes)
    type(event_log_t), intent(in), optional :: log
    logical :: yes

    yes = .false.
    if (present(log)) yes = log%n >= log%most
  end function is_full

  !> Appends a collision.
  pure subroutine append(self, record)
    class(event_log_t), intent(inout) :: self
    real(real64), intent(in) :: record(record_length)

    if (.not. allocated(self%record)) allocate (self%record(record_length, first_room))
    if (self%n == size(self%record, 2)) self%record = reshape(self%record, [record_length, 2*self%n], pad=[0.0_real64])
    self%n = self%n + 1
    self%record(:, self%n) = record
  end subroutine append

  !> Deletes the oldest entries once the log is twice as long as necessary.
  pure subroutine keep(self, least)
    class(event_log_t), intent(inout) :: self
    integer, intent(in) :: least                    !! number of latest entries to be kept

    if (self%n < 2*least) return
    self%record(:, :least) = self%record(:, self%n - least + 1:self%n)
    self%n = least
  end subroutine keep

end module event_log
