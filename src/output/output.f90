!> The output of a run: when something is written, and the life of its files. During the run the file is
!> OUT.h5.part, and a lock file keeps other runs away; the name OUT.h5 means that the run is finished.
module output
  use kinds, only: int64, real64
  use cadence, only: cadence_t
  use errors, only: error_t, exit_files, fail
  use event_log, only: event_log_t
  use evolution, only: limits_t
  use h5md_file, only: event_track, frame_track, h5md_file_t, n_tracks, observable_track
  use h5md_layout, only: event_counter, frame_counter, observables_group, position, sample_counter, time_of, value_of
  use hdf5_objects, only: hdf5_file_t
  use observables, only: observed
  use run_description, only: describe_cost, describe_run
  use run_files, only: current_checkpoint, is_file, is_hdf5_file, lock, remove_checkpoints, run_file, unfinished, unfinished_new
  use run_input, only: run_input_t
  use samples, only: event_series, frame_sample, frame_series, observable_sample, observable_series
  use settings, only: output_settings_t
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use system, only: free_bytes, is_folder, last_problem, lock_t, make_folders_of, move_file, &
    record_signals, remove_file, seconds, synchronize
  use texts, only: written
  implicit none
  private
  public :: output_t, planned_bytes, progress_t

  integer(int64), parameter :: constants = 24            !! per disk: id, species, mass, radius [bytes]
  real(real64), parameter :: longest_wait = 0.05_real64  !! of a sample before it is written [s]

  !> How far the output has come: with the state, all that is needed to go on.
  type :: progress_t
    type(cadence_t) :: frames, observables
    integer(int64) :: events = 0                  !! collisions written to the event log
    real(real64) :: spent = 0.0_real64            !! wall time of earlier parts of the run [s]
  end type progress_t

  interface progress_t
    module procedure new_progress
  end interface progress_t

  type :: output_t
    type(progress_t) :: progress
    real(real64), private :: opened = 0.0_real64  !! by the clock of `seconds` [s]
    character(len=:), allocatable :: path         !! of the finished file
    type(run_input_t) :: input                    !! described in the file
    type(h5md_file_t), private :: h5md
    type(lock_t), private :: lock
  contains
    procedure :: open => open_output
    procedure :: resume
    procedure :: tighten
    procedure :: write_what_is_due
    procedure :: write_events
    procedure :: finish
    procedure :: save
    procedure :: release
    procedure, private :: claim
    procedure, private :: plan
    procedure, private :: create_file
    procedure, private :: append
    procedure, private :: rebuild
    procedure, private :: write_frame
    procedure, private :: write_observables
  end type output_t

contains

  !> The progress of a run that has written nothing yet.
  pure function new_progress(settings) result(progress)
    type(output_settings_t), intent(in) :: settings
    type(progress_t) :: progress

    associate (s => settings)
      progress%frames = cadence_t(s%frames_every_time, s%frames_every_collisions, s%frames_every_events)
      progress%observables = cadence_t(s%observables_every_time, s%observables_every_collisions, &
        s%observables_every_events)
    end associate
  end function new_progress

  !> Opens the output of a new run and writes the first samples.
  subroutine open_output(self, path, input, sim, force, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path          !! of the finished file
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: force                  !! replace, at the end, a finished file
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: capacities(n_tracks)

    call self%claim(path, error)
    if (allocated(error)) return
    call check_path(path, force, error)
    if (.not. allocated(error)) then
      self%progress = progress_t(input%settings%output)
      call self%plan(input, sim, capacities)
      call check_room(planned_bytes(input, sim), path, error)
    end if
    if (.not. allocated(error)) then
      call remove_checkpoints(path)
      call remove_file(run_file(path, unfinished))
      call self%create_file(self%h5md%file, sim)
      call self%h5md%make_tracks(capacities)
      call self%write_frame(sim)
      call self%write_observables(sim)
      call self%h5md%write_buffers()
      call self%h5md%file%rename()
      call self%h5md%file%report(error)
      call remove_file(run_file(path, unfinished_new))     ! still there only after a failure, and useless
    end if
    if (allocated(error)) call self%release()
  end subroutine open_output

  !> Opens the output of a stopped run, and goes back to where its checkpoint stands.
  subroutine resume(self, path, input, sim, progress, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    type(progress_t), intent(in) :: progress
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: capacities(n_tracks)

    if (.not. is_file(run_file(path, unfinished))) then
      call fail(error, exit_files, run_file(path, unfinished)//": is missing: without the samples written so " &
        //"far the checkpoint is of no use; --force instead of --resume starts over")
      return
    end if
    call self%claim(path, error)
    if (allocated(error)) return
    self%progress = progress
    call self%plan(input, sim, capacities)
    call self%h5md%file%open(run_file(path, unfinished), writable=.true.)
    call self%h5md%resume_tracks([progress%frames%count, progress%observables%count, progress%events])
    call self%h5md%file%report(error)
    if (allocated(error)) call self%release()
  end subroutine resume

  !> Makes the folders, and takes the lock that keeps other runs from this output.
  subroutine claim(self, path, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    logical :: made, taken

    call record_signals()                         ! from here on there is something to lose
    self%path = path
    self%opened = seconds()
    call make_folders_of(path, made)
    if (.not. made) then
      call fail(error, exit_files, path//": cannot make its folder: "//last_problem())
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder; the output must be a file")
    else
      call self%lock%acquire(run_file(path, lock), taken)
      if (taken) call fail(error, exit_files, path//": another run is writing it; its lock is "//run_file(path, lock))
    end if
  end subroutine claim

  !> Refuses to overwrite foreign files, and results without --force.
  subroutine check_path(path, force, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: force
    type(error_t), allocatable, intent(out) :: error
    logical :: exists, foreign

    exists = is_file(path)
    foreign = exists
    if (exists) foreign = .not. is_hdf5_file(path)
    if (foreign) then
      call fail(error, exit_files, path//": exists already and is not the output of a run; it is left as it is; " &
        //"choose another name")
    else if (exists .and. .not. force) then
      call fail(error, exit_files, path//": exists already, from a finished run; --force replaces it, "// &
        "-o writes elsewhere")
    else if (is_file(run_file(path, current_checkpoint)) .and. .not. force) then
      call fail(error, exit_files, run_file(path, current_checkpoint)//": exists already, from a run that was " &
        //"stopped; --resume goes on, --force starts over")
    end if
  end subroutine check_path

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
      track(frame_track)%series = frame_series(int(sim%n_disks()), settings%single_precision, any(sim%box%periodic))
      track(observable_track)%counter = sample_counter
      track(observable_track)%series = observable_series(observed(sim))
      track(event_track)%counter = event_counter
      if (settings%event_log) track(event_track)%series = event_series()
    end associate
    rule = stop_rule_t(input%settings%stop, sim)
    capacities = [self%progress%frames%planned(rule%limits), self%progress%observables%planned(rule%limits), 0_int64]
  end subroutine plan

  !> Bytes that the output of a run needs at least: where the number of samples is unknown the first and the last count.
  function planned_bytes(input, sim) result(bytes)
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    integer(int64) :: bytes, capacities(n_tracks)
    type(output_t) :: output
    real(real64) :: samples(2), rooms(2)

    output%progress = progress_t(input%settings%output)
    call output%plan(input, sim, capacities)
    samples = real(max(capacities([frame_track, observable_track]), 2_int64), real64)
    rooms = [output%h5md%track(frame_track)%room(), output%h5md%track(observable_track)%room()]
    bytes = int(min(constants*sim%n_disks() + dot_product(samples, rooms), 9.0e18_real64), int64)
  end function planned_bytes

  !> Refuses a run whose planned output does not fit onto the disk.
  subroutine check_room(needed, path, error)
    integer(int64), intent(in) :: needed          !! [bytes]
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error

    if (needed > free_bytes(path)) call fail(error, exit_files, path//": the output will have "//written(needed) &
      //" bytes, "//written(free_bytes(path))//" are free; choose fewer frames or make room")
  end subroutine check_room

  !> Creates a file under a temporary name, with everything but the tracks.
  subroutine create_file(self, file, sim)
    class(output_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: sim

    call remove_file(run_file(self%path, unfinished_new))
    call file%create(run_file(self%path, unfinished_new), final_path=run_file(self%path, unfinished))
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
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error

    if (self%progress%frames%is_due(sim)) call self%write_frame(sim)
    if (self%progress%observables%is_due(sim)) call self%write_observables(sim)
    call self%h5md%write_buffers(longest_wait)
    call self%h5md%file%report(error)
  end subroutine write_what_is_due

  !> Writes one frame.
  subroutine write_frame(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    call self%append(frame_track, frame_sample(sim, self%progress%frames%count), sim)
    call self%progress%frames%take(sim)
  end subroutine write_frame

  !> Writes one sample of the observables.
  subroutine write_observables(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    call self%append(observable_track, observable_sample(sim, self%progress%observables%count), sim)
    call self%progress%observables%take(sim)
  end subroutine write_observables

  !> Writes the collisions that the log holds, and empties it.
  subroutine write_events(self, sim, log, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(event_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(out) :: error

    if (log%n == 0) return
    call self%append(event_track, log%record(:, :log%n), sim)
    self%progress%events = self%progress%events + log%n
    call log%clear()
    call self%h5md%file%report(error)
  end subroutine write_events

  !> Appends samples to a track, in a larger file if there is no room for them in this one.
  subroutine append(self, track, samples, sim)
    class(output_t), intent(inout) :: self
    integer, intent(in) :: track
    real(real64), intent(in) :: samples(:, :)     !! (width,count)
    type(simulation_t), intent(in) :: sim
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
    type(simulation_t), intent(in) :: sim
    type(h5md_file_t) :: new

    call self%h5md%write_buffers()
    if (allocated(self%h5md%file%failure)) return
    call self%create_file(new%file, sim)
    call self%h5md%replace_by(new, capacities)
  end subroutine rebuild

  !> Returns how far the output is when all that was written has reached the disk: a checkpoint relies on it.
  subroutine save(self, progress, error)
    class(output_t), intent(inout) :: self
    type(progress_t), intent(out) :: progress
    type(error_t), allocatable, intent(out) :: error
    logical :: done

    progress = self%progress
    progress%spent = self%progress%spent + seconds() - self%opened
    call self%h5md%write_buffers()
    call self%h5md%file%report(error)
    if (allocated(error)) return
    call synchronize(run_file(self%path, unfinished), done)
    if (.not. done) call fail(error, exit_files, run_file(self%path, unfinished)//": cannot be written: "//last_problem())
  end subroutine save

  !> Ends the output of a finished run: the last samples, unused room given up, a check of the file, its final
  !> name.
  subroutine finish(self, sim, wall_seconds, rate, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: wall_seconds      !! since the start or the last resume [s]
    real(real64), intent(in) :: rate              !! collisions per processor time since then [1/s]
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: part
    logical :: moved

    part = run_file(self%path, unfinished)
    if (self%progress%frames%is_new(sim)) call self%write_frame(sim)
    if (self%progress%observables%is_new(sim)) call self%write_observables(sim)
    call self%h5md%write_buffers()
    call self%h5md%file%report(error)
    if (.not. allocated(error) .and. any(self%h5md%track%appended /= self%h5md%track%capacity)) then
      call self%rebuild(self%h5md%track%appended, sim)
      if (allocated(self%h5md%file%failure)) deallocate (self%h5md%file%failure)     ! the file is good without it
    end if
    call describe_cost(self%h5md%file, self%progress%spent + wall_seconds, rate)
    call self%h5md%close()
    call self%h5md%file%report(error)
    if (.not. allocated(error)) call check_file(part, self%progress, sim, error)
    if (.not. allocated(error)) then
      call synchronize(part, moved)
      if (moved) call move_file(part, self%path, moved)
      if (.not. moved) call fail(error, exit_files, part//": cannot be renamed to "//self%path//": "//last_problem())
    end if
    if (.not. allocated(error)) call remove_checkpoints(self%path)
    call self%release()
  end subroutine finish

  !> Reads back what shows whether the file is complete.
  subroutine check_file(path, progress, sim, error)
    character(len=*), intent(in) :: path
    type(progress_t), intent(in) :: progress
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    real(real64), allocatable :: time(:)

    call file%open(path, writable=.false.)
    allocate (time(progress%frames%count))
    call file%fetch(position//time_of, size(time), time)
    if (file%length(position//value_of) /= 2*size(time)*int(sim%n_disks(), int64)) &
      call file%check(-1, "be read back: frames are missing")
    if (file%length(observables_group//"total_energy"//value_of) /= progress%observables%count) &
      call file%check(-1, "be read back: observables are missing")
    if (.not. allocated(file%failure)) then
      if (time(size(time)) < sim%time()) call file%check(-1, "be read back: the last frame is missing")
    end if
    call file%close()
    call file%report(error)
  end subroutine check_file

  !> Closes the files, finished or not, and removes the lock.
  subroutine release(self)
    class(output_t), intent(inout) :: self

    call self%h5md%write_buffers()
    call self%h5md%close()
    call self%lock%release()
  end subroutine release

end module output
