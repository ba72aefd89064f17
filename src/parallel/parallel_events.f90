!> Event-driven dynamics on several cores, or on one whose cache takes in a part of the disks at a time, with every
!> bit of the plain engine. Space is cut into domains; each has an engine of its own, and they compare at the end of
!> every window of time (see `domains`). If a window does not hold, all go back to the state in which they set out.
!> What is rare and awkward is left to the plain engine: small or idle systems, a moment within simultaneous
!> collisions, a collapse.
module parallel_events
  use kinds, only: int16, int32, int64, real64
  use cell_faces, only: patch_t
  use cell_grid, only: whole_box
  use domain_borders, only: refresh, verify
  use domain_cuts, only: domain_cuts_t
  use domains, only: clear_sums, domain_t, gather, keep_log, load, merge_logs, move_on, next_time
  use epochs, only: begin_first_epoch, most_events, move_epoch, stands_still
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use event_log, only: event_log_t
  use evolution, only: evolution_t, limits_t
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use system, only: seconds
  implicit none
  private
  public :: parallel_events_t

  real(real64), parameter :: longest_visit = 1.0_real64        !! until the caller can look at signals and clocks [s]
  integer, parameter :: most_windows = 24                      !! of a visit
  real(real64), parameter :: turns_per_event = 20.0_real64
  real(real64), parameter :: few_events = 20.0_real64          !! before a limit, to be taken one by one
  real(real64), parameter :: shortest = 0.01_real64            !! window to be tried, in usual ones
  !> Events per disk that are to come before a count is at its limit, for several domains to go on, or to begin.
  real(real64), parameter :: least_left = 0.25_real64, least_left_to_begin = 2.0_real64
  integer(int64), parameter :: plain_events = 5                !! per disk, after which to try again
  real(real64), parameter :: rounding = 1.0e-12_real64

  type, extends(evolution_t) :: parallel_events_t
    type(event_driven_t) :: plain                  !! an engine for all that is not worth more; it is copied to run
    integer(int32) :: threads = 1
    real(real64) :: window = 0.5_real64            !! collisions per disk in a window of time
    integer(int32) :: halo = 6                     !! columns and rows of copies around a domain
    integer(int32) :: least_disks = 1250           !! of a domain; twice as many in a periodic box, which has twice as many cuts
    integer(int32) :: most_disks = 62000           !! likewise, if it is to fit into caches
    integer(int64) :: windows_done = 0, windows_failed = 0
    ! Of these two only one is there at a time, to save memory.
    type(event_driven_t), allocatable, private :: engine   !! the plain one at work
    type(domain_t), allocatable, private :: domain(:)
    type(domain_cuts_t), private :: cuts
    integer(int32), private :: wanted = 1          !! domains
    integer, private :: holder = 0                 !! of the events predicted: nobody, the plain engine, the domains
    real(real64), private :: rate = 0.0_real64     !! of events [1/time]
    real(real64), private :: shortening = 1.0_real64   !! of windows, after failures
    integer(int32), private :: widening = 0        !! of the halo, after failures
    integer(int64), private :: plain_until = -1    !! number of events up to which the plain engine goes on
  contains
    procedure :: start
    procedure :: advance
    procedure, private :: advance_plainly
    procedure, private :: end_epoch
    procedure, private :: visit
  end type parallel_events_t

  integer, parameter :: nobody = 0, plain_engine = 1, all_domains = 2

contains

  !> Events are predicted when it is clear by whom.
  subroutine start(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    self%holder = nobody
    self%idle = .false.
    self%wanted = min(self%threads, sim%n_disks()/(self%least_disks*merge(2, 1, all(sim%box%periodic))))
    if (self%wanted > 0) self%wanted = self%wanted*max(sim%n_disks()/self%most_disks/self%wanted, 1)
    call sim%start_sums()
    if (.not. sim%epoch_end > 0) call begin_first_epoch(sim)
  end subroutine start

  !> Goes on to a limit, or for as long as the caller can wait.
  subroutine advance(self, sim, limits, error)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(limits_t) :: goal
    logical :: held

    if (limits%reached(sim) .or. self%log%is_full()) return
    held = worthwhile(self, sim, limits)
    if (held .and. sim%now >= sim%epoch_end .and. limits%time - sim%epoch > sim%epoch_end) then
      held = .not. stands_still(sim)
      if (held) call self%end_epoch(sim)
      if (held .and. limits%epochs) return
    end if
    goal = limits
    goal%time = min(limits%time - sim%epoch, sim%epoch_end)
    goal%events = min(limits%events, most_events(sim))
    goal%dissipated = limits%dissipated - abs(limits%dissipated)*rounding
    held = held .and. goal%time > sim%now
    if (held) then
      call self%visit(sim, goal, held)
      if (.not. held) self%plain_until = sim%events + plain_events*sim%n_disks()
    end if
    if (.not. held) then
      call self%advance_plainly(sim, limits, error)
    else if (sim%events >= most_events(sim)) then
      call self%end_epoch(sim)
    end if
  end subroutine advance

  !> Begins the next epoch, with all events to be predicted again.
  subroutine end_epoch(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    if (self%wanted > self%threads .and. allocated(self%domain)) deallocate (self%domain)  ! to leave room for sorting many
    call move_epoch(sim)
    self%holder = nobody
    self%widening = max(self%widening - 1, 0)
  end subroutine end_epoch

  !> Lets the plain engine go on for a while.
  subroutine advance_plainly(self, sim, limits, error)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error

    if (allocated(self%domain)) deallocate (self%domain)
    if (.not. allocated(self%engine)) allocate (self%engine, source=self%plain)
    if (self%holder /= plain_engine) call self%engine%start(sim)
    self%holder = plain_engine
    self%engine%log = self%log
    call self%engine%advance(sim, limits, error)
    self%log = self%engine%log
    self%idle = self%engine%idle
  end subroutine advance_plainly

  !> Whether several domains can be faster than the plain engine.
  pure function worthwhile(self, sim, limits) result(yes)
    class(parallel_events_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    logical :: yes
    real(real64) :: least

    least = merge(least_left, least_left_to_begin, self%holder == all_domains)*sim%n_disks()
    yes = self%wanted > 1 .and. sim%events >= self%plain_until .and. limits%events - sim%events > least &
      .and. limits%collisions - sim%collisions > least
  end function worthwhile

  !> Moves on by some windows of time. `held`: it could; else the state is as before, and the plain engine must go on.
  subroutine visit(self, sim, goal, held)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    logical, intent(out) :: held
    type(event_log_t) :: merged
    real(real64) :: began, t
    integer(int32) :: k
    integer :: w
    logical :: good

    began = seconds()
    if (self%holder /= all_domains) call load_all(self, sim)
    held = self%cuts%n > 1
    if (.not. held) return
    self%holder = all_domains
    do k = 1, self%cuts%n
      call keep_log(self%domain(k), self%log%is_on())
    end do
    t = sim%now
    do w = 1, most_windows
      call run_window(self, sim, goal, t, good)
      if (.not. good .or. .not. t < goal%time .or. .not. left(sim, self%domain, goal) > 0) exit
      if (stop_requested()) exit
      if (seconds() - began > longest_visit) exit
    end do
    if (good .and. self%log%is_on()) call merge_logs(self%domain, merged, good)
    if (good) held = sim%dissipated%value() + sum(self%domain%sim%dissipated%value()) < goal%dissipated &
      .and. t - sim%last_advance >= sim%blink      ! else the plain engine looks for a collapse
    if (good .and. held) then
      call gather_all(self, sim, t)
      ! Not before: windows that the next failure throws away could make up for each halving, for ever.
      self%shortening = min(1.0_real64, 1.1_real64**w*self%shortening)
      if (self%log%is_on()) call append_log(self%log, sim%epoch, merged)
      if (all(self%domain%engine%idle)) self%plain_until = sim%events + 1
    else
      self%holder = nobody
      self%shortening = 0.5_real64*self%shortening
      held = held .and. self%shortening > shortest
    end if
    if (.not. held) self%shortening = 1
  end subroutine visit

  !> When the next window ends.
  pure function window_end(self, sim, t, t_limit) result(t_end)
    class(parallel_events_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t, t_limit         !! since the epoch [time]
    real(real64) :: t_end, length

    length = self%window*self%shortening*sim%n_disks()/(2*rate_of(self, sim))
    if (self%wanted > self%threads) length = 2*length      ! a cache takes in each domain once in a window
    t_end = t + length
    if (t_end + 0.5_real64*length > t_limit) t_end = t_limit
  end function window_end

  !> Events in a time, generously.
  pure function expected(self, sim, length) result(events)
    class(parallel_events_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: length             !! [time]
    real(real64) :: events

    events = 1.2_real64*length*rate_of(self, sim) + 100
  end function expected

  !> Events that may still come before a count is at its limit.
  pure function left(sim, domain, goal) result(events)
    type(simulation_t), intent(in) :: sim
    type(domain_t), intent(in) :: domain(:)
    type(limits_t), intent(in) :: goal
    real(real64) :: events

    events = min(real(goal%events - sim%events - sum(domain%sim%events), real64), &
      real(goal%collisions - sim%collisions - sum(domain%sim%collisions), real64))
  end function left

  !> Events per time that are to be expected.
  pure function rate_of(self, sim) result(rate)
    class(parallel_events_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64) :: rate

    rate = self%rate
    if (.not. rate > 0) rate = 10*sim%n_disks()/(sim%epoch_end - sim%epoch_begin)
  end function rate_of

  !> Fills all domains.
  subroutine load_all(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(patch_t) :: whole
    integer(int16), allocatable :: cell(:, :)
    integer(int32) :: i, k

    whole = whole_box(sim)
    self%cuts%n = 1
    if (whole%small < maxval(sim%disk%radius)) return
    allocate (cell(2, sim%n_disks()))
    !$omp parallel do num_threads(self%threads)
    do i = 1, sim%n_disks()
      cell(:, i) = int(whole%cell_at(sim%position(i)), int16)
    end do
    !$omp end parallel do
    call self%cuts%cut(whole, sim%box%periodic, cell, self%wanted, self%threads, &
      self%halo + self%widening + merge(2, 0, self%wanted > self%threads))
    if (self%cuts%n < 2) return
    if (allocated(self%engine)) deallocate (self%engine)
    if (allocated(self%domain)) then
      if (size(self%domain) /= self%cuts%n) deallocate (self%domain)
    end if
    if (.not. allocated(self%domain)) allocate (self%domain(self%cuts%n))
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      associate (domain => self%domain(k))
        domain%patch = self%cuts%patch_of(k, sim%box%periodic)
        domain%halo = self%cuts%halo
        domain%low = self%cuts%low(:, k)
        domain%high = self%cuts%high(:, k)
        domain%neighbour = self%cuts%neighbours_of(k, domain%patch)
        call load(domain, sim, cell)
      end associate
    end do
    !$omp end parallel do
  end subroutine load_all

  !> Runs one window in all domains, which first take over what came of the one before. It ends early at the limit of a
  !> count. `good`: it holds.
  subroutine run_window(self, sim, goal, t, good)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    real(real64), intent(inout) :: t               !! since the epoch [time]
    logical, intent(out) :: good
    integer(int64) :: events
    integer(int32) :: k
    real(real64) :: t_begin, t_end

    events = sum(self%domain%sim%events)
    t_begin = t
    t_end = window_end(self, sim, t, goal%time)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call refresh(self%domain(k))
    end do
    !$omp end parallel do
    do
      call stride(self, sim, goal, t, t_end)
      good = all(self%domain%done)
      if (.not. (good .and. t < t_end .and. left(sim, self%domain, goal) > 0)) exit
    end do
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call verify(self%domain, k)
    end do
    !$omp end parallel do
    good = all(self%domain%good) .and. left(sim, self%domain, goal) >= 0     ! else several at the last moment
    self%windows_done = self%windows_done + 1
    if (.not. good) then
      self%windows_failed = self%windows_failed + 1
      self%widening = min(self%widening + 2, self%halo)
    else if (t > t_begin) then
      self%rate = max(sum(self%domain%sim%events) - events, 1_int64)/(t - t_begin)
    end if
  end subroutine run_window

  !> Lets all domains go on, to the end of the window unless a count would pass its limit: then most of the way there and,
  !> in the end, from event to event.
  subroutine stride(self, sim, goal, t, t_end)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal
    real(real64), intent(inout) :: t               !! since the epoch [time]
    real(real64), intent(in) :: t_end              !! likewise
    integer(int64) :: turns                        ! of one engine, of which some collisions take several
    integer(int32) :: k
    real(real64) :: sure, t_next
    logical :: stepping

    turns = int(turns_per_event*expected(self, sim, t_end - t), int64)
    t_next = t_end
    sure = left(sim, self%domain, goal)
    stepping = .false.
    if (sure <= expected(self, sim, t_end - t)) then
      sure = 0.9_real64*sure - 5*sqrt(sure)
      stepping = sure < few_events
      if (stop_requested()) stepping = .false.     ! see `advance` of the engine
      if (stepping) then
        do k = 1, self%cuts%n
          t_next = min(t_next, next_time(self%domain(k)))
        end do
      else
        t_next = min(t_next, t + sure/rate_of(self, sim))
      end if
    end if
    !$omp parallel do schedule(static, 1) num_threads(self%threads) if (.not. stepping)
    do k = 1, self%cuts%n
      call move_on(self%domain(k), t_next, turns)
    end do
    !$omp end parallel do
    t = t_next
  end subroutine stride

  !> Adds collisions to a log.
  pure subroutine append_log(log, epoch, more)
    type(event_log_t), intent(inout) :: log
    real(real64), intent(in) :: epoch              !! [time]
    type(event_log_t), intent(in) :: more          !! with times since the epoch
    integer :: k

    do k = 1, more%n
      call log%append_record([epoch + more%record(1, k), more%record(2:, k)])
    end do
  end subroutine append_log

  !> Brings the whole simulation to the present; the domains go on from there.
  subroutine gather_all(self, sim, now)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: now                !! since the epoch [time]
    integer(int32) :: k

    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call gather(self%domain(k), sim)
    end do
    !$omp end parallel do
    sim%now = now
    do k = 1, self%cuts%n
      associate (own => self%domain(k)%sim)
        sim%events = sim%events + own%events
        sim%collisions = sim%collisions + own%collisions
        sim%wall_collisions = sim%wall_collisions + own%wall_collisions
        sim%obstacle_collisions = sim%obstacle_collisions + own%obstacle_collisions
        sim%virial%units = sim%virial%units + own%virial%units
        sim%dissipated%units = sim%dissipated%units + own%dissipated%units
        sim%wall_impulse%units = sim%wall_impulse%units + own%wall_impulse%units
      end associate
      call clear_sums(self%domain(k), sim)
    end do
  end subroutine gather_all

end module parallel_events
