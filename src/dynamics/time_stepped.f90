!> Time-stepped dynamics: exact free flight over a fixed step; then every disk beyond a wall is reflected, and every
!> pair that overlaps and approaches collides once. A contact is noticed up to one step late, a short one not at all:
!> this is the method to compare the event-driven one with.
!>
!> As there, a disk's own state changes only at its own collisions, so no error accumulates from step to step.
module time_stepped
  use images, only: images_t
  use kinds, only: int32, int64, most_exact, never, real64
  use box_geometry, only: box_t, strike_velocity, wall_normal
  use box_sides, only: bounds
  use disks, only: disk_t
  use encounters, only: collide, encounter_text, pass_side, passes
  use errors, only: error_t, exit_broken, fail
  use evolution, only: evolution_t, limits_t
  use free_flight, only: flight, slowest
  use near_pairs, only: near_pairs_t
  use pair_lists, only: list_pairs, pair_list_t, places_t
  use partners, only: axis_of, n_sides, nothing, sense_of
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use texts, only: written
  implicit none
  private
  public :: time_stepped_t

  !> A disk should move less than this share of the smallest radius in one step.
  real(real64), parameter :: longest_way = 0.5_real64
  integer(int64), parameter :: steps_per_look = 1024  !! whether anything still moves
  integer(int32), parameter :: many = 5000            !! disks: to test all pairs takes long

  type, extends(evolution_t) :: time_stepped_t
    real(real64) :: dt = 0.0_real64                 !! [time]
    logical :: every_pair = .false.                 !! test all pairs at every step, not only near ones
    type(near_pairs_t), private :: near
    ! Of the current step
    type(places_t), private :: at                   !! where they are
    integer(int32), allocatable, private :: outside(:)  !! (disks) those beyond a side come first
    type(pair_list_t), private :: contacts
  contains
    procedure :: warning
    procedure :: pause_at
    procedure :: start
    procedure :: renew
    procedure :: advance
  end type time_stepped_t

contains

  !> Makes room for positions, and forgets near pairs.
  subroutine start(self, sim)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    if (allocated(self%outside)) deallocate (self%at%x, self%outside)
    allocate (self%at%x(sim%n_disks(), 2), self%outside(sim%n_disks()))
    self%at%radius = sim%disk%radius
    self%at%period = sim%box%periods()
    call self%near%start()
    call sim%start_sums()
    self%idle = .false.
  end subroutine start

  !> The end of the step that contains a time.
  pure function pause_at(self, time) result(t)
    class(time_stepped_t), intent(in) :: self
    real(real64), intent(in) :: time               !! since the start of the run
    real(real64) :: t                              !! likewise

    t = time
    if (time > most_exact*self%dt) return
    t = steps_taken(time, self%dt)*self%dt
    if (t < time) t = (steps_taken(time, self%dt) + 1)*self%dt
  end function pause_at

  !> Near pairs stay near however fast they become: only what was at rest may move.
  subroutine renew(self, sim, changed)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)

    self%idle = .false.
  end subroutine renew

  !> Takes steps; the k-th is at the time k*dt, wherever this paused before.
  subroutine advance(self, sim, limits, error)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(simulation_t) :: before
    integer(int64) :: k, turn
    integer :: logged

    self%arrived = .false.
    k = steps_taken(sim%now, self%dt)
    do turn = 1, limits%turns
      if (limits%reached(sim%tally) .or. self%log%is_full()) return
      if (modulo(k, steps_per_look) == 0) self%idle = at_rest(sim)
      if (self%idle .or. (k + 1)*self%dt > limits%time - sim%epoch) then
        if (limits%time < never) sim%now = max(sim%now, limits%time - sim%epoch)
        self%arrived = .true.
        return
      end if
      if (slow(self, sim)) before = sim
      logged = self%log%n
      k = k + 1
      sim%now = k*self%dt
      call take_step(self, sim, error)
      if (allocated(error)) return
      if (.not. slow(self, sim)) cycle
      if (stop_requested()) then                    ! the step is not complete
        sim = before
        self%log%n = logged
        return
      end if
    end do
  end subroutine advance

  !> Whether a step takes so long that a request to stop cannot wait for its end.
  pure function slow(self, sim) result(yes)
    class(time_stepped_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = self%every_pair .and. sim%n_disks() > many
  end function slow

  !> The largest k with k*dt <= now: it follows from the state alone.
  pure function steps_taken(now, dt) result(k)
    real(real64), intent(in) :: now, dt             !! [time]
    integer(int64) :: k

    k = nint(now/dt, int64) + 1
    do while (k*dt > now)
      k = k - 1
    end do
  end function steps_taken

  !> Whether nothing moves and nothing ever will.
  pure function at_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    integer(int32) :: i

    yes = .not. (sim%box%falling() .or. any(sim%box%side%motion%travels()))
    do i = 1, sim%n_disks()
      if (.not. yes) return
      yes = .not. any(abs(sim%disk(i)%v) > slowest)
    end do
  end function at_rest

  !> All collisions at `sim%now`: first sides, then obstacles, then pairs of disks, each in ascending order, so that the
  !> result does not depend on how they are found.
  subroutine take_step(self, sim, error)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(inout) :: error
    integer(int32) :: n_outside, i
    integer :: k

    call fly(sim%disk, sim%box, sim%now, self%at, self%outside, n_outside)
    do k = 1, n_outside
      i = self%outside(k)
      if (any(self%at%centre(i) /= self%at%centre(i))) then
        call fail(error, exit_broken, "a position became NaN: "//encounter_text(sim, i, nothing))
        return
      end if
      call meet_sides(self, sim, i)
    end do
    if (self%every_pair) then
      call list_pairs(self%contacts, sim%box, self%at, 0.0_real64, interruptible=slow(self, sim))
    else
      call self%near%find_contacts(sim, self%at, self%dt, self%contacts)
    end if
    do k = 1, self%contacts%n
      associate (i => self%contacts%i(k), partner => self%contacts%partner(k))
        if (partner > 0) then
          call meet_disk(self, sim, i, partner)
        else
          call meet_wall(self, sim, i, partner)
        end if
      end associate
    end do
  end subroutine take_step

  !> Where the disks are at t, and which of them are beyond a side (or nowhere: NaN). That is seldom, and tested in
  !> vector registers.
  pure subroutine fly(disk, box, t, at, outside, n)
    type(disk_t), intent(in) :: disk(:)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: t                   !! since the epoch [time]
    type(places_t), intent(inout) :: at
    integer(int32), intent(out) :: outside(*)       !! (disks) the first n count, ascending
    integer(int32), intent(out) :: n
    real(real64) :: g(2), s, side(2, 2)
    integer(int32) :: i, k, hit

    g = box%gravity
    do i = 1, size(disk, kind=int32)
      s = t - disk(i)%clock
      at%x(i, 1) = flight(disk(i)%x(1), disk(i)%v(1), g(1), s)
      at%x(i, 2) = flight(disk(i)%x(2), disk(i)%v(2), g(2), s)
    end do
    call bounds(box, t, side(:, 1), side(:, 2))
    call mark_outside(size(disk), at%x, at%radius, side, box%periodic, outside, n)
    if (n == 0) return
    n = 0
    do k = 1, size(disk, kind=int32)
      hit = outside(k)
      outside(n + 1) = k
      n = n + hit
    end do
  end subroutine fly

  !> Marks with 1 the disks that are not between the sides.
  pure subroutine mark_outside(n, x, radius, side, periodic, hit, n_hits)
    integer, intent(in) :: n
    real(real64), intent(in) :: x(n, 2), radius(n)        !! [length]
    real(real64), intent(in) :: side(2, 2)                !! where they are: by axis, lower and upper [length]
    logical, intent(in) :: periodic(2)
    integer(int32), intent(out) :: hit(n)
    integer(int32), intent(out) :: n_hits           !! how many
    real(real64) :: inset(2)
    integer :: i

    inset = merge(0.0_real64, 1.0_real64, periodic)
    n_hits = 0
    !GCC$ VECTOR
    do i = 1, n
      hit(i) = 1 - iand(between(x(i, 1), side(1, 1) + inset(1)*radius(i), side(1, 2) - inset(1)*radius(i)), &
        between(x(i, 2), side(2, 1) + inset(2)*radius(i), side(2, 2) - inset(2)*radius(i)))
      n_hits = n_hits + hit(i)
    end do
  end subroutine mark_outside

  !> 1 if x is between two limits, else (or if it is NaN) 0.
  elemental function between(x, low, high) result(inside)
    real(real64), intent(in) :: x, low, high
    integer(int32) :: inside

    inside = iand(merge(1, 0, x >= low), merge(1, 0, x <= high))
  end function between

  !> Takes disk i through the periodic sides that it is beyond, and reflects it at walls.
  subroutine meet_sides(self, sim, i)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: beyond, inset, before(2), low(2), high(2)
    integer(int32) :: side
    integer :: axis

    call bounds(sim%box, sim%now, low, high)
    do side = 0, 1 - n_sides, -1
      axis = axis_of(side)
      inset = merge(0.0_real64, sim%disk(i)%radius, sim%box%periodic(axis))
      if (sense_of(side) < 0) then
        beyond = (low(axis) + inset) - self%at%x(i, axis)
      else
        beyond = self%at%x(i, axis) - (high(axis) - inset)
      end if
      if (.not. beyond > 0) cycle
      if (passes(sim, side)) then
        before = self%at%centre(i)
        call pass_side(sim, i, side, sim%now)
        self%at%x(i, :) = sim%position(i)
        call self%near%shift(i, self%at%centre(i) - before)
      else
        call meet_wall(self, sim, i, side)
      end if
    end do
  end subroutine meet_sides

  !> Reflects disk i, which is beyond a side or an obstacle, if it moves further out of it. It keeps its position and so
  !> its potential energy.
  subroutine meet_wall(self, sim, i, code)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64) :: normal(2)

    normal = wall_normal(sim%box, code, self%at%centre(i), sim%velocity(i))
    if (dot_product(sim%velocity(i) - strike_velocity(sim%box, code, normal, sim%now), normal) < 0) &
      call collide(sim, i, code, sim%now, .true., self%log)
  end subroutine meet_wall

  !> Collides the disks i < j, which overlap, if they approach.
  subroutine meet_disk(self, sim, i, j)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    type(images_t) :: images
    real(real64) :: dx(2)

    images = sim%box%images()
    dx = self%at%centre(j) - self%at%centre(i)
    dx = dx + images%shift(images%nearest_image(dx))
    if (dot_product(dx, sim%velocity(j) - sim%velocity(i)) < 0) call collide(sim, i, j, sim%now, .true., self%log)
  end subroutine meet_disk

  !> What is wrong with the step; empty if nothing is. The fastest disk may fall through the whole box and then has the
  !> speed v0 + sqrt(2 g L). A disk that loses energy in every step of a lasting contact sinks by up to g dt**2/2 per
  !> step under gravity; the TC model prevents it.
  pure function warning(self, sim) result(text)
    class(time_stepped_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text
    real(real64) :: speed, radius
    integer(int32) :: i

    text = ""
    speed = 0
    do i = 1, sim%n_disks()
      speed = max(speed, norm2(sim%velocity(i)))
    end do
    speed = speed + sqrt(2*sum(abs(sim%box%gravity)*sim%box%edges())) + sim%box%highest_speed()
    radius = minval(sim%disk%radius)
    if (speed*self%dt > longest_way*radius) then
      text = "run.dt: at speeds up to "//about(speed)//" a disk moves by "//about(speed*self%dt/radius) &
        //" radii in a step, so that collisions are missed; better: below "//about(longest_way*radius/speed)
    end if
    if (sim%box%falling() .and. sim%law%contact_time <= self%dt &
      .and. (any(sim%law%restitution < 1) .or. sim%box%has_lossy_walls())) then
      if (text /= "") text = text//"; "
      text = text//"contact.contact_time: inelastic disks sink into each other and the floor unless it " &
        //"is more than run.dt"
    end if
  end function warning

  !> A number with three significant digits.
  pure function about(number) result(text)
    real(real64), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=12) :: buffer
    real(real64) :: rounded

    write (buffer, "(es12.2e3)") number
    read (buffer, *) rounded
    text = written(rounded)
  end function about
end module time_stepped
