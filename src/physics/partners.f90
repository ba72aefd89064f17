!> Integer codes for the partner of a disk in an event:
!> - a disk (> 0);
!> - a surface of the box: 0, -1, -2, -3 for the left, right, bottom and top side; -4, -5, ... for
!>   obstacles. These are the boundary ids: side k has the code 1 - k, obstacle m the code -3 - m;
!> - the boundary of the cell of the disk (large negative codes).
!>
!> The event log uses the same boundary ids, but identifies disks by their ids instead of their
!> indices.
module partners
  use kinds, only: int32
  implicit none
  private
  public :: n_sides, side_name, is_side, is_wall, axis_of, sense_of, crossing, side_crossed, looks_again, nothing
  public :: obstacle_code, obstacle_number

  integer(int32), parameter :: n_sides = 4
  integer(int32), parameter :: first_crossing = -2000000000
  !> Code of the event at which a disk leaves the region searched so far, but stays in its cell. Its
  !> contacts must then be searched anew. The code is `looks_again` - 1 if the disk leaves through
  !> the right or upper edge, otherwise `looks_again`.
  integer(int32), parameter :: looks_again = first_crossing - n_sides
  integer(int32), parameter :: nothing = -huge(1_int32)
  character(len=6), parameter :: side_name(n_sides) = ["left  ", "right ", "bottom", "top   "]

contains

  !> True if a code <= 0 represents a side of the box.
  elemental function is_side(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > -n_sides
  end function is_side

  !> True if a code <= 0 represents a side or an obstacle, and not the boundary of a cell.
  elemental function is_wall(code) result(yes)
    integer(int32), intent(in) :: code
    logical :: yes

    yes = code > first_crossing
  end function is_wall

  !> Code of obstacle m.
  elemental function obstacle_code(m) result(code)
    integer(int32), intent(in) :: m
    integer(int32) :: code

    code = 1 - n_sides - m
  end function obstacle_code

  !> Index of the obstacle with the given code.
  elemental function obstacle_number(code) result(m)
    integer(int32), intent(in) :: code
    integer(int32) :: m

    m = 1 - n_sides - code
  end function obstacle_number

  !> Index of the axis normal to a side.
  elemental function axis_of(side) result(axis)
    integer(int32), intent(in) :: side
    integer(int32) :: axis

    axis = 1 - side/2
  end function axis_of

  !> Direction of the outward normal of a side along its axis: +1 for the right and top side, -1 for
  !> the left and bottom side.
  elemental function sense_of(side) result(sense)
    integer(int32), intent(in) :: side
    integer(int32) :: sense

    sense = 2*modulo(side, 2) - 1
  end function sense_of

  !> Code of the event when a disk leaves its cell through the face on the given side (left, right,
  !> bottom or top).
  elemental function crossing(side) result(code)
    integer(int32), intent(in) :: side
    integer(int32) :: code

    code = first_crossing + side
  end function crossing

  !> Side through which a disk leaves its cell, from the code of the event (see `crossing`).
  elemental function side_crossed(code) result(side)
    integer(int32), intent(in) :: code
    integer(int32) :: side

    side = code - first_crossing
  end function side_crossed

end module partners
