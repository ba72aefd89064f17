!> The seam between the dynamics and the ways to find what a disk meets next; and the kernel they share.
module neighbour_search
  use kinds, only: int32, never, real64
  use disks, only: disk_t
  use free_flight, only: flight, flight_velocity
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: neighbour_search_t, earliest_contact, first_crossing

  !> Codes of `disk%partner` from here downwards: the disk leaves its cell to the left, right, bottom, top.
  integer(int32), parameter :: first_crossing = -2000000000

  type, abstract :: neighbour_search_t
    logical :: everyone = .false.    !! predict all disks anew after each event, not just those involved
  contains
    procedure(build_search), deferred :: build
    procedure(predict_event), deferred :: predict
    procedure(cross_cells), deferred :: cross
    procedure :: predict_both
    procedure :: read_ahead
  end type neighbour_search_t

  abstract interface
    !> Takes in where the disks are now.
    subroutine build_search(self, sim)
      import :: neighbour_search_t, simulation_t
      class(neighbour_search_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
    end subroutine build_search

    !> Writes into disk i the earliest event it can expect: a disk, a side, an obstacle, a cell's end.
    subroutine predict_event(self, sim, i)
      import :: int32, neighbour_search_t, simulation_t
      class(neighbour_search_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      integer(int32), intent(in) :: i
    end subroutine predict_event

    !> Moves disk i over the face that its event names, a crossing or a periodic side, and predicts.
    subroutine cross_cells(self, sim, i, code)
      import :: int32, neighbour_search_t, simulation_t
      class(neighbour_search_t), intent(inout) :: self
      type(simulation_t), intent(inout) :: sim
      integer(int32), intent(in) :: i
      integer(int32), intent(in) :: code      !! of the crossing or the side
    end subroutine cross_cells
  end interface

contains

  !> Writes into the disks i and j, which have just collided, what they can expect.
  subroutine predict_both(self, sim, i, j)
    class(neighbour_search_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    call self%predict(sim, i)
    call self%predict(sim, j)
  end subroutine predict_both

  !> Asks for what the next predictions for some disks will need, so that it is in the cache by then. At each stage
  !> that can be found out from what was asked for at those before.
  subroutine read_ahead(self, sim, stage, disks)
    class(neighbour_search_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: stage       !! from 1
    integer(int32), intent(in) :: disks(:)
  end subroutine read_ahead

  !> The earliest contact of disk i with the disks listed, if it comes before the event known already.
  !>
  !> The time is a pure function of the states of the two disks: both are advanced to the later of their
  !> clocks, and every term changes sign, or nothing, when they trade places. So it comes out the same to
  !> the last bit whenever, and by whichever of the two, it is predicted. Of contacts at the same
  !> moment the one with the lower disks wins.
  !>
  !> Most candidates fail one combined test: the root is not before the best so far (it needs
  !> c < -2 b (t - late), with a margin above rounding) or not real.
  pure subroutine earliest_contact(disk, i, n, list, fresh, falling, gravity, shifted, shift, t, partner)
    type(disk_t), intent(in) :: disk(0:*)     !! all disks, counted from 0
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: n           !! number of candidates
    integer(int32), intent(in) :: list(*)     !! (n) candidates, counted from 0; i itself is harmless
    logical, intent(in) :: fresh              !! nobody has a later clock than i
    logical, intent(in) :: falling            !! `gravity` is not zero
    real(real64), intent(in) :: gravity(2)
    logical, intent(in) :: shifted            !! `shift` is not zero
    real(real64), intent(in) :: shift(2)      !! of the candidates' image [length]
    real(real64), intent(inout) :: t          !! in: of the event known; out: of the earliest [time]
    integer(int32), intent(inout) :: partner  !! likewise
    real(real64) :: xi, yi, ui, vi, clock, ri, xj, yj, uj, vj, clock_j, rj, late, si, sj, dx, dy, du, dv
    real(real64) :: sigma2, b, c, disc, t_j, gate, reach, in_time
    integer(int32) :: k, j
    call read_state(disk(i - 1), xi, yi, ui, vi, clock, ri)
    gate = above(t)
    reach = 2*(clock - gate)
    do k = 1, n
      j = list(k)
      call read_state(disk(j), xj, yj, uj, vj, clock_j, rj)
      if (fresh) then                         ! the same numbers as below, with si = 0
        late = clock
        sj = late - clock_j
        dx = moved(xj, uj, gravity(1), sj, falling) - xi
        dy = moved(yj, vj, gravity(2), sj, falling) - yi
        du = sped_up(uj, gravity(1), sj, falling) - ui
        dv = sped_up(vj, gravity(2), sj, falling) - vi
      else
        late = merge(clock, clock_j, clock > clock_j)
        si = late - clock
        sj = late - clock_j
        dx = moved(xj, uj, gravity(1), sj, falling) - moved(xi, ui, gravity(1), si, falling)
        dy = moved(yj, vj, gravity(2), sj, falling) - moved(yi, vi, gravity(2), si, falling)
        du = sped_up(uj, gravity(1), sj, falling) - sped_up(ui, gravity(1), si, falling)
        dv = sped_up(vj, gravity(2), sj, falling) - sped_up(vi, gravity(2), si, falling)
        reach = 2*(late - gate)
      end if
      if (shifted) then
        dx = dx + shift(1)
        dy = dy + shift(2)
      end if
      sigma2 = (ri + rj)**2
      b = dx*du + dy*dv
      c = dx*dx + dy*dy - sigma2
      disc = sigma2*(du*du + dv*dv) - (dx*dv - dy*du)**2
      in_time = reach*b - c
      in_time = merge(in_time, disc, in_time < disc)
      if (in_time > 0) then
        t_j = late + max(c, 0.0_real64)/(sqrt(disc) + abs(b))
        if (t_j > t .or. b >= 0) cycle
        if (t_j == t .and. .not. before(i, j + 1, partner)) cycle
        t = t_j
        partner = j + 1
        gate = above(t)
        reach = 2*(clock - gate)
      end if
    end do
  end subroutine earliest_contact

  !> The state of a disk, in numbers.
  pure subroutine read_state(d, x, y, u, v, clock, radius)
    type(disk_t), intent(in) :: d
    real(real64), intent(out) :: x, y, u, v, clock, radius
    x = d%x(1); y = d%x(2)
    u = d%v(1); v = d%v(2)
    clock = d%clock; radius = d%radius
  end subroutine read_state

  !> A coordinate after the time s; on a straight line with fewer steps, to the same number.
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

  !> A velocity after the time s, likewise.
  elemental function sped_up(v, g, s, falling) result(after)
    real(real64), intent(in) :: v, g, s
    logical, intent(in) :: falling
    real(real64) :: after
    after = v
    if (falling) after = flight_velocity(v, g, s)
  end function sped_up

  !> A time just above t by more than the rounding of the test that it guards.
  elemental function above(t) result(gate)
    real(real64), intent(in) :: t
    real(real64) :: gate
    gate = t + 16*epsilon(t)*abs(t) + tiny(t)/epsilon(t)
  end function above

  !> Whether, at the same moment, i meets disk j before its other partner (a disk or, if <= 0, a wall).
  elemental function before(i, j, other) result(yes)
    integer(int32), intent(in) :: i, j, other
    logical :: yes
    if (other <= 0) then
      yes = j < i
    else if (min(i, j) /= min(i, other)) then
      yes = min(i, j) < min(i, other)
    else
      yes = max(i, j) < max(i, other)
    end if
  end function before

end module neighbour_search
