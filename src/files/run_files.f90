!> Names of the files of a run, derived from the path of its output OUT.h5, and rules for replacing
!> and deleting these files. Only files written by a run may be replaced or deleted. For files that
!> contain results, `--force` is required.
module run_files
  use errors, only: error_t, exit_files, exit_usage, fail
  use kinds, only: int64
  use system, only: identity_of, last_problem, move_file, read_bytes, synchronize, what_is
  use texts, only: shown
  implicit none
  private
  public :: output_of, is_file, source_of, check_name, check_places, check_replaced, take_final_name

  ! Extensions that follow the name of the output
  character(len=*), parameter, public :: &
    !> Extension of the output file during the run.
    unfinished = ".part", &
    !> Extension of a new output file until it is complete.
    unfinished_new = ".part_new", &
    !> Extension of the lock file, which prevents other runs from writing the same output.
    lock = ".lock"
  character(len=9), parameter :: endings(*) = [character(len=9) :: "", unfinished, unfinished_new, lock]

contains

  !> Path of the output to which an auxiliary file belongs; empty if the path is not an auxiliary
  !> file.
  pure function output_of(path) result(output)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: output
    integer :: k, last

    output = ""
    do k = 2, size(endings)
      last = len(path) - len_trim(endings(k))
      if (last < 1) cycle
      if (path(last + 1:) == trim(endings(k))) output = path(:last)
    end do
  end function output_of

  !> True if the path exists, as a file, a folder or another object.
  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = what_is(path) /= "nothing"
  end function is_file

  !> File from which a run is resumed: the unfinished output if there is one, otherwise the finished
  !> output.
  function source_of(output) result(path)
    character(len=*), intent(in) :: output        !! path of the finished output
    character(len=:), allocatable :: path

    path = output
    if (is_file(output//unfinished)) path = output//unfinished
  end function source_of

  !> Reports an error if the name of the output is reserved for an auxiliary file of another run.
  pure subroutine check_name(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error

    if (output_of(output) /= "") call fail(error, exit_usage, "the name of the output "//shown(output)//" is reserved " &
      //"for files of the run with the output "//shown(output_of(output))//"; choose another name")
  end subroutine check_name

  !> Reports an error if the run would overwrite an existing file that was not written by a run.
  subroutine check_places(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: path, what
    integer :: k

    do k = 1, size(endings)
      path = output//trim(endings(k))
      what = what_is(path)
      if (what == "nothing" .or. endings(k) == lock) cycle
      if (what == "a file") then
        if (begins_like_a_run(path)) cycle
        what = "not a file of a run"
      end if
      call fail(error, exit_files, path//": exists already and is "//what//"; it is left as it is; remove it, " &
        //"or choose another output with -o")
      return
    end do
  end subroutine check_places

  !> True if a file starts with the signature of HDF5, is empty, or contains only zeros. Empty files
  !> and files of zeros are left behind by a run that was killed shortly after its start.
  function begins_like_a_run(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes
    character(len=8) :: first
    integer(int64) :: n

    call read_bytes(path, first, n)
    yes = n == 0 .or. (n == 8 .and. any(first == [char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10), &
      repeat(achar(0), 8)]))
  end function begins_like_a_run

  !> Reports an error if the file at the output path is no longer the file that was there when the
  !> run started.
  subroutine check_replaced(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    !> Identity of the file at this path when the run started.
    integer(int64), intent(in) :: replaced(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: there(3)

    there = identity_of(output)
    if (.not. is_file(output) .or. all(there == replaced)) return
    call fail(error, exit_files, output//": is not the file that was there when the run began; it is left as it is, and " &
      //"the results stay in "//output//unfinished//" until it is moved away")
  end subroutine check_replaced

  !> Renames a completed output to its final name.
  subroutine take_final_name(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    integer(int64), intent(in) :: replaced(:)     !! identity of the file that may be replaced
    type(error_t), allocatable, intent(out) :: error
    logical :: done

    call synchronize(output//unfinished, done)
    if (done) call check_replaced(output, replaced, error)
    if (allocated(error)) return
    if (done) call move_file(output//unfinished, output, done)
    if (.not. done) call fail(error, exit_files, output//unfinished//": cannot be renamed: "//last_problem())
  end subroutine take_final_name

end module run_files
