!> What a checkpoint holds: who wrote it, for which input, all that changes in a simulation, and how far its output has
!> come. It is written to a file of its own, and into the output of a finished run.
module checkpoint_contents
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int32, int64, most_exact, never, real64
  use build_info, only: build_flags
  use cadence, only: cadence_t
  use component_file, only: component_file_t
  use disks, only: clocks, columns, id_column, image_column, mass_column, met_column, n_columns, radius_column, species_column
  use errors, only: error_t, exit_usage, fail
  use exact_sums, only: exact_sum_t
  use h5md_layout, only: checkpoint_group, provenance
  use hdf5_objects, only: hdf5_file_t, scalar
  use parameter_values, only: most_written, parameter_group_t
  use partners, only: obstacle_code
  use progress, only: progress_t
  use sample_track, only: samples_t
  use sealed_file, only: checksum
  use simulation_state, only: simulation_t
  use texts, only: growing_text_t, legible, written
  use version, only: program_version
  implicit none
  private
  public :: check_origin, exchange_contents, exchange_final_state, is_free, put_final_state, put_origin

  character(len=*), parameter :: eol = new_line("a")

  !> Variables, or beginnings of their names, that may be another when a run goes on: how it is done, when it ends, what
  !> is written. They have no effect on the trajectory.
  character(len=*), parameter :: free_to_change(*) = [character(len=25) :: "run.title", "run.search", "run.queue", "run.threads", &
    "stop.", "output.frames_every_", "output.observables_every_", "output.checkpoint_every"]

  ! Ranges of what is read
  real(real64), parameter :: most = 1.0e300_real64          !! of sums: two of them do not overflow
  real(real64), parameter :: times(2) = [0.0_real64, clocks(2)]
  real(real64), parameter :: anything(2) = [-most, most], not_negative(2) = [0.0_real64, most]
  integer(int64), parameter :: counts(2) = [0_int64, int(most_exact, int64)]

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
    type(parameter_group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text, line
    type(growing_text_t) :: growing
    integer :: k, g

    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. groups(g)%values(k)%is_set()) cycle
        line = groups(g)%value_line(k)
        if (.not. is_free(line)) call growing%add(line//eol)
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

  !> Whether a line `variable = value` is of a variable that may change.
  pure function is_free(line) result(yes)
    character(len=*), intent(in) :: line
    logical :: yes
    integer :: k

    yes = .false.
    do k = 1, size(free_to_change)
      yes = yes .or. index(line, trim(free_to_change(k))) == 1
    end do
  end function is_free

  !> Writes what `check_origin` will compare.
  subroutine put_origin(file, groups)
    type(component_file_t), intent(inout) :: file
    type(parameter_group_t), intent(in) :: groups(:)

    call file%hdf5%put(file%name_of("program"), program())
    call file%hdf5%put(file%name_of("input"), fixed_input(groups))
  end subroutine put_origin

  !> Refuses the checkpoint of another program or another input.
  subroutine check_origin(file, groups, error)
    type(component_file_t), intent(inout) :: file
    type(parameter_group_t), intent(in) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there, here
    integer :: k

    call file%hdf5%fetch_text(file%name_of("program"), there)
    if (there /= program() .and. .not. allocated(file%hdf5%failure)) then
      call fail(error, exit_usage, file%hdf5%path//": was written by "//legible(there)//", this is "//program())
      return
    end if
    call file%hdf5%fetch_text(file%name_of("input"), there)
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

  !> Writes or reads all of a checkpoint in a file of its own. When read the simulation must know its box and species.
  subroutine exchange_contents(file, sim, progress)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    integer :: k

    call exchange_state(file, sim)
    call exchange_progress(file, progress)
    call file%exchange("progress/spent", progress%spent, not_negative)
    call file%exchange("progress/replaced", progress%replaced, [-1_int64, counts(2)])
    do k = 1, size(progress%unwritten)
      call exchange_samples(file, "unwritten/"//written(k), progress%unwritten(k))
    end do
  end subroutine exchange_contents

  !> Writes or reads the checkpoint in the output of a finished run. It depends on the input alone: the time that the run
  !> took is not in it. A checksum of 0 says that the run has not finished.
  subroutine exchange_final_state(file, sim, progress, finished)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    logical, intent(in) :: finished
    integer(int64) :: sum_there(1)

    file%group = checkpoint_group
    call exchange_state(file, sim)
    call exchange_progress(file, progress)
    sum_there = merge(file%crc, 0_int64, finished)
    if (file%writing) call file%hdf5%put(file%name_of("checksum"), scalar, sum_there)
    if (.not. file%writing) call file%hdf5%fetch(file%name_of("checksum"), 1, sum_there)
    if (sum_there(1) /= file%crc .and. .not. (file%writing .or. allocated(file%flaw))) &
      file%flaw = "the checksum of its last state is wrong"
    if (.not. file%writing) call file%hdf5%fetch_attribute(provenance//"@wall_time", progress%spent)
  end subroutine exchange_final_state

  !> Writes it into a file that has it already, or not yet.
  subroutine put_final_state(output, groups, sim, progress, finished)
    type(hdf5_file_t), intent(inout) :: output
    type(parameter_group_t), intent(in) :: groups(:)
    type(simulation_t), intent(inout) :: sim        !! stays as it is
    type(progress_t), intent(in) :: progress
    logical, intent(in) :: finished
    type(component_file_t) :: file
    type(progress_t) :: written

    file%hdf5 = output
    file%writing = .true.
    file%group = checkpoint_group
    call put_origin(file, groups)
    written = progress
    call exchange_final_state(file, sim, written, finished)
    output = file%hdf5
  end subroutine put_final_state

  !> Writes or reads what changes in a simulation. When read it must know its box and species.
  subroutine exchange_state(file, sim)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    logical :: stored
    integer(int64) :: settled
    integer :: k

    call file%exchange("epoch", sim%epoch, times)
    call file%exchange("now", sim%now, times)
    settled = merge(1, 0, sim%settled)
    call file%exchange("settled", settled, [0_int64, 1_int64])
    sim%settled = settled == 1
    call file%exchange("epoch_begin", sim%epoch_begin, times)
    call file%exchange("epoch_end", sim%epoch_end, [0.0_real64, never])
    call file%exchange("epoch_events", sim%epoch_events, counts)
    call file%exchange("blink", sim%blink, not_negative)
    call file%exchange("last_advance", sim%last_advance, clocks)
    call file%exchange("events_then", sim%events_then, counts)
    call file%exchange("start_energy", sim%start_energy, not_negative)
    call file%exchange("kicks", sim%kicks, counts)
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

    call sim%tally%make_room(sim%box%n_surfaces())
    associate (tally => sim%tally)
      call file%exchange("events", tally%events, counts)
      call file%exchange("collisions", tally%collisions, counts)
      call exchange_sums(file, "sums", tally%sum)
      call file%exchange("surfaces/collisions", tally%surface%collisions, counts)
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
    integer(int64), parameter :: lowest = ibset(0_int64, 63)
    integer(int64) :: halves(2, size(sums))
    integer :: k

    do k = 1, size(sums)
      halves(:, k) = transfer(sums(k)%units, halves)
    end do
    call file%exchange(name//"/low", halves(1, :), [lowest, huge(lowest)])
    call file%exchange(name//"/high", halves(2, :), [-2_int64**62, 2_int64**62 - 1])
    do k = 1, size(sums)
      sums(k)%units = transfer(halves(:, k), sums(k)%units)
    end do
  end subroutine exchange_sums

  !> Writes or reads a column of `disks: columns`.
  subroutine exchange_column(file, sim, k)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: k
    real(real64) :: range(2)
    real(real64), allocatable :: values(:)
    integer(int32), allocatable :: numbers(:)
    integer(int64), allocatable :: long_numbers(:)

    range = range_of(sim, k)
    allocate (values, source=sim%values_of(k))
    associate (name => "disks/"//trim(columns(k)%name))
      select case (columns(k)%kind)
      case ("real")
        call file%exchange(name, values, range)
      case ("int")
        numbers = int(values, int32)
        call file%exchange(name, numbers, int(range, int64))
        values = numbers
      case default                                 ! "long"
        long_numbers = int(values, int64)
        call file%exchange(name, long_numbers, int(range, int64))
        values = long_numbers
      end select
    end associate
    if (.not. file%writing) call sim%take_values(k, values)
  end subroutine exchange_column

  !> Lowest and highest value of a column.
  pure function range_of(sim, k) result(range)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: k
    real(real64) :: range(2)

    select case (k)
    case (species_column)
      range = [1, size(sim%species)]
    case (id_column)
      range = [1, sim%n_disks()]
    case (met_column)
      range = [obstacle_code(sim%box%n_obstacles()), sim%n_disks()]
    case (image_column, image_column + 1)
      range = merge(columns(k)%range, 0.0_real64, sim%box%periodic(k - image_column + 1))
    case default
      range = columns(k)%range
    end select
  end function range_of

  !> Writes or reads how far the output has come.
  subroutine exchange_progress(file, progress)
    type(component_file_t), intent(inout) :: file
    type(progress_t), intent(inout) :: progress

    call exchange_cadence(file, "frames", progress%frames)
    call exchange_cadence(file, "observables", progress%observables)
    call file%exchange("progress/events", progress%events, counts)
  end subroutine exchange_progress

  !> Writes or reads how far a cadence has come; its steps are part of the input, and when the next sample is due
  !> follows from them.
  subroutine exchange_cadence(file, name, cadence)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(cadence_t), intent(inout) :: cadence

    call file%exchange("progress/"//name//"/count", cadence%count, [1_int64, counts(2)])
    call file%exchange("progress/"//name//"/last_events", cadence%last_events, counts)
    call file%exchange("progress/"//name//"/last_time", cadence%last_time, times)
  end subroutine exchange_cadence

  !> Writes or reads samples, often none.
  subroutine exchange_samples(file, name, samples)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(samples_t), intent(inout) :: samples
    real(real64), allocatable :: values(:)
    integer(int64) :: extent(2)
    integer :: status

    if (file%writing) then
      if (samples%count() > 0) call file%hdf5%put(name, shape(samples%values), [samples%values])
    else if (size(file%hdf5%extents(name)) == 2) then
      extent = file%hdf5%extents(name)
      status = -1
      if (minval(extent) > 0 .and. product(real(extent, real64)) < huge(0)) &
        allocate (values(product(extent)), stat=status)
      call file%hdf5%check(-abs(status), "be read: "//name)
      if (status /= 0) return
      call file%exchange(name, values, anything)
      samples%values = reshape(values, extent)
    end if
  end subroutine exchange_samples

end module checkpoint_contents
