!> Placement at positions from an initial-configuration file, read by `start/starting_disks`.
module file_placement
  use fields, only: fields_t
  use kinds, only: real64
  use packing, only: packing_t
  use placement, only: batch_t, placement_t
  use status_line, only: status_line_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: file_placement_t, choices, word

  character(len=*), parameter :: word = "file"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "The positions are read from the initial-configuration file (file).")]

  type, extends(placement_t) :: file_placement_t
  contains
    procedure :: culprit
    procedure :: is_bound
    procedure :: place
    procedure :: bytes
  end type file_placement_t

contains

  !> See `placement`.
  pure function culprit(self) result(name)
    class(file_placement_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "file"
  end function culprit

  !> See `placement`.
  pure function is_bound(self) result(yes)
    class(file_placement_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function is_bound

  !> Nothing to do: the disks are already at the positions from the file.
  subroutine place(self, batch, packing, line, fields)
    class(file_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
  end subroutine place

  !> See `placement`.
  pure function bytes(self, own_sizes, periods) result(number)
    class(file_placement_t), intent(in) :: self
    logical, intent(in) :: own_sizes
    real(real64), intent(in) :: periods
    real(real64) :: number

    number = 226
  end function bytes

end module file_placement
