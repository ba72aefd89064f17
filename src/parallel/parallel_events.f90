!> Event-driven dynamics on several cores, or on one whose cache takes in a part of the disks at a time, with every
!> bit of the plain engine. Space is cut into domains; each has an engine of its own, and they compare at the end of
!> every window of time (see `partition`, `domains`). If a window does not hold, all go back to the state in which they
!> set out. What is rare and awkward is left to the plain engine: small or idle systems, a moment within simultaneous
!> collisions, a collapse.
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

  integer, parameter :: most_windows = 24                      !! of a visit
  real(real64), parameter :: shortest = 0.1_real64             !! window to be tried, in usual ones
  !> Events per disk that are to come before a count is at its limit, for several domains to go on, or to begin.
  real(real64), parameter :: least_left = 0.25_real64, least_left_to_begin = 2.0_real64
  ! Shortest and longest spell of the plain engine [events per disk].
  integer(int64), parameter :: moment(2) = 5                        !! to pass what domains cannot
  integer(int64), parameter :: failing(2) = [5, 5*2**20]            !! while windows do not hold
  integer(int64), parameter :: busy(2) = [50, 1600]                 !! while cores are busy

  !> Who has predicted the events.
  integer, parameter :: nobody = 0, plain_engine = 1, all_domains = 2

  type, extends(evolution_t) :: parallel_events_t
    type(event_driven_t) :: plain                  !! an engine for all that is not worth more; it is copied to run
    type(partition_t) :: parts
    integer(int32) :: least_disks = 1250           !! of a domain; twice as many in a periodic box, which has twice as many cuts
    integer(int32) :: most_disks = 62000           !! likewise, if it is to fit into caches
    real(real64) :: least_cores = 1.25_real64      !! that several threads must have had of late: else one is faster
    integer(int64) :: windows_done = 0, windows_failed = 0
    ! To save memory this engine is there only while there are no domains.
    type(event_driven_t), allocatable, private :: engine   !! the plain one at work
    integer, private :: holder = nobody            !! of the events predicted
    integer(int64), private :: spell = 0           !! of the plain engine, the last time [events per disk]
    integer(int64), private :: plain_until = -1    !! number of events up to which the plain engine goes on
  contains
    procedure :: start
    procedure :: renew
    procedure :: advance
    procedure :: most_domains
  end type parallel_events_t

contains

  !> Events are predicted when it is clear by whom.
  subroutine start(self, sim)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    self%holder = nobody
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

  !> Only the plain engine can go on with its events; domains are filled again.
  subroutine renew(self, sim, changed)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)

    self%idle = .false.
    if (self%holder == plain_engine) then
      call self%engine%renew(sim, changed)
    else
      self%holder = nobody
    end if
  end subroutine renew

  !> How many domains are worth their copies, and so how many threads find something to do.
  pure function most_domains(self, n_disks, periodic) result(n)
    class(parallel_events_t), intent(in) :: self
    integer(int32), intent(in) :: n_disks
    logical, intent(in) :: periodic(2)
    integer(int32) :: n

    n = n_disks/(self%least_disks*merge(2, 1, all(periodic)))
  end function most_domains

  !> Goes on to a limit, or for as long as the caller can wait.
  subroutine advance(self, sim, limits, error, log)
    class(parallel_events_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    logical :: plainly                             ! the plain engine goes on

    self%arrived = .false.
    if (limits%reached(sim%tally) .or. is_full(log)) return
    plainly = .not. worthwhile()
    if (.not. plainly) call visit()
    if (plainly) call advance_plainly()
    if (self%parts%wanted > self%parts%threads .and. allocated(self%parts%domain) .and. &
      (sim%now >= sim%epoch_end .or. sim%tally%events >= most_events(sim))) then
      deallocate (self%parts%domain)               ! to leave room for sorting many
      self%holder = nobody
    end if
  contains

    !> Whether several domains can be faster than the plain engine.
    pure function worthwhile() result(yes)
      logical :: yes
      real(real64) :: least

      least = merge(least_left, least_left_to_begin, self%holder == all_domains)*sim%n_disks()
      yes = self%parts%wanted > 1 .and. sim%tally%events >= self%plain_until .and. limits%events - sim%tally%events > least &
        .and. limits%collisions - sim%tally%collisions > least .and. limits%time > sim%now
    end function worthwhile

    !> Lets the domains move on by some windows of time. If one of them does not hold the state stays as it was, and shorter
    !> windows are tried the next time.
    subroutine visit()
      real(real64) :: t
      integer :: windows, listed
      logical :: good, too_far

      listed = 0
      if (self%holder /= all_domains) then
        if (allocated(self%engine)) deallocate (self%engine)
        self%holder = nobody
        call self%parts%fill(sim, present(log), good)
        if (.not. good) call retire(moment)
        if (.not. good) return
        self%holder = all_domains
      end if
      call self%parts%run_windows(sim, limits, windows_of_visit(), t, windows, good)
      self%windows_done = self%windows_done + windows
      if (present(log)) then
        listed = log%n
        if (good) call merge_logs(self%parts%domain, log, good)
      end if
      ! The plain engine finds the very event at which a count is at its limit, or a collapse.
      too_far = good
      if (good) too_far = limits%outgrown(self%parts%tally_now(sim)) .or. t - sim%last_advance < sim%blink
      if (good .and. .not. too_far) then
        call self%parts%write_back_all(sim, t)
        self%arrived = t >= limits%time
      else
        self%holder = nobody
        if (present(log)) log%n = listed
      end if
      if (.not. good) call shorten_windows()
      if (good) call lengthen_windows(windows)
      if (too_far) call retire(moment)
      if (self%holder == nobody) return
      if (self%parts%threads > 1 .and. self%parts%cores <= self%least_cores) then
        call retire(busy)
        self%parts%cores = self%parts%threads
      end if
      ! The plain engine finds out whether nothing happens in the whole.
      if (all(self%parts%domain%engine%idle)) call retire(moment)
    end subroutine visit

    !> The number of windows that a failure may discard. It decreases with the number of recent failures.
    pure function windows_of_visit() result(n)
      integer :: n

      n = max(1, int(most_windows*self%parts%shortening**4))
    end function windows_of_visit

    !> Makes windows longer after a visit in which all held. Within a visit they stay as they are: windows that the next
    !> failure throws away could otherwise make up for each halving, for ever.
    subroutine lengthen_windows(windows)
      integer, intent(in) :: windows               !! of the visit

      associate (shortening => self%parts%shortening)
        shortening = min(1.0_real64, 1.1_real64**windows*shortening)
      end associate
    end subroutine lengthen_windows

    !> Makes windows shorter after one that did not hold. If that does not help the plain engine takes over.
    subroutine shorten_windows()
      self%windows_failed = self%windows_failed + 1
      associate (shortening => self%parts%shortening)
        shortening = 0.5_real64*shortening
        if (shortening > shortest) return
        shortening = shortest
      end associate
      call retire(failing)
    end subroutine shorten_windows

    !> Leaves the run to the plain engine for a spell: twice as long as the last one, unless domains have gone on for longer
    !> than that since. So a run that does not suit domains costs hardly more than with the plain engine alone.
    subroutine retire(spells)
      integer(int64), intent(in) :: spells(2)      !! the shortest and the longest [events per disk]

      if (sim%tally%events - self%plain_until > self%spell*sim%n_disks()) self%spell = 0
      self%spell = min(max(2*self%spell, spells(1)), spells(2))
      self%plain_until = sim%tally%events + self%spell*sim%n_disks()
      plainly = .true.
    end subroutine retire

    !> Lets the plain engine go on for a while: where domains are to be tried again, to the end of its spell.
    subroutine advance_plainly()
      type(limits_t) :: goal
      integer(int64) :: events
      real(real64) :: time

      if (allocated(self%parts%domain)) deallocate (self%parts%domain)
      if (.not. allocated(self%engine)) allocate (self%engine, source=self%plain)
      if (self%holder /= plain_engine) call self%engine%start(sim)
      self%holder = plain_engine
      goal = limits
      if (sim%tally%events < self%plain_until) goal%events = min(limits%events, self%plain_until)
      events = sim%tally%events
      time = sim%time()
      call self%engine%advance(sim, goal, error, log)
      self%alone = self%alone + sim%tally%events - events
      self%idle = self%engine%idle
      self%arrived = self%engine%arrived
      self%last_event = self%engine%last_event
      self%turns_left = self%engine%turns_left
      if (sim%tally%events - events >= sim%n_disks()) &
        call self%parts%learn(sim%tally%events - events, goal%turns - self%turns_left, sim%time() - time)
    end subroutine advance_plainly
  end subroutine advance

end module parallel_events
