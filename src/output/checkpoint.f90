!> Checkpoints: what changes in a simulation, and how far its output has come, kept in the output itself. A run that goes
!> on from one gives the same data as one that never stopped, bit for bit.
!>
!> A file has room for two: one counts, the other is written next. When all of it has reached the disk, a number says that
!> it counts from now on. So there is a whole one at every moment, from the first on.
module checkpoint
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int32, int64, real64
  use build_info, only: build_flags
  use cadence, only: cadence_t
  use checksums, only: checksum
  use component_file, only: component_file_t
  use disks, only: angle_column, columns, mass_column, n_columns, radius_column, spin_column
  use errors, only: error_t, exit_files, exit_usage, fail
  use exact_sums, only: exact_sum_t
  use h5md_layout, only: checkpoint_group, provenance
  use hdf5_objects, only: hdf5_file_t, scalar
  use input_groups, only: most_written, group_t
  use variables, only: free_to_change
  use progress, only: progress_t
  use run_files, only: is_file, unfinished
  use settings, only: run_input_t, settings_t
  use simulation_state, only: simulation_t
  use system, only: synchronize
  use texts, only: growing_text_t, legible, written
  use version, only: program_version
  implicit none
  private
  public :: make_checkpoints, put_checkpoint, read_checkpoint

  character(len=*), parameter :: eol = new_line("a"), current = checkpoint_group//"current"

contains

  !> The program, with what makes two builds give different bits: the version, and arithmetic that is not exact.
  pure function program() result(text)
    character(len=:), allocatable :: text

    text = "ricochet "//program_version
    if (index(build_flags, "-ffp-contract=off") == 0) text = text//", contracted arithmetic"
    if (index(build_flags, "-ffast-math") + index(build_flags, "-Ofast") > 0) text = text//", fast math"
  end function program

  !> The input as it was used, without what is free to change: one variable to a line.
  pure function fixed_input(groups) result(text)
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text, line
    type(growing_text_t) :: growing
    integer :: k, g

    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. groups(g)%values(k)%is_set()) cycle
        line = groups(g)%value_line(k)
        if (.not. free_to_change(line)) call growing%add(line//eol)
      end do
    end do
    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. allocated(groups(g)%values(k)%reals)) cycle
        if (size(groups(g)%values(k)%reals) <= most_written) cycle      ! in the text with all digits
        call growing%add("checksum of "//trim(groups(g)%name)//"."//trim(groups(g)%instance)//"." &
          //trim(groups(g)%values(k)%name)//" = "//checksum(transfer(groups(g)%values(k)%reals, [0_int8]))//eol)
      end do
    end do
    text = growing%text()
  end function fixed_input

  !> Gives a new file its checkpoints: both are of the present state.
  subroutine make_checkpoints(file, groups, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    type(simulation_t), intent(inout) :: sim      !! stays as it is
    type(progress_t), intent(in) :: progress
    integer :: slot

    call file%put(checkpoint_group//"program", program())
    call file%put(checkpoint_group//"input", fixed_input(groups))
    do slot = 1, 2
      call put_slot(file, slot, sim, progress)
    end do
    call file%put(current, scalar, [1_int64])
  end subroutine make_checkpoints

  !> Writes a checkpoint in place of the one that does not count; it counts when it has reached the disk.
  subroutine put_checkpoint(file, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim      !! stays as it is
    type(progress_t), intent(in) :: progress
    integer(int64) :: slot(1)

    call file%fetch(current, 1, slot)
    slot = 3 - slot
    call put_slot(file, int(slot(1)), sim, progress)
    call settle()
    call file%put(current, scalar, slot)
    call settle()
  contains
    !> Returns when all that was written is on the disk.
    subroutine settle()
      logical :: done

      call file%flush()
      call synchronize(file%path, done)
      if (.not. done) call file%check(-1, "be written")
    end subroutine settle
  end subroutine put_checkpoint

  !> Writes one of the two.
  subroutine put_slot(file, slot, sim, progress)
    type(hdf5_file_t), intent(inout) :: file
    integer, intent(in) :: slot
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(in) :: progress
    type(component_file_t) :: components
    type(progress_t) :: copy

    components%hdf5 = file
    components%writing = .true.
    copy = progress
    call exchange_slot(components, slot, sim, copy)
    file = components%hdf5
  end subroutine put_slot

  !> Restores a run from its output, finished or not, which goes on with what `progress` says.
  subroutine read_checkpoint(path, input, sim, progress, finished, error)
    character(len=*), intent(in) :: path        !! of the output
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim    !! in: with the box, law and species of the input
    type(progress_t), intent(out) :: progress
    logical, intent(out) :: finished            !! the run had come to its end
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: source
    type(component_file_t) :: file
    type(simulation_t), allocatable :: blank
    integer(int64) :: slot(1)
    integer :: trial

    source = path//unfinished
    finished = .not. is_file(source)
    if (finished) source = path
    if (.not. is_file(source)) then
      call fail(error, exit_files, source//": there is no run to go on from")
      return
    end if
    call file%hdf5%open(source, writable=.false.)
    call check_origin(file, input%groups, error)
    if (.not. allocated(error)) call check_elements(file, input%settings, sim, error)
    if (.not. allocated(error)) then
      slot = 1
      call file%hdf5%fetch(current, 1, slot)
      blank = sim
      do trial = 1, 2                             ! the other one if that which counts is damaged
        if (allocated(file%hdf5%failure)) deallocate (file%hdf5%failure)
        sim = blank
        progress = progress_t(input%settings)
        call exchange_slot(file, merge(1, 2, slot(1) == 1), sim, progress)
        if (.not. allocated(file%hdf5%failure)) exit
        slot = 3 - slot
      end do
      call file%hdf5%report(error)
      if (.not. sim%own_sizes) sim%disk%radius = input%settings%species(sim%tag%species)%radius
      call sim%choose_units()
      call progress%frames%look_ahead(sim)
      call progress%observables%look_ahead(sim)
      if (finished) call file%hdf5%fetch_attribute(provenance//"@wall_time", progress%spent)
    end if
    call file%hdf5%close()
  end subroutine read_checkpoint

  !> Refuses to go on if disks had more than the input gives them now, or less: a starting file decides that, too.
  subroutine check_elements(file, settings, sim, error)
    type(component_file_t), intent(inout) :: file
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical :: there(2), here(2)
    integer :: k

    there = [(file%hdf5%length(checkpoint_group//"1/disks/"//trim(columns(k)%name)) >= 0, k=spin_column, angle_column)]
    here = [sim%law%rotation, sim%law%rotation .or. sim%law%orientation]
    if (all(there .eqv. here) .or. allocated(file%hdf5%failure)) return
    if (.not. any([(settings%species(k)%file /= "", k=1, size(settings%species))])) return
    call fail(error, exit_files, file%hdf5%path//": whether its disks turn was read from species.file, which is not what it " &
      //"was, or not there; --resume needs it as it was, --force instead starts over")
  end subroutine check_elements

  !> Refuses the checkpoint of another program or another input.
  subroutine check_origin(file, groups, error)
    type(component_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there, here
    integer :: k

    call file%hdf5%fetch_text(checkpoint_group//"program", there)
    if (there /= program() .and. .not. allocated(file%hdf5%failure)) then
      call fail(error, exit_usage, file%hdf5%path//": was written by "//legible(there)//", this is "//program())
      return
    end if
    call file%hdf5%fetch_text(checkpoint_group//"input", there)
    if (allocated(file%hdf5%failure)) return
    here = fixed_input(groups)
    if (there == here) return
    do k = 1, min(len(there), len(here))
      if (there(k:k) /= here(k:k)) exit
    end do
    call fail(error, exit_usage, file%hdf5%path//": belongs to another input: there "//legible(line_at(there, k)) &
      //", here "//legible(line_at(here, k))//"; --resume needs the input as it was there, --force instead starts over")
  end subroutine check_origin

  !> The line of a text in which a character stands, or would stand behind the end.
  pure function line_at(text, k) result(line)
    character(len=*), intent(in) :: text
    integer, intent(in) :: k                      !! place of the character
    character(len=:), allocatable :: line

    line = text(index(text(:k - 1), eol, back=.true.) + 1:)
    line = line(:index(line//eol, eol) - 1)
  end function line_at

  !> Writes or reads one of the two checkpoints, and the checksum of all its values.
  subroutine exchange_slot(file, slot, sim, progress)
    type(component_file_t), intent(inout) :: file
    integer, intent(in) :: slot
    type(simulation_t), intent(inout) :: sim      !! when read it must know its box and species
    type(progress_t), intent(inout) :: progress
    integer(int64) :: sum_there(1)

    file%group = checkpoint_group//written(slot)//"/"
    file%crc = 0
    call exchange_state(file, sim)
    call exchange_cadence(file, "frames", progress%frames)
    call exchange_cadence(file, "observables", progress%observables)
    call file%exchange("progress/events", progress%events)
    call file%exchange("progress/spent", progress%spent)
    sum_there = file%crc
    if (file%writing) call file%hdf5%put(file%name_of("checksum"), scalar, sum_there)
    if (.not. file%writing) call file%hdf5%fetch(file%name_of("checksum"), 1, sum_there)
    if (sum_there(1) /= file%crc) call file%hdf5%check(-1, "be read: the checksum of its state is wrong")
  end subroutine exchange_slot

  !> Writes or reads what changes in a simulation. When read it must know its box and species.
  subroutine exchange_state(file, sim)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    logical :: stored
    integer(int64) :: settled
    integer :: k

    call file%exchange("epoch", sim%epoch)
    call file%exchange("now", sim%now)
    settled = merge(1, 0, sim%settled)
    call file%exchange("settled", settled)
    sim%settled = settled == 1
    call file%exchange("epoch_begin", sim%epoch_begin)
    call file%exchange("epoch_end", sim%epoch_end)
    call file%exchange("epoch_events", sim%epoch_events)
    call file%exchange("blink", sim%blink)
    call file%exchange("last_advance", sim%last_advance)
    call file%exchange("events_then", sim%events_then)
    call file%exchange("start_energy", sim%start_energy)
    call file%exchange("kicks", sim%kicks)
    call exchange_tally(file, sim)
    if (.not. allocated(sim%disk)) call sim%make_room(sum(sim%species%count))
    do k = 1, n_columns
      stored = sim%has_column(k)
      if (k == radius_column .or. k == mass_column) stored = sim%own_sizes     ! else they follow from the input
      if (stored) call exchange_column(file, sim, k)
    end do
    if (sim%own_sizes .and. .not. file%writing) call sim%settle_masses()
  end subroutine exchange_state

  !> Writes or reads what collisions have gathered.
  subroutine exchange_tally(file, sim)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim

    call sim%tally%make_room(size(sim%box%surface))
    associate (tally => sim%tally)
      call file%exchange("events", tally%events)
      call file%exchange("collisions", tally%collisions)
      call exchange_sums(file, "sums", tally%sum)
      call file%exchange("surfaces/collisions", tally%surface%collisions)
      call exchange_sums(file, "surfaces/impulse1", tally%surface%impulse(1))
      call exchange_sums(file, "surfaces/impulse2", tally%surface%impulse(2))
      call exchange_sums(file, "surfaces/energy", tally%surface%energy)
    end associate
  end subroutine exchange_tally

  !> Writes or reads sums: the halves of whole numbers of units, which may grow to twice as much.
  subroutine exchange_sums(file, name, sums)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(exact_sum_t), intent(inout) :: sums(:)
    integer(int64) :: halves(2, size(sums))
    integer :: k

    do k = 1, size(sums)
      halves(:, k) = transfer(sums(k)%units, halves)
    end do
    call file%exchange(name//"/low", halves(1, :))
    call file%exchange(name//"/high", halves(2, :))
    do k = 1, size(sums)
      sums(k)%units = transfer(halves(:, k), sums(k)%units)
    end do
  end subroutine exchange_sums

  !> Writes or reads a column of `disks: columns`.
  subroutine exchange_column(file, sim, k)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: k
    real(real64), allocatable :: values(:)
    integer(int32), allocatable :: numbers(:)
    integer(int64), allocatable :: long_numbers(:)

    allocate (values, source=sim%values_of(k))
    associate (name => "disks/"//trim(columns(k)%name))
      select case (columns(k)%kind)
      case ("real")
        call file%exchange(name, values)
      case ("int")
        numbers = int(values, int32)
        call file%exchange(name, numbers)
        values = numbers
      case default                                 ! "long"
        long_numbers = int(values, int64)
        call file%exchange(name, long_numbers)
        values = long_numbers
      end select
    end associate
    if (.not. file%writing) call sim%take_values(k, values)
  end subroutine exchange_column

  !> Writes or reads how far a cadence has come; its steps are part of the input, and when the next sample is due
  !> follows from them.
  subroutine exchange_cadence(file, name, cadence)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(cadence_t), intent(inout) :: cadence

    call file%exchange("progress/"//name//"/count", cadence%count)
    call file%exchange("progress/"//name//"/last_events", cadence%last_events)
    call file%exchange("progress/"//name//"/last_time", cadence%last_time)
  end subroutine exchange_cadence

end module checkpoint
