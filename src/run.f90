!> One run, from the input file to the finished output.
module run
  use, intrinsic :: iso_fortran_env, only: error_unit
  use checkpoint, only: read_checkpoint, write_checkpoint
  use command_line, only: command_t
  use errors, only: error_t, exit_stopped, exit_usage, fail
  use event_log, only: event_log_t
  use evolution, only: evolution_t, limits_t
  use kinds, only: int64, never, real64
  use memory, only: check_memory
  use observables, only: total_energy
  use output, only: output_t
  use parameter_values, only: parameter_group_t
  use progress_line, only: progress_line_t
  use run_setup, only: choose_evolution, new_simulation, read_input
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use system, only: checkpoint_requests, folder_of, is_folder, print_text, seconds, stop_requested, watch_signals
  use texts, only: written
  use time_stepped, only: step_warning
  implicit none
  private
  public :: perform_run

  integer, parameter :: log_capacity = 4096                !! collisions listed between two writes
  real(real64), parameter :: look_around = 0.05_real64     !! time between looks at signals and clocks [s]

contains

  !> Reads the input and runs it; `error` carries the exit status also of a run that was stopped.
  subroutine perform_run(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    type(settings_t) :: settings
    type(parameter_group_t), allocatable :: groups(:)
    character(len=:), allocatable :: input_text
    type(simulation_t) :: sim
    type(output_t) :: output
    class(evolution_t), allocatable :: evolution
    type(stop_rule_t) :: stop_rule
    real(real64) :: started, cpu(2), rate             ! [s], [1/s]
    integer(int64) :: before
    logical :: folder_is_new

    started = seconds()
    input_text = ""
    call watch_signals()
    call read_input(command%input, command%overrides, settings, groups, input_text, error)
    if (.not. allocated(error)) call check_memory(settings%species, error)
    if (allocated(error)) return
    if (command%resume) then
      call read_checkpoint(command%output, settings, groups, sim, output, error)
    else
      call new_simulation(settings, sim, error)
      if (allocated(error)) return
      if (.not. command%quiet) call warn(settings, sim)
      if (command%check) then
        call print_text(command%input//": fine; "//written(int(sim%n_disks()))//" disks", error)
        return
      end if
      folder_is_new = .not. is_folder(folder_of(command%output))
      call output%open(command%output, settings, groups, input_text, command%overrides, sim, command%force, error)
      if (folder_is_new .and. .not. (allocated(error) .or. command%quiet)) write (error_unit, "(a)") &
        "note: "//folder_of(command%output)//" was not there: it is made for the output"
    end if
    if (allocated(error)) return
    call choose_evolution(settings%run, evolution)
    if (settings%output%event_log) evolution%log = event_log_t(log_capacity)
    stop_rule = stop_rule_t(settings%stop, sim)
    before = sim%collisions
    call cpu_time(cpu(1))
    call evolution%start(sim)
    call main_loop(command, settings, groups, sim, evolution, stop_rule, output, started, error)
    call cpu_time(cpu(2))
    rate = (sim%collisions - before)/max(cpu(2) - cpu(1), 1.0e-9_real64)
    if (.not. allocated(error)) call output%finish(sim, seconds() - started, rate, error)
    if (.not. allocated(error)) &
      call print_text(summary(command%output, sim, stop_rule, seconds() - started, rate), error)
    call output%release()
  end subroutine perform_run

  !> Lets the simulation move from one thing that is due to the next, until its end.
  subroutine main_loop(command, settings, groups, sim, evolution, stop_rule, output, started, error)
    type(command_t), intent(in) :: command
    type(settings_t), intent(in) :: settings
    type(parameter_group_t), intent(in) :: groups(:)
    type(simulation_t), intent(inout) :: sim
    class(evolution_t), intent(inout) :: evolution
    type(stop_rule_t), intent(in) :: stop_rule
    type(output_t), intent(inout) :: output
    real(real64), intent(in) :: started               !! [s]
    type(error_t), allocatable, intent(out) :: error
    type(progress_line_t) :: line
    type(limits_t) :: limits
    integer(int64) :: turns
    integer :: requests_served
    real(real64) :: now, looked, next_checkpoint      ! [s]
    real(real64) :: begun                             ! by the clock of the simulation [time]

    turns = 1
    requests_served = 0
    begun = sim%time()
    looked = seconds()
    next_checkpoint = looked + settings%output%checkpoint_every
    call line%start(sim, stop_rule, started, command%quiet)
    do while (.not. is_over(sim, evolution, stop_rule))
      limits = stop_rule%limits
      limits%time = min(limits%time, output%next_time())
      limits%collisions = min(limits%collisions, output%next_collisions())
      limits%events = min(limits%events, output%next_events(), stop_rule%next_look(sim))
      limits%turns = turns
      call evolution%advance(sim, limits, error)
      if (allocated(error)) exit
      call output%write_what_is_due(sim, error)
      if (.not. allocated(error)) call output%write_events(evolution%log, error)
      if (allocated(error)) exit
      now = seconds()
      ! However short the wall clock, each part of a run gets somewhere.
      if (stop_requested() .or. (sim%time() > begun .and. now - started > stop_rule%wall_clock)) then
        call write_checkpoint(command%output, settings, groups, sim, output, error)
        if (.not. allocated(error)) call fail(error, exit_stopped, "stopped at time " &
          //written(sim%time())//", after a checkpoint: the same command with --resume goes on")
        exit
      end if
      if (checkpoint_requests() > requests_served .or. now > next_checkpoint) then
        requests_served = checkpoint_requests()
        call write_checkpoint(command%output, settings, groups, sim, output, error)
        if (allocated(error)) exit
        next_checkpoint = seconds() + settings%output%checkpoint_every     ! after writing, however slow the disk
      end if
      call line%report(sim, stop_rule)
      turns = adapted(turns, now - looked)
      looked = now
    end do
    call line%clear()
  end subroutine main_loop

  !> Whether the run has come to its end: by a rule, because there is nothing but rounding left to follow,
  !> or because nothing will ever happen any more and no rule names a time to wait for.
  pure function is_over(sim, evolution, stop_rule) result(yes)
    type(simulation_t), intent(in) :: sim
    class(evolution_t), intent(in) :: evolution
    type(stop_rule_t), intent(in) :: stop_rule
    logical :: yes

    yes = stop_rule%met(sim) .or. stop_rule%too_cold(sim) .or. &
      (evolution%idle .and. .not. stop_rule%limits%time < never)
  end function is_over

  !> The number of turns that takes about `look_around`.
  pure function adapted(turns, elapsed) result(n)
    integer(int64), intent(in) :: turns
    real(real64), intent(in) :: elapsed               !! for these turns [s]
    integer(int64) :: n

    n = turns
    if (elapsed < 0.5_real64*look_around) n = min(2*turns, 2_int64**40)
    if (elapsed > 2*look_around) n = max(turns/2, 1_int64)
  end function adapted

  !> Says what is legal but seldom meant.
  subroutine warn(settings, sim)
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
    if (settings%run%dynamics == "steps") text = step_warning(sim, settings%run%dt)
    if (text /= "") write (error_unit, "(a)") "warning: "//text
    if (settings%stop%energy_fraction > 0 .and. .not. sim%start_energy > 0) write (error_unit, "(a)") &
      "warning: nothing moves at the start: stop.energy_fraction is met at once"
  end subroutine warn

  !> What the run came to, as lines `key = value`.
  function summary(path, sim, stop_rule, elapsed, rate) result(text)
    character(len=*), intent(in) :: path
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t), intent(in) :: stop_rule
    real(real64), intent(in) :: elapsed               !! wall time of the whole run [s]
    real(real64), intent(in) :: rate                  !! collisions per processor time of the simulation [1/s]
    character(len=:), allocatable :: text
    character(len=1), parameter :: eol = new_line("a")

    text = "output = "//path// &
      eol//"disks = "//written(int(sim%n_disks()))// &
      eol//"collisions = "//written(sim%collisions)// &
      eol//"wall_collisions = "//written(sum(sim%wall_collisions))// &
      eol//"obstacle_collisions = "//written(sim%obstacle_collisions)// &
      eol//"time = "//written(sim%time())// &
      eol//"kinetic_energy = "//written(sim%kinetic_energy())// &
      eol//"total_energy = "//written(total_energy(sim))// &
      eol//"dissipated_energy = "//written(sim%dissipated)// &
      eol//"wall_time = "//written(elapsed)// &
      eol//"collisions_per_second = "//written(rate)
    if (stop_rule%met(sim)) return
    text = text//eol//"note = "
    if (stop_rule%too_cold(sim)) then
      text = text//"cooled to 1e-25 of the first temperature, and beyond that rounding rules"
    else
      text = text//"nothing will ever happen any more"
    end if
    text = text//": the run ended before its stop rule was met"
  end function summary

end module run
