!> Tracks: sets of series that are sampled together, such as the frames, the observables and the
!> event log. Each sample adds values to all series of its track, and a counter in the file contains
!> the number of complete samples. The counter is written only after the values have been flushed,
!> so that readers and resumed runs can rely on it.
!>
!> A sample contains the reals and the integers of all series, one series after another. Small
!> samples are buffered, because one HDF5 call takes as long as writing a hundred kilobytes.
module sample_track
  use kinds, only: int64, real64
  use hdf5_objects, only: hdf5_file_t, scalar
  use hdf5_series, only: long_integer, series_t
  use sample_numbers, only: first_values, sample_t
  use system, only: seconds
  use texts, only: written
  implicit none
  private
  public :: track_t

  !> Maximum total size of the samples written by one call [bytes].
  integer(int64), parameter :: batch_bytes = 262144
  !> Maximum number of samples written by one call.
  integer(int64), parameter :: most_in_batch = 512
  !> Space reserved if the number of samples is unknown [bytes].
  integer(int64), parameter :: first_bytes = 67108864
  !> Minimum number of samples for which space is reserved.
  integer(int64), parameter :: fewest = 16
  integer(int64), parameter :: growth = 4      !! factor by which the capacity of a full file increases

  type :: track_t
    !> Series of the track. If all series share a step and a time, the first two series contain
    !> them.
    type(series_t), allocatable :: series(:)
    character(len=:), allocatable :: counter      !! path of the dataset with the number of complete samples
    integer(int64) :: planned = 0                       !! number of samples in the whole run; 0 if unknown
    integer(int64) :: capacity = 0                      !! number of samples for which the file has space
    integer(int64), private :: committed = 0            !! number of complete samples in the file
    integer(int64), private :: waiting = 0              !! number of samples in the buffer
    !> Clock time when the oldest buffered sample was added [s].
    real(real64), private :: waiting_since = 0.0_real64
    type(sample_t), private :: buffer                   !! buffered samples, with space for a batch
  contains
    procedure :: appended
    procedure :: bytes_per_sample
    procedure :: first_capacity
    procedure :: enlarged
    procedure :: widen
    procedure :: make
    procedure :: resume
    procedure :: put_counter
    procedure :: move
    procedure :: append
    procedure :: flush => flush_buffer
    procedure :: verify
    procedure, private :: batch, commit
  end type track_t

contains

  !> Number of samples added so far, both written and buffered.
  elemental function appended(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = self%committed + self%waiting
  end function appended

  !> Size of one sample in the file [bytes].
  elemental function bytes_per_sample(self) result(bytes)
    class(track_t), intent(in) :: self
    integer(int64) :: bytes

    bytes = sum(self%series%bytes_per_sample())
  end function bytes_per_sample

  !> Number of samples written by one call.
  pure function batch(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = max(1_int64, min(most_in_batch, batch_bytes/self%bytes_per_sample()))
  end function batch

  !> Initial capacity, in samples.
  elemental function first_capacity(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = self%planned
    if (n == 0) n = max(fewest, first_bytes/self%bytes_per_sample())
  end function first_capacity

  !> Capacity required for `count` more samples. An insufficient capacity is multiplied by a
  !> constant factor, which leaves space for later samples.
  pure function enlarged(self, count) result(n)
    class(track_t), intent(in) :: self
    integer(int64), intent(in) :: count
    integer(int64) :: n

    n = self%capacity
    do while (n < self%appended() + count)
      n = max(growth*n, 1_int64)
    end do
  end function enlarged

  !> Changes the type of a series to 64-bit integers if one of the given samples contains an integer
  !> too large for 32 bits. The present file keeps its types; the next file created will contain
  !> 64-bit integers.
  subroutine widen(self, samples, widened)
    class(track_t), intent(inout) :: self
    type(sample_t), intent(in) :: samples
    logical, intent(out) :: widened                     !! whether the type of any series has changed
    integer :: first(size(self%series)), k

    widened = .false.
    first = first_values(self%series%width(), self%series%has_integers())
    do k = 1, size(self%series)
      associate (series => self%series(k))
        if (.not. series%has_integers()) cycle
        if (series%holds(samples%integers(first(k):first(k) + series%width() - 1, :))) cycle
        series%storage = long_integer
        widened = .true.
      end associate
    end do
  end subroutine widen

  !> Creates the series and the counter in a new file. H5MD prescribes links between the steps and
  !> the times of elements that are sampled together.
  subroutine make(self, file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity              !! number of samples
    integer :: k

    self%capacity = capacity
    do k = 1, size(self%series)
      if (k > 3 .and. index(self%series(1)%name, "/step") > 0) then
        call self%series(k)%make_element(file, capacity, self%series(1), self%series(2))
      else
        call self%series(k)%make(file, capacity)
      end if
      call file%hold(self%series(k)%dataset)
    end do
    call self%put_counter(file)
  end subroutine make

  !> Locates the series in an existing file, to continue after the first `count` samples. The file
  !> is not changed.
  subroutine resume(self, file, count)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count
    integer(int64) :: committed(1)
    integer :: k

    committed = 0
    call file%fetch(self%counter, 1, committed)
    if (committed(1) < count) call file%check(-1, "be continued: "//self%counter//" is " &
      //written(committed(1))//", the checkpoint says "//written(count))
    do k = 1, size(self%series)
      call self%series(k)%find(file)
      call file%hold(self%series(k)%dataset)
      if (self%series(k)%capacity < committed(1)) call file%check(-1, "be continued: "//self%counter//" is " &
        //written(committed(1))//", but "//trim(self%series(k)%name)//" has only "//written(self%series(k)%capacity))
    end do
    self%capacity = minval(self%series%capacity)
    self%committed = count
  end subroutine resume

  !> Writes the number of complete samples to the file. After `resume`, this call makes readers
  !> ignore samples that were written after the checkpoint.
  subroutine put_counter(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file

    call file%put(self%counter, scalar, [self%committed])
  end subroutine put_counter

  !> Creates the series with a different capacity in a new file, and copies all samples written so
  !> far.
  subroutine move(self, file, source, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file, source
    integer(int64), intent(in) :: capacity
    type(series_t) :: old(size(self%series))
    integer :: k

    old = self%series
    call self%make(file, capacity)
    do k = 1, size(self%series)
      call self%series(k)%copy(file, source, old(k), self%committed)
    end do
  end subroutine move

  !> Checks that the file contains all samples and no unused space. A violation is recorded as a
  !> failure of the file.
  subroutine verify(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64) :: committed(1)
    integer :: k

    committed = -1
    call file%fetch(self%counter, 1, committed)
    if (committed(1) /= self%appended()) call file%check(-1, "be read back: samples are missing")
    do k = 1, size(self%series)
      associate (series => self%series(k))
        if (file%length(trim(series%name)) /= series%width()*self%appended()) &
          call file%check(-1, "be read back: samples are missing in "//trim(series%name))
      end associate
    end do
  end subroutine verify

  !> Appends samples; the file must have space for them. Full batches of buffered samples are
  !> committed, that is, written to the file.
  subroutine append(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(sample_t), intent(in) :: samples
    integer(int64) :: count

    count = samples%count()
    if (self%waiting + count > self%batch()) call self%flush(file, 0.0_real64)
    if (count >= self%batch()) then
      call self%commit(file, samples)
      return
    end if
    if (.not. allocated(self%buffer%reals)) call self%buffer%make_room(samples, self%batch())
    if (self%waiting == 0) self%waiting_since = seconds()
    call self%buffer%insert(self%waiting, samples)
    self%waiting = self%waiting + count
    if (self%waiting == self%batch()) call self%flush(file, 0.0_real64)
  end subroutine append

  !> Commits the buffered samples if the oldest of them has been in the buffer for at least
  !> `least_wait`.
  subroutine flush_buffer(self, file, least_wait)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: least_wait              !! [s]

    if (self%waiting == 0) return
    if (seconds() - self%waiting_since < least_wait) return
    call self%commit(file, self%buffer%first(self%waiting))
    self%waiting = 0
  end subroutine flush_buffer

  !> Writes samples to the file after the existing complete samples, flushes the file, and then
  !> increases the counter.
  subroutine commit(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(sample_t), intent(in) :: samples
    integer :: first(size(self%series)), last, k

    first = first_values(self%series%width(), self%series%has_integers())
    do k = 1, size(self%series)
      associate (series => self%series(k))
        last = first(k) + series%width() - 1
        if (series%has_integers()) then
          call series%store(file, self%committed + 1, samples%integers(first(k):last, :))
        else
          call series%store(file, self%committed + 1, samples%reals(first(k):last, :))
        end if
      end associate
    end do
    call file%flush()
    if (allocated(file%failure)) return
    self%committed = self%committed + samples%count()
    call self%put_counter(file)
    call file%flush()
  end subroutine commit

end module sample_track
