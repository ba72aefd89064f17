!> The files of a run, all named after its output OUT.h5, and what of it may be replaced or removed: only what a run
!> has written, and of that nothing that somebody may still want.
module run_files
  use errors, only: error_t, exit_files, fail
  use kinds, only: int64
  use system, only: last_problem, move_file, read_bytes, remove_file, synchronize, what_is
  implicit none
  private
  public :: output_of, is_file, check_places, check_start, remove_temporaries, take_final_name

  ! What the name of a file ends with. An ending with .h5 replaces that of the output; an output without has none.
  character(len=*), parameter, public :: &
    unfinished = ".part", &                       !! the output while it is being written
    unfinished_new = ".part_new", &               !! the same until all that is written once is in it
    lock = ".lock"                                !! keeps other runs from this output
  character(len=12), parameter :: endings(*) = [character(len=12) :: "", unfinished, unfinished_new, lock]

  ! What such files begin with.
  character(len=8), parameter :: hdf5 = char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)

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

  !> Fails if something that no run has written stands where the run is to write.
  subroutine check_places(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: path, what
    logical :: ours
    integer :: k

    do k = 1, size(endings)
      path = output//trim(endings(k))
      what = what_is(path)
      if (what == "nothing" .or. endings(k) == lock) cycle
      if (what == "a file") then
        ours = begins(path, [hdf5])
        if (ours) cycle
        what = "not a file of a run"
      end if
      call fail(error, exit_files, path//": exists already and is "//what//"; it is left as it is; remove it, " &
        //"or choose another output with -o")
      return
    end do
  end subroutine check_places

  !> Whether a file is empty, or begins in one of several ways.
  function begins(path, ways) result(yes)
    character(len=*), intent(in) :: path
    character(len=8), intent(in) :: ways(:)
    logical :: yes
    character(len=8) :: first
    integer(int64) :: n

    call read_bytes(path, 1_int64, first, n)
    yes = n == 0 .or. (n == 8 .and. any(ways == first))
  end function begins

  !> Fails if a new run would replace an output, or delete what another run has left: that needs --force.
  subroutine check_start(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error

    if (is_file(output)) then
      call fail(error, exit_files, output//": exists already; --resume with a longer stop rule continues it, " &
        //"--force replaces it when the run has finished, -o writes elsewhere")
    else if (is_file(output//unfinished)) then
      call fail(error, exit_files, output//unfinished//": exists already, from a run that did not finish; --resume " &
        //"goes on, --force starts over")
    end if
  end subroutine check_start

  !> Gives an output that is complete its final name; of a file that was not there when the run began nothing is taken.
  subroutine take_final_name(output, replaces, error)
    character(len=*), intent(in) :: output        !! path of the output
    logical, intent(in) :: replaces               !! a file of this name
    type(error_t), allocatable, intent(out) :: error
    logical :: done

    call synchronize(output//unfinished, done)
    if (is_file(output) .and. .not. replaces) then
      call fail(error, exit_files, output//": has come since the run began; it is left as it is, and the results stay in " &
        //output//unfinished//" until it is moved away")
      return
    end if
    if (done) call move_file(output//unfinished, output, done)
    if (.not. done) call fail(error, exit_files, output//unfinished//": cannot be renamed: "//last_problem())
  end subroutine take_final_name

  !> Removes what a run that was killed has left half made.
  subroutine remove_temporaries(output)
    character(len=*), intent(in) :: output        !! path of the output

    call remove_file(output//unfinished_new)
  end subroutine remove_temporaries

  !> Whether there is a file of this name.
  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = what_is(path) /= "nothing"
  end function is_file

end module run_files
