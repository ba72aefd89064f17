!> Recycles disks: at regular times, each disk whose centre is in one region moves to a random position in another region. With
!> recycling, a discharging hopper or a gas that escapes through an opening reaches a steady state. The random numbers of a move
!> depend only on the seed, the id of the disk and the number of the kick, as in the module `kicks`.
module recycling
  use kinds, only: int32, int64, never, real64
  use box_sides, only: centre_range
  use disks, only: advance_disk
  use kicks, only: change_spin, change_velocity
  use packing, only: packing_t
  use random_stream, only: key_of_draws, random_stream_t, recycled_disks
  use simulation_state, only: simulation_t
  use tally, only: drive_energy
  implicit none
  private
  public :: are_waiting, recycle_disks

  !> Largest number of random positions that are tried for one disk in one kick.
  integer, parameter :: most_trials = 100

contains

  !> Moves each disk whose centre is in `from_region` to a free position in `to_region`, in the order of the ids, and lists the
  !> moved disks. A position is free if a disk at this position overlaps no other disk, no obstacle and no side. If no free position
  !> is found for a disk, the disk is not moved. The former position of a moved disk counts as occupied until the procedure returns.
  subroutine recycle_disks(sim, moved)
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable, intent(out) :: moved(:)     !! indices of the moved disks
    type(packing_t), allocatable :: packing
    type(random_stream_t) :: stream
    integer(int32), allocatable :: due(:)
    real(real64) :: x(2)                                     ! new position [length]
    integer(int64) :: key
    integer(int32) :: k, n, n_moved
    logical :: free

    sim%kicks = sim%kicks + 1
    n = sim%n_disks()
    call list_disks_due(sim, due)
    allocate (moved(size(due)))
    n_moved = 0
    if (size(due) > 0) packing = present_packing(sim, size(due))
    key = key_of_draws(sim%seed, recycled_disks)
    do k = 1, size(due, kind=int32)
      associate (i => due(k))
        call stream%seed_disk(key, sim%tag(i)%id, sim%kicks)
        call find_position(sim, packing, sim%disk(i)%radius, stream, x, free)
        if (.not. free) cycle
        call move_disk(sim, i, x, stream)
        sim%recycled(sim%tag(i)%id) = sim%recycled(sim%tag(i)%id) + 1
        n_moved = n_moved + 1
        moved(n_moved) = i
        call packing%add(n + n_moved, int(sim%tag(i)%species, int32), x, sim%disk(i)%radius)
      end associate
    end do
    moved = moved(:n_moved)
  end subroutine recycle_disks

  !> Whether any disk is in the region in which disks are recycled.
  pure function are_waiting(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    integer(int32) :: i

    yes = .false.
    do i = 1, sim%n_disks()
      yes = is_due(sim, i)
      if (yes) return
    end do
  end function are_waiting

  !> Whether the centre of disk i is in the region in which disks are recycled.
  pure function is_due(sim, i) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    logical :: yes
    real(real64) :: x(2)

    yes = sim%drive%acts_on(sim%tag(i)%species)
    if (.not. yes) return
    x = sim%position(i)
    associate (region => sim%drive%from_region)
      yes = all(x >= region([1, 3]) .and. x <= region([2, 4]))
    end associate
  end function is_due

  !> Lists the disks that are recycled at the present time, in the order of their ids.
  pure subroutine list_disks_due(sim, due)
    type(simulation_t), intent(in) :: sim
    integer(int32), allocatable, intent(out) :: due(:)
    integer(int32), allocatable :: index_of(:)               ! index of each disk to be recycled, by id; 0 for all other disks
    integer(int32) :: i

    allocate (index_of(sim%n_disks()), source=0_int32)
    do i = 1, sim%n_disks()
      if (is_due(sim, i)) index_of(sim%tag(i)%id) = i
    end do
    due = pack(index_of, index_of > 0)
  end subroutine list_disks_due

  !> A packing of all disks at their present positions, with space for the disks that will be moved.
  function present_packing(sim, more) result(packing)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: more                              !! largest number of disks that will be moved
    type(packing_t) :: packing
    real(real64), allocatable :: x(:, :)                     ! (2,n) present positions [length]
    integer(int32) :: i

    allocate (x(2, sim%n_disks()))
    do i = 1, sim%n_disks()
      x(:, i) = sim%position(i)
    end do
    packing = packing_t(sim%box, int(sim%n_disks()) + more, size(sim%species))
    associate (region => sim%drive%to_region)
      call packing%open_all_species(sim%tag%species, sim%disk%radius, min(minval(x, dim=2), region([1, 3])), &
        max(maxval(x, dim=2), region([2, 4])))
    end associate
    do i = 1, sim%n_disks()
      call packing%add(i, int(sim%tag(i)%species, int32), x(:, i), sim%disk(i)%radius)
    end do
  end function present_packing

  !> Draws random positions in `to_region` until a position is free for a disk with the given radius.
  pure subroutine find_position(sim, packing, radius, stream, x, free)
    type(simulation_t), intent(in) :: sim
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: radius                       !! [length]
    type(random_stream_t), intent(inout) :: stream
    real(real64), intent(out) :: x(2)                        !! [length]
    logical, intent(out) :: free                             !! .false. if none of the tried positions is free
    real(real64) :: lower(2), upper(2), u(2)
    integer(int32) :: blocker
    integer :: trial

    ! A moving side may leave no space for the disk in the region; along the axis of the side, `upper` then equals `lower`.
    call centre_range(sim%drive%to_region, sim%box, radius, lower, upper, sim%now)
    free = .false.
    x = lower
    if (any(lower >= upper)) return
    do trial = 1, most_trials
      call stream%draw_uniform(u(1))
      call stream%draw_uniform(u(2))
      x = min(lower + u*(upper - lower), upper)
      call packing%find_blocker(x, [0.0_real64, 0.0_real64], radius, blocker)
      free = blocker == 0
      if (free) return
    end do
  end subroutine find_position

  !> Moves disk i to a new position, at which a new trajectory starts. The procedure erases the last collision partner of the disk,
  !> the time of its last contact and its number of crossed periods. The change of its kinetic, rotational and potential energy is
  !> added to the sum `drive_energy`. The disk receives the given velocity and no rotation, or a velocity and a rotation drawn from
  !> the Maxwell distribution.
  subroutine move_disk(sim, i, x, stream)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: x(2)                         !! [length]
    type(random_stream_t), intent(inout) :: stream
    real(real64) :: v(2), spin(2)

    call sim%rotate_to(i, sim%now)
    call advance_disk(sim%disk(i), sim%box%gravity, sim%now)
    call sim%tally%sum(drive_energy)%add(-sim%mass_of(i)*dot_product(sim%box%gravity, x - sim%disk(i)%x))
    sim%disk(i)%x = x
    sim%tag(i)%last_partner = 0
    if (allocated(sim%extra)) then
      sim%extra(i)%last_contact = -never
      sim%extra(i)%image = 0
    end if
    v = sim%drive%velocity
    spin = 0
    if (sim%drive%temperature > 0) then
      call stream%draw_normals(v)
      v = sqrt(sim%drive%temperature/sim%mass_of(i))*v
      if (sim%features%rotation) call stream%draw_normals(spin)
    end if
    call change_velocity(sim, i, v)
    if (sim%features%rotation) call change_spin(sim, i, sqrt(sim%drive%temperature/sim%inertia_of(i))*spin(1))
  end subroutine move_disk

end module recycling
