!> The seam behind which the kinds of fixed obstacles stand. Search, start, time steps and observables ask an
!> obstacle's shape all they need to know, and know no centre, radius or end themselves.
module shapes
  use images, only: images_t
  use kinds, only: never, real64
  implicit none
  private
  public :: shape_t, magnitude, spare

  !> Relative margin above all rounding, for questions whose answer may err on one side only.
  real(real64), parameter :: spare = 1.0e-6_real64

  !> The outline of an obstacle. Points are given relative to its middle.
  type, abstract :: shape_t
    real(real64) :: middle(2) = 0.0_real64      !! [length]
    logical :: encloses = .false.               !! keeps the disks inside, not outside
    real(real64) :: extent(2) = 0.0_real64      !! half the sides of the smallest rectangle around it [length]
    real(real64) :: area = 0.0_real64           !! that it takes from the box or, if it encloses the disks, leaves [length**2]
  contains
    procedure :: from_nearest
    procedure :: direction
    procedure(contact_time), deferred :: contact_time
    procedure(gap), deferred :: gap
    procedure(normal), deferred :: normal
    procedure(reaches), deferred :: reaches
    procedure(covers), deferred :: covers
    procedure(misfit), deferred :: misfit
  end type shape_t

  abstract interface
    !> Time until the rim of a disk touches the outline: zero if it does already (or overlaps by rounding)
    !> and moves on into it, `never` if it will not.
    pure function contact_time(self, d, v, g, radius) result(s)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2)          !! from the middle to the disk's centre [length]
      real(real64), intent(in) :: v(2)          !! [length/time]
      real(real64), intent(in) :: g(2)          !! [length/time**2]
      real(real64), intent(in) :: radius        !! of the disk [length]
      real(real64) :: s
    end function contact_time

    !> Distance between the outline and the rim of a disk; negative if they overlap.
    pure function gap(self, d, radius) result(length)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), radius
      real(real64) :: length
    end function gap

    !> Unit vector from the outline to a disk that touches it.
    pure function normal(self, d) result(direction)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2)
      real(real64) :: direction(2)
    end function normal

    !> Whether a disk whose centre is in the rectangle d +- half can touch the outline. Yes, if in doubt.
    pure function reaches(self, d, half, radius) result(yes)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), half(2), radius
      logical :: yes
    end function reaches

    !> Whether no disk can have its centre anywhere in the rectangle d +- half. No, if in doubt; but for a
    !> point (half = 0) the answer is exact.
    pure function covers(self, d, half, radius) result(yes)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: d(2), half(2), radius
      logical :: yes
    end function covers

    !> What is wrong with it in a box, as `variable: what`; empty if nothing is.
    pure function misfit(self, lower, upper, periodic) result(problem)
      import :: real64, shape_t
      class(shape_t), intent(in) :: self
      real(real64), intent(in) :: lower(2), upper(2)
      logical, intent(in) :: periodic(2)
      character(len=:), allocatable :: problem
    end function misfit
  end interface

contains

  !> Length of a vector. Other than `norm2` of gfortran, whose scaling rounds, it gives scaled bits for a vector that is
  !> scaled by a power of two.
  pure function magnitude(v)
    real(real64), intent(in) :: v(2)
    real(real64) :: magnitude

    magnitude = sqrt(v(1)*v(1) + v(2)*v(2))
  end function magnitude

  !> From the middle of its nearest image to x. What encloses the disks has no images. Of two that are equally near, in
  !> the middle between them, it is the one that `heading` points away from, if that is given: a disk may touch both.
  pure function from_nearest(self, x, images, heading) result(d)
    class(shape_t), intent(in) :: self
    real(real64), intent(in) :: x(2)            !! [length]
    type(images_t), intent(in) :: images        !! of the box
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

  !> Unit vector along the outline where the normal is this one: counter-clockwise around its middle.
  pure function direction(self, normal) result(along)
    class(shape_t), intent(in) :: self
    real(real64), intent(in) :: normal(2)       !! from the outline to a disk
    real(real64) :: along(2)

    along = [-normal(2), normal(1)]
    if (self%encloses) along = -along
  end function direction

end module shapes
