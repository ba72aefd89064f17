!> The output of a run: what is due, when, and written how. While the run lasts the file is OUT.h5.part,
!> and a lock file keeps other runs away; the name OUT.h5 means finished.
module output
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: box_t
  use cadence, only: cadence_t
  use errors, only: error_t, exit_files, fail
  use event_log, only: event_log_t
  use h5md_file, only: collisions_series, h5md_file_t, image_series, position_series, velocity_series
  use hdf5_objects, only: hdf5_file_t
  use observables, only: observable_list, observed_values
  use parameter_values, only: parameter_group_t
  use run_description, only: describe_cost, describe_run
  use run_files, only: checkpoint_of, is_file, is_hdf5_file, lock_of, new_part_of, part_of, remove_checkpoints
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use stop_rules, only: stop_rule_t
  use system, only: free_bytes, is_folder, last_problem, lock_t, make_folders_of, move_file, &
    remove_file, seconds, synchronize
  use texts, only: text_t, written
  implicit none
  private
  public :: output_t, progress_t

  !> How far the output has come: with the state, all that is needed to go on.
  type :: progress_t
    type(cadence_t) :: frames, observables
    integer(int64) :: events = 0                  !! collisions written to the event log
    real(real64) :: spent = 0.0_real64            !! wall time of earlier parts of the run [s]
  end type progress_t

  type :: output_t
    type(progress_t) :: progress
    real(real64), private :: opened = 0.0_real64  !! by the clock of `seconds` [s]
    character(len=:), allocatable, private :: path
    type(h5md_file_t), private :: h5md
    type(lock_t), private :: lock
  contains
    procedure :: open => open_output
    procedure :: resume
    procedure :: next_time
    procedure :: next_collisions
    procedure :: next_events
    procedure :: write_what_is_due
    procedure :: write_events
    procedure :: finish
    procedure :: save
    procedure :: release
    procedure, private :: claim
    procedure, private :: plan
    procedure, private :: write_frame
    procedure, private :: write_observables
  end type output_t

contains

  !> Opens the output of a new run and writes the first samples. A finished file is replaced, when the run
  !> is finished, only if `force`.
  subroutine open_output(self, path, settings, groups, input_text, overrides, sim, force, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path          !! of the finished file
    type(settings_t), intent(in) :: settings
    type(parameter_group_t), intent(in) :: groups(:)     !! every value as used
    character(len=*), intent(in) :: input_text
    type(text_t), intent(in) :: overrides(:)
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: force
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: frames, samples
    logical :: exists, foreign

    call self%claim(path, error)
    if (allocated(error)) return
    exists = is_file(path)
    foreign = exists
    if (exists) foreign = .not. is_hdf5_file(path)
    if (foreign) then
      call fail(error, exit_files, path//": is there already, and is no output of a run: it is left " &
        //"as it is; choose another name")
    else if (exists .and. .not. force) then
      call fail(error, exit_files, path//": is there already, from a finished run; --force replaces it, "// &
        "-o writes elsewhere")
    else if (is_file(checkpoint_of(path)) .and. .not. force) then
      call fail(error, exit_files, checkpoint_of(path)//": is there already, from a run that was " &
        //"stopped; --resume goes on, --force starts over")
    end if
    if (.not. allocated(error)) call self%plan(settings, sim, frames, samples)
    if (.not. allocated(error)) call check_room(self%h5md, frames, samples, path, error)
    if (.not. allocated(error)) then
      call remove_checkpoints(path)
      call remove_file(part_of(path))
      call remove_file(new_part_of(path))
      associate (h5md => self%h5md)
        call h5md%file%create(new_part_of(path), 0, name=part_of(path))
        call describe_run(h5md%file, settings, groups, input_text, overrides, sim)
        call h5md%make_tracks(frames, samples)
        call self%write_frame(sim)
        call self%write_observables(sim)
        call h5md%write_all()
        call h5md%file%rename()
        call h5md%file%failure(error)
      end associate
      call remove_file(new_part_of(path))           ! if it failed: nothing of use is in it
    end if
    if (allocated(error)) call self%release()
  end subroutine open_output

  !> Opens the output of a run that was stopped, and goes back to where its checkpoint stands.
  subroutine resume(self, path, settings, sim, progress, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    type(progress_t), intent(in) :: progress
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: frames, samples

    if (.not. is_file(part_of(path))) then
      call fail(error, exit_files, part_of(path)//": is missing: without the samples written so far the " &
        //"checkpoint is of no use; --force instead of --resume starts over")
      return
    end if
    call self%claim(path, error)
    if (allocated(error)) return
    call self%plan(settings, sim, frames, samples)
    call self%progress%frames%go_on(progress%frames)
    call self%progress%observables%go_on(progress%observables)
    self%progress%events = progress%events
    self%progress%spent = progress%spent
    associate (h5md => self%h5md)
      call h5md%file%open(part_of(path), writable=.true.)
      call h5md%frames%resume(h5md%file, progress%frames%count)
      call h5md%observables%resume(h5md%file, progress%observables%count)
      call h5md%events%resume(h5md%file, progress%events)
      call h5md%file%flush()
      call h5md%file%failure(error)
    end associate
    if (allocated(error)) call self%release()
  end subroutine resume

  !> Makes the folders, and takes the lock that keeps other runs from this output.
  subroutine claim(self, path, error)
    class(output_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    logical :: made, taken

    self%path = path
    self%opened = seconds()
    call make_folders_of(path, made)
    if (.not. made) then
      call fail(error, exit_files, path//": cannot make its folder: "//last_problem())
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder; the output must be a file")
    else
      call self%lock%acquire(lock_of(path), taken)
      if (taken) call fail(error, exit_files, path//": another run is writing it; its lock is "//lock_of(path))
    end if
  end subroutine claim

  !> What will be written, and when, and how often.
  subroutine plan(self, settings, sim, frames, samples)
    class(output_t), intent(inout) :: self
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(out) :: frames, samples       !! of frames, of observables; 0: unknown
    type(stop_rule_t) :: rule

    associate (o => settings%output)
      self%progress%frames = cadence_t(o%frames_every_time, o%frames_every_collisions, o%frames_every_events)
      self%progress%observables = cadence_t(o%observables_every_time, &
        o%observables_every_collisions, o%observables_every_events)
      call self%h5md%plan_frames(int(sim%n_disks()), o%single_precision, any(sim%box%periodic))
      if (o%event_log) call self%h5md%plan_events()
    end associate
    associate (list => observable_list(sim%species))
      call self%h5md%plan_observables(list%name, list%width, list%is_count)
    end associate
    rule = stop_rule_t(settings%stop, sim)
    frames = self%progress%frames%planned(rule%limits)
    samples = self%progress%observables%planned(rule%limits)
  end subroutine plan

  !> Refuses a run whose planned output does not fit onto the disk.
  subroutine check_room(h5md, frames, samples, path, error)
    type(h5md_file_t), intent(in) :: h5md
    integer(int64), intent(in) :: frames, samples        !! planned; 0: unknown
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    real(real64) :: needed

    needed = real(max(frames, 2_int64), real64)*real(h5md%frames%room(), real64) &
      + real(max(samples, 2_int64), real64)*real(h5md%observables%room(), real64)
    if (needed > real(free_bytes(path), real64)) call fail(error, exit_files, path &
      //": the output will have "//written(int(min(needed, 9.0e18_real64), int64))//" bytes, " &
      //written(free_bytes(path))//" are free; ask for fewer frames or make room")
  end subroutine check_room

  !> When the next sample is due by time; `never` if none is.
  pure function next_time(self) result(t)
    class(output_t), intent(in) :: self
    real(real64) :: t

    t = min(self%progress%frames%next_time(), self%progress%observables%next_time())
  end function next_time

  !> The same by collisions of two disks; huge if none is.
  pure function next_collisions(self) result(n)
    class(output_t), intent(in) :: self
    integer(int64) :: n

    n = min(self%progress%frames%next_collisions, self%progress%observables%next_collisions)
  end function next_collisions

  !> The same by collisions of any kind.
  pure function next_events(self) result(n)
    class(output_t), intent(in) :: self
    integer(int64) :: n

    n = min(self%progress%frames%next_events, self%progress%observables%next_events)
  end function next_events

  !> To be called whenever the simulation pauses.
  subroutine write_what_is_due(self, sim, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error

    if (self%progress%frames%is_due(sim)) call self%write_frame(sim)
    if (self%progress%observables%is_due(sim)) call self%write_observables(sim)
    call self%h5md%write_old()
    call self%h5md%file%failure(error)
  end subroutine write_what_is_due

  !> Writes one frame, disks in file order.
  subroutine write_frame(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), allocatable :: x(:), v(:)       ! vectors one after the other
    integer(int32), allocatable :: image(:), collisions(:)
    integer(int32) :: i, k
    integer(int64) :: frame

    associate (file => self%h5md%file, track => self%h5md%frames, n => sim%n_disks())
      allocate (x(2*n), v(2*n), collisions(n))
      do i = 1, n
        k = sim%tag(i)%id
        x(2*k - 1:2*k) = sim%position(i)
        v(2*k - 1:2*k) = sim%velocity(i)
        collisions(k) = sim%tag(i)%collisions
      end do
      call self%progress%frames%take(sim)
      call self%h5md%reserve_frame()
      frame = track%put + 1
      call track%put_moment(file, sim%time())
      if (any(sim%box%periodic)) then
        allocate (image(2*n))
        do i = 1, n
          k = sim%tag(i)%id
          image(2*k - 1:2*k) = sim%tag(i)%image
          call wrap(sim%box, x(2*k - 1:2*k), image(2*k - 1:2*k))
        end do
        call track%series(image_series)%put(file, frame, 1_int64, image)
      end if
      call track%series(position_series)%put(file, frame, 1_int64, x)
      call track%series(velocity_series)%put(file, frame, 1_int64, v)
      call track%series(collisions_series)%put(file, frame, 1_int64, collisions)
      call track%commit(file, 1_int64)
    end associate
  end subroutine write_frame

  !> Moves a point by whole periods into the box, which holds its lower sides only, and counts them.
  pure subroutine wrap(box, x, image)
    type(box_t), intent(in) :: box
    real(real64), intent(inout) :: x(2)           !! [length]
    integer(int32), intent(inout) :: image(2)     !! periods travelled
    integer(int32) :: periods(2)

    associate (edges => box%edges())
      periods = merge(floor((x - box%lower)/edges), 0, box%periodic)
      where (box%periodic .and. x - periods*edges >= box%upper) periods = periods + 1
      image = image + periods
      x = x - periods*edges
    end associate
    where (box%periodic) x = max(x, box%lower)    ! by rounding only
  end subroutine wrap

  subroutine write_observables(self, sim)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    call self%progress%observables%take(sim)
    call self%h5md%put_observables(sim%time(), observed_values(sim))
  end subroutine write_observables

  !> Writes the collisions that the log holds, and empties it.
  subroutine write_events(self, log, error)
    class(output_t), intent(inout) :: self
    type(event_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(out) :: error

    if (log%n == 0) return
    call self%h5md%put_events(log%n, log%time, log%pair, log%impulse)
    call log%clear()
    self%progress%events = self%h5md%events%put
    call self%h5md%file%failure(error)
  end subroutine write_events

  !> Returns when all that was written has reached the disk, and how far that is: a checkpoint counts on it.
  subroutine save(self, progress, error)
    class(output_t), intent(inout) :: self
    type(progress_t), intent(out) :: progress
    type(error_t), allocatable, intent(out) :: error
    logical :: done

    progress = self%progress
    progress%spent = self%progress%spent + seconds() - self%opened
    call self%h5md%write_all()
    call self%h5md%file%failure(error)
    if (allocated(error)) return
    call synchronize(part_of(self%path), done)
    if (.not. done) call fail(error, exit_files, part_of(self%path)//": cannot be written: "//last_problem())
  end subroutine save

  !> Ends the output of a finished run: the last samples, unused room given up, a look at
  !> the file, its final name.
  subroutine finish(self, sim, wall_seconds, rate, error)
    class(output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: wall_seconds      !! since the start or the last resume [s]
    real(real64), intent(in) :: rate              !! collisions per processor time since then [1/s]
    type(error_t), allocatable, intent(out) :: error
    logical :: moved

    if (self%progress%frames%is_new(sim)) call self%write_frame(sim)
    if (self%progress%observables%is_new(sim)) call self%write_observables(sim)
    associate (h5md => self%h5md)
      call h5md%trim()
      call describe_cost(h5md%file, self%progress%spent + wall_seconds, rate)
      call h5md%close()
      call h5md%file%failure(error)
    end associate
    if (.not. allocated(error)) call check_file(part_of(self%path), self%progress, sim, error)
    if (.not. allocated(error)) then
      call synchronize(part_of(self%path), moved)
      if (moved) call move_file(part_of(self%path), self%path, moved)
      if (.not. moved) call fail(error, exit_files, part_of(self%path)//": cannot be renamed to " &
        //self%path//": "//last_problem())
    end if
    if (.not. allocated(error)) call remove_checkpoints(self%path)
    call self%release()
  end subroutine finish

  !> Reads back what tells whether the file is whole.
  subroutine check_file(path, progress, sim, error)
    character(len=*), intent(in) :: path
    type(progress_t), intent(in) :: progress
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    real(real64), allocatable :: time(:)

    call file%open(path, writable=.false.)
    allocate (time(progress%frames%count))
    call file%fetch("particles/disks/velocity/time", size(time), time)
    if (file%length("particles/disks/position/value") /= 2*size(time)*int(sim%n_disks(), int64)) &
      call file%check(-1, "be read back: frames are missing")
    if (file%length("observables/total_energy/value") /= progress%observables%count) &
      call file%check(-1, "be read back: observables are missing")
    if (.not. allocated(file%trouble)) then
      if (time(size(time)) < sim%time()) call file%check(-1, "be read back: the last frame is missing")
    end if
    call file%close()
    call file%failure(error)
  end subroutine check_file

  !> Lets go of the files, finished or not.
  subroutine release(self)
    class(output_t), intent(inout) :: self

    call self%h5md%write_all()
    call self%h5md%close()
    call self%lock%release()
  end subroutine release

end module output
