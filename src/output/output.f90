!> The output of a run: when something is written, and the life of its files. During the run the file is
!> OUT.h5.part, and a lock file keeps other runs away; the name OUT.h5 means that the run is finished.
module output
  use kinds, only: int64, real64
  use errors, only: error_t, exit_files, fail
  use checkpoint, only: make_checkpoints, put_checkpoint
  use event_log, only: event_log_t
  use evolution, only: limits_t
  use h5md_file, only: event_track, frame_track, h5md_file_t, n_tracks, observable_track
  use h5md_layout, only: checkpoint_group, event_counter, frame_counter, sample_counter
  use hdf5_objects, only: hdf5_file_t
  use observables, only: observed
  use progress, only: progress_t
  use run_description, only: describe_end, describe_run, describes
  use run_files, only: check_places, check_start, is_file, lock, remove_temporaries, take_final_name, unfinished, unfinished_new
  use settings, only: run_input_t
  use samples, only: check_counts, event_series, frame_sample, frame_series, observable_sample, observable_series
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use signals, only: record_signals
  use system, only: free_bytes, is_folder, last_problem, lock_t, make_folders_of, remove_file, seconds, synchronize
  use texts, only: written
  implicit none
  private
  public :: output_t, planned_bytes

  real(real64), parameter :: longest_wait = 0.05_real64  !! of a sample before it is written [s]

  type :: output_t
    type(progress_t) :: progress
    real(real64), private :: opened = 0.0_real64  !! by the clock of `seconds` [s]
    character(len=:), allocatable :: path         !! of the finished file
    type(run_input_t) :: input                    !! described in the file
    type(h5md_file_t), private :: h5md
    type(lock_t), private :: lock
    logical, private :: replaces = .false.        !! a finished file that was there when the run began or went on
  contains
    procedure :: open => open_output
    procedure :: resume
    procedure :: tighten
    procedure :: write_what_is_due
    procedure :: write_events
    procedure :: finish
    procedure :: break_off
    procedure :: save
    procedure :: release
    procedure, private :: claim, plan, create_file, append, rebuild, write_end, write_frame, write_observables
  end type output_t

contains

  !> Opens the output of a new run and writes the first samples.
  subroutine open_output(self, path, input, sim, force, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path          !! of the finished file
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim
    logical, intent(in) :: force                  !! replace, at the end, a finished file
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: capacities(n_tracks), planned

    call self%claim(path, error)
    if (allocated(error)) return
    self%progress = progress_t(input%settings)
    if (.not. force) call check_start(path, error)
    if (.not. allocated(error)) then
      call self%plan(input, sim, capacities)
      planned = planned_bytes(input, sim)
      if (planned > free_bytes(path)) call fail(error, exit_files, path//": the output will have "//written(planned) &
        //" bytes, "//written(free_bytes(path))//" are free; choose fewer frames or make room")
    end if
    if (.not. allocated(error)) then
      call remove_file(path//unfinished)
      call self%create_file(self%h5md%file, sim)
      call self%h5md%make_tracks(capacities)
      call self%write_frame(sim)
      call self%write_observables(sim)
      call self%h5md%write_buffers()
      call make_checkpoints(self%h5md%file, input%groups, sim, self%progress)
      call self%h5md%file%rename()
      call self%h5md%file%report(error)
      call remove_file(path//unfinished_new)     ! still there only after a failure, and useless
    end if
    if (allocated(error)) call self%release()
  end subroutine open_output

  !> Opens the output of a run that goes on, and goes back to where its checkpoint stands. That of a finished run stays as
  !> it is until the longer one has finished. The file must describe the input of now.
  subroutine resume(self, path, input, sim, progress, finished, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(in) :: progress
    logical, intent(in) :: finished
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: source
    integer(int64) :: capacities(n_tracks)

    source = path//unfinished
    if (finished) source = path
    call self%claim(path, error)
    if (allocated(error)) return
    self%progress = progress
    call self%plan(input, sim, capacities)
    call self%h5md%file%open(source, writable=.not. finished)
    call self%h5md%resume_tracks(progress%counts())
    if (.not. describes(self%h5md%file, input) .or. finished) then
      call self%rebuild(max(self%h5md%capacities(capacities), progress%counts()), sim)
    else
      call self%h5md%commit()
    end if
    call self%h5md%file%report(error)
    if (allocated(error)) call self%release()
  end subroutine resume

  !> Makes the folders, takes the lock that keeps other runs from this output, and looks at what else is there.
  subroutine claim(self, path, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    logical :: made

    call record_signals()                         ! from here on there is something to lose
    self%path = path
    self%replaces = is_file(path)
    self%opened = seconds()
    call make_folders_of(path, made)
    if (.not. made) then
      call fail(error, exit_files, path//": cannot make its folder: "//last_problem())
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder; the output must be a file")
    else
      call self%lock%acquire(path//lock, problem)
      if (problem /= "") call fail(error, exit_files, path//": "//problem)
    end if
    if (allocated(error)) return
    call check_places(path, error)
    if (.not. allocated(error)) call remove_temporaries(path)
    if (allocated(error)) call self%release()
  end subroutine claim

  !> Sets up the tracks, and says how many samples of each are planned.
  subroutine plan(self, input, sim, capacities)
    class(output_t), intent(inout) :: self
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(out) :: capacities(n_tracks)      !! 0: unknown
    type(stop_rule_t) :: rule

    self%input = input
    associate (track => self%h5md%track, settings => input%settings%output)
      track(frame_track)%counter = frame_counter
      track(frame_track)%series = frame_series(sim, settings%single_precision)
      track(observable_track)%counter = sample_counter
      track(observable_track)%series = observable_series(observed(sim))
      track(event_track)%counter = event_counter
      if (settings%event_log) track(event_track)%series = event_series(input%settings%law%detailed)
    end associate
    rule = stop_rule_t(input%settings%stop, sim)
    capacities = [self%progress%frames%planned(rule%limits), self%progress%observables%planned(rule%limits), 0_int64]
  end subroutine plan

  !> Bytes that the output of a run needs at least: where the number of samples is unknown the first and the last count.
  function planned_bytes(input, sim) result(bytes)
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    integer(int64) :: bytes, capacities(n_tracks)
    real(real64), parameter :: constants = 200.0_real64   !! per disk: id, species, mass, radius, two checkpoints [bytes]
    type(output_t) :: output

    output%progress = progress_t(input%settings)
    call output%plan(input, sim, capacities)
    bytes = int(min(9.0e18_real64, constants*sim%n_disks() &
      + sum(real(max(capacities, 2_int64), real64)*real(output%h5md%track%room(), real64))), int64)
  end function planned_bytes

  !> Creates a file under a temporary name, with everything but the tracks and the checkpoints.
  subroutine create_file(self, file, sim)
    class(output_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim

    call file%create(self%path//unfinished_new, final_path=self%path//unfinished)
    call describe_run(file, self%input, sim)
  end subroutine create_file

  !> Lowers the limits so that the simulation pauses at the next sample.
  pure subroutine tighten(self, limits)
    class(output_t), intent(in) :: self
    type(limits_t), intent(inout) :: limits

    call self%progress%frames%tighten(limits)
    call self%progress%observables%tighten(limits)
  end subroutine tighten

  !> Writes the samples that are due; to be called whenever the simulation pauses.
  subroutine write_what_is_due(self, sim, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical :: due(2)

    due = [self%progress%frames%is_due(sim), self%progress%observables%is_due(sim)]
    if (any(due)) call check_counts(sim, error)
    if (allocated(error)) return
    if (due(1)) call self%write_frame(sim)
    if (due(2)) call self%write_observables(sim)
    call self%h5md%write_buffers(longest_wait)
    call self%h5md%file%report(error)
  end subroutine write_what_is_due

  !> Writes one frame.
  subroutine write_frame(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    call self%append(frame_track, frame_sample(sim, self%progress%frames%count), sim)
    call self%progress%frames%take(sim)
  end subroutine write_frame

  !> Writes one sample of the observables.
  subroutine write_observables(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    call self%append(observable_track, observable_sample(sim, self%progress%observables%count), sim)
    call self%progress%observables%take(sim)
  end subroutine write_observables

  !> Takes over the collisions that the log holds, and empties it; `write_what_is_due` tells of a failure.
  subroutine write_events(self, sim, log)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(event_log_t), intent(inout) :: log

    if (log%n == 0) return
    call self%append(event_track, log%record(:sum(self%h5md%track(event_track)%series%width()), :log%n), sim)
    self%progress%events = self%progress%events + log%n
    call log%clear()
  end subroutine write_events

  !> Appends samples to a track, in a larger file if there is no room for them in this one.
  subroutine append(self, track, samples, sim)
    class(output_t), intent(inout) :: self
    integer, intent(in) :: track
    real(real64), intent(in) :: samples(:, :)     !! (width,count)
    type(simulation_t), intent(inout) :: sim
    integer(int64) :: capacities(n_tracks)

    capacities = self%h5md%track%capacity
    capacities(track) = self%h5md%track(track)%enlarged(size(samples, 2, int64))
    if (any(capacities > self%h5md%track%capacity)) call self%rebuild(capacities, sim)
    call self%h5md%track(track)%append(self%h5md%file, samples)
  end subroutine append

  !> Replaces the file by one with other capacities.
  subroutine rebuild(self, capacities, sim)
    class(output_t), intent(inout) :: self
    integer(int64), intent(in) :: capacities(n_tracks)
    type(simulation_t), intent(inout) :: sim
    type(h5md_file_t) :: new
    integer(int64) :: needed

    call self%h5md%write_buffers()
    needed = sum(self%h5md%track%appended*self%h5md%track%room())
    if (needed > free_bytes(self%path)) then
      self%h5md%file%unsaved = needed
      call self%h5md%file%check(-1, "be copied to a file of the right size")
    end if
    if (allocated(self%h5md%file%failure)) return
    call self%create_file(new%file, sim)
    call new%file%copy_group(checkpoint_group, self%h5md%file)
    call self%h5md%replace_by(new, capacities)
  end subroutine rebuild

  !> Makes a checkpoint of this moment.
  subroutine save(self, sim, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim      !! stays as it is
    type(error_t), allocatable, intent(out) :: error
    type(progress_t) :: progress
    logical :: done

    progress = self%progress
    progress%spent = progress%spent + seconds() - self%opened
    call self%h5md%write_buffers()
    call synchronize(self%h5md%file%path, done)
    if (.not. done) call self%h5md%file%check(-1, "be written: "//last_problem())
    call put_checkpoint(self%h5md%file, sim, progress)
    call self%h5md%file%report(error)
  end subroutine save

  !> Ends the output of a finished run: a check of the file, its final name. If that fails, a checkpoint written
  !> afterwards leads back to the moment before.
  subroutine finish(self, sim, cost, note, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: cost(2)           !! see `write_end`
    character(len=*), intent(in) :: note          !! why it ended if no stop rule was met
    type(error_t), allocatable, intent(out) :: error
    type(progress_t) :: before

    before = self%progress
    call self%write_end(sim, cost, note, finished=.true.)
    call self%h5md%file%report(error)
    if (.not. allocated(error)) then
      call self%h5md%close()
      call self%h5md%file%report(error)
    end if
    if (.not. allocated(error)) call self%h5md%verify(error)
    if (.not. allocated(error)) call take_final_name(self%path, self%replaces, error)
    if (allocated(error)) self%progress = before
    if (.not. allocated(error)) call self%release()
  end subroutine finish

  !> Writes the last samples, gives up unused room, and says how the run ended. A finished run gets a checkpoint that goes
  !> on before the last samples: in a longer run they might not be due.
  subroutine write_end(self, sim, cost, note, finished)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: cost(2)           !! since the start or the last resume: wall time [s], collisions per
    !! processor time [1/s]
    character(len=*), intent(in) :: note          !! why the run ended if no stop rule was met
    logical, intent(in) :: finished
    type(progress_t) :: before

    before = self%progress
    if (self%progress%frames%is_new(sim)) call self%write_frame(sim)
    if (self%progress%observables%is_new(sim)) call self%write_observables(sim)
    call self%h5md%write_buffers()
    if (allocated(self%h5md%file%failure)) return
    if (any(self%h5md%track%appended /= self%h5md%track%capacity)) call self%rebuild(self%h5md%track%appended, sim)
    call describe_end(self%h5md%file, self%input%settings%run%threads, before%spent + cost(1), cost(2), note)
    if (.not. finished) return
    before%spent = 0                       ! the state depends on the input alone
    call put_checkpoint(self%h5md%file, sim, before)
    call make_checkpoints(self%h5md%file, self%input%groups, sim, before)
  end subroutine write_end

  !> Leaves the output of a run that broke off under the name of an unfinished one, with its last state.
  subroutine break_off(self, sim, cost, note)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: cost(2)           !! see `write_end`
    character(len=*), intent(in) :: note          !! why
    type(error_t), allocatable :: uncountable

    call check_counts(sim, uncountable)
    if (.not. allocated(uncountable)) call self%write_end(sim, cost, note, finished=.false.)
  end subroutine break_off

  !> Closes the files, finished or not, and removes the lock.
  subroutine release(self)
    class(output_t), intent(inout) :: self

    call self%h5md%write_buffers()
    call self%h5md%close()
    call self%lock%release()
  end subroutine release

end module output
