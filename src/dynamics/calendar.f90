!> The part of the event queue for later times: append-only buckets of one cache line, one for each of the next
!> windows of time, and unordered lists for longer spans beyond. Appending touches few cache lines; nothing is ever
!> searched or removed singly.
module calendar
  use kinds, only: int32, real64
  use disks, only: tag_t
  implicit none
  private
  public :: bucket_capacity, bucket_t, calendar_t, events_per_window, filed_t, most_coming, stages, window_none

  integer(int32), parameter :: bucket_capacity = 15
  !> Wanted. Fewer per window: more empty windows to open. More: buckets overflow into the heap.
  real(real64), parameter :: events_per_window = 4.0_real64
  integer(int32), parameter :: few_disks = 5000    !! nearly all of their events may have buckets
  integer(int32), parameter :: windows_ahead(*) = [20, 15, 10]    !! to announce for prefetching, stage by stage
  integer(int32), parameter :: stages = size(windows_ahead)
  integer(int32), parameter :: most_coming = windows_ahead(1)*bucket_capacity  !! disks announced at once
  integer(int32), parameter :: window_none = -1    !! as tag%window: not in the calendar

  type :: bucket_t                                 ! one cache line
    integer(int32) :: n = 0
    integer(int32) :: disk(bucket_capacity)
  end type bucket_t

  !> A disk and the window in which it expects its event.
  type :: filed_t
    integer(int32) :: disk
    integer(int32) :: window
  end type filed_t

  !> Events of one span, this turn of the ring or later.
  type :: span_t
    integer(int32) :: n = 0
    type(filed_t), allocatable :: filed(:)         !! (n, and room for more)
  end type span_t

  type :: calendar_t
    type(bucket_t), allocatable :: bucket(:)       !! (0:) a ring, length a power of two
    type(span_t), allocatable :: span(:)           !! (0:) a ring as well; a span is half a turn of the other
    integer(int32) :: last_bucket = 0              !! one less than a power of two: masks numbers of windows
    integer(int32) :: last_span = 0                !! likewise, of spans
    integer(int32) :: log_span = 0                 !! binary logarithm of the windows in a span
    integer(int32) :: ring_end = 0                 !! the first window that has no bucket yet
    integer(int32) :: announced(stages) = 0        !! the last window that was announced
  contains
    procedure :: empty
    procedure :: begin
    procedure :: put_near
    procedure :: put_far
    procedure :: span_begins
    procedure :: open_span
    procedure :: list_coming
    procedure, private :: lengthen                 ! bound, so that it is not inlined into the hot path
  end type calendar_t

contains

  !> Empty buckets and spans, enough to hold most events of n disks: twice as many. For many disks the buckets must
  !> leave the cache to the disks; equal numbers of buckets and spans minimise the lines written.
  subroutine empty(self, n)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: n                !! number of disks
    integer(int32) :: s, length

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
      if (size(self%bucket) /= self%last_bucket + 1 .or. size(self%span) /= self%last_span + 1) &
        deallocate (self%bucket, self%span)
    end if
    if (.not. allocated(self%bucket)) then
      allocate (self%bucket(0:self%last_bucket), self%span(0:self%last_span))
      do s = 0, self%last_span
        allocate (self%span(s)%filed(16))
      end do
    end if
    self%bucket%n = 0
    self%span%n = 0
  end subroutine empty

  !> Begins with a window.
  subroutine begin(self, window)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: window

    self%ring_end = shiftl(shiftr(window, self%log_span) + 2, self%log_span)
    self%announced = window
  end subroutine begin

  !> Into the bucket of a window before `ring_end`, which is not the current one, unless it is full.
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

  !> Into the list of the span of a later window.
  subroutine put_far(self, i, window)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: i, window
    integer(int32) :: s, n

    s = iand(shiftr(window, self%log_span), self%last_span)
    n = self%span(s)%n + 1
    if (n > size(self%span(s)%filed)) call self%lengthen(s)
    self%span(s)%filed(n)%disk = i
    self%span(s)%filed(n)%window = window
    self%span(s)%n = n
  end subroutine put_far

  !> Doubles the room of a span. What is not used of it takes no memory.
  subroutine lengthen(self, s)
    class(calendar_t), intent(inout) :: self
    integer(int32), intent(in) :: s
    type(filed_t), allocatable :: longer(:)

    associate (filed => self%span(s)%filed)
      allocate (longer(2*size(filed)))
      longer(:size(filed)) = filed
    end associate
    call move_alloc(longer, self%span(s)%filed)
  end subroutine lengthen

  !> Whether a window is the first of a span.
  pure function span_begins(self, window) result(yes)
    class(calendar_t), intent(in) :: self
    integer(int32), intent(in) :: window
    logical :: yes

    yes = iand(window, shiftl(1_int32, self%log_span) - 1) == 0
  end function span_begins

  !> Moves the events of the next span into their buckets. Those of a later turn stay, if they are still what their
  !> disks expect; those whose bucket is full are given back.
  subroutine open_span(self, tag, n_surplus, surplus)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(out) :: n_surplus
    integer(int32), allocatable, intent(inout) :: surplus(:)     !! (n_surplus) disks; grows as needed
    type(filed_t) :: filed
    integer(int32) :: s, k, n
    logical :: full

    s = iand(shiftr(self%ring_end, self%log_span), self%last_span)
    self%ring_end = self%ring_end + shiftl(1_int32, self%log_span)
    n = self%span(s)%n
    self%span(s)%n = 0
    n_surplus = 0
    do k = 1, n
      filed = self%span(s)%filed(k)
      if (filed%window < self%ring_end) then
        call self%put_near(filed%disk, filed%window, full)
        if (.not. full) cycle
        n_surplus = n_surplus + 1
        if (n_surplus > size(surplus)) surplus = [surplus, surplus]
        surplus(n_surplus) = filed%disk
      else if (tag(filed%disk)%window == filed%window) then    ! appends at most where it has read
        call self%put_far(filed%disk, filed%window)
      end if
    end do
  end subroutine open_span

  !> Lists disks that probably have events in the next windows, each window once at each stage, the earlier the
  !> lower. After the first stage only those whose entry is still valid.
  subroutine list_coming(self, tag, window, stage, n, disks)
    class(calendar_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag(*)
    integer(int32), intent(in) :: window           !! the current one
    integer(int32), intent(in) :: stage
    integer(int32), intent(out) :: n
    integer(int32), intent(out) :: disks(most_coming)    !! (n)
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
