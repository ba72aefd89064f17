!> Row types of the table of input variables and of their keywords, and the ranges of numbers.
module variable_rows
  use kinds, only: real64
  implicit none
  private

  integer, parameter, public :: name_length = 37, help_length = 1000
  integer, parameter, public :: most_threads = 1024, most_disks = 100000000
  !> Smallest absolute value of a nonzero number in the input.
  real(real64), parameter, public :: smallest = 1.0e-100_real64
  !> Largest absolute value of a number in the input.
  real(real64), parameter, public :: largest = 1.0e100_real64

  !> When a variable may change after the start of a run: never, on `--resume`, or while the
  !> simulation is running. Variables that do not affect the trajectory may change on `--resume`. A
  !> running simulation accepts changes of variables that affect the motion of the disks, but not of
  !> their number, properties or initial state.
  character(len=9), parameter, public :: at_no_time = "never", on_resume = "on resume", in_motion = "running"

  type, public :: range_t
    real(real64) :: lower, upper             !! smallest and largest allowed value
    character(len=24) :: words
  end type range_t

  !> Input groups of obstacles.
  character(len=8), parameter, public :: obstacle_groups(2) = [character(len=8) :: "obstacle", "wall"]
  !> Input groups of boundaries: sides of the box and obstacles. The reference file contains these
  !> groups as comments.
  character(len=8), parameter, public :: wall_groups(*) = [character(len=8) :: "side", obstacle_groups]

  type(range_t), parameter, public :: anything = range_t(-largest, largest, "")
  type(range_t), parameter, public :: positive = range_t(smallest, largest, "> 0")
  type(range_t), parameter, public :: not_negative = range_t(0, largest, ">= 0")
  type(range_t), parameter, public :: number_of_threads = range_t(0, most_threads, "from 0 to 1024")
  type(range_t), parameter, public :: unit_interval = range_t(0, 1, "from 0 to 1")
  type(range_t), parameter, public :: fraction = range_t(smallest, nearest(1.0_real64, -1.0), "> 0 and < 1")
  type(range_t), parameter, public :: part_of_all = range_t(smallest, 1, "> 0 and <= 1")
  type(range_t), parameter, public :: energy_left = range_t(1.0e-12_real64, fraction%upper, ">= 1e-12 and < 1")
  type(range_t), parameter, public :: spread_of_radii = range_t(0, fraction%upper, ">= 0 and < 1")
  type(range_t), parameter, public :: tangential = range_t(-1, 1, "from -1 to 1")
  type(range_t), parameter, public :: first_angle = range_t(-360, 360, "from -360 to 360")
  type(range_t), parameter, public :: last_angle = range_t(-360, 720, "from -360 to 720")
  type(range_t), parameter, public :: moment = range_t(smallest, 1, "> 0 and <= 1")
  type(range_t), parameter, public :: number_of_sweeps = range_t(0, 1.0e9_real64, "from 0 to 1000000000")
  type(range_t), parameter, public :: per_decade = range_t(1, 1000, "from 1 to 1000")
  type(range_t), parameter, public :: count_of_disks = range_t(1, most_disks, "from 1 to 100000000")

  type, public :: variable_t
    character(len=8) :: group
    character(len=name_length) :: name
    character(len=8) :: kind                 !! type of the values, 'integer', 'real', 'logical' or 'text'
    integer :: size                          !! required number of values; 0 allows any number
    character(len=8) :: status               !! one of the keywords explained at the end of this file
    character(len=24) :: value  !! default or example, as in an input file
    !> Help text in full sentences, beginning with the name of the quantity.
    character(len=help_length) :: help
    type(range_t) :: range = anything        !! range of numbers
    character(len=16) :: unit = ""
    !> Allowed keywords, separated by blanks; empty if any string is allowed. The meanings of the
    !> keywords are in the module `choices`.
    character(len=240) :: choices = ""
    !> Condition under which the variable has an effect: the name of another variable, followed by
    !> one or more of its values. For example, "motion sine parabolic" limits a variable to the
    !> motions 'sine' and 'parabolic'.
    character(len=60) :: goes_with = ""
    !> Names of variables of the same group, separated by blanks, that exclude this variable.
    character(len=80) :: excludes = ""
    !> When the value may change: `at_no_time`, `on_resume` or `in_motion`.
    character(len=9) :: may_change = at_no_time
    character(len=100) :: otherwise = ""     !! description of a default that is not a constant
  end type variable_t

  !> An allowed keyword of a variable. Variables of the same name in different groups have the same
  !> keywords.
  type, public :: choice_t
    character(len=19) :: name                !! name of the variable
    character(len=17) :: word                !! keyword
    character(len=300) :: meaning            !! meaning of the keyword, in full sentences or phrases
  end type choice_t

  ! The status of a variable determines its line in the reference file and the meaning of `value`:
  ! - "default": the line contains the default value.
  ! - "fallback": the line is a comment. It contains the default that the variable has with the
  !   choice to which it belongs.
  ! - "example": the line contains an example, because every input must set the variable.
  ! - "required": the line is a comment with an example. The choice to which the variable belongs
  !   requires a value.
  ! - "optional": the line is a comment with an example; there is no default, and no value is
  !   required.

end module variable_rows
