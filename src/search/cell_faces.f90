!> Faces of the cells, including the sides of the box, and the times when disks cross them.
!>
!> Neighbouring cells overlap. The overlap is as large as possible under the condition that two
!> disks in contact are always in the same cell or in adjacent cells. A disk in an overlap is
!> assigned to the cell that it will leave last. If the cells are much wider than the disks, this
!> halves the number of cell crossings.
module cell_faces
  use kinds, only: int16, int32, never, real64
  use box_state, only: box_state_t, side_time
  use cell_layout, only: cell_layout_t
  use disks, only: disk_t
  use free_flight, only: flight, flight_velocity, negligible_speed, time_to_line
  use event_prediction, only: prediction_t
  use partners, only: crossing, is_wall, n_sides, nothing, sense_of, side_crossed
  use shapes, only: spare
  implicit none
  private
  public :: cell_faces_t, line_t

  !> A line parallel to an axis that bounds a cell: a face of a column or row of cells, or a side of
  !> the box.
  type :: line_t
    real(real64) :: place = 0.0_real64             !! position of the face or side [length]
    !> Signed distance from the line to the centre of a disk at the event, in units of the radius: 1
    !> for a left or bottom wall, -1 for a right or top wall, 0 for a face and for a periodic or
    !> open side.
    real(real64) :: inset = 0.0_real64
    integer(int32) :: code = 0                     !! code of the event: contact with a side, or cell crossing
    logical :: struck = .false.                    !! whether a moving side may touch disks in this cell
  end type line_t

  type :: cell_faces_t
    real(real64) :: width(2) = 0.0_real64          !! distance between adjacent cells [length]
    real(real64) :: overlap(2) = 0.0_real64        !! width of the overlap of neighbouring cells [length]
    logical :: moving = .false.                    !! whether the box has moving sides
    !> Whether gravity acts or sides move, so that both faces of an axis must be tested.
    logical :: falling = .false.
    logical :: periodic(2) = .false.               !! whether the box is periodic along each axis
    ! A piston can eventually reach every part of the box. Until it has moved by one cell width,
    ! however, it can touch only disks in a few adjacent columns or rows, called its strip. `due` is
    ! the earliest time when any piston leaves its strip, relative to `box%epoch` [time]
    real(real64) :: due = never
    !> Centre of the strip of each piston, as inward displacement from the mean position of the side
    !> [length].
    real(real64) :: centre(n_sides) = 0.0_real64
    !> Maximum distance of a disk beyond the mean position of each side; shape (axis, lower or upper
    !> side) [length].
    real(real64) :: beyond(2, 2) = 0.0_real64
    type(line_t), allocatable :: column(:, :)     !! left and right faces of each column; shape (0:1, columns)
    type(line_t), allocatable :: row(:, :)         !! lower and upper faces of each row; shape (0:1, rows)
  contains
    procedure :: set
    procedure :: find_strips
    procedure :: watch_pistons
    procedure :: rectangle
    procedure :: choose_cell
    procedure :: next
    procedure :: next_within
    procedure, private :: next_falling
  end type cell_faces_t

contains

  !> Sets up the faces of the cells in a block.
  subroutine set(self, box, layout, now)
    class(cell_faces_t), intent(out) :: self
    type(box_state_t), intent(in) :: box
    type(cell_layout_t), intent(in) :: layout
    real(real64), intent(in) :: now

    self%width = layout%width
    self%overlap = max(self%width - layout%reach, 0.0_real64)
    self%moving = any(box%side%moves())
    self%falling = box%has_gravity() .or. self%moving
    self%periodic = box%periodic
    self%beyond = box%side_excursion()
    where (transpose(reshape(box%side%is_piston(), [2, 2]))) self%beyond = never
    call cut(1, self%column)
    call cut(2, self%row)
    call find_struck(1, self%column)
    call find_struck(2, self%row)
    call self%find_strips(box, layout%small, now)
  contains

    !> Sets up the faces of columns (axis 1) or rows (axis 2).
    pure subroutine cut(axis, line)
      integer(int32), intent(in) :: axis
      type(line_t), allocatable, intent(out) :: line(:, :)
      integer(int32) :: low, high, inset(2), k, place

      low = 2 - 2*axis                               ! codes of the two sides
      high = low - 1
      inset = merge(0, 1, box%periodic(axis) .or. box%open([1 - low, 1 - high]))
      allocate (line(0:1, layout%n(axis)))
      do k = 1, layout%n(axis)
        place = layout%place_of(k, axis)
        line(0, k) = line_t(box%lower(axis) + self%width(axis)*(place - 1) - 0.5_real64*self%overlap(axis), &
          0.0_real64, crossing(low))
        line(1, k) = line_t(box%lower(axis) + self%width(axis)*place + 0.5_real64*self%overlap(axis), &
          0.0_real64, crossing(high))
        if (place == 1) line(0, k) = line_t(box%lower(axis), inset(1), low)
        if (place == layout%whole(axis)) line(1, k) = line_t(box%upper(axis), -inset(2), high)
      end do
    end subroutine cut

    !> Finds the columns (axis 1) or rows (axis 2) in which a moving side may touch disks.
    pure subroutine find_struck(axis, line)
      integer, intent(in) :: axis
      type(line_t), intent(inout) :: line(0:, :)
      real(real64) :: reach(2, 2)
      logical :: moves(n_sides)

      reach = box%side_excursion()
      moves = box%side%moves()
      associate (within => (reach(axis, :) + layout%small)*(1 + spare))
        line(0, :)%struck = moves(2*axis - 1) .and. line(0, :)%place <= box%lower(axis) + within(1)
        line(1, :)%struck = moves(2*axis) .and. line(1, :)%place >= box%upper(axis) - within(2)
      end associate
    end subroutine find_struck
  end subroutine set

  !> Finds the columns and rows in which a piston may touch disks before it has moved by one cell
  !> width. The outermost cells also contain the disks beyond the grid. A piston outside the grid
  !> may therefore touch the disks in these cells.
  pure subroutine find_strips(self, box, small, now)
    class(cell_faces_t), intent(inout) :: self
    type(box_state_t), intent(in) :: box
    real(real64), intent(in) :: small              !! maximum radius [length]
    real(real64), intent(in) :: now
    integer :: k

    do k = 1, n_sides
      if (.not. box%side(k)%is_piston()) cycle
      self%centre(k) = max(box%side_position(k, now), 0.0_real64)
      if (k <= 2) call mark(self%column, 1)
      if (k > 2) call mark(self%row, 2)
    end do
    call self%watch_pistons(box, now)
  contains

    !> Marks the columns (axis 1) or rows (axis 2) in the strip of a piston.
    pure subroutine mark(line, axis)
      type(line_t), intent(inout) :: line(0:, :)
      integer, intent(in) :: axis
      real(real64) :: x, room
      integer :: high

      high = 1 - modulo(k, 2)
      x = merge(box%upper(axis) - self%centre(k), box%lower(axis) + self%centre(k), high == 1)
      x = min(max(x, box%lower(axis)), box%upper(axis))
      room = (self%width(axis) + small)*(1 + spare)
      line(high, :)%struck = (line(0, :)%place <= x + room .and. line(1, :)%place >= x - room) .or. line(high, :)%code == 1 - k
    end subroutine mark
  end subroutine find_strips

  !> Finds the earliest time when any piston leaves its strip. The result is valid until the next
  !> collision of a disk with a piston.
  pure subroutine watch_pistons(self, box, now)
    class(cell_faces_t), intent(inout) :: self
    type(box_state_t), intent(in) :: box
    real(real64), intent(in) :: now
    real(real64) :: ahead, outwards
    integer :: k

    self%due = never
    do k = 1, n_sides
      if (.not. box%side(k)%is_piston()) cycle
      associate (width => self%width((k + 1)/2))
        ahead = box%side_position(k, now) - self%centre(k)
        outwards = never
        if (self%centre(k) > width) outwards = max(width + ahead, 0.0_real64)
        self%due = min(self%due, now + box%side(k)%motion%leaving_time(box%side_velocity(k, now), &
          max(width - ahead, 0.0_real64), outwards))
      end associate
    end do
  end subroutine watch_pistons

  !> Rectangle that contains the centres of all disks in a cell. At a side of the box, the rectangle
  !> extends to the outermost position of that side. Towards a piston it is unbounded.
  pure subroutine rectangle(self, cell, n, low, high)
    class(cell_faces_t), intent(in) :: self
    integer(int32), intent(in) :: cell(2)          !! column and row in the grid of the whole box
    integer(int32), intent(in) :: n(2)             !! numbers of columns and rows of the box
    real(real64), intent(out) :: low(2), high(2)   !! relative to the lower left corner of the box [length]

    low = self%width*(cell - 1) - 0.5_real64*self%overlap - merge(self%beyond(:, 1), 0.0_real64, cell == 1)
    high = self%width*cell + 0.5_real64*self%overlap + merge(self%beyond(:, 2), 0.0_real64, cell == n)
  end subroutine rectangle

  !> Among the overlapping cells that contain the disk, chooses the cell that the disk will leave
  !> last.
  pure subroutine choose_cell(self, gravity, disk, now, cell)
    class(cell_faces_t), intent(in) :: self
    real(real64), intent(in) :: gravity(2)         !! [length/time**2]
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    integer(int16), intent(inout) :: cell(2)       !! on entry, any cell that contains the disk
    real(real64) :: s

    s = now - disk%clock
    cell(1) = cell(1) + ahead(self%column, self%overlap(1), disk%x(1), disk%v(1), gravity(1), s, cell(1))
    cell(2) = cell(2) + ahead(self%row, self%overlap(2), disk%x(2), disk%v(2), gravity(2), s, cell(2))
  end subroutine choose_cell

  !> Change of the column or row of a disk along one axis. The change is 1 or -1 if the next cell in
  !> the direction of motion also contains the disk, otherwise 0.
  pure function ahead(line, overlap, x, v, g, s, cell) result(step)
    type(line_t), intent(in) :: line(0:1, *)
    real(real64), intent(in) :: overlap, x, v, g, s
    integer(int16), intent(in) :: cell
    integer(int16) :: step
    real(real64) :: left
    integer(int32) :: up

    up = merge(1, 0, flight_velocity(v, g, s) > 0)
    left = abs(line(up, cell)%place - flight(x, v, g, s))
    step = int(chosen(0_int32, 2*up - 1, left < overlap .and. .not. is_wall(line(up, cell)%code)), int16)
  end function ahead

  !> Selects `second` if the condition is true, otherwise `first`. No branch is used, because it
  !> would often be mispredicted.
  elemental function chosen(first, second, condition) result(n)
    integer(int32), intent(in) :: first, second
    logical, intent(in) :: condition
    integer(int32) :: n

    n = ieor(first, iand(-merge(1, 0, condition), ieor(first, second)))
  end function chosen

  !> Finds the earliest event at which the disk leaves its cell or touches a side in it.
  pure subroutine next(self, box, disk, cell, now, falling, near)
    class(cell_faces_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int16), intent(in) :: cell(2)
    real(real64), intent(in) :: now
    logical, intent(in) :: falling
    type(prediction_t), intent(inout) :: near        !! the time and partner of the earliest event are set

    if (falling) then
      call self%next_falling(box, self%column(:, cell(1)), self%row(:, cell(2)), disk, now, near)
    else
      call next_straight(self%column, self%row, disk, cell, near%time, near%partner)
    end if
  end subroutine next

  !> Finds the earliest event at which the disk reaches one of four lines around it. The lines are
  !> the faces of its cell, or closer lines that bound its neighbourhood.
  pure subroutine next_within(self, box, column, row, disk, now, near)
    class(cell_faces_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(line_t), intent(in) :: column(0:1), row(0:1)
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    type(prediction_t), intent(inout) :: near        !! the time and partner of the earliest event are set

    if (self%falling) then
      call self%next_falling(box, column, row, disk, now, near)
    else
      call next_straight(column, row, disk, [1_int16, 1_int16], near%time, near%partner)
    end if
  end subroutine next_within

  !> Version of `next_within` for straight paths. Axis and direction are selected without branches,
  !> which would often be mispredicted.
  pure subroutine next_straight(column, row, disk, cell, t, code)
    type(line_t), intent(in) :: column(0:1, *), row(0:1, *)
    type(disk_t), intent(in) :: disk
    integer(int16), intent(in) :: cell(2)
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    real(real64) :: t_x, t_y
    integer(int32) :: up_x, up_y

    up_x = merge(1, 0, disk%v(1) > 0)
    up_y = merge(1, 0, disk%v(2) > 0)
    t_x = line_time(column(up_x, cell(1)), disk, 1)
    t_y = line_time(row(up_y, cell(2)), disk, 2)
    code = chosen(column(up_x, cell(1))%code, row(up_y, cell(2))%code, t_y < t_x)
    t = merge(t_y, t_x, t_y < t_x)
  end subroutine next_straight

  !> Time at which a disk on a straight path reaches the line ahead along one axis. If the line is a
  !> side, the time is bit-identical to the result of `side_time`, because the result must not
  !> depend on the procedure that predicts a collision.
  pure function line_time(line, disk, axis) result(t)
    type(line_t), intent(in) :: line
    type(disk_t), intent(in) :: disk
    integer, intent(in) :: axis
    real(real64) :: t, speed

    speed = abs(disk%v(axis))
    t = ((line%place + line%inset*disk%radius) - disk%x(axis))/ &
      sign(merge(speed, negligible_speed, speed > negligible_speed), disk%v(axis))
    t = disk%clock + merge(t, 0.0_real64, t > 0)
    t = merge(t, never, speed > negligible_speed)
  end function line_time

  !> Version of `next_within` for parabolic paths and for boxes with moving sides.
  pure subroutine next_falling(self, box, column, row, disk, now, near)
    class(cell_faces_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(line_t), intent(in) :: column(0:1), row(0:1)
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    type(prediction_t), intent(inout) :: near        !! the time and partner of the earliest event are set
    real(real64) :: t_x, t_y
    integer(int32) :: code_x, code_y

    if (self%moving) then
      call next_beside(box, column, 1, disk, now, t_x, code_x)
      call next_beside(box, row, 2, disk, now, t_y, code_y)
    else
      call next_along(box, column, 1, disk, now, t_x, code_x)
      call next_along(box, row, 2, disk, now, t_y, code_y)
    end if
    near%partner = chosen(code_x, code_y, t_y < t_x)
    near%time = merge(t_y, t_x, t_y < t_x)
  end subroutine next_falling

  !> Version of `next_falling` for a single axis without moving sides.
  pure subroutine next_along(box, line, axis, disk, now, t, code)
    type(box_state_t), intent(in) :: box
    type(line_t), intent(in) :: line(0:1)          !! faces of the cell of the disk
    integer(int32), intent(in) :: axis
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    real(real64) :: g, x, v, sense, gap, disc, t_other
    integer(int32) :: up

    g = box%gravity(axis)
    up = merge(1, 0, disk%v(axis) > 0)
    if (.not. abs(g) > 0) then
      t = line_time(line(up), disk, axis)
    else if (any(is_wall(line%code))) then
      t = falling_time(line(up), axis, box, disk, now)
      t_other = falling_time(line(1 - up), axis, box, disk, now)
      up = chosen(up, 1 - up, t_other < t)
      t = min(t, t_other)
    else                                           ! face ahead, or face behind if gravity reverses the motion
      x = flight(disk%x(axis), disk%v(axis), g, now - disk%clock)
      v = flight_velocity(disk%v(axis), g, now - disk%clock)
      up = merge(1, 0, v > -g*resolution(now))
      sense = 2*up - 1                             ! simplified formulas of `time_to_line`
      gap = max(sense*(line(up)%place - x), 0.0_real64)
      disc = (v*v + tiny(v)) + 2*sense*g*gap       ! positive even for a disk at rest on the face
      if (disc >= 0) then
        t = now + 2*gap/(abs(v) + sqrt(disc))
      else
        up = 1 - up
        gap = max(sense*(x - line(up)%place), 0.0_real64)
        t = now + (abs(v) + sqrt(v*v - 2*sense*g*gap))/(-sense*g)
      end if
    end if
    code = line(up)%code
  end subroutine next_along

  !> Version of `next_falling` for a single axis of a box with moving sides.
  pure subroutine next_beside(box, line, axis, disk, now, t, code)
    type(box_state_t), intent(in) :: box
    type(line_t), intent(in) :: line(0:1)          !! faces of the cell of the disk
    integer(int32), intent(in) :: axis
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code

    if (any(line%struck)) then
      call next_moving(line, axis, box, disk, now, t, code)
    else
      call next_along(box, line, axis, disk, now, t, code)
    end if
  end subroutine next_beside

  !> Version of `next_along` for a cell in which a moving side may touch disks, even if the side is
  !> not a face of the cell.
  pure subroutine next_moving(line, axis, box, disk, now, t, code)
    type(line_t), intent(in) :: line(0:1)          !! faces of the cell of the disk
    integer(int32), intent(in) :: axis
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    integer(int32) :: event(4), k, k_side
    real(real64) :: t_k

    k_side = 2 - 2*axis                            ! code of the lower side
    event(:2) = merge([k_side, k_side - 1], [nothing, nothing], line%struck)
    event(3:) = merge(nothing, line%code, line%code == event(:2))
    t = never
    code = line(0)%code
    do k = 1, size(event)
      if (event(k) == nothing) cycle
      if (is_wall(event(k))) t_k = side_time(box, disk, event(k))
      if (.not. is_wall(event(k))) t_k = falling_time(line(modulo(k - 1, 2)), axis, box, disk, now)
      if (t_k < t) code = event(k)
      t = min(t, t_k)
    end do
  end subroutine next_moving

  !> Time at which a disk on a parabolic path reaches a face or side. The equation of motion has an
  !> earlier root, the time at which the disk entered the cell. This root is excluded.
  pure function falling_time(line, axis, box, disk, now) result(t)
    type(line_t), intent(in) :: line
    integer(int32), intent(in) :: axis
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    real(real64) :: t, sense, g

    if (is_wall(line%code)) then
      t = side_time(box, disk, line%code)
      return
    end if
    t = never
    sense = sense_of(side_crossed(line%code))
    g = box%gravity(axis)
    if (sense*flight_velocity(disk%v(axis), g, now - disk%clock + resolution(now)) <= 0 &
      .and. sense*g < 0) return                    ! accelerating away from the line
    t = max(now, disk%clock + time_to_line(sense*(line%place - disk%x(axis)), sense*disk%v(axis), sense*g))
  end function falling_time

  !> Smallest time difference resolved at the time `now`. Without this limit, a disk that turns
  !> round at a face could cross the face infinitely often.
  elemental function resolution(now)
    real(real64), intent(in) :: now
    real(real64) :: resolution

    resolution = 4*epsilon(now)*now + tiny(now)
  end function resolution

end module cell_faces
