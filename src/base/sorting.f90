!> Counting sort by small integer keys, such as cell numbers.
module sorting
  use kinds, only: int32
  implicit none
  private
  public :: sort_by_count

contains

  !> Computes the permutation that sorts the keys in ascending order. Items with equal keys keep
  !> their relative order.
  pure subroutine sort_by_count(key, n_keys, first, order)
    integer(int32), intent(in) :: key(:)                  !! (n) key of each item, from 1 to n_keys
    integer(int32), intent(in) :: n_keys
    !> Sorted position of the first item with each key; shape (n_keys+1), where the last element is
    !> n+1.
    integer(int32), allocatable, intent(out) :: first(:)
    integer(int32), intent(out) :: order(:)               !! (n) index of the item at each sorted position
    integer(int32), allocatable :: next(:)                ! sorted position of the next item with each key
    integer(int32) :: k

    allocate (next(n_keys + 1), source=0_int32)
    do k = 1, size(key, kind=int32)
      next(key(k) + 1) = next(key(k) + 1) + 1
    end do
    next(1) = 1
    do k = 1, n_keys
      next(k + 1) = next(k + 1) + next(k)
    end do
    first = next
    do k = 1, size(key, kind=int32)
      order(next(key(k))) = k
      next(key(k)) = next(key(k)) + 1
    end do
  end subroutine sort_by_count

end module sorting
