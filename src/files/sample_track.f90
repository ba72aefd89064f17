!> Series that are filled together: frames, observables, or events. A counter in the file says how many samples
!> are complete; it is written after their values have been flushed, and readers and restarts go by it.
!>
!> A sample is one record of reals, the values of each series one after the other; integers are exact up to
!> 2**53. Small samples are buffered: a call of HDF5 costs as much as a hundred kilobytes.
module sample_track
  use kinds, only: int64, real64
  use hdf5_objects, only: hdf5_file_t, scalar
  use hdf5_series, only: series_t
  use system, only: seconds
  use texts, only: written
  implicit none
  private
  public :: track_t

  integer(int64), parameter :: batch_bytes = 262144     !! samples that are written together
  integer(int64), parameter :: most_in_batch = 512      !! samples
  integer(int64), parameter :: first_bytes = 67108864   !! room made for an unknown number of samples
  integer(int64), parameter :: fewest = 16              !! samples there is room for, however large
  integer(int64), parameter :: growth = 4               !! room is multiplied by this when it is used up

  type :: track_t
    type(series_t), allocatable :: series(:)            !! step and time first, if they share them; none: not in use
    character(len=:), allocatable :: counter            !! path of its dataset
    integer(int64) :: capacity = 0                      !! samples there is room for
    integer(int64) :: appended = 0                      !! samples taken over, written or not
    integer(int64), private :: committed = 0            !! samples that are complete in the file
    real(real64), private :: waiting_since = 0.0_real64 !! of the oldest sample in the buffer [s]
    real(real64), allocatable, private :: buffer(:, :)  !! (width,:) samples that are not written
  contains
    procedure :: make
    procedure :: resume
    procedure :: commit
    procedure :: copy
    procedure :: close => close_track
    procedure :: first_capacity
    procedure :: enlarged
    procedure :: append
    procedure :: write_buffer
    procedure :: verify
    procedure :: room
    procedure, private :: batch
    procedure, private :: keep
    procedure, private :: write_samples
    procedure, private :: link_step_and_time
  end type track_t

contains

  !> Bytes of one sample in the file.
  elemental function room(self) result(bytes)
    class(track_t), intent(in) :: self
    integer(int64) :: bytes
    integer :: k

    bytes = 0
    if (.not. allocated(self%series)) return
    do k = 1, size(self%series)
      bytes = bytes + self%series(k)%room()
    end do
  end function room

  !> Number of samples that are written together.
  pure function batch(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = max(1_int64, min(most_in_batch, batch_bytes/self%room()))
  end function batch

  !> The capacity that `count` more samples need, with room for later ones if it has to grow.
  pure function enlarged(self, count) result(n)
    class(track_t), intent(in) :: self
    integer(int64), intent(in) :: count
    integer(int64) :: n

    n = self%capacity
    do while (n < self%appended + count)
      n = max(growth*n, 1_int64)
    end do
  end function enlarged

  !> Room to begin with for an unknown number of samples.
  pure function first_capacity(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = 0
    if (allocated(self%series)) n = max(fewest, first_bytes/self%room())
  end function first_capacity

  !> Makes the track in a new file.
  subroutine make(self, file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity              !! samples
    integer :: k

    if (.not. allocated(self%series)) return
    self%capacity = capacity
    do k = 1, size(self%series)
      call self%series(k)%make(file, self%capacity)
    end do
    call self%link_step_and_time(file)
    call file%put(self%counter, scalar, [0_int64])
  end subroutine make

  !> Gives all elements the step and time of the first, as H5MD wants it for what is sampled together.
  subroutine link_step_and_time(self, file)
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
  end subroutine link_step_and_time

  !> Opens the track of a file and goes back to its first `count` samples; the file stays as it is.
  subroutine resume(self, file, count)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count
    integer(int64) :: committed(1)
    integer :: k

    if (.not. allocated(self%series)) return
    committed = 0
    call file%fetch(self%counter, 1, committed)
    if (committed(1) < count) call file%check(-1, "go on: "//self%counter//" is " &
      //written(committed(1))//", the checkpoint says "//written(count))
    do k = 1, size(self%series)
      call self%series(k)%open(file)
      if (self%series(k)%capacity < committed(1)) call file%check(-1, "go on: "//self%counter//" is " &
        //written(committed(1))//", but "//trim(self%series(k)%name)//" has only "//written(self%series(k)%capacity))
    end do
    self%capacity = minval(self%series%capacity)
    self%appended = count
    self%committed = count
  end subroutine resume

  !> Tells readers which samples are complete: after `resume`, no more than those it went back to.
  subroutine commit(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file

    if (allocated(self%series)) call file%put(self%counter, scalar, [self%committed])
  end subroutine commit

  !> Makes the same track in a new file with another capacity, with all samples that are written.
  subroutine copy(self, file, source, source_file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file, source_file
    type(track_t), intent(in) :: source
    integer(int64), intent(in) :: capacity
    integer :: k

    if (.not. allocated(source%series)) return
    self%series = source%series
    self%counter = source%counter
    self%appended = source%committed
    self%committed = source%committed
    call self%make(file, capacity)
    do k = 1, size(self%series)
      call self%series(k)%copy(file, source%series(k), source_file, source%committed)
    end do
    call self%commit(file)
  end subroutine copy

  !> Notes a failure of the file if it lacks samples.
  subroutine verify(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64) :: committed(1)
    integer :: k

    if (.not. allocated(self%series)) return
    committed = -1
    call file%fetch(self%counter, 1, committed)
    if (committed(1) /= self%appended) call file%check(-1, "be read back: samples are missing")
    do k = 1, size(self%series)
      associate (series => self%series(k))
        if (file%length(trim(series%name)) /= series%width()*self%appended) &
          call file%check(-1, "be read back: samples are missing in "//trim(series%name))
      end associate
    end do
  end subroutine verify

  !> Closes the series; the samples in the buffer must have been written.
  subroutine close_track(self)
    class(track_t), intent(inout) :: self
    integer :: k

    if (.not. allocated(self%series)) return
    do k = 1, size(self%series)
      call self%series(k)%close()
    end do
  end subroutine close_track

  !> Takes over the next samples, for which there must be room. They are written at once if they fill a batch.
  !> What cannot be written stays in the buffer.
  subroutine append(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: samples(:, :)           !! (width,count)
    integer(int64) :: count, waiting

    count = size(samples, 2)
    if (self%appended - self%committed + count > self%batch()) call self%write_buffer(file, 0.0_real64)
    waiting = self%appended - self%committed
    self%appended = self%appended + count
    if (count >= self%batch()) call self%write_samples(file, samples)
    if (self%committed == self%appended) return
    if (waiting == 0) self%waiting_since = seconds()
    call self%keep(waiting, samples)
    if (waiting + count == self%batch()) call self%write_buffer(file, 0.0_real64)
  end subroutine append

  !> Puts samples into the buffer, behind those that wait there.
  subroutine keep(self, waiting, samples)
    class(track_t), intent(inout) :: self
    integer(int64), intent(in) :: waiting               !! samples in the buffer
    real(real64), intent(in) :: samples(:, :)           !! (width,count)

    if (waiting + size(samples, 2) > self%batch()) return       ! only when nothing can be written any more
    if (.not. allocated(self%buffer)) allocate (self%buffer(size(samples, 1), self%batch()))
    self%buffer(:, waiting + 1:waiting + size(samples, 2)) = samples
  end subroutine keep

  !> Writes the buffer if its oldest sample has waited for some time.
  subroutine write_buffer(self, file, least_wait)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: least_wait              !! [s]

    if (self%appended == self%committed .or. allocated(file%failure)) return
    if (seconds() - self%waiting_since < least_wait) return
    call self%write_samples(file, self%buffer(:, :self%appended - self%committed))
  end subroutine write_buffer

  !> Writes samples behind those that are committed, and commits them: first the values, then the counter.
  subroutine write_samples(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: samples(:, :)           !! (width,count)
    integer(int64) :: committed
    integer :: k, first

    first = 1
    do k = 1, size(self%series)
      call self%series(k)%write(file, self%committed + 1, samples(first:first + self%series(k)%width() - 1, :))
      first = first + self%series(k)%width()
    end do
    committed = self%committed + size(samples, 2)
    call file%flush()
    call file%put(self%counter, scalar, [committed])
    call file%flush()
    if (.not. allocated(file%failure)) self%committed = committed
  end subroutine write_samples

end module sample_track
