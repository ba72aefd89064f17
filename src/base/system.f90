!> What the language does not offer, by the C library (Linux with glibc, 64 bits): signals, the monotonic
!> clock, terminals, file locks, atomic renames, room on a disk, and an exit that prints nothing.
module system
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_funloc, c_funptr, c_int, &
    c_int64_t, c_intptr_t, c_long, c_null_char, c_ptr, c_size_t
  use, intrinsic :: iso_fortran_env, only: error_unit
  use errors, only: error_t, exit_files, fail
  use kinds, only: int64, real64
  implicit none
  private
  public :: watch_signals, stop_requested, checkpoint_requested
  public :: seconds, talks_to_terminal, leave, host_name, process_id
  public :: move_file, link_file, remove_file, make_folders_of, synchronize
  public :: is_folder, folder_of, obstacle_to_opening, free_bytes, last_problem, lock_t
  public :: fill_standard_streams, print_text

  integer(c_int), parameter :: sig_hup = 1, sig_int = 2, sig_usr1 = 10, sig_term = 15, sig_xcpu = 24, sig_xfsz = 25
  integer(c_intptr_t), parameter :: by_default = 0, ignored = 1      !! SIG_DFL, SIG_IGN
  integer(c_int), parameter :: read_only = 0, read_write = 2, create = 64
  integer(c_int), parameter :: exclusive = 2, without_waiting = 4    !! of flock
  integer(c_int), parameter :: would_block = 11, already_there = 17  !! EAGAIN, EEXIST
  integer(c_int), parameter :: all_may = 511, owner_writes = 420     !! modes 0777 and 0644

  !> Launchers often send a signal twice within moments; only a later one means impatience. [s]
  real(real64), parameter :: twice_at_once = 0.5_real64

  ! The only module variables of the program: a signal handler has nowhere else to write.
  integer(c_int), volatile :: stop_signal = 0
  integer(c_int), volatile :: checkpoint_signal = 0
  real(real64), volatile :: first_signal_at = 0.0_real64

  !> A lock on a run's output. The kernel drops it when the process ends, however it ends.
  type :: lock_t
    character(len=:), allocatable :: path
    integer(c_int), private :: descriptor = -1
  contains
    procedure :: acquire
    procedure :: release
  end type lock_t

  interface
    function c_signal(number, handler) bind(C, name="signal") result(previous)
      import :: c_funptr, c_int
      integer(c_int), value :: number
      type(c_funptr), value :: handler
      type(c_funptr) :: previous
    end function c_signal
    function c_raise(number) bind(C, name="raise") result(status)
      import :: c_int
      integer(c_int), value :: number
      integer(c_int) :: status
    end function c_raise
    function c_clock_gettime(clock, time) bind(C, name="clock_gettime") result(status)
      import :: c_int, c_long
      integer(c_int), value :: clock
      integer(c_long), intent(out) :: time(2)         !! seconds, nanoseconds
      integer(c_int) :: status
    end function c_clock_gettime
    function c_isatty(descriptor) bind(C, name="isatty") result(yes)
      import :: c_int
      integer(c_int), value :: descriptor
      integer(c_int) :: yes
    end function c_isatty
    subroutine c_exit(code) bind(C, name="exit")
      import :: c_int
      integer(c_int), value :: code
    end subroutine c_exit
    function c_getpid() bind(C, name="getpid") result(id)
      import :: c_int
      integer(c_int) :: id
    end function c_getpid
    function c_gethostname(name, length) bind(C, name="gethostname") result(status)
      import :: c_char, c_int, c_size_t
      character(kind=c_char), intent(out) :: name(*)
      integer(c_size_t), value :: length
      integer(c_int) :: status
    end function c_gethostname
    function c_rename(from, to) bind(C, name="rename") result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
      integer(c_int) :: status
    end function c_rename
    function c_link(from, to) bind(C, name="link") result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
      integer(c_int) :: status
    end function c_link
    function c_unlink(path) bind(C, name="unlink") result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: status
    end function c_unlink
    function c_mkdir(path, mode) bind(C, name="mkdir") result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: mode
      integer(c_int) :: status
    end function c_mkdir
    function c_open(path, flags, mode) bind(C, name="open") result(descriptor)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: flags, mode
      integer(c_int) :: descriptor
    end function c_open
    function c_close(descriptor) bind(C, name="close") result(status)
      import :: c_int
      integer(c_int), value :: descriptor
      integer(c_int) :: status
    end function c_close
    function c_fsync(descriptor) bind(C, name="fsync") result(status)
      import :: c_int
      integer(c_int), value :: descriptor
      integer(c_int) :: status
    end function c_fsync
    function c_flock(descriptor, operation) bind(C, name="flock") result(status)
      import :: c_int
      integer(c_int), value :: descriptor, operation
      integer(c_int) :: status
    end function c_flock
    function c_write(descriptor, bytes, length) bind(C, name="write") result(written)
      import :: c_char, c_int, c_size_t
      integer(c_int), value :: descriptor
      character(kind=c_char), intent(in) :: bytes(*)
      integer(c_size_t), value :: length
      integer(c_size_t) :: written
    end function c_write
    function c_statvfs(path, fields) bind(C, name="statvfs") result(status)
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(out) :: fields(16)   !! the structure has 14 words
      integer(c_int) :: status
    end function c_statvfs
    function c_errno_location() bind(C, name="__errno_location") result(address)
      import :: c_ptr
      type(c_ptr) :: address
    end function c_errno_location
    function c_strerror(number) bind(C, name="strerror") result(text)
      import :: c_int, c_ptr
      integer(c_int), value :: number
      type(c_ptr) :: text
    end function c_strerror
    function c_strlen(text) bind(C, name="strlen") result(length)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function c_strlen
  end interface

contains

  !> Standard streams that the caller has closed lead nowhere. Otherwise the first files that are opened would
  !> take their places, and messages would end up in them.
  subroutine fill_standard_streams()
    integer(c_int) :: descriptor, status

    do
      descriptor = c_open("/dev/null"//c_null_char, read_write, 0_c_int)
      if (descriptor < 0 .or. descriptor > 2) exit
    end do
    if (descriptor > 2) status = c_close(descriptor)
  end subroutine fill_standard_streams

  !> Writes lines to the standard output. Fortran's own `write` does not tell when the disk behind it is full.
  subroutine print_text(text, error)
    character(len=*), intent(in) :: text             !! without the last line end
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: left
    integer(c_size_t) :: written

    left = text//new_line("a")
    do while (len(left) > 0)
      written = c_write(1_c_int, left, len(left, c_size_t))
      if (written < 0) then
        call fail(error, exit_files, "standard output: cannot be written: "//last_problem())
        return
      end if
      left = left(written + 1:)
    end do
  end subroutine print_text

  !> From now on TERM, INT, HUP and XCPU ask for a stop with a checkpoint, USR1 for a checkpoint; what the
  !> caller chose to ignore (nohup) stays ignored. A file that grows beyond its limit is a failed write.
  subroutine watch_signals()
    integer(c_int), parameter :: watched(5) = [sig_hup, sig_int, sig_term, sig_xcpu, sig_usr1]
    type(c_funptr) :: previous
    integer :: k

    do k = 1, size(watched)
      previous = c_signal(watched(k), c_funloc(note_signal))
      if (transfer(previous, by_default) == ignored) previous = c_signal(watched(k), previous)
    end do
    previous = c_signal(sig_xfsz, transfer(ignored, previous))
  end subroutine watch_signals

  !> Only takes notice; the main loop looks. A later second wish to stop ends the program at once.
  subroutine note_signal(number) bind(C)
    integer(c_int), value :: number
    type(c_funptr) :: previous
    integer(c_int) :: status

    if (number == sig_usr1) then
      checkpoint_signal = 1
    else if (stop_signal == 0) then
      first_signal_at = seconds()
      stop_signal = number
    else if (seconds() - first_signal_at > twice_at_once) then
      previous = c_signal(number, transfer(by_default, previous))
      status = c_raise(number)
    end if
  end subroutine note_signal

  !> Whether a signal has asked the run to stop.
  function stop_requested() result(yes)
    logical :: yes

    yes = stop_signal /= 0
  end function stop_requested

  !> Whether USR1 has come since the last time this was asked.
  function checkpoint_requested() result(yes)
    logical :: yes

    yes = checkpoint_signal /= 0
    checkpoint_signal = 0
  end function checkpoint_requested

  !> A clock that only moves forward. [s]
  function seconds() result(t)
    real(real64) :: t
    integer(c_int), parameter :: monotonic = 1
    integer(c_long) :: time(2)
    integer(c_int) :: status

    status = c_clock_gettime(monotonic, time)
    t = real(time(1), real64) + 1.0e-9_real64*real(time(2), real64)
  end function seconds

  !> Whether messages, on the standard error, go to a terminal.
  function talks_to_terminal() result(yes)
    logical :: yes

    yes = c_isatty(2_c_int) == 1                   ! its descriptor: not the number of Fortran's unit
  end function talks_to_terminal

  !> Ends the program with an exit status, without a word.
  subroutine leave(code)
    integer, intent(in) :: code

    flush (error_unit)
    call c_exit(int(code, c_int))
  end subroutine leave

  function host_name() result(name)
    character(len=:), allocatable :: name
    character(len=256, kind=c_char) :: buffer

    name = "unknown"
    if (c_gethostname(buffer, len(buffer, c_size_t)) == 0) name = buffer(:scan(buffer//c_null_char, c_null_char) - 1)
  end function host_name

  function process_id() result(id)
    integer :: id

    id = c_getpid()
  end function process_id

  !> Renames a file; what had the new name is replaced in the same instant.
  subroutine move_file(from, to, moved)
    character(len=*), intent(in) :: from, to
    logical, intent(out) :: moved

    moved = c_rename(from//c_null_char, to//c_null_char) == 0
    if (moved) call synchronize(folder_of(to), moved)
  end subroutine move_file

  !> Gives a file a second name, in place of what had it. Some file systems cannot.
  subroutine link_file(from, to)
    character(len=*), intent(in) :: from, to
    integer(c_int) :: status

    call remove_file(to)
    status = c_link(from//c_null_char, to//c_null_char)
  end subroutine link_file

  !> Removes a file if it is there.
  subroutine remove_file(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: status

    status = c_unlink(path//c_null_char)
  end subroutine remove_file

  !> Makes the folders that lead to a file, as far as they are missing.
  subroutine make_folders_of(path, made)
    character(len=*), intent(in) :: path
    logical, intent(out) :: made
    integer :: k

    do k = 2, len(path)
      if (path(k:k) /= "/") cycle
      if (is_folder(path(:k - 1))) cycle
      made = c_mkdir(path(:k - 1)//c_null_char, all_may) == 0
      if (.not. made) made = error_number() == already_there     ! a twin was faster
      if (.not. made) return
    end do
    made = is_folder(folder_of(path))
  end subroutine make_folders_of

  !> Returns when the file, or the folder with its names, has reached the disk.
  subroutine synchronize(path, done)
    character(len=*), intent(in) :: path
    logical, intent(out) :: done
    integer(c_int) :: descriptor, status

    descriptor = c_open(path//c_null_char, read_only, 0_c_int)
    done = descriptor >= 0
    if (.not. done) return
    done = c_fsync(descriptor) == 0
    status = c_close(descriptor)
  end subroutine synchronize

  !> Why a file cannot be opened, in the system's words; nothing if it can.
  function obstacle_to_opening(path, writable) result(text)
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    character(len=:), allocatable :: text
    integer(c_int) :: descriptor, status

    text = ""
    descriptor = c_open(path//c_null_char, merge(read_write, read_only, writable), 0_c_int)
    if (descriptor < 0) text = last_problem()
    if (descriptor >= 0) status = c_close(descriptor)
  end function obstacle_to_opening

  function is_folder(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    inquire (file=path//"/.", exist=yes)
  end function is_folder

  !> The folder part of a path.
  pure function folder_of(path) result(folder)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: folder

    folder = path(:index(path, "/", back=.true.))
    if (folder == "") folder = "."
  end function folder_of

  !> Room that is left on the disk where the file is or will be; huge if nobody knows. [bytes]
  function free_bytes(path) result(bytes)
    character(len=*), intent(in) :: path
    integer(int64) :: bytes
    integer(c_int64_t) :: fields(16)
    integer, parameter :: unit_size = 2, total = 3, available = 5    !! f_frsize, f_blocks, f_bavail

    bytes = huge(bytes)
    if (c_statvfs(folder_of(path)//c_null_char, fields) /= 0) return
    if (fields(total) > 0) bytes = fields(unit_size)*fields(available)
  end function free_bytes

  !> Why the last call into the system failed, in its own words.
  function last_problem() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    type(c_ptr) :: address
    integer :: k

    address = c_strerror(error_number())
    call c_f_pointer(address, letters, [c_strlen(address)])
    allocate (character(len=size(letters)) :: text)
    do k = 1, size(letters)
      text(k:k) = letters(k)
    end do
  end function last_problem

  function error_number() result(number)
    integer(c_int) :: number
    integer(c_int), pointer :: errno

    call c_f_pointer(c_errno_location(), errno)
    number = errno
  end function error_number

  !> Takes the lock file `path` for this process, or tells that another one has it. Where the file system
  !> knows no locks the run goes on without.
  subroutine acquire(self, path, taken)
    class(lock_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    logical, intent(out) :: taken               !! by another process
    character(len=64) :: token, found
    integer(c_int) :: status
    integer(c_size_t) :: written
    integer :: trial, unit, io

    write (token, "(i0,1x,i0)") c_getpid(), nint(1.0e6_real64*seconds(), int64)
    self%path = path
    do trial = 1, 100
      self%descriptor = c_open(path//c_null_char, ior(read_write, create), owner_writes)
      taken = .false.
      if (self%descriptor < 0) return
      if (c_flock(self%descriptor, ior(exclusive, without_waiting)) /= 0) then
        taken = error_number() == would_block
        status = c_close(self%descriptor)
        self%descriptor = -1
        return
      end if
      ! The file may have lost its name to a process that was just leaving: then the lock is worth nothing.
      written = c_write(self%descriptor, trim(token)//new_line("a"), len_trim(token, c_size_t) + 1_c_size_t)
      if (written <= len_trim(token)) return              ! a full disk: no room even for this
      found = ""
      open (newunit=unit, file=path, status="old", action="read", iostat=io)
      if (io == 0) then
        read (unit, "(a)", iostat=io) found
        close (unit)
      end if
      if (io == 0 .and. found == token) return
      status = c_close(self%descriptor)
    end do
  end subroutine acquire

  subroutine release(self)
    class(lock_t), intent(inout) :: self
    integer(c_int) :: status

    if (self%descriptor < 0) return
    call remove_file(self%path)
    status = c_close(self%descriptor)
    self%descriptor = -1
  end subroutine release

end module system
