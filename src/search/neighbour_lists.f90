!> Neighbour lists. The list of a disk contains the disks that it could touch while the centres of
!> both stay within their neighbourhoods.
!>
!> The neighbourhood of a disk is a square around the position at which the list of the disk was
!> made. The square is clipped at the faces of the cell and at the sides of the box. When the centre
!> of the disk leaves this square, which is an event, its list expires. A new list and a new
!> neighbourhood are then made from the 3 x 3 cells around the disk. A prediction therefore tests
!> only a few neighbours, however many disks the cells contain (Donev, Torquato and Stillinger,
!> Journal of Computational Physics 202, 737 (2005)).
!>
!> Lists save time but do not change the results. A list without space for another neighbour is
!> marked as incomplete. Until the disk receives a new list, its predictions search the 3 x 3 cells
!> around it.
!>
!> If the radii differ very much, 3 x 3 cells contain very many disks. The disks with small
!> neighbourhoods are then also sorted into a second grid of narrow cells, according to the centres
!> of their neighbourhoods. A new list of such a disk then requires only a search of 3 x 3 narrow
!> cells, and of 3 x 3 wide cells for the few disks with large neighbourhoods.
module neighbour_lists
  use, intrinsic :: iso_fortran_env, only: real32
  use kinds, only: int16, int32, int64, pi, real64
  use cell_contents, only: append, cell_contents_t
  use cell_faces, only: cell_faces_t, line_t
  use cell_layout, only: cell_layout_t
  use disks, only: disk_t, tag_t
  use memory_hints, only: prefetch
  use event_prediction, only: list_capacity, prediction_t
  use partners, only: is_wall, looks_again
  implicit none
  private
  public :: neighbour_lists_t

  !> Special values of the entry count: no list made yet; list too short for all neighbours.
  integer(int32), parameter :: unlisted = -2, incomplete = -1
  !> Number of array elements copied from every list, even if the list is shorter. Copying a fixed
  !> number needs no branch.
  integer(int32), parameter :: always_copied = 15
  !> Factor of the image index in a list entry; larger than the index of any disk.
  integer(int32), parameter :: image_unit = 2**27
  !> Maximum number of disks for which lists are used, so that 32-bit integers can number all
  !> entries.
  integer(int32), parameter :: most_listed = image_unit/4

  !> Minimum width of a narrow cell, divided by (mean radius + margin). A disk fits if its own
  !> radius plus margin is at most half the cell width. With 2 the mean disk would just fit; a
  !> larger value admits somewhat larger disks.
  real(real64), parameter :: narrow_width = 2.2_real64

  !> The region around a disk in which its list is valid. When the centre of the disk leaves it, the
  !> list expires.
  type :: neighbourhood_t
    !> (left, right) and (lower, upper) boundaries of the region.
    type(line_t) :: column(0:1), row(0:1)
  end type neighbourhood_t

  !> Minimum mean number of disks in 3 x 3 cells for which lists save time in a dilute system.
  real(real64), parameter, public :: candidates_that_pay = 30.0_real64

  type :: neighbour_lists_t
    logical :: used = .false.
    real(real64) :: least_candidates = candidates_that_pay
    !> Capacity of the list of a small disk; larger disks have more neighbours.
    integer(int32) :: capacity = 16
    real(real64) :: mean_radius = 0.0_real64       !! [length]
    !> Half the width of the neighbourhood of a disk with the mean radius [length].
    real(real64) :: margin = 0.0_real64
    real(real64) :: origin(2) = 0.0_real64         !! lower left corner of the box [length]
    real(real64) :: period(2) = 0.0_real64         !! edges of the box [length]
    real(real32) :: rounding_error = 0.0_real32    !! upper bound of the rounding errors in `extent` [length]
    type(neighbourhood_t), allocatable :: neighbourhood(:)   !! neighbourhood of each disk
    !> For each disk: x and y of the centre relative to `origin`, radius plus `rounding_error`, and
    !> half the width of the neighbourhood before clipping; shape (4, disks) [length].
    real(real32), allocatable :: extent(:, :)
    !> Position in `entry` of the list of each disk; shape (disks+1). A list starts with the number
    !> of its entries.
    integer(int32), allocatable :: first(:)
    !> All lists, from index 0. An entry is the index of a disk, counted from 0, plus `image_unit`
    !> times an image index.
    integer(int32), allocatable :: entry(:)
    !> For the entry of disk j in the list of disk i, the position of the reverse entry of disk i in
    !> the list of disk j; from index 0.
    integer(int32), allocatable :: back(:)
    !> Number of narrow cells per cell along each axis; 1 without narrow cells.
    integer(int32) :: parts = 1
    !> Maximum radius plus margin of disks in narrow cells [length].
    real(real32) :: narrow_extent = 0.0_real32
    type(cell_layout_t) :: narrow_layout           !! the narrow cells, which subdivide the cells of the box
    type(cell_contents_t) :: narrow                !! disks in narrow cells
    type(cell_contents_t) :: wide                  !! all other disks with lists, in wide cells
  contains
    procedure :: prepare
    procedure, private :: make_room
    procedure, private :: cut_cells
    procedure :: lay
    procedure :: enter
    procedure :: leave
    procedure :: is_complete
    procedure :: is_short
    procedure :: copy_list
    procedure :: n_entries
    procedure :: neighbour
    procedure :: read_ahead
  end type neighbour_lists_t

contains

  !> Allocates the neighbour lists if they are expected to save time. With lists, a prediction after
  !> a collision tests fewer disks, but the lists must be renewed, and the lower the density, the
  !> more often. `least_candidates` and the width of the neighbourhoods were optimised for
  !> polydisperse disks.
  subroutine prepare(self, disk, tag, lower, edges, layout)
    class(neighbour_lists_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    real(real64), intent(in) :: lower(2), edges(2) !! lower left corner and edges of the box [length]
    type(cell_layout_t), intent(in) :: layout
    real(real64) :: area, packing, candidates, radii(2)
    integer(int32) :: i, n

    self%used = .false.
    n = size(disk, kind=int32)
    if (n > most_listed .or. .not. layout%small > 0) return
    area = product(layout%n*layout%width)
    candidates = min(9*product(layout%width)/area, 1.0_real64)*n
    packing = min(n*pi*layout%small**2/area, 0.9_real64)           ! an upper bound
    if (candidates < self%least_candidates - 27*packing) return
    n = 0
    radii = 0
    do i = 1, size(disk, kind=int32)
      if (tag(i)%id == 0 .or. disk(i)%radius > layout%small) cycle
      n = n + 1
      radii = radii + disk(i)%radius**[1, 2]
    end do
    packing = min(pi*radii(2)/area, 0.9_real64)
    self%used = n > 0 .and. candidates > self%least_candidates - 27*packing
    if (.not. self%used) return
    self%mean_radius = radii(1)/n
    self%margin = max(0.6_real64 + 2.5_real64*(0.72_real64 - packing), 0.3_real64)*self%mean_radius
    call self%make_room(disk, lower, edges)
    call self%cut_cells(layout, int(minval(layout%width)/(narrow_width*(self%mean_radius + self%margin)), int32))
  end subroutine prepare

  !> Allocates empty lists for all disks, with more space for larger disks, which have more
  !> neighbours.
  subroutine make_room(self, disk, lower, edges)
    class(neighbour_lists_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    real(real64), intent(in) :: lower(2), edges(2) !! lower left corner and edges of the box [length]
    real(real64) :: sizes                          ! radius of the disk relative to the mean radius
    integer(int32) :: i, n

    n = size(disk, kind=int32)
    self%origin = lower
    self%period = edges
    self%rounding_error = real(8*epsilon(1.0_real32)*maxval(edges) + 1.0e-6_real64*maxval(disk%radius), real32)
    if (allocated(self%first)) then
      if (size(self%first) /= n + 1) deallocate (self%first, self%neighbourhood, self%extent)
    end if
    if (.not. allocated(self%first)) then
      allocate (self%first(n + 1), self%neighbourhood(n))
      allocate (self%extent(4, n), source=0.0_real32)           ! values of disks without a list are also read
    end if
    self%first(1) = 0
    do i = 1, n
      sizes = min(disk(i)%radius/self%mean_radius, 4096.0_real64)
      self%first(i + 1) = self%first(i) + self%capacity*(1 + int(0.5_real64*sizes, int32))
    end do
    if (allocated(self%entry)) then
      if (size(self%entry) < self%first(n + 1) + always_copied) deallocate (self%entry, self%back)
    end if
    if (.not. allocated(self%entry)) &
      allocate (self%entry(0:self%first(n + 1) - 1 + always_copied), self%back(0:self%first(n + 1) - 1))
    self%entry(self%first(:n)) = unlisted
  end subroutine make_room

  !> Divides each cell into parts x parts empty narrow cells.
  subroutine cut_cells(self, layout, parts)
    class(neighbour_lists_t), intent(inout) :: self
    type(cell_layout_t), intent(in) :: layout
    integer(int32), intent(in) :: parts
    integer(int32) :: n

    self%parts = 1
    if (parts < 2 .or. any(layout%n /= layout%whole .or. layout%first /= 1) .or. maxval(layout%n)*parts > huge(1_int16) - 2) return
    self%parts = parts
    associate (narrow => self%narrow_layout)
      narrow = layout
      narrow%whole = parts*layout%whole
      narrow%n = narrow%whole
      narrow%width = layout%width/parts
      call narrow%find_sides(layout%last > 0)
      self%narrow_extent = 0.5_real32*real(minval(narrow%width), real32)*(1 - 4*epsilon(1.0_real32))
      n = size(self%neighbourhood, kind=int32)
      call self%narrow%empty(narrow%n(1) + 2, narrow%n(2) + 2, n)
      call self%wide%empty(layout%n(1) + 2, layout%n(2) + 2, n)
    end associate
  end subroutine cut_cells

  !> True if disk i belongs in a narrow cell.
  pure function is_narrow(self, i) result(yes)
    type(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%extent(3, i) + self%extent(4, i) <= self%narrow_extent
  end function is_narrow

  !> Narrow cell that contains the centre of the neighbourhood of disk i.
  pure function narrow_cell(self, i) result(cell)
    type(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int16) :: cell(2)

    cell = int(self%narrow_layout%cell_at(self%origin + self%extent(:2, i)), int16)
  end function narrow_cell

  !> Sets up a new neighbourhood around disk i at the position x.
  pure subroutine lay(self, i, radius, x, faces, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: radius, x(2)       !! [length]
    type(cell_faces_t), intent(in) :: faces
    integer(int16), intent(in) :: cell(2)
    real(real64) :: margin

    margin = self%margin*sqrt(self%mean_radius/radius)
    self%extent(:, i) = real([x - self%origin, radius, margin], real32)
    self%extent(3, i) = self%extent(3, i) + self%rounding_error
    self%neighbourhood(i)%column = clipped(faces%column(:, cell(1)), 1)
    self%neighbourhood(i)%row = clipped(faces%row(:, cell(2)), 2)
  contains

    !> The two boundaries of a neighbourhood along an axis. On each side this is the face of the
    !> cell or the edge of the square, whichever is closer.
    pure function clipped(line, axis) result(nearer)
      type(line_t), intent(in) :: line(0:1)
      integer(int32), intent(in) :: axis
      type(line_t) :: nearer(0:1)
      real(real64) :: place
      integer(int32) :: up

      nearer = line
      do up = 0, 1
        place = x(axis) + (2*up - 1)*margin
        ! A moving side does not bound a neighbourhood.
        if ((2*up - 1)*(line(up)%place + line(up)%inset*radius - place) <= 0 &
          .and. .not. (line(up)%struck .and. is_wall(line(up)%code))) cycle
        nearer(up)%place = place
        nearer(up)%inset = 0
        nearer(up)%code = looks_again - up
      end do
    end function clipped
  end subroutine lay

  !> Makes the list of disk i: finds the disks that it can touch in its new neighbourhood.
  subroutine enter(self, i, cells, layout, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    integer(int16), intent(in) :: cell(2)          !! cell of disk i

    self%entry(self%first(i)) = 0
    if (self%parts == 1) then
      call search(self, i, cells, layout, cell)
    else if (is_narrow(self, i)) then
      associate (home => narrow_cell(self, i))
        call search(self, i, self%narrow, self%narrow_layout, home)
        call search(self, i, self%wide, layout, cell)
        call self%narrow%insert(self%narrow%number(home), i)
      end associate
    else
      call search(self, i, cells, layout, cell)
      call self%wide%insert(self%wide%number(cell), i)
    end if
  end subroutine enter

  !> Searches a cell and its eight neighbours for disks that disk i can touch in its neighbourhood,
  !> and enters each pair in both lists. Pairs with a disk that has no list yet are entered when its
  !> list is made.
  subroutine search(self, i, cells, layout, cell)
    type(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    integer(int16), intent(in) :: cell(2)          !! cell around which disks are searched
    integer(int32) :: candidate(list_capacity), around(9), image(9), c, k, row
    integer(int64) :: n                            ! number of candidates
    real(real32) :: own(4)                         ! extent of disk i [length]

    own = self%extent(:, i)
    self%extent(4, i) = -(2*own(4) + 4*own(3))     ! makes the distance test reject disk i itself
    n = 0
    if (layout%at_seam(cell)) then
      call find_cells(cells, layout, cell, around, image)
      do k = 1, size(around)
        call append(cells%cell(around(k)), candidate, n)
        call add_chain(around(k), image(k))
        call test_candidates(image(k))
      end do
    else
      c = cells%number(cell)
      do row = c - cells%stride, c + cells%stride, cells%stride
        call append(cells%cell(row - 1), candidate, n)
        call append(cells%cell(row), candidate, n)
        call append(cells%cell(row + 1), candidate, n)
      end do
      do row = c - cells%stride, c + cells%stride, cells%stride
        do k = row - 1, row + 1
          call add_chain(k, 0)
        end do
      end do
      call test_candidates(0)
    end if
    self%extent(4, i) = own(4)
  contains

    !> Adds the disks in the linked list of a crowded cell to the candidates. The first disk of the
    !> linked list is skipped: it also occupies the last slot and was added with the slots.
    subroutine add_chain(c, image)
      integer(int32), intent(in) :: c, image
      integer(int32) :: j

      j = cells%chain(c)
      if (j > 0) j = cells%next(j)
      do while (j > 0)
        if (n == list_capacity) call test_candidates(image)
        n = n + 1
        candidate(n) = j - 1
        j = cells%next(j)
      end do
    end subroutine add_chain

    !> Adds the candidates that are close enough to disk i. The test has no branches, which would
    !> often be mispredicted.
    subroutine test_candidates(image)
      integer(int32), intent(in) :: image          !! periodic image that contains the candidates
      integer(int32) :: j, k, found(list_capacity + 1), n_found
      real(real32) :: x, y, reach, margin, dx, dy

      associate (shift => real(periods(image)*self%period, real32))
        x = own(1) - shift(1)
        y = own(2) - shift(2)
        reach = own(3)
        margin = own(4)
      end associate
      n_found = 0
      do k = 1, int(n, int32)
        j = candidate(k) + 1
        associate (other => self%extent(:, j))
          dx = max(abs(other(1) - x) - (margin + other(4)), 0.0_real32)
          dy = max(abs(other(2) - y) - (margin + other(4)), 0.0_real32)
          found(n_found + 1) = j
          n_found = n_found + merge(1, 0, dx*dx + dy*dy <= (reach + other(3))**2)
        end associate
      end do
      do k = 1, n_found
        j = found(k)
        call add_pair(self, i, j, image)
      end do
      n = 0
    end subroutine test_candidates
  end subroutine search

  !> Enters disks i and j in each other's lists, unless disk j has no list yet. `image` is the
  !> periodic image of disk j that disk i can touch.
  pure subroutine add_pair(self, i, j, image)
    type(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i, j, image
    integer(int32) :: at_i, at_j, n_i, n_j

    at_i = self%first(i)
    at_j = self%first(j)
    n_i = self%entry(at_i) + 1
    n_j = self%entry(at_j) + 1
    if (n_j == unlisted + 1) return
    if (n_i > 0) then
      if (at_i + n_i == self%first(i + 1)) n_i = incomplete    ! the list is full
      self%entry(at_i) = n_i
    end if
    if (n_j > 0) then
      if (at_j + n_j == self%first(j + 1)) n_j = incomplete
      self%entry(at_j) = n_j
    end if
    if (n_i > 0) self%entry(at_i + n_i) = j - 1 + image_unit*image
    if (n_i > 0) self%back(at_i + n_i) = max(n_j, 0)
    if (n_j > 0) self%entry(at_j + n_j) = i - 1 + image_unit*reverse(image)
    if (n_j > 0) self%back(at_j + n_j) = max(n_i, 0)
  end subroutine add_pair

  !> Removes disk i from the lists of all other disks.
  pure subroutine leave(self, i, cells, layout, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    integer(int16), intent(in) :: cell(2)          !! cell of disk i
    integer(int32) :: at, k, m, around(9), image(9), j, n

    if (self%parts > 1) then
      if (is_narrow(self, i)) then
        call self%narrow%remove(self%narrow%number(narrow_cell(self, i)), i)
      else
        call self%wide%remove(self%wide%number(cell), i)
      end if
    end if
    at = self%first(i)
    n = self%entry(at)
    self%entry(at) = unlisted
    do k = 1, n
      j = iand(self%entry(at + k), image_unit - 1) + 1
      if (self%entry(self%first(j)) >= 0) call remove(self, j, self%back(at + k))
    end do
    if (n /= incomplete) return
    call find_cells(cells, layout, cell, around, image)
    do k = 1, size(around)
      do m = 1, cells%cell(around(k))%in_slots()
        call remove_disk(self, cells%cell(around(k))%slot(m) + 1, i - 1 + image_unit*reverse(image(k)))
      end do
      j = cells%chain(around(k))
      do while (j > 0)
        call remove_disk(self, j, i - 1 + image_unit*reverse(image(k)))
        j = cells%next(j)
      end do
    end do
  end subroutine leave

  !> Removes an entry from the list of disk i by moving the last entry to its position.
  pure subroutine remove(self, i, place)
    type(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i, place
    integer(int32) :: at, n, last

    at = self%first(i)
    n = self%entry(at)
    last = self%entry(at + n)
    self%entry(at + place) = last
    self%back(at + place) = self%back(at + n)
    ! If the list of the other disk is incomplete, this value of `back` is never used.
    self%back(self%first(iand(last, image_unit - 1) + 1) + self%back(at + n)) = place
    self%entry(at) = n - 1
  end subroutine remove

  !> Removes an entry, if it exists, from the list of disk i.
  pure subroutine remove_disk(self, i, entry)
    type(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i, entry
    integer(int32) :: k

    do k = 1, self%entry(self%first(i))
      if (self%entry(self%first(i) + k) /= entry) cycle
      call remove(self, i, k)
      return
    end do
  end subroutine remove_disk

  !> Lists a cell and its eight neighbours, with the periodic image to which each belongs.
  pure subroutine find_cells(cells, layout, cell, around, image)
    type(cell_contents_t), intent(in) :: cells
    type(cell_layout_t), intent(in) :: layout
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(out) :: around(9), image(9)
    integer(int32) :: column, row, x, y, k

    do k = 0, 8
      call layout%step(1, int(cell(1), int32), modulo(k, 3) - 1, column, x)
      call layout%step(2, int(cell(2), int32), k/3 - 1, row, y)
      around(k + 1) = column + cells%stride*row
      image(k + 1) = modulo(x + 3*y, 9)
    end do
  end subroutine find_cells

  !> Index of the image of disk i that disk j can touch, if disk i can touch the image `image` of
  !> disk j.
  elemental function reverse(image)
    integer(int32), intent(in) :: image
    integer(int32) :: reverse

    reverse = merge(9 - image, 0, image > 0)
  end function reverse

  !> Index of an image along each axis: -1, 0 or 1. An entry encodes the indices x and y as x + 3 y,
  !> modulo 9.
  pure function periods(image) result(number)
    integer(int32), intent(in) :: image
    real(real64) :: number(2)

    number = [modulo(image + 4, 3) - 1, modulo(image + 4, 9)/3 - 1]
  end function periods

  !> True if the list of disk i contains all disks that disk i can touch in its neighbourhood.
  pure function is_complete(self, i) result(yes)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%entry(self%first(i)) >= 0
  end function is_complete

  !> True if the list of disk i is complete and fits into the list of candidates.
  pure function is_short(self, i) result(yes)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    associate (n => self%entry(self%first(i)))
      yes = n >= 0 .and. n <= list_capacity
    end associate
  end function is_short

  !> Copies the neighbour list of a disk to its candidates. The list must not contain neighbours
  !> across a periodic side.
  pure subroutine copy_list(self, near)
    class(neighbour_lists_t), intent(in) :: self
    type(prediction_t), intent(inout) :: near
    integer(int32) :: at, k

    at = self%first(near%disk)
    near%n = self%entry(at)
    near%list(:always_copied) = self%entry(at + 1:at + always_copied)
    do k = always_copied + 1, near%n
      near%list(k) = self%entry(at + k)
    end do
  end subroutine copy_list

  !> Number of entries in the list of disk i.
  pure function n_entries(self, i) result(n)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: n

    n = max(self%entry(self%first(i)), 0)
  end function n_entries

  !> Disk j (index counted from 0) in entry k = 1, 2, ... of the list of disk i, and the periodic
  !> image in which disk i can touch it.
  pure subroutine neighbour(self, i, k, j, image)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i, k
    integer(int32), intent(out) :: j
    real(real64), intent(out) :: image(2)

    associate (entry => self%entry(self%first(i) + k))
      j = iand(entry, image_unit - 1)
      image = periods(entry/image_unit)
    end associate
  end subroutine neighbour

  !> Prefetches the data for predicting the next events of several disks, in three stages: the
  !> records of the disks, their neighbour lists, and the disks in these lists. The record and the
  !> list of a disk's collision partner are fetched one stage later than the disk's own.
  subroutine read_ahead(self, disk, tag, stage, disks)
    class(neighbour_lists_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: stage
    integer(int32), intent(in) :: disks(:)
    integer(int32) :: k, m, partner

    do k = 1, size(disks)
      partner = disk(disks(k))%partner
      select case (stage)
      case (1)
        call fetch_record(disks(k))
      case (2)
        call fetch_list(disks(k))
        if (partner > 0) call fetch_record(partner)
      case default
        do m = 1, self%n_entries(disks(k))
          call prefetch(disk(iand(self%entry(self%first(disks(k)) + m), image_unit - 1) + 1)%x(1))
        end do
        if (partner > 0) call fetch_list(partner)
      end select
    end do
  contains

    subroutine fetch_record(i)
      integer(int32), intent(in) :: i

      call prefetch(tag(i)%species)
      call prefetch(disk(i)%collision_counter)
      call prefetch(self%first(i))
    end subroutine fetch_record

    subroutine fetch_list(i)
      integer(int32), intent(in) :: i

      call prefetch(self%neighbourhood(i)%column(0)%code)
      call prefetch(self%neighbourhood(i)%row(1)%code)
      call prefetch(self%entry(self%first(i)))
    end subroutine fetch_list
  end subroutine read_ahead

end module neighbour_lists
