!> Who is next door across a periodic side: the images of the box, with where they are and how they move. Search, start,
!> obstacles and collisions ask here.
!>
!> In a sheared box (Lees and Edwards, J. Phys. C 5, 1921 (1972)) the image above slides along x. Where an image is depends
!> on the time alone: its shift when the clocks began, at the epoch, and from then on its velocity. So the separation of
!> two disks through an image is a function of their states and the time, whoever asks.
module images
  use kinds, only: never, real64
  implicit none
  private
  public :: image_t, images_t, sliding_images

  !> One image of the box, as seen from the box itself.
  type :: image_t
    real(real64) :: shift(2) = 0.0_real64       !! from the box to it, at the epoch [length]
    real(real64) :: slip = 0.0_real64           !! its velocity along x [length/time]
  end type image_t

  !> An image has a number by axis: 0, 0 is the box itself, 0, 1 the image above. Numbers are whole, and real because disks
  !> may be any number of periods apart.
  type :: images_t
    real(real64) :: period(2) = never           !! `never` between walls [length]
    real(real64) :: slip = 0.0_real64           !! velocity of the image above [length/time]
    real(real64) :: slide = 0.0_real64          !! of that image at the epoch, less whole periods [length]
    real(real64) :: left_out = 0.0_real64       !! those periods
  contains
    procedure :: count => count_around
    procedure :: around
    procedure :: displacement
    procedure :: nearest_image
    procedure :: shift
    procedure :: image
    procedure :: reach
    procedure :: look_again
    procedure :: climb
  end type images_t

contains

  !> The images of a box whose image above is displaced by slip*t at the time t of the run. The clocks count from `epoch`.
  !> The displacement is reduced to a period without loss, so that times however late keep their digits.
  pure function sliding_images(period, slip, epoch) result(images)
    real(real64), intent(in) :: period(2)       !! [length]
    real(real64), intent(in) :: slip            !! [length/time]
    real(real64), intent(in) :: epoch           !! [time]
    type(images_t) :: images
    real(real64) :: s(2), e(2)

    s = halves(slip)
    e = halves(epoch)
    associate (length => period(1))
      images%period = period
      images%slip = slip
      images%slide = modulo(modulo(s(1)*e(1), length) + modulo(s(1)*e(2), length) + modulo(s(2)*e(1), length) &
        + s(2)*e(2), length)
      images%left_out = anint((slip*epoch - images%slide)/length)
    end associate
  end function sliding_images

  !> A number as the sum of two with half the digits: their products are exact.
  pure function halves(x)
    real(real64), intent(in) :: x
    real(real64) :: halves(2)
    integer, parameter :: half = 26             ! of 53 binary digits

    halves(1) = scale(aint(scale(fraction(x), half)), exponent(x) - half)
    halves(2) = x - halves(1)
  end function halves

  !> How many images there are in reach, the box itself included.
  pure function count_around(self) result(n)
    class(images_t), intent(in) :: self
    integer :: n

    n = product(2*self%reach() + 1)
  end function count_around

  !> Along each axis, up to which number images are in reach: two disks that are in the box touch through none beyond,
  !> until one of them passes a side or it is time to look again.
  pure function reach(self)
    class(images_t), intent(in) :: self
    integer :: reach(2)

    reach = merge(1, 0, self%period < never)
    if (abs(self%slip) > 0) reach(1) = 2
  end function reach

  !> The number of the k-th of the images in reach, row by row.
  pure function around(self, k, now) result(number)
    class(images_t), intent(in) :: self
    integer, intent(in) :: k                    !! from 1
    real(real64), intent(in), optional :: now   !! since the epoch; where images slide [time]
    real(real64) :: number(2)
    integer :: reach(2)

    reach = self%reach()
    associate (in_row => 2*reach(1) + 1)
      number = [modulo(k - 1, in_row) - reach(1), (k - 1)/in_row - reach(2)]
    end associate
    if (abs(self%slip) > 0 .and. present(now)) &
      number(1) = number(1) - anint(self%displacement(number(2), now)/self%period(1))
  end function around

  !> How far along x the image `rows` above is displaced.
  pure function displacement(self, rows, now)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: rows
    real(real64), intent(in) :: now             !! since the epoch [time]
    real(real64) :: displacement                !! [length]

    displacement = rows*(self%slide + self%slip*now)
  end function displacement

  !> Until when the images in reach now, or others that slide by up to `distance`, are all that matter.
  pure function look_again(self, now, distance) result(t)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: now             !! [time]
    real(real64), intent(in), optional :: distance    !! default: half a period [length]
    real(real64) :: t, farthest

    farthest = 0.5_real64*self%period(1)
    if (present(distance)) farthest = distance
    t = never
    if (abs(self%slip) > farthest/never) t = now + farthest/abs(self%slip)
  end function look_again

  !> The number of the image through which what is dx away is nearest: almost always 0, 0.
  pure function nearest_image(self, dx, now) result(number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: dx(2)           !! [length]
    real(real64), intent(in), optional :: now   !! since the epoch; where images slide [time]
    real(real64) :: number(2)

    number = 0
    if (abs(dx(1)) < 0.5_real64*self%period(1) .and. abs(dx(2)) < 0.5_real64*self%period(2)) return
    number = -anint(dx/self%period)
    if (abs(self%slip) > 0 .and. present(now)) &
      number(1) = -anint((dx(1) + self%displacement(number(2), now))/self%period(1))
  end function nearest_image

  !> Where the image of this number was at the epoch.
  pure function shift(self, number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: number(2)
    real(real64) :: shift(2)                    !! [length]

    shift = number*self%period
    shift(1) = shift(1) + number(2)*self%slide
  end function shift

  !> The image of this number.
  pure function image(self, number)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: number(2)
    type(image_t) :: image

    image = image_t(self%shift(number), number(2)*self%slip)
  end function image

  !> Describes a disk as one of the image `rows` above: it is where it was, as seen from there.
  pure subroutine climb(self, rows, clock, x, v, periods)
    class(images_t), intent(in) :: self
    real(real64), intent(in) :: rows
    real(real64), intent(in) :: clock           !! of x [time]
    real(real64), intent(inout) :: x(2)         !! [length]
    real(real64), intent(inout) :: v(2)         !! [length/time]
    real(real64), intent(inout) :: periods(2)   !! that the disk has travelled

    x = x - [self%displacement(rows, clock), rows*self%period(2)]
    v(1) = v(1) - rows*self%slip
    periods = periods + rows*[-self%left_out, 1.0_real64]
  end subroutine climb

end module images
