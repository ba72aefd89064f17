!> What changes in the state when two disks, a disk and a wall, or a disk and a periodic side meet, with all counts
!> and sums. Both dynamics use it.
module encounters
  use kinds, only: int32, int64, real64
  use collisions, only: pair_impulse, tangential_impulse
  use disks, only: disk_t, land
  use event_log, only: event_log_t
  use free_flight, only: flight, flight_velocity
  use images, only: image_t, images_t
  use partners, only: axis_of, is_side, is_wall, met_id, most_repeats, repeated, repeats, sense_of
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  use tally, only: dissipated, heat_virial, stress, virial, work
  use texts, only: written
  use wall_hits, only: collide_wall
  implicit none
  private
  public :: collide, collide_pair, encounter_text, pass_side, passes

  !> Collisions that disks may have at one moment in any series, and then in a collapse, where approaches are no more than
  !> rounding errors: by their ratio to the velocities, per loss of speed in a collision, or, where walls slow all disks down, by
  !> their size, far below the velocities that an input may have [length/time].
  integer(int32), parameter :: most_visible = most_repeats - 3
  real(real64), parameter :: rounded = 1.0e-12_real64, slowest = 1.0e-120_real64

  real(real64), parameter :: far_heavier = 2.0_real64**20    !! ratio of masses

contains

  !> Collides disk i at the time t with what `code` names, unless they are together already, with all that is rare: disks
  !> turn and rub, and the collision is booked, and logged if there is a log: the same entry whichever of two disks expected
  !> it.
  subroutine collide(sim, i, code, t, counts, log)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code           !! a disk (> 0), a side or an obstacle: see `partners`
    real(real64), intent(in) :: t
    logical, value :: counts                     !! in the tally and the log
    type(event_log_t), intent(inout), optional :: log
    real(real64) :: v(2), w(2), change(2), restitution
    integer(int32) :: first, second, ids(2), n_repeats

    n_repeats = 0
    first = i
    second = min(code, 0)
    if (code > 0) then
      if (are_together(sim, i, code, t)) then
        call keep_apart(sim, i, code)
        return
      end if
      first = merge(i, code, sim%tag(i)%id < sim%tag(code)%id)
      second = i + code - first
      if (.not. min(sim%disk(i)%clock, sim%disk(code)%clock) < t) call note_stuck(sim, i, code, t, counts, n_repeats)
      call sim%turn(second, t)
    end if
    call sim%turn(first, t)
    v = flight_velocity(sim%disk(first)%v, sim%box%gravity, t - sim%disk(first)%clock)
    w = v
    if (code > 0) w = flight_velocity(sim%disk(second)%v, sim%box%gravity, t - sim%disk(second)%clock)
    if (code > 0) then
      restitution = sim%law%restitution(sim%tag(i)%species, sim%tag(code)%species)
      if (sim%law%by_speed%speed > 0) restitution = sim%law%by_speed%restitution_at(restitution, approach(sim, i, code, t))
      call collide_pair(sim, i, code, t, counts, restitution)
      if (n_repeats > 0) sim%tag([i, code])%met = repeated(sim%tag([code, i])%id, n_repeats)
      if (sim%law%grip%is_rough()) call rub(sim, first, second, impulse_between(sim, first, second, v, w), counts)
    else
      call collide_wall(sim, i, code, t, counts)
    end if
    if (.not. counts) return
    change = momentum_change(sim, first, second, v, w)
    if (code > 0 .and. sim%with%stress) call book_pair(sim, first, second, change, handed(sim, first, second, v, w))
    call sim%note_change(first, v, t)
    if (code > 0) call sim%note_change(second, w, t)
    if (.not. present(log)) return
    ids = [sim%tag(first)%id, code]
    if (code > 0) ids(2) = sim%tag(second)%id
    call log%append([sim%box%epoch + t, real(ids, real64), impulse_between(sim, first, second, v, w), change])
  end subroutine collide

  !> Collides the disks i and j at the time t. Which of them is i changes no bit.
  subroutine collide_pair(sim, i, j, t, counts, restitution)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical, value :: counts                     !! in the tally
    real(real64), value :: restitution           !! but for the TC model
    real(real64) :: dx(2), dv(2), b, distance2, q, mass_i, mass_j
    integer(int32) :: si, sj
    logical :: elastic

    si = sim%tag(i)%species
    sj = sim%tag(j)%species
    if (sim%law%contact_time > 0) then
      elastic = .false.
      call sim%make_contact(i, t, elastic)
      call sim%make_contact(j, t, elastic)
      if (elastic) restitution = 1
    end if
    call land(sim%disk(i), sim%box%gravity, t)
    call land(sim%disk(j), sim%box%gravity, t)
    dx = sim%disk(j)%x - sim%disk(i)%x
    dv = sim%disk(j)%v - sim%disk(i)%v
    if (any(sim%box%periodic)) then
      if (any(abs(dx) >= 0.5_real64*sim%box%edges())) call see_nearest(sim, t, dx, dv)    ! seldom
    end if
    b = dx(1)*dv(1) + dx(2)*dv(2)
    distance2 = dx(1)*dx(1) + dx(2)*dx(2)
    mass_i = sim%species(si)%mass
    mass_j = sim%species(sj)%mass
    if (allocated(sim%own_mass)) then                ! as in `mass_of`, with one test for both
      mass_i = sim%own_mass(i)
      mass_j = sim%own_mass(j)
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
    if (.not. counts) return
    sim%tally%events = sim%tally%events + 1
    sim%tally%collisions = sim%tally%collisions + 1
    call sim%tally%sum(virial)%add(-q*distance2)
    if (restitution < 1) call sim%tally%sum(dissipated)%add(0.5_real64*(1 - restitution)*q*b)
  end subroutine collide_pair

  !> Speed along the normal with which the disks i and j meet at the time t.
  pure function approach(sim, i, j, t) result(g)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    type(disk_t) :: p, q
    real(real64) :: g, dx(2), dv(2)              ! [length/time]

    p = sim%disk(i)
    q = sim%disk(j)
    call land(p, sim%box%gravity, t)
    call land(q, sim%box%gravity, t)
    dx = q%x - p%x
    dv = q%v - p%v
    call see_nearest(sim, t, dx, dv)
    g = abs(dot_product(dx, dv))/magnitude(dx)
  end function approach

  !> Looks at a collision of two disks that have both had one at this very time. In contacts of more than two disks that is
  !> common, and the series of such collisions mostly ends. A collapse is a series without end: the same disks collide again
  !> and again, until the speed at which they approach is no more than the rounding error of their velocities. Elastic
  !> disks cannot collapse, nor do disks with a contact time.
  pure subroutine note_stuck(sim, i, j, t, counts, n)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical, intent(in) :: counts                !! in the tally
    integer(int32), intent(out) :: n             !! length of the series so far, see `partners: most_repeats`
    real(real64) :: restitution, fastest
    integer(int32) :: met(2)

    n = 0
    restitution = sim%law%restitution(sim%tag(i)%species, sim%tag(j)%species)
    if (sim%law%contact_time > 0 .or. .not. restitution < 1) return
    met = sim%tag([i, j])%met
    n = minval(merge(repeats(met), most_repeats, met > 0)) + 1        ! where one has hit a wall in between, its partner counts
    fastest = max(magnitude(sim%disk(i)%v), magnitude(sim%disk(j)%v))
    if (approach(sim, i, j, t) > max(rounded*(1 - restitution)*fastest, slowest)) n = min(n, most_visible)
    n = min(n, most_repeats)
    if (.not. counts) return
    sim%tally%stuck = sim%tally%stuck + 1
    if (n == most_repeats) sim%tally%collapse = min(sim%tally%collapse, sim%box%epoch + t)
  end subroutine note_stuck

  !> The tangential part of a collision of the rough disks i and j, whose velocities along the normal have changed already.
  subroutine rub(sim, i, j, normal_impulse, counts)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: normal_impulse   !! [mass length/time]
    logical, value :: counts                     !! in the tally
    real(real64) :: along(2), dv(2), slip, impulse, mass_i, mass_j, reduced

    associate (p => sim%disk(i), q => sim%disk(j), law => sim%law)
      along = q%x - p%x
      dv = q%v - p%v
      call see_nearest(sim, p%clock, along, dv)
      along = [along(2), -along(1)]/magnitude(along)             ! z x n, n from j to i
      dv = -dv
      slip = dot_product(dv, along) - (p%radius*sim%spin(i) + q%radius*sim%spin(j))
      mass_i = sim%mass_of(i)
      mass_j = sim%mass_of(j)
      reduced = mass_i*mass_j/(mass_i + mass_j)
      impulse = tangential_impulse(law%grip, law%inertia, reduced, slip, normal_impulse)
      p%v = p%v + (impulse/mass_i)*along
      q%v = q%v - (impulse/mass_j)*along
      call sim%spin_up(i, -p%radius*impulse)
      call sim%spin_up(j, -q%radius*impulse)
      if (counts) call sim%tally%sum(dissipated)%add( &
        -impulse*(slip + 0.5_real64*impulse*(1 + 1/law%inertia)/reduced))
    end associate
    call keep_apart(sim, i, j)
  end subroutine rub

  !> The momentum that disk i has gained, from a surface or from disk j. The velocity of a disk that is far heavier than its
  !> partner hardly changes, and rounds: then it is that which the partner has lost.
  pure function momentum_change(sim, i, j, v, w) result(change)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: j              !! not positive: there is no partner
    real(real64), intent(in) :: v(2), w(2)       !! their velocities before [length/time]
    real(real64) :: change(2)                    !! [mass length/time]

    if (is_far_heavier(sim, i, j)) then
      change = -sim%mass_of(j)*(sim%disk(j)%v - w)
    else
      change = sim%mass_of(i)*(sim%disk(i)%v - v)
    end if
  end function momentum_change

  !> The size of that.
  pure function impulse_between(sim, i, j, v, w) result(impulse)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: j              !! not positive: there is no partner
    real(real64), intent(in) :: v(2), w(2)       !! their velocities before [length/time]
    real(real64) :: impulse                      !! [mass length/time]

    if (is_far_heavier(sim, i, j)) then
      impulse = sim%mass_of(j)*magnitude(sim%disk(j)%v - w)
    else
      impulse = sim%mass_of(i)*magnitude(sim%disk(i)%v - v)
    end if
  end function impulse_between

  !> Whether disk i is so much heavier than disk j that its own change of velocity has lost digits.
  pure function is_far_heavier(sim, i, j) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    logical :: yes

    yes = j > 0
    if (yes) yes = sim%mass_of(i) > far_heavier*sim%mass_of(j)
  end function is_far_heavier

  !> The energy of translation that disk i has gained from disk j, as the mean of the gain of one and the loss of the other.
  pure function handed(sim, i, j, v, w) result(energy)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: v(2), w(2)       !! their velocities before [length/time]
    real(real64) :: energy

    if (is_far_heavier(sim, i, j) .or. is_far_heavier(sim, j, i)) then
      energy = 0.25_real64*dot_product(momentum_change(sim, i, j, v, w), sim%disk(i)%v + v + sim%disk(j)%v + w)
    else
      energy = 0.5_real64*(gain(sim, i, v) - gain(sim, j, w))
    end if
  end function handed

  !> The energy of translation that disk i has gained.
  pure function gain(sim, i, before)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: before(2)        !! its velocity [length/time]
    real(real64) :: gain                         !! [energy]

    gain = 0.5_real64*sim%mass_of(i)*dot_product(sim%disk(i)%v - before, sim%disk(i)%v + before)
  end function gain

  !> Books a collision of the disks i and j, whose momentum changes by `change` and its negative: the change, and the energy
  !> that one hands to the other, times their distance; and what the shear has done, which is nothing but if they met through
  !> the bottom or the top.
  subroutine book_pair(sim, i, j, change, handed)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: change(2)        !! [mass length/time]
    real(real64), intent(in) :: handed           !! to disk i [energy]
    real(real64) :: r(2), slip(2)
    integer :: a, b

    r = sim%disk(i)%x - sim%disk(j)%x
    slip = 0
    call see_nearest(sim, sim%disk(i)%clock, r, slip)
    do a = 1, 2
      do b = 1, 2
        call sim%tally%sum(stress + 2*(a - 1) + b - 1)%add(change(a)*r(b))
      end do
    end do
    if (sim%with%helfand) call sim%tally%sum(heat_virial:heat_virial + 1)%add(handed*r)
    if (.not. sim%box%is_sheared()) return
    call sim%tally%sum(work)%add(-slip(1)*change(1))
    call keep_apart(sim, i, j)
  end subroutine book_pair

  !> Turns the separation of two disks at the time t, and its rate, into those of the nearest image of the second.
  pure subroutine see_nearest(sim, t, dx, dv)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t
    real(real64), intent(inout) :: dx(2)         !! [length]
    real(real64), intent(inout) :: dv(2)         !! [length/time]
    type(images_t) :: images
    type(image_t) :: image

    if (all(abs(dx) < 0.5_real64*sim%box%periods())) return    ! nearly always
    images = sim%images()
    image = images%image(images%nearest_image(dx, t))
    dx = dx + [image%shift(1) + image%slip*t, image%shift(2)]
    dv(1) = dv(1) + image%slip
  end subroutine see_nearest

  !> Whether the disks i and j, which touch at the time t, hit each other last and through the same image. No force acts
  !> between them: only rounding can have made them approach again, when one of them passed a periodic side.
  pure function are_together(sim, i, j, t) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical :: yes
    type(images_t) :: images
    real(real64) :: then(2), dx(2)

    yes = met_id(sim%tag(i)%met) == sim%tag(j)%id .and. met_id(sim%tag(j)%met) == sim%tag(i)%id
    if (.not. yes) return
    images = sim%images()
    associate (p => sim%disk(i), q => sim%disk(j), g => sim%box%gravity)
      then = q%x - p%x
      dx = flight(q%x, q%v, g, t - q%clock) - flight(p%x, p%v, g, t - p%clock)
      yes = .not. (p%clock < q%clock .or. p%clock > q%clock) &
        .and. all(abs(images%nearest_image(then, p%clock) - images%nearest_image(dx, t)) <= 0)
    end associate
  end function are_together

  !> Takes from two disks of the same clock, which have collided, the approach that rounding may have left, in the very
  !> expression by which a contact is predicted: then none is. This is no collision, and the clocks stay.
  pure subroutine keep_apart(sim, i, j)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64) :: dx(2), dv(2), slip, step, mass_i, mass_j

    associate (p => sim%disk(i), q => sim%disk(j))
      dx = q%x - p%x
      dv = 0
      call see_nearest(sim, p%clock, dx, dv)
      slip = dv(1)
      mass_i = sim%mass_of(i)
      mass_j = sim%mass_of(j)
      step = max(epsilon(step)*maxval(abs([p%v, q%v]))/magnitude(dx)*(mass_i*mass_j/(mass_i + mass_j)), tiny(step))
      do
        dv = q%v - p%v + [slip, 0.0_real64]
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

  !> Moves disk i by one period through a periodic side at the time t. Its clock stays.
  subroutine pass_side(sim, i, code, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, code
    real(real64), intent(in) :: t
    integer :: axis, period

    axis = axis_of(code)
    period = sense_of(code)
    if (axis == 2 .and. sim%box%is_sheared()) then
      call pass_seam(sim, i, period, t)
      return
    end if
    associate (d => sim%disk(i), edges => sim%box%edges())
      d%x(axis) = d%x(axis) - period*edges(axis)
      d%stamp = d%stamp + 1
      sim%extra(i)%image(axis) = sim%extra(i)%image(axis) + period
    end associate
  end subroutine pass_side

  !> Moves disk i through the bottom or the top of a sheared box. What is inside is displaced, and as fast as the box is
  !> when seen from there: no force acts.
  subroutine pass_seam(sim, i, rows, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer, intent(in) :: rows                  !! 1 through the top, -1 through the bottom
    real(real64), intent(in) :: t
    type(images_t) :: images
    real(real64) :: v, columns

    images = sim%images()
    associate (d => sim%disk(i), periods => sim%extra(i)%image, length => sim%box%upper(1) - sim%box%lower(1))
      v = d%v(1)
      call images%climb(real(rows, real64), d%clock, d%x, d%v, periods)
      columns = floor((flight(d%x(1), d%v(1), 0.0_real64, t - d%clock) - sim%box%lower(1))/length, int64)
      d%x(1) = d%x(1) - columns*length
      periods(1) = periods(1) + columns
      d%stamp = d%stamp + 1
      call sim%tally%sum(work)%add(0.5_real64*sim%mass_of(i)*(d%v(1) - v)*(d%v(1) + v))
    end associate
  end subroutine pass_seam

  !> Disk i, its partner and the time, for messages.
  pure function encounter_text(sim, i, code) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code           !! as in `partners`
    character(len=:), allocatable :: text

    text = disk_text(i)
    if (code > 0) then
      text = text//" and "//disk_text(code)
    else if (is_side(code)) then
      text = text//" and the "//sim%box%surface(1 - code)%name//" side"
    else if (is_wall(code)) then
      text = text//" and obstacle "//sim%box%surface(sim%box%surface_of(code))%name
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
