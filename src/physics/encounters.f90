!> What changes in the state when two disks, a disk and a wall, or a disk and a periodic side meet, with all counts
!> and sums. Both dynamics use it.
module encounters
  use kinds, only: int32, real64
  use box_geometry, only: wall_normal
  use collisions, only: pair_impulse, still_in_contact, wall_rebound
  use disks, only: disk_t
  use event_log, only: event_log_t
  use free_flight, only: flight, flight_velocity
  use partners, only: axis_of, is_side, is_wall, obstacle_number, sense_of, side_name, wall_index
  use shapes, only: magnitude, nearest_image
  use simulation_state, only: simulation_t
  use texts, only: written
  implicit none
  private
  public :: collide, collide_pair, encounter_text, pass_side, passes

contains

  !> Collides disk i at the time t with what `code` names, unless they are together already, and logs the collision if the
  !> log is on: the same entry whichever of two disks expected it.
  subroutine collide(sim, i, code, t, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! a disk (> 0), or a wall: see `box_geometry`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout) :: log
    real(real64) :: v(2)
    integer(int32) :: first

    first = i
    if (code > 0) then
      if (are_together(sim, i, code, t)) then
        call keep_apart(sim, i, code)
        return
      end if
      first = merge(i, code, sim%tag(i)%id < sim%tag(code)%id)
    end if
    v = flight_velocity(sim%disk(first)%v, sim%box%gravity, t - sim%disk(first)%clock)
    if (code > 0) then
      call collide_pair(sim, i, code, t)
    else
      call collide_wall(sim, i, code, t)
    end if
    if (.not. log%is_on()) return
    associate (impulse => sim%mass_of(first)*magnitude(sim%disk(first)%v - v))
      if (code > 0) then
        call log%append(sim%epoch + t, min(sim%tag(i)%id, sim%tag(code)%id), &
          max(sim%tag(i)%id, sim%tag(code)%id), impulse)
      else
        call log%append(sim%epoch + t, sim%tag(i)%id, code, impulse)
      end if
    end associate
  end subroutine collide

  !> Advances a disk's own state to the time t.
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

  !> Whether disk i is still in contact at the time t, by the contact law.
  pure function in_contact(sim, i, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t
    logical :: yes

    yes = still_in_contact(sim%law, sim%tag(i)%collisions, t - sim%disk(i)%clock)
  end function in_contact

  !> Collides the disks i and j at the time t. Which of them is i changes no bit.
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
    if (any(sim%box%periodic)) dx = dx - nearest_image(dx, sim%box%periods())
    dv = sim%disk(j)%v - sim%disk(i)%v
    b = dx(1)*dv(1) + dx(2)*dv(2)
    distance2 = dx(1)*dx(1) + dx(2)*dx(2)
    mass_i = sim%species(si)%mass
    mass_j = sim%species(sj)%mass
    if (allocated(sim%mass)) then                          ! as in `mass_of`, with one test for both
      mass_i = sim%mass(sim%tag(i)%id)
      mass_j = sim%mass(sim%tag(j)%id)
    end if
    q = pair_impulse(b, distance2, mass_i, mass_j, restitution)
    sim%disk(i)%v = sim%disk(i)%v + (q/mass_i)*dx          ! a reciprocal would round the same way each time
    sim%disk(j)%v = sim%disk(j)%v - (q/mass_j)*dx
    dv = sim%disk(j)%v - sim%disk(i)%v
    if (dx(1)*dv(1) + dx(2)*dv(2) < 0) call keep_apart(sim, i, j)    ! by rounding
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(j)%collisions = sim%tag(j)%collisions + 1
    sim%tag(i)%met = sim%tag(j)%id
    sim%tag(j)%met = sim%tag(i)%id
    sim%events = sim%events + 1
    sim%collisions = sim%collisions + 1
    call sim%virial%add(-q*distance2)
    if (restitution < 1) call sim%dissipated%add(0.5_real64*(1 - restitution)*q*b)
  end subroutine collide_pair

  !> Whether the disks i and j, which touch at the time t, hit each other last and through the same image. No force acts
  !> between them: only rounding can have made them approach again, when one of them passed a periodic side.
  pure function are_together(sim, i, j, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical :: yes
    real(real64) :: then(2), dx(2)

    yes = sim%tag(i)%met == sim%tag(j)%id .and. sim%tag(j)%met == sim%tag(i)%id
    if (.not. yes) return
    associate (p => sim%disk(i), q => sim%disk(j), g => sim%box%gravity, period => sim%box%periods())
      then = q%x - p%x
      dx = flight(q%x, q%v, g, t - q%clock) - flight(p%x, p%v, g, t - p%clock)
      yes = .not. (p%clock < q%clock .or. p%clock > q%clock) &
        .and. all(abs(nearest_image(then, period) - nearest_image(dx, period)) <= 0)
    end associate
  end function are_together

  !> Takes from two disks of the same clock, which have collided, the approach that is left by rounding, in the very
  !> expression by which a contact is predicted: then none is. This is no collision, and the clocks stay.
  pure subroutine keep_apart(sim, i, j)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64) :: dx(2), dv(2), step, mass_i, mass_j

    associate (p => sim%disk(i), q => sim%disk(j))
      dx = q%x - p%x
      dx = dx - nearest_image(dx, sim%box%periods())
      mass_i = sim%mass_of(i)
      mass_j = sim%mass_of(j)
      step = max(epsilon(step)*maxval(abs([p%v, q%v]))/magnitude(dx)*(mass_i*mass_j/(mass_i + mass_j)), tiny(step))
      do
        dv = q%v - p%v
        if (dx(1)*dv(1) + dx(2)*dv(2) >= 0) exit
        p%v = p%v - (step/mass_i)*dx
        q%v = q%v + (step/mass_j)*dx
        step = 2*step
      end do
      p%stamp = p%stamp + 1
      q%stamp = q%stamp + 1
    end associate
  end subroutine keep_apart

  !> Whether the code names a periodic side.
  pure function passes(sim, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: code
    logical :: yes

    yes = .false.
    if (is_side(code)) yes = sim%box%periodic(axis_of(code))
  end function passes

  !> Moves disk i by one period through a periodic side. Its clock, the time of its last collision, stays.
  subroutine pass_side(sim, i, code)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    integer :: axis, period

    axis = axis_of(code)
    period = sense_of(code)
    associate (d => sim%disk(i), edges => sim%box%edges())
      d%x(axis) = d%x(axis) - period*edges(axis)
      d%stamp = d%stamp + 1
      sim%image(axis, i) = sim%image(axis, i) + period
    end associate
  end subroutine pass_side

  !> Collides disk i with a side or an obstacle at the time t.
  subroutine collide_wall(sim, i, code, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    real(real64) :: normal(2), v(2), restitution, mass
    integer(int32) :: k

    restitution = sim%law%wall_restitution
    if (sim%law%contact_time > 0) then
      if (in_contact(sim, i, t)) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    normal = wall_normal(sim%box, code, sim%disk(i)%x)
    v = sim%disk(i)%v
    sim%disk(i)%v = wall_rebound(v, normal, restitution, sim%law%wall_rule)
    mass = sim%mass_of(i)
    call sim%dissipated%add(0.5_real64*mass*(dot_product(v, v) - dot_product(sim%disk(i)%v, sim%disk(i)%v)))
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(i)%met = merge(0, code, is_side(code))
    sim%events = sim%events + 1
    if (is_side(code)) then
      k = wall_index(code)
      sim%wall_collisions(k) = sim%wall_collisions(k) + 1
      call sim%wall_impulse(k)%add(mass*dot_product(sim%disk(i)%v - v, normal))
    else
      sim%obstacle_collisions = sim%obstacle_collisions + 1
    end if
  end subroutine collide_wall

  !> Disk i, its partner and the time, for messages.
  pure function encounter_text(sim, i, code) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code           !! as in `partners`
    character(len=:), allocatable :: text

    text = disk_text(i)
    if (code > 0) then
      text = text//" and "//disk_text(code)
    else if (is_side(code)) then
      text = text//" and the "//trim(side_name(wall_index(code)))//" side"
    else if (is_wall(code)) then
      text = text//" and obstacle "//sim%box%obstacle(obstacle_number(code))%name
    end if
    text = text//" at time "//written(sim%time())

  contains

    !> A disk by its number and species.
    pure function disk_text(k) result(words)
      integer(int32), intent(in) :: k
      character(len=:), allocatable :: words

      words = "disk "//written(sim%tag(k)%id)//" ("//sim%species(sim%tag(k)%species)%name//")"
    end function disk_text
  end function encounter_text

end module encounters
