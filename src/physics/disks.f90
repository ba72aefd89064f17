!> Data of the disks, grouped by frequency of use. The record of a disk fills one cache line and is
!> read in every prediction. The tag of a disk fills half a cache line and is read only in events of
!> the disk itself. Arrays of optional data exist only in some simulations. Derived data are not
!> stored in checkpoints. They are recomputed whenever a run starts or resumes.
module disks
  use free_flight, only: flight, flight_velocity
  use kinds, only: int16, int32, int64, largest_exact, never, real64
  implicit none
  private
  public :: disk_t, extra_t, series_t, source_t, species_t, tag_t, whole_disk_t
  public :: disks_before, advance_disk, list_by_id, longest_name, names_of, species_by_id

  !> Position, velocity and clock of a disk change only in its own collisions and when it passes a
  !> periodic side. At other times, the position is extrapolated from these data.
  type :: disk_t
    real(real64) :: x(2) = 0.0_real64           !! position at `clock` [length]
    real(real64) :: v(2) = 0.0_real64           !! velocity at `clock` [length/time]
    real(real64) :: clock = 0.0_real64          !! time of `x` and `v`, relative to `box%epoch` [time]
    real(real64) :: radius = 0.0_real64         !! [length]
    ! Derived data: the collision counter, and the next event as predicted by the search. The
    ! counter is the number of changes of x and v in the present epoch. An event is stale if the
    ! counter of the partner has changed since the prediction.
    integer(int32) :: collision_counter = 0
    integer(int32) :: partner = 0     !! partner in the next event: a disk (> 0) or another code of `partners`
    real(real64) :: event_time = 0.0_real64     !! time of the next event, relative to `box%epoch` [time]
  end type disk_t

  type :: tag_t
    integer(int32) :: species = 1               !! index of the species
    integer(int32) :: id = 0                    !! number of the disk in the order of the input
    integer(int64) :: collisions = 0            !! number of events of the disk since the start of the run
    !> Last collision partner: id of a disk, boundary id of an obstacle, or 0.
    integer(int32) :: last_partner = 0
    ! Derived data for the search and the event queue.
    integer(int16) :: cell(2) = 0_int16         !! column and row in the cell grid
    integer(int32) :: window = 0                !! time window of the event in the event queue
    integer(int32) :: partner_counter = 0     !! collision counter of the partner when the event was predicted
  end type tag_t

  integer, parameter :: longest_name = 40            !! maximum length of the name of a species

  !> A species. Its disks have the same contact law and, unless masses are read from a file, the
  !> same mass.
  type :: species_t
    character(len=:), allocatable :: name
    integer :: count = 0
    real(real64) :: mass = 1.0_real64           !! mass of each disk; the maximum if masses differ [mass]
  end type species_t

  !> A source. Waiting disks of a species enter the box through the source at multiples of its
  !> interval, at random free positions.
  type :: source_t
    character(len=:), allocatable :: name
    integer :: species = 1                      !! index of the species
    real(real64) :: region(4) = 0.0_real64      !! region in which disks enter: xlo, xhi, ylo, yhi [length]
    real(real64) :: interval = never            !! [time]
    integer :: count = 1                        !! maximum number of disks that enter at one time
    !> Velocity of entering disks if `temperature` is 0 [length/time].
    real(real64) :: velocity(2) = 0.0_real64
    !> kT of the Maxwell distribution from which the velocities of entering disks are drawn; 0 for a
    !> fixed velocity [energy].
    real(real64) :: temperature = 0.0_real64
    real(real64) :: start_time = 0.0_real64     !! earliest time when disks enter [time]
    real(real64) :: end_time = never            !! latest time when disks enter [time]
  contains
    procedure :: next_multiple
    procedure :: speed2
  end type source_t

  !> Optional data of a disk, which exist only if `simulation_state: has_extra` is .true.
  type :: extra_t
    !> Image counters, stored as reals: number of periods crossed along each axis. The unwrapped
    !> position is x + image*edges.
    real(real64) :: image(2) = 0.0_real64
    !> Time of the last contact (TC model), relative to `box%epoch` [time].
    real(real64) :: last_contact = 0.0_real64
    real(real64) :: spin = 0.0_real64           !! angular velocity [1/time]
    real(real64) :: angle = 0.0_real64          !! orientation at `clock`, unwrapped [radian]
  end type extra_t

  !> Membership of a disk in a series of collisions. The collisions of a series occur at one and the
  !> same time and are connected by common disks (see `collapses`).
  type :: series_t
    real(real64) :: time = -never               !! time of the last series, relative to `box%epoch` [time]
    !> Id of a disk of the same series. Following these ids from disk to disk leads to the disk that
    !> represents the series.
    integer(int32) :: root = 0
    integer(int32) :: disks = 0                 !! number of disks in the series represented by this disk
    !> Number of collisions in the series represented by this disk.
    integer(int64) :: collisions = 0
    !> Number of events of this disk up to which no collapse is possible.
    integer(int64) :: known_until = 0
    !> Minimum number of events until the disk is examined again (see `collapses: judge`).
    integer(int64) :: patience = 0
  end type series_t

  !> All data of one disk in a single type, to be copied together.
  type :: whole_disk_t
    type(disk_t) :: disk
    type(tag_t) :: tag
    real(real64) :: own_mass = 0.0_real64       !! mass of the disk if masses within a species differ [mass]
    type(extra_t) :: extra
  end type whole_disk_t

contains

  !> Lists the indices of the chosen disks, in the order of their ids.
  pure subroutine list_by_id(tag, chosen, index)
    type(tag_t), intent(in) :: tag(:)
    logical, intent(in) :: chosen(:)
    integer(int32), allocatable, intent(out) :: index(:)
    ! For each id, the index of the disk if it is chosen, otherwise 0.
    integer(int32), allocatable :: index_of(:)
    integer(int32) :: i

    allocate (index_of(size(tag)), source=0_int32)
    do i = 1, size(tag, kind=int32)
      if (chosen(i)) index_of(tag(i)%id) = i
    end do
    index = pack(index_of, index_of > 0)
  end subroutine list_by_id

  !> Advances a disk in free flight to the time t.
  pure subroutine advance_disk(disk, gravity, t)
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: gravity(2), t
    real(real64) :: s

    s = t - disk%clock
    disk%x = flight(disk%x, disk%v, gravity, s)
    disk%v = flight_velocity(disk%v, gravity, s)
    disk%clock = t
    disk%collision_counter = disk%collision_counter + 1
  end subroutine advance_disk

  !> Number of the first multiple of the interval that is after a given time and between the start
  !> and the end of the source; 0 if there is none. A multiple within a few rounding errors of the
  !> start or the end counts as inside: in double precision, 3 x 0.1 exceeds 0.3.
  pure function next_multiple(self, after) result(k)
    class(source_t), intent(in) :: self
    real(real64), intent(in) :: after             !! since the start of the run [time]
    integer(int64) :: k
    real(real64) :: first, last                   ! [time]

    k = 0
    first = self%start_time - 4*spacing(self%start_time)
    last = self%end_time + 4*spacing(self%end_time)
    if (self%count == 0 .or. max(after, first) >= largest_exact*self%interval) return
    k = max(int(max(after, first)/self%interval, int64) - 1, 1_int64)
    do while (k*self%interval <= after .or. k*self%interval < first)
      k = k + 1
    end do
    if (k*self%interval > last) k = 0
  end function next_multiple

  !> Mean square of the velocities of entering disks.
  elemental function speed2(self, mass)
    class(source_t), intent(in) :: self
    real(real64), intent(in) :: mass              !! [mass]
    real(real64) :: speed2                        !! [(length/time)**2]

    speed2 = 2*self%temperature/mass + sum(self%velocity**2)
  end function speed2

  !> Names of the species.
  pure function names_of(species) result(names)
    class(species_t), intent(in) :: species(:)
    character(len=longest_name) :: names(size(species))
    integer :: s

    do s = 1, size(species)
      names(s) = species(s)%name
    end do
  end function names_of

  !> Number of disks in all species before species s; their ids are lower than those of species s.
  pure function disks_before(species, s) result(n)
    class(species_t), intent(in) :: species(:)
    integer, intent(in) :: s
    integer :: n

    n = sum(species(:s - 1)%count)
  end function disks_before

  !> Index of the species of each disk, in the order of ids.
  pure function species_by_id(species) result(number)
    class(species_t), intent(in) :: species(:)
    integer(int32), allocatable :: number(:)
    integer :: s

    allocate (number(sum(species%count)))
    do s = 1, size(species)
      number(disks_before(species, s) + 1:disks_before(species, s + 1)) = int(s, int32)
    end do
  end function species_by_id

end module disks
