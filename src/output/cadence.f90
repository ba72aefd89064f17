!> When samples are due: at multiples of a time, of a number of collisions, of a number of events, and at
!> the first and the last moment of a run.
module cadence
  use kinds, only: int64, never, real64
  use evolution, only: limits_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: cadence_t

  type :: cadence_t
    real(real64) :: every_time = never
    integer(int64) :: every_collisions = huge(0_int64)
    integer(int64) :: every_events = huge(0_int64)
    integer(int64) :: count = 0                   !! samples taken
    integer(int64) :: multiple = 1                !! of every_time that is due next
    integer(int64) :: next_collisions = huge(0_int64)
    integer(int64) :: next_events = huge(0_int64)
    real(real64) :: last_time = -1.0_real64       !! moment of the last sample
    integer(int64) :: last_events = -1
  contains
    procedure :: next_time
    procedure :: is_due
    procedure :: is_new
    procedure :: take
    procedure :: go_on
    procedure :: planned
  end type cadence_t

  interface cadence_t
    module procedure new_cadence
  end interface cadence_t

contains

  pure function new_cadence(every_time, every_collisions, every_events) result(cadence)
    real(real64), intent(in) :: every_time        !! `never`: not by time
    integer(int64), intent(in) :: every_collisions, every_events     !! huge: not by these
    type(cadence_t) :: cadence

    cadence%every_time = every_time
    cadence%every_collisions = every_collisions
    cadence%every_events = every_events
    cadence%next_collisions = every_collisions
    cadence%next_events = every_events
  end function new_cadence

  !> The moment k dt of the next sample by time; a product, not a sum, so that it does not drift.
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

    yes = self%count == 0 .or. sim%time() >= self%next_time() &
      .or. sim%collisions >= self%next_collisions .or. sim%events >= self%next_events
  end function is_due

  !> Whether this moment has no sample yet.
  pure function is_new(self, sim) result(yes)
    class(cadence_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%count == 0 .or. sim%time() > self%last_time .or. sim%events /= self%last_events
  end function is_new

  !> Counts a sample now, and finds when the next ones are due: the first multiples ahead.
  pure subroutine take(self, sim)
    class(cadence_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%count = self%count + 1
    self%last_time = sim%time()
    self%last_events = sim%events
    if (self%every_time < never) then
      self%multiple = max(self%multiple, int(sim%time()/self%every_time, int64))
      do while (self%next_time() <= sim%time())
        self%multiple = self%multiple + 1
      end do
    end if
    self%next_collisions = next_multiple(sim%collisions, self%every_collisions)
    self%next_events = next_multiple(sim%events, self%every_events)
  end subroutine take

  !> Takes over how far the cadence of an earlier part of the run had come.
  pure subroutine go_on(self, earlier)
    class(cadence_t), intent(inout) :: self
    type(cadence_t), intent(in) :: earlier

    self%count = earlier%count
    self%multiple = earlier%multiple
    self%next_collisions = earlier%next_collisions
    self%next_events = earlier%next_events
    self%last_time = earlier%last_time
    self%last_events = earlier%last_events
  end subroutine go_on

  !> The first multiple of `step` beyond n; huge if there is no step.
  pure function next_multiple(n, step) result(next)
    integer(int64), intent(in) :: n, step
    integer(int64) :: next

    next = huge(next)
    if (step < huge(step)) next = (n/step + 1)*step
  end function next_multiple

  !> Number of samples of a run, if it is known beforehand: when there is one cadence, and one rule of the
  !> same kind that ends the run. Else 0.
  pure function planned(self, limits) result(n)
    class(cadence_t), intent(in) :: self
    type(limits_t), intent(in) :: limits          !! of the run
    integer(int64) :: n
    logical :: asked(3), limited(3)

    asked = [self%every_time < never, self%every_collisions < huge(n), self%every_events < huge(n)]
    limited = [limits%time < never, limits%collisions < huge(n), limits%events < huge(n)]
    n = 0
    if (.not. any(asked)) n = 2
    if (count(asked) /= 1 .or. count(limited) /= 1 .or. .not. any(asked .and. limited)) return
    if (limits%dissipated < huge(limits%dissipated)) return
    if (asked(1)) then
      n = multiples_within(limits%time, self%every_time)
    else if (asked(2)) then
      n = 1 + (limits%collisions + self%every_collisions - 1)/self%every_collisions
    else
      n = 1 + (limits%events + self%every_events - 1)/self%every_events
    end if
  end function planned

  !> Number of moments 0, dt, 2 dt, ... up to t, and t itself. 0: too many to be meant.
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

end module cadence
