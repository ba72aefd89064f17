!> The state of a simulation as a record, for checkpoints.
module state_record
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int128, int32, int64, real64
  use changes, only: text_of_change
  use exact_sums, only: exact_sum_t
  use hdf5_objects, only: hdf5_file_t
  use partners, only: n_sides
  use record, only: checksum, reading, record_t
  use sampling_schedule, only: progress_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: exchange_all, layout

  !> Version of the checkpoint layout; checkpoints of other versions cannot be read.
  integer, parameter :: layout = 12

contains

  !> Counts, writes or reads the numbers of a checkpoint. Before a checkpoint is read, the box and
  !> the species of the simulation must be set.
  subroutine exchange_all(file, record, sim, progress)
    type(hdf5_file_t), intent(inout) :: file      !! not used when the numbers are only counted
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout) :: sim
    type(progress_t), intent(inout) :: progress
    integer(int64) :: settled
    real(real64) :: offset(n_sides)      ! displacements of the sides when their motions began [length]
    integer :: k

    call exchange_changes(file, record, sim)
    call record%exchange(file, sim%box%epoch)
    call record%exchange(file, sim%now)
    settled = merge(1, 0, sim%events_done)
    call record%exchange(file, settled)
    sim%events_done = settled == 1
    call record%exchange(file, sim%epoch_begin)
    call record%exchange(file, sim%epoch_end)
    call record%exchange(file, sim%epoch_events)
    call record%exchange(file, sim%negligible_time)
    call record%exchange(file, sim%last_advance)
    call record%exchange(file, sim%events_then)
    call record%exchange(file, sim%start_energy)
    call record%exchange(file, sim%reference_energy)
    call record%exchange(file, sim%typical_speed2)
    call record%exchange(file, sim%n_kicks)
    if (allocated(sim%drive_count)) call record%exchange(file, sim%drive_count)
    call record%exchange(file, sim%changes)
    call exchange_tally(file, record, sim)
    if (allocated(sim%waits)) call exchange_waiting(file, record, sim)
    call record%exchange(file, sim%box%piston%clock)
    call record%exchange(file, sim%box%piston%position)
    call record%exchange(file, sim%box%piston%velocity)
    offset = sim%box%side%offset()
    call record%exchange(file, offset)
    call sim%box%side%place(offset)
    call exchange_disks(file, record, sim)
    do k = 1, size(progress%schedule)
      ! The times of the next samples are not stored, because they follow from the sampling
      ! intervals in the input.
      associate (schedule => progress%schedule(k))
        call record%exchange(file, schedule%count)
        call record%exchange(file, schedule%last_events)
        call record%exchange(file, schedule%last_time)
      end associate
    end do
    call record%exchange(file, progress%events)
    call record%seal(file)
  end subroutine exchange_all

  !> Counts, writes or reads the number of scheduled changes made so far, and a checksum of these
  !> changes. When reading, the procedure also brings the system to its state after the changes. If
  !> the checksum shows that the input contains different changes, `changes_made` is set to -1.
  subroutine exchange_changes(file, record, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout) :: sim
    integer(int64) :: made, identity, there
    character(len=:), allocatable :: text
    integer :: i

    made = sim%changes_made
    call record%exchange(file, made)
    text = ""
    if (allocated(sim%schedule)) then
      do i = 1, int(min(made, size(sim%schedule, kind=int64)))
        text = text//text_of_change(sim%schedule(i))
      end do
    end if
    identity = transfer(checksum(transfer(text, [0_int8])), identity)
    there = identity
    call record%exchange(file, there)
    if (record%mode /= reading .or. made == 0) return
    sim%changes_made = -1
    if (there /= identity) return
    sim%changes_made = made
    sim%system_t = sim%schedule(made)%system
    call sim%box%specify(sim%schedule(made)%box)
  end subroutine exchange_changes

  !> Counts, writes or reads the sums and counters over all events.
  subroutine exchange_tally(file, record, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout) :: sim
    integer :: k

    call sim%tally%make_room(size(sim%box%surface))
    associate (tally => sim%tally)
      call record%exchange(file, tally%events)
      call record%exchange(file, tally%collisions)
      call record%exchange(file, tally%simultaneous)
      call record%exchange(file, tally%series)
      call record%exchange(file, tally%collapse)
      call exchange_sums(file, record, tally%sum)
      call record%exchange(file, tally%surface_collisions)
      do k = 1, size(tally%surface_sums, 1)
        call exchange_sums(file, record, tally%surface_sums(k, :))
      end do
    end associate
  end subroutine exchange_tally

  !> Counts, writes or reads the list of disks waiting outside the box, and the counters and sums of
  !> departures and entries.
  subroutine exchange_waiting(file, record, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout) :: sim
    integer(int64) :: waits(size(sim%waits))

    waits = merge(1, 0, sim%waits)
    call record%exchange(file, waits)
    sim%waits = waits == 1
    call record%exchange(file, sim%source_time)
    call record%exchange(file, sim%tally%inside)
    call record%exchange(file, sim%tally%entered)
    call record%exchange(file, sim%tally%left)
    call exchange_sums(file, record, sim%tally%flow)
  end subroutine exchange_waiting

  !> Counts, writes or reads 128-bit integers, which represent exact sums.
  subroutine exchange_sums(file, record, sums)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    type(exact_sum_t), intent(inout) :: sums(:)
    integer(int128), target :: parts(2*size(sums))

    parts = [sums%units, sums%rare]
    call record%pass(file, c_loc(parts), 2*size(parts))
    sums%units = parts(:size(sums))
    sums%rare = parts(size(sums) + 1:)
  end subroutine exchange_sums

  !> Counts, writes or reads the state of the disks.
  subroutine exchange_disks(file, record, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    type(simulation_t), intent(inout), target :: sim
    integer(int64) :: settled
    real(real64), allocatable :: mass(:)
    integer :: k

    associate (disk => sim%disk, tag => sim%tag)
      call record%exchange(file, disk%x(1))
      call record%exchange(file, disk%x(2))
      call record%exchange(file, disk%v(1))
      call record%exchange(file, disk%v(2))
      call record%exchange(file, disk%clock)
      call exchange_short(file, record, tag%species)
      call exchange_short(file, record, tag%id)
      call record%exchange(file, tag%collisions)
      call exchange_short(file, record, tag%last_partner)
      ! Without individual masses and radii, no radii are stored, because the input contains the
      ! radius of each species.
      if (sim%features%own_sizes) call record%exchange(file, disk%radius)
    end associate
    settled = merge(1, 0, sim%events_done)
    do k = 1, merge(1, 0, sim%features%rotation) + merge(2, 0, sim%features%orientation)
      ! `settled` is copied several times, so that the length of the record depends on whether the
      ! run has rotation and orientation. A checkpoint of a run with different features is then
      ! detected.
      call record%exchange(file, settled)
    end do
    if (allocated(sim%series)) call record%pass(file, c_loc(sim%series(1)), size(sim%series)*storage_size(sim%series)/64)
    if (allocated(sim%extra)) call record%pass(file, c_loc(sim%extra(1)), size(sim%extra)*storage_size(sim%extra)/64)
    if (.not. sim%features%own_sizes) return
    mass = sim%masses()      ! also if all masses equal the mass of the species
    call record%exchange(file, mass)
    if (record%mode == reading) sim%own_mass = mass
  end subroutine exchange_disks

  !> Counts, writes or reads 32-bit integers.
  subroutine exchange_short(file, record, values)
    type(hdf5_file_t), intent(inout) :: file
    type(record_t), intent(inout) :: record
    integer(int32), intent(inout) :: values(:)
    integer(int64) :: words(size(values))

    words = values
    call record%exchange(file, words)
    values = int(words, int32)
  end subroutine exchange_short

end module state_record
