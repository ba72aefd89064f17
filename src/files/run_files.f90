!> The files of a run, all named after its output OUT.h5.
module run_files
  use system, only: remove_file
  implicit none
  private
  public :: run_file, is_file, is_hdf5_file, remove_checkpoints

  ! What the name of a file ends with. An ending with .h5 replaces that of the output.
  character(len=*), parameter, public :: &
    unfinished = ".part", &                       !! the output while it is being written
    unfinished_new = ".part_new", &               !! the same until all that is written once is in it
    lock = ".lock", &                             !! keeps other runs from this output
    current_checkpoint = ".chk.h5", &
    previous_checkpoint = ".chk_prev.h5", &
    new_checkpoint = ".chk_new.h5"                !! while it is being written

contains

  !> Name of a file of the run that has a certain output.
  pure function run_file(output, ending) result(path)
    character(len=*), intent(in) :: output        !! path of the output
    character(len=*), intent(in) :: ending        !! one of the names above
    character(len=:), allocatable :: path

    path = output//ending
    if (index(ending//"|", ".h5|") > 0 .and. index(output//"|", ".h5|") > 1) path = output(:len(output) - 3)//ending
  end function run_file

  !> Removes all checkpoints of an output.
  subroutine remove_checkpoints(output)
    character(len=*), intent(in) :: output        !! path of the output

    call remove_file(run_file(output, current_checkpoint))
    call remove_file(run_file(output, previous_checkpoint))
    call remove_file(run_file(output, new_checkpoint))
  end subroutine remove_checkpoints

  !> Whether the file is in HDF5 format, by its first bytes: nothing else is ever replaced.
  function is_hdf5_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes
    character(len=8) :: first
    integer :: unit, status

    yes = .false.
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=status)
    if (status /= 0) return
    read (unit, iostat=status) first
    if (status == 0) yes = first == char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)
    close (unit)
  end function is_hdf5_file

  !> Whether there is a file of this name.
  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    inquire (file=path, exist=yes)
  end function is_file

end module run_files
