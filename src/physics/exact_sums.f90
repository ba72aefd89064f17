!> Sums stored as fixed-point numbers, bit-identical for any order of their terms.
module exact_sums
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use kinds, only: int64, int128, real64
  implicit none
  private
  public :: exact_sum_t

  !> Number of binary digits of a term as large as the bound of `choose_unit`.
  integer, parameter :: digits_of_bound = 62
  integer, parameter :: digits_of_rare = 90              !! binary logarithm of `rare_unit`
  real(real64), parameter :: most_units = 2.0_real64**digits_of_bound
  real(real64), parameter :: rare_unit = 2.0_real64**digits_of_rare
  integer, parameter :: digits_of_most = 125
  !> Maximum of the component `rare` of a sum. Beyond this maximum the value of the sum is NaN.
  integer(int128), parameter :: most = 2_int128**digits_of_most

  !> A fixed-point sum. Terms above the bound passed to `choose_unit` are also added exactly, at a
  !> slightly higher cost. Up to 2**35 terms below 2**90 units cannot cause an overflow. A larger
  !> term is split, and its multiples of 2**90 units are counted in `rare`.
  type :: exact_sum_t
    integer(int128) :: units = 0
    integer(int128) :: rare = 0                          !! number of multiples of 2**90 units
    !> Reciprocal of the unit, a power of two; 0 if the unit has not been chosen yet.
    real(real64) :: per_one = 0.0_real64
  contains
    procedure :: choose_unit
    procedure :: add
    procedure :: include
    procedure :: clear
    procedure :: value
    procedure, private :: add_rare, make_finer, make_coarser
  end type exact_sum_t

contains

  !> Chooses the unit such that a term as large as `bound` has 62 binary digits. Terms added earlier
  !> are converted to the new unit.
  elemental subroutine choose_unit(self, bound)
    class(exact_sum_t), intent(inout) :: self
    real(real64), intent(in) :: bound
    real(real64) :: before
    integer :: finer                                     ! number of additional binary digits

    before = self%per_one
    self%per_one = 1
    if (bound > 0) self%per_one = scale(1.0_real64, min(digits_of_bound - exponent(bound), maxexponent(bound) - 1))
    if (.not. before > 0) return
    finer = exponent(self%per_one) - exponent(before)
    if (finer > 0) call self%make_finer(min(finer, digits_of_most))
    if (finer < 0) call self%make_coarser(min(-finer, digits_of_most))
  end subroutine choose_unit

  !> Divides the unit of the sum by 2**`digits`.
  elemental subroutine make_finer(self, digits)
    class(exact_sum_t), intent(inout) :: self
    integer, intent(in) :: digits                        !! binary logarithm of the factor
    integer(int128) :: moved

    if (self%units == 0 .and. self%rare == 0) return
    moved = self%units/2_int128**max(digits_of_rare - digits, 0)
    self%units = self%units - moved*2_int128**max(digits_of_rare - digits, 0)
    if (abs(self%rare) >= 2_int128**(digits_of_most - digits) &
      .or. abs(moved) >= 2_int128**(digits_of_most - max(digits - digits_of_rare, 0))) then
      self%rare = most
    else
      self%rare = self%rare*2_int128**digits + moved*2_int128**max(digits - digits_of_rare, 0)
      self%units = self%units*2_int128**digits
    end if
  end subroutine make_finer

  !> Multiplies the unit of the sum by 2**`digits`.
  elemental subroutine make_coarser(self, digits)
    class(exact_sum_t), intent(inout) :: self
    integer, intent(in) :: digits                        !! binary logarithm of the factor
    integer(int128) :: left

    left = self%rare/2_int128**digits
    self%units = self%units/2_int128**digits &
      + (self%rare - left*2_int128**digits)/2_int128**max(digits - digits_of_rare, 0)*2_int128**max(digits_of_rare - digits, 0)
    self%rare = left
  end subroutine make_coarser

  !> Adds a term, rounded to a multiple of the unit. Truncation would give the errors of many small
  !> terms the same sign.
  elemental subroutine add(self, term)
    class(exact_sum_t), intent(inout) :: self
    real(real64), intent(in) :: term
    real(real64) :: units, upper

    units = term*self%per_one
    if (abs(units) < most_units) then
      self%units = self%units + int(units + sign(0.5_real64, units), int64)
    else if (abs(units) < rare_unit) then      ! two 64-bit conversions are faster than one 128-bit conversion
      upper = aint(units/most_units)
      self%units = self%units + int(upper, int64)*2_int128**digits_of_bound + int(units - upper*most_units, int64)
    else
      call self%add_rare(units)
    end if
  end subroutine add

  !> Adds a very large term in two parts. Both parts are exact, because a double-precision number
  !> has fewer digits than either of the two integers that represent the sum.
  elemental subroutine add_rare(self, units)
    class(exact_sum_t), intent(inout) :: self
    real(real64), intent(in) :: units
    real(real64) :: rare

    rare = aint(units/rare_unit)
    if (abs(rare) < real(most, real64) .and. abs(self%rare) < most) then
      self%rare = self%rare + int(rare, int128)
      self%units = self%units + int(units - rare*rare_unit, int128)
    else
      self%rare = most
    end if
  end subroutine add_rare

  !> Adds the terms of another sum with the same unit.
  elemental subroutine include(self, other)
    class(exact_sum_t), intent(inout) :: self
    type(exact_sum_t), intent(in) :: other

    self%units = self%units + other%units
    self%rare = self%rare + other%rare
    if (max(abs(self%rare), abs(other%rare)) >= most) self%rare = most
  end subroutine include

  !> Sets the sum to zero.
  elemental subroutine clear(self)
    class(exact_sum_t), intent(inout) :: self

    self%units = 0
    self%rare = 0
  end subroutine clear

  !> Value of the sum; NaN if it has become too large.
  elemental function value(self)
    class(exact_sum_t), intent(in) :: self
    real(real64) :: value

    value = 0
    if (.not. self%per_one > 0) return
    value = real(self%units, real64)/self%per_one
    if (self%rare == 0) return
    value = value + real(self%rare, real64)*(rare_unit/self%per_one)
    if (abs(self%rare) >= most) value = ieee_value(value, ieee_quiet_nan)
  end function value

end module exact_sums
