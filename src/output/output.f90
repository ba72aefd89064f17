!> Output of a run: decides when samples are written, and manages the output file. The file is
!> called OUT.h5.part during the run and OUT.h5 once the run has finished. A lock file prevents
!> other runs from writing to the same output.
!>
!> The layout of an output file never changes after its creation. If the number of samples is known
!> at the start, the file has exactly the space required. If the number is unknown, a full file is
!> replaced by a larger one in an atomic renaming. At the end of the run the file is replaced by a
!> copy without unused space.
module output
  use kinds, only: int64, never, real64, unlimited
  use sampling_schedule, only: frames, progress_t, values
  use checkpoint, only: checkpoint_bytes, copy_checkpoints, has_both_checkpoints, has_broken_off, make_checkpoints, &
    mark_as_broken, put_checkpoint, put_last_checkpoint
  use errors, only: error_t, exit_files, fail
  use event_log, only: event_log_t
  use evolution, only: limits_t
  use h5md_layout, only: earlier_changes, event_counter, frame_counter, replaced_file, sample_counter, saved_at, wall_time
  use hdf5_objects, only: hdf5_file_t, scalar
  use sample_numbers, only: sample_t
  use sample_values, only: frame_column_t, frame_columns, frame_sample, observable_sample
  use observables, only: observed
  use run_description, only: describe_end, describe_run, describes
  use run_files, only: check_places, check_replaced, is_file, lock, source_of, take_final_name, unfinished, unfinished_new
  use sample_track, only: track_t
  use samples, only: check_counts, event_samples, event_series, frame_series, observable_series
  use settings, only: run_input_t
  use signals, only: record_signals
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use system, only: free_bytes, identity_of, is_folder, largest_file, last_problem, lock_t, make_folders_of, remove_file, seconds
  use texts, only: size_text, written
  implicit none
  private
  public :: estimate_size, output_t

  !> Maximum time for which a sample is buffered during a run [s].
  real(real64), parameter :: longest_wait = 0.05_real64
  !> Index of the event log in the list of tracks, after `frames` and `values`.
  integer, parameter :: events = 3
  !> Treatment of the checkpoints when a new file replaces the old one: copied (`kept`), written for
  !> the present state (`anew`), or omitted (`dropped`).
  integer, parameter :: kept = 1, anew = 2, dropped = 3

  type :: output_t
    type(progress_t) :: progress
    character(len=:), allocatable :: path         !! path of the finished file
    type(run_input_t) :: input                    !! input described in the file
    type(hdf5_file_t), allocatable, private :: file
    !> Tracks of frames, observables and, if requested, events: 2 or 3 elements.
    type(track_t), allocatable, private :: track(:)
    type(frame_column_t), allocatable, private :: columns(:)  !! columns of the frames
    !> Whether the file is expected to be copied, without its unused space, at the end of the run.
    logical, private :: is_copied = .true.
    type(lock_t), private :: lock
    !> Identity of the file that existed at `path` when the run started.
    integer(int64), private :: replaced(3) = 0_int64
    !> Clock time when this part of the run started [s].
    real(real64), private :: opened = 0.0_real64
    real(real64), private :: spent = 0.0_real64   !! wall time of the earlier parts of the run [s]
  contains
    procedure :: claim
    procedure :: open => open_output
    procedure :: resume
    procedure :: tighten
    procedure :: take_due_samples
    procedure :: take_events
    procedure :: finish
    procedure :: break_off
    procedure :: save
    procedure :: release
    procedure, private :: check_start, check_room, plan, create_file, take_sample, add, flush_buffers, rebuild, write_end
    procedure, private :: bytes_of_file, lacks_log
  end type output_t

contains

  !> Creates the folders of the output, acquires its lock, and reports an error if a file must not
  !> be overwritten.
  subroutine claim(self, path, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path          !! path of the finished file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    logical :: made

    call record_signals()                         ! from here on, killing the program could lose data
    self%file = hdf5_file_t()
    self%path = path
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
    if (.not. allocated(error)) call check_places(path, error)
    ! A file with the extension `unfinished_new` is incomplete and was left behind by a killed run.
    if (.not. allocated(error)) call remove_file(path//unfinished_new)
    self%replaced = identity_of(path)
    if (is_file(path) .and. all(self%replaced == 0) .and. .not. allocated(error)) &
      call fail(error, exit_files, path//": cannot be examined: "//last_problem())
  end subroutine claim

  !> Opens the output of a new run after `claim`, and writes the first samples.
  subroutine open_output(self, input, sim, force, error, only_start)
    class(output_t), intent(inout) :: self
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim
    !> .true. allows the run to replace an unfinished output at its start, and a finished output at
    !> its end.
    logical, intent(in) :: force
    type(error_t), allocatable, intent(out) :: error
    !> .true. reserves space only for the first samples; all later samples are then written by
    !> another run.
    logical, intent(in), optional :: only_start
    integer :: k

    if (.not. force) call self%check_start(error)
    if (allocated(error)) return
    self%progress = progress_t(input%settings)
    call self%plan(input, sim)
    if (present(only_start)) then
      self%is_copied = self%is_copied .and. .not. only_start
      if (only_start) self%track%planned = 1
    end if
    call self%check_room(sim, error)
    if (allocated(error)) return
    call remove_file(self%path//unfinished)
    call self%create_file(self%file, sim)
    do k = 1, size(self%track)
      call self%track(k)%make(self%file, self%track(k)%first_capacity())
    end do
    call self%take_sample(frames, sim)
    call self%take_sample(values, sim)
    call self%flush_buffers()
    call make_checkpoints(self%file, input%groups, sim, self%progress)
    call self%file%flush()
    call self%file%rename()
    call self%file%report(error)
    if (allocated(error)) call self%file%discard()
  end subroutine open_output

  !> Reports an error if a new run would replace a finished output, or an unfinished output from
  !> which a run can still be resumed.
  subroutine check_start(self, error)
    class(output_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error

    if (is_file(self%path)) then
      call fail(error, exit_files, self%path//": exists already; --resume with a longer stop rule continues it, " &
        //"--force replaces it when the run has finished, -o writes elsewhere")
    else if (is_file(self%path//unfinished)) then
      if (has_broken_off(self%path)) return
      call fail(error, exit_files, self%path//unfinished//": exists already, from a run that did not finish; --resume " &
        //"continues it, --force starts it again")
    end if
  end subroutine check_start

  !> Reports an error if the disk has too little space for the output and for its copy at the end of
  !> the run.
  subroutine check_room(self, sim, error)
    class(output_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: planned, free
    character(len=:), allocatable :: text

    planned = self%bytes_of_file(sim)
    free = free_bytes(self%path)
    text = self%path//": the output will have "//written(planned)//" bytes"
    if (self%lacks_log()) text = text//" without the event log, whose length is unknown"
    if (planned > largest_file()) then
      call fail(error, exit_files, text//", and files may have at most "//written(largest_file()) &
        //" (ulimit -f); choose fewer frames or raise the limit")
    else if (planned > free .or. (self%is_copied .and. planned > free/2)) then
      if (self%is_copied) text = text//", its copy at the end of the run as many"
      call fail(error, exit_files, text//", "//written(free)//" are free; choose fewer frames or make room")
    end if
  end subroutine check_room

  !> Opens the output of a resumed run after `claim`. New samples follow the samples written before
  !> the checkpoint. Samples written after the checkpoint are overwritten. A finished output is left
  !> unchanged until the continued run has finished. The run writes to a new file if the old file
  !> describes a different input or has less space than a new run would reserve.
  subroutine resume(self, input, sim, progress, finished, error)
    class(output_t), intent(inout) :: self
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(in) :: progress
    logical, intent(in) :: finished
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: counts(3)
    real(real64) :: spent(1)
    logical :: fits
    integer :: k

    self%progress = progress
    call self%plan(input, sim)
    call self%file%open(source_of(self%path), writable=.not. finished)
    spent = 0
    call self%file%fetch(wall_time, 1, spent)
    self%spent = spent(1)
    if (.not. finished) call self%file%fetch(replaced_file, 3, self%replaced)
    if (self%file%length(earlier_changes) >= 0) call self%file%fetch_text(earlier_changes, self%input%changes)
    if (self%file%length(saved_at) >= 0) then
      call self%file%fetch(saved_at, 1, spent)
      self%input%saved_at = spent(1)
    end if
    call check_replaced(self%path, self%replaced, error)
    if (allocated(error)) return
    counts = [progress%schedule%count, progress%events]
    do k = 1, size(self%track)
      call self%track(k)%resume(self%file, counts(k))
    end do
    fits = .not. finished
    if (fits) fits = describes(self%file, input)
    if (fits) fits = has_both_checkpoints(self%file)
    ! .false. for a saved simulation in memory
    if (fits) fits = all(self%track%capacity >= self%track%first_capacity())
    if (.not. fits) then
      call self%check_room(sim, error)
      if (allocated(error)) return
      call self%rebuild([(max(self%track(k)%first_capacity(), counts(k)), k=1, size(self%track))], sim, anew)
    else
      do k = 1, size(self%track)
        call self%track(k)%put_counter(self%file)
      end do
      call self%file%flush()
    end if
    call self%file%report(error)
  end subroutine resume

  !> Sets up the tracks and the planned number of samples of each.
  subroutine plan(self, input, sim)
    class(output_t), intent(inout) :: self
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t) :: rule

    self%input = input
    rule = input%settings%stop%applied_to(sim)
    associate (settings => input%settings%output)
      allocate (self%track(merge(events, values, settings%event_log)))
      self%track(frames)%counter = frame_counter
      self%columns = frame_columns(sim, sim%box%periodic, settings%frame_columns)
      self%track(frames)%series = frame_series(self%columns, sim%n_disks(), settings%single_precision)
      self%track(values)%counter = sample_counter
      self%track(values)%series = observable_series(observed(sim))
      self%track(:values)%planned = self%progress%schedule%planned(rule%limits_t)
      if (settings%event_log) then
        self%track(events)%counter = event_counter
        self%track(events)%series = event_series()
        self%track(events)%planned = planned_events(rule%limits_t)
      end if
      self%is_copied = any(self%track%planned == 0)
      ! Collisions with boundaries are also logged, but do not count as disk–disk collisions.
      if (settings%event_log) self%is_copied = self%is_copied .or. (rule%collisions < unlimited &
        .and. (sim%box%has_obstacles() .or. .not. all(sim%box%periodic)))
    end associate
  end subroutine plan

  !> Smallest possible number of logged events, for a run that ends at a number of events or
  !> collisions; 0 if another stop rule can end the run.
  pure function planned_events(limits) result(n)
    type(limits_t), intent(in) :: limits          !! limits of the run
    integer(int64) :: n

    n = 0
    if (limits%watches() .or. limits%at_rest .or. limits%disks_inside >= 0 .or. limits%time < never) return
    if (max(limits%events, limits%collisions) == huge(n)) n = min(limits%events, limits%collisions)
    if (n == huge(n)) n = 0
  end function planned_events

  !> True if only the size of the event log is unknown before the run.
  pure function lacks_log(self) result(yes)
    class(output_t), intent(in) :: self
    logical :: yes

    yes = size(self%track) == events
    if (yes) yes = self%track(events)%planned == 0
  end function lacks_log

  !> Minimum size of the file in bytes. If the number of samples is unknown, the first and the last
  !> sample are counted.
  function bytes_of_file(self, sim) result(bytes)
    class(output_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    integer(int64) :: bytes
    !> Size of id, species, mass and radius per disk [bytes].
    real(real64), parameter :: constants = 24.0_real64

    bytes = int(min(9.0e18_real64, constants*sim%n_disks() + 2*checkpoint_bytes(sim) &
      + sum(real(max(self%track%planned, 2_int64), real64)*real(self%track%bytes_per_sample(), real64))), int64)
  end function bytes_of_file

  !> Estimates the minimum size of the output of a run.
  subroutine estimate_size(input, sim, bytes, text)
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    integer(int64), intent(out) :: bytes
    character(len=:), allocatable, intent(out) :: text   !! part of a message
    type(output_t) :: output

    output%progress = progress_t(input%settings)
    call output%plan(input, sim)
    bytes = output%bytes_of_file(sim)
    text = "at least "//size_text(bytes)
    if (output%lacks_log()) text = text//" without the event log"
  end subroutine estimate_size

  !> Creates a file with a temporary name and writes all data except samples and checkpoints.
  subroutine create_file(self, file, sim)
    class(output_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim

    call file%create(self%path//unfinished_new, final_path=self%path//unfinished)
    call describe_run(file, self%input, sim)
    call file%put(replaced_file, [3], self%replaced)
    call file%put(wall_time, scalar, [self%spent])
  end subroutine create_file

  !> Lowers the limits of the simulation, so that it pauses when the next sample is due.
  pure subroutine tighten(self, limits)
    class(output_t), intent(in) :: self
    type(limits_t), intent(inout) :: limits

    call self%progress%schedule(frames)%tighten(limits)
    call self%progress%schedule(values)%tighten(limits)
  end subroutine tighten

  !> Takes all samples that are due. The main loop calls this procedure whenever the simulation
  !> pauses at a limit.
  subroutine take_due_samples(self, sim, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical :: due(2)

    due = self%progress%schedule%is_due(sim)
    if (any(due)) call check_counts(sim, error)
    if (allocated(error)) return
    if (due(frames)) call self%take_sample(frames, sim)
    if (due(values)) call self%take_sample(values, sim)
    call self%flush_buffers(longest_wait)
    call self%file%report(error)
  end subroutine take_due_samples

  !> Adds a frame or a sample of the observables to the output.
  subroutine take_sample(self, track, sim)
    class(output_t), intent(inout) :: self
    integer, intent(in) :: track                  !! `frames` or `values`
    type(simulation_t), intent(inout) :: sim

    associate (schedule => self%progress%schedule(track))
      if (track == frames) call self%add(track, frame_sample(sim, schedule%count, self%columns), sim)
      if (track == values) call self%add(track, observable_sample(sim, schedule%count), sim)
      call schedule%take(sim)
    end associate
  end subroutine take_sample

  !> Moves the logged events to the output. A failure of the output is reported by the next call of
  !> `take_due_samples`.
  subroutine take_events(self, sim, log)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(event_log_t), intent(inout) :: log

    if (log%n == 0) return
    call self%add(events, event_samples(log), sim)
    self%progress%events = self%progress%events + log%n
    log%n = 0
  end subroutine take_events

  !> Adds samples to a track. If the file has no space for them, it is first replaced by a larger
  !> file.
  subroutine add(self, track, samples, sim)
    class(output_t), intent(inout) :: self
    integer, intent(in) :: track
    type(sample_t), intent(in) :: samples
    type(simulation_t), intent(inout) :: sim
    integer(int64) :: capacities(size(self%track))
    logical :: widened

    capacities = self%track%capacity
    capacities(track) = self%track(track)%enlarged(samples%count())
    call self%track(track)%widen(samples, widened)
    if (widened .or. any(capacities > self%track%capacity)) call self%rebuild(capacities, sim, kept)
    call self%track(track)%append(self%file, samples)
  end subroutine add

  !> Commits buffered samples, that is, writes them to the file: all of them, or only those buffered
  !> for at least `least_wait`.
  subroutine flush_buffers(self, least_wait)
    class(output_t), intent(inout) :: self
    real(real64), intent(in), optional :: least_wait      !! [s]
    real(real64) :: wait
    integer :: k

    wait = 0
    if (present(least_wait)) wait = least_wait
    do k = 1, size(self%track)
      call self%track(k)%flush(self%file, wait)
    end do
  end subroutine flush_buffers

  !> Replaces the file by a new one with different capacities of the tracks.
  subroutine rebuild(self, capacities, sim, checkpoints)
    class(output_t), intent(inout) :: self
    integer(int64), intent(in) :: capacities(:)
    type(simulation_t), intent(inout) :: sim
    !> `kept`, `anew` or `dropped`
    integer, intent(in) :: checkpoints
    type(hdf5_file_t), allocatable :: new
    integer(int64) :: needed
    integer :: k

    call self%flush_buffers()
    needed = sum(self%track%appended()*self%track%bytes_per_sample())
    if (needed > free_bytes(self%path)) call self%file%check(-1, "be copied to a file of the right size", &
      needed=needed)
    if (allocated(self%file%failure)) return
    allocate (new)
    call self%create_file(new, sim)
    do k = 1, size(self%track)
      call self%track(k)%move(new, self%file, capacities(k))
    end do
    if (checkpoints == kept) call copy_checkpoints(new, self%file)
    if (checkpoints == anew) call make_checkpoints(new, self%input%groups, sim, self%progress)
    if (checkpoints == dropped) call mark_as_broken(new)
    call new%flush()
    if (allocated(self%file%failure)) then        ! the old file could not be read
      call new%discard()
      return
    end if
    call new%rename()
    call self%file%close()
    call move_alloc(new, self%file)
    if (allocated(self%file%failure)) call self%file%discard()
  end subroutine rebuild

  !> Writes a checkpoint of the present state.
  subroutine save(self, sim, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    type(error_t), allocatable, intent(out) :: error

    call self%flush_buffers()
    call self%file%put(wall_time, scalar, [self%spent + seconds() - self%opened])
    call put_checkpoint(self%file, sim, self%progress)
    call self%file%report(error)
  end subroutine save

  !> Completes the output of a finished run: checks the file and renames it to its final name. If
  !> this fails, the run can be resumed from the checkpoint written just before.
  subroutine finish(self, sim, cost, note, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: cost(3)           !! see `write_end`
    character(len=*), intent(in) :: note          !! reason why the run ended, if no stop rule was met
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    integer :: k

    call self%write_end(sim, cost, note, broken=.false.)
    call self%file%close()
    call self%file%report(error)
    if (allocated(error)) return
    call file%open(self%file%path, writable=.false.)
    do k = 1, size(self%track)
      call self%track(k)%verify(file)
    end do
    call file%close()
    call file%report(error)
    if (.not. allocated(error)) call take_final_name(self%path, self%replaced, error)
    if (.not. allocated(error)) call self%release()
  end subroutine finish

  !> Writes the last samples, removes unused space, and records why the run ended. Samples taken
  !> only because the run ends are not counted in the final checkpoint. A continued run therefore
  !> overwrites them.
  subroutine write_end(self, sim, cost, note, broken)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    !> Wall time [s], collisions per processor time [1/s], and number of events executed by the
    !> serial engine, in the present part of the run.
    real(real64), intent(in) :: cost(3)
    character(len=*), intent(in) :: note          !! reason why the run ended, if no stop rule was met
    logical, intent(in) :: broken
    type(progress_t) :: before
    integer :: track

    before = self%progress
    do track = frames, values
      if (self%progress%schedule(track)%is_new(sim)) call self%take_sample(track, sim)
    end do
    call self%flush_buffers()
    if (broken .or. any(self%track%appended() /= self%track%capacity)) &
      call self%rebuild(self%track%appended(), sim, merge(dropped, kept, broken))
    call describe_end(self%file, self%input%settings%run%threads, self%spent + cost(1), cost(2:), note)
    if (.not. broken) call put_last_checkpoint(self%file, sim, before)
  end subroutine write_end

  !> Completes the output of an aborted run, including the last state. The file keeps the name of an
  !> unfinished output, OUT.h5.part.
  subroutine break_off(self, sim, cost, note)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: cost(3)           !! see `write_end`
    character(len=*), intent(in) :: note          !! reason for aborting the run
    type(error_t), allocatable :: uncountable

    call check_counts(sim, uncountable)
    if (.not. allocated(uncountable)) call self%write_end(sim, cost, note, broken=.true.)
  end subroutine break_off

  !> Closes the output file, finished or not, and deletes the lock file.
  subroutine release(self)
    class(output_t), intent(inout) :: self

    if (allocated(self%track)) call self%flush_buffers()
    if (allocated(self%file)) call self%file%close()
    call self%lock%release()
  end subroutine release

end module output
