!> Whom or what a disk meets, as one number: another disk (> 0), a surface of the box (0, -1, -2, -3: the left, right,
!> bottom, top side; -4, -5, ...: an obstacle), or the end of its cell (far below). The event log writes the same numbers.
!> Surface k of the box has the code 1 - k.
module partners
  use kinds, only: int32
  implicit none
  private
  public :: n_sides, side_name, is_side, is_wall, axis_of, sense_of, crossing, side_crossed, looks_again, nothing

  integer(int32), parameter :: n_sides = 4
  integer(int32), parameter :: first_crossing = -2000000000
  integer(int32), parameter :: looks_again = first_crossing - n_sides      !! the end of what was searched, within a cell
  integer(int32), parameter :: nothing = -huge(1_int32)
  character(len=6), parameter :: side_name(n_sides) = ["left  ", "right ", "bottom", "top   "]

contains

  !> Whether the code, which is not a disk, is a side of the box.
  elemental function is_side(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > -n_sides
  end function is_side

  !> Whether the code, which is not a disk, is a side or an obstacle: not the end of a cell.
  elemental function is_wall(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > first_crossing
  end function is_wall

  !> The axis across a side.
  elemental function axis_of(side) result(axis)
    integer(int32), intent(in) :: side
    integer(int32) :: axis

    axis = 1 - side/2
  end function axis_of

  !> Which way one leaves through a side: +1 right and top, -1 left and bottom.
  elemental function sense_of(side) result(sense)
    integer(int32), intent(in) :: side
    integer(int32) :: sense

    sense = 2*modulo(side, 2) - 1
  end function sense_of

  !> The code of leaving a cell where side `side` would be.
  elemental function crossing(side) result(code)
    integer(int32), intent(in) :: side
    integer(int32) :: code

    code = first_crossing + side
  end function crossing

  !> The side where a disk leaves its cell, from the code of the crossing.
  elemental function side_crossed(code) result(side)
    integer(int32), intent(in) :: code
    integer(int32) :: side

    side = code - first_crossing
  end function side_crossed

end module partners
