!> Checkpoints. A checkpoint contains the present state of a simulation and the progress of its output, and is stored in the output
!> file. A resumed run yields bit-identical data to a run without interruption.
!>
!> During a run the output file contains two slots, which are datasets with space for one checkpoint each. One of the two slots is
!> valid, and a new checkpoint is written to the other slot. After the new checkpoint has been stored on the disk, a number in the
!> file is changed, so that the slot with the new checkpoint becomes the valid slot. The file therefore contains a complete
!> checkpoint at all times. Each checkpoint contains a checksum. The output of a finished run contains one slot. The output of a run
!> that broke off contains no valid checkpoint.
module checkpoint
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int128, int32, int64, real64
  use build_info, only: build_flags
  use sampling_schedule, only: progress_t
  use errors, only: error_t, exit_files, exit_usage, fail
  use exact_sums, only: exact_sum_t
  use h5md_layout, only: changes_at_work, checkpoint_group, parameters_group
  use hdf5_objects, only: hdf5_file_t, scalar
  use hdf5_series, only: long_integer, series_t
  use input_groups, only: group_t, most_written
  use record, only: checksum, counting, reading, record_t, writing
  use run_files, only: is_file, source_of, unfinished
  use settings, only: run_input_t
  use side_motion, only: piston
  use simulation_state, only: simulation_t
  use system, only: last_problem, synchronize
  use texts, only: eol, growing_text_t, legible, line_at, lower_case, text_t, written
  use variables, only: change_of, on_resume, table
  use version, only: program_version
  implicit none
  private
  public :: checkpoint_bytes, copy_checkpoints, has_both_checkpoints, has_broken_off, make_checkpoints, mark_as_broken
  public :: put_checkpoint, put_last_checkpoint, read_checkpoint, recall_overrides, recall_input

  integer, parameter :: layout = 10               !! version of the layout of checkpoints; no other version can be read
  character(len=*), parameter :: slots(2) = checkpoint_group//["1", "2"]
  character(len=*), parameter :: current = checkpoint_group//"current"     !! number of the valid slot, or `none`
  integer, parameter :: none = 0
  character(len=*), parameter :: described = checkpoint_group//"input_checksum"

  !> Path of a hard link to the first slot. The link is created after all other links of the file and is never deleted. To delete
  !> the last link of a group, HDF5 first overwrites the name of the link and then removes the link from a list. If the program were
  !> killed between the overwriting of the name and the removal of the link, h5dump could not list the file.
  character(len=*), parameter :: kept = checkpoint_group//"kept"

contains

  !> A text that identifies the program. The text contains the version of the layout of checkpoints, and those compiler flags that
  !> permit inexact arithmetic and can therefore change the results.
  pure function program() result(text)
    character(len=:), allocatable :: text

    text = "ricochet "//program_version//", checkpoint "//written(layout)
    if (index(build_flags, "-ffp-contract=off") == 0) text = text//", contracted arithmetic"
    if (index(build_flags, "-ffast-math") + index(build_flags, "-Ofast") > 0) text = text//", fast math"
  end function program

  !> Text of the input that the run uses, with one variable per line. The text does not contain variables that may change on
  !> `--resume`.
  pure function fixed_input(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: k, g

    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (groups(g)%values(k)%name == "relative_to") cycle           ! not needed, because mass and radius have final values
        if (.not. groups(g)%values(k)%is_set() .or. table(groups(g)%values(k)%row)%may_change == on_resume) cycle
        call growing%add(groups(g)%value_line(k)//eol)
      end do
    end do
    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. allocated(groups(g)%values(k)%reals)) cycle
        if (size(groups(g)%values(k)%reals) <= most_written) cycle  ! `value_line` contains all values of a short list
        if (table(groups(g)%values(k)%row)%may_change == on_resume) cycle
        call growing%add("checksum of "//trim(groups(g)%name)//"."//trim(groups(g)%instance)//"." &
          //trim(groups(g)%values(k)%name)//" = "//checksum(transfer(groups(g)%values(k)%reals, [0_int8]))//eol)
      end do
    end do
    text = growing%text()
  end function fixed_input

  !> Adds overrides from the command line of the original run, so that users need not repeat these overrides on `--resume`.
  !> Overrides of variables that may change on `--resume` are not added.
  subroutine recall_overrides(output, overrides, error)
    character(len=*), intent(in) :: output                       !! path of the output
    !> Overrides of the present command line, in the form GROUP.VARIABLE=VALUE. The procedure inserts the overrides from the output
    !> file before the overrides of the present command line.
    type(text_t), allocatable, intent(inout) :: overrides(:)
    !> Error if another version of the program wrote the output, or if the text of the input in the output file is damaged.
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
      call check_program(file, error)                         ! another version may have other names of variables
      if (.not. allocated(error)) call check_description(file, error)
    end if
    call file%close()
    if (allocated(error)) return
    call move_alloc(overrides, given)
    allocate (overrides(0))
    do while (text /= "")
      line = line_at(text, 1)
      text = text(min(len(line) + 1, len(text)) + 1:)
      if (change_of(variable_of(line)) == on_resume) cycle
      if (any([(variable_of(given(k)%text) == variable_of(line), k=1, size(given))])) cycle
      override%text = line
      overrides = [overrides, override]           ! see `command_line: take_option`
    end do
    overrides = [overrides, given]
  end subroutine recall_overrides

  !> Reads the texts of the input from an output file. The procedure checks that the texts are undamaged and that this version of
  !> the program wrote the texts.
  subroutine recall_input(file, text, overrides, changes, error)
    type(hdf5_file_t), intent(inout) :: file
    character(len=:), allocatable, intent(out) :: text, overrides
    character(len=:), allocatable, intent(out) :: changes         !! changes made during the run; not allocated if there are none
    type(error_t), allocatable, intent(out) :: error

    text = ""
    overrides = ""
    call check_program(file, error)
    if (allocated(error)) return
    call file%fetch_text(parameters_group//"input", text)
    call file%fetch_text(parameters_group//"overrides", overrides)
    if (file%length(changes_at_work) >= 0) call file%fetch_text(changes_at_work, changes)
    call check_description(file, error)
  end subroutine recall_input

  !> Reports an error if the texts of the input in the file have changed after the run wrote the texts.
  subroutine check_description(file, error)
    type(hdf5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there

    call file%fetch_text(described, there)
    if (there /= description_checksum(file)) call file%check(-1, "be read", "its input is damaged")
    call file%report(error)
  end subroutine check_description

  !> Checksum of the texts that describe the input in an output file.
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

  !> Name of the variable that an override sets.
  pure function variable_of(override) result(name)
    character(len=*), intent(in) :: override
    character(len=:), allocatable :: name

    name = lower_case(trim(adjustl(override(:index(override//"=", "=") - 1))))
  end function variable_of

  !> Creates both slots in a new file and writes a checkpoint of the present state to each slot.
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

  !> Copies both slots (datasets for one checkpoint each) of another file into a new file. The slots are created in the same order
  !> as in `make_checkpoints`, because `remove_last` depends on this order.
  subroutine copy_checkpoints(file, source)
    type(hdf5_file_t), intent(inout) :: file
    type(hdf5_file_t), intent(inout) :: source
    character(len=:), allocatable :: text
    type(series_t) :: words
    integer :: k

    call source%fetch_text(checkpoint_group//"program", text)
    call file%put(checkpoint_group//"program", text)
    call source%fetch_text(checkpoint_group//"input", text)
    call file%put(checkpoint_group//"input", text)
    call file%put(described, description_checksum(file))
    call file%put(current, scalar, [int(checkpoint_number(source), int64)])
    do k = 1, 2
      words = series_t(slots(k), long_integer)
      call words%find(source)
      call words%make(file, words%capacity)
      call words%copy(file, source, words%capacity)
    end do
    call file%link(slots(1), kept)
  end subroutine copy_checkpoints

  !> Writes a checkpoint to the slot that is not valid. After the checkpoint has been stored on the disk, the slot that contains the
  !> new checkpoint is marked as valid.
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

  !> Marks a new file as the output of a run that broke off; such a run cannot be resumed.
  subroutine mark_as_broken(file)
    type(hdf5_file_t), intent(inout) :: file

    call file%put(current, scalar, [int(none, int64)])
  end subroutine mark_as_broken

  !> Number of the slot that contains the valid checkpoint. The result is `none` if no slot is valid, and -1 if the file does not
  !> contain the number of the valid slot.
  function checkpoint_number(file) result(number)
    type(hdf5_file_t), intent(inout) :: file
    integer :: number
    integer(int64) :: there(1)

    there = -1
    if (file%length(current) == 1) call file%fetch(current, 1, there)
    number = int(there(1))
  end function checkpoint_number

  !> Whether a file contains the second of the two slots for checkpoints.
  function has_both_checkpoints(file) result(yes)
    type(hdf5_file_t), intent(inout) :: file
    logical :: yes

    yes = file%length(slots(2)) > 0
  end function has_both_checkpoints

  !> Whether an unfinished output was written by a run that broke off.
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

  !> Writes a checkpoint to a slot, and creates the slot if it does not exist.
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
    call record%begin(writing)
    call exchange_all(file, record, sim, copy)
  end subroutine put_slot

  !> Restores a run from its finished or unfinished output. The argument `progress` returns how many samples the output contained at
  !> the time of the checkpoint.
  subroutine read_checkpoint(output, input, sim, progress, finished, error)
    character(len=*), intent(in) :: output      !! path of the finished output
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim    !! in: simulation with the box, contact law and species of the input
    type(progress_t), intent(out) :: progress
    logical, intent(out) :: finished            !! .true. if the run had already finished
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
    call sim%simplify_masses()
    call sim%choose_units()
    call progress%schedule%look_ahead(sim)
  end subroutine read_checkpoint

  !> Reads the valid checkpoint. If the valid checkpoint is damaged, the checkpoint in the other slot is read.
  subroutine read_slot(file, sim, progress, error)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    type(error_t), allocatable, intent(out) :: error
    type(record_t) :: record
    type(simulation_t) :: blank
    character(len=:), allocatable :: failure      ! why the valid checkpoint could not be read
    integer(int64) :: words
    integer :: number, trial

    number = checkpoint_number(file)
    call sim%make_room(sum(sim%species%count))
    blank = sim
    do trial = 1, 2
      sim = blank
      record%name = slots(merge(2, 1, number == 2 .eqv. trial == 1))
      call record%begin(counting)
      call exchange_all(file, record, sim, progress)
      words = file%length(record%name)
      if (words > 0 .and. words /= record%words) then
        call fail(error, exit_files, file%path//": has other disks than the input now describes: a starting file " &
          //"(species.file) has changed; --resume needs it unchanged, --force starts the run again")
        return
      end if
      call record%begin(reading)
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

  !> Reports an error if another version of the program wrote the checkpoint, or if the checkpoint belongs to a different input.
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

  !> Counts, writes or reads the numbers of a checkpoint. Before a checkpoint is read, the box and the species of the simulation
  !> must be set.
  subroutine exchange_all(file, record, sim, progress)
    type(hdf5_file_t), intent(inout) :: file      !! the file is not accessed if the numbers are only counted
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout), target :: sim
    type(progress_t), intent(inout) :: progress
    integer(int64) :: settled
    integer :: k

    call record%exchange(file, sim%box%epoch)
    call record%exchange(file, sim%now)
    settled = merge(1, 0, sim%events_done)
    call record%exchange(file, settled)
    sim%events_done = settled == 1
    call record%exchange(file, sim%epoch_begin)
    call record%exchange(file, sim%epoch_end)
    call record%exchange(file, sim%epoch_events)
    call record%exchange(file, sim%negligible_time)
    call record%exchange(file, sim%last_advance)
    call record%exchange(file, sim%events_then)
    call record%exchange(file, sim%start_energy)
    call record%exchange(file, sim%reference_energy)
    call record%exchange(file, sim%typical_speed2)
    call record%exchange(file, sim%kicks)
    if (allocated(sim%recycled)) call record%exchange(file, sim%recycled)
    call record%exchange(file, sim%changes)
    call exchange_tally()
    if (any(sim%box%surface%motion%kind == piston)) then
      call record%exchange(file, sim%box%side%clock)
      call record%exchange(file, sim%box%side%position)
      call record%exchange(file, sim%box%side%velocity)
    end if
    call exchange_disks()
    do k = 1, size(progress%schedule)
      ! The times of the next samples are not stored, because they follow from the intervals in the input.
      associate (schedule => progress%schedule(k))
                                                  ! numbers
        call record%exchange(file, schedule%count)
        call record%exchange(file, schedule%last_events)
        call record%exchange(file, schedule%last_time)
      end associate
    end do
    call record%exchange(file, progress%events)
    call record%seal(file)
  contains

    !> Counts, writes or reads the sums and counters over all events.
    subroutine exchange_tally()
      call sim%tally%make_room(size(sim%box%surface))
      associate (tally => sim%tally)
        call record%exchange(file, tally%events)
        call record%exchange(file, tally%collisions)
        call record%exchange(file, tally%simultaneous)
        call record%exchange(file, tally%series)
        call record%exchange(file, tally%collapse)
        call exchange_sums(tally%sum)
        call record%exchange(file, tally%surface_collisions)
        do k = 1, size(tally%surface_sums, 1)
          call exchange_sums(tally%surface_sums(k, :))
        end do
      end associate
    end subroutine exchange_tally

    !> Counts, writes or reads the 128-bit integers that represent exact sums.
    subroutine exchange_sums(sums)
      type(exact_sum_t), intent(inout) :: sums(:)
      integer(int128), target :: parts(2*size(sums))

      parts = [sums%units, sums%rare]
      call record%pass(file, c_loc(parts), 2*size(parts))
      sums%units = parts(:size(sums))
      sums%rare = parts(size(sums) + 1:)
    end subroutine exchange_sums

    !> Counts, writes or reads the state of the disks.
    subroutine exchange_disks()
      real(real64), allocatable :: mass(:)

      associate (disk => sim%disk, tag => sim%tag)
        call record%exchange(file, disk%x(1))
        call record%exchange(file, disk%x(2))
        call record%exchange(file, disk%v(1))
        call record%exchange(file, disk%v(2))
        call record%exchange(file, disk%clock)
        call exchange_short(tag%species)
        call exchange_short(tag%id)
        call record%exchange(file, tag%collisions)
        call exchange_short(tag%last_partner)
        ! If disks have no individual masses and radii, the radii are not stored, because the input contains the radius of each
        ! species.
        if (sim%features%own_sizes) call record%exchange(file, disk%radius)
      end associate
      settled = merge(1, 0, sim%events_done)
      do k = 1, merge(1, 0, sim%features%rotation) + merge(2, 0, sim%features%orientation)
        ! Copies of `settled` make the length of the record depend on whether the run has rotation and orientation, so that a
        ! checkpoint of a run with other features is detected.
        call record%exchange(file, settled)
      end do
      if (allocated(sim%series)) call record%pass(file, c_loc(sim%series(1)), size(sim%series)*storage_size(sim%series)/64)
      if (allocated(sim%extra)) call record%pass(file, c_loc(sim%extra(1)), size(sim%extra)*storage_size(sim%extra)/64)
      if (.not. sim%features%own_sizes) return
      mass = sim%masses()                       ! individual masses are stored even if each mass equals the mass of the species
      call record%exchange(file, mass)
      if (record%mode == reading) sim%own_mass = mass
    end subroutine exchange_disks

    !> Counts, writes or reads 32-bit integers, which are stored with 64 bits.
    subroutine exchange_short(values)
      integer(int32), intent(inout) :: values(:)
      integer(int64) :: words(size(values))

      words = values
      call record%exchange(file, words)
      values = int(words, int32)
    end subroutine exchange_short
  end subroutine exchange_all

end module checkpoint
