!> A simulation cut into domains, which move on together by windows of time. The events predicted are theirs; the
!> simulation itself stays as it was until their states are written back. If a window does not hold, they are worth nothing
!> any more and have to be filled again.
module partition
  use kinds, only: int16, int32, int64, real64
  use cell_faces, only: patch_t
  use cell_layout, only: whole_box
  use domain_borders, only: compare_copies, refresh
  use domain_cuts, only: domain_cuts_t
  use domains, only: domain_t, load, move_on, next_time, write_back
  use evolution, only: limits_t
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use system, only: seconds
  use tally, only: tally_t
  use team, only: barrier_t, close_barrier, is_last_at, join, many, open_barrier, release
  implicit none
  private
  public :: partition_t

  real(real64), parameter :: longest_visit = 1.0_real64        !! until the caller can look at signals and clocks [s]
  real(real64), parameter :: of_late = 0.1_real64              !! [s]
  real(real64), parameter :: few_events = 20.0_real64          !! before a limit, to be taken moment by moment

  !> What all threads do next: one of them decides while the others wait.
  type :: plan_t
    logical :: goes_on = .true.
    integer :: windows = 0                         !! begun
    real(real64) :: until = 0.0_real64             !! by the clock, for another to begin [s]
    real(real64) :: t_begin = 0.0_real64, t_end = 0.0_real64   !! of the window, since the epoch [time]
    integer(int64) :: events = 0                   !! in the domains when it began
    logical :: begins = .false.                    !! domains take over what came of the window before
    real(real64) :: t = 0.0_real64                 !! to which domains go on, since the epoch [time]
    integer(int64) :: turns = 0                    !! of an engine, at most, on the way
    logical :: compares = .false.                  !! domains are where the window ends
    logical :: good = .true.                       !! the window holds
  end type plan_t

  type :: partition_t
    integer(int32) :: threads = 1
    integer(int32) :: wanted = 1                   !! domains
    real(real64) :: window = 0.5_real64            !! collisions per disk in a window
    integer(int32) :: halo = 6                     !! columns and rows of copies around a domain
    real(real64) :: overload = 4.0_real64          !! turns of an engine in a window, over what all should need together
    type(patch_t) :: whole                         !! the cells of the box; they follow from what does not change in a run
    type(domain_cuts_t) :: cuts
    type(domain_t), allocatable :: domain(:)
    real(real64) :: pace = 0.0_real64              !! events per time; 0: not known yet [1/time]
    real(real64) :: turns_per_event = 10.0_real64  !! of engines
    real(real64) :: shortening = 1.0_real64        !! of windows, after failures
    integer(int32) :: widening = 0                 !! of the halo, after failures
    real(real64) :: cores = 0.0_real64             !! that have been at work of late, on average; 0: not known yet
  contains
    procedure :: fill
    procedure :: run_windows
    procedure :: learn
    procedure :: tally_now
    procedure :: write_back_all
  end type partition_t

contains

  !> Cuts a simulation and fills the domains. `cut`: it could be cut into several.
  subroutine fill(self, sim, listing, cut)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: listing                 !! collisions are to be listed
    logical, intent(out) :: cut
    integer(int16), allocatable :: cell(:, :)
    integer(int32) :: i, k

    if (self%whole%small <= 0) self%whole = whole_box(sim, .false.)
    cut = .false.
    if (self%whole%small < maxval(sim%disk%radius)) return
    allocate (cell(2, sim%n_disks()))
    do i = 1, sim%n_disks()
      cell(:, i) = int(self%whole%cell_at(sim%position(i)), int16)
    end do
    call self%cuts%cut(self%whole, sim%box%periodic, cell, self%wanted, self%threads, &
      self%halo + self%widening + merge(2, 0, self%wanted > self%threads))
    cut = self%cuts%n > 1
    if (.not. cut) return
    if (allocated(self%domain)) then
      if (size(self%domain) /= self%cuts%n) deallocate (self%domain)
    end if
    if (.not. allocated(self%domain)) allocate (self%domain(self%cuts%n))
    if (.not. self%pace > 0) self%pace = 10*sim%n_disks()/(sim%epoch_end - sim%epoch_begin)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      associate (domain => self%domain(k))
        domain%patch = self%cuts%patch_of(k, sim%box%periodic)
        domain%halo = self%cuts%halo
        domain%low = self%cuts%low(:, k)
        domain%high = self%cuts%high(:, k)
        domain%neighbour = self%cuts%neighbours_of(k, domain%patch)
        if (listing .and. .not. allocated(domain%log)) allocate (domain%log)
        call load(domain, sim, pack([(i, i=1, sim%n_disks())], domain%patch%covers(cell)))
      end associate
    end do
    !$omp end parallel do
  end subroutine fill

  !> Learns how fast things happen, from which the length of windows follows, from what has happened in a time.
  pure subroutine learn(self, events, turns, time)
    class(partition_t), intent(inout) :: self
    integer(int64), intent(in) :: events, turns
    real(real64), intent(in) :: time               !! [time]

    if (.not. (events > 0 .and. time > 0)) return
    self%pace = events/time
    self%turns_per_event = max(turns/real(events, real64), 1.0_real64)
  end subroutine learn

  !> What collisions have gathered, those in the domains since they were filled included.
  pure function tally_now(self, sim) result(so_far)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(tally_t) :: so_far
    integer(int32) :: k

    so_far = sim%tally
    do k = 1, self%cuts%n
      call so_far%include(self%domain(k)%sim%tally)
    end do
  end function tally_now

  !> Runs windows in all domains, one after the other, for as long as they hold, until a limit is reached or the caller has
  !> waited long enough. A window ends early at the limit of a count. `good`: all of them hold.
  !>
  !> A thread waits for the others twice in each window: before it compares what they hold, and before it changes what
  !> they compare.
  subroutine run_windows(self, sim, limits, most, t, windows, good)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    integer, intent(in) :: most                    !! windows
    real(real64), intent(out) :: t                 !! where they end, since the epoch [time]
    integer, intent(out) :: windows                !! begun
    logical, intent(out) :: good
    type(plan_t) :: plan
    type(barrier_t) :: barrier
    real(real64) :: began, elapsed, cpu(2)         ! [s]
    integer(int32) :: k

    began = seconds()
    call cpu_time(cpu(1))
    plan%until = began + longest_visit
    plan%t = sim%now
    call begin_window()
    call open_barrier(barrier)
    !$omp parallel num_threads(self%threads) private(k)
    call join(barrier)
    !$omp barrier
    do while (plan%goes_on)
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        if (plan%begins) call refresh(self%domain(k))
        call move_on(self%domain(k), plan%t, plan%turns)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        plan%begins = .false.
        plan%compares = stop_requested()
        if (.not. plan%compares) plan%compares = .not. (all(self%domain%done) .and. plan%t < plan%t_end .and. left() > 0)
        if (.not. plan%compares) call aim()
        call release(barrier)
      end if
      !$omp flush
      if (.not. plan%compares) cycle
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        call compare_copies(self%domain, k)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        call end_window()
        call release(barrier)
      end if
      !$omp flush
    end do
    !$omp end parallel
    call close_barrier(barrier)
    call cpu_time(cpu(2))
    elapsed = seconds() - began
    self%cores = self%cores + (cpu(2) - cpu(1) - elapsed*self%cores)/max(elapsed, of_late)
    t = plan%t
    windows = plan%windows
    good = plan%good
  contains

    !> Plans the window that begins now.
    subroutine begin_window()
      real(real64) :: length

      length = self%window*self%shortening*sim%n_disks()/(2*self%pace)
      if (self%wanted > self%threads) length = 2*length      ! a cache takes in each domain once in a window
      plan%windows = plan%windows + 1
      plan%t_begin = plan%t
      plan%t_end = plan%t + length
      if (plan%t_end + 0.5_real64*length > limits%time) plan%t_end = limits%time
      plan%events = sum(self%domain%sim%tally%events)
      plan%begins = .true.
      self%domain%turns = 0
      call aim()
    end subroutine begin_window

    !> Where all domains go next: to the end of the window unless a count would pass its limit, then most of the way there,
    !> and at last to the next event of any of them. However wrong the guess of the pace, no engine takes more than some turns.
    subroutine aim()
      real(real64) :: expected, sure, next
      integer(int32) :: k

      expected = 1.2_real64*(plan%t_end - plan%t)*self%pace + 100      ! generously
      plan%turns = int(min(self%overload*self%turns_per_event*expected, 1.0e15_real64), int64)
      sure = left()
      next = plan%t_end
      if (sure <= expected) then
        sure = 0.9_real64*sure - 5*sqrt(sure)
        if (sure >= few_events) then
          next = plan%t + sure/self%pace
        else
          do k = 1, self%cuts%n
            next = min(next, next_time(self%domain(k)))
          end do
        end if
      end if
      plan%t = min(next, plan%t_end)
    end subroutine aim

    !> Whether the window that has been compared holds, and whether another one begins.
    subroutine end_window()
      plan%good = all(self%domain%done) .and. all(self%domain%good) .and. left() >= 0    ! else several at the last moment
      if (plan%good) then
        call self%learn(sum(self%domain%sim%tally%events) - plan%events, sum(self%domain%turns), plan%t - plan%t_begin)
      else
        self%widening = min(self%widening + 2, self%halo)
      end if
      plan%goes_on = seconds() < plan%until
      if (plan%goes_on) plan%goes_on = plan%good .and. plan%windows < most .and. plan%t < limits%time .and. left() > 0
      if (plan%goes_on) call begin_window()
    end subroutine end_window

    !> Events that may still come before a count is at its limit.
    pure function left() result(events)
      real(real64) :: events

      events = min(real(limits%events - sim%tally%events - sum(self%domain%sim%tally%events), real64), &
        real(limits%collisions - sim%tally%collisions - sum(self%domain%sim%tally%collisions), real64))
    end function left
  end subroutine run_windows

  !> Brings the whole simulation to the present; the domains go on from there.
  subroutine write_back_all(self, sim, now)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: now                !! since the epoch [time]
    integer(int32) :: k
    logical :: shared

    shared = sim%n_disks() >= many
    !$omp parallel do schedule(static, 1) num_threads(self%threads) if (shared)
    do k = 1, self%cuts%n
      call write_back(self%domain(k), sim)
      self%domain(k)%sim%now = now
    end do
    !$omp end parallel do
    sim%now = now
    do k = 1, self%cuts%n
      call sim%tally%include(self%domain(k)%sim%tally)
      call self%domain(k)%sim%tally%clear()
    end do
  end subroutine write_back_all

end module partition
