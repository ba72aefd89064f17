!> One domain of a divided simulation, with its own event-driven engine. A domain owns the disks in
!> a rectangle of cells and contains ghosts (copies) of the disks in the halo around it. Rectangle
!> and halo form the extended domain, with the cells in `layout`. Disks that would enter the
!> extended domain during a time window are missing. Errors in the motion of ghosts therefore spread
!> inwards from the edge of the extended domain, until `domain_borders` corrects the ghosts after
!> the window.
module domains
  use kinds, only: int32, int64, real64
  use cell_layout, only: cell_layout_t
  use disks, only: disk_t, tag_t, whole_disk_t
  use errors, only: error_t
  use domain_engine, only: domain_engine_t
  use event_log, only: event_log_t
  use evolution, only: limits_t
  use partners, only: nothing
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use system, only: seconds
  implicit none
  private
  public :: advance_domain, correction_t, domain_t, forever, list_ghosts, load, merge_logs, next_time, slot_of_ghost, write_back

  real(real64), parameter :: forever = 2.0e150_real64      !! later than the time of any event
  !> Wall-clock time after which a domain abandons an incomplete window [s].
  real(real64), parameter :: longest_window = 5.0_real64
  !> Number of iterations between two checks of signals and of the clock.
  integer(int64), parameter :: iterations_between_checks = 100000
  !> A domain of n disks has n/spare + spare_at_least vacant slots (array elements without a disk),
  !> for disks that enter the extended domain.
  integer(int32), parameter :: spare = 32, spare_at_least = 200

  !> True state of a disk, which replaces or adds a ghost in a domain. If the disk has left the
  !> extended domain, its ghost is removed instead.
  type, extends(whole_disk_t) :: correction_t
    integer(int32) :: global_index = 0             !! index of the disk in the whole simulation
    !> Column and row of the disk in the extended domain; the disk may be outside it.
    integer(int32) :: cell(2) = 0
    integer(int32) :: slot = 0                     !! index of the ghost in this domain; 0 if there is none
  end type correction_t

  type :: domain_t
    !> First and last column and row of the domain in the whole grid.
    integer(int32) :: low(2) = 0, high(2) = 0
    integer(int32) :: halo = 0                     !! width of the halo [cells]
    !> Indices of the domains that own disks in this extended domain.
    integer(int32), allocatable :: neighbour(:)
    type(cell_layout_t) :: layout
    !> Owned disks and ghosts, with some vacant array elements (slots). The time origin is the same
    !> as in the whole simulation.
    type(simulation_t) :: sim
    type(domain_engine_t) :: engine
    !> Index of each disk in the whole simulation. The elements of vacant slots form a linked list.
    integer(int32), allocatable :: global_index(:)
    integer(int32) :: vacant = 0                   !! index of the first vacant slot; 0 if there is none
    type(event_log_t), allocatable :: log          !! log of the collisions counted by this domain
    integer(int64) :: iterations = 0               !! number of iterations of the engine in the present window
    logical :: done = .false.                      !! whether the engine has reached the end of the window
    logical :: valid = .false.                     !! whether no owned disk can have touched a wrong ghost
    integer(int32) :: n_corrections = 0
    !> Corrections to be applied; size at least n_corrections.
    type(correction_t), allocatable :: corrections(:)
    !> Hash table of the ids and slots of the ghosts; indices 0:last_key.
    integer(int32), allocatable, private :: key(:), slot(:)
    integer(int32), private :: last_key = 0        !! largest index of the hash table: a power of two minus 1
  end type domain_t

contains

  !> Loads the disks of the extended domain and predicts their events.
  subroutine load(self, sim, disks)
    type(domain_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: disks(:)         !! indices of the disks in the extended domain
    integer(int32) :: i, n, slots

    n = size(disks, kind=int32)
    call make_room()
    do i = 1, n
      call self%sim%place_disk(i, sim%whole_disk(disks(i)))
    end do
    self%global_index(:n) = disks
    slots = self%sim%n_disks()
    do i = n + 1, slots
      self%sim%disk(i) = disk_t(event_time=forever, partner=nothing)
      self%sim%tag(i) = tag_t()
      self%global_index(i) = merge(i + 1, 0, i < slots)
    end do
    self%vacant = n + 1
    self%n_corrections = 0
    self%valid = .true.
    self%sim%now = sim%now
    self%sim%box%epoch = sim%box%epoch
    if (allocated(self%log)) self%log%n = 0
    self%sim%tally = sim%tally
    call self%sim%tally%clear()
    call start()
  contains

    !> Allocates slots for n disks, and vacant ones.
    subroutine make_room()
      integer(int32) :: slots

      if (.not. allocated(self%sim%species)) then
        self%sim%specification_t = sim%specification_t
        self%sim%box = sim%box
        self%sim%epoch_end = forever
        allocate (self%engine%search)
        self%engine%is_part = .true.
      end if
      slots = n + n/spare + spare_at_least
      if (allocated(self%global_index)) then
        if (size(self%global_index) > n + spare_at_least/2 .and. size(self%global_index) < 2*slots) return
        deallocate (self%sim%disk, self%sim%tag, self%global_index)
        if (allocated(self%sim%own_mass)) deallocate (self%sim%own_mass)
        if (allocated(self%sim%extra)) deallocate (self%sim%extra)
      end if
      allocate (self%global_index(slots))
      call self%sim%make_room(slots, like=sim)
    end subroutine make_room

    !> Sets up the cells and the event queue for the first n slots.
    subroutine start()
      logical :: cut_low(2), cut_high(2)
      integer(int32) :: k

      self%engine%search%is_part = .true.
      self%engine%search%layout = self%layout
      associate (layout => self%layout, histories => self%engine%histories)
        histories%layout = self%layout
        histories%own_low = modulo(self%low - layout%first, layout%whole) + 1
        histories%own_high = histories%own_low + self%high - self%low
        cut_low = histories%own_low > 1
        cut_high = histories%own_high < layout%n
        histories%deep_low = histories%own_low + merge(self%halo, 0, cut_low)
        histories%deep_high = histories%own_high - merge(self%halo, 0, cut_high)
        histories%safe_low = merge(2, 1, cut_low .and. (self%sim%box%periodic .or. layout%first > 1))
        histories%safe_high = layout%n - merge(1, 0, cut_high .and. (self%sim%box%periodic &
          .or. layout%first + layout%n - 1 < layout%whole))
        if (allocated(histories%reached)) deallocate (histories%reached)
        allocate (histories%reached(0:layout%n(1) + 1, 0:layout%n(2) + 1))
        if (allocated(histories%history_of)) deallocate (histories%history_of)
        allocate (histories%history_of(self%sim%n_disks()), source=0)
        if (.not. allocated(histories%history)) allocate (histories%history(1024))
        call self%engine%start(self%sim)
        call histories%begin_window()
        histories%n_histories = 0
        do k = 1, n
          call histories%begin_history(self%sim%tag(k)%cell, k)
        end do
      end associate
      call list_ghosts(self)
    end subroutine start
  end subroutine load

  !> Builds the hash table for finding ghosts by their ids.
  subroutine list_ghosts(self)
    type(domain_t), intent(inout) :: self
    integer(int32) :: k, place, ghosts

    ghosts = self%engine%histories%n_ghosts()
    if (.not. allocated(self%key) .or. 3*ghosts > 2*self%last_key) then
      self%last_key = 255
      do while (self%last_key < 2*ghosts)
        self%last_key = 2*self%last_key + 1
      end do
      if (allocated(self%key)) deallocate (self%key, self%slot)
      allocate (self%key(0:self%last_key), self%slot(0:self%last_key))
    end if
    self%key = 0
    do k = 1, self%engine%histories%n_histories
      associate (history => self%engine%histories%history(k))
        if (history%own) cycle
        place = place_of(self, self%sim%tag(history%slot)%id)
        self%key(place) = self%sim%tag(history%slot)%id
        self%slot(place) = history%slot
      end associate
    end do
  end subroutine list_ghosts

  !> Position of an id in the hash table, or the free position where it would be stored.
  pure function place_of(self, id) result(place)
    type(domain_t), intent(in) :: self
    integer(int32), intent(in) :: id
    integer(int32) :: place

    place = iand(int(ishft(id*2654435769_int64, -12), int32), self%last_key)
    do while (self%key(place) /= 0 .and. self%key(place) /= id)
      place = iand(place + 1, self%last_key)
    end do
  end function place_of

  !> Slot of the ghost with the given id; 0 if the domain has none.
  pure function slot_of_ghost(self, id) result(slot)
    type(domain_t), intent(in) :: self
    integer(int32), intent(in) :: id
    integer(int32) :: slot, place

    place = place_of(self, id)
    slot = 0
    if (self%key(place) == id) slot = self%slot(place)
  end function slot_of_ghost

  !> Advances the domain and its ghosts to the end of a window. The domain abandons the window once
  !> its engine has done the given number of iterations or has run for `longest_window`.
  subroutine advance_domain(self, t_end, iterations)
    type(domain_t), intent(inout) :: self
    real(real64), intent(in) :: t_end              !! end of the window, relative to `box%epoch` [time]
    integer(int64), intent(in) :: iterations
    type(limits_t) :: limits
    type(error_t), allocatable :: error
    real(real64) :: began                          ! [s]
    integer(int64) :: iterations_left

    self%done = .false.
    if (.not. self%valid) return                   ! invalid: too few slots for all ghosts
    began = seconds()
    limits%time = t_end
    iterations_left = iterations
    do while (iterations_left > 0)
      limits%iterations = min(iterations_left, iterations_between_checks)
      call self%engine%advance(self%sim, limits, error, self%log)
      iterations_left = iterations_left - (limits%iterations - self%engine%iterations_left)
      if (allocated(error)) exit
      self%done = self%engine%arrived
      if (self%done) exit
      if (stop_requested()) exit
      if (seconds() - began > longest_window) exit
    end do
    self%iterations = self%iterations + iterations - iterations_left
  end subroutine advance_domain

  !> Time of the next event in the domain.
  function next_time(self) result(t)
    type(domain_t), intent(inout) :: self
    real(real64) :: t                              !! relative to `box%epoch` [time]
    integer(int32) :: i

    call self%engine%queue%first(self%sim%disk, self%sim%tag, i)
    t = self%sim%disk(i)%event_time
  end function next_time

  !> Copies the states of the owned disks to the whole simulation.
  subroutine write_back(self, sim)
    type(domain_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: k

    do k = 1, self%sim%n_disks()
      if (self%sim%tag(k)%id == 0 .or. .not. self%engine%histories%is_own(k)) cycle
      call sim%place_disk(self%global_index(k), self%sim%whole_disk(k))
    end do
  end subroutine write_back

  !> Merges the log entries of all domains, sorted by time, into the log of the whole simulation. If
  !> collisions in different domains are simultaneous, their order is unknown, and `good` is set to
  !> .false.
  subroutine merge_logs(domain, log, good)
    type(domain_t), intent(inout) :: domain(:)
    type(event_log_t), intent(inout) :: log
    logical, intent(out) :: good
    integer :: next(size(domain)), k, m
    real(real64) :: head(size(domain))

    good = .true.
    next = 1
    do
      head = huge(head)
      do k = 1, size(domain)
        if (next(k) <= domain(k)%log%n) head(k) = domain(k)%log%record(1, next(k))
      end do
      m = minloc(head, dim=1)
      if (.not. head(m) < huge(head)) exit
      good = good .and. count(head <= head(m)) == 1
      call log%append(domain(m)%log%record(:, next(m)))
      next(m) = next(m) + 1
    end do
    do k = 1, size(domain)
      domain(k)%log%n = 0
    end do
  end subroutine merge_logs

end module domains
