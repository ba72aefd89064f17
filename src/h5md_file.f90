!> The output file of a run in H5MD layout: where frames, observables and events stand, and that what is
!> committed is there. https://www.nongnu.org/h5md/h5md.html, version 1.1.
!>
!> Each of the three is a track: series that grow together, and a counter of the samples that are complete,
!> written after their data have been flushed. A reader, or a restart, goes by the counter.
module h5md_file
  use kinds, only: int32, int64, real64
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: double_precision, long_integer, series_t, short_integer, single_precision
  use system, only: seconds
  use texts, only: written
  implicit none
  private
  public :: h5md_file_t, track_t

  integer(int64), parameter :: most_in_chunk = 512      !! samples
  integer(int64), parameter :: chunk_bytes = 65536      !! aim for small frames; large ones are one chunk
  integer(int64), parameter :: block_bytes = 1048576    !! room made at once for an unknown number of frames
  integer(int64), parameter :: batch_bytes = 262144     !! samples that wait to be written together
  real(real64), parameter :: longest_wait = 0.05_real64 !! of a sample before it is written [s]

  !> Series that grow together: step, time, values; of events: values alone.
  type :: track_t
    type(series_t), allocatable :: series(:)
    character(len=:), allocatable :: counter            !! name of the dataset
    integer(int64) :: committed = 0                     !! samples that are complete in the file
    integer(int64) :: put = 0                           !! samples handed over, be they written or not
    real(real64), private :: waiting_since = 0.0_real64 !! of the oldest sample that is not written [s]
  contains
    procedure :: make => make_track
    procedure :: resume => resume_track
    procedure :: put_moment
    procedure :: commit
    procedure :: write_waiting
    procedure :: cut => cut_track
    procedure :: room => track_room
    procedure, private :: block_of, batch_of
  end type track_t

  type :: h5md_file_t
    type(hdf5_file_t) :: file
    type(track_t) :: frames, observables, events
  contains
    procedure :: plan_frames
    procedure :: plan_observables
    procedure :: plan_events
    procedure :: make_tracks
    procedure, private :: link_moments
    procedure :: put_observables
    procedure :: put_events
    procedure :: write_old
    procedure :: write_all
  end type h5md_file_t

  character(len=*), parameter :: disks = "particles/disks/"
  integer, parameter, public :: position_series = 3, velocity_series = 4, collisions_series = 5, &
    image_series = 6

contains

  !> The frames of n disks.
  subroutine plan_frames(self, n, single, wrapped)
    class(h5md_file_t), intent(inout) :: self
    integer, intent(in) :: n
    logical, intent(in) :: single                       !! positions and velocities in single precision
    logical, intent(in) :: wrapped                      !! periodic: count the periods, too
    integer :: reals
    reals = merge(single_precision, double_precision, single)
    self%frames%counter = disks//"committed"
    self%frames%series = [moments(disks//"position"), &
      series_t(disks//"position/value", reals, [2, n]), &
      series_t(disks//"velocity/value", reals, [2, n]), &
      series_t(disks//"collisions/value", short_integer, [n])]
    if (wrapped) self%frames%series = [self%frames%series, &
      series_t(disks//"image/value", short_integer, [2, n])]
  end subroutine plan_frames

  !> The observables, by name below /observables.
  subroutine plan_observables(self, names, widths, are_counts)
    class(h5md_file_t), intent(inout) :: self
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: widths(:)                    !! number of components; 1: a scalar
    logical, intent(in) :: are_counts(:)
    integer, allocatable :: item(:)
    integer :: k
    self%observables%counter = "observables/committed"
    self%observables%series = moments("observables/"//trim(names(1)))
    do k = 1, size(names)
      item = [integer ::]
      if (widths(k) > 1) item = [widths(k)]
      self%observables%series = [self%observables%series, series_t("observables/"//trim(names(k)) &
        //"/value", merge(long_integer, double_precision, are_counts(k)), item)]
    end do
  end subroutine plan_observables

  !> The list of collisions.
  subroutine plan_events(self)
    class(h5md_file_t), intent(inout) :: self
    self%events%counter = "events/committed"
    self%events%series = [series_t("events/time", double_precision, [integer ::]), &
      series_t("events/i", short_integer, [integer ::]), &
      series_t("events/j", short_integer, [integer ::]), &
      series_t("events/impulse", double_precision, [integer ::])]
  end subroutine plan_events

  !> Step and time of an H5MD element.
  pure function moments(element) result(series)
    character(len=*), intent(in) :: element
    type(series_t) :: series(2)
    series = [series_t(element//"/step", long_integer, [integer ::]), &
      series_t(element//"/time", double_precision, [integer ::])]
  end function moments

  !> Makes room in the file for what is planned.
  subroutine make_tracks(self, frames, samples)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: frames, samples       !! of observables; 0: unknown
    call self%frames%make(self%file, frames)
    call self%link_moments(self%frames)
    call self%observables%make(self%file, samples)
    call self%link_moments(self%observables)
    if (allocated(self%events%series)) call self%events%make(self%file, 0_int64)
    call self%file%flush()
  end subroutine make_tracks

  !> Gives all elements the step and time of the first, as H5MD wants it for what is sampled together.
  subroutine link_moments(self, track)
    class(h5md_file_t), intent(inout) :: self
    type(track_t), intent(in) :: track
    character(len=:), allocatable :: element
    integer :: k
    do k = 4, size(track%series)
      element = track%series(k)%name
      element = element(:len(element) - len("value"))
      call self%file%link(track%series(1)%name, element//"step")
      call self%file%link(track%series(2)%name, element//"time")
    end do
  end subroutine link_moments

  !> Appends one sample of all observables.
  subroutine put_observables(self, time, values)
    class(h5md_file_t), intent(inout) :: self
    real(real64), intent(in) :: time
    real(real64), intent(in) :: values(:)               !! components one after the other
    integer :: k, first
    associate (track => self%observables)
      call track%put_moment(self%file, time)
      first = 1
      do k = 3, size(track%series)
        associate (series => track%series(k), part => values(first:first + product(track%series(k)%item) - 1))
          if (series%storage == long_integer) then
            call series%put(self%file, track%put + 1, 1_int64, nint(part, int64))
          else
            call series%put(self%file, track%put + 1, 1_int64, part)
          end if
          first = first + size(part)
        end associate
      end do
      call track%commit(self%file, 1_int64)
    end associate
  end subroutine put_observables

  !> Appends n collisions.
  subroutine put_events(self, n, time, pair, impulse)
    class(h5md_file_t), intent(inout) :: self
    integer, intent(in) :: n
    real(real64), intent(in) :: time(:), impulse(:)
    integer(int32), intent(in) :: pair(:, :)            !! (2,:)
    integer(int32), allocatable :: column(:)
    integer(int64) :: first, count
    if (n == 0) return
    associate (track => self%events)
      first = track%put + 1
      count = n
      call track%series(1)%put(self%file, first, count, time)
      column = pair(1, :n)
      call track%series(2)%put(self%file, first, count, column)
      column = pair(2, :n)
      call track%series(3)%put(self%file, first, count, column)
      call track%series(4)%put(self%file, first, count, impulse)
      call track%commit(self%file, count)
    end associate
  end subroutine put_events

  !> Makes room for `planned` samples, or for a block of them if their number is unknown (0).
  subroutine make_track(self, file, planned)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: planned
    integer(int64) :: extent, chunk
    integer :: k
    extent = planned
    if (planned == 0) extent = self%block_of()
    do k = 1, size(self%series)
      associate (series => self%series(k))
        series%block = self%block_of()
        series%batch = self%batch_of()
        chunk = max(1_int64, min(most_in_chunk, extent, chunk_bytes/series%room()))
        call series%make(file, extent, chunk)
      end associate
    end do
    call file%put(self%counter, [integer ::], [0_int64])
  end subroutine make_track

  !> Samples by which the track grows.
  pure function block_of(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n
    n = max(1_int64, min(most_in_chunk, block_bytes/self%room()))
  end function block_of

  !> Samples that wait for each other.
  pure function batch_of(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n
    n = max(1_int64, min(most_in_chunk, batch_bytes/self%room()))
  end function batch_of

  !> Bytes of one sample.
  pure function track_room(self) result(bytes)
    class(track_t), intent(in) :: self
    integer(int64) :: bytes
    integer :: k
    bytes = 0
    do k = 1, size(self%series)
      bytes = bytes + self%series(k)%room()
    end do
  end function track_room

  !> Opens the track of a file and goes back to its first `count` samples.
  subroutine resume_track(self, file, count)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count
    integer(int64) :: committed(1)
    integer :: k
    committed = 0
    call file%fetch(self%counter, 1, committed)
    if (committed(1) < count) call file%check(-1, "go on: "//self%counter//" is " &
      //written(committed(1))//", the checkpoint says "//written(count))
    do k = 1, size(self%series)
      self%series(k)%block = self%block_of()
      self%series(k)%batch = self%batch_of()
      call self%series(k)%open(file)
    end do
    self%committed = count
    self%put = count
    if (committed(1) /= count) call file%replace(self%counter, count)
  end subroutine resume_track

  !> Writes step and time of the sample that is being written.
  subroutine put_moment(self, file, time)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: time
    call self%series(1)%put(file, self%put + 1, 1_int64, [self%put])
    call self%series(2)%put(file, self%put + 1, 1_int64, [time])
  end subroutine put_moment

  !> Declares the next samples complete. They are written when a batch is full or, at the latest, when they
  !> have waited long enough.
  subroutine commit(self, file, count)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count                 !! of samples
    if (self%put == self%committed) self%waiting_since = seconds()
    self%put = self%put + count
    if (self%put - self%committed >= self%batch_of()) call self%write_waiting(file)
  end subroutine commit

  !> Writes what waits: first the data, then the counter.
  subroutine write_waiting(self, file)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer :: k
    if (self%put == self%committed) return
    do k = 1, size(self%series)
      call self%series(k)%write_waiting(file)
    end do
    call file%flush()
    call file%replace(self%counter, self%put)
    call file%flush()
    if (.not. allocated(file%trouble)) self%committed = self%put
  end subroutine write_waiting

  !> Writes the samples that have waited long enough.
  subroutine write_old(self)
    class(h5md_file_t), intent(inout) :: self
    real(real64) :: now
    now = seconds()
    if (now - self%frames%waiting_since > longest_wait) call self%frames%write_waiting(self%file)
    if (now - self%observables%waiting_since > longest_wait) call self%observables%write_waiting(self%file)
    if (now - self%events%waiting_since > longest_wait) call self%events%write_waiting(self%file)
  end subroutine write_old

  !> Writes all samples that wait.
  subroutine write_all(self)
    class(h5md_file_t), intent(inout) :: self
    call self%frames%write_waiting(self%file)
    call self%observables%write_waiting(self%file)
    call self%events%write_waiting(self%file)
  end subroutine write_all

  !> Gives up the room that was not used.
  subroutine cut_track(self, file)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer :: k
    if (.not. allocated(self%series)) return
    do k = 1, size(self%series)
      call self%series(k)%cut(file, self%committed)
    end do
  end subroutine cut_track

end module h5md_file
