!> Sampling schedules, and the progress of the output. Samples are due at the start and the end of a
!> run, at given times, and at multiples of a time, of a number of collisions or of a number of
!> events.
module sampling_schedule
  use kinds, only: int64, never, real64
  use evolution, only: limits_t
  use settings, only: sampling_t, settings_t
  use simulation_state, only: simulation_t
  use stop_rules, only: whole_collisions
  implicit none
  private
  public :: schedule_t, by_time, by_collisions, by_events, progress_t, frames, values

  !> Quantities in which sampling intervals are measured, see `settings: sampled_by`.
  integer, parameter :: by_time = 1, by_collisions = 2, by_events = 3, by_collisions_per_disk = 4

  !> Times that differ by at most this number of units in the last place are treated as equal.
  integer, parameter :: units_lost = 4

  !> A sampling schedule during a run. Its interval in collisions, not necessarily an integer, also
  !> represents the interval in collisions per disk.
  type, extends(sampling_t) :: schedule_t
    integer(int64) :: count = 0                   !! number of samples taken; the first is due at the start
    !> Time, number of collisions and number of events at which the next samples are due.
    real(real64) :: next(3) = never
    real(real64) :: last_time = -1.0_real64       !! time of the last sample [time]
    integer(int64) :: last_events = -1            !! number of events and kicks before the last sample
  contains
    procedure :: is_due
    procedure :: is_new
    procedure :: take
    procedure :: look_ahead
    procedure :: tighten
    procedure :: planned
    procedure, private :: next_time, number_within
  end type schedule_t

  !> Progress of the output: the numbers of samples and of logged events written so far. Together
  !> with the state of the simulation, this is all that is needed to resume a run.
  type :: progress_t
    type(schedule_t) :: schedule(2)               !! schedules of frames and observables
    integer(int64) :: events = 0                  !! number of events in the event log
  end type progress_t
  integer, parameter :: frames = 1, values = 2

  interface progress_t
    module procedure new_progress
  end interface progress_t

contains

  !> Progress of the output before the first sample.
  pure function new_progress(settings) result(progress)
    type(settings_t), intent(in) :: settings
    type(progress_t) :: progress
    integer :: k

    do k = frames, values
      associate (schedule => progress%schedule(k))
        schedule%sampling_t = settings%output%sampling(k)
        if (.not. schedule%every(by_collisions_per_disk) < never) cycle
        schedule%every(by_collisions) = min(schedule%every(by_collisions), &
          0.5_real64*settings%n_disks()*schedule%every(by_collisions_per_disk))
      end associate
    end do
  end function new_progress

  !> True if a sample is due at the present time.
  elemental function is_due(self, sim) result(yes)
    class(schedule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%has_reached(self%next(by_time)) &
      .or. any([sim%tally%collisions, sim%tally%events] >= self%next(by_collisions:))
  end function is_due

  !> True if the present state has not been sampled yet.
  pure function is_new(self, sim) result(yes)
    class(schedule_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%time() > self%last_time .or. sim%tally%events + sim%n_kicks /= self%last_events
  end function is_new

  !> Records that the present state has been sampled, and determines when the next samples are due.
  pure subroutine take(self, sim)
    class(schedule_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%count = self%count + 1
    self%last_time = sim%time()
    self%last_events = sim%tally%events + sim%n_kicks
    call self%look_ahead(sim)
  end subroutine take

  !> Determines the time and the numbers of collisions and events at which the next samples are due.
  !> A sample is due at the present time only if further events can occur and no sample has been
  !> taken at this time.
  elemental subroutine look_ahead(self, sim)
    class(schedule_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical :: over                               ! .true. if no further sample can be due at the present time

    over = sim%events_done .or. self%last_time >= sim%time()
    self%next(by_time) = self%next_time(sim%time(), merge(sim%time(), self%last_time, over))
    self%next(by_collisions:) = next_number([sim%tally%collisions, sim%tally%events], self%every(by_collisions:by_events))
  end subroutine look_ahead

  !> Lowers the limits, so that the simulation pauses at the next sample.
  pure subroutine tighten(self, limits)
    class(schedule_t), intent(in) :: self
    type(limits_t), intent(inout) :: limits

    limits%time = min(limits%time, self%next(by_time))
    limits%collisions = min(limits%collisions, whole_collisions(self%next(by_collisions)))
    limits%events = min(limits%events, whole_collisions(self%next(by_events)))
    limits%sampled = max(limits%sampled, self%last_time)
  end subroutine tighten

  !> Time of the next sample: the first sampling time t with t >= `time` and t > `past`. Sampling
  !> times are the multiples of the interval, the logarithmic times, and the times given in the
  !> input. Multiples are calculated as products, because sums would accumulate rounding errors. If
  !> several sampling times differ only by rounding errors, the last of them is used.
  pure function next_time(self, time, past) result(next)
    class(schedule_t), intent(in) :: self
    real(real64), intent(in) :: time, past        !! [time]
    real(real64) :: next, due(3)
    integer(int64) :: n
    integer :: k

    due = never
    if (self%every(by_time) < never) then
      n = max(1_int64, int(time/self%every(by_time), int64))
      do while (.not. is_ahead(n*self%every(by_time)))
        n = n + 1
      end do
      due(1) = n*self%every(by_time)
    end if
    if (self%per_decade > 0) then
      associate (from => self%from, steps => real(self%per_decade, real64))
        n = max(0_int64, int(steps*log10(max(time, from)/from), int64) - 1)
        do while (.not. is_ahead(from*10**(n/steps)))
          n = n + 1
        end do
        due(2) = from*10**(n/steps)
      end associate
    end if
    if (allocated(self%at)) due(3) = first_ahead(self%at)
    next = minval(due)
    do k = 2, 3
      if (due(k) <= next + units_lost*spacing(next)) next = due(k)
    end do
  contains

    !> True if t >= `time` and t exceeds `past` by more than rounding errors.
    pure logical function is_ahead(t)
      real(real64), intent(in) :: t

      is_ahead = t >= time .and. t > past + units_lost*spacing(past)
    end function is_ahead

    !> First of the given times for which `is_ahead` is .true.
    pure real(real64) function first_ahead(times)
      real(real64), intent(in) :: times(:)        !! sampling times in ascending order [time]
      integer :: behind, ahead, middle

      behind = 0
      ahead = size(times) + 1
      do while (ahead - behind > 1)
        middle = (behind + ahead)/2
        if (is_ahead(times(middle))) then
          ahead = middle
        else
          behind = middle
        end if
      end do
      first_ahead = never
      if (ahead <= size(times)) first_ahead = times(ahead)
    end function first_ahead
  end function next_time

  !> Smallest number of collisions (or events) above n at which a multiple of the interval `every`
  !> is reached. If this multiple is also the limit of a stop rule, the run ends at this number.
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

  !> Number of samples of a run, or 0 if it is unknown at the start. The number is known if the
  !> schedule has at most one interval, and the only stop rule limits the quantity of this interval:
  !> time, collisions or events. With given or logarithmic sampling times, the limited quantity must
  !> be the time.
  elemental function planned(self, limits) result(n)
    class(schedule_t), intent(in) :: self
    type(limits_t), intent(in) :: limits          !! limits of the run
    integer(int64) :: n
    logical :: given(3), limited(3), chooses

    chooses = self%per_decade > 0 .or. allocated(self%at)
    given = self%every(by_time:by_events) < never
    given(by_time) = given(by_time) .or. chooses
    limited = [limits%time < never, limits%collisions < huge(n), limits%events < huge(n)]
    n = 0
    if (.not. any(given)) n = 2
    if (count(given) /= 1 .or. any(given .neqv. limited) .or. limits%watches() .or. limits%disks_inside >= 0) return
    if (given(by_time) .and. .not. chooses) n = multiples_within(limits%time, self%every(by_time))
    if (chooses) n = self%number_within(limits%time)
    if (given(by_collisions)) n = numbers_within(limits%collisions, self%every(by_collisions))
    if (given(by_events)) n = numbers_within(limits%events, self%every(by_events))
  end function planned

  !> Number of sampling times from 0 to t inclusive. The result is 0 if it would exceed `too_many`;
  !> the output then reserves no space for the samples.
  pure function number_within(self, t) result(n)
    class(schedule_t), intent(in) :: self
    real(real64), intent(in) :: t                 !! [time]
    integer(int64) :: n
    integer(int64), parameter :: too_many = 10000000
    real(real64) :: next

    n = 1
    next = self%next_time(0.0_real64, 0.0_real64)
    do while (next < t .and. n < too_many)
      n = n + 1
      next = self%next_time(next, next)
    end do
    if (t > 0) n = n + 1
    if (n > too_many) n = 0
  end function number_within

  !> Number of multiples of dt from 0 to t inclusive. The result is 0 if it would exceed `too_many`;
  !> the output then reserves no space for the samples.
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

  !> Number of samples from 0 collisions (or events) up to a limit, including the samples at 0 and
  !> at the limit.
  pure function numbers_within(limit, every) result(n)
    integer(int64), intent(in) :: limit
    real(real64), intent(in) :: every
    integer(int64) :: n

    n = 1 + limit
    if (every > 1 .and. limit > 0) n = 2 + int((limit - 1)/every*(1 + 4*epsilon(every)), int64)
  end function numbers_within

end module sampling_schedule
