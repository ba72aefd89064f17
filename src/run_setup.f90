!> Sets up a run: creates the initial state and the objects selected by the input, and starts the
!> threads. Only this module depends on all types of neighbour search and dynamics.
module run_setup
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use evolution, only: evolution_t
  use initial_state, only: create_simulation
  use memory, only: room_for_domains
  use parallel_events, only: parallel_events_t
  use renumbering, only: renumber
  use kinds, only: int64
  use settings, only: run_input_t, settings_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use system, only: cores_of_process
  use team, only: make_team
  use texts, only: counted, written
  use time_stepped, only: time_stepped_t
  use variables, only: most_threads
  implicit none
  private
  public :: new_simulation, choose_evolution, start_threads

contains

  !> Creates the initial state of a run. The disks are sorted so that neighbours in space are close
  !> in memory.
  subroutine new_simulation(input, line, sim, error, unrelaxed)
    type(run_input_t), intent(inout) :: input
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(out) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: unrelaxed                      !! see `create_simulation`

    call create_simulation(input, line, sim, error, unrelaxed)
    if (.not. allocated(error)) call renumber(sim)
  end subroutine new_simulation

  !> Creates the dynamics selected by the input (event-driven, parallel or time-stepped), with its
  !> neighbour search and event queue.
  subroutine choose_evolution(settings, evolution)
    type(settings_t), intent(in) :: settings
    class(evolution_t), allocatable, intent(out) :: evolution
    type(event_driven_t), allocatable :: events
    type(parallel_events_t), allocatable :: parallel
    type(time_stepped_t), allocatable :: steps
    logical :: cuts_space

    cuts_space = settings%wants_domains()
    if (cuts_space) cuts_space = room_for_domains(settings)
    if (settings%run%dynamics == "steps") then
      allocate (steps)
      steps%dt = settings%run%dt
      steps%every_pair = settings%run%search /= "cells"
      call move_alloc(steps, evolution)
    else
      allocate (events)
      allocate (events%search)
      events%search%undivided = settings%run%search /= "cells"
      events%search%everyone = settings%run%search == "rescan"
      events%windowed = settings%run%queue == "calendar"
      if (cuts_space) then
        allocate (parallel)
        parallel%serial = events
        parallel%parts%threads = settings%run%threads
        call move_alloc(parallel, evolution)
      else
        call move_alloc(events, evolution)
      end if
    end if
  end subroutine choose_evolution

  !> Starts the threads, which exist until the run ends. A run on the serial engine has only one
  !> thread.
  subroutine start_threads(settings, warning)
    type(settings_t), intent(inout) :: settings
    !> Warning about a probably unintended number of threads; empty if the number is plausible.
    character(len=:), allocatable, intent(out) :: warning
    character(len=:), allocatable :: name
    integer :: cores
    type(parallel_events_t) :: usual

    call ask(settings%run%threads, name)
    settings%run%threads_asked = settings%run%threads
    warning = ""
    cores = cores_of_process()
    associate (threads => settings%run%threads)
      if (threads > cores) warning = name//": "//written(threads)//" threads are more than the " &
        //counted(int(cores, int64), "core")//" that the run may use; fewer threads would be faster"
      threads = min(threads, usual%most_domains(int(settings%n_disks()), settings%box%periodic))
      if (.not. settings%wants_domains()) threads = 1
      if (threads > 1) then
        if (.not. room_for_domains(settings)) then
          warning = name//": there is not enough memory for "//written(threads)//" threads; the run uses one"
          threads = 1
        end if
      end if
      threads = max(threads, 1)
    end associate
    call make_team(settings%run%threads)
  end subroutine start_threads

  !> Determines the number of threads from the input or the environment; the default is one.
  subroutine ask(threads, name)
    !> On entry, the number of threads in the input, or 0 if it is not set. On return, the number of
    !> threads to be used.
    integer, intent(inout) :: threads
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

end module run_setup
