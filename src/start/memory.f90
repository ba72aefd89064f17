!> Checks that a run fits into the free memory of the computer, or into the memory granted by a
!> batch system. Otherwise the run is refused before it starts. If memory suffices only without
!> domains, the run uses the serial engine. The free memory is known only on Linux; on other systems
!> every run is accepted.
module memory
  use kinds, only: int64, never, pi, real64
  use input_problems, only: problem_list_t
  use neighbour_lists, only: candidates_that_pay
  use radii, only: largest_radius
  use sample_values, only: frame_columns
  use settings, only: settings_t
  use system, only: read_file
  use texts, only: eol, line_at, size_text, written
  implicit none
  private
  public :: check_memory, free_memory, memory_needed, peak, room_for_domains

  !> Contributions to the peak of the resident memory, in bytes per disk, per obstacle and per
  !> process. They agree with measurements by `runs/memory.sh` within 5 %. For time-stepped dynamics
  !> they are upper bounds, because the length of the Verlet lists depends on the time step.
  integer(int64), parameter :: per_process = 10000000, per_obstacle = 580
  !> State and next event of a disk (`record`); cell of the neighbour search (`cell`).
  real(real64), parameter :: record = 103, cell = 32
  !> Image counters, contact time and rotation of a disk (`extra`); individual mass (`own_size`).
  real(real64), parameter :: extra = 40, own_size = 8
  !> Series of simultaneous collisions of a disk.
  real(real64), parameter :: watched = 40
  real(real64), parameter :: sampled = 8.8_real64            !! one value of a disk in a frame
  real(real64), parameter :: listed = 264                    !! neighbour list of a disk
  !> Random numbers of kicks (`kicked`), test for free positions in kicks that move disks
  !> (`placed_anew`), and Verlet lists of time-stepped dynamics (`stepped`), per disk.
  real(real64), parameter :: kicked = 24, placed_anew = 70, stepped = 100
  !> Additional memory per disk with domains, for walled (first) and periodic (second) boxes.
  real(real64), parameter :: divided(2) = [152, 212]
  !> Additional memory per disk with both domains and neighbour lists.
  real(real64), parameter :: listed_twice = 80
  !> Upper bound of the number of cells per disk chosen by `cell_layout`.
  real(real64), parameter :: cells_per_disk = 1.67_real64

contains

  !> Reports a problem if the run needs more memory than is free.
  subroutine check_memory(settings, problems)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    integer(int64) :: needed, free
    character(len=:), allocatable :: what

    needed = peak(settings, domains=.false.)
    free = free_memory("")
    what = written(settings%n_disks())//" disks"
    if (settings%box%has_obstacles()) what = what//" and "//written(settings%box%n_obstacles())//" obstacles"
    if (needed > free) call problems%add(0, "species.count", what//" need about " &
      //size_text(needed)//" of memory, and "//size_text(free)//" are free; use fewer disks")
  end subroutine check_memory

  !> True if the memory suffices for domains. A safety margin is needed, because the operating
  !> system kills a run without warning when the memory is exhausted.
  function room_for_domains(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes

    yes = 1.15_real64*real(peak(settings, domains=.true.), real64) <= real(free_memory(""), real64)
  end function room_for_domains

  !> Memory required by a run in bytes, including its domains if it uses domains.
  function memory_needed(settings) result(bytes)
    type(settings_t), intent(in) :: settings
    integer(int64) :: bytes
    logical :: domains

    domains = settings%wants_domains()
    if (domains) domains = room_for_domains(settings)
    bytes = peak(settings, domains)
  end function memory_needed

  !> Peak memory of a run in bytes, with or without domains.
  pure function peak(settings, domains) result(bytes)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: domains                        !! .true. if the box is divided into domains
    integer(int64) :: bytes
    real(real64) :: running, starting, more               ! [bytes per disk]
    logical :: lists
    integer :: k

    lists = are_listed(settings)
    more = 0
    if (settings%has_extra(settings%box%periodic)) more = extra
    associate (periods => merge(extra, 0.0_real64, any(settings%box%periodic)))
      starting = more + maxval([(settings%species(k)%placement%bytes(settings%features%own_sizes, periods), &
        k=1, size(settings%species))])
    end associate
    if (settings%features%own_sizes) more = more + own_size
    if (settings%law%can_collapse()) more = more + watched
    running = record + cell*cells(settings) + more + sampled*numbers_in_frame(settings)
    if (lists) running = running + listed
    if (allocated(settings%drive)) running = running + merge(placed_anew, kicked, settings%drive%moves_disks())
    if (settings%run%dynamics == "steps") running = running + stepped
    if (domains) running = running + divided(merge(2, 1, all(settings%box%periodic)))
    if (domains .and. lists) running = running + listed_twice
    bytes = int(settings%n_disks()*max(running, starting), int64) + per_process + settings%box%n_obstacles()*per_obstacle
  end function peak

  !> Number of values per disk in a frame; 0 if only the first and the last frame are written.
  pure function numbers_in_frame(settings) result(n)
    type(settings_t), intent(in) :: settings
    integer :: n

    n = 0
    associate (frames => settings%output%sampling(1))
      if (.not. (any(frames%every < never) .or. allocated(frames%at) .or. frames%per_decade > 0)) return
    end associate
    associate (columns => frame_columns(settings, settings%box%periodic, settings%output%frame_columns))
      n = sum(columns%width)
    end associate
  end function numbers_in_frame

  !> Number of cells in the search grid, divided by the number of disks.
  pure function cells(settings) result(n)
    type(settings_t), intent(in) :: settings
    real(real64) :: n

    n = 0
    if (settings%run%search /= "cells" .or. settings%run%dynamics /= "events") return
    n = min(cells_per_disk, 0.25_real64*pi/max(crowding(settings), tiny(n)))
  end function cells

  !> True if the run uses neighbour lists, according to the condition in `neighbour_lists`.
  pure function are_listed(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes
    real(real64) :: packing, candidates

    yes = settings%run%search == "cells" .and. settings%run%dynamics == "events"
    if (.not. yes) return
    associate (s => settings%species)
      packing = min(pi*sum(s%count*s%mean_radius**2*(1 + s%polydispersity**2))/product(settings%box%edges()), 0.9_real64)
    end associate
    candidates = 9/max(cells(settings), tiny(packing))
    yes = candidates > candidates_that_pay - 27*packing
  end function are_listed

  !> Packing fraction that the system would have if all disks had the radius that determines the
  !> cell width. This is the largest radius of all species with at least a twentieth of the disks.
  pure function crowding(settings) result(fraction)
    type(settings_t), intent(in) :: settings
    real(real64) :: fraction, radius
    integer :: k

    radius = 0
    do k = 1, size(settings%species)
      if (20*int(settings%species(k)%count, int64) >= settings%n_disks()) &
        radius = max(radius, largest_radius(settings%species(k)))
    end do
    fraction = settings%n_disks()*pi*radius**2/product(settings%box%edges())
  end function crowding

  !> Available memory in bytes: the smaller of the free memory of the computer and the limit of the
  !> control group. Beyond this limit the operating system kills a batch job without a message. The
  !> result is huge if neither is known.
  function free_memory(root) result(bytes)
    !> Root folder of the file system; empty except in tests.
    character(len=*), intent(in) :: root
    integer(int64) :: bytes
    ! A line of the form `number:controllers:group`; in version 2 of control groups the list of
    ! controllers is empty
    character(len=:), allocatable :: groups, line
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
      do while (len(folder) >= top)                       ! the control group and all groups that contain it
        bytes = min(bytes, number_after("", folder//"/memory.max"), number_after("", folder//"/memory.limit_in_bytes"))
        folder = folder(:index(folder, "/", back=.true.) - 1)
      end do
    end do
  end function free_memory

  !> Number that follows a label at the start of a line of a file; a huge number if there is no such
  !> line.
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
