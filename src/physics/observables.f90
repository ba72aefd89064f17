!> What is measured of a simulation besides the frames: means over the disks, totals, and the counts and sums
!> that the collisions have gathered.
module observables
  use kinds, only: int32, real64
  use box_geometry, only: box_t, free_area, surface_path
  use drive, only: noise
  use partners, only: n_sides
  use simulation_state, only: simulation_t
  use tally, only: dissipated, drive_energy, heat, stress, surface_tally_t, virial, work
  implicit none
  private
  public :: observable_list_t, observed, own_names, total_energy

  integer, parameter :: most_components = 4

  !> One observable, scalar or vector.
  type :: observable_t
    character(len=64) :: name = ""                !! below /observables
    integer :: width = 0                          !! number of components
    logical :: is_count = .false.                 !! a whole number
    real(real64) :: value(most_components) = 0.0_real64    !! now; counts are exact up to 2**53
  end type observable_t

  type :: observable_list_t
    integer :: n = 0
    type(observable_t), allocatable :: row(:)     !! the first n count
  contains
    procedure :: add
    procedure :: values
  end type observable_list_t

  !> Sums over the disks of a species, or of all.
  type :: sums_t
    real(real64) :: n = 0.0_real64
    real(real64) :: mass = 0.0_real64
    real(real64) :: kinetic = 0.0_real64          !! [energy]
    real(real64) :: potential = 0.0_real64        !! [energy]
    real(real64) :: speed = 0.0_real64
    real(real64) :: momentum(2) = 0.0_real64
    real(real64) :: rotational = 0.0_real64       !! kinetic [energy]
    real(real64) :: own_kinetic = 0.0_real64      !! relative to the velocity profile of a sheared box [energy]
    real(real64) :: own_momentum(2) = 0.0_real64  !! likewise
    real(real64) :: energy = 0.0_real64           !! of all kinds, so exactly that it can be balanced; unless `is_driven`: 0
    real(real64) :: lost = 0.0_real64             !! what rounding has taken from it
  contains
    procedure :: total
  end type sums_t

contains

  !> All observables with their values now. A new one is one more line here.
  pure function observed(sim) result(list)
    type(simulation_t), intent(in) :: sim
    type(observable_list_t) :: list
    type(sums_t) :: sums(0:size(sim%species))     ! 0: all
    integer :: s, k

    call add_up(sim, sums)
    call add_means(list, "all", sums(0), sim%with%rotation)
    do s = 1, size(sim%species)
      call add_means(list, sim%species(s)%name, sums(s), sim%with%rotation)
    end do
    call list%add("total_energy", [sums(0)%total(sim%is_driven())])
    call list%add("momentum", sums(0)%momentum)
    call list%add("pressure", [pressure(sim, sums(0)%own_kinetic)])
    call list%add("virial", [sim%tally%total(virial)])
    call list%add("dissipated_energy", [sim%tally%total(dissipated)])
    if (sim%drive%is_on()) call list%add("drive_energy", [sim%tally%total(drive_energy)])
    call list%add("collisions", real([sim%tally%collisions], real64), is_count=.true.)
    associate (side => sim%tally%surface(:n_sides), obstacle => sim%tally%surface(n_sides + 1:))
      call list%add("wall_collisions", real(side%collisions, real64), is_count=.true.)
      call list%add("wall_impulse", abs([side(:2)%impulse(1)%value(), side(3:)%impulse(2)%value()]))
      call list%add("obstacle_collisions", real([sum(obstacle%collisions)], real64), is_count=.true.)
    end associate
    if (sim%box%highest_temperature() > 0) call list%add("heat", [sim%tally%total(heat)])
    if (sim%box%highest_speed() > 0) call list%add("work", [sim%tally%total(work)])
    if (sim%with%stress) call list%add("virial_tensor", sim%tally%total([stress, stress + 1, stress + 2, stress + 3]))
    do k = 1, size(sim%box%surface)
      if (sim%box%is_wall(k)) call add_surface(list, surface_path(sim%box, k), sim%tally%surface(k))
    end do
  end function observed

  !> What has happened at a wall: the impulse given to it, the energy that disks have gained there, and how often.
  pure subroutine add_surface(list, path, surface)
    type(observable_list_t), intent(inout) :: list
    character(len=*), intent(in) :: path
    type(surface_tally_t), intent(in) :: surface

    call list%add(path//"/impulse", surface%impulse%value())
    call list%add(path//"/energy", [surface%energy%value()])
    call list%add(path//"/collisions", real([surface%collisions], real64), is_count=.true.)
  end subroutine add_surface

  !> Means over a species, per disk. The temperature is kT in two dimensions: the kinetic energy relative to the
  !> common motion, and to the velocity profile of a sheared box.
  pure subroutine add_means(list, group, sums, rotation)
    type(observable_list_t), intent(inout) :: list
    character(len=*), intent(in) :: group         !! name of the species
    type(sums_t), intent(in) :: sums
    logical, intent(in) :: rotation               !! disks can turn
    real(real64) :: n, drift

    n = max(sums%n, 1.0_real64)
    drift = 0
    if (sums%n > 0) drift = 0.5_real64*dot_product(sums%own_momentum, sums%own_momentum)/sums%mass
    call list%add(group//"/kinetic_energy", [sums%kinetic/n])
    call list%add(group//"/potential_energy", [sums%potential/n])
    call list%add(group//"/mean_speed", [sums%speed/n])
    call list%add(group//"/temperature", [max(sums%own_kinetic - drift, 0.0_real64)/n])
    if (.not. rotation) return
    call list%add(group//"/rotational_energy", [sums%rotational/n])
    call list%add(group//"/rotational_temperature", [2*sums%rotational/n])
  end subroutine add_means

  !> Adds an observable, with one or more components.
  pure subroutine add(self, name, value, is_count)
    class(observable_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: value(:)
    logical, intent(in), optional :: is_count
    type(observable_t), allocatable :: larger(:)

    if (.not. allocated(self%row)) allocate (self%row(32))
    if (self%n == size(self%row)) then
      allocate (larger(2*self%n))
      larger(:self%n) = self%row
      call move_alloc(larger, self%row)
    end if
    self%n = self%n + 1
    associate (row => self%row(self%n))
      row%name = name
      row%width = size(value)
      row%value(:size(value)) = value
      if (present(is_count)) row%is_count = is_count
    end associate
  end subroutine add

  !> All components one after the other.
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

  !> Names below /observables that no species may have.
  function own_names() result(names)
    character(len=64), allocatable :: names(:)
    type(simulation_t) :: empty
    type(observable_list_t) :: list
    integer :: k

    allocate (empty%species(0), empty%disk(0), empty%tag(0))
    empty%drive%kind = noise
    call empty%tally%make_room(n_sides)
    empty%box = box_t()
    empty%box%surface%law%temperature = 1         ! but all that can be measured
    empty%box%surface%law%speed = 1
    empty%with%stress = .true.
    list = observed(empty)
    allocate (names(list%n + 1))
    names(list%n + 1) = "walls"                   ! it has none
    do k = 1, list%n
      associate (name => list%row(k)%name)
        names(k) = name(:index(name//"/", "/") - 1)
      end associate
    end do
  end function own_names

  !> Kinetic and potential energy of all disks.
  pure function total_energy(sim) result(energy)
    type(simulation_t), intent(in) :: sim
    real(real64) :: energy
    type(sums_t) :: sums(0:size(sim%species))

    call add_up(sim, sums)
    energy = sums(0)%total(sim%is_driven())
  end function total_energy

  !> Energy of all kinds.
  pure function total(self, exact)
    class(sums_t), intent(in) :: self
    logical, intent(in) :: exact
    real(real64) :: total

    total = self%kinetic + self%potential + self%rotational
    if (exact) total = self%energy + self%lost
  end function total

  !> Adds to the energy (Neumaier, Z. Angew. Math. Mech. 54, 39 (1974)): what disks are given shows in the last digits of
  !> a sum over many.
  pure subroutine add_energy(sums, term)
    type(sums_t), intent(inout) :: sums
    real(real64), intent(in) :: term
    real(real64) :: new

    new = sums%energy + term
    if (abs(sums%energy) >= abs(term)) then
      sums%lost = sums%lost + ((sums%energy - new) + term)
    else
      sums%lost = sums%lost + ((term - new) + sums%energy)
    end if
    sums%energy = new
  end subroutine add_energy

  !> One pass over the disks. Heights count from the origin.
  pure subroutine add_up(sim, sums)
    type(simulation_t), intent(in) :: sim
    type(sums_t), intent(out) :: sums(0:)
    real(real64) :: v(2), speed2, mass
    logical :: falling, sheared, driven
    integer(int32) :: i
    integer :: s

    falling = sim%box%falling()
    sheared = sim%box%is_sheared()
    driven = sim%is_driven()
    do i = 1, sim%n_disks()
      v = sim%velocity(i)
      mass = sim%mass_of(i)
      speed2 = dot_product(v, v)
      associate (own => sums(sim%tag(i)%species))
        own%n = own%n + 1
        own%mass = own%mass + mass
        own%kinetic = own%kinetic + 0.5_real64*mass*speed2
        if (falling) own%potential = own%potential - mass*dot_product(sim%box%gravity, sim%position(i))
        own%speed = own%speed + sqrt(speed2)
        own%momentum = own%momentum + mass*v
        if (sim%with%rotation) own%rotational = own%rotational + 0.5_real64*sim%inertia_of(i)*sim%spin(i)**2
        if (sheared) then
          v = v - sim%box%stream(sim%position(i))
          own%own_kinetic = own%own_kinetic + 0.5_real64*mass*dot_product(v, v)
          own%own_momentum = own%own_momentum + mass*v
        end if
        if (driven) call add_energy(own, 0.5_real64*mass*speed2)
        if (driven .and. falling) call add_energy(own, -mass*dot_product(sim%box%gravity, sim%position(i)))
        if (driven .and. sim%with%rotation) call add_energy(own, 0.5_real64*sim%inertia_of(i)*sim%spin(i)**2)
      end associate
    end do
    do s = 1, size(sim%species)
      associate (all => sums(0), own => sums(s))
        all%n = all%n + own%n
        all%mass = all%mass + own%mass
        all%kinetic = all%kinetic + own%kinetic
        all%potential = all%potential + own%potential
        all%speed = all%speed + own%speed
        all%momentum = all%momentum + own%momentum
        all%rotational = all%rotational + own%rotational
        all%lost = all%lost + own%lost
        call add_energy(all, own%energy)
        if (.not. sheared) then
          own%own_kinetic = own%kinetic
          own%own_momentum = own%momentum
        end if
        all%own_kinetic = all%own_kinetic + own%own_kinetic
        all%own_momentum = all%own_momentum + own%own_momentum
      end associate
    end do
  end subroutine add_up

  !> Pressure in two dimensions by the virial theorem, P A = K + W/(2t): K now, W the sum of impulse times
  !> distance over the pair collisions since the start.
  pure function pressure(sim, kinetic)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: kinetic           !! of all disks, relative to the profile of a sheared box [energy]
    real(real64) :: pressure

    pressure = kinetic
    if (sim%time() > 0) pressure = pressure + 0.5_real64*sim%tally%total(virial)/sim%time()
    pressure = pressure/free_area(sim%box)
  end function pressure

end module observables
