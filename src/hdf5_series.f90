!> Datasets that are filled along their last dimension. Their storage is allocated as a whole when they are
!> made and takes no room on the disk before it is filled; nothing but data is ever written after that, so
!> that a kill at any moment, or a reader, meets a file in order. Small items wait in memory until they are
!> written together: a call of the library costs as much as a hundred kilobytes.
module hdf5_series
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5, only: hid_t, hsize_t, h5_integer_kind, h5kind_to_type, h5dcreate_f, h5dopen_f, &
    h5dread_f, h5dwrite_f, h5dclose_f, h5dget_space_f, h5pclose_f, h5screate_simple_f, h5sclose_f, &
    h5sselect_hyperslab_f, h5s_select_set_f, h5t_native_double, h5t_ieee_f32le, h5t_ieee_f64le, &
    h5t_std_i32le, h5t_std_i64le
  use hdf5_objects, only: hdf5_file_t, prepare_dataset, prepare_links
  use kinds, only: int32, int64, real64
  implicit none
  private
  public :: series_t, double_precision, single_precision, short_integer, long_integer

  !> How numbers are stored.
  integer, parameter :: double_precision = 1, single_precision = 2, short_integer = 3, &
    long_integer = 4
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
    real(real64), allocatable, private :: reals(:)          !! the waiting items, by the kind of their values
    integer(int32), allocatable, private :: integers(:)
    integer(int64), allocatable, private :: longs(:)
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
    procedure, private :: place_in_batch, write_items, read_items, storage_type
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
    integer(int64) :: n, at
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5t_native_double, c_loc(values))
    else
      n = product(int(self%shape, int64))
      if (.not. allocated(self%reals)) allocate (self%reals(n*self%batch))
      call self%place_in_batch(file, first, count, at)
      self%reals(n*at + 1:n*(at + count)) = values(:n*count)
    end if
  end subroutine put_reals

  subroutine put_integers(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(int32), intent(in), target :: values(*)
    integer(int64) :: n, at
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5kind_to_type(int32, h5_integer_kind), c_loc(values))
    else
      n = product(int(self%shape, int64))
      if (.not. allocated(self%integers)) allocate (self%integers(n*self%batch))
      call self%place_in_batch(file, first, count, at)
      self%integers(n*at + 1:n*(at + count)) = values(:n*count)
    end if
  end subroutine put_integers

  subroutine put_longs(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(int64), intent(in), target :: values(*)
    integer(int64) :: n, at
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
    else
      n = product(int(self%shape, int64))
      if (.not. allocated(self%longs)) allocate (self%longs(n*self%batch))
      call self%place_in_batch(file, first, count, at)
      self%longs(n*at + 1:n*(at + count)) = values(:n*count)
    end if
  end subroutine put_longs

  !> Where in the batch the next items go, which is written first if they do not fit.
  subroutine place_in_batch(self, file, first, count, at)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(int64), intent(out) :: at             !! items that wait before them
    if (self%waiting + count > self%batch) call self%write_waiting(file)
    if (self%waiting == 0) self%first_waiting = first
    at = self%waiting
    self%waiting = self%waiting + count
  end subroutine place_in_batch

  !> Writes the items that wait.
  subroutine write_waiting(self, file)
    class(series_t), intent(inout), target :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64) :: n
    n = self%waiting
    self%waiting = 0
    if (n == 0) return
    if (allocated(self%reals)) then
      call self%write_items(file, self%first_waiting, n, h5t_native_double, c_loc(self%reals))
    else if (allocated(self%integers)) then
      call self%write_items(file, self%first_waiting, n, h5kind_to_type(int32, h5_integer_kind), &
        c_loc(self%integers))
    else
      call self%write_items(file, self%first_waiting, n, h5kind_to_type(int64, h5_integer_kind), &
        c_loc(self%longs))
    end if
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
