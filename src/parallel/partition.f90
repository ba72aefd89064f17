!> A simulation divided into domains, which advance together by time windows. Each domain predicts
!> and stores the events of the disks in its extended domain. The whole simulation, `sim`, keeps its
!> old state until the states are copied back from the domains. After an invalid window, the states
!> of the domains are wrong, and all domains must be loaded again.
module partition
  use kinds, only: int16, int32, int64, real64
  use cell_layout, only: cell_layout_t, whole_box
  use domain_borders, only: compare_ghosts, correct_ghosts
  use domain_cuts, only: domain_cuts_t
  use domains, only: advance_domain, domain_t, load, next_time, write_back
  use evolution, only: limits_t
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use system, only: seconds
  use tally, only: tally_t
  use team, only: barrier_t, close_barrier, is_last_at, join, many, open_barrier, release
  implicit none
  private
  public :: partition_t

  !> Wall-clock time after which `run_windows` returns, so that the caller can check signals [s].
  real(real64), parameter :: longest_call = 1.0_real64
  real(real64), parameter :: averaging_time = 0.1_real64  !! averaging time for the number of active cores [s]
  !> Number of events before a limit below which the domains advance one event at a time.
  real(real64), parameter :: few_events = 20.0_real64

  !> The next step of all threads, chosen by one thread while the others wait.
  type :: plan_t
    logical :: continues = .true.
    integer :: windows = 0                         !! number of windows started
    !> Wall-clock time after which no further window is started [s].
    real(real64) :: until = 0.0_real64
    !> Start and end of the window, relative to `box%epoch` [time].
    real(real64) :: t_begin = 0.0_real64, t_end = 0.0_real64
    integer(int64) :: events = 0      !! number of events in the domains at the start of the window
    !> Whether domains first apply the corrections of the previous window.
    logical :: corrects = .false.
    real(real64) :: t = 0.0_real64      !! time to which domains advance, relative to `box%epoch` [time]
    integer(int64) :: iterations = 0               !! maximum number of iterations of an engine in this step
    logical :: compares = .false.      !! whether the window ends with this step and domains are compared
    logical :: valid = .true.                      !! whether the window is valid
  end type plan_t

  type :: partition_t
    integer(int32) :: threads = 1
    integer(int32) :: wanted = 1                   !! number of domains
    real(real64) :: window = 0.5_real64            !! length of a window [collisions per disk]
    integer(int32) :: halo = 6                     !! width of the halo around a domain [cells]
    !> Maximum number of iterations of one engine in a step, relative to the number expected in all
    !> domains together.
    real(real64) :: overload = 4.0_real64
    type(cell_layout_t) :: whole                   !! block of all cells of the box, constant during a run
    type(domain_cuts_t) :: cuts
    type(domain_t), allocatable :: domain(:)
    real(real64) :: event_rate = 0.0_real64        !! events per unit of time; 0 if not known yet [1/time]
    real(real64) :: iterations_per_event = 10.0_real64  !! number of iterations of an engine per event
    !> Factor by which invalid windows have shortened the later ones.
    real(real64) :: shortening = 1.0_real64
    !> Increase of the halo width after invalid windows [cells].
    integer(int32) :: widening = 0
    !> Recent average of the number of active cores; 0 if not known yet.
    real(real64) :: cores = 0.0_real64
  contains
    procedure :: fill
    procedure :: run_windows
    procedure :: update_rates
    procedure :: total_tally
    procedure :: write_back_all
  end type partition_t

contains

  !> Divides a simulation into domains and loads them. `cut` is .false. if there would be fewer than
  !> two domains.
  subroutine fill(self, sim, listing, cut)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: listing                 !! whether collisions are logged
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
    if (.not. self%event_rate > 0) self%event_rate = 10*sim%n_disks()/(sim%epoch_end - sim%epoch_begin)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      associate (domain => self%domain(k))
        domain%layout = self%cuts%layout_of(k, sim%box%periodic)
        domain%halo = self%cuts%halo
        domain%low = self%cuts%low(:, k)
        domain%high = self%cuts%high(:, k)
        domain%neighbour = self%cuts%neighbours_of(k, domain%layout)
        if (listing .and. .not. allocated(domain%log)) allocate (domain%log)
        call load(domain, sim, pack([(i, i=1, sim%n_disks())], domain%layout%covers(cell)))
      end associate
    end do
    !$omp end parallel do
  end subroutine fill

  !> Updates the measured event rate, which determines the length of windows, and the measured
  !> number of iterations per event. The limit of iterations is proportional to the product of these
  !> two numbers.
  pure subroutine update_rates(self, events, iterations, time)
    class(partition_t), intent(inout) :: self
    integer(int64), intent(in) :: events, iterations
    real(real64), intent(in) :: time               !! [time]

    if (.not. (events > 0 .and. time > 0)) return
    self%event_rate = events/time
    self%iterations_per_event = max(iterations/real(events, real64), 1.0_real64)
  end subroutine update_rates

  !> Counters and sums of the whole simulation, including collisions in the domains since they were
  !> loaded.
  pure function total_tally(self, sim) result(so_far)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(tally_t) :: so_far
    integer(int32) :: k

    so_far = sim%tally
    do k = 1, self%cuts%n
      call so_far%include(self%domain(k)%sim%tally)
    end do
  end function total_tally

  !> Executes successive windows in all domains, until a window is invalid, a limit is reached, or
  !> `longest_call` has passed. A window ends early if the number of events or collisions reaches
  !> its limit. `good` is .true. if all windows are valid.
  !>
  !> The threads wait for each other twice per window. All domains must have reached the end of the
  !> window before they are compared, and all comparisons must be complete before any state is
  !> changed.
  subroutine run_windows(self, sim, limits, most, t, windows, good)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    integer, intent(in) :: most                    !! maximum number of windows
    real(real64), intent(out) :: t                 !! end of the last window, relative to `box%epoch` [time]
    integer, intent(out) :: windows                !! number of windows started
    logical, intent(out) :: good
    type(plan_t) :: plan
    type(barrier_t) :: barrier
    real(real64) :: began, elapsed, cpu(2)         ! [s]
    integer(int32) :: k

    began = seconds()
    call cpu_time(cpu(1))
    plan%until = began + longest_call
    plan%t = sim%now
    call begin_window(self, sim, limits, plan)
    call open_barrier(barrier)
    !$omp parallel num_threads(self%threads) private(k)
    call join(barrier)
    !$omp barrier
    do while (plan%continues)
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        if (plan%corrects) call correct_ghosts(self%domain(k))
        call advance_domain(self%domain(k), plan%t, plan%iterations)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        plan%corrects = .false.
        plan%compares = stop_requested()
        if (.not. plan%compares) plan%compares = .not. (all(self%domain%done) .and. plan%t < plan%t_end &
          .and. events_left(self, sim, limits) > 0)
        if (.not. plan%compares) call choose_target(self, sim, limits, plan)
        call release(barrier)
      end if
      !$omp flush
      if (.not. plan%compares) cycle
      !$omp do schedule(static, 1)
      do k = 1, self%cuts%n
        call compare_ghosts(self%domain, k)
      end do
      !$omp end do nowait
      if (is_last_at(barrier)) then
        call end_window(self, sim, limits, most, plan)
        call release(barrier)
      end if
      !$omp flush
    end do
    !$omp end parallel
    call close_barrier(barrier)
    call cpu_time(cpu(2))
    elapsed = seconds() - began
    self%cores = self%cores + (cpu(2) - cpu(1) - elapsed*self%cores)/max(elapsed, averaging_time)
    t = plan%t
    windows = plan%windows
    good = plan%valid
  end subroutine run_windows

  !> Starts the next window.
  subroutine begin_window(self, sim, limits, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    type(plan_t), intent(inout) :: plan
    real(real64) :: length

    length = self%window*self%shortening*sim%n_disks()/(2*self%event_rate)
    ! With more domains than threads, each domain is loaded into the cache once per window. Longer
    ! windows need fewer such loads.
    if (self%wanted > self%threads) length = 2*length
    plan%windows = plan%windows + 1
    plan%t_begin = plan%t
    plan%t_end = plan%t + length
    if (plan%t_end + 0.5_real64*length > limits%time) plan%t_end = limits%time
    plan%events = sum(self%domain%sim%tally%events)
    plan%corrects = .true.
    self%domain%iterations = 0
    call choose_target(self, sim, limits, plan)
  end subroutine begin_window

  !> Chooses the time to which all domains advance next. This is the end of the window, unless the
  !> number of events or collisions would exceed its limit earlier. Near a limit the domains first
  !> execute most of the remaining events together. Finally they execute single events. The limit of
  !> iterations bounds the work of each engine in case the estimated event rate is wrong.
  subroutine choose_target(self, sim, limits, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    type(plan_t), intent(inout) :: plan
    real(real64) :: expected, sure, next
    integer(int32) :: k

    expected = 1.2_real64*(plan%t_end - plan%t)*self%event_rate + 100  ! overestimated
    plan%iterations = int(min(self%overload*self%iterations_per_event*expected, 1.0e15_real64), int64)
    sure = events_left(self, sim, limits)
    next = plan%t_end
    if (sure <= expected) then
      sure = 0.9_real64*sure - 5*sqrt(sure)
      if (sure >= few_events) then
        next = plan%t + sure/self%event_rate
      else
        do k = 1, self%cuts%n
          next = min(next, next_time(self%domain(k)))
        end do
      end if
    end if
    plan%t = min(next, plan%t_end)
  end subroutine choose_target

  !> Determines, after the comparison of the domains, whether the window is valid and whether
  !> another window is started.
  subroutine end_window(self, sim, limits, most, plan)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    integer, intent(in) :: most                    !! maximum number of windows
    type(plan_t), intent(inout) :: plan

    ! `events_left` is negative if simultaneous events have exceeded the limit of events or
    ! collisions.
    plan%valid = all(self%domain%done) .and. all(self%domain%valid) .and. events_left(self, sim, limits) >= 0
    if (plan%valid) then
      call self%update_rates(sum(self%domain%sim%tally%events) - plan%events, sum(self%domain%iterations), plan%t - plan%t_begin)
    else
      self%widening = min(self%widening + 2, self%halo)
    end if
    plan%continues = seconds() < plan%until
    if (plan%continues) plan%continues = plan%valid .and. plan%windows < most .and. plan%t < limits%time &
      .and. events_left(self, sim, limits) > 0
    if (plan%continues) call begin_window(self, sim, limits, plan)
  end subroutine end_window

  !> Number of events that can be executed before the number of events or collisions reaches its
  !> limit.
  pure function events_left(self, sim, limits) result(events)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    real(real64) :: events

    events = min(real(limits%events - sim%tally%events - sum(self%domain%sim%tally%events), real64), &
      real(limits%collisions - sim%tally%collisions - sum(self%domain%sim%tally%collisions), real64))
  end function events_left

  !> Copies the present states of the domains to the whole simulation. The domains stay in memory,
  !> so that the run can be continued.
  subroutine write_back_all(self, sim, now)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: now                !! relative to `box%epoch` [time]
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
