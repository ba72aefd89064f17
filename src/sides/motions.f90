!> List of all motions of a side: their keywords in the input, their types, and their variables in
!> the group `&side`. A new motion requires a file in this folder and a line in each list of this
!> module.
module motions
  use parabolic, only: parabolic_t, parabolic_choices => choices, parabolic_word => word
  use piston, only: piston_t, piston_choices => choices, piston_rows => rows, piston_word => word
  use sawtooth, only: sawtooth_t, sawtooth_choices => choices, sawtooth_word => word
  use side_motion, only: side_motion_t
  use sine, only: sine_t, sine_choices => choices, sine_word => word
  use stroke, only: stroke_t, stroke_choices => choices, stroke_rows => rows, stroke_word => word
  use variable_rows, only: choice_t, in_motion, positive, unit_interval, variable_t
  implicit none
  private
  public :: choose_motion, motion_choices, motion_rows, pistons

  character(len=*), parameter :: still_word = "still"
  !> Keywords of the motions, separated by blanks: oscillations, motions with a `position`, motions
  !> with a `velocity`, all motions, and pistons.
  character(len=*), parameter :: oscillations = sine_word//" "//parabolic_word
  character(len=*), parameter :: with_position = still_word//" "//stroke_word//" "//piston_word
  character(len=*), parameter :: with_velocity = sawtooth_word//" "//stroke_word
  character(len=*), parameter :: words = still_word//" "//oscillations//" "//with_velocity//" "//piston_word
  character(len=*), parameter :: pistons = piston_word

  type(choice_t), parameter :: motion_choices(*) = [ &
    choice_t("motion", still_word, "The side does not move."), &
    sine_choices, parabolic_choices, sawtooth_choices, stroke_choices, piston_choices]

  type(variable_t), parameter :: motion_rows(*) = [ &
    variable_t("side", "motion", "text", 1, "default", "'"//still_word//"'", &
      "Motion of the side along its normal. The work of a moving side on the disks is an observable. In a running simulation " &
      //"a side begins a new motion at its present position; variables that do not exist for the new motion are dropped, " &
      //"unless the same change sets them.", choices=words, may_change=in_motion), &
    variable_t("side", "amplitude", "real", 1, "required", "0.05", &
      "Amplitude of the oscillation: largest displacement of the side from its mean position, given by box.lower or " &
      //"box.upper.", &
      positive, "length", goes_with="motion "//oscillations, may_change=in_motion), &
    variable_t("side", "period", "real", 1, "required", "1", &
      "Period of the oscillation.", positive, "time", goes_with="motion "//oscillations, may_change=in_motion), &
    variable_t("side", "phase", "real", 1, "fallback", "0", &
      "Phase of the oscillation at t = 0, in units of the period. With phase = 0 the side starts at its mean position and " &
      //"moves inwards.", unit_interval, goes_with="motion "//oscillations, may_change=in_motion), &
    variable_t("side", "position", "real", 1, "optional", "1", &
      "Initial coordinate of the moving side: x of the left or right side, y of the bottom or top side.", &
      unit="length", goes_with="motion "//with_position, &
      otherwise="the coordinate in box.lower or box.upper"), &
    variable_t("side", "velocity", "real", 1, "required", "1", &
      "Velocity of the side, positive inwards. With motion = 'sawtooth' the side strikes disks with this velocity, which must be " &
      //"greater than 0. With motion = 'constant_velocity' negative values move the side outwards.", unit="length/time", &
      goes_with="motion "//with_velocity, may_change=in_motion), &
    stroke_rows, piston_rows]

contains

  !> Creates the motion for a keyword; for 'still' the result is not allocated.
  subroutine choose_motion(word, motion)
    character(len=*), intent(in) :: word
    class(side_motion_t), allocatable, intent(out) :: motion

    select case (word)
    case (sine_word)
      allocate (sine_t :: motion)
    case (parabolic_word)
      allocate (parabolic_t :: motion)
    case (sawtooth_word)
      allocate (sawtooth_t :: motion)
    case (stroke_word)
      allocate (stroke_t :: motion)
    case (piston_word)
      allocate (piston_t :: motion)
    case default                                     ! the side is at rest
    end select
  end subroutine choose_motion

end module motions
