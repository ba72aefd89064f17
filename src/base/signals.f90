!> Signals that stop a run or request a checkpoint. The signal handler and the variables that it sets are in `system_calls.c`.
!>
!> If the program ended suddenly while the files of a run are open, data could be lost. A stop signal that arrives while files are
!> open is therefore only recorded, and the main loop then writes a checkpoint and ends the run. A stop signal that arrives after
!> the end of the main loop has no effect: the program completes the file and finishes the run.
module signals
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_int, c_null_char
  use system, only: talks_to_terminal
  implicit none
  private
  public :: watch_signals, end_at_signals, record_signals, stop_requested, checkpoint_requests

  interface
    !> Installs the signal handler. The signals TERM, INT, HUP and XCPU request a stop with a checkpoint, and the signal USR1
    !> requests a checkpoint. Signals that were ignored when the program was started (for example by nohup) are still ignored. The
    !> signal XFSZ is ignored, so that a write beyond the size limit of files fails without a signal.
    subroutine watch_signals() bind(C, name="system_watch_signals")
    end subroutine watch_signals

    !> Whether a signal has requested a stop.
    function stop_requested() bind(C, name="system_stop_requested") result(yes)
      import :: c_bool
      logical(c_bool) :: yes
    end function stop_requested

    !> Number of signals USR1 received so far; each signal requests a checkpoint.
    function checkpoint_requests() result(requests) bind(C, name="system_checkpoint_requests")
      import :: c_int
      integer(c_int) :: requests
    end function checkpoint_requests

    !> After a call of `record_signals`, a stop signal is only recorded, and does not end the program. The function `stop_requested`
    !> returns whether a signal has been recorded.
    subroutine record_signals() bind(C, name="system_record_signals")
    end subroutine record_signals

    subroutine c_end_at_signals(message, code) bind(C, name="system_end_at_signals")
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: message(*)
      integer(c_int), value :: code
    end subroutine c_end_at_signals
  end interface

contains

  !> After a call of `end_at_signals`, a stop signal ends the program immediately, with the given message and exit status. If a stop
  !> signal has already been recorded, the procedure itself ends the program. The procedure is called before parts of the program
  !> that can be interrupted without a loss of data.
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
