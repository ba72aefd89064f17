!> Event-driven dynamics: exact, from collision to collision. Each disk holds one event, the earliest that it can
!> have; when it is due, the disks concerned collide and predict again.
!>
!> An event becomes stale when the partner collides with another disk first. Stale events are not searched for: the
!> partner's stamp reveals them when they come up, and the disk only predicts again.
module event_driven
  use kinds, only: int32, int64, never, real64
  use box_sides, only: side_time
  use calendar, only: most_coming, stages
  use cell_grid, only: cell_grid_t
  use encounters, only: collide, collide_pair, encounter_text, pass_side, passes
  use epochs, only: begin_first_epoch, last_time
  use errors, only: error_t, exit_broken, fail
  use event_log, only: event_log_t, is_full
  use event_queue, only: event_queue_t
  use evolution, only: evolution_t, limits_t
  use neighbour_search, only: event_t
  use partners, only: is_wall
  use piston_strips, only: change_strips, near_piston
  use side_motion, only: piston
  use simulation_state, only: simulation_t
  use signals, only: stop_requested
  use tracks, only: tracks_t
  use wall_hits, only: collide_wall
  implicit none
  private
  public :: event_driven_t

  integer(int64), parameter :: events_to_look = 20000  !! between two looks at the number of pair collisions
  integer(int32), parameter :: disks_in_cache = 20000    !! more do not fit into a second-level cache: prefetch
  integer(int64), parameter :: events_ahead = 8    !! after which to prefetch again

  type, extends(evolution_t) :: event_driven_t
    class(cell_grid_t), allocatable :: search      !! a class, so that its rare parts are not inlined into the hot path
    type(event_queue_t) :: queue
    logical :: windowed = .true.                   !! the queue uses its calendar, not the heap alone
    logical :: thorough = .false.                  !! a collision is more than a change of two velocities
    logical :: is_part = .false.                   !! of a simulation: only collisions of disks that belong here count
    class(tracks_t), allocatable :: tracks         !! of its disks, in a part
    integer(int64) :: last_count = 0               !! the number of events at which `run_events` returns
  contains
    procedure :: start
    procedure :: advance
    procedure :: renew
    procedure, private :: run_events
    procedure, private :: predict_all
  end type event_driven_t

contains

  !> Builds search and queue from a state: new, restored, or in a new epoch.
  subroutine start(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    self%idle = .false.
    call sim%start_sums()
    if (.not. sim%epoch_end > 0) call begin_first_epoch(sim)
    call self%search%build(sim)
    do i = 1, sim%n_disks()
      if (stop_requested()) return                 ! see `advance`
      if (sim%tag(i)%id > 0) call self%search%predict(sim, i)    ! else a vacant slot
    end do
    call self%queue%fill(sim%disk, sim%tag, sim%now, self%windowed)
  end subroutine start

  !> Predicts the disks anew that have changed; the events of all others that they were to meet are stale.
  subroutine renew(self, sim, changed)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)
    integer(int32) :: k

    self%idle = .false.
    if (size(changed) == sim%n_disks()) then
      call renew_all(self, sim)
      return
    end if
    do k = 1, size(changed, kind=int32)
      if (stop_requested()) return                 ! see `advance`
      call predict(self, sim, changed(k))
    end do
  end subroutine renew

  !> Predicts all disks, whose clocks are equal. An event later than the next kick of all disks will never happen, so it is
  !> not filed, unless it is the earliest of all: the queue is never empty.
  subroutine renew_all(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64) :: last                           ! since the epoch [time]
    integer(int32) :: i, n

    n = sim%n_disks()
    do i = 1, n - 1, 2
      if (stop_requested()) return                 ! see `advance`
      call self%search%predict_both(sim, i, i + 1)
    end do
    if (mod(n, 2_int32) == 1) call self%search%predict(sim, n)
    last = never
    if (sim%drive%reaches_all()) last = sim%drive%time_of(sim%kicks + 1) - sim%box%epoch
    last = max(last, minval(sim%disk%event_time))
    do i = 1, n
      if (sim%disk(i)%event_time <= last) then
        call self%queue%schedule(sim%disk, sim%tag, i)
      else
        call self%queue%withhold(sim%tag(i))
      end if
    end do
  end subroutine renew_all

  !> Executes events until a limit is met. None after a stop has been requested: many predictions take long and are
  !> then left unfinished; the state itself is whole.
  subroutine advance(self, sim, limits, error, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    type(event_t) :: event
    integer(int64) :: turns, events
    real(real64) :: t_limit

    turns = limits%turns
    self%turns_left = turns
    self%thorough = present(log) .or. sim%with%are_rare() .or. sim%law%by_speed%speed > 0
    self%arrived = .false.
    do while (turns > 0)
      if (limits%reached(sim%tally) .or. is_full(log)) return
      if (stop_requested()) return
      self%last_count = next_pause()
      t_limit = min(limits%time, self%search%faces%due)
      if (sim%n_disks() >= disks_in_cache) call read_ahead()
      events = sim%tally%events
      call self%run_events(sim, t_limit, turns, event, log)
      self%turns_left = turns
      self%last_event = [event%disk, event%partner]
      if (turns == 0 .and. .not. sim%now < limits%time) turns = 1    ! a sample of this moment waits for all its events
      if (self%search%everyone .and. sim%tally%events > events) call self%predict_all(sim)
      if (event%time <= t_limit) cycle
      if (t_limit < limits%time .and. event%time > t_limit) then
        turns = turns + 1                          ! nothing has happened
        self%turns_left = turns
        call follow_piston(self, sim)
        cycle
      end if
      if (is_stale()) then                         ! what is to come must not depend on who was predicted when
        call predict(self, sim, event%disk)
        cycle
      end if
      if (event%time /= event%time) then
        call fail(error, exit_broken, "a time became NaN: "//encounter_text(sim, event%disk, event%partner))
        return
      end if
      self%idle = event%time > last_time .and. .not. sim%box%is_sheared()    ! there images move for ever
      if (limits%time < last_time) sim%now = max(sim%now, limits%time)
      self%arrived = .true.
      return
    end do
  contains

    !> Whether the partner of an event has collided since it was predicted.
    pure function is_stale() result(yes)
      logical :: yes

      yes = event%partner > 0
      if (yes) yes = sim%disk(event%partner)%stamp /= sim%tag(event%disk)%partner_stamp
    end function is_stale

    !> The event count before which no check is due.
    pure function next_pause() result(events)
      integer(int64) :: events

      events = min(limits%events, sim%tally%events + min(limits%collisions - sim%tally%collisions, events_to_look))
      if (limits%watches() .or. present(log) .or. self%search%everyone) events = sim%tally%events + 1
    end function next_pause

    !> Prefetches what the next events will read, and pauses soon to do so again.
    subroutine read_ahead()
      integer(int32) :: stage, n, disks(most_coming)

      do stage = 1, stages
        call self%queue%list_coming(sim%tag, stage, n, disks)
        call self%search%read_ahead(sim%disk, sim%tag, stage, disks(:n))
        if (self%is_part .and. stage == 2) call self%tracks%read_ahead(sim%disk, disks(:n))
      end do
      self%last_count = min(self%last_count, sim%tally%events + events_ahead)
    end subroutine read_ahead
  end subroutine advance

  !> The loop: event after event, up to the number `last_count` of events, to the limit of time, or as long as
  !> there are turns. Hot path only; rare work is left to the caller.
  subroutine run_events(self, sim, t_limit, turns, event, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: t_limit            !! since the epoch [time]
    integer(int64), intent(inout) :: turns         !! that are left
    type(event_t), intent(out) :: event            !! the last one; beyond the limit of time: not executed
    type(event_log_t), intent(inout), optional :: log
    real(real64) :: t
    integer(int32) :: i, code

    do while (turns > 0)
      turns = turns - 1
      call self%queue%first(sim%disk, sim%tag, i)
      t = sim%disk(i)%event_time
      code = sim%disk(i)%partner
      if (.not. t <= t_limit) exit
      call self%queue%drop_first(sim%tag)
      sim%now = max(sim%now, t)
      call execute(self, sim, i, code, t, log)
      if (sim%tally%events >= self%last_count) exit
    end do
    event = event_t(t, i, code)
  end subroutine run_events

  !> Executes the event of disk i, and predicts the disks concerned again.
  subroutine execute(self, sim, i, code, t, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code          !! the disk and its partner: see `partners`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout), optional :: log
    logical :: counts

    counts = .true.
    if (self%is_part) counts = self%tracks%counts(sim%tag, i, code)
    if (code > 0) then
      if (sim%disk(code)%stamp == sim%tag(i)%partner_stamp) then
        ! Equal clocks are rare: of two that are together, or that have both had a collision at this very time.
        if (self%thorough .or. .not. abs(sim%disk(i)%clock - sim%disk(code)%clock) > 0) then
          call collide(sim, i, code, t, counts, log)
        else
          call collide_pair(sim, i, code, t, counts, sim%law%restitution(sim%tag(i)%species, sim%tag(code)%species))
        end if
        call self%queue%forget(code)
        call self%search%predict_both(sim, i, code)
        if (self%is_part) call self%tracks%note_collision(sim%disk, sim%tag, i, code)
        call self%queue%schedule(sim%disk, sim%tag, code)
        call self%queue%schedule(sim%disk, sim%tag, i)
        return
      end if
    else if (is_wall(code) .and. .not. passes(sim, code)) then
      if (self%thorough) then
        call collide(sim, i, code, t, counts, log)
      else
        call collide_wall(sim, i, code, t, counts)
      end if
      if (sim%box%surface(sim%box%surface_of(code))%motion%kind == piston) call follow_side(self, sim, code)
    else
      if (is_wall(code)) call pass_side(sim, i, code, t)
      call self%search%cross(sim, i, code)
      if (self%is_part) call self%tracks%note(sim%tag(i)%cell, i)
      call self%queue%schedule(sim%disk, sim%tag, i)
      return
    end if
    call predict(self, sim, i)
  end subroutine execute

  !> Predicts the disks anew that expected to hit a piston, which now flies otherwise, and those that hit it sooner. The loop
  !> ends, as the piston may leave its strip sooner.
  subroutine follow_side(self, sim, side)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: side             !! its code
    integer(int32) :: k

    call self%search%faces%watch_pistons(sim%box, sim%now)
    self%last_count = 0
    associate (near => near_piston(self%search, 1 - side))
      do k = 1, size(near, kind=int32)
        associate (disk => sim%disk(near(k)))
          if (disk%partner == side .or. side_time(sim%box, disk, side) < disk%event_time) call predict(self, sim, near(k))
        end associate
      end do
    end associate
  end subroutine follow_side

  !> Predicts the disks that a piston may strike in the strip that it enters, or might have struck in the one that it leaves.
  subroutine follow_piston(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable :: disks(:)
    integer(int32) :: k

    call change_strips(self%search, sim, disks)
    do k = 1, size(disks, kind=int32)
      call predict(self, sim, disks(k))
    end do
  end subroutine follow_piston

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

end module event_driven
