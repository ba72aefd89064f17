!> Checkpoints: OUT.chk.h5 holds what changes in a simulation, and how far its output has come. A run that goes
!> on from it gives the same data as one that never stopped, bit for bit.
!>
!> A checkpoint is written under another name, read back, and renamed, so there is a complete one at every
!> moment. The file begins with a checksum of all that follows, which is verified before anything is read.
module checkpoint
  use checkpoint_checks, only: flaw_of_progress, flaw_of_state
  use checkpoint_contents, only: check_origin, exchange_contents, exchange_final_state, put_origin
  use component_file, only: component_file_t
  use disks, only: angle_column, columns, spin_column
  use disk_room, only: checkpoint_room
  use errors, only: error_t, exit_files, exit_usage, fail
  use h5md_layout, only: checkpoint_group
  use kinds, only: int64
  use output, only: output_t
  use progress, only: progress_t
  use run_files, only: check_places, current_checkpoint, identify, is_file, new_checkpoint, previous_checkpoint, run_file, &
    unfinished
  use sealed_file, only: flaw_of, seal
  use settings, only: run_input_t, settings_t
  use simulation_state, only: simulation_t
  use system, only: free_bytes, last_problem, link_file, move_file, remove_file, synchronize
  use texts, only: written
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

  integer, parameter :: reserved = 512          !! bytes before the HDF5 part, for the checksum
  character(len=*), parameter :: title = "ricochet checkpoint 5"

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
    call put_origin(file, output%input%groups)
    call exchange_contents(file, sim, progress)
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

  !> Restores a run from its checkpoint; the output goes on with what `progress` says. A finished run has its checkpoint
  !> in its output: it counts if the run has not been gone on with since, up to a checkpoint.
  subroutine read_checkpoint(path, input, sim, progress, finished, error)
    character(len=*), intent(in) :: path        !! of the output
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(inout) :: sim    !! in: with the box, law and species of the input
    type(progress_t), intent(out) :: progress
    logical, intent(out) :: finished            !! the run had come to its end
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: current, flaw
    type(component_file_t) :: file
    integer(int64) :: identity(2)
    logical :: there(3)

    current = run_file(path, current_checkpoint)
    there = [is_file(path), is_file(current), is_file(run_file(path, unfinished))]
    finished = there(1) .and. .not. all(there(2:))
    if (finished) then
      current = path
      call identify(path, identity, flaw)         ! first: what is read below is to be that file
      if (flaw /= "") call fail(error, exit_files, path//": "//flaw)
    else if (.not. there(2)) then
      call fail(error, exit_files, current//": there is no checkpoint to go on from; "//advice(path))
    else
      flaw = flaw_of(current, title)
      if (flaw /= "") call fail(error, exit_usage, current//": "//flaw//"; "//advice(path))
    end if
    if (allocated(error)) return
    call file%hdf5%open(current, writable=.false.)
    if (finished) call enter(file, error)
    if (.not. allocated(error)) call check_origin(file, input%groups, error)
    if (.not. allocated(error)) call check_elements(file, input%settings, sim, error)
    if (.not. allocated(error)) then
      progress = progress_t(input%settings)
      if (finished) progress%replaced = identity
      if (finished) call exchange_final_state(file, sim, progress, finished)
      if (.not. finished) call exchange_contents(file, sim, progress)
      call complete(file, input%settings, sim, progress, flaw)
      if (flaw /= "") call fail(error, exit_usage, current//": is damaged: "//flaw//"; "//advice(path))
    end if
    call file%hdf5%close()
  end subroutine read_checkpoint

  !> Looks for the checkpoint in the output of a finished run.
  subroutine enter(file, error)
    type(component_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error

    file%group = checkpoint_group
    if (file%hdf5%length(file%name_of("checksum")) < 0 .and. .not. allocated(file%hdf5%failure)) call fail(error, &
      exit_files, file%hdf5%path//": is a finished run that lacks its last state, and cannot be continued; a new run " &
      //"can start from its last frame: placement = 'file'")
  end subroutine enter

  !> Refuses to go on if disks had more than the input gives them now, or less: a starting file decides that, too.
  subroutine check_elements(file, settings, sim, error)
    type(component_file_t), intent(inout) :: file
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    logical :: there(2), here(2)
    integer :: k

    there = [(file%hdf5%length(file%name_of("disks/"//trim(columns(k)%name))) >= 0, k=spin_column, angle_column)]
    here = [sim%law%rotation, sim%law%rotation .or. sim%law%orientation]
    if (all(there .eqv. here) .or. allocated(file%hdf5%failure)) return
    if (.not. any([(settings%species(k)%file /= "", k=1, size(settings%species))])) return
    call fail(error, exit_files, file%hdf5%path//": whether its disks turn was read from species.file, which is not what it " &
      //"was, or not there; --resume needs it as it was, --force instead starts over")
  end subroutine check_elements

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
    if (.not. sim%own_sizes) sim%disk%radius = settings%species(sim%tag%species)%radius
    call sim%choose_units()
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

end module checkpoint
