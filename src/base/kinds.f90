!> Kind parameters of Fortran numbers, and constants.
module kinds
  use, intrinsic :: iso_fortran_env, only: int16, int32, int64, real64
  implicit none
  private
  public :: int16, int32, int64, int128, real64, largest_exact, never, pi, unlimited

  integer, parameter :: int128 = selected_int_kind(38)

  !> Time of an event that does not occur, later than any actual event. The value is finite, because
  !> sums and products with infinity could be NaN.
  real(real64), parameter :: never = 1.0e150_real64
  !> Number of events or collisions that is never reached.
  integer(int64), parameter :: unlimited = huge(0_int64)
  !> Largest integer up to which double precision represents all integers exactly.
  real(real64), parameter :: largest_exact = 2.0_real64**53
  real(real64), parameter :: pi = 3.14159265358979323846264338327950288_real64
end module kinds
