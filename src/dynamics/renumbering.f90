!> Disks that are neighbours in space become neighbours in memory.
module renumbering
  use kinds, only: int32, real64
  use disks, only: disk_t, tag_t
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  implicit none
  private
  public :: renumber

  integer(int32), parameter :: tile = 8           !! cells along the side of a tile, whose disks fill a page

contains

  !> Sorts the disks by the cells of a grid with about one disk per cell, and the cells by square tiles, so that
  !> few pages hold a neighbourhood. The order follows from the state alone and is the same for every search
  !> and queue; `tag%id` keeps the order of the input.
  subroutine renumber(sim)
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable :: first(:), place(:), cell(:)
    integer(int32) :: n(2), c(2), i, k

    n = int(max(1.0_real64, min(sqrt(real(sim%n_disks(), real64)), 30000.0_real64)), int32)
    n = tile*((n + tile - 1)/tile)
    allocate (place(sim%n_disks()), cell(sim%n_disks()))
    do i = 1, sim%n_disks()
      c = int(min(max((sim%position(i) - sim%box%lower)/sim%box%edges()*n, 0.0_real64), n - 1.0_real64), int32)
      cell(i) = 1 + tile**2*dot_product(c/tile, [1, n(1)/tile]) + dot_product(modulo(c, tile), [1, tile])
    end do
    call sort_by_count(cell, product(n), first, place)
    deallocate (cell, first)
    do i = 1, sim%n_disks()
      do while (place(i) /= i)
        call swap(sim, i, place(i))
        k = place(i)
        place(i) = place(k)
        place(k) = k
      end do
    end do
  end subroutine renumber

  !> Lets the disks i and k trade places: no second copy of all disks is needed, and most are near already.
  pure subroutine swap(sim, i, k)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, k
    type(disk_t) :: disk
    type(tag_t) :: tag

    disk = sim%disk(i)
    sim%disk(i) = sim%disk(k)
    sim%disk(k) = disk
    tag = sim%tag(i)
    sim%tag(i) = sim%tag(k)
    sim%tag(k) = tag
    if (size(sim%extra) > 0) sim%extra(:, [i, k]) = sim%extra(:, [k, i])
  end subroutine swap

end module renumbering
