!> Executes collisions of a disk with a side or an obstacle.
module boundary_collisions
  use kinds, only: int32, never, real64
  use box_geometry, only: next_obstacle, normal_surface_velocity, tangential_surface_velocity, wall_normal
  use box_sides, only: side_time
  use collisions, only: tangential_law_t, tangential_impulse, wall_law_t, wall_rebound
  use disks, only: advance_disk
  use partners, only: axis_of, is_side, sense_of
  use side_motion, only: piston
  use random_stream, only: random_stream_t, thermal_walls
  use simulation_state, only: simulation_t
  use tally, only: dissipated, gain, heat, impulse, work
  implicit none
  private
  public :: collide_wall

  !> Shortest time between successive contacts of a resting disk with the same surface, in units of the contact duration.
  real(real64), parameter :: shortest_separation = 0.4_real64

contains

  !> Executes the collision of disk i with a surface of the box at the time t.
  subroutine collide_wall(sim, i, code, t, counts)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    logical, value :: counts                     !! whether the collision is included in the tally
    real(real64) :: normal(2), normal_velocity(2), u(2), v(2), omega
    type(wall_law_t) :: law
    logical :: elastic
    integer :: k

    elastic = .false.
    if (sim%law%contact_time > 0) call sim%register_contact(i, t, elastic)
    call advance_disk(sim%disk(i), sim%box%gravity, t)
    k = sim%box%surface_of(code)
    law = sim%box%surface(k)%law
    normal = wall_normal(sim%box, code, sim%disk(i)%x, sim%disk(i)%v)
    normal_velocity = normal_surface_velocity(sim%box, code, normal, t)
    u = tangential_surface_velocity(sim%box, code, sim%disk(i)%x, normal) + normal_velocity
    v = sim%disk(i)%v
    omega = sim%spin(i)
    if (law%temperature > 0) then
      call draw_thermal_velocity(sim, i, law%temperature, normal, u)
    else
      sim%disk(i)%v = wall_rebound(law, v - normal_velocity, normal, elastic)
      if (any(abs(normal_velocity) > 0)) then
        ! The rounded velocity of the disk is not less than the velocity of the side, because rounding is monotonic.
        sim%disk(i)%v = sim%disk(i)%v + normal_velocity
        if (law%restitution < 1 .and. .not. elastic) call end_bouncing(sim%disk(i)%v, v, normal_velocity, normal)
      end if
      ! Only event-driven dynamics separates a resting disk from the surface.
      if (elastic .and. law%restitution <= 0 .and. sim%epoch_end > 0) call separate_from_surface(sim, i, code, normal)
      if (law%tangential%is_rough()) call apply_tangential_impulse_at_wall(sim, i, law%tangential, normal, u, v)
    end if
    if (sim%box%surface(k)%motion%kind == piston) call move_piston(sim, i, code, normal, v, u, t)
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(i)%last_partner = merge(0, code, is_side(code))
    if (counts) call add_wall_sums(sim, i, k, law%temperature > 0, u, v, omega)
  end subroutine collide_wall

  !> Ends a series of bounces on a moving side when a collision dissipates less than the rounding error. The normal velocity of the
  !> disk is then set to the velocity of the side. Without this rule, a series of bounces on a moving side could be infinite.
  pure subroutine end_bouncing(v, before, normal_velocity, normal)
    real(real64), intent(inout) :: v(2)          !! velocity of the disk after the collision [length/time]
    !> Velocity of the disk before the collision, and normal velocity of the side [length/time]
    real(real64), intent(in) :: before(2), normal_velocity(2)
    real(real64), intent(in) :: normal(2)        !! unit vector inwards
    real(real64) :: left

    left = dot_product(v - normal_velocity, normal)
    if (left >= -dot_product(before - normal_velocity, normal)) v = v - left*normal
  end subroutine end_bouncing

  !> Applies the momentum transfer between a disk and a piston. When the procedure is called, the disk has the velocity after a
  !> rebound from a piston of infinite mass. The procedure reduces the impulse of the rebound to the value for the finite mass of
  !> the piston. When the procedure returns, u contains the mean of the velocities of the piston before and after the collision,
  !> from which the work of the piston is calculated.
  pure subroutine move_piston(sim, i, code, normal, before, u, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: normal(2)        !! unit vector inwards
    real(real64), intent(in) :: before(2)        !! velocity of the disk before the collision [length/time]
    real(real64), intent(inout) :: u(2)          !! velocity of the surface [length/time]
    real(real64), intent(in) :: t                !! time relative to the time origin `box%epoch` [time]
    real(real64) :: mass, v, given
    integer :: axis

    mass = sim%mass_of(i)
    axis = axis_of(code)
    associate (motion => sim%box%surface(1 - code)%motion, side => sim%box%side(1 - code), disk => sim%disk(i))
      v = sim%box%side_velocity(1 - code, t)
      given = dot_product(disk%v - before, normal)*mass/(mass + motion%mass)
      disk%v = disk%v - given*normal
      ! The piston is moved into contact with the disk, by the same formula as in `side_time`. Without the shift of the piston,
      ! rounding errors would separate the piston from a disk at rest.
      side%position = merge(disk%x(axis) - (sim%box%lower(axis) + disk%radius), &
        (sim%box%upper(axis) - disk%radius) - disk%x(axis), sense_of(code) < 0)
      side%velocity = min(v - given, dot_product(disk%v, normal))  ! rounding errors must not make the piston faster than the disk
      side%clock = t
      u = u + (0.5_real64*(side%velocity - v))*normal
    end associate
  end subroutine move_piston

  !> Draws the velocity of disk i after a collision with a thermal wall, as if the disk came from a gas with the temperature of the
  !> wall. The normal component v of the velocity has the probability density (m v/kT) exp(-m v**2/2kT). The tangential component of
  !> the velocity and the angular velocity are Gaussian.
  pure subroutine draw_thermal_velocity(sim, i, temperature, normal, u)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: temperature      !! kT [energy]
    real(real64), intent(in) :: normal(2)        !! unit vector from the wall to the disk
    real(real64), intent(in) :: u(2)             !! velocity of the surface [length/time]
    type(random_stream_t) :: stream
    real(real64) :: uniform, normals(2), thermal

    call stream%seed_draw(sim%seed, thermal_walls, sim%tag(i)%id, sim%tag(i)%collisions)
    call stream%draw_uniform(uniform)
    call stream%draw_normals(normals)
    thermal = sqrt(temperature/sim%mass_of(i))
    sim%disk(i)%v = u + thermal*(sqrt(-2*log(1 - uniform))*normal + normals(1)*[-normal(2), normal(1)])
    if (sim%features%rotation) sim%extra(i)%spin = sqrt(temperature/sim%inertia_of(i))*normals(2)
  end subroutine draw_thermal_velocity

  !> Separates disk i from a surface on which the disk rests. With restitution 0 the normal velocity of the disk vanishes in the
  !> first collision. The elastic collisions of the TC model would not separate a disk without normal velocity from the surface, and
  !> infinitely many collisions would occur at the same time. The normal velocity of the disk is therefore set such that the next
  !> contact with the surface is 0.4 to 0.8 contact durations later.
  pure subroutine separate_from_surface(sim, i, code, normal)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: normal(2)        !! unit vector from the wall to the disk
    real(real64) :: speed, t
    integer(int32) :: partner

    associate (disk => sim%disk(i), contact_time => sim%law%contact_time)
      speed = epsilon(speed)*disk%radius/contact_time
      do while (speed < disk%radius/contact_time)
        t = never
        if (is_side(code)) t = side_time(sim%box, disk, code)
        if (.not. is_side(code)) call next_obstacle(sim%box, disk, code, [code], t, partner)
        if (t - disk%clock > shortest_separation*contact_time) exit
        disk%v = disk%v + speed*normal
        speed = 2*speed
      end do
    end associate
  end subroutine separate_from_surface

  !> Applies the tangential impulse in a collision of disk i with a rough wall, after the normal impulse.
  pure subroutine apply_tangential_impulse_at_wall(sim, i, law, normal, u, before)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    type(tangential_law_t), intent(in) :: law
    real(real64), intent(in) :: normal(2)        !! unit vector from the wall to the disk
    real(real64), intent(in) :: u(2)             !! velocity of the surface [length/time]
    real(real64), intent(in) :: before(2)        !! velocity of the disk before the collision [length/time]
    real(real64) :: along(2), impulse

    along = [-normal(2), normal(1)]
    associate (disk => sim%disk(i), mass => sim%mass_of(i))
      impulse = tangential_impulse(law, sim%law%inertia, mass, &
        dot_product(disk%v - u, along) - disk%radius*sim%spin(i), mass*abs(dot_product(disk%v - before, normal)))
      disk%v = disk%v + (impulse/mass)*along
      call sim%change_angular_momentum(i, -disk%radius*impulse)
    end associate
  end subroutine apply_tangential_impulse_at_wall

  !> Adds a collision with a side or obstacle to the counters and sums. The energy change of the disk consists of the work of the
  !> moving surface, and of transferred heat or dissipated energy. At a thermal wall, the energy change of the disk minus the work
  !> of the surface is the transferred heat. At any other wall, the work of the surface minus the energy change of the disk is the
  !> dissipated energy.
  pure subroutine add_wall_sums(sim, i, k, heats, u, v, omega)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer, intent(in) :: k                     !! index of the surface
    logical, intent(in) :: heats                 !! whether the surface is a thermal wall
    real(real64), intent(in) :: u(2)             !! velocity of the surface [length/time]
    real(real64), intent(in) :: v(2), omega      !! velocities of the disk before the collision [length/time, 1/time]
    real(real64) :: mass, gained, done

    mass = sim%mass_of(i)
    gained = 0.5_real64*mass*(dot_product(sim%disk(i)%v, sim%disk(i)%v) - dot_product(v, v))
    if (sim%features%rotation) gained = gained + 0.5_real64*sim%inertia_of(i)*(sim%spin(i)**2 - omega**2)
    done = mass*dot_product(u, sim%disk(i)%v - v)
    sim%tally%events = sim%tally%events + 1
    if (heats) then
      call sim%tally%sum(heat)%add(gained - done)
    else
      call sim%tally%sum(dissipated)%add(done - gained)
    end if
    if (abs(done) > 0) call sim%tally%sum(work)%add(done)
    sim%tally%surface_collisions(k) = sim%tally%surface_collisions(k) + 1
    call sim%tally%surface_sums(impulse:gain, k)%add([-mass*(sim%disk(i)%v - v), gained])
  end subroutine add_wall_sums

end module boundary_collisions
