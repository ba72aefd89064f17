!> All observables: averages over disks, totals, and the counters and sums over collisions.
module observables
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use kinds, only: int32, real64
  use box_geometry, only: box_t, free_area
  use box_state, only: bounds
  use features, only: features_t
  use partners, only: n_sides
  use simulation_state, only: simulation_t
  use tally, only: inflow, outflow
  use tally, only: kinetic_flux, dissipated, drive_energy, flux_changes, gain, heat, heat_virial, impulse, stress, virial, work
  implicit none
  private
  public :: observable_list_t, observed, own_names, energies, total_energy

  integer, parameter :: most_components = 4

  !> One observable, a scalar or a vector.
  type :: observable_t
    character(len=64) :: name = ""                !! path below the HDF5 group /observables
    integer :: width = 0                          !! number of components
    logical :: is_count = .false.                 !! whether the value is an integer
    real(real64) :: value(most_components) = 0.0_real64    !! present value; counts are exact up to 2**53
  end type observable_t

  type :: observable_list_t
    integer :: n = 0
    type(observable_t), allocatable :: row(:)     !! the observables in the first n elements
  contains
    procedure :: add
    procedure :: values
  end type observable_list_t

  !> Indices of the sums over the disks of a species, or over all disks, in the first dimension of
  !> an array of sums.
  integer, parameter :: disks = 1, mass = 2, speed = 3, momentum = 4       !! momentum has two components
  integer, parameter :: kinetic = 6, potential = 7, rotational = 8         !! energies
  !> Kinetic energy and momentum relative to the velocity profile of a sheared box; momentum has two
  !> components.
  integer, parameter :: own_kinetic = 9, own_momentum = 10
  !> Kinetic flux relative to the velocity profile; five components (see `tally: kinetic_flux`)
  integer, parameter :: flux = 12
  integer, parameter :: tensor(*) = flux + [0, 1, 1, 2]      !! components xx, xy, yx, yy of the momentum flux
  !> Index of the last sum over disks. A new sum is inserted after the kinetic flux.
  integer, parameter :: last_term = flux + 4
  !> Total energy (`energy`) and rounding error of its summation (`lost`), computed only in driven
  !> simulations.
  integer, parameter :: energy = last_term + 1, lost = last_term + 2

contains

  !> Present values of all observables. A new observable is added here, as one line.
  pure function observed(sim) result(list)
    type(simulation_t), intent(in) :: sim
    type(observable_list_t) :: list
    ! sums over the disks of each species and, for index 0, over all disks
    real(real64) :: sums(lost, 0:size(sim%species))
    character(len=:), allocatable :: path
    real(real64) :: flux_integral(5)      ! time integrals of the fluxes [energy time], [energy length]
    real(real64) :: at(2, 2)                          ! positions of the lower and upper sides [length]
    logical :: changes                                ! whether the system changes during the run
    integer :: s, k

    changes = sim%changes > 0 .or. sim%features%changes
    call add_up(sim, sums)
    call add_means(list, "all", sums(:, 0), sim%features)
    do s = 1, size(sim%species)
      call add_means(list, sim%species(s)%name, sums(:, s), sim%features)
    end do
    call list%add("total_energy", [total(sim, sums(:, 0))])
    call list%add("momentum", sums(momentum:momentum + 1, 0))
    call list%add("virial_pressure", [pressure(sim, sums(own_kinetic, 0))])
    call list%add("virial", [sim%tally%total(virial)])
    call list%add("dissipated_energy", [sim%tally%total(dissipated)])
    if (allocated(sim%drive) .or. changes) call list%add("drive_energy", [sim%tally%total(drive_energy)])
    if (allocated(sim%drive_count)) call list%add(sim%kick_counter(), real([sum(sim%drive_count)], real64), is_count=.true.)
    call list%add("collisions", real([sim%tally%collisions], real64), is_count=.true.)
    associate (hits => sim%tally%surface_collisions, surface_sums => sim%tally%surface_sums)
      call list%add("side_collisions", real(hits(:n_sides), real64), is_count=.true.)
      call list%add("side_impulse", abs([surface_sums(impulse, 1:2)%value(), surface_sums(impulse + 1, 3:4)%value()]))
      call list%add("obstacle_collisions", real([sum(hits(n_sides + 1:))], real64), is_count=.true.)
    end associate
    if (sim%box%highest_temperature() > 0 .or. changes) call list%add("heat", [sim%tally%total(heat)])
    if (sim%box%does_work() .or. changes) call list%add("work", [sim%tally%total(work)])
    if (sim%features%open) call add_exchange(list, sim)
    if (sim%features%stress) then
      call list%add("virial_tensor", sim%tally%total([stress, stress + 1, stress + 2, stress + 3]))
      call list%add("kinetic_tensor", sums(tensor, 0))
    end if
    if (sim%features%helfand) then
      flux_integral = sums(flux:flux + 4, 0)*sim%time() - sim%tally%total([(flux_changes + k, k=0, 4)])
      call list%add("helfand_stress", flux_integral(tensor - flux + 1))
      call list%add("helfand_heat", flux_integral(4:))
      call list%add("heat_virial", sim%tally%total([heat_virial, heat_virial + 1]))
    end if
    do k = 1, size(sim%box%surface)
      if (.not. sim%box%is_wall(k)) cycle
      path = trim(merge("sides/    ", "obstacles/", k <= n_sides))//sim%box%surface(k)%name
      call list%add(path//"/impulse", sim%tally%surface_sums(impulse:impulse + 1, k)%value())
      call list%add(path//"/energy_to_disks", [sim%tally%surface_sums(gain, k)%value()])
      call list%add(path//"/collisions", real([sim%tally%surface_collisions(k)], real64), is_count=.true.)
      if (sim%features%open .and. k <= n_sides) call list%add(path//"/left", real([sim%tally%left(k)], real64), is_count=.true.)
      if (.not. any((sim%box%side%moves() .or. sim%features%moving) .and. [1, 2, 3, 4] == k)) cycle
      call bounds(sim%box, sim%now, at(:, 1), at(:, 2))
      call list%add(path//"/position", [at((k + 1)/2, 2 - modulo(k, 2))])
      call list%add(path//"/velocity", [sim%box%side_velocity(k, sim%now)])
    end do
  end function observed

  !> Total energy at the present time, accurate enough for an energy balance.
  pure function total_energy(sim) result(now)
    type(simulation_t), intent(in) :: sim
    real(real64) :: now                           !! [energy]
    real(real64) :: sums(lost, 0:size(sim%species))

    call add_up(sim, sums)
    now = total(sim, sums(:, 0))
  end function total_energy

  !> Adds the observables of an open system. The first is the total number of disks.
  pure subroutine add_exchange(list, sim)
    type(observable_list_t), intent(inout) :: list
    type(simulation_t), intent(in) :: sim
    integer :: s

    call list%add("inside", real([sim%n_inside()], real64), is_count=.true.)
    call list%add("outflow_energy", [sim%tally%flow(outflow)%value()])
    call list%add("inflow_energy", [sim%tally%flow(inflow)%value()])
    if (.not. allocated(sim%source)) return
    do s = 1, size(sim%source)
      call list%add("sources/"//sim%source(s)%name//"/entered", real([sim%tally%entered(s)], real64), is_count=.true.)
    end do
  end subroutine add_exchange

  !> Adds averages over the disks of a species. In open systems, averages over no disk are NaN. The
  !> temperature kT is the mean kinetic energy per disk, relative to the mean velocity and, in a
  !> sheared box, to the velocity profile.
  pure subroutine add_means(list, group, sums, features)
    type(observable_list_t), intent(inout) :: list
    character(len=*), intent(in) :: group         !! name of the species, or 'all'
    real(real64), intent(in) :: sums(:)
    type(features_t), intent(in) :: features
    real(real64) :: n, drift

    n = max(sums(disks), 1.0_real64)
    if (features%open .and. .not. sums(disks) > 0) n = ieee_value(n, ieee_quiet_nan)
    drift = 0
    associate (p => sums(own_momentum:own_momentum + 1))
      if (sums(disks) > 0) drift = 0.5_real64*dot_product(p, p)/sums(mass)
    end associate
    call list%add(group//"/kinetic_energy", [sums(kinetic)/n])
    call list%add(group//"/potential_energy", [sums(potential)/n])
    call list%add(group//"/mean_speed", [sums(speed)/n])
    call list%add(group//"/temperature", [max(sums(own_kinetic) - drift, 0.0_real64)/n])
    if (features%open) call list%add(group//"/particle_number", sums(disks:disks), is_count=.true.)
    if (.not. features%rotation) return
    call list%add(group//"/rotational_energy", [sums(rotational)/n])
    call list%add(group//"/rotational_temperature", [2*sums(rotational)/n])
  end subroutine add_means

  !> Adds an observable with one or more components.
  pure subroutine add(self, name, value, is_count)
    class(observable_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: value(:)
    logical, intent(in), optional :: is_count

    if (.not. allocated(self%row)) allocate (self%row(32))
    if (self%n == size(self%row)) self%row = [self%row, self%row]
    self%n = self%n + 1
    associate (row => self%row(self%n))
      row = observable_t(name, size(value))
      row%value(:size(value)) = value
      if (present(is_count)) row%is_count = is_count
    end associate
  end subroutine add

  !> Components of all observables as one array.
  pure function values(self)
    class(observable_list_t), intent(in) :: self
    real(real64) :: values(sum(self%row(:self%n)%width))
    integer :: k, last

    last = 0
    do k = 1, self%n
      associate (row => self%row(k))
        values(last + 1:last + row%width) = row%value(:row%width)
        last = last + row%width
      end associate
    end do
  end function values

  !> Reserved names in the HDF5 group /observables, which species must not have.
  function own_names() result(names)
    character(len=64), allocatable :: names(:)
    type(simulation_t) :: empty
    type(observable_list_t) :: list
    integer :: k

    allocate (empty%species(0))
    empty%changes = 1
    call empty%make_room(0)
    call empty%tally%make_room(n_sides)
    empty%box%box_t = box_t()
    empty%box%surface%law%temperature = 1         ! thermal, sliding walls have every observable of walls
    empty%box%surface%law%speed = 1
    empty%features%stress = .true.
    empty%features%helfand = .true.
    empty%features%open = .true.
    list = observed(empty)
    allocate (names(list%n + 2))
    names(list%n + 1:) = ["obstacles", "sources  "] ! groups that exist only with obstacles or sources
    do k = 1, list%n
      associate (name => list%row(k)%name)
        names(k) = name(:index(name//"/", "/") - 1)
      end associate
    end do
  end function own_names

  !> Kinetic energies and total energy of all disks.
  pure function energies(sim)
    type(simulation_t), intent(in) :: sim
    real(real64) :: energies(3)                   !! translational, rotational, total [energy]
    real(real64) :: sums(lost, 0:size(sim%species))

    call add_up(sim, sums)
    energies = [sums(kinetic, 0), sums(rotational, 0), total(sim, sums(:, 0))]
  end function energies

  !> Total energy of the disks, from the sums over the disks.
  pure function total(sim, sums)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: sums(:)
    real(real64) :: total

    total = sums(kinetic) + sums(potential) + sums(rotational)
    if (sim%is_driven()) total = sums(energy) + sums(lost)
  end function total

  !> Adds a term to the energy by compensated summation (Neumaier, ZAMM 54, 39 (1974)). The energy
  !> gained from driving can be small compared with the total energy of many disks. Simple summation
  !> would lose some digits of this gain.
  pure subroutine add_energy(sums, term)
    real(real64), intent(inout) :: sums(:)
    real(real64), intent(in) :: term
    real(real64) :: new

    new = sums(energy) + term
    if (abs(sums(energy)) >= abs(term)) then
      sums(lost) = sums(lost) + ((sums(energy) - new) + term)
    else
      sums(lost) = sums(lost) + ((term - new) + sums(energy))
    end if
    sums(energy) = new
  end subroutine add_energy

  !> Computes all sums in one pass over the disks. The potential energy is zero at the origin of the
  !> coordinates.
  pure subroutine add_up(sim, sums)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(out) :: sums(:, 0:)
    real(real64) :: term(last_term), v(2), own_v(2)
    logical :: falling, sheared, driven
    integer(int32) :: i
    integer :: s, k

    falling = sim%box%has_gravity()
    sheared = sim%box%is_sheared()
    driven = sim%is_driven()
    sums = 0
    term = 0
    term(disks) = 1
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      s = sim%tag(i)%species
      v = sim%velocity(i)
      own_v = v
      if (sheared) own_v = v - sim%box%shear_profile(sim%position(i))
      term(mass) = sim%mass_of(i)
      term(speed) = sqrt(dot_product(v, v))
      term(momentum:momentum + 1) = term(mass)*v
      term(kinetic) = 0.5_real64*term(mass)*dot_product(v, v)
      if (falling) term(potential) = -term(mass)*dot_product(sim%box%gravity, sim%position(i))
      if (sim%features%rotation) term(rotational) = 0.5_real64*sim%inertia_of(i)*sim%spin(i)**2
      term(own_kinetic) = 0.5_real64*term(mass)*dot_product(own_v, own_v)
      term(own_momentum:own_momentum + 1) = term(mass)*own_v
      if (sim%features%stress) term(flux:flux + 4) = kinetic_flux(term(mass), own_v)
      sums(:size(term), s) = sums(:size(term), s) + term
      if (.not. driven) cycle
      do k = kinetic, rotational
        call add_energy(sums(:, s), term(k))
      end do
    end do
    do s = 1, size(sim%species)
      sums(:size(term), 0) = sums(:size(term), 0) + sums(:size(term), s)
      sums(lost, 0) = sums(lost, 0) + sums(lost, s)
      call add_energy(sums(:, 0), sums(energy, s))
    end do
  end subroutine add_up

  !> Two-dimensional pressure P by the virial theorem, P A = K + W/(2t). Here K is the present
  !> kinetic energy, A the present accessible area, and t the time since the start of the run. W is
  !> the sum of impulse times distance over all disk-disk collisions in this time. Between walls, P
  !> differs from the mean force per length of a wall, because the centre of a disk in contact with
  !> a wall is at the distance of one radius.
  pure function pressure(sim, kinetic)
    type(simulation_t), intent(in) :: sim
    !> Kinetic energy relative to the velocity profile of a sheared box [energy].
    real(real64), intent(in) :: kinetic
    real(real64) :: pressure
    type(box_t) :: box

    pressure = kinetic
    if (sim%time() > 0) pressure = pressure + 0.5_real64*sim%tally%total(virial)/sim%time()
    box = sim%box%box_t
    if (any(box%side%moves_permanently())) call bounds(sim%box, sim%now, box%lower, box%upper)
    pressure = pressure/free_area(box)
  end function pressure

end module observables
