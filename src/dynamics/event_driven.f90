!> Event-driven dynamics: exact, from collision to collision. Each disk holds one event, the earliest that it can
!> have; when it is due, the disks concerned collide and predict again.
!>
!> An event becomes stale when the partner collides with another disk first. Stale events are not searched for: the
!> partner's stamp reveals them when they come up, and the disk only predicts again.
module event_driven
  use kinds, only: int32, int64, never, real64
  use calendar, only: most_coming, stages
  use disks, only: of_same_collision
  use encounters, only: collide, collide_pair, encounter_text, pass_side, passes
  use errors, only: error_t, exit_broken, fail
  use event_heap, only: event_t
  use event_queue, only: event_queue_t
  use evolution, only: evolution_t, limits_t
  use neighbour_search, only: neighbour_search_t
  use partners, only: is_wall
  use renumbering, only: renumber
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  use signals, only: stop_requested
  implicit none
  private
  public :: event_driven_t, events_per_epoch

  !> Pair collisions per disk after which the origin of time moves, so that times keep their digits.
  integer(int64), parameter :: epoch_length = 20
  integer, parameter :: significant_bits = 20      !! of an epoch: sums of epochs are exact
  !> Events between two checks for a collapse: at least these, and these per disk.
  integer(int64), parameter :: events_per_check = 20000, events_per_check_and_disk = 20
  integer(int32), parameter :: disks_in_cache = 20000    !! more do not fit into a second-level cache: prefetch
  integer(int64), parameter :: events_ahead = 8    !! after which to prefetch again
  real(real64), parameter :: last_time = 0.5_real64*never

  type, extends(evolution_t) :: event_driven_t
    class(neighbour_search_t), allocatable :: search
    type(event_queue_t) :: queue
    logical :: windowed = .true.                   !! the queue uses its calendar, not the heap alone
    ! A collapse is an endless series of events during which time does not advance.
    real(real64), private :: blink = 0.0_real64    !! in which nothing moves visibly [time]
    real(real64), private :: last_check = 0.0_real64  !! when it was last looked for [time]
    integer(int64), private :: next_check = 0        !! number of events at which to look again
  contains
    procedure :: start
    procedure :: advance
    procedure, private :: run_events
    procedure, private :: predict_all
  end type event_driven_t

contains

  !> Predicts all events of a state, new or restored.
  subroutine start(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i
    real(real64) :: fastest

    call rebuild(self, sim)
    fastest = magnitude(sim%box%gravity)*minval(sim%disk%radius)
    do i = 1, sim%n_disks()
      fastest = max(fastest, dot_product(sim%disk(i)%v, sim%disk(i)%v))
    end do
    self%blink = 1.0e-9_real64*minval(sim%disk%radius)/sqrt(max(fastest, tiny(fastest)))
    self%last_check = sim%now
    self%next_check = sim%events + check_interval(sim)
    self%idle = .false.
    if (sim%next_epoch == 0) sim%next_epoch = events_per_epoch(sim)
  end subroutine start

  !> Rebuilds search and queue from the state.
  subroutine rebuild(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    call self%search%build(sim)
    do i = 1, sim%n_disks()
      if (stop_requested()) return                 ! see `advance`
      call self%search%predict(sim, i)
    end do
    call self%queue%fill(sim%disk, sim%tag, sim%now, self%windowed)
  end subroutine rebuild

  !> Events of any kind between two epochs.
  pure function events_per_epoch(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = epoch_length*sim%n_disks()/2 + 100
  end function events_per_epoch

  !> Events of any kind between two checks for a collapse.
  pure function check_interval(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = max(events_per_check, events_per_check_and_disk*sim%n_disks())
  end function check_interval

  !> Executes events until a limit is met. None after a stop has been requested: many predictions take long and are
  !> then left unfinished; the state itself is whole.
  subroutine advance(self, sim, limits, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_t) :: event
    real(real64) :: t_limit
    integer(int64) :: turns, pause_at, events

    turns = limits%turns
    do while (turns > 0)
      if (limits%reached(sim) .or. self%log%is_full()) return
      if (sim%events >= sim%next_epoch) call move_epoch(self, sim)
      if (stop_requested()) return
      t_limit = min(limits%time - sim%epoch, last_time)
      pause_at = next_pause(self, sim, limits)
      if (sim%n_disks() >= disks_in_cache) call read_ahead(self, sim, pause_at)
      events = sim%events
      call self%run_events(sim, t_limit, pause_at, turns, event)
      if (self%search%everyone .and. sim%events > events) call self%predict_all(sim)
      if (.not. event%time <= t_limit) then
        if (event%time /= event%time) &
          call fail(error, exit_broken, "a time became NaN: "//encounter_text(sim, event%disk, event%partner))
        self%idle = event%time > last_time
        if (limits%time < last_time) sim%now = max(sim%now, limits%time - sim%epoch)
        return
      end if
      if (sim%events >= self%next_check) call check_for_collapse(self, sim, event, error)
      if (allocated(error)) return
    end do
  end subroutine advance

  !> The loop: event after event, up to the number `pause_at` of collisions, to the limit of time, or as long as
  !> there are turns. Hot path only; rare work is left to the caller.
  subroutine run_events(self, sim, t_limit, pause_at, turns, event)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: t_limit            !! since the epoch [time]
    integer(int64), intent(in) :: pause_at
    integer(int64), intent(inout) :: turns         !! that are left
    type(event_t), intent(out) :: event            !! the last one; beyond the limit of time: not executed
    real(real64) :: t
    integer(int32) :: i, code

    do while (turns > 0)
      turns = turns - 1
      call self%queue%first(sim%disk, sim%tag, i)
      t = sim%disk(i)%event_time
      code = sim%disk(i)%partner
      if (.not. t <= t_limit) exit
      call self%queue%drop_first(i)
      sim%now = max(sim%now, t)
      call execute(self, sim, i, code, t)
      if (sim%events >= pause_at) exit
    end do
    event = event_t(t, i, code)
  end subroutine run_events

  !> The event count before which no check is due.
  pure function next_pause(self, sim, limits) result(events)
    class(event_driven_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    integer(int64) :: events

    events = min(sim%next_epoch, self%next_check, limits%events, &
      sim%events + min(limits%collisions - sim%collisions, events_per_check))
    if (limits%dissipated < huge(limits%dissipated) .or. self%log%is_on() .or. self%search%everyone) &
      events = sim%events + 1
  end function next_pause

  !> Prefetches what the next events will read, and pauses soon to do so again.
  subroutine read_ahead(self, sim, pause_at)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(inout) :: pause_at
    integer(int32) :: stage, n, disks(most_coming)

    do stage = 1, stages
      call self%queue%list_coming(sim%tag, stage, n, disks)
      call self%search%read_ahead(sim, stage, disks(:n))
    end do
    pause_at = min(pause_at, sim%events + events_ahead)
  end subroutine read_ahead

  !> Executes the event of disk i, and predicts the disks concerned again.
  subroutine execute(self, sim, i, code, t)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code          !! the disk and its partner: see `partners`
    real(real64), intent(in) :: t

    if (code > 0) then
      if (sim%disk(code)%stamp == sim%tag(i)%partner_stamp) then
        if (self%log%is_on() .or. of_same_collision(sim%disk(i)%stamp, sim%tag(i)%partner_stamp)) then  ! seldom
          call collide(sim, i, code, t, self%log)
        else
          call collide_pair(sim, min(i, code), max(i, code), t)
        end if
        call self%queue%forget(code)
        call self%search%predict_both(sim, i, code)
        call self%queue%schedule(sim%disk, sim%tag, code)
        call self%queue%schedule(sim%disk, sim%tag, i)
        return
      end if
    else if (is_wall(code) .and. .not. passes(sim, code)) then
      call collide(sim, i, code, t, self%log)
    else
      if (is_wall(code)) call pass_side(sim, i, code)
      call self%search%cross(sim, i, code)
      call self%queue%schedule(sim%disk, sim%tag, i)
      return
    end if
    call predict(self, sim, i)
  end subroutine execute

  !> Predicts disk i and files its event.
  subroutine predict(self, sim, i)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    call self%search%predict(sim, i)
    call self%queue%schedule(sim%disk, sim%tag, i)
  end subroutine predict

  !> Predicts all disks, not just those involved: the first textbook method.
  subroutine predict_all(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    do i = 1, sim%n_disks()
      if (stop_requested()) return                 ! see `advance`
      call predict(self, sim, i)
    end do
  end subroutine predict_all

  !> Ends the run if a long series of events has not advanced the clock. The message names the last of them.
  subroutine check_for_collapse(self, sim, event, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(event_t), intent(in) :: event
    type(error_t), allocatable, intent(inout) :: error

    if (sim%now - self%last_check < self%blink) call fail(error, exit_broken, &
      "inelastic collapse, time no longer advances: "//encounter_text(sim, event%disk, event%partner) &
      //remedy(sim, event%disk, event%partner))
    self%next_check = sim%events + check_interval(sim)
    self%last_check = sim%now
  end subroutine check_for_collapse

  !> What helps against the collapse of disk i with its partner, as far as it has not been done.
  pure function remedy(sim, i, code) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code
    character(len=:), allocatable :: text
    real(real64) :: restitution

    restitution = sim%law%wall_restitution
    if (code > 0) restitution = sim%law%restitution(sim%tag(i)%species, sim%tag(code)%species)
    text = "; "//trim(merge("raise", "set  ", sim%law%contact_time > 0)) &
      //" contact.contact_time (TC model), well below the mean time between collisions"
    if (restitution < 1) text = text//", or raise " &
      //trim(merge("contact.restitution     ", "contact.wall_restitution", code > 0))
    if (code <= 0 .and. sim%box%falling()) text = text//"; a disk that starts at rest on a wall never leaves it: " &
      //"start it higher, or take run.dynamics = 'steps'"
  end function remedy

  !> Moves the origin of time to about now, so that times stay small and keep their digits. As everything is
  !> predicted again then, it also sorts the disks by cell.
  subroutine move_epoch(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64) :: shift

    shift = scale(aint(scale(fraction(sim%now), significant_bits)), exponent(sim%now) - significant_bits)
    call renumber(sim)
    sim%disk%clock = sim%disk%clock - shift
    sim%now = sim%now - shift
    sim%epoch = sim%epoch + shift
    sim%next_epoch = sim%events + events_per_epoch(sim)
    self%last_check = self%last_check - shift
    call rebuild(self, sim)
  end subroutine move_epoch

end module event_driven
