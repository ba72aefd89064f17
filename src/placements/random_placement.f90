!> Placement by random sequential insertion (see `random_insertion`).
module random_placement
  use box_state, only: centre_range
  use fields, only: fields_t
  use kinds, only: int32, pi, real64
  use packing, only: packing_t
  use placement, only: batch_t, by_size, placement_t, stream_number
  use random_insertion, only: insert_at_random, largest_first
  use random_stream, only: random_stream_t
  use status_line, only: status_line_t
  use texts, only: written
  use variable_rows, only: choice_t
  implicit none
  private
  public :: random_placement_t, choices, word

  character(len=*), parameter :: word = "random"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "Random sequential insertion: uniformly distributed positions without overlaps, up to a " &
      //"packing fraction of about 0.54.")]

  !> Maximum number of attempts to place a species, multiplied by the number of its disks.
  integer(int32), parameter :: many_trials = 500000
  !> If an attempt placed n disks, another attempt is expected to place at most nearly*n + few.
  integer(int32), parameter :: few = 5
  real(real64), parameter :: nearly = 1.25_real64  !! factor of n in this estimate
  !> Minimum ratio between the packing fractions that 'dense' and 'random' placement can reach.
  real(real64), parameter :: denser = 1.5_real64
  !> Packing fraction at which random sequential insertion saturates.
  real(real64), parameter :: saturation = 0.547_real64

  type, extends(placement_t) :: random_placement_t
  contains
    procedure :: turn
    procedure :: shortfall
    procedure :: place
    procedure :: bytes
  end type random_placement_t

contains

  !> See `placement`.
  pure function turn(self)
    class(random_placement_t), intent(in) :: self
    integer :: turn

    turn = by_size
  end function turn

  !> See `placement`.
  pure function shortfall(self, packing_fraction) result(text)
    class(random_placement_t), intent(in) :: self
    real(real64), intent(in) :: packing_fraction
    character(len=:), allocatable :: text

    text = ""
    if (packing_fraction > saturation) text = "random placement reaches "//written(saturation)//", placement = 'dense' more"
  end function shortfall

  !> Inserts the disks into the packing.
  subroutine place(self, batch, packing, line, fields)
    class(random_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
    type(random_stream_t) :: stream
    real(real64) :: lower(2), upper(2)
    integer(int32) :: placed, trial, count

    count = size(batch%radius, kind=int32)
    call stream%seed(batch%seed, [int(batch%number), stream_number])
    call centre_range(batch%region, packing%box, batch%largest_radius, lower, upper)
    ! The number of disks that fit varies between attempts. A species of few disks is tried more
    ! often, because its number of fitting disks varies more, relative to the mean.
    do trial = 1, merge(1, max(1, many_trials/count), minval(batch%radius) < maxval(batch%radius))
      call packing%open_species(batch%number, batch%largest_radius, count, lower, upper)
      call insert_at_random(packing, batch%number, batch%first, batch%radius, stream, line, placed)
      batch%is_packed = placed == count
      if (batch%is_packed) return
      if (placed == 0 .or. count > nearly*placed + few) exit  ! another attempt is unlikely to place all disks
    end do
    call fields%complain("placement", failure(batch, placed))
  end subroutine place

  !> Message about disks that could not be placed.
  pure function failure(batch, placed) result(text)
    type(batch_t), intent(in) :: batch
    integer(int32), intent(in) :: placed       !! number of disks placed
    character(len=:), allocatable :: text
    ! area of each disk divided by the area of the region, in the order of placement
    real(real64), allocatable :: part(:)

    allocate (part(size(batch%radius)))
    part = pi*batch%radius(largest_first(batch%radius))**2/product(batch%region([2, 4]) - batch%region([1, 3]))
    text = "no more room after "//written(placed)//" of "//written(size(batch%radius))//" random disks: reached " &
      //written(sum(part(:placed)))//" of the wanted packing "//written(sum(part))//"; "
    if (sum(part) < denser*sum(part(:placed))) then
      text = text//"use placement = 'dense'"
    else
      text = text//"use fewer or smaller disks"
    end if
  end function failure

  !> See `placement`.
  pure function bytes(self, own_sizes, periods) result(number)
    class(random_placement_t), intent(in) :: self
    logical, intent(in) :: own_sizes
    real(real64), intent(in) :: periods
    real(real64) :: number

    number = merge(150, 166, own_sizes)
  end function bytes

end module random_placement
