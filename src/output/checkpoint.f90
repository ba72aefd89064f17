!> Checkpoints: OUT.chk.h5 holds what changes in a simulation, and how far its output has come. A run that goes
!> on from it gives the same data as one that never stopped, bit for bit.
!>
!> A checkpoint is written under another name, read back, and renamed, so there is a complete one at every
!> moment. The file begins with a checksum of all that follows, which is verified before anything is read.
module checkpoint
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int64, never, real64
  use build_info, only: build_flags
  use cadence, only: cadence_t
  use checkpoint_checks, only: flaw_of_progress, flaw_of_state
  use component_file, only: component_file_t
  use disk_room, only: checkpoint_room
  use errors, only: error_t, exit_files, exit_usage, fail
  use exact_sums, only: exact_sum_t
  use hdf5_objects, only: hdf5_file_t
  use output, only: output_t, progress_t
  use parameter_values, only: parameter_group_t, values_text
  use partners, only: n_sides, obstacle_code, side_name
  use run_files, only: check_places, current_checkpoint, is_file, new_checkpoint, previous_checkpoint, run_file, unfinished
  use run_input, only: run_input_t
  use sample_track, only: samples_t
  use sealed_file, only: checksum, flaw_of, seal
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use system, only: free_bytes, last_problem, link_file, move_file, remove_file, synchronize
  use texts, only: legible, written
  use version, only: program_version
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

  integer, parameter :: reserved = 512          !! bytes before the HDF5 part, for the checksum
  character(len=*), parameter :: title = "ricochet checkpoint 3"
  character(len=*), parameter :: eol = new_line("a")

  !> Variables that change how a run is done but not its result: they may differ when it goes on.
  character(len=*), parameter :: free_to_change(5) = [character(len=26) :: "run.title = ", &
    "run.search = ", "run.queue = ", "stop.wall_clock = ", "output.checkpoint_every = "]

  ! Ranges of what is read
  real(real64), parameter :: longest = 1.0e101_real64       !! of times; inputs have numbers up to 1e100
  real(real64), parameter :: most = 1.0e300_real64          !! of sums: two of them do not overflow
  real(real64), parameter :: times(2) = [0.0_real64, longest], clocks(2) = [-longest, longest]
  real(real64), parameter :: sums(2) = [-most, most], not_negative(2) = [0.0_real64, most]
  real(real64), parameter :: speeds(2) = [-1.0e102_real64, 1.0e102_real64]
  real(real64), parameter :: places(2) = [-never, never]    !! where a disk collided last, any number of periods away
  integer(int64), parameter :: counts(2) = [0_int64, 2_int64**53]   !! exact also as reals

contains

  !> Writes the checkpoint of a run; the previous one is kept as OUT.chk_prev.h5.
  subroutine write_checkpoint(sim, output, error)
    type(simulation_t), intent(inout) :: sim    !! stays as it is
    type(output_t), intent(inout) :: output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: new, current
    type(component_file_t) :: file
    type(progress_t) :: progress
    logical :: done

    new = run_file(output%path, new_checkpoint)
    current = run_file(output%path, current_checkpoint)
    call output%save(progress, error)
    if (.not. allocated(error)) call check_room(current, sim%n_disks(), error)
    if (allocated(error)) return
    file%writing = .true.
    call file%hdf5%create(new, final_path=current, reserved=reserved)
    call file%hdf5%put("program", program())
    call file%hdf5%put("input", fixed_input(output%input%groups))
    call exchange_state(file, sim)
    call exchange_progress(file, progress)
    call file%hdf5%close()
    call file%hdf5%report(error)
    if (.not. allocated(error)) then
      call seal(new, title, done)
      if (done) call synchronize(new, done)
      if (done) call link_file(current, run_file(output%path, previous_checkpoint))
      if (done) call move_file(new, current, done)
      if (.not. done) call fail(error, exit_files, current//": cannot be written: "//last_problem())
    end if
    if (allocated(error)) call remove_file(new)
  end subroutine write_checkpoint

  !> Fails if a checkpoint of n disks does not fit onto the disk.
  subroutine check_room(path, n, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: n
    type(error_t), allocatable, intent(out) :: error

    if (free_bytes(path) < checkpoint_room(n)) call fail(error, exit_files, path &
      //": cannot be written: "//written(checkpoint_room(n))//" bytes needed, " &
      //written(free_bytes(path))//" bytes free")
  end subroutine check_room

  !> Restores a run from its checkpoint: the simulation, and the output open and ready to go on.
  subroutine read_checkpoint(path, input, sim, output, error)
    character(len=*), intent(in) :: path        !! of the output
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim    !! in: with the box, law and species of the input
    type(output_t), intent(inout) :: output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: current, flaw
    type(component_file_t) :: file
    type(progress_t) :: progress
    logical :: finished

    current = run_file(path, current_checkpoint)
    finished = is_file(path)
    if (finished) finished = .not. is_file(run_file(path, unfinished))
    if (finished) then
      call fail(error, exit_files, path//": is a finished run; there is nothing to resume")
    else if (.not. is_file(current)) then
      call fail(error, exit_files, current//": there is no checkpoint to go on from; "//advice(path))
    else
      flaw = flaw_of(current, title)
      if (flaw /= "") call fail(error, exit_usage, current//": "//flaw//"; "//advice(path))
    end if
    if (allocated(error)) return
    call file%hdf5%open(current, writable=.false.)
    call check_origin(file%hdf5, input%groups, error)
    if (.not. allocated(error)) then
      call exchange_state(file, sim)
      progress = progress_t(input%settings%output)
      call exchange_progress(file, progress)
      call complete(file, input%settings, sim, progress, flaw)
      if (flaw /= "") call fail(error, exit_usage, current//": is damaged: "//flaw//"; "//advice(path))
    end if
    call file%hdf5%close()
    if (.not. allocated(error)) call output%resume(path, input, sim, progress, error)
  end subroutine read_checkpoint

  !> Derives the rest of what has been read if all of it can be right.
  subroutine complete(file, settings, sim, progress, flaw)
    type(component_file_t), intent(in) :: file
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    character(len=:), allocatable, intent(out) :: flaw      !! what cannot be right; empty if nothing

    flaw = ""
    if (allocated(file%flaw)) flaw = file%flaw
    if (allocated(file%hdf5%failure)) flaw = "it cannot "//file%hdf5%failure
    if (flaw /= "") return
    sim%disk%radius = sim%species(sim%tag%species)%radius
    flaw = flaw_of_state(sim, settings)
    if (flaw == "") flaw = flaw_of_progress(progress, sim, settings%output%event_log)
    if (flaw /= "") return
    call progress%frames%look_ahead(sim)
    call progress%observables%look_ahead(sim)
  end subroutine complete

  !> What to do without the checkpoint of an output, by whether the previous one is good.
  function advice(path)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: advice
    type(error_t), allocatable :: foreign

    call check_places(path, foreign)
    advice = run_file(path, previous_checkpoint)
    if (flaw_of(advice, title) == "") then
      advice = "the previous one is good: give "//advice//" its name to go on from there"
    else if (allocated(foreign)) then
      advice = "remove it; then --force instead of --resume starts over"
    else
      advice = "--force instead of --resume starts over"
    end if
  end function advice

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
    character(len=:), allocatable :: text
    integer :: k, g, first, length

    text = values_text(groups)
    do k = 1, size(free_to_change)
      first = index(eol//text, eol//trim(free_to_change(k))//" ")
      if (first == 0) cycle
      length = index(text(first:), eol)
      text = text(:first - 1)//text(first + length:)
    end do
    do g = 1, size(groups)
      do k = 1, size(groups(g)%values)
        if (.not. allocated(groups(g)%values(k)%reals)) cycle
        if (size(groups(g)%values(k)%reals) <= 100) cycle      ! in the text with all digits
        text = text//"checksum of "//trim(groups(g)%name)//"."//trim(groups(g)%instance)//"." &
          //trim(groups(g)%values(k)%name)//" = " &
          //checksum(transfer(groups(g)%values(k)%reals, [0_int8]))//eol
      end do
    end do
  end function fixed_input

  !> Refuses the checkpoint of another program or another input.
  subroutine check_origin(file, groups, error)
    type(hdf5_file_t), intent(inout) :: file
    type(parameter_group_t), intent(in) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there, here, variable

    call file%fetch_text("program", there)
    if (there /= program() .and. .not. allocated(file%failure)) then
      call fail(error, exit_usage, file%path//": was written by "//legible(there)//", this is "//program())
      return
    end if
    call file%fetch_text("input", there)
    if (allocated(file%failure)) return
    there = there//eol
    here = fixed_input(groups)
    do while (there /= "" .or. here /= "")
      variable = legible(there(:index(there//eol, eol) - 1))
      if (here(:index(here//eol, eol) - 1) /= variable) then
        call fail(error, exit_usage, file%path//": belongs to another input: there " &
          //variable//", here "//here(:index(here//eol, eol) - 1))
        return
      end if
      there = there(min(index(there//eol, eol), len(there)) + 1:)
      here = here(min(index(here//eol, eol), len(here)) + 1:)
    end do
  end subroutine check_origin

  !> Writes or reads what changes in a simulation. When read it must know its box and species.
  subroutine exchange_state(file, sim)
    type(component_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    integer(int64) :: n
    integer :: k

    call file%exchange("epoch", sim%epoch, times)
    call file%exchange("now", sim%now, times)
    call file%exchange("epoch_begin", sim%epoch_begin, times)
    call file%exchange("epoch_end", sim%epoch_end, [0.0_real64, never])
    call file%exchange("epoch_events", sim%epoch_events, counts)
    call file%exchange("blink", sim%blink, not_negative)
    call file%exchange("last_advance", sim%last_advance, clocks)
    call file%exchange("events_then", sim%events_then, counts)
    call file%exchange("events", sim%events, counts)
    call file%exchange("collisions", sim%collisions, counts)
    call file%exchange("wall_collisions", sim%wall_collisions, counts)
    call file%exchange("obstacle_collisions", sim%obstacle_collisions, counts)
    do k = 1, n_sides
      call exchange_sum(file, "wall_impulse_"//trim(side_name(k)), sim%wall_impulse(k))
    end do
    call exchange_sum(file, "virial", sim%virial)
    call exchange_sum(file, "dissipated", sim%dissipated)
    call file%exchange("start_energy", sim%start_energy, not_negative)
    n = sum(int(sim%species%count, int64))
    if (.not. allocated(sim%disk)) then
      allocate (sim%disk(n), sim%tag(n))
      allocate (sim%image(2, n), source=0_int64)
    end if
    call file%exchange("disks/x1", sim%disk%x(1), places)
    call file%exchange("disks/x2", sim%disk%x(2), places)
    call file%exchange("disks/v1", sim%disk%v(1), speeds)
    call file%exchange("disks/v2", sim%disk%v(2), speeds)
    call file%exchange("disks/clock", sim%disk%clock, clocks)
    call file%exchange("disks/species", sim%tag%species, [1_int64, size(sim%species, kind=int64)])
    call file%exchange("disks/id", sim%tag%id, [1_int64, n])
    call file%exchange("disks/collisions", sim%tag%collisions, counts)
    call file%exchange("disks/met", sim%tag%met, [int(obstacle_code(sim%box%n_obstacles()), int64), n])
    call file%exchange("disks/image1", sim%image(1, :), [-counts(2), counts(2)])
    call file%exchange("disks/image2", sim%image(2, :), [-counts(2), counts(2)])
  end subroutine exchange_state

  !> Writes or reads a sum: the two halves of a whole number of units.
  subroutine exchange_sum(file, name, sum)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(exact_sum_t), intent(inout) :: sum
    integer(int64) :: halves(2)

    halves = transfer(sum%units, halves)
    call file%exchange(name//"/units", halves, [ibset(0_int64, 63), huge(1_int64)])
    sum%units = transfer(halves, sum%units)
    call file%exchange(name//"/units_per_one", sum%per_one, not_negative)
  end subroutine exchange_sum

  !> Writes or reads how far the output has come.
  subroutine exchange_progress(file, progress)
    type(component_file_t), intent(inout) :: file
    type(progress_t), intent(inout) :: progress
    integer :: k

    call exchange_cadence(file, "frames", progress%frames)
    call exchange_cadence(file, "observables", progress%observables)
    call file%exchange("progress/events", progress%events, counts)
    call file%exchange("progress/spent", progress%spent, not_negative)
    do k = 1, size(progress%unwritten)
      call exchange_samples(file, "unwritten/"//written(k), progress%unwritten(k))
    end do
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
      call file%exchange(name, values, sums)
      samples%values = reshape(values, extent)
    end if
  end subroutine exchange_samples

end module checkpoint
