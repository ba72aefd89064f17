!> Search by cells: the box is cut into cells at least one diameter wide, so that a disk meets only those in
!> its own cell and the eight around it before it leaves its cell, which is an event like any other.
!> The cost of a prediction does not depend on the number of disks.
module cell_grid
  use kinds, only: int16, int32, never, real64
  use big_disks, only: big_disks_t, largest_small_radius
  use box_geometry, only: next_obstacle, next_side
  use cell_faces, only: cell_faces_t
  use cells, only: cell_t, cells_t, gather, list_capacity, sum_around
  use disks, only: disk_t, tag_t
  use free_flight, only: time_to_circle
  use neighbour_search, only: earliest_contact, first_crossing, neighbour_search_t
  use obstacle_lists, only: obstacle_lists_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: cell_grid_t

  real(real64), parameter :: no_shift(2) = 0.0_real64
  real(real64), parameter :: disks_per_cell = 0.8_real64    !! wanted when dilute
  real(real64), parameter :: dilute = 1.6_real64            !! side of such cells in diameters, at least
  real(real64), parameter :: spare_width = 1.0e-6_real64    !! relative, above all rounding

  integer(int32), parameter :: leaves_margin = first_crossing - 4   !! event of a big disk

  !> The first contact of a disk with those in the cells around, beyond the end of its cell too.
  type :: contact_t
    real(real64) :: time = never
    integer(int32) :: partner = 0                  !! 0: none
    integer(int32) :: stamp = 0                    !! the partner's when this was predicted
  end type contact_t

  integer(int32), parameter :: unknown = -1        !! as partner of a contact

  type, extends(neighbour_search_t) :: cell_grid_t
    private
    integer(int32) :: n(2) = 0                     !! columns, rows
    integer(int32) :: stride = 0                   !! from row to row
    type(cell_faces_t) :: faces                    !! of the cells, and the sides among them
    logical :: special = .false.                   !! more than small disks and walls on straight lines
    logical :: falling = .false.                   !! disks fly on parabolas
    logical :: obstructed = .false.                !! there are obstacles
    logical :: keeps_contacts = .false.            !! over the ends of cells: of use where disks are few
    type(contact_t), allocatable :: contact(:)     !! (disks) if contacts are kept
    real(real64) :: last_read = 0.0_real64         !! by `read_ahead`
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
    procedure, private :: predict_contact
    procedure, private :: scan_crowd
  end type cell_grid_t

contains

  !> Chooses the cells, sorts the disks into them and finds the obstacles that reach into each.
  subroutine build(self, sim)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64) :: small, reach, width, x(2)
    integer(int32) :: i
    small = largest_small_radius(sim%disk)
    reach = 2*small*(1 + spare_width)
    width = sqrt(disks_per_cell*product(sim%box%edges())/sim%n_disks())
    self%keeps_contacts = width > dilute*reach
    if (.not. self%keeps_contacts) width = reach
    self%n = int(min(max(sim%box%edges()/width, 1.0_real64), 32000.0_real64), int32)
    self%stride = self%n(1) + 2
    call self%faces%set(sim%box, self%n)
    self%falling = sim%box%falling()
    call self%cells%empty(self%stride, self%n(2) + 2, sim%n_disks())
    do i = 1, sim%n_disks()
      if (sim%disk(i)%radius > small) cycle
      x = (sim%position(i) - sim%box%lower)/self%faces%width
      sim%tag(i)%cell = int(min(max(int(x, int32) + 1, 1), self%n), int16)
      call self%cells%insert(cell_number(self, sim%tag(i)%cell), i)
    end do
    self%obstructed = sim%box%obstructed()
    if (self%obstructed) call self%obstacles%renew(sim%box, small, self%n, self%faces%width)
    call self%big%start(sim, small, self%n, self%faces%width)
    if (allocated(self%contact)) deallocate (self%contact)
    if (self%keeps_contacts) allocate (self%contact(sim%n_disks()))
    self%special = any(sim%box%periodic) .or. self%falling .or. self%obstructed .or. self%big%count > 0
  end subroutine build

  !> Number of the cell in column cell(1) and row cell(2), both from 1.
  pure function cell_number(self, cell) result(c)
    class(cell_grid_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32) :: c
    c = cell(1) + self%stride*cell(2)
  end function cell_number

  !> Moves disk i into the cell beyond the face, over a periodic side into the first one behind it, and
  !> predicts what it meets there.
  subroutine cross(self, sim, i, code)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code
    integer(int32) :: face, axis, there, way
    if (self%big%count > 0) then
      if (sim%disk(i)%radius > self%big%small) then
        call self%big%register(sim, self%big%number_of(i))
        call self%predict(sim, i)
        return
      end if
    end if
    face = -merge(code - first_crossing, code, code <= first_crossing)
    axis = 1 + face/2
    way = 2*modulo(face, 2) - 1
    call self%cells%remove(cell_number(self, sim%tag(i)%cell), i)
    there = sim%tag(i)%cell(axis) + way
    if (there < 1) there = self%n(axis)
    if (there > self%n(axis)) there = 1
    sim%tag(i)%cell(axis) = int(there, int16)
    call self%cells%insert(cell_number(self, sim%tag(i)%cell), i)
    if (self%keeps_contacts .and. .not. is_special(self, sim, i)) then
      if (self%contact(i)%partner /= unknown) then
        call predict_ahead(self, self%cells%cell, self%contact, sim%disk, sim%tag, sim%now, i, &
          merge(way, self%stride*way, axis == 1), merge(self%stride, 1, axis == 1))
        return
      end if
    end if
    call self%predict(sim, i)
  end subroutine cross

  !> The earliest of: side or cell face, obstacle, disk in the cells around.
  subroutine predict(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    if (self%special) then
      if (is_special(self, sim, i)) then
        call self%predict_special(sim, i)      ! by dispatch, which keeps it out of the way of the bulk
        if (self%keeps_contacts) self%contact(i)%partner = unknown
        return
      end if
    end if
    if (self%keeps_contacts) then
      call self%predict_contact(sim, i)
    else
      call predict_in_bulk(self, self%cells%cell, sim%disk, sim%tag, sim%now, i)
    end if
  end subroutine predict

  !> The reads do not wait for each other, as they would when the events come. Their sum is of no use but to
  !> keep the compiler from leaving them out.
  subroutine read_ahead(self, sim, disks)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: disks(:)
    integer(int32) :: k
    self%last_read = 0
    do k = 1, size(disks)
      self%last_read = self%last_read + sim%disk(disks(k))%event_time &
        + sum_around(self%cells%cell, cell_number(self, sim%tag(disks(k))%cell), self%stride, sim%disk)
    end do
  end subroutine read_ahead

  !> Whether disk i may meet anything but small disks and walls on straight lines.
  pure function is_special(self, sim, i) result(yes)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    logical :: yes
    yes = self%falling .or. self%obstructed .or. self%big%count > 0 .or. at_periodic_edge(self, sim%tag(i)%cell)
  end function is_special

  !> The same for two disks that have just collided. What comes before the tests of candidates is done for both
  !> first: it need not wait for those.
  subroutine predict_both(self, sim, i, j)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    logical :: bulk
    bulk = .not. self%keeps_contacts
    if (self%special) bulk = bulk .and. .not. (is_special(self, sim, i) .or. is_special(self, sim, j))
    if (bulk) then
      call predict_two(self, self%cells%cell, sim%disk, sim%tag, i, j)
    else
      call self%predict(sim, i)
      call self%predict(sim, j)
    end if
  end subroutine predict_both

  subroutine predict_two(self, cell, disk, tag, i, j)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i, j
    real(real64) :: t, t_j
    integer(int32) :: code, n, list(list_capacity), code_j, n_j, list_j(list_capacity)
    call look_around(self, cell, disk, tag(i), i, t, code, list, n)
    call look_around(self, cell, disk, tag(j), j, t_j, code_j, list_j, n_j)
    call expect_first(disk, tag(i), i, n, list, .true., t, code)
    call expect_first(disk, tag(j), j, n_j, list_j, .true., t_j, code_j)
  end subroutine predict_two

  !> Where there are but small disks and walls on straight lines.
  subroutine predict_in_bulk(self, cell, disk, tag, now, i)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    integer(int32), intent(in) :: i
    real(real64) :: t
    integer(int32) :: code, n, list(list_capacity)
    call look_around(self, cell, disk, tag(i), i, t, code, list, n)
    call expect_first(disk, tag(i), i, n, list, disk(i)%clock >= now, t, code)
  end subroutine predict_in_bulk

  !> When disk i meets a face or side, and whom it may meet before.
  subroutine look_around(self, cell, disk, tag, i, t, code, list, n)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(in) :: tag
    integer(int32), intent(in) :: i
    real(real64), intent(out) :: t
    integer(int32), intent(out) :: code, list(list_capacity), n
    integer(int32) :: c
    call self%faces%next(disk(i), tag%cell, t, code)
    c = cell_number(self, tag%cell)
    call gather(cell, c, self%stride, i, list, n)
    if (cell(c)%near_crowd()) call self%scan_crowd(disk, i, c, no_shift, t, code)
  end subroutine look_around

  !> Writes into disk i the first of what it can expect.
  subroutine expect_first(disk, tag, i, n, list, fresh, t, code)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i, n, list(list_capacity)
    logical, intent(in) :: fresh
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    call earliest_contact(disk, i, n, list, fresh, .false., no_shift, no_shift, t, code)
    disk(i)%event_time = t
    disk(i)%partner = code
    tag%partner_stamp = disk(max(code, 1))%stamp      ! without a branch; of use if code > 0
  end subroutine expect_first

  !> The same where contacts are kept.
  subroutine predict_contact(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: t
    integer(int32) :: code, c, n, list(list_capacity)
    t = never
    code = 0
    c = cell_number(self, sim%tag(i)%cell)
    call gather(self%cells%cell, c, self%stride, i, list, n)
    if (self%cells%cell(c)%near_crowd()) call self%scan_crowd(sim%disk, i, c, no_shift, t, code)
    call earliest_contact(sim%disk, i, n, list, sim%disk(i)%clock >= sim%now, .false., no_shift, no_shift, t, code)
    self%contact(i) = contact_t(t, code, sim%disk(max(code, 1))%stamp)
    call expect_face_or_contact(self, self%contact(i), sim%disk(i), sim%tag(i), i)
  end subroutine predict_contact

  !> Behind the face just crossed: the contact found before stays, three cells come into reach.
  subroutine predict_ahead(self, cell, contact, disk, tag, now, i, ahead, along)
    class(cell_grid_t), intent(in) :: self
    type(cell_t), intent(in) :: cell(0:*)
    type(contact_t), intent(inout) :: contact(*)
    type(disk_t), intent(inout) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    real(real64), intent(in) :: now
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: ahead            !! from the disk's cell to the middle one of the three
    integer(int32), intent(in) :: along            !! from this one to the next
    real(real64) :: t
    integer(int32) :: code, c, k, n, list(list_capacity)
    t = contact(i)%time
    code = contact(i)%partner
    c = cell_number(self, tag(i)%cell) + ahead
    n = 0
    do k = c - along, c + along, along
      list(n + 1:n + size(cell(k)%slot)) = cell(k)%slot
      n = n + cell(k)%in_slots()
    end do
    if (cell(c - ahead)%near_crowd() .or. cell(c)%near_crowd()) then
      do k = c - along, c + along, along
        call scan_chain(self, disk, i, k, no_shift, no_shift, t, code)
      end do
    end if
    call earliest_contact(disk, i, n, list, disk(i)%clock >= now, .false., no_shift, no_shift, t, code)
    if (t < contact(i)%time .or. code /= contact(i)%partner) contact(i) = contact_t(t, code, disk(code)%stamp)
    call expect_face_or_contact(self, contact(i), disk(i), tag(i), i)
  end subroutine predict_ahead

  !> Disk i expects the end of its cell or its first contact. At the same moment the lower disk has its way, as
  !> in the kernel.
  pure subroutine expect_face_or_contact(self, contact, disk, tag, i)
    class(cell_grid_t), intent(in) :: self
    type(contact_t), intent(in) :: contact
    type(disk_t), intent(inout) :: disk
    type(tag_t), intent(inout) :: tag
    integer(int32), intent(in) :: i
    real(real64) :: t
    integer(int32) :: code
    call self%faces%next(disk, tag%cell, t, code)
    if (contact%time < t .or. (contact%time == t .and. contact%partner < i)) then
      t = contact%time
      code = contact%partner
    end if
    disk%event_time = t
    disk%partner = code
    tag%partner_stamp = contact%stamp
  end subroutine expect_face_or_contact

  !> Everywhere else.
  subroutine predict_special(self, sim, i)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: t
    integer(int32) :: code, c, n, list(list_capacity)
    if (self%big%count > 0) then
      if (sim%disk(i)%radius > self%big%small) then
        call predict_big(self, sim, i)
        return
      end if
    end if
    if (self%falling) then
      call self%faces%next_falling(sim%box, sim%disk(i), sim%tag(i)%cell, sim%now, t, code)
    else
      call self%faces%next(sim%disk(i), sim%tag(i)%cell, t, code)
    end if
    c = cell_number(self, sim%tag(i)%cell)
    if (self%obstructed) call self%obstacles%next_contact(sim%box, sim%disk(i), sim%tag(i)%cell, t, code)
    if (at_periodic_edge(self, sim%tag(i)%cell)) then
      call scan_around_edge(self, sim, i, t, code)
    else
      call gather(self%cells%cell, c, self%stride, i, list, n)
      call earliest_contact(sim%disk, i, n, list, sim%disk(i)%clock >= sim%now, self%falling, &
        no_shift, sim%box%gravity, t, code)
      if (self%cells%cell(c)%near_crowd()) call self%scan_crowd(sim%disk, i, c, sim%box%gravity, t, code)
    end if
    if (self%big%count > 0) call scan_big_ones(self, sim, i, t, code)
    sim%disk(i)%event_time = t
    sim%disk(i)%partner = code
    sim%tag(i)%partner_stamp = sim%disk(max(code, 1))%stamp
  end subroutine predict_special

  !> Contacts of a small disk with the big ones that can be near its cell.
  subroutine scan_big_ones(self, sim, i, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: e
    e = self%big%first(sim%tag(i)%cell(1), sim%tag(i)%cell(2))
    do while (e > 0)
      associate (entry => self%big%entry(e))
        call earliest_contact(sim%disk, i, 1, [self%big%disk(entry%number) - 1], .false., .true., &
          entry%image*sim%box%edges(), sim%box%gravity, t, code)
        e = entry%next
      end associate
    end do
  end subroutine scan_big_ones

  !> The earliest event of a big disk: side, obstacle, end of its margin, another big disk, or a small one in
  !> the cells along its rim.
  subroutine predict_big(self, sim, i)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: t, t_margin
    integer(int32) :: code, number, ix, iy, m
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
        call earliest_contact(sim%disk, i, self%big%count, self%big%disk - 1, .false., .true., &
          [ix, iy]*sim%box%edges(), sim%box%gravity, t, code)
      end do
    end do
    do m = 1, size(self%big%ring(number)%at, kind=int32)
      associate (place => self%big%ring(number)%at(m))
        call scan_cell(self, sim, i, place%cell(1) + self%stride*place%cell(2), &
          -place%image*sim%box%edges(), t, code)
      end associate
    end do
    sim%disk(i)%event_time = t
    sim%disk(i)%partner = code
    sim%tag(i)%partner_stamp = sim%disk(max(code, 1))%stamp
  end subroutine predict_big

  !> Whether the cells around lie partly beyond a periodic side.
  pure function at_periodic_edge(self, cell) result(yes)
    class(cell_grid_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes
    yes = any(self%faces%periodic .and. (cell == 1 .or. cell == self%n))
  end function at_periodic_edge

  !> Contacts with the chained disks of the nine cells around c.
  pure subroutine scan_crowd(self, disk, i, c, gravity, t, code)
    class(cell_grid_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i, c
    real(real64), intent(in) :: gravity(2)
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: k, m
    do k = c - self%stride, c + self%stride, self%stride
      do m = k - 1, k + 1
        call scan_chain(self, disk, i, m, no_shift, gravity, t, code)
      end do
    end do
  end subroutine scan_crowd

  !> Contacts with the chained disks of the crowded cell c.
  pure subroutine scan_chain(self, disk, i, c, shift, gravity, t, code)
    class(cell_grid_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i, c
    real(real64), intent(in) :: shift(2), gravity(2)
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: list(list_capacity), n, j
    j = self%cells%chain(c)
    do while (j > 0)
      n = 0
      do while (j > 0 .and. n < list_capacity)
        n = n + 1
        list(n) = j - 1
        j = self%cells%next(j)
      end do
      call earliest_contact(disk, i, n, list, .false., .true., shift, gravity, t, code)
    end do
  end subroutine scan_chain

  !> The same cell by cell where some of the nine are images beyond a periodic side. In a box of fewer than
  !> three columns a cell stands for several of its images.
  subroutine scan_around_edge(self, sim, i, t, code)
    class(cell_grid_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: dx, dy, there(2), image(2)
    real(real64) :: shift(2)
    do dy = -1, 1
      do dx = -1, 1
        there = sim%tag(i)%cell + [dx, dy]
        image = merge(floor(real(there - 1)/self%n), 0, sim%box%periodic)
        there = there - image*self%n
        shift = image*sim%box%edges()
        call scan_cell(self, sim, i, there(1) + self%stride*there(2), shift, t, code)
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
    call earliest_contact(sim%disk, i, self%cells%cell(c)%in_slots(), self%cells%cell(c)%slot, .false., &
      .true., shift, sim%box%gravity, t, code)
    call scan_chain(self, sim%disk, i, c, shift, sim%box%gravity, t, code)
  end subroutine scan_cell

end module cell_grid
