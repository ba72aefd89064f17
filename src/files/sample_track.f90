!> Series that are filled together: frames, observables, events. A counter in the file says how many samples
!> are complete; it is written after their data have been flushed. A reader, or a restart, goes by it.
module sample_track
  use kinds, only: int64, real64
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: series_t
  use system, only: seconds
  use texts, only: written
  implicit none
  private
  public :: track_t

  integer(int64), parameter :: batch_bytes = 262144     !! samples that wait to be written together
  integer(int64), parameter :: most_in_batch = 512      !! samples
  integer(int64), parameter :: first_bytes = 67108864   !! room made for an unknown number of samples
  integer(int64), parameter :: fewest = 16              !! samples there is room for, however large
  integer(int64), parameter :: growth = 4               !! room is multiplied by this when it is used up

  type :: track_t
    type(series_t), allocatable :: series(:)            !! step, time, values; of events values alone
    character(len=:), allocatable :: counter            !! name of its dataset
    integer(int64) :: capacity = 0                      !! samples there is room for
    integer(int64) :: committed = 0                     !! samples that are complete in the file
    integer(int64) :: put = 0                           !! samples handed over, be they written or not
    real(real64) :: waiting_since = 0.0_real64          !! of the oldest sample that is not written [s]
  contains
    procedure :: is_in_use
    procedure :: make
    procedure :: resume
    procedure :: copy
    procedure :: close => close_track
    procedure :: larger
    procedure :: put_moment
    procedure :: commit
    procedure :: write_waiting
    procedure :: room
    procedure, private :: batch
    procedure, private :: link_moments
  end type track_t

contains

  pure function is_in_use(self) result(yes)
    class(track_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%series)
  end function is_in_use

  !> Bytes of one sample.
  pure function room(self) result(bytes)
    class(track_t), intent(in) :: self
    integer(int64) :: bytes
    integer :: k

    bytes = 0
    do k = 1, size(self%series)
      bytes = bytes + self%series(k)%room()
    end do
  end function room

  !> Samples that wait for each other.
  pure function batch(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = max(1_int64, min(most_in_batch, batch_bytes/self%room()))
  end function batch

  !> The capacity to have next, to take `count` more samples.
  pure function larger(self, count) result(n)
    class(track_t), intent(in) :: self
    integer(int64), intent(in) :: count
    integer(int64) :: n

    n = self%capacity
    do while (n < self%put + count)
      n = max(growth*n, 1_int64)
    end do
  end function larger

  !> Makes the track in a new file, with room for `capacity` samples; 0: nobody knows how many.
  subroutine make(self, file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity
    integer :: k

    if (.not. self%is_in_use()) return
    self%capacity = capacity
    if (capacity == 0) self%capacity = max(fewest, first_bytes/self%room())
    do k = 1, size(self%series)
      self%series(k)%batch = self%batch()
      call self%series(k)%make(file, self%capacity)
    end do
    call self%link_moments(file)
    call file%put(self%counter, [integer ::], [0_int64])
  end subroutine make

  !> Gives all elements the step and time of the first, as H5MD wants it for what is sampled together.
  subroutine link_moments(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    character(len=:), allocatable :: element
    integer :: k

    if (index(self%series(1)%name, "/step") == 0) return
    do k = 4, size(self%series)
      element = trim(self%series(k)%name)
      element = element(:len(element) - len("value"))
      call file%link(trim(self%series(1)%name), element//"step")
      call file%link(trim(self%series(2)%name), element//"time")
    end do
  end subroutine link_moments

  !> Opens the track of a file and goes back to its first `count` samples.
  subroutine resume(self, file, count)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count
    integer(int64) :: committed(1)
    integer :: k

    if (.not. self%is_in_use()) return
    committed = 0
    call file%fetch(self%counter, 1, committed)
    if (committed(1) < count) call file%check(-1, "go on: "//self%counter//" is " &
      //written(committed(1))//", the checkpoint says "//written(count))
    do k = 1, size(self%series)
      self%series(k)%batch = self%batch()
      call self%series(k)%open(file)
    end do
    self%capacity = self%series(1)%capacity
    self%committed = count
    self%put = count
    if (committed(1) /= count) call file%replace(self%counter, count)
  end subroutine resume

  !> Makes the track in a new file with another capacity, with all the samples it has.
  subroutine copy(self, file, source, source_file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file, source_file
    type(track_t), intent(in) :: source
    integer(int64), intent(in) :: capacity
    integer :: k

    if (.not. source%is_in_use()) return
    self%series = source%series
    self%counter = source%counter
    self%put = source%put
    self%committed = source%committed
    call self%make(file, capacity)
    do k = 1, size(self%series)
      call self%series(k)%copy(file, source%series(k), source_file, source%committed)
    end do
    call file%replace(self%counter, self%committed)
  end subroutine copy

  subroutine close_track(self)
    class(track_t), intent(inout) :: self
    integer :: k

    if (.not. self%is_in_use()) return
    do k = 1, size(self%series)
      call self%series(k)%close()
    end do
  end subroutine close_track

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
    if (self%put - self%committed >= self%batch()) call self%write_waiting(file)
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

end module sample_track
