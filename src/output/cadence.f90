!> When samples are due: at multiples of a time, of a number of collisions or of a number of events, and at the start and
!> the end of a run. And how far the output has come.
module cadence
  use kinds, only: int64, never, real64
  use evolution, only: limits_t
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  use stop_rules, only: whole_collisions
  implicit none
  private
  public :: cadence_t, by_time, by_collisions, by_events, progress_t, frames, values

  !> What is counted.
  integer, parameter :: by_time = 1, by_collisions = 2, by_events = 3

  type :: cadence_t
    real(real64) :: every(3) = never              !! interval of time; of collisions and of events, whole or not
    integer(int64) :: count = 0                   !! samples taken; the first is due at once
    real(real64) :: next(3) = never               !! time, collisions and events at which the next are due
    real(real64) :: last_time = -1.0_real64       !! of the last sample [time]
    integer(int64) :: last_events = -1            !! that had happened then, collisions and kicks
  contains
    procedure :: is_due
    procedure :: is_new
    procedure :: take
    procedure :: look_ahead
    procedure :: tighten
    procedure :: planned
  end type cadence_t

  !> With the state, all that is needed to go on.
  type :: progress_t
    type(cadence_t) :: cadence(2)                 !! of frames and of values of the observables
    integer(int64) :: events = 0                  !! collisions written to the event log
  end type progress_t
  integer, parameter :: frames = 1, values = 2

  interface progress_t
    module procedure new_progress
  end interface progress_t

contains

  !> The progress of a run that has written nothing yet.
  pure function new_progress(settings) result(progress)
    type(settings_t), intent(in) :: settings
    type(progress_t) :: progress

    progress%cadence(frames)%every = intervals(settings%output%frames_every)
    progress%cadence(values)%every = intervals(settings%output%observables_every)
  contains

    !> Of time, of collisions in all or per disk, and of events.
    pure function intervals(every)
      real(real64), intent(in) :: every(:)        !! see `settings: sampled_by`
      real(real64) :: intervals(3)

      intervals = [every(1), min(every(2), 0.5_real64*settings%n_disks()*every(4)), every(3)]
    end function intervals
  end function new_progress

  !> Whether a sample is due now.
  elemental function is_due(self, sim) result(yes)
    class(cadence_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%has_reached(self%next(by_time)) &
      .or. any([sim%tally%collisions, sim%tally%events] >= self%next(by_collisions:))
  end function is_due

  !> Whether there is no sample of the present state yet.
  pure function is_new(self, sim) result(yes)
    class(cadence_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%time() > self%last_time .or. sim%tally%events + sim%kicks /= self%last_events
  end function is_new

  !> Counts a sample taken now.
  pure subroutine take(self, sim)
    class(cadence_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%count = self%count + 1
    self%last_time = sim%time()
    self%last_events = sim%tally%events + sim%kicks
    call self%look_ahead(sim)
  end subroutine take

  !> Finds when the next samples are due: at the first multiples ahead. This follows from the state alone, whenever
  !> the last sample was taken; but for one that is due now, when something may still happen.
  elemental subroutine look_ahead(self, sim)
    class(cadence_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical :: over                               ! the present moment, for samples

    over = sim%settled .or. self%last_time >= sim%time()
    self%next(by_time) = next_time(sim%time(), self%every(by_time), over)
    self%next(by_collisions:) = next_number([sim%tally%collisions, sim%tally%events], self%every(by_collisions:))
  end subroutine look_ahead

  !> Lowers the limits so that the simulation pauses at the next sample.
  pure subroutine tighten(self, limits)
    class(cadence_t), intent(in) :: self
    type(limits_t), intent(inout) :: limits

    limits%time = min(limits%time, self%next(by_time))
    limits%collisions = min(limits%collisions, whole_collisions(self%next(by_collisions)))
    limits%events = min(limits%events, whole_collisions(self%next(by_events)))
    limits%sampled = max(limits%sampled, self%last_time)
  end subroutine tighten

  !> The first multiple of an interval from a time on, or beyond it: a product, not a sum, so that it does not drift.
  pure function next_time(time, every, beyond) result(next)
    real(real64), intent(in) :: time, every       !! [time]
    logical, intent(in) :: beyond
    real(real64) :: next
    integer(int64) :: multiple

    next = never
    if (.not. every < never) return
    multiple = max(1_int64, int(time/every, int64))
    do while (multiple*every < time .or. (beyond .and. multiple*every <= time))
      multiple = multiple + 1
    end do
    next = multiple*every
  end function next_time

  !> The first number of collisions or events beyond n that reaches another multiple of an interval: where a run would end
  !> that is to have so many.
  elemental function next_number(n, every) result(next)
    integer(int64), intent(in) :: n
    real(real64), intent(in) :: every
    real(real64) :: next
    integer(int64) :: multiple

    next = merge(n + 1.0_real64, never, every < never)
    if (every <= 1 .or. .not. every < never) return
    multiple = int(n/every, int64)
    do while (whole_collisions(multiple*every) <= n)
      multiple = multiple + 1
    end do
    next = whole_collisions(multiple*every)
  end function next_number

  !> Number of samples of a run if it can be known in advance: there is at most one interval, and one rule of the same
  !> kind ends the run. Otherwise 0.
  elemental function planned(self, limits) result(n)
    class(cadence_t), intent(in) :: self
    type(limits_t), intent(in) :: limits          !! of the run
    integer(int64) :: n
    logical :: given(3), limited(3)

    given = self%every < never
    limited = [limits%time < never, limits%collisions < huge(n), limits%events < huge(n)]
    n = 0
    if (.not. any(given)) n = 2
    if (count(given) /= 1 .or. any(given .neqv. limited) .or. limits%watches()) return
    if (given(by_time)) n = multiples_within(limits%time, self%every(by_time))
    if (given(by_collisions)) n = numbers_within(limits%collisions, self%every(by_collisions))
    if (given(by_events)) n = numbers_within(limits%events, self%every(by_events))
  end function planned

  !> Number of times 0, dt, 2 dt, ... up to t, and t itself. 0: too many to plan for.
  pure function multiples_within(t, dt) result(n)
    real(real64), intent(in) :: t, dt
    integer(int64) :: n
    real(real64), parameter :: too_many = 1.0e12_real64

    n = 0
    if (t/dt > too_many) return
    n = nint(t/dt, int64)
    if (n*dt < t) n = n + 1
    if ((n - 1)*dt >= t) n = n - 1
    n = n + 1
  end function multiples_within

  !> Number of samples by number from 0 to a limit, both included.
  pure function numbers_within(limit, every) result(n)
    integer(int64), intent(in) :: limit
    real(real64), intent(in) :: every
    integer(int64) :: n

    n = 1 + limit
    if (every > 1 .and. limit > 0) n = 2 + int((limit - 1)/every*(1 + 4*epsilon(every)), int64)
  end function numbers_within

end module cadence
