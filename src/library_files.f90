!> The part of the C interface `ricochet.h` that saves simulations to files and loads them from the
!> output of runs.
module library_files
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_ptr
  use sampling_schedule, only: progress_t
  use checkpoint, only: read_checkpoint, recall_input
  use errors, only: error_t
  use hdf5_objects, only: hdf5_file_t
  use initial_state, only: describe_system
  use library, only: answer, begin, check_files, session_of, session_t, text_of
  use output, only: output_t
  use run_files, only: check_name, output_of, source_of
  use run_input, only: input_from_text
  use run_setup, only: choose_evolution, new_simulation
  use settings, only: run_input_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use texts, only: lines_of, text_t
  implicit none
  private

contains

  !> See ricochet.h. The file contains the first samples of a run with the present input, and a
  !> checkpoint of the present state.
  function save(handle, path, force, message, room) bind(C, name="ricochet_save") result(code)
    type(c_ptr), value :: handle
    character(kind=c_char), intent(in) :: path(*)
    integer(c_int), value :: force, room
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int) :: code
    type(session_t), pointer :: session
    type(run_input_t) :: input
    type(simulation_t) :: first
    type(output_t) :: output
    type(status_line_t) :: silent
    type(error_t), allocatable :: error

    session => session_of(handle)
    call check_name(text_of(path), error)
    if (.not. allocated(error)) call input_from_text(session%input%text, session%input%path, session%input%overrides, input, &
      error, stepped=.true.)
    if (.not. allocated(error)) call check_files(session%input%groups, input%groups, error)
    if (allocated(session%input%changes)) then        ! the changed input does not describe the initial state
      first = session%sim
      input%changes = session%input%changes
    else if (.not. allocated(error)) then
      call new_simulation(input, silent, first, error)
    end if
    input%saved_at = session%sim%time()
    if (.not. allocated(error)) call output%claim(text_of(path), error)
    if (.not. allocated(error)) call output%open(input, first, force /= 0, error, only_start=.true.)
    if (.not. allocated(error)) call output%save(session%sim, error)
    call output%release()
    code = answer(error, message, room)
  end function save

  !> See ricochet.h.
  function load(path, threads, message, room, code) bind(C, name="ricochet_load") result(handle)
    character(kind=c_char), intent(in) :: path(*)
    integer(c_int), value :: threads, room
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_int), intent(out) :: code
    type(c_ptr) :: handle
    type(session_t), pointer :: session
    type(hdf5_file_t) :: file
    type(progress_t) :: progress
    type(error_t), allocatable :: error
    character(len=:), allocatable :: output, text, overrides, list
    type(text_t), allocatable :: lines(:)
    logical :: finished

    allocate (session)
    output = output_of(text_of(path))
    if (output == "") output = text_of(path)
    call file%open(source_of(output), writable=.false.)
    call recall_input(file, text, overrides, list, error)
    call file%close()
    if (.not. allocated(error)) then
      call lines_of(overrides, lines)
      call input_from_text(text, source_of(output), lines, session%input, error, stepped=.true.)
    end if
    if (.not. allocated(error)) then
      call describe_system(session%input%settings, session%sim)
      call choose_evolution(session%input%settings, session%evolution)
      call read_checkpoint(output, session%input, session%evolution, session%sim, progress, finished, error)
    end if
    if (allocated(list)) session%input%changes = list
    handle = begin(session, threads, error)
    code = answer(error, message, room)
  end function load

end module library_files
