!> Tests whether all disks are at rest, or whether time has stopped although events go on, as in an
!> inelastic collapse. The results depend only on the state of the simulation, not on the search,
!> the queue or the number of threads.
module rest
  use box_state, only: bounds, next_side
  use encounters, only: is_passage
  use epochs, only: most_events
  use kinds, only: int32, int64, never, real64
  use partners, only: axis_of, n_sides, sense_of
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: disk_on_side, has_come_to_rest, is_at_rest, last_encounter, stands_still, stays_at_rest

  !> A collapse is reported if time does not advance during at least `collapse_length` events, and
  !> at least `collapse_length_per_disk` events per disk.
  integer(int64), parameter :: collapse_length = 20000, collapse_length_per_disk = 20

contains

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

  !> True if all disks are at rest, and nothing can set them in motion: no gravity, shear, moving
  !> side, driving, source or scheduled change.
  pure function stays_at_rest(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .not. (sim%box%has_gravity() .or. sim%box%is_sheared() .or. any(sim%box%side%moves()) .or. allocated(sim%drive) &
      .or. allocated(sim%source) .or. allocated(sim%schedule))
    if (yes) yes = is_at_rest(sim)
  end function stays_at_rest

  !> Finds a disk that rests on a side while other disks move. Its last event and its next bounce on
  !> a dissipative side are both within `negligible_time` of now. Such bounces are lower than the
  !> spacing of the coordinates, so they cannot be resolved: they converge, and time stops
  !> advancing. Returns the disk with the lowest id and its side, or 0. The next bounce is computed
  !> here. The stored event of the disk cannot be used, because it depends on the search, and the
  !> parallel engine may not have predicted any.
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

end module rest
