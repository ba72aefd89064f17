!> Sorts the disks in memory such that neighbours in space become neighbours in memory.
module renumbering
  use kinds, only: int32, real64
  use disks, only: whole_disk_t
  use simulation_state, only: simulation_t
  use sorting, only: sort_by_count
  implicit none
  private
  public :: renumber

  integer(int32), parameter :: tile = 8  !! number of cells along the edge of a tile; the disks of a tile fill a memory page

contains

  !> Sorts the disks by the cells of a grid with about one disk per cell. The cells are sorted by square tiles, so that the disks in
  !> a region of space occupy few memory pages. Disks in the same cell keep their order. The new order depends on the state alone,
  !> and not on the search or the queue. The id of a disk (`tag%id`) does not change.
  subroutine renumber(sim)
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable :: first(:), place(:), cell(:), order(:)
    integer(int32) :: n(2), c(2), i

    n = int(max(1.0_real64, min(sqrt(real(sim%n_disks(), real64)), 30000.0_real64)), int32)
    n = (n + tile - 1)/tile                       ! number of tiles
    allocate (order(sim%n_disks()), place(sim%n_disks()), cell(sim%n_disks()))
    do i = 1, sim%n_disks()
      c = int(min(max((sim%position(i) - sim%box%lower)/sim%box%edges()*tile*n, 0.0_real64), tile*n - 1.0_real64), int32)
      cell(i) = 1 + tile**2*dot_product(c/tile, [1, n(1)]) + dot_product(modulo(c, tile), [1, tile])
    end do
    call sort_by_count(cell, tile**2*product(n), first, place)
    do i = 1, sim%n_disks()
      order(place(i)) = i
    end do
    call move_in_order(sim, order)
  end subroutine renumber

  !> Permutes the disks in place, without a second copy of all disks. Most disks are already near their new position in memory.
  subroutine move_in_order(sim, order)
    type(simulation_t), intent(inout) :: sim
    !> in: index of the disk that belongs at each position; out: the identity permutation.
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
