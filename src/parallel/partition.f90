!> A simulation cut into domains, which move on together by windows of time. The events predicted are theirs; the
!> simulation itself stays as it was until they are gathered. If a window does not hold, they are worth nothing any more
!> and have to be filled again.
module partition
  use kinds, only: int16, int32, int64, real64
  use cell_faces, only: patch_t
  use cell_grid, only: whole_box
  use domain_borders, only: refresh, verify
  use domain_cuts, only: domain_cuts_t
  use domains, only: domain_t, due_t, follow_event, gather, load, move_on, next_due
  use evolution, only: limits_t
  use pace, only: pace_t
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
  real(real64), parameter :: few_events = 20.0_real64          !! before a limit, to be taken one by one

  !> What all threads do next: one of them decides while the others wait.
  type :: plan_t
    logical :: goes_on = .true.
    integer :: windows = 0, most = 0               !! begun, and allowed
    real(real64) :: until = 0.0_real64             !! by the clock, for another to begin [s]
    real(real64) :: t_begin = 0.0_real64, t_end = 0.0_real64   !! of the window, since the epoch [time]
    integer(int64) :: events = 0                   !! in the domains when it began
    logical :: begins = .false.                    !! domains take over what came of the window before
    logical :: moves = .false.                     !! domains go on to a time
    real(real64) :: t = 0.0_real64                 !! this one, since the epoch [time]
    integer(int64) :: turns = 0                    !! of an engine, at most, on the way
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
    type(pace_t) :: pace
    real(real64) :: shortening = 1.0_real64        !! of windows, after failures
    integer(int32) :: widening = 0                 !! of the halo, after failures
    real(real64) :: cores = 0.0_real64             !! that have been at work of late, on average
  contains
    procedure :: fill
    procedure :: run_windows
    procedure :: tally_now
    procedure :: left
    procedure :: is_past
    procedure :: gather_all
    procedure, private :: window_end
    procedure, private :: expected
    procedure, private :: begin_window
    procedure, private :: follow_window
    procedure, private :: aim
    procedure, private :: step
    procedure, private :: end_window
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
    logical :: shared

    if (self%whole%small <= 0) self%whole = whole_box(sim, .false.)
    cut = .false.
    if (self%whole%small < maxval(sim%disk%radius)) return
    allocate (cell(2, sim%n_disks()))
    shared = sim%n_disks() >= many
    !$omp parallel do num_threads(self%threads) if (shared)
    do i = 1, sim%n_disks()
      cell(:, i) = int(self%whole%cell_at(sim%position(i)), int16)
    end do
    !$omp end parallel do
    call self%cuts%cut(self%whole, sim%box%periodic, cell, self%wanted, self%threads, &
      self%halo + self%widening + merge(2, 0, self%wanted > self%threads))
    cut = self%cuts%n > 1
    if (.not. cut) return
    if (allocated(self%domain)) then
      if (size(self%domain) /= self%cuts%n) deallocate (self%domain)
    end if
    if (.not. allocated(self%domain)) allocate (self%domain(self%cuts%n))
    if (.not. self%pace%events > 0) self%pace%events = 10*sim%n_disks()/(sim%epoch_end - sim%epoch_begin)
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

  !> When the next window ends.
  pure function window_end(self, sim, t, t_limit) result(t_end)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t, t_limit         !! since the epoch [time]
    real(real64) :: t_end, length

    length = self%window*self%shortening*sim%n_disks()/(2*self%pace%events)
    if (self%wanted > self%threads) length = 2*length      ! a cache takes in each domain once in a window
    t_end = t + length
    if (t_end + 0.5_real64*length > t_limit) t_end = t_limit
  end function window_end

  !> Events in a time, generously.
  pure function expected(self, length) result(events)
    class(partition_t), intent(in) :: self
    real(real64), intent(in) :: length             !! [time]
    real(real64) :: events

    events = 1.2_real64*length*self%pace%events + 100
  end function expected

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

  !> Events that may still come before a count is at its limit.
  pure function left(self, sim, goal) result(events)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal
    real(real64) :: events

    events = min(real(goal%events - sim%tally%events - sum(self%domain%sim%tally%events), real64), &
      real(goal%collisions - sim%tally%collisions - sum(self%domain%sim%tally%collisions), real64))
  end function left

  !> Runs windows in all domains, one after the other, for as long as they hold, until the goal is reached or the caller has
  !> waited long enough. A window ends early at the limit of a count. `good`: all of them hold.
  !>
  !> A thread waits for the others twice in each window: before it compares what they hold, and before it changes what
  !> they compare.
  subroutine run_windows(self, sim, goal, most, t, windows, good)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    integer, intent(in) :: most                    !! windows
    real(real64), intent(inout) :: t               !! since the epoch [time]
    integer, intent(out) :: windows                !! begun
    logical, intent(out) :: good
    type(plan_t) :: plan
    type(barrier_t) :: barrier
    real(real64) :: began, elapsed, cpu(2)         ! [s]
    integer(int32) :: k

    began = seconds()
    call cpu_time(cpu(1))
    plan%most = most
    plan%until = began + longest_visit
    call self%begin_window(sim, goal, t, plan)
    call open_barrier(barrier)
    !$omp parallel num_threads(self%threads) private(k)
    call join(barrier)
    !$omp barrier
    do while (plan%goes_on)
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        if (plan%begins) call refresh(self%domain(k))
        if (plan%moves) call move_on(self%domain(k), plan%t, plan%turns)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        call self%follow_window(sim, goal, plan)
        call release(barrier)
      end if
      !$omp flush
      if (plan%moves) cycle
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        call verify(self%domain, k)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        call self%end_window(sim, goal, plan)
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
  end subroutine run_windows

  !> Plans the window that begins now.
  subroutine begin_window(self, sim, goal, t, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    real(real64), intent(in) :: t                  !! since the epoch [time]
    type(plan_t), intent(inout) :: plan

    plan%windows = plan%windows + 1
    plan%t_begin = t
    plan%t = t
    plan%t_end = self%window_end(sim, t, goal%time)
    plan%events = sum(self%domain%sim%tally%events)
    plan%begins = .true.
    self%domain%turns = 0
    call self%aim(sim, goal, plan)
  end subroutine begin_window

  !> Plans how the window goes on, and takes single events where a count is near its limit.
  subroutine follow_window(self, sim, goal, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    type(plan_t), intent(inout) :: plan
    logical :: stepped

    stepped = .not. plan%moves
    plan%begins = .false.
    do
      if (stepped) call self%step(plan%t, plan%t_end)
      plan%moves = .false.
      if (.not. (all(self%domain%done) .and. plan%t < plan%t_end .and. self%left(sim, goal) > 0)) exit
      if (stop_requested()) exit
      call self%aim(sim, goal, plan)
      if (plan%moves) exit
      stepped = .true.
    end do
  end subroutine follow_window

  !> Where all domains go next: to the end of the window unless a count would pass its limit, then most of the way there.
  !> If it is too near for that they do not move together any more, but from event to event. However wrong the guess of
  !> the pace, no engine takes more than some turns.
  subroutine aim(self, sim, goal, plan)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal
    type(plan_t), intent(inout) :: plan
    real(real64) :: expected, sure

    expected = self%expected(plan%t_end - plan%t)
    plan%turns = int(min(self%overload*self%pace%turns*expected, 1.0e15_real64), int64)
    sure = self%left(sim, goal)
    plan%moves = .true.
    if (sure > expected) then
      plan%t = plan%t_end
    else
      sure = 0.9_real64*sure - 5*sqrt(sure)
      plan%moves = .not. sure < few_events
      if (plan%moves) plan%t = min(plan%t_end, plan%t + sure/self%pace%events)
    end if
  end subroutine aim

  !> Whether the window that has been compared holds, and whether another one begins.
  subroutine end_window(self, sim, goal, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    type(plan_t), intent(inout) :: plan
    real(real64) :: now                            ! [s]

    now = seconds()
    plan%good = all(self%domain%done) .and. all(self%domain%good) .and. self%left(sim, goal) >= 0  ! else several at the last
    if (plan%good) then                                                                            ! moment
      call self%pace%learn(sum(self%domain%sim%tally%events) - plan%events, sum(self%domain%turns), plan%t - plan%t_begin)
    else
      self%widening = min(self%widening + 2, self%halo)
    end if
    plan%goes_on = plan%good .and. plan%windows < plan%most .and. plan%t < goal%time .and. self%left(sim, goal) > 0 &
      .and. now < plan%until
    if (plan%goes_on) call self%begin_window(sim, goal, plan%t, plan)
  end subroutine end_window

  !> Takes the next event, in the domains that expect it, or else goes to the end of the window: of simultaneous events
  !> only the one that the plain engine takes first.
  subroutine step(self, t, t_end)
    class(partition_t), intent(inout) :: self
    real(real64), intent(inout) :: t               !! since the epoch [time]
    real(real64), intent(in) :: t_end              !! likewise
    type(due_t) :: due(size(self%domain))
    integer(int32) :: k, first

    first = 1
    do k = 1, self%cuts%n
      due(k) = next_due(self%domain(k))
      if (due(k)%precedes(due(first))) first = k
    end do
    do k = 1, self%cuts%n
      if (due(first)%time > t_end) then
        call move_on(self%domain(k), t_end, 1_int64)
      else if (.not. due(first)%precedes(due(k))) then
        call follow_event(self%domain(k))
      else
        self%domain(k)%done = .true.               ! its turn comes later
      end if
    end do
    t = min(due(first)%time, t_end)
  end subroutine step

  !> Whether all that happens up to a time has happened.
  function is_past(self, t) result(yes)
    class(partition_t), intent(inout) :: self
    real(real64), intent(in) :: t                  !! since the epoch [time]
    logical :: yes
    type(due_t) :: due
    integer(int32) :: k

    yes = .true.
    do k = 1, self%cuts%n
      due = next_due(self%domain(k))
      yes = yes .and. due%time > t
    end do
  end function is_past

  !> Brings the whole simulation to the present; the domains go on from there.
  subroutine gather_all(self, sim, now)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: now                !! since the epoch [time]
    integer(int32) :: k
    logical :: shared

    shared = sim%n_disks() >= many
    !$omp parallel do schedule(static, 1) num_threads(self%threads) if (shared)
    do k = 1, self%cuts%n
      call gather(self%domain(k), sim)
      self%domain(k)%sim%now = now
    end do
    !$omp end parallel do
    sim%now = now
    do k = 1, self%cuts%n
      call sim%tally%include(self%domain(k)%sim%tally)
      call self%domain(k)%sim%tally%clear()
    end do
  end subroutine gather_all

end module partition
