!> What a disk has around it: the end of its cell, and the disks it may meet before that.
module outlook
  use kinds, only: int32, real64
  use cell_faces, only: cell_faces_t
  use cells, only: cell_t, cells_t, gather, list_capacity
  use disks, only: disk_t, tag_t
  implicit none
  private
  public :: look_around, outlook_t

  !> What is around a disk. Not initialised: it is made for each prediction.
  type :: outlook_t
    real(real64) :: time                           !! when the disk leaves its cell or meets a side
    integer(int32) :: code                         !! of the crossing or the side
    integer(int32) :: cell                         !! its number
    integer(int32) :: n                            !! number of disks around
    integer(int32) :: list(list_capacity)          !! (n), counted from 0
  end type outlook_t

contains

  !> What is around disk i.
  subroutine look_around(faces, grid, cell, disk, tag, now, falling, i, near)
    type(cell_faces_t), intent(in) :: faces
    type(cells_t), intent(in) :: grid
    type(cell_t), intent(in) :: cell(0:*)          !! those of the grid
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(in) :: tag
    real(real64), intent(in) :: now
    logical, value :: falling
    integer(int32), value :: i
    type(outlook_t), intent(out) :: near

    call faces%next(disk, tag%cell, now, falling, near%time, near%code)
    near%cell = grid%number(tag%cell)
    call gather(cell, near%cell, grid%stride, i, near%list, near%n)
  end subroutine look_around

end module outlook
