!> Methods for generating the initial positions of disks. Each method is an extension of the
!> abstract type `placement_t`, in a file of this folder.
module placement
  use disks, only: species_t
  use fields, only: fields_t
  use kinds, only: int32, int64, real64
  use packing, only: packing_t
  use status_line, only: status_line_t
  implicit none
  private
  public :: batch_t, placement_t

  !> Stages of the placement. Species `by_input` are placed first, in the order of the input.
  !> Species `by_size` follow, in the order of decreasing radius. Finally species are placed
  !> `in_batches`, each of which may contain several species.
  integer, parameter, public :: by_input = 1, by_size = 2, in_batches = 3
  !> Key of the random streams of placements.
  integer, parameter, public :: stream_number = 1

  !> Disks placed in one call. The disks belong to one species or, for a placement `in_batches`, to
  !> all species with this placement and the same region.
  type :: batch_t
    type(species_t), allocatable :: species(:)
    integer(int32) :: number = 0               !! index of the first of these species in the input
    integer(int32) :: first = 0                !! index of the first disk of this species
    integer(int64) :: seed = 0                 !! seed of the run
    real(real64) :: region(4) = 0.0_real64     !! xlo, xhi, ylo, yhi [length]
    real(real64) :: largest_radius = 0.0_real64         !! largest radius of the first species [length]
    real(real64), allocatable :: radius(:)     !! radii of the disks [length]
    !> Positions; shape (2, n) [length]. Before the placement, these are positions from an
    !> initial-configuration file, or the shape is (2,0).
    real(real64), allocatable :: x(:, :)
    logical :: is_packed = .false.      !! whether the placement has already added the disks to the packing
  end type batch_t

  type, abstract :: placement_t
  contains
    procedure(place), deferred :: place
    procedure :: read => read_nothing
    procedure :: count_disks
    procedure :: turn
    procedure :: culprit
    procedure :: is_bound
    procedure :: shortfall
    procedure :: starting_scale
    procedure :: moves_all_disks
    procedure :: conflict
    procedure :: bytes
  end type placement_t

  abstract interface

    !> Determines the positions of the disks of a batch, or reports why they cannot be placed.
    subroutine place(self, batch, packing, line, fields)
      import :: batch_t, fields_t, packing_t, placement_t, status_line_t
      class(placement_t), intent(in) :: self
      type(batch_t), intent(inout) :: batch
      type(packing_t), intent(inout) :: packing        !! disks placed earlier, in their box
      class(status_line_t), intent(inout) :: line      !! status line for the progress
      class(fields_t), intent(inout) :: fields         !! group of the first species; collects the problems
    end subroutine place
  end interface

contains

  !> Reads the variables of the placement from the group `&species`.
  subroutine read_nothing(self, fields)
    class(placement_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields
  end subroutine read_nothing

  !> Number of disks implied by a variable of the placement, such as a list of positions, and the
  !> name of this variable.
  pure subroutine count_disks(self, n, variable)
    class(placement_t), intent(in) :: self
    integer(int64), intent(out) :: n           !! 0 if no variable determines the number
    character(len=:), allocatable, intent(out) :: variable

    n = 0
    variable = ""
  end subroutine count_disks

  !> Stage in which a species is placed: `by_input`, `by_size` or `in_batches`.
  pure function turn(self)
    class(placement_t), intent(in) :: self
    integer :: turn

    turn = by_input
  end function turn

  !> Name of the variable with which the user can correct the position of a disk.
  pure function culprit(self) result(name)
    class(placement_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "placement"
  end function culprit

  !> True if the placement itself keeps the disks in their region. Positions given in the input may
  !> be anywhere.
  pure function is_bound(self) result(yes)
    class(placement_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function is_bound

  !> Explains in a message why the placement cannot reach a packing fraction; empty if it can.
  pure function shortfall(self, packing_fraction) result(text)
    class(placement_t), intent(in) :: self
    real(real64), intent(in) :: packing_fraction
    character(len=:), allocatable :: text

    text = ""
  end function shortfall

  !> Factor by which disks are shrunk when positions from an initial-configuration file are tested.
  !> The shrunk disks must not overlap.
  pure function starting_scale(self) result(scale)
    class(placement_t), intent(in) :: self
    real(real64) :: scale

    scale = 1
  end function starting_scale

  !> True if the placement moves all disks of the run. All species must then have this placement and
  !> the whole box as their region. The option --check skips such a placement, because it may take
  !> long.
  pure function moves_all_disks(self) result(yes)
    class(placement_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function moves_all_disks

  !> Explains in a message why a group or variable cannot be combined with the placement; empty if
  !> it can.
  pure function conflict(self, variable) result(reason)
    class(placement_t), intent(in) :: self
    character(len=*), intent(in) :: variable
    character(len=:), allocatable :: reason

    reason = ""
  end function conflict

  !> Memory during the placement in bytes per disk, without optional data.
  pure function bytes(self, own_sizes, periods) result(number)
    class(placement_t), intent(in) :: self
    logical, intent(in) :: own_sizes           !! whether masses or radii differ within a species
    !> Memory for the image counters of a disk; 0 if the box is not periodic [bytes].
    real(real64), intent(in) :: periods
    real(real64) :: number

    number = 150
  end function bytes

end module placement
