!> The faces of the cells of a grid, and when a disk leaves its cell; the sides of the box are faces as well.
module cell_faces
  use kinds, only: int16, int32, never, real64
  use box_geometry, only: box_t, side_time
  use disks, only: disk_t
  use free_flight, only: time_to_line
  use neighbour_search, only: first_crossing
  implicit none
  private
  public :: cell_faces_t

  real(real64), parameter :: slowest = 1/never     !! a disk slower than this is at rest

  type :: cell_faces_t
    real(real64) :: width(2) = 0.0_real64          !! of a cell [length]
    real(real64) :: lower(2) = 0.0_real64          !! sides of the box [length]
    real(real64) :: upper(2) = 0.0_real64          !! [length]
    real(real64) :: walled(2) = 1.0_real64         !! 1 along an axis with walls, 0 if periodic
    integer(int32) :: last(0:3) = 0                !! column or row beyond which a face is a side: left, right, ...
  contains
    procedure :: set
    procedure :: next
    procedure :: next_falling
  end type cell_faces_t

contains

  !> Cuts the box into n(1) columns and n(2) rows of cells.
  subroutine set(self, box, n)
    class(cell_faces_t), intent(out) :: self
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: n(2)
    self%width = box%edges()/n*(1 + 4*epsilon(self%width))       ! the last face is not before the side
    self%lower = box%lower
    self%upper = box%upper
    self%last = [1, n(1), 1, n(2)]
    self%walled = merge(0, 1, box%periodic)
  end subroutine set

  !> When and how the disk leaves its cell on a straight line, or meets a side within it; which axis and
  !> which way are toss-ups: no branch on them.
  pure subroutine next(self, disk, cell, t, code)
    class(cell_faces_t), intent(in) :: self
    type(disk_t), intent(in) :: disk
    integer(int16), intent(in) :: cell(2)
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    real(real64) :: t_x, t_y
    integer(int32) :: face, up_x, up_y
    t_x = face_time(disk%x(1), disk%v(1), disk%clock, self%walled(1)*disk%radius, cell(1), self%width(1), &
      self%lower(1), self%upper(1))
    t_y = face_time(disk%x(2), disk%v(2), disk%clock, self%walled(2)*disk%radius, cell(2), self%width(2), &
      self%lower(2), self%upper(2))
    up_x = merge(1, 0, disk%v(1) > 0)
    up_y = merge(1, 0, disk%v(2) > 0)
    face = up_x + merge(1, 0, t_y < t_x)*(2 + up_y - up_x)
    code = merge(0, first_crossing, cell(1 + face/2) == self%last(face)) - face
    t = merge(t_y, t_x, t_y < t_x)
  end subroutine next

  !> The same along one axis. Contact with a side comes out as `side_time` has it: it is one event, whoever
  !> predicts it.
  pure function face_time(x, v, clock, inset, cell, width, lower, upper) result(t)
    real(real64), intent(in) :: x, v, clock
    real(real64), intent(in) :: inset             !! of the side: the disk's radius, or 0 if periodic [length]
    integer(int16), intent(in) :: cell
    real(real64), intent(in) :: width, lower, upper
    real(real64) :: t, line, first, last, speed
    line = lower + width*((cell - 0.5_real64) + sign(0.5_real64, v))
    first = lower + inset
    last = upper - inset
    line = merge(line, first, line > first)
    line = merge(line, last, line < last)
    speed = abs(v)
    t = (line - x)/sign(merge(speed, slowest, speed > slowest), v)
    t = clock + merge(t, 0.0_real64, t > 0)
    t = merge(t, never, speed > slowest)
  end function face_time

  !> The same on a parabola: each of the two faces along an axis can be the one, and the root before `now`, where
  !> the disk came in, is not.
  pure subroutine next_falling(self, box, disk, cell, now, t, code)
    class(cell_faces_t), intent(in) :: self
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int16), intent(in) :: cell(2)
    real(real64), intent(in) :: now
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    real(real64) :: line, side, t_k, sense
    integer(int32) :: face, axis
    t = never
    code = 0
    do face = 0, 3
      axis = 1 + face/2
      sense = 2*modulo(face, 2) - 1
      line = box%lower(axis) + self%width(axis)*(cell(axis) + min(sense, 0.0_real64))
      side = merge(box%upper(axis) - disk%radius, box%lower(axis) + disk%radius, sense > 0)
      if (sense*(line - side) >= 0) then
        t_k = side_time(box, disk, -face)
      else if (sense*(disk%v(axis) + box%gravity(axis)*(now - disk%clock)) <= 0 &
        .and. sense*box%gravity(axis) < 0) then
        cycle                                      ! flies away from this face, ever faster
      else
        t_k = max(now, disk%clock &
          + time_to_line(sense*(line - disk%x(axis)), sense*disk%v(axis), sense*box%gravity(axis)))
      end if
      if (t_k < t) then
        t = t_k
        code = merge(0, first_crossing, sense*(line - side) >= 0) - face
      end if
    end do
  end subroutine next_falling

end module cell_faces
