!> What happens next: a calendar over the heap (G. Paul, J. Comput. Phys. 221, 615 (2007)).
!>
!> The near future, one window of time, is a short sorted list; if it grows long, the heap takes over until
!> the window is done. Later events lie in append-only buckets of one cache line, one bucket per window;
!> those beyond the last bucket in an unordered far list. Nothing is searched or unlinked: an entry
!> counts only if it still is what its disk expects. Without buckets all events are in the heap.
module event_queue
  use kinds, only: int32, int64, never, real64
  use disks, only: disk_t, tag_t
  use event_heap, only: event_heap_t, event_t, precedes
  implicit none
  private
  public :: event_queue_t

  integer(int32), parameter :: list_capacity = 64
  integer(int32), parameter :: bucket_capacity = 15
  integer(int32), parameter :: in_window = -1, nowhere = -2, in_far_list = -3   !! values of tag%bucket
  real(real64), parameter :: last_window = 2.0e9_real64
  real(real64), parameter :: events_per_window = 4.0_real64
  integer, parameter :: sample_size = 100

  type :: bucket_t                                 ! one cache line
    integer(int32) :: n = 0
    integer(int32) :: disk(bucket_capacity)
  end type bucket_t

  type :: event_queue_t
    private
    logical :: calendar = .true.
    type(event_heap_t) :: heap
    type(event_t) :: list(list_capacity)           !! (n_list) latest first
    integer(int32) :: n_list = 0
    logical :: list_is_open = .false.              !! it takes events; else the heap does
    type(bucket_t), allocatable :: bucket(:)       !! (0:) a ring, length a power of two
    integer(int32), allocatable :: far(:)          !! (n_far) disks whose event lies beyond the ring
    integer(int32) :: n_far = 0
    integer(int32) :: length = 0                   !! number of buckets
    integer(int32) :: window = 0                   !! number of the current window since the epoch
    integer(int32) :: half_turn = 0                !! window at which the far list is filed again
    real(real64) :: width = never                  !! of a window [time]
    real(real64) :: per_time = 0.0_real64          !! windows per time, 1/width
    real(real64) :: window_end = never             !! since the epoch [time]
    integer(int64) :: n_taken = 0                  !! events since the last filling
    real(real64) :: filled_at = 0.0_real64         !! moment of the last filling [time]
  contains
    procedure :: fill
    procedure :: schedule
    procedure :: first
    procedure :: drop_first
    procedure, private :: insert_far
    procedure, private :: insert_into_heap
    procedure, private :: open_next_window
  end type event_queue_t

contains

  !> Files the expected events of all disks anew.
  subroutine fill(self, disk, tag, now, calendar)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(inout) :: tag(:)
    real(real64), intent(in) :: now                !! since the epoch [time]
    logical, intent(in) :: calendar                !! .false.: everything into the heap
    integer(int32) :: n, i, length
    n = size(disk, kind=int32)
    self%n_list = 0
    self%list_is_open = .false.
    self%n_far = 0
    call self%heap%initialise(n)
    tag%bucket = nowhere
    self%width = max(window_width(self, disk, now), 1.0e-9_real64*now, 1/never)   ! numbers fit int32
    self%per_time = 1/self%width
    self%calendar = calendar .and. self%width < never
    self%n_taken = 0
    self%filled_at = now
    if (self%calendar) then
      length = 16
      do while (length < n/2)
        length = 2*length
      end do
      if (allocated(self%bucket)) then
        if (size(self%bucket) /= length) deallocate (self%bucket, self%far)
      end if
      if (.not. allocated(self%bucket)) allocate (self%bucket(0:length - 1), self%far(n))
      self%bucket%n = 0
      self%length = length
      self%window = int(now*self%per_time, int32)
      self%window_end = self%width*(self%window + 1)
      self%half_turn = self%window + length/2
      self%list_is_open = .true.
    else
      self%window_end = huge(now)
    end if
    do i = 1, n
      call schedule(self, disk, tag, i)
    end do
  end subroutine fill

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
      width = events_per_window*(self%window_end - self%filled_at)/self%n_taken
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
    if (disk(i)%event_time < self%window_end) then
      tag(i)%bucket = in_window
      call insert_near(self, disk, event_t(disk(i)%event_time, i, disk(i)%partner))
    else
      if (self%heap%n > 0) call self%heap%remove(i)
      call file(self, self%bucket, disk, tag, i)
    end if
  end subroutine schedule

  !> Into the bucket of its window, which is not the current one.
  subroutine file(self, bucket, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(bucket_t), intent(inout) :: bucket(0:*)
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i
    integer(int32) :: window, k, n
    window = window_number(self, disk(i)%event_time)
    if (window == tag(i)%bucket) return
    k = iand(window, self%length - 1)
    if (window - self%window < self%length) then
      n = bucket(k)%n + 1
      if (n <= bucket_capacity) then
        bucket(k)%disk(n) = i
        bucket(k)%n = n
        tag(i)%bucket = window
        return
      end if
    end if
    call self%insert_far(disk, tag, i, window)
  end subroutine file

  !> The window that holds the time t, later than the current one.
  pure function window_number(self, t) result(window)
    class(event_queue_t), intent(in) :: self
    real(real64), intent(in) :: t
    integer(int32) :: window
    real(real64) :: number
    number = t*self%per_time
    window = int(merge(number, last_window, number < last_window), int32)
    window = merge(window, self%window + 1, window > self%window)    ! it may round down
  end function window_number

  !> Into the current window: the sorted list, or the heap once the list has overflowed.
  subroutine insert_near(self, disk, event)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(event_t), intent(in) :: event
    integer(int32) :: k
    if (self%list_is_open) then
      k = self%n_list
      do while (k > 0)
        if (precedes(event, self%list(k))) exit
        self%list(k + 1) = self%list(k)
        k = k - 1
      end do
      self%list(k + 1) = event
      self%n_list = self%n_list + 1
      self%list_is_open = self%n_list < list_capacity
    else
      call self%insert_into_heap(disk, event)
    end if
  end subroutine insert_near

  !> Where the list is full, it moves into the heap first.
  subroutine insert_into_heap(self, disk, event)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(event_t), intent(in) :: event
    integer(int32) :: k
    do k = 1, self%n_list
      if (expected(disk, self%list(k))) call self%heap%update(self%list(k))
    end do
    self%n_list = 0
    call self%heap%update(event)
  end subroutine insert_into_heap

  !> Where there is no room in the right bucket: into an earlier one, as opened too soon does no harm; or into
  !> the far list, if the window lies beyond the ring.
  recursive subroutine insert_far(self, disk, tag, i, window)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i, window
    integer(int32) :: earlier, k
    if (window - self%window >= self%length) then
      if (tag(i)%bucket == in_far_list) return
      if (self%n_far == size(self%far)) call sweep_far_list(self, disk, tag)
      self%n_far = self%n_far + 1
      self%far(self%n_far) = i
      tag(i)%bucket = in_far_list
      return
    end if
    do earlier = window - 1, self%window + 1, -1
      k = iand(earlier, self%length - 1)
      if (self%bucket(k)%n == bucket_capacity) cycle
      self%bucket(k)%n = self%bucket(k)%n + 1
      self%bucket(k)%disk(self%bucket(k)%n) = i
      tag(i)%bucket = earlier
      return
    end do
    tag(i)%bucket = in_window
    call insert_near(self, disk, event_t(disk(i)%event_time, i, disk(i)%partner))
  end subroutine insert_far

  !> Drops void entries of the far list and files those that have come near.
  recursive subroutine sweep_far_list(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32) :: k, i, n
    n = 0
    do k = 1, self%n_far                           ! a disk that came and went may be entered twice
      i = self%far(k)
      if (tag(i)%bucket /= in_far_list) cycle
      tag(i)%bucket = nowhere
      n = n + 1
      self%far(n) = i
    end do
    self%n_far = 0
    do k = 1, n                                    ! refiling appends at most where it has read
      i = self%far(k)
      call schedule(self, disk, tag, i)
    end do
  end subroutine sweep_far_list

  !> The disk whose event comes first; the event stays in the queue.
  subroutine first(self, disk, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(out) :: i
    type(event_t) :: event
    do
      if (self%n_list > 0) then
        event = self%list(self%n_list)
        if (event%time < self%window_end) then
          i = event%disk
          if (expected(disk, event)) return
          self%n_list = self%n_list - 1
          cycle
        end if
      else if (self%heap%n > 0) then
        event = self%heap%first()
        i = event%disk
        if (event%time < self%window_end) return
      end if
      call self%open_next_window(disk, tag)
    end do
  end subroutine first

  !> Takes the event that `first` found out of the queue.
  subroutine drop_first(self, tag, i)
    class(event_queue_t), intent(inout) :: self
    type(tag_t), intent(inout) :: tag(*)
    integer(int32), intent(in) :: i                !! as given by `first`
    if (self%n_list > 0) then
      self%n_list = self%n_list - 1
    else
      call self%heap%remove(i)
    end if
    tag(i)%bucket = nowhere
    self%n_taken = self%n_taken + 1
  end subroutine drop_first

  !> Whether an entry still is what its disk expects.
  pure function expected(disk, event) result(yes)
    type(disk_t), intent(in) :: disk(*)
    type(event_t), intent(in) :: event
    logical :: yes
    yes = disk(event%disk)%event_time == event%time .and. disk(event%disk)%partner == event%partner
  end function expected

  !> Moves on by one window and sorts its bucket into the list.
  subroutine open_next_window(self, disk, tag)
    class(event_queue_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(*)
    type(tag_t), intent(inout) :: tag(*)
    type(bucket_t) :: opened
    integer(int32) :: k, i
    self%window = self%window + 1
    self%window_end = self%width*(self%window + 1)
    self%list_is_open = self%heap%n == 0
    if (self%window == self%half_turn) then
      if (ill_fitting(self)) then
        k = size(self%far, kind=int32)
        call fill(self, disk(1:k), tag(1:k), self%width*self%window, calendar=.true.)
        return
      end if
      self%half_turn = self%window + self%length/2
      call sweep_far_list(self, disk, tag)
    end if
    k = iand(self%window, self%length - 1)
    opened%n = self%bucket(k)%n
    opened%disk = self%bucket(k)%disk
    self%bucket(k)%n = 0
    do k = 1, opened%n
      i = opened%disk(k)
      if (tag(i)%bucket /= self%window) cycle
      tag(i)%bucket = nowhere
      call schedule(self, disk, tag, i)
    end do
  end subroutine open_next_window

  !> Whether windows turned out far too narrow or too wide since the last filling.
  pure function ill_fitting(self) result(yes)
    class(event_queue_t), intent(in) :: self
    logical :: yes
    real(real64) :: per_window
    per_window = max(self%n_taken, 1_int64)*self%width/(self%window_end - self%filled_at)
    yes = abs(log(per_window/events_per_window)) > log(1.5_real64) .or. self%n_taken == 0
  end function ill_fitting

end module event_queue
