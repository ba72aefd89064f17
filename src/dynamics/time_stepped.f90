!> Time-stepped dynamics. In each step of fixed length, all disks first move in exact free flight.
!> Then each disk beyond a wall is reflected, and each pair of overlapping, approaching disks
!> collides once. A contact is detected up to one step late, and missed if it begins and ends within
!> a step. The method exists for comparison with event-driven dynamics.
!>
!> As in event-driven dynamics, the stored state of a disk changes only in its collisions, so that
!> rounding errors do not accumulate from step to step.
module time_stepped
  use images, only: images_t
  use kinds, only: int32, int64, largest_exact, never, real64
  use box_geometry, only: wall_normal
  use box_state, only: bounds, normal_surface_velocity
  use encounters, only: collide, depart, encounter_text, is_passage, pass_side
  use errors, only: error_t, exit_broken, fail
  use event_log, only: event_log_t, is_full
  use evolution, only: evolution_t, limits_t
  use free_flight, only: flight, negligible_speed
  use verlet_list, only: verlet_list_t
  use partners, only: axis_of, n_sides, nothing, sense_of
  use signals, only: stop_requested
  use simulation_state, only: simulation_t
  use texts, only: about
  implicit none
  private
  public :: time_stepped_t

  !> Maximum recommended displacement per step, relative to the smallest radius.
  real(real64), parameter :: longest_way = 0.5_real64
  !> Number of steps between two tests of whether any disk moves.
  integer(int64), parameter :: steps_per_look = 1024

  type, extends(evolution_t) :: time_stepped_t
    real(real64) :: dt = 0.0_real64                 !! [time]
    !> Whether all pairs are tested in every step, instead of only those in the Verlet lists.
    logical :: every_pair = .false.
    type(verlet_list_t), private :: near
    ! The coordinates are stored separately from the disks, so that loops can be vectorised.
    real(real64), allocatable, private :: x(:, :)    !! positions in this step; shape (disks, 2) [length]
    real(real64), allocatable, private :: radius(:)  !! radius of each disk [length]
    integer(int32), allocatable, private :: outside(:)   !! 1 for each disk beyond a side, otherwise 0
  contains
    procedure :: warning
    procedure :: pause_at
    procedure :: start
    procedure :: renew
    procedure :: advance
  end type time_stepped_t

contains

  !> Allocates the positions and deletes the Verlet lists.
  subroutine start(self, sim)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim

    if (allocated(self%x)) deallocate (self%x, self%outside)
    allocate (self%x(sim%n_disks(), 2))
    self%radius = sim%disk%radius
    allocate (self%outside(sim%n_disks()))
    self%near = verlet_list_t()
    call sim%start_sums()
    self%idle = .false.
  end subroutine start

  !> End of the time step that contains a given time.
  pure function pause_at(self, time) result(t)
    class(time_stepped_t), intent(in) :: self
    real(real64), intent(in) :: time               !! since the start of the run [time]
    real(real64) :: t                              !! since the start of the run [time]

    t = time
    if (time > largest_exact*self%dt) return
    t = steps_taken(time, self%dt)*self%dt
    if (t < time) t = (steps_taken(time, self%dt) + 1)*self%dt
  end function pause_at

  !> Prepares the dynamics for continuing after velocities have been changed. Disks that were at
  !> rest may move again. The Verlet lists stay valid, because they do not depend on velocities.
  subroutine renew(self, sim, changed)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: changed(:)

    self%idle = .false.
  end subroutine renew

  !> Executes steps. Step k ends at the time k*dt, whenever earlier calls of `advance` returned.
  subroutine advance(self, sim, limits, error, log)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    type(event_log_t), intent(inout), optional :: log
    integer(int64) :: k, departures

    departures = sum(sim%tally%left)
    self%arrived = .not. sim%now < limits%time      ! all limits are tested at the end of a step
    self%iterations_left = limits%iterations
    k = steps_taken(sim%now, self%dt)
    do while (self%iterations_left > 0)
      if (limits%reached(sim%tally) .or. is_full(log)) return
      if (modulo(k, steps_per_look) == 0) self%idle = at_rest(sim)
      if (self%idle .or. (k + 1)*self%dt > limits%time) then
        if (limits%time < never) sim%now = max(sim%now, limits%time)
        self%arrived = .true.
        return
      end if
      k = k + 1
      call take_step(self, sim, k*self%dt, error, log)
      if (allocated(error) .or. sim%now < k*self%dt) return
      self%iterations_left = self%iterations_left - 1
      self%arrived = .not. sim%now < limits%time
      if (sum(sim%tally%left) > departures) return   ! the caller asks the sources whether a disk enters
    end do
  end subroutine advance

  !> Number of steps before the present time: the largest integer k with k*dt <= now.
  pure function steps_taken(now, dt) result(k)
    real(real64), intent(in) :: now, dt             !! [time]
    integer(int64) :: k

    k = nint(now/dt, int64) + 1
    do while (k*dt > now)
      k = k - 1
    end do
  end function steps_taken

  !> True if all disks are at rest, and no force or side can set them in motion.
  pure function at_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    integer(int32) :: i

    yes = .not. (sim%box%has_gravity() .or. any(sim%box%side%moves()))
    do i = 1, sim%n_disks()
      if (.not. yes) return
      yes = .not. any(abs(sim%disk(i)%v) > negligible_speed)
    end do
  end function at_rest

  !> Advances all disks to the time t and executes all collisions that are due: first with sides,
  !> then with obstacles, then between disks. Within each group, collisions are executed in the
  !> order of the disk indices, so the result does not depend on how pairs are searched for. If a
  !> stop is requested during a long search, the procedure returns early and leaves the state
  !> unchanged.
  subroutine take_step(self, sim, t, error, log)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: t
    type(error_t), allocatable, intent(inout) :: error
    type(event_log_t), intent(inout), optional :: log
    integer(int32) :: i, k

    do i = 1, sim%n_disks()
      associate (d => sim%disk(i), g => sim%box%gravity)
        self%x(i, 1) = flight(d%x(1), d%v(1), g(1), t - d%clock)
        self%x(i, 2) = flight(d%x(2), d%v(2), g(2), t - d%clock)
      end associate
    end do
    do i = 1, merge(sim%n_disks(), 0_int32, allocated(sim%waits))
      if (.not. sim%is_inside(i)) self%x(i, :) = sim%disk(i)%x       ! gravity does not act on waiting disks
    end do
    call self%near%update(sim, self%x, self%dt, self%every_pair)
    if (self%every_pair) then
      if (stop_requested()) return
    end if
    sim%now = t
    call mark_outside(self, sim)
    i = next_marked(self%outside, 0)
    do while (i > 0)
      if (any(self%x(i, :) /= self%x(i, :))) then
        call fail(error, exit_broken, "a position became NaN: "//encounter_text(sim, i, nothing))
        return
      end if
      if (sim%is_inside(i)) call meet_sides()
      i = next_marked(self%outside, i)
    end do
    call self%near%mark_overlaps(sim%box%box_t, self%x, self%radius)
    k = next_marked(self%near%hit(:self%near%n), 0)
    do while (k > 0)
      associate (i => self%near%i(k), partner => self%near%partner(k))
        if (partner > 0) then
          call meet_disk(i, partner)
        else
          call meet_wall(i, partner)
        end if
      end associate
      k = next_marked(self%near%hit(:self%near%n), k)
    end do
  contains

    !> Moves disk i through the periodic sides that it has passed, reflects it at walls, and lets it
    !> leave through open sides.
    subroutine meet_sides()
      real(real64) :: beyond, inset, before(2), low(2), high(2)
      integer(int32) :: side
      integer :: axis

      call bounds(sim%box, sim%now, low, high)
      do side = 0, 1 - n_sides, -1
        axis = axis_of(side)
        inset = merge(0.0_real64, sim%disk(i)%radius, is_passage(sim, side))
        if (sense_of(side) < 0) then
          beyond = (low(axis) + inset) - self%x(i, axis)
        else
          beyond = self%x(i, axis) - (high(axis) - inset)
        end if
        if (.not. beyond > 0) cycle
        if (sim%box%open(1 - side)) then
          call depart(sim, i, side, sim%now, log)
          call self%near%remove(i)
          return
        else if (sim%box%periodic(axis)) then
          before = self%x(i, :)
          call pass_side(sim, i, side, sim%now)
          self%x(i, :) = sim%position(i)
          call self%near%shift(i, self%x(i, :) - before)
        else
          call meet_wall(i, side)
        end if
      end do
    end subroutine meet_sides

    !> Reflects disk i, which overlaps a wall (a side or an obstacle), if it is moving further into
    !> it. Position and potential energy do not change.
    subroutine meet_wall(i, code)
      integer(int32), intent(in) :: i, code
      real(real64) :: normal(2)

      normal = wall_normal(sim%box%box_t, code, [self%x(i, 1), self%x(i, 2)], sim%velocity(i))
      if (dot_product(sim%velocity(i) - normal_surface_velocity(sim%box, code, normal, sim%now), normal) < 0) &
        call collide(sim, i, code, sim%now, .true., log)
    end subroutine meet_wall

    !> Executes the collision of the overlapping disks i and j (i < j) if they approach each other.
    subroutine meet_disk(i, j)
      integer(int32), intent(in) :: i, j
      type(images_t) :: images
      real(real64) :: dx(2)

      images = sim%box%images()
      dx = self%x(j, :) - self%x(i, :)
      dx = dx + images%shift(images%nearest_image(dx))
      if (dot_product(dx, sim%velocity(j) - sim%velocity(i)) < 0) call collide(sim, i, j, sim%now, .true., log)
    end subroutine meet_disk
  end subroutine take_step

  !> Index of the first element after index `after` that is 1; 0 if there is none.
  pure function next_marked(mark, after) result(k)
    integer(int32), contiguous, intent(in) :: mark(:)
    integer(int32), intent(in) :: after
    integer(int32) :: k

    do k = after + 1, size(mark, kind=int32)
      if (mark(k) > 0) return
    end do
    k = 0
  end function next_marked

  !> Sets `outside` to 1 for disks that are not between the sides or have a NaN position, and to 0
  !> for all others.
  pure subroutine mark_outside(self, sim)
    class(time_stepped_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    real(real64) :: low(2), high(2), inset(2)
    integer :: i

    call bounds(sim%box, sim%now, low, high)
    inset = merge(0.0_real64, 1.0_real64, sim%box%periodic)
    associate (x => self%x, radius => self%radius)
      !GCC$ VECTOR
      do i = 1, size(radius)
        self%outside(i) = 1 - iand(between(x(i, 1), low(1) + inset(1)*radius(i), high(1) - inset(1)*radius(i)), &
          between(x(i, 2), low(2) + inset(2)*radius(i), high(2) - inset(2)*radius(i)))
      end do
    end associate
  end subroutine mark_outside

  !> 1 if x is between two limits; 0 if x is outside the limits or NaN.
  elemental function between(x, low, high) result(inside)
    real(real64), intent(in) :: x, low, high
    integer(int32) :: inside

    inside = iand(merge(1, 0, x >= low), merge(1, 0, x <= high))
  end function between

  !> Warning about the length of the step; empty if it is suitable. The maximum speed under gravity
  !> is estimated as v0 + sqrt(2 g L), for the fastest disk falling through the whole box of length
  !> L. Under gravity a disk can stay in contact with a surface for many steps. Without the TC model
  !> it then dissipates energy in every step, and sinks by up to g dt**2/2 per step.
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
    if (sim%box%has_gravity() .and. sim%law%contact_time <= self%dt &
      .and. (sim%law%is_inelastic() .or. sim%box%has_lossy_walls())) then
      if (text /= "") text = text//"; "
      text = text//"contact.contact_time: inelastic disks sink into each other and the floor unless it " &
        //"is more than run.dt"
    end if
  end function warning

end module time_stepped
