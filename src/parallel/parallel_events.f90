!> Parallel event-driven dynamics, on several cores, or on one core with domains that fit into its
!> cache. The results are bit-identical to the results of the serial engine. The box is divided into
!> domains, each with its own engine. The domains advance independently through one time window and
!> are then compared (see `partition` and `domains`). If a window is invalid, the simulation returns
!> to its state before the present series of windows. The serial engine takes over for small or
!> inactive systems, for a stop between simultaneous collisions, and in an inelastic collapse.
module parallel_events
  use kinds, only: int32, int64, real64
  use domains, only: merge_logs
  use epochs, only: begin_first_epoch, most_events
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use event_log, only: event_log_t, is_full
  use evolution, only: evolution_t, limits_t
  use partition, only: partition_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: parallel_events_t

  integer, parameter :: most_windows = 24      !! maximum number of windows in one call of `run_domains`
  !> Minimum length of a window, relative to the usual length.
  real(real64), parameter :: shortest = 0.1_real64
  !> Domains pay off if at least this number of events per disk remains before the next limit:
  !> `least_left` if domains are in use, otherwise `least_left_to_begin`.
  real(real64), parameter :: least_left = 0.25_real64, least_left_to_begin = 2.0_real64
  !> Minimum and maximum length of a period of the serial engine that begins because domains cannot
  !> be used: a limit or an inelastic collapse was reached, or no event is left [events per disk].
  integer(int64), parameter :: brief(2) = 5
  !> Minimum and maximum length of a period of the serial engine after invalid windows [events per
  !> disk].
  integer(int64), parameter :: after_failures(2) = [5, 5*2**20]
  !> Minimum and maximum length of a period of the serial engine while other programs use the cores
  !> [events per disk].
  integer(int64), parameter :: while_busy(2) = [50, 1600]

  !> Values of `predicted_by`: the engine that predicted the events.
  integer, parameter :: no_engine = 0, serial_engine = 1, all_domains = 2

  type, extends(evolution_t) :: parallel_events_t
    !> Template of the serial engine, copied when the serial engine is needed.
    type(event_driven_t) :: serial
    type(partition_t) :: parts
    !> Minimum number of disks in a domain. The minimum is twice as large in a periodic box, where
    !> domains have neighbours on all sides.
    integer(int32) :: least_disks = 1250
    !> Maximum number of disks in a domain that fits into the cache.
    integer(int32) :: most_disks = 62000
    !> Average number of active cores below which the serial engine is faster than several threads.
    real(real64) :: least_cores = 1.25_real64
    integer(int64) :: windows_done = 0, windows_failed = 0
    ! To save memory, the serial engine exists only while there are no domains.
    type(event_driven_t), allocatable, private :: engine   !! the serial engine in use
    integer, private :: predicted_by = no_engine   !! engine with the predicted events
    !> Length of the last period of the serial engine [events per disk].
    integer(int64), private :: serial_period = 0
    !> Total number of events at the end of the last period of the serial engine.
    integer(int64), private :: serial_until = -1
  contains
    procedure :: start
    procedure :: renew
    procedure :: advance
    procedure :: most_domains
  end type parallel_events_t

contains

  !> Prepares a run. No events are predicted yet, because the engine that will execute them is
  !> unknown.
  subroutine start(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    self%predicted_by = no_engine
    self%idle = .false.
    if (.not. self%parts%cores > 0) self%parts%cores = self%parts%threads
    self%parts%widening = max(self%parts%widening - 1, 0)
    associate (wanted => self%parts%wanted)
      wanted = min(self%parts%threads, self%most_domains(sim%n_disks(), sim%box%periodic))
      if (wanted > 0) wanted = wanted*max(sim%n_disks()/self%most_disks/wanted, 1)
    end associate
    call sim%start_sums()
    if (.not. sim%epoch_end > 0) call begin_first_epoch(sim)
  end subroutine start

  !> Updates the predicted events after changes of disks. The serial engine predicts only the events
  !> of these disks anew. The domains cannot be updated in part, so all disks are loaded into them
  !> again.
  subroutine renew(self, sim, changed)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)

    self%idle = .false.
    if (self%predicted_by == serial_engine) then
      call self%engine%renew(sim, changed)
    else
      self%predicted_by = no_engine
    end if
  end subroutine renew

  !> Maximum number of domains, and therefore of threads, for which the work on ghosts pays off.
  pure function most_domains(self, n_disks, periodic) result(n)
    class(parallel_events_t), intent(in) :: self
    integer(int32), intent(in) :: n_disks
    logical, intent(in) :: periodic(2)
    integer(int32) :: n

    n = n_disks/(self%least_disks*merge(2, 1, all(periodic)))
  end function most_domains

  !> Advances the simulation until a limit is reached, or until the caller has to check signals
  !> again.
  subroutine advance(self, sim, limits, error, log)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    logical :: serially                            ! whether the serial engine is used

    self%arrived = .false.
    if (limits%reached(sim%tally) .or. is_full(log)) return
    serially = .not. domains_pay(self, sim, limits)
    if (.not. serially) then
      call run_domains(self, sim, limits, log)
      serially = sim%tally%events < self%serial_until        ! selected by `run_domains`
    end if
    if (serially) call advance_serially(self, sim, limits, error, log)
    if (self%parts%wanted > self%parts%threads .and. allocated(self%parts%domain) .and. &
      (sim%now >= sim%epoch_end .or. sim%tally%events >= most_events(sim))) then
      deallocate (self%parts%domain)               ! sorting the disks requires the memory of the domains
      self%predicted_by = no_engine
    end if
  end subroutine advance

  !> True if several domains can be faster than the serial engine.
  pure function domains_pay(self, sim, limits) result(yes)
    class(parallel_events_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    logical :: yes
    real(real64) :: least

    least = merge(least_left, least_left_to_begin, self%predicted_by == all_domains)*sim%n_disks()
    yes = self%parts%wanted > 1 .and. sim%tally%events >= self%serial_until .and. limits%events - sim%tally%events > least &
      .and. limits%collisions - sim%tally%collisions > least .and. limits%time > sim%now
  end function domains_pay

  !> Advances the domains by several windows. If a window is invalid, the simulation keeps its state
  !> from before the call, and the next call tries shorter windows.
  subroutine run_domains(self, sim, limits, log)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(event_log_t), intent(inout), optional :: log
    real(real64) :: t
    integer :: windows, listed
    logical :: good, too_far

    listed = 0
    if (self%predicted_by /= all_domains) then
      if (allocated(self%engine)) deallocate (self%engine)
      self%predicted_by = no_engine
      call self%parts%fill(sim, present(log), good)
      if (.not. good) call use_serial_engine(self, sim, brief)
      if (.not. good) return
      self%predicted_by = all_domains
    end if
    call self%parts%run_windows(sim, limits, most_windows_now(self), t, windows, good)
    self%windows_done = self%windows_done + windows
    if (present(log)) then
      listed = log%n
      if (good) call merge_logs(self%parts%domain, log, good)
    end if
    ! Only the serial engine finds the exact event at which a limit is reached, and examines
    ! collisions that may be part of a collapse.
    too_far = good
    if (good) too_far = limits%outgrown(self%parts%total_tally(sim)) .or. t - sim%last_advance < sim%negligible_time &
      .or. any(self%parts%domain%sim%tally%unexamined > 0)
    if (good .and. .not. too_far) then
      call self%parts%write_back_all(sim, t)
      self%arrived = t >= limits%time
    else
      self%predicted_by = no_engine
      if (present(log)) log%n = listed
    end if
    if (.not. good) call shorten_windows(self, sim)
    if (good) call lengthen_windows(self, windows)
    if (too_far) call use_serial_engine(self, sim, brief)
    if (self%predicted_by == no_engine) return
    if (self%parts%threads > 1 .and. self%parts%cores <= self%least_cores) then
      call use_serial_engine(self, sim, while_busy)
      self%parts%cores = self%parts%threads
    end if
    ! The serial engine determines whether any further event will occur.
    if (all(self%parts%domain%engine%idle)) call use_serial_engine(self, sim, brief)
  end subroutine run_domains

  !> Maximum number of windows in the next call of `run_domains`. The number is reduced after
  !> invalid windows, because one invalid window invalidates all windows of a call.
  pure function most_windows_now(self) result(n)
    class(parallel_events_t), intent(in) :: self
    integer :: n

    n = max(1, int(most_windows*self%parts%shortening**4))
  end function most_windows_now

  !> Lengthens the windows after a call in which all were valid. Within a call the length is
  !> constant. A growing length could make the last window of every call invalid. Since one invalid
  !> window invalidates all windows of a call, the run would then make no progress.
  pure subroutine lengthen_windows(self, windows)
    class(parallel_events_t), intent(inout) :: self
    integer, intent(in) :: windows               !! number of windows in the last call

    associate (shortening => self%parts%shortening)
      shortening = min(1.0_real64, 1.1_real64**windows*shortening)
    end associate
  end subroutine lengthen_windows

  !> Shortens the windows after an invalid one. If the windows already have the minimum length, the
  !> serial engine is selected for a period.
  subroutine shorten_windows(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%windows_failed = self%windows_failed + 1
    associate (shortening => self%parts%shortening)
      shortening = 0.5_real64*shortening
      if (shortening > shortest) return
      shortening = shortest
    end associate
    call use_serial_engine(self, sim, after_failures)
  end subroutine shorten_windows

  !> Selects the serial engine for a period. The period is twice as long as the previous one, unless
  !> the domains have meanwhile executed more events than the serial engine executed in the previous
  !> period. Owing to this doubling, a run that is unsuitable for domains takes hardly longer than
  !> on the serial engine alone.
  subroutine use_serial_engine(self, sim, periods)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: periods(2)      !! minimum and maximum period [events per disk]

    if (sim%tally%events - self%serial_until > self%serial_period*sim%n_disks()) self%serial_period = 0
    self%serial_period = min(max(2*self%serial_period, periods(1)), periods(2))
    self%serial_until = sim%tally%events + self%serial_period*sim%n_disks()
  end subroutine use_serial_engine

  !> Advances the simulation with the serial engine, at most to the end of the selected period.
  subroutine advance_serially(self, sim, limits, error, log)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    type(limits_t) :: goal
    integer(int64) :: events
    real(real64) :: time

    if (allocated(self%parts%domain)) deallocate (self%parts%domain)
    if (.not. allocated(self%engine)) allocate (self%engine, source=self%serial)
    if (self%predicted_by /= serial_engine) call self%engine%start(sim)
    self%predicted_by = serial_engine
    goal = limits
    if (sim%tally%events < self%serial_until) goal%events = min(limits%events, self%serial_until)
    events = sim%tally%events
    time = sim%time()
    call self%engine%advance(sim, goal, error, log)
    self%serial_events = self%serial_events + sim%tally%events - events
    self%idle = self%engine%idle
    self%arrived = self%engine%arrived
    self%last_event = self%engine%last_event
    self%iterations_left = self%engine%iterations_left
    if (sim%tally%events - events >= sim%n_disks()) &
      call self%parts%update_rates(sim%tally%events - events, goal%iterations - self%iterations_left, sim%time() - time)
  end subroutine advance_serially

end module parallel_events
