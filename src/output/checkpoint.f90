!> Checkpoints: OUT.chk.h5 holds all of a simulation that the input does not say, and how far its output has
!> come. A run that goes on from it gives the same data as one that never stopped, bit for bit.
!>
!> A checkpoint is written under another name, read back, and renamed: at every moment there is a whole one.
!> The file begins with a checksum over all that follows, which is verified before anything is believed.
module checkpoint
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int32, int64, real64
  use partners, only: n_sides
  use build_info, only: build_flags
  use cadence, only: cadence_t
  use checksum, only: crc_of_bytes, crc_of_file, hexadecimal
  use errors, only: error_t, exit_files, exit_usage, fail
  use hdf5_objects, only: hdf5_file_t
  use initial_state, only: describe_system
  use output, only: output_t, progress_t
  use parameter_values, only: parameter_group_t, values_text
  use run_files, only: checkpoint_of, earlier_checkpoint_of, is_file, new_checkpoint_of, part_of
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use system, only: free_bytes, is_folder, last_problem, link_file, move_file, remove_file, synchronize
  use texts, only: written
  use version, only: program_version
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

  integer, parameter :: reserved = 512          !! bytes before the HDF5 part, for the checksum
  integer, parameter :: header_length = 64
  character(len=*), parameter :: first_words = "ricochet checkpoint"
  character(len=*), parameter :: eol = new_line("a")

  !> Variables that say how a run is done, not what: they may differ when it goes on.
  character(len=*), parameter :: free_to_change(5) = [character(len=26) :: "run.title = ", &
    "run.search = ", "run.queue = ", "stop.wall_clock = ", "output.checkpoint_every = "]

contains

  !> Writes the checkpoint of a run; the one before is kept as OUT.chk_prev.h5.
  subroutine write_checkpoint(path, settings, groups, sim, output, error)
    character(len=*), intent(in) :: path        !! of the output
    type(settings_t), intent(in) :: settings
    type(parameter_group_t), intent(in) :: groups(:)    !! every value as used
    type(simulation_t), intent(in) :: sim
    type(output_t), intent(inout) :: output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: new, current
    type(hdf5_file_t) :: file
    type(progress_t) :: progress
    logical :: done

    new = new_checkpoint_of(path)
    current = checkpoint_of(path)
    call output%save(progress, error)
    if (.not. allocated(error)) call check_room(current, size(sim%disk, kind=int64), error)
    if (allocated(error)) return
    call remove_file(new)
    call file%create(new, reserved, name=current)
    call file%put("program", program())
    call file%put("input", identity(groups))
    call put_state(file, sim)
    call put_progress(file, progress)
    call file%close()
    call file%failure(error)
    if (.not. allocated(error)) then
      call seal(new, done)
      if (done) call synchronize(new, done)
      if (done) call link_file(current, earlier_checkpoint_of(path))
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
  subroutine read_checkpoint(path, settings, groups, sim, output, error)
    character(len=*), intent(in) :: path        !! of the output
    type(settings_t), intent(in) :: settings
    type(parameter_group_t), intent(in) :: groups(:)
    type(simulation_t), intent(out) :: sim
    type(output_t), intent(inout) :: output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: current, flaw
    type(hdf5_file_t) :: file
    type(progress_t) :: progress
    logical :: finished

    current = checkpoint_of(path)
    finished = is_file(path)
    if (finished) finished = .not. is_file(part_of(path))
    if (finished) then
      call fail(error, exit_files, path//": is finished; there is nothing to go on with")
    else if (.not. is_file(current)) then
      call fail(error, exit_files, current//": there is no checkpoint to go on from; " &
        //way_out(earlier_checkpoint_of(path)))
    else
      flaw = flaw_of(current)
      if (flaw /= "") call fail(error, exit_usage, current//": "//flaw//"; "//way_out(earlier_checkpoint_of(path)))
    end if
    if (allocated(error)) return
    call file%open(current, writable=.false.)
    call check_origin(file, groups, error)
    if (.not. allocated(error)) then
      call describe_system(settings, sim)
      call fetch_state(file, sim)
      call fetch_progress(file, progress)
    end if
    call file%close()
    if (.not. allocated(error)) call file%failure(error)
    if (.not. allocated(error)) call output%resume(path, settings, sim, progress, error)
  end subroutine read_checkpoint

  !> What to do without a checkpoint, by whether the one before is whole.
  function way_out(earlier) result(advice)
    character(len=*), intent(in) :: earlier
    character(len=:), allocatable :: advice

    advice = "the one before is whole: give "//earlier//" its name to go on from there"
    if (flaw_of(earlier) /= "") advice = "--force instead of --resume starts over"
  end function way_out

  !> What makes two builds give different bits: the version, and arithmetic that is not by the book.
  pure function program() result(text)
    character(len=:), allocatable :: text

    text = "ricochet "//program_version
    if (index(build_flags, "-ffp-contract=off") == 0) text = text//", contracted arithmetic"
    if (index(build_flags, "-ffast-math") + index(build_flags, "-Ofast") > 0) text = text//", fast math"
  end function program

  !> The input as it was used, less what is free to change: one variable to a line.
  pure function identity(groups) result(text)
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
          //hexadecimal(crc_of_bytes(transfer(groups(g)%values(k)%reals, [0_int8])))//eol
      end do
    end do
  end function identity

  !> Refuses the checkpoint of another program or another input.
  subroutine check_origin(file, groups, error)
    type(hdf5_file_t), intent(inout) :: file
    type(parameter_group_t), intent(in) :: groups(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: there, here, variable

    call file%fetch_text("program", there)
    if (there /= program() .and. .not. allocated(file%trouble)) then
      call fail(error, exit_usage, file%path//": was written by "//there//", this is "//program())
      return
    end if
    call file%fetch_text("input", there)
    if (allocated(file%trouble)) return
    there = there//eol
    here = identity(groups)
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

  !> Writes the state. Names and units as in `simulation_state` and `disks`.
  subroutine put_state(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: sim

    call file%put("reals", [5 + n_sides], [sim%epoch, sim%now, sim%virial, sim%dissipated, &
      sim%start_energy, sim%wall_impulse])
    call file%put("counts", [4 + n_sides], [sim%next_epoch, sim%events, sim%collisions, &
      sim%obstacle_collisions, sim%wall_collisions])
    associate (n => size(sim%disk))
      call file%put("disks/x1", [n], sim%disk%x(1))
      call file%put("disks/x2", [n], sim%disk%x(2))
      call file%put("disks/v1", [n], sim%disk%v(1))
      call file%put("disks/v2", [n], sim%disk%v(2))
      call file%put("disks/clock", [n], sim%disk%clock)
      call file%put("disks/species", [n], sim%tag%species)
      call file%put("disks/id", [n], sim%tag%id)
      call file%put("disks/collisions", [n], sim%tag%collisions)
      call file%put("disks/image1", [n], sim%tag%image(1))
      call file%put("disks/image2", [n], sim%tag%image(2))
    end associate
  end subroutine put_state

  !> Reads it back, into a simulation that knows its box and species.
  subroutine fetch_state(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    real(real64) :: reals(5 + n_sides)
    integer(int64) :: counts(4 + n_sides)

    reals = 0
    counts = 0
    call file%fetch("reals", size(reals), reals)
    call file%fetch("counts", size(counts), counts)
    sim%epoch = reals(1)
    sim%now = reals(2)
    sim%virial = reals(3)
    sim%dissipated = reals(4)
    sim%start_energy = reals(5)
    sim%wall_impulse = reals(6:)
    sim%next_epoch = counts(1)
    sim%events = counts(2)
    sim%collisions = counts(3)
    sim%obstacle_collisions = counts(4)
    sim%wall_collisions = counts(5:)
    call fetch_disks(file, sim)
  end subroutine fetch_state

  subroutine fetch_disks(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(inout) :: sim
    real(real64), allocatable :: reals(:)
    integer(int32), allocatable :: numbers(:)
    integer :: n

    n = sum(sim%species%count)
    allocate (sim%disk(n), sim%tag(n))
    allocate (reals(n), numbers(n))
    reals = 0
    numbers = 1
    call file%fetch("disks/x1", n, reals)
    sim%disk%x(1) = reals
    call file%fetch("disks/x2", n, reals)
    sim%disk%x(2) = reals
    call file%fetch("disks/v1", n, reals)
    sim%disk%v(1) = reals
    call file%fetch("disks/v2", n, reals)
    sim%disk%v(2) = reals
    call file%fetch("disks/clock", n, reals)
    sim%disk%clock = reals
    call file%fetch("disks/species", n, numbers)
    sim%tag%species = numbers
    sim%disk%radius = sim%species(numbers)%radius
    call file%fetch("disks/id", n, numbers)
    sim%tag%id = numbers
    call file%fetch("disks/collisions", n, numbers)
    sim%tag%collisions = numbers
    call file%fetch("disks/image1", n, numbers)
    sim%tag%image(1) = numbers
    call file%fetch("disks/image2", n, numbers)
    sim%tag%image(2) = numbers
  end subroutine fetch_disks

  subroutine put_progress(file, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(progress_t), intent(in) :: progress

    call put_cadence("frames", progress%frames)
    call put_cadence("observables", progress%observables)
    call file%put("events", [1], [progress%events])
    call file%put("seconds", [1], [progress%spent])

  contains

    subroutine put_cadence(name, cadence)
      character(len=*), intent(in) :: name
      type(cadence_t), intent(in) :: cadence

      call file%put(name//"/counts", [5], [cadence%count, cadence%multiple, &
        cadence%next_collisions, cadence%next_events, cadence%last_events])
      call file%put(name//"/last_time", [1], [cadence%last_time])
    end subroutine put_cadence

  end subroutine put_progress

  subroutine fetch_progress(file, progress)
    type(hdf5_file_t), intent(inout) :: file
    type(progress_t), intent(out) :: progress
    integer(int64) :: counts(1)
    real(real64) :: reals(1)

    counts = 0
    reals = 0
    call fetch_cadence("frames", progress%frames)
    call fetch_cadence("observables", progress%observables)
    call file%fetch("events", 1, counts)
    call file%fetch("seconds", 1, reals)
    progress%events = counts(1)
    progress%spent = reals(1)

  contains

    !> The steps of the cadence come from the input, in `resume`.
    subroutine fetch_cadence(name, cadence)
      character(len=*), intent(in) :: name
      type(cadence_t), intent(inout) :: cadence
      integer(int64) :: numbers(5)
      real(real64) :: moment(1)

      numbers = 0
      moment = 0
      call file%fetch(name//"/counts", 5, numbers)
      call file%fetch(name//"/last_time", 1, moment)
      cadence%count = numbers(1)
      cadence%multiple = numbers(2)
      cadence%next_collisions = numbers(3)
      cadence%next_events = numbers(4)
      cadence%last_events = numbers(5)
      cadence%last_time = moment(1)
    end subroutine fetch_cadence

  end subroutine fetch_progress

  !> Writes the checksum of a closed file into its reserved bytes, and reads all back: a full disk shows
  !> nowhere else.
  subroutine seal(path, done)
    character(len=*), intent(in) :: path
    logical, intent(out) :: done
    character(len=header_length) :: header
    integer :: unit, status

    header = header_of(path)
    open (newunit=unit, file=path, access="stream", form="unformatted", action="readwrite", status="old", iostat=status)
    done = status == 0
    if (.not. done) return
    write (unit, pos=1, iostat=status) header
    done = status == 0
    close (unit, iostat=status)
    done = done .and. status == 0
    if (done) done = flaw_of(path) == ""
  end subroutine seal

  !> Why a file cannot be believed; nothing if its checksum is right.
  function flaw_of(path) result(flaw)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: flaw
    character(len=header_length) :: header
    integer(int64) :: bytes
    integer :: unit, status

    flaw = "cannot be read"
    if (is_folder(path)) flaw = "is a folder"
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=status)
    if (status /= 0) return
    inquire (unit, size=bytes)
    header = ""
    read (unit, iostat=status) header(:max(0_int64, min(bytes, len(header, int64))))
    close (unit)
    if (status /= 0) return
    flaw = ""
    if (bytes == 0) then
      flaw = "is empty"
    else if (header(:len(first_words)) /= first_words) then
      flaw = "is no checkpoint, or is damaged: it does not begin like one"
    else if (header /= header_of(path)) then
      flaw = "is damaged or cut short: its checksum is wrong"
    end if
  end function flaw_of

  !> The first bytes of a checkpoint, by what follows them.
  function header_of(path) result(header)
    character(len=*), intent(in) :: path
    character(len=header_length) :: header
    integer(int64) :: crc

    call crc_of_file(path, header_length + 1_int64, crc)
    header = first_words//", CRC-64 of the rest: "//hexadecimal(crc)
    header(header_length:) = eol
  end function header_of

end module checkpoint
