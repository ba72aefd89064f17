!> How disks start to move, by the rule of their species.
module starting_velocities
  use kinds, only: int32, real64
  use box_geometry, only: box_t
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use disks, only: disk_t
  use random_stream, only: random_stream_t
  use settings, only: species_settings_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: add_stream, draw_velocities, remove_drift, scale_to_temperature

contains

  !> Gives the disks of one species their velocities. `balanced` asks for zero total momentum: equal
  !> speeds then come in opposite pairs (and one star of three if the number is odd), so that they
  !> stay equal; the other rules leave it to `remove_drift`.
  pure subroutine draw_velocities(species, mass, stream, balanced, disk)
    type(species_settings_t), intent(in) :: species
    real(real64), intent(in) :: mass(:)             !! (count) [mass]
    type(random_stream_t), intent(inout) :: stream
    logical, intent(in) :: balanced
    type(disk_t), intent(inout) :: disk(:)          !! (count)
    integer :: i

    select case (species%velocities)
    case ("equal_speed")
      call draw_directions(stream, balanced .and. size(disk) > 1, disk)
      do i = 1, size(disk)
        disk(i)%v = species%speed*disk(i)%v
      end do
    case ("uniform")
      do i = 1, size(disk)
        call stream%draw_uniform(disk(i)%v(1))
        call stream%draw_uniform(disk(i)%v(2))
        disk(i)%v = species%speed*(2*disk(i)%v - 1)
      end do
    case ("maxwell")
      do i = 1, size(disk)
        call stream%draw_normals(disk(i)%v)
        disk(i)%v = sqrt(species%temperature/mass(i))*disk(i)%v
      end do
    case ("explicit")
      do i = 1, size(disk)
        disk(i)%v = species%velocity(:, min(i, size(species%velocity, 2)))   ! one holds for all
      end do
    case default                                    ! 'rest'; 'file': they came with the positions
    end select
  end subroutine draw_velocities

  !> Unit vectors. Balanced, the partner is half the list away, not a neighbour on a grid.
  pure subroutine draw_directions(stream, balanced, disk)
    type(random_stream_t), intent(inout) :: stream
    logical, intent(in) :: balanced
    type(disk_t), intent(inout) :: disk(:)
    real(real64), parameter :: turn = 0.5_real64*sqrt(3.0_real64)     ! sine of 120 degrees
    integer :: i, n, half

    n = size(disk)
    half = 0
    if (balanced) half = (n - merge(3, 0, modulo(n, 2) == 1))/2
    do i = 1, half
      call stream%draw_direction(disk(i)%v)
      disk(i + half)%v = -disk(i)%v
    end do
    do i = 2*half + 1, n
      call stream%draw_direction(disk(i)%v)
    end do
    if (.not. balanced .or. modulo(n, 2) == 0) return
    associate (e => disk(n)%v)
      disk(n - 1)%v = -0.5_real64*e + turn*[-e(2), e(1)]
      disk(n - 2)%v = -0.5_real64*e - turn*[-e(2), e(1)]
    end associate
  end subroutine draw_directions

  !> Makes the total momentum of all velocities that a rule has generated zero. What is shifted are
  !> those of 'uniform' and 'maxwell'; equal speeds are balanced among themselves, a single one
  !> excepted.
  pure subroutine remove_drift(species, sim)
    type(species_settings_t), intent(in) :: species(:)
    type(simulation_t), intent(inout) :: sim
    logical, dimension(size(species)) :: shifted, generated
    real(real64) :: momentum(2), mass
    integer(int32) :: i

    shifted = [(species(i)%velocities == "uniform" .or. species(i)%velocities == "maxwell", i=1, size(species))]
    generated = [(shifted(i) .or. species(i)%velocities == "equal_speed", i=1, size(species))]
    momentum = 0
    mass = 0
    do i = 1, size(sim%disk)
      associate (s => sim%tag(i)%species)
        if (generated(s)) momentum = momentum + sim%mass_of(i)*sim%disk(i)%v
        if (shifted(s)) mass = mass + sim%mass_of(i)
      end associate
    end do
    if (.not. mass > 0) return
    do i = 1, size(sim%disk)
      if (shifted(sim%tag(i)%species)) sim%disk(i)%v = sim%disk(i)%v - momentum/mass
    end do
  end subroutine remove_drift

  !> Scales the velocities of the disks of one species, relative to their mean, to an exact temperature: the momentum stays.
  subroutine scale_to_temperature(species, group, mass, disk, problems)
    type(species_settings_t), intent(in) :: species
    type(group_t), intent(in) :: group
    real(real64), intent(in) :: mass(:)             !! (count) [mass]
    type(disk_t), intent(inout) :: disk(:)          !! (count)
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: mean(2), temperature
    integer :: i, axis

    mean = [(sum(mass*disk%v(axis))/sum(mass), axis=1, 2)]
    temperature = 0
    do i = 1, size(disk)
      temperature = temperature + 0.5_real64*mass(i)*sum((disk(i)%v - mean)**2)/size(disk)
    end do
    if (size(disk) == 1) then
      call group%complain("exact_temperature", "one disk does not move relative to the mean of its species; leave it out, or " &
        //"take more disks", problems)
      return
    else if (.not. temperature > 0) then
      call group%complain("exact_temperature", "the disks do not move relative to each other, which no factor changes; let " &
        //"them start with velocities = 'maxwell'", problems)
      return
    end if
    do i = 1, size(disk)
      disk(i)%v = mean + sqrt(species%exact_temperature/temperature)*(disk(i)%v - mean)
    end do
  end subroutine scale_to_temperature

  !> Adds the velocity profile of a sheared box, or takes it away.
  pure subroutine add_stream(box, factor, disk)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: factor              !! 1 or -1
    type(disk_t), intent(inout) :: disk(:)
    integer :: i

    if (.not. box%is_sheared()) return
    do i = 1, size(disk)
      disk(i)%v = disk(i)%v + factor*box%stream(disk(i)%x)
    end do
  end subroutine add_stream

end module starting_velocities
