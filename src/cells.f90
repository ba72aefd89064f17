!> Which disks are in which cell, in a form that is copied as a whole: three disks and their number, 16 bytes.
!> A cell with more of them chains the surplus behind its last disk.
module cells
  use kinds, only: int32, real64
  use disks, only: disk_t
  implicit none
  private
  public :: cell_t, cells_t, gather, list_capacity, sum_around

  integer(int32), parameter :: cell_capacity = 3
  integer(int32), parameter :: count_slot = cell_capacity + 1
  integer(int32), parameter :: listed = cell_capacity        !! mask of the disks in slots
  integer(int32), parameter :: chained = cell_capacity + 1   !! unit of the disks in the chain
  integer(int32), parameter :: list_capacity = 64            !! more than nine cells have slots

  !> Disks are counted from 0 here, as it suits those who read them. The last slot counts the disks: those in
  !> the slots in its two lowest bits and, if the cell is crowded, those chained behind the last one in the
  !> bits above.
  type :: cell_t
    integer(int32) :: slot(count_slot) = 0
  contains
    procedure :: in_slots
    procedure :: is_crowded
  end type cell_t

  type :: cells_t
    type(cell_t), allocatable :: cell(:)         !! (0:)
    integer(int32), allocatable :: next(:)       !! (disks) chain of a crowded cell; 0: its end
  contains
    procedure :: empty
    procedure :: insert
    procedure :: remove
    procedure :: chain
  end type cells_t

contains

  !> Makes n_cells empty cells for n_disks disks.
  subroutine empty(self, n_cells, n_disks)
    class(cells_t), intent(inout) :: self
    integer(int32), intent(in) :: n_cells, n_disks
    integer(int32) :: c
    if (allocated(self%cell)) then
      if (size(self%cell) /= n_cells .or. size(self%next) /= n_disks) deallocate (self%cell, self%next)
    end if
    if (.not. allocated(self%cell)) allocate (self%cell(0:n_cells - 1), self%next(n_disks))
    do c = 0, n_cells - 1
      self%cell(c)%slot = 0
    end do
  end subroutine empty

  !> Puts disk i into cell c.
  pure subroutine insert(self, c, i)
    class(cells_t), intent(inout) :: self
    integer(int32), intent(in) :: c, i
    integer(int32) :: n
    associate (slot => self%cell(c)%slot)
      n = slot(count_slot)
      if (n < cell_capacity) then
        self%next(i) = 0
        slot(n + 1) = i - 1
        slot(count_slot) = n + 1
      else                                         ! becomes the head of the chain
        self%next(i) = slot(cell_capacity) + 1
        slot(cell_capacity) = i - 1
        slot(count_slot) = n + chained
      end if
    end associate
  end subroutine insert

  !> Takes disk i out of cell c.
  pure subroutine remove(self, c, i)
    class(cells_t), intent(inout) :: self
    integer(int32), intent(in) :: c, i
    integer(int32) :: n, k, link
    associate (slot => self%cell(c)%slot)
      n = slot(count_slot)
      do k = 1, iand(n, listed)
        if (slot(k) == i - 1) exit
      end do
      if (n <= listed) then
        slot(k) = slot(n)
        slot(count_slot) = n - 1
        return
      end if
      link = slot(cell_capacity) + 1
      if (k <= cell_capacity) then                 ! the head of the chain takes the free place
        slot(k) = link - 1
        slot(cell_capacity) = self%next(link) - 1
        self%next(link) = 0
      else
        do while (self%next(link) /= i)
          link = self%next(link)
        end do
        self%next(link) = self%next(i)
      end if
      slot(count_slot) = n - chained
    end associate
  end subroutine remove

  !> Number of disks in the slots.
  elemental function in_slots(self) result(n)
    class(cell_t), intent(in) :: self
    integer(int32) :: n
    n = iand(self%slot(count_slot), listed)
  end function in_slots

  !> Whether more disks are chained behind the last one.
  elemental function is_crowded(self) result(yes)
    class(cell_t), intent(in) :: self
    logical :: yes
    yes = self%slot(count_slot) > listed
  end function is_crowded

  !> The first disk in the chain of cell c; 0 if there is none.
  pure function chain(self, c) result(i)
    class(cells_t), intent(in) :: self
    integer(int32), intent(in) :: c
    integer(int32) :: i
    i = 0
    if (self%cell(c)%is_crowded()) i = self%next(self%cell(c)%slot(cell_capacity) + 1)
  end function chain

  !> Lists the disks in the nine cells around c. Whole cells are copied without a branch on how many they
  !> hold; of a crowded one, only those in its slots.
  pure subroutine gather(cell, c, stride, list, n, crowded)
    type(cell_t), intent(in) :: cell(0:*)
    integer(int32), intent(in) :: c, stride
    integer(int32), intent(out) :: list(list_capacity)
    integer(int32), intent(out) :: n               !! number of disks listed
    logical, intent(out) :: crowded                !! one of the cells has a chain
    integer(int32) :: k, row, m, counts
    m = 0
    counts = 0
    k = c - stride
    do row = 1, 3
      list(m + 1:m + count_slot) = cell(k - 1)%slot
      m = m + iand(cell(k - 1)%slot(count_slot), listed)
      list(m + 1:m + count_slot) = cell(k)%slot
      m = m + iand(cell(k)%slot(count_slot), listed)
      list(m + 1:m + count_slot) = cell(k + 1)%slot
      m = m + iand(cell(k + 1)%slot(count_slot), listed)
      counts = ior(counts, ior(cell(k - 1)%slot(count_slot), &
        ior(cell(k)%slot(count_slot), cell(k + 1)%slot(count_slot))))
      k = k + stride
    end do
    n = m
    crowded = counts > listed
  end subroutine gather

  !> A sum over the first disks of the nine cells around c, which are in the cache thereafter.
  pure function sum_around(cell, c, stride, disk) result(total)
    type(cell_t), intent(in) :: cell(0:*)
    integer(int32), intent(in) :: c, stride
    type(disk_t), intent(in) :: disk(0:*)
    real(real64) :: total
    integer(int32) :: k
    total = 0
    do k = c - stride, c + stride, stride
      total = total + disk(cell(k - 1)%slot(1))%x(1) + disk(cell(k)%slot(1))%x(1) + disk(cell(k + 1)%slot(1))%x(1)
    end do
  end function sum_around

end module cells
