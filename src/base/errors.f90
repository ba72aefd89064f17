!> The type `error_t` of error values. An allocated `error_t` indicates a failure. A procedure that fails returns the `error_t` to
!> its caller, and `main` finally prints the message.
module errors
  use texts, only: legible
  implicit none
  private
  public :: error_t, fail
  public :: exit_finished, exit_usage, exit_files, exit_broken, exit_stopped

  integer, parameter :: exit_finished = 0   !! the run reached its stop rule
  integer, parameter :: exit_usage = 2      !! wrong usage, invalid input, or a checkpoint that belongs to another run
  integer, parameter :: exit_files = 3      !! a file cannot be read or written, the disk is full, or the file is in use
  !> The simulation broke off: events no longer advance the time, disks overlap, or a number is NaN.
  integer, parameter :: exit_broken = 4
  integer, parameter :: exit_stopped = 75   !! stopped by a signal or by the wall-clock limit; a checkpoint was written

  !> A failure: its message and the exit status of the program.
  type :: error_t
    character(len=:), allocatable :: message   !! cause, location and remedy of the failure; one line per problem
    integer :: code = exit_usage               !! exit status of the program
  end type error_t

contains

  !> Allocates `error` with an exit status and a message. The message may contain names from the input. Control characters in the
  !> message are therefore replaced, so that the message remains one legible line.
  pure subroutine fail(error, code, message)
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in) :: code                !! one of the `exit_` constants
    character(len=*), intent(in) :: message

    allocate (error)
    error%code = code
    error%message = legible(message)
  end subroutine fail

end module errors
