!> Errors as values. An allocated `error_t` means failure; callers pass it up, and `main` reports it once.
module errors
  use texts, only: legible
  implicit none
  private
  public :: error_t, fail
  public :: exit_finished, exit_usage, exit_files, exit_broken, exit_stopped

  integer, parameter :: exit_finished = 0   !! the run reached its stop rule
  integer, parameter :: exit_usage = 2      !! wrong usage, bad input, checkpoint of another run
  integer, parameter :: exit_files = 3      !! cannot read or write, disk full, file in use
  integer, parameter :: exit_broken = 4     !! the simulation broke off: stuck clock, overlap, NaN
  integer, parameter :: exit_stopped = 75   !! stopped by a signal or the wall-clock limit, after a checkpoint

  !> What went wrong, and the exit status that follows.
  type :: error_t
    character(len=:), allocatable :: message   !! what, where, and what to do; one line per problem
    integer :: code = exit_usage               !! exit status of the program
  end type error_t

contains

  !> Allocates `error` with a message, made one legible line whatever names it has, and the exit status that goes with it.
  pure subroutine fail(error, code, message)
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in) :: code                !! one of the `exit_` constants
    character(len=*), intent(in) :: message

    allocate (error)
    error%code = code
    error%message = legible(message)
  end subroutine fail

end module errors
