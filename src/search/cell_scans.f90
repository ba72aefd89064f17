!> Contacts that the simple scan of nine cells does not include: with disks of crowded cells, across
!> a periodic side, and with single disks.
module cell_scans
  use kinds, only: int32, int64, real64
  use cell_contents, only: append, cell_contents_t
  use cell_faces, only: patch_t
  use images, only: image_t, images_t
  use neighbour_lists, only: neighbour_lists_t
  use neighbour_search, only: earliest_contact, list_capacity, no_gravity, prospect_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: scan_around_seam, scan_cells, scan_chains_around, scan_disks, scan_list

contains

  !> Finds contacts with given disks, seen through an image.
  pure subroutine scan_disks(sim, disks, image, near)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: disks(:)
    type(image_t), intent(in) :: image             !! image through which they are seen
    type(prospect_t), intent(inout) :: near
    integer(int32) :: first

    do first = 1, size(disks, kind=int32), list_capacity
      near%n = min(size(disks, kind=int32) - first + 1, list_capacity)
      near%list(:near%n) = disks(first:first + near%n - 1) - 1
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
    end do
  end subroutine scan_disks

  !> Finds contacts with the disks in the neighbour list of a disk.
  subroutine scan_list(lists, sim, images, falling, near)
    type(neighbour_lists_t), intent(in) :: lists
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    logical, intent(in) :: falling
    type(prospect_t), intent(inout) :: near
    integer(int32) :: j, k
    real(real64) :: image(2)

    near%n = 0
    do k = 1, lists%n_entries(near%disk)
      call lists%neighbour(near%disk, k, j, image)
      if (any(abs(image) > 0)) cycle
      if (near%n == list_capacity) call test_list()
      near%n = near%n + 1
      near%list(near%n) = j
    end do
    call test_list()
    do k = 1, lists%n_entries(near%disk)
      call lists%neighbour(near%disk, k, j, image)
      if (any(abs(image) > 0)) call scan_disks(sim, [j + 1], images%image(image), near)
    end do
  contains

    !> Tests the candidates. The literals let the compiler specialise the kernel.
    subroutine test_list()
      if (falling) then
        call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0)
      else
        call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, no_gravity)
      end if
      near%n = 0
    end subroutine test_list
  end subroutine scan_list

  !> Finds contacts with the disks of some cells, seen through an image.
  pure subroutine scan_cells(cells, sim, c, near, image)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c(:)             !! numbers of up to nine cells
    type(prospect_t), intent(inout) :: near
    type(image_t), intent(in) :: image             !! image through which they are seen
    integer(int64) :: n
    integer(int32) :: k, crowded

    n = 0
    crowded = 0
    do k = 1, size(c, kind=int32)
      call append(cells%cell(c(k)), near%list, n)
      crowded = max(crowded, cells%chain(c(k)))
    end do
    near%n = int(n, int32)
    if (n > 0) call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
    if (crowded == 0) return
    do k = 1, size(c, kind=int32)
      call scan_chain(cells, sim, c(k), near, image)
    end do
  end subroutine scan_cells

  !> Finds contacts with disks in the list of a crowded cell.
  pure subroutine scan_chain(cells, sim, c, near, image)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c
    type(prospect_t), intent(inout) :: near
    type(image_t), intent(in), optional :: image   !! image through which the cell is seen
    integer(int32) :: j

    j = cells%chain(c)
    do while (j > 0)
      near%n = 0
      do while (j > 0 .and. near%n < list_capacity)
        near%n = near%n + 1
        near%list(near%n) = j - 1
        j = cells%next(j)
      end do
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
    end do
  end subroutine scan_chain

  !> Finds contacts with disks in the lists of the nine cells around a disk.
  pure subroutine scan_chains_around(cells, sim, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    type(prospect_t), intent(inout) :: near
    integer(int32) :: row, c

    do row = near%cell - cells%stride, near%cell + cells%stride, cells%stride
      do c = row - 1, row + 1
        call scan_chain(cells, sim, c, near)
      end do
    end do
  end subroutine scan_chains_around

  !> Finds contacts where some of the nine cells are images across a periodic side; cells of one image are treated together. If
  !> the images above and below move along x, more columns are included: all that can be reached before the images have moved by one
  !> column. Disks two columns apart cannot touch.
  pure subroutine scan_around_seam(cells, patch, sim, images, near)
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    type(prospect_t), intent(inout) :: near
    real(real64) :: displacement, periods
    integer(int32) :: own(2), row(-1:1), above(-1:1), column(6), beside(6), columns, first, x, y, k, m, c(9), n

    own = sim%tag(near%disk)%cell
    do k = -1, 1
      call patch%step(2, own(2), k, row(k), above(k))
    end do
    do y = above(-1), above(1)
      first = -1
      columns = 3
      periods = 0
      if (y /= 0 .and. abs(images%velocity) > 0) then
        displacement = images%displacement(real(y, real64), sim%now)
        periods = anint(displacement/images%period(1))
        first = -nint((displacement - periods*images%period(1))/patch%width(1)) - merge(3, 2, y*images%velocity > 0)
        columns = 6
      end if
      do k = 1, columns
        call patch%step(1, own(1), first + k - 1, column(k), beside(k))
      end do
      do x = beside(1), beside(columns)
        n = 0
        do k = -1, 1
          if (above(k) /= y) cycle
          do m = 1, columns
            if (beside(m) /= x) cycle
            n = n + 1
            c(n) = column(m) + cells%stride*row(k)
          end do
        end do
        call scan_cells(cells, sim, c(:n), near, images%image([x - periods, real(y, real64)]))
      end do
    end do
  end subroutine scan_around_seam

end module cell_scans
