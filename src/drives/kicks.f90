!> Common steps of several types of driving.
module kicks
  use kinds, only: int32, real64
  use disks, only: advance_disk
  use simulation_state, only: simulation_t
  use tally, only: drive_energy
  implicit none
  private
  public :: change_spin, change_velocity, interrupt_disk

contains

  !> Advances disk i to the present time, at which a kick changes its trajectory. The last collision
  !> partner is erased, because the disk may collide with the same partner again immediately after
  !> the kick.
  pure subroutine interrupt_disk(sim, i)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    call sim%rotate_to(i, sim%now)
    call advance_disk(sim%disk(i), sim%box%gravity, sim%now)
    sim%tag(i)%last_partner = 0
  end subroutine interrupt_disk

  !> Sets the velocity of disk i and adds the change of its kinetic energy to the sum
  !> `drive_energy`.
  subroutine change_velocity(sim, i, v)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: v(2)             !! [length/time]
    real(real64) :: before(2)

    before = sim%disk(i)%v
    call sim%tally%sum(drive_energy)%add(0.5_real64*sim%mass_of(i)*dot_product(v - before, v + before))
    sim%disk(i)%v = v
    call sim%record_velocity_change(i, before, sim%now)
  end subroutine change_velocity

  !> Sets the angular velocity of disk i and adds the change of its rotational energy to the sum
  !> `drive_energy`.
  subroutine change_spin(sim, i, omega)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: omega            !! [1/time]

    associate (before => sim%extra(i)%spin)
      call sim%tally%sum(drive_energy)%add(0.5_real64*sim%inertia_of(i)*(omega - before)*(omega + before))
      before = omega
    end associate
  end subroutine change_spin

end module kicks
