!> The seam between the dynamics and the ways to find what a disk meets next; and the kernel that they share.
module neighbour_search
  use images, only: image_t
  use kinds, only: int32, never, real64
  use disks, only: disk_t, tag_t
  use free_flight, only: flight, flight_velocity
  implicit none
  private
  public :: event_t, prospect_t, earliest_contact, event_of, list_capacity, latest_clock, no_gravity, wins

  integer(int32), parameter :: list_capacity = 64
  !> What a caller knows beforehand, as a sum, so that the compiler makes a version of the kernel without the rest:
  !> no disk has a later clock than the one in question, which is now; nothing falls.
  integer(int32), parameter :: latest_clock = 1, no_gravity = 2
  real(real64), parameter :: margin_of_times = 32*epsilon(1.0_real64)    !! above all rounding in the kernel

  !> An event that a disk expects.
  type :: event_t
    real(real64) :: time = 0.0_real64         !! since the epoch [time]
    integer(int32) :: disk = 0                !! who expects it
    integer(int32) :: partner = 0             !! whom it meets: a disk (> 0) or a code (<= 0)
  end type event_t

  !> What a disk may meet next: the earliest event known, and other disks that might come before it. Not
  !> initialised, as one is made for each prediction.
  type :: prospect_t
    real(real64) :: time                      !! of the earliest event [time]
    integer(int32) :: partner                 !! whom it meets then
    integer(int32) :: disk                    !! whose prospect this is
    integer(int32) :: cell                    !! number of the disk's cell
    integer(int32) :: n                       !! number of candidates
    integer(int32) :: list(list_capacity)     !! (n) candidates, counted from 0
  end type prospect_t

contains

  !> The earliest contact of a disk with the candidates, if it precedes the event known so far.
  !>
  !> The time is a pure function of the states of the two disks: both are advanced to the later of their clocks,
  !> and every term keeps its value, or changes sign, when they trade places. So it is the same to the last bit
  !> whenever, and for whichever of the two, it is predicted. Of simultaneous contacts one `wins`. A
  !> contact time before `now` is a rounding artefact: after a perfectly inelastic collision two disks stay in contact
  !> to the last bits, and shifting one by a period can change those bits. Then the contact is now or never, and as the
  !> shift is an event with a prediction, that is decided then, whoever looks at the pair later.
  !>
  !> The root of |dx + dv s| = sigma is c/(sqrt(disc) - b), which does not cancel near contact, and the discriminant
  !> sigma**2 dv**2 - (dx x dv)**2, which does not cancel for distant grazing pairs. Disks that touch, or overlap by
  !> rounding, and approach collide now.
  !>
  !> Most candidates fail one combined test: the root is not real, or not before the best so far, or not before the
  !> candidate's own event, when the candidate will predict again with the disk among its candidates. A root before t
  !> needs c < -2 b (t - late), here with a margin above rounding.
  pure subroutine earliest_contact(disk, tag, near, now, gravity, known, image)
    type(disk_t), intent(in) :: disk(0:*)     !! all disks, counted from 0
    type(tag_t), intent(in) :: tag(*)
    type(prospect_t), intent(inout) :: near   !! the disk itself is harmless among the candidates
    real(real64), value :: now                !! [time]
    real(real64), intent(in) :: gravity(2)
    integer(int32), value :: known            !! 0, `latest_clock`, `no_gravity`, or their sum
    type(image_t), intent(in), optional :: image   !! through which the candidates are seen
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
      if (.not. fresh) then                   ! else the same numbers come out, with si = 0
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
      if (present(image)) dx = dx + (image%shift(1) + image%slip*late)
      if (present(image)) dy = dy + image%shift(2)
      if (present(image)) du = du + image%slip
      sigma2 = (ri + rj)**2
      b = dx*du + dy*dv
      c = dx*dx + dy*dy - sigma2
      disc = sigma2*(du*du + dv*dv) - (dx*dv - dy*du)**2
      latest = min(best, disk(j)%event_time)
      in_time = (from - (2 + margin_of_times)*latest)*b - c
      in_time = merge(in_time, disc, in_time < disc)
      if (in_time > 0 .and. b < 0) then
        t_j = late + max(c, 0.0_real64)/(sqrt(min(disc, b*b)) - b)
        if (t_j < now .and. .not. fresh) then ! by rounding: the contact is over, or else it is now
          t_j = merge(2*never, now, b + (du*du + dv*dv)*(now - late) >= 0)
        end if
        if (t_j < best) then
          best = t_j; partner = j + 1
        else if (.not. t_j > best) then       ! seldom
          if (wins(event_t(t_j, near%disk, j + 1), event_t(t_j, near%disk, partner), tag)) partner = j + 1
        end if
      end if
    end do
    near%time = best; near%partner = partner
  end subroutine earliest_contact

  !> The state of a disk as scalars.
  pure subroutine read_state(d, x, y, u, v, clock, radius)
    type(disk_t), intent(in) :: d
    real(real64), intent(out) :: x, y, u, v, clock, radius

    x = d%x(1); y = d%x(2)
    u = d%v(1); v = d%v(2)
    clock = d%clock; radius = d%radius
  end subroutine read_state

  !> A coordinate after the time s; a straight line takes fewer operations and gives the same number.
  elemental function moved(x, v, g, s, falling) result(there)
    real(real64), intent(in) :: x, v, g, s
    logical, intent(in) :: falling            !! otherwise g is zero
    real(real64) :: there

    if (falling) then
      there = flight(x, v, g, s)
    else
      there = x + v*s
    end if
  end function moved

  !> The velocity after the time s, likewise.
  elemental function sped_up(v, g, s, falling) result(after)
    real(real64), intent(in) :: v, g, s
    logical, intent(in) :: falling
    real(real64) :: after

    after = v
    if (falling) after = flight_velocity(v, g, s)
  end function sped_up

  !> The event of disk i.
  pure function event_of(disk, i) result(event)
    type(disk_t), intent(in) :: disk(*)
    integer(int32), intent(in) :: i
    type(event_t) :: event

    event = event_t(disk(i)%event_time, i, disk(i)%partner)
  end function event_of

  !> Whether, of two simultaneous events, the first comes first, wherever one has to: by the lower id of the disks concerned,
  !> then by the higher one, which is 0 for a single disk.
  pure function wins(a, b, tag) result(yes)
    type(event_t), intent(in) :: a, b
    type(tag_t), intent(in) :: tag(*)
    logical :: yes
    integer(int32) :: ids_a(2), ids_b(2)

    ids_a = ids_of(a)
    ids_b = ids_of(b)
    yes = ids_a(1) < ids_b(1) .or. (ids_a(1) == ids_b(1) .and. ids_a(2) < ids_b(2))
  contains

    !> The lower and the higher id.
    pure function ids_of(event) result(ids)
      type(event_t), intent(in) :: event
      integer(int32) :: ids(2)

      ids = [tag(event%disk)%id, 0]
      if (event%partner > 0) ids = [min(ids(1), tag(event%partner)%id), max(ids(1), tag(event%partner)%id)]
    end function ids_of
  end function wins

end module neighbour_search
