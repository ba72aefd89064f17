!> Entry of waiting disks into the box through sources. The random numbers of an entry depend only
!> on the seed, the source, the id of the disk, and the number of intervals of the source since the
!> start of the run.
module entries
  use kinds, only: int32, int64, never, real64
  use encounters, only: energy_of
  use fields, only: fields_t
  use box_geometry, only: box_t
  use disks, only: list_by_id, source_t
  use free_positions, only: check_cover, check_region, check_room, find_position, present_packing
  use packing, only: packing_t
  use random_stream, only: entering_disks, key_of_draws, random_stream_t
  use simulation_state, only: simulation_t
  use tally, only: inflow
  implicit none
  private
  public :: awaits_entry, check_source, entry_time, let_disks_enter

contains

  !> Checks the region of a source.
  subroutine check_source(source, fields, box, radius)
    type(source_t), intent(in) :: source
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius                       !! largest radius of the species [length]
    logical :: sound

    call check_region(fields, "region", source%region, box, sound)
    if (sound) call check_room(fields, "region", source%region, box, radius)
    if (sound) call check_cover(fields, "region", source%region, box)
  end subroutine check_source

  !> Time when source s acts next. The result is `never` if no disk of the species is waiting, or if
  !> the source ends earlier.
  pure function entry_time(sim, s) result(t)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: s                                 !! index of the source
    real(real64) :: t                                        !! time since the start of the run [time]
    integer(int64) :: k

    t = never
    associate (source => sim%source(s))
      if (sim%tally%inside(source%species) >= sim%species(source%species)%count) return
      k = source%next_multiple(sim%source_time(s))
      if (k > 0) t = k*source%interval
    end associate
  end function entry_time

  !> True if any source can still let a disk enter.
  pure function awaits_entry(sim) result(yes)
    type(simulation_t), intent(in) :: sim
    logical :: yes
    integer :: s

    yes = .false.
    if (.not. allocated(sim%source)) return
    do s = 1, size(sim%source)
      yes = yes .or. entry_time(sim, s) < never
    end do
  end function awaits_entry

  !> Lets disks enter through source s at its next time. The waiting disks are tried in the order of
  !> their ids, until the number of disks that have found a free position reaches the maximum for
  !> this source.
  subroutine let_disks_enter(sim, s, entered)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: s                                 !! index of the source
    integer(int32), allocatable, intent(out) :: entered(:)   !! indices of the disks that entered
    type(packing_t) :: packing
    type(random_stream_t) :: stream
    integer(int32), allocatable :: waiting(:)                ! indices of the waiting disks
    real(real64) :: x(2)                                     ! [length]
    integer(int64) :: k, key
    integer(int32) :: j, n
    logical :: free

    associate (source => sim%source(s))
      k = source%next_multiple(sim%source_time(s))
      sim%source_time(s) = k*source%interval
      call list_by_id(sim%tag, [(sim%tag(j)%species == source%species .and. .not. sim%is_inside(j), j=1, sim%n_disks())], waiting)
      allocate (entered(size(waiting)))
      n = 0
      packing = present_packing(sim, source%region, min(size(waiting), source%count))
      key = key_of_draws(key_of_draws(sim%seed, entering_disks), s)
      do j = 1, size(waiting, kind=int32)
        if (n == source%count) exit
        associate (i => waiting(j))
          call stream%seed_disk(key, sim%tag(i)%id, k)
          call find_position(source%region, sim, packing, sim%disk(i)%radius, stream, x, free)
          if (.not. free) cycle
          call enter(sim, source, i, x, stream)
          n = n + 1
          entered(n) = i
          call packing%add(sim%n_disks() + n, int(sim%tag(i)%species, int32), x, sim%disk(i)%radius)
        end associate
      end do
      sim%tally%entered(s) = sim%tally%entered(s) + n
    end associate
    entered = entered(:n)
  end subroutine let_disks_enter

  !> Lets disk i enter at a free position. The disk receives either the velocity of the source and
  !> no rotation, or a velocity and rotation from the Maxwell distribution. The orientation of the
  !> disk is kept.
  subroutine enter(sim, source, i, x, stream)
    type(simulation_t), intent(inout) :: sim
    type(source_t), intent(in) :: source
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: x(2)                         !! [length]
    type(random_stream_t), intent(inout) :: stream
    real(real64) :: normals(2)

    associate (disk => sim%disk(i), species => sim%tag(i)%species)
      disk%x = x
      disk%v = source%velocity
      disk%clock = sim%now
      disk%collision_counter = disk%collision_counter + 1
      if (allocated(sim%extra)) sim%extra(i)%last_contact = -never
      if (source%temperature > 0) then
        call stream%draw_normals(normals)
        disk%v = sqrt(source%temperature/sim%mass_of(i))*normals
      end if
      if (source%temperature > 0 .and. sim%features%rotation) then
        call stream%draw_normals(normals)
        sim%extra(i)%spin = sqrt(source%temperature/sim%inertia_of(i))*normals(1)
      end if
      sim%waits(sim%tag(i)%id) = .false.
      sim%tally%inside(species) = sim%tally%inside(species) + 1
      call sim%tally%flow(inflow)%add(energy_of(sim, i))
    end associate
  end subroutine enter

end module entries
