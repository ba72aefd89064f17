!> When the origin of time moves, and when a collapse is looked for. Both follow from the state alone, so that all ways
!> to go on from it agree.
module epochs
  use kinds, only: int32, int64, never, pi, real64
  use renumbering, only: renumber
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: begin_first_epoch, last_time, move_epoch, put_check_off

  !> Pair collisions per disk after which the origin of time should move, so that times keep their digits.
  integer(int64), parameter :: epoch_length = 20
  integer, parameter :: significant_bits = 20      !! of an epoch: sums of epochs are exact
  !> Events between two checks for a collapse: at least these, and these per disk.
  integer(int64), parameter :: events_per_check = 2000, events_per_check_and_disk = 20
  real(real64), parameter :: last_time = 0.5_real64*never
  real(real64), parameter :: densest = 0.9_real64  !! packing fraction

contains

  !> Chooses the length of the first epoch by a guess at the rate of events, and the time that is too short for any
  !> disk to move visibly.
  pure subroutine begin_first_epoch(sim)
    type(simulation_t), intent(inout) :: sim
    real(real64) :: fastest, mean
    integer(int32) :: i

    mean = magnitude(sim%box%gravity)*minval(sim%disk%radius)
    fastest = mean
    do i = 1, sim%n_disks()
      associate (v => sim%disk(i)%v)
        mean = mean + dot_product(v, v)/sim%n_disks()
        fastest = max(fastest, dot_product(v, v))
      end associate
    end do
    sim%blink = 1.0e-9_real64*minval(sim%disk%radius)/sqrt(max(fastest, tiny(fastest)))
    call begin_epoch(sim, events_per_epoch(sim)/(sqrt(max(mean, tiny(mean)))*sim%n_disks()*events_per_path(sim)))
    call put_check_off(sim)
  end subroutine begin_first_epoch

  !> Events per disk and length of its path in a gas: with other disks, by the equation of state of Henderson, and with
  !> walls.
  pure function events_per_path(sim) result(rate)
    type(simulation_t), intent(in) :: sim
    real(real64) :: rate                           !! [1/length]
    real(real64) :: packing

    packing = min(pi*sum(sim%disk%radius**2)/product(sim%box%edges()), densest)
    rate = sqrt(2/pi)*packing*(1 - 7*packing/16)/(1 - packing)**2/(sum(sim%disk%radius)/sim%n_disks()) &
      + sum(1/sim%box%edges())
  end function events_per_path

  !> Events of any kind wanted between two epochs.
  pure function events_per_epoch(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = epoch_length*sim%n_disks()/2 + 100
  end function events_per_epoch

  !> An epoch of a given length begins now.
  pure subroutine begin_epoch(sim, length)
    type(simulation_t), intent(inout) :: sim
    real(real64), intent(in) :: length             !! [time]

    sim%epoch_begin = sim%now
    sim%epoch_end = min(sim%now + max(length, sim%blink), last_time)
    sim%epoch_events = sim%events
  end subroutine begin_epoch

  !> At the end of an epoch, moves the origin of time to about now, so that times stay small and keep their digits. As
  !> everything must be predicted again then, it also sorts the disks by cell. The next epoch ends at a time, not after a
  !> number of events, so that parts of a simulation that know nothing of each other agree on it.
  subroutine move_epoch(sim)
    type(simulation_t), intent(inout) :: sim
    real(real64) :: shift, length

    sim%now = max(sim%now, sim%epoch_end)
    length = (sim%epoch_end - sim%epoch_begin)*min(2.0_real64, &
      events_per_epoch(sim)/real(max(sim%events - sim%epoch_events, 1_int64), real64))
    shift = scale(aint(scale(fraction(sim%now), significant_bits)), exponent(sim%now) - significant_bits)
    call renumber(sim)
    sim%disk%clock = sim%disk%clock - shift
    sim%disk%stamp = 0
    sim%now = sim%now - shift
    sim%epoch = sim%epoch + shift
    call begin_epoch(sim, length)
    call put_check_off(sim)
  end subroutine move_epoch

  !> Looks for a collapse only if many events follow: an epoch of the usual length ends before.
  pure subroutine put_check_off(sim)
    type(simulation_t), intent(inout) :: sim

    sim%next_check = sim%events + check_interval(sim)
    sim%last_check = sim%now
  end subroutine put_check_off

  !> Events of any kind between two checks for a collapse.
  pure function check_interval(sim) result(n)
    type(simulation_t), intent(in) :: sim
    integer(int64) :: n

    n = max(events_per_check, events_per_check_and_disk*sim%n_disks())
  end function check_interval

end module epochs
