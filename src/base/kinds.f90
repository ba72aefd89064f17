!> Kinds of numbers, and the time that represents "no event". Every other module uses this module.
module kinds
  use, intrinsic :: iso_fortran_env, only: int16, int32, int64, real64
  implicit none
  private
  public :: int16, int32, int64, int128, real64, largest_exact, never, pi

  integer, parameter :: int128 = selected_int_kind(38)

  !> The time of an event that never happens: later than any event. This time is finite, so that sums and products that contain it
  !> are finite as well.
  real(real64), parameter :: never = 1.0e150_real64
  !> 2**53, the largest number up to which real numbers represent every integer exactly.
  real(real64), parameter :: largest_exact = 2.0_real64**53
  real(real64), parameter :: pi = 3.14159265358979323846264338327950288_real64
end module kinds
