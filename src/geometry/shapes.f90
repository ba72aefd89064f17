!> Interface of fixed obstacles of all shapes. The neighbour search, the placement of disks,
!> time-stepped dynamics and the observables use only `shape_t`. They need not distinguish circles,
!> arcs and straight walls.
module shapes
  use images, only: images_t
  use kinds, only: real64
  implicit none
  private
  public :: shape_t, magnitude, spare, unit_vector

  !> Relative safety margin, larger than all rounding errors. If rounding errors make a test
  !> uncertain, the margin selects the result for which no contact is missed.
  real(real64), parameter :: spare = 1.0e-6_real64

  !> Outline of an obstacle. All points are relative to the middle of the obstacle.
  type, abstract :: shape_t
    real(real64) :: middle(2) = 0.0_real64      !! [length]
    logical :: encloses = .false.               !! .true. if the disks are inside the obstacle
    logical :: is_round = .false.               !! .true. if the outline is a circle with the disks outside
    !> Whether a disk that leaves the outline on a straight path can never touch it again.
    logical :: is_convex = .true.
    !> Half width and half height of the bounding rectangle [length].
    real(real64) :: extent(2) = 0.0_real64
    !> Maximum distance of a point of the outline from the middle [length].
    real(real64) :: circumradius = 0.0_real64
    real(real64) :: area = 0.0_real64  !! area enclosed by the outline [length**2]
  contains
    procedure :: from_nearest
    procedure :: direction
    procedure :: is_concave_at
    procedure(contact_time), deferred :: contact_time
    procedure(gap), deferred :: gap
    procedure(normal), deferred :: normal
    procedure(reaches), deferred :: reaches
    procedure(covers), deferred :: covers
    procedure(misfit), deferred :: misfit
  end type shape_t

  abstract interface
    !> Time until the rim of a disk touches the outline; the result is `never` if there is no
    !> contact. The result is 0 if the disk already touches the outline (or overlaps it owing to
    !> rounding) and is moving towards it.
    pure function contact_time(self, d, v, g, radius, within) result(s)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      !> Vector from the middle of the obstacle to the centre of the disk [length].
      real(real64), intent(in) :: d(2)
      real(real64), intent(in) :: v(2)          !! [length/time]
      real(real64), intent(in) :: g(2)          !! [length/time**2]
      real(real64), intent(in) :: radius        !! radius of the disk [length]
      !> Latest time of interest: for a later contact the result may be `never` [time].
      real(real64), intent(in), optional :: within
      real(real64) :: s
    end function contact_time

    !> Minimum distance between the outline and the rim of a disk; negative if they overlap.
    pure function gap(self, d, radius) result(length)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), radius
      real(real64) :: length
    end function gap

    !> Unit vector from the point of contact on the outline to the centre of the touching disk. If
    !> there are several points of contact, the normal with the smallest angle to the vector
    !> `heading` is chosen. The result is a unit vector even if the centre of the disk is on the
    !> outline or at the centre of a circle.
    pure function normal(self, d, heading) result(direction)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2)
      real(real64), intent(in), optional :: heading(2)
      real(real64) :: direction(2)
    end function normal

    !> True if a disk centred in the rectangle d +- half can touch the outline, or if rounding
    !> errors make this uncertain.
    pure function reaches(self, d, half, radius) result(yes)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), half(2), radius
      logical :: yes
    end function reaches

    !> True if the obstacle certainly excludes the centres of disks from the whole rectangle d +-
    !> half. If rounding errors make this uncertain, the result is .false.; for a single point (half
    !> = 0) the result is exact.
    pure function covers(self, d, half, radius) result(yes)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), half(2), radius
      logical :: yes
    end function covers

    !> Reason why the obstacle does not fit into a box, as "variable: problem"; empty if it fits.
    pure function misfit(self, lower, upper, periodic) result(problem)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: lower(2), upper(2)
      logical, intent(in) :: periodic(2)
      character(len=:), allocatable :: problem
    end function misfit
  end interface

contains

  !> Length of a vector. Multiplying the vector by a power of two multiplies the result by exactly
  !> the same power. The `norm2` of gfortran scales the vector, which would introduce rounding
  !> errors.
  pure function magnitude(v)
    real(real64), intent(in) :: v(2)
    real(real64) :: magnitude

    magnitude = sqrt(v(1)*v(1) + v(2)*v(2))
  end function magnitude

  !> Unit vector in the direction of v or, if v vanishes, of `otherwise`. The vector v vanishes at
  !> the centre of a container hardly larger than a disk, and when a disk in a time-stepped
  !> simulation stops exactly on an obstacle.
  pure function unit_vector(v, otherwise) result(e)
    real(real64), intent(in) :: v(2)
    real(real64), intent(in), optional :: otherwise(2)  !! default, also if it is 0: the x direction
    real(real64) :: e(2)
    ! the squares of smaller components are imprecise
    real(real64), parameter :: shortest = sqrt(tiny(1.0_real64))

    if (magnitude(v) > shortest) then
      e = v/magnitude(v)
      return
    end if
    e = [1.0_real64, 0.0_real64]
    if (.not. present(otherwise)) return
    if (magnitude(otherwise) > shortest) e = otherwise/magnitude(otherwise)
  end function unit_vector

  !> Vector to the point x from the middle of the nearest periodic image of the obstacle. The
  !> distances of x from the outlines of all images are compared. The nearest image of a long wall
  !> is not always the image with the nearest middle. If x is equally distant from two images, a
  !> disk at x may touch both. The image whose normal has the smallest angle to the vector `heading`
  !> is then chosen.
  pure function from_nearest(self, x, images, heading) result(d)
    class(shape_t), intent(in) :: self
    real(real64), intent(in) :: x(2)            !! [length]
    type(images_t), intent(in) :: images        !! images of the box
    real(real64), intent(in), optional :: heading(2)
    real(real64) :: d(2), nearest(2), candidate(2), touching
    integer :: k

    nearest = x - self%middle
    nearest = nearest + images%shift(images%nearest_image(nearest))
    d = nearest
    do k = 1, images%count()
      candidate = nearest + images%shift(images%around(k))
      if (self%gap(candidate, 0.0_real64) < self%gap(d, 0.0_real64)) d = candidate
    end do
    if (.not. present(heading)) return
    touching = self%gap(d, 0.0_real64)
    touching = touching + spare**2*(touching + self%circumradius + maxval(abs(x)))
    do k = 1, images%count()
      candidate = nearest + images%shift(images%around(k))
      if (self%gap(candidate, 0.0_real64) > touching) cycle
      if (dot_product(heading, self%normal(candidate, heading)) > dot_product(heading, self%normal(d, heading))) d = candidate
    end do
  end function from_nearest

  !> Unit tangent vector at the point of contact with a disk, counter-clockwise around the middle of
  !> the obstacle.
  pure function direction(self, d, normal) result(along)
    class(shape_t), intent(in) :: self
    !> Vector from the middle of the obstacle to the centre of the disk [length].
    real(real64), intent(in) :: d(2)
    real(real64), intent(in) :: normal(2)       !! unit vector from the outline to the disk
    real(real64) :: along(2)

    along = [-normal(2), normal(1)]
    if (self%encloses) along = -along
  end function direction

  !> True if the outline is concave at the point of contact with a disk, so that the disk can slide
  !> along it.
  pure function is_concave_at(self, d) result(yes)
    class(shape_t), intent(in) :: self
    !> Vector from the middle of the obstacle to the centre of the disk [length].
    real(real64), intent(in) :: d(2)
    logical :: yes

    yes = self%encloses
  end function is_concave_at

end module shapes
