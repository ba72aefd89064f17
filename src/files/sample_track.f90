!> Series that are filled together: frames, observables, or events. A counter in the file says how many samples
!> are complete; it is written after their values have been flushed, and readers and restarts go by it.
!>
!> A sample is one record of reals, the values of each series one after the other; integers are exact up to
!> 2**53. Small samples are buffered: a call of HDF5 costs as much as a hundred kilobytes.
module sample_track
  use kinds, only: int64, real64
  use hdf5_objects, only: hdf5_file_t, scalar
  use hdf5_series, only: long_integer, series_t
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
    type(series_t), allocatable :: series(:)            !! step and time first, if they share them
    character(len=:), allocatable :: counter            !! path of its dataset
    integer(int64) :: planned = 0                       !! samples of the whole run; 0: unknown
    integer(int64) :: capacity = 0                      !! samples there is room for
    integer(int64), private :: committed = 0            !! samples that are complete in the file
    integer(int64), private :: waiting = 0              !! samples in the buffer
    real(real64), private :: waiting_since = 0.0_real64 !! of the oldest of them [s]
    real(real64), allocatable, private :: buffer(:, :)  !! (width,batch)
  contains
    procedure :: appended
    procedure :: room
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
    procedure, private :: batch, commit, link_step_and_time
  end type track_t

contains

  !> Samples taken over, written or not.
  elemental function appended(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = self%committed + self%waiting
  end function appended

  !> Bytes of one sample in the file.
  elemental function room(self) result(bytes)
    class(track_t), intent(in) :: self
    integer(int64) :: bytes

    bytes = sum(self%series%room())
  end function room

  !> Number of samples that are written together.
  pure function batch(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = max(1_int64, min(most_in_batch, batch_bytes/self%room()))
  end function batch

  !> Room to begin with.
  elemental function first_capacity(self) result(n)
    class(track_t), intent(in) :: self
    integer(int64) :: n

    n = self%planned
    if (n == 0) n = max(fewest, first_bytes/self%room())
  end function first_capacity

  !> The capacity that `count` more samples need, with room for later ones if it has to grow.
  pure function enlarged(self, count) result(n)
    class(track_t), intent(in) :: self
    integer(int64), intent(in) :: count
    integer(int64) :: n

    n = self%capacity
    do while (n < self%appended() + count)
      n = max(growth*n, 1_int64)
    end do
  end function enlarged

  !> Lets series have longer integers, in the next file, where these samples need them.
  subroutine widen(self, samples, widened)
    class(track_t), intent(inout) :: self
    real(real64), intent(in) :: samples(:, :)           !! (width,count)
    logical, intent(out) :: widened                     !! whether any series has changed
    integer :: k, first

    widened = .false.
    first = 1
    do k = 1, size(self%series)
      associate (series => self%series(k))
        if (.not. series%holds(samples(first:first + series%width() - 1, :))) then
          series%storage = long_integer
          widened = .true.
        end if
        first = first + series%width()
      end associate
    end do
  end subroutine widen

  !> Makes the track in a new file.
  subroutine make(self, file, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity              !! samples
    integer :: k

    self%capacity = capacity
    do k = 1, size(self%series)
      call self%series(k)%make(file, capacity)
    end do
    call self%link_step_and_time(file)
    call self%put_counter(file)
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

  !> Finds the track in a file and goes back to its first `count` samples; the file stays as it is.
  subroutine resume(self, file, count)
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
      call self%series(k)%find(file)
      if (self%series(k)%capacity < committed(1)) call file%check(-1, "go on: "//self%counter//" is " &
        //written(committed(1))//", but "//trim(self%series(k)%name)//" has only "//written(self%series(k)%capacity))
    end do
    self%capacity = minval(self%series%capacity)
    self%committed = count
  end subroutine resume

  !> Tells readers which samples are complete: after `resume`, no more than those it went back to.
  subroutine put_counter(self, file)
    class(track_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file

    call file%put(self%counter, scalar, [self%committed])
  end subroutine put_counter

  !> Makes the track in a new file with another capacity, and copies all samples that are written.
  subroutine move(self, file, source, capacity)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file, source
    integer(int64), intent(in) :: capacity
    integer :: k

    call self%make(file, capacity)
    do k = 1, size(self%series)
      call self%series(k)%copy(file, source, self%committed)
    end do
  end subroutine move

  !> Notes a failure of the file if it lacks samples, or has room for more.
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

  !> Takes over the next samples, for which there must be room. They are committed at once if they fill a batch.
  subroutine append(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: samples(:, :)           !! (width,count)
    integer(int64) :: count

    count = size(samples, 2)
    if (self%waiting + count > self%batch()) call self%flush(file, 0.0_real64)
    if (count >= self%batch()) then
      call self%commit(file, samples)
      return
    end if
    if (.not. allocated(self%buffer)) allocate (self%buffer(size(samples, 1), self%batch()))
    if (self%waiting == 0) self%waiting_since = seconds()
    self%buffer(:, self%waiting + 1:self%waiting + count) = samples
    self%waiting = self%waiting + count
    if (self%waiting == self%batch()) call self%flush(file, 0.0_real64)
  end subroutine append

  !> Commits the samples in the buffer if the oldest has waited for some time.
  subroutine flush_buffer(self, file, least_wait)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: least_wait              !! [s]

    if (self%waiting == 0) return
    if (seconds() - self%waiting_since < least_wait) return
    call self%commit(file, self%buffer(:, :self%waiting))
    self%waiting = 0
  end subroutine flush_buffer

  !> Stores samples behind those that are complete, and then counts them: their values reach the disk first.
  subroutine commit(self, file, samples)
    class(track_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(in) :: samples(:, :)           !! (width,count)
    integer :: k, first

    first = 1
    do k = 1, size(self%series)
      call self%series(k)%store(file, self%committed + 1, samples(first:first + self%series(k)%width() - 1, :))
      first = first + self%series(k)%width()
    end do
    call file%flush()
    if (allocated(file%failure)) return
    self%committed = self%committed + size(samples, 2)
    call self%put_counter(file)
    call file%flush()
  end subroutine commit

end module sample_track
