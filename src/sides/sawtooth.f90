!> A side that strikes each disk with a constant velocity but stays in place. This is the limit of
!> fast oscillations of small amplitude.
module sawtooth
  use fields, only: fields_t
  use kinds, only: never, real64
  use side_motion, only: side_motion_t, side_state_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: choices, sawtooth_t, word

  character(len=*), parameter :: word = "sawtooth"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("motion", word, "The side stays in place but strikes each disk with a constant velocity: the limit of a fast " &
      //"oscillation with small amplitude.")]

  type, extends(side_motion_t) :: sawtooth_t
    real(real64) :: strike = 0.0_real64              !! inward velocity [length/time]
  contains
    procedure :: read => read_strike
    procedure :: check
    procedure :: culprit
    procedure :: moves
    procedure :: local_time
    procedure :: position
    procedure :: velocity
    procedure :: contact_time
    procedure :: innermost_position
    procedure :: highest_speed
  end type sawtooth_t

contains

  !> Reads the velocity of the side.
  subroutine read_strike(self, fields, width)
    class(sawtooth_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields
    real(real64), intent(in) :: width                !! unused

    call fields%read("velocity", self%strike)
  end subroutine read_strike

  !> Reports a side that does not strike inwards.
  subroutine check(self, fields)
    class(sawtooth_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields

    if (fields%is_sound("velocity") .and. .not. self%strike > 0) call fields%complain("velocity", &
      "must be > 0 with motion = '"//word//"': the side strikes inwards")
  end subroutine check

  !> See `side_motion`.
  pure function culprit(self) result(name)
    class(sawtooth_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "velocity"
  end function culprit

  !> False: the side stays at the edge of the box.
  elemental function moves(self) result(yes)
    class(sawtooth_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function moves

  !> Returns the time unchanged, because position and velocity of the side are constant.
  elemental function local_time(self, epoch, t, state) result(tau)
    class(sawtooth_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t
    type(side_state_t), intent(in) :: state
    real(real64) :: tau

    tau = t
  end function local_time

  !> Zero: the side stays at the edge of the box.
  elemental function position(self, tau, state) result(x)
    class(sawtooth_t), intent(in) :: self
    real(real64), intent(in) :: tau
    type(side_state_t), intent(in) :: state
    real(real64) :: x

    x = 0
  end function position

  !> Velocity with which the side strikes.
  elemental function velocity(self, tau, state) result(x)
    class(sawtooth_t), intent(in) :: self
    real(real64), intent(in) :: tau
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length/time]

    x = self%strike
  end function velocity

  !> Not needed, because the side does not move.
  pure function contact_time(self, tau, gap, v, g, state) result(s)
    class(sawtooth_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap, v, g
    type(side_state_t), intent(in) :: state
    real(real64) :: s

    s = never
  end function contact_time

  !> Zero: the side stays at the edge of the box.
  elemental function innermost_position(self) result(x)
    class(sawtooth_t), intent(in) :: self
    real(real64) :: x

    x = 0
  end function innermost_position

  !> Speed with which the side strikes.
  elemental function highest_speed(self) result(x)
    class(sawtooth_t), intent(in) :: self
    real(real64) :: x                                !! [length/time]

    x = abs(self%strike)
  end function highest_speed

end module sawtooth
