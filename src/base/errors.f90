!> Error handling. A procedure that fails returns an allocated `error_t` to its caller. The error is
!> passed up to `main`, which prints the message.
module errors
  use texts, only: legible
  implicit none
  private
  public :: error_t, fail
  public :: exit_finished, exit_usage, exit_files, exit_broken, exit_stopped

  integer, parameter :: exit_finished = 0   !! exit status of a run that reached its stop rule
  !> Exit status after wrong usage, invalid input, or an attempt to resume another run's checkpoint.
  integer, parameter :: exit_usage = 2
  integer, parameter :: exit_files = 3      !! exit status if a file is in use or cannot be read or written
  !> Exit status of an aborted simulation: events no longer advanced the time, disks overlapped, or
  !> a number became NaN.
  integer, parameter :: exit_broken = 4
  !> Exit status of a run that wrote a checkpoint and stopped because of a signal or its wall-clock
  !> limit.
  integer, parameter :: exit_stopped = 75

  !> Error message and exit status of the program.
  type :: error_t
    !> Cause, location and remedy, with one line for each problem.
    character(len=:), allocatable :: message
    integer :: code = exit_usage               !! exit status of the program
  end type error_t

contains

  !> Allocates an error with the given exit status and message. Control characters, which a name
  !> from the input may contain, are replaced, so that the message stays legible and on one line.
  pure subroutine fail(error, code, message)
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in) :: code                !! one of the `exit_` constants
    character(len=*), intent(in) :: message

    allocate (error)
    error%code = code
    error%message = legible(message)
  end subroutine fail

end module errors
