!> Neighbour lists: for each disk those that it can touch while all stay within their neighbourhoods.
!>
!> A neighbourhood is a square around the position where a disk was listed last, clipped at the faces of its cell and at
!> the sides of the box. Two disks are in each other's list if they can touch somewhere in their neighbourhoods. A disk
!> that leaves its neighbourhood, which is an event, searches the nine cells around it, lies in a new neighbourhood and
!> is listed anew. So a prediction tests a few neighbours, however many disks the cells hold (Donev, Torquato and
!> Stillinger, J. Comput. Phys. 202, 737 (2005)).
!>
!> Lists are a cache. If one is full, it counts as incomplete until its disk is listed again, and the disk searches cells.
module neighbour_lists
  use, intrinsic :: iso_fortran_env, only: real32
  use kinds, only: int16, int32, int64, pi, real64
  use cell_contents, only: append, cell_contents_t
  use cell_faces, only: cell_faces_t, line_t, patch_t
  use disks, only: disk_t, tag_t
  use memory_hints, only: prefetch
  use neighbour_search, only: list_capacity, prospect_t
  use partners, only: is_wall, looks_again
  implicit none
  private
  public :: neighbour_lists_t

  integer(int32), parameter :: unlisted = -2, incomplete = -1    !! instead of a number of entries
  integer(int32), parameter :: always_copied = 15                !! entries, without a branch on how many there are
  integer(int32), parameter :: image_unit = 2**27                !! more than disks
  integer(int32), parameter :: most_listed = image_unit/4        !! disks, so that places in all lists are int32

  !> The positions that the centre of a disk may take until it is listed again.
  type :: neighbourhood_t
    type(line_t) :: column(0:1), row(0:1)          !! left and right, lower and upper line, with the events there
  end type neighbourhood_t

  type :: neighbour_lists_t
    logical :: used = .false.
    real(real64) :: least_candidates = 30.0_real64 !! in nine cells of dilute disks, from which lists pay
    integer(int32) :: capacity = 16                !! of the list of a small disk; larger ones have more neighbours
    real(real64) :: mean_radius = 0.0_real64       !! [length]
    real(real64) :: margin = 0.0_real64            !! half the width of a neighbourhood, for the mean radius [length]
    real(real64) :: origin(2) = 0.0_real64         !! [length]
    real(real64) :: period(2) = 0.0_real64         !! [length]
    real(real32) :: rounding = 0.0_real32          !! above all errors in `extent` [length]
    type(neighbourhood_t), allocatable :: neighbourhood(:)   !! (disks)
    !> (4,disks) x, y of the centre from the origin, radius of the disk with `rounding`, half the width: of squares not clipped
    real(real32), allocatable :: extent(:, :)
    integer(int32), allocatable :: first(:)        !! (disks+1) where the list of a disk begins, with the number of its entries
    integer(int32), allocatable :: entry(:)        !! (0:) all lists: disk, from 0, + image_unit*image
    integer(int32), allocatable :: back(:)         !! (0:) for each entry, the place of this disk in the list of that one
  contains
    procedure :: prepare
    procedure, private :: make_room
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

  !> Decides whether lists pay, and makes room for them. A collision tests fewer disks with lists, but disks are listed again and
  !> again: the more often, the less dense they are. Limits and margin were measured with disks of many sizes.
  subroutine prepare(self, disk, tag, lower, edges, patch)
    class(neighbour_lists_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    real(real64), intent(in) :: lower(2), edges(2) !! of the box [length]
    type(patch_t), intent(in) :: patch
    real(real64) :: area, packing, candidates, radii(2)
    integer(int32) :: i, n

    self%used = .false.
    n = size(disk, kind=int32)
    if (n > most_listed .or. .not. patch%small > 0) return
    area = product(patch%n*patch%width)
    candidates = min(9*product(patch%width)/area, 1.0_real64)*n
    packing = min(n*pi*patch%small**2/area, 0.9_real64)            ! at most so much
    if (candidates < self%least_candidates - 27*packing) return
    n = 0
    radii = 0
    do i = 1, size(disk, kind=int32)
      if (tag(i)%id == 0 .or. disk(i)%radius > patch%small) cycle
      n = n + 1
      radii = radii + disk(i)%radius**[1, 2]
    end do
    packing = min(pi*radii(2)/area, 0.9_real64)
    self%used = n > 0 .and. candidates > self%least_candidates - 27*packing
    if (.not. self%used) return
    self%mean_radius = radii(1)/n
    self%margin = max(0.6_real64 + 2.5_real64*(0.72_real64 - packing), 0.3_real64)*self%mean_radius
    call self%make_room(disk, lower, edges)
  end subroutine prepare

  !> Makes room for the lists of all disks, which are not listed yet. A larger disk has more neighbours.
  subroutine make_room(self, disk, lower, edges)
    class(neighbour_lists_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    real(real64), intent(in) :: lower(2), edges(2) !! of the box [length]
    real(real64) :: sizes                          ! the mean one is 1
    integer(int32) :: i, n

    n = size(disk, kind=int32)
    self%origin = lower
    self%period = edges
    self%rounding = real(8*epsilon(1.0_real32)*maxval(edges) + 1.0e-6_real64*maxval(disk%radius), real32)
    if (allocated(self%first)) then
      if (size(self%first) /= n + 1) deallocate (self%first, self%neighbourhood, self%extent)
    end if
    if (.not. allocated(self%first)) then
      allocate (self%first(n + 1), self%neighbourhood(n))
      allocate (self%extent(4, n), source=0.0_real32)           ! candidates may be unlisted
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

  !> Lays a new neighbourhood around disk i, which is at x.
  pure subroutine lay(self, i, radius, x, faces, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: radius, x(2)       !! [length]
    type(cell_faces_t), intent(in) :: faces
    integer(int16), intent(in) :: cell(2)
    real(real64) :: margin

    margin = self%margin*sqrt(self%mean_radius/radius)
    self%extent(:, i) = real([x - self%origin, radius, margin], real32)
    self%extent(3, i) = self%extent(3, i) + self%rounding
    self%neighbourhood(i)%column = clipped(faces%column(:, cell(1)), 1)
    self%neighbourhood(i)%row = clipped(faces%row(:, cell(2)), 2)
  contains

    !> The lines of a cell across an axis, moved to the neighbourhood's if these come before.
    pure function clipped(line, axis) result(nearer)
      type(line_t), intent(in) :: line(0:1)
      integer(int32), intent(in) :: axis
      type(line_t) :: nearer(0:1)
      real(real64) :: place
      integer(int32) :: up

      nearer = line
      do up = 0, 1
        place = x(axis) + (2*up - 1)*margin
        if ((2*up - 1)*(line(up)%place + line(up)%inset*radius - place) <= 0 &
          .and. .not. (line(up)%struck .and. is_wall(line(up)%code))) cycle    ! a side that moves is no end
        nearer(up)%place = place
        nearer(up)%inset = 0
        nearer(up)%code = looks_again - up
      end do
    end function clipped
  end subroutine lay

  !> Enters disk i, which has a new neighbourhood, into the lists of the disks that it can touch, and those into its list.
  !> They are among those in the nine cells around it. A disk that is not listed yet will enter the pair when it is.
  subroutine enter(self, i, cells, patch, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    integer(int16), intent(in) :: cell(2)          !! of disk i
    integer(int32) :: candidate(list_capacity), around(9), image(9), c, k, row
    integer(int64) :: n                            ! number of candidates

    self%entry(self%first(i)) = 0
    n = 0
    if (patch%at_seam(cell)) then
      call find_cells(cells, patch, cell, around, image)
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
  contains

    !> Adds the chained disks of a crowded cell; the first one was in its last slot.
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

    !> Enters those of the candidates that are near enough. Which ones is a toss-up: no branch on it.
    subroutine test_candidates(image)
      integer(int32), intent(in) :: image          !! through which they are seen
      integer(int32) :: j, k, found(list_capacity + 1), n_found
      real(real32) :: x, y, reach, margin, dx, dy

      associate (own => self%extent(:, i), shift => real(periods(image)*self%period, real32))
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
          n_found = n_found + iand(merge(1, 0, dx*dx + dy*dy <= (reach + other(3))**2), merge(1, 0, j /= i))
        end associate
      end do
      do k = 1, n_found
        j = found(k)
        call add_pair(self, i, j, image)
      end do
      n = 0
    end subroutine test_candidates
  end subroutine enter

  !> Enters disk j, which is seen through an image, into the list of disk i, and the reverse, unless it is not listed yet.
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
      if (at_i + n_i == self%first(i + 1)) n_i = incomplete    ! it is full
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

  !> Removes disk i from the lists of all others.
  pure subroutine leave(self, i, cells, patch, cell)
    class(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    integer(int16), intent(in) :: cell(2)          !! of disk i
    integer(int32) :: at, k, m, around(9), image(9), j, n

    at = self%first(i)
    n = self%entry(at)
    self%entry(at) = unlisted
    do k = 1, n
      j = iand(self%entry(at + k), image_unit - 1) + 1
      if (self%entry(self%first(j)) >= 0) call remove(self, j, self%back(at + k))
    end do
    if (n /= incomplete) return
    call find_cells(cells, patch, cell, around, image)
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

  !> Removes an entry from the list of disk i; the last one takes its place.
  pure subroutine remove(self, i, place)
    type(neighbour_lists_t), intent(inout) :: self
    integer(int32), intent(in) :: i, place
    integer(int32) :: at, n, last

    at = self%first(i)
    n = self%entry(at)
    last = self%entry(at + n)
    self%entry(at + place) = last
    self%back(at + place) = self%back(at + n)
    self%back(self%first(iand(last, image_unit - 1) + 1) + self%back(at + n)) = place    ! unused, if that list is incomplete
    self%entry(at) = n - 1
  end subroutine remove

  !> Removes an entry from the list of disk i, if it is there.
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

  !> The nine cells around a cell, with the images through which they are seen.
  pure subroutine find_cells(cells, patch, cell, around, image)
    type(cell_contents_t), intent(in) :: cells
    type(patch_t), intent(in) :: patch
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(out) :: around(9), image(9)
    integer(int32) :: column, row, x, y, k

    do k = 0, 8
      call patch%step(1, int(cell(1), int32), modulo(k, 3) - 1, column, x)
      call patch%step(2, int(cell(2), int32), k/3 - 1, row, y)
      around(k + 1) = column + cells%stride*row
      image(k + 1) = modulo(x + 3*y, 9)
    end do
  end subroutine find_cells

  !> The image through which a disk is seen by the one that it sees through an image.
  elemental function reverse(image)
    integer(int32), intent(in) :: image
    integer(int32) :: reverse

    reverse = merge(9 - image, 0, image > 0)
  end function reverse

  !> The number of an image by axis, each -1, 0 or 1. As a part of an entry it is x + 3 y, modulo 9.
  pure function periods(image) result(number)
    integer(int32), intent(in) :: image
    real(real64) :: number(2)

    number = [modulo(image + 4, 3) - 1, modulo(image + 4, 9)/3 - 1]
  end function periods

  !> Whether all disks that disk i can touch in its neighbourhood are in its list.
  pure function is_complete(self, i) result(yes)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%entry(self%first(i)) >= 0
  end function is_complete

  !> Whether the list is complete and can be copied as a whole.
  pure function is_short(self, i) result(yes)
    class(neighbour_lists_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%is_complete(i) .and. self%entry(self%first(i)) <= list_capacity
  end function is_short

  !> Copies the list of a disk that sees no images.
  pure subroutine copy_list(self, near)
    class(neighbour_lists_t), intent(in) :: self
    type(prospect_t), intent(inout) :: near
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

  !> The k-th neighbour in the list of disk i, counted from 0, and the number of the image through which it is seen.
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

  !> Prefetches what predictions for some disks will read, stage by stage: their records, their lists, the disks in those;
  !> and, one stage later, the record and the list of their partners.
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

    !> The record and tag of a disk, and where its list begins.
    subroutine fetch_record(i)
      integer(int32), intent(in) :: i

      call prefetch(tag(i)%species)
      call prefetch(disk(i)%stamp)
      call prefetch(self%first(i))
    end subroutine fetch_record

    !> The neighbourhood and the list of a disk.
    subroutine fetch_list(i)
      integer(int32), intent(in) :: i

      call prefetch(self%neighbourhood(i)%column(0)%code)
      call prefetch(self%neighbourhood(i)%row(1)%code)
      call prefetch(self%entry(self%first(i)))
    end subroutine fetch_list
  end subroutine read_ahead

end module neighbour_lists
