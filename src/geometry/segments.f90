!> Straight walls between two points, impenetrable from both sides. Disks also collide with the ends
!> of a wall.
!>
!> A disk touches a wall when its centre reaches the stadium around the wall. The stadium consists
!> of two straight sides, parallel to the wall at a distance of one disk radius, and of two half
!> circles about the ends. The stadium is convex, so the centre of a disk can reach a straight side
!> only from outside. If rounding errors hide a contact with a straight side near an end of the
!> wall, the contact with the half circle is found instead.
module segments
  use free_flight, only: flight, time_to_circle, time_to_line
  use kinds, only: never, real64
  use shapes, only: shape_t, spare, unit_vector
  implicit none
  private
  public :: segment_t, new_segment

  type, extends(shape_t) :: segment_t
    real(real64) :: half(2) = 0.0_real64      !! vector from the middle of the wall to its second end [length]
    real(real64) :: along(2) = [1.0_real64, 0.0_real64]   !! unit vector along the wall
    real(real64) :: length = 0.0_real64         !! half the length of the wall [length]
  contains
    procedure :: direction
    procedure :: contact_time
    procedure :: gap
    procedure :: normal
    procedure :: reaches
    procedure :: covers
    procedure :: misfit
    procedure, private :: from_outline
  end type segment_t

contains

  !> Creates the straight wall between two points.
  pure function new_segment(from, to) result(segment)
    real(real64), intent(in) :: from(2), to(2)  !! [length]
    type(segment_t) :: segment

    segment%middle = 0.5_real64*(from + to)
    segment%half = 0.5_real64*(to - from)
    segment%extent = abs(segment%half)
    segment%length = sqrt(dot_product(segment%half, segment%half))
    segment%circumradius = segment%length
    if (segment%length > 0) segment%along = segment%half/segment%length
  end function new_segment

  !> Tangential velocity of the surface at a point of contact, for a surface that moves along the
  !> wall with unit speed. The velocity is the unit vector along the wall, without its component
  !> along the surface normal. At the ends of the wall the surface therefore moves more slowly than
  !> between them.
  pure function direction(self, d, normal) result(along)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    real(real64), intent(in) :: normal(2)
    real(real64) :: along(2)

    along = self%along - dot_product(self%along, normal)*normal
  end function direction

  !> Time until a disk touches the wall.
  pure function contact_time(self, d, v, g, radius, within) result(s)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2), v(2), g(2), radius
    real(real64), intent(in), optional :: within
    real(real64) :: s, across(2)
    integer :: side

    s = min(time_to_circle(d - self%half, v, g, radius, .false., within), &
      time_to_circle(d + self%half, v, g, radius, .false., within))
    do side = -1, 1, 2
      across = side*[-self%along(2), self%along(1)]
      s = min(s, time_to_side())
    end do

  contains

    !> Time until the centre of a disk reaches the straight side of the stadium in the direction
    !> `across`. The result is `never` if the centre passes beyond an end of the wall. The distance
    !> is a quadratic function of time, so the side is reached from outside at most once.
    pure function time_to_side() result(t)
      real(real64) :: t, away, speed, fall, disc

      away = dot_product(d, across) - radius
      speed = -dot_product(v, across)             ! both `speed` and `fall` are positive towards the wall
      fall = -dot_product(g, across)
      if (away > -radius .and. abs(dot_product(d, self%along)) <= self%length) away = max(away, 0.0_real64)
      t = never
      if (away >= 0) then
        t = time_to_line(away, speed, fall)
      else if (fall > 0 .and. speed < 0) then     ! rising beyond an end of the wall; may fall back onto it
        disc = speed**2 + 2*fall*away
        if (disc >= 0) t = (sqrt(disc) - speed)/fall
      end if
      if (.not. t < never) return
      if (abs(dot_product(flight(d, v, g, t), self%along)) > self%length) t = never
    end function time_to_side
  end function contact_time

  !> Vector from the nearest point of the wall to a point.
  pure function from_outline(self, d) result(offset)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    real(real64) :: offset(2), place

    place = dot_product(d, self%along)
    offset = d - min(max(place, -self%length), self%length)*self%along
  end function from_outline

  !> Minimum distance between the wall and the rim of a disk.
  pure function gap(self, d, radius) result(length)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2), radius
    real(real64) :: length, offset(2)

    offset = self%from_outline(d)
    length = sqrt(dot_product(offset, offset)) - radius
  end function gap

  !> Unit vector from the point of contact on the wall to the centre of the touching disk. Between
  !> the ends this vector is exactly the normal of the wall, without rounding errors even for very
  !> small disks. `heading` matters only at an end of the wall; elsewhere a disk touches the wall at
  !> one point.
  pure function normal(self, d, heading) result(direction)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    real(real64), intent(in), optional :: heading(2)
    real(real64) :: direction(2)

    if (abs(dot_product(d, self%along)) <= self%length) then
      direction = [-self%along(2), self%along(1)]
      direction = sign(1.0_real64, dot_product(d, direction))*direction
    else
      direction = unit_vector(self%from_outline(d), heading)
    end if
  end function normal

  !> True if a disk centred in a rectangle can touch the wall. The test looks for a separating axis,
  !> with the disk replaced by a square of the same width.
  pure function reaches(self, d, half, radius) result(yes)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    real(real64) :: across(2), room(2)
    logical :: yes

    across = [-self%along(2), self%along(1)]
    room = (half + radius)*(1 + spare)
    yes = all(abs(d) <= room + abs(self%half)*(1 + spare)) .and. &
      abs(dot_product(d, across)) <= dot_product(room, abs(across)) + spare*sqrt(dot_product(d, d))
  end function reaches

  !> True if the wall excludes the centres of disks from a whole rectangle. Since the stadium around
  !> the wall is convex, it suffices to test the corners of the rectangle.
  pure function covers(self, d, half, radius) result(yes)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    logical :: yes
    integer :: i, j

    yes = all([((self%gap(d + [i, j]*half, radius) < 0, i=-1, 1, 2), j=-1, 1, 2)])
  end function covers

  !> Checks that the wall has a positive length and both ends in the box.
  pure function misfit(self, lower, upper, periodic) result(problem)
    class(segment_t), intent(in) :: self
    real(real64), intent(in) :: lower(2), upper(2)
    logical, intent(in) :: periodic(2)
    character(len=:), allocatable :: problem
    real(real64) :: slack(2)

    problem = ""
    slack = spare**2*max(abs(lower), abs(upper))
    if (.not. self%length > 0) problem = "to: is the same point as from"
    if (outside(self%middle + self%half)) problem = "to: lies outside the box"
    if (outside(self%middle - self%half)) problem = "from: lies outside the box"

  contains

    !> True if an end of the wall is outside the box.
    pure function outside(point) result(yes)
      real(real64), intent(in) :: point(2)
      logical :: yes

      yes = any(point < lower - slack .or. point > upper + slack)
    end function outside
  end function misfit

end module segments
