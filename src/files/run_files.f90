!> The files of a run, all named after its output OUT.h5, and what of it may be replaced or removed: only what a run
!> has written, and of that nothing that somebody may still want.
module run_files
  use, intrinsic :: iso_fortran_env, only: int8
  use errors, only: error_t, exit_files, fail
  use kinds, only: int64
  use sealed_file, only: crc_of
  use system, only: file_size, last_problem, move_file, read_bytes, remove_file, synchronize, what_is
  implicit none
  private
  public :: run_file, output_of, is_file, check_places, check_start, remove_checkpoints, remove_temporaries
  public :: identify, check_replaced, take_final_name

  ! What the name of a file ends with. An ending with .h5 replaces that of the output; an output without has none.
  character(len=*), parameter, public :: &
    unfinished = ".part", &                       !! the output while it is being written
    unfinished_new = ".part_new", &               !! the same until all that is written once is in it
    lock = ".lock", &                             !! keeps other runs from this output
    current_checkpoint = ".chk.h5", &
    previous_checkpoint = ".chk_prev.h5", &
    new_checkpoint = ".chk_new.h5"                !! while it is being written
  character(len=12), parameter :: endings(*) = [character(len=12) :: "", unfinished, unfinished_new, lock, &
    current_checkpoint, previous_checkpoint, new_checkpoint]

  ! What such files begin with; zeros as long as the rest of the file is not complete.
  character(len=8), parameter :: hdf5 = char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)
  character(len=8), parameter :: free = repeat(achar(0), 8), sealed = "ricochet"

  !> The identity of a file that does not exist.
  integer(int64), parameter, public :: no_file(2) = [-1_int64, 0_int64]

contains

  !> Name of a file of the run that has a certain output.
  pure function run_file(output, ending) result(path)
    character(len=*), intent(in) :: output        !! path of the output
    character(len=*), intent(in) :: ending        !! one of the names above
    character(len=:), allocatable :: path
    integer :: kept

    path = output//ending
    kept = index(ending//"|", ".h5|") - 1
    if (kept > 0) path = output//ending(:kept)
    if (kept > 0 .and. index(output//"|", ".h5|") > 1) path = output(:len(output) - 3)//ending
  end function run_file

  !> The output of the run that has a file of this name, not being its output; empty if there can be none.
  pure function output_of(path) result(output)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: output
    integer :: k, last

    do k = 2, size(endings)
      do last = len(path) - len_trim(endings(k)), len(path) - len_trim(endings(k)) + 3, 3
        if (last < 1) cycle
        output = path(:last)//".h5"
        if (run_file(output, trim(endings(k))) == path) return
        output = path(:last)
        if (run_file(output, trim(endings(k))) == path) return
      end do
    end do
    output = ""
  end function output_of

  !> Fails if something that no run has written stands where the run is to write.
  subroutine check_places(output, error)
    character(len=*), intent(in) :: output        !! path of the output
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: path, what
    logical :: ours
    integer :: k

    do k = 1, size(endings)
      path = run_file(output, trim(endings(k)))
      what = what_is(path)
      if (what == "nothing" .or. endings(k) == lock) cycle
      if (what == "a file") then
        ours = begins(path, [merge(hdf5, sealed, index(endings(k), ".chk") == 0), free])
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
    else if (is_file(run_file(output, current_checkpoint))) then
      call fail(error, exit_files, run_file(output, current_checkpoint)//": exists already, from a run that was " &
        //"stopped; --resume goes on, --force starts over")
    else if (is_file(run_file(output, unfinished))) then
      call fail(error, exit_files, run_file(output, unfinished)//": exists already, from a run that ended without a " &
        //"checkpoint; --force deletes it and starts over, -o writes elsewhere")
    end if
  end subroutine check_start

  !> Finds what tells a file from others, wherever it is copied: its size, and the checksum of its bytes. Of a file of more
  !> than 64 MB it is that of 64 pieces spread over it: two runs, or two parts of one, differ in all their frames.
  subroutine identify(path, identity, problem)
    character(len=*), intent(in) :: path
    integer(int64), intent(out) :: identity(2)    !! [bytes], CRC-32; `no_file` if there is none
    character(len=:), allocatable, intent(out) :: problem   !! why it cannot be found; else empty
    integer(int64), parameter :: piece = 1048576, most_pieces = 64
    character(len=:), allocatable :: what, bytes
    integer(int64) :: size, pieces, k, n

    identity = no_file
    problem = ""
    what = what_is(path)
    if (what == "nothing") return
    size = file_size(path)
    if (size < 0) problem = "cannot be read: "//last_problem()
    if (what /= "a file") problem = "is "//what
    if (problem /= "") return
    identity = [size, 0_int64]
    allocate (character(len=min(size, piece)) :: bytes)
    pieces = min((size + piece - 1)/piece, most_pieces)
    do k = 0, pieces - 1
      call read_bytes(path, 1 + (size - len(bytes))*k/max(pieces - 1, 1_int64), bytes, n)
      if (n < 0) problem = "cannot be read: "//last_problem()
      if (n < 0) return
      identity(2) = crc_of(transfer(bytes(:n), [0_int8]), identity(2))
    end do
  end subroutine identify

  !> Fails if the finished output would replace another file than the one that was there when the run began.
  subroutine check_replaced(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    integer(int64), intent(in) :: replaced(2)     !! the identity of that file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    integer(int64) :: identity(2)

    call identify(output, identity, problem)
    if (problem == "" .and. .not. (all(identity == no_file) .or. all(identity == replaced))) &
      problem = "is not the file that was there when the run began"
    if (problem /= "") call fail(error, exit_files, output//": "//problem//"; it is left as it is, and the results stay in " &
      //run_file(output, unfinished)//" until it is moved away")
  end subroutine check_replaced

  !> Gives an output that is complete its final name.
  subroutine take_final_name(output, replaced, error)
    character(len=*), intent(in) :: output        !! path of the output
    integer(int64), intent(in) :: replaced(2)     !! the identity of the file that it may replace
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: part
    logical :: done

    part = run_file(output, unfinished)
    call synchronize(part, done)
    if (done) call check_replaced(output, replaced, error)
    if (allocated(error)) return
    if (done) call move_file(part, output, done)
    if (.not. done) call fail(error, exit_files, part//": cannot be renamed to "//output//": "//last_problem())
  end subroutine take_final_name

  !> Removes all checkpoints of an output.
  subroutine remove_checkpoints(output)
    character(len=*), intent(in) :: output        !! path of the output

    call remove_file(run_file(output, current_checkpoint))
    call remove_file(run_file(output, previous_checkpoint))
    call remove_file(run_file(output, new_checkpoint))
  end subroutine remove_checkpoints

  !> Removes what a run that was killed has left half made.
  subroutine remove_temporaries(output)
    character(len=*), intent(in) :: output        !! path of the output

    call remove_file(run_file(output, unfinished_new))
    call remove_file(run_file(output, new_checkpoint))
  end subroutine remove_temporaries

  !> Whether there is a file of this name.
  function is_file(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = what_is(path) /= "nothing"
  end function is_file

end module run_files
