!> Sets up a run from an input file: reads and checks the input, creates the initial state, creates the objects that the input
!> selects, and starts the threads. The module `run_setup` is the only module that depends on all kinds of neighbour search and
!> dynamics.
module run_setup
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use evolution, only: evolution_t
  use initial_state, only: create_simulation
  use input_fit, only: check_fit, complete_settings
  use variable_help, only: groups_text
  use input_problems, only: problem_list_t
  use input_settings, only: resolve_settings
  use input_text, only: read_text
  use memory, only: room_for_domains
  use namelist_input, only: read_groups
  use parallel_events, only: parallel_events_t
  use renumbering, only: renumber
  use kinds, only: int64
  use settings, only: run_input_t, settings_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use system, only: cores_of_process, print_text
  use team, only: make_team
  use texts, only: counted, text_t, written
  use time_stepped, only: time_stepped_t
  use variables, only: most_threads
  implicit none
  private
  public :: read_input, input_from_text, resolve_input, new_simulation, choose_evolution, start_threads

contains

  !> Reads the input file `path`, applies the overrides and checks the input. If `printed` is .true., the part of the input that
  !> could be interpreted is printed, even if the input is invalid.
  subroutine read_input(path, overrides, input, error, printed)
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)                        !! overrides in the form GROUP.VARIABLE=VALUE
    type(run_input_t), intent(out) :: input
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: printed
    character(len=:), allocatable :: text

    call read_text(path, text, error)
    if (.not. allocated(error)) call input_from_text(text, path, overrides, input, error, printed)
  end subroutine read_input

  !> Like `read_input`, but for a text instead of a file; the argument `path` is used only in messages. All problems are collected
  !> in one error.
  subroutine input_from_text(text, path, overrides, input, error, printed, stepped)
    character(len=*), intent(in) :: text
    character(len=*), intent(in) :: path
    type(text_t), intent(in) :: overrides(:)
    type(run_input_t), intent(out) :: input
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: printed
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`
    type(problem_list_t) :: problems
    logical :: complete

    input%path = path
    input%text = text
    input%overrides = overrides
    call read_groups(text, overrides, input%groups, problems, complete)
    if (present(printed)) call print_text(groups_text(input%groups), error)
    if (.not. allocated(error)) call resolve_input(input, complete, problems, error, stepped)
  end subroutine input_from_text

  !> Converts the groups of an input to settings. All problems are collected in one error.
  subroutine resolve_input(input, complete, problems, error, stepped)
    type(run_input_t), intent(inout) :: input
    logical, intent(inout) :: complete                              !! .false. if parts of the text could not be read
    type(problem_list_t), intent(inout) :: problems                 !! problems found so far; further problems are added
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: stepped                        !! see `resolve_settings`

    if (complete) then  ! variables in unreadable parts of the text must not be reported as missing
      call resolve_settings(input%groups, input%settings, problems, stepped)
      call complete_settings(input%settings, input%groups, problems, complete)
      if (complete) call check_fit(input%settings, input%groups, problems)
    end if
    call problems%report(input%path, error, input%overrides)
  end subroutine resolve_input

  !> Creates the initial state of a run. The disks are sorted in memory by position, so that neighbours are close in memory.
  subroutine new_simulation(input, line, sim, error, unrelaxed)
    type(run_input_t), intent(inout) :: input
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(out) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: unrelaxed                      !! see `create_simulation`

    call create_simulation(input, line, sim, error, unrelaxed)
    if (.not. allocated(error)) call renumber(sim)
  end subroutine new_simulation

  !> Creates the object of the dynamics (event-driven, parallel or time-stepped) that the input selects, with its neighbour search
  !> and event queue.
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

  !> Starts the threads of a run, which exist until the run ends. A run that uses the serial engine has one thread.
  subroutine start_threads(settings, warning)
    type(settings_t), intent(inout) :: settings
    !> Warning about a probably unintended number of threads; empty if no warning applies.
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

  !> Determines the number of threads from the input or the environment. The default is one thread.
  subroutine ask(threads, name)
    !> Number of threads in the input, or 0 if the input contains no number; the procedure replaces 0 by the number of threads to
    !> use
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
