!> What moves. Disks are split by access: a record of one cache line, which every prediction reads, and a tag of half a
!> line, which is needed only when a disk has an event of its own. Each begins with its state, which a checkpoint
!> stores; what follows is derived, and rebuilt at every start.
module disks
  use kinds, only: int16, int32, int64, real64
  implicit none
  private
  public :: disk_t, tag_t, species_t

  !> Position, velocity and clock change only at the disk's own collisions (and when it passes a periodic side); other
  !> disks see it by extrapolation.
  type :: disk_t
    real(real64) :: x(2) = 0.0_real64           !! position at `clock` [length]
    real(real64) :: v(2) = 0.0_real64           !! velocity at `clock` [length/time]
    real(real64) :: clock = 0.0_real64          !! time of the last own collision, since the epoch [time]
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

  !> Disks of one species share what the contact law says of them and, unless a file says otherwise, their mass.
  type :: species_t
    character(len=:), allocatable :: name
    integer :: count = 0
    real(real64) :: mass = 1.0_real64           !! of each disk, or the largest [mass]
  end type species_t

end module disks
