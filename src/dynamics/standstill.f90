!> Messages about events that no longer advance the time, and about inelastic collapses, with a
!> remedy.
module standstill
  use box_geometry, only: wall_normal
  use encounters, only: encounter_text
  use errors, only: error_t, exit_broken, fail
  use evolution, only: limits_t
  use kinds, only: int32, int64, real64
  use partners, only: is_side, obstacle_number
  use rest, only: disk_on_side, is_at_rest, last_encounter
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  use texts, only: about, counted, written
  implicit none
  private
  public :: collapse_note, fail_at_standstill, report_rest

contains

  !> Reports that events no longer advance the time.
  subroutine fail_at_standstill(sim, last, error)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: last(2)            !! index of a disk, and its partner; see `partners`
    type(error_t), allocatable, intent(out) :: error

    call fail(error, exit_broken, standstill_text(sim, last(1), last(2)))
  end subroutine fail_at_standstill

  !> Called when a run has reached its number of events or collisions. Reports whether time would
  !> stop advancing if the run continued. Time stops if all disks are at rest or one disk rests on a
  !> side. The report depends on the state alone, because a run resumed at its limit predicts no
  !> events.
  subroutine report_rest(sim, limits, error)
    type(simulation_t), intent(in) :: sim
    type(limits_t), intent(in) :: limits
    type(error_t), allocatable, intent(inout) :: error
    integer(int32) :: last(2)                        ! disk that no longer advances, and its partner

    if (allocated(error) .or. .not. (sim%epoch_end > 0 .and. limits%reached(sim%tally) .and. sim%box%has_gravity())) return
    if (sim%n_inside() == 0 .or. sim%tally%has_at_most(limits%disks_inside)) return
    if (.not. is_at_rest(sim)) then
      last = disk_on_side(sim)
    else if (limits%at_rest) then
      return
    else
      last = last_encounter(sim)
    end if
    if (last(1) > 0) call fail_at_standstill(sim, last, error)
  end subroutine report_rest

  !> Message that explains why events of disk i with its partner no longer advance the time, and
  !> suggests a remedy.
  pure function standstill_text(sim, i, code) result(text)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code      !! index of the disk and code of its partner; see `partners`
    character(len=:), allocatable :: text
    character(len=*), parameter :: steps = "or use run.dynamics = 'steps'"
    logical :: from_the_start

    text = "time no longer advances: "//encounter_text(sim, i, code)
    from_the_start = .not. sim%time() > sim%negligible_time
    if (slides(sim, i, code) .and. (from_the_start .or. .not. may_lose(sim, i, code))) then
      text = text//"; the disk slides along a concave obstacle, in an unbounded number of collisions: start it with a gap to " &
        //"the obstacle, "//steps
      return
    end if
    text = "inelastic collapse, "//text
    if (from_the_start .and. code <= 0 .and. sim%box%has_gravity()) then
      text = text//"; a disk that starts at rest on a wall never leaves it: start it higher, "//steps
      return
    end if
    text = text//"; "//longer_contacts(sim)
    if (may_lose(sim, i, code)) text = text//", or raise " &
      //trim(merge("contact.restitution     ", "contact.wall_restitution", code > 0))
    if (is_at_rest(sim)) text = text//"; stop.at_rest = .true. ends a run where all disks have come to rest"
  end function standstill_text

  !> True if an event of disk i with the given partner can dissipate energy.
  pure function may_lose(sim, i, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code
    logical :: yes

    if (code > 0) then
      associate (law => sim%law%between(sim%tag(i)%species, sim%tag(code)%species))
        yes = law%is_inelastic()
      end associate
    else
      yes = sim%box%surface(sim%box%surface_of(code))%law%is_inelastic()
    end if
  end function may_lose

  !> True if disk i slides along an obstacle that is concave towards the disk.
  pure function slides(sim, i, code) result(yes)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, code
    logical :: yes
    ! maximum ratio of normal velocity to speed for a sliding disk
    real(real64), parameter :: grazing = 1.0e-6_real64
    real(real64) :: x(2), v(2), normal(2)

    yes = .false.
    if (code > 0 .or. is_side(code)) return
    x = sim%position(i)
    v = sim%velocity(i)
    normal = wall_normal(sim%box%box_t, code, x, v)
    associate (shape => sim%box%obstacle(obstacle_number(code))%shape)
      yes = abs(dot_product(v, normal)) < grazing*magnitude(v) .and. shape%is_concave_at(shape%from_nearest(x, sim%box%images()))
    end associate
  end function slides

  !> Report about the inelastic collapses in a run; empty if no collapse occurred.
  pure function collapse_note(sim) result(text)
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text

    text = ""
    if (sim%has_collapsed()) text = "an inelastic collapse occurred: " &
      //counted(sim%tally%simultaneous, "collision")//" took no time, the first collapse at time "//written(sim%tally%collapse) &
      //"; the motion after it depends on rounding errors; "//longer_contacts(sim)
  end function collapse_note

  !> Advice to set a contact duration much longer than the times in a collapse and much shorter than
  !> the mean time between collisions. A suitable value is proposed unless the present one is long
  !> enough.
  pure function longer_contacts(sim) result(text)
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: text
    real(real64), parameter :: share = 0.01_real64, negligible_times = 1.0e5_real64
    integer(int64) :: contacts                     ! number of collisions, summed over all disks
    real(real64) :: proposal                       ! proposed contact duration [time]

    contacts = sim%tally%events + sim%tally%collisions - 2*sim%tally%simultaneous
    proposal = max(share*sim%time()*sim%n_disks()/max(contacts, 1_int64), negligible_times*sim%negligible_time)
    if (sim%law%contact_time >= proposal) then
      text = "contact.contact_time is already long: use run.dynamics = 'steps'"
      return
    end if
    text = trim(merge("raise", "set  ", sim%law%contact_time > 0))//" contact.contact_time (TC model), for example to " &
      //about(proposal)//", well below the mean time between collisions"
  end function longer_contacts

end module standstill
