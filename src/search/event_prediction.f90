!> Predicted events, and the procedure `earliest_contact`, by which all search methods predict
!> disk-disk contacts.
module event_prediction
  use images, only: image_t
  use kinds, only: int32, never, real64
  use disks, only: disk_t, tag_t
  use free_flight, only: flight, flight_velocity
  implicit none
  private
  public :: event_t, prediction_t, earliest_contact, event_of, list_capacity, latest_clock, no_gravity, wins

  integer(int32), parameter :: list_capacity = 64
  !> Guarantees given by the caller of `earliest_contact`. The sum of both flags gives both
  !> guarantees. `latest_clock`: the clock of the disk is `now`, and no candidate has a later clock.
  !> `no_gravity`: no gravity acts on the disks. For each combination the compiler generates a
  !> version without unneeded operations.
  integer(int32), parameter :: latest_clock = 1, no_gravity = 2
  !> Larger than all rounding errors in `earliest_contact`.
  real(real64), parameter :: margin_of_times = 32*epsilon(1.0_real64)

  !> A predicted event.
  type :: event_t
    real(real64) :: time = 0.0_real64     !! time of the event, relative to the time origin `box%epoch` [time]
    integer(int32) :: disk = 0                !! disk whose record contains the event
    integer(int32) :: partner = 0             !! disk (> 0), boundary id, or other code (<= 0)
  end type event_t

  !> State of the prediction for one disk: the earliest event found so far, and the candidates for
  !> an earlier one. The components have no initial values, because setting them would cost time in
  !> each prediction.
  type :: prediction_t
    real(real64) :: time                      !! time of the earliest event [time]
    integer(int32) :: partner                 !! partner in the earliest event
    integer(int32) :: disk                    !! disk for which the prediction is made
    integer(int32) :: cell                    !! number of the cell of the disk
    integer(int32) :: n                       !! number of candidates
    integer(int32) :: list(list_capacity)     !! indices of the n candidates, counted from 0
  end type prediction_t

contains

  !> Finds the earliest contact of a disk with the candidates, if it precedes the earliest event
  !> found so far.
  !>
  !> The contact time depends only on the states of the two disks, both advanced to the later of
  !> their clocks. Exchanging the disks changes at most the signs of terms in the formula. The
  !> contact time is therefore bit-identical for both disks, whenever it is predicted. Simultaneous
  !> contacts are ordered by `wins`.
  !>
  !> Contact times before `now` result from rounding errors. For example, the distance of two disks
  !> after a perfectly inelastic collision equals the sum of their radii only within rounding
  !> errors. These errors change when one disk is shifted by a period. Such a contact occurs either
  !> at `now` or not at all. Later predictions lead to the same decision. The shift of a disk is
  !> itself an event, after which its contacts are predicted anew.
  !>
  !> The contact time s is the first root of |dx + dv s| = sigma. The root is calculated as s =
  !> c/(sqrt(disc) - b), with b = dx . dv and c = dx**2 - sigma**2. This form avoids cancellation
  !> for disks close to contact. The discriminant is calculated as disc = sigma**2 dv**2 - (dx x
  !> dv)**2. This form avoids cancellation for distant disks that graze each other. If two
  !> approaching disks touch, or overlap owing to rounding errors, they collide at `now`.
  !>
  !> A single test excludes most candidates. The test combines three conditions. The root must be
  !> real, and it must be earlier than the earliest contact found so far and than the next event of
  !> the candidate. (A later contact need not be predicted, because the pair is tested again at that
  !> event.) If the root is earlier than a time t, then c < -2 b (t - late), where `late` is the
  !> later clock of the two disks. This inequality is tested with a margin larger than all rounding
  !> errors.
  pure subroutine earliest_contact(disk, tag, near, now, gravity, known, image)
    type(disk_t), intent(in) :: disk(0:*)     !! all disks, with indices from 0
    type(tag_t), intent(in) :: tag(*)
    type(prediction_t), intent(inout) :: near   !! the candidates may include the disk itself
    real(real64), value :: now                !! [time]
    real(real64), intent(in) :: gravity(2)
    integer(int32), value :: known            !! 0, `latest_clock`, `no_gravity`, or their sum
    type(image_t), intent(in), optional :: image   !! periodic image of the box that contains the candidates
    real(real64) :: xi, yi, ui, vi, clock, ri, x, y, u, v, xj, yj, uj, vj, clock_j, rj, late, si, sj, dx, dy, du, dv
    real(real64) :: sigma2, b, c, disc, t_j, best, latest, from, margin, in_time
    integer(int32) :: k, n, j, partner
    logical :: fresh, falling

    fresh = iand(known, latest_clock) > 0
    falling = iand(known, no_gravity) == 0
    call read_state(disk(near%disk - 1), xi, yi, ui, vi, clock, ri)
    x = xi; y = yi; u = ui; v = vi; late = clock; best = near%time; partner = near%partner
    margin = margin_of_times*(abs(clock) + tiny(clock)/epsilon(clock)**2)
    from = 2*clock - margin; n = near%n
    do k = 1, n
      j = near%list(k)
      call read_state(disk(j), xj, yj, uj, vj, clock_j, rj)
      if (.not. fresh) then                   ! the state would not change if si = 0
        late = merge(clock, clock_j, clock > clock_j)
        from = 2*late - margin
        si = late - clock
        x = moved(xi, ui, gravity(1), si, falling)
        y = moved(yi, vi, gravity(2), si, falling)
        u = sped_up(ui, gravity(1), si, falling)
        v = sped_up(vi, gravity(2), si, falling)
      end if
      sj = late - clock_j
      dx = moved(xj, uj, gravity(1), sj, falling) - x
      dy = moved(yj, vj, gravity(2), sj, falling) - y
      du = sped_up(uj, gravity(1), sj, falling) - u
      dv = sped_up(vj, gravity(2), sj, falling) - v
      if (present(image)) dx = dx + (image%shift(1) + image%velocity*late)
      if (present(image)) dy = dy + image%shift(2)
      if (present(image)) du = du + image%velocity
      sigma2 = (ri + rj)**2
      b = dx*du + dy*dv
      c = dx*dx + dy*dy - sigma2
      disc = sigma2*(du*du + dv*dv) - (dx*dv - dy*du)**2
      latest = min(best, disk(j)%event_time)
      in_time = (from - (2 + margin_of_times)*latest)*b - c
      in_time = merge(in_time, disc, in_time < disc)
      if (in_time > 0 .and. b < 0) then
        t_j = late + max(c, 0.0_real64)/(sqrt(min(disc, b*b)) - b)
        if (t_j < now .and. .not. fresh) then ! rounding error: contact at `now` or not at all
          t_j = merge(2*never, now, b + (du*du + dv*dv)*(now - late) >= 0)
        end if
        if (t_j < best) then
          best = t_j; partner = j + 1
        else if (.not. t_j > best) then       ! rare
          if (wins(event_t(t_j, near%disk, j + 1), event_t(t_j, near%disk, partner), tag)) partner = j + 1
        end if
      end if
    end do
    near%time = best; near%partner = partner
  end subroutine earliest_contact

  !> Copies the state of a disk to scalars.
  pure subroutine read_state(d, x, y, u, v, clock, radius)
    type(disk_t), intent(in) :: d
    real(real64), intent(out) :: x, y, u, v, clock, radius

    x = d%x(1); y = d%x(2)
    u = d%v(1); v = d%v(2)
    clock = d%clock; radius = d%radius
  end subroutine read_state

  !> Coordinate of a disk after a flight of duration s.
  elemental function moved(x, v, g, s, falling) result(there)
    real(real64), intent(in) :: x, v, g, s
    logical, intent(in) :: falling            !! whether gravity acts; without gravity g is zero
    real(real64) :: there

    if (falling) then
      there = flight(x, v, g, s)
    else
      there = x + v*s
    end if
  end function moved

  !> Velocity component of a disk after a flight of duration s.
  elemental function sped_up(v, g, s, falling) result(after)
    real(real64), intent(in) :: v, g, s
    logical, intent(in) :: falling
    real(real64) :: after

    after = v
    if (falling) after = flight_velocity(v, g, s)
  end function sped_up

  !> The event stored in the record of disk i.
  pure function event_of(disk, i) result(event)
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i
    type(event_t) :: event

    event = event_t(disk(i)%event_time, i, disk(i)%partner)
  end function event_of

  !> True if event a precedes the simultaneous event b. Simultaneous events are ordered by the lower
  !> id of their two disks, then by the higher id. For an event of a single disk, 0 is used in place
  !> of the higher id.
  pure function wins(a, b, tag) result(yes)
    type(event_t), intent(in) :: a, b
    type(tag_t), intent(in) :: tag(*)
    logical :: yes
    integer(int32) :: ids_a(2), ids_b(2)

    ids_a = ids_of(a)
    ids_b = ids_of(b)
    yes = ids_a(1) < ids_b(1) .or. (ids_a(1) == ids_b(1) .and. ids_a(2) < ids_b(2))
  contains

    pure function ids_of(event) result(ids)
      type(event_t), intent(in) :: event
      integer(int32) :: ids(2)

      ids = [tag(event%disk)%id, 0]
      if (event%partner > 0) ids = [min(ids(1), tag(event%partner)%id), max(ids(1), tag(event%partner)%id)]
    end function ids_of
  end function wins

end module event_prediction
