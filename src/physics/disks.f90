!> Data of the disks, grouped by the frequency of access. The record of a disk occupies one cache line and is read in every
!> prediction. The tag of a disk occupies half a cache line and is needed only in events of the disk itself. Optional data of disks
!> are in arrays that exist only in some simulations. Derived data of the disks are not stored in checkpoints, because they are
!> recomputed at every start.
module disks
  use free_flight, only: flight, flight_velocity
  use kinds, only: int16, int32, int64, never, real64
  implicit none
  private
  public :: disk_t, extra_t, series_t, species_t, tag_t, whole_disk_t
  public :: disks_before, advance_disk, longest_name, names_of, species_by_id

  !> Position, velocity and clock of a disk change only in the collisions of this disk, and when the disk passes a periodic side.
  !> The position of a disk at another time follows from its stored position and velocity.
  type :: disk_t
    real(real64) :: x(2) = 0.0_real64           !! position at `clock` [length]
    real(real64) :: v(2) = 0.0_real64           !! velocity at `clock` [length/time]
    real(real64) :: clock = 0.0_real64          !! time of `x` and `v`, relative to the time origin `box%epoch` [time]
    real(real64) :: radius = 0.0_real64         !! [length]
    ! Derived data: the collision counter, and the next event as predicted by the search. The collision counter is the number of
    ! changes of x and v of the disk in the present epoch. A changed collision counter shows that an event is stale.
    integer(int32) :: collision_counter = 0
    integer(int32) :: partner = 0               !! partner in the next event: index of a disk (> 0), or another code of `partners`
    real(real64) :: event_time = 0.0_real64     !! time of the next event, relative to the time origin `box%epoch` [time]
  end type disk_t

  type :: tag_t
    integer(int32) :: species = 1               !! index of the species
    integer(int32) :: id = 0                    !! number of the disk in the order of the input file
    integer(int64) :: collisions = 0            !! number of events of the disk since the start of the run
    integer(int32) :: last_partner = 0  !! last collision partner: id of a disk, code of an obstacle, or 0
    ! Derived data, which the search and the event queue use.
    integer(int16) :: cell(2) = 0_int16         !! column and row in the cell grid
    integer(int32) :: window = 0                !! time window to which the event queue has assigned the event
    integer(int32) :: partner_counter = 0       !! collision counter of the partner at the time of the prediction
  end type tag_t

  integer, parameter :: longest_name = 40            !! largest length of the name of a species

  !> A species: all its disks have the same contact law and, unless a file contains individual masses, the same mass.
  type :: species_t
    character(len=:), allocatable :: name
    integer :: count = 0
    real(real64) :: mass = 1.0_real64           !! mass of each disk; largest mass if the masses differ [mass]
  end type species_t

  !> Optional data of a disk, which exist only if `simulation_state: has_extra` is .true.
  type :: extra_t
    !> Integer number of periods by which the disk has moved along each axis; the unwrapped position is x + image*edges.
    real(real64) :: image(2) = 0.0_real64
    real(real64) :: last_contact = 0.0_real64   !! time of the last contact (TC model), relative to `box%epoch` [time]
    real(real64) :: spin = 0.0_real64           !! angular velocity [1/time]
    real(real64) :: angle = 0.0_real64          !! orientation at `clock`, unwrapped [radian]
  end type extra_t

  !> Membership of a disk in a series, which consists of the collisions of one time that are connected through shared disks. See
  !> `collapses`.
  type :: series_t
    real(real64) :: time = -never               !! time of the last series, relative to the time origin `box%epoch` [time]
    !> Id of a disk of the same series, which leads to the disk that represents the series
    integer(int32) :: root = 0
    integer(int32) :: disks = 0                 !! number of disks in the series that this disk represents
    integer(int64) :: collisions = 0            !! number of collisions in the series that this disk represents
    integer(int64) :: known_until = 0           !! number of events of this disk up to which no collapse is possible
    !> Smallest number of events until the disk is examined again, see `collapses: judge`
    integer(int64) :: patience = 0
  end type series_t

  !> All data of one disk, combined in one type so that they can be copied together.
  type :: whole_disk_t
    type(disk_t) :: disk
    type(tag_t) :: tag
    real(real64) :: own_mass = 0.0_real64       !! mass of the disk, if masses within a species differ [mass]
    type(extra_t) :: extra
  end type whole_disk_t

contains

  !> Advances a disk along its free flight to the time t.
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

  !> Names of the species.
  pure function names_of(species) result(names)
    class(species_t), intent(in) :: species(:)
    character(len=longest_name) :: names(size(species))
    integer :: s

    do s = 1, size(species)
      names(s) = species(s)%name
    end do
  end function names_of

  !> Number of disks in all species before species s. Disks of earlier species have lower ids than the disks of species s.
  pure function disks_before(species, s) result(n)
    class(species_t), intent(in) :: species(:)
    integer, intent(in) :: s
    integer :: n

    n = sum(species(:s - 1)%count)
  end function disks_before

  !> Index of the species of each disk, in the order of the ids of the disks.
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
