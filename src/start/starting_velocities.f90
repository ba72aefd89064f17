!> Initial velocities of the disks, by the rules of their species. Each species has its own random streams, so that changes to one
!> species do not affect the random numbers of other species.
module starting_velocities
  use kinds, only: int32, real64
  use disks, only: disks_before
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use random_stream, only: random_stream_t
  use settings, only: settings_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: draw_initial_velocities

  integer, parameter :: stream_number = 2, stream_of_spins = 6  !! numbers that identify the random streams of this module

contains

  !> Sets the velocities of all disks. If no boundary or force can change the total momentum, the total momentum is set to zero. In
  !> a sheared box the rules and temperatures apply to velocities relative to the velocity profile, but velocities that are given
  !> explicitly are absolute.
  subroutine draw_initial_velocities(settings, groups, sim, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)                  !! groups of the species
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    type(random_stream_t) :: stream
    real(real64) :: mass(size(sim%disk))
    logical :: balanced, given
    integer :: s, i, first, last

    mass = sim%masses()
    balanced = all(sim%box%periodic) .and. .not. sim%box%has_obstacles() .and. .not. sim%box%has_gravity()
    do s = 1, size(settings%species)
      call find_disks()
      call stream%seed(settings%run%seed, [s, stream_number])
      call draw_velocities()
    end do
    if (balanced) call remove_drift()
    do s = 1, size(settings%species)
      call find_disks()
      if (sim%features%rotation) call draw_spins()
      associate (species => settings%species(s))
        given = species%velocities == "explicit" .or. species%velocities == "file"
        if (species%exact_temperature >= 0) then
          if (given) call add_stream(-1.0_real64)
          call scale_to_temperature(species%exact_temperature)
          given = .false.
        end if
        if (.not. given) call add_stream(1.0_real64)
      end associate
    end do

  contains

    !> Finds the first and the last disk of species s.
    subroutine find_disks()
      first = disks_before(settings%species, s) + 1
      last = disks_before(settings%species, s + 1)
    end subroutine find_disks

    !> Draws the velocities of one species. If the total momentum has to be zero, velocities of equal speed are drawn in opposite
    !> pairs (and one triple at 120 degrees if the number is odd), so that the speeds remain equal. For velocities by other rules,
    !> `remove_drift` sets the total momentum to zero.
    subroutine draw_velocities()
      associate (species => settings%species(s), disk => sim%disk)
        select case (species%velocities)
        case ("equal_speed")
          call draw_directions(balanced .and. last > first)
          do i = first, last
            disk(i)%v = species%speed*disk(i)%v
          end do
        case ("uniform")
          do i = first, last
            call stream%draw_uniform(disk(i)%v(1))
            call stream%draw_uniform(disk(i)%v(2))
            disk(i)%v = species%speed*(2*disk(i)%v - 1)
          end do
        case ("maxwell")
          do i = first, last
            call stream%draw_normals(disk(i)%v)
            disk(i)%v = sqrt(species%temperature/mass(i))*disk(i)%v
          end do
        case ("explicit")
          do i = first, last
            ! A single given velocity applies to all disks.
            disk(i)%v = species%velocity(:, min(i - first + 1, size(species%velocity, 2)))
          end do
        case default                                        ! 'rest', or 'file' for velocities that are already set
        end select
      end associate
    end subroutine draw_velocities

    !> Draws unit vectors. Disks that receive opposite velocities are half a list apart, so that they are not neighbours on the
    !> initial grid.
    subroutine draw_directions(in_pairs)
      logical, intent(in) :: in_pairs
      real(real64), parameter :: sine_of_120 = 0.5_real64*sqrt(3.0_real64)  ! sine of 120 degrees
      integer :: n, half

      n = last - first + 1
      half = 0
      if (in_pairs) half = (n - merge(3, 0, modulo(n, 2) == 1))/2
      do i = first, first + half - 1
        call stream%draw_direction(sim%disk(i)%v)
        sim%disk(i + half)%v = -sim%disk(i)%v
      end do
      do i = first + 2*half, last
        call stream%draw_direction(sim%disk(i)%v)
      end do
      if (.not. in_pairs .or. modulo(n, 2) == 0) return
      associate (e => sim%disk(last)%v)
        sim%disk(last - 1)%v = -0.5_real64*e + sine_of_120*[-e(2), e(1)]
        sim%disk(last - 2)%v = -0.5_real64*e - sine_of_120*[-e(2), e(1)]
      end associate
    end subroutine draw_directions

    !> Sets the total momentum of all generated velocities to zero by shifting the velocities of 'uniform' and 'maxwell'. The
    !> momenta of a species with 'equal_speed' already add up to zero, unless the species has a single disk.
    subroutine remove_drift()
      logical, dimension(size(settings%species)) :: shifted, generated
      real(real64) :: momentum(2), total

      associate (species => settings%species)
        shifted = [(species(i)%velocities == "uniform" .or. species(i)%velocities == "maxwell", i=1, size(species))]
        generated = [(shifted(i) .or. species(i)%velocities == "equal_speed", i=1, size(species))]
      end associate
      momentum = 0
      total = 0
      do i = 1, size(sim%disk)
        if (generated(sim%tag(i)%species)) momentum = momentum + mass(i)*sim%disk(i)%v
        if (shifted(sim%tag(i)%species)) total = total + mass(i)
      end do
      if (.not. total > 0) return
      do i = 1, size(sim%disk)
        if (shifted(sim%tag(i)%species)) sim%disk(i)%v = sim%disk(i)%v - momentum/total
      end do
    end subroutine remove_drift

    !> Sets the angular velocities. With 'file' the angular velocities have been set together with the positions.
    subroutine draw_spins()
      real(real64) :: normals(2)

      call stream%seed(settings%run%seed, [s, stream_of_spins])
      do i = first, last
        associate (species => settings%species(s), omega => sim%extra(i)%spin)
          if (species%rotational_temperature >= 0) then
            call stream%draw_normals(normals)
            omega = sqrt(species%rotational_temperature/sim%inertia_of(int(i, int32)))*normals(1)
          else if (abs(species%angular_velocity) > 0) then
            omega = species%angular_velocity
          end if
        end associate
      end do
    end subroutine draw_spins

    !> Scales the velocities of one species, relative to their mean, to an exact temperature. The momentum of the species does not
    !> change.
    subroutine scale_to_temperature(wanted)
      real(real64), intent(in) :: wanted                    !! intended kT of the translational motion [energy]
      real(real64) :: mean(2), temperature
      integer :: axis

      associate (disk => sim%disk(first:last), m => mass(first:last))
        mean = [(sum(m*disk%v(axis))/sum(m), axis=1, 2)]
        temperature = 0
        do i = 1, size(disk)
          temperature = temperature + 0.5_real64*m(i)*sum((disk(i)%v - mean)**2)/size(disk)
        end do
        if (first == last) then
          call groups(s)%complain("exact_temperature", "one disk does not move relative to the mean of its species; leave it " &
            //"out, or use more disks", problems)
        else if (.not. temperature > 0) then
          call groups(s)%complain("exact_temperature", "the disks do not move relative to each other, which no factor changes; " &
            //"use velocities = 'maxwell'", problems)
        else
          do i = 1, size(disk)
            disk(i)%v = mean + sqrt(wanted/temperature)*(disk(i)%v - mean)
          end do
        end if
      end associate
    end subroutine scale_to_temperature

    !> Adds or subtracts the velocity profile of a sheared box.
    subroutine add_stream(factor)
      real(real64), intent(in) :: factor                    !! 1 to add, -1 to subtract

      if (.not. sim%box%is_sheared()) return
      do i = first, last
        sim%disk(i)%v = sim%disk(i)%v + factor*sim%box%shear_profile(sim%disk(i)%x)
      end do
    end subroutine add_stream
  end subroutine draw_initial_velocities

end module starting_velocities
