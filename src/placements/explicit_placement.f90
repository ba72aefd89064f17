!> Placement at the positions given by the variable `position`.
module explicit_placement
  use fields, only: fields_t
  use kinds, only: int64, real64
  use packing, only: packing_t
  use placement, only: batch_t, placement_t
  use status_line, only: status_line_t
  use variable_rows, only: choice_t, variable_t
  implicit none
  private
  public :: explicit_placement_t, choices, rows, word

  character(len=*), parameter :: word = "explicit"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "The positions are listed in the variable position.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("species", "position", "real", 0, "required", "0.2, 0.5, 0.8, 0.5", &
      "Positions x1, y1, x2, y2, ... of the disks.", unit="length", goes_with="placement "//word)]

  type, extends(placement_t) :: explicit_placement_t
    real(real64), allocatable :: position(:, :)        !! shape (2, count) [length]
  contains
    procedure :: read => read_positions
    procedure :: count_disks
    procedure :: culprit
    procedure :: is_bound
    procedure :: place
  end type explicit_placement_t

contains

  !> Reads the positions.
  subroutine read_positions(self, fields)
    class(explicit_placement_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read("position", self%position)
  end subroutine read_positions

  !> See `placement`.
  pure subroutine count_disks(self, n, variable)
    class(explicit_placement_t), intent(in) :: self
    integer(int64), intent(out) :: n
    character(len=:), allocatable, intent(out) :: variable

    n = size(self%position, 2, kind=int64)
    variable = "position"
  end subroutine count_disks

  !> See `placement`.
  pure function culprit(self) result(name)
    class(explicit_placement_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "position"
  end function culprit

  !> See `placement`.
  pure function is_bound(self) result(yes)
    class(explicit_placement_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function is_bound

  !> Copies the positions.
  subroutine place(self, batch, packing, line, fields)
    class(explicit_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields

    batch%x = self%position
  end subroutine place

end module explicit_placement
