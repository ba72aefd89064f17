!> Checkpoints: the state of a simulation and the progress of its output, stored in the output file.
!> A resumed run is bit-identical to an uninterrupted one.
!>
!> During a run the output file has two slots, each with space for one checkpoint; one of them is
!> valid. A new checkpoint and its checksum are written to the other slot. Once they are on disk, a
!> number in the file is changed, which makes this slot the valid one. The file therefore always
!> contains a complete checkpoint. The output of a finished run has one slot. The output of an
!> aborted run contains no valid checkpoint.
module checkpoint
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int64
  use build_info, only: build_flags
  use sampling_schedule, only: progress_t
  use errors, only: error_t, exit_files, exit_usage, fail
  use evolution, only: evolution_t
  use h5md_layout, only: changes_at_work, checkpoint_group, earlier_changes, parameters_group
  use hdf5_objects, only: hdf5_file_t, scalar
  use hdf5_series, only: long_integer, series_t
  use input_groups, only: group_t, most_written
  use record, only: checksum, counting, reading, record_t, writing
  use run_files, only: is_file, source_of, unfinished
  use settings, only: run_input_t
  use simulation_state, only: simulation_t
  use state_record, only: exchange_all, layout
  use system, only: last_problem, synchronize
  use texts, only: eol, growing_text_t, legible, line_at, lower_case, text_t, written
  use variables, only: change_of, on_resume, table
  use version, only: program_version
  implicit none
  private
  public :: checkpoint_bytes, copy_checkpoints, has_both_checkpoints, has_broken_off, make_checkpoints, mark_as_broken
  public :: put_checkpoint, put_last_checkpoint, read_checkpoint, recall_overrides, recall_input

  character(len=*), parameter :: slots(2) = checkpoint_group//["1", "2"]
  character(len=*), parameter :: current = checkpoint_group//"current"  !! number of the valid slot, or `none`
  integer, parameter :: none = 0
  character(len=*), parameter :: described = checkpoint_group//"input_checksum"

  !> Path of an additional hard link to the first slot, created after all other links of the file
  !> and never deleted. HDF5 deletes the last link of a group in two steps: it overwrites the name,
  !> then removes the link from a list. If the program were killed between these steps, h5dump could
  !> not list the file.
  character(len=*), parameter :: kept = checkpoint_group//"kept"

contains

  !> Identification of the program that can resume the run. It consists of the version of the
  !> checkpoint layout, and of those compiler flags that allow inexact arithmetic and can therefore
  !> change results.
  pure function program() result(text)
    character(len=:), allocatable :: text

    text = "ricochet "//program_version//", checkpoint "//written(layout)
    if (index(build_flags, "-ffp-contract=off") == 0) text = text//", contracted arithmetic"
    if (index(build_flags, "-ffast-math") + index(build_flags, "-Ofast") > 0) text = text//", fast math"
  end function program

  !> The input that the run uses, with one variable per line. Variables that may change on
  !> `--resume` are left out.
  pure function fixed_input(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: k, g

    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (groups(g)%values(k)%name == "relative_to") cycle           ! unneeded: masses and radii are final
        if (.not. groups(g)%values(k)%is_set() .or. table(groups(g)%values(k)%row)%may_change == on_resume) cycle
        call growing%add(groups(g)%value_line(k)//eol)
      end do
    end do
    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. allocated(groups(g)%values(k)%reals)) cycle
        ! `value_line` contains all values of a short list
        if (size(groups(g)%values(k)%reals) <= most_written) cycle
        if (table(groups(g)%values(k)%row)%may_change == on_resume) cycle
        call growing%add("checksum of "//trim(groups(g)%name)//"."//trim(groups(g)%instance)//"." &
          //trim(groups(g)%values(k)%name)//" = "//checksum(transfer(groups(g)%values(k)%reals, [0_int8]))//eol)
      end do
    end do
    text = growing%text()
  end function fixed_input

  !> Restores the overrides of the original run, including overrides of scheduled changes, so that
  !> users need not repeat them on `--resume`. Overrides of variables that may change on `--resume`
  !> are not restored.
  subroutine recall_overrides(output, overrides, error)
    character(len=*), intent(in) :: output                       !! path of the output
    !> Overrides on the present command line, in the form GROUP.VARIABLE=VALUE. The overrides in the
    !> output file are inserted before them.
    type(text_t), allocatable, intent(inout) :: overrides(:)
    !> Set if another version of the program wrote the output, or if the stored text of the input is
    !> damaged.
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    type(text_t) :: override
    type(text_t), allocatable :: given(:)
    character(len=:), allocatable :: text, line
    integer :: k

    if (.not. is_file(source_of(output))) return
    call file%open(source_of(output), writable=.false.)
    call file%fetch_text(parameters_group//"overrides", text)
    if (checkpoint_number(file) /= none) then
      call check_program(file, error)                         ! another version may use other variable names
      if (.not. allocated(error)) call check_description(file, error)
    end if
    call file%close()
    if (allocated(error)) return
    call move_alloc(overrides, given)
    allocate (overrides(0))
    do while (text /= "")
      line = line_at(text, 1)
      text = text(min(len(line) + 1, len(text)) + 1:)
      if (change_of(variable_of(line)) == on_resume .and. index(variable_of(line), "change.") /= 1) cycle
      if (any([(variable_of(given(k)%text) == variable_of(line), k=1, size(given))])) cycle
      override%text = line
      overrides = [overrides, override]           ! see `command_line: take_option`
    end do
    overrides = [overrides, given]
  end subroutine recall_overrides

  !> Reads the text of the input from an output file. Checks that this text is undamaged and was
  !> written by this version of the program.
  subroutine recall_input(file, text, overrides, changes, error)
    type(hdf5_file_t), intent(inout) :: file
    character(len=:), allocatable, intent(out) :: text, overrides
    !> Changes in the text; not allocated if there are none.
    character(len=:), allocatable, intent(out) :: changes
    type(error_t), allocatable, intent(out) :: error

    text = ""
    overrides = ""
    call check_program(file, error)
    if (allocated(error)) return
    call file%fetch_text(parameters_group//"input", text)
    call file%fetch_text(parameters_group//"overrides", overrides)
    if (file%length(earlier_changes) >= 0) call file%fetch_text(earlier_changes, changes)
    call check_description(file, error)
  end subroutine recall_input

  !> Reports an error if the text of the input in the file was modified after the run had written
  !> it.
  subroutine check_description(file, error)
    type(hdf5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there

    call file%fetch_text(described, there)
    if (there /= description_checksum(file)) call file%check(-1, "be read", "its input is damaged")
    call file%report(error)
  end subroutine check_description

  !> Checksum of the texts in an output file that describe the input.
  function description_checksum(file) result(text)
    type(hdf5_file_t), intent(inout) :: file
    character(len=8) :: text
    character(len=:), allocatable :: input, overrides, changes

    changes = ""
    call file%fetch_text(parameters_group//"input", input)
    call file%fetch_text(parameters_group//"overrides", overrides)
    if (file%length(changes_at_work) >= 0) call file%fetch_text(changes_at_work, changes)
    text = checksum(transfer(input//eol//overrides//eol//changes, [0_int8]))
  end function description_checksum

  !> Name of the variable in an override.
  pure function variable_of(override) result(name)
    character(len=*), intent(in) :: override
    character(len=:), allocatable :: name

    name = lower_case(trim(adjustl(override(:index(override//"=", "=") - 1))))
  end function variable_of

  !> Creates both slots in a new file and writes a checkpoint of the present state to each.
  subroutine make_checkpoints(file, groups, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    type(progress_t), intent(in) :: progress

    call file%put(checkpoint_group//"program", program())
    call file%put(checkpoint_group//"input", fixed_input(groups))
    call file%put(described, description_checksum(file))
    call file%put(current, scalar, [2_int64])
    call put_slot(file, slots(1), sim, progress)
    call put_slot(file, slots(2), sim, progress)
    call file%link(slots(1), kept)
  end subroutine make_checkpoints

  !> Copies both slots to a new file, in the same order as `make_checkpoints`; `remove_last` depends
  !> on this order.
  subroutine copy_checkpoints(file, source)
    type(hdf5_file_t), intent(inout) :: file
    type(hdf5_file_t), intent(inout) :: source
    character(len=:), allocatable :: text
    type(series_t) :: words, there
    integer :: k

    call source%fetch_text(checkpoint_group//"program", text)
    call file%put(checkpoint_group//"program", text)
    call source%fetch_text(checkpoint_group//"input", text)
    call file%put(checkpoint_group//"input", text)
    call file%put(described, description_checksum(file))
    call file%put(current, scalar, [int(checkpoint_number(source), int64)])
    do k = 1, 2
      there = series_t(slots(k), long_integer)
      call there%find(source)
      words = there
      call words%make(file, there%capacity)
      call words%copy(file, source, there, there%capacity)
      call there%close(source)
      call words%close(file)
    end do
    call file%link(slots(1), kept)
  end subroutine copy_checkpoints

  !> Writes a checkpoint to the invalid slot, which becomes valid as soon as the data are on disk.
  subroutine put_checkpoint(file, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    type(progress_t), intent(in) :: progress
    integer :: slot
    logical :: done

    slot = merge(2, 1, checkpoint_number(file) == 1)
    call put_slot(file, slots(slot), sim, progress)
    call file%flush()
    call synchronize(file%path, done)
    if (.not. done) call file%check(-1, "be written", last_problem())
    call file%put(current, scalar, [int(slot, int64)])
    call file%flush()
  end subroutine put_checkpoint

  !> Writes the final checkpoint to the first slot and removes the second slot.
  subroutine put_last_checkpoint(file, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    type(progress_t), intent(in) :: progress

    call put_checkpoint(file, sim, progress)
    if (checkpoint_number(file) /= 1) call put_checkpoint(file, sim, progress)
    call file%remove_last(slots(2), before=slots(1))
  end subroutine put_last_checkpoint

  !> Marks a new file as the output of an aborted run, which cannot be resumed.
  subroutine mark_as_broken(file)
    type(hdf5_file_t), intent(inout) :: file

    call file%put(current, scalar, [int(none, int64)])
  end subroutine mark_as_broken

  !> Number of the valid slot; `none` if no slot is valid, -1 if the file does not contain the
  !> number.
  function checkpoint_number(file) result(number)
    type(hdf5_file_t), intent(inout) :: file
    integer :: number
    integer(int64) :: there(1)

    there = -1
    if (file%length(current) == 1) call file%fetch(current, 1, there)
    number = int(there(1))
  end function checkpoint_number

  !> True if a file contains both slots for checkpoints.
  function has_both_checkpoints(file) result(yes)
    type(hdf5_file_t), intent(inout) :: file
    logical :: yes

    yes = file%length(slots(2)) > 0
  end function has_both_checkpoints

  !> True if an unfinished output was written by an aborted run.
  function has_broken_off(output) result(yes)
    character(len=*), intent(in) :: output        !! path of the finished output
    logical :: yes
    type(hdf5_file_t) :: file

    call file%open(output//unfinished, writable=.false.)
    yes = checkpoint_number(file) == none
    call file%close()
  end function has_broken_off

  !> Size of one checkpoint [bytes].
  function checkpoint_bytes(sim) result(bytes)
    type(simulation_t), intent(inout) :: sim      !! unchanged on return
    integer(int64) :: bytes
    type(hdf5_file_t) :: no_file
    type(record_t) :: record
    type(progress_t) :: progress

    call exchange_all(no_file, record, sim, progress)
    bytes = 8*record%words
  end function checkpoint_bytes

  !> Writes a checkpoint to a slot; a missing slot is created.
  subroutine put_slot(file, name, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(in) :: progress
    type(record_t) :: record
    type(progress_t) :: copy

    record%name = name
    copy = progress
    if (file%length(name) < 0) then
      call exchange_all(file, record, sim, copy)
      call record%make(file)
    end if
    call record%begin(writing, file)
    call exchange_all(file, record, sim, copy)
  end subroutine put_slot

  !> Restores a run from its finished or unfinished output. On return, `progress` contains the
  !> numbers of samples in the output at the time of the checkpoint.
  subroutine read_checkpoint(output, input, evolution, sim, progress, finished, error)
    character(len=*), intent(in) :: output      !! path of the finished output
    type(run_input_t), intent(in) :: input
    class(evolution_t), intent(in) :: evolution !! dynamics that will continue the run
    !> On entry, a simulation with the box, contact law and species of the input.
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(out) :: progress
    logical, intent(out) :: finished            !! .true. if the run had finished
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    character(len=:), allocatable :: source

    source = source_of(output)
    finished = source == output
    if (.not. is_file(source)) then
      call fail(error, exit_files, source//": there is no run to continue")
      return
    end if
    progress = progress_t(input%settings)
    call file%open(source, writable=.false.)
    if (checkpoint_number(file) == none) then
      call fail(error, exit_files, source//": its run broke off and cannot be continued; without --resume it starts again")
    else
      call check_origin(file, input%groups, error)
    end if
    if (.not. allocated(error)) call read_slot(file, sim, progress, error)
    call file%close()
    if (allocated(error)) return
    if (.not. sim%features%own_sizes) sim%disk%radius = input%settings%species(sim%tag%species)%radius
    call check_changes(evolution, sim, source, error)
    call sim%simplify_masses()
    call sim%choose_units()
    call progress%schedule%look_ahead(sim)
  end subroutine read_checkpoint

  !> Reports an error if the scheduled changes before the checkpoint differ from the changes that
  !> the run has made, or if a later change is due at a time that has already passed. With time
  !> steps, a change within a step is made at the end of the step. A run saved within this step has
  !> not made the change yet.
  subroutine check_changes(evolution, sim, path, error)
    class(evolution_t), intent(in) :: evolution
    type(simulation_t), intent(in) :: sim
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error

    if (sim%changes_made < 0) then
      call fail(error, exit_usage, path//": belongs to another input: the changes (&change) before the time of the checkpoint, " &
        //written(sim%time())//", differ; --resume needs the unchanged input, --force starts the run again")
    else if (allocated(sim%schedule)) then
      if (sim%changes_made == size(sim%schedule)) return
      associate (change => sim%schedule(sim%changes_made + 1))
        if (sim%has_reached(evolution%pause_at(change%time))) call fail(error, exit_usage, change%origin &
          //": its time has passed: the run continues from time "//written(sim%time())//"; give a later time")
      end associate
    end if
  end subroutine check_changes

  !> Reads the valid checkpoint or, if it is damaged, the one in the other slot.
  subroutine read_slot(file, sim, progress, error)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    type(error_t), allocatable, intent(out) :: error
    type(record_t) :: record
    type(simulation_t) :: blank
    character(len=:), allocatable :: failure      ! reason why the valid checkpoint could not be read
    integer(int64) :: words
    integer :: number, trial

    failure = ""
    number = checkpoint_number(file)
    call sim%make_room(sum(sim%species%count))
    blank = sim
    do trial = 1, 2
      sim = blank
      record%name = slots(merge(2, 1, number == 2 .eqv. trial == 1))
      call record%begin(counting, file)
      call exchange_all(file, record, sim, progress)
      words = file%length(record%name)
      if (words > 0 .and. words /= record%words) then
        call fail(error, exit_files, file%path//": has other disks than the input now describes: an initial-configuration file " &
          //"(species.file) has changed; --resume needs it unchanged, --force starts the run again")
        return
      end if
      call record%begin(reading, file)
      call exchange_all(file, record, sim, progress)
      if (any(sim%tag%species < 1 .or. sim%tag%species > size(sim%species) .or. sim%tag%id < 1 .or. sim%tag%id > size(sim%tag))) &
        call file%check(-1, "be read: "//record%name//" has invalid species or numbers of disks")
      if (.not. allocated(file%failure)) return
      if (trial == 1) call move_alloc(file%failure, failure)
    end do
    call move_alloc(failure, file%failure)
    call file%report(error)
  end subroutine read_slot

  !> Reports an error if another version of the program wrote the checkpoint.
  subroutine check_program(file, error)
    type(hdf5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there

    call file%fetch_text(checkpoint_group//"program", there)
    if (there /= program() .and. .not. allocated(file%failure)) &
      call fail(error, exit_usage, file%path//": was written by "//legible(there)//", but this is "//program() &
      //"; continue the run with the program that started it")
    if (.not. allocated(error)) call file%report(error)
  end subroutine check_program

  !> Reports an error if another version of the program wrote the checkpoint, or if it belongs to a
  !> different input.
  subroutine check_origin(file, groups, error)
    type(hdf5_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there, here
    integer :: k

    call check_program(file, error)
    if (.not. allocated(error)) call file%fetch_text(checkpoint_group//"input", there)
    if (.not. allocated(error)) call file%report(error)
    if (allocated(error)) return
    here = fixed_input(groups)
    if (there == here) return
    do k = 1, min(len(there), len(here))
      if (there(k:k) /= here(k:k)) exit
    end do
    call fail(error, exit_usage, file%path//": belongs to another input: there "//legible(line_at(there, k)) &
      //", here "//legible(line_at(here, k))//"; --resume needs the unchanged input, --force starts the run again")
  end subroutine check_origin

end module checkpoint
