!> Ricochet: event-driven simulation of hard disks.
program main
  use, intrinsic :: iso_fortran_env, only: error_unit
  use command_line, only: answer, command_t, read_command_line
  use errors, only: error_t, exit_finished
  use run, only: perform_run
  use run_input, only: read_input
  use settings, only: run_input_t
  use system, only: end_program, fill_standard_streams
  implicit none
  call serve()

contains

  !> Answers an option such as --help, or performs a run. The main program has no variables of its
  !> own, because they would not be deallocated at its end.
  subroutine serve()
    type(command_t) :: command
    type(run_input_t) :: input
    type(error_t), allocatable :: error
    integer :: code

    code = exit_finished
    call fill_standard_streams()
    call read_command_line(command, error)
    if (.not. allocated(error)) then
      if (command%question /= "") then
        call answer(command, error)
      else if (command%print_input) then
        call read_input(command%input, command%overrides, input, error, printed=.true.)
      else
        call perform_run(command, error)
      end if
    end if
    if (allocated(error)) then
      if (error%message /= "") write (error_unit, "(a)") error%message
      code = error%code
    end if
    call end_program(code)
  end subroutine serve

end program main
