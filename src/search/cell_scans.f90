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
  public :: scan_around_seam, scan_cell, scan_chains_around, scan_one

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

  !> Contacts where some of the nine cells are images beyond a periodic side, cells of one image together. If the images
  !> above and below slide, they are more columns, all that come near until they have slid by one: disks two columns apart
  !> never touch.
  subroutine scan_around_seam(cells, patch, sim, near)
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    type(simulation_t), intent(in) :: sim
    type(prospect_t), intent(inout) :: near
    type(images_t) :: images
    real(real64) :: displacement, periods(-1:1)
    integer(int32) :: own(2), dy, dx, low(-1:1), row(-1:1), above(-1:1), width, column, beside, c, seen(2)
    integer(int64) :: n
    integer :: pass

    images = sim%images()
    own = sim%tag(near%disk)%cell
    low = -1
    periods = 0
    do dy = -1, 1
      call patch%step(2, own(2), dy, row(dy), above(dy))
      if (above(dy) == 0 .or. .not. abs(images%slip) > 0) cycle
      displacement = images%displacement(real(above(dy), real64), sim%now)
      periods(above(dy)) = anint(displacement/images%period(1))
      low(dy) = -nint((displacement - periods(above(dy))*images%period(1))/patch%width(1)) &
        - merge(3, 2, above(dy)*images%slip > 0)
    end do
    n = 0
    seen = 0
    do pass = 1, 2                                 ! the box itself first
      do dy = -1, 1
        width = merge(5, 2, above(dy) /= 0 .and. abs(images%slip) > 0)
        do dx = low(dy), low(dy) + width
          call patch%step(1, own(1), dx, column, beside)
          if ((beside == 0 .and. above(dy) == 0) .neqv. pass == 1) cycle
          if (beside /= seen(1) .or. above(dy) /= seen(2)) call scan_listed()
          seen = [beside, above(dy)]
          c = column + cells%stride*row(dy)
          call append(cells%cell(c), near%list, n)
          if (cells%chain(c) == 0) cycle
          call scan_listed()
          call scan_chain(cells, sim, c, near, image())
        end do
      end do
    end do
    call scan_listed()

  contains

    !> That of the cells listed.
    type(image_t) function image()
      image = images%image([seen(1) - periods(seen(2)), real(seen(2), real64)])
    end function image

    !> Contacts with the disks listed so far.
    subroutine scan_listed()
      if (n == 0) return
      near%n = int(n, int32)
      n = 0
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image())
    end subroutine scan_listed
  end subroutine scan_around_seam

end module cell_scans
