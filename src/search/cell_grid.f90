!> Search by cells: the box is cut into cells at least one diameter wide, so that a disk meets only those in
!> its own cell and the eight around it before it leaves its cell, which is an event like any other. Wider cells
!> overlap (see `cell_faces`).
module cell_grid
  use kinds, only: int16, int32, int64, real64
  use big_disks, only: big_disks_t, largest_small_radius, ring_cell_t
  use box_geometry, only: next_obstacle, next_side
  use cell_faces, only: cell_faces_t
  use cells, only: append, cell_t, cells_t, gather, list_capacity
  use disks, only: disk_t, tag_t
  use free_flight, only: time_to_circle
  use neighbour_search, only: earliest_contact, first_crossing, neighbour_search_t
  use obstacle_lists, only: obstacle_lists_t
  use outlook, only: look_around, outlook_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: cell_grid_t

  real(real64), parameter :: disks_per_cell = 0.6_real64    !! wanted when dilute
  real(real64), parameter :: spacious = 1.2_real64          !! cell, in diameters: wide enough for choosing to pay
  real(real64), parameter :: spare_width = 1.0e-6_real64    !! relative, above all rounding
  integer(int32), parameter :: leaves_margin = first_crossing - 4   !! event of a big disk

  type, extends(neighbour_search_t) :: cell_grid_t
    private
    integer(int32) :: n(2) = 0                     !! columns, rows
    type(cell_faces_t) :: faces                    !! of the cells, and the sides among them
    logical :: obstructed = .false.                !! there are obstacles
    logical :: chosen = .false.                    !! colliding disks choose among the cells that they are in
    type(big_disks_t) :: big                       !! disks much larger than those the cells are made for
    type(cells_t) :: cells                         !! numbered row by row, with a ring of empty ones around
    type(obstacle_lists_t) :: obstacles            !! that reach into the cells
  contains
    procedure :: build
    procedure :: predict
    procedure :: predict_both
    procedure :: cross
    procedure :: read_ahead
    procedure, private :: predict_special
    procedure, private :: scan_crowd, follow_big
  end type cell_grid_t

contains

  !> Chooses the cells, sorts the disks into them and finds the obstacles that reach into each.
  subroutine build(self, sim)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64) :: small, reach, width, x(2)
    integer(int32) :: i
    integer(int16) :: ix, iy

    small = largest_small_radius(sim%disk)
    reach = 2*small*(1 + spare_width)
    width = max(sqrt(disks_per_cell*product(sim%box%edges())/sim%n_disks()), reach)
    self%n = int(min(max(sim%box%edges()/width, 1.0_real64), 32000.0_real64), int32)
    call self%faces%set(sim%box, self%n, reach)
    self%chosen = any(self%faces%width > spacious*reach)
    call self%cells%empty(self%n(1) + 2, self%n(2) + 2, sim%n_disks())
    do i = 1, sim%n_disks()
      x = (sim%position(i) - sim%box%lower)/self%faces%width
      sim%tag(i)%cell = int(min(max(int(x, int32) + 1, 1), self%n), int16)
      if (sim%disk(i)%radius > small) then
        sim%tag(i)%cell = 1                        ! one that is marked in any case
      else
        call self%cells%insert(self%cells%number(sim%tag(i)%cell), i)
      end if
    end do
    self%obstructed = sim%box%obstructed()
    if (self%obstructed) call self%obstacles%renew(sim%box, small, self%n, self%faces%width, self%faces%overlap)
    call self%big%start(sim, small, self%n, self%faces%width, self%faces%overlap)
    if (.not. (any(sim%box%periodic) .or. self%obstructed .or. self%big%count > 0)) return
    do iy = 1, int(self%n(2), int16)
      do ix = 1, int(self%n(1), int16)
        call mark_special(self, [ix, iy])
      end do
    end do
  end subroutine build

  !> Marks a cell if a disk there may meet an obstacle, a big disk, or others beyond a periodic side; or may be big.
  subroutine mark_special(self, cell)
    class(cell_grid_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = at_periodic_edge(self, cell)
    if (self%obstructed) yes = yes .or. self%obstacles%reach_into(cell)
    if (self%big%count > 0) yes = yes .or. self%big%first(cell(1), cell(2)) > 0 .or. all(cell == 1)
    call self%cells%mark(self%cells%number(cell), yes)
  end subroutine mark_special

  !> Registers a big disk anew. The cells it leaves and those it comes to change their marks.
  subroutine follow_big(self, sim, number)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: number
    type(ring_cell_t), allocatable :: ring(:)
    integer :: m

    allocate (ring, source=self%big%ring(number)%at)
    call self%big%register(sim, number)
    ring = [ring, self%big%ring(number)%at]
    do m = 1, size(ring)
      call mark_special(self, int(ring(m)%cell, int16))
    end do
  end subroutine follow_big

  !> Moves disk i into the cell beyond the face, over a periodic side into the first one behind it, and
  !> predicts what it meets there.
  subroutine cross(self, sim, i, code)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code
    integer(int32) :: face, axis, there
    integer(int16) :: cell(2)

    if (sim%disk(i)%radius > self%big%small) then
      call self%follow_big(sim, self%big%number_of(i))
      call self%predict(sim, i)
      return
    end if
    face = -merge(code - first_crossing, code, code <= first_crossing)
    axis = 1 + face/2
    cell = sim%tag(i)%cell
    there = cell(axis) + 2*modulo(face, 2) - 1
    if (there < 1) there = self%n(axis)
    if (there > self%n(axis)) there = 1
    cell(axis) = int(there, int16)
    if (self%chosen) call self%faces%choose_cell(sim%disk(i), sim%now, cell)
    call move(self, sim%tag(i), i, cell)
    call self%predict(sim, i)
  end subroutine cross

  !> Lets disk i, which has just collided, choose its cell.
  subroutine settle(self, disk, tag, i)
    class(cell_grid_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    integer(int16) :: cell(2)

    if (disk%radius > self%big%small) return
    cell = tag%cell
    call self%faces%choose_cell(disk, disk%clock, cell)
    if (cell(1) /= tag%cell(1) .or. cell(2) /= tag%cell(2)) call move(self, tag, i, cell)
  end subroutine settle

  !> Moves disk i into another cell.
  subroutine move(self, tag, i, cell)
    class(cell_grid_t), intent(inout) :: self
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    integer(int16), intent(in) :: cell(2)

    call self%cells%remove(self%cells%number(tag%cell), i)
    tag%cell = cell
    call self%cells%insert(self%cells%number(cell), i)
  end subroutine move

  !> The earliest of: side or cell face, obstacle, disk in the cells around.
  subroutine predict(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    logical :: done

    if (self%faces%falling) then                   ! said in so many words, the compiler makes a version for each
      call predict_in_bulk(self, self%cells%cell, sim%disk, sim%tag, sim%now, .true., i, done)
    else
      call predict_in_bulk(self, self%cells%cell, sim%disk, sim%tag, sim%now, .false., i, done)
    end if
    if (.not. done) call self%predict_special(sim, i)    ! by dispatch, which keeps it out of the way of the bulk
  end subroutine predict

  subroutine read_ahead(self, sim, stage, disks)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: stage
    integer(int32), intent(in) :: disks(:)

    call self%cells%read_ahead(sim%disk, sim%tag, stage, disks)
  end subroutine read_ahead

  !> The same for two disks that have just collided. What comes before the tests of candidates is done for both
  !> first: it need not wait for those.
  subroutine predict_both(self, sim, i, j)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    logical :: done

    if (self%chosen) then
      call settle(self, sim%disk(i), sim%tag(i), i)
      call settle(self, sim%disk(j), sim%tag(j), j)
    end if
    if (self%faces%falling) then
      call predict_two(self, self%cells%cell, sim%disk, sim%tag, sim%now, .true., i, j, done)
    else
      call predict_two(self, self%cells%cell, sim%disk, sim%tag, sim%now, .false., i, j, done)
    end if
    if (done) return
    call self%predict(sim, i)
    call self%predict(sim, j)
  end subroutine predict_both

  !> Not done where there is more than small disks and walls.
  subroutine predict_two(self, cell, disk, tag, now, falling, i, j, done)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    logical, value :: falling
    integer(int32), value :: i, j
    logical, intent(out) :: done
    type(outlook_t) :: near_i, near_j

    done = .not. (cell(self%cells%number(tag(i)%cell))%is_marked() .or. cell(self%cells%number(tag(j)%cell))%is_marked())
    if (.not. done) return
    call look_around(self%faces, self%cells, cell, disk(i), tag(i), now, falling, i, near_i)
    call look_around(self%faces, self%cells, cell, disk(j), tag(j), now, falling, j, near_j)
    call expect_first(self, cell, disk, tag(i), now, falling, i, near_i, .true.)
    call expect_first(self, cell, disk, tag(j), now, falling, j, near_j, .true.)
  end subroutine predict_two

  !> Likewise for one disk.
  subroutine predict_in_bulk(self, cell, disk, tag, now, falling, i, done)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    logical, value :: falling
    integer(int32), value :: i
    logical, intent(out) :: done
    type(outlook_t) :: near

    done = .not. cell(self%cells%number(tag(i)%cell))%is_marked()
    if (.not. done) return
    call look_around(self%faces, self%cells, cell, disk(i), tag(i), now, falling, i, near)
    call expect_first(self, cell, disk, tag(i), now, falling, i, near, .false.)
  end subroutine predict_in_bulk

  !> Writes into disk i the first of what it can expect.
  subroutine expect_first(self, cell, disk, tag, now, falling, i, near, fresh)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag
    real(real64), intent(in) :: now
    logical, value :: falling
    integer(int32), value :: i
    type(outlook_t), intent(in) :: near
    logical, intent(in) :: fresh
    real(real64) :: t
    integer(int32) :: code

    t = near%time
    code = near%code
    if (cell(near%cell)%near_crowd()) call self%scan_crowd(disk, i, near%cell, now, t, code)
    call earliest_contact(disk, i, near%n, near%list, now, fresh, falling, self%faces%box%gravity, t, code)
    disk(i)%event_time = t
    disk(i)%partner = code
    tag%partner_stamp = disk(max(code, 1))%stamp   ! without a branch; of use if code > 0
  end subroutine expect_first

  !> Everywhere else.
  subroutine predict_special(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: t
    integer(int32) :: code

    if (sim%disk(i)%radius > self%big%small) then
      call foresee_big(self, sim, i, t, code)
    else
      call foresee_small(self, sim, i, t, code)
    end if
    sim%disk(i)%event_time = t
    sim%disk(i)%partner = code
    sim%tag(i)%partner_stamp = sim%disk(max(code, 1))%stamp
  end subroutine predict_special

  !> The earliest event of a small disk in a marked cell.
  subroutine foresee_small(self, sim, i, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    integer(int32) :: c, n, e, list(list_capacity)

    call self%faces%next(sim%disk(i), sim%tag(i)%cell, sim%now, self%faces%falling, t, code)
    c = self%cells%number(sim%tag(i)%cell)
    if (self%obstructed) call self%obstacles%next_contact(sim%box, sim%disk(i), sim%tag(i)%cell, t, code)
    if (at_periodic_edge(self, sim%tag(i)%cell)) then
      call scan_around_edge(self, sim, i, t, code)
    else
      call gather(self%cells%cell, c, self%cells%stride, i, list, n)
      call earliest_contact(sim%disk, i, n, list, sim%now, .false., self%faces%falling, self%faces%box%gravity, t, code)
      if (self%cells%cell(c)%near_crowd()) call self%scan_crowd(sim%disk, i, c, sim%now, t, code)
    end if
    if (self%big%count == 0) return
    e = self%big%first(sim%tag(i)%cell(1), sim%tag(i)%cell(2))
    do while (e > 0)
      associate (entry => self%big%entry(e))
        call earliest_contact(sim%disk, i, 1, [self%big%disk(entry%number) - 1], sim%now, .false., .true., &
          self%faces%box%gravity, t, code, entry%image*sim%box%edges())
        e = entry%next
      end associate
    end do
  end subroutine foresee_small

  !> The earliest event of a big disk: side, obstacle, end of its margin, another big disk, or a small one in
  !> the cells along its rim.
  subroutine foresee_big(self, sim, i, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code
    real(real64) :: t_margin
    integer(int32) :: number, ix, iy, m

    number = self%big%number_of(i)
    call next_side(sim%box, sim%disk(i), t, code)
    if (self%obstructed) call next_obstacle(sim%box, sim%disk(i), &
      [(m, m=1, size(sim%box%obstacle, kind=int32))], t, code)
    t_margin = sim%now + time_to_circle(sim%position(i) - self%big%centre(:, number), sim%velocity(i), &
      sim%box%gravity, self%big%margin, inside=.true.)
    code = merge(leaves_margin, code, t_margin < t)
    t = min(t, t_margin)
    do iy = merge(-1, 0, sim%box%periodic(2)), merge(1, 0, sim%box%periodic(2))
      do ix = merge(-1, 0, sim%box%periodic(1)), merge(1, 0, sim%box%periodic(1))
        call earliest_contact(sim%disk, i, self%big%count, self%big%disk - 1, sim%now, .false., .true., &
          self%faces%box%gravity, t, code, [ix, iy]*sim%box%edges())
      end do
    end do
    do m = 1, size(self%big%ring(number)%at, kind=int32)
      associate (place => self%big%ring(number)%at(m))
        call scan_cell(self, sim, i, place%cell(1) + self%cells%stride*place%cell(2), &
          -place%image*sim%box%edges(), t, code)
      end associate
    end do
  end subroutine foresee_big

  !> Whether the cells around lie partly beyond a periodic side.
  pure function at_periodic_edge(self, cell) result(yes)
    class(cell_grid_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = any(self%faces%box%periodic .and. (cell == 1 .or. cell == self%n))
  end function at_periodic_edge

  !> Contacts with the chained disks of the nine cells around c.
  pure subroutine scan_crowd(self, disk, i, c, now, t, code)
    class(cell_grid_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i, c
    real(real64), intent(in) :: now
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: k, m

    do k = c - self%cells%stride, c + self%cells%stride, self%cells%stride
      do m = k - 1, k + 1
        call scan_chain(self, disk, i, m, now, t, code)
      end do
    end do
  end subroutine scan_crowd

  !> Contacts with the chained disks of the crowded cell c.
  pure subroutine scan_chain(self, disk, i, c, now, t, code, shift)
    class(cell_grid_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i, c
    real(real64), intent(in) :: now
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64), intent(in), optional :: shift(2) !! of the cell, seen there [length]
    integer(int32) :: list(list_capacity), n, j

    j = self%cells%chain(c)
    do while (j > 0)
      n = 0
      do while (j > 0 .and. n < list_capacity)
        n = n + 1
        list(n) = j - 1
        j = self%cells%next(j)
      end do
      call earliest_contact(disk, i, n, list, now, .false., .true., self%faces%box%gravity, t, code, shift)
    end do
  end subroutine scan_chain

  !> Contacts where some of the nine cells are images beyond a periodic side; cells of the same image are scanned
  !> together. In a box of fewer than three columns a cell stands for several of its images.
  subroutine scan_around_edge(self, sim, i, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64) :: shift(2)
    integer(int32) :: there(2, -1:1), image(2, -1:1), k, image_x, image_y, dx, dy, c, list(list_capacity)
    integer(int64) :: n

    do k = -1, 1
      there(:, k) = sim%tag(i)%cell + k
      image(:, k) = merge(merge(1, 0, there(:, k) > self%n) - merge(1, 0, there(:, k) < 1), 0, sim%box%periodic)
      there(:, k) = there(:, k) - image(:, k)*self%n
    end do
    do image_y = minval(image(2, :)), maxval(image(2, :))
      do image_x = minval(image(1, :)), maxval(image(1, :))
        shift = [image_x, image_y]*sim%box%edges()
        n = 0
        do dy = -1, 1
          if (image(2, dy) /= image_y) cycle
          do dx = -1, 1
            if (image(1, dx) /= image_x) cycle
            c = there(1, dx) + self%cells%stride*there(2, dy)
            call append(self%cells%cell(c), list, n)
            call scan_chain(self, sim%disk, i, c, sim%now, t, code, shift)
          end do
        end do
        call earliest_contact(sim%disk, i, int(n, int32), list, sim%now, .false., .true., self%faces%box%gravity, &
          t, code, shift)
      end do
    end do
  end subroutine scan_around_edge

  !> Contacts with the disks of one cell, seen `shift` away.
  subroutine scan_cell(self, sim, i, c, shift, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, c
    real(real64), intent(in) :: shift(2)           !! [length]
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code

    call earliest_contact(sim%disk, i, self%cells%cell(c)%in_slots(), self%cells%cell(c)%slot, &
      sim%now, .false., .true., self%faces%box%gravity, t, code, shift)
    call scan_chain(self, sim%disk, i, c, sim%now, t, code, shift)
  end subroutine scan_cell

end module cell_grid
