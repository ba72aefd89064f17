!> Simulations for unit tests. The procedures create states from a line of text, advance them with any method, compare states, and
!> create random cases.
module test_systems
  use, intrinsic :: iso_fortran_env, only: error_unit
  use kinds, only: dp => real64, int32, int64, never
  use box_geometry, only: box_t, obstacle_gap
  use box_state, only: bounds
  use disks, only: disk_t, tag_t
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use evolution, only: limits_t
  use initial_state, only: create_simulation
  use event_prediction, only: earliest_contact, prediction_t, no_gravity
  use partners, only: n_sides
  use random_stream, only: random_stream_t
  use run_input, only: input_from_text
  use settings, only: run_input_t
  use shapes, only: shape_t
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use tally, only: dissipated
  use texts, only: text_t, written
  use timeline, only: advance
  implicit none
  private
  public :: add_obstacle, build, few_disks, system, systems, every_system, prepare, evolve, difference
  public :: total_energy, momentum, tightest_gap
  public :: cases, draw_between, draw_vector, draw_magnitude, meeting, time_to_contact

  !> Systems with many combinations of features, in which all general properties must hold.
  character(len=*), parameter :: systems(*) = [character(len=40) :: "walls", "walls dilute", &
    "walls dense mixture", "walls few", "walls giant bed inelastic", "walls mixture smooth inelastic", &
    "walls gravity mixture", "walls gravity pegs inelastic contact", "walls round mixture", &
    "walls round pegs gravity smooth", "walls pegs inelastic", "channel", "channel gravity pegs mixture", &
    "channel inelastic contact", "periodic", "periodic few", "periodic dense mixture", &
    "periodic inelastic contact", "periodic pegs dilute", "periodic giant mixture", &
    "walls giants dilute", "walls giants gravity", "periodic giants dilute inelastic contact", &
    "walls slants mixture", "channel gravity slants inelastic contact", "periodic slants pegs dilute", &
    "walls dense sizes", "channel dense sizes gravity", "periodic dense sizes inelastic", "walls sizes pegs", &
    "periodic giant sizes", "walls arcs mixture", "channel gravity arcs inelastic contact", "periodic arcs pegs dilute"]
  !> All systems of the list `systems`, and further systems with moving sides.
  character(len=*), parameter :: every_system(*) = [character(len=40) :: systems, "walls shaken", &
    "walls shaken gravity mixture", "channel shaken gravity inelastic contact", "walls shaken bed dilute", &
    "walls shaken pegs inelastic contact", "walls shaken slants gravity", "walls shaken giants gravity", &
    "walls shaken sizes gravity", "walls shaken arcs gravity giant"]

contains

  !> Returns the number of random cases that a test draws: `most` if the environment variable THOROUGH is set, otherwise half of
  !> them.
  integer function cases(most)
    integer, intent(in) :: most
    integer :: length
    call get_environment_variable("THOROUGH", length=length)
    cases = merge(most, (most + 1)/2, length > 0)
  end function cases

  !> Returns the simulation that an input text describes. `message` contains the problems of the input, or '' if there are none.
  !> Without `message`, a problem ends the tests. If the input has no stop rule, the simulation ends at time 1.
  subroutine build(text, sim, message, input, overrides)
    character(len=*), intent(in) :: text
    type(simulation_t), intent(out) :: sim
    character(len=:), allocatable, intent(out), optional :: message
    type(run_input_t), intent(out), optional :: input
    type(text_t), intent(in), optional :: overrides(:)
    type(run_input_t) :: read
    type(text_t), allocatable :: changes(:)
    type(status_line_t) :: line
    type(error_t), allocatable :: error
    allocate (changes(0))
    if (present(overrides)) changes = overrides
    call input_from_text(text//merge("                 ", " &stop time = 1 /", index(text, "&stop") > 0), "f", changes, read, error)
    if (.not. allocated(error)) call create_simulation(read, line, sim, error)
    if (present(input)) input = read
    if (present(message)) message = ""
    if (.not. allocated(error)) return
    if (.not. present(message)) write (error_unit, "(a)") text, error%message
    if (.not. present(message)) error stop "a test needs a state that cannot be built"
    message = error%message
  end subroutine build

  !> Returns a system of disks in the unit box with elastic walls. Each disk is a separate species.
  function few_disks(x, v, radius, mass) result(sim)
    real(dp), intent(in) :: x(:)           !! x1, y1, x2, y2, ... [length]
    real(dp), intent(in) :: v(:)           !! v1x, v1y, ... likewise [length/time]
    real(dp), intent(in) :: radius(:)      !! (n) [length]
    real(dp), intent(in) :: mass(:)        !! (n) [mass]
    type(simulation_t) :: sim
    integer(int32) :: i, n
    n = size(radius, kind=int32)
    sim%box%box_t = box_t()
    allocate (sim%species(n), sim%law%restitution(n, n))
    call make_room(sim, n)
    sim%law%restitution = 1
    do i = 1, n
      sim%disk(i)%x = x(2*i - 1:2*i)
      sim%disk(i)%v = v(2*i - 1:2*i)
      sim%disk(i)%radius = radius(i)
      sim%tag(i)%id = i
      sim%tag(i)%species = i
      sim%species(i)%name = "disk"
      sim%species(i)%count = 1
      sim%species(i)%mass = mass(i)
    end do
  end function few_disks

  !> Allocates n disks, including data for features that a test may use later.
  pure subroutine make_room(sim, n)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: n
    call sim%make_room(n)
    if (.not. allocated(sim%extra)) allocate (sim%extra(n))
  end subroutine make_room

  !> Returns a gas of about a hundred disks in a box of 3 x 2 that does not contain the origin. The words name the features:
  !> `periodic` or `channel` (periodic in x), otherwise walls; `gravity`; `pegs`, `slants` and `arcs` as obstacles and a `round`
  !> container;
  !> a `mixture` of two species; a `giant` or two `giants`; a `bed` at rest that is hit by the giant; many `sizes`; `inelastic`;
  !> `smooth` walls; `contact` duration; `shaken` sides; `few`, `dilute` or `dense`.
  function system(words, seed, scale) result(sim)
    character(len=*), intent(in) :: words
    integer(int64), intent(in) :: seed
    integer, intent(in), optional :: scale     !! scale of the box; the number of disks grows with its square
    type(simulation_t) :: sim
    real(dp) :: upper(2), radius
    integer :: n
    n = 1
    if (present(scale)) n = scale
    upper = [-1.0_dp, 0.5_dp] + n*[3.0_dp, 2.0_dp]
    n = n**2*merge(3, merge(40, 70, has("round")), has("few"))
    radius = 0.2_dp*merge(5, 1, has("few"))*merge(0.13_dp, merge(0.46_dp, 0.32_dp, has("dense")), has("dilute"))
    call build("&run seed = "//written(seed)//" / &box lower = -1, 0.5 upper = "//written(upper(1))//","//written(upper(2)) &
      //" boundary = "//given("periodic", "'periodic','periodic'", given("channel", "'periodic','wall'", "'wall','wall'")) &
      //given("gravity", " gravity = 0,-1")//" /" &
      //" &contact"//given("smooth", " wall_rule = 'normal'")//given("contact", " contact_time = 0.01") &
      //given("inelastic", " wall_restitution = 0.85 pair_restitution = " &
      //given("giant", "0.5,0.6,0.7,0.6,0.9,0.8,0.7,0.8,0.95", "0.9,0.8,0.8,0.95"))//" /" &
      //given("giant", " &species name = 'giant' mass = 30 radius = 0.35 velocity = 0.7,-1.5" &
      //given("giants", " position = 0.1,1.7,1.3,1.2 /", " position = 0.1,1.7 /")) &
      //gas("small", "1", radius)//gas("other", given("mixture", "5", "1"), merge(0.5_dp, 1.0_dp, has("mixture"))*radius) &
      ! circles of different size, one of them across the left side
      //given("pegs", " &obstacle centre = -1,1.1 radius = 0.15 / &obstacle centre = 0.9,1.9 radius = 0.2 /" &
      //" &obstacle centre = 1.2,1.2 radius = 0.3 /") &
      //given("round", " &obstacle centre = 0.5,1.5 radius = 0.98 side = 'inside' /") &
      ! so far from moving sides that no disk is crushed
      //given("slants", " &wall from = -1.0,1.2 to = -0.6,1.6 / &wall from = 0.2,1.9 to = 1.6,1.3 /") &
      ! half a circle, almost a whole circle with disks inside, and an arc across the left side
      //given("arcs", " &obstacle centre = 0.75,1.75 radius = 0.25 from_angle = 180 to_angle = 360 /" &
      //" &obstacle centre = 1.5,1.6 radius = 0.3 from_angle = -60 to_angle = 250 /" &
      //" &obstacle centre = -1.3,1.5 radius = 0.42 from_angle = -60 to_angle = 60 /") &
      ! with large and small amplitudes, and fast; all start at their mean positions
      //given("shaken", " &side name = 'bottom' motion = 'parabolic' amplitude = 0.5 period = 4 /" &
      //" &side name = 'top' motion = 'sawtooth' velocity = 0.5 /" &
      //given("channel", "", " &side name = 'right' motion = 'sine' amplitude = 0.03 period = 0.25 phase = 0.5 /")), sim)

  contains

    !> Returns one species of the gas.
    function gas(name, mass, radius) result(text)
      character(len=*), intent(in) :: name, mass
      real(dp), intent(in) :: radius
      character(len=:), allocatable :: text
      text = " &species name = '"//name//"' count = "//written(n)//" mass = "//mass//" radius = "//written(radius) &
        //given("dense", " placement = 'dense'")//given("sizes", " polydispersity = 0.39 radius_distribution = 'lognormal'") &
        //" velocities = "//given("bed", "'rest' /", "'uniform' /")
    end function gas

    pure logical function has(word)
      character(len=*), intent(in) :: word
      has = index(words, word) > 0
    end function has

    !> Returns `text` if the given word is one of the words, and otherwise `otherwise` or ''.
    pure function given(word, text, otherwise) result(this)
      character(len=*), intent(in) :: word, text
      character(len=*), intent(in), optional :: otherwise
      character(len=:), allocatable :: this
      this = ""
      if (present(otherwise)) this = otherwise
      if (has(word)) this = text
    end function given
  end function system

  !> Adds an obstacle to a box.
  subroutine add_obstacle(box, name, shape)
    class(box_t), intent(inout) :: box
    character(len=*), intent(in) :: name
    class(shape_t), intent(in) :: shape

    call box%add_obstacles([name], [1])
    box%surface(size(box%surface))%law = box%surface(1)%law
    allocate (box%obstacle(size(box%obstacle))%shape, source=shape)
  end subroutine add_obstacle

  !> Returns the dynamics for a method. `cells` uses neighbour lists where they are faster, and `lists` uses them everywhere. With
  !> `short`, the lists are short and often full. Further methods are `pairs` and `rescan`. With `heap` the event queue is a heap,
  !> otherwise a calendar.
  subroutine prepare(dynamics, method, sim)
    type(event_driven_t), intent(out) :: dynamics
    character(len=*), intent(in) :: method
    type(simulation_t), intent(inout) :: sim
    allocate (dynamics%search)
    dynamics%search%undivided = index(method, "pairs") + index(method, "rescan") > 0
    if (index(method, "lists") > 0) dynamics%search%lists%least_candidates = -never
    if (index(method, "short") > 0) dynamics%search%lists%capacity = 8
    dynamics%search%everyone = index(method, "rescan") > 0
    dynamics%windowed = index(method, "heap") == 0
    call dynamics%start(sim)
  end subroutine prepare

  !> Continues a simulation up to a limit, in the same way as after a restart.
  subroutine evolve(sim, method, time, collisions, events, failure)
    type(simulation_t), intent(inout) :: sim
    character(len=*), intent(in) :: method                      !! as for `prepare`
    real(dp), intent(in), optional :: time                      !! since the start of the run [time]
    integer, intent(in), optional :: collisions, events
    character(len=:), allocatable, intent(out), optional :: failure  !! reason of a failure, '' if there was none
    type(event_driven_t) :: dynamics
    type(limits_t) :: limits
    type(error_t), allocatable :: error
    if (present(time)) limits%time = time
    if (present(collisions)) limits%collisions = collisions
    if (present(events)) limits%events = events
    call prepare(dynamics, method, sim)
    call advance(dynamics, sim, limits, error)
    if (.not. present(failure)) return
    failure = ""
    if (allocated(error)) failure = error%message
  end subroutine evolve

  !> Returns the first difference between two states, or '' if the states are bit-identical. Data that belong to the search or to
  !> the event queue are not compared.
  pure function difference(a, b) result(text)
    type(simulation_t), intent(in) :: a, b
    character(len=:), allocatable :: text
    integer(int32) :: i
    text = ""
    if (a%tally%events /= b%tally%events) text = "events"
    if (a%tally%collisions /= b%tally%collisions) text = "collisions"
    if (a%epoch_events /= b%epoch_events .or. a%events_then /= b%events_then) text = "an event that counts"
    if (any(differ([a%box%epoch, a%now, a%epoch_begin, a%epoch_end, a%negligible_time, a%last_advance, a%tally%sum%value()], &
      [b%box%epoch, b%now, b%epoch_begin, b%epoch_end, b%negligible_time, b%last_advance, b%tally%sum%value()]))) &
      text = "a time or a sum"
    if (any(a%tally%surface_collisions /= b%tally%surface_collisions)) text = "collisions with walls"
    if (any(differ(a%tally%surface_sums%value(), b%tally%surface_sums%value()))) text = "a sum of a wall"
    if (allocated(a%extra) .neqv. allocated(b%extra)) text = "numbers of the disks"
    do i = 1, a%n_disks()
      if (text /= "") return
      associate (p => a%disk(i), q => b%disk(i), s => a%tag(i), t => b%tag(i))
        if (s%id /= t%id) text = "order of the disks"
        if (s%collisions /= t%collisions) text = "counts of a disk"
        if (any(differ([p%x, p%v, p%clock, p%radius, a%mass_of(i)], [q%x, q%v, q%clock, q%radius, b%mass_of(i)]))) &
          text = "state of a disk"
      end associate
      if (.not. allocated(a%extra)) cycle
      associate (p => a%extra(i), q => b%extra(i))
        if (any(differ([p%image, p%last_contact, p%spin, p%angle], [q%image, q%last_contact, q%spin, q%angle]))) &
          text = "an optional number of a disk"
      end associate
    end do
  end function difference

  !> Returns whether two numbers differ in any bit.
  elemental function differ(a, b) result(yes)
    real(dp), intent(in) :: a, b
    logical :: yes
    yes = transfer(a, 0_int64) /= transfer(b, 0_int64)
  end function differ

  !> Returns the sum of kinetic, potential and dissipated energy at the present time.
  pure function total_energy(sim) result(energy)
    type(simulation_t), intent(in) :: sim
    real(dp) :: energy
    integer(int32) :: i
    energy = sim%kinetic_energy() + sim%tally%total(dissipated)
    do i = 1, sim%n_disks()
      energy = energy - sim%mass_of(i)*dot_product(sim%box%gravity, sim%position(i))
    end do
  end function total_energy

  pure function momentum(sim) result(p)
    type(simulation_t), intent(in) :: sim
    real(dp) :: p(2)
    integer(int32) :: i
    p = 0
    do i = 1, sim%n_disks()
      p = p + sim%mass_of(i)*sim%velocity(i)
    end do
  end function momentum

  !> Returns the smallest gap between disks, sides and obstacles at the present time, in units of the disk diameter. The gap is
  !> negative if any of these objects overlap.
  pure function tightest_gap(sim) result(gap)
    type(simulation_t), intent(in) :: sim
    real(dp) :: gap, x(2), dx(2), low(2), high(2)
    integer(int32) :: i, j, m
    gap = never
    call bounds(sim%box, sim%now, low, high)
    do i = 1, sim%n_disks()
      x = sim%position(i)
      associate (r => sim%disk(i)%radius)
        do j = 1, i - 1
          dx = separation(sim%box%box_t, x, sim%position(j))
          gap = min(gap, norm2(dx)/(r + sim%disk(j)%radius) - 1)
        end do
        gap = min(gap, minval(merge(never, min(x - low, high - x) - r, sim%box%periodic))/(2*r))
        do m = 1, sim%box%n_obstacles()
          gap = min(gap, obstacle_gap(sim%box%box_t, m, x, r)/(2*r))
        end do
      end associate
    end do
  end function tightest_gap

  !> Returns the vector from a point to the nearest periodic image of another point.
  pure function separation(box, a, b) result(dx)
    type(box_t), intent(in) :: box
    real(dp), intent(in) :: a(2), b(2)
    real(dp) :: dx(2), edges(2)
    edges = box%edges()
    dx = b - a
    dx = dx - merge(edges*anint(dx/edges), 0.0_dp, box%periodic)
  end function separation

  !> Returns the time until two disks touch, calculated with the textbook formula.
  pure function time_to_contact(dx, dv, sigma) result(s)
    real(dp), intent(in) :: dx(2), dv(2), sigma
    real(dp) :: s, b, disc
    s = never
    b = dot_product(dx, dv)
    disc = sigma**2*dot_product(dv, dv) - (dx(1)*dv(2) - dx(2)*dv(1))**2
    if (b < 0 .and. disc > 0) s = max(dot_product(dx, dx) - sigma**2, 0.0_dp)/(sqrt(disc) - b)
  end function time_to_contact

  !> Returns the time at which two disks collide, calculated by the procedure that all searches use. The argument `known` is the
  !> time of another event.
  function meeting(disk, i, known) result(t)
    type(disk_t), intent(in) :: disk(2)
    integer, intent(in) :: i
    real(dp), intent(in) :: known
    real(dp) :: t
    type(prediction_t) :: near
    type(tag_t) :: tag(2)
    tag%id = [1, 2]
    near%time = known
    near%partner = 0
    near%disk = i
    near%n = 1
    near%list(1) = 2 - i
    call earliest_contact(disk, tag, near, disk(i)%clock, [0.0_dp, 0.0_dp], no_gravity)
    t = near%time
  end function meeting

  !> Draws a uniform number between two limits.
  subroutine draw_between(stream, low, high, u)
    type(random_stream_t), intent(inout) :: stream
    real(dp), intent(in) :: low, high
    real(dp), intent(out) :: u
    call stream%draw_uniform(u)
    u = low + (high - low)*u
  end subroutine draw_between

  !> Draws a vector whose components are uniform in (-size, size).
  subroutine draw_vector(stream, size, v)
    type(random_stream_t), intent(inout) :: stream
    real(dp), intent(in) :: size
    real(dp), intent(out) :: v(2)
    call draw_between(stream, -size, size, v(1))
    call draw_between(stream, -size, size, v(2))
  end subroutine draw_vector

  !> Draws a positive number of random order of magnitude: 10**u, where u is uniform in (-decades, decades).
  subroutine draw_magnitude(stream, decades, u)
    type(random_stream_t), intent(inout) :: stream
    real(dp), intent(in) :: decades
    real(dp), intent(out) :: u
    call draw_between(stream, -decades, decades, u)
    u = 10.0_dp**u
  end subroutine draw_magnitude

end module test_systems
