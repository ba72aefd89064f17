!> When samples are due: at multiples of a time, of a number of collisions, in all or per disk, or of a number of events,
!> and at the start and the end of a run.
module cadence
  use kinds, only: int64, never, real64
  use evolution, only: limits_t
  use simulation_state, only: simulation_t
  use stop_rules, only: whole_collisions
  implicit none
  private
  public :: cadence_t

  type :: cadence_t
    real(real64) :: every_time = never                    !! default: not by time
    integer(int64) :: every_collisions = huge(0_int64)    !! default: not by these
    integer(int64) :: every_events = huge(0_int64)
    real(real64) :: collision_step = never        !! collisions in all that make so many per disk, whole or not
    integer(int64) :: count = 0                   !! samples taken; the first is due at once
    integer(int64) :: multiple = 1                !! of every_time that is due next
    integer(int64) :: next_collisions = huge(0_int64)
    integer(int64) :: next_events = huge(0_int64)
    real(real64) :: last_time = -1.0_real64       !! of the last sample [time]
    integer(int64) :: last_events = -1
  contains
    procedure :: next_time
    procedure :: is_due
    procedure :: is_new
    procedure :: take
    procedure :: look_ahead
    procedure :: tighten
    procedure :: planned
  end type cadence_t

contains

  !> Time k dt of the next sample by time: a product, not a sum, so that it does not drift.
  pure function next_time(self) result(t)
    class(cadence_t), intent(in) :: self
    real(real64) :: t

    t = never
    if (self%every_time < never) t = self%multiple*self%every_time
  end function next_time

  !> Whether a sample is due now.
  pure function is_due(self, sim) result(yes)
    class(cadence_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%has_reached(self%next_time()) &
      .or. sim%tally%collisions >= self%next_collisions .or. sim%tally%events >= self%next_events
  end function is_due

  !> Whether there is no sample of the present state yet.
  pure function is_new(self, sim) result(yes)
    class(cadence_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%time() > self%last_time .or. sim%tally%events /= self%last_events
  end function is_new

  !> Counts a sample taken now.
  pure subroutine take(self, sim)
    class(cadence_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%count = self%count + 1
    self%last_time = sim%time()
    self%last_events = sim%tally%events
    call self%look_ahead(sim)
  end subroutine take

  !> Finds when the next samples are due: at the first multiples ahead. This follows from the state alone, whenever
  !> the last sample was taken; but for one that is due now, when something may still happen.
  pure subroutine look_ahead(self, sim)
    class(cadence_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical :: over                               !! the present moment, for samples

    if (self%every_time < never) then
      over = sim%settled .or. self%last_time >= sim%time()
      self%multiple = max(self%multiple, int(sim%time()/self%every_time, int64))
      do while (self%next_time() < sim%time() .or. (over .and. self%next_time() <= sim%time()))
        self%multiple = self%multiple + 1
      end do
    end if
    self%next_collisions = min(next_multiple(sim%tally%collisions, self%every_collisions), &
      next_step(sim%tally%collisions, self%collision_step))
    self%next_events = next_multiple(sim%tally%events, self%every_events)
  end subroutine look_ahead

  !> Lowers the limits so that the simulation pauses at the next sample.
  pure subroutine tighten(self, limits)
    class(cadence_t), intent(in) :: self
    type(limits_t), intent(inout) :: limits

    limits%time = min(limits%time, self%next_time())
    limits%collisions = min(limits%collisions, self%next_collisions)
    limits%events = min(limits%events, self%next_events)
    limits%sampled = max(limits%sampled, self%last_time)
  end subroutine tighten

  !> The first multiple of `step` beyond n; huge if there is no step.
  pure function next_multiple(n, step) result(next)
    integer(int64), intent(in) :: n, step
    integer(int64) :: next

    next = huge(next)
    if (step < huge(step)) next = (n/step + 1)*step
  end function next_multiple

  !> The first number of collisions beyond n that reaches another multiple of a step: where a run would end that is to
  !> have so many per disk.
  pure function next_step(n, step) result(next)
    integer(int64), intent(in) :: n
    real(real64), intent(in) :: step
    integer(int64) :: next
    integer(int64) :: multiple

    next = n + 1
    if (step <= 1) return
    multiple = int(n/step, int64)
    next = whole_collisions(multiple*step)
    do while (next <= n)
      multiple = multiple + 1
      next = whole_collisions(multiple*step)
    end do
  end function next_step

  !> Number of samples of a run if it can be known in advance: there is one cadence, and one rule of the same
  !> kind ends the run. Otherwise 0.
  pure function planned(self, limits) result(n)
    class(cadence_t), intent(in) :: self
    type(limits_t), intent(in) :: limits          !! of the run
    integer(int64) :: n
    logical :: given(4), limited(4)

    given = [self%every_time < never, self%every_collisions < huge(n), self%every_events < huge(n), &
      self%collision_step < never]
    limited = [limits%time < never, limits%collisions < huge(n), limits%events < huge(n), limits%collisions < huge(n)]
    n = 0
    if (.not. any(given)) n = 2
    if (count(given) /= 1 .or. count(limited(:3)) /= 1 .or. .not. any(given .and. limited)) return
    if (limits%watches()) return
    if (given(1)) then
      n = multiples_within(limits%time, self%every_time)
    else if (given(2)) then
      n = 1 + (limits%collisions + self%every_collisions - 1)/self%every_collisions
    else if (given(4)) then
      n = steps_within(limits%collisions, self%collision_step)
    else
      n = 1 + (limits%events + self%every_events - 1)/self%every_events
    end if
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

  !> Number of samples by collisions per disk from 0 to a limit, both included.
  pure function steps_within(limit, step) result(n)
    integer(int64), intent(in) :: limit
    real(real64), intent(in) :: step
    integer(int64) :: n

    n = 1 + limit
    if (step > 1 .and. limit > 0) n = 2 + int((limit - 1)/step*(1 + 4*epsilon(step)), int64)
  end function steps_within

end module cadence
