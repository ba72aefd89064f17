!> Applies kicks: changes of the velocities of disks at regular times. The random numbers of a kick depend only on the seed, the
!> disk and the number of the kick. The random numbers of a kick therefore depend neither on the order of the disks nor on the
!> history of the run.
module kicks
  use kinds, only: int32, int64, pi, real64
  use disks, only: advance_disk
  use drive, only: active, andersen, noise
  use exact_sums, only: exact_sum_t
  use random_stream, only: draws_of_kicks => kicks, key_of_draws, orientations, random_stream_t
  use simulation_state, only: simulation_t
  use tally, only: drive_energy
  implicit none
  private
  public :: change_spin, change_velocity, draw_orientations, kick

contains

  !> Applies the next kick to the disks at the present time, and lists the affected disks.
  subroutine kick(sim, kicked)
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable, intent(out) :: kicked(:)
    real(real64), allocatable :: draws(:, :)     ! (2,n) random numbers of the affected disks, needed to restore the momentum
    real(real64) :: z(2)
    integer(int64) :: key
    integer(int32) :: i, n
    logical :: is_hit

    sim%kicks = sim%kicks + 1
    key = key_of_draws(sim%seed, draws_of_kicks)
    n = sim%n_disks()
    allocate (kicked(n), draws(2, merge(n, 0_int32, sim%drive%keep_momentum)))
    n = 0
    do i = 1, sim%n_disks()
      if (.not. sim%drive%acts_on(sim%tag(i)%species)) cycle
      call kick_disk(sim, i, key, is_hit, z)
      if (.not. is_hit) cycle
      n = n + 1
      kicked(n) = i
      if (sim%drive%keep_momentum) draws(:, n) = z
    end do
    kicked = kicked(:n)
    if (sim%drive%keep_momentum) call restore_momentum()
  contains

    !> Subtracts the mean velocity that noise has added to the disks. The sums over the disks are exact and do not depend on the
    !> order of the disks.
    subroutine restore_momentum()
      type(exact_sum_t) :: momentum(2), mass
      real(real64) :: scale, heaviest
      integer(int32) :: k

      heaviest = maxval(sim%species%mass)
      scale = sqrt(sim%drive%strength*sim%drive%interval)
      call momentum%choose_unit(16*heaviest*scale)
      call mass%choose_unit(heaviest)
      do k = 1, size(kicked, kind=int32)
        associate (i => kicked(k))
          call momentum%add(sim%mass_of(i)*scale*draws(:, k))
          call mass%add(sim%mass_of(i))
        end associate
      end do
      do k = 1, size(kicked, kind=int32)
        call change_velocity(sim, kicked(k), sim%disk(kicked(k))%v - momentum%value()/mass%value())
      end do
    end subroutine restore_momentum
  end subroutine kick

  !> Applies a kick to disk i. In a sheared box the random velocity is relative to the velocity profile. The procedure erases the
  !> last collision partner of disk i, because the kick may cause a new collision with the same partner immediately. A kick does not
  !> count as a collision.
  subroutine kick_disk(sim, i, key, is_hit, z)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int64), intent(in) :: key            !! key of the random numbers of all disks, from `key_of_draws`
    logical, intent(out) :: is_hit               !! whether the disk receives the kick; 'andersen' selects disks at random
    real(real64), intent(out) :: z(2)            !! Gaussian random numbers of variance 1 drawn for the velocity
    type(random_stream_t) :: stream
    real(real64) :: u, spin(2), v(2)

    z = 0
    associate (drive => sim%drive, id => sim%tag(i)%id)
      call stream%seed_disk(key, id, sim%kicks)
      is_hit = .true.
      if (drive%kind == andersen) then
        call stream%draw_uniform(u)
        is_hit = u < drive%fraction
      end if
      if (.not. is_hit) return
      call sim%rotate_to(i, sim%now)
      call advance_disk(sim%disk(i), sim%box%gravity, sim%now)
      sim%tag(i)%last_partner = 0
      call stream%draw_normals(z)
      if (drive%kind == noise) then
        call change_velocity(sim, i, sim%disk(i)%v + sqrt(drive%strength*drive%interval)*z)
        return
      end if
      v = sim%box%shear_profile(sim%disk(i)%x) + sqrt(drive%temperature/sim%mass_of(i))*z
      if (drive%kind == active) call add_self_propulsion()
      call change_velocity(sim, i, v)
      if (.not. sim%features%rotation) return
      call stream%draw_normals(spin)
      call change_spin(sim, i, sqrt(drive%temperature/sim%inertia_of(i))*spin(1))
    end associate
  contains

    !> Applies rotational diffusion to the orientation of disk i, and adds the self-propulsion velocity.
    subroutine add_self_propulsion()
      type(random_stream_t) :: stream
      real(real64) :: z(2)

      associate (drive => sim%drive, angle => sim%extra(i)%angle)
        call stream%seed_draw(sim%seed, orientations, sim%tag(i)%id, sim%kicks)
        call stream%draw_normals(z)
        angle = angle + sqrt(2*drive%rotational_diffusion*drive%interval)*z(1)
        v = v + drive%speed*[cos(angle), sin(angle)]
      end associate
    end subroutine add_self_propulsion
  end subroutine kick_disk

  !> Draws the initial orientations of active disks from a uniform distribution.
  subroutine draw_orientations(sim)
    type(simulation_t), intent(inout) :: sim
    type(random_stream_t) :: stream
    real(real64) :: u
    integer(int32) :: i

    do i = 1, sim%n_disks()
      if (.not. sim%drive%acts_on(sim%tag(i)%species)) cycle
      call stream%seed_draw(sim%seed, orientations, sim%tag(i)%id, sim%kicks)
      call stream%draw_uniform(u)
      sim%extra(i)%angle = 2*pi*u
    end do
  end subroutine draw_orientations

  !> Sets the velocity of disk i and adds the change of its energy to the sum `drive_energy`.
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

  !> Sets the angular velocity of disk i and adds the change of its energy to the sum `drive_energy`.
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
