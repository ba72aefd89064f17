!> Divides a run into epochs. At the end of an epoch the time origin moves. This time depends only
!> on the state of the simulation, not on the search, the queue or the number of threads.
module epochs
  use box_state, only: separate_from_sides
  use kinds, only: int32, int64, never, pi, real64
  use renumbering, only: renumber
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: are_crushed, begin_first_epoch, ends_by_event, ends_by_kick, last_time, most_events, move_epoch, restart_epoch

  !> Intended number of collisions per disk in an epoch. Moving the time origin at the end of each
  !> epoch preserves the precision of times.
  integer(int64), parameter :: epoch_length = 24
  !> Number of significant bits in a shift of the time origin. With so few bits, shifts can be added
  !> without rounding errors.
  integer, parameter :: significant_bits = 20
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
    sim%box%piston%clock = sim%box%piston%clock - shift
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

end module epochs
