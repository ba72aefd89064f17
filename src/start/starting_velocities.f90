!> Generates the initial velocities of the disks, by the method chosen for each species. Each
!> species has its own random streams, so that changing one species does not affect the random
!> numbers of the others.
module starting_velocities
  use kinds, only: int32, int64, real64
  use disks, only: disk_t, disks_before
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use random_stream, only: random_stream_t
  use settings, only: settings_t, species_settings_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: draw_initial_velocities

  !> Keys of the random streams of this module.
  integer, parameter :: stream_number = 2, stream_of_spins = 6

  !> State of the generation of velocities, one species after another.
  type :: drawing_t
    integer(int64) :: seed = 0                              !! seed of the run
    type(random_stream_t) :: stream
    real(real64), allocatable :: mass(:)                    !! masses of all disks [mass]
    integer :: first = 0, last = 0                          !! first and last disk of the present species
  contains
    procedure :: draw_velocities
    procedure :: draw_directions
    procedure :: remove_drift
    procedure :: draw_spins
    procedure :: scale_to_temperature
    procedure :: add_stream
  end type drawing_t

contains

  !> Generates the initial velocities of all disks. If no boundary or force can change the total
  !> momentum, the total momentum of generated velocities is set to zero. In a sheared box,
  !> generated velocities and temperatures are relative to the shear flow. Explicit velocities are
  !> absolute.
  subroutine draw_initial_velocities(settings, groups, sim, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)                  !! groups of the species
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    type(drawing_t) :: drawing
    logical :: balanced, given
    integer :: s

    drawing%seed = settings%run%seed
    drawing%mass = sim%masses()
    balanced = all(sim%box%periodic) .and. .not. sim%box%has_obstacles() .and. .not. sim%box%has_gravity()
    do s = 1, size(settings%species)
      drawing%first = disks_before(settings%species, s) + 1
      drawing%last = disks_before(settings%species, s + 1) - settings%species(s)%waiting
      call drawing%stream%seed(drawing%seed, [s, stream_number])
      call drawing%draw_velocities(settings%species(s), balanced, sim%disk)
    end do
    if (balanced) call drawing%remove_drift(settings%species, sim)
    do s = 1, size(settings%species)
      drawing%first = disks_before(settings%species, s) + 1
      drawing%last = disks_before(settings%species, s + 1) - settings%species(s)%waiting
      if (drawing%last < drawing%first) cycle
      associate (species => settings%species(s))
        if (sim%features%rotation) call drawing%draw_spins(species, s, sim)
        given = species%velocities == "explicit" .or. species%velocities == "file"
        if (species%exact_temperature >= 0) then
          if (given) call drawing%add_stream(sim, -1.0_real64)
          call drawing%scale_to_temperature(species%exact_temperature, groups(s), sim%disk, problems)
          given = .false.
        end if
        if (.not. given) call drawing%add_stream(sim, 1.0_real64)
      end associate
    end do
  end subroutine draw_initial_velocities

  !> Draws the velocities of one species. If the total momentum must vanish, velocities of equal
  !> speed are drawn as opposite pairs. If the number of disks is odd, three of the velocities point
  !> in directions 120 degrees apart. These velocities add up to zero although all disks have the
  !> same speed. For 'uniform' and 'maxwell', `remove_drift` sets the total momentum to zero.
  subroutine draw_velocities(self, species, balanced, disk)
    class(drawing_t), intent(inout) :: self
    type(species_settings_t), intent(in) :: species
    logical, intent(in) :: balanced                         !! whether the total momentum must vanish
    type(disk_t), intent(inout) :: disk(:)
    integer :: i

    associate (first => self%first, last => self%last)
      select case (species%velocities)
      case ("equal_speed")
        call self%draw_directions(balanced .and. last > first, disk)
        do i = first, last
          disk(i)%v = species%speed*disk(i)%v
        end do
      case ("uniform")
        do i = first, last
          call self%stream%draw_uniform(disk(i)%v(1))
          call self%stream%draw_uniform(disk(i)%v(2))
          disk(i)%v = species%speed*(2*disk(i)%v - 1)
        end do
      case ("maxwell")
        do i = first, last
          call self%stream%draw_normals(disk(i)%v)
          disk(i)%v = sqrt(species%temperature/self%mass(i))*disk(i)%v
        end do
      case ("explicit")
        do i = first, last
          ! A single velocity in the input applies to all disks.
          disk(i)%v = species%velocity(:, min(i - first + 1, size(species%velocity, 2)))
        end do
      case default  ! 'rest': zero; 'file': already set
      end select
    end associate
  end subroutine draw_velocities

  !> Draws unit vectors in random directions. The indices of disks with opposite velocities differ
  !> by half the number of disks. These disks are therefore not neighbours on an initial grid.
  subroutine draw_directions(self, in_pairs, disk)
    class(drawing_t), intent(inout) :: self
    logical, intent(in) :: in_pairs
    type(disk_t), intent(inout) :: disk(:)
    real(real64), parameter :: sine_of_120 = 0.5_real64*sqrt(3.0_real64)  ! sine of an angle of 120 degrees
    integer :: i, n, half

    n = self%last - self%first + 1
    half = 0
    if (in_pairs) half = (n - merge(3, 0, modulo(n, 2) == 1))/2
    do i = self%first, self%first + half - 1
      call self%stream%draw_direction(disk(i)%v)
      disk(i + half)%v = -disk(i)%v
    end do
    do i = self%first + 2*half, self%last
      call self%stream%draw_direction(disk(i)%v)
    end do
    if (.not. in_pairs .or. modulo(n, 2) == 0) return
    associate (e => disk(self%last)%v)
      disk(self%last - 1)%v = -0.5_real64*e + sine_of_120*[-e(2), e(1)]
      disk(self%last - 2)%v = -0.5_real64*e - sine_of_120*[-e(2), e(1)]
    end associate
  end subroutine draw_directions

  !> Sets the total momentum of all generated velocities to zero, by subtracting a constant velocity
  !> from all 'uniform' and 'maxwell' disks. The momenta of an 'equal_speed' species already add up
  !> to zero, unless the species consists of a single disk.
  subroutine remove_drift(self, species, sim)
    class(drawing_t), intent(in) :: self
    type(species_settings_t), intent(in) :: species(:)
    type(simulation_t), intent(inout) :: sim
    logical, dimension(size(species)) :: shifted, generated
    real(real64) :: momentum(2), total
    integer :: i

    shifted = [(species(i)%velocities == "uniform" .or. species(i)%velocities == "maxwell", i=1, size(species))]
    generated = [(shifted(i) .or. species(i)%velocities == "equal_speed", i=1, size(species))]
    momentum = 0
    total = 0
    do i = 1, size(sim%disk)
      if (.not. sim%is_inside(i)) cycle
      if (generated(sim%tag(i)%species)) momentum = momentum + self%mass(i)*sim%disk(i)%v
      if (shifted(sim%tag(i)%species)) total = total + self%mass(i)
    end do
    if (.not. total > 0) return
    do i = 1, size(sim%disk)
      if (shifted(sim%tag(i)%species) .and. sim%is_inside(i)) sim%disk(i)%v = sim%disk(i)%v - momentum/total
    end do
  end subroutine remove_drift

  !> Generates the initial angular velocities. Angular velocities from a file have been set together
  !> with the positions.
  subroutine draw_spins(self, species, s, sim)
    class(drawing_t), intent(inout) :: self
    type(species_settings_t), intent(in) :: species
    integer, intent(in) :: s                                !! index of the species
    type(simulation_t), intent(inout) :: sim
    real(real64) :: normals(2)
    integer :: i

    call self%stream%seed(self%seed, [s, stream_of_spins])
    do i = self%first, self%last
      associate (omega => sim%extra(i)%spin)
        if (species%rotational_temperature >= 0) then
          call self%stream%draw_normals(normals)
          omega = sqrt(species%rotational_temperature/sim%inertia_of(int(i, int32)))*normals(1)
        else if (abs(species%angular_velocity) > 0) then
          omega = species%angular_velocity
        end if
      end associate
    end do
  end subroutine draw_spins

  !> Scales the velocities of a species relative to their mean, so that the species has exactly the
  !> given temperature. The total momentum is conserved.
  subroutine scale_to_temperature(self, wanted, group, disks, problems)
    class(drawing_t), intent(in) :: self
    real(real64), intent(in) :: wanted                      !! required translational kT [energy]
    type(group_t), intent(in) :: group                      !! group of the species
    type(disk_t), intent(inout) :: disks(:)                 !! all disks
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: mean(2), temperature
    integer :: axis, i

    associate (disk => disks(self%first:self%last), m => self%mass(self%first:self%last))
      mean = [(sum(m*disk%v(axis))/sum(m), axis=1, 2)]
      temperature = 0
      do i = 1, size(disk)
        temperature = temperature + 0.5_real64*m(i)*sum((disk(i)%v - mean)**2)/size(disk)
      end do
      if (size(disk) == 1) then
        call group%complain("exact_temperature", "one disk does not move relative to the mean of its species; leave it " &
          //"out, or use more disks", problems)
      else if (.not. temperature > 0) then
        call group%complain("exact_temperature", "the disks do not move relative to each other, which no factor changes; " &
          //"use velocities = 'maxwell'", problems)
      else
        do i = 1, size(disk)
          disk(i)%v = mean + sqrt(wanted/temperature)*(disk(i)%v - mean)
        end do
      end if
    end associate
  end subroutine scale_to_temperature

  !> Adds the velocity profile of the shear flow to the velocities of all disks, or subtracts it.
  subroutine add_stream(self, sim, factor)
    class(drawing_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: factor                      !! 1 to add the profile, -1 to subtract it
    integer :: i

    if (.not. sim%box%is_sheared()) return
    do i = self%first, self%last
      sim%disk(i)%v = sim%disk(i)%v + factor*sim%box%shear_profile(sim%disk(i)%x)
    end do
  end subroutine add_stream

end module starting_velocities
