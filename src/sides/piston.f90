!> A piston: a side with a mass, driven by a constant force and by collisions with disks.
module piston
  use fields, only: fields_t
  use free_flight, only: flight, flight_velocity, time_to_line
  use kinds, only: never, real64
  use side_motion, only: side_motion_t, side_state_t
  use variable_rows, only: choice_t, in_motion, not_negative, positive, variable_t
  implicit none
  private
  public :: choices, piston_t, rows, word

  character(len=*), parameter :: word = "piston"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("motion", word, "The side is a piston of finite mass, accelerated by collisions and by a constant force, which " &
      //"corresponds to a constant pressure. This motion is not available with run.dynamics = 'steps'.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("side", "mass", "real", 1, "required", "10", &
      "Mass of the piston. Gravity does not act on the piston.", &
      positive, "mass", goes_with="motion "//word, may_change=in_motion), &
    variable_t("side", "force", "real", 1, "required", "1", &
      "Constant inward force on the piston. The external pressure is this force divided by the length of the side.", &
      not_negative, "energy/length", goes_with="motion "//word, may_change=in_motion)]

  !> A piston whose `reach` is the width of the box.
  type, extends(side_motion_t) :: piston_t
    real(real64) :: mass = 1.0_real64                !! [mass]
    real(real64) :: pull = 0.0_real64                !! inward acceleration by the force [length/time**2]
  contains
    procedure :: read => read_piston
    procedure :: culprit
    procedure :: moves_permanently
    procedure :: place_at
    procedure :: is_piston
    procedure :: taken_from
    procedure :: leaving_time
    procedure :: local_time
    procedure :: position
    procedure :: velocity
    procedure :: contact_time
    procedure :: innermost_position
    procedure :: highest_speed
  end type piston_t

contains

  !> Reads the mass and the force.
  subroutine read_piston(self, fields, width)
    class(piston_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields
    real(real64), intent(in) :: width                !! distance to the opposite side [length]
    real(real64) :: force

    force = 0
    call fields%read("mass", self%mass)
    call fields%read("force", force)
    self%pull = force/self%mass
    self%reach = width
  end subroutine read_piston

  !> See `side_motion`.
  pure function culprit(self) result(name)
    class(piston_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "position"
  end function culprit

  !> The position of a piston changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(piston_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves_permanently

  !> Lets the piston start at a given displacement.
  pure subroutine place_at(self, x, t)
    class(piston_t), intent(inout) :: self
    real(real64), intent(in) :: x                    !! inward displacement [length]
    real(real64), intent(in) :: t                    !! [time]

    call self%place(x)
  end subroutine place_at

  !> Collisions with disks change the motion of a piston.
  elemental function is_piston(self) result(yes)
    class(piston_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function is_piston

  !> Change of the velocity of the piston in a collision.
  elemental function taken_from(self, change, mass) result(v)
    class(piston_t), intent(in) :: self
    !> Velocity change of the disk if the mass of the piston were infinite [length/time].
    real(real64), intent(in) :: change
    real(real64), intent(in) :: mass                 !! mass of the disk [mass]
    real(real64) :: v                                !! [length/time]

    v = change*mass/(mass + self%mass)
  end function taken_from

  !> Time until the piston has moved by one of the given lengths.
  elemental function leaving_time(self, v, inwards, outwards) result(s)
    class(piston_t), intent(in) :: self
    real(real64), intent(in) :: v                    !! present inward velocity [length/time]
    !> Maximum displacement in each direction, >= 0; `never` for no limit [length].
    real(real64), intent(in) :: inwards, outwards
    real(real64) :: s                                !! [time]

    s = time_to_line(inwards, v, self%pull)
    if (outwards < never) s = min(s, time_to_line(outwards, -v, -self%pull))
  end function leaving_time

  !> Time since the last change of the state of the piston.
  elemental function local_time(self, epoch, t, state) result(tau)
    class(piston_t), intent(in) :: self
    real(real64), intent(in) :: epoch, t             !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: tau                              !! [time]

    tau = t - state%clock
  end function local_time

  !> Inward displacement of the piston.
  elemental function position(self, tau, state) result(x)
    class(piston_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length]

    x = flight(state%position, state%velocity, self%pull, tau)
  end function position

  !> Inward velocity of the piston.
  elemental function velocity(self, tau, state) result(x)
    class(piston_t), intent(in) :: self
    real(real64), intent(in) :: tau                  !! [time]
    type(side_state_t), intent(in) :: state
    real(real64) :: x                                !! [length/time]

    x = flight_velocity(state%velocity, self%pull, tau)
  end function velocity

  !> Time until contact: the gap is a quadratic function of time.
  pure function contact_time(self, tau, gap, v, g, state) result(s)
    class(piston_t), intent(in) :: self
    real(real64), intent(in) :: tau, gap, v, g       !! see `side_motion`
    type(side_state_t), intent(in) :: state
    real(real64) :: s

    s = time_to_line(gap, flight_velocity(state%velocity, self%pull, tau) - v, self%pull - g)
  end function contact_time

  !> Initial displacement of the piston.
  elemental function innermost_position(self) result(x)
    class(piston_t), intent(in) :: self
    real(real64) :: x                                !! [length]

    x = self%offset
  end function innermost_position

  !> Speed of the piston after falling through the whole box.
  elemental function highest_speed(self) result(x)
    class(piston_t), intent(in) :: self
    real(real64) :: x                                !! [length/time]

    x = sqrt(2*abs(self%pull)*self%reach)
  end function highest_speed

end module piston
