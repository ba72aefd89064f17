!> Progress display on standard error. On a terminal the status line is updated in place; in a file
!> or a pipe a new line is written every 30 seconds.
module status_line
  use, intrinsic :: iso_fortran_env, only: error_unit
  use kinds, only: real64
  use system, only: seconds, talks_to_terminal
  implicit none
  private
  public :: status_line_t

  !> Time between two updates on a terminal and in a file [s].
  real(real64), parameter :: terminal_pause = 0.2_real64, file_pause = 30.0_real64
  character(len=*), parameter :: erase_rest = achar(27)//"[K", &   !! erases the rest of a line
    !> Disables and enables the wrapping of long lines.
    no_wrap = achar(27)//"[?7l", wrap = achar(27)//"[?7h"

  type :: status_line_t
    logical, private :: quiet = .true.
    logical, private :: terminal = .false.
    logical, private :: shown = .false.
    real(real64), private :: pause = file_pause    !! time between two updates of the line [s]
    real(real64), private :: next_update = 0.0_real64    !! clock time of the next update [s]
  contains
    procedure :: open => open_line
    procedure :: is_due
    procedure :: show
    procedure :: show_share
    procedure :: clear
    procedure :: tell
  end type status_line_t

contains

  !> Opens the status line; until then nothing is shown.
  subroutine open_line(self, quiet)
    class(status_line_t), intent(inout) :: self
    logical, intent(in) :: quiet

    self%quiet = quiet
    self%terminal = talks_to_terminal()
    self%pause = merge(terminal_pause, file_pause, self%terminal)
    self%next_update = seconds() + self%pause
  end subroutine open_line

  !> True if the next update of the status line is due.
  function is_due(self) result(yes)
    class(status_line_t), intent(in) :: self
    logical :: yes

    yes = .false.
    if (.not. self%quiet) yes = seconds() >= self%next_update
  end function is_due

  !> Displays a text in the status line.
  subroutine show(self, text)
    class(status_line_t), intent(inout) :: self
    character(len=*), intent(in) :: text

    self%next_update = seconds() + self%pause
    self%shown = .true.
    if (self%terminal) then
      write (error_unit, "(a)", advance="no") achar(13)//no_wrap//text//erase_rest//wrap
    else
      write (error_unit, "(a)") text
    end if
    flush (error_unit)
  end subroutine show

  !> Displays the progress of a task in the status line if an update is due.
  subroutine show_share(self, task, share)
    class(status_line_t), intent(inout) :: self
    character(len=*), intent(in) :: task
    real(real64), intent(in) :: share              !! completed fraction of the task, from 0 to 1
    character(len=8) :: percent

    if (.not. self%is_due()) return
    write (percent, "(f5.1,a)") 100*share, " %"
    call self%show(task//": "//trim(adjustl(percent)))
  end subroutine show_share

  !> Prints a message above the status line, unless the program is quiet.
  subroutine tell(self, message)
    class(status_line_t), intent(inout) :: self
    character(len=*), intent(in) :: message

    if (self%quiet) return
    call self%clear()
    write (error_unit, "(a)") message
    flush (error_unit)
  end subroutine tell

  !> Erases the status line from the terminal before a message is printed.
  subroutine clear(self)
    class(status_line_t), intent(inout) :: self

    if (self%terminal .and. self%shown) write (error_unit, "(a)", advance="no") achar(13)//erase_rest
    self%shown = .false.
    flush (error_unit)
  end subroutine clear

end module status_line
