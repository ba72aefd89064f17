!> Motion of a side of the box, and the time at which it touches a disk in free flight. All positions, velocities and accelerations
!> are components along the inner normal of the side. A side without a motion stands still at the edge of the box.
module side_motion
  use fields, only: fields_t
  use kinds, only: never, real64
  implicit none
  private
  public :: side_motion_t, side_state_t

  !> The state of a piston. Collisions with disks change the state.
  type :: side_state_t
    real(real64) :: position = 0.0_real64      !! displacement inwards from the edge of the box, at the time `clock` [length]
    real(real64) :: velocity = 0.0_real64      !! velocity inwards, at the time `clock` [length/time]
    real(real64) :: clock = 0.0_real64         !! time of position and velocity, relative to `box%epoch` [time]
  end type side_state_t

  !> Each kind of motion is an extension of this type in a file of this folder.
  type, abstract :: side_motion_t
    real(real64) :: offset = 0.0_real64        !! displacement inwards of the side at the start of its motion [length]
    real(real64) :: reach = 0.0_real64         !! largest displacement, inwards or outwards, that is foreseen [length]
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

    !> Reads the variables of a kind of motion from the group `&side`.
    subroutine read_motion(self, fields, width)
      import :: fields_t, real64, side_motion_t
      class(side_motion_t), intent(inout) :: self
      class(fields_t), intent(inout) :: fields
      real(real64), intent(in) :: width              !! distance between the side and the opposite side [length]
    end subroutine read_motion

    !> Name of the variable that determines how far inwards the side moves.
    pure function culprit(self) result(name)
      import :: side_motion_t
      class(side_motion_t), intent(in) :: self
      character(len=:), allocatable :: name
    end function culprit

    !> Local time of the motion at the time epoch + t of the run, from which position and velocity follow.
    elemental function local_time(self, epoch, t, state) result(tau)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: epoch, t           !! [time]
      type(side_state_t), intent(in) :: state        !! state of the side, if it is a piston
      real(real64) :: tau                            !! [time]
    end function local_time

    !> Displacement inwards from the edge of the box [length], or velocity inwards [length/time].
    elemental function value_at(self, tau, state) result(x)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! time as returned by `local_time` [time]
      type(side_state_t), intent(in) :: state        !! state of the side, if it is a piston
      real(real64) :: x
    end function value_at

    !> Time until the side touches the boundary of a disk on a parabolic path; the result is `never` if
    !> there is no contact.
    pure function contact_time(self, tau, gap, v, g, state) result(s)
      import :: real64, side_motion_t, side_state_t
      class(side_motion_t), intent(in) :: self
      real(real64), intent(in) :: tau                !! local time from which the result `s` is measured [time]
      real(real64), intent(in) :: gap                !! gap between the side and the boundary of the disk, not negative [length]
      real(real64), intent(in) :: v                  !! velocity of the disk [length/time]
      real(real64), intent(in) :: g                  !! acceleration of the disk [length/time**2]
      type(side_state_t), intent(in) :: state        !! state of the side, if it is a piston
      real(real64) :: s                              !! [time]
    end function contact_time

    !> Largest inward displacement from the edge of the box [length], or highest speed of the side [length/time]; for a piston, the
    !> initial displacement and the speed after a fall through the box.
    elemental function length_of(self) result(x)
      import :: real64, side_motion_t
      class(side_motion_t), intent(in) :: self
      real(real64) :: x
    end function length_of
  end interface

contains

  !> Checks the values of the variables of `&side`.
  subroutine check(self, fields)
    class(side_motion_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
  end subroutine check

  !> Whether the position of the side changes at any time, or differs from the edge of the box.
  elemental function moves(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves

  !> Whether the position of the side, and therefore the accessible area, changes permanently.
  elemental function moves_permanently(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function moves_permanently

  !> Time at which a motion of fixed duration ends; `never` for all other motions.
  elemental function final_time(self) result(t)
    class(side_motion_t), intent(in) :: self
    real(real64) :: t                                !! time since the start of the run [time]

    t = never
  end function final_time

  !> Velocity inwards just before `final_time`.
  elemental function final_velocity(self) result(v)
    class(side_motion_t), intent(in) :: self
    real(real64) :: v                                !! [length/time]

    v = 0
  end function final_velocity

  !> Whether the side stands still at any position.
  elemental function stands(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function stands

  !> Whether a changed motion continues the motion `other` instead of beginning anew. Values such as amplitude, period, phase, mass
  !> and force may differ.
  pure function continues(self, other) result(yes)
    class(side_motion_t), intent(in) :: self
    class(side_motion_t), intent(in) :: other
    logical :: yes

    yes = same_type_as(self, other)
  end function continues

  !> Sets the displacement of the side at the start of its motion.
  pure subroutine place(self, offset)
    class(side_motion_t), intent(inout) :: self
    real(real64), intent(in) :: offset               !! displacement inwards [length]

    self%offset = offset
  end subroutine place

  !> Lets a motion begin such that the side has a given displacement at a given time. The position of an oscillating side cannot be
  !> chosen.
  pure subroutine place_at(self, x, t)
    class(side_motion_t), intent(inout) :: self
    real(real64), intent(in) :: x                    !! displacement inwards [length]
    real(real64), intent(in) :: t                    !! time since the start of the run [time]
  end subroutine place_at

  !> Whether the side is a piston, whose motion collisions with disks change.
  elemental function is_piston(self) result(yes)
    class(side_motion_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function is_piston

  !> Change of the velocity of a piston in a collision, by which the velocity of the disk changes less than at a piston of infinite
  !> mass.
  elemental function taken_from(self, change, mass) result(v)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: change               !! change of the velocity of the disk at infinite mass [length/time]
    real(real64), intent(in) :: mass                 !! mass of the disk [mass]
    real(real64) :: v                                !! [length/time]

    v = 0
  end function taken_from

  !> Time until a piston has moved by given lengths inwards or outwards, without a collision.
  elemental function leaving_time(self, v, inwards, outwards) result(s)
    class(side_motion_t), intent(in) :: self
    real(real64), intent(in) :: v                    !! present velocity inwards [length/time]
    real(real64), intent(in) :: inwards, outwards    !! not negative; `never` if a length does not matter [length]
    real(real64) :: s                                !! [time]

    s = never
  end function leaving_time

end module side_motion
