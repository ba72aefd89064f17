!> What is measured of a simulation besides the frames: means over the disks, totals, and the counts and sums
!> that the collisions have gathered.
module observables
  use kinds, only: int32, real64
  use box_geometry, only: free_area
  use simulation_state, only: simulation_t
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
  end type sums_t

contains

  !> All observables with their values now. A new one is one more line here.
  pure function observed(sim) result(list)
    type(simulation_t), intent(in) :: sim
    type(observable_list_t) :: list
    type(sums_t) :: sums(0:size(sim%species))     ! 0: all
    integer :: s

    call add_up(sim, sums)
    call add_means(list, "all", sums(0))
    do s = 1, size(sim%species)
      call add_means(list, sim%species(s)%name, sums(s))
    end do
    call list%add("total_energy", [sums(0)%kinetic + sums(0)%potential])
    call list%add("momentum", sums(0)%momentum)
    call list%add("pressure", [pressure(sim, sums(0)%kinetic)])
    call list%add("virial", [sim%virial%value()])
    call list%add("dissipated_energy", [sim%dissipated%value()])
    call list%add("collisions", real([sim%collisions], real64), is_count=.true.)
    call list%add("wall_collisions", real(sim%wall_collisions, real64), is_count=.true.)
    call list%add("wall_impulse", sim%wall_impulse%value())
    call list%add("obstacle_collisions", real([sim%obstacle_collisions], real64), is_count=.true.)
  end function observed

  !> Means over a species, per disk. The temperature is kT in two dimensions: the kinetic energy relative to the
  !> common motion.
  pure subroutine add_means(list, group, sums)
    type(observable_list_t), intent(inout) :: list
    character(len=*), intent(in) :: group         !! name of the species
    type(sums_t), intent(in) :: sums
    real(real64) :: n, drift

    n = max(sums%n, 1.0_real64)
    drift = 0
    if (sums%n > 0) drift = 0.5_real64*dot_product(sums%momentum, sums%momentum)/sums%mass
    call list%add(group//"/kinetic_energy", [sums%kinetic/n])
    call list%add(group//"/potential_energy", [sums%potential/n])
    call list%add(group//"/mean_speed", [sums%speed/n])
    call list%add(group//"/temperature", [max(sums%kinetic - drift, 0.0_real64)/n])
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
  pure function own_names() result(names)
    character(len=64), allocatable :: names(:)
    type(simulation_t) :: empty
    type(observable_list_t) :: list
    integer :: k

    allocate (empty%species(0), empty%disk(0), empty%tag(0))
    list = observed(empty)
    allocate (names(list%n))
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
    energy = sums(0)%kinetic + sums(0)%potential
  end function total_energy

  !> One pass over the disks. Heights count from the origin.
  pure subroutine add_up(sim, sums)
    type(simulation_t), intent(in) :: sim
    type(sums_t), intent(out) :: sums(0:)
    real(real64) :: x(2), v(2), speed2, mass
    integer(int32) :: i
    integer :: s

    do i = 1, sim%n_disks()
      x = sim%position(i)
      v = sim%velocity(i)
      mass = sim%mass_of(i)
      speed2 = dot_product(v, v)
      associate (own => sums(sim%tag(i)%species))
        own%n = own%n + 1
        own%mass = own%mass + mass
        own%kinetic = own%kinetic + 0.5_real64*mass*speed2
        own%potential = own%potential - mass*dot_product(sim%box%gravity, x)
        own%speed = own%speed + sqrt(speed2)
        own%momentum = own%momentum + mass*v
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
      end associate
    end do
  end subroutine add_up

  !> Pressure in two dimensions by the virial theorem, P A = K + W/(2t): K now, W the sum of impulse times
  !> distance over the pair collisions since the start.
  pure function pressure(sim, kinetic)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: kinetic           !! of all disks [energy]
    real(real64) :: pressure

    pressure = kinetic
    if (sim%time() > 0) pressure = pressure + 0.5_real64*sim%virial%value()/sim%time()
    pressure = pressure/free_area(sim%box)
  end function pressure

end module observables
