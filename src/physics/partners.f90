!> Defines integer codes for the partners of a disk in an event. The partner is another disk (> 0), a surface of the box (0, -1, -2,
!> -3 for the left, right, bottom and top side; -4, -5, ... for an obstacle), or the boundary of the cell of the disk (large
!> negative codes). The event log also uses the codes of surfaces, but identifies disks by their ids. Side k of the box has the code
!> 1 - k, and the m-th obstacle has the code -3 - m.
module partners
  use kinds, only: int32
  implicit none
  private
  public :: n_sides, side_name, is_side, is_wall, axis_of, sense_of, crossing, side_crossed, looks_again, nothing
  public :: obstacle_code, obstacle_number

  integer(int32), parameter :: n_sides = 4
  integer(int32), parameter :: first_crossing = -2000000000
  !> Code of an event that requires a new search: the disk leaves the region in which contacts were searched, but stays in its cell.
  !> If the disk leaves the region of the search through its right or upper edge, the code is `looks_again` - 1.
  integer(int32), parameter :: looks_again = first_crossing - n_sides
  integer(int32), parameter :: nothing = -huge(1_int32)
  character(len=6), parameter :: side_name(n_sides) = ["left  ", "right ", "bottom", "top   "]

contains

  !> Whether a code represents a side of the box. The argument `code` must not be positive, because positive values are indices of
  !> disks.
  elemental function is_side(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > -n_sides
  end function is_side

  !> Whether a code represents a side or an obstacle, and not the boundary of a cell. The argument `code` must not be positive,
  !> because positive values are indices of disks.
  elemental function is_wall(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > first_crossing
  end function is_wall

  !> The code of the m-th obstacle.
  elemental function obstacle_code(m) result(code)
    integer(int32), intent(in) :: m
    integer(int32) :: code

    code = 1 - n_sides - m
  end function obstacle_code

  !> The index of the obstacle with the given code.
  elemental function obstacle_number(code) result(m)
    integer(int32), intent(in) :: code
    integer(int32) :: m

    m = 1 - n_sides - code
  end function obstacle_number

  !> The index of the axis that is normal to a side.
  elemental function axis_of(side) result(axis)
    integer(int32), intent(in) :: side
    integer(int32) :: axis

    axis = 1 - side/2
  end function axis_of

  !> Direction of the outward normal of a side along its axis: +1 for the right and top side, -1 for the left and bottom side.
  elemental function sense_of(side) result(sense)
    integer(int32), intent(in) :: side
    integer(int32) :: sense

    sense = 2*modulo(side, 2) - 1
  end function sense_of

  !> The code of the event in which a disk leaves its cell through a face. The left, right, bottom and top faces are identified by
  !> the corresponding side of the box.
  elemental function crossing(side) result(code)
    integer(int32), intent(in) :: side
    integer(int32) :: code

    code = first_crossing + side
  end function crossing

  !> The side of the box in whose direction a disk leaves its cell. The argument is the code of the event in which the disk leaves
  !> its cell: see `crossing`.
  elemental function side_crossed(code) result(side)
    integer(int32), intent(in) :: code
    integer(int32) :: side

    side = code - first_crossing
  end function side_crossed

end module partners
