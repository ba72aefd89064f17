!> Operating-system services that Fortran does not provide: a monotonic clock, detection of
!> terminals, file locks, atomic renaming, free disk space, and an exit without a message. Functions
!> that need a C header file are in `system_calls.c`.
module system
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_double, c_int, c_int64_t, c_null_char, c_size_t
  use, intrinsic :: iso_fortran_env, only: error_unit
  use errors, only: error_t, exit_files, fail
  use kinds, only: int64
  implicit none
  private
  public :: seconds, talks_to_terminal, end_program, host_name
  public :: move_file, remove_file, make_folders_of, synchronize
  public :: what_is, identity_of, is_folder, folder_of, names_beside, opening_problem, free_bytes, last_problem, lock_t
  public :: file_size, largest_file, read_bytes, read_file, write_word
  public :: fill_standard_streams, print_text, cores_of_process

  !> Kinds of file-system objects.
  character(len=20), parameter :: kinds_of_files(*) = [character(len=20) :: "nothing", "a file", "a folder", &
    "a symbolic link", "a pipe or a device", "hidden by the system"]

  !> Results of `c_lock` without a lock: another run holds the lock, the file is not a lock file, or
  !> a system call failed.
  integer(c_int), parameter :: taken = -1, foreign = -3, failed = -4     ! -2: the file system has no locks

  !> Lock on the output file of a run. The operating system releases the lock when the process ends,
  !> even by a crash.
  type :: lock_t
    character(len=:), allocatable :: path
    integer(c_int), private :: descriptor = -1
  contains
    procedure :: acquire
    procedure :: release
  end type lock_t

  abstract interface
    !> System call with a path or a string as argument; returns 0 for success.
    function path_call(path) bind(C) result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: status
    end function path_call

    !> System call with the path of a file or folder as argument; returns a size in bytes.
    function size_call(path) bind(C) result(bytes)
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t) :: bytes
    end function size_call

    !> System call that renames a file; returns 0 for success.
    function naming_call(from, to) bind(C) result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
      integer(c_int) :: status
    end function naming_call
  end interface

  interface
    !> Current time of a monotonic clock, in seconds.
    function seconds() result(t) bind(C, name="system_seconds")
      import :: c_double
      real(c_double) :: t
    end function seconds

    !> Opens /dev/null for each standard stream that was closed when the program started. Otherwise
    !> the next file to be opened would receive the descriptor of the stream, and messages would be
    !> written to that file.
    subroutine fill_standard_streams() bind(C, name="system_fill_standard_streams")
    end subroutine fill_standard_streams

    !> True if standard error is a terminal.
    function talks_to_terminal() bind(C, name="system_talks_to_terminal") result(yes)
      import :: c_bool
      logical(c_bool) :: yes
    end function talks_to_terminal

    ! The functions declared here are described in system_calls.c.
    function cores_of_process() result(n) bind(C, name="system_cores")
      import :: c_int
      integer(c_int) :: n
    end function cores_of_process

    !> Size limit for files of this process (ulimit -f), in bytes; a huge number if there is no
    !> limit.
    function largest_file() result(bytes) bind(C, name="system_largest_file")
      import :: c_int64_t
      integer(c_int64_t) :: bytes
    end function largest_file

    subroutine c_describe_problem(text, size) bind(C, name="system_describe_problem")
      import :: c_char, c_size_t
      character(kind=c_char), intent(out) :: text(*)
      integer(c_size_t), value :: size
    end subroutine c_describe_problem

    subroutine c_name_host(text, size) bind(C, name="system_name_host")
      import :: c_char, c_size_t
      character(kind=c_char), intent(out) :: text(*)
      integer(c_size_t), value :: size
    end subroutine c_name_host

    function c_read_bytes(path, bytes, count) bind(C, name="system_read_bytes") result(n)
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      character(kind=c_char), intent(out) :: bytes(*)
      integer(c_int64_t), value :: count
      integer(c_int64_t) :: n
    end function c_read_bytes

    subroutine c_identify(path, identity) bind(C, name="system_identify")
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(out) :: identity(3)
    end subroutine c_identify

    function c_write_word(path, position, word) bind(C, name="system_write_word") result(status)
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), value :: position, word
      integer(c_int) :: status
    end function c_write_word

    subroutine c_opening_problem(path, writable, text, size) bind(C, name="system_opening_problem")
      import :: c_bool, c_char, c_size_t
      character(kind=c_char), intent(in) :: path(*)
      logical(c_bool), value :: writable
      character(kind=c_char), intent(out) :: text(*)
      integer(c_size_t), value :: size
    end subroutine c_opening_problem

    function c_list_names(folder, ending, names, width, most) bind(C, name="system_list_names") result(count)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: folder(*), ending(*)
      character(kind=c_char), intent(out) :: names(*)
      integer(c_int), value :: width, most
      integer(c_int) :: count
    end function c_list_names

    subroutine c_unlock(path, descriptor) bind(C, name="system_unlock")
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: descriptor
    end subroutine c_unlock

    subroutine c_exit(code) bind(C, name="exit")
      import :: c_int
      integer(c_int), value :: code
    end subroutine c_exit
  end interface

  procedure(path_call), bind(C, name="system_synchronize") :: c_synchronize
  procedure(path_call), bind(C, name="system_find_folder") :: c_find_folder
  procedure(path_call), bind(C, name="system_make_folder") :: c_make_folder
  procedure(path_call), bind(C, name="system_what_is") :: c_what_is  !! returns an index into `kinds_of_files`
  !> Returns a file descriptor, or a negative error code such as `taken`.
  procedure(path_call), bind(C, name="system_lock") :: c_lock
  procedure(path_call), bind(C, name="system_print") :: c_print
  procedure(path_call), bind(C, name="unlink") :: c_unlink
  !> Returns the free space of the file system that contains a folder [bytes].
  procedure(size_call), bind(C, name="system_free_bytes") :: c_free_bytes
  procedure(size_call), bind(C, name="system_file_size") :: c_file_size
  procedure(naming_call), bind(C, name="rename") :: c_rename

contains

  !> Prints a string to standard output. The `write` statement of Fortran would not report a full
  !> disk.
  subroutine print_text(text, error)
    character(len=*), intent(in) :: text               !! one or more lines; a final line end is added
    type(error_t), allocatable, intent(out) :: error

    if (c_print(text//new_line("a")//c_null_char) /= 0) &
      call fail(error, exit_files, "standard output: cannot be written: "//last_problem())
  end subroutine print_text

  !> Ends the program with an exit status, without a message.
  subroutine end_program(code)
    integer, intent(in) :: code

    flush (error_unit)
    call c_exit(int(code, c_int))
  end subroutine end_program

  !> Name of the computer on which the program runs.
  function host_name() result(name)
    character(len=:), allocatable :: name
    character(len=256, kind=c_char) :: buffer

    call c_name_host(buffer, len(buffer, c_size_t))
    name = buffer(:index(buffer, c_null_char) - 1)
  end function host_name

  !> Renames a file atomically and replaces an existing file of the new name. `moved` is .true. even
  !> if the folder cannot be synchronised with the disk afterwards. In this case a crash of the
  !> operating system could undo the renaming.
  subroutine move_file(from, to, moved)
    character(len=*), intent(in) :: from, to
    logical, intent(out) :: moved
    logical :: done

    moved = c_rename(from//c_null_char, to//c_null_char) == 0
    if (moved) call synchronize(folder_of(to), done)
  end subroutine move_file

  !> Deletes a file if it exists.
  subroutine remove_file(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: status

    status = c_unlink(path//c_null_char)
  end subroutine remove_file

  !> Creates the missing parent folders of a file.
  subroutine make_folders_of(path, made)
    character(len=*), intent(in) :: path
    logical, intent(out) :: made
    integer :: k

    do k = 2, len(path)
      if (path(k:k) /= "/") cycle
      if (is_folder(path(:k - 1))) cycle
      made = c_make_folder(path(:k - 1)//c_null_char) == 0
      if (.not. made) return
    end do
    made = is_folder(folder_of(path))
  end subroutine make_folders_of

  !> Waits until the contents of a file or the entries of a folder are stored on disk.
  subroutine synchronize(path, done)
    character(len=*), intent(in) :: path
    logical, intent(out) :: done

    done = c_synchronize(path//c_null_char) == 0
  end subroutine synchronize

  !> Reason why a file cannot be opened; empty if it can. A file with several names (symbolic or
  !> hard links) must not be opened for writing.
  function opening_problem(path, writable) result(text)
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    character(len=:), allocatable :: text
    character(len=256, kind=c_char) :: buffer

    call c_opening_problem(path//c_null_char, logical(writable, c_bool), buffer, len(buffer, c_size_t))
    text = buffer(:index(buffer, c_null_char) - 1)
  end function opening_problem

  !> Kind of the file-system object at a path, in words. Symbolic links are not followed.
  function what_is(path) result(kind)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: kind

    kind = trim(kinds_of_files(c_what_is(path//c_null_char)))
  end function what_is

  !> Inode, size and modification time of a file. Together they identify the file and its contents,
  !> because a copy has a different inode. The result is zero if the file does not exist.
  function identity_of(path) result(identity)
    character(len=*), intent(in) :: path
    integer(int64) :: identity(3)

    call c_identify(path//c_null_char, identity)
  end function identity_of

  !> Size of a file in bytes; 0 for pipes and devices, -1 if the file does not exist.
  function file_size(path) result(bytes)
    character(len=*), intent(in) :: path
    integer(int64) :: bytes

    bytes = c_file_size(path//c_null_char)
  end function file_size

  !> Reads the first bytes of a regular file. A Fortran `open` statement would remove trailing
  !> blanks from the file name.
  subroutine read_bytes(path, bytes, n)
    character(len=*), intent(in) :: path
    character(len=*), intent(out) :: bytes
    !> Number of bytes read, at most len(bytes), or -1 if the file cannot be read.
    integer(int64), intent(out) :: n

    n = c_read_bytes(path//c_null_char, bytes, len(bytes, int64))
  end subroutine read_bytes

  !> Reads a whole regular file. A Fortran `read` statement may report success without reading any
  !> bytes. This would cause an infinite loop.
  subroutine read_file(path, text, problem)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    !> Reason why the file cannot be read; empty after success.
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: failure
    integer(int64) :: n

    allocate (character(len=max(file_size(path), 8192_int64)) :: text)  ! files in /proc report a size of 0
    call read_bytes(path, text, n)
    text = text(:max(n, 0_int64))
    problem = ""
    if (n >= 0) return
    failure = last_problem()
    problem = opening_problem(path, writable=.false.)
    if (problem == "") problem = failure
  end subroutine read_file

  !> Overwrites eight bytes of a file with a 64-bit integer in little-endian byte order.
  subroutine write_word(path, position, word, done)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: position             !! offset of the first byte from the start of the file
    integer(int64), intent(in) :: word
    logical, intent(out) :: done

    done = c_write_word(path//c_null_char, position, word) == 0
  end subroutine write_word

  !> True if the path is a folder or a symbolic link to a folder.
  function is_folder(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = c_find_folder(path//c_null_char) == 0
  end function is_folder

  !> Parent folder of a file.
  pure function folder_of(path) result(folder)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: folder

    folder = path(:index(path, "/", back=.true.))
    if (folder == "") folder = "."
  end function folder_of

  !> Names of the files with an ending such as `.nml` in the folder of a file, in alphabetical order
  !> and without the ending. Long names, and names beyond the first 1000, are left out.
  function names_beside(path, ending) result(names)
    character(len=*), intent(in) :: path, ending
    character(len=64, kind=c_char), allocatable :: names(:)

    allocate (names(1000))
    names = names(:c_list_names(folder_of(path)//c_null_char, ending//c_null_char, names, len(names), size(names)))
  end function names_beside

  !> Free space for a file in the file system of its (possibly missing) folder, in bytes; a huge
  !> number if the free space is unknown.
  function free_bytes(path) result(bytes)
    character(len=*), intent(in) :: path
    integer(int64) :: bytes

    bytes = c_free_bytes(folder_of(path)//c_null_char)
  end function free_bytes

  !> Error message of the operating system for the last failed system call.
  function last_problem() result(text)
    character(len=:), allocatable :: text
    character(len=256, kind=c_char) :: buffer

    call c_describe_problem(buffer, len(buffer, c_size_t))
    text = buffer(:index(buffer, c_null_char) - 1)
  end function last_problem

  !> Acquires the lock file `path` for this process. If the file system does not support locks, the
  !> run continues without a lock.
  subroutine acquire(self, path, problem)
    class(lock_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> Reason why the lock was not acquired; empty after success.
    character(len=:), allocatable, intent(out) :: problem

    self%path = path
    self%descriptor = c_lock(path//c_null_char)
    select case (self%descriptor)
    case (taken)
      problem = "another run, perhaps of another user, is writing it; its lock is "//path
    case (foreign)
      problem = "cannot be locked: "//path//" is not the lock of a run, which is an empty file without a second name; " &
        //"remove it, or choose another output"
    case (failed)
      problem = "cannot be created: "//path//": "//last_problem()
    case default
      problem = ""
    end select
  end subroutine acquire

  !> Deletes the lock file and releases the lock if this process holds it.
  subroutine release(self)
    class(lock_t), intent(inout) :: self

    if (self%descriptor < 0) return
    call c_unlock(self%path//c_null_char, self%descriptor)
    self%descriptor = -1
  end subroutine release

end module system
