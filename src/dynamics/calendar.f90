!> Calendar: the part of the event queue that contains events of later times. Time is divided into windows of equal length. Each of
!> the next windows has a bucket: an array that occupies one cache line. The time after the windows with buckets is divided into
!> spans of many windows, and each span has an unordered list of events. A new entry is appended at the end of a bucket or of a
!> list, so that few cache lines are accessed. No procedure searches a bucket or a list for the entry of a particular disk, or
!> removes a single entry. All lists share one array, which is divided into chunks. The chunks of a list are reused after the span
!> of the list has been processed.
module calendar
  use kinds, only: int32, real64
  use disks, only: tag_t
  implicit none
  private
  public :: bucket_capacity, bucket_t, calendar_t, events_per_window, filed_t, most_coming, stages, window_none

  integer(int32), parameter :: bucket_capacity = 15
  !> Intended mean number of events in a window. With fewer events per window, the program would process more empty windows. With
  !> more events per window, more events would have to be stored in the heap, because a bucket has space for only a few events.
  real(real64), parameter :: events_per_window = 4.0_real64
  integer(int32), parameter :: few_disks = 5000    !! number of disks up to which nearly all events fit into buckets
  !> For each stage of prefetching, the number of windows between the current window and the last prefetched window.
  integer(int32), parameter :: windows_ahead(*) = [20, 15, 10]
  integer(int32), parameter :: stages = size(windows_ahead)
  integer(int32), parameter :: most_coming = windows_ahead(1)*bucket_capacity
    !! largest number of disks in the list that one stage of prefetching makes
  integer(int32), parameter :: window_none = -1    !! value of tag%window if the event is not in the calendar

  type :: bucket_t                                 ! one cache line
    integer(int32) :: n = 0
    integer(int32) :: disk(bucket_capacity)
  end type bucket_t

  integer(int32), parameter :: log_chunk = 7
  !> Number of entries in a chunk. A chunk is a part of a list and occupies 1 KiB. The first entry of a chunk is a link to another
  !> chunk of the same list.
  integer(int32), parameter :: chunk = shiftl(1_int32, log_chunk)
  integer(int32), parameter :: none = -1

  !> An entry: a disk and the window of its event. In the first entry of a chunk, which is a link, `disk` contains the number of the
  !> previous chunk of the list instead of a disk.
  type :: filed_t
    integer(int32) :: disk
    integer(int32) :: window
  end type filed_t

  type :: calendar_t
    type(bucket_t), allocatable :: bucket(:)       !! (0:last_bucket) circular buffer of the buckets of the next windows
    !> (0:last_span) position in `filed` after the last entry in the list of each span, 0 if the list is empty. `list_end` is a
    !> circular buffer, like `bucket`. The number of windows in a span is half the number of buckets. Because the buffer is
    !> circular, the list of a span can also contain events of later spans that use the same element of `list_end`.
    integer(int32), allocatable :: list_end(:)
    !> (0:) the chunks of all lists. Each chunk contains a link to the previous chunk of the same list.
    type(filed_t), allocatable :: filed(:)
    integer(int32) :: n_chunks = 0                 !! number of chunks that have been used
    integer(int32) :: vacant = none                !! number of the first chunk in the list of free chunks
    integer(int32) :: last_bucket = 0              !! largest index of a bucket, which is also the bit mask for window numbers
    integer(int32) :: last_span = 0                !! largest index of a span, which is also the bit mask for span numbers
    integer(int32) :: log_span = 0                 !! binary logarithm of the number of windows in a span
    integer(int32) :: ring_end = 0                 !! first window that has no bucket yet
    integer(int32) :: announced(stages) = 0        !! for each stage of prefetching, the last window whose disks have been listed
  contains
    procedure :: empty
    procedure :: begin
    procedure :: put_near
    procedure :: put_far
    procedure :: span_begins
    procedure :: open_span
    procedure :: list_coming
    procedure, private :: add_chunk  ! type-bound, so that the compiler does not inline the procedure into the hot path
  end type calendar_t

contains

  !> Empties the calendar, and chooses the numbers of buckets and spans. The numbers of buckets and spans are so large that all
  !> windows together contain at least 2n events on average, so that most events of n disks fit into the calendar. If there are many
  !> disks, the number of buckets is limited, so that buckets and disks fit into the cache together. The number of different cache
  !> lines to which the program writes is smallest if there are as many buckets as spans.
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
      ! The operating system provides memory only for the part of the array that is used.
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

  !> Adds a disk to the bucket of a window that is later than the current window and earlier than `ring_end`, unless the bucket is
  !> full.
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

  !> Appends a chunk to the list whose last entry precedes the position `place`.
  subroutine add_chunk(self, place)
    class(calendar_t), intent(inout) :: self
    !> in: position after the last entry of the list; out: position of the first entry in the new chunk.
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

  !> Whether a window is the first of a span.
  pure function span_begins(self, window) result(yes)
    class(calendar_t), intent(in) :: self
    integer(int32), intent(in) :: window
    logical :: yes

    yes = iand(window, shiftl(1_int32, self%log_span) - 1) == 0
  end function span_begins

  !> Moves the events of the next span into their buckets. Events of later spans can be in the same list as the events of the next
  !> span, and stay in the list if they are still valid. Disks whose events do not fit into a full bucket are returned in `surplus`.
  subroutine open_span(self, tag, n_surplus, surplus)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(out) :: n_surplus
    integer(int32), allocatable, intent(inout) :: surplus(:)     !! (n_surplus) disks whose events do not fit into a bucket
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

  !> Lists disks that probably have events in the next windows, for one stage of prefetching. Each stage of prefetching lists the
  !> disks of a window exactly once. The first stage of prefetching is the farthest ahead of the current window, and each later
  !> stage is closer. All stages of prefetching except the first stage omit disks whose entries have become invalid.
  subroutine list_coming(self, tag, window, stage, n, disks)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: window           !! current window
    integer(int32), intent(in) :: stage
    integer(int32), intent(out) :: n
    integer(int32), intent(out) :: disks(most_coming)    !! (n) disks that probably have events soon
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
