!> Motion of a side of the box, and the time when it touches a disk in free flight. All positions,
!> velocities and accelerations are components along the inward normal of the side. A side without a
!> motion is at rest at the edge of the box.
module side_motion
  use fields, only: fields_t
  use kinds, only: never, real64
  implicit none
  private
  public :: side_motion_t, side_state_t

  !> State of a piston, changed by collisions with disks.
  type :: side_state_t
    !> Inward displacement from the edge of the box, at the time `clock` [length].
    real(real64) :: position = 0.0_real64
    real(real64) :: velocity = 0.0_real64      !! inward velocity at the time `clock` [length/time]
    !> Time to which position and velocity refer, relative to `box%epoch` [time].
    real(real64) :: clock = 0.0_real64
  end type side_state_t

  !> Abstract motion; each kind of motion is an extension in a file of this folder.
  type, abstract :: side_motion_t
    real(real64) :: offset = 0.0_real64        !! inward displacement when the motion starts [length]
    !> Maximum displacement in either direction, if known in advance [length].
    real(real64) :: reach = 0.0_real64
  contains
    procedure(read_motion), deferred :: read
    procedure(culprit), deferred :: culprit
    procedure(local_time), deferred :: local_time
    procedure(value_at), deferred :: position
    procedure(value_at), deferred :: velocity
    procedure(contact_time), deferred :: contact_time
    procedure(length_of), deferred :: innermost_position
    procedure(length_of), deferred :: highest_speed
    procedure :: check
    procedure :: moves
    procedure :: moves_permanently
    procedure :: final_time
    procedure :: final_velocity
    procedure :: stands
    procedure :: continues
    procedure :: place
    procedure :: place_at
    procedure :: is_piston
    procedure :: taken_from
    procedure :: leaving_time
  end type side_motion_t

  abstract interface

    !> Reads the variables of the motion from the group `&side`.
    subroutine read_motion(self, fields, width)
      import :: fields_t, real64, side_motion_t
      class(side_motion_t), intent(inout) :: self
      class(fields_t), intent(inout) :: fields
      real(real64), intent(in) :: width              !! distance to the opposite side [length]
    end subroutine read_motion

    !> Name of the variable that determines how far inwards the side moves.
    pure function culprit(self) result(name)
      import :: side_motion_t
      class(side_motion_t), intent(in) :: self
      character(len=:), allocatable :: name
    end function culprit

    !> Local time of the motion at the time epoch + t of the run. Position and velocity depend on
    !> the local time.
    elemental function local_time(self, epoch, t, state) result(tau)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: epoch, t           !! [time]
      type(side_state_t), intent(in) :: state        !! state of the side if it is a piston
      real(real64) :: tau                            !! [time]
    end function local_time

    !> Inward displacement from the edge of the box [length], or inward velocity [length/time].
    elemental function value_at(self, tau, state) result(x)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! local time of the motion, see `local_time` [time]
      type(side_state_t), intent(in) :: state        !! state of the side if it is a piston
      real(real64) :: x
    end function value_at

    !> Time until the side touches the rim of a disk that moves on a parabola; the result is `never`
    !> if there is no contact.
    pure function contact_time(self, tau, gap, v, g, state) result(s)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! local time from which `s` is counted [time]
      real(real64), intent(in) :: gap      !! gap between the side and the rim of the disk, >= 0 [length]
      real(real64), intent(in) :: v                  !! velocity of the disk [length/time]
      real(real64), intent(in) :: g                  !! acceleration of the disk [length/time**2]
      type(side_state_t), intent(in) :: state        !! state of the side if it is a piston
      real(real64) :: s                              !! [time]
    end function contact_time

    !> Maximum inward displacement from the edge of the box [length], or maximum speed of the side
    !> [length/time]. For a piston, the result is the initial displacement or the speed after a fall
    !> through the box.
    elemental function length_of(self) result(x)
      import :: real64, side_motion_t
      class(side_motion_t), intent(in) :: self
      real(real64) :: x
    end function length_of
  end interface

contains

  !> Checks the values of the variables in `&side`.
  subroutine check(self, fields)
    class(side_motion_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
  end subroutine check

  !> True if the side is not always at the edge of the box.
  elemental function moves(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves

  !> True if the position of the side, and thereby the accessible area, changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function moves_permanently

  !> Time at which a motion of fixed duration ends; `never` for other motions.
  elemental function final_time(self) result(t)
    class(side_motion_t), intent(in) :: self
    real(real64) :: t                                !! time since the start of the run [time]

    t = never
  end function final_time

  !> Inward velocity just before `final_time`.
  elemental function final_velocity(self) result(v)
    class(side_motion_t), intent(in) :: self
    real(real64) :: v                                !! [length/time]

    v = 0
  end function final_velocity

  !> True if the side is permanently at rest, at any position.
  elemental function stands(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function stands

  !> True if a changed motion continues the motion `other` instead of starting anew. Parameters such
  !> as amplitude, period, phase, mass and force may differ.
  pure function continues(self, other) result(yes)
    class(side_motion_t), intent(in) :: self
    class(side_motion_t), intent(in) :: other
    logical :: yes

    yes = same_type_as(self, other)
  end function continues

  !> Sets the displacement of the side at the start of its motion.
  pure subroutine place(self, offset)
    class(side_motion_t), intent(inout) :: self
    real(real64), intent(in) :: offset               !! inward displacement [length]

    self%offset = offset
  end subroutine place

  !> Starts the motion such that the side has a given displacement at a given time. The position of
  !> an oscillating side cannot be chosen.
  pure subroutine place_at(self, x, t)
    class(side_motion_t), intent(inout) :: self
    real(real64), intent(in) :: x                    !! inward displacement [length]
    real(real64), intent(in) :: t                    !! time since the start of the run [time]
  end subroutine place_at

  !> True if the side is a piston, whose motion is changed by collisions with disks.
  elemental function is_piston(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function is_piston

  !> Velocity change of a piston in a collision. The velocity change of the disk is smaller by this
  !> amount than for a piston of infinite mass.
  elemental function taken_from(self, change, mass) result(v)
    class(side_motion_t), intent(in) :: self
    !> Velocity change of the disk if the mass of the piston were infinite [length/time].
    real(real64), intent(in) :: change
    real(real64), intent(in) :: mass                 !! mass of the disk [mass]
    real(real64) :: v                                !! [length/time]

    v = 0
  end function taken_from

  !> Time until a piston has moved inwards or outwards by the given lengths, without a collision.
  elemental function leaving_time(self, v, inwards, outwards) result(s)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: v                    !! present inward velocity [length/time]
    !> Maximum displacement in each direction, >= 0; `never` for no limit [length].
    real(real64), intent(in) :: inwards, outwards
    real(real64) :: s                                !! [time]

    s = never
  end function leaving_time

end module side_motion
