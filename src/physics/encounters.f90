!> Encounters: what changes in the state when two disks, a disk and a wall, or a disk and a periodic side
!> meet. Both dynamics share it, with all counts and sums.
module encounters
  use kinds, only: int32, real64
  use box_geometry, only: box_t, first_obstacle, from_obstacle, nearest_image
  use collisions, only: pair_impulse, wall_rebound
  use disks, only: disk_t
  use event_log, only: event_log_t
  use free_flight, only: flight, flight_velocity
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: collide, collide_pair, collide_wall, pass_side, passes, wall_normal

contains

  !> Lets disk i collide at the time t with what `code` names, and lists the collision if the log is on:
  !> the same line whichever of two disks expected it.
  subroutine collide(sim, i, code, t, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! a disk (> 0), or a wall: see `box_geometry`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout) :: log
    real(real64) :: v(2)
    integer(int32) :: first

    first = merge(min(i, code), i, code > 0)
    if (log%is_on()) v = flight_velocity(sim%disk(first)%v, sim%box%gravity, t - sim%disk(first)%clock)
    if (code > 0) then
      call collide_pair(sim, first, max(i, code), t)
    else
      call collide_wall(sim, i, code, t)
    end if
    if (.not. log%is_on()) return
    associate (impulse => sim%species(sim%tag(first)%species)%mass*norm2(sim%disk(first)%v - v))
      if (code > 0) then
        call log%append(sim%epoch + t, min(sim%tag(i)%id, sim%tag(code)%id), &
          max(sim%tag(i)%id, sim%tag(code)%id), impulse)
      else
        call log%append(sim%epoch + t, sim%tag(i)%id, code, impulse)
      end if
    end associate
  end subroutine collide

  !> Brings a disk's own state to the time t.
  pure subroutine land(disk, gravity, t)
    type(disk_t), intent(inout) :: disk
    real(real64), intent(in) :: gravity(2), t
    real(real64) :: s

    s = t - disk%clock
    disk%x = flight(disk%x, disk%v, gravity, s)
    disk%v = flight_velocity(disk%v, gravity, s)
    disk%clock = t
    disk%stamp = disk%stamp + 1
  end subroutine land

  !> Whether a contact of disk i at t counts as elastic because its last one is not over (TC model).
  pure function in_contact(sim, i, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t
    logical :: yes

    yes = sim%tag(i)%collisions > 0 .and. t - sim%disk(i)%clock < sim%law%contact_time
  end function in_contact

  !> Lets the disks i < j collide at the time t.
  subroutine collide_pair(sim, i, j, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    real(real64) :: dx(2), dv(2), b, distance2, restitution, q, mass_i, mass_j
    integer(int32) :: si, sj

    si = sim%tag(i)%species
    sj = sim%tag(j)%species
    restitution = sim%law%restitution(si, sj)
    if (sim%law%contact_time > 0) then
      if (in_contact(sim, i, t) .or. in_contact(sim, j, t)) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    call land(sim%disk(j), sim%box%gravity, t)
    dx = sim%disk(j)%x - sim%disk(i)%x
    if (any(sim%box%periodic)) dx = dx - nearest_image(sim%box, dx)
    dv = sim%disk(j)%v - sim%disk(i)%v
    b = dx(1)*dv(1) + dx(2)*dv(2)
    distance2 = dx(1)*dx(1) + dx(2)*dx(2)
    mass_i = sim%species(si)%mass
    mass_j = sim%species(sj)%mass
    q = pair_impulse(b, distance2, mass_i, mass_j, restitution)
    sim%disk(i)%v = sim%disk(i)%v + (q/mass_i)*dx          ! a reciprocal would round the same way each time
    sim%disk(j)%v = sim%disk(j)%v - (q/mass_j)*dx
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(j)%collisions = sim%tag(j)%collisions + 1
    sim%events = sim%events + 1
    sim%collisions = sim%collisions + 1
    sim%virial = sim%virial - q*distance2
    sim%dissipated = sim%dissipated + 0.5_real64*(1 - restitution)*q*b
  end subroutine collide_pair

  !> Whether the code names a periodic side.
  pure function passes(sim, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: code
    logical :: yes

    yes = .false.
    if (code > first_obstacle) yes = sim%box%periodic(1 - code/2)
  end function passes

  !> Takes disk i through a periodic side: it goes on from one period away. Its clock, the time of its last
  !> collision, stays.
  subroutine pass_side(sim, i, code)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    integer :: axis, period

    axis = 1 - code/2
    period = 2*modulo(code, 2) - 1                 ! +1 through the right or top side
    associate (d => sim%disk(i), tag => sim%tag(i), edges => sim%box%edges())
      d%x(axis) = d%x(axis) - period*edges(axis)
      d%stamp = d%stamp + 1
      tag%image(axis) = tag%image(axis) + period
    end associate
  end subroutine pass_side

  !> Lets disk i collide with a side or an obstacle at the time t.
  subroutine collide_wall(sim, i, code, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    real(real64) :: normal(2), v(2), restitution, mass

    restitution = sim%law%wall_restitution
    if (sim%law%contact_time > 0) then
      if (in_contact(sim, i, t)) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    normal = wall_normal(sim%box, code, sim%disk(i)%x)
    v = sim%disk(i)%v
    sim%disk(i)%v = wall_rebound(v, normal, restitution, sim%law%smooth_walls)
    mass = sim%species(sim%tag(i)%species)%mass
    sim%dissipated = sim%dissipated + 0.5_real64*mass*(dot_product(v, v) - dot_product(sim%disk(i)%v, sim%disk(i)%v))
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%events = sim%events + 1
    if (code > first_obstacle) then
      sim%wall_collisions(1 - code) = sim%wall_collisions(1 - code) + 1
      sim%wall_impulse(1 - code) = sim%wall_impulse(1 - code) + mass*dot_product(sim%disk(i)%v - v, normal)
    else
      sim%obstacle_collisions = sim%obstacle_collisions + 1
    end if
  end subroutine collide_wall

  !> Unit vector from a side or obstacle to a disk at x that touches it.
  pure function wall_normal(box, code, x) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)
    real(real64) :: normal(2)
    integer :: m

    normal = 0
    if (code > first_obstacle) then
      normal(1 - code/2) = 1 - 2*modulo(code, 2)
    else
      m = first_obstacle + 1 - code
      normal = from_obstacle(box, m, x)
      normal = merge(-normal, normal, box%obstacle(m)%inside)/norm2(normal)
    end if
  end function wall_normal

end module encounters
