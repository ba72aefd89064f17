!> Performs one run, from reading the input file to completing the output.
module run
  use, intrinsic :: iso_fortran_env, only: error_unit
  use sampling_schedule, only: progress_t
  use checkpoint, only: read_checkpoint, recall_overrides
  use command_line, only: command_t
  use errors, only: error_t, exit_broken, exit_files, exit_finished, exit_stopped, fail
  use event_log, only: event_log_t
  use evolution, only: evolution_t, limits_t
  use initial_state, only: describe_system
  use memory, only: memory_needed
  use kinds, only: int64, real64
  use observables, only: energies
  use output, only: estimate_size, output_t
  use partners, only: n_sides
  use progress_line, only: progress_line_t
  use rest, only: stays_at_rest
  use run_files, only: is_file, source_of, unfinished
  use run_input, only: read_input
  use run_setup, only: choose_evolution, new_simulation, start_threads
  use settings, only: run_input_t
  use simulation_state, only: simulation_t
  use standstill, only: collapse_note, report_rest
  use stop_rules, only: coldness, stop_rule_t
  use signals, only: checkpoint_requests, end_at_signals, stop_requested, watch_signals
  use system, only: folder_of, is_folder, print_text, seconds
  use tally, only: dissipated, drive_energy
  use texts, only: counted, eol, legible, size_text, written
  use timeline, only: adapted_iterations, advance_once
  implicit none
  private
  public :: perform_run

  integer, parameter :: most_unwritten = 4096              !! capacity of the event log [events]
  !> Size of the output above which the expected size is printed at the start of the run [bytes].
  integer(int64), parameter :: much = 250000000

  type :: run_t
    type(command_t) :: command
    type(run_input_t) :: input
    type(simulation_t) :: sim
    class(evolution_t), allocatable :: evolution
    type(event_log_t), allocatable :: log
    type(stop_rule_t) :: stop_rule
    type(output_t) :: output
    type(progress_line_t) :: line
    real(real64) :: started = 0.0_real64                   !! clock time when the program started [s]
    real(real64) :: rate = 0.0_real64      !! collisions per processor time in this part of the run [1/s]
    real(real64) :: event_rate = 0.0_real64      !! events per processor time in this part of the run [1/s]
    !> Number of events executed by the serial engine in this part of a parallel run.
    integer(int64) :: serial_events = 0
  end type run_t

contains

  !> Reads the input and performs the run. If the run was stopped by a signal or the wall-clock
  !> limit, `error` contains the exit status.
  subroutine perform_run(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    type(run_t) :: run
    character(len=:), allocatable :: warning

    run%started = seconds()
    run%command = command
    call watch_signals()
    call run%line%open(command%quiet)
    call end_at_signals("stopped before the run began; nothing is lost: repeat the command", exit_stopped)
    if (command%resume) call recall_overrides(command%output, run%command%overrides, error)
    if (allocated(error)) return
    call read_input(command%input, run%command%overrides, run%input, error)
    if (allocated(error)) return
    call start_threads(run%input%settings, warning)
    call choose_evolution(run%input%settings, run%evolution)
    if (run%input%settings%output%event_log) run%log = event_log_t(most=most_unwritten)
    if (warning /= "" .and. .not. command%quiet) write (error_unit, "(a)") "warning: "//warning
    if (command%resume) then
      call go_on(run, error)
    else
      call begin(run, error)
    end if
    if (allocated(error) .or. command%check) then
      call run%output%release()
      return
    end if
    run%stop_rule = run%input%settings%stop%applied_to(run%sim)
    call follow(run, error)
    if (.not. allocated(error)) call run%output%finish(run%sim, cost_of(run), note(run), error)
    if (allocated(error)) then
      if (error%code == exit_broken) call run%output%break_off(run%sim, cost_of(run), error%message)
      if (error%code == exit_files) error%message = error%message//"; --resume continues from the last checkpoint"
    else
      call end_at_signals("stopped; the run is finished, only its summary is missing", exit_finished)
      if (run%sim%has_collapsed() .and. .not. command%quiet) write (error_unit, "(a)") "note: "//note(run)
      call print_text(summary(run), error)
    end if
    call run%output%release()
  end subroutine perform_run

  !> Creates the initial state of a new run and opens the output. With --check, only reports that
  !> the input is valid.
  subroutine begin(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    logical :: folder_is_new, over_broken
    integer(int64) :: bytes                                ! minimum size of the output
    character(len=:), allocatable :: size_of_output

    call new_simulation(run%input, run%line, run%sim, error, unrelaxed=run%command%check)
    call run%line%clear()
    if (allocated(error)) return
    call estimate_size(run%input, run%sim, bytes, size_of_output)
    associate (command => run%command)
      if (.not. command%quiet) call warn(run)
      if (command%check) then
        call print_text(legible(command%input)//": valid; "//counted(int(run%sim%n_disks(), int64), "disk")// &
          "; the run needs about "//size_text(memory_needed(run%input%settings))//" of memory, the output " &
          //size_of_output, error)
        return
      end if
      folder_is_new = .not. is_folder(folder_of(command%output))
      call run%output%claim(command%output, error)
      over_broken = is_file(command%output//unfinished)
      if (.not. allocated(error)) call run%output%open(run%input, run%sim, command%force, error)
      if (allocated(error) .or. command%quiet) return
      if (over_broken .and. .not. command%force) write (error_unit, "(a)") "note: "//legible(command%output)//unfinished// &
        ", of a run that broke off, has been replaced"
      if (bytes > much) write (error_unit, "(a)") "note: the output needs "//size_of_output
      if (folder_is_new) write (error_unit, "(a)") &
        "note: folder "//legible(folder_of(command%output))//" has been created for the output"
    end associate
  end subroutine begin

  !> Restores the state of a run and opens the output. With --check, only reports that the run can
  !> be resumed.
  subroutine go_on(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    type(progress_t) :: progress
    type(stop_rule_t) :: rule
    logical :: finished, found

    associate (command => run%command, sim => run%sim)
      call describe_system(run%input%settings, sim)
      found = is_file(source_of(command%output))
      if (.not. found) found = is_file(command%output)     ! another run may have just renamed the output
      if (found .and. .not. command%check) call run%output%claim(command%output, error)
      if (.not. allocated(error)) &
        call read_checkpoint(command%output, run%input, run%evolution, sim, progress, finished, error)
      if (.not. (found .or. allocated(error))) &
        call fail(error, exit_files, command%output//": another run has just created it; repeat the command later")
      ! The file already contains a checkpoint of the present state; writing another one would only
      ! delay the stop.
      if (stop_requested() .and. .not. allocated(error)) &
        call fail(error, exit_stopped, "stopped before the run continued; nothing is lost: repeat the command")
      if (allocated(error)) return
      rule = run%input%settings%stop%applied_to(sim)
      if (finished .and. (rule%is_met(sim) .or. rule%rests(sim))) then
        call fail(error, exit_files, command%output//": is a finished run, of "//written(sim%time())//" time units and " &
          //written(sim%tally%collisions)//" collisions; to continue it, repeat the command with --resume and a later stop rule")
      else if (finished .and. rule%too_cold(sim)) then
        call fail(error, exit_files, command%output//": is a finished run that has "//coldness//": it cannot be continued")
      else if (command%check) then
        call print_text(legible(command%input)//": valid; the run continues from time "//written(sim%time()), error)
      else
        call run%output%resume(run%input, sim, progress, finished, error)
      end if
    end associate
  end subroutine go_on

  !> Warns of settings that are valid but rarely useful.
  subroutine warn(run)
    type(run_t), intent(in) :: run
    character(len=:), allocatable :: text

    text = run%evolution%warning(run%sim)
    if (text /= "") write (error_unit, "(a)") "warning: "//text
    if (run%input%settings%stop%energy_fraction > 0 .and. .not. run%sim%start_energy > 0) then
      write (error_unit, "(a)") "warning: stop.energy_fraction: no disk moves at the start, so that the rule is met at once"
    else if (stays_at_rest(run%sim)) then
      write (error_unit, "(a)") "warning: no events are possible: no disk moves at the start, and nothing sets disks in motion; " &
        //"velocities are set with species.speed, temperature or velocity"
    end if
  end subroutine warn

  !> Advances the simulation to the end of the run and measures the speed of the program.
  subroutine follow(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: collisions, events
    real(real64) :: started, ended                         ! processor time [s]

    collisions = run%sim%tally%collisions
    events = run%sim%tally%events
    call cpu_time(started)
    call run%evolution%start(run%sim)
    call main_loop(run, error)
    call cpu_time(ended)
    associate (duration => max(ended - started, 1.0e-9_real64))
      run%rate = (run%sim%tally%collisions - collisions)/duration
      run%event_rate = (run%sim%tally%events - events)/duration
    end associate
    run%serial_events = run%evolution%serial_events
    deallocate (run%evolution)                             ! the memory may be needed to complete the output
  end subroutine follow

  !> Wall time, rate and number of serial events in this part of the run, as required by `output:
  !> write_end`.
  function cost_of(run) result(cost)
    type(run_t), intent(in) :: run
    real(real64) :: cost(3)

    cost = [seconds() - run%started, run%rate, real(run%serial_events, real64)]
  end function cost_of

  !> Main loop: advances the simulation from one sample, checkpoint or check to the next, until the
  !> run ends.
  subroutine main_loop(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    type(limits_t) :: limits
    integer(int64) :: iterations
    integer :: requests, requests_served
    logical :: stopping
    real(real64) :: now, next_checkpoint              ! [s]
    real(real64) :: first_time      ! simulation time at the start of this part of the run [time]

    iterations = 1
    requests_served = 0
    first_time = run%sim%time()
    next_checkpoint = seconds() + run%input%settings%output%checkpoint_every
    call run%line%start(run%sim, run%stop_rule, run%started)
    limits%time = run%sim%time()
    call run%output%tighten(limits)
    ! If no further event can occur, the run ends with a last sample. If the run is stopped just
    ! after this sample, the resumed run must call `advance_once` to detect its end.
    if (run%sim%events_done .and. limits%sampled >= run%sim%time()) call advance_once(run%evolution, run%sim, limits, error)
    do while (.not. (run%stop_rule%is_over(run%sim, run%evolution) .or. allocated(error)))
      limits = run%stop_rule%limits_t
      limits%iterations = iterations
      call run%output%tighten(limits)
      now = seconds()
      call advance_once(run%evolution, run%sim, limits, error, run%log)
      iterations = adapted_iterations(iterations, seconds() - now, run%evolution%iterations_left > 0)
      if (allocated(run%log)) call run%output%take_events(run%sim, run%log)
      if (allocated(error)) exit
      call run%output%take_due_samples(run%sim, error)
      if (allocated(error)) exit
      now = seconds()
      stopping = stop_requested()
      ! Each part of a run advances the simulation at least once, even if the wall-clock limit is
      ! very short.
      if (run%sim%time() > first_time .and. now - run%started > run%stop_rule%wall_clock) stopping = .true.
      requests = checkpoint_requests()
      if (stopping .or. requests > requests_served .or. now > next_checkpoint) then
        requests_served = requests
        call run%output%save(run%sim, error)
        if (stop_requested()) stopping = .true.            ! a signal may have arrived during `save`
        if (stopping .and. .not. allocated(error)) call fail(error, exit_stopped, "stopped at time "// &
          written(run%sim%time())//", after writing a checkpoint: repeat the command with --resume to continue")
        if (allocated(error)) exit
        ! the interval until the next checkpoint starts at the request
        next_checkpoint = seconds() + run%input%settings%output%checkpoint_every
      end if
      call run%line%report(run%sim, run%stop_rule)
    end do
    call report_rest(run%sim, run%stop_rule%limits_t, error)
    call run%line%clear()
  end subroutine main_loop

  !> Results of the run, as lines `key = value`.
  function summary(run) result(text)
    type(run_t), intent(in) :: run
    character(len=:), allocatable :: text
    real(real64) :: energy(3)      ! translational, rotational and total energy of the disks [energy]

    associate (sim => run%sim)
      energy = energies(sim)
      text = "output = "//legible(run%command%output)// &
        eol//"disks = "//written(int(sim%n_disks()))
      if (allocated(sim%waits)) text = text//eol//"disks_inside = "//written(int(sim%n_inside()))
      text = text// &
        eol//"collisions = "//written(sim%tally%collisions)// &
        eol//"side_collisions = "//written(sum(sim%tally%surface_collisions(:n_sides)))// &
        eol//"obstacle_collisions = "//written(sum(sim%tally%surface_collisions(n_sides + 1:)))// &
        eol//"time = "//written(sim%time())// &
        eol//"kinetic_energy = "//written(energy(1))
      if (sim%features%rotation) text = text//eol//"rotational_energy = "//written(energy(2))
      text = text//eol//"total_energy = "//written(energy(3))// &
        eol//"dissipated_energy = "//written(sim%tally%total(dissipated))// &
        eol//"wall_time = "//written(seconds() - run%started)// &
        eol//"collisions_per_second = "//written(run%rate)
      ! the disk of a billiard collides only with boundaries
      if (sim%tally%collisions == 0) text = text//eol//"events_per_second = "//written(run%event_rate)
      if (run%input%settings%run%threads_asked > 1) text = text//eol//"threads = "//written(run%input%settings%run%threads)
      if (run%input%settings%run%threads > 1) text = text//eol//"events_on_one_core = "//written(run%serial_events)
      if (sim%tally%series(1) > 0) text = text//eol//"simultaneous_collisions = "//written(sim%tally%simultaneous)// &
        eol//"longest_series = "//written(sim%tally%series(1))//" collisions of "//written(sim%tally%series(2))//" disks"
      if (allocated(sim%drive)) text = text//eol//"kicks = "//written(sim%n_kicks)// &
        eol//"drive_energy = "//written(sim%tally%total(drive_energy))
      if (allocated(sim%drive_count)) text = text//eol//sim%kick_counter()//" = "//written(sum(sim%drive_count))
    end associate
    if (note(run) /= "") text = text//eol//"note = "//note(run)
  end function summary

  !> Note about inelastic collapses, and about the end of a run that met no stop rule; empty if
  !> neither applies.
  function note(run) result(text)
    type(run_t), intent(in) :: run
    character(len=:), allocatable :: text

    text = collapse_note(run%sim)
    if (run%stop_rule%is_met(run%sim) .or. run%stop_rule%rests(run%sim)) return
    if (text /= "") text = text//"; "
    if (run%stop_rule%too_cold(run%sim)) then
      text = text//coldness//", below which rounding errors dominate"
    else
      text = text//"no further events are possible"
    end if
    text = text//": the run ended before its stop rule was met"
  end function note

end module run
