!> Sorting by counting, for items with small integer keys such as cell numbers.
module sorting
  use kinds, only: int32
  implicit none
  private
  public :: sort_by_count

contains

  !> Where each item goes so that the keys ascend; items with equal keys keep their order.
  pure subroutine sort_by_count(key, n_keys, first, place)
    integer(int32), intent(in) :: key(:)                  !! (n) from 1 to n_keys
    integer(int32), intent(in) :: n_keys
    integer(int32), allocatable, intent(out) :: first(:)  !! (n_keys+1) place of the first item of each key; n+1
    integer(int32), intent(out) :: place(:)               !! (n) of each item
    integer(int32) :: k

    allocate (first(n_keys + 1))
    first = 0
    do k = 1, size(key, kind=int32)
      first(key(k) + 1) = first(key(k) + 1) + 1
    end do
    first(1) = 1
    do k = 2, n_keys + 1
      first(k) = first(k) + first(k - 1)
    end do
    do k = 1, size(key, kind=int32)
      place(k) = first(key(k))
      first(key(k)) = first(key(k)) + 1
    end do
    do k = n_keys, 1, -1                                  ! each has moved on to the first item of the next key
      first(k + 1) = first(k)
    end do
    first(1) = 1
  end subroutine sort_by_count

end module sorting
