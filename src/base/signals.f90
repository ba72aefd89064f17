!> Signals that stop a run or request a checkpoint. The signal handler and its variables are in
!> `system_calls.c`.
!>
!> Killing the program while the files of a run are open could lose data. A stop signal during a run
!> is therefore only recorded: the main loop then writes a checkpoint and ends the run. After the
!> main loop a stop signal is ignored, and the program completes the output file.
module signals
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_int, c_null_char
  use system, only: talks_to_terminal
  implicit none
  private
  public :: watch_signals, end_at_signals, record_signals, stop_requested, checkpoint_requests

  interface
    !> Installs the signal handler. TERM, INT, HUP and XCPU request a stop with a checkpoint; USR1
    !> requests a checkpoint. Signals that were already ignored when the program started (by nohup,
    !> for example) remain ignored. XFSZ is ignored. A write beyond the limit of the file size then
    !> fails, but the program is not killed.
    subroutine watch_signals() bind(C, name="system_watch_signals")
    end subroutine watch_signals

    !> True if a signal has requested a stop.
    function stop_requested() bind(C, name="system_stop_requested") result(yes)
      import :: c_bool
      logical(c_bool) :: yes
    end function stop_requested

    !> Number of checkpoint requests (USR1 signals) received so far.
    function checkpoint_requests() result(requests) bind(C, name="system_checkpoint_requests")
      import :: c_int
      integer(c_int) :: requests
    end function checkpoint_requests

    !> From this call on, a stop signal is recorded for `stop_requested` and no longer ends the
    !> program.
    subroutine record_signals() bind(C, name="system_record_signals")
    end subroutine record_signals

    subroutine c_end_at_signals(message, code) bind(C, name="system_end_at_signals")
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: message(*)
      integer(c_int), value :: code
    end subroutine c_end_at_signals
  end interface

contains

  !> From this call on, a stop signal ends the program immediately, with the given message and exit
  !> status. If a stop signal was recorded earlier, this call ends the program. The call precedes
  !> tasks that can be interrupted without losing data.
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
