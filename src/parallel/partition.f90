!> A simulation cut into domains, which move on together by windows of time. The events predicted are theirs; the
!> simulation itself stays as it was until they are gathered. If a window does not hold, they are worth nothing any more
!> and have to be filled again.
module partition
  use kinds, only: int16, int32, int64, real64
  use cell_faces, only: patch_t
  use cell_grid, only: whole_box
  use domain_borders, only: refresh, verify
  use domain_cuts, only: domain_cuts_t
  use domains, only: domain_t, due_t, follow_event, gather, keep_log, load, move_on, next_due
  use evolution, only: limits_t
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use tally, only: tally_t
  use time_use, only: note_busy, part_cuts, part_domains, part_filling, part_gathering, part_refreshing, part_verifying, &
    spend_time_on
  implicit none
  private
  public :: partition_t

  real(real64), parameter :: few_events = 20.0_real64          !! before a limit, to be taken one by one

  !> How fast things happen, as far as it is known.
  type, public :: pace_t
    real(real64) :: events = 0.0_real64            !! per time; 0: not known yet [1/time]
    real(real64) :: turns = 10.0_real64            !! of engines, per event
  contains
    procedure :: learn
  end type pace_t

  type :: partition_t
    integer(int32) :: threads = 1
    integer(int32) :: wanted = 1                   !! domains
    real(real64) :: window = 0.5_real64            !! collisions per disk in a window
    integer(int32) :: halo = 6                     !! columns and rows of copies around a domain
    real(real64) :: overload = 4.0_real64          !! turns of an engine in a window, over what all should need together
    type(domain_cuts_t) :: cuts
    type(domain_t), allocatable :: domain(:)
    type(pace_t) :: pace
    real(real64) :: shortening = 1.0_real64        !! of windows, after failures
    integer(int32) :: widening = 0                 !! of the halo, after failures
  contains
    procedure :: fill
    procedure :: run_window
    procedure :: tally_now
    procedure :: left
    procedure :: is_past
    procedure :: gather_all
    procedure, private :: window_end
    procedure, private :: expected
    procedure, private :: stride
    procedure, private :: step
  end type partition_t

contains

  !> Learns from what has happened in a time.
  pure subroutine learn(self, events, turns, time)
    class(pace_t), intent(inout) :: self
    integer(int64), intent(in) :: events, turns
    real(real64), intent(in) :: time               !! [time]

    if (.not. (events > 0 .and. time > 0)) return
    self%events = events/time
    self%turns = max(turns/real(events, real64), 1.0_real64)
  end subroutine learn

  !> Cuts a simulation and fills the domains. `cut`: it could be cut into several.
  subroutine fill(self, sim, log, cut)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: log                     !! collisions are to be listed
    logical, intent(out) :: cut
    type(patch_t) :: whole
    integer(int16), allocatable :: cell(:, :)
    integer(int32) :: i, k

    call spend_time_on(part_cuts)
    whole = whole_box(sim)
    cut = .false.
    if (whole%small < maxval(sim%disk%radius)) return
    allocate (cell(2, sim%n_disks()))
    !$omp parallel do num_threads(self%threads)
    do i = 1, sim%n_disks()
      cell(:, i) = int(whole%cell_at(sim%position(i)), int16)
    end do
    !$omp end parallel do
    call self%cuts%cut(whole, sim%box%periodic, cell, self%wanted, self%threads, &
      self%halo + self%widening + merge(2, 0, self%wanted > self%threads))
    cut = self%cuts%n > 1
    if (.not. cut) return
    if (allocated(self%domain)) then
      if (size(self%domain) /= self%cuts%n) deallocate (self%domain)
    end if
    if (.not. allocated(self%domain)) allocate (self%domain(self%cuts%n))
    if (.not. self%pace%events > 0) self%pace%events = 10*sim%n_disks()/(sim%epoch_end - sim%epoch_begin)
    call spend_time_on(part_filling)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      associate (domain => self%domain(k))
        domain%patch = self%cuts%patch_of(k, sim%box%periodic)
        domain%halo = self%cuts%halo
        domain%low = self%cuts%low(:, k)
        domain%high = self%cuts%high(:, k)
        domain%neighbour = self%cuts%neighbours_of(k, domain%patch)
        call keep_log(domain, log)
        call load(domain, sim, cell)
      end associate
    end do
    !$omp end parallel do
  end subroutine fill

  !> When the next window ends.
  pure function window_end(self, sim, t, t_limit) result(t_end)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t, t_limit         !! since the epoch [time]
    real(real64) :: t_end, length

    length = self%window*self%shortening*sim%n_disks()/(2*self%pace%events)
    if (self%wanted > self%threads) length = 2*length      ! a cache takes in each domain once in a window
    t_end = t + length
    if (t_end + 0.5_real64*length > t_limit) t_end = t_limit
  end function window_end

  !> Events in a time, generously.
  pure function expected(self, length) result(events)
    class(partition_t), intent(in) :: self
    real(real64), intent(in) :: length             !! [time]
    real(real64) :: events

    events = 1.2_real64*length*self%pace%events + 100
  end function expected

  !> What collisions have gathered, those in the domains since they were filled included.
  pure function tally_now(self, sim) result(so_far)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(tally_t) :: so_far
    integer(int32) :: k

    so_far = sim%tally
    do k = 1, self%cuts%n
      call so_far%include(self%domain(k)%sim%tally)
    end do
  end function tally_now

  !> Events that may still come before a count is at its limit.
  pure function left(self, sim, goal) result(events)
    class(partition_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal
    real(real64) :: events

    events = min(real(goal%events - sim%tally%events - sum(self%domain%sim%tally%events), real64), &
      real(goal%collisions - sim%tally%collisions - sum(self%domain%sim%tally%collisions), real64))
  end function left

  !> Runs one window in all domains, which first take over what came of the one before. It ends early at the limit of a
  !> count. `good`: it holds.
  subroutine run_window(self, sim, goal, t, good)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal             !! its time counts since the epoch
    real(real64), intent(inout) :: t               !! since the epoch [time]
    logical, intent(out) :: good
    integer(int64) :: events
    integer(int32) :: k
    real(real64) :: t_begin, t_end

    events = sum(self%domain%sim%tally%events)
    t_begin = t
    t_end = self%window_end(sim, t, goal%time)
    call spend_time_on(part_refreshing)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call refresh(self%domain(k))
    end do
    !$omp end parallel do
    call spend_time_on(part_domains)
    self%domain%turns = 0
    do
      call self%stride(sim, goal, t, t_end)
      good = all(self%domain%done)
      if (.not. (good .and. t < t_end .and. self%left(sim, goal) > 0)) exit
      if (stop_requested()) exit
    end do
    call spend_time_on(part_verifying)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call verify(self%domain, k)
    end do
    !$omp end parallel do
    good = good .and. all(self%domain%good) .and. self%left(sim, goal) >= 0     ! else several at the last moment
    if (good) then
      call self%pace%learn(sum(self%domain%sim%tally%events) - events, sum(self%domain%turns), t - t_begin)
    else
      self%widening = min(self%widening + 2, self%halo)
    end if
  end subroutine run_window

  !> Lets all domains go on, to the end of the window unless a count would pass its limit: then most of the way there and,
  !> in the end, from event to event. However wrong the guess of the pace, no engine takes more than some turns.
  subroutine stride(self, sim, goal, t, t_end)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: goal
    real(real64), intent(inout) :: t               !! since the epoch [time]
    real(real64), intent(in) :: t_end              !! likewise
    integer(int64) :: turns
    integer(int32) :: k
    real(real64) :: sure

    turns = int(min(self%overload*self%pace%turns*self%expected(t_end - t), 1.0e15_real64), int64)
    sure = self%left(sim, goal)
    if (sure > self%expected(t_end - t)) then
      t = t_end
    else
      sure = 0.9_real64*sure - 5*sqrt(sure)
      if (sure < few_events) then
        call self%step(t, t_end)
        return
      end if
      t = min(t_end, t + sure/self%pace%events)
    end if
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call move_on(self%domain(k), t, turns)
    end do
    !$omp end parallel do
    call note_busy(sum(self%domain%busy))
  end subroutine stride

  !> Takes the next event, in the domains that expect it, or else goes to the end of the window: of simultaneous events
  !> only the one that the plain engine takes first.
  subroutine step(self, t, t_end)
    class(partition_t), intent(inout) :: self
    real(real64), intent(inout) :: t               !! since the epoch [time]
    real(real64), intent(in) :: t_end              !! likewise
    type(due_t) :: due(size(self%domain))
    integer(int32) :: k, first

    first = 1
    do k = 1, self%cuts%n
      due(k) = next_due(self%domain(k))
      if (due(k)%precedes(due(first))) first = k
    end do
    do k = 1, self%cuts%n
      if (due(first)%time > t_end) then
        call move_on(self%domain(k), t_end, 1_int64)
      else if (.not. due(first)%precedes(due(k))) then
        call follow_event(self%domain(k))
      else
        self%domain(k)%done = .true.               ! its turn comes later
      end if
    end do
    t = min(due(first)%time, t_end)
  end subroutine step

  !> Whether all that happens up to a time has happened.
  function is_past(self, t) result(yes)
    class(partition_t), intent(inout) :: self
    real(real64), intent(in) :: t                  !! since the epoch [time]
    logical :: yes
    type(due_t) :: due
    integer(int32) :: k

    yes = .true.
    do k = 1, self%cuts%n
      due = next_due(self%domain(k))
      yes = yes .and. due%time > t
    end do
  end function is_past

  !> Brings the whole simulation to the present; the domains go on from there.
  subroutine gather_all(self, sim, now)
    class(partition_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: now                !! since the epoch [time]
    integer(int32) :: k

    call spend_time_on(part_gathering)
    !$omp parallel do schedule(static, 1) num_threads(self%threads)
    do k = 1, self%cuts%n
      call gather(self%domain(k), sim)
      self%domain(k)%sim%now = now
    end do
    !$omp end parallel do
    sim%now = now
    do k = 1, self%cuts%n
      call sim%tally%include(self%domain(k)%sim%tally)
      call self%domain(k)%sim%tally%clear()
    end do
  end subroutine gather_all

end module partition
