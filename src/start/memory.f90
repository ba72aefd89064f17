!> How much memory a run may use: a run that cannot fit is refused before it starts, and one that is short of it goes
!> without domains. On Linux; elsewhere no limit is known.
module memory
  use kinds, only: int64
  use errors, only: error_t, exit_usage, fail
  use settings, only: settings_t
  use texts, only: size_text, written
  implicit none
  private
  public :: check_memory, room_for_domains, bytes_needed, available_memory, find_groups, number_after

  ! Measured with 100 000 to a million disks; a test compares them with real runs. [bytes]
  integer(int64), parameter :: per_disk = 290, per_growing_disk = 400, per_stepped_disk = 410, per_shared_disk = 430, &
    besides = 25000000
  integer(int64), parameter :: per_logged_disk = 110       !! in the lists of collisions of several domains
  integer(int64), parameter :: unlimited = huge(1_int64)
  ! When reading a file fails, the Fortran library begins it anew, for ever: so nobody reads on beyond this.
  integer, parameter :: most_lines = 1000
  integer, parameter, public :: path_length = 1200         !! of the folder of a control group

contains

  !> Refuses more disks than fit in memory.
  subroutine check_memory(settings, error)
    type(settings_t), intent(in) :: settings
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: limit
    integer(int64) :: needed, available

    needed = bytes_needed(settings, .false.)
    call available_memory("", available, limit)
    if (needed > available) call fail(error, exit_usage, "species.count: "//written(settings%n_disks()) &
      //" disks need about "//size_text(needed)//" of memory; "//limit//" leaves "//size_text(available)//"; use fewer disks")
  end subroutine check_memory

  !> Whether there is memory to cut the box into domains.
  function room_for_domains(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes
    integer(int64) :: available
    character(len=:), allocatable :: limit

    call available_memory("", available, limit)
    yes = bytes_needed(settings, .true.) <= available
  end function room_for_domains

  !> What a run needs at most, with domains or without.
  pure function bytes_needed(settings, domains) result(bytes)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: domains
    integer(int64) :: bytes, each
    integer :: k

    each = per_disk
    do k = 1, size(settings%species)
      if (any(settings%species(k)%placement == [character(len=5) :: "dense", "grown"])) each = per_growing_disk
    end do
    if (settings%run%dynamics == "steps") each = max(each, per_stepped_disk)
    if (domains) each = max(each, per_shared_disk + merge(per_logged_disk, 0_int64, settings%output%event_log))
    bytes = settings%n_disks()*each + besides
  end function bytes_needed

  !> The tightest of all limits: free memory of the machine, ulimit, control groups.
  subroutine available_memory(root, bytes, limit)
    character(len=*), intent(in) :: root                  !! empty except in tests
    integer(int64), intent(out) :: bytes
    character(len=:), allocatable, intent(out) :: limit   !! its name
    integer(int64) :: candidate

    bytes = unlimited
    limit = ""
    candidate = number_after("MemAvailable:", root//"/proc/meminfo")
    if (candidate < unlimited) call consider(1024*candidate, "the machine")
    call consider(process_limit("Max address space", "VmSize:"), "ulimit -v")
    call consider(process_limit("Max data size", "VmData:"), "ulimit -d")
    call consider(group_limit(root), "the control group")
  contains
    !> Keeps the tighter limit.
    subroutine consider(value, name)
      integer(int64), intent(in) :: value
      character(len=*), intent(in) :: name

      if (value >= bytes) return
      bytes = max(value, 0_int64)
      limit = name
    end subroutine consider

    !> What a limit of this process leaves, by the names of the limit and of what is in use.
    function process_limit(most, used) result(left)
      character(len=*), intent(in) :: most, used
      integer(int64) :: left

      left = number_after(most, root//"/proc/self/limits")
      if (left < unlimited) left = left - 1024*number_after(used, root//"/proc/self/status")
    end function process_limit
  end subroutine available_memory

  !> What the tightest of the control groups around this process leaves.
  function group_limit(root) result(bytes)
    character(len=*), intent(in) :: root
    integer(int64) :: bytes
    character(len=path_length), allocatable :: folders(:)
    integer :: k

    call find_groups(root, "memory", folders)
    bytes = unlimited
    do k = 1, size(folders)
      bytes = min(bytes, left(trim(folders(k)), "/memory.max", "/memory.current", "inactive_file"), &
        left(trim(folders(k)), "/memory.limit_in_bytes", "/memory.usage_in_bytes", "total_inactive_file"))
    end do
  contains
    !> What a group leaves, by the names of its limit, of what is in use, and of the files held in memory among it,
    !> which give way.
    function left(group, most, used, files) result(rest)
      character(len=*), intent(in) :: group, most, used, files
      integer(int64) :: rest, in_use, held

      rest = number_after("", group//most)
      in_use = number_after("", group//used)
      held = number_after(files//" ", group//"/memory.stat")
      if (rest == unlimited .or. in_use == unlimited) return
      if (held == unlimited) held = 0
      rest = rest - max(in_use - held, 0_int64)
    end function left
  end function group_limit

  !> Lists the folders of the control groups around this process that can limit what a controller controls. Those of
  !> version 1 and 2 have files of different names.
  subroutine find_groups(root, controller, folders)
    character(len=*), intent(in) :: root                  !! empty except in tests
    character(len=*), intent(in) :: controller            !! "memory" or "cpu"
    character(len=path_length), allocatable, intent(out) :: folders(:)
    character(len=1024) :: line                           !! NUMBER:CONTROLLERS:PATH
    logical :: old
    integer :: unit, status, first, last, length, k

    allocate (folders(0))
    open (newunit=unit, file=root//"/proc/self/cgroup", status="old", action="read", iostat=status)
    if (status /= 0) return
    do k = 1, most_lines
      read (unit, "(a)", iostat=status) line
      if (status /= 0) exit
      first = index(line, ":")
      last = first + index(line(first + 1:), ":")
      old = index(","//line(first + 1:last - 1)//",", ","//controller//",") > 0
      if (last > first + 1 .and. .not. old) cycle
      length = len_trim(line)
      do while (length >= last)
        folders = [character(len=path_length) :: folders, &
          root//"/sys/fs/cgroup"//trim(merge("/"//controller, repeat(" ", len(controller) + 1), old))//line(last + 1:length)]
        length = last - 1 + index(line(last + 1:length), "/", back=.true.)
      end do
    end do
    close (unit)
  end subroutine find_groups

  !> The number that follows a label at the beginning of a line of a file; huge if there is none.
  function number_after(label, path) result(number)
    character(len=*), intent(in) :: label, path
    integer(int64) :: number
    character(len=200) :: line
    integer :: unit, status, k

    number = unlimited
    open (newunit=unit, file=path, status="old", action="read", iostat=status)
    if (status /= 0) return
    do k = 1, most_lines
      read (unit, "(a)", iostat=status) line
      if (status /= 0) exit
      if (index(line, label) /= 1) cycle
      read (line(len(label) + 1:), *, iostat=status) number
      if (status /= 0) number = unlimited
      exit
    end do
    close (unit)
  end function number_after

end module memory
