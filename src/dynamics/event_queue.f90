!> The event queue: a calendar combined with a heap (Paul, Journal of Computational Physics 221, 615
!> (2007)).
!>
!> Events of the current time window are kept in a short sorted list. If the list overflows, its
!> events move to the heap, which is then used until the end of the window. Events of later windows
!> are stored in the calendar, or in the heap if their bucket is full. Calendar entries are never
!> searched for or removed individually. An entry is valid as long as it equals the event stored by
!> its disk. Without the calendar, all events are in the heap.
module event_queue
  use kinds, only: int32, int64, never, real64
  use calendar, only: bucket_capacity, bucket_t, calendar_t, events_per_window, most_coming, window_none
  use disks, only: disk_t, tag_t
  use event_heap, only: event_heap_t, need_order, precedes
  use event_prediction, only: event_of, event_t
  implicit none
  private
  public :: event_queue_t

  integer(int32), parameter :: near_capacity = 64
  real(real64), parameter :: last_window = 2.0e9_real64
  integer, parameter :: sample_size = 100

  type :: event_queue_t
    private
    type(calendar_t) :: calendar
    type(event_heap_t) :: heap
    !> Sorted list of events, the latest first. Element 0 is a sentinel that is never due. Indices
    !> 0:n_near.
    type(event_t) :: near(0:near_capacity)
    integer(int32) :: n_near = 0
    !> .true. if new events of the current window are added to the sorted list, .false. if they are
    !> added to the heap.
    logical :: near_is_open = .false.
    logical :: windowed = .true.                   !! whether the calendar is used in addition to the heap
    !> Index of the current window, counted from the time origin `box%epoch`.
    integer(int32) :: window = 0
    integer(int32) :: n_disks = 0
    real(real64) :: width = never                  !! width of a window [time]
    real(real64) :: per_time = 0.0_real64          !! number of windows per unit of time, 1/width [1/time]
    real(real64) :: next_window = 1.0_real64       !! window + 1
    !> Number of events removed from the queue since the last `fill`.
    integer(int64) :: n_taken = 0
    real(real64) :: filled_at = 0.0_real64         !! time of the last `fill` [time]
  contains
    procedure :: fill
    procedure :: schedule
    procedure :: remove_entry
    procedure :: first
    procedure :: drop_first
    procedure :: drop_if_next
    procedure :: list_coming
    ! Rarely called procedures are type-bound, so that the compiler does not inline them into
    ! frequently called procedures.
    procedure, private :: insert_near
    procedure, private :: insert_into_heap
    procedure, private :: first_in_heap
    procedure, private :: open_next_window
    procedure, private :: take_from_heap
    procedure, private :: open_next_span
  end type event_queue_t

contains

  !> Enters the events of all disks into the queue.
  subroutine fill(self, disk, tag, now, windowed)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(inout) :: tag(:)
    real(real64), intent(in) :: now                !! relative to the time origin `box%epoch` [time]
    logical, intent(in) :: windowed      !! whether the calendar is used; otherwise all events are in the heap
    integer(int32) :: i

    self%n_disks = size(disk, kind=int32)
    self%n_near = 0
    self%near(0)%time = huge(now)
    call self%heap%initialise(self%n_disks)
    tag%window = window_none
    ! The width of a window has a lower bound, so that window numbers fit into 32 bits.
    self%width = max(window_width(), 1.0e-9_real64*now, 1/never)
    self%windowed = windowed .and. self%width < never
    self%near_is_open = self%windowed
    self%n_taken = 0
    self%filled_at = now
    self%per_time = 0                              ! without the calendar: a single, infinitely long window
    if (self%windowed) then
      self%per_time = 1/self%width
      call self%calendar%empty(self%n_disks)
    end if
    self%window = int(now*self%per_time, int32)
    call self%calendar%begin(self%window)
    self%next_window = self%window + 1
    do i = 1, self%n_disks
      call schedule(self, disk, tag, i)
    end do
  contains

    !> Width of a window that contains `events_per_window` events on average. The event rate is
    !> measured since the last `fill`; at first, it is estimated from the median waiting time in a
    !> sample of disks. Without events the width is `never`.
    pure function window_width() result(width)
      real(real64) :: width, waits(sample_size), swap
      integer :: i, k, n_waits

      width = never
      if (self%n_taken > sample_size .and. self%windowed) then
        width = events_per_window*(self%width*self%next_window - self%filled_at)/self%n_taken
        return
      end if
      n_waits = 0
      do i = 1, size(disk), (size(disk) - 1)/sample_size + 1
        if (.not. disk(i)%event_time < never) cycle
        n_waits = n_waits + 1
        waits(n_waits) = disk(i)%event_time - now
        do k = n_waits, 2, -1
          if (waits(k) >= waits(k - 1)) exit
          swap = waits(k); waits(k) = waits(k - 1); waits(k - 1) = swap
        end do
      end do
      if (n_waits > 0) width = events_per_window*waits((n_waits + 1)/2) &
        /(log(2.0_real64)*n_waits*max(1.0_real64, size(disk)/real(sample_size, real64)))
    end function window_width
  end subroutine fill

  !> Enters the event of disk i into the queue. A previous entry of the disk becomes invalid,
  !> because it no longer equals the stored event.
  subroutine schedule(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i
    integer(int32) :: window
    real(real64) :: number
    logical :: full

    number = disk(i)%event_time*self%per_time
    if (.not. number >= self%next_window) then     ! also true for NaN, so that the error is detected
      tag(i)%window = window_none
      call self%insert_near(disk, tag, i)
      return
    end if
    window = int(merge(number, last_window, number < last_window), int32)
    if (window == tag(i)%window) return
    tag(i)%window = window
    if (window < self%calendar%ring_end) then
      call self%calendar%put_near(i, window, full)
      if (.not. full) return
      tag(i)%window = window_none
      call self%insert_into_heap(disk, tag, i)
    else
      call self%calendar%put_far(i, window)
    end if
  end subroutine schedule

  !> Removes the entry of a disk from the queue by erasing the window number in its tag. The entry
  !> stays in memory, and becomes invalid when the event of the disk changes.
  pure subroutine remove_entry(self, tag)
    class(event_queue_t), intent(in) :: self
    type(tag_t), intent(inout) :: tag

    tag%window = window_none
  end subroutine remove_entry

  !> Adds an event of the current window to the sorted list, or to the heap if the list is full.
  subroutine insert_near(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: i

    if (self%near_is_open) then
      call insert(self%near, self%n_near, event_of(disk, i), tag)
      self%n_near = self%n_near + 1
      self%near_is_open = self%n_near < near_capacity
    else
      call hand_over(self, disk, tag)
      call self%insert_into_heap(disk, tag, i)
    end if
  end subroutine insert_near

  !> Moves the sorted list to the heap.
  subroutine hand_over(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    integer(int32) :: k

    do k = 1, self%n_near
      if (is_valid(disk, self%near(k))) call self%heap%update(self%near(k), tag)
    end do
    self%n_near = 0
  end subroutine hand_over

  !> Adds the event of disk i to the heap.
  subroutine insert_into_heap(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: i

    call self%heap%update(event_of(disk, i), tag)
  end subroutine insert_into_heap

  !> Inserts an event into a sorted list of n events. Comparing the times is nearly always
  !> sufficient. Simultaneous events are usually the two copies of one collision, stored by both
  !> disks, and the order of these copies does not matter.
  pure subroutine insert(list, n, event, tag)
    type(event_t), intent(inout) :: list(0:*)
    integer(int32), intent(in) :: n
    type(event_t), intent(in) :: event
    type(tag_t), intent(in) :: tag(*)
    integer(int32) :: k

    k = n
    do while (list(k)%time < event%time)
      list(k + 1) = list(k)
      k = k - 1
    end do
    if (need_order(list(k), event) /= 0) then
      do while (precedes(list(k), event, tag))
        list(k + 1) = list(k)
        k = k - 1
      end do
    end if
    list(k + 1) = event
  end subroutine insert

  !> Finds the disk with the earliest event, which stays in the queue.
  subroutine first(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(out) :: i

    do
      do while (self%n_near > 0)
        i = self%near(self%n_near)%disk
        if (is_valid(disk, self%near(self%n_near))) return
        self%n_near = self%n_near - 1
      end do
      if (self%heap%n > 0) then
        call self%first_in_heap(disk, tag, i)
        if (i > 0) return
      end if
      call self%open_next_window(disk, tag)
    end do
  end subroutine first

  !> Disk with the earliest event in the heap; 0 if no event in the heap is due in the current
  !> window.
  subroutine first_in_heap(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(out) :: i
    type(event_t) :: event

    do while (self%heap%n > 0)
      event = self%heap%first()
      i = event%disk
      if (is_valid(disk, event)) then
        if (.not. event%time*self%per_time < self%next_window) exit
        return
      end if
      call self%heap%drop_first(tag)
    end do
    i = 0
  end subroutine first_in_heap

  !> Removes the event found by `first`.
  subroutine drop_first(self, tag)
    class(event_queue_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)

    if (self%n_near > 0) then
      self%n_near = self%n_near - 1
    else
      call self%heap%drop_first(tag)
    end if
    self%n_taken = self%n_taken + 1
  end subroutine drop_first

  !> Removes the next entry of the queue if it belongs to disk i. If both disks of a collision have
  !> stored it, the two entries are adjacent. Removing the second entry at once is faster than
  !> recognising it as invalid later.
  subroutine drop_if_next(self, i)
    class(event_queue_t), intent(inout) :: self
    integer(int32), intent(in) :: i

    self%n_near = self%n_near - merge(1, 0, self%near(self%n_near)%disk == i)
  end subroutine drop_if_next

  !> Lists disks that probably have events in the next windows (see `calendar`).
  subroutine list_coming(self, tag, stage, n, disks)
    class(event_queue_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: stage
    integer(int32), intent(out) :: n
    integer(int32), intent(out) :: disks(most_coming)    !! the n disks

    n = 0
    if (self%windowed) call self%calendar%list_coming(tag, self%window, stage, n, disks)
  end subroutine list_coming

  !> True if an entry is valid, that is, equal to the event stored by its disk.
  pure function is_valid(disk, event) result(yes)
    type(disk_t), intent(in) :: disk(*)
    type(event_t), intent(in) :: event
    logical :: yes

    associate (t => disk(event%disk)%event_time)
      yes = .not. (t < event%time .or. t > event%time) .and. disk(event%disk)%partner == event%partner
    end associate
  end function is_valid

  !> Advances by one window and sorts the events of the new window into the list, which must be
  !> empty.
  subroutine open_next_window(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)

    self%window = self%window + 1
    self%next_window = self%window + 1
    self%near_is_open = .true.
    call take_bucket(self%calendar%bucket(iand(self%window, self%calendar%last_bucket)), disk, tag, self%per_time, &
      self%next_window, self%near, self%n_near)
    if (self%heap%n > 0) call self%take_from_heap(disk, tag)
    if (self%calendar%span_begins(self%window)) call self%open_next_span(disk, tag)
  end subroutine open_next_window

  !> Moves the valid events of a bucket to a sorted list. An entry is invalid if the event stored by
  !> its disk is due in a later window. The position of an event in the list is the number of later
  !> events. Counting the later events needs no branches that depend on the times. It is fast for
  !> the few events of a bucket.
  pure subroutine take_bucket(bucket, disk, tag, per_time, next_window, list, n)
    type(bucket_t), intent(inout) :: bucket
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    real(real64), intent(in) :: per_time, next_window
    type(event_t), intent(inout) :: list(0:*)
    integer(int32), intent(out) :: n
    real(real64) :: time(bucket_capacity)
    integer(int32) :: due(bucket_capacity), slot(bucket_capacity), k, m, place, later, odd

    n = 0
    do k = 1, bucket%n
      due(n + 1) = bucket%disk(k)
      time(n + 1) = disk(bucket%disk(k))%event_time
      n = n + merge(1, 0, time(n + 1)*per_time < next_window)
    end do
    bucket%n = 0
    do k = 1, n
      place = 1
      do m = 1, k - 1
        later = merge(1, 0, time(m) > time(k))
        place = place + later
        slot(m) = slot(m) + 1 - later
      end do
      slot(k) = place
    end do
    do k = 1, n
      list(slot(k)) = event_of(disk, due(k))
    end do
    odd = 0
    do k = 1, n - 1
      odd = ior(odd, need_order(list(k), list(k + 1)))
    end do
    if (odd == 0) return
    do k = 1, n
      call insert(list, k - 1, event_of(disk, due(k)), tag)
    end do
  end subroutine take_bucket

  !> Moves the events due in the current window from the heap to the sorted list. If the list
  !> overflows, all its events are moved back.
  subroutine take_from_heap(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(in) :: tag(*)
    integer(int32) :: i

    do while (self%near_is_open)
      call self%first_in_heap(disk, tag, i)
      if (i == 0) return
      call self%heap%drop_first(tag)
      call self%insert_near(disk, tag, i)
    end do
    call hand_over(self, disk, tag)
  end subroutine take_from_heap

  !> Moves the events of the next span to their buckets. If the windows have proved far too narrow
  !> or too wide, all events are entered into the queue again with another width.
  subroutine open_next_span(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), allocatable :: surplus(:)
    integer(int32) :: k, n

    if (ill_fitting()) then
      call fill(self, disk(1:self%n_disks), tag(1:self%n_disks), self%width*self%window, windowed=.true.)
      return
    end if
    allocate (surplus(64))
    call self%calendar%open_span(tag, n, surplus)
    do k = 1, n
      tag(surplus(k))%window = window_none
      call self%insert_into_heap(disk, tag, surplus(k))
    end do
  contains

    !> True if all events should be entered anew with another window width. The present width must
    !> have proved far too small or too large, and enough windows must have passed since the last
    !> `fill`.
    pure function ill_fitting() result(yes)
      logical :: yes
      real(real64) :: per_window

      per_window = max(self%n_taken, 1_int64)*self%width/(self%width*self%next_window - self%filled_at)
      yes = (abs(log(per_window/events_per_window)) > log(1.5_real64) .or. self%n_taken == 0) &
        .and. 4*(self%window - self%filled_at*self%per_time) > self%n_disks
    end function ill_fitting
  end subroutine open_next_span

end module event_queue
