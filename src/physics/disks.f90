!> What moves. The numbers of a disk are kept by access: a record of one cache line, which every prediction reads; a tag of
!> half a line, which is needed only when a disk has an event of its own; and arrays that only some simulations
!> have. What is derived is in no checkpoint: it is rebuilt at every start.
module disks
  use free_flight, only: flight, flight_velocity
  use kinds, only: int16, int32, int64, real64
  implicit none
  private
  public :: disk_t, extra_t, species_t, tag_t, whole_disk_t
  public :: disks_before, land, longest_name, names_of, species_by_id

  !> Position, velocity and clock change only at the disk's own collisions (and when it passes a periodic side); other
  !> disks see it by extrapolation.
  type :: disk_t
    real(real64) :: x(2) = 0.0_real64           !! position at `clock` [length]
    real(real64) :: v(2) = 0.0_real64           !! velocity at `clock` [length/time]
    real(real64) :: clock = 0.0_real64          !! when x and v were set, since the epoch [time]
    real(real64) :: radius = 0.0_real64         !! [length]
    ! Derived: how often x, v have changed in this epoch, which reveals stale events; and the event expected next, written
    ! by the search.
    integer(int32) :: stamp = 0
    integer(int32) :: partner = 0               !! a disk (> 0), or another code of `partners`
    real(real64) :: event_time = 0.0_real64     !! since the epoch [time]
  end type disk_t

  type :: tag_t
    integer(int32) :: species = 1               !! number of the species
    integer(int32) :: id = 0                    !! number in the order of the input file
    integer(int64) :: collisions = 0            !! collisions of any kind since the start of the run
    integer(int32) :: met = 0                   !! what it hit last: id of a disk, or code of an obstacle; else 0
    ! Derived: bookkeeping of search and queue.
    integer(int16) :: cell(2) = 0_int16         !! column and row of the cell grid
    integer(int32) :: window = 0                !! of time in which the queue filed the expected event
    integer(int32) :: partner_stamp = 0         !! the partner's stamp when the event was predicted
  end type tag_t

  integer, parameter :: longest_name = 40            !! of a species

  !> Disks of one species share what the contact law says of them and, unless a file says otherwise, their mass.
  type :: species_t
    character(len=:), allocatable :: name
    integer :: count = 0
    real(real64) :: mass = 1.0_real64           !! of each disk, or the largest [mass]
  end type species_t

  !> Numbers that a disk has only in some simulations: `simulation_state: has_extra`.
  type :: extra_t
    real(real64) :: image(2) = 0.0_real64       !! periods travelled, whole numbers: the true position is x + image*edges
    real(real64) :: last_contact = 0.0_real64   !! time of the last collision since the epoch, for the TC model [time]
    real(real64) :: spin = 0.0_real64           !! angular velocity [1/time]
    real(real64) :: angle = 0.0_real64          !! orientation at `clock`, not wrapped [radian]
  end type extra_t

  !> All numbers of one disk, to be moved as a whole.
  type :: whole_disk_t
    type(disk_t) :: disk
    type(tag_t) :: tag
    real(real64) :: own_mass = 0.0_real64       !! if masses are not those of the species [mass]
    type(extra_t) :: extra
  end type whole_disk_t

contains

  !> Takes a disk to where it is at the time t.
  pure subroutine land(disk, gravity, t)
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: gravity(2), t
    real(real64) :: s

    s = t - disk%clock
    disk%x = flight(disk%x, disk%v, gravity, s)
    disk%v = flight_velocity(disk%v, gravity, s)
    disk%clock = t
    disk%stamp = disk%stamp + 1
  end subroutine land

  !> The names of the species.
  pure function names_of(species) result(names)
    class(species_t), intent(in) :: species(:)
    character(len=longest_name) :: names(size(species))
    integer :: s

    do s = 1, size(species)
      names(s) = species(s)%name
    end do
  end function names_of

  !> How many disks the species before species s have: their ids are the lower ones.
  pure function disks_before(species, s) result(n)
    class(species_t), intent(in) :: species(:)
    integer, intent(in) :: s
    integer :: n

    n = sum(species(:s - 1)%count)
  end function disks_before

  !> Of which species each disk is, by id.
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
