!> Datasets that grow along their last dimension. Storage is allocated ahead, whole or in blocks, so that
!> between two allocations no metadata change: a kill at any moment, or a reader, meets a file in order.
!> Small items wait in memory until they are written together: a call of the library costs as much as a
!> hundred kilobytes.
module hdf5_series
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: hid_t, hsize_t, h5_integer_kind, h5kind_to_type, h5dcreate_f, h5dopen_f, &
    h5dwrite_f, h5dclose_f, h5dget_space_f, h5dset_extent_f, h5pclose_f, h5pset_chunk_f, &
    h5screate_simple_f, h5sclose_f, h5sselect_hyperslab_f, h5s_select_set_f, h5s_unlimited_f, &
    h5t_native_double, h5t_ieee_f32le, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le
  use hdf5_objects, only: hdf5_file_t, prepare_dataset, prepare_links
  use kinds, only: int32, int64, real64
  implicit none
  private
  public :: series_t, double_precision, single_precision, short_integer, long_integer

  !> How numbers are stored.
  integer, parameter :: double_precision = 1, single_precision = 2, short_integer = 3, &
    long_integer = 4
  integer, parameter :: bytes_of(4) = [8, 4, 4, 8]

  !> One series. Its name, storage and shape are given, then it is made or opened.
  type :: series_t
    character(len=:), allocatable :: name
    integer :: storage = double_precision
    integer, allocatable :: item(:)               !! shape of one item; empty: a number
    integer(int64) :: block = 1                   !! items by which it grows when it is full
    integer(int64) :: batch = 1                   !! items that are written together
    integer(int64), private :: extent = 0         !! items there is room for
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
    procedure :: cut
    procedure :: room
    generic :: put => put_reals, put_integers, put_longs
    procedure, private :: put_reals, put_integers, put_longs
    procedure, private :: grow, place_in_batch, write_items
  end type series_t

contains

  !> Bytes of one item in the file.
  pure function room(self) result(bytes)
    class(series_t), intent(in) :: self
    integer(int64) :: bytes
    bytes = bytes_of(self%storage)*product(int(self%item, int64))
  end function room

  !> Makes the series with storage for `extent` items.
  subroutine make(self, file, extent, chunk)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: extent
    integer(int64), intent(in) :: chunk           !! items that lie together in the file
    integer(hid_t) :: space, properties, links, types(4)
    integer(hsize_t) :: item(size(self%item))
    integer :: status, closed, rank
    if (allocated(file%trouble)) return
    types = [h5t_ieee_f64le, h5t_ieee_f32le, h5t_std_i32le, h5t_std_i64le]
    self%extent = extent
    item = self%item
    rank = size(item) + 1
    call prepare_dataset(properties, status)
    if (status >= 0) call h5pset_chunk_f(properties, rank, [item, int(chunk, hsize_t)], status)
    if (status >= 0) call h5screate_simple_f(rank, [item, int(extent, hsize_t)], space, status, &
      [item, int(h5s_unlimited_f, hsize_t)])
    if (status >= 0) call prepare_links(links, status)
    if (status >= 0) call h5dcreate_f(file%id, self%name, types(self%storage), space, self%id, &
      status, properties, links)
    call file%check(status, "write "//self%name)
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
    self%extent = file%length(self%name)/product(int(self%item, int64))
    call h5dopen_f(file%id, self%name, self%id, status)
    call file%check(status, "be read: "//self%name)
  end subroutine open_series

  !> Gives up what lies beyond the first `count` items, and closes the series.
  subroutine cut(self, file, count)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: count
    integer :: status
    if (allocated(file%trouble)) return
    status = 0
    if (count /= self%extent) call h5dset_extent_f(self%id, int([int(self%item, int64), count], &
      hsize_t), status)
    if (status >= 0) call h5dclose_f(self%id, status)
    call file%check(status, "write "//self%name)
  end subroutine cut

  subroutine put_reals(self, file, first, count, values)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first           !! number of the first of these items, from 1
    integer(int64), intent(in) :: count           !! of items
    real(real64), intent(in), target :: values(*)
    integer(int64) :: n, at
    call self%grow(file, first + count - 1)
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5t_native_double, c_loc(values))
    else
      n = product(int(self%item, int64))
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
    call self%grow(file, first + count - 1)
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5kind_to_type(int32, h5_integer_kind), c_loc(values))
    else
      n = product(int(self%item, int64))
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
    call self%grow(file, first + count - 1)
    if (count >= self%batch) then
      call self%write_items(file, first, count, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
    else
      n = product(int(self%item, int64))
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

  !> Makes room for items up to number `last`, by whole blocks. When an item is put, not when it is written:
  !> then the same run gives a file of the same layout, however its batches fell.
  subroutine grow(self, file, last)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: last
    integer :: status
    if (last <= self%extent .or. allocated(file%trouble)) return
    do while (self%extent < last)
      self%extent = self%extent + self%block
    end do
    call h5dset_extent_f(self%id, int([int(self%item, int64), self%extent], hsize_t), status)
    call file%check(status, "write "//self%name)
    call file%flush()
  end subroutine grow

  !> Writes items.
  subroutine write_items(self, file, first, count, in_memory, address)
    class(series_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(in) :: first, count
    integer(hid_t), intent(in) :: in_memory
    type(c_ptr), intent(in) :: address
    integer(hid_t) :: space, here
    integer(hsize_t) :: start(size(self%item) + 1), counts(size(self%item) + 1)
    integer :: status, closed
    if (allocated(file%trouble)) return
    counts = [int(self%item, hsize_t), int(count, hsize_t)]
    start = 0
    start(size(start)) = first - 1
    file%unsaved = file%unsaved + count*self%room()
    call h5screate_simple_f(size(counts), counts, here, status)
    if (status >= 0) call h5dget_space_f(self%id, space, status)
    if (status >= 0) call h5sselect_hyperslab_f(space, h5s_select_set_f, start, counts, status)
    if (status >= 0) call h5dwrite_f(self%id, in_memory, address, status, here, space)
    call file%check(status, "write "//self%name)
    call h5sclose_f(space, closed)
    call h5sclose_f(here, closed)
  end subroutine write_items

end module hdf5_series
