!> The output file of a run: its tracks, their growth, and the exchange of the file by one that fits better.
!>
!> A file never changes its layout. When the number of samples is known at the start it has room for just
!> these. Otherwise, when the room is used up, and at the end, a new file replaces it in one instant.
module h5md_file
  use kinds, only: int64, real64
  use errors, only: error_t
  use hdf5_objects, only: hdf5_file_t
  use sample_track, only: track_t
  use system, only: remove_file
  implicit none
  private
  public :: h5md_file_t

  !> The tracks.
  integer, parameter, public :: frame_track = 1, observable_track = 2, event_track = 3, n_tracks = 3

  type :: h5md_file_t
    type(hdf5_file_t) :: file
    type(track_t) :: track(n_tracks)
  contains
    procedure :: capacities
    procedure :: make_tracks
    procedure :: resume_tracks
    procedure :: commit
    procedure :: replace_by
    procedure :: write_buffers
    procedure :: close => close_file
    procedure :: verify
  end type h5md_file_t

contains

  !> The capacities to begin with, where those that are planned are known or not.
  pure function capacities(self, planned)
    class(h5md_file_t), intent(in) :: self
    integer(int64), intent(in) :: planned(n_tracks)       !! samples; 0: their number is unknown
    integer(int64) :: capacities(n_tracks)
    integer :: k

    capacities = planned
    do k = 1, n_tracks
      if (planned(k) == 0) capacities(k) = self%track(k)%first_capacity()
    end do
  end function capacities

  !> Makes room for samples in a new file.
  subroutine make_tracks(self, planned)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: planned(n_tracks)       !! samples; 0: their number is unknown
    integer(int64) :: capacities(n_tracks)
    integer :: k

    capacities = self%capacities(planned)
    do k = 1, n_tracks
      call self%track(k)%make(self%file, capacities(k))
    end do
  end subroutine make_tracks

  !> Opens the tracks of the open file and goes back to their first samples.
  subroutine resume_tracks(self, counts)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: counts(n_tracks)        !! of samples that have been taken
    integer :: k

    do k = 1, n_tracks
      call self%track(k)%resume(self%file, counts(k))
    end do
  end subroutine resume_tracks

  !> Tells readers how far the tracks have gone back.
  subroutine commit(self)
    class(h5md_file_t), intent(inout) :: self
    integer :: k

    do k = 1, n_tracks
      call self%track(k)%commit(self%file)
    end do
    call self%file%flush()
  end subroutine commit

  !> Puts a new file, with the same samples and other capacities, in the place of this one. The new file has
  !> all but the tracks.
  subroutine replace_by(self, new, capacities)
    class(h5md_file_t), intent(inout) :: self
    type(h5md_file_t), intent(inout) :: new
    integer(int64), intent(in) :: capacities(n_tracks)
    integer :: k

    do k = 1, n_tracks
      call new%track(k)%copy(new%file, self%track(k), self%file, capacities(k))
    end do
    call new%file%flush()
    if (allocated(self%file%failure)) call new%file%check(-1, self%file%failure)
    call new%file%rename()
    if (allocated(new%file%failure)) then
      self%file%failure = new%file%failure
      self%file%unsaved = new%file%unsaved
      call new%close()
      call remove_file(new%file%path)
    else
      call self%close()
      self%file = new%file
      self%track = new%track
    end if
  end subroutine replace_by

  !> Writes the samples that have waited in a buffer for some time; without `least_wait` all.
  subroutine write_buffers(self, least_wait)
    class(h5md_file_t), intent(inout) :: self
    real(real64), intent(in), optional :: least_wait      !! [s]
    real(real64) :: wait
    integer :: k

    wait = 0
    if (present(least_wait)) wait = least_wait
    do k = 1, n_tracks
      call self%track(k)%write_buffer(self%file, wait)
    end do
  end subroutine write_buffers

  !> Closes the tracks and the file.
  subroutine close_file(self)
    class(h5md_file_t), intent(inout) :: self
    integer :: k

    do k = 1, n_tracks
      call self%track(k)%close()
    end do
    call self%file%close()
  end subroutine close_file

  !> Reads back what shows whether the closed file has all samples, and no room for more.
  subroutine verify(self, error)
    class(h5md_file_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    integer :: k

    call file%open(self%file%path, writable=.false.)
    do k = 1, n_tracks
      call self%track(k)%verify(file)
    end do
    call file%close()
    call file%report(error)
  end subroutine verify

end module h5md_file
