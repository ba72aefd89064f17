!> A priority queue of events: a min-heap in an array, with four children per node. The heap
!> contains at most one event per disk, found by the index of the disk. The order of simultaneous
!> events depends neither on the order of insertion nor on which of the two disks stores an event.
module event_heap
  use kinds, only: int32
  use disks, only: tag_t
  use event_prediction, only: event_t, wins
  implicit none
  private
  public :: event_heap_t, need_order, precedes

  !> Number of children of a node. A heap with four children has half as many levels as a binary
  !> heap, without needing more cache lines per level.
  integer(int32), parameter :: arity = 4

  type :: event_heap_t
    integer(int32) :: n = 0                      !! number of events
    type(event_t), allocatable, private :: entry(:)        !! events in heap order
    !> Position in `entry` of the event of each disk; 0 if the heap contains no event of the disk.
    integer(int32), allocatable, private :: slot(:)
  contains
    procedure :: initialise
    procedure :: update
    procedure :: first
    procedure :: drop_first
  end type event_heap_t

contains

  !> True if event a precedes event b. Events are ordered by time; simultaneous events by
  !> `event_prediction: wins`. If both disks of a pair have stored their collision, the two events
  !> have the same rank.
  pure function precedes(a, b, tag) result(yes)
    type(event_t), intent(in) :: a, b
    type(tag_t), intent(in) :: tag(*)
    logical :: yes

    yes = a%time < b%time
    if (.not. (yes .or. a%time > b%time)) yes = wins(a, b, tag)
  end function precedes

  !> Nonzero if the events a and b are simultaneous and must be ordered by `precedes`; a must not be
  !> earlier than b. Simultaneous events are usually the two copies of one collision, stored by both
  !> disks. The order of these copies does not matter.
  elemental function need_order(a, b) result(bits)
    type(event_t), intent(in) :: a, b
    integer(int32) :: bits

    bits = iand(-merge(1, 0, a%time <= b%time), ior(ieor(a%disk, b%partner), ieor(a%partner, b%disk)))
  end function need_order

  !> Empties the heap and allocates space for the events of n disks.
  subroutine initialise(self, n)
    class(event_heap_t), intent(inout) :: self
    integer(int32), intent(in) :: n              !! number of disks

    if (allocated(self%slot)) then
      if (size(self%slot) /= n) deallocate (self%slot, self%entry)
    end if
    if (.not. allocated(self%slot)) allocate (self%slot(n), self%entry(n))
    self%slot = 0
    self%n = 0
  end subroutine initialise

  !> Inserts the event of a disk, or replaces the previous event of this disk.
  pure subroutine update(self, event, tag)
    class(event_heap_t), intent(inout) :: self
    type(event_t), intent(in) :: event
    type(tag_t), intent(in) :: tag(*)            !! tags of all disks
    integer(int32) :: k

    k = self%slot(event%disk)
    if (k == 0) then
      self%n = self%n + 1
      k = self%n
    end if
    call sift_up(self, k, event, tag)
    if (self%slot(event%disk) == k) call sift_down(self, k, event, tag)
  end subroutine update

  !> The earliest event. The heap must not be empty.
  pure function first(self) result(event)
    class(event_heap_t), intent(in) :: self
    type(event_t) :: event

    event = self%entry(1)
  end function first

  !> Removes the earliest event. The heap must not be empty.
  pure subroutine drop_first(self, tag)
    class(event_heap_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)            !! tags of all disks
    type(event_t) :: last

    self%slot(self%entry(1)%disk) = 0
    last = self%entry(self%n)
    self%n = self%n - 1
    if (self%n > 0) call sift_down(self, 1_int32, last, tag)
  end subroutine drop_first

  !> Inserts `event` at the position `start`, and moves it towards the root of the heap until its
  !> parent precedes it.
  pure subroutine sift_up(self, start, event, tag)
    class(event_heap_t), intent(inout) :: self
    integer(int32), intent(in) :: start
    type(event_t), intent(in) :: event
    type(tag_t), intent(in) :: tag(*)
    integer(int32) :: k, parent

    k = start
    do while (k > 1)
      parent = (k - 2)/arity + 1
      if (.not. precedes(event, self%entry(parent), tag)) exit
      self%entry(k) = self%entry(parent)
      self%slot(self%entry(k)%disk) = k
      k = parent
    end do
    self%entry(k) = event
    self%slot(event%disk) = k
  end subroutine sift_up

  !> Inserts `event` at the position `start`, and moves it away from the root of the heap until it
  !> precedes all its children.
  pure subroutine sift_down(self, start, event, tag)
    class(event_heap_t), intent(inout) :: self
    integer(int32), intent(in) :: start
    type(event_t), intent(in) :: event
    type(tag_t), intent(in) :: tag(*)
    integer(int32) :: k, child, best

    k = start
    do
      best = arity*(k - 1) + 2
      if (best > self%n) exit
      do child = best + 1, min(best + arity - 1, self%n)
        if (precedes(self%entry(child), self%entry(best), tag)) best = child
      end do
      if (.not. precedes(self%entry(best), event, tag)) exit
      self%entry(k) = self%entry(best)
      self%slot(self%entry(k)%disk) = k
      k = best
    end do
    self%entry(k) = event
    self%slot(event%disk) = k
  end subroutine sift_down

end module event_heap
