!> A side of the box, with its motion.
module box_side
  use kinds, only: never, real64
  use side_motion, only: side_motion_t, side_state_t
  use stroke, only: stroke_t
  implicit none
  private
  public :: side_t

  type :: side_t
    !> Not allocated if the side is at rest at the edge of the box.
    class(side_motion_t), allocatable :: motion
  contains
    procedure :: moves
    procedure :: is_piston
    procedure :: has_stroke
    procedure :: moves_permanently
    procedure :: offset
    procedure :: reach
    procedure :: innermost_position
    procedure :: highest_speed
    procedure :: position
    procedure :: velocity
    procedure :: place
    procedure :: follow
  end type side_t

contains

  !> True if the side is ever away from the edge of the box.
  elemental function moves(self) result(yes)
    class(side_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%motion)
    if (yes) yes = self%motion%moves()
  end function moves

  !> True if the side is a piston, moved by collisions with disks.
  elemental function is_piston(self) result(yes)
    class(side_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%motion)
    if (yes) yes = self%motion%is_piston()
  end function is_piston

  !> True if the side moves by a fixed length known in advance.
  elemental function has_stroke(self) result(yes)
    class(side_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%motion)
    if (yes) yes = self%motion%final_time() < never
  end function has_stroke

  !> True if the position of the side changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(side_t), intent(in) :: self
    logical :: yes

    yes = allocated(self%motion)
    if (yes) yes = self%motion%moves_permanently()
  end function moves_permanently

  !> Inward displacement of the side when its motion starts.
  elemental function offset(self) result(x)
    class(side_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = 0
    if (allocated(self%motion)) x = self%motion%offset
  end function offset

  !> Maximum displacement of the side in either direction, as far as it is known in advance.
  elemental function reach(self) result(x)
    class(side_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = 0
    if (allocated(self%motion)) x = self%motion%reach
  end function reach

  !> Maximum inward displacement of the side; see `side_motion`.
  elemental function innermost_position(self) result(x)
    class(side_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = 0
    if (allocated(self%motion)) x = self%motion%innermost_position()
  end function innermost_position

  !> Maximum speed of the side; see `side_motion`.
  elemental function highest_speed(self) result(speed)
    class(side_t), intent(in) :: self
    real(real64) :: speed                            !! [length/time]

    speed = 0
    if (allocated(self%motion)) speed = self%motion%highest_speed()
  end function highest_speed

  !> Inward displacement of the side at a given time.
  elemental function position(self, epoch, t, state) result(x)
    class(side_t), intent(in) :: self
    real(real64), intent(in) :: epoch                !! time origin [time]
    real(real64), intent(in) :: t                    !! time relative to the time origin [time]
    type(side_state_t), intent(in) :: state          !! state of the side if it is a piston
    real(real64) :: x                                !! [length]

    x = 0
    if (allocated(self%motion)) x = self%motion%position(self%motion%local_time(epoch, t, state), state)
  end function position

  !> Inward velocity of the side at a given time.
  elemental function velocity(self, epoch, t, state) result(v)
    class(side_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t             !! as in `position`
    type(side_state_t), intent(in) :: state          !! as in `position`
    real(real64) :: v                                !! [length/time]

    v = 0
    if (allocated(self%motion)) v = self%motion%velocity(self%motion%local_time(epoch, t, state), state)
  end function velocity

  !> Sets the displacement of the side at the start of its motion. A side at rest away from the edge
  !> of the box is a stroke of zero velocity.
  elemental subroutine place(self, offset)
    class(side_t), intent(inout) :: self
    real(real64), intent(in) :: offset               !! inward displacement [length]

    if (.not. allocated(self%motion)) then
      if (.not. abs(offset) > 0) return
      allocate (stroke_t :: self%motion)
    end if
    call self%motion%place(offset)
  end subroutine place

  !> Starts a new motion of the side at its position before a change. An unchanged motion continues.
  elemental subroutine follow(self, before, x, t)
    class(side_t), intent(inout) :: self
    type(side_t), intent(in) :: before
    real(real64), intent(in) :: x                    !! inward displacement before the change [length]
    real(real64), intent(in) :: t                    !! time of the change since the start of the run [time]

    if (continues(self, before)) then
      call self%place(before%offset())
    else if (allocated(self%motion)) then
      call self%motion%place_at(x, t)
    else
      call self%place(x)
    end if
  end subroutine follow

  !> True if the side continues the motion that it had before a change.
  elemental function continues(after, before) result(yes)
    type(side_t), intent(in) :: after, before
    logical :: yes

    if (allocated(after%motion) .and. allocated(before%motion)) then
      yes = after%motion%continues(before%motion)
    else
      yes = .true.
      if (allocated(after%motion)) yes = after%motion%stands()
      if (allocated(before%motion)) yes = before%motion%stands()
    end if
  end function continues

end module box_side
