!> Event-driven dynamics: exact trajectories from event to event. Each disk stores the earliest of
!> its predicted events. When this event is due, the disks involved collide, and their next events
!> are predicted.
!>
!> The event of a disk becomes stale if its partner collides with a third disk first. Stale events
!> are not searched for. When a stale event is due, it is recognised by the changed collision
!> counter of the partner, and the next event of the disk is predicted instead.
module event_driven
  use kinds, only: int16, int32, int64, never, real64
  use box_state, only: side_time
  use collapses, only: still, watch
  use calendar, only: most_coming, stages
  use cell_grid, only: cell_grid_t
  use disks, only: disk_t, tag_t
  use encounters, only: depart, encounter_text, execute_collision, is_passage, need_general, pass_side
  use epochs, only: begin_first_epoch, last_time
  use errors, only: error_t, exit_broken, fail
  use event_log, only: event_log_t, is_full
  use event_queue, only: event_queue_t
  use evolution, only: evolution_t, limits_t
  use event_prediction, only: event_t
  use partners, only: axis_of, is_side, is_wall, nothing
  use piston_strips, only: change_strips, near_piston
  use simulation_state, only: simulation_t
  use signals, only: stop_requested
  implicit none
  private
  public :: event_driven_t

  !> Maximum number of events between two checks of the limits.
  integer(int64), parameter :: events_to_look = 20000
  !> Number of disks that fit into a second-level cache; with fewer disks, prefetching saves no
  !> time.
  integer(int32), parameter :: disks_in_cache = 20000
  integer(int64), parameter :: events_ahead = 8    !! number of events between two prefetches

  !> Disk-disk collisions that need the general procedure: collisions of disks with equal clocks,
  !> collisions of disks that have hardly moved relative to each other, or all collisions.
  integer, parameter :: if_clocks_are_equal = 0, if_hardly_moved = 1, always = 2

  type, extends(evolution_t) :: event_driven_t
    !> The search for collision partners; polymorphic, so that the compiler does not inline rarely
    !> used procedures into the hot path.
    class(cell_grid_t), allocatable :: search
    type(event_queue_t) :: queue
    logical :: windowed = .true.      !! whether the queue uses the calendar in addition to the heap
    integer :: general = if_clocks_are_equal       !! collisions that need the general procedure `collide`
    logical :: lossy = .false.                     !! whether collisions may be part of an inelastic collapse
    !> Whether a disk has left the box since the start of `advance`.
    logical :: has_departed = .false.
    logical :: is_part = .false.  !! whether this engine advances one domain of a parallel run
    integer(int64) :: last_count = 0               !! total number of events at which `run_events` returns
  contains
    procedure :: start
    procedure :: advance
    procedure :: renew
    procedure, private :: run_events
    procedure, private :: predict_all
    ! Called only if `is_part`:
    procedure :: counts
    procedure :: record_collision
    procedure :: record_cell
    procedure :: read_records_ahead
  end type event_driven_t

contains

  !> Sets up the search and the event queue for the state `sim`: the initial state, the state of a
  !> checkpoint, or the state at the start of an epoch.
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
      if (sim%tag(i)%id == 0) cycle                ! an array element without a disk
      if (sim%is_inside(i)) call self%search%predict(sim, i)
      if (.not. sim%is_inside(i)) call forget_events(sim, i)
    end do
    call self%queue%fill(sim%disk, sim%tag, sim%now, self%windowed)
  end subroutine start

  !> Predicts the events of changed disks anew. Events of other disks with a changed disk as partner
  !> become stale.
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

  !> Predicts the events of all disks, whose clocks must be equal. If the next kick changes all
  !> velocities, later events will never occur. These events are left out of the queue. Only the
  !> earliest of them is kept, because the queue must not be empty.
  subroutine renew_all(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64) :: last                           ! latest time of an event in the queue [time]
    integer(int32) :: i, n

    n = sim%n_disks()
    do i = 1, n - 1, 2
      if (stop_requested()) return                 ! see `advance`
      call self%search%predict_both(sim, i, i + 1)
    end do
    if (mod(n, 2_int32) == 1) call self%search%predict(sim, n)
    last = never
    ! The time of the kick may have been rounded up (see `timeline: advance_once`).
    if (allocated(sim%drive)) then
      if (sim%drive%acts_on_all()) last = nearest(sim%kick_time(sim%n_kicks + 1) - sim%box%epoch, 1.0_real64)
    end if
    last = max(last, minval(sim%disk%event_time))
    do i = 1, n
      if (sim%disk(i)%event_time <= last) then
        call self%queue%schedule(sim%disk, sim%tag, i)
      else
        call self%queue%remove_entry(sim%tag(i))
      end if
    end do
  end subroutine renew_all

  !> Executes events until a limit is reached. After a stop request the procedure returns early.
  !> Some predictions may then be missing, but the state of the simulation is complete.
  subroutine advance(self, sim, limits, error, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    type(event_t) :: event
    integer(int64) :: iterations, events
    real(real64) :: t_limit

    iterations = limits%iterations
    self%iterations_left = iterations
    self%lossy = sim%law%can_collapse()
    self%general = merge(if_hardly_moved, if_clocks_are_equal, self%lossy)
    if (present(log) .or. need_general(sim)) self%general = always
    self%arrived = .false.
    self%has_departed = .false.
    do while (iterations > 0)
      if (limits%reached(sim%tally) .or. is_full(log)) return
      if (stop_requested()) return
      self%last_count = next_pause()
      t_limit = min(limits%time, self%search%faces%due)
      if (sim%n_disks() >= disks_in_cache) call read_ahead()
      events = sim%tally%events
      call self%run_events(sim, t_limit, iterations, event, log)
      self%iterations_left = iterations
      self%last_event = [event%disk, event%partner]
      ! All events at the time limit are executed, because a sample may be due then.
      if (iterations == 0 .and. .not. sim%now < limits%time) iterations = 1
      if (self%search%everyone .and. sim%tally%events > events) call self%predict_all(sim)
      if (self%has_departed) return                ! the caller asks the sources whether a disk enters
      if (event%time <= t_limit) cycle
      if (t_limit < limits%time .and. event%time > t_limit) then
        iterations = iterations + 1                ! an iteration without an event does not count
        self%iterations_left = iterations
        call follow_piston(self, sim)
        cycle
      end if
      ! The returned event must not be stale, because the order of the predictions determines which
      ! events are stale.
      if (is_stale()) then
        call predict(self, sim, event%disk)
        cycle
      end if
      if (event%time /= event%time) then
        call fail(error, exit_broken, "a time became NaN: "//encounter_text(sim, event%disk, event%partner))
        return
      end if
      ! the images of a sheared box never stop
      self%idle = event%time > last_time .and. .not. sim%box%is_sheared()
      if (limits%time < last_time) sim%now = max(sim%now, limits%time)
      self%arrived = .true.
      return
    end do
  contains

    !> True if the partner has collided since the event was predicted.
    pure function is_stale() result(yes)
      logical :: yes

      yes = event%partner > 0
      if (yes) yes = sim%disk(event%partner)%collision_counter /= sim%tag(event%disk)%partner_counter
    end function is_stale

    !> Total number of events at which the limits are checked next.
    pure function next_pause() result(events)
      integer(int64) :: events

      events = min(limits%events, sim%tally%events + min(limits%collisions - sim%tally%collisions, events_to_look))
      if (limits%watches() .or. present(log) .or. self%search%everyone) events = sim%tally%events + 1
    end function next_pause

    !> Prefetches the data of the next events, and schedules the next prefetch.
    subroutine read_ahead()
      integer(int32) :: stage, n, disks(most_coming)

      do stage = 1, stages
        call self%queue%list_coming(sim%tag, stage, n, disks)
        call self%search%read_ahead(sim%disk, sim%tag, stage, disks(:n))
        if (self%is_part .and. stage == 2) call self%read_records_ahead(sim%disk, disks(:n))
      end do
      self%last_count = min(self%last_count, sim%tally%events + events_ahead)
    end subroutine read_ahead
  end subroutine advance

  !> Hot path: executes one event after another. It ends when the number of events reaches
  !> `last_count`, the next event is beyond the time limit, or the allowed iterations are used up.
  !> Rare operations are left to the caller.
  subroutine run_events(self, sim, t_limit, iterations, event, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: t_limit            !! relative to the time origin `box%epoch` [time]
    integer(int64), intent(inout) :: iterations    !! number of remaining iterations
    type(event_t), intent(out) :: event     !! the last event; not executed if it is later than the time limit
    type(event_log_t), intent(inout), optional :: log
    real(real64) :: t
    integer(int32) :: i, code

    do while (iterations > 0)
      iterations = iterations - 1
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

  !> Executes the event of disk i, and predicts the next events of disk i and its partner.
  subroutine execute(self, sim, i, code, t, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code      !! index of the disk and code of its partner; see `partners`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout), optional :: log
    logical :: counts, is_general
    real(real64) :: s      ! time since the previous event of either disk, whichever was later [time]

    counts = .true.
    if (self%is_part) counts = self%counts(sim%tag, i, code)
    if (code > 0) then
      if (sim%disk(code)%collision_counter == sim%tag(i)%partner_counter) then
        if (self%general == if_clocks_are_equal) then
          ! The clocks of two disks are equal only if the disks are still in contact, or if both
          ! have collided at exactly the present time.
          is_general = .not. abs(sim%disk(i)%clock - sim%disk(code)%clock) > 0
        else if (self%general == if_hardly_moved) then
          ! One component of the displacement suffices here, because `watch` tests both components.
          s = t - max(sim%disk(i)%clock, sim%disk(code)%clock)
          is_general = (s*(sim%disk(code)%v(1) - sim%disk(i)%v(1)))**2 <= (still*(sim%disk(i)%radius + sim%disk(code)%radius))**2
          if (is_general) call watch(sim, i, code, t, self%is_part)
        else
          is_general = .true.
          if (self%lossy) call watch(sim, i, code, t, self%is_part)
        end if
        call execute_collision(sim, i, code, t, counts, is_general, log)
        call self%queue%drop_if_next(code)
        call self%search%predict_both(sim, i, code)
        if (self%is_part) call self%record_collision(sim%disk, sim%tag, i, code)
        call self%queue%schedule(sim%disk, sim%tag, code)
        call self%queue%schedule(sim%disk, sim%tag, i)
        return
      end if
    else if (is_wall(code) .and. .not. is_passage(sim, code)) then
      call execute_collision(sim, i, code, t, counts, self%general == always, log)
      if (is_side(code)) then
        if (sim%box%side(1 - code)%is_piston()) call follow_side(self, sim, code)
      end if
    else
      if (is_wall(code)) then
        if (.not. sim%box%periodic(axis_of(code))) then
          call let_out(self, sim, i, code, t, log)
          return
        end if
        call pass_side(sim, i, code, t)
      end if
      call self%search%cross(sim, i, code)
      if (self%is_part) call self%record_cell(sim%tag(i)%cell, i)
      call self%queue%schedule(sim%disk, sim%tag, i)
      return
    end if
    call predict(self, sim, i)
  end subroutine execute

  !> Lets disk i leave the box through an open side. The event loop then returns.
  subroutine let_out(self, sim, i, code, t, log)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code          !! index of the disk and code of the side; see `partners`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout), optional :: log

    self%has_departed = .true.
    self%last_count = 0
    call depart(sim, i, code, t, log)
    if (sim%disk(i)%radius > self%search%layout%small) then
      call self%start(sim)                         ! makes the lists of big disks anew
    else
      call self%search%take_out(sim%tag(i), i)
      self%search%n_listed = self%search%n_listed - 1
      sim%tag(i)%cell = 0
      call forget_events(sim, i)
      call self%queue%schedule(sim%disk, sim%tag, i)
    end if
  end subroutine let_out

  !> Sets the next event of a waiting disk to a time that is never reached.
  pure subroutine forget_events(sim, i)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    sim%disk(i)%event_time = 2*never
    sim%disk(i)%partner = nothing
  end subroutine forget_events

  !> Updates predicted events after a collision has changed the motion of a piston. The procedure
  !> updates disks that were to collide with the piston next, and disks that the piston now reaches
  !> before their next event. The event loop then returns, because the piston may leave its strip of
  !> cells (see `piston_strips`) earlier than expected.
  subroutine follow_side(self, sim, side)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: side             !! code of the side
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

  !> Called when a piston leaves its strip (the cells within its reach, see `piston_strips`).
  !> Predicts the events of the disks in the old and the new strip anew.
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

  !> Predicts the next event of disk i and enters it into the queue.
  subroutine predict(self, sim, i)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    call self%search%predict(sim, i)
    call self%queue%schedule(sim%disk, sim%tag, i)
  end subroutine predict

  !> Predicts the events of all disks after each event, and not only the events of the disks
  !> involved. This is the simplest algorithm, found in textbooks.
  subroutine predict_all(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    do i = 1, sim%n_disks()
      if (stop_requested()) return                 ! see `advance`
      if (sim%is_inside(i)) call predict(self, sim, i)
    end do
  end subroutine predict_all

  !> True if this engine counts and logs the collision of disk i with a partner. In a parallel run,
  !> one of the domains does.
  pure function counts(self, tag, i, code) result(yes)
    class(event_driven_t), intent(in) :: self
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i, code     !! index of the disk, and code of its partner (see `partners`)
    logical :: yes

    yes = .true.
  end function counts

  !> Records a collision of disks i and j, and the cells that contain the two disks.
  subroutine record_collision(self, disk, tag, i, j)
    class(event_driven_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i, j
  end subroutine record_collision

  !> Records the cell of disk i.
  subroutine record_cell(self, cell, i)
    class(event_driven_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i
  end subroutine record_cell

  !> Prefetches the records of some disks and of their partners.
  subroutine read_records_ahead(self, disk, disks)
    class(event_driven_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    integer(int32), intent(in) :: disks(:)
  end subroutine read_records_ahead

end module event_driven
