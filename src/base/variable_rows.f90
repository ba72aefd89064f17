!> Definitions for the table of all input variables: the types of the rows and of the choices, and
!> the ranges and limits of numbers.
module variable_rows
  use kinds, only: real64
  implicit none
  private

  integer, parameter, public :: name_length = 37, help_length = 1000
  integer, parameter, public :: most_threads = 1024, most_disks = 100000000
  real(real64), parameter, public :: smallest = 1.0e-100_real64    !! smallest absolute value of a nonzero number in the input
  real(real64), parameter, public :: largest = 1.0e100_real64  !! largest absolute value of a number in the input

  !> When a variable may change after the start of a run: never, on `--resume` (if it does not
  !> affect the trajectory), or in a running simulation (if it affects the motion of the disks, but
  !> not their number, properties or initial state).
  character(len=9), parameter, public :: never = "never", on_resume = "on resume", in_motion = "running"

  type, public :: range_t
    real(real64) :: lower, upper             !! smallest and largest allowed value
    character(len=24) :: words
  end type range_t

  !> Groups that describe obstacles.
  character(len=8), parameter, public :: obstacle_groups(2) = [character(len=8) :: "obstacle", "wall"]
  !> Groups that describe boundaries: sides of the box and obstacles. In the reference file they are
  !> commented out.
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
    integer :: size                          !! required number of values; 0 if any number of values is allowed
    character(len=8) :: status               !! a status, as explained at the end of this file
    character(len=24) :: value  !! default or example, as written in an input file
    character(len=help_length) :: help       !! help text in full sentences; the first sentence names the quantity
    type(range_t) :: range = anything        !! range of numbers
    character(len=16) :: unit = ""
    !> Keywords, separated by blanks, that are allowed; empty if any string is allowed. The module
    !> `choices` contains their meanings.
    character(len=240) :: choices = ""
    !> Condition under which the variable has an effect: the name of a second variable, followed by
    !> one or more of its values. Example: "motion sine parabolic" means that the variable applies
    !> only if motion is 'sine' or 'parabolic'.
    character(len=60) :: goes_with = ""
    !> Names of variables in the same group, separated by blanks, that cannot be combined with this
    !> one.
    character(len=80) :: excludes = ""
    character(len=9) :: may_change = never   !! when the value may change after the start of a run
    character(len=100) :: otherwise = ""     !! description of the default if the default is not a constant
  end type variable_t

  !> An allowed keyword of a variable. Variables with the same name in several groups have the same
  !> keywords.
  type, public :: choice_t
    character(len=19) :: name                !! name of the variable
    character(len=17) :: word                !! the keyword
    character(len=300) :: meaning            !! description in one or more full sentences or phrases
  end type choice_t

  ! The status of a variable determines its line in the reference file and the meaning of the
  ! component `value`:
  ! - "default": the default value, which the line contains.
  ! - "fallback": the default value where the variable applies; the line is a comment.
  ! - "example": an example, because a value must be given.
  ! - "required": an example, as a comment; must be given with the choice with which it applies.
  ! - "optional": an example, as a comment; there is no default, and the variable need not be given.

end module variable_rows
