!> Datasets that are filled along their last dimension. Their storage is allocated as a whole when they are
!> made and takes no room on the disk before it is filled; nothing but data is ever written after that, so
!> that a kill at any moment, or a reader, meets a file in order. Small items wait in memory until they are
!> written together: a call of the library costs as much as a hundred kilobytes.
module hdf5_series
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr, c_sizeof
  use, intrinsic :: iso_fortran_env, only: int8, real32
  use hdf5, only: hid_t, hsize_t, h5_integer_kind, h5kind_to_type, h5dcreate_f, h5dopen_f, &
    h5dread_f, h5dwrite_f, h5dclose_f, h5dget_space_f, h5pclose_f, h5screate_simple_f, h5sclose_f, &
    h5sselect_hyperslab_f, h5s_select_set_f, h5t_native_double, h5t_native_real, h5t_ieee_f32le, &
    h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le
  use hdf5_objects, only: hdf5_file_t, prepare_dataset, prepare_links
  use kinds, only: int32, int64, real64
  implicit none
  private
  public :: series_t, double_precision, single_precision, short_integer, long_integer

  !> How numbers are stored.
  integer, parameter :: double_precision = 1, single_precision = 2, short_integer = 3, long_integer = 4
  integer, parameter :: bytes_of(4) = [8, 4, 4, 8]
  integer(int64), parameter :: copied_at_once = 1048576     !! [bytes]

  !> One series. Its name, storage and shape are given, then it is made or opened.
  type :: series_t
    character(len=96) :: name = ""                !! path of the dataset
    integer :: storage = double_precision
    integer :: rank = 0                           !! of one item; 0: a number
    integer :: shape(2) = 1                       !! of one item, as far as it has dimensions
    integer(int64) :: batch = 1                   !! items that are written together
    integer(int64) :: capacity = 0                !! items there is room for
    integer(int64), private :: waiting = 0        !! items put but not written
    integer(int64), private :: first_waiting = 0  !! number of the first of them
    integer(int8), allocatable, private :: batch_of_bytes(:)    !! the waiting items, as they came
    integer(hid_t), private :: in_memory = -1     !! HDF5 type of their values
    integer(hid_t), private :: id = -1
  contains
    procedure :: make
    procedure :: open => open_series
    procedure :: write_waiting
    procedure :: copy
    procedure :: close => close_series
    procedure :: room
    generic :: put => put_reals, put_integers, put_longs
    procedure, private :: put_reals, put_integers, put_longs
    procedure, private :: put_items, write_items, read_items, storage_type
  end type series_t

contains

  !> Bytes of one item in the file.
  pure function room(self) result(bytes)
    class(series_t), intent(in) :: self
    integer(int64) :: bytes

    bytes = bytes_of(self%storage)*product(int(self%shape, int64))
  end function room

  !> Its HDF5 type in the file.
  function storage_type(self) result(type)
    class(series_t), intent(in) :: self
    integer(hid_t) :: type, types(4)

    types = [h5t_ieee_f64le, h5t_ieee_f32le, h5t_std_i32le, h5t_std_i64le]
    type = types(self%storage)
  end function storage_type

  !> Makes the series with room for `capacity` items.
  subroutine make(self, file, capacity)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: capacity
    integer(hid_t) :: space, properties, links
    integer :: status, closed

    if (allocated(file%trouble)) return
    self%capacity = capacity
    call prepare_dataset(properties, status)
    if (status >= 0) call prepare_links(links, status)
    if (status >= 0) call h5screate_simple_f(self%rank + 1, &
      int([int(self%shape(:self%rank), int64), capacity], hsize_t), space, status)
    if (status >= 0) call h5dcreate_f(file%id, trim(self%name), self%storage_type(), space, self%id, status, &
      properties, links)
    call file%check(status, "write "//trim(self%name))
    call h5sclose_f(space, closed)
    call h5pclose_f(properties, closed)
    call h5pclose_f(links, closed)
  end subroutine make

  !> Opens the series in a file that is to go on.
  subroutine open_series(self, file)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer :: status

    if (allocated(file%trouble)) return
    self%capacity = file%length(trim(self%name))/product(int(self%shape, int64))
    call h5dopen_f(file%id, trim(self%name), self%id, status)
    call file%check(status, "be read: "//trim(self%name))
  end subroutine open_series

  subroutine close_series(self)
    class(series_t), intent(inout) :: self
    integer :: status

    if (self%id >= 0) call h5dclose_f(self%id, status)
    self%id = -1
  end subroutine close_series

  !> Takes over the first `count` items of the same series in another file.
  subroutine copy(self, file, source, source_file, count)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file, source_file
    class(series_t), intent(in) :: source
    integer(int64), intent(in) :: count
    integer(int8), allocatable, target :: buffer(:)
    integer(int64) :: first, n, step

    step = max(1_int64, copied_at_once/self%room())
    allocate (buffer(min(step, count)*self%room()))
    do first = 1, count, step
      n = min(step, count - first + 1)
      call source%read_items(source_file, first, n, self%storage_type(), c_loc(buffer))
      call self%write_items(file, first, n, self%storage_type(), c_loc(buffer))
    end do
  end subroutine copy

  subroutine put_reals(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first           !! number of the first of these items, from 1
    integer(int64), intent(in) :: count           !! of items
    real(real64), intent(in), target :: values(*)
    real(real32), allocatable, target :: short(:)

    if (self%storage == single_precision) then    ! HDF5 would take ten times as long to shorten them
      short = real(values(:count*product(int(self%shape, int64))), real32)
      call self%put_items(file, first, count, h5t_native_real, c_sizeof(short(1)), c_loc(short))
    else
      call self%put_items(file, first, count, h5t_native_double, c_sizeof(values(1)), c_loc(values))
    end if
  end subroutine put_reals

  subroutine put_integers(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(int32), intent(in), target :: values(*)

    call self%put_items(file, first, count, h5kind_to_type(int32, h5_integer_kind), c_sizeof(values(1)), c_loc(values))
  end subroutine put_integers

  subroutine put_longs(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(int64), intent(in), target :: values(*)

    call self%put_items(file, first, count, h5kind_to_type(int64, h5_integer_kind), c_sizeof(values(1)), c_loc(values))
  end subroutine put_longs

  !> Lets the items wait, after those before them have been written if there is no place for all; a whole
  !> batch is written at once.
  subroutine put_items(self, file, first, count, in_memory, width, address)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(hid_t), intent(in) :: in_memory       !! HDF5 type of the values
    integer(int64), intent(in) :: width           !! of a value in memory [bytes]
    type(c_ptr), intent(in) :: address
    integer(int8), pointer :: bytes(:)
    integer(int64) :: n

    if (count >= self%batch) then
      call self%write_items(file, first, count, in_memory, address)
      return
    end if
    if (self%waiting + count > self%batch) call self%write_waiting(file)
    if (self%waiting == 0) self%first_waiting = first
    n = width*product(int(self%shape, int64))
    if (.not. allocated(self%batch_of_bytes)) allocate (self%batch_of_bytes(n*self%batch))
    self%in_memory = in_memory
    call c_f_pointer(address, bytes, [n*count])
    self%batch_of_bytes(n*self%waiting + 1:n*(self%waiting + count)) = bytes
    self%waiting = self%waiting + count
  end subroutine put_items

  !> Writes the items that wait.
  subroutine write_waiting(self, file)
    class(series_t), intent(inout), target :: self
    type(hdf5_file_t), intent(inout) :: file

    if (self%waiting > 0) call self%write_items(file, self%first_waiting, self%waiting, self%in_memory, &
      c_loc(self%batch_of_bytes))
    self%waiting = 0
  end subroutine write_waiting

  subroutine write_items(self, file, first, count, in_memory, address)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(hid_t), intent(in) :: in_memory
    type(c_ptr), intent(in) :: address
    integer(hid_t) :: there, here
    integer :: status, closed

    if (allocated(file%trouble)) return
    file%unsaved = file%unsaved + count*self%room()
    call select_items(self, first, count, there, here, status)
    if (status >= 0) call h5dwrite_f(self%id, in_memory, address, status, here, there)
    call file%check(status, "write "//trim(self%name))
    call h5sclose_f(there, closed)
    call h5sclose_f(here, closed)
  end subroutine write_items

  subroutine read_items(self, file, first, count, in_memory, address)
    class(series_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(hid_t), intent(in) :: in_memory
    type(c_ptr), intent(in) :: address
    type(c_ptr) :: place
    integer(hid_t) :: there, here
    integer :: status, closed

    if (allocated(file%trouble)) return
    place = address
    call select_items(self, first, count, there, here, status)
    if (status >= 0) call h5dread_f(self%id, in_memory, place, status, here, there)
    call file%check(status, "be read: "//trim(self%name))
    call h5sclose_f(there, closed)
    call h5sclose_f(here, closed)
  end subroutine read_items

  !> Some items, as part of the file and of the memory.
  subroutine select_items(self, first, count, there, here, status)
    class(series_t), intent(in) :: self
    integer(int64), intent(in) :: first, count
    integer(hid_t), intent(out) :: there, here
    integer, intent(out) :: status
    integer(hsize_t) :: start(self%rank + 1), counts(self%rank + 1)

    counts = [int(self%shape(:self%rank), hsize_t), int(count, hsize_t)]
    start = 0
    start(size(start)) = first - 1
    call h5screate_simple_f(size(counts), counts, here, status)
    if (status >= 0) call h5dget_space_f(self%id, there, status)
    if (status >= 0) call h5sselect_hyperslab_f(there, h5s_select_set_f, start, counts, status)
  end subroutine select_items

end module hdf5_series
