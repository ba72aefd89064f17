!> Groups, attributes, datasets and growing series in an HDF5 file, by what the output needs of them. All
!> HDF5 calls are here.
!>
!> The first call that fails is remembered and nothing is done after it: a writer need not ask after every
!> line, `failure` tells at the end. A name is a path, `group/dataset`, or with @ an attribute, `group@name`.
module hdf5_objects
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: hid_t, hsize_t, size_t, h5_integer_kind, h5kind_to_type, &
    h5dont_atexit_f, h5open_f, h5eset_auto_f, h5get_libversion_f, h5fcreate_f, h5fopen_f, h5fflush_f, h5fclose_f, &
    h5gcreate_f, h5gclose_f, h5lexists_f, h5lcreate_hard_f, h5ocopy_f, h5oopen_f, h5oclose_f, &
    h5acreate_f, h5aexists_f, h5aopen_f, h5awrite_f, h5aclose_f, h5dcreate_f, h5dopen_f, h5dwrite_f, h5dread_f, h5dclose_f, &
    h5dget_space_f, h5dget_type_f, h5screate_f, h5screate_simple_f, h5sclose_f, &
    h5sget_simple_extent_npoints_f, h5tcopy_f, h5tset_size_f, h5tget_size_f, h5tclose_f, &
    h5pcreate_f, h5pclose_f, h5pset_alloc_time_f, h5pset_create_inter_group_f, &
    h5pset_file_locking_f, h5pset_fill_time_f, h5pset_obj_track_times_f, h5pset_sieve_buf_size_f, h5pset_userblock_f, &
    h5p_dataset_create_f, h5p_file_access_f, h5p_file_create_f, h5p_link_create_f, &
    h5f_acc_excl_f, h5f_acc_rdonly_f, h5f_acc_rdwr_f, h5f_scope_global_f, &
    h5d_alloc_time_early_f, h5d_fill_time_never_f, h5s_scalar_f, &
    h5t_native_double, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le, h5t_fortran_s1
  use errors, only: error_t, exit_files, fail
  use kinds, only: int32, int64, real64
  use system, only: free_bytes, last_problem, move_file, opening_problem
  use texts, only: written
  implicit none
  private
  public :: hdf5_file_t, prepare_dataset, prepare_links, hdf5_version

  integer(size_t), parameter :: sieve = 4096      !! what a small write becomes [bytes]

  type :: hdf5_file_t
    character(len=:), allocatable :: path
    character(len=:), allocatable :: name         !! that people know it by: its path once it is whole
    character(len=:), allocatable :: trouble      !! what failed first; allocated: nothing is done any more
    integer(hid_t) :: id = -1
    integer(int64) :: unsaved = 0        !! written since the last flush [bytes]
  contains
    procedure :: create
    procedure :: open => open_file
    procedure :: rename => rename_file
    procedure :: flush => flush_file
    procedure :: close => close_file
    procedure :: check
    procedure :: failure
    procedure :: make_group
    procedure :: link
    procedure :: copy
    procedure :: has
    generic :: put => put_reals, put_integers, put_longs, put_text, put_texts
    generic :: fetch => fetch_reals, fetch_integers, fetch_longs
    procedure :: fetch_text
    procedure :: length
    procedure :: replace
    procedure, private :: put_reals, put_integers, put_longs, put_text, put_texts, put_values
    procedure, private :: fetch_reals, fetch_integers, fetch_longs, fetch_values
  end type hdf5_file_t

contains

  !> Remembers the first failure.
  subroutine check(self, status, what)
    class(hdf5_file_t), intent(inout) :: self
    integer, intent(in) :: status
    character(len=*), intent(in) :: what

    if (status < 0 .and. .not. allocated(self%trouble)) self%trouble = what
  end subroutine check

  !> The failure, if there was one, as an error: file, what, and the room on its disk.
  subroutine failure(self, error)
    class(hdf5_file_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error

    if (.not. allocated(self%trouble)) return
    if (self%unsaved > 0) then
      call fail(error, exit_files, self%name//": cannot "//self%trouble//": "//written(self%unsaved) &
        //" bytes needed, "//written(free_bytes(self%path))//" bytes free")
    else
      call fail(error, exit_files, self%name//": cannot "//self%trouble)
    end if
  end subroutine failure

  function hdf5_version() result(text)
    character(len=:), allocatable :: text
    integer :: major, minor, release, status

    call h5get_libversion_f(major, minor, release, status)
    text = written(major)//"."//written(minor)//"."//written(release)
  end function hdf5_version

  !> Starts the library, silent on errors, and prepares access without HDF5's own locks: they would keep
  !> readers out, and one reader could stop a run. It is not to tidy up when the program ends: everything is
  !> closed by then, or could not be closed because the disk is full, and then it crashes.
  subroutine prepare_access(access, status)
    integer(hid_t), intent(out) :: access
    integer, intent(out) :: status

    call h5dont_atexit_f(status)
    call h5open_f(status)
    if (status >= 0) call h5eset_auto_f(0, status)
    if (status >= 0) call h5pcreate_f(h5p_file_access_f, access, status)
    if (status >= 0) call h5pset_file_locking_f(access, .false., .true., status)
    if (status >= 0) call h5pset_sieve_buf_size_f(access, sieve, status)
  end subroutine prepare_access

  !> A new file; there must be none of this name. The first `reserved` bytes are left to the caller.
  subroutine create(self, path, reserved, name)
    class(hdf5_file_t), intent(out) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: reserved               !! 0, 512 or 512 times a power of 2 [bytes]
    character(len=*), intent(in), optional :: name     !! to be given to it when it is whole; default: path
    integer(hid_t) :: access, creation
    integer :: status, closed

    self%path = path
    self%name = path
    if (present(name)) self%name = name
    call prepare_access(access, status)
    if (status >= 0) call h5pcreate_f(h5p_file_create_f, creation, status)
    if (status >= 0 .and. reserved > 0) call h5pset_userblock_f(creation, int(reserved, hsize_t), status)
    if (status >= 0) call h5fcreate_f(path, h5f_acc_excl_f, self%id, status, creation, access)
    call self%check(status, "be created: "//last_problem())
    call h5pclose_f(creation, closed)
    call h5pclose_f(access, closed)
  end subroutine create

  subroutine open_file(self, path, writable)
    class(hdf5_file_t), intent(out) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    character(len=:), allocatable :: reason
    integer(hid_t) :: access
    integer :: status, closed

    self%path = path
    self%name = path
    reason = opening_problem(path, writable)
    if (reason == "") reason = "it is damaged, or no HDF5 file"
    call prepare_access(access, status)
    if (status >= 0) call h5fopen_f(path, merge(h5f_acc_rdwr_f, h5f_acc_rdonly_f, writable), self%id, status, access)
    call self%check(status, "be "//trim(merge("written", "read   ", writable))//": "//reason)
    call h5pclose_f(access, closed)
  end subroutine open_file

  !> Gives the open file its name, in the place of what had it.
  subroutine rename_file(self)
    class(hdf5_file_t), intent(inout) :: self
    logical :: moved

    if (allocated(self%trouble)) return
    call move_file(self%path, self%name, moved)
    if (.not. moved) call self%check(-1, "take its name: "//last_problem())
    if (moved) self%path = self%name
  end subroutine rename_file

  !> All that was written goes to the operating system: it outlives a kill of the program.
  subroutine flush_file(self)
    class(hdf5_file_t), intent(inout) :: self
    integer :: status

    if (allocated(self%trouble)) return
    call h5fflush_f(self%id, h5f_scope_global_f, status)
    call self%check(status, "be written")
    if (status >= 0) self%unsaved = 0
  end subroutine flush_file

  subroutine close_file(self)
    class(hdf5_file_t), intent(inout) :: self
    integer :: status

    if (self%id < 0) return
    call self%flush()
    call h5fclose_f(self%id, status)
    call self%check(status, "be closed")
    self%id = -1
  end subroutine close_file

  !> Makes a group and those that lead to it.
  subroutine make_group(self, name)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hid_t) :: group, links
    integer :: status, closed

    if (allocated(self%trouble)) return
    call prepare_links(links, status)
    if (status >= 0) call h5gcreate_f(self%id, name, group, status, lcpl_id=links)
    call self%check(status, "make group "//name)
    if (status < 0) return
    call h5gclose_f(group, closed)
    call h5pclose_f(links, closed)
  end subroutine make_group

  !> Links that make the groups on their way.
  subroutine prepare_links(links, status)
    integer(hid_t), intent(out) :: links
    integer, intent(out) :: status

    call h5pcreate_f(h5p_link_create_f, links, status)
    if (status >= 0) call h5pset_create_inter_group_f(links, 1, status)
  end subroutine prepare_links

  !> Gives an object a second name.
  subroutine link(self, name, second_name)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, second_name
    integer(hid_t) :: links
    integer :: status, closed

    if (allocated(self%trouble)) return
    call prepare_links(links, status)
    if (status >= 0) call h5lcreate_hard_f(self%id, name, self%id, second_name, status, lcpl_id=links)
    call self%check(status, "link "//second_name)
    call h5pclose_f(links, closed)
  end subroutine link

  !> Takes over an object of another file, with all that is in it.
  subroutine copy(self, source, name)
    class(hdf5_file_t), intent(inout) :: self
    type(hdf5_file_t), intent(in) :: source
    character(len=*), intent(in) :: name
    integer(hid_t) :: links
    integer :: status, closed

    if (allocated(self%trouble)) return
    call prepare_links(links, status)
    if (status >= 0) call h5ocopy_f(source%id, name, self%id, name, status, lcpl_id=links)
    call self%check(status, "copy "//name)
    call h5pclose_f(links, closed)
  end subroutine copy

  !> Whether there is an object of this name; the groups on its way must exist.
  function has(self, name) result(yes)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical :: yes
    integer :: status

    yes = .false.
    if (allocated(self%trouble)) return
    call h5lexists_f(self%id, name, yes, status)
    if (status < 0) yes = .false.
  end function has

  subroutine put_reals(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)             !! shape; empty: one value
    real(real64), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_ieee_f64le, h5t_native_double, c_loc(values))
  end subroutine put_reals

  subroutine put_integers(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(int32), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_std_i32le, h5kind_to_type(int32, h5_integer_kind), c_loc(values))
  end subroutine put_integers

  subroutine put_longs(self, name, extents, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(int64), intent(in), target :: values(*)

    call self%put_values(name, extents, h5t_std_i64le, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
  end subroutine put_longs

  subroutine put_text(self, name, text)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, text
    character(len=max(len(text), 1)), target :: padded
    integer(hid_t) :: string
    integer :: closed

    padded = text
    string = string_of(len(padded))
    call self%put_values(name, [integer ::], string, string, c_loc(padded))
    call h5tclose_f(string, closed)
  end subroutine put_text

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

  !> The type of texts of a length, padded with blanks.
  function string_of(length) result(string)
    integer, intent(in) :: length
    integer(hid_t) :: string
    integer :: status

    call h5tcopy_f(h5t_fortran_s1, string, status)
    call h5tset_size_f(string, int(length, size_t), status)
  end function string_of

  !> Writes a new dataset, or an attribute, new or not, of an object that is there.
  subroutine put_values(self, name, extents, stored_as, in_memory, address)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:)
    integer(hid_t), intent(in) :: stored_as, in_memory
    type(c_ptr), intent(in) :: address
    integer(hid_t) :: space, object, values, properties, links
    integer(size_t) :: bytes
    integer :: status, closed, at
    logical :: exists

    if (allocated(self%trouble)) return
    call h5tget_size_f(stored_as, bytes, status)
    self%unsaved = self%unsaved + bytes*product(int(extents, int64))
    if (size(extents) == 0) then
      call h5screate_f(h5s_scalar_f, space, status)
    else
      call h5screate_simple_f(size(extents), int(extents, hsize_t), space, status)
    end if
    at = index(name, "@")
    if (at > 0) then
      call h5oopen_f(self%id, name(:at - 1), object, status)
      if (status >= 0) call h5aexists_f(object, name(at + 1:), exists, status)
      if (status >= 0 .and. exists) then
        call h5aopen_f(object, name(at + 1:), values, status)
      else if (status >= 0) then
        call h5acreate_f(object, name(at + 1:), stored_as, space, values, status)
      end if
      if (status >= 0) call h5awrite_f(values, in_memory, address, status)
      if (status >= 0) call h5aclose_f(values, status)
      call h5oclose_f(object, closed)
    else
      call prepare_dataset(properties, status)
      call prepare_links(links, closed)
      if (status >= 0) call h5dcreate_f(self%id, name, stored_as, space, values, status, properties, links)
      if (status >= 0) call h5dwrite_f(values, in_memory, address, status)
      if (status >= 0) call h5dclose_f(values, status)
      call h5pclose_f(links, closed)
      call h5pclose_f(properties, closed)
    end if
    call self%check(status, "write "//name)
    call h5sclose_f(space, closed)
  end subroutine put_values

  !> Storage at once, never filled, without time stamps: the same run gives the same bytes.
  subroutine prepare_dataset(properties, status)
    integer(hid_t), intent(out) :: properties
    integer, intent(out) :: status

    call h5pcreate_f(h5p_dataset_create_f, properties, status)
    if (status >= 0) call h5pset_alloc_time_f(properties, h5d_alloc_time_early_f, status)
    if (status >= 0) call h5pset_fill_time_f(properties, h5d_fill_time_never_f, status)
    if (status >= 0) call h5pset_obj_track_times_f(properties, .false., status)
  end subroutine prepare_dataset

  !> Number of values in a dataset; -1 if it is not there.
  function length(self, name) result(n)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64) :: n
    integer(hid_t) :: dataset, space
    integer :: status, closed

    n = -1
    if (allocated(self%trouble)) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) return
    call h5dget_space_f(dataset, space, status)
    if (status >= 0) call h5sget_simple_extent_npoints_f(space, n, status)
    call h5sclose_f(space, closed)
    call h5dclose_f(dataset, closed)
  end function length

  !> Writes a new value into a dataset of one integer.
  subroutine replace(self, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in), target :: value
    integer(hid_t) :: dataset
    integer :: status, closed

    if (allocated(self%trouble)) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status >= 0) call h5dwrite_f(dataset, h5kind_to_type(int64, h5_integer_kind), c_loc(value), status)
    call self%check(status, "write "//name)
    call h5dclose_f(dataset, closed)
  end subroutine replace

  subroutine fetch_reals(self, name, n, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n                      !! how many values there must be
    real(real64), intent(inout), target :: values(*)

    call self%fetch_values(name, n, h5t_native_double, c_loc(values))
  end subroutine fetch_reals

  subroutine fetch_integers(self, name, n, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer(int32), intent(inout), target :: values(*)

    call self%fetch_values(name, n, h5kind_to_type(int32, h5_integer_kind), c_loc(values))
  end subroutine fetch_integers

  subroutine fetch_longs(self, name, n, values)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer(int64), intent(inout), target :: values(*)

    call self%fetch_values(name, n, h5kind_to_type(int64, h5_integer_kind), c_loc(values))
  end subroutine fetch_longs

  subroutine fetch_values(self, name, n, in_memory, address)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer(hid_t), intent(in) :: in_memory
    type(c_ptr), intent(in) :: address
    type(c_ptr) :: place
    integer(hid_t) :: dataset
    integer :: status, closed

    if (allocated(self%trouble)) return
    place = address
    status = -1
    if (self%length(name) == n) then
      call h5dopen_f(self%id, name, dataset, status)
      if (status >= 0) call h5dread_f(dataset, in_memory, place, status)
      call h5dclose_f(dataset, closed)
    end if
    call self%check(status, "be read: "//name)
  end subroutine fetch_values

  !> Reads a text dataset.
  subroutine fetch_text(self, name, text)
    class(hdf5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: text
    character(len=:), allocatable, target :: buffer
    type(c_ptr) :: place
    integer(hid_t) :: dataset, string
    integer(size_t) :: bytes
    integer :: status, closed

    text = ""
    if (allocated(self%trouble)) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status >= 0) call h5dget_type_f(dataset, string, status)
    if (status >= 0) call h5tget_size_f(string, bytes, status)
    if (status >= 0) then
      allocate (character(len=bytes) :: buffer)
      place = c_loc(buffer)
      call h5dread_f(dataset, string, place, status)
      call h5tclose_f(string, closed)
      call h5dclose_f(dataset, closed)
      text = trim(buffer)
    end if
    call self%check(status, "be read: "//name)
  end subroutine fetch_text

end module hdf5_objects
