!> Checks whether a run fits into the memory that is available on the machine or granted by a batch system. A run that needs more
!> memory is refused before it starts. If the memory is sufficient for a run without domains but not for a run with domains, the run
!> uses the serial engine. The available memory is known only on Linux; on other operating systems every run is accepted.
module memory
  use kinds, only: int64, never, pi, real64
  use input_problems, only: problem_list_t
  use neighbour_lists, only: candidates_that_pay
  use radii, only: largest_radius
  use settings, only: settings_t
  use system, only: read_file
  use texts, only: eol, line_at, size_text, written
  implicit none
  private
  public :: check_memory, free_memory, memory_needed, peak, room_for_domains

  !> Memory in bytes per disk, per obstacle and per process. Each value is a contribution to the peak of the resident memory; the
  !> script `runs/memory.sh` measures the contributions with an accuracy of 5 %. For time-stepped dynamics the contributions are
  !> upper bounds, because the length of the Verlet lists depends on the time step.
  integer(int64), parameter :: per_process = 10000000, per_obstacle = 580
  !> Memory of the state and the next event of a disk (`record`), and of a cell of the neighbour search (`cell`)
  real(real64), parameter :: record = 103, cell = 32
  !> Memory of the image indices, contact time and rotation of a disk (`extra`), and of an individual mass (`own_size`)
  real(real64), parameter :: extra = 40, own_size = 8
  real(real64), parameter :: watched = 40                    !! memory for the series of simultaneous collisions of a disk
  real(real64), parameter :: sampled = 8.8_real64            !! memory for each value of a disk in a frame
  real(real64), parameter :: listed = 264                    !! neighbour list of a disk
  !> Memory per disk of the random numbers of the driving (`kicked`), of the test for free positions of recycled disks
  !> (`placed_anew`), and of the Verlet lists of time-stepped dynamics (`stepped`)
  real(real64), parameter :: kicked = 24, placed_anew = 70, stepped = 100
  !> Additional memory per disk if the box is divided into domains: the first number applies to a box with walls, the second number
  !> to a periodic box.
  real(real64), parameter :: divided(2) = [152, 212]
  !> Additional memory per disk if a run uses both domains and neighbour lists
  real(real64), parameter :: listed_twice = 80
  ! Total memory per disk during the placement of disks, for four methods in this order: given positions, random positions,
  ! positions from a file, compression.
  real(real64), parameter :: placed = 150, inserted = 166, read_in = 226, grown = 310
  !> Upper bound of the number of cells per disk that `cell_layout` chooses
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

  !> Whether the memory is sufficient to divide the box into domains. The test includes a safety margin, because the operating
  !> system kills a run without a warning when the memory is exhausted.
  function room_for_domains(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes

    yes = 1.15_real64*real(peak(settings, domains=.true.), real64) <= real(free_memory(""), real64)
  end function room_for_domains

  !> Memory that a run needs, including the domains if the run will use domains. [bytes]
  function memory_needed(settings) result(bytes)
    type(settings_t), intent(in) :: settings
    integer(int64) :: bytes
    logical :: domains

    domains = settings%wants_domains()
    if (domains) domains = room_for_domains(settings)
    bytes = peak(settings, domains)
  end function memory_needed

  !> Peak memory of a run, with or without domains. [bytes]
  pure function peak(settings, domains) result(bytes)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: domains                        !! .true. if the box is divided into domains
    integer(int64) :: bytes
    real(real64) :: running, starting, more               ! bytes per disk
    logical :: lists

    lists = are_listed(settings)
    more = 0
    if (any(settings%box%periodic) .or. settings%law%contact_time > 0 .or. settings%features%rotation &
      .or. settings%features%orientation) more = extra
    starting = more + starting_bytes(settings)
    if (settings%features%own_sizes) more = more + own_size
    if (settings%law%can_collapse()) more = more + watched
    running = record + cell*cells(settings) + more + sampled*numbers_in_frame(settings)
    if (lists) running = running + listed
    if (settings%drive%is_on()) running = running + merge(placed_anew, kicked, settings%drive%moves_disks())
    if (settings%run%dynamics == "steps") running = running + stepped
    if (domains) running = running + divided(merge(2, 1, all(settings%box%periodic)))
    if (domains .and. lists) running = running + listed_twice
    bytes = int(settings%n_disks()*max(running, starting), int64) + per_process + settings%box%n_obstacles()*per_obstacle
  end function peak

  !> Memory in bytes per disk during the placement of disks, without optional data such as individual masses. For disks with
  !> placement 'relaxed' the result is the memory of the compression, because the event chains and a start on a lattice need less
  !> memory.
  pure function starting_bytes(settings) result(bytes)
    type(settings_t), intent(in) :: settings
    real(real64) :: bytes
    integer :: k

    bytes = placed
    do k = 1, size(settings%species)
      select case (settings%species(k)%placement)
      case ("random")
        if (.not. settings%features%own_sizes) bytes = max(bytes, inserted)
      case ("file")
        bytes = max(bytes, read_in)
      case ("dense", "grown", "relaxed")
        bytes = max(bytes, grown + merge(extra, 0.0_real64, any(settings%box%periodic)))
      case default                                    ! grids and lattices need no additional memory
      end select
    end do
  end function starting_bytes

  !> Number of values per disk in a frame; 0 if only the first and the last frame are written.
  pure function numbers_in_frame(settings) result(n)
    type(settings_t), intent(in) :: settings
    integer :: n, k

    n = 0
    associate (frames => settings%output%sampling(1), features => settings%features)
      if (.not. (any(frames%every < never) .or. allocated(frames%at) .or. frames%per_decade > 0)) return
      n = 5 + merge(2, 0, any(settings%box%periodic)) + merge(1, 0, features%rotation) + merge(1, 0, features%orientation) &
        + merge(1, 0, settings%drive%moves_disks())
    end associate
    if (.not. allocated(settings%output%frame_columns)) return
    n = 2
    do k = 1, size(settings%output%frame_columns)
      n = n + merge(2, 1, any(settings%output%frame_columns(k) == [character(len=8) :: "velocity", "image"]))
    end do
  end function numbers_in_frame

  !> Number of cells in the grid of the search, divided by the number of disks.
  pure function cells(settings) result(n)
    type(settings_t), intent(in) :: settings
    real(real64) :: n

    n = 0
    if (settings%run%search /= "cells" .or. settings%run%dynamics /= "events") return
    n = min(cells_per_disk, 0.25_real64*pi/max(crowding(settings), tiny(n)))
  end function cells

  !> Whether the run will use neighbour lists, according to the condition in `neighbour_lists`.
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

  !> Packing fraction that the system would have if all disks had the radius that determines the width of the cells. The width of
  !> the cells is determined by the largest radius of those species that contain at least a twentieth of all disks.
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

  !> The available memory: the smaller of the free memory of the computer and the memory limit of the control group of the process.
  !> If a batch job exceeds the memory limit of its control group, the operating system kills the job without a message. The result
  !> is huge if neither the free memory nor the limit is known. [bytes]
  function free_memory(root) result(bytes)
    character(len=*), intent(in) :: root                  !! root folder of the file system; empty except in tests
    integer(int64) :: bytes
    ! A line of the form `number:controllers:group`; in version 2 of control groups the controllers are empty
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
      do while (len(folder) >= top)                       ! the control group, and all control groups that contain it
        bytes = min(bytes, number_after("", folder//"/memory.max"), number_after("", folder//"/memory.limit_in_bytes"))
        folder = folder(:index(folder, "/", back=.true.) - 1)
      end do
    end do
  end function free_memory

  !> The number that follows a label at the beginning of a line of a file. The result is huge if no line begins with the label.
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
