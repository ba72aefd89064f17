!> Event-driven dynamics: exact, from collision to collision. Each disk expects one event, the earliest it can
!> have; when it comes, the disks concerned collide and predict anew.
!>
!> What a disk expects turns stale when its partner collides first. Nobody looks for such events: the
!> partner's stamp shows it when the event comes up, and the disk only predicts again.
module event_driven
  use kinds, only: int32, int64, never, real64
  use encounters, only: collide, collide_pair, encounter_text, pass_side, passes
  use errors, only: error_t, exit_broken, fail
  use event_queue, only: event_queue_t, most_coming, stages
  use evolution, only: evolution_t, limits_t
  use neighbour_search, only: neighbour_search_t
  use partners, only: is_wall
  use renumbering, only: renumber
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: event_driven_t

  !> Pair collisions per disk after which the origin of time moves, so that times keep their digits.
  integer(int64), parameter :: epoch_length = 20
  integer, parameter :: significant_bits = 20      !! of an epoch: sums of epochs are exact
  !> Events between two looks at the clock: at least these, and these per disk.
  integer(int64), parameter :: patience = 20000, patience_per_disk = 20
  integer(int32), parameter :: many = 20000        !! disks that do not fit into a second-level cache
  integer(int64), parameter :: events_ahead = 8    !! after which to read ahead again
  real(real64), parameter :: last_time = 0.5_real64*never

  type, extends(evolution_t) :: event_driven_t
    class(neighbour_search_t), allocatable :: search
    type(event_queue_t) :: queue
    logical :: calendar = .true.                   !! the queue is a calendar, else the heap alone
    ! Watch over the clock: a collapse is an endless series of events in no time.
    real(real64), private :: blink = 0.0_real64    !! a time in which nothing can move visibly [time]
    real(real64), private :: last_look = 0.0_real64  !! when we looked at the clock [time]
    integer(int64), private :: next_watch = 0        !! number of events at which to look again
  contains
    procedure :: start
    procedure :: advance
    procedure, private :: go_on
    procedure, private :: expect_anew
  end type event_driven_t

contains

  subroutine start(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i
    real(real64) :: fastest

    call expect_everything(self, sim)
    fastest = norm2(sim%box%gravity)*minval(sim%disk%radius)
    do i = 1, sim%n_disks()
      fastest = max(fastest, dot_product(sim%disk(i)%v, sim%disk(i)%v))
    end do
    self%blink = 1.0e-9_real64*minval(sim%disk%radius)/sqrt(max(fastest, tiny(fastest)))
    self%last_look = sim%now
    self%next_watch = sim%events + events_per_watch(sim)
    self%idle = .false.
    if (sim%next_epoch == 0) sim%next_epoch = events_per_epoch(sim)
  end subroutine start

  !> Predicts the event of every disk.
  subroutine expect_everything(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    call self%search%build(sim)
    do i = 1, sim%n_disks()
      call self%search%predict(sim, i)
    end do
    call self%queue%fill(sim%disk, sim%tag, sim%now, self%calendar)
  end subroutine expect_everything

  !> Events of any kind between two epochs.
  pure function events_per_epoch(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = epoch_length*sim%n_disks()/2 + 100
  end function events_per_epoch

  !> Events of any kind between two looks at the clock.
  pure function events_per_watch(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = max(patience, patience_per_disk*sim%n_disks())
  end function events_per_watch

  subroutine advance(self, sim, limits, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    real(real64) :: t, t_limit
    integer(int64) :: turns, look
    integer(int32) :: i, code

    turns = limits%turns
    do while (turns > 0)
      if (reached(self, sim, limits)) return
      if (sim%events >= sim%next_epoch) call move_epoch(self, sim)
      t_limit = min(limits%time - sim%epoch, last_time)
      look = next_look(self, sim, limits)
      if (sim%n_disks() >= many) call read_ahead(self, sim, look)
      call self%go_on(sim, t_limit, look, turns, i, code, t)
      if (.not. t <= t_limit) then
        if (t /= t) call fail(error, exit_broken, "a time became NaN: "//encounter_text(sim, i, code))
        self%idle = t > last_time
        if (limits%time < last_time) sim%now = max(sim%now, limits%time - sim%epoch)
        return
      end if
      if (sim%events >= self%next_watch) call watch(self, sim, i, code, error)
      if (allocated(error)) return
    end do
  end subroutine advance

  !> The loop: event after event, up to the number `look` of collisions, to the limit of time, or as long as
  !> there are turns. Nothing else is done here, and what is rare elsewhere, so that it stays fast.
  subroutine go_on(self, sim, t_limit, look, turns, i, code, t)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: t_limit            !! since the epoch [time]
    integer(int64), intent(in) :: look
    integer(int64), intent(inout) :: turns         !! that are left
    integer(int32), intent(out) :: i, code         !! of the last event: the disk and whom it expected
    real(real64), intent(out) :: t                 !! its time; beyond the limit: it still is to come
    integer(int64) :: events                       !! before this one

    do while (turns > 0)
      turns = turns - 1
      call self%queue%first(sim%disk, sim%tag, i)
      t = sim%disk(i)%event_time
      code = sim%disk(i)%partner
      if (.not. t <= t_limit) exit
      call self%queue%drop_first(i)
      sim%now = max(sim%now, t)
      events = sim%events
      call react(self, sim, i, code, t)
      if (self%search%everyone .and. sim%events > events) call self%expect_anew(sim)
      if (sim%events >= look) exit
    end do
  end subroutine go_on

  !> Whether the run is to pause here, time aside.
  pure function reached(self, sim, limits) result(yes)
    class(event_driven_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    logical :: yes

    yes = sim%events >= limits%events .or. sim%collisions >= limits%collisions &
      .or. sim%dissipated >= limits%dissipated .or. self%log%is_full()
  end function reached

  !> The number of events before which there is nothing to do but to go on.
  pure function next_look(self, sim, limits) result(events)
    class(event_driven_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    integer(int64) :: events

    events = min(sim%next_epoch, self%next_watch, limits%events, &
      sim%events + min(limits%collisions - sim%collisions, patience))
    if (limits%dissipated < huge(limits%dissipated) .or. self%log%is_on()) events = sim%events + 1
  end function next_look

  !> Brings into the cache what the next events need, and looks again soon.
  subroutine read_ahead(self, sim, look)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(inout) :: look
    integer(int32) :: stage, n, disks(most_coming)

    do stage = 1, stages
      call self%queue%list_coming(sim%tag, stage, n, disks)
      call self%search%read_ahead(sim, stage, disks(:n))
    end do
    look = min(look, sim%events + events_ahead)
  end subroutine read_ahead

  !> Executes what disk i expects, now, and predicts what those concerned expect next.
  subroutine react(self, sim, i, code, t)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code          !! the disk and whom it expects
    real(real64), intent(in) :: t

    if (code > 0) then
      if (sim%disk(code)%stamp == sim%tag(i)%partner_stamp) then
        if (self%log%is_on()) then                 ! apart, as the log is rare and costs registers
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
  end subroutine react

  subroutine predict(self, sim, i)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    call self%search%predict(sim, i)
    call self%queue%schedule(sim%disk, sim%tag, i)
  end subroutine predict

  !> Predicts all disks anew, not just those involved.
  subroutine expect_anew(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    do i = 1, sim%n_disks()
      call predict(self, sim, i)
    end do
  end subroutine expect_anew

  !> Ends the run if a long series of events has brought the clock no further. The last of them names whom.
  subroutine watch(self, sim, i, code, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code          !! the disk that just collided, and with whom
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: remedy

    remedy = ""
    if (code <= 0 .and. sim%box%falling()) remedy = "; a disk that starts at rest on a wall never leaves it: " &
      //"start it higher, or take run.dynamics = 'steps'"
    if (sim%now - self%last_look < self%blink) call fail(error, exit_broken, &
      "inelastic collapse, the clock stands still: "//encounter_text(sim, i, code)//"; set contact.contact_time " &
      //"(TC model), well below the mean time between collisions, or raise " &
      //trim(merge("contact.restitution     ", "contact.wall_restitution", code > 0))//remedy)
    self%next_watch = sim%events + events_per_watch(sim)
    self%last_look = sim%now
  end subroutine watch

  !> Moves the origin of time to about now, so that times stay small and keep their digits; and, as
  !> everything is predicted anew then, puts the disks into the order of the cells.
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
    self%last_look = self%last_look - shift
    call expect_everything(self, sim)
  end subroutine move_epoch

end module event_driven
