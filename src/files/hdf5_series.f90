!> Time series in an HDF5 file: datasets that grow by one sample at a time along the last dimension.
!> The whole storage of a series is allocated when the series is created, although the file system
!> uses disk space only for the parts already written. Afterwards only values are written. Therefore
!> other programs can read the file at any time, and the file stays consistent even if the program
!> is killed.
module hdf5_series
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8, real32
  use hdf5, only: hid_t, hsize_t, h5dclose_f, h5gclose_f, h5olink_f, h5_integer_kind, h5_real_kind, h5kind_to_type, &
    h5t_ieee_f32le, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le
  use hdf5_objects, only: hdf5_file_t
  use kinds, only: int32, int64, real64
  use texts, only: written
  implicit none
  private
  public :: series_t, double_precision, single_precision, short_integer, long_integer

  !> Types of the stored values.
  integer, parameter :: double_precision = 1, single_precision = 2, short_integer = 3, long_integer = 4
  integer, parameter :: bytes_of(4) = [8, 4, 4, 8]
  integer(int64), parameter :: copied_at_once = 1048576     !! buffer size for copying [bytes]

  !> One series. The caller sets the name, storage type and shape. The series is then created in a
  !> new file or located in an existing file. The dataset then stays open until `close`, or until
  !> its file is closed.
  type :: series_t
    character(len=96) :: name = ""                !! path of the dataset
    integer :: storage = double_precision
    integer :: rank = 0                           !! number of dimensions of a sample; 0 for a single number
    integer :: shape(2) = 1                       !! shape of a sample; unused dimensions have the extent 1
    integer(int64) :: capacity = 0                !! number of samples for which the dataset has space
    integer(hid_t) :: dataset = -1                !! the open dataset
  contains
    procedure :: make
    procedure :: make_element
    procedure :: find
    procedure :: close => close_series
    procedure :: pass
    generic :: store => store_reals, store_integers
    procedure :: load
    procedure :: copy
    procedure :: width
    procedure :: has_integers
    procedure :: holds
    procedure :: bytes_per_sample
    procedure, private :: store_reals, store_integers, extents, storage_type
  end type series_t

contains

  !> Number of values in a sample.
  elemental function width(self)
    class(series_t), intent(in) :: self
    integer :: width

    width = product(self%shape)
  end function width

  !> True if the values of the series are integers.
  elemental function has_integers(self) result(yes)
    class(series_t), intent(in) :: self
    logical :: yes

    yes = self%storage == short_integer .or. self%storage == long_integer
  end function has_integers

  !> True if the storage type can represent all given values.
  pure function holds(self, values) result(yes)
    class(series_t), intent(in) :: self
    integer(int64), intent(in) :: values(:, :)    !! shape (width, samples)
    logical :: yes

    yes = .true.
    if (self%storage == short_integer) yes = all(abs(values) <= huge(0_int32))
  end function holds

  !> Size of one sample in the file [bytes].
  elemental function bytes_per_sample(self) result(bytes)
    class(series_t), intent(in) :: self
    integer(int64) :: bytes

    bytes = int(bytes_of(self%storage), int64)*self%width()
  end function bytes_per_sample

  !> HDF5 type of the stored values.
  function storage_type(self) result(type)
    class(series_t), intent(in) :: self
    integer(hid_t) :: type, types(4)

    types = [h5t_ieee_f64le, h5t_ieee_f32le, h5t_std_i32le, h5t_std_i64le]
    type = types(self%storage)
  end function storage_type

  !> Shape of a dataset with `count` samples.
  pure function extents(self, count)
    class(series_t), intent(in) :: self
    integer(int64), intent(in) :: count
    integer(int64) :: extents(self%rank + 1)

    extents = [int(self%shape(:self%rank), int64), count]
  end function extents

  !> Creates the series in a file, with space for `capacity` samples.
  subroutine make(self, file, capacity)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity

    self%capacity = capacity
    call file%make_dataset(trim(self%name), self%storage_type(), int(self%extents(capacity), hsize_t), self%dataset)
  end subroutine make

  !> Creates the series as the value of an H5MD element, with links to the series of its steps and
  !> times. The group of the element stays open meanwhile, because HDF5 would otherwise search for
  !> its path three times, which takes long if the file contains thousands of elements.
  subroutine make_element(self, file, capacity, step, time)
    class(series_t), intent(inout) :: self        !! its name ends in /value
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity
    type(series_t), intent(in) :: step, time
    integer(hid_t) :: group
    integer :: slash, status(3)

    self%capacity = capacity
    slash = index(self%name, "/", back=.true.)
    call file%make_group(self%name(:slash - 1), group)
    call file%make_dataset(trim(self%name(slash + 1:)), self%storage_type(), int(self%extents(capacity), hsize_t), self%dataset, &
      group)
    status = 0
    if (.not. allocated(file%failure)) then
      call h5olink_f(step%dataset, group, "step", status(1))
      call h5olink_f(time%dataset, group, "time", status(2))
    end if
    if (group >= 0) call h5gclose_f(group, status(3))  ! also after a failure
    call file%check(minval(status), "link the step and the time of "//trim(self%name))
  end subroutine make_element

  !> Locates the series in a file, where its samples must have the expected shape. The file may
  !> contain 64-bit integers even if 32-bit integers are expected.
  subroutine find(self, file)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(hsize_t), allocatable :: extents(:)
    integer :: bytes, status
    logical :: there

    self%dataset = -1
    if (allocated(file%failure)) return
    call file%open_dataset(trim(self%name), self%dataset, extents, status, bytes_each=bytes)
    if (status < 0) self%dataset = -1
    if (self%storage == short_integer .and. bytes == bytes_of(long_integer)) self%storage = long_integer
    there = size(extents) == self%rank + 1 .and. extents(1) >= 0
    if (there) there = all(extents(:self%rank) == self%shape(:self%rank))
    if (there) self%capacity = extents(self%rank + 1)
    call file%check(merge(0, -1, there), "be read: there is no "//trim(self%name)//" of the expected shape")
  end subroutine find

  !> Closes the dataset, which makes HDF5 write its buffered values.
  subroutine close_series(self, file)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer :: status

    if (self%dataset < 0) return
    call h5dclose_f(self%dataset, status)
    call file%check(status, "write "//trim(self%name))
    self%dataset = -1
  end subroutine close_series

  !> Stores samples of real numbers. Single-precision values are converted here, because the
  !> conversion by HDF5 would take ten times as long. A single sample in double precision, which may
  !> be large, is written without copying it.
  subroutine store_reals(self, file, first, values)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first           !! index of the first sample, starting at 1
    real(real64), intent(in), target :: values(:, :)     !! shape (width, samples)
    real(real64), allocatable, target :: doubles(:, :)
    real(real32), allocatable, target :: singles(:, :)

    if (allocated(file%failure)) return
    if (self%storage == single_precision) then
      singles = real(values, real32)
      call self%pass(file, first, size(values, 2, int64), h5kind_to_type(real32, h5_real_kind), c_loc(singles), .true.)
    else if (size(values, 2) == 1) then
      call self%pass(file, first, 1_int64, h5kind_to_type(real64, h5_real_kind), c_loc(values(1, 1)), .true.)
    else
      doubles = values
      call self%pass(file, first, size(values, 2, int64), h5kind_to_type(real64, h5_real_kind), c_loc(doubles), .true.)
    end if
  end subroutine store_reals

  !> Stores samples of integers, converted to the type in the file.
  subroutine store_integers(self, file, first, values)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first           !! index of the first sample, starting at 1
    integer(int64), intent(in), target :: values(:, :)   !! shape (width, samples)
    integer(int32), allocatable, target :: shorts(:, :)
    integer(int64), allocatable, target :: longs(:, :)

    if (allocated(file%failure)) return
    if (self%storage == short_integer) then
      shorts = int(values, int32)
      call self%pass(file, first, size(values, 2, int64), h5kind_to_type(int32, h5_integer_kind), c_loc(shorts), .true.)
    else if (size(values, 2) == 1) then
      call self%pass(file, first, 1_int64, h5kind_to_type(int64, h5_integer_kind), c_loc(values(1, 1)), .true.)
    else
      longs = values
      call self%pass(file, first, size(values, 2, int64), h5kind_to_type(int64, h5_integer_kind), c_loc(longs), .true.)
    end if
  end subroutine store_integers

  !> Writes samples from a memory address to the file, or reads samples from the file into memory.
  subroutine pass(self, file, first, count, type, address, writing)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first           !! index of the first sample, starting at 1
    integer(int64), intent(in) :: count           !! number of samples
    integer(hid_t), intent(in) :: type            !! HDF5 type in memory
    type(c_ptr), intent(in) :: address
    logical, intent(in) :: writing

    call file%transfer(self%dataset, first, self%extents(count), type, address, writing)
  end subroutine pass

  !> Reads one sample as double-precision numbers.
  subroutine load(self, file, number, values)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: number          !! index of the sample, starting at 1
    real(real64), intent(inout), target :: values(*)

    if (number < 1 .or. number > self%capacity) call file%check(-1, "be read: "//trim(self%name)//" has no sample " &
      //written(number))
    call self%pass(file, number, 1_int64, h5kind_to_type(real64, h5_real_kind), c_loc(values), writing=.false.)
  end subroutine load

  !> Copies the first `count` samples of the same series from another file.
  subroutine copy(self, file, source, from, count)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file, source
    type(series_t), intent(in) :: from            !! the series in the file `source`
    integer(int64), intent(in) :: count
    integer(int8), allocatable, target :: buffer(:)
    integer(int64) :: first, n, step

    step = max(1_int64, copied_at_once/self%bytes_per_sample())
    allocate (buffer(min(step, count)*self%bytes_per_sample()))
    do first = 1, count, step
      n = min(step, count - first + 1)
      call from%pass(source, first, n, self%storage_type(), c_loc(buffer), writing=.false.)
      call self%pass(file, first, n, self%storage_type(), c_loc(buffer), writing=.true.)
    end do
  end subroutine copy

end module hdf5_series
