!> A packing is a set of placed disks. The module can test whether another disk fits between the placed disks, and can find the
!> first disk that a moving disk touches. Each species has its own grid of cells. The disks of one species have similar radii. The
!> cost of a search therefore does not depend on the radii of other species.
module packing
  use images, only: images_t
  use kinds, only: int32, real64
  use memory_hints, only: prefetch
  use obstacle_cells, only: obstacle_cells_t
  use partners, only: obstacle_code, obstacle_number
  use box_geometry, only: box_t
  use shapes, only: spare
  implicit none
  private
  public :: packing_t

  !> The grid of cells of one species.
  type :: layer_t
    real(real64) :: radius = 0.0_real64             !! largest radius of the disks of the species [length]
    integer(int32) :: count = 0                     !! number of disks of the species to be placed
    real(real64) :: lower(2) = 0.0_real64           !! corners of a rectangle that contains all centres [length]
    real(real64) :: upper(2) = 0.0_real64
    real(real64) :: density(2) = 0.0_real64         !! number of cells per length along each axis [1/length]
    integer :: n(2) = 0                             !! numbers of columns and rows
    real(real64) :: width = 0.0_real64              !! smaller edge of a cell [length]
    integer(int32), allocatable :: head(:, :)       !! first disk in each cell; 0 if the cell is empty
  end type layer_t

  !> A placed disk. All data of a disk are stored in one record, so that the access to a disk reads only one cache line. Disks that
  !> are close in space are usually far apart in memory.
  type :: placed_t
    real(real64) :: x(2) = 0.0_real64               !! centre [length]
    real(real64) :: radius = 0.0_real64             !! [length]
    integer(int32) :: species = 0                   !! index of the species; 0 if the disk has not been placed yet
    integer(int32) :: next = 0                      !! next disk in the same cell; 0 at the end of the list
  end type placed_t

  type :: packing_t
    type(box_t) :: box
    type(images_t), private :: images               !! images of the box
    type(placed_t), allocatable :: disk(:)          !! (n)
    type(layer_t), allocatable :: layer(:)          !! (number of species)
    !> Lists of nearby obstacles for each cell. The lists are valid for disks up to the largest radius that was passed to
    !> `open_species`.
    type(obstacle_cells_t) :: near
  contains
    procedure :: open_all_species
    procedure :: open_species
    procedure :: add
    procedure :: remove
    procedure :: shift
    procedure :: find_contact
    procedure :: find_blocker
    procedure :: list_neighbours
    procedure :: covers
    procedure :: separation
    procedure :: load_cells
    procedure :: load_disks
  end type packing_t

  interface packing_t
    module procedure empty_packing
  end interface packing_t

contains

  !> Creates a packing without disks, with space for `n_disks` disks.
  function empty_packing(box, n_disks, n_species) result(packing)
    type(box_t), intent(in) :: box
    integer, intent(in) :: n_disks, n_species
    type(packing_t) :: packing

    packing%box = box
    packing%images = box%images()
    allocate (packing%disk(n_disks), packing%layer(n_species))
  end function empty_packing

  !> Sets up the cells of a species. The edge of a cell is the largest diameter of the species, or longer if the species has few
  !> disks.
  subroutine open_species(self, s, radius, count, lower, upper)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: s
    real(real64), intent(in) :: radius              !! largest radius of the disks of the species [length]
    integer, intent(in) :: count                    !! number of disks of the species to be placed
    !> Corners of a rectangle that contains the centres of all disks of the species [length]
    real(real64), intent(in) :: lower(2), upper(2)
    real(real64) :: side, extent(2), few
    integer :: n(2)

    call self%near%serve(self%box, radius)
    extent = upper - lower
    few = 2.0_real64*count
    side = max(2*radius, sqrt(extent(1)*extent(2)/few), maxval(extent)/few)
    n = max(int(extent/side), 1)
    associate (layer => self%layer(s))
      layer%radius = radius
      layer%count = count
      layer%lower = lower
      layer%upper = upper
      layer%density = 0
      where (extent > 0) layer%density = n/extent
      layer%n = n
      layer%width = minval(extent/n)
      if (allocated(layer%head)) deallocate (layer%head)
      allocate (layer%head(n(1), n(2)), source=0_int32)
    end associate
  end subroutine open_species

  !> Sets up the cells of all species for given disks.
  subroutine open_all_species(self, species, radius, lower, upper)
    class(packing_t), intent(inout) :: self
    integer, intent(in) :: species(:)               !! (n) index of the species of each disk
    real(real64), intent(in) :: radius(:)           !! (n) [length]
    real(real64), intent(in) :: lower(2), upper(2)  !! corners of a rectangle that contains the centres of all disks [length]
    integer(int32) :: s

    do s = 1, size(self%layer, kind=int32)
      associate (mine => species == s)
        if (any(mine)) call self%open_species(s, maxval(radius, mask=mine), count(mine), lower, upper)
      end associate
    end do
  end subroutine open_all_species

  !> Adds disk k of species s at the point p, without a test for overlaps.
  pure subroutine add(self, k, s, p, radius)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k, s
    real(real64), intent(in) :: p(2)                !! [length]
    real(real64), intent(in) :: radius              !! [length]
    integer :: c(2)

    c = cell(self%layer(s), p)
    self%disk(k)%x = p
    self%disk(k)%radius = radius
    self%disk(k)%species = s
    self%disk(k)%next = self%layer(s)%head(c(1), c(2))
    self%layer(s)%head(c(1), c(2)) = k
  end subroutine add

  !> Removes disk k from its cell. The record of the disk keeps its position and radius.
  pure subroutine remove(self, k)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k
    integer(int32) :: before
    integer :: c(2)

    associate (me => self%disk(k))
      c = cell(self%layer(me%species), me%x)
      associate (head => self%layer(me%species)%head(c(1), c(2)))
        if (head == k) then
          head = me%next
          return
        end if
        before = head
      end associate
      do while (self%disk(before)%next /= k)
        before = self%disk(before)%next
      end do
      self%disk(before)%next = me%next
    end associate
  end subroutine remove

  !> Moves disk k along an axis, without a test for overlaps. The distance must not exceed the period of a periodic axis.
  pure subroutine shift(self, k, axis, distance)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k
    integer, intent(in) :: axis                     !! 1 for x, 2 for y
    real(real64), intent(in) :: distance            !! negative for a motion to the left or downwards [length]
    real(real64) :: p(2)

    associate (me => self%disk(k), box => self%box)
      p = me%x
      p(axis) = p(axis) + distance
      if (box%periodic(axis)) then                  ! rounding errors must not move the disk out of the box
        if (p(axis) >= box%upper(axis)) p(axis) = max(p(axis) - (box%upper(axis) - box%lower(axis)), box%lower(axis))
        if (p(axis) < box%lower(axis)) p(axis) = min(p(axis) + (box%upper(axis) - box%lower(axis)), box%upper(axis))
      end if
      if (all(cell(self%layer(me%species), p) == cell(self%layer(me%species), me%x))) then
        me%x = p
        return
      end if
    end associate
    call self%remove(k)
    call self%add(k, self%disk(k)%species, p, self%disk(k)%radius)
  end subroutine shift

  !> Finds the first disk that disk k touches when disk k moves along an axis while all other disks are at rest. On a periodic axis,
  !> the grid of each species must extend over the whole period.
  pure subroutine find_contact(self, k, axis, sense, distance, partner)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: k
    integer, intent(in) :: axis                     !! 1 for x, 2 for y
    integer, intent(in) :: sense                    !! 1 for a motion to the right or upwards, -1 for the opposite direction
    !> Distance up to which the procedure searches. If a disk is touched, the procedure sets this argument to the distance to the
    !> contact. [length]
    real(real64), intent(inout) :: distance
    integer(int32), intent(out) :: partner          !! disk that is touched; 0 if no disk is touched
    integer :: s

    partner = 0
    do s = 1, size(self%layer)
      if (allocated(self%layer(s)%head)) call search_ahead(self, s, k, [axis, sense], distance, partner)
    end do
  end subroutine find_contact

  !> Like `find_contact`, but searches only the disks of species s. The procedure searches lines of cells perpendicular to the
  !> motion, one line after another, until disk k cannot reach the next line before the contact that was found.
  pure subroutine search_ahead(packing, s, k, way, distance, partner)
    type(packing_t), intent(in) :: packing
    integer, intent(in) :: s
    integer(int32), intent(in) :: k
    integer, intent(in) :: way(2)                   !! axis and sense
    real(real64), intent(inout) :: distance
    integer(int32), intent(inout) :: partner
    real(real64) :: rho, period(2), start(2), gap
    integer :: along, across, first, last, n(2), c(2), middle(2), step, row

    along = way(1)
    across = 3 - along
    associate (layer => packing%layer(s), me => packing%disk(k), periodic => packing%box%periodic)
      n = layer%n
      period = packing%box%edges()
      rho = (me%radius + layer%radius)*(1 + spare)
      start = (me%x - layer%lower)*layer%density    ! position in units of cells
      middle = int(min(max(start, 0.0_real64), n - 1.0_real64))
      first = floor(start(across) - rho*layer%density(across))
      last = floor(start(across) + rho*layer%density(across))
      if (periodic(across)) then
        last = min(last, first + n(across) - 1)
      else
        first = min(max(first, 0), n(across) - 1)
        last = min(max(last, 0), n(across) - 1)
      end if
      do step = 0, n(along) - 1
        c(along) = middle(along) + way(2)*step
        gap = way(2)*(c(along) + merge(0, 1, way(2) > 0) - start(along))
        if (step > 0 .and. gap > (distance + rho)*layer%density(along)) exit
        if (.not. periodic(along) .and. (c(along) < 0 .or. c(along) >= n(along))) exit
        c(along) = modulo(c(along), n(along))
        do row = first, last
          c(across) = merge(modulo(row, n(across)), row, periodic(across))
          call search_contact(packing, k, layer%head(c(1) + 1, c(2) + 1), way, period, distance, partner)
        end do
      end do
    end associate
  end subroutine search_ahead

  !> Like `find_contact`, but searches only the disks in one cell.
  pure subroutine search_contact(packing, k, head, way, period, distance, partner)
    type(packing_t), intent(in) :: packing
    integer(int32), intent(in) :: k, head
    integer, intent(in) :: way(2)
    real(real64), intent(in) :: period(2)           !! [length]
    real(real64), intent(inout) :: distance
    integer(int32), intent(inout) :: partner
    real(real64) :: ahead, aside, half_chord_2
    integer(int32) :: j

    j = head
    associate (me => packing%disk(k), along => way(1), across => 3 - way(1), periodic => packing%box%periodic)
      do while (j > 0)
        associate (other => packing%disk(j))
          aside = abs(other%x(across) - me%x(across))
          if (periodic(across)) aside = min(aside, period(across) - aside)
          half_chord_2 = (me%radius + other%radius)**2 - aside**2
          if (half_chord_2 > 0 .and. j /= k) then
            ahead = way(2)*(other%x(along) - me%x(along))
            if (ahead < 0 .and. periodic(along)) ahead = ahead + period(along)
            if (ahead >= 0) then
              ahead = max(ahead - sqrt(half_chord_2), 0.0_real64)
              if (ahead < distance) then
                distance = ahead
                partner = j
              end if
            end if
          end if
          j = other%next
        end associate
      end do
    end associate
  end subroutine search_contact

  !> Finds a disk or an obstacle that excludes the centres of disks of the given radius from the whole rectangle `centre` +- `half`.
  !> The result `blocker` is the index of the disk, or the code of the obstacle (see `partners`), or 0 if neither a disk nor an
  !> obstacle excludes the rectangle. With half = 0 the procedure tests whether a disk fits at the point `centre`.
  pure subroutine find_blocker(self, centre, half, radius, blocker)
    class(packing_t), intent(in) :: self
    real(real64), intent(in) :: centre(2), half(2)  !! [length]
    !> Radius of the disks; at most the largest radius that was passed to `open_species` [length]
    real(real64), intent(in) :: radius
    integer(int32), intent(out) :: blocker
    real(real64) :: rho
    integer(int32) :: e
    integer :: s, kx, ky, first(2), last(2)

    e = self%near%first_near(centre)
    do while (e > 0)
      blocker = obstacle_code(self%near%entry(e)%obstacle)
      if (self%covers(blocker, centre, half, radius)) return
      e = self%near%entry(e)%next
    end do
    blocker = 0
    do s = 1, size(self%layer)
      if (.not. allocated(self%layer(s)%head)) cycle
      rho = radius + self%layer(s)%radius
      call range_images(self%box, centre, rho, first, last)
      do ky = first(2), last(2)
        do kx = first(1), last(1)
          call search_layer(self, s, centre + [kx, ky]*self%box%edges(), half, radius, blocker)
          if (blocker > 0) return
        end do
      end do
    end do
  end subroutine find_blocker

  !> Prefetches the cells around a point in the grid of a species.
  subroutine load_cells(self, s, p)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: s
    real(real64), intent(in) :: p(2)                !! [length]
    integer :: c(2)

    associate (layer => self%layer(s))
      c = cell(layer, p)
      call prefetch(layer%head(c(1), max(c(2) - 1, 1)))
      call prefetch(layer%head(c(1), c(2)))
      call prefetch(layer%head(c(1), min(c(2) + 1, layer%n(2))))
    end associate
  end subroutine load_cells

  !> Prefetches, for each cell around a point, the disk that was added last to the cell.
  subroutine load_disks(self, s, p)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: s
    real(real64), intent(in) :: p(2)                !! [length]
    integer :: c(2), i, j

    associate (layer => self%layer(s))
      c = cell(layer, p)
      do j = max(c(2) - 1, 1), min(c(2) + 1, layer%n(2))
        do i = max(c(1) - 1, 1), min(c(1) + 1, layer%n(1))
          call prefetch(self%disk(max(layer%head(i, j), 1_int32))%x(1))
        end do
      end do
    end associate
  end subroutine load_disks

  !> Finds a disk of species s that excludes the centres of disks of the given radius from the whole rectangle p +- half. If no disk
  !> of the species excludes the whole rectangle, `blocker` is set to 0. The cell that contains the point p is searched first,
  !> because a disk in this cell is most likely to exclude the rectangle.
  pure subroutine search_layer(packing, s, p, half, radius, blocker)
    type(packing_t), intent(in) :: packing
    integer, intent(in) :: s
    real(real64), intent(in) :: p(2), half(2), radius
    integer(int32), intent(out) :: blocker
    real(real64) :: rho
    integer :: middle(2), low(2), high(2), i, j

    blocker = 0
    rho = radius + packing%layer(s)%radius
    associate (layer => packing%layer(s))
      if (any(p + rho < layer%lower .or. p - rho > layer%upper)) return
      middle = cell(layer, p)
      blocker = blocker_in(packing, layer%head(middle(1), middle(2)), p, half, radius)
      if (blocker > 0) return
      if (rho <= layer%width) then                  ! a search in the neighbouring cells is usually sufficient
        low = max(middle - 1, 1)
        high = min(middle + 1, layer%n)
      else
        low = cell(layer, p - rho)
        high = cell(layer, p + rho)
      end if
      do j = low(2), high(2)
        do i = low(1), high(1)
          blocker = blocker_in(packing, layer%head(i, j), p, half, radius)
          if (blocker > 0) return
        end do
      end do
    end associate
  end subroutine search_layer

  !> Like `search_layer`, but searches only the disks in one cell.
  pure function blocker_in(packing, head, p, half, radius) result(blocker)
    type(packing_t), intent(in) :: packing
    integer(int32), intent(in) :: head
    real(real64), intent(in) :: p(2), half(2), radius
    integer(int32) :: blocker

    blocker = head
    do while (blocker > 0)
      associate (d => packing%disk(blocker))
        if ((abs(d%x(1) - p(1)) + half(1))**2 + (abs(d%x(2) - p(2)) + half(2))**2 < (d%radius + radius)**2) return
        blocker = d%next
      end associate
    end do
  end function blocker_in

  !> Lists all disks whose boundary is within the distance `reach` of a point. The list may also contain more distant disks, because
  !> all disks in the searched cells are listed.
  subroutine list_neighbours(self, p, reach, list, n)
    class(packing_t), intent(in) :: self
    real(real64), intent(in) :: p(2), reach         !! [length]
    integer(int32), allocatable, intent(inout) :: list(:)   !! enlarged if necessary
    integer(int32), intent(out) :: n                !! number of disks in the list
    integer :: s, kx, ky, first(2), last(2)

    n = 0
    do s = 1, size(self%layer)
      if (.not. allocated(self%layer(s)%head)) cycle
      call range_images(self%box, p, reach + self%layer(s)%radius, first, last)
      do ky = first(2), last(2)
        do kx = first(1), last(1)
          call append_cells(p + [kx, ky]*self%box%edges(), reach + self%layer(s)%radius)
        end do
      end do
    end do

  contains

    !> Appends to the list all disks of species s in cells within the distance rho of a point.
    subroutine append_cells(p, rho)
      real(real64), intent(in) :: p(2), rho
      integer :: low(2), high(2), i, j
      integer(int32) :: k

      associate (layer => self%layer(s))
        if (any(p + rho < layer%lower .or. p - rho > layer%upper)) return
        low = cell(layer, p - rho)
        high = cell(layer, p + rho)
        do j = low(2), high(2)
          do i = low(1), high(1)
            k = layer%head(i, j)
            do while (k > 0)
              if (n == size(list)) list = [list, list]
              n = n + 1
              list(n) = k
              k = self%disk(k)%next
            end do
          end do
        end do
      end associate
    end subroutine append_cells
  end subroutine list_neighbours

  !> Whether the given disk or obstacle excludes the centres of disks of the given radius from the whole rectangle `centre` +-
  !> `half`.
  pure function covers(self, by, centre, half, radius) result(yes)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: by                !! index of the disk (> 0), or code of the obstacle
    real(real64), intent(in) :: centre(2), half(2)  !! [length]
    real(real64), intent(in) :: radius              !! [length]
    real(real64) :: corner(2)
    logical :: yes

    if (by < 0) then
      associate (shape => self%box%obstacle(obstacle_number(by))%shape)
        yes = shape%covers(shape%from_nearest(centre, self%box%images()), half, radius)
      end associate
    else
      corner = abs(self%separation(self%disk(by)%x, centre)) + half
      yes = corner(1)**2 + corner(2)**2 < (self%disk(by)%radius + radius)**2
    end if
  end function covers

  !> Vector from the point a to the nearest periodic image of the point b.
  pure function separation(self, a, b) result(d)
    class(packing_t), intent(in) :: self
    real(real64), intent(in) :: a(2), b(2)          !! [length]
    real(real64) :: d(2)

    d = b - a
    d = d + self%images%shift(self%images%nearest_image(d))
  end function separation

  !> The cell that contains a point, or the nearest cell if the point is outside the grid.
  pure function cell(layer, p) result(c)
    type(layer_t), intent(in) :: layer
    real(real64), intent(in) :: p(2)
    integer :: c(2)
    real(real64) :: column_row(2)

    column_row = max((p - layer%lower)*layer%density, 0.0_real64)
    c = 1 + int(min(column_row, layer%n - 1.0_real64))
  end function cell

  !> First and last index, along each axis, of the periodic images of a point that can be within the distance rho of a disk in the
  !> box.
  pure subroutine range_images(box, p, rho, first, last)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: p(2), rho
    integer, intent(out) :: first(2), last(2)

    first = merge(-1, 0, box%periodic .and. p + rho > box%upper)
    last = merge(1, 0, box%periodic .and. p - rho < box%lower)
  end subroutine range_images

end module packing
