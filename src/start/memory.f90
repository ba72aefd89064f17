!> How much memory a run may use: a run that cannot fit is refused before it starts. On Linux; elsewhere no
!> limit is known.
module memory
  use kinds, only: int64, real64
  use errors, only: error_t, exit_usage, fail
  use settings, only: species_settings_t
  use texts, only: written
  implicit none
  private
  public :: check_memory, available_memory, number_after

  ! Measured with 200 000 and a million disks; a test compares them with real runs. [bytes]
  integer(int64), parameter :: per_disk = 240, per_growing_disk = 340, besides = 20000000
  integer(int64), parameter :: unlimited = huge(1_int64)
  ! When reading a file fails, the Fortran library begins it anew, for ever: so nobody reads on beyond this.
  integer, parameter :: most_lines = 1000

contains

  !> Refuses more disks than fit in memory.
  subroutine check_memory(species, error)
    type(species_settings_t), intent(in) :: species(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: limit
    integer(int64) :: n, needed, available
    integer :: k

    n = sum(int(species%count, int64))
    needed = n*merge(per_growing_disk, per_disk, any([(species(k)%placement == "dense", k=1, size(species))])) + besides
    call available_memory("", available, limit)
    if (needed > available) call fail(error, exit_usage, "species.count: "//written(n)//" disks need about " &
      //megabytes(needed)//" of memory; "//limit//" leaves "//megabytes(available)//"; use fewer disks")
  end subroutine check_memory

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
    candidate = number_after("Max address space", root//"/proc/self/limits")
    if (candidate < unlimited) &
      call consider(candidate - 1024*number_after("VmSize:", root//"/proc/self/status"), "ulimit -v")
    call consider(group_limit(root), "the control group")
  contains
    !> Keeps the tighter limit.
    subroutine consider(value, name)
      integer(int64), intent(in) :: value
      character(len=*), intent(in) :: name

      if (value >= bytes) return
      bytes = value
      limit = name
    end subroutine consider
  end subroutine available_memory

  !> The tightest limit of the control groups around this process, version 1 or 2.
  function group_limit(root) result(bytes)
    character(len=*), intent(in) :: root
    integer(int64) :: bytes
    character(len=1024) :: line                           !! NUMBER:CONTROLLERS:PATH
    character(len=:), allocatable :: folder, name
    integer :: unit, status, first, last, length, k

    bytes = unlimited
    open (newunit=unit, file=root//"/proc/self/cgroup", status="old", action="read", iostat=status)
    if (status /= 0) return
    do k = 1, most_lines
      read (unit, "(a)", iostat=status) line
      if (status /= 0) exit
      first = index(line, ":")
      last = first + index(line(first + 1:), ":")
      folder = root//"/sys/fs/cgroup"
      name = "/memory.max"
      if (index(","//line(first + 1:last - 1)//",", ",memory,") > 0) then
        folder = folder//"/memory"
        name = "/memory.limit_in_bytes"
      else if (last > first + 1) then
        cycle
      end if
      length = len_trim(line)
      do while (length >= last)
        bytes = min(bytes, number_after("", folder//line(last + 1:length)//name))
        length = last - 1 + index(line(last + 1:length), "/", back=.true.)
      end do
    end do
    close (unit)
  end function group_limit

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

  !> A size for messages.
  pure function megabytes(bytes) result(text)
    integer(int64), intent(in) :: bytes
    character(len=:), allocatable :: text

    text = written(nint(bytes/1.0e6_real64, int64))//" MB"
  end function megabytes

end module memory
