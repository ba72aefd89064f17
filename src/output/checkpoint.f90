!> Checkpoints: OUT.chk.h5 holds what changes in a simulation, and how far its output has come. A run that goes
!> on from it gives the same data as one that never stopped, bit for bit.
!>
!> A checkpoint is written under another name, read back, and renamed, so there is a complete one at every
!> moment. The file begins with a checksum of all that follows, which is verified before anything is read.
module checkpoint
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int32, int64, real64
  use build_info, only: build_flags
  use cadence, only: cadence_t
  use errors, only: error_t, exit_files, exit_usage, fail
  use hdf5_objects, only: hdf5_file_t
  use output, only: output_t, progress_t
  use parameter_values, only: parameter_group_t, values_text
  use run_files, only: current_checkpoint, is_file, new_checkpoint, previous_checkpoint, run_file, unfinished
  use run_input, only: run_input_t
  use sealed_file, only: checksum, flaw_of, seal
  use simulation_state, only: simulation_t
  use system, only: free_bytes, last_problem, link_file, move_file, remove_file, synchronize
  use texts, only: written
  use version, only: program_version
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

  integer, parameter :: reserved = 512          !! bytes before the HDF5 part, for the checksum
  character(len=*), parameter :: title = "ricochet checkpoint 2"
  character(len=*), parameter :: eol = new_line("a")

  !> Variables that change how a run is done but not its result: they may differ when it goes on.
  character(len=*), parameter :: free_to_change(5) = [character(len=26) :: "run.title = ", &
    "run.search = ", "run.queue = ", "stop.wall_clock = ", "output.checkpoint_every = "]

  !> A file whose components are either written or read.
  type :: component_file_t
    type(hdf5_file_t) :: hdf5
    logical :: writing = .false.
  contains
    generic :: exchange => exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers
    procedure, private :: exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers
  end type component_file_t

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
    if (.not. allocated(error)) call check_room(current, size(sim%disk, kind=int64), error)
    if (allocated(error)) return
    call remove_file(new)
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
    integer(int64), intent(in) :: n
    type(error_t), allocatable, intent(out) :: error
    integer(int64), parameter :: per_disk = 60, besides = 32768     !! [bytes]

    if (free_bytes(path) < per_disk*n + besides) call fail(error, exit_files, path &
      //": cannot be written: "//written(per_disk*n + besides)//" bytes needed, " &
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
    end if
    call file%hdf5%close()
    if (.not. allocated(error)) call file%hdf5%report(error)
    if (.not. allocated(error)) call output%resume(path, input, sim, progress, error)
  end subroutine read_checkpoint

  !> What to do without the checkpoint of an output, by whether the previous one is good.
  function advice(path)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: advice

    advice = run_file(path, previous_checkpoint)
    if (flaw_of(advice, title) == "") then
      advice = "the previous one is good: give "//advice//" its name to go on from there"
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
      call fail(error, exit_usage, file%path//": was written by "//there//", this is "//program())
      return
    end if
    call file%fetch_text("input", there)
    if (allocated(file%failure)) return
    there = there//eol
    here = fixed_input(groups)
    do while (there /= "" .or. here /= "")
      variable = there(:index(there//eol, eol) - 1)
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
    integer :: n

    call file%exchange("epoch", sim%epoch)
    call file%exchange("now", sim%now)
    call file%exchange("next_epoch", sim%next_epoch)
    call file%exchange("events", sim%events)
    call file%exchange("collisions", sim%collisions)
    call file%exchange("wall_collisions", sim%wall_collisions)
    call file%exchange("obstacle_collisions", sim%obstacle_collisions)
    call file%exchange("wall_impulse", sim%wall_impulse)
    call file%exchange("virial", sim%virial)
    call file%exchange("dissipated", sim%dissipated)
    call file%exchange("start_energy", sim%start_energy)
    n = sum(sim%species%count)
    if (.not. allocated(sim%disk)) allocate (sim%disk(n), sim%tag(n))
    call file%exchange("disks/x1", sim%disk%x(1))
    call file%exchange("disks/x2", sim%disk%x(2))
    call file%exchange("disks/v1", sim%disk%v(1))
    call file%exchange("disks/v2", sim%disk%v(2))
    call file%exchange("disks/clock", sim%disk%clock)
    call file%exchange("disks/species", sim%tag%species)
    call file%exchange("disks/id", sim%tag%id)
    call file%exchange("disks/collisions", sim%tag%collisions)
    call file%exchange("disks/image1", sim%tag%image(1))
    call file%exchange("disks/image2", sim%tag%image(2))
    if (.not. file%writing) sim%disk%radius = sim%species(sim%tag%species)%radius
  end subroutine exchange_state

  !> Writes or reads how far the output has come.
  subroutine exchange_progress(file, progress)
    type(component_file_t), intent(inout) :: file
    type(progress_t), intent(inout) :: progress

    call exchange_cadence(file, "frames", progress%frames)
    call exchange_cadence(file, "observables", progress%observables)
    call file%exchange("progress/events", progress%events)
    call file%exchange("progress/spent", progress%spent)
  end subroutine exchange_progress

  !> Writes or reads how far a cadence has come; its steps are part of the input.
  subroutine exchange_cadence(file, name, cadence)
    type(component_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(cadence_t), intent(inout) :: cadence

    call file%exchange("progress/"//name//"/count", cadence%count)
    call file%exchange("progress/"//name//"/multiple", cadence%multiple)
    call file%exchange("progress/"//name//"/next_collisions", cadence%next_collisions)
    call file%exchange("progress/"//name//"/next_events", cadence%next_events)
    call file%exchange("progress/"//name//"/last_events", cadence%last_events)
    call file%exchange("progress/"//name//"/last_time", cadence%last_time)
  end subroutine exchange_cadence

  !> Writes or reads a real.
  subroutine exchange_real(self, name, value)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: value
    real(real64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer)
    value = buffer(1)
  end subroutine exchange_real

  !> Writes or reads an array of reals.
  subroutine exchange_reals(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: values(:)
    real(real64), allocatable :: buffer(:)

    allocate (buffer, source=values)
    if (self%writing) call self%hdf5%put(name, shape(buffer), buffer)
    if (.not. self%writing) call self%hdf5%fetch(name, size(buffer), buffer)
    values = buffer
  end subroutine exchange_reals

  !> Writes or reads an integer of 64 bits.
  subroutine exchange_long(self, name, value)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: value
    integer(int64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer)
    value = buffer(1)
  end subroutine exchange_long

  !> Writes or reads an array of integers of 64 bits.
  subroutine exchange_longs(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: values(:)
    integer(int64), allocatable :: buffer(:)

    allocate (buffer, source=values)
    if (self%writing) call self%hdf5%put(name, shape(buffer), buffer)
    if (.not. self%writing) call self%hdf5%fetch(name, size(buffer), buffer)
    values = buffer
  end subroutine exchange_longs

  !> Writes or reads an array of integers of 32 bits.
  subroutine exchange_integers(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int32), intent(inout) :: values(:)
    integer(int32), allocatable :: buffer(:)

    allocate (buffer, source=values)
    if (self%writing) call self%hdf5%put(name, shape(buffer), buffer)
    if (.not. self%writing) call self%hdf5%fetch(name, size(buffer), buffer)
    values = buffer
  end subroutine exchange_integers

end module checkpoint
