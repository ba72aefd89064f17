!> Error values. An allocated `error_t` indicates a failure. A procedure that fails returns it to
!> its caller, and `main` finally prints the message.
module errors
  use texts, only: legible
  implicit none
  private
  public :: error_t, fail
  public :: exit_finished, exit_usage, exit_files, exit_broken, exit_stopped

  integer, parameter :: exit_finished = 0   !! exit status of a run that reached its stop rule
  integer, parameter :: exit_usage = 2      !! exit status after wrong usage, invalid input, or a checkpoint of another run
  integer, parameter :: exit_files = 3      !! exit status if a file cannot be read or written or is in use
  !> Exit status of a simulation that was aborted because events no longer advanced the time, disks
  !> overlapped, or a number became NaN.
  integer, parameter :: exit_broken = 4
  integer, parameter :: exit_stopped = 75   !! exit status of a run stopped by a signal or the wall-clock limit, with a checkpoint

  !> A failure: its message and the exit status of the program.
  type :: error_t
    character(len=:), allocatable :: message   !! cause, location and remedy of the failure; one line per problem
    integer :: code = exit_usage               !! exit status of the program
  end type error_t

contains

  !> Allocates `error` with an exit status and a message. Control characters are replaced, so that
  !> the message remains one legible line even if a name from the input contains some.
  pure subroutine fail(error, code, message)
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in) :: code                !! one of the `exit_` constants
    character(len=*), intent(in) :: message

    allocate (error)
    error%code = code
    error%message = legible(message)
  end subroutine fail

end module errors
