!> Circular obstacles with the disks outside or inside.
module circles
  use free_flight, only: time_to_circle
  use images, only: images_t
  use kinds, only: never, pi, real64
  use shapes, only: magnitude, shape_t, spare, unit_vector
  implicit none
  private
  public :: circle_t, new_circle

  type, extends(shape_t) :: circle_t
    real(real64) :: radius = 0.0_real64         !! [length]
  contains
    procedure :: from_nearest
    procedure :: contact_time
    procedure :: gap
    procedure :: normal
    procedure :: reaches
    procedure :: covers
    procedure :: misfit
    procedure, private :: distance_at_contact
  end type circle_t

contains

  !> Creates a circle. If `encloses` is .true., the disks are inside.
  pure function new_circle(centre, radius, encloses) result(circle)
    real(real64), intent(in) :: centre(2)       !! [length]
    real(real64), intent(in) :: radius          !! [length]
    logical, intent(in) :: encloses
    type(circle_t) :: circle

    circle%middle = centre
    circle%radius = radius
    circle%encloses = encloses
    circle%is_round = .not. encloses
    circle%is_convex = .not. encloses
    circle%extent = radius
    circle%circumradius = radius
    circle%area = pi*radius**2
  end function new_circle

  !> Vector to the point x from the middle of the nearest periodic image of the circle. Circles that
  !> enclose disks have no images. If two images are equally close, a disk at x may touch both. Of
  !> the two images, the image is then chosen for which the result has the same sign along the
  !> periodic axis as the vector `heading`.
  pure function from_nearest(self, x, images, heading) result(d)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: x(2)            !! [length]
    type(images_t), intent(in) :: images        !! images of the box
    real(real64), intent(in), optional :: heading(2)
    real(real64) :: d(2)
    integer :: axis

    d = x - self%middle
    if (.not. self%encloses) d = d + images%shift(images%nearest_image(d))
    if (self%encloses .or. .not. present(heading)) return
    do axis = 1, 2
      if (.not. (images%period(axis) < never .and. d(axis)*heading(axis) < 0)) cycle
      if (abs(d(axis)) > 0.5_real64*images%period(axis) - spare**2*(images%period(axis) + abs(x(axis)))) &
        d(axis) = d(axis) - sign(images%period(axis), d(axis))
    end do
  end function from_nearest

  !> Distance between the centres of the circle and of a touching disk.
  pure function distance_at_contact(self, radius) result(rho)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: radius          !! radius of the disk [length]
    real(real64) :: rho

    rho = merge(self%radius - radius, self%radius + radius, self%encloses)
  end function distance_at_contact

  !> Time until a disk touches the circle.
  pure function contact_time(self, d, v, g, radius, within) result(s)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: d(2), v(2), g(2), radius
    real(real64), intent(in), optional :: within
    real(real64) :: s

    s = time_to_circle(d, v, g, self%distance_at_contact(radius), self%encloses, within)
  end function contact_time

  !> Minimum distance between the circle and the rim of a disk.
  pure function gap(self, d, radius) result(length)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: d(2), radius
    real(real64) :: length

    length = magnitude(d) - self%distance_at_contact(radius)
    if (self%encloses) length = -length
  end function gap

  !> Unit vector from the point of contact on the circle to the centre of the touching disk.
  !> `heading` matters only at the centre of the circle; elsewhere the point of contact is unique.
  pure function normal(self, d, heading) result(direction)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: d(2)
    real(real64), intent(in), optional :: heading(2)
    ! variables, because gfortran would pass a copy of an expression
    real(real64) :: direction(2), inwards(2)

    if (self%encloses) then
      inwards = -d
      direction = unit_vector(inwards, heading)
    else
      direction = unit_vector(d, heading)
    end if
  end function normal

  !> True if a disk centred in a rectangle can touch the circle.
  pure function reaches(self, d, half, radius) result(yes)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    logical :: yes

    if (self%encloses) then
      yes = magnitude(abs(d) + half) >= self%distance_at_contact(radius)/(1 + spare)
    else
      yes = magnitude(max(abs(d) - half, 0.0_real64)) <= self%distance_at_contact(radius)*(1 + spare)
    end if
  end function reaches

  !> True if the circle excludes the centres of disks from a whole rectangle.
  pure function covers(self, d, half, radius) result(yes)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: d(2), half(2), radius
    real(real64) :: corner(2), rho
    logical :: yes

    rho = self%distance_at_contact(radius)
    if (self%encloses) then
      corner = max(abs(d) - half, 0.0_real64)
      yes = rho < 0 .or. corner(1)**2 + corner(2)**2 > rho**2
    else
      corner = abs(d) + half
      yes = corner(1)**2 + corner(2)**2 < rho**2
    end if
  end function covers

  !> Checks that the circle overlaps the box and fits between periodic sides.
  pure function misfit(self, lower, upper, periodic) result(problem)
    class(circle_t), intent(in) :: self
    real(real64), intent(in) :: lower(2), upper(2)
    logical, intent(in) :: periodic(2)
    character(len=:), allocatable :: problem
    integer :: axis

    problem = ""
    if (magnitude(min(max(self%middle, lower), upper) - self%middle) >= self%radius) &
      problem = "centre: the obstacle is outside the box"
    do axis = 1, 2
      if (periodic(axis) .and. 2*self%radius > upper(axis) - lower(axis)) problem = &
        "radius: the obstacle is wider than the box along the periodic axis "//merge("x", "y", axis == 1)
      if (problem /= "" .or. .not. (self%encloses .and. periodic(axis))) cycle
      if (min(self%middle(axis) - lower(axis), upper(axis) - self%middle(axis)) < self%radius) problem = &
        "centre: a container (side = 'inside') must not extend beyond a periodic boundary, along "//merge("x", "y", axis == 1)
    end do
  end function misfit

end module circles
