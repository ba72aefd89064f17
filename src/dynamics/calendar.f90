!> Calendar: the part of the event queue for later events. Time is divided into windows of equal
!> length. Each of the next windows has a bucket, an array that fills one cache line. Later times
!> are divided into spans of many windows, each with an unordered list of events.
!>
!> New entries are appended at the end, which accesses few cache lines. Entries of a particular disk
!> are never searched for, and entries are never removed singly. All lists share one array, which is
!> divided into chunks. The chunks of a list are reused once the span of the list has been
!> processed.
module calendar
  use kinds, only: int32, real64
  use disks, only: tag_t
  implicit none
  private
  public :: bucket_capacity, bucket_t, calendar_t, events_per_window, filed_t, most_coming, stages, window_none

  integer(int32), parameter :: bucket_capacity = 15
  !> Intended mean number of events in a window. With fewer events, more empty windows would have to
  !> be processed. With more events, the small buckets would overflow more often, and more events
  !> would be stored in the heap.
  real(real64), parameter :: events_per_window = 4.0_real64
  !> Number of disks up to which nearly all events fit into buckets.
  integer(int32), parameter :: few_disks = 5000
  !> Number of windows between the current window and the last prefetched window, for each stage of
  !> prefetching.
  integer(int32), parameter :: windows_ahead(*) = [20, 15, 10]
  integer(int32), parameter :: stages = size(windows_ahead)
  integer(int32), parameter :: most_coming = windows_ahead(1)*bucket_capacity
    !! maximum number of disks listed by one stage of prefetching
  integer(int32), parameter :: window_none = -1    !! value of tag%window for events outside the calendar

  type :: bucket_t                                 ! fills one cache line
    integer(int32) :: n = 0
    integer(int32) :: disk(bucket_capacity)
  end type bucket_t

  integer(int32), parameter :: log_chunk = 7
  !> Number of entries in a chunk, a part of a list that occupies 1 KiB. The first entry is a link
  !> to another chunk of the same list.
  integer(int32), parameter :: chunk = shiftl(1_int32, log_chunk)
  integer(int32), parameter :: none = -1

  !> An entry: a disk and the window of its event. In the link at the start of a chunk, `disk` is
  !> the number of the previous chunk of the list.
  type :: filed_t
    integer(int32) :: disk
    integer(int32) :: window
  end type filed_t

  type :: calendar_t
    !> Circular buffer with the buckets of the next windows; indices 0:last_bucket.
    type(bucket_t), allocatable :: bucket(:)
    !> For each span, the position in `filed` after the last entry of the list, or 0 if the list is
    !> empty; indices 0:last_span. A span has half as many windows as there are buckets. Like
    !> `bucket`, the array is a circular buffer. A list can therefore also contain events of later
    !> spans with the same index.
    integer(int32), allocatable :: list_end(:)
    !> Chunks of all lists, each with a link to the previous chunk of the same list; indices from 0.
    type(filed_t), allocatable :: filed(:)
    integer(int32) :: n_chunks = 0                 !! number of chunks used so far
    integer(int32) :: vacant = none                !! first chunk in the list of free chunks
    !> Maximum index of a bucket; also the bit mask for window numbers.
    integer(int32) :: last_bucket = 0
    !> Maximum index of a span; also the bit mask for span numbers.
    integer(int32) :: last_span = 0
    integer(int32) :: log_span = 0                 !! binary logarithm of the number of windows per span
    integer(int32) :: ring_end = 0                 !! first window without a bucket
    !> For each stage of prefetching, the last window whose disks were listed.
    integer(int32) :: announced(stages) = 0
  contains
    procedure :: empty
    procedure :: begin
    procedure :: put_near
    procedure :: put_far
    procedure :: span_begins
    procedure :: open_span
    procedure :: list_coming
    procedure, private :: add_chunk  ! type-bound, so that the compiler does not inline it into the hot path
  end type calendar_t

contains

  !> Empties the calendar and chooses the numbers of buckets and spans. On average, all windows
  !> together contain at least 2n events, so that most events of n disks fit into the calendar. For
  !> many disks the number of buckets is limited, so that buckets and disks fit into the cache
  !> together. The number of cache lines that are written is smallest if there are as many buckets
  !> as spans.
  subroutine empty(self, n)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: n                !! number of disks
    integer(int32) :: length

    length = min(2*n, merge(2048, max(512, 3*nint(sqrt(real(n)))), n <= few_disks))
    self%log_span = 3
    do while (shiftl(2_int32, self%log_span) < length)
      self%log_span = self%log_span + 1
    end do
    self%last_bucket = shiftl(2_int32, self%log_span) - 1
    self%last_span = 3
    do while (events_per_window*shiftl(self%last_span, self%log_span) < 2.0_real64*n)
      self%last_span = 2*self%last_span + 1
    end do
    if (allocated(self%bucket)) then
      if (size(self%bucket) /= self%last_bucket + 1 .or. size(self%list_end) /= self%last_span + 1) &
        deallocate (self%bucket, self%list_end, self%filed)
    end if
    if (.not. allocated(self%bucket)) then
      allocate (self%bucket(0:self%last_bucket), self%list_end(0:self%last_span))
      ! The operating system provides memory only for the part of the array in use.
      allocate (self%filed(0:chunk*(self%last_span + 1 + 2*n/chunk) - 1))
    end if
    self%bucket%n = 0
    self%list_end = 0
    self%n_chunks = 0
    self%vacant = none
  end subroutine empty

  !> Starts the calendar at a given window.
  subroutine begin(self, window)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: window

    self%ring_end = shiftl(shiftr(window, self%log_span) + 2, self%log_span)
    self%announced = window
  end subroutine begin

  !> Adds a disk to the bucket of a window between the current window and `ring_end`. If the bucket
  !> is full, nothing is added.
  subroutine put_near(self, i, window, full)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: i, window
    logical, intent(out) :: full
    integer(int32) :: n

    associate (bucket => self%bucket(iand(window, self%last_bucket)))
      n = bucket%n + 1
      full = n > bucket_capacity
      if (full) return
      bucket%disk(n) = i
      bucket%n = n
    end associate
  end subroutine put_near

  !> Adds a disk to the list of the span of a later window.
  subroutine put_far(self, i, window)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: i, window
    integer(int32) :: s, place

    s = iand(shiftr(window, self%log_span), self%last_span)
    place = self%list_end(s)
    if (iand(place, chunk - 1) == 0) call self%add_chunk(place)
    self%filed(place)%disk = i
    self%filed(place)%window = window
    self%list_end(s) = place + 1
  end subroutine put_far

  !> Appends a chunk to the list whose last entry is just before the position `place`.
  subroutine add_chunk(self, place)
    class(calendar_t), intent(inout) :: self
    !> On entry, the position after the last entry of the list. On return, the position of the first
    !> entry in the new chunk.
    integer(int32), intent(inout) :: place
    type(filed_t), allocatable :: more(:)
    integer(int32) :: c

    c = self%vacant
    if (c /= none) then
      self%vacant = self%filed(chunk*c)%disk
    else
      c = self%n_chunks
      self%n_chunks = c + 1
      if (chunk*self%n_chunks > size(self%filed)) then
        allocate (more(0:2*size(self%filed) - 1))
        more(:size(self%filed) - 1) = self%filed
        call move_alloc(more, self%filed)
      end if
    end if
    self%filed(chunk*c)%disk = shiftr(place, log_chunk) - 1
    place = chunk*c + 1
  end subroutine add_chunk

  !> True if a window is the first of a span.
  pure function span_begins(self, window) result(yes)
    class(calendar_t), intent(in) :: self
    integer(int32), intent(in) :: window
    logical :: yes

    yes = iand(window, shiftl(1_int32, self%log_span) - 1) == 0
  end function span_begins

  !> Moves the events of the next span to their buckets. Valid events of later spans stay in this
  !> list. Disks whose buckets are full are returned in `surplus`.
  subroutine open_span(self, tag, n_surplus, surplus)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(out) :: n_surplus
    !> Disks whose buckets are full; size at least n_surplus.
    integer(int32), allocatable, intent(inout) :: surplus(:)
    type(filed_t) :: filed
    integer(int32) :: s, c, k, list_end, before
    logical :: full

    s = iand(shiftr(self%ring_end, self%log_span), self%last_span)
    self%ring_end = self%ring_end + shiftl(1_int32, self%log_span)
    list_end = self%list_end(s)
    self%list_end(s) = 0
    n_surplus = 0
    do while (list_end > 0)
      c = shiftr(list_end - 1, log_chunk)
      do k = chunk*c + 1, list_end - 1
        filed = self%filed(k)
        if (filed%window < self%ring_end) then
          call self%put_near(filed%disk, filed%window, full)
          if (.not. full) cycle
          n_surplus = n_surplus + 1
          if (n_surplus > size(surplus)) surplus = [surplus, surplus]
          surplus(n_surplus) = filed%disk
        else if (tag(filed%disk)%window == filed%window) then
          call self%put_far(filed%disk, filed%window)
        end if
      end do
      before = self%filed(chunk*c)%disk
      self%filed(chunk*c)%disk = self%vacant
      self%vacant = c
      list_end = chunk*(before + 1)
    end do
  end subroutine open_span

  !> Lists disks that probably have events in the next windows, for one stage of prefetching. Each
  !> stage lists the disks of a window exactly once. The first stage is farthest ahead of the
  !> current window. Later stages are closer, and omit disks whose entries have become invalid since
  !> then.
  subroutine list_coming(self, tag, window, stage, n, disks)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: window           !! current window
    integer(int32), intent(in) :: stage
    integer(int32), intent(out) :: n
    !> The n disks that probably have events in the next windows.
    integer(int32), intent(out) :: disks(most_coming)
    integer(int32) :: w, last, k
    logical :: valid

    n = 0
    last = min(window + windows_ahead(stage), self%ring_end - 1)
    do w = max(self%announced(stage), window) + 1, last
      associate (bucket => self%bucket(iand(w, self%last_bucket)))
        do k = 1, bucket%n
          disks(n + 1) = bucket%disk(k)
          valid = stage == 1
          if (.not. valid) valid = tag(bucket%disk(k))%window == w
          n = n + merge(1, 0, valid)
        end do
      end associate
    end do
    self%announced(stage) = last
  end subroutine list_coming

end module calendar
