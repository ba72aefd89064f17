!> Checks whether a run fits into the memory that is available on the machine or granted by a batch system. A run that does not
!> fit is refused before it starts; one for which domains do not fit uses the serial engine. The check works on Linux; on other
!> systems no limit is known.
module memory
  use kinds, only: int64
  use input_problems, only: problem_list_t
  use settings, only: settings_t
  use system, only: read_file
  use texts, only: eol, line_at, size_text, written
  implicit none
  private
  public :: check_memory, free_memory, room_for_domains

  ! Memory per disk with the serial engine, per disk with domains, and independent of disks, measured with 100 000 to a million
  ! disks. [bytes]
  integer(int64), parameter :: per_disk = 410, per_shared_disk = 540, besides = 25000000
  integer(int64), parameter :: per_list = 270    !! neighbour list of a disk, used where sizes differ
  integer(int64), parameter :: per_obstacle = 560

contains

  !> Refuses more disks than fit into the memory.
  subroutine check_memory(settings, problems)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    integer(int64) :: needed, free
    character(len=:), allocatable :: what

    needed = settings%n_disks()*(per_disk + merge(per_list, 0_int64, sizes_differ(settings))) + besides &
      + settings%box%n_obstacles()*per_obstacle
    free = free_memory("")
    what = written(settings%n_disks())//" disks"
    if (settings%box%has_obstacles()) what = what//" and "//written(settings%box%n_obstacles())//" obstacles"
    if (needed > free) call problems%add(0, "species.count", what//" need about " &
      //size_text(needed)//" of memory, and "//size_text(free)//" are free; use fewer disks")
  end subroutine check_memory

  !> Whether the memory suffices for dividing the box into domains.
  function room_for_domains(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes

    yes = settings%n_disks()*(per_shared_disk + merge(per_list, 0_int64, sizes_differ(settings))) + besides <= free_memory("")
  end function room_for_domains

  !> Whether the disks may have so many different sizes that neighbour lists are used.
  pure function sizes_differ(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes

    yes = any(settings%species%polydispersity > 0) .or. any(settings%species%radius_in_file) &
      .or. maxval(settings%species%radius) > minval(settings%species%radius)
  end function sizes_differ

  !> Memory available on the machine, or the limit of the control group if that is less, because a batch job that exceeds it is
  !> killed without a message. Huge if neither is known. [bytes]
  function free_memory(root) result(bytes)
    character(len=*), intent(in) :: root                  !! root of the file system; empty except in tests
    integer(int64) :: bytes
    character(len=:), allocatable :: groups, line         ! number:controllers:group; in version 2 without controllers
    character(len=:), allocatable :: folder, unread
    integer :: top, at, colon

    bytes = number_after("MemAvailable:", root//"/proc/meminfo")
    if (bytes < huge(bytes)) bytes = 1024*bytes
    call read_file(root//"/proc/self/cgroup", groups, unread)
    at = 1
    do while (at <= len(groups))
      line = line_at(groups, at)
      at = at + len(line) + 1
      colon = index(line, ":", back=.true.)
      folder = root//"/sys/fs/cgroup"
      if (index(line(:colon), "memory") > 0) folder = folder//"/memory"
      top = len(folder)
      if (index(line(:colon), "memory") + index(line, "::") == 0) cycle
      folder = folder//line(colon + 1:)
      do while (len(folder) >= top)                       ! the control group, and those that contain it
        bytes = min(bytes, number_after("", folder//"/memory.max"), number_after("", folder//"/memory.limit_in_bytes"))
        folder = folder(:index(folder, "/", back=.true.) - 1)
      end do
    end do
  end function free_memory

  !> The number that follows a label at the beginning of a line of a file; huge if there is none.
  function number_after(label, path) result(number)
    character(len=*), intent(in) :: label, path
    integer(int64) :: number
    character(len=:), allocatable :: text, line, unread
    integer :: at, status

    number = huge(number)
    call read_file(path, text, unread)
    at = index(eol//text, eol//label)
    if (at == 0) return
    line = line_at(text, at)
    read (line(len(label) + 1:), *, iostat=status) number
    if (status /= 0) number = huge(number)
  end function number_after

end module memory
