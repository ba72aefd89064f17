!> Sorting by counting, for items with small integer keys such as cell numbers.
module sorting
  use kinds, only: int32, int64
  use team, only: many, team_size
  implicit none
  private
  public :: sort_by_count

  integer(int32), parameter :: per_key = 8         !! items for each key from which several threads pay

contains

  !> Where each item goes so that the keys ascend; items with equal keys keep their order.
  subroutine sort_by_count(key, n_keys, first, place)
    integer(int32), intent(in) :: key(:)                  !! (n) from 1 to n_keys
    integer(int32), intent(in) :: n_keys
    integer(int32), allocatable, intent(out) :: first(:)  !! (n_keys+1) place of the first item of each key; n+1
    integer(int32), intent(out) :: place(:)               !! (n) of each item
    integer(int32), allocatable :: next(:, :)             ! (n_keys,blocks) place of the next item of each key in a block
    integer(int32) :: n, blocks, b, k, sum_so_far, items

    n = size(key, kind=int32)
    blocks = 1
    if (n >= many .and. n/per_key >= n_keys) blocks = team_size()
    allocate (first(n_keys + 1), next(n_keys, blocks))
    !$omp parallel do if (blocks > 1)
    do b = 1, blocks
      next(:, b) = 0
      do k = end_of(b - 1) + 1, end_of(b)
        next(key(k), b) = next(key(k), b) + 1
      end do
    end do
    !$omp end parallel do
    sum_so_far = 1
    do k = 1, n_keys
      first(k) = sum_so_far
      do b = 1, blocks
        items = next(k, b)
        next(k, b) = sum_so_far
        sum_so_far = sum_so_far + items
      end do
    end do
    first(n_keys + 1) = sum_so_far
    !$omp parallel do if (blocks > 1)
    do b = 1, blocks
      do k = end_of(b - 1) + 1, end_of(b)
        place(k) = next(key(k), b)
        next(key(k), b) = next(key(k), b) + 1
      end do
    end do
    !$omp end parallel do
  contains

    !> The last item of a block, each of which is for one thread.
    pure function end_of(block) result(last)
      integer(int32), intent(in) :: block
      integer(int32) :: last

      last = int(int(block, int64)*n/blocks, int32)
    end function end_of
  end subroutine sort_by_count

end module sorting
