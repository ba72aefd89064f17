!> An open HDF5 file: creating, opening, renaming, flushing and closing it, and creating groups and
!> hard links.
!>
!> The first failure is recorded, and all later calls have no effect. A procedure that writes a file
!> therefore need not test the result of every call. At the end, `report` returns the recorded
!> failure.
module hdf5_handle
  use, intrinsic :: iso_c_binding, only: c_bool, c_int, c_int64_t
  use hdf5, only: hid_t, hsize_t, size_t, h5dont_atexit_f, h5open_f, h5eset_auto_f, h5get_libversion_f, &
    h5dclose_f, h5fcreate_f, h5fopen_f, h5fflush_f, h5fclose_f, h5fget_filesize_f, h5pcreate_f, h5pclose_f, h5pset_alloc_time_f, &
    h5pset_create_inter_group_f, h5pset_file_locking_f, h5pset_fill_time_f, h5pset_obj_track_times_f, &
    h5pset_sieve_buf_size_f, h5pset_small_data_block_size_f, h5pset_sym_k_f, h5p_dataset_create_f, h5p_file_access_f, &
    h5p_file_create_f, h5p_link_create_f, h5d_alloc_time_early_f, h5d_fill_time_never_f, h5f_acc_excl_f, h5f_acc_rdonly_f, &
    h5f_acc_rdwr_f, h5f_scope_global_f, h5lis_registered_f, h5l_type_external_f, h5gcreate_f, h5gclose_f, &
    h5lcreate_hard_f
  use errors, only: error_t, exit_files, fail
  use kinds, only: int64
  use system, only: free_bytes, largest_file, last_problem, move_file, opening_problem, remove_file
  use texts, only: written
  implicit none
  private
  public :: hdf5_handle_t, hdf5_version

  integer(size_t), parameter :: sieve = 4096      !! size of the buffer for small writes [bytes]
  !> Half the number of addresses in a node of the second kind. HDF5 stores the links of a group in
  !> nodes of 8 links, and the addresses of these nodes in nodes of a second kind. Most groups of an
  !> output file have three links. With the HDF5 default of 16, almost empty nodes would occupy a
  !> quarter of the file of a small run.
  integer, parameter :: half_tree_node = 2
  !> Half the number of links in a node of the first kind; the HDF5 default. The 7 links of the
  !> group `checkpoint` must fit into one node, because `hdf5_objects: remove_last` relies on the
  !> order of the last parts of a file.
  integer, parameter :: half_link_node = 4

  type :: hdf5_handle_t
    character(len=:), allocatable :: path
    character(len=:), allocatable :: final_path   !! path of the completed file, for messages
    !> Phrase that completes "cannot ", describing the first failed action.
    character(len=:), allocatable :: failure
    logical, private :: has_reason = .false.      !! whether `failure` includes a reason
    integer(hid_t) :: id = -1
    !> HDF5 properties for creating the missing groups of a path.
    integer(hid_t) :: links = -1
    integer(hid_t) :: storage = -1                !! HDF5 properties of new datasets, set by `prepare`
    integer(int64) :: unsaved = 0                 !! bytes written since the last flush
    !> Datasets that stay open; only the first `n_held` elements are used.
    integer(hid_t), allocatable, private :: held(:)
    integer, private :: n_held = 0
  contains
    procedure :: create
    procedure :: open => open_file
    procedure :: rename => rename_file
    procedure :: flush => flush_file
    procedure :: close => close_file
    procedure :: discard
    procedure :: hold
    procedure :: make_group
    procedure :: link
    procedure :: check
    procedure :: report
  end type hdf5_handle_t

  interface
    !> Disables one kind of link in the HDF5 library.
    function forget_link(kind) result(status) bind(C, name="H5Lunregister")
      import :: c_int
      integer(c_int), value :: kind
      integer(c_int) :: status
    end function forget_link

    !> Prevents HDF5 from reserving space for attributes in the header of a dataset.
    function reserve_no_attributes(properties, yes) result(status) bind(C, name="H5Pset_dset_no_attrs_hint")
      import :: c_bool, c_int, c_int64_t
      integer(c_int64_t), value :: properties     !! HDF5 identifier
      logical(c_bool), value :: yes
      integer(c_int) :: status
    end function reserve_no_attributes
  end interface

contains

  !> Records the failure of an action if `status` indicates an error and no failure was recorded
  !> earlier.
  subroutine check(self, status, action, reason, needed)
    class(hdf5_handle_t), intent(inout) :: self
    integer, intent(in) :: status                 !! return value of an HDF5 call; negative after a failure
    character(len=*), intent(in) :: action        !! phrase that completes "cannot "
    character(len=*), intent(in), optional :: reason    !! reason for the failure, if known
    !> Disk space required by the action; default: the amount of unsaved data [bytes].
    integer(int64), intent(in), optional :: needed
    integer(hsize_t) :: bytes                     ! size of the file, including preallocated space
    integer(int64) :: most
    integer :: known

    if (status >= 0 .or. allocated(self%failure)) return
    self%failure = action
    if (present(needed)) self%unsaved = needed
    if (present(reason)) then
      self%failure = action//": "//reason
      self%has_reason = .true.
    else if (self%id >= 0 .and. self%unsaved > 0) then
      most = largest_file()
      call h5fget_filesize_f(self%id, bytes, known)
      if (known < 0 .or. max(bytes, self%unsaved) <= most) return
      self%failure = action//": files may have at most "//written(most)//" bytes (ulimit -f)"
      self%has_reason = .true.
    end if
  end subroutine check

  !> Returns the recorded failure as an error; without a failure the error is not allocated. The
  !> message names the file, the action, and either the reason or the free disk space.
  subroutine report(self, error)
    class(hdf5_handle_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: free

    if (.not. allocated(self%failure)) return
    call fail(error, exit_files, self%final_path//": cannot "//self%failure)
    free = free_bytes(self%path)
    if (self%unsaved <= 0 .or. free == huge(free)) return
    if (self%has_reason .and. free >= self%unsaved) return
    error%message = error%message//": "//written(self%unsaved)//" bytes needed, "//written(free)//" bytes free"
  end subroutine report

  !> Version of the HDF5 library, stored as provenance in the output file.
  function hdf5_version() result(text)
    character(len=:), allocatable :: text
    integer :: major, minor, release, status

    call h5get_libversion_f(major, minor, release, status)
    text = written(major)//"."//written(minor)//"."//written(release)
  end function hdf5_version

  !> Initialises the HDF5 library, once per process because each initialisation leaks memory. HDF5
  !> must not print errors. HDF5 needs no exit handler, because the program closes all files before
  !> it exits. On a full disk a file cannot be closed, and the exit handler would crash. External
  !> links are disabled, because they could refer to devices or to files of other users.
  subroutine start_library(status)
    integer, intent(out) :: status
    logical, save :: started = .false.
    logical :: followed

    status = 0
    if (started) return
    call h5dont_atexit_f(status)
    call h5open_f(status)
    if (status >= 0) call h5eset_auto_f(0, status)
    if (status >= 0) call h5lis_registered_f(h5l_type_external_f, followed, status)
    if (status >= 0 .and. followed) status = forget_link(int(h5l_type_external_f, c_int))
    started = status >= 0
  end subroutine start_library

  !> Sets the properties of a file.
  !> - File locks are disabled: otherwise other programs could not read the file during a run, and a
  !>   reader could stop a run.
  !> - Storage is allocated when a dataset is created, without fill values and time stamps, so that
  !>   equal runs write identical bytes.
  !> - Small datasets do not share a block of storage, because HDF5 releases a shared block in two
  !>   steps, between which the header of the file contains a wrong length.
  !> - No space is reserved for attributes of datasets, because the program writes none. The file of
  !>   a small run is therefore a tenth smaller.
  subroutine prepare(self, access, status)
    class(hdf5_handle_t), intent(inout) :: self
    integer(hid_t), intent(out) :: access         !! HDF5 properties for opening the file
    integer, intent(out) :: status

    call start_library(status)
    if (status >= 0) call h5pcreate_f(h5p_file_access_f, access, status)
    if (status >= 0) call h5pset_file_locking_f(access, .false., .true., status)
    if (status >= 0) call h5pset_sieve_buf_size_f(access, sieve, status)
    if (status >= 0) call h5pset_small_data_block_size_f(access, 0_hsize_t, status)
    if (status >= 0) call h5pcreate_f(h5p_link_create_f, self%links, status)
    if (status >= 0) call h5pset_create_inter_group_f(self%links, 1, status)
    if (status >= 0) call h5pcreate_f(h5p_dataset_create_f, self%storage, status)
    if (status >= 0) call h5pset_alloc_time_f(self%storage, h5d_alloc_time_early_f, status)
    if (status >= 0) call h5pset_fill_time_f(self%storage, h5d_fill_time_never_f, status)
    if (status >= 0) call h5pset_obj_track_times_f(self%storage, .false., status)
    if (status >= 0) status = reserve_no_attributes(int(self%storage, c_int64_t), logical(.true., c_bool))
  end subroutine prepare

  !> Creates a new file. The path must not exist.
  subroutine create(self, path, final_path)
    class(hdf5_handle_t), intent(out) :: self
    character(len=*), intent(in) :: path
    character(len=*), intent(in), optional :: final_path    !! default: `path`
    integer(hid_t) :: access, creation
    integer :: status, closed

    self%path = path
    self%final_path = path
    if (present(final_path)) self%final_path = final_path
    call prepare(self, access, status)
    if (status >= 0) call h5pcreate_f(h5p_file_create_f, creation, status)
    if (status >= 0) call h5pset_sym_k_f(creation, half_tree_node, half_link_node, status)
    if (status >= 0) call h5fcreate_f(path, h5f_acc_excl_f, self%id, status, creation, access)
    call self%check(status, "be created", last_problem())
    call h5pclose_f(creation, closed)
    call h5pclose_f(access, closed)
  end subroutine create

  !> Opens a file for reading, or for reading and writing.
  subroutine open_file(self, path, writable)
    class(hdf5_handle_t), intent(out) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    character(len=:), allocatable :: reason
    integer(hid_t) :: access
    integer :: status, closed

    self%path = path
    self%final_path = path
    call prepare(self, access, status)
    reason = opening_problem(path, writable)
    if (reason /= "") status = -1
    if (reason == "") reason = "it is damaged, or not an HDF5 file"
    if (status >= 0) call h5fopen_f(path, merge(h5f_acc_rdwr_f, h5f_acc_rdonly_f, writable), self%id, status, access)
    call self%check(status, "be "//trim(merge("written", "read   ", writable)), reason)
    call h5pclose_f(access, closed)
  end subroutine open_file

  !> Renames the open file to its final path and replaces an existing file there.
  subroutine rename_file(self)
    class(hdf5_handle_t), intent(inout) :: self
    logical :: moved

    if (allocated(self%failure)) return
    call move_file(self%path, self%final_path, moved)
    if (.not. moved) call self%check(-1, "be renamed", last_problem())
    if (moved) self%path = self%final_path
  end subroutine rename_file

  !> Passes all written data to the operating system, so that no data are lost if the program is
  !> killed.
  subroutine flush_file(self)
    class(hdf5_handle_t), intent(inout) :: self
    integer :: status

    if (allocated(self%failure)) return
    call h5fflush_f(self%id, h5f_scope_global_f, status)
    call self%check(status, "be written")
    if (status >= 0) self%unsaved = 0
  end subroutine flush_file

  !> Adds an open dataset to those that stay open until the file is closed. HDF5 cannot close a file
  !> with open datasets.
  subroutine hold(self, dataset)
    class(hdf5_handle_t), intent(inout) :: self
    integer(hid_t), intent(in) :: dataset

    if (dataset < 0) return
    if (.not. allocated(self%held)) allocate (self%held(16))
    if (self%n_held == size(self%held)) self%held = [self%held, self%held]
    self%n_held = self%n_held + 1
    self%held(self%n_held) = dataset
  end subroutine hold

  !> Closes the file if it is open, and frees the HDF5 property lists, which exist even if the file
  !> could not be opened. A recorded failure can still be reported.
  subroutine close_file(self)
    class(hdf5_handle_t), intent(inout) :: self
    integer :: status, k

    if (self%links >= 0) call h5pclose_f(self%links, status)
    if (self%storage >= 0) call h5pclose_f(self%storage, status)
    self%links = -1
    self%storage = -1
    if (self%id < 0) return
    call self%flush()
    do k = 1, self%n_held
      call h5dclose_f(self%held(k), status)
    end do
    self%n_held = 0
    call h5fclose_f(self%id, status)
    call self%check(status, "be closed")
    self%id = -1
  end subroutine close_file

  !> Closes and deletes the file. A recorded failure can still be reported.
  subroutine discard(self)
    class(hdf5_handle_t), intent(inout) :: self

    call self%close()
    call remove_file(self%path)
  end subroutine discard

  !> Creates a group and all missing groups on its path. The group is closed again unless the caller
  !> requests it open.
  subroutine make_group(self, name, opened)
    class(hdf5_handle_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hid_t), intent(out), optional :: opened      !! the open group; -1 after a failure
    integer(hid_t) :: group
    integer :: status, closed

    if (present(opened)) opened = -1
    if (allocated(self%failure)) return
    call h5gcreate_f(self%id, name, group, status, lcpl_id=self%links)
    call self%check(status, "make group "//name)
    if (status >= 0 .and. present(opened)) opened = group
    if (status >= 0 .and. .not. present(opened)) call h5gclose_f(group, closed)
  end subroutine make_group

  !> Adds a second name (a hard link) to an object in the file.
  subroutine link(self, name, second_name)
    class(hdf5_handle_t), intent(inout) :: self
    character(len=*), intent(in) :: name, second_name
    integer :: status

    if (allocated(self%failure)) return
    call h5lcreate_hard_f(self%id, name, self%id, second_name, status, lcpl_id=self%links)
    call self%check(status, "link "//second_name)
  end subroutine link

end module hdf5_handle
