!> Divides a run into epochs. At the end of an epoch the time origin moves, and the state is tested
!> for an inelastic collapse. The time of the test and its result depend only on the state of the
!> simulation. They do not depend on the search, the queue or the number of threads.
module epochs
  use box_sides, only: bounds, next_side, separate_from_sides
  use encounters, only: is_passage
  use kinds, only: int32, int64, never, pi, real64
  use partners, only: axis_of, n_sides, sense_of
  use renumbering, only: renumber
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: are_crushed, restart_epoch, begin_first_epoch, ends_by_event, ends_by_kick, is_at_rest, last_time, most_events
  public :: stays_at_rest
  public :: disk_on_side, has_come_to_rest, last_encounter, move_epoch, stands_still

  !> Intended number of collisions per disk in an epoch. Moving the time origin at the end of each
  !> epoch preserves the precision of times.
  integer(int64), parameter :: epoch_length = 24
  !> Number of significant bits in a shift of the time origin. With so few bits, shifts can be added
  !> without rounding errors.
  integer, parameter :: significant_bits = 20
  !> A collapse is reported if time does not advance during at least `collapse_length` events, and
  !> at least `collapse_length_per_disk` events per disk.
  integer(int64), parameter :: collapse_length = 20000, collapse_length_per_disk = 20
  !> Minimum duration of an epoch, in units of `negligible_time`.
  real(real64), parameter :: shortest = 2.0_real64**(-20)
  real(real64), parameter :: last_time = 0.5_real64*never
  !> Factor of energy growth above which disks are considered crushed.
  real(real64), parameter :: crushing = 1.0e6_real64
  !> Maximum packing fraction in the estimate of the event rate.
  real(real64), parameter :: densest = 0.9_real64
  !> Two limits with the same value. The first is the factor by which a single event may increase
  !> the speed of the fastest disk. The second is the distance that a disk may travel in an epoch,
  !> in box edges. An event that may exceed both limits ends the epoch. A kick ends the epoch if the
  !> time since the time origin, multiplied by the new speed of a disk, exceeds the second limit:
  !> the rounding error of this time would displace the disk noticeably.
  real(real64), parameter :: farthest = 1.0e3_real64

contains

  !> Chooses the length of the first epoch from an estimate of the event rate. Also sets
  !> `negligible_time`, a duration in which no disk moves noticeably.
  pure subroutine begin_first_epoch(sim)
    type(simulation_t), intent(inout) :: sim
    real(real64) :: mean                           ! mean squared speed [length**2/time**2]
    integer(int32) :: i

    mean = magnitude(sim%box%gravity)*minval(sim%disk%radius) + sim%box%highest_speed()**2
    sim%negligible_time = time_to_move(sim, max(sqrt(mean), sim%fastest_drive(), fastest_disk(sim)))
    do i = 1, sim%n_disks()
      associate (v => sim%disk(i)%v)
        mean = mean + dot_product(v, v)/max(sim%n_inside(), 1_int32)
      end associate
    end do
    mean = mean + sim%fastest_drive()**2
    call begin_epoch(sim, events_per_epoch(sim)/(sqrt(max(mean, tiny(mean)))*sim%n_disks()*events_per_path()))
    sim%last_advance = sim%now
    sim%events_then = sim%tally%events
  contains

    !> Mean number of events of a disk per path length. Collisions with walls are counted, and
    !> collisions with other disks according to Henderson's equation of state (Molecular Physics 30,
    !> 971 (1975)).
    pure function events_per_path() result(rate)
      real(real64) :: rate                           !! [1/length]
      real(real64) :: packing

      packing = min(pi*sum(sim%disk%radius**2)/product(sim%box%edges()), densest)
      rate = sqrt(2/pi)*packing*(1 - 7*packing/16)/(1 - packing)**2/(sum(sim%disk%radius)/sim%n_disks()) &
        + sum(1/sim%box%edges())
    end function events_per_path
  end subroutine begin_first_epoch

  !> Time in which a disk of a given speed does not move noticeably.
  pure function time_to_move(sim, speed) result(time)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: speed              !! [length/time]
    real(real64) :: time                           !! [time]

    time = 1.0e-9_real64*minval(sim%disk%radius)/max(speed, sqrt(tiny(speed)))
  end function time_to_move

  !> Intended number of events in an epoch.
  pure function events_per_epoch(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = epoch_length*sim%n_disks()/2 + 100
  end function events_per_epoch

  !> Starts an epoch of a given length at the present time.
  pure subroutine begin_epoch(sim, length)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: length             !! [time]

    sim%epoch_begin = sim%now
    sim%epoch_end = min(sim%now + max(length, shortest*sim%negligible_time), last_time)
    sim%epoch_events = sim%tally%events
  end subroutine begin_epoch

  !> Ends the epoch and moves the time origin to about the present time, which preserves the
  !> precision of times. All events must then be predicted anew. For this reason the disks are also
  !> sorted by cells at this time. The next epoch ends at a fixed time and not after a fixed number
  !> of events, so that all domains can independently end the epoch at the same time. An epoch can
  !> also be ended by a single event or a kick (see `ends_by_event` and `ends_by_kick`). A disk can
  !> then be much faster than before, so the time origin moves exactly to the present time.
  subroutine move_epoch(sim, is_urgent)
    type(simulation_t), intent(inout) :: sim
    logical, intent(in) :: is_urgent               !! whether the epoch was ended by a single event or a kick
    real(real64) :: shift, length

    if (sim%now - sim%last_advance >= sim%negligible_time) then
      sim%last_advance = sim%now
      sim%events_then = sim%tally%events
    end if
    length = (sim%now - sim%epoch_begin)*min(2.0_real64, &
      events_per_epoch(sim)/real(max(sim%tally%events - sim%epoch_events, 1_int64), real64))
    if (is_urgent) then
      shift = sim%now
      sim%negligible_time = min(sim%negligible_time, time_to_move(sim, fastest_disk(sim)))
    else
      shift = scale(aint(scale(fraction(sim%now), significant_bits)), exponent(sim%now) - significant_bits)
    end if
    call renumber(sim)
    call move_origin(sim, shift)
    call begin_epoch(sim, length)
  end subroutine move_epoch

  !> Ends the epoch after a change of the disks, the forces or the contact laws, and moves the time
  !> origin exactly to the present time. Since disks can be much faster after such a change, the
  !> length of the next epoch is determined when the evolution starts. Time-stepped dynamics has no
  !> epochs and is not affected.
  subroutine restart_epoch(sim)
    type(simulation_t), intent(inout) :: sim

    if (.not. sim%epoch_end > 0) return
    call renumber(sim)
    call move_origin(sim, sim%now)
    sim%epoch_end = 0
  end subroutine restart_epoch

  !> Moves the time origin `box%epoch` by `shift`. Afterwards all events must be predicted anew.
  subroutine move_origin(sim, shift)
    type(simulation_t), intent(inout) :: sim
    real(real64), value :: shift                    !! [time]
    integer(int32) :: i

    do i = 1, sim%n_disks()
      sim%disk(i)%clock = sim%disk(i)%clock - shift
      sim%disk(i)%collision_counter = 0
    end do
    if (sim%law%contact_time > 0) sim%extra%last_contact = sim%extra%last_contact - shift
    if (allocated(sim%series)) sim%series%time = sim%series%time - shift
    sim%now = sim%now - shift
    sim%last_advance = sim%last_advance - shift
    sim%box%epoch = sim%box%epoch + shift
    sim%box%side%state%clock = sim%box%side%state%clock - shift
    if (.not. any(sim%box%side%moves())) return      ! rounding affects only contacts with moving sides
    do i = 1, sim%n_disks()
      if (sim%is_inside(i)) call separate_from_sides(sim%box, sim%disk(i), sim%now)
    end do
  end subroutine move_origin

  !> Number of events, since the start of the run, at which the epoch ends early. The limit is
  !> reached only if the event rate is far higher than expected, for example before an inelastic
  !> collapse.
  pure function most_events(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = sim%epoch_events + 2*events_per_epoch(sim)
  end function most_events

  !> True if the first event ends the epoch, because it can make a disk very fast. The rounding
  !> error of the time since the time origin would displace such a disk noticeably. Slow disks
  !> become fast if they are rough and rotate fast, or if they reach a moving or hot boundary. The
  !> result must depend only on the state. It is therefore .false. under gravity and shear, which
  !> change velocities also between events.
  pure function ends_by_event(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    real(real64) :: possible                       ! maximum speed that an event can cause [length/time]
    integer(int32) :: i

    yes = .false.
    if (sim%tally%events > sim%epoch_events .or. sim%box%has_gravity() .or. sim%box%is_sheared()) return
    possible = sim%box%highest_speed()
    if (sim%box%highest_temperature() > 0) possible = max(possible, sqrt(sim%box%highest_temperature()/minval(sim%masses())))
    if (sim%law%tangential%is_rough() .or. sim%box%has_rough_walls()) &
      possible = max(possible, maxval([(abs(sim%spin(i))*sim%disk(i)%radius, i=1, sim%n_disks())]))
    if (possible*sim%epoch_end > farthest*maxval(sim%box%edges())) yes = possible > farthest*fastest_disk(sim)
  end function ends_by_event

  !> True if a kick ends the epoch, because it has made a disk very fast (see `ends_by_event`).
  pure function ends_by_kick(sim, kicked) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: kicked(:)        !! indices of the disks accelerated by the kick
    logical :: yes
    real(real64) :: fastest2                       ! maximum squared speed [length**2/time**2]
    integer(int32) :: k

    yes = .false.
    if (.not. sim%epoch_end > 0) return            ! time-stepped dynamics has no epochs
    fastest2 = 0
    do k = 1, size(kicked, kind=int32)
      fastest2 = max(fastest2, sum(sim%disk(kicked(k))%v**2))
    end do
    yes = sqrt(fastest2)*sim%now > farthest*maxval(sim%box%edges())
  end function ends_by_kick

  !> Speed of the fastest disk.
  pure function fastest_disk(sim) result(speed)
    type(simulation_t), intent(in) :: sim
    real(real64) :: speed                          !! [length/time]
    integer(int32) :: i

    speed = 0
    do i = 1, sim%n_disks()
      speed = max(speed, magnitude(sim%disk(i)%v))
    end do
  end function fastest_disk

  !> True if moving sides compress the disks beyond close packing, so that their energy grows
  !> without limit; .false. if driving or thermal walls supply energy.
  pure function are_crushed(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes

    associate (box => sim%box)
      yes = any(box%side%has_stroke()) .and. .not. (allocated(sim%drive) .or. allocated(sim%source) &
        .or. box%highest_temperature() > 0)
      if (yes) yes = sim%kinetic_energy() > crushing*(sim%start_energy &
        + sum(sim%masses())*(box%highest_speed()**2 + sum(abs(box%gravity)*box%edges())))
    end associate
  end function are_crushed

  !> True if time has stopped advancing during a long series of events, as in an inelastic collapse.
  pure function stands_still(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = sim%now - sim%last_advance < sim%negligible_time &
      .and. sim%tally%events - sim%events_then >= max(collapse_length, collapse_length_per_disk*sim%n_disks())
  end function stands_still

  !> True if all disks under gravity are at rest at the end of an epoch. The test is made only at
  !> the end of an epoch, so that the result does not depend on when the caller pauses. All bounces
  !> in the epoch must be unresolved, because a ball with converging bounces must first execute all
  !> of them. If the disks are at rest at the end of an epoch, the run ends in this state.
  pure function has_come_to_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    real(real64) :: longest                        ! duration of the longest bounce [time]
    integer(int32) :: i

    yes = sim%box%has_gravity() .and. sim%tally%events > sim%epoch_events &
      .and. (sim%tally%events >= most_events(sim) .or. sim%now >= sim%epoch_end)
    if (yes) yes = is_at_rest(sim)                 ! tested first, because it returns at the first moving disk
    if (.not. yes) return
    longest = 0
    do i = 1, sim%n_disks()
      longest = max(longest, unresolved_bounce(sim, i))
    end do
    yes = sim%now - sim%epoch_begin <= real(sim%tally%events - sim%epoch_events, real64)*longest
  end function has_come_to_rest

  !> Duration up to which a bounce of disk i is negligible or too low to be resolved. A bounce is
  !> too low if its height is less than an eighth of the spacing of the disk's coordinates [time].
  pure function unresolved_bounce(sim, i) result(long)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: long

    long = max(sim%negligible_time, sqrt(spacing(maxval(abs(sim%disk(i)%x)))/magnitude(sim%box%gravity)))
  end function unresolved_bounce

  !> True if all disks are at rest. A disk that bounces inelastically on a surface at rest makes
  !> infinitely many bounces in a finite time, because the durations of the bounces form a
  !> convergent series. Under gravity a disk is therefore considered at rest if its last bounce was
  !> less than `negligible_time` ago and its remaining bounces would end within `negligible_time`.
  !> Bounces lower than an eighth of the spacing of the coordinates also count as rest, because
  !> rounding errors can make them endless. Without gravity a disk is at rest if it does not move.
  pure function is_at_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    real(real64) :: slow, long                     ! [length/time], [time]
    integer(int32) :: i

    long = sim%negligible_time
    yes = .true.
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      if (sim%box%has_gravity()) then
        long = unresolved_bounce(sim, i)
        yes = sim%now - sim%disk(i)%clock <= long
      end if
      slow = magnitude(sim%box%gravity)*long
      yes = yes .and. magnitude(sim%velocity(i)) <= slow .and. abs(sim%spin(i))*sim%disk(i)%radius <= slow
      if (.not. yes) return
    end do
  end function is_at_rest

  !> Whether all disks are at rest, and nothing can set them in motion: no gravity, shear, moving
  !> side, driving, source or scheduled change.
  pure function stays_at_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .not. (sim%box%has_gravity() .or. sim%box%is_sheared() .or. any(sim%box%side%moves()) .or. allocated(sim%drive) &
      .or. allocated(sim%source) .or. allocated(sim%schedule))
    if (yes) yes = is_at_rest(sim)
  end function stays_at_rest

  !> The disk that rests on a side while other disks move, and this side; 0 if there is none. If
  !> several disks rest on sides, the result is the disk with the lowest id. The last event of this
  !> disk and its next bounce on a dissipative side are both within `negligible_time` of the present
  !> time. Its bounces are lower than the spacing of its coordinates. They are therefore not
  !> resolved: they converge, and time stops advancing. The next bounce is computed here. The stored
  !> event of the disk cannot be used, because it depends on the search, and the parallel engine may
  !> not have predicted any.
  pure function disk_on_side(sim) result(found)
    type(simulation_t), intent(in) :: sim
    integer(int32) :: found(2)                       !! index of the disk, and code of the side
    integer(int32) :: i, side
    real(real64) :: t                                ! time relative to the time origin `box%epoch` [time]

    found = 0
    if (sim%law%contact_time > 0) return             ! bounces then become elastic and do not converge
    do i = 1, sim%n_disks()
      if (sim%now - sim%disk(i)%clock > sim%negligible_time .or. .not. sim%is_inside(i)) cycle
      if (found(1) > 0) then
        if (sim%tag(found(1))%id < sim%tag(i)%id) cycle
      end if
      call next_side(sim%box, sim%disk(i), t, side)
      if (t - sim%now > sim%negligible_time) cycle
      if (bounces_converge(sim, i, side)) found = [i, side]
    end do
  end function disk_on_side

  !> True if a side is dissipative, and disk i moves so slowly relative to the side that its bounces
  !> are not resolved.
  pure function bounces_converge(sim, i, side) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: side               !! code of the side
    logical :: yes
    integer(int32) :: k

    k = 1 - side
    associate (law => sim%box%surface(k)%law, inwards => -sense_of(side)*sim%disk(i)%v(axis_of(side)))
      yes = .not. is_passage(sim, side) .and. law%is_inelastic() .and. .not. law%temperature > 0 &
        .and. abs(inwards - sim%box%side_velocity(k, sim%now)) <= sim%negligible_time*magnitude(sim%box%gravity)
    end associate
  end function bounces_converge

  !> The last event of disks at rest, as far as the state determines it: the disk with the latest
  !> clock, and its last collision partner; 0 if there was no event. Among disks with equal clocks,
  !> the disk with the lowest id is chosen. If the partner was a side, the nearest side is returned.
  pure function last_encounter(sim) result(pair)
    type(simulation_t), intent(in) :: sim
    integer(int32) :: pair(2)                        !! index of the disk, and its partner: see `partners`
    integer(int32) :: i

    pair = 0
    if (sim%tally%events == 0) return
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      if (pair(1) > 0) then
        associate (disk => sim%disk(i), latest => sim%disk(pair(1)))
          if (disk%clock < latest%clock) cycle
          if (.not. disk%clock > latest%clock .and. sim%tag(i)%id > sim%tag(pair(1))%id) cycle
        end associate
      end if
      pair(1) = i
    end do
    if (pair(1) == 0) return
    pair(2) = sim%tag(pair(1))%last_partner
    if (pair(2) > 0) pair(2) = findloc(sim%tag%id, pair(2), dim=1, kind=int32)
    if (pair(2) == 0) pair(2) = nearest_side(sim, pair(1))
  end function last_encounter

  !> Code of the side nearest to disk i at its clock, among those from which disks rebound.
  pure function nearest_side(sim, i) result(side)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    integer(int32) :: side, k
    real(real64) :: lower(2), upper(2), gap(n_sides) ! [length]

    call bounds(sim%box, sim%disk(i)%clock, lower, upper)
    gap([1, 3]) = sim%disk(i)%x - lower
    gap([2, 4]) = upper - sim%disk(i)%x
    where ([(is_passage(sim, 1 - k), k=1, n_sides)]) gap = never
    side = 1 - minloc(gap, dim=1, kind=int32)
  end function nearest_side

end module epochs
