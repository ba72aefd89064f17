!> Executes collisions of disks with sides and obstacles.
module boundary_collisions
  use kinds, only: int32, never, real64
  use box_geometry, only: next_obstacle, tangential_surface_velocity, wall_normal
  use box_state, only: normal_surface_velocity, side_time
  use tangential_law, only: tangential_impulse, tangential_law_t
  use wall_law, only: wall_law_t, wall_rebound
  use disks, only: advance_disk
  use partners, only: axis_of, is_side, sense_of
  use random_stream, only: random_stream_t, thermal_walls
  use simulation_state, only: simulation_t
  use tally, only: dissipated, gain, heat, impulse, work
  implicit none
  private
  public :: collide_wall

  !> Minimum time between successive contacts of a resting disk with the same surface, in units of
  !> the contact duration.
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
    normal = wall_normal(sim%box%box_t, code, sim%disk(i)%x, sim%disk(i)%v)
    normal_velocity = normal_surface_velocity(sim%box, code, normal, t)
    u = tangential_surface_velocity(sim%box%box_t, code, sim%disk(i)%x, normal) + normal_velocity
    v = sim%disk(i)%v
    omega = sim%spin(i)
    if (law%temperature > 0) then
      call draw_thermal_velocity(sim, i, law%temperature, normal, u)
    else
      sim%disk(i)%v = wall_rebound(law, v - normal_velocity, normal, elastic)
      if (any(abs(normal_velocity) > 0)) then
        ! The rounded velocity of the disk is not below the velocity of the side, because rounding
        ! is monotonic.
        sim%disk(i)%v = sim%disk(i)%v + normal_velocity
        if (law%is_inelastic() .and. .not. elastic) call end_bouncing(sim%disk(i)%v, v, normal_velocity, normal)
      end if
      ! Only event-driven dynamics separates a resting disk from the surface.
      if (elastic .and. law%stops_disks() .and. sim%epoch_end > 0) call separate_from_surface(sim, i, code, normal)
      if (law%tangential%is_rough()) call apply_tangential_impulse_at_wall(sim, i, law%tangential, normal, u, v)
    end if
    if (is_side(code)) call move_piston(sim, i, code, normal, v, u, t)
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(i)%last_partner = merge(0, code, is_side(code))
    if (counts) call add_wall_sums(sim, i, k, law%temperature > 0, u, v, omega)
  end subroutine collide_wall

  !> Ends a sequence of bounces on a moving side, which could otherwise be infinite. Once a
  !> collision dissipates less than the rounding error, the disk takes the normal velocity of the
  !> side.
  pure subroutine end_bouncing(v, before, normal_velocity, normal)
    real(real64), intent(inout) :: v(2)          !! velocity of the disk after the collision [length/time]
    !> Velocity of the disk before the collision, and normal velocity of the side [length/time].
    real(real64), intent(in) :: before(2), normal_velocity(2)
    real(real64), intent(in) :: normal(2)        !! inward unit vector
    real(real64) :: left

    left = dot_product(v - normal_velocity, normal)
    if (left >= -dot_product(before - normal_velocity, normal)) v = v - left*normal
  end subroutine end_bouncing

  !> Transfers momentum between a disk and a piston. On entry the disk has the velocity after a
  !> collision with a piston of infinite mass. The procedure reduces its impulse to the value for
  !> the actual mass. On return u is the mean of the piston velocities before and after the
  !> collision. The work of the piston is calculated with this mean.
  pure subroutine move_piston(sim, i, code, normal, before, u, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: normal(2)        !! inward unit vector
    real(real64), intent(in) :: before(2)        !! velocity of the disk before the collision [length/time]
    real(real64), intent(inout) :: u(2)          !! velocity of the surface [length/time]
    real(real64), intent(in) :: t                !! relative to the time origin `box%epoch` [time]
    real(real64) :: v, given
    integer :: axis

    if (.not. sim%box%side(1 - code)%is_piston()) return
    axis = axis_of(code)
    associate (motion => sim%box%side(1 - code)%motion, side => sim%box%piston(1 - code), disk => sim%disk(i))
      v = sim%box%side_velocity(1 - code, t)
      given = motion%taken_from(dot_product(disk%v - before, normal), sim%mass_of(i))
      disk%v = disk%v - given*normal
      ! Moves the piston into contact with the disk, by the formula of `side_time`. Rounding errors
      ! would otherwise separate the piston from a disk at rest.
      side%position = merge(disk%x(axis) - (sim%box%lower(axis) + disk%radius), &
        (sim%box%upper(axis) - disk%radius) - disk%x(axis), sense_of(code) < 0)
      ! rounding errors must not make the piston faster than the disk
      side%velocity = min(v - given, dot_product(disk%v, normal))
      side%clock = t
      u = u + (0.5_real64*(side%velocity - v))*normal
    end associate
  end subroutine move_piston

  !> Draws the velocity of disk i after a collision with a thermal wall, as if the disk came from a
  !> gas at the temperature of the wall. The normal component v has the probability density (m v/kT)
  !> exp(-m v**2/2kT); the tangential component and the angular velocity are Gaussian.
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

  !> Separates disk i from a surface on which it rests. With zero restitution the first collision
  !> stops the normal motion of the disk. The TC model would then cause infinitely many elastic
  !> collisions at one and the same time. The normal velocity is therefore chosen such that the next
  !> contact with the surface is 0.4 to 0.8 contact durations later.
  !>
  !> In a container hardly larger than the disk, no velocity achieves this. If the disk leaves the
  !> surface in an elastic collision, it keeps the velocity of this collision. Otherwise several
  !> velocities are tried, and the velocity with the latest contact is used.
  pure subroutine separate_from_surface(sim, i, code, normal)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: normal(2)        !! unit vector from the wall to the disk
    real(real64) :: speed, t, latest, before(2), best(2)
    integer(int32) :: partner

    latest = -never
    before = sim%disk(i)%v
    best = before
    associate (disk => sim%disk(i), contact_time => sim%law%contact_time)
      speed = epsilon(speed)*disk%radius/contact_time
      do while (speed < disk%radius/contact_time)
        t = never
        if (is_side(code)) t = side_time(sim%box, disk, code)
        if (.not. is_side(code)) call next_obstacle(sim%box%box_t, disk, code, [code], t, partner)
        if (t - disk%clock > shortest_separation*contact_time) return
        if (t > latest) best = disk%v
        latest = max(latest, t)
        disk%v = disk%v + speed*normal
        speed = 2*speed
      end do
      disk%v = merge(before, best, dot_product(before, normal) > 0.001_real64*norm2(before))
    end associate
  end subroutine separate_from_surface

  !> Applies the tangential impulse in a collision of disk i with a rough wall, after the normal
  !> impulse.
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

  !> Adds a collision with a side or obstacle to the counters and sums. The energy change of the
  !> disk minus the work of the surface is the heat transferred by a thermal wall. For any other
  !> wall, this difference is the negative of the dissipated energy.
  pure subroutine add_wall_sums(sim, i, k, heats, u, v, omega)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer, intent(in) :: k                     !! index of the surface
    logical, intent(in) :: heats                 !! whether the surface is a thermal wall
    real(real64), intent(in) :: u(2)             !! velocity of the surface [length/time]
    !> Velocity [length/time] and angular velocity [1/time] of the disk before the collision.
    real(real64), intent(in) :: v(2), omega
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
