!> Changes a running simulation: forces, contact laws, motions of sides, positions and velocities. Each change takes effect at the
!> present time, for all disks at once. The resulting change of the energy is counted as work.
module changes
  use box_sides, only: bounds
  use disks, only: advance_disk
  use epochs, only: restart_epoch
  use kinds, only: int32, int64, never, real64
  use partners, only: n_sides
  use observables, only: total_energy
  use side_motion, only: piston, side_state_t
  use sample_values, only: wrap
  use simulation_state, only: simulation_t, system_t
  use tally, only: work
  implicit none
  private
  public :: change_positions, change_system, change_velocities

contains

  !> Replaces the box, the contact law and the drive of a simulation by those of another input with the same disks. The new box,
  !> contact law and drive take effect at the present time. A side must not jump: its old and new positions at the present time must
  !> be equal.
  subroutine change_system(sim, system, problem)
    type(simulation_t), intent(inout) :: sim
    type(system_t), intent(in) :: system
    !> Reason why the system cannot be replaced; empty if the system has been replaced.
    character(len=:), allocatable, intent(out) :: problem
    type(simulation_t) :: other
    ! Energy before the change [energy], old and new positions of the sides [length], velocity of a side [length/time]
    real(real64) :: before, here(2, 2), there(2, 2), v
    integer :: k

    problem = ""
    other%specification_t = sim%specification_t
    other%system_t = system
    other%features%own_sizes = sim%features%own_sizes
    other%box%epoch = sim%box%epoch
    do k = 1, n_sides                                        ! a new piston has the position and velocity of the old side
      if (other%box%surface(k)%motion%kind /= piston) cycle
      v = 0
      if (sim%box%surface(k)%motion%moves()) v = sim%box%side_velocity(k, sim%now)
      other%box%side(k) = side_state_t(sim%box%side_position(k, sim%now), v, sim%now)
    end do
    call bounds(sim%box, sim%now, here(:, 1), here(:, 2))
    call bounds(other%box, sim%now, there(:, 1), there(:, 2))
    if ((other%features%rotation .neqv. sim%features%rotation) .or. &
      (other%features%orientation .neqv. sim%features%orientation) .or. &
      (other%law%contact_time > 0 .neqv. sim%law%contact_time > 0) .or. &
      (other%drive%moves_disks() .neqv. sim%drive%moves_disks())) then
      problem = "the change needs data that the disks do not have: rotation, orientation, contact_time > 0 and " &
        //"drive.kind = 'recycle' must be there from the start"
    else if (any(abs(there - here) > 1.0e-12_real64*minval(sim%box%edges()))) then
      problem = "a side would jump: at this time the new motion must have the position of the old one"
    end if
    if (problem /= "") return
    before = total_energy(sim)
    call advance_all(sim)
    sim%system_t = other%system_t
    call sim%fit_series()
    call count_kicks()
    call restart_epoch(sim)
    call book(sim, before)
  contains

    !> Sets `kicks` to the number of kicks that the new driving would have applied since the start of the run. The time and the
    !> random numbers of the next kick depend on the number of previous kicks.
    subroutine count_kicks()
      if (.not. sim%drive%is_on()) return
      sim%kicks = int(min(sim%time()/sim%drive%interval, 2.0_real64**62), int64)
      do while (sim%drive%time_of(sim%kicks + 1) <= sim%time())
        sim%kicks = sim%kicks + 1
      end do
      do while (sim%drive%time_of(sim%kicks) > sim%time())
        sim%kicks = sim%kicks - 1
      end do
    end subroutine count_kicks
  end subroutine change_system

  !> Sets the velocities of all disks.
  subroutine change_velocities(sim, v)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: v(:, :)                      !! (2,n) new velocities in the order of ids [length/time]
    real(real64) :: before, old(2)                           ! energy before the change [energy], old velocity [length/time]
    integer(int32) :: i

    before = total_energy(sim)
    call advance_all(sim)
    do i = 1, sim%n_disks()
      old = sim%disk(i)%v
      sim%disk(i)%v = v(:, sim%tag(i)%id)
      call sim%record_velocity_change(i, old, sim%now)
    end do
    sim%reference_energy = sim%kinetic_energy()
    call restart_epoch(sim)
    call book(sim, before)
  end subroutine change_velocities

  !> Sets the positions of all disks, without a test for overlaps. A new position beyond a periodic side is interpreted as the
  !> position of a periodic image of the disk.
  subroutine change_positions(sim, x)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: x(:, :)                      !! (2,n) new positions in the order of ids [length]
    ! Energy before the change [energy], old position [length], velocity [length/time]
    real(real64) :: before, old(2), v(2), image(2)
    integer(int32) :: i

    before = total_energy(sim)
    call advance_all(sim)
    do i = 1, sim%n_disks()
      image = 0
      if (any(sim%box%periodic)) image = sim%extra(i)%image
      old = sim%disk(i)%x
      v = sim%disk(i)%v
      call wrap(sim, old, v, image)                          ! shifts the old position by whole periods into the box
      sim%disk(i)%x = x(:, sim%tag(i)%id)
      call wrap(sim, sim%disk(i)%x, v, image)
      if (any(sim%box%periodic)) sim%extra(i)%image = image
    end do
    call restart_epoch(sim)
    call book(sim, before)
  end subroutine change_positions

  !> Advances all disks to the present time with the previous forces. When the procedure returns, the clocks of all disks are equal.
  !> The procedure also erases the last collision partner of each disk. A disk whose velocity has been changed can collide with its
  !> last partner again immediately. If the last partner were not erased, the new collision would be mistaken for a rounding error
  !> of the previous collision.
  subroutine advance_all(sim)
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: i

    do i = 1, sim%n_disks()
      call sim%rotate_to(i, sim%now)
      call advance_disk(sim%disk(i), sim%box%gravity, sim%now)
      sim%tag(i)%last_partner = 0
    end do
  end subroutine advance_all

  !> Counts the change of the total energy since `before` as work on the disks. The units of the exact sums are chosen as in a run
  !> that starts with the new system.
  subroutine book(sim, before)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: before                       !! total energy before the change [energy]

    sim%changes = sim%changes + 1
    if (.not. sim%has_collapsed()) sim%tally%collapse = never       ! the change prevents a collapse that was about to occur
    if (allocated(sim%series)) sim%series%known_until = 0
    sim%typical_speed2 = max(sim%typical_speed2, sim%mean_square_speed())
    call sim%choose_units()
    call sim%tally%sum(work)%add(total_energy(sim) - before)
  end subroutine book

end module changes
