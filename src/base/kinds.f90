!> Kind parameters of Fortran numbers, and the time that represents "no event".
module kinds
  use, intrinsic :: iso_fortran_env, only: int16, int32, int64, real64
  implicit none
  private
  public :: int16, int32, int64, int128, real64, largest_exact, never, pi

  integer, parameter :: int128 = selected_int_kind(38)

  !> Time that represents "no event", later than any event. It is finite, because sums and products
  !> that contain infinity could be NaN.
  real(real64), parameter :: never = 1.0e150_real64
  !> 2**53: double-precision numbers represent every integer up to this value exactly.
  real(real64), parameter :: largest_exact = 2.0_real64**53
  real(real64), parameter :: pi = 3.14159265358979323846264338327950288_real64
end module kinds
