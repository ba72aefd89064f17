!> A packing: a set of disks at fixed positions. The module tests whether another disk fits between
!> them, and finds the first disk touched by a moving disk. Each species has its own grid of cells,
!> adapted to its radii. The cost of a search then does not depend on the radii of other species.
module packing
  use grid, only: grid_t
  use images, only: images_t
  use kinds, only: int32, real64
  use memory_hints, only: prefetch
  use obstacle_cells, only: obstacle_cells_t
  use partners, only: obstacle_number
  use box_geometry, only: box_t
  use box_state, only: box_state_t
  use shapes, only: spare
  implicit none
  private
  public :: packing_t

  !> Grid of cells of one species.
  type, extends(grid_t) :: layer_t
    real(real64) :: radius = 0.0_real64             !! maximum radius of the species [length]
    integer(int32) :: count = 0                     !! number of disks of the species to be placed
    real(real64) :: upper(2) = 0.0_real64           !! upper right corner [length]
    real(real64) :: width = 0.0_real64              !! smaller edge of a cell [length]
    integer(int32), allocatable :: head(:, :)       !! first disk in each cell; 0 if the cell is empty
  end type layer_t

  !> A placed disk. Neighbours in space are usually far apart in memory. All data of a disk are
  !> therefore stored in one record, which costs a single cache line.
  type :: placed_t
    real(real64) :: x(2) = 0.0_real64               !! centre [length]
    real(real64) :: radius = 0.0_real64             !! [length]
    integer(int32) :: species = 0      !! index of the species; 0 if the disk has not been placed yet
    integer(int32) :: next = 0                      !! next disk in the same cell; 0 at the end of the list
  end type placed_t

  type :: packing_t
    type(box_state_t) :: box                        !! box at the time of the placement
    type(images_t), private :: images               !! periodic images of the box
    type(placed_t), allocatable :: disk(:)          !! placed disks
    type(layer_t), allocatable :: layer(:)          !! cells of each species
    !> Obstacles near each cell, listed for disks up to the maximum radius passed to `open_species`.
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

  !> Creates an empty packing with space for `n_disks` disks.
  function empty_packing(box, n_disks, n_species) result(packing)
    type(box_state_t), intent(in) :: box
    integer, intent(in) :: n_disks, n_species
    type(packing_t) :: packing

    packing%box = box
    packing%images = box%images()
    allocate (packing%disk(n_disks), packing%layer(n_species))
  end function empty_packing

  !> Sets up the cells of a species. The edge of a cell is the largest diameter of the species, or
  !> longer if the species has few disks.
  subroutine open_species(self, s, radius, count, lower, upper)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: s
    real(real64), intent(in) :: radius              !! maximum radius of the species [length]
    integer, intent(in) :: count                    !! number of disks of the species to be placed
    !> Corners of a rectangle that contains the centres of all disks of the species [length].
    real(real64), intent(in) :: lower(2), upper(2)
    real(real64) :: side, extent(2), few
    integer(int32) :: n(2)

    call self%near%serve(self%box%box_t, radius)
    extent = upper - lower
    few = 2.0_real64*count
    side = max(2*radius, sqrt(extent(1)*extent(2)/few), maxval(extent)/few)
    n = max(int(extent/side, int32), 1)
    associate (layer => self%layer(s))
      layer%radius = radius
      layer%count = count
      call layer%divide(lower, extent, n)
      layer%upper = upper
      layer%width = minval(extent/n)
      if (allocated(layer%head)) deallocate (layer%head)
      allocate (layer%head(n(1), n(2)), source=0_int32)
    end associate
  end subroutine open_species

  !> Sets up the cells of all species for given disks.
  subroutine open_all_species(self, species, radius, lower, upper)
    class(packing_t), intent(inout) :: self
    integer, intent(in) :: species(:)               !! index of the species of each disk
    real(real64), intent(in) :: radius(:)           !! radius of each disk [length]
    !> Corners of a rectangle that contains the centres of all disks [length].
    real(real64), intent(in) :: lower(2), upper(2)
    integer(int32) :: s

    do s = 1, size(self%layer, kind=int32)
      associate (mine => species == s)
        if (any(mine)) call self%open_species(s, maxval(radius, mask=mine), count(mine), lower, upper)
      end associate
    end do
  end subroutine open_all_species

  !> Adds disk k of species s at the point p, without testing for overlaps.
  pure subroutine add(self, k, s, p, radius)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k, s
    real(real64), intent(in) :: p(2)                !! [length]
    real(real64), intent(in) :: radius              !! [length]
    integer :: c(2)

    c = self%layer(s)%cell(p)
    self%disk(k)%x = p
    self%disk(k)%radius = radius
    self%disk(k)%species = s
    self%disk(k)%next = self%layer(s)%head(c(1), c(2))
    self%layer(s)%head(c(1), c(2)) = k
  end subroutine add

  !> Removes disk k from its cell; its position and radius are kept.
  pure subroutine remove(self, k)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k
    integer(int32) :: before
    integer :: c(2)

    associate (me => self%disk(k))
      c = self%layer(me%species)%cell(me%x)
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

  !> Moves disk k along an axis, without testing for overlaps. The distance must not exceed the
  !> period of a periodic axis.
  pure subroutine shift(self, k, axis, distance)
    class(packing_t), intent(inout) :: self
    integer(int32), intent(in) :: k
    integer, intent(in) :: axis                     !! 1 for x, 2 for y
    real(real64), intent(in) :: distance            !! negative to the left or downwards [length]
    real(real64) :: p(2)

    associate (me => self%disk(k), box => self%box)
      p = me%x
      p(axis) = p(axis) + distance
      if (box%periodic(axis)) then                  ! rounding errors must not move the disk out of the box
        if (p(axis) >= box%upper(axis)) p(axis) = max(p(axis) - (box%upper(axis) - box%lower(axis)), box%lower(axis))
        if (p(axis) < box%lower(axis)) p(axis) = min(p(axis) + (box%upper(axis) - box%lower(axis)), box%upper(axis))
      end if
      associate (layer => self%layer(me%species))
        if (all(layer%cell(p) == layer%cell(me%x))) then
          me%x = p
          return
        end if
      end associate
    end associate
    call self%remove(k)
    call self%add(k, self%disk(k)%species, p, self%disk(k)%radius)
  end subroutine shift

  !> Finds the first disk that disk k touches when it moves along an axis while all others are at
  !> rest. On a periodic axis, the grid of each species must span the whole period.
  pure subroutine find_contact(self, k, axis, sense, distance, partner)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: k
    integer, intent(in) :: axis                     !! 1 for x, 2 for y
    !> 1 for a motion to the right or upwards, -1 for the opposite direction.
    integer, intent(in) :: sense
    !> On entry, the maximum distance of the search. On return, the distance to the contact if a
    !> contact was found [length].
    real(real64), intent(inout) :: distance
    integer(int32), intent(out) :: partner          !! touched disk; 0 if there is none
    integer :: s

    partner = 0
    do s = 1, size(self%layer)
      if (allocated(self%layer(s)%head)) call search_ahead(self, s, k, [axis, sense], distance, partner)
    end do
  end subroutine find_contact

  !> Version of `find_contact` for the disks of species s. Columns or rows of cells perpendicular to
  !> the motion are searched one by one. The search ends when the next column or row is beyond the
  !> contact found so far.
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
      start = layer%in_cells(me%x)
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

  !> Version of `find_contact` for the disks in one cell.
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

  !> Finds a disk or an obstacle that excludes the centres of disks of the given radius from the
  !> whole rectangle `centre` +- `half`. With half = 0, this tests whether a disk fits at the point
  !> `centre`. `blocker` is the index of the disk, the boundary id of the obstacle (see `partners`),
  !> or 0 if there is none.
  pure subroutine find_blocker(self, centre, half, radius, blocker)
    class(packing_t), intent(in) :: self
    real(real64), intent(in) :: centre(2), half(2)  !! [length]
    !> Radius of the disks, at most the maximum radius passed to `open_species` [length].
    real(real64), intent(in) :: radius
    integer(int32), intent(out) :: blocker
    real(real64) :: rho
    integer(int32) :: e
    integer :: s, kx, ky, first(2), last(2)

    e = self%near%first_near(centre)
    do while (e > 0)
      blocker = self%near%entry(e)%code
      if (self%covers(blocker, centre, half, radius)) return
      e = self%near%entry(e)%next
    end do
    blocker = 0
    do s = 1, size(self%layer)
      if (.not. allocated(self%layer(s)%head)) cycle
      rho = radius + self%layer(s)%radius
      call range_images(self%box%box_t, centre, rho, first, last)
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
      c = layer%cell(p)
      call prefetch(layer%head(c(1), max(c(2) - 1, 1)))
      call prefetch(layer%head(c(1), c(2)))
      call prefetch(layer%head(c(1), min(c(2) + 1, layer%n(2))))
    end associate
  end subroutine load_cells

  !> Prefetches the most recently added disk of each cell around a point.
  subroutine load_disks(self, s, p)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: s
    real(real64), intent(in) :: p(2)                !! [length]
    integer :: c(2), i, j

    associate (layer => self%layer(s))
      c = layer%cell(p)
      do j = max(c(2) - 1, 1), min(c(2) + 1, layer%n(2))
        do i = max(c(1) - 1, 1), min(c(1) + 1, layer%n(1))
          call prefetch(self%disk(max(layer%head(i, j), 1_int32))%x(1))
        end do
      end do
    end associate
  end subroutine load_disks

  !> Finds a disk of species s that excludes the centres of disks of the given radius from the whole
  !> rectangle p +- half; `blocker` is 0 if there is none. The search starts in the cell of p, which
  !> is most likely to contain such a disk.
  pure subroutine search_layer(packing, s, p, half, radius, blocker)
    type(packing_t), intent(in) :: packing
    integer, intent(in) :: s
    real(real64), intent(in) :: p(2), half(2), radius
    integer(int32), intent(out) :: blocker
    real(real64) :: rho
    integer(int32) :: middle(2), corner(2, 2), i, j

    blocker = 0
    rho = radius + packing%layer(s)%radius
    associate (layer => packing%layer(s))
      if (any(p + rho < layer%lower .or. p - rho > layer%upper)) return
      middle = layer%cell(p)
      blocker = blocker_in(packing, layer%head(middle(1), middle(2)), p, half, radius)
      if (blocker > 0) return
      if (rho <= layer%width) then                  ! neighbouring cells usually suffice
        corner(:, 1) = max(middle - 1, 1)
        corner(:, 2) = min(middle + 1, layer%n)
      else
        corner = layer%block(p, rho)
      end if
      do j = corner(2, 1), corner(2, 2)
        do i = corner(1, 1), corner(1, 2)
          blocker = blocker_in(packing, layer%head(i, j), p, half, radius)
          if (blocker > 0) return
        end do
      end do
    end associate
  end subroutine search_layer

  !> Version of `search_layer` for the disks in one cell.
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

  !> Lists all disks whose rim is within the distance `reach` of a point. Since whole cells are
  !> listed, the result may include more distant disks.
  subroutine list_neighbours(self, p, reach, list, n)
    class(packing_t), intent(in) :: self
    real(real64), intent(in) :: p(2), reach         !! [length]
    integer(int32), allocatable, intent(inout) :: list(:)   !! enlarged if necessary
    integer(int32), intent(out) :: n                !! number of disks in the list
    integer :: s, kx, ky, first(2), last(2)

    n = 0
    do s = 1, size(self%layer)
      if (.not. allocated(self%layer(s)%head)) cycle
      call range_images(self%box%box_t, p, reach + self%layer(s)%radius, first, last)
      do ky = first(2), last(2)
        do kx = first(1), last(1)
          call append_cells(p + [kx, ky]*self%box%edges(), reach + self%layer(s)%radius)
        end do
      end do
    end do

  contains

    !> Appends all disks of species s in cells within the distance rho of a point.
    subroutine append_cells(p, rho)
      real(real64), intent(in) :: p(2), rho
      integer(int32) :: corner(2, 2), i, j, k

      associate (layer => self%layer(s))
        if (any(p + rho < layer%lower .or. p - rho > layer%upper)) return
        corner = layer%block(p, rho)
        do j = corner(2, 1), corner(2, 2)
          do i = corner(1, 1), corner(1, 2)
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

  !> True if the given disk or obstacle excludes the centres of disks of the given radius from the
  !> whole rectangle `centre` +- `half`.
  pure function covers(self, by, centre, half, radius) result(yes)
    class(packing_t), intent(in) :: self
    integer(int32), intent(in) :: by                !! index of the disk (> 0), or boundary id of the obstacle
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

  !> First and last index, along each axis, of the periodic images of a point that can be within the
  !> distance rho of a disk in the box.
  pure subroutine range_images(box, p, rho, first, last)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: p(2), rho
    integer, intent(out) :: first(2), last(2)

    first = merge(-1, 0, box%periodic .and. p + rho > box%upper)
    last = merge(1, 0, box%periodic .and. p - rho < box%lower)
  end subroutine range_images

end module packing
