!> Contacts with disks that the plain way through nine cells does not reach: those of crowded cells, those seen
!> through a periodic side, and single ones.
module cell_scans
  use kinds, only: int32, int64, real64
  use cell_contents, only: append, cell_contents_t
  use cell_faces, only: patch_t
  use images, only: image_t, images_t
  use neighbour_search, only: earliest_contact, list_capacity, prospect_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: scan_around_edge, scan_cell, scan_chains_around, scan_one

contains

  !> The contact with one disk, seen through an image.
  pure subroutine scan_one(sim, j, image, near)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: j
    type(image_t), intent(in) :: image             !! through which it is seen
    type(prospect_t), intent(inout) :: near

    near%n = 1
    near%list(1) = j - 1
    call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
  end subroutine scan_one

  !> Contacts with the disks of one cell, seen through an image.
  pure subroutine scan_cell(cells, sim, c, image, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c
    type(image_t), intent(in) :: image             !! through which it is seen
    type(prospect_t), intent(inout) :: near
    integer(int64) :: n

    n = 0
    call append(cells%cell(c), near%list, n)
    near%n = int(n, int32)
    call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
    call scan_chain(cells, sim, c, near, image)
  end subroutine scan_cell

  !> Contacts with the chained disks of a crowded cell.
  pure subroutine scan_chain(cells, sim, c, near, image)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c
    type(prospect_t), intent(inout) :: near
    type(image_t), intent(in), optional :: image   !! through which the cell is seen
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

  !> Contacts with the chained disks of the nine cells around a disk.
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

  !> Contacts where some of the nine cells are images beyond a periodic side; cells of the same image are scanned
  !> together. In a box of fewer than three columns a cell stands for several of its images.
  pure subroutine scan_around_edge(cells, patch, sim, near)
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    type(simulation_t), intent(in) :: sim
    type(prospect_t), intent(inout) :: near
    type(images_t) :: images
    type(image_t) :: image
    integer(int32) :: there(2, -1:1), number(2, -1:1), k, number_x, number_y, dx, dy, c
    integer(int64) :: n
    logical :: crowded

    there(:, 0) = sim%tag(near%disk)%cell
    there(:, 1) = merge(patch%next, there(:, 0) + 1, there(:, 0) == patch%last)
    there(:, -1) = merge(patch%last, there(:, 0) - 1, there(:, 0) == patch%next)
    do k = -1, 1
      number(:, k) = k*merge(1, 0, there(:, 0) == merge(patch%last, patch%next, k > 0))
    end do
    images = sim%images()
    do number_y = minval(number(2, :)), maxval(number(2, :))
      do number_x = minval(number(1, :)), maxval(number(1, :))
        image = images%image(real([number_x, number_y], real64))
        n = 0
        crowded = .false.
        do dy = -1, 1
          do dx = -1, 1
            if (number(1, dx) /= number_x .or. number(2, dy) /= number_y) cycle
            c = there(1, dx) + cells%stride*there(2, dy)
            call append(cells%cell(c), near%list, n)
            crowded = crowded .or. cells%chain(c) > 0
          end do
        end do
        near%n = int(n, int32)
        call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
        if (.not. crowded) cycle
        do dy = -1, 1
          do dx = -1, 1
            if (number(1, dx) /= number_x .or. number(2, dy) /= number_y) cycle
            call scan_chain(cells, sim, there(1, dx) + cells%stride*there(2, dy), near, image)
          end do
        end do
      end do
    end do
  end subroutine scan_around_edge

end module cell_scans
