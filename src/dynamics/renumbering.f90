!> Sorts the disks in memory, so that neighbours in space become neighbours in memory.
module renumbering
  use kinds, only: int32, real64
  use disks, only: whole_disk_t
  use grid, only: grid_t
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  implicit none
  private
  public :: renumber

  !> Number of cells along the edge of a tile; the disks of a tile fill a memory page.
  integer(int32), parameter :: tile = 8

contains

  !> Sorts the disks by the cells of a grid with about one disk per cell. The cells are sorted by
  !> square tiles, so that the disks in a region of space occupy few memory pages. Disks in the same
  !> cell keep their order. The new order depends only on the state, and not on the search or the
  !> queue. The ids of the disks (`tag%id`) do not change.
  subroutine renumber(sim)
    type(simulation_t), intent(inout) :: sim
    type(grid_t) :: cells
    integer(int32), allocatable :: first(:), cell(:), order(:)
    integer(int32) :: n(2), c(2), i

    n = int(max(1.0_real64, min(sqrt(real(sim%n_disks(), real64)), 30000.0_real64)), int32)
    n = (n + tile - 1)/tile                       ! number of tiles
    call cells%divide(sim%box%lower, sim%box%edges(), tile*n)
    allocate (order(sim%n_disks()), cell(sim%n_disks()))
    cell = 1
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      c = cells%cell(sim%position(i)) - 1
      cell(i) = 1 + tile**2*dot_product(c/tile, [1, n(1)]) + dot_product(modulo(c, tile), [1, tile])
    end do
    call sort_by_count(cell, tile**2*product(n), first, order)
    call move_in_order(sim, order)
  end subroutine renumber

  !> Permutes the disks in place, without a second copy of all disks. Most disks are already close
  !> to their new position in memory.
  subroutine move_in_order(sim, order)
    type(simulation_t), intent(inout) :: sim
    !> On entry, the index of the disk that belongs at each position; on return, the identity
    !> permutation.
    integer(int32), intent(inout) :: order(:)
    type(whole_disk_t) :: held
    integer(int32) :: start, to, from

    do start = 1, sim%n_disks()
      if (order(start) == start) cycle
      held = sim%whole_disk(start)
      to = start
      do
        from = order(to)
        order(to) = to
        if (from == start) exit
        call sim%place_disk(to, sim%whole_disk(from))
        to = from
      end do
      call sim%place_disk(to, held)
    end do
  end subroutine move_in_order

end module renumbering
