!> Cell search (linked-cell method). The cells are at least one diameter wide. A disk can therefore
!> touch only the disks in the 3 x 3 cells around it, until it crosses a face of its cell. This
!> crossing is an event. Wide cells overlap (see `cell_faces`).
module cell_grid
  use kinds, only: int16, int32, never, real64
  use box_geometry, only: next_obstacle
  use box_state, only: box_state_t, next_side
  use cell_contents, only: cell_contents_t, gather
  use cell_faces, only: cell_faces_t
  use cell_layout, only: cell_layout_t, whole_box
  use cell_scans, only: add_chains_around, scan_around_seam, scan_disks, scan_list, scan_reach, scan_rim, test_list
  use disks, only: disk_t, tag_t
  use free_flight, only: time_to_circle
  use images, only: images_t
  use neighbour_lists, only: neighbour_lists_t
  use event_prediction, only: earliest_contact, latest_clock, no_gravity, prediction_t
  use partners, only: axis_of, is_wall, looks_again, nothing, sense_of, side_crossed
  use object_lists, only: place_t, object_lists_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: cell_grid_t

  real(real64), parameter :: spacious = 1.2_real64  !! minimum width of overlapping cells, in diameters

  type :: cell_grid_t
    private
    type(cell_layout_t), public :: layout        !! block of cells, chosen by `build` or by a domain
    logical, public :: is_part = .false.
    logical, public :: undivided = .false.       !! whether a single cell contains all disks
    logical, public :: everyone = .false.        !! whether all disks are predicted anew after each event
    type(cell_faces_t), public :: faces                    !! faces of the cells and sides of the box
    logical, public :: roomy = .false.           !! whether cells overlap
    type(cell_contents_t), public :: cells       !! cells with their disks, and a border of empty cells
    type(object_lists_t), public :: reach        !! obstacles, and disks that are too large for the cells
    type(images_t) :: images                       !! periodic images of the box
    integer(int32), public :: n_listed = 0         !! number of disks in the cells
    type(neighbour_lists_t), public :: lists     !! of the small disks, used if cells contain many disks
    real(real64) :: plain_radius = 0.0_real64    !! largest radius for simple cell crossings, or -1 [length]
  contains
    procedure :: build
    procedure :: predict
    procedure :: predict_both
    procedure :: cross
    procedure :: insert
    procedure :: take_out
    procedure :: predict_with_care      ! type-bound, so that the compiler does not inline the procedure
    procedure :: read_ahead
    procedure, private :: find_event_of_big        ! as above
    procedure, private :: cross_with_care
    procedure, private :: follow_big, list
    procedure, private :: predict_both_with_care
  end type cell_grid_t

contains

  !> Chooses the cells and inserts all disks. Lists of obstacles are renewed only for new cells.
  subroutine build(self, sim)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(place_t), allocatable :: rims(:)
    logical :: kept                                ! whether the lists of obstacles are still valid
    integer(int32) :: i
    integer(int16) :: ix, iy

    if (.not. self%is_part) self%layout = whole_box(sim, self%undivided)
    self%images = sim%images()
    call self%faces%set(sim%box, self%layout, sim%now)
    kept = sim%box%has_obstacles() .and. self%reach%serves(self%layout, self%faces) .and. .not. self%lists%used
    if (kept) call clear_cells(self, sim, kept)
    associate (layout => self%layout)
      if (.not. kept) call self%cells%empty(layout%n(1) + 2, layout%n(2) + 2, sim%n_disks())
      call fill_cells(self, sim)
      if (kept) then
        rims = self%reach%rims()
        call self%reach%renew_big(sim, layout, self%faces)
        rims = [rims, self%reach%rims()]
      else
        call self%reach%renew(sim, layout, self%faces)
      end if
      call list_all(self, sim)
      self%roomy = any(self%faces%width > spacious*layout%reach) .and. .not. self%lists%used
      self%plain_radius = merge(-1.0_real64, layout%small, self%lists%used)
      if (kept .and. .not. self%lists%used) then
        do i = 1, size(rims, kind=int32)
          call mark(self, int(rims(i)%cell, int16))
        end do
        return
      end if
      if (.not. (any(sim%box%periodic) .or. allocated(self%reach%first) .or. self%is_part .or. self%lists%used)) return
      do iy = 0, int(layout%n(2) + 1, int16)
        do ix = 0, int(layout%n(1) + 1, int16)
          call mark(self, [ix, iy])
        end do
      end do
    end associate
  end subroutine build

  !> Removes each disk from its cell; `all_found` is .true. if all cells are empty afterwards.
  subroutine clear_cells(self, sim, all_found)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical, intent(out) :: all_found
    integer(int32) :: i, n

    all_found = .false.
    if (sim%n_disks() /= size(self%cells%next)) return
    n = 0
    do i = 1, sim%n_disks()
      if (any(sim%tag(i)%cell < 1 .or. sim%tag(i)%cell > self%layout%n)) cycle
      call self%cells%clear(self%cells%number(sim%tag(i)%cell), n)
    end do
    all_found = n == self%n_listed
  end subroutine clear_cells

  !> Inserts the disks into the cells.
  subroutine fill_cells(self, sim)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i
    integer(int16) :: cell(2)

    self%n_listed = 0
    associate (layout => self%layout)
      do i = 1, sim%n_disks()
        if (.not. sim%is_inside(i)) cycle
        if (sim%disk(i)%radius > layout%small) then
          sim%tag(i)%cell = 1                      ! cell (1,1), which is always marked
        else if (sim%tag(i)%id > 0) then
          cell = int(layout%cell_at(sim%position(i)), int16)
          call put(self, sim%tag(i), i, cell)
          self%n_listed = self%n_listed + 1
        end if
      end do
    end associate
  end subroutine fill_cells

  !> Sets up the neighbour lists of all small disks, if the lists are expected to save time.
  subroutine list_all(self, sim)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32) :: i

    self%lists%used = .false.
    if (self%undivided .or. sim%box%is_sheared()) return
    call self%lists%prepare(sim%disk, sim%tag, sim%box%lower, sim%box%edges(), self%layout)
    if (.not. self%lists%used) return
    do i = 1, sim%n_disks()
      if (sim%tag(i)%id > 0 .and. sim%disk(i)%radius <= self%layout%small .and. sim%is_inside(i)) call self%list(sim, i)
    end do
  end subroutine list_all

  !> Inserts disk i into a cell and updates the neighbour lists.
  subroutine insert(self, sim, i, cell)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int16), intent(in) :: cell(2)

    call put(self, sim%tag(i), i, cell)
    if (self%lists%used) call self%list(sim, i)
  end subroutine insert

  !> Removes disk i from its cell and from the neighbour lists.
  subroutine take_out(self, tag, i)
    class(cell_grid_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag
    integer(int32), intent(in) :: i

    if (self%lists%used) call self%lists%leave(i, self%cells, self%layout, tag%cell)
    call take(self, tag, i)
  end subroutine take_out

  subroutine put(self, tag, i, cell)
    class(cell_grid_t), intent(inout) :: self
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    integer(int16), intent(in) :: cell(2)

    tag%cell = cell
    call self%cells%insert(self%cells%number(cell), i)
  end subroutine put

  subroutine take(self, tag, i)
    class(cell_grid_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag
    integer(int32), intent(in) :: i

    call self%cells%remove(self%cells%number(tag%cell), i)
  end subroutine take

  !> Sets up the neighbour list of disk i at its present position, if the disk is in the block.
  subroutine list(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i

    if (.not. self%layout%holds(sim%tag(i)%cell)) return
    call self%lists%lay(i, sim%disk(i)%radius, sim%position(i), self%faces, sim%tag(i)%cell)
    call self%lists%enter(i, self%cells, self%layout, sim%tag(i)%cell)
  end subroutine list

  !> Marks a cell that needs the general procedure, near obstacles, big disks or periodic images.
  subroutine mark(self, cell)
    class(cell_grid_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: special

    special = .not. self%layout%holds(cell) .or. (size(self%reach%big) > 0 .and. all(cell == 1)) .or. self%lists%used
    if (.not. special) special = self%layout%at_seam(cell) .or. self%reach%has_any(cell)
    call self%cells%mark(self%cells%number(cell), special)
  end subroutine mark

  !> Updates the reference position of a big disk and the marks of the cells near its rim.
  subroutine follow_big(self, sim, number)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: number
    type(place_t), allocatable :: rim(:)
    integer :: m

    allocate (rim, source=self%reach%big(number)%rim)
    call self%reach%follow(sim, number, self%layout, self%faces)
    rim = [rim, self%reach%big(number)%rim]
    do m = 1, size(rim)
      call mark(self, int(rim(m)%cell, int16))
    end do
  end subroutine follow_big

  !> Executes a cell crossing of disk i (or the expiry of its list), and predicts its next event.
  subroutine cross(self, sim, i, code)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code

    if (sim%disk(i)%radius > self%plain_radius) then
      call self%cross_with_care(sim, i, code)
    else if (code > looks_again) then
      call change_cell(self, sim, i, code)
    end if
    call self%predict(sim, i)
  end subroutine cross

  !> Updates the reference position of a big disk, or renews the neighbour list of a small one.
  subroutine cross_with_care(self, sim, i, code)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code

    if (sim%disk(i)%radius > self%layout%small) then
      call self%follow_big(sim, self%reach%number_of(i))
    else
      call self%lists%leave(i, self%cells, self%layout, sim%tag(i)%cell)
      if (code > looks_again) call change_cell(self, sim, i, code)
      call self%list(sim, i)
    end if
  end subroutine cross_with_care

  !> Moves disk i to the cell behind a face, or to a periodic image if the face is a periodic side.
  subroutine change_cell(self, sim, i, code)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    integer(int32) :: side, axis
    integer(int16) :: cell(2)
    logical :: inside

    side = code
    if (.not. is_wall(code)) side = side_crossed(code)
    axis = axis_of(side)
    cell = sim%tag(i)%cell
    cell(axis) = cell(axis) + int(sense_of(side), int16)
    if (is_wall(code) .and. self%layout%last(axis) > 0) then
      ! shear displaces the image
      if (axis == 2 .and. sim%box%is_sheared()) cell = int(self%layout%cell_at(sim%position(i)), int16)
      cell(axis) = int(merge(self%layout%next(axis), self%layout%last(axis), sense_of(side) > 0), int16)
    end if
    inside = .true.
    if (self%is_part) inside = self%layout%holds(cell)
    if ((self%roomy .or. self%lists%used) .and. inside) call self%faces%choose_cell(sim%box%gravity, sim%disk(i), sim%now, cell)
    call move(self, sim%tag(i), i, cell)
  end subroutine change_cell

  !> After a collision, reassigns disk i to a cell if the cells overlap.
  subroutine choose_cell(self, gravity, disk, tag, i)
    class(cell_grid_t), intent(inout) :: self
    real(real64), intent(in) :: gravity(2)         !! [length/time**2]
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    integer(int16) :: cell(2)

    if (disk%radius > self%layout%small) return
    cell = tag%cell
    call self%faces%choose_cell(gravity, disk, disk%clock, cell)
    if (cell(1) /= tag%cell(1) .or. cell(2) /= tag%cell(2)) call move(self, tag, i, cell)
  end subroutine choose_cell

  subroutine move(self, tag, i, cell)
    class(cell_grid_t), intent(inout) :: self
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    integer(int16), intent(in) :: cell(2)

    call take(self, tag, i)
    call put(self, tag, i, cell)
  end subroutine move

  !> Predicts the next event of disk i: a side, a face, an obstacle, or a disk in 3 x 3 cells.
  subroutine predict(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    if (self%cells%cell(self%cells%number(sim%tag(i)%cell))%needs_care()) then
      call self%predict_with_care(sim, i, .false.)
    else if (self%faces%falling) then      ! literal arguments let the compiler specialise the procedure
      call predict_one(self, sim%box, sim%disk, sim%tag, sim%now, 0, i)
    else
      call predict_one(self, sim%box, sim%disk, sim%tag, sim%now, no_gravity, i)
    end if
  end subroutine predict

  !> Predicts the next events of disks i and j after their collision.
  subroutine predict_both(self, sim, i, j)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j

    if (self%roomy) then
      call choose_cell(self, sim%box%gravity, sim%disk(i), sim%tag(i), i)
      call choose_cell(self, sim%box%gravity, sim%disk(j), sim%tag(j), j)
    end if
    if (self%cells%cell(self%cells%number(sim%tag(i)%cell))%needs_care() .or. &
      self%cells%cell(self%cells%number(sim%tag(j)%cell))%needs_care()) then
      call self%predict_both_with_care(sim, i, j)
    else if (self%faces%falling) then
      call predict_two(self, sim%box, sim%disk, sim%tag, sim%now, latest_clock, [i, j])
    else
      call predict_two(self, sim%box, sim%disk, sim%tag, sim%now, latest_clock + no_gravity, [i, j])
    end if
  end subroutine predict_both

  !> General version of `predict_both`. The usual case is first: both disks have complete lists.
  subroutine predict_both_with_care(self, sim, i, j)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j

    associate (cell_i => sim%tag(i)%cell, cell_j => sim%tag(j)%cell)
      if (self%lists%used) then
        if (is_plainly_listed(self, cell_i, i) .and. is_plainly_listed(self, cell_j, j) .and. &
          .not. (self%reach%has_any(cell_i) .or. self%reach%has_any(cell_j))) then
          call predict_listed(self, sim, i, j)
          return
        end if
      end if
    end associate
    call predict_collided(i)
    call predict_collided(j)
  contains

    subroutine predict_collided(k)
      integer(int32), intent(in) :: k

      if (self%cells%cell(self%cells%number(sim%tag(k)%cell))%needs_care()) then
        call self%predict_with_care(sim, k, .true.)
      else
        call self%predict(sim, k)
      end if
    end subroutine predict_collided
  end subroutine predict_both_with_care

  !> True if a small disk has a complete neighbour list without neighbours across a periodic side.
  pure function is_plainly_listed(self, cell, i) result(yes)
    class(cell_grid_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%lists%is_short(i) .and. .not. self%layout%at_seam(cell)
  end function is_plainly_listed

  !> Predicts the next events of two disks from their neighbour lists after their collision.
  subroutine predict_listed(self, sim, i, j)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    type(prediction_t) :: near_i, near_j

    call survey_list(self, sim%box, sim%disk(i), sim%now, i, near_i)
    call survey_list(self, sim%box, sim%disk(j), sim%now, j, near_j)
    if (self%faces%falling) then      ! literal arguments let the compiler specialise the procedure
      call take_earliest(sim%box%gravity, sim%disk, sim%tag, sim%now, latest_clock, near_i)
      call take_earliest(sim%box%gravity, sim%disk, sim%tag, sim%now, latest_clock, near_j)
    else
      call take_earliest(sim%box%gravity, sim%disk, sim%tag, sim%now, latest_clock + no_gravity, near_i)
      call take_earliest(sim%box%gravity, sim%disk, sim%tag, sim%now, latest_clock + no_gravity, near_j)
    end if
  end subroutine predict_listed

  !> Determines when disk i leaves its neighbourhood, and copies its neighbour list.
  pure subroutine survey_list(self, box, disk, now, i, near)
    type(cell_grid_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    real(real64), intent(in) :: now
    integer(int32), intent(in) :: i
    type(prediction_t), intent(out) :: near

    associate (region => self%lists%neighbourhood(i))
      call self%faces%next_within(box, region%column, region%row, disk, now, near)
    end associate
    near%disk = i
    call self%lists%copy_list(near)
  end subroutine survey_list

  !> Predicts the next events of two disks in unmarked cells, after collecting all candidates.
  subroutine predict_two(self, box, disk, tag, now, known, pair)
    class(cell_grid_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    integer(int32), value :: known
    integer(int32), intent(in) :: pair(2)
    type(prediction_t) :: first, second

    first%disk = pair(1)
    second%disk = pair(2)
    call survey(self, box, disk(first%disk), tag(first%disk), now, known, first)
    call survey(self, box, disk(second%disk), tag(second%disk), now, known, second)
    call take_earliest(box%gravity, disk, tag, now, known, first)
    call take_earliest(box%gravity, disk, tag, now, known, second)
  end subroutine predict_two

  !> Predicts the next event of a disk in an unmarked cell.
  subroutine predict_one(self, box, disk, tag, now, known, i)
    class(cell_grid_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    integer(int32), value :: known, i
    type(prediction_t) :: near

    near%disk = i
    call survey(self, box, disk(i), tag(i), now, known, near)
    call take_earliest(box%gravity, disk, tag, now, known, near)
  end subroutine predict_one

  !> Finds when a disk leaves its cell, and collects the candidates for a collision until then.
  subroutine survey(self, box, disk, tag, now, known, near)
    class(cell_grid_t), intent(in) :: self
    type(box_state_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(in) :: tag
    real(real64), intent(in) :: now
    integer(int32), value :: known
    type(prediction_t), intent(inout) :: near        !! earliest event and candidates of the disk `near%disk`

    call self%faces%next(box, disk, tag%cell, now, iand(known, no_gravity) == 0, near)
    near%cell = self%cells%number(tag%cell)
    call gather(self%cells%cell, near%cell, self%cells%stride, near%disk, near%list, near%n)
  end subroutine survey

  !> Tests the candidates of a disk and stores its earliest event in its record.
  subroutine take_earliest(gravity, disk, tag, now, known, near)
    real(real64), intent(in) :: gravity(2)         !! [length/time**2]
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    integer(int32), value :: known
    type(prediction_t), intent(inout) :: near

    call earliest_contact(disk, tag, near, now, gravity, known)
    disk(near%disk)%event_time = near%time
    disk(near%disk)%partner = near%partner
    ! used only if the partner is a disk
    tag(near%disk)%partner_counter = disk(max(near%partner, 1))%collision_counter
  end subroutine take_earliest

  !> Prefetches, in several stages, the data for predicting the events of several disks.
  subroutine read_ahead(self, disk, tag, stage, disks)
    class(cell_grid_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: stage, disks(:)

    if (self%lists%used) then
      call self%lists%read_ahead(disk, tag, stage, disks)
    else
      call self%cells%read_ahead(disk, tag, stage, disks)
    end if
  end subroutine read_ahead

  !> General version of `predict`. A disk that has left the block is removed from the search.
  subroutine predict_with_care(self, sim, i, has_collided)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    logical, intent(in) :: has_collided   !! whether disk i has just collided, so that its clock is the latest
    type(prediction_t) :: near
    integer(int32) :: known                        ! as in `earliest_contact`

    near%disk = i
    known = merge(latest_clock, 0, has_collided) + merge(0, no_gravity, self%faces%falling)
    if (sim%disk(i)%radius > self%layout%small) then
      call self%find_event_of_big(sim, known, near)
    else if (.not. self%layout%holds(sim%tag(i)%cell)) then
      call self%take_out(sim%tag(i), i)
      sim%disk(i)%collision_counter = sim%disk(i)%collision_counter + 1
      near%time = 2*never
      near%partner = nothing
    else
      call find_event_of_small(self, sim, known, near)
    end if
    sim%disk(i)%event_time = near%time
    sim%disk(i)%partner = near%partner
    sim%tag(i)%partner_counter = sim%disk(max(near%partner, 1))%collision_counter
  end subroutine predict_with_care

  !> Finds when a big disk has its next contact, or leaves the margin around its old position.
  subroutine find_event_of_big(self, sim, known, near)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    real(real64) :: t_margin
    integer(int32) :: image

    associate (i => near%disk, big => self%reach%big(self%reach%number_of(near%disk)))
      call next_side(sim%box, sim%disk(i), near%time, near%partner)
      call next_obstacle(sim%box%box_t, sim%disk(i), sim%tag(i)%last_partner, big%obstacles, near%time, near%partner)
      t_margin = sim%now + time_to_circle(sim%position(i) - big%centre, sim%velocity(i), sim%box%gravity, self%reach%margin, .true.)
      if (t_margin < near%time) near%partner = looks_again
      near%time = min(near%time, t_margin)
      do image = 1, self%images%count()
        call scan_disks(sim, self%reach%big%disk, self%images%image(self%images%around(image)), known, near)
      end do
      call scan_rim(self%cells, sim, big%rim, self%images, known, near)
    end associate
  end subroutine find_event_of_big

  !> Finds the next event of a small disk, with or without a neighbour list.
  subroutine find_event_of_small(self, sim, known, near)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    integer(int32) :: first                        ! first entry in the cell's list of obstacles and big disks

    associate (i => near%disk, cell => sim%tag(near%disk)%cell)
      if (self%lists%used) then
        call self%faces%next_within(sim%box, self%lists%neighbourhood(i)%column, self%lists%neighbourhood(i)%row, &
          sim%disk(i), sim%now, near)
      else
        call self%faces%next(sim%box, sim%disk(i), cell, sim%now, self%faces%falling, near)
      end if
      first = self%reach%first_in(cell)
      if (first > 0) call scan_reach(self%reach, first, sim, self%images, known, near)
      if (self%lists%used) then
        if (is_plainly_listed(self, cell, i)) then
          call self%lists%copy_list(near)
          call test_list(sim, known, near)
          return
        else if (self%lists%is_complete(i)) then
          call scan_list(self%lists, sim, self%images, known, near)
          return
        end if
      end if
      if (sim%n_disks() > 1) call scan_cells_around(self, sim, known, near)
    end associate
  end subroutine find_event_of_small

  !> Finds contacts of a small disk with the disks in its own cell and the eight cells around it.
  subroutine scan_cells_around(self, sim, known, near)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: known            !! as in `earliest_contact`
    type(prediction_t), intent(inout) :: near
    real(real64) :: t

    associate (cell => sim%tag(near%disk)%cell)
      near%cell = self%cells%number(cell)
      if (self%layout%at_seam(cell)) then
        t = self%images%valid_until(sim%now, self%layout%width(1))
        if (t < near%time) near%partner = looks_again
        near%time = min(t, near%time)
        call scan_around_seam(self%cells, self%layout, sim, self%images, known, near)
      else
        call gather(self%cells%cell, near%cell, self%cells%stride, near%disk, near%list, near%n)
        if (self%cells%is_crowded_around(near%cell)) call add_chains_around(self%cells, sim, known, near)
        call test_list(sim, known, near)
      end if
    end associate
  end subroutine scan_cells_around

end module cell_grid
