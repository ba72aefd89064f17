!> Displacements and velocities of the periodic images of the box, for the neighbour search, the
!> placement of disks, obstacles and collisions.
!>
!> In a sheared box (Lees and Edwards, 1972, doi:10.1088/0022-3719/5/15/006) the image above the box
!> moves along x at constant velocity, so its position depends only on the time. The separation
!> between a disk and an image of another disk therefore depends only on the states of the two disks
!> and on the time.
module images
  use kinds, only: never, real64
  implicit none
  private
  public :: image_t, images_t, moving_images

  !> A periodic image of the box: its displacement and velocity relative to the box itself.
  type :: image_t
    real(real64) :: shift(2) = 0.0_real64       !! displacement of the image at the time origin [length]
    real(real64) :: velocity = 0.0_real64       !! velocity of the image along x [length/time]
  end type image_t

  !> All periodic images of the box, each identified by two indices: (0, 0) is the box itself, (0,
  !> 1) the image above it. The indices are whole numbers stored as reals, because two disks may be
  !> any number of periods apart.
  type :: images_t
    real(real64) :: period(2) = never           !! edges of the box; `never` along an axis with walls [length]
    real(real64) :: velocity = 0.0_real64       !! velocity of the image above the box [length/time]
    !> Displacement of the image above the box at the time origin, modulo the period [length].
    real(real64) :: offset = 0.0_real64
    real(real64) :: removed_periods = 0.0_real64  !! number of periods subtracted from `offset`
  contains
    procedure :: count => count_around
    procedure :: around
    procedure :: displacement
    procedure :: nearest_image
    procedure :: shift
    procedure :: image
    procedure :: reach
    procedure :: valid_until
    procedure :: enter_image_frame
  end type images_t

contains

  !> Creates the images of a box, for times measured from the time origin `epoch`. At the time t of
  !> the run, the image above the box is displaced along x by velocity*t. This displacement is
  !> reduced modulo the period without rounding errors, so that late times are as precise as early
  !> ones.
  pure function moving_images(period, velocity, epoch) result(images)
    real(real64), intent(in) :: period(2)       !! [length]
    real(real64), intent(in) :: velocity        !! [length/time]
    real(real64), intent(in) :: epoch           !! [time]
    type(images_t) :: images
    real(real64) :: s(2), e(2)

    s = halves(velocity)
    e = halves(epoch)
    associate (length => period(1))
      images%period = period
      images%velocity = velocity
      images%offset = modulo(modulo(s(1)*e(1), length) + modulo(s(1)*e(2), length) + modulo(s(2)*e(1), length) &
        + s(2)*e(2), length)
      images%removed_periods = anint((velocity*epoch - images%offset)/length)
    end associate
  end function moving_images

  !> Splits a number into a sum of two parts with at most 27 significant bits each, so that products
  !> of two parts are exact.
  pure function halves(x)
    real(real64), intent(in) :: x
    real(real64) :: halves(2)
    integer, parameter :: half = 26             ! number of significant bits of `halves(1)`

    halves(1) = scale(aint(scale(fraction(x), half)), exponent(x) - half)
    halves(2) = x - halves(1)
  end function halves

  !> Number of images to be searched for collision partners (see `reach`), including the box itself.
  pure function count_around(self) result(n)
    class(images_t), intent(in) :: self
    integer :: n

    n = product(2*self%reach() + 1)
  end function count_around

  !> Maximum index, along each axis, of the images to be searched for collision partners. Until the
  !> time `valid_until`, a disk in the box can touch only disks in these images, provided that no
  !> disk leaves the box.
  pure function reach(self)
    class(images_t), intent(in) :: self
    integer :: reach(2)

    reach = merge(1, 0, self%period < never)
    if (abs(self%velocity) > 0) reach(1) = 2
  end function reach

  !> Indices of image k in the list of images to be searched for collision partners, numbered row by
  !> row.
  pure function around(self, k, now) result(number)
    class(images_t), intent(in) :: self
    integer, intent(in) :: k                    !! number of the image, starting at 1
    !> Time relative to `box%epoch`; required in a sheared box [time].
    real(real64), intent(in), optional :: now
    real(real64) :: number(2)
    integer :: reach(2)

    reach = self%reach()
    associate (in_row => 2*reach(1) + 1)
      number = [modulo(k - 1, in_row) - reach(1), (k - 1)/in_row - reach(2)]
    end associate
    if (abs(self%velocity) > 0 .and. present(now)) &
      number(1) = number(1) - anint(self%displacement(number(2), now)/self%period(1))
  end function around

  !> Displacement along x of the image `rows` periods above the box.
  pure function displacement(self, rows, now)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: rows
    real(real64), intent(in) :: now             !! time relative to `box%epoch` [time]
    real(real64) :: displacement                !! [length]

    displacement = rows*(self%offset + self%velocity*now)
  end function displacement

  !> Time at which the image above the box will have moved by `distance` from its present position;
  !> `never` if the images do not move. A search that allows for displacements of up to `distance`
  !> can use the present result of `around` until then.
  pure function valid_until(self, now, distance) result(t)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: now             !! [time]
    !> Displacement of the image; default: half a period [length].
    real(real64), intent(in), optional :: distance
    real(real64) :: t, farthest

    farthest = 0.5_real64*self%period(1)
    if (present(distance)) farthest = distance
    t = never
    if (abs(self%velocity) > farthest/never) t = now + farthest/abs(self%velocity)
  end function valid_until

  !> Indices of the image that contains the nearest copy of an object, given the separation dx from
  !> the object itself. Nearly always this is the box itself, with the indices (0, 0).
  pure function nearest_image(self, dx, now) result(number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: dx(2)           !! [length]
    !> Time relative to `box%epoch`; required in a sheared box [time].
    real(real64), intent(in), optional :: now
    real(real64) :: number(2)

    number = 0
    if (abs(dx(1)) < 0.5_real64*self%period(1) .and. abs(dx(2)) < 0.5_real64*self%period(2)) return
    number = -anint(dx/self%period)
    if (abs(self%velocity) > 0 .and. present(now)) &
      number(1) = -anint((dx(1) + self%displacement(number(2), now))/self%period(1))
  end function nearest_image

  !> Displacement, at the time origin, of the image with the given indices.
  pure function shift(self, number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: number(2)
    real(real64) :: shift(2)                    !! [length]

    shift = number*self%period
    shift(1) = shift(1) + number(2)*self%offset
  end function shift

  !> Displacement and velocity of the image with the given indices.
  pure function image(self, number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: number(2)
    type(image_t) :: image

    image = image_t(self%shift(number), number(2)*self%velocity)
  end function image

  !> Transforms the state of a disk to the frame of the image `rows` periods above the box.
  !> Coordinates and velocity components change; the physical state does not.
  pure subroutine enter_image_frame(self, rows, clock, x, v, periods)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: rows
    real(real64), intent(in) :: clock           !! time to which the position x refers [time]
    real(real64), intent(inout) :: x(2)         !! [length]
    real(real64), intent(inout) :: v(2)         !! [length/time]
    real(real64), intent(inout) :: periods(2)  !! image counters of the disk, which are updated

    x = x - [self%displacement(rows, clock), rows*self%period(2)]
    v(1) = v(1) - rows*self%velocity
    periods = periods + rows*[-self%removed_periods, 1.0_real64]
  end subroutine enter_image_frame

end module images
