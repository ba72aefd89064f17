!> Contacts that the simple search of 3 x 3 cells does not find: contacts with disks in linked lists
!> of crowded cells, with disks across a periodic side, with obstacles, and with big disks.
module cell_scans
  use kinds, only: int32, int64, real64
  use box_geometry, only: find_image_contact, stays_clear
  use cell_contents, only: append, cell_capacity, cell_contents_t
  use cell_layout, only: cell_layout_t
  use images, only: image_t, images_t
  use neighbour_lists, only: neighbour_lists_t
  use event_prediction, only: earliest_contact, latest_clock, list_capacity, no_gravity, prediction_t
  use grid, only: entry_t
  use object_lists, only: object_lists_t, place_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: add_chains_around, scan_around_seam, scan_disks, scan_list, scan_reach, scan_rim, test_list

contains

  !> Tests the candidates in `near` and empties the list. With literal arguments of
  !> `earliest_contact`, the compiler generates specialised versions.
  subroutine test_list(sim, known, near)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near

    if (near%n == 0) return
    select case (known)
    case (latest_clock + no_gravity)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, latest_clock + no_gravity)
    case (no_gravity)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, no_gravity)
    case (latest_clock)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, latest_clock)
    case default
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0)
    end select
    near%n = 0
  end subroutine test_list

  !> Tests the candidates in `near`, which are all in the same periodic image of the box, and
  !> empties the list.
  subroutine test_through_image(sim, known, image, near)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known
    type(image_t), intent(in) :: image
    type(prediction_t), intent(inout) :: near

    select case (known)
    case (latest_clock + no_gravity)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, latest_clock + no_gravity, image)
    case (no_gravity)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, no_gravity, image)
    case (latest_clock)
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, latest_clock, image)
    case default
      call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, image)
    end select
    near%n = 0
  end subroutine test_through_image

  !> Finds contacts with given disks, which are all in the same periodic image of the box.
  subroutine scan_disks(sim, disks, image, known, near)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: disks(:)
    type(image_t), intent(in) :: image             !! periodic image of the box that contains the candidates
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: first

    do first = 1, size(disks, kind=int32), list_capacity
      near%n = min(size(disks, kind=int32) - first + 1, list_capacity)
      near%list(:near%n) = disks(first:first + near%n - 1) - 1
      call test_through_image(sim, known, image, near)
    end do
  end subroutine scan_disks

  !> Finds contacts of a small disk with the obstacles and big disks that reach into its cell.
  subroutine scan_reach(reach, first, sim, images, known, near)
    type(object_lists_t), intent(in) :: reach
    integer(int32), intent(in) :: first            !! first entry in the list of the cell
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    type(entry_t) :: entry                         ! the compiler keeps a local copy in registers
    integer(int32) :: next                         ! index of the next list entry
    integer(int32) :: last(2)                      ! periodic image of the candidates in `near`
    ! index of an obstacle's image; shift to this image [length]
    real(real64) :: number(2), shift(2)
    logical :: falling                             ! whether gravity acts on the disks

    near%n = 0
    falling = iand(known, no_gravity) == 0
    next = first
    associate (disk => sim%disk(near%disk), last_partner => sim%tag(near%disk)%last_partner)
      do while (next > 0)
        entry = reach%entry(next)
        next = entry%next
        if (entry%code <= 0) then
          number = entry%image
          shift = images%shift(number)
          if (.not. stays_clear(sim%box%box_t, disk, entry%code, shift, near%time, falling)) &
            call find_image_contact(sim%box%box_t, disk, last_partner, entry%code, shift, near%time, near%partner)
        else
          if (near%n > 0 .and. (near%n == list_capacity .or. any(entry%image /= last))) call test_disks()
          last = entry%image
          near%n = near%n + 1
          near%list(near%n) = entry%code - 1
        end if
      end do
    end associate
    if (near%n > 0) call test_disks()
  contains

    !> Tests those candidates that are big disks. The candidates are all in the same periodic image
    !> of the box.
    subroutine test_disks()
      if (all(last == 0)) then
        call test_list(sim, known, near)
      else
        call test_through_image(sim, known, images%image(real(last, real64)), near)
      end if
    end subroutine test_disks
  end subroutine scan_reach

  !> Finds contacts of a disk with the disks in its neighbour list.
  subroutine scan_list(lists, sim, images, known, near)
    type(neighbour_lists_t), intent(in) :: lists
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: j, k
    real(real64) :: image(2)

    near%n = 0
    do k = 1, lists%n_entries(near%disk)
      call lists%neighbour(near%disk, k, j, image)
      if (any(abs(image) > 0)) cycle
      if (near%n == list_capacity) call test_list(sim, known, near)
      near%n = near%n + 1
      near%list(near%n) = j
    end do
    call test_list(sim, known, near)
    do k = 1, lists%n_entries(near%disk)
      call lists%neighbour(near%disk, k, j, image)
      if (any(abs(image) > 0)) call scan_disks(sim, [j + 1], images%image(image), known, near)
    end do
  end subroutine scan_list

  !> Finds contacts with the disks in given cells, which are all in the same periodic image of the
  !> box.
  subroutine scan_cells(cells, sim, c, images, number, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c(:)             !! numbers of up to nine cells
    type(images_t), intent(in) :: images
    real(real64), intent(in) :: number(2)          !! index of the image that contains the cells
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int64) :: n
    integer(int32) :: k

    n = 0
    do k = 1, size(c, kind=int32)
      call append(cells%cell(c(k)), near%list, n)
    end do
    near%n = int(n, int32)
    do k = 1, size(c, kind=int32)
      call add_chain(cells, sim, c(k), images, number, known, near)
    end do
    if (near%n > 0) call test_through_image(sim, known, images%image(number), near)
  end subroutine scan_cells

  !> Adds the disks in the linked list of a crowded cell to the candidates. The first of them is
  !> also in a slot.
  subroutine add_chain(cells, sim, c, images, number, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: c                !! number of the cell
    type(images_t), intent(in) :: images
    real(real64), intent(in) :: number(2)          !! index of the image that contains the cell
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: j

    j = cells%chain(c)
    if (j > 0) j = cells%next(j)
    do while (j > 0)
      if (near%n == list_capacity) call test_through_image(sim, known, images%image(number), near)
      near%n = near%n + 1
      near%list(near%n) = j - 1
      j = cells%next(j)
    end do
  end subroutine add_chain

  !> Finds contacts of a big disk with small disks in the cells along its rim. Cells of the same
  !> periodic image are searched together.
  subroutine scan_rim(cells, sim, rim, images, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    type(place_t), intent(in) :: rim(:)
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: m, n, c(9)

    n = 0
    do m = 1, size(rim, kind=int32)
      n = n + 1
      c(n) = rim(m)%cell(1) + cells%stride*rim(m)%cell(2)
      if (m < size(rim) .and. n < size(c)) then
        if (all(rim(m + 1)%image == rim(m)%image)) cycle
      end if
      call scan_cells(cells, sim, c(:n), images, real(-rim(m)%image, real64), known, near)
      n = 0
    end do
  end subroutine scan_rim

  !> Adds disks in linked lists to the candidates found by `gather`. Linked lists exist in the
  !> crowded cells among the cell of a disk and its eight neighbours.
  subroutine add_chains_around(cells, sim, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: row, c, j

    do row = near%cell - cells%stride, near%cell + cells%stride, cells%stride
      do c = row - 1, row + 1
        ! The first disk of a linked list is also in a slot. It is therefore already a candidate,
        ! unless `gather` left it out.
        j = cells%chain(c)
        if (j > 0 .and. c /= near%cell) j = cells%next(j)
        do while (j > 0)
          if (near%n == list_capacity) call test_list(sim, known, near)
          near%n = near%n + 1
          near%list(near%n) = j - 1
          j = cells%next(j)
        end do
      end do
    end do
  end subroutine add_chains_around

  !> Finds contacts of a disk near a periodic side. Some of the 3 x 3 cells around this disk lie
  !> beyond the side. Cells of the same periodic image are searched together. A sheared box, whose
  !> images above and below move along x, requires `scan_around_moving_seam` instead.
  subroutine scan_around_seam(cells, layout, sim, images, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: own(2), row(-1:1), above(-1:1), column(-1:1), beside(-1:1), low, high, left, right, k

    if (abs(images%velocity) > 0) then
      call scan_around_moving_seam(cells, layout, sim, images, known, near)
      return
    end if
    own = sim%tag(near%disk)%cell
    do k = -1, 1
      call layout%step(1, own(1), k, column(k), beside(k))
      call layout%step(2, own(2), k, row(k), above(k))
    end do
    low = -1
    do while (low <= 1)                            ! rows of the same image are adjacent
      high = last_alike(above, low)
      left = -1
      do while (left <= 1)
        right = last_alike(beside, left)
        call scan_block()
        left = right + 1
      end do
      low = high + 1
    end do
  contains

    !> The last of the adjacent rows or columns that are in the same image as a given row or column.
    pure function last_alike(image, first) result(last)
      integer(int32), intent(in) :: image(-1:1), first
      integer(int32) :: last

      last = first
      if (first < 1) last = first + merge(1, 0, image(first + 1) == image(first))
      if (first < 0 .and. image(1) == image(first)) last = 1
    end function last_alike

    !> Tests the disks in a block of cells, which are all in the same periodic image.
    subroutine scan_block()
      integer(int64) :: n
      integer(int32) :: c, k, m, fullest

      n = 0
      fullest = 0
      do k = low, high
        do m = left, right
          c = column(m) + cells%stride*row(k)
          call append(cells%cell(c), near%list, n)
          fullest = max(fullest, cells%cell(c)%in_slots())
        end do
      end do
      near%n = int(n, int32)
      if (near%n == 0) return
      associate (number => real([beside(left), above(low)], real64))
        if (fullest == cell_capacity) then
          do k = low, high
            do m = left, right
              call add_chain(cells, sim, column(m) + cells%stride*row(k), images, number, known, near)
            end do
          end do
        end if
        if (beside(left) == 0 .and. above(low) == 0) then
          call test_list(sim, known, near)
        else
          call test_through_image(sim, known, images%image(number), near)
        end if
      end associate
    end subroutine scan_block
  end subroutine scan_around_seam

  !> Version of `scan_around_seam` for sheared boxes, whose images above and below move along x. In
  !> these images six columns are searched instead of three. No contact is then missed before the
  !> images have moved by the width of a column.
  subroutine scan_around_moving_seam(cells, layout, sim, images, known, near)
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    real(real64) :: displacement, periods
    integer(int32) :: own(2), row(-1:1), above(-1:1), column(6), beside(6), columns, first, x, y, k, m, c(9), n

    own = sim%tag(near%disk)%cell
    do k = -1, 1
      call layout%step(2, own(2), k, row(k), above(k))
    end do
    do y = above(-1), above(1)
      first = -1
      columns = 3
      periods = 0
      if (y /= 0) then
        displacement = images%displacement(real(y, real64), sim%now)
        periods = anint(displacement/images%period(1))
        first = -nint((displacement - periods*images%period(1))/layout%width(1)) - merge(3, 2, y*images%velocity > 0)
        columns = 6
      end if
      do k = 1, columns
        call layout%step(1, own(1), first + k - 1, column(k), beside(k))
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
        call scan_cells(cells, sim, c(:n), images, [x - periods, real(y, real64)], known, near)
      end do
    end do
  end subroutine scan_around_moving_seam

end module cell_scans
