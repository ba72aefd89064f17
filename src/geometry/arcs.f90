!> Arcs of circles, impenetrable from both sides. Disks also collide with the ends of an arc.
!>
!> When a disk touches an arc, the centre of the disk lies on a circle about the centre of the arc.
!> The radius of this circle is the sum of both radii for a disk outside the arc, and the difference
!> of both radii for a disk inside. In both cases the centre of the disk must lie between the first
!> and the last angle of the arc. From inside, a disk larger than the arc can touch only the ends.
!> The centre of a disk that touches an end lies on a circle about this end. This circle meets the
!> circles of both faces (the outer and the inner side of the arc) with common tangents. If rounding
!> errors hide a contact with a face near an end, the contact with the end is therefore found
!> instead.
module arcs
  use free_flight, only: flight, later_time_to_circle, time_to_circle
  use kinds, only: never, pi, real64
  use shapes, only: magnitude, shape_t, spare, unit_vector
  implicit none
  private
  public :: arc_t, new_arc

  !> Maximum number of times that a parabola crosses a circle in the same direction.
  integer, parameter :: most_crossings = 2

  !> An arc of a circle; its middle is the middle of its bounding rectangle.
  type, extends(shape_t) :: arc_t
    !> Vector from the middle of the arc to the centre of its circle [length].
    real(real64) :: centre(2) = 0.0_real64
    real(real64) :: radius = 0.0_real64         !! [length]
    !> Unit vectors from the centre of the circle to the first and the last point of the arc,
    !> counter-clockwise; shape (component, end).
    real(real64) :: end_direction(2, 2) = 0.0_real64
    logical :: is_large = .false.               !! .true. if the arc is more than half a circle
    logical :: is_closed = .false.              !! .true. if the arc is the whole circle
  contains
    procedure :: direction
    procedure :: is_concave_at
    procedure :: contact_time
    procedure :: gap
    procedure :: normal
    procedure :: reaches
    procedure :: covers
    procedure :: misfit
    procedure, private :: is_in_window
    procedure, private :: end_point
  end type arc_t

contains

  !> Creates an arc, counter-clockwise from one angle to a larger one.
  pure function new_arc(centre, radius, from_angle, to_angle) result(arc)
    real(real64), intent(in) :: centre(2)       !! [length]
    real(real64), intent(in) :: radius          !! [length]
    real(real64), intent(in) :: from_angle      !! [degrees]
    real(real64), intent(in) :: to_angle        !! from_angle < to_angle <= from_angle + 360 [degrees]
    type(arc_t) :: arc
    real(real64) :: low(2), high(2), point(2), offset
    integer :: k

    arc%radius = radius
    arc%end_direction(:, 1) = vector_at(from_angle)
    arc%end_direction(:, 2) = vector_at(to_angle)
    arc%is_large = to_angle - from_angle > 180
    arc%is_closed = to_angle - from_angle >= 360
    arc%is_convex = .false.
    low = radius*minval(arc%end_direction, dim=2)
    high = radius*maxval(arc%end_direction, dim=2)
    do k = 0, 3  ! rightmost, top, leftmost and bottom point of the circle
      point = vector_at(90.0_real64*k)
      if (.not. arc%is_in_window(point)) cycle
      low = min(low, radius*point)
      high = max(high, radius*point)
    end do
    arc%centre = -0.5_real64*(low + high)
    arc%middle = centre - arc%centre
    arc%extent = 0.5_real64*(high - low)
    offset = magnitude(arc%centre)
    arc%circumradius = maxval([(magnitude(arc%end_point(k)), k=1, 2)])
    ! the farthest point of the circle belongs to the arc
    if (arc%is_in_window(arc%centre)) arc%circumradius = radius + offset
  end function new_arc

  !> Unit vector at a given angle; exact for multiples of 90 degrees.
  pure function vector_at(angle) result(e)
    real(real64), intent(in) :: angle           !! [degrees]
    real(real64) :: e(2), rest
    integer :: quarter

    quarter = nint(angle/90)
    rest = (angle - 90*quarter)*(pi/180)
    e = [cos(rest), sin(rest)]
    select case (modulo(quarter, 4))
    case (1)
      e = [-e(2), e(1)]
    case (2)
      e = -e
    case (3)
      e = [e(2), -e(1)]
    case default                                ! no rotation
    end select
  end function vector_at

  !> True if the direction of a vector from the centre of the circle lies between the first and the
  !> last angle of the arc.
  pure function is_in_window(self, c) result(yes)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: c(2)            !! [length]
    logical :: yes
    ! Cross products. `after_first` is positive if the first end of the arc reaches the vector by a
    ! counter-clockwise rotation of less than half a turn. `before_last` is positive if the vector
    ! reaches the last end by such a rotation.
    real(real64) :: after_first, before_last

    associate (first => self%end_direction(:, 1), last => self%end_direction(:, 2))
      after_first = first(1)*c(2) - first(2)*c(1)
      before_last = c(1)*last(2) - c(2)*last(1)
    end associate
    if (self%is_large) then
      yes = after_first >= 0 .or. before_last >= 0
    else
      yes = after_first >= 0 .and. before_last >= 0
    end if
  end function is_in_window

  !> Vector from the middle of the arc to its first or last point.
  pure function end_point(self, k) result(point)
    class(arc_t), intent(in) :: self
    integer, intent(in) :: k                    !! 1 for the first point, 2 for the last point
    real(real64) :: point(2)

    point = self%centre + self%radius*self%end_direction(:, k)
  end function end_point

  !> Tangential velocity of the surface at a point of contact, for a surface that moves
  !> counter-clockwise along the arc with unit speed. The velocity is the unit tangent vector of the
  !> circle at the nearest point of the arc, without its component along the surface normal. The
  !> ends of the arc therefore move more slowly than the rest.
  pure function direction(self, d, normal) result(along)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2), normal(2)
    real(real64) :: along(2), outwards(2)
    integer :: k

    outwards = d - self%centre
    if (.not. self%is_in_window(outwards)) then
      k = minloc([magnitude(d - self%end_point(1)), magnitude(d - self%end_point(2))], dim=1)
      outwards = self%end_direction(:, k)
    end if
    outwards = unit_vector(outwards, otherwise=-normal)        ! a disk at the centre touches the inner face
    along = [-outwards(2), outwards(1)]
    along = along - dot_product(along, normal)*normal
  end function direction

  !> True if a disk touches the arc from inside.
  pure function is_concave_at(self, d) result(yes)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    logical :: yes

    yes = magnitude(d - self%centre) < self%radius .and. self%is_in_window(d - self%centre)
  end function is_concave_at

  !> Time until a disk touches the arc.
  pure function contact_time(self, d, v, g, radius, within) result(s)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2), v(2), g(2), radius
    real(real64), intent(in), optional :: within
    real(real64) :: s, c(2)
    integer :: k

    c = d - self%centre
    s = time_to_face(self%radius + radius, .false.)
    if (self%radius > radius) s = min(s, time_to_face(self%radius - radius, .true.))
    if (self%is_closed) return
    do k = 1, 2
      associate (from_end => d - self%end_point(k))
        if (.not. grazes(from_end)) s = min(s, time_to_circle(from_end, v, g, radius, .false., within))
      end associate
    end do

  contains

    !> Time until the disk touches the outer or the inner face of the arc. At a contact, the centre
    !> of the disk is on a circle of radius `rho`, between the first and the last angle of the arc,
    !> and on the same side of the arc as the face. Elsewhere a disk can cross the circle without
    !> touching the face.
    pure function time_to_face(rho, inside) result(t)
      real(real64), intent(in) :: rho           !! radius of the circle of contact [length]
      logical, intent(in) :: inside             !! .true. for the inner face
      real(real64) :: t, contact(2)
      integer :: skipped

      t = never
      if (.not. inside) then
        if (grazes(c)) return
      end if
      t = time_to_circle(c, v, g, rho, inside, within)
      do skipped = 1, most_crossings
        if (.not. t < never) return
        contact = flight(c, v, g, t)
        if (self%is_in_window(contact) .and. (magnitude(contact) <= self%radius .eqv. inside)) return
        t = later_time_to_circle(c, v, g, rho, inside, skipped)
      end do
      t = never
    end function time_to_face

    !> True if a disk on a straight path moves away from a point. Within rounding errors, the path
    !> may also be at a right angle to the direction of the point. A disk moving away from the
    !> centre of a circle cannot collide with the circle from outside. Without this test, rounding
    !> errors could cause a second collision with the same face or end of the arc.
    pure function grazes(from) result(yes)
      real(real64), intent(in) :: from(2)       !! vector from the point to the centre of the disk [length]
      logical :: yes

      yes = .not. any(abs(g) > 0) .and. dot_product(from, v) > -spare**2*magnitude(from)*magnitude(v)
    end function grazes
  end function contact_time

  !> Minimum distance between the arc and the rim of a disk.
  pure function gap(self, d, radius) result(length)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2), radius
    real(real64) :: length

    if (self%is_in_window(d - self%centre)) then
      length = abs(magnitude(d - self%centre) - self%radius) - radius
    else
      length = min(magnitude(d - self%end_point(1)), magnitude(d - self%end_point(2))) - radius
    end if
  end function gap

  !> Unit vector from the point of contact on the arc to the centre of the touching disk. A disk in
  !> the opening of an arc can touch both ends simultaneously.
  pure function normal(self, d, heading) result(direction)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    real(real64), intent(in), optional :: heading(2)
    real(real64) :: direction(2), c(2), other(2), touching
    integer :: k

    c = d - self%centre
    if (self%is_in_window(c)) then
      direction = unit_vector(sign(1.0_real64, magnitude(c) - self%radius)*c, heading)
    else
      k = minloc([magnitude(d - self%end_point(1)), magnitude(d - self%end_point(2))], dim=1)
      direction = unit_vector(d - self%end_point(k), heading)
    end if
    if (.not. present(heading)) return
    touching = self%gap(d, 0.0_real64)
    touching = touching + spare**2*(touching + self%radius)
    do k = 1, 2
      other = d - self%end_point(k)
      if (magnitude(other) > touching) cycle
      other = unit_vector(other, heading)
      if (dot_product(heading, other) > dot_product(heading, direction)) direction = other
    end do
  end function normal

  !> True if a disk centred in a rectangle can touch the arc. The test uses the bounding rectangle
  !> of the arc, and the annulus of the centres of all disks that touch the full circle.
  pure function reaches(self, d, half, radius) result(yes)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    real(real64) :: c(2), slack
    logical :: yes

    c = d - self%centre
    slack = spare*(self%radius + radius + magnitude(c) + magnitude(half))
    yes = all(abs(d) <= half + self%extent + radius + slack) .and. &
      magnitude(max(abs(c) - half, 0.0_real64)) <= self%radius + radius + slack .and. &
      magnitude(abs(c) + half) >= self%radius - radius - slack
  end function reaches

  !> Sufficient test of whether the arc excludes the centres of disks from a whole rectangle: a disk
  !> in the middle of the rectangle overlaps the arc by more than half the diagonal of the
  !> rectangle. For a large rectangle the result may be .false. although no disk can be centred in
  !> the rectangle.
  pure function covers(self, d, half, radius) result(yes)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    logical :: yes

    yes = self%gap(d, radius) + magnitude(half) < 0
  end function covers

  !> Checks that the arc overlaps the box. Along a periodic axis the arc must not be wider than the
  !> box, and the middle of the arc must be in the box. Otherwise images shifted by more than one
  !> period could touch disks in the box.
  pure function misfit(self, lower, upper, periodic) result(problem)
    class(arc_t), intent(in) :: self
    real(real64), intent(in) :: lower(2), upper(2)
    logical, intent(in) :: periodic(2)
    character(len=:), allocatable :: problem
    character(len=1) :: name
    integer :: axis

    problem = ""
    if (any(self%middle - self%extent >= upper) .or. any(self%middle + self%extent <= lower)) &
      problem = "centre: the arc is outside the box"
    do axis = 1, 2
      if (.not. periodic(axis)) cycle
      name = merge("x", "y", axis == 1)
      if (self%middle(axis) < lower(axis) .or. self%middle(axis) > upper(axis)) &
        problem = "centre: the middle of the arc is outside the box, along the periodic axis "//name
      if (2*self%extent(axis) > (upper(axis) - lower(axis))*(1 + spare**2)) &
        problem = "radius: the arc is wider than the box, along the periodic axis "//name
    end do
  end function misfit

end module arcs
