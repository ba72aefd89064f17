!> The files of a run, all named after its output OUT.h5, and what of it may be replaced or removed: only what a run
!> has written, and of that nothing that somebody may still want.
module run_files
  use errors, only: error_t, exit_files, exit_usage, fail
  use kinds, only: int64
  use system, only: identity_of, last_problem, move_file, read_bytes, synchronize, what_is
  use texts, only: shown
  implicit none
  private
  public :: output_of, is_file, source_of, check_name, check_places, check_replaced, take_final_name

  ! What the name of a file ends with.
  character(len=*), parameter, public :: &
    unfinished = ".part", &                       !! the output while it is being written
    unfinished_new = ".part_new", &               !! the same until all that is written once is in it
    lock = ".lock"                                !! keeps other runs from this output
  character(len=9), parameter :: endings(*) = [character(len=9) :: "", unfinished, unfinished_new, lock]

contains

  !> The output of the run that has a file of this name, not being its output; empty if there can be none.
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

  !> Whether there is a file of this name.
  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = what_is(path) /= "nothing"
  end function is_file

  !> The file from which a run goes on: its output, finished or not.
  function source_of(output) result(path)
    character(len=*), intent(in) :: output        !! path of the finished one
    character(len=:), allocatable :: path

    path = output
    if (is_file(output//unfinished)) path = output//unfinished
  end function source_of

  !> Refuses an output that would have the name of another file of a run.
  pure subroutine check_name(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error

    if (output_of(output) /= "") call fail(error, exit_usage, "the output "//shown(output)//" would have a name that is kept " &
      //"for files of the run with the output "//shown(output_of(output))//"; choose another name")
  end subroutine check_name

  !> Fails if something that no run has written stands where the run is to write.
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

  !> Whether a file begins as HDF5 files do, or as one whose run was killed before it was complete: empty, or with zeros.
  function begins_like_a_run(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes
    character(len=8) :: first
    integer(int64) :: n

    call read_bytes(path, first, n)
    yes = n == 0 .or. (n == 8 .and. any(first == [char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10), &
      repeat(achar(0), 8)]))
  end function begins_like_a_run

  !> Fails if the finished output would replace another file than the one that was there when the run began.
  subroutine check_replaced(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    integer(int64), intent(in) :: replaced(:)     !! the identity of that file
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: there(3)

    there = identity_of(output)
    if (.not. is_file(output) .or. all(there == replaced)) return
    call fail(error, exit_files, output//": is not the file that was there when the run began; it is left as it is, and " &
      //"the results stay in "//output//unfinished//" until it is moved away")
  end subroutine check_replaced

  !> Gives an output that is complete its final name.
  subroutine take_final_name(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    integer(int64), intent(in) :: replaced(:)     !! the identity of the file that it may replace
    type(error_t), allocatable, intent(out) :: error
    logical :: done

    call synchronize(output//unfinished, done)
    if (done) call check_replaced(output, replaced, error)
    if (allocated(error)) return
    if (done) call move_file(output//unfinished, output, done)
    if (.not. done) call fail(error, exit_files, output//unfinished//": cannot be renamed: "//last_problem())
  end subroutine take_final_name

end module run_files
