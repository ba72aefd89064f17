!> Whether numbers that come from outside lie between bounds. NaN, which would slip through most comparisons, never does.
module bounds
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use kinds, only: int64, real64
  implicit none
  private
  public :: first_outside

  !> Place in a list of the first number that is not between two others; 0: there is none.
  interface first_outside
    procedure :: first_real_outside, first_integer_outside
  end interface first_outside

contains

  !> The first real that is NaN, infinite or not in the range.
  pure function first_real_outside(values, range) result(place)
    real(real64), intent(in) :: values(:)
    real(real64), intent(in) :: range(2)          !! lower and upper end, which belong to it
    integer :: place

    do place = 1, size(values)
      if (.not. ieee_is_finite(values(place))) return         ! comparing a NaN is trapped by debug builds
      if (values(place) < range(1) .or. values(place) > range(2)) return
    end do
    place = 0
  end function first_real_outside

  !> The first integer that is not in the range.
  pure function first_integer_outside(values, range) result(place)
    integer(int64), intent(in) :: values(:)
    integer(int64), intent(in) :: range(2)        !! lower and upper end, which belong to it
    integer :: place

    do place = 1, size(values)
      if (values(place) < range(1) .or. values(place) > range(2)) return
    end do
    place = 0
  end function first_integer_outside

end module bounds
