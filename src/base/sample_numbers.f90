!> Buffers for the numbers of a sample before they are written to the output file.
module sample_numbers
  use kinds, only: int64, real64
  implicit none
  private
  public :: first_values, sample_t

  !> One or more samples of the same quantities. Reals and integers are stored in separate arrays,
  !> each in the order of the quantities.
  type :: sample_t
    real(real64), allocatable :: reals(:, :)         !! (reals in a sample, samples)
    integer(int64), allocatable :: integers(:, :)    !! (integers in a sample, samples)
  contains
    procedure :: count => count_samples
    procedure :: make_room
    procedure :: first
    procedure :: insert
  end type sample_t

contains

  !> For each quantity, the index of its first value within the reals or the integers of a sample.
  pure function first_values(width, is_integer) result(first)
    integer, intent(in) :: width(:)                  !! number of values of each quantity
    logical, intent(in) :: is_integer(:)             !! whether the quantity has integer values
    integer :: first(size(width)), next(2), k, which

    next = 1
    do k = 1, size(width)
      which = merge(1, 2, is_integer(k))
      first(k) = next(which)
      next(which) = next(which) + width(k)
    end do
  end function first_values

  !> Number of samples.
  pure function count_samples(self) result(n)
    class(sample_t), intent(in) :: self
    integer(int64) :: n

    n = size(self%reals, 2, int64)
  end function count_samples

  !> Allocates `n` samples with the quantities of another sample.
  subroutine make_room(self, like, n)
    class(sample_t), intent(out) :: self
    type(sample_t), intent(in) :: like
    integer(int64), intent(in) :: n

    allocate (self%reals(size(like%reals, 1), n), self%integers(size(like%integers, 1), n))
  end subroutine make_room

  !> The first `n` samples.
  function first(self, n) result(part)
    class(sample_t), intent(in) :: self
    integer(int64), intent(in) :: n
    type(sample_t) :: part

    call part%make_room(self, n)      ! without this call gfortran 12 warns of uninitialised bounds
    part%reals = self%reals(:, :n)
    part%integers = self%integers(:, :n)
  end function first

  !> Keeps the first `n` samples and appends the samples of `new`.
  subroutine insert(self, n, new)
    class(sample_t), intent(inout) :: self
    integer(int64), intent(in) :: n
    type(sample_t), intent(in) :: new

    self%reals(:, n + 1:n + new%count()) = new%reals
    self%integers(:, n + 1:n + new%count()) = new%integers
  end subroutine insert

end module sample_numbers
