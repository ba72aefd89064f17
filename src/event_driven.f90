!> Event-driven dynamics: exact, from collision to collision. Each disk expects one event, the earliest it can
!> have; when it comes, the disks concerned collide and predict anew.
!>
!> What a disk expects turns stale when its partner collides first. Nobody looks for such events: the
!> partner's stamp shows it when the event comes up, and the disk only predicts again.
module event_driven
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: box_t, first_obstacle
  use collisions, only: pair_impulse, wall_rebound
  use disks, only: disk_t
  use errors, only: error_t, exit_broken, fail
  use event_queue, only: event_queue_t
  use evolution, only: evolution_t, limits_t
  use free_flight, only: flight, flight_velocity
  use neighbour_search, only: first_crossing, neighbour_search_t
  use renumbering, only: renumber
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: event_driven_t

  !> Pair collisions per disk after which the origin of time moves, so that times keep their digits.
  integer(int64), parameter :: epoch_length = 20
  integer, parameter :: significant_bits = 20      !! of an epoch: sums of epochs are exact
  integer(int64), parameter :: patience = 20000    !! events between two looks at the clock
  real(real64), parameter :: last_time = 0.5_real64*never
  character(len=6), parameter :: side_name(4) = ["left  ", "right ", "bottom", "top   "]

  type, extends(evolution_t) :: event_driven_t
    class(neighbour_search_t), allocatable :: search
    type(event_queue_t) :: queue
    logical :: calendar = .true.                   !! the queue is a calendar, else the heap alone
    ! Watch over the clock: a collapse is an endless series of events in no time.
    real(real64), private :: blink = 0.0_real64    !! a time in which nothing can move visibly [time]
    real(real64), private :: last_look = 0.0_real64  !! [time]
    integer(int64), private :: events_since = 0    !! the last look
  contains
    procedure :: start
    procedure :: advance
    procedure, private :: react
    procedure, private :: expect_everything
    procedure, private :: predict
    procedure, private :: watch
    procedure, private :: move_epoch
  end type event_driven_t

contains

  subroutine start(self, sim)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i
    real(real64) :: fastest
    call self%expect_everything(sim)
    fastest = norm2(sim%box%gravity)*minval(sim%disk%radius)
    do i = 1, sim%n_disks()
      fastest = max(fastest, dot_product(sim%disk(i)%v, sim%disk(i)%v))
    end do
    self%blink = 1.0e-9_real64*minval(sim%disk%radius)/sqrt(max(fastest, tiny(fastest)))
    self%last_look = sim%now
    self%events_since = 0
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

  subroutine advance(self, sim, limits, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(out) :: error
    real(real64) :: t
    integer(int64) :: turn
    integer(int32) :: i
    do turn = 1, limits%turns
      if (sim%events >= limits%events .or. sim%collisions >= limits%collisions &
        .or. sim%dissipated >= limits%dissipated) return
      if (sim%events >= sim%next_epoch) call self%move_epoch(sim)
      call self%queue%first(sim%disk, sim%tag, i)
      t = sim%disk(i)%event_time
      if (.not. t <= min(limits%time - sim%epoch, last_time)) then
        if (t /= t) call fail(error, exit_broken, "a time became NaN: "//moment(sim, i))
        self%idle = t > last_time
        if (limits%time < last_time) sim%now = max(sim%now, limits%time - sim%epoch)
        return
      end if
      call self%queue%drop_first(sim%tag, i)
      sim%now = max(sim%now, t)
      call self%react(sim, i)
      self%events_since = self%events_since + 1
      if (self%events_since > patience) call self%watch(sim, i, error)
      if (allocated(error)) return
    end do
  end subroutine advance

  !> Executes what disk i expects, now.
  subroutine react(self, sim, i)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32) :: code, k
    code = sim%disk(i)%partner
    if (code > 0) then
      if (sim%disk(code)%stamp == sim%tag(i)%partner_stamp) then
        call collide_pair(sim, min(i, code), max(i, code), sim%disk(i)%event_time)
        call self%predict(sim, i)
        call self%predict(sim, code)
      else
        call self%predict(sim, i)
        return
      end if
    else if (code <= first_crossing) then
      call self%search%cross(sim, i, code)
      call self%predict(sim, i)
      return
    else if (passes(sim, code)) then
      call pass_side(sim, i, code)
      call self%search%cross(sim, i, code)
      call self%predict(sim, i)
    else
      call collide_wall(sim, i, code, sim%disk(i)%event_time)
      call self%predict(sim, i)
    end if
    if (self%search%everyone) then
      do k = 1, sim%n_disks()
        call self%predict(sim, k)
      end do
    end if
  end subroutine react

  subroutine predict(self, sim, i)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    call self%search%predict(sim, i)
    call self%queue%schedule(sim%disk, sim%tag, i)
  end subroutine predict

  !> Brings a disk's own state to the time t.
  pure subroutine land(disk, gravity, t)
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: gravity(2), t
    disk%x = flight(disk%x, disk%v, gravity, t - disk%clock)
    disk%v = flight_velocity(disk%v, gravity, t - disk%clock)
    disk%clock = t
    disk%stamp = disk%stamp + 1
  end subroutine land

  !> Whether a contact of disk i at t counts as elastic because its last one is not over (TC model).
  pure function in_contact(sim, i, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t
    logical :: yes
    yes = sim%tag(i)%collisions > 0 .and. t - sim%disk(i)%clock < sim%law%contact_time
  end function in_contact

  !> Lets the disks i < j collide at the time t.
  subroutine collide_pair(sim, i, j, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    real(real64) :: dx(2), dv(2), b, distance2, restitution, q, mass_i, mass_j
    integer(int32) :: si, sj
    si = sim%tag(i)%species
    sj = sim%tag(j)%species
    restitution = sim%law%restitution(si, sj)
    if (sim%law%contact_time > 0) then
      if (in_contact(sim, i, t) .or. in_contact(sim, j, t)) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    call land(sim%disk(j), sim%box%gravity, t)
    dx = sim%disk(j)%x - sim%disk(i)%x
    if (any(sim%box%periodic)) dx = dx - nearest_image(dx, sim%box%edges(), sim%box%periodic)
    dv = sim%disk(j)%v - sim%disk(i)%v
    b = dx(1)*dv(1) + dx(2)*dv(2)
    distance2 = dx(1)*dx(1) + dx(2)*dx(2)
    mass_i = sim%species(si)%mass
    mass_j = sim%species(sj)%mass
    q = pair_impulse(b, distance2, mass_i, mass_j, restitution)
    sim%disk(i)%v = sim%disk(i)%v + (q/mass_i)*dx
    sim%disk(j)%v = sim%disk(j)%v - (q/mass_j)*dx
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(j)%collisions = sim%tag(j)%collisions + 1
    sim%events = sim%events + 1
    sim%collisions = sim%collisions + 1
    sim%virial = sim%virial - q*distance2
    sim%dissipated = sim%dissipated + 0.5_real64*(1 - restitution)*q*b
  end subroutine collide_pair

  !> The whole periods in a separation: dx less these is the nearest image.
  pure function nearest_image(dx, edges, periodic) result(shift)
    real(real64), intent(in) :: dx(2), edges(2)
    logical, intent(in) :: periodic(2)
    real(real64) :: shift(2)
    shift = merge(edges*anint(dx/edges), 0.0_real64, periodic)
  end function nearest_image

  !> Whether the code names a periodic side.
  pure function passes(sim, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: code
    logical :: yes
    yes = .false.
    if (code > first_obstacle) yes = sim%box%periodic(1 - code/2)
  end function passes

  !> Takes disk i through a periodic side: it goes on from one period away. Its clock, the time of its last
  !> collision, stays.
  subroutine pass_side(sim, i, code)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    integer :: axis, period
    axis = 1 - code/2
    period = 2*modulo(code, 2) - 1                 ! +1 through the right or top side
    associate (d => sim%disk(i), tag => sim%tag(i), edges => sim%box%edges())
      d%x(axis) = d%x(axis) - period*edges(axis)
      d%stamp = d%stamp + 1
      tag%image(axis) = tag%image(axis) + period
    end associate
  end subroutine pass_side

  !> Lets disk i collide with a side or an obstacle at the time t.
  subroutine collide_wall(sim, i, code, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    real(real64) :: normal(2), v(2), restitution, mass
    restitution = sim%law%wall_restitution
    if (sim%law%contact_time > 0) then
      if (in_contact(sim, i, t)) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    normal = wall_normal(sim%box, code, sim%disk(i)%x)
    v = sim%disk(i)%v
    sim%disk(i)%v = wall_rebound(v, normal, restitution, sim%law%smooth_walls)
    mass = sim%species(sim%tag(i)%species)%mass
    sim%dissipated = sim%dissipated &
      + 0.5_real64*mass*(dot_product(v, v) - dot_product(sim%disk(i)%v, sim%disk(i)%v))
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%events = sim%events + 1
    if (code > first_obstacle) then
      sim%wall_collisions(1 - code) = sim%wall_collisions(1 - code) + 1
      sim%wall_impulse(1 - code) = sim%wall_impulse(1 - code) &
        + mass*dot_product(sim%disk(i)%v - v, normal)
    else
      sim%obstacle_collisions = sim%obstacle_collisions + 1
    end if
  end subroutine collide_wall

  !> Unit vector from a side or obstacle to a disk at x that touches it.
  pure function wall_normal(box, code, x) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)
    real(real64) :: normal(2)
    normal = 0
    if (code > first_obstacle) then
      normal(1 - code/2) = 1 - 2*modulo(code, 2)
    else
      associate (o => box%obstacle(first_obstacle + 1 - code))
        normal = x - o%centre
        normal = merge(-normal, normal, o%inside)/norm2(normal)
      end associate
    end if
  end function wall_normal

  !> Ends the run if a long series of events has brought the clock no further. The last of them names whom.
  subroutine watch(self, sim, i, error)
    class(event_driven_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    type(error_t), allocatable, intent(inout) :: error
    if (self%events_since < 20*int(sim%n_disks(), int64)) return
    if (sim%now - self%last_look < self%blink) call fail(error, exit_broken, &
      "inelastic collapse, the clock stands still: "//moment(sim, i)//"; set contact.contact_time " &
      //"(TC model), well below the mean time between collisions, or raise contact.restitution")
    self%events_since = 0
    self%last_look = sim%now
  end subroutine watch

  !> Time, disk and partner of an event, for messages.
  pure function moment(sim, i) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    character(len=:), allocatable :: text
    character(len=200) :: line
    integer(int32) :: code
    code = sim%disk(i)%partner
    write (line, '("disk ",i0," (",a,")")') sim%tag(i)%id, sim%species(sim%tag(i)%species)%name
    text = trim(line)
    if (code > 0) then
      write (line, '(" and disk ",i0," (",a,")")') sim%tag(code)%id, &
        sim%species(sim%tag(code)%species)%name
    else if (code > first_obstacle) then
      line = " and the "//trim(side_name(1 - code))//" side"
    else if (code > first_crossing) then
      line = " and obstacle "//sim%box%obstacle(first_obstacle + 1 - code)%name
    else
      line = ""
    end if
    text = text//trim(line)
    write (line, '(" at time ",g0)') sim%time()
    text = text//trim(line)
  end function moment

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
    call self%expect_everything(sim)
  end subroutine move_epoch

end module event_driven
