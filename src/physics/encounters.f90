!> Executes events: applies the contact law to colliding disks and walls, moves disks through
!> periodic sides, and updates counters and sums. Used by the event-driven and the time-stepped
!> dynamics.
module encounters
  use kinds, only: int32, int64, real64
  use contact_law, only: pair_impulse
  use tangential_law, only: tangential_impulse
  use disks, only: disk_t, advance_disk
  use event_log, only: event_log_t
  use free_flight, only: flight, flight_velocity
  use images, only: image_t, images_t
  use partners, only: axis_of, is_side, is_wall, sense_of
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  use tally, only: dissipated, heat_virial, outflow, stress, virial, work
  use texts, only: written
  use boundary_collisions, only: collide_wall
  implicit none
  private
  public :: are_in_contact, collide, depart, encounter_text, energy_of, execute_collision, is_passage, need_general, pass_side
  public :: relative_motion

  !> Mass ratio above which the velocity change of the heavy disk loses significant digits.
  real(real64), parameter :: far_heavier = 2.0_real64**20

contains

  !> True if all collisions need the general procedure `collide`. An event log also needs this
  !> procedure.
  pure function need_general(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%features%need_general_collision() .or. sim%law%by_speed%speed > 0
  end function need_general

  !> Executes the collision of disk i at the time t with the partner `code`, by the general
  !> procedure or by the fast procedures for pairs and walls.
  subroutine execute_collision(sim, i, code, t, counts, general, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! index of a disk (> 0), or boundary id (see `partners`)
    real(real64), intent(in) :: t
    logical, value :: counts                     !! whether the collision is included in the tally and the log
    logical, value :: general                    !! whether the general procedure is needed
    type(event_log_t), intent(inout), optional :: log

    if (general) then
      call collide(sim, i, code, t, counts, log)
    else if (code > 0) then
      call collide_pair(sim, i, code, t, counts, sim%law%restitution(sim%tag(i)%species, sim%tag(code)%species))
    else
      call collide_wall(sim, i, code, t, counts)
    end if
  end subroutine execute_collision

  !> Executes the collision of disk i at the time t with the partner `code`: another disk, a side or
  !> an obstacle. This general procedure handles rotation, friction, velocity-dependent restitution,
  !> the virial tensor and the event log; `collide_pair` is the fast version for smooth disks
  !> without these features. The log entry does not depend on which of the two disks predicted the
  !> event. A pair that is still in contact after its last collision is skipped.
  subroutine collide(sim, i, code, t, counts, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! index of a disk (> 0), or boundary id (see `partners`)
    real(real64), intent(in) :: t
    logical, value :: counts                     !! whether the collision is included in the tally and the log
    type(event_log_t), intent(inout), optional :: log
    real(real64) :: v(2), w(2), change(2), restitution
    integer(int32) :: first, second, ids(2)

    first = i
    second = min(code, 0)
    if (code > 0) then
      if (are_in_contact(sim, i, code, t)) then
        call remove_residual_approach(sim, i, code)
        return
      end if
      first = merge(i, code, sim%tag(i)%id < sim%tag(code)%id)
      second = i + code - first
      call sim%rotate_to(second, t)
    end if
    call sim%rotate_to(first, t)
    v = flight_velocity(sim%disk(first)%v, sim%box%gravity, t - sim%disk(first)%clock)
    w = v
    if (code > 0) w = flight_velocity(sim%disk(second)%v, sim%box%gravity, t - sim%disk(second)%clock)
    if (code > 0) then
      restitution = sim%law%restitution(sim%tag(i)%species, sim%tag(code)%species)
      if (sim%law%by_speed%speed > 0) restitution = sim%law%by_speed%restitution_at(restitution, impact_velocity(sim, i, code, t))
      call collide_pair(sim, i, code, t, counts, restitution)
      if (sim%law%tangential%is_rough()) &
        call apply_tangential_impulse(sim, first, second, impulse_between(sim, first, second, v, w), counts)
    else
      call collide_wall(sim, i, code, t, counts)
    end if
    if (.not. counts) return
    change = momentum_change(sim, first, second, v, w)
    if (code > 0 .and. sim%features%stress) &
      call add_pair_sums(sim, first, second, change, transferred_energy(sim, first, second, v, w))
    call sim%record_velocity_change(first, v, t)
    if (code > 0) call sim%record_velocity_change(second, w, t)
    if (.not. present(log)) return
    ids = [sim%tag(first)%id, code]
    if (code > 0) ids(2) = sim%tag(second)%id
    call log%append([sim%box%epoch + t, real(ids, real64), impulse_between(sim, first, second, v, w), change])
  end subroutine collide

  !> Executes the collision of disks i and j at the time t. The result is bit-identical if i and j
  !> are exchanged.
  subroutine collide_pair(sim, i, j, t, counts, restitution)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical, value :: counts                     !! whether the collision is included in the tally
    !> Coefficient of restitution, unless the TC model makes the collision elastic.
    real(real64), value :: restitution
    real(real64) :: dx(2), dv(2), b, distance2, q, mass_i, mass_j
    integer(int32) :: si, sj
    logical :: elastic

    si = sim%tag(i)%species
    sj = sim%tag(j)%species
    if (sim%law%contact_time > 0) then
      elastic = .false.
      call sim%register_contact(i, t, elastic)
      call sim%register_contact(j, t, elastic)
      if (elastic) restitution = 1
    end if
    call advance_disk(sim%disk(i), sim%box%gravity, t)
    call advance_disk(sim%disk(j), sim%box%gravity, t)
    dx = sim%disk(j)%x - sim%disk(i)%x
    dv = sim%disk(j)%v - sim%disk(i)%v
    if (any(sim%box%periodic)) then
      ! Few contacts are across a periodic side.
      if (any(abs(dx) >= 0.5_real64*sim%box%edges())) call use_nearest_image(sim, t, dx, dv)
    end if
    b = dx(1)*dv(1) + dx(2)*dv(2)
    distance2 = dx(1)*dx(1) + dx(2)*dx(2)
    mass_i = sim%species(si)%mass
    mass_j = sim%species(sj)%mass
    if (allocated(sim%own_mass)) then   ! faster than `mass_of`, which would test the allocation for each disk
      mass_i = sim%own_mass(i)
      mass_j = sim%own_mass(j)
    end if
    q = pair_impulse(b, distance2, mass_i, mass_j, restitution)
    ! The impulse is divided by the mass. Multiplying it by a stored reciprocal mass would repeat
    ! the same rounding error in all collisions.
    sim%disk(i)%v = sim%disk(i)%v + (q/mass_i)*dx
    sim%disk(j)%v = sim%disk(j)%v - (q/mass_j)*dx
    dv = sim%disk(j)%v - sim%disk(i)%v
    ! Rounding errors can leave the two disks with a residual approach velocity.
    if (dx(1)*dv(1) + dx(2)*dv(2) < 0) call remove_residual_approach(sim, i, j)
    sim%tag(i)%collisions = sim%tag(i)%collisions + 1
    sim%tag(j)%collisions = sim%tag(j)%collisions + 1
    sim%tag(i)%last_partner = sim%tag(j)%id
    sim%tag(j)%last_partner = sim%tag(i)%id
    if (.not. counts) return
    sim%tally%events = sim%tally%events + 1
    sim%tally%collisions = sim%tally%collisions + 1
    call sim%tally%sum(virial)%add(-q*distance2)
    if (restitution < 1) call sim%tally%sum(dissipated)%add(0.5_real64*(1 - restitution)*q*b)
  end subroutine collide_pair

  !> Normal impact velocity of disks i and j at the time t.
  pure function impact_velocity(sim, i, j, t) result(g)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    real(real64) :: g, dx(2), dv(2)      ! separation dx [length]; velocities g, dv [length/time]

    call relative_motion(sim, i, j, t, dx, dv)
    g = abs(dot_product(dx, dv))/magnitude(dx)
  end function impact_velocity

  !> Separation and relative velocity of disk i and the nearest periodic image of disk j at the time
  !> t.
  pure subroutine relative_motion(sim, i, j, t, dx, dv)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    real(real64), intent(out) :: dx(2)           !! [length]
    real(real64), intent(out) :: dv(2)           !! [length/time]
    type(disk_t) :: p, q

    p = sim%disk(i)
    q = sim%disk(j)
    call advance_disk(p, sim%box%gravity, t)
    call advance_disk(q, sim%box%gravity, t)
    dx = q%x - p%x
    dv = q%v - p%v
    call use_nearest_image(sim, t, dx, dv)
  end subroutine relative_motion

  !> Applies the tangential impulse in a collision of the rough disks i and j, after the normal
  !> impulse.
  subroutine apply_tangential_impulse(sim, i, j, normal_impulse, counts)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: normal_impulse   !! [mass length/time]
    logical, value :: counts                     !! whether the collision is included in the tally
    real(real64) :: along(2), dv(2), slip, impulse, mass_i, mass_j, reduced

    associate (p => sim%disk(i), q => sim%disk(j), law => sim%law)
      along = q%x - p%x
      dv = q%v - p%v
      call use_nearest_image(sim, p%clock, along, dv)
      along = [along(2), -along(1)]/magnitude(along)      ! unit vector z x n, where n points from j to i
      dv = -dv
      slip = dot_product(dv, along) - (p%radius*sim%spin(i) + q%radius*sim%spin(j))
      mass_i = sim%mass_of(i)
      mass_j = sim%mass_of(j)
      reduced = mass_i*mass_j/(mass_i + mass_j)
      impulse = tangential_impulse(law%tangential, law%inertia, reduced, slip, normal_impulse)
      p%v = p%v + (impulse/mass_i)*along
      q%v = q%v - (impulse/mass_j)*along
      call sim%change_angular_momentum(i, -p%radius*impulse)
      call sim%change_angular_momentum(j, -q%radius*impulse)
      if (counts) call sim%tally%sum(dissipated)%add( &
        -impulse*(slip + 0.5_real64*impulse*(1 + 1/law%inertia)/reduced))
    end associate
    call remove_residual_approach(sim, i, j)
  end subroutine apply_tangential_impulse

  !> Momentum change of disk i in a collision with a surface or with disk j. If disk i is far
  !> heavier than disk j, its velocity change is dominated by rounding errors. The momentum change
  !> is then computed from the velocity change of disk j.
  pure function momentum_change(sim, i, j, v, w) result(change)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: j              !! index of the other disk; not positive for a surface
    real(real64), intent(in) :: v(2), w(2)   !! velocities of disks i and j before the collision [length/time]
    real(real64) :: change(2)                    !! [mass length/time]

    if (is_far_heavier(sim, i, j)) then
      change = -sim%mass_of(j)*(sim%disk(j)%v - w)
    else
      change = sim%mass_of(i)*(sim%disk(i)%v - v)
    end if
  end function momentum_change

  !> Magnitude of the momentum change of disk i in a collision.
  pure function impulse_between(sim, i, j, v, w) result(impulse)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: j              !! index of the other disk; not positive for a surface
    real(real64), intent(in) :: v(2), w(2)   !! velocities of disks i and j before the collision [length/time]
    real(real64) :: impulse                      !! [mass length/time]

    if (is_far_heavier(sim, i, j)) then
      impulse = sim%mass_of(j)*magnitude(sim%disk(j)%v - w)
    else
      impulse = sim%mass_of(i)*magnitude(sim%disk(i)%v - v)
    end if
  end function impulse_between

  !> True if disk i is so much heavier than disk j that the velocity change of disk i loses
  !> significant digits.
  pure function is_far_heavier(sim, i, j) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    logical :: yes

    yes = j > 0
    if (yes) yes = sim%mass_of(i) > far_heavier*sim%mass_of(j)
  end function is_far_heavier

  !> Translational energy transferred from disk j to disk i: the mean of the energy gained by i and
  !> the energy lost by j.
  pure function transferred_energy(sim, i, j, v, w) result(energy)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: v(2), w(2)   !! velocities of disks i and j before the collision [length/time]
    real(real64) :: energy

    if (is_far_heavier(sim, i, j) .or. is_far_heavier(sim, j, i)) then
      energy = 0.25_real64*dot_product(momentum_change(sim, i, j, v, w), sim%disk(i)%v + v + sim%disk(j)%v + w)
    else
      energy = 0.5_real64*(energy_gain(sim, i, v) - energy_gain(sim, j, w))
    end if
  end function transferred_energy

  !> Change of the translational kinetic energy of disk i in a collision.
  pure function energy_gain(sim, i, before)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: before(2)        !! velocity of disk i before the collision [length/time]
    real(real64) :: energy_gain                  !! [energy]

    energy_gain = 0.5_real64*sim%mass_of(i)*dot_product(sim%disk(i)%v - before, sim%disk(i)%v + before)
  end function energy_gain

  !> Adds a collision of disks i and j to the virial tensor, the collisional heat flux, and the work
  !> of the shear. The shear does work only in collisions across the lower or upper boundary of a
  !> sheared box.
  subroutine add_pair_sums(sim, i, j, change, transferred_energy)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: change(2)        !! momentum change of disk i [mass length/time]
    real(real64), intent(in) :: transferred_energy  !! energy transferred to disk i [energy]
    real(real64) :: r(2), image_velocity(2)
    integer :: a, b

    r = sim%disk(i)%x - sim%disk(j)%x
    image_velocity = 0
    call use_nearest_image(sim, sim%disk(i)%clock, r, image_velocity)
    do a = 1, 2
      do b = 1, 2
        call sim%tally%sum(stress + 2*(a - 1) + b - 1)%add(change(a)*r(b))
      end do
    end do
    if (sim%features%helfand) call sim%tally%sum(heat_virial:heat_virial + 1)%add(transferred_energy*r)
    if (.not. sim%box%is_sheared()) return
    call sim%tally%sum(work)%add(-image_velocity(1)*change(1))
    call remove_residual_approach(sim, i, j)
  end subroutine add_pair_sums

  !> Replaces the separation and relative velocity of two disks at the time t by the values between
  !> the first disk and the nearest periodic image of the second disk.
  pure subroutine use_nearest_image(sim, t, dx, dv)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t
    real(real64), intent(inout) :: dx(2)         !! [length]
    real(real64), intent(inout) :: dv(2)         !! [length/time]
    type(images_t) :: images
    type(image_t) :: image

    if (all(abs(dx) < 0.5_real64*sim%box%periods())) return    ! usually the disk in the box is nearest
    images = sim%images()
    image = images%image(images%nearest_image(dx, t))
    dx = dx + [image%shift(1) + image%velocity*t, image%shift(2)]
    dv(1) = dv(1) + image%velocity
  end subroutine use_nearest_image

  !> True if disks i and j, touching at the time t, are still in contact after their last collision.
  !> The contact must be through the same periodic image. Free disks can approach each other after
  !> such a collision only because of a rounding error, which arises when one of them is shifted by
  !> a period.
  pure function are_in_contact(sim, i, j, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical :: yes
    type(images_t) :: images
    real(real64) :: then(2), dx(2)

    yes = sim%tag(i)%last_partner == sim%tag(j)%id .and. sim%tag(j)%last_partner == sim%tag(i)%id
    if (.not. yes) return
    images = sim%images()
    associate (p => sim%disk(i), q => sim%disk(j), g => sim%box%gravity)
      then = q%x - p%x
      dx = flight(q%x, q%v, g, t - q%clock) - flight(p%x, p%v, g, t - p%clock)
      yes = .not. (p%clock < q%clock .or. p%clock > q%clock) &
        .and. all(abs(images%nearest_image(then, p%clock) - images%nearest_image(dx, t)) <= 0)
    end associate
  end function are_in_contact

  !> Removes the approach velocity that rounding errors can leave after a collision of two disks.
  !> The test uses the same expression as the prediction of contacts. The pair is therefore not
  !> predicted to collide again. No event is counted, and the clocks do not change.
  pure subroutine remove_residual_approach(sim, i, j)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64) :: dx(2), dv(2), image_velocity, step, mass_i, mass_j

    associate (p => sim%disk(i), q => sim%disk(j))
      dx = q%x - p%x
      dv = 0
      call use_nearest_image(sim, p%clock, dx, dv)
      image_velocity = dv(1)
      mass_i = sim%mass_of(i)
      mass_j = sim%mass_of(j)
      step = max(epsilon(step)*maxval(abs([p%v, q%v]))/magnitude(dx)*(mass_i*mass_j/(mass_i + mass_j)), tiny(step))
      do
        dv = q%v - p%v + [image_velocity, 0.0_real64]
        if (dx(1)*dv(1) + dx(2)*dv(2) >= 0) exit
        p%v = p%v - (step/mass_i)*dx
        q%v = q%v + (step/mass_j)*dx
        step = 2*step
      end do
      p%collision_counter = p%collision_counter + 1
      q%collision_counter = q%collision_counter + 1
    end associate
  end subroutine remove_residual_approach

  !> True if a code represents a periodic or an open side, through which disks pass.
  pure function is_passage(sim, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: code
    logical :: yes

    yes = .false.
    if (is_side(code)) yes = sim%box%periodic(axis_of(code)) .or. sim%box%open(1 - code)
  end function is_passage

  !> Lets disk i leave the box through an open side at the time t. The departure is an event but not
  !> a collision. If disk i becomes the first waiting disk of a source, the source ignores the
  !> multiples of its interval before the departure.
  subroutine depart(sim, i, code, t, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! code of the side; see `partners`
    real(real64), intent(in) :: t
    type(event_log_t), intent(inout), optional :: log
    integer :: k

    call sim%rotate_to(i, t)
    call advance_disk(sim%disk(i), sim%box%gravity, t)
    associate (disk => sim%disk(i), tag => sim%tag(i), tally => sim%tally)
      call tally%flow(outflow)%add(energy_of(sim, i))
      do k = 1, size(sim%source_time)
        if (sim%source(k)%species /= tag%species .or. tally%inside(tag%species) < sim%species(tag%species)%count) cycle
        sim%source_time(k) = max(sim%source_time(k), nearest(sim%box%epoch + t, -1.0_real64))
      end do
      tally%events = tally%events + 1
      tally%left(1 - code) = tally%left(1 - code) + 1
      tally%inside(tag%species) = tally%inside(tag%species) - 1
      tag%collisions = tag%collisions + 1
      tag%last_partner = 0
      disk%v = 0
      if (allocated(sim%extra)) sim%extra(i)%image = 0
      if (allocated(sim%extra)) sim%extra(i)%spin = 0
      sim%waits(tag%id) = .true.
      if (present(log)) call log%append([sim%box%epoch + t, real([tag%id, code], real64), [0.0_real64, 0.0_real64, 0.0_real64]])
    end associate
  end subroutine depart

  !> Kinetic, rotational and potential energy of disk i at its clock. The potential energy is zero
  !> at the origin of the coordinates.
  pure function energy_of(sim, i) result(energy)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: energy

    associate (disk => sim%disk(i))
      energy = sim%mass_of(i)*(0.5_real64*dot_product(disk%v, disk%v) - dot_product(sim%box%gravity, disk%x))
    end associate
    if (sim%features%rotation) energy = energy + 0.5_real64*sim%inertia_of(i)*sim%spin(i)**2
  end function energy_of

  !> Moves disk i by one period when it passes a periodic side at the time t. The clock of the disk
  !> does not change.
  subroutine pass_side(sim, i, code, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    integer :: axis, period

    axis = axis_of(code)
    period = sense_of(code)
    if (axis == 2 .and. sim%box%is_sheared()) then
      call pass_sheared_boundary(sim, i, period, t)
      return
    end if
    associate (d => sim%disk(i), edges => sim%box%edges())
      d%x(axis) = d%x(axis) - period*edges(axis)
      d%collision_counter = d%collision_counter + 1
      sim%extra(i)%image(axis) = sim%extra(i)%image(axis) + period
    end associate
  end subroutine pass_side

  !> Moves disk i across the lower or upper boundary of a sheared box (Lees-Edwards). The position
  !> is shifted by the displacement of the periodic image. The velocity is shifted by the velocity
  !> of the image. Only the reference frame changes; no force acts on the disk.
  subroutine pass_sheared_boundary(sim, i, rows, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer, intent(in) :: rows                  !! 1 at the upper boundary, -1 at the lower one
    real(real64), intent(in) :: t
    type(images_t) :: images
    real(real64) :: v, columns

    images = sim%images()
    associate (d => sim%disk(i), periods => sim%extra(i)%image, length => sim%box%upper(1) - sim%box%lower(1))
      v = d%v(1)
      call images%enter_image_frame(real(rows, real64), d%clock, d%x, d%v, periods)
      columns = floor((flight(d%x(1), d%v(1), 0.0_real64, t - d%clock) - sim%box%lower(1))/length, int64)
      d%x(1) = d%x(1) - columns*length
      periods(1) = periods(1) + columns
      d%collision_counter = d%collision_counter + 1
      call sim%tally%sum(work)%add(0.5_real64*sim%mass_of(i)*(d%v(1) - v)*(d%v(1) + v))
    end associate
  end subroutine pass_sheared_boundary

  !> Part of a message: disk i, its partner and the present time. The disk with the lower id is
  !> named first, whichever of the two disks predicted the event.
  pure function encounter_text(sim, i, code) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code      !! index of the disk and code of its partner; see `partners`
    character(len=:), allocatable :: text

    text = disk_text(i)
    if (code > 0) then
      text = disk_text(merge(i, code, sim%tag(i)%id < sim%tag(code)%id))//" and " &
        //disk_text(merge(code, i, sim%tag(i)%id < sim%tag(code)%id))
    else if (is_side(code)) then
      text = text//" and the "//sim%box%surface(1 - code)%name//" side"
    else if (is_wall(code)) then
      text = text//" and obstacle "//sim%box%surface(sim%box%surface_of(code))%name
    end if
    text = text//" at time "//written(sim%time())

  contains

    !> Part of a message: number and species of a disk.
    pure function disk_text(k) result(words)
      integer(int32), intent(in) :: k
      character(len=:), allocatable :: words

      words = "disk "//written(sim%tag(k)%id)//" ("//sim%species(sim%tag(k)%species)%name//")"
    end function disk_text
  end function encounter_text

end module encounters
