!> Room on the disk: what the planned output needs, and what is kept for the end. A run that cannot write its
!> output any more still writes a checkpoint, and in it the samples that have no room elsewhere.
module disk_room
  use kinds, only: int64, real64
  use errors, only: error_t, exit_files, fail
  use event_log, only: log_capacity
  use h5md_file, only: event_track, n_tracks
  use run_files, only: run_file, unfinished_new
  use sample_track, only: track_t
  use system, only: free_bytes, last_problem, remove_file, reserve_t
  use texts, only: written
  implicit none
  private
  public :: check_room, checkpoint_room, keep_room, last_room, planned_room

contains

  !> Bytes to be kept for the end of a run of n disks: for a checkpoint with all samples that may be waiting then.
  pure function last_room(track, capacities, n) result(bytes)
    type(track_t), intent(in) :: track(n_tracks)
    integer(int64), intent(in) :: capacities(n_tracks)    !! samples; 0: unknown
    integer, intent(in) :: n
    integer(int64) :: bytes
    integer :: k

    bytes = checkpoint_room(n)
    do k = 1, n_tracks
      bytes = bytes + track(k)%most_unwritten(capacities(k), merge(log_capacity, 1, k == event_track))
    end do
  end function last_room

  !> Keeps room for the end.
  subroutine keep_room(reserve, bytes, path, error)
    type(reserve_t), intent(inout) :: reserve
    integer(int64), intent(in) :: bytes
    character(len=*), intent(in) :: path          !! of the output
    type(error_t), allocatable, intent(out) :: error
    logical :: taken

    call remove_file(run_file(path, unfinished_new))
    call reserve%take(run_file(path, unfinished_new), bytes, taken)
    if (.not. taken) call fail(error, exit_files, path//": cannot keep room for the end of the run: " &
      //last_problem()//": "//written(bytes)//" bytes needed, "//written(free_bytes(path))//" bytes free")
  end subroutine keep_room

  !> Bytes that the output of n disks needs at least: of unknown samples the first and the last count.
  pure function planned_room(track, capacities, n) result(bytes)
    type(track_t), intent(in) :: track(n_tracks)
    integer(int64), intent(in) :: capacities(n_tracks)
    integer, intent(in) :: n
    integer(int64) :: bytes
    integer(int64), parameter :: constants = 104  !! per disk: id, species, mass, radius, the last state [bytes]

    bytes = int(min(9.0e18_real64, &
      constants*n + sum(real(max(capacities, 2_int64), real64)*real(track%room(), real64))), int64)
  end function planned_room

  !> Refuses a run whose planned output, and the room for its end, do not fit onto the disk.
  subroutine check_room(planned, kept, path, error)
    integer(int64), intent(in) :: planned         !! for the output [bytes]
    integer(int64), intent(in) :: kept            !! for the end [bytes]
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error

    if (real(planned, real64) + kept > free_bytes(path)) call fail(error, exit_files, path//": the output will have " &
      //written(planned)//" bytes, its end needs "//written(kept)//" more, "//written(free_bytes(path)) &
      //" are free; choose fewer frames or make room")
  end subroutine check_room

  !> Bytes that a checkpoint of n disks needs.
  pure function checkpoint_room(n) result(bytes)
    integer, intent(in) :: n
    integer(int64) :: bytes
    integer(int64), parameter :: per_disk = 96, besides = 32768

    bytes = per_disk*n + besides
  end function checkpoint_room

end module disk_room
