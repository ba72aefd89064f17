!> How many threads a run has: as the input or the environment asks for, as far as they can be had.
module threads
  use kinds, only: int64
  use memory, only: room_for_domains
  use parallel_events, only: parallel_events_t
  use variables, only: most_threads
  use settings, only: settings_t
  use system, only: cores_of_process
  use team, only: make_team
  use texts, only: counted, written
  implicit none
  private
  public :: start_threads

contains

  !> Starts the threads of a run, which then has them until it ends. A run that one core does alone takes none.
  subroutine start_threads(settings, warning)
    type(settings_t), intent(inout) :: settings
    character(len=:), allocatable, intent(out) :: warning  !! of what the user may not have meant; empty if there is nothing
    character(len=:), allocatable :: name
    integer :: cores
    type(parallel_events_t) :: usual

    call ask(settings%run%threads, name)
    warning = ""
    cores = cores_of_process()
    associate (threads => settings%run%threads)
      if (threads > cores) warning = name//": "//written(threads)//" threads are more than the " &
        //counted(int(cores, int64), "core")//" that the run may use, and slower"
      threads = min(threads, usual%most_domains(int(settings%n_disks()), settings%box%periodic))
      if (.not. settings%wants_domains()) threads = 1
      if (threads > 1) then
        if (.not. room_for_domains(settings)) then
          warning = name//": there is not enough memory for "//written(threads)//" threads; the run goes on with one"
          threads = 1
        end if
      end if
      threads = max(threads, 1)
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

end module threads
