!> Search by cells in a sheared box. The cells beyond its bottom and top slide along x: a disk in the first or last row
!> meets more columns there than three, all that it can meet until they have slid by one column. Then it looks again,
!> which is an event like any other.
module sheared_cells
  use cell_grid, only: cell_grid_t
  use cell_scans, only: scan_cell
  use images, only: images_t
  use kinds, only: int16, int32, real64
  use neighbour_search, only: prospect_t
  use partners, only: axis_of, is_wall, looks_again
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: sheared_cells_t

  !> It has no big disks: all cells are made for the largest.
  type, extends(cell_grid_t) :: sheared_cells_t
  contains
    procedure :: cross
    procedure :: predict_with_care
  end type sheared_cells_t

contains

  !> Moves disk i into the next cell, unless it only looks again, and predicts there.
  subroutine cross(self, sim, i, code)
    class(sheared_cells_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code

    if (code /= looks_again) then
      if (is_wall(code)) then
        if (axis_of(code) == 2) call change_column(self, sim, i)
      end if
      call self%change_cell(sim, i, code)
    end if
    call self%predict(sim, i)
  end subroutine cross

  !> Moves disk i, which has passed the bottom or the top and so was displaced, into the column where it is now.
  subroutine change_column(self, sim, i)
    class(sheared_cells_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32) :: here(2)

    here = self%patch%cell_at(sim%position(i))
    call self%take_out(sim%tag(i), i)
    call self%insert(sim%tag(i), i, [int(here(1), int16), sim%tag(i)%cell(2)])
  end subroutine change_column

  !> Predicts a disk where there is more than nine cells with a few disks each.
  subroutine predict_with_care(self, sim, i)
    class(sheared_cells_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    type(images_t) :: images
    type(prospect_t) :: near
    real(real64) :: t
    integer(int32) :: row

    associate (cell => sim%tag(i)%cell)
      if (cell(2) > 1 .and. cell(2) < self%patch%n(2)) then
        call self%cell_grid_t%predict_with_care(sim, i)
        return
      end if
      near%disk = i
      call self%faces%next(sim%disk(i), cell, sim%now, .false., near%time, near%partner)
      images = sim%images()
      t = images%look_again(sim%now, self%patch%width(1))
      if (t < near%time) near%partner = looks_again
      near%time = min(t, near%time)
      do row = cell(2) - 1, cell(2) + 1
        call scan_row(self, sim, images, row, near)
      end do
    end associate
    sim%disk(i)%event_time = near%time
    sim%disk(i)%partner = near%partner
    sim%tag(i)%partner_stamp = sim%disk(max(near%partner, 1))%stamp
  end subroutine predict_with_care

  !> Contacts with the disks of one row. Disks two columns apart never touch: m columns ahead, in cells that are displaced
  !> by d columns, are those with |m + d| < 2.
  subroutine scan_row(self, sim, images, row, near)
    class(sheared_cells_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(images_t), intent(in) :: images
    integer(int32), intent(in) :: row              !! from 0, to 1 beyond the last
    type(prospect_t), intent(inout) :: near
    real(real64) :: displacement, periods
    integer(int32) :: column, low, high, image(2), there(2)

    associate (n => self%patch%n, own => sim%tag(near%disk)%cell(1))
      image(2) = merge(1, 0, row > n(2)) - merge(1, 0, row < 1)
      low = own - 1
      high = own + 1
      periods = 0
      if (image(2) /= 0) then
        displacement = images%displacement(real(image(2), real64), sim%now)
        periods = anint(displacement/images%period(1))
        column = own - nint((displacement - periods*images%period(1))/self%patch%width(1))
        low = column - merge(3, 2, image(2)*images%slip > 0)
        high = low + 5
      end if
      do column = low, high
        image(1) = floor(real(column - 1, real64)/n(1))
        there = [column, row] - image*n
        call scan_cell(self%cells, sim, self%cells%number(int(there, int16)), &
          images%image([image(1) - periods, real(image(2), real64)]), near)
      end do
    end associate
  end subroutine scan_row

end module sheared_cells
