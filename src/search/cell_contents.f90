!> The disks in each cell. A cell is a record of 16 bytes, copied as a unit, with a count and three
!> slots for one disk each. If a cell contains more than three disks (a crowded cell), the
!> additional disks form a linked list that starts in the last slot.
module cell_contents
  use kinds, only: int16, int32, int64
  use disks, only: disk_t, tag_t
  use memory_hints, only: prefetch
  use event_prediction, only: list_capacity
  implicit none
  private
  public :: append, cell_capacity, cell_contents_t, gather

  integer(int32), parameter :: cell_capacity = 3
  integer(int32), parameter :: count_slot = cell_capacity + 1
  integer(int32), parameter :: counted = 65535               !! bit mask for the number of disks in the slots
  !> Increment of the bit field that counts crowded cells.
  integer(int32), parameter :: crowd = counted + 1
  integer(int32), parameter :: marked = shiftl(crowd, 8)     !! bit that marks the cell

  !> The first three elements of `slot` are indices of disks, counted from 0. The last element
  !> contains bit fields:
  !> - bits 0 to 15: number of disks in the slots,
  !> - bits 16 to 23: number of crowded cells among the cell and its eight neighbours,
  !> - bit 24: mark of the cell (see `cell_grid: mark`).
  type :: cell_t
    integer(int32) :: slot(count_slot)
  contains
    procedure :: in_slots
    procedure :: needs_care
  end type cell_t

  type :: cell_contents_t
    integer(int32) :: stride = 0      !! difference between the numbers of vertically adjacent cells
    type(cell_t), allocatable :: cell(:)         !! (0:) cells, row by row
    !> Next disk in the linked list of a crowded cell, for each disk; 0 at the end of the list.
    integer(int32), allocatable :: next(:)
  contains
    procedure :: number
    procedure :: empty
    procedure :: clear
    procedure :: mark
    procedure :: insert
    procedure :: remove
    procedure :: chain
    procedure :: is_crowded_around
    procedure :: read_ahead
    procedure, private :: count_crowd
  end type cell_contents_t

contains

  !> Number of the cell in column cell(1) and row cell(2), both counted from 1.
  pure function number(self, cell) result(c)
    class(cell_contents_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32) :: c

    c = cell(1) + self%stride*cell(2)
  end function number

  !> Allocates `rows` rows of `stride` empty cells, for a given number of disks.
  subroutine empty(self, stride, rows, n_disks)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: stride, rows, n_disks
    integer(int32) :: c

    self%stride = stride
    if (allocated(self%cell)) then
      if (size(self%cell) /= stride*rows .or. size(self%next) /= n_disks) deallocate (self%cell, self%next)
    end if
    if (.not. allocated(self%cell)) allocate (self%cell(0:stride*rows - 1), self%next(n_disks))
    do c = 0, stride*rows - 1
      self%cell(c)%slot = 0
    end do
  end subroutine empty

  !> Removes all disks from cell c and adds their number to n.
  pure subroutine clear(self, c, n)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: c
    integer(int32), intent(inout) :: n             !! total number of removed disks
    integer(int32) :: link, in_slots

    in_slots = self%cell(c)%in_slots()
    n = n + in_slots
    link = self%chain(c)
    if (link > 0) then
      call self%count_crowd(c, -1)
      do while (self%next(link) > 0)
        n = n + 1
        link = self%next(link)
      end do
    end if
    self%cell(c)%slot(count_slot) = self%cell(c)%slot(count_slot) - in_slots
  end subroutine clear

  !> Sets or removes the mark of cell c.
  pure subroutine mark(self, c, yes)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: c
    logical, intent(in) :: yes

    associate (count => self%cell(c)%slot(count_slot))
      count = merge(ior(count, marked), iand(count, not(marked)), yes)
    end associate
  end subroutine mark

  !> Inserts disk i into cell c.
  pure subroutine insert(self, c, i)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: c, i
    integer(int32) :: n, head

    n = self%cell(c)%in_slots()
    associate (slot => self%cell(c)%slot)
      self%next(i) = 0
      if (n < cell_capacity) then
        slot(n + 1) = i - 1
        slot(count_slot) = slot(count_slot) + 1
        return
      end if
      head = slot(cell_capacity) + 1
      self%next(i) = head                          ! disk i becomes the first in the list
      slot(cell_capacity) = i - 1
    end associate
    if (self%next(head) == 0) call self%count_crowd(c, 1)
  end subroutine insert

  !> Removes disk i from cell c.
  pure subroutine remove(self, c, i)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: c, i
    integer(int32) :: n, k, link

    link = self%chain(c)
    associate (slot => self%cell(c)%slot)
      k = 1 + slots_before(self%cell(c), i)
      if (link == 0) then
        n = self%cell(c)%in_slots()
        slot(k) = slot(n)
        slot(count_slot) = slot(count_slot) - 1
        return
      end if
      if (slot(k) == i - 1) then                   ! the first disk of the list moves to the free slot
        slot(k) = link - 1
        slot(cell_capacity) = self%next(link) - 1
        self%next(link) = 0
      else
        do while (self%next(link) /= i)
          link = self%next(link)
        end do
        self%next(link) = self%next(i)
      end if
    end associate
    if (self%chain(c) == 0) call self%count_crowd(c, -1)
  end subroutine remove

  !> Updates the counts of crowded cells in cell c and its eight neighbours. `change` is 1 if cell c
  !> has become crowded, -1 if it no longer is.
  pure subroutine count_crowd(self, c, change)
    class(cell_contents_t), intent(inout) :: self
    integer(int32), intent(in) :: c, change
    integer(int32) :: k, m

    do k = c - self%stride, c + self%stride, self%stride
      do m = k - 1, k + 1
        self%cell(m)%slot(count_slot) = self%cell(m)%slot(count_slot) + change*crowd
      end do
    end do
  end subroutine count_crowd

  !> Number of disks in the slots of a cell.
  elemental function in_slots(self) result(n)
    class(cell_t), intent(in) :: self
    integer(int32) :: n

    n = iand(self%slot(count_slot), counted)
  end function in_slots

  !> True if predictions for the disks in a cell need the general procedure: the cell is marked, is
  !> crowded, or has a crowded neighbour.
  elemental function needs_care(self) result(yes)
    class(cell_t), intent(in) :: self
    logical :: yes

    yes = self%slot(count_slot) >= crowd
  end function needs_care

  !> True if cell c or one of its eight neighbours is crowded.
  pure function is_crowded_around(self, c) result(yes)
    class(cell_contents_t), intent(in) :: self
    integer(int32), intent(in) :: c
    logical :: yes

    yes = iand(self%cell(c)%slot(count_slot), marked - crowd) > 0
  end function is_crowded_around

  !> First disk in the linked list of a crowded cell; 0 if the cell is not crowded. This disk also
  !> occupies the last slot.
  pure function chain(self, c) result(i)
    class(cell_contents_t), intent(in) :: self
    integer(int32), intent(in) :: c
    integer(int32) :: i

    i = 0
    if (self%cell(c)%in_slots() < cell_capacity) return
    i = self%cell(c)%slot(cell_capacity) + 1
    if (self%next(i) == 0) i = 0
  end function chain

  !> Number of slots before the slot of disk i in its cell; 2 if the disk is in the linked list.
  elemental function slots_before(self, i) result(n)
    type(cell_t), intent(in) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: n, first

    first = merge(0, 1, self%slot(1) == i - 1)
    n = first + iand(first, merge(0, 1, self%slot(2) == i - 1))
  end function slots_before

  !> Lists the disks in the slots of cell c and its eight neighbours, except disk i, which is in
  !> cell c. All slots are copied, whether they are occupied or vacant, to avoid branches that
  !> depend on the number of disks. If disk i is in the linked list of a crowded cell, the first
  !> disk of this list is left out instead of disk i.
  subroutine gather(cell, c, stride, i, list, n)
    type(cell_t), intent(in) :: cell(0:*)
    integer(int32), intent(in) :: c, stride, i
    integer(int32), intent(out) :: list(list_capacity)
    integer(int32), intent(out) :: n               !! number of disks in `list`
    integer(int64) :: below, here, above, m, own   ! 64-bit indices need no conversion to addresses

    here = c
    below = here - stride
    above = here + stride
    m = 0
    call append(cell(below - 1), list, m)
    call append(cell(below), list, m)
    call append(cell(below + 1), list, m)
    call append(cell(here - 1), list, m)
    own = m + 1 + slots_before(cell(here), i)
    call append(cell(here), list, m)
    list(own) = list(m)
    m = m - 1
    call append(cell(here + 1), list, m)
    call append(cell(above - 1), list, m)
    call append(cell(above), list, m)
    call append(cell(above + 1), list, m)
    n = int(m, int32)
  end subroutine gather

  !> Appends the disks in the slots of a cell to a list of n disks.
  pure subroutine append(cell, list, n)
    type(cell_t), intent(in) :: cell
    integer(int32), intent(inout) :: list(list_capacity)
    integer(int64), intent(inout) :: n

    list(n + 1:n + count_slot) = cell%slot
    n = n + cell%in_slots()
  end subroutine append

  !> Prefetches the data for predicting the next events of several disks, in three stages: the
  !> records of the disks, their cells, and the disks in these cells. The record and the cells of a
  !> disk's collision partner are fetched one stage later than the disk's own.
  subroutine read_ahead(self, disk, tag, stage, disks)
    class(cell_contents_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: stage
    integer(int32), intent(in) :: disks(:)
    integer(int32) :: k, partner

    do k = 1, size(disks)
      select case (stage)
      case (1)
        call fetch(disks(k))
      case (2)
        call fetch_cells(self%number(tag(disks(k))%cell))
        partner = disk(disks(k))%partner
        if (partner > 0) call fetch(partner)
      case default
        call fetch_disks(self%number(tag(disks(k))%cell))
        partner = disk(disks(k))%partner
        if (partner > 0) call fetch_cells(self%number(tag(partner)%cell))
      end select
    end do
  contains

    subroutine fetch(i)
      integer(int32), intent(in) :: i

      call prefetch(tag(i)%species)
      call prefetch(disk(i)%collision_counter)
    end subroutine fetch

    !> Prefetches cell c and its eight neighbours.
    subroutine fetch_cells(c)
      integer(int32), intent(in) :: c
      integer(int32) :: m

      do m = c - self%stride, c + self%stride, self%stride
        call prefetch(self%cell(m - 1)%slot(1))    ! three adjacent cells occupy one or two cache lines
        call prefetch(self%cell(m + 1)%slot(count_slot))
      end do
    end subroutine fetch_cells

    !> Prefetches the first disk of cell c and of each of its eight neighbours.
    subroutine fetch_disks(c)
      integer(int32), intent(in) :: c
      integer(int32) :: m, l

      do m = c - self%stride, c + self%stride, self%stride
        do l = m - 1, m + 1
          call prefetch(disk(self%cell(l)%slot(1) + 1)%x(1))
        end do
      end do
    end subroutine fetch_disks

  end subroutine read_ahead

end module cell_contents
