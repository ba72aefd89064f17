!> Whom or what a disk meets, as one number: another disk (> 0), a surface of the box (0, -1, -2, -3: the left, right,
!> bottom, top side; -4, -5, ...: an obstacle), or the end of its cell (far below). The event log writes the same numbers.
!> Side k of the box has the code 1 - k; the codes of obstacles follow.
module partners
  use kinds, only: int32
  implicit none
  private
  public :: n_sides, side_name, is_side, is_wall, axis_of, sense_of, crossing, side_crossed, looks_again, nothing
  public :: met_id, most_repeats, repeated, repeats
  public :: obstacle_code, obstacle_number

  integer(int32), parameter :: n_sides = 4
  integer(int32), parameter :: first_crossing = -2000000000
  !> The end of the region that was searched, within a cell; one less if it ends to the right or above.
  integer(int32), parameter :: looks_again = first_crossing - n_sides
  integer(int32), parameter :: nothing = -huge(1_int32)
  integer(int32), parameter :: most_repeats = 11           !! of collisions at one moment that are counted
  integer(int32), parameter :: per_repeat = 2_int32**27    !! larger than any id of a disk
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

  !> The code of the m-th obstacle.
  elemental function obstacle_code(m) result(code)
    integer(int32), intent(in) :: m
    integer(int32) :: code

    code = 1 - n_sides - m
  end function obstacle_code

  !> The number of the obstacle with this code.
  elemental function obstacle_number(code) result(m)
    integer(int32), intent(in) :: code
    integer(int32) :: m

    m = 1 - n_sides - code
  end function obstacle_number

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

  !> The last collision partner `met` of a disk that has hit it as the n-th in a series of collisions that take no time. Such
  !> series are rare: every other collision writes the plain id of the partner.
  elemental function repeated(id, n) result(met)
    integer(int32), intent(in) :: id               !! of the partner, a disk
    integer(int32), intent(in) :: n                !! at most `most_repeats`
    integer(int32) :: met

    met = id + n*per_repeat
  end function repeated

  !> The id of the last collision partner, if it was a disk; else the code of an obstacle, or 0.
  elemental function met_id(met) result(id)
    integer(int32), intent(in) :: met
    integer(int32) :: id

    id = met
    if (met > 0) id = modulo(met, per_repeat)
  end function met_id

  !> The length of the series of collisions at one moment to which the last one belonged.
  elemental function repeats(met) result(n)
    integer(int32), intent(in) :: met
    integer(int32) :: n

    n = max(met, 0_int32)/per_repeat
  end function repeats

end module partners
