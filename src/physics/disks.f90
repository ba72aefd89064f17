!> What moves. Disks are split by access: a record of one cache line, which every prediction reads, and a tag of half a
!> line, which is needed only when a disk has an event of its own. Each begins with its state, which a checkpoint
!> stores; what follows is derived, and rebuilt at every start.
module disks
  use kinds, only: int16, int32, int64, real64
  implicit none
  private
  public :: disk_t, tag_t, species_t, stamp_of, stamp_after_passing, of_same_collision

  integer, parameter :: pass_bits = 2             !! of a stamp

  !> Position, velocity and clock change only at the disk's own collisions (and when it passes a periodic side); other
  !> disks see it by extrapolation.
  type :: disk_t
    real(real64) :: x(2) = 0.0_real64           !! position at `clock` [length]
    real(real64) :: v(2) = 0.0_real64           !! velocity at `clock` [length/time]
    real(real64) :: clock = 0.0_real64          !! time of the last own collision, since the epoch [time]
    real(real64) :: radius = 0.0_real64         !! [length]
    integer(int32) :: stamp = 0                 !! of the last change of x, v: 0 before the first
    ! Derived: the event expected next, written by the search.
    integer(int32) :: partner = 0               !! a disk (> 0), or another code of `partners`
    real(real64) :: event_time = 0.0_real64     !! since the epoch [time]
  end type disk_t

  type :: tag_t
    integer(int32) :: species = 1               !! number of the species
    integer(int32) :: id = 0                    !! number in the order of the input file
    integer(int64) :: collisions = 0            !! collisions of any kind since the start of the run
    integer(int32) :: obstacle = 0              !! code of the obstacle that it met last, if it has met nothing since; else 0
    ! Derived: bookkeeping of search and queue.
    integer(int16) :: cell(2) = 0_int16         !! column and row of the cell grid
    integer(int32) :: window = 0                !! of time in which the queue filed the expected event
    integer(int32) :: partner_stamp = 0         !! the partner's stamp when the event was predicted
  end type tag_t

  !> Disks of one species share mass and radius.
  type :: species_t
    character(len=:), allocatable :: name
    integer :: count = 0
    real(real64) :: mass = 1.0_real64           !! [mass]
    real(real64) :: radius = 0.0_real64         !! [length]
  end type species_t

contains

  !> The stamp of all that takes part in a collision: its number, modulo 2**30. Stamps are compared for equality only.
  !> A stamp that a prediction has noted is the partner's still if the partner has not changed: everything is predicted
  !> again after an epoch, which has fewer collisions than that.
  elemental function stamp_of(collision) result(stamp)
    integer(int64), intent(in) :: collision     !! its number, from 1
    integer(int32) :: stamp

    stamp = ishft(int(iand(collision, 2_int64**30 - 1), int32), pass_bits)
  end function stamp_of

  !> The stamp of a disk that has passed a periodic side: the collision stays the same.
  elemental function stamp_after_passing(stamp) result(after)
    integer(int32), intent(in) :: stamp
    integer(int32) :: after

    after = stamp
    call mvbits(ibits(stamp, 0, pass_bits) + 1, 0, pass_bits, after, 0)
  end function stamp_after_passing

  !> Whether the last collision of two disks was one and the same, if their clocks are equal, too: for others to look like
  !> that, 2**30 collisions would have to happen at one moment. 0 is the number of none.
  elemental function of_same_collision(stamp, other) result(yes)
    integer(int32), intent(in) :: stamp, other
    logical :: yes

    yes = ishft(ieor(stamp, other), -pass_bits) == 0 .and. ishft(stamp, -pass_bits) /= 0
  end function of_same_collision

end module disks
