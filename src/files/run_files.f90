!> The files of a run, all named after its output OUT.h5.
module run_files
  use system, only: remove_file
  implicit none
  private
  public :: part_of, new_part_of, lock_of, checkpoint_of, earlier_checkpoint_of, new_checkpoint_of
  public :: is_file, is_hdf5_file, remove_checkpoints

contains

  !> The output while it is being written.
  pure function part_of(path) result(name)
    character(len=*), intent(in) :: path          !! of the output
    character(len=:), allocatable :: name

    name = path//".part"
  end function part_of

  !> The same before all that is written once is in it.
  pure function new_part_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name

    name = path//".part_new"
  end function new_part_of

  !> The file whose lock keeps two runs from one output.
  pure function lock_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name

    name = path//".lock"
  end function lock_of

  pure function checkpoint_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name

    name = stem_of(path)//".chk.h5"
  end function checkpoint_of

  !> The last checkpoint but one.
  pure function earlier_checkpoint_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name

    name = stem_of(path)//".chk_prev.h5"
  end function earlier_checkpoint_of

  !> A checkpoint while it is being written.
  pure function new_checkpoint_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name

    name = stem_of(path)//".chk_new.h5"
  end function new_checkpoint_of

  !> The path without .h5.
  pure function stem_of(path) result(stem)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: stem

    stem = path
    if (index(path//"|", ".h5|") > 1) stem = path(:len(path) - 3)
  end function stem_of

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

  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    inquire (file=path, exist=yes)
  end function is_file

  subroutine remove_checkpoints(path)
    character(len=*), intent(in) :: path          !! of the output

    call remove_file(checkpoint_of(path))
    call remove_file(earlier_checkpoint_of(path))
    call remove_file(new_checkpoint_of(path))
  end subroutine remove_checkpoints

end module run_files
