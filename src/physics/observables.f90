!> What is measured of a simulation besides the frames: means over the disks, totals, and the counts and sums
!> that the collisions have gathered.
module observables
  use kinds, only: int32, pi, real64
  use box_geometry, only: free_area
  use disks, only: species_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: observable_t, observable_list, observed_values, total_energy

  !> One observable, scalar or vector.
  type :: observable_t
    character(len=64) :: name = ""                !! below /observables
    integer :: width = 1                          !! number of components
    logical :: is_count = .false.                 !! a whole number
  end type observable_t

  integer, parameter :: n_means = 4               !! per species: K, U, |v|, kT

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

  !> All observables, in the order of `observed_values`.
  pure function observable_list(species) result(list)
    type(species_t), intent(in) :: species(:)
    type(observable_t), allocatable :: list(:)
    integer :: s

    list = means_of("all")
    do s = 1, size(species)
      list = [list, means_of(species(s)%name)]
    end do
    list = [list, observable_t("total_energy"), observable_t("momentum", 2), &
      observable_t("pressure"), observable_t("virial"), observable_t("dissipated_energy"), &
      observable_t("collisions", 1, .true.), observable_t("wall_collisions", 4, .true.), &
      observable_t("wall_impulse", 4), observable_t("obstacle_collisions", 1, .true.)]
  end function observable_list

  !> The means over a species.
  pure function means_of(group) result(list)
    character(len=*), intent(in) :: group
    type(observable_t) :: list(n_means)

    list = [observable_t(group//"/kinetic_energy"), observable_t(group//"/potential_energy"), &
      observable_t(group//"/mean_speed"), observable_t(group//"/temperature")]
  end function means_of

  !> Their values now, vectors flattened; counts as reals, exact up to 2**53.
  pure function observed_values(sim) result(values)
    type(simulation_t), intent(in) :: sim
    real(real64), allocatable :: values(:)
    type(sums_t) :: sums(0:size(sim%species))     ! 0: all
    integer :: s

    call add_up(sim, sums)
    values = [(means(sums(s)), s=0, size(sim%species))]
    values = [values, sums(0)%kinetic + sums(0)%potential, sums(0)%momentum, &
      pressure(sim, sums(0)%kinetic), sim%virial, sim%dissipated, real(sim%collisions, real64), &
      real(sim%wall_collisions, real64), sim%wall_impulse, real(sim%obstacle_collisions, real64)]
  end function observed_values

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
      mass = sim%species(sim%tag(i)%species)%mass
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

  !> Kinetic and potential energy and speed per disk, and the temperature kT in two dimensions: the
  !> kinetic energy per disk relative to the common motion.
  pure function means(sums)
    type(sums_t), intent(in) :: sums
    real(real64) :: means(n_means), common

    means = 0
    if (.not. sums%n > 0) return
    common = 0.5_real64*dot_product(sums%momentum, sums%momentum)/sums%mass
    means = [sums%kinetic, sums%potential, sums%speed, max(sums%kinetic - common, 0.0_real64)]/sums%n
  end function means

  !> Pressure in two dimensions by the virial theorem, P A = K + W/(2t): K now, W the sum of impulse times
  !> distance over the pair collisions since the start.
  pure function pressure(sim, kinetic)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: kinetic           !! of all disks [energy]
    real(real64) :: pressure

    pressure = kinetic
    if (sim%time() > 0) pressure = pressure + 0.5_real64*sim%virial/sim%time()
    pressure = pressure/free_area(sim%box)
  end function pressure

end module observables
