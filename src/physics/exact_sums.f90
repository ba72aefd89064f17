!> Sums that come out the same to the last bit in whatever order their terms are added: fixed-point numbers.
module exact_sums
  use kinds, only: int64, int128, real64
  implicit none
  private
  public :: exact_sum_t

  integer, parameter :: digits_of_bound = 62             !! binary ones, of a term at the bound
  real(real64), parameter :: most_units = 2.0_real64**digits_of_bound

  !> Terms may exceed the bound that `choose_unit` was given: then adding them takes a little longer.
  type :: exact_sum_t
    integer(int128) :: units = 0
    real(real64) :: per_one = 0.0_real64                 !! units per 1, a power of two; 0: not chosen yet
  contains
    procedure :: choose_unit
    procedure :: add
    procedure :: value
  end type exact_sum_t

contains

  !> Makes a sum, empty or restored, fine enough for terms up to a bound; one at work keeps its value.
  elemental subroutine choose_unit(self, bound)
    class(exact_sum_t), intent(inout) :: self
    real(real64), intent(in) :: bound
    real(real64) :: before
    integer :: finer                                     ! [binary digits]

    before = self%per_one
    self%per_one = 1
    if (bound > 0) self%per_one = scale(1.0_real64, min(digits_of_bound - exponent(bound), maxexponent(bound) - 1))
    if (.not. before > 0 .or. self%units == 0) return
    finer = exponent(self%per_one) - exponent(before)
    if (finer > 0) self%units = self%units*2_int128**finer
    if (finer < 0) self%units = self%units/2_int128**min(-finer, 126)
  end subroutine choose_unit

  !> Adds a term, less what is below a unit.
  elemental subroutine add(self, term)
    class(exact_sum_t), intent(inout) :: self
    real(real64), intent(in) :: term
    real(real64) :: units

    units = term*self%per_one
    if (abs(units) < most_units) then
      self%units = self%units + int(units, int64)
    else
      self%units = self%units + int(units, int128)
    end if
  end subroutine add

  !> The sum so far.
  elemental function value(self)
    class(exact_sum_t), intent(in) :: self
    real(real64) :: value

    value = 0
    if (self%per_one > 0) value = real(self%units, real64)/self%per_one
  end function value

end module exact_sums
