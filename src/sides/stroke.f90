!> A stroke of a side: the side is at rest, moves at a constant velocity, and comes to rest again. A
!> side at rest away from the edge of the box is a stroke of zero velocity.
module stroke
  use fields, only: fields_t
  use free_flight, only: flight, time_to_line
  use kinds, only: never, real64
  use side_motion, only: side_motion_t, side_state_t
  use texts, only: written
  use variable_rows, only: choice_t, in_motion, largest, not_negative, positive, variable_t
  implicit none
  private
  public :: choices, rows, stroke_t, word

  character(len=*), parameter :: word = "constant_velocity"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("motion", word, "The side moves with constant velocity from start_time to end_time, for compressions or " &
      //"expansions, and stands still before and after.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("side", "start_time", "real", 1, "fallback", "0", &
      "Time at which the side starts to move.", not_negative, "time", &
      goes_with="motion "//word, may_change=in_motion), &
    variable_t("side", "end_time", "real", 1, "required", "1", &
      "Time at which the side stops, later than start_time.", positive, "time", &
      goes_with="motion "//word, may_change=in_motion)]

  !> A stroke whose `reach` is the sum of `offset` and the length of its path.
  type, extends(side_motion_t) :: stroke_t
    real(real64) :: speed = 0.0_real64               !! inward velocity [length/time]
    real(real64) :: start_time = 0.0_real64          !! [time]
    real(real64) :: end_time = 0.0_real64            !! [time]
  contains
    procedure :: read => read_stroke
    procedure :: check
    procedure :: culprit
    procedure :: moves_permanently
    procedure :: final_time
    procedure :: final_velocity
    procedure :: stands
    procedure :: continues
    procedure :: place
    procedure :: place_at
    procedure :: local_time
    procedure :: position
    procedure :: velocity
    procedure :: contact_time
    procedure :: innermost_position
    procedure :: highest_speed
  end type stroke_t

contains

  !> Reads the velocity, the start time and the end time.
  subroutine read_stroke(self, fields, width)
    class(stroke_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields
    real(real64), intent(in) :: width                !! unused

    call fields%read("velocity", self%speed)
    call fields%read("start_time", self%start_time)
    call fields%read("end_time", self%end_time)
  end subroutine read_stroke

  !> Reports a stroke that ends before it starts, or is too long.
  subroutine check(self, fields)
    class(stroke_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields

    if (fields%is_sound("end_time") .and. self%end_time <= self%start_time) call fields%complain( &
      "end_time", "is not after start_time, "//written(self%start_time))
    if (self%reach > largest) call fields%complain("end_time", "the side moves as far as "//written(self%reach) &
      //"; allowed: up to "//written(largest))
  end subroutine check

  !> See `side_motion`.
  pure function culprit(self) result(name)
    class(stroke_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "position"
    if (self%speed > 0) name = "end_time"
  end function culprit

  !> The position of the side changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(stroke_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves_permanently

  !> Time when the side stops.
  elemental function final_time(self) result(t)
    class(stroke_t), intent(in) :: self
    real(real64) :: t                                !! [time]

    t = self%end_time
  end function final_time

  !> Inward velocity just before the side stops.
  elemental function final_velocity(self) result(v)
    class(stroke_t), intent(in) :: self
    real(real64) :: v                                !! [length/time]

    v = self%speed
  end function final_velocity

  !> True if the side never moves.
  elemental function stands(self) result(yes)
    class(stroke_t), intent(in) :: self
    logical :: yes

    yes = .not. abs(self%speed) > 0
  end function stands

  !> True if the two strokes are equal, or if neither side ever moves.
  pure function continues(self, other) result(yes)
    class(stroke_t), intent(in) :: self
    class(side_motion_t), intent(in) :: other
    logical :: yes

    yes = self%stands() .and. other%stands()
    select type (other)
    class is (stroke_t)
      yes = yes .or. .not. any(abs([self%speed - other%speed, self%start_time - other%start_time, &
        self%end_time - other%end_time]) > 0)
    end select
  end function continues

  !> Sets the displacement at the start of the stroke.
  pure subroutine place(self, offset)
    class(stroke_t), intent(inout) :: self
    real(real64), intent(in) :: offset               !! inward displacement [length]

    self%offset = offset
    self%reach = abs(offset) + abs(self%speed)*(self%end_time - self%start_time)
  end subroutine place

  !> Starts the stroke such that the side has a given displacement at a given time.
  pure subroutine place_at(self, x, t)
    class(stroke_t), intent(inout) :: self
    real(real64), intent(in) :: x                    !! inward displacement [length]
    real(real64), intent(in) :: t                    !! time since the start of the run [time]

    call self%place(x - self%speed*(min(max(t, self%start_time), self%end_time) - self%start_time))
  end subroutine place_at

  !> Time since the start of the stroke.
  elemental function local_time(self, epoch, t, state) result(tau)
    class(stroke_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t             !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: tau                              !! [time]

    tau = (epoch - self%start_time) + t
  end function local_time

  !> Inward displacement of the side.
  elemental function position(self, tau, state) result(x)
    class(stroke_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length]

    x = self%offset + self%speed*min(max(tau, 0.0_real64), self%end_time - self%start_time)
  end function position

  !> Inward velocity of the side.
  elemental function velocity(self, tau, state) result(x)
    class(stroke_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length/time]

    x = self%speed
    if (tau < 0 .or. tau >= self%end_time - self%start_time) x = 0
  end function velocity

  !> Time until contact, before, during or after the stroke.
  pure function contact_time(self, tau, gap, v, g, state) result(s)
    class(stroke_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap, v, g       !! see `side_motion`
    type(side_state_t), intent(in) :: state
    real(real64) :: s, from, to(3), gap_at
    integer :: k

    to = [-tau, (self%end_time - self%start_time) - tau, never]
    from = 0
    do k = 1, 3
      if (.not. to(k) > from) cycle
      gap_at = gap + (flight(0.0_real64, v, g, from) - (position(self, tau + from, state) - position(self, tau, state)))
      s = from + time_to_line(max(gap_at, 0.0_real64), merge(self%speed, 0.0_real64, k == 2) - (v + g*from), -g)
      if (s <= to(k)) return
      from = to(k)
    end do
    s = never
  end function contact_time

  !> Larger of the inward displacements before and after the stroke.
  elemental function innermost_position(self) result(x)
    class(stroke_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = self%offset + max(0.0_real64, self%speed*(self%end_time - self%start_time))
  end function innermost_position

  !> Speed of the side during the stroke.
  elemental function highest_speed(self) result(x)
    class(stroke_t), intent(in) :: self
    real(real64) :: x                                !! [length/time]

    x = abs(self%speed)
  end function highest_speed

end module stroke
