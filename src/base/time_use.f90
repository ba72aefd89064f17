!> Where the wall clock goes, for whoever makes the program faster: if RICOCHET_TIMES is set, each moment of a run belongs
!> to one of its parts, and the end of the run tells how long each took. Else nothing is measured.
!>
!> The state is the process's own, as its clock is; only the main thread turns from part to part.
module time_use
  use kinds, only: real64
  use system, only: seconds
  implicit none
  private
  public :: begin_time_use, spend_time_on, time_use_report

  integer, parameter, public :: part_start = 1, part_events = 2, part_epochs = 3, part_cuts = 4, part_filling = 5, &
    part_domains = 6, part_verifying = 7, part_gathering = 8, part_merging = 9, part_samples = 10, part_end = 11, &
    part_waiting = 12
  integer, parameter :: n_parts = 12
  character(len=*), parameter :: names(n_parts) = [character(len=38) :: "start: reading, placing, checking", &
    "events, on one core", "* epochs: sorting disks", "* cutting the box", "* filling domains", &
    "* events in domains", "* comparing copies", "* gathering disks", "merging collisions", &
    "samples, checkpoints", "end of the output", "waiting for other threads"]
  character(len=*), parameter :: entry = "(a,f10.3,"" s"",f7.1,"" %"")"
  integer, parameter :: cores(4) = [4, 8, 16, 64]

  logical :: measured = .false.
  integer :: part = part_start
  real(real64) :: since = 0.0_real64               !! when the present part began [s]
  real(real64) :: spent(n_parts) = 0.0_real64      !! on each part [s]

contains

  !> Begins to measure if the user has asked for it.
  subroutine begin_time_use(started)
    real(real64), intent(in) :: started            !! when the run began [s]
    integer :: length

    call get_environment_variable("RICOCHET_TIMES", length=length)
    measured = length > 0
    since = started
  end subroutine begin_time_use

  !> From now on time is spent on another part.
  subroutine spend_time_on(next)
    integer, intent(in) :: next
    real(real64) :: now

    if (.not. measured) return
    now = seconds()
    spent(part) = spent(part) + (now - since)
    since = now
    part = next
  end subroutine spend_time_on

  !> A line for each part that took the main thread any time; and how many times faster than one core more cores can be, if
  !> they share the work of the parts with a star and one of them does the rest, but for waiting (Amdahl, AFIPS Conf. Proc.
  !> 30, 483 (1967)). Empty if nothing was measured.
  function time_use_report(threads) result(text)
    integer, intent(in) :: threads
    character(len=:), allocatable :: text
    character(len=100) :: line
    real(real64) :: alone, shared
    integer :: k

    text = ""
    if (.not. measured) return
    call spend_time_on(part)
    do k = 1, n_parts
      if (spent(k) > 0) call add(names(k), spent(k))
    end do
    if (.not. spent(part_domains) > 0) return
    shared = threads*sum(spent, mask=names(:) (1:1) == "*")
    alone = sum(spent, mask=names(:) (1:1) /= "*") - spent(part_waiting)
    write (line, "(a,*(i0,"": "",f0.2,:,"",  ""))") "cores and the best that they can gain: ", &
      (cores(k), (alone + shared)/(alone + shared/cores(k)), k=1, size(cores))
    text = text//trim(line)
  contains
    !> Adds the line of a part.
    subroutine add(name, time)
      character(len=*), intent(in) :: name
      real(real64), intent(in) :: time             !! [s]

      write (line, entry) [character(len=len(names)) :: name], time, 100*time/sum(spent)
      text = text//trim(line)//new_line("a")
    end subroutine add
  end function time_use_report

end module time_use
