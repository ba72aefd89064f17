!> How many threads a run has: as the input or the environment asks for, as far as they can be had.
module threads
  use kinds, only: int64
  use memory, only: bytes_needed, find_groups, number_after, path_length, room_for_domains
  use parallel_events, only: parallel_events_t
  use parameters, only: most_threads
  use settings, only: settings_t
  use system, only: cores_of_process, startable_threads
  use team, only: make_team
  use texts, only: counted, written
  implicit none
  private
  public :: start_threads, usable_cores

contains

  !> Starts the threads of a run, which then has them until it ends. A run that one core does alone takes none.
  subroutine start_threads(settings, warning)
    type(settings_t), intent(inout) :: settings
    character(len=:), allocatable, intent(out) :: warning  !! of what the user may not have meant; empty if there is nothing
    character(len=:), allocatable :: name
    integer :: wanted, cores
    logical :: roomy
    type(parallel_events_t) :: usual

    call ask(settings%run%threads, name)
    associate (threads => settings%run%threads)
      cores = usable_cores("")
      warning = ""
      if (threads > cores) warning = name//": "//written(threads)//" threads are more than the " &
        //counted(int(cores, int64), "core")//" that the run may use, and slower"
      wanted = min(threads, usual%most_domains(int(settings%n_disks()), settings%box%periodic))
      if (.not. settings%wants_domains()) wanted = 1
      threads = max(wanted, 1)
      roomy = room_for_domains(settings)
      if (wanted > 1 .and. .not. roomy) then
        threads = 1
        warning = name//": there is not enough memory for "//written(wanted)//" threads; the run goes on with one"
      else if (wanted > 1) then
        threads = threads_had(startable_threads(wanted, bytes_needed(settings, .true.)))
        if (threads < wanted) warning = name//": a limit on processes, threads or address space lets only " &
          //written(threads)//" of "//written(wanted)//" threads start; the run goes on with "//written(threads)
      end if
    end associate
    call make_team(settings%run%threads)
  end subroutine start_threads

  !> How many threads are asked for, and where: in the input, or in the environment. Else it is one.
  subroutine ask(threads, name)
    integer, intent(inout) :: threads                      !! in: as in the input; 0: it does not say
    character(len=:), allocatable, intent(out) :: name
    character(len=16) :: value
    integer :: status

    name = "run.threads"
    if (threads > 0) return
    name = "OMP_NUM_THREADS"
    call get_environment_variable(name, value)
    read (value, *, iostat=status) threads
    if (status /= 0 .or. threads < 1) threads = 1
    threads = min(threads, most_threads)
  end subroutine ask

  !> How many threads OpenMP gives of those that are wanted.
  function threads_had(wanted) result(n)
    integer, intent(in) :: wanted
    integer :: n

    n = 0
    !$omp parallel num_threads(wanted) reduction(+:n)
    n = n + 1
    !$omp end parallel
  end function threads_had

  !> How many cores this process may use at a time: by its mask, and by the tightest quota of its control groups.
  function usable_cores(root) result(n)
    character(len=*), intent(in) :: root                   !! empty except in tests
    integer :: n
    character(len=path_length), allocatable :: folders(:)
    character(len=:), allocatable :: both
    integer(int64) :: cores
    integer :: k

    call find_groups(root, "cpu", folders)
    cores = cores_of_process()
    do k = 1, size(folders)
      both = trim(folders(k))//"/cpu.max"                  ! version 2: both numbers in one line
      cores = min(cores, granted(number_after("", both), number_after(written(number_after("", both))//" ", both)), &
        granted(number_after("", trim(folders(k))//"/cpu.cfs_quota_us"), number_after("", trim(folders(k))//"/cpu.cfs_period_us")))
    end do
    n = int(cores)
  end function usable_cores

  !> The cores that keep a control group busy, by the time that it may use of each period; no quota is not above 0, or huge.
  pure function granted(quota, period) result(cores)
    integer(int64), intent(in) :: quota, period            !! of processor time, and of the clock
    integer(int64) :: cores

    cores = huge(cores)
    if (quota > 0 .and. quota < huge(quota) .and. period > 0) cores = (quota - 1)/period + 1
  end function granted

end module threads
