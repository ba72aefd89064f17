!> Reads and writes datasets, parts of datasets, and attributes in an open HDF5 file.
!>
!> The name `group/dataset` is the path of a dataset; the name `group@name` is an attribute of a
!> group.
module hdf5_objects
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: haddr_t, hid_t, hsize_t, size_t, h5_integer_kind, h5kind_to_type, h5ldelete_f, &
    h5oopen_f, h5oclose_f, h5acreate_f, h5aopen_f, h5aread_f, h5awrite_f, &
    h5aget_space_f, h5aclose_f, h5dcreate_f, h5dopen_f, h5dwrite_f, h5dread_f, h5dclose_f, h5dget_space_f, h5dget_type_f, &
    h5dget_create_plist_f, h5dget_offset_f, h5dget_storage_size_f, h5pclose_f, h5pget_external_count_f, h5pget_layout_f, &
    h5d_chunked_f, h5d_virtual_f, h5iget_name_f, h5screate_simple_f, h5sclose_f, h5sget_simple_extent_dims_f, &
    h5sget_simple_extent_ndims_f, &
    h5sget_simple_extent_npoints_f, h5sselect_hyperslab_f, h5s_select_set_f, h5tcopy_f, h5tset_size_f, h5tget_size_f, &
    h5tget_class_f, h5tis_variable_str_f, h5tclose_f, h5t_native_double, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le, &
    h5t_fortran_s1
  use hdf5_handle, only: hdf5_handle_t
  use kinds, only: int32, int64, real64
  use system, only: write_word
  implicit none
  private
  public :: hdf5_file_t, scalar

  integer, parameter :: scalar(0) = [integer ::]  !! shape of a dataset with a single value

  ! Upper limits of string lengths, because a damaged file may contain wrong lengths. All strings
  ! written by this program are shorter.
  integer(int64), parameter :: most_texts = 10000
  integer(size_t), parameter :: longest_text = 67108864      !! [bytes]

  type, extends(hdf5_handle_t) :: hdf5_file_t
  contains
    procedure :: remove_last
    procedure :: make_dataset
    procedure :: open_dataset
    procedure :: extents
    procedure :: length
    procedure :: transfer
    generic :: put => put_reals, put_integers, put_longs, put_text, put_texts
    generic :: fetch => fetch_reals, fetch_longs
    procedure :: fetch_text
    procedure :: fetch_texts
    procedure, private :: put_reals, put_integers, put_longs, put_text, put_texts, put_values, put_attribute
    procedure, private :: fetch_reals, fetch_longs, fetch_values
  end type hdf5_file_t

contains

  !> Removes the most recently created dataset, so that the file ends after the values of the
  !> dataset `before`. Each of the three steps leaves a valid file:
  !> 1. The link to the dataset is deleted. The storage of the dataset is not freed yet, because the
  !>    dataset is still open.
  !> 2. The new length of the file is written to its header. HDF5 itself would write this length
  !>    only after truncating the file.
  !> 3. The dataset is closed, which frees the storage.
  subroutine remove_last(self, name, before)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, before
    ! offset of the file length in the header of an HDF5 file
    integer(int64), parameter :: header_end = 40
    integer(hid_t) :: dataset, kept
    integer(hsize_t) :: bytes
    integer(hsize_t), allocatable :: extents(:)
    integer(haddr_t) :: offset
    integer :: status, closed
    logical :: done

    if (allocated(self%failure)) return
    call self%open_dataset(before, kept, extents, status)
    if (status >= 0) call h5dget_offset_f(kept, offset, status)
    if (status >= 0) call h5dget_storage_size_f(kept, bytes, status)
    call h5dclose_f(kept, closed)
    if (status >= 0) call self%open_dataset(name, dataset, extents, status)
    if (status >= 0) call h5ldelete_f(self%id, name, status)
    call self%check(status, "remove "//name)
    call self%flush()
    if (allocated(self%failure)) return
    call write_word(self%path, header_end, int(offset + bytes, int64), done)
    if (done) call h5dclose_f(dataset, closed)  ! after a failure, closing the dataset would truncate the file
    call self%check(merge(0, -1, done), "remove "//name)
  end subroutine remove_last

  !> Creates a dataset. The dataset is closed again unless the caller requests it open.
  subroutine make_dataset(self, name, type, extents, opened, group)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hid_t), intent(in) :: type            !! HDF5 type in the file
    integer(hsize_t), intent(in) :: extents(:)    !! shape of the dataset; empty for a single value
    integer(hid_t), intent(out), optional :: opened      !! the open dataset; -1 after a failure
    integer(hid_t), intent(in), optional :: group !! open group to which `name` is relative
    integer(hid_t) :: dataset, space, place
    integer :: status, closed

    if (present(opened)) opened = -1
    if (allocated(self%failure)) return
    call h5screate_simple_f(size(extents), extents, space, status)
    place = self%id
    if (present(group)) place = group
    if (status >= 0) call h5dcreate_f(place, name, type, space, dataset, status, self%storage, self%links)
    call self%check(status, "write "//name)
    if (status >= 0 .and. present(opened)) opened = dataset
    if (status >= 0 .and. .not. present(opened)) call h5dclose_f(dataset, closed)
    call h5sclose_f(space, closed)
  end subroutine make_dataset

  !> Opens a dataset whose values are all stored in this file. Datasets with values in other files
  !> are refused, because those files could be devices or belong to other users. The storage size is
  !> checked, because HDF5 1.10 reads beyond the end of a damaged dataset.
  subroutine open_dataset(self, name, dataset, extents, status, like, bytes_each)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hid_t), intent(out) :: dataset
    integer(hsize_t), allocatable, intent(out) :: extents(:)
    integer, intent(out) :: status                !! negative if the dataset does not exist or cannot be used
    !> HDF5 type whose class (real, integer or text) the dataset must have.
    integer(hid_t), intent(in), optional :: like
    integer, intent(out), optional :: bytes_each  !! size of one value [bytes]
    integer(hid_t) :: creation, space, type
    integer(hsize_t) :: most(32), shape(32), n, stored
    integer(size_t) :: bytes                      ! size of one value [bytes]
    integer :: layout, n_files, kinds(2), rank, closed

    extents = [-1_hsize_t]
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) return
    call h5dget_create_plist_f(dataset, creation, status)
    if (status >= 0) call h5pget_layout_f(creation, layout, status)
    if (status >= 0) call h5pget_external_count_f(creation, n_files, status)
    if (status >= 0 .and. (layout == h5d_virtual_f .or. n_files > 0)) status = -1
    call self%check(status, "be used: "//name//" stores its values in another file")
    call h5pclose_f(creation, closed)
    if (status >= 0) call h5dget_space_f(dataset, space, status)
    if (status >= 0) call h5sget_simple_extent_ndims_f(space, rank, status)
    call h5sget_simple_extent_npoints_f(space, n, closed)
    ! If a dataset contains no values, HDF5 reports a failure for a request of the number of values
    ! or the storage size.
    if (closed < 0) n = 0
    if (status >= 0) call h5sget_simple_extent_dims_f(space, shape, most, status)
    call h5sclose_f(space, closed)
    if (status >= 0) call h5dget_type_f(dataset, type, status)
    if (status >= 0) call h5tget_size_f(type, bytes, status)
    if (present(bytes_each)) bytes_each = merge(int(bytes), 0, status >= 0)
    if (status >= 0 .and. layout /= h5d_chunked_f .and. n > 0) then
      call h5dget_storage_size_f(dataset, stored, status)
      if (stored /= n*int(bytes, hsize_t)) status = -1
    end if
    if (present(like)) then
      if (status >= 0) call h5tget_class_f(type, kinds(1), status)
      if (status >= 0) call h5tget_class_f(like, kinds(2), status)
      if (status >= 0 .and. kinds(1) /= kinds(2)) status = -1
    end if
    call h5tclose_f(type, closed)
    if (status >= 0) extents = shape(:rank)
    if (status >= 0 .and. rank == 0 .and. n == 0) extents = [n]           ! created without values
    if (status < 0) call h5dclose_f(dataset, closed)
  end subroutine open_dataset

  !> Shape of a dataset; [-1] if the dataset does not exist.
  function extents(self, name, bytes) result(extent)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(out), optional :: bytes       !! size of one value in the file [bytes]
    integer(hsize_t), allocatable :: extent(:)
    integer(hid_t) :: dataset
    integer :: status

    extent = [-1_hsize_t]
    if (allocated(self%failure)) return
    call self%open_dataset(name, dataset, extent, status, bytes_each=bytes)
    if (status >= 0) call h5dclose_f(dataset, status)
  end function extents

  !> Number of values in a dataset; -1 if the dataset does not exist, or if its stated size exceeds
  !> the maximum size of a file.
  function length(self, name) result(n)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64) :: n

    n = product_of(self%extents(name))
  end function length

  !> Number of values of an array of the given shape; -1 if they would not fit into any file.
  pure function product_of(extents) result(n)
    integer(hsize_t), intent(in) :: extents(:)
    integer(int64) :: n

    n = -1
    if (product(real(extents, real64)) < real(huge(n), real64)) n = product(extents)
  end function product_of

  !> Writes values from a memory address to a part of an open dataset, or reads values from this
  !> part into memory. HDF5 may buffer small amounts of written values until `flush`.
  subroutine transfer(self, dataset, first, counts, type, address, writing)
    class(hdf5_file_t), intent(inout) :: self
    integer(hid_t), intent(in) :: dataset
    integer(int64), intent(in) :: first           !! first index along the last dimension, starting at 1
    !> Number of values along each dimension. The part may be smaller than the dataset only along
    !> the last dimension.
    integer(int64), intent(in) :: counts(:)
    integer(hid_t), intent(in) :: type            !! HDF5 type in memory
    type(c_ptr), intent(in) :: address
    logical, intent(in) :: writing
    integer(hid_t) :: in_file, in_memory
    integer(hsize_t) :: start(size(counts))
    integer(size_t) :: bytes                      ! size of one value [bytes]
    type(c_ptr) :: place
    integer :: status, closed

    if (allocated(self%failure)) return
    call h5tget_size_f(type, bytes, status)
    if (writing) self%unsaved = self%unsaved + bytes*product(counts)
    start = 0
    start(size(start)) = first - 1
    place = address
    call h5screate_simple_f(size(counts), int(counts, hsize_t), in_memory, closed)
    call h5dget_space_f(dataset, in_file, status)
    if (status >= 0) call h5sselect_hyperslab_f(in_file, h5s_select_set_f, start, int(counts, hsize_t), status)
    if (status >= 0 .and. writing) call h5dwrite_f(dataset, type, place, status, in_memory, in_file)
    if (status >= 0 .and. .not. writing) call h5dread_f(dataset, type, place, status, in_memory, in_file)
    if (status < 0) call self%check(status, trim(merge("write   ", "be read:", writing))//" "//path_of(dataset))
    call h5sclose_f(in_file, closed)
    call h5sclose_f(in_memory, closed)
  end subroutine transfer

  !> Path of an open dataset in its file, without the leading slash.
  function path_of(dataset) result(path)
    integer(hid_t), intent(in) :: dataset
    character(len=:), allocatable :: path
    character(len=256) :: text
    integer(size_t) :: length
    integer :: status

    call h5iget_name_f(dataset, text, len(text, size_t), length, status)
    path = "a dataset"
    if (status >= 0 .and. length > 1) path = text(2:min(int(length), len(text)))
  end function path_of

  !> Writes real numbers in double precision.
  subroutine put_reals(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)             !! shape, or `scalar`
    real(real64), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_ieee_f64le, h5t_native_double, c_loc(values))
  end subroutine put_reals

  !> Writes 32-bit integers.
  subroutine put_integers(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(int32), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_std_i32le, h5kind_to_type(int32, h5_integer_kind), c_loc(values))
  end subroutine put_integers

  !> Writes 64-bit integers.
  subroutine put_longs(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(int64), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_std_i64le, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
  end subroutine put_longs

  !> Writes one string. An empty string is stored as one blank.
  subroutine put_text(self, name, text)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, text
    character(len=:), allocatable, target :: padded     ! allocatable, because the stack may be too small
    integer(hid_t) :: string
    integer :: closed

    allocate (character(len=max(len(text), 1)) :: padded)
    padded(:) = text
    string = string_of(len(padded))
    call self%put_values(name, scalar, string, string, c_loc(padded))
    call h5tclose_f(string, closed)
  end subroutine put_text

  !> Writes a list of strings, padded with blanks to the length of the longest string.
  subroutine put_texts(self, name, texts)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: texts(:)
    character(len=max(1, maxval([0, len_trim(texts)]))), allocatable, target :: padded(:)
    integer(hid_t) :: string
    integer :: closed

    padded = texts
    string = string_of(len(padded))
    call self%put_values(name, [size(padded)], string, string, c_loc(padded))
    call h5tclose_f(string, closed)
  end subroutine put_texts

  !> HDF5 type of blank-padded strings of fixed length.
  function string_of(length) result(string)
    integer, intent(in) :: length
    integer(hid_t) :: string
    integer :: status

    call h5tcopy_f(h5t_fortran_s1, string, status)
    call h5tset_size_f(string, int(length, size_t), status)
  end function string_of

  !> Writes a dataset or an attribute. A missing one is created; an existing one must have the same
  !> number of values.
  subroutine put_values(self, name, extents, stored_as, in_memory, address)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(hid_t), intent(in) :: stored_as, in_memory     !! HDF5 types
    type(c_ptr), intent(in) :: address
    integer(hid_t) :: dataset
    integer(hsize_t), allocatable :: there(:)
    integer(size_t) :: bytes
    integer :: status

    if (allocated(self%failure)) return
    call h5tget_size_f(stored_as, bytes, status)
    self%unsaved = self%unsaved + bytes*product(int(extents, int64))
    if (index(name, "@") > 0) then
      call self%put_attribute(name, int(extents, hsize_t), stored_as, in_memory, address)
      return
    end if
    call self%open_dataset(name, dataset, there, status, like=stored_as)
    if (status < 0) then
      call self%make_dataset(name, stored_as, int(extents, hsize_t))
      call self%open_dataset(name, dataset, there, status)
    end if
    if (product_of(there) /= product(int(extents, int64))) call self%check(-1, "write "//name)
    if (.not. allocated(self%failure)) call h5dwrite_f(dataset, in_memory, address, status)
    call self%check(status, "write "//name)
    call h5dclose_f(dataset, status)              ! closing a dataset makes HDF5 write its buffered values
    call self%check(status, "write "//name)
  end subroutine put_values

  !> Writes an attribute of an existing object, and creates the attribute if it is missing.
  subroutine put_attribute(self, name, extents, stored_as, in_memory, address)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hsize_t), intent(in) :: extents(:)
    integer(hid_t), intent(in) :: stored_as, in_memory
    type(c_ptr), intent(in) :: address
    integer(hid_t) :: object, space, attribute
    integer :: status, closed, at

    at = index(name, "@")
    call h5screate_simple_f(size(extents), extents, space, status)
    if (status >= 0) call h5oopen_f(self%id, name(:at - 1), object, status)
    if (status >= 0) call h5aopen_f(object, name(at + 1:), attribute, status)
    if (status < 0) call h5acreate_f(object, name(at + 1:), stored_as, space, attribute, status)
    if (status >= 0) call h5awrite_f(attribute, in_memory, address, status)
    if (status >= 0) call h5aclose_f(attribute, status)
    call self%check(status, "write "//name)
    call h5oclose_f(object, closed)
    call h5sclose_f(space, closed)
  end subroutine put_attribute

  !> Reads a dataset or an attribute of n real numbers.
  subroutine fetch_reals(self, name, n, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n                      !! required number of values
    real(real64), intent(inout), target :: values(*)

    call self%fetch_values(name, n, h5t_native_double, c_loc(values))
  end subroutine fetch_reals

  !> Reads a dataset or an attribute of n integers.
  subroutine fetch_longs(self, name, n, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer(int64), intent(inout), target :: values(*)

    call self%fetch_values(name, n, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
  end subroutine fetch_longs

  !> Reads a dataset or an attribute of n values into memory. If reading fails, or if the file
  !> contains a different number or type of values, the memory is unchanged.
  subroutine fetch_values(self, name, n, in_memory, address)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer(hid_t), intent(in) :: in_memory
    type(c_ptr), intent(in) :: address
    type(c_ptr) :: place
    integer(hid_t) :: object, attribute, dataset, space
    integer(hsize_t), allocatable :: extents(:)
    integer(hsize_t) :: there
    integer :: status, closed, at

    if (allocated(self%failure)) return
    place = address
    there = -1
    at = index(name, "@")
    if (at > 0) then
      call h5oopen_f(self%id, name(:at - 1), object, status)
      if (status >= 0) call h5aopen_f(object, name(at + 1:), attribute, status)
      if (status >= 0) call h5aget_space_f(attribute, space, status)
      if (status >= 0) call h5sget_simple_extent_npoints_f(space, there, status)
      if (status >= 0 .and. there == n) call h5aread_f(attribute, in_memory, place, status)
      call h5sclose_f(space, closed)
      call h5aclose_f(attribute, closed)
      call h5oclose_f(object, closed)
    else
      if (in_memory == h5t_native_double) then
        call self%open_dataset(name, dataset, extents, status)      ! HDF5 converts integers to reals
      else
        call self%open_dataset(name, dataset, extents, status, like=in_memory)
      end if
      there = product_of(extents)
      if (status >= 0 .and. there == n) call h5dread_f(dataset, in_memory, place, status)
      call h5dclose_f(dataset, closed)
    end if
    if (there /= n) status = -1
    call self%check(status, "be read: "//name)
  end subroutine fetch_values

  !> Reads a list of strings, each truncated or padded to the given length.
  subroutine fetch_texts(self, name, length, texts)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: length
    character(len=length), allocatable, target, intent(out) :: texts(:)
    integer(hid_t) :: string
    integer :: closed

    allocate (texts(min(max(0_int64, self%length(name)), most_texts)))
    texts = ""
    string = string_of(length)
    call self%fetch_values(name, size(texts), string, c_loc(texts))
    call h5tclose_f(string, closed)
  end subroutine fetch_texts

  !> Reads one string of any length.
  subroutine fetch_text(self, name, text)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: text
    character(len=:), allocatable, target :: buffer
    integer(hid_t) :: dataset, string
    integer(hsize_t), allocatable :: extents(:)
    integer(size_t) :: bytes
    integer :: status, closed
    logical :: elsewhere

    text = ""
    if (allocated(self%failure)) return
    call self%open_dataset(name, dataset, extents, status, like=h5t_fortran_s1)
    if (status >= 0) call h5dget_type_f(dataset, string, status)
    if (status >= 0) call h5tis_variable_str_f(string, elsewhere, status)
    if (status >= 0) call h5tget_size_f(string, bytes, status)
    if (status >= 0 .and. (elsewhere .or. bytes > longest_text)) status = -1
    call self%check(status, "be read: "//name)
    if (.not. allocated(self%failure)) then
      allocate (character(len=bytes) :: buffer)
      call self%fetch_values(name, 1, string, c_loc(buffer))
      if (.not. allocated(self%failure)) text = trim(buffer)
    end if
    call h5tclose_f(string, closed)
    call h5dclose_f(dataset, closed)
  end subroutine fetch_text

end module hdf5_objects
