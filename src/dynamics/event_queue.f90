!> What happens next: a calendar over the heap (G. Paul, J. Comput. Phys. 221, 615 (2007)).
!>
!> The near future, one window of time, is a short sorted list; if it grows long, the heap takes over until
!> the window is done. Events of the next windows lie in append-only buckets of one cache line, one bucket per
!> window; later ones in unordered lists, one per span of many windows, so that those who append, at any
!> distance, write to few places; those that find their bucket full in the heap. Nothing is searched or
!> unlinked: an entry counts only if it still is what its disk expects. Without buckets all events are in the
!> heap.
module event_queue
  use kinds, only: int32, int64, never, real64
  use disks, only: disk_t, tag_t
  use event_heap, only: event_heap_t, event_t, need_order, precedes
  implicit none
  private
  public :: event_queue_t, most_coming, stages

  integer(int32), parameter :: list_capacity = 64
  integer(int32), parameter :: bucket_capacity = 15
  integer(int32), parameter :: few = 5000          !! disks, nearly all of whose events may have buckets
  integer(int32), parameter :: windows_ahead(*) = [20, 15, 10]               !! to announce, stage by stage
  integer(int32), parameter :: stages = size(windows_ahead)
  integer(int32), parameter :: most_coming = windows_ahead(1)*bucket_capacity  !! disks announced at once
  integer(int32), parameter :: nowhere = -1        !! as tag%window
  real(real64), parameter :: last_window = 2.0e9_real64
  real(real64), parameter :: events_per_window = 4.0_real64
  integer, parameter :: sample_size = 100

  type :: bucket_t                                 ! one cache line
    integer(int32) :: n = 0
    integer(int32) :: disk(bucket_capacity)
  end type bucket_t

  type :: entry_t
    integer(int32) :: disk
    integer(int32) :: window                       !! in which it expects its event
  end type entry_t

  !> Events of one span, this turn of the ring or later.
  type :: span_t
    integer(int32) :: n = 0
    type(entry_t), allocatable :: entry(:)         !! (n)
  end type span_t

  type :: event_queue_t
    private
    logical :: calendar = .true.
    type(event_heap_t) :: heap
    type(event_t) :: list(0:list_capacity)         !! (n_list) latest first, after one that is never due
    integer(int32) :: n_list = 0
    logical :: list_is_open = .false.              !! it takes events; else the heap does
    type(bucket_t), allocatable :: bucket(:)       !! (0:) a ring, length a power of two
    type(span_t), allocatable :: span(:)           !! (0:) a ring as well; a span is half a turn of the other
    integer(int32) :: last_bucket = 0              !! one less than a power of two: masks numbers of windows
    integer(int32) :: last_span = 0                !! likewise, of spans
    integer(int32) :: log_span = 0                 !! binary logarithm of the windows in a span
    integer(int32) :: window = 0                   !! number of the current window since the epoch
    integer(int32) :: ring_end = 0                 !! the first window that has no bucket yet
    integer(int32) :: n_disks = 0
    integer(int32) :: announced(stages) = 0        !! the last window that was announced
    real(real64) :: width = never                  !! of a window [time]
    real(real64) :: per_time = 0.0_real64          !! windows per time, 1/width
    real(real64) :: next_window = 1.0_real64       !! window + 1
    integer(int64) :: n_taken = 0                  !! events since the last filling
    real(real64) :: filled_at = 0.0_real64         !! moment of the last filling [time]
  contains
    procedure :: fill
    procedure :: schedule
    procedure :: first
    procedure :: drop_first
    procedure :: forget
    procedure :: coming
    ! Bound to the type so that these rare parts stay out of the frequent ones.
    procedure, private :: insert_near
    procedure, private :: insert_into_heap
    procedure, private :: first_in_heap
    procedure, private :: open_next_window
    procedure, private :: take_from_heap
    procedure, private :: open_next_span
    procedure, private :: lengthen
  end type event_queue_t

contains

  !> Files the expected events of all disks anew.
  subroutine fill(self, disk, tag, now, calendar)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(inout) :: tag(:)
    real(real64), intent(in) :: now                !! since the epoch [time]
    logical, intent(in) :: calendar                !! .false.: everything into the heap
    integer(int32) :: i

    self%n_disks = size(disk, kind=int32)
    self%n_list = 0
    self%list(0)%time = huge(now)
    call self%heap%initialise(self%n_disks)
    tag%window = nowhere
    self%width = max(window_width(self, disk, now), 1.0e-9_real64*now, 1/never)   ! numbers fit int32
    self%calendar = calendar .and. self%width < never
    self%list_is_open = self%calendar
    self%n_taken = 0
    self%filled_at = now
    self%per_time = 0                              ! one window without end
    if (self%calendar) then
      self%per_time = 1/self%width
      call make_rings(self)
    end if
    self%window = int(now*self%per_time, int32)
    self%ring_end = shiftl(shiftr(self%window, self%log_span) + 2, self%log_span)
    self%announced = self%window
    self%next_window = self%window + 1
    do i = 1, self%n_disks
      call schedule(self, disk, tag, i)
    end do
  end subroutine fill

  !> Empty buckets and spans, enough to hold most events: twice as many as there are disks. Those of many disks should
  !> leave the cache to the disks, and be about as many buckets as spans, as all are written to by turns.
  subroutine make_rings(self)
    class(event_queue_t), intent(inout) :: self
    integer(int32) :: s, length

    length = min(2*self%n_disks, merge(2048, max(512, 3*nint(sqrt(real(self%n_disks)))), self%n_disks <= few))
    self%log_span = 3
    do while (shiftl(2_int32, self%log_span) < length)
      self%log_span = self%log_span + 1
    end do
    self%last_bucket = shiftl(2_int32, self%log_span) - 1
    self%last_span = 3
    do while (events_per_window*shiftl(self%last_span, self%log_span) < 2.0_real64*self%n_disks)
      self%last_span = 2*self%last_span + 1
    end do
    if (allocated(self%bucket)) then
      if (size(self%bucket) /= self%last_bucket + 1 .or. size(self%span) /= self%last_span + 1) &
        deallocate (self%bucket, self%span)
    end if
    if (.not. allocated(self%bucket)) then
      allocate (self%bucket(0:self%last_bucket), self%span(0:self%last_span))
      do s = 0, self%last_span
        allocate (self%span(s)%entry(16))
      end do
    end if
    self%bucket%n = 0
    self%span%n = 0
  end subroutine make_rings

  !> The width of a window that holds a few events: by the rate since the last filling or, at first, by the
  !> median wait of a sample of disks. `never` if nothing is expected at all.
  pure function window_width(self, disk, now) result(width)
    class(event_queue_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    real(real64), intent(in) :: now
    real(real64) :: width, waits(sample_size), swap
    integer :: i, k, n_waits

    width = never
    if (self%n_taken > sample_size .and. self%calendar) then
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

  !> Files what disk i expects. Its former entry, if any, turns void by itself.
  subroutine schedule(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i
    integer(int32) :: window
    real(real64) :: number

    number = disk(i)%event_time*self%per_time
    if (.not. number >= self%next_window) then     ! NaN as well, to be found
      tag(i)%window = nowhere
      call self%insert_near(disk, i)
    else
      window = int(merge(number, last_window, number < last_window), int32)
      if (window == tag(i)%window) return
      tag(i)%window = window
      if (window < self%ring_end) then
        call file(self, self%bucket, disk, tag, i, window)
      else
        call file_far(self, self%span, i, window)
      end if
    end if
  end subroutine schedule

  !> Into the bucket of its window, which is not the current one.
  subroutine file(self, bucket, disk, tag, i, window)
    class(event_queue_t), intent(inout) :: self
    type(bucket_t), intent(inout) :: bucket(0:*)
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i, window
    integer(int32) :: k, n

    k = iand(window, self%last_bucket)
    n = bucket(k)%n + 1
    if (n > bucket_capacity) then
      tag(i)%window = nowhere
      call self%insert_into_heap(disk, i)
      return
    end if
    bucket(k)%disk(n) = i
    bucket(k)%n = n
  end subroutine file

  !> Into the list of the span of its window.
  subroutine file_far(self, span, i, window)
    class(event_queue_t), intent(inout) :: self
    type(span_t), intent(inout) :: span(0:*)
    integer(int32), intent(in) :: i, window
    integer(int32) :: s, n

    s = iand(shiftr(window, self%log_span), self%last_span)
    n = span(s)%n + 1
    if (n > size(span(s)%entry)) call self%lengthen(s)
    span(s)%entry(n)%disk = i
    span(s)%entry(n)%window = window
    span(s)%n = n
  end subroutine file_far

  !> Makes room for as many entries of a span again.
  subroutine lengthen(self, s)
    class(event_queue_t), intent(inout) :: self
    integer(int32), intent(in) :: s

    self%span(s)%entry = [self%span(s)%entry, self%span(s)%entry]
  end subroutine lengthen

  !> Into the current window: the sorted list, or the heap once the list has overflowed.
  subroutine insert_near(self, disk, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i

    if (self%list_is_open) then
      call insert(self%list, self%n_list, event_of(disk, i))
      self%n_list = self%n_list + 1
      self%list_is_open = self%n_list < list_capacity
    else
      call hand_over(self, disk)
      call self%insert_into_heap(disk, i)
    end if
  end subroutine insert_near

  !> Moves the list into the heap.
  subroutine hand_over(self, disk)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32) :: k

    do k = 1, self%n_list
      if (expected(disk, self%list(k))) call self%heap%update(self%list(k))
    end do
    self%n_list = 0
  end subroutine hand_over

  subroutine insert_into_heap(self, disk, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i

    call self%heap%update(event_of(disk, i))
  end subroutine insert_into_heap

  !> Puts an event into its place in a sorted list of n. Times decide nearly always: of events at the same
  !> moment most are one collision that both disks expect, and these need no order.
  pure subroutine insert(list, n, event)
    type(event_t), intent(inout) :: list(0:*)
    integer(int32), intent(in) :: n
    type(event_t), intent(in) :: event
    integer(int32) :: k

    k = n
    do while (list(k)%time < event%time)
      list(k + 1) = list(k)
      k = k - 1
    end do
    if (need_order(list(k), event) /= 0) then
      do while (precedes(list(k), event))
        list(k + 1) = list(k)
        k = k - 1
      end do
    end if
    list(k + 1) = event
  end subroutine insert

  !> The disk whose event comes first; the event stays in the queue.
  subroutine first(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(out) :: i

    do
      do while (self%n_list > 0)
        i = self%list(self%n_list)%disk
        if (expected(disk, self%list(self%n_list))) return
        self%n_list = self%n_list - 1
      end do
      if (self%heap%n > 0) then
        call self%first_in_heap(disk, i)
        if (i > 0) return
      end if
      call self%open_next_window(disk, tag)
    end do
  end subroutine first

  !> The disk whose event comes first of those in the heap; 0: none is due in this window.
  subroutine first_in_heap(self, disk, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(out) :: i
    type(event_t) :: event

    do while (self%heap%n > 0)
      event = self%heap%first()
      i = event%disk
      if (expected(disk, event)) then
        if (.not. event%time*self%per_time < self%next_window) exit
        return
      end if
      call self%heap%remove(i)
    end do
    i = 0
  end subroutine first_in_heap

  !> Takes the event that `first` found out of the queue.
  subroutine drop_first(self, i)
    class(event_queue_t), intent(inout) :: self
    integer(int32), intent(in) :: i                !! as given by `first`

    if (self%n_list > 0) then
      self%n_list = self%n_list - 1
    else
      call self%heap%remove(i)
    end if
    self%n_taken = self%n_taken + 1
  end subroutine drop_first

  !> Tells that the event of disk i is void by now. Only saves time: of a collision that both disks expected
  !> the second entry comes right after the first.
  subroutine forget(self, i)
    class(event_queue_t), intent(inout) :: self
    integer(int32), intent(in) :: i

    self%n_list = self%n_list - merge(1, 0, self%list(self%n_list)%disk == i)
  end subroutine forget

  !> Announces disks that probably have events in the next windows, each window once at each stage, the earlier the
  !> lower. After the first stage only those whose entry is not void.
  subroutine coming(self, tag, stage, n, disks)
    class(event_queue_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: stage
    integer(int32), intent(out) :: n
    integer(int32), intent(out) :: disks(most_coming)    !! (n)
    integer(int32) :: window, last, k
    logical :: expected

    n = 0
    if (.not. self%calendar) return
    last = min(self%window + windows_ahead(stage), self%ring_end - 1)
    do window = max(self%announced(stage), self%window) + 1, last
      associate (bucket => self%bucket(iand(window, self%last_bucket)))
        do k = 1, bucket%n
          disks(n + 1) = bucket%disk(k)
          expected = stage == 1
          if (.not. expected) expected = tag(bucket%disk(k))%window == window
          n = n + merge(1, 0, expected)
        end do
      end associate
    end do
    self%announced(stage) = last
  end subroutine coming

  !> What disk i expects.
  pure function event_of(disk, i) result(event)
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i
    type(event_t) :: event

    event = event_t(disk(i)%event_time, i, disk(i)%partner)
  end function event_of

  !> Whether an entry still is what its disk expects.
  pure function expected(disk, event) result(yes)
    type(disk_t), intent(in) :: disk(*)
    type(event_t), intent(in) :: event
    logical :: yes

    associate (t => disk(event%disk)%event_time)
      yes = .not. (t < event%time .or. t > event%time) .and. disk(event%disk)%partner == event%partner
    end associate
  end function expected

  !> Moves on by one window and sorts what is due in it into the list, which is empty.
  subroutine open_next_window(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)

    self%window = self%window + 1
    self%next_window = self%window + 1
    self%list_is_open = .true.
    call take_bucket(self%bucket(iand(self%window, self%last_bucket)), disk, self%per_time, self%next_window, &
      self%list, self%n_list)
    if (self%heap%n > 0) call self%take_from_heap(disk)
    if (iand(self%window, shiftl(1_int32, self%log_span) - 1) == 0) call self%open_next_span(disk, tag)
  end subroutine open_next_window

  !> Empties a bucket into a sorted list: what its disks expect before the next window. Whatever else it
  !> holds is void. Events are so few that each is put in its place by counting the later ones, without a branch
  !> on times.
  pure subroutine take_bucket(bucket, disk, per_time, next_window, list, n)
    type(bucket_t), intent(inout) :: bucket
    type(disk_t), intent(in) :: disk(*)
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
      call insert(list, k - 1, event_of(disk, due(k)))
    end do
  end subroutine take_bucket

  !> Moves what is due in this window from the heap into the list; if that is too much, all into the heap.
  subroutine take_from_heap(self, disk)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    integer(int32) :: i

    do while (self%list_is_open)
      call self%first_in_heap(disk, i)
      if (i == 0) return
      call self%heap%remove(i)
      call self%insert_near(disk, i)
    end do
    call hand_over(self, disk)
  end subroutine take_from_heap

  !> Files the events of the span that now is the next one into their buckets; those of a later turn stay, if they
  !> still are what their disks expect. Or, if the windows do not fit, files all events anew.
  subroutine open_next_span(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    type(entry_t) :: entry
    integer(int32) :: s, k, n

    if (ill_fitting(self)) then
      call fill(self, disk(1:self%n_disks), tag(1:self%n_disks), self%width*self%window, calendar=.true.)
      return
    end if
    s = iand(shiftr(self%ring_end, self%log_span), self%last_span)
    self%ring_end = self%ring_end + shiftl(1_int32, self%log_span)
    n = self%span(s)%n
    self%span(s)%n = 0
    do k = 1, n
      entry = self%span(s)%entry(k)
      if (entry%window < self%ring_end) then
        call file(self, self%bucket, disk, tag, entry%disk, entry%window)
      else if (tag(entry%disk)%window == entry%window) then    ! appends at most where it has read
        call file_far(self, self%span, entry%disk, entry%window)
      end if
    end do
  end subroutine open_next_span

  !> Whether windows turned out far too narrow or too wide since the last filling, which must be so long ago that
  !> filing all disks anew pays.
  pure function ill_fitting(self) result(yes)
    class(event_queue_t), intent(in) :: self
    logical :: yes
    real(real64) :: per_window

    per_window = max(self%n_taken, 1_int64)*self%width/(self%width*self%next_window - self%filled_at)
    yes = (abs(log(per_window/events_per_window)) > log(1.5_real64) .or. self%n_taken == 0) &
      .and. 4*(self%window - self%filled_at*self%per_time) > self%n_disks
  end function ill_fitting

end module event_queue
