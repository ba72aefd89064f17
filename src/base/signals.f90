!> Signals that stop a run, or make it write a checkpoint. The handler, and the variables that it sets, are in
!> `system_calls.c`.
!>
!> From the first file of a run to its last there is something to lose, and a stop is recorded. The main loop heeds it
!> with a checkpoint; once the loop has ended the file is completed, and the run is a finished one.
module signals
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_int, c_null_char
  use system, only: talks_to_terminal
  implicit none
  private
  public :: watch_signals, end_at_signals, record_signals, stop_requested, checkpoint_requests

  interface
    !> From now on TERM, INT, HUP and XCPU request a stop with a checkpoint, USR1 a checkpoint; signals that the
    !> caller chose to ignore (nohup) stay ignored. A file that grows beyond its limit is a failed write.
    subroutine watch_signals() bind(C, name="system_watch_signals")
    end subroutine watch_signals

    !> Whether a signal has requested a stop.
    function stop_requested() bind(C, name="system_stop_requested") result(yes)
      import :: c_bool
      logical(c_bool) :: yes
    end function stop_requested

    !> How many times USR1 has requested a checkpoint.
    function checkpoint_requests() result(requests) bind(C, name="system_checkpoint_requests")
      import :: c_int
      integer(c_int) :: requests
    end function checkpoint_requests

    !> From now on a signal that requests a stop is only recorded: see `stop_requested`.
    subroutine record_signals() bind(C, name="system_record_signals")
    end subroutine record_signals

    subroutine c_end_at_signals(message, code) bind(C, name="system_end_at_signals")
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: message(*)
      integer(c_int), value :: code
    end subroutine c_end_at_signals
  end interface

contains

  !> From now on a signal that requests a stop, and one that has been recorded, ends the program at once: there is
  !> nothing to lose.
  subroutine end_at_signals(message, code)
    character(len=*), intent(in) :: message
    integer, intent(in) :: code                        !! exit status
    character(len=*), parameter :: erase_line = achar(13)//achar(27)//"[K"

    if (talks_to_terminal()) then
      call c_end_at_signals(erase_line//message//new_line("a")//c_null_char, int(code, c_int))
    else
      call c_end_at_signals(message//new_line("a")//c_null_char, int(code, c_int))
    end if
  end subroutine end_at_signals

end module signals
