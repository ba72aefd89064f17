!> Dense random packings by Lubachevsky-Stillinger compression (Lubachevsky and Stillinger, 1990, doi:10.1007/BF01025983): the disks
!> start small, move as an elastic gas, and grow to their full size. In the original algorithm the disks grow continuously. In the
!> module `dense_growth` the disks grow in steps between short runs at constant size, so that the ordinary event-driven dynamics can
!> be used. In each step every disk grows into the gap between the disk and its neighbours. If initial positions are given, the
!> disks start at these positions with the largest size for which they do not overlap.
module dense_growth
  use kinds, only: int32, int64, never, pi, real64
  use box_geometry, only: box_t, obstacle_gap
  use disks, only: disks_before, species_by_id, species_t
  use errors, only: error_t, exit_usage, fail
  use event_driven, only: event_driven_t
  use evolution, only: limits_t
  use packing, only: packing_t
  use random_insertion, only: insert_at_random
  use random_stream, only: random_stream_t
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use texts, only: written
  use timeline, only: advance
  implicit none
  private
  public :: grow_disks, smallest_scale

  real(real64), parameter :: loose = 0.4_real64         !! packing fraction of the small disks that are inserted at random positions
  !> Largest ratio of the relative sizes of two disks during growth. The relative size of a disk is its radius divided by its full
  !> radius.
  real(real64), parameter :: lead = 1.02_real64
  real(real64), parameter :: caution = 0.9_real64       !! fraction of the available gap that a disk fills in one growth step
  real(real64), parameter :: smallest_scale = 1.0e-3_real64       !! smallest initial size, relative to the full size
  !> Number of growth steps with which disks at given positions reach the largest possible size; each step closes nine tenths of the
  !> remaining gaps.
  integer, parameter :: approaches = 6
  integer, parameter :: run_length = 2                  !! number of collisions per disk between two growth steps
  integer, parameter :: mixing_length = 10              !! number of collisions per disk after the growth
  !> Number of growth steps between two checks of the growth. The growth has failed if the amount by which the disks must still grow
  !> has decreased by less than a tenth since the previous check.
  integer, parameter :: jumps_per_check = 50

contains

  !> Finds positions for all disks of several species in a box.
  subroutine grow_disks(box, species, full, stream, line, x, error)
    type(box_t), intent(in) :: box                      !! box with its obstacles; its gravity and shear are ignored
    type(species_t), intent(in) :: species(:)
    real(real64), intent(in) :: full(:)                 !! (n) radii to be reached, in the order of species [length]
    type(random_stream_t), intent(inout) :: stream
    class(status_line_t), intent(inout) :: line         !! status line that shows the progress
    !> (2,n) positions of the disks, species by species [length]. The argument contains the initial positions, or has the shape
    !> (2,0) for random initial positions, and returns the final positions.
    real(real64), allocatable, intent(inout) :: x(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(simulation_t) :: sim                           ! elastic disks
    type(event_driven_t), allocatable :: evolution
    real(real64) :: missing_size, missing_before
    integer(int32) :: i
    integer :: jump

    sim%box = box
    sim%box%gravity = 0
    sim%box%shear_rate = 0
    sim%species = species
    allocate (sim%law%restitution(size(species), size(species)), source=1.0_real64)
    call sim%list_disks()
    if (size(x, 2) == 0) call insert_small_disks()
    if (size(x, 2) > 0) call start_at_positions()
    if (allocated(error)) return
    allocate (evolution)
    allocate (evolution%search)
    missing_before = 1
    jump = 0
    do
      call move(run_length)
      if (allocated(error)) return
      missing_size = 1 - minval(sim%disk%radius/full(sim%tag%id))
      if (missing_size <= 0) exit
      call line%show_share("growing disks to their full size", 1 - missing_size)
      jump = jump + 1
      if (modulo(jump, jumps_per_check) == 0) then
        if (missing_size > 0.9_real64*missing_before) then
          call fail_to_grow()
          return
        end if
        missing_before = missing_size
      end if
      call grow(min(1.0_real64, lead*(1 - missing_size)))
    end do
    call move(mixing_length)
    if (size(x, 2) == 0) x = reshape(x, [2, size(sim%disk)], pad=[0.0_real64])
    do i = 1, sim%n_disks()
      x(:, sim%tag(i)%id) = sim%disk(i)%x
    end do

  contains

    !> Reports that the growth has failed, with the packing fraction that was reached.
    subroutine fail_to_grow()
      real(real64) :: reached, wanted
      character(len=:), allocatable :: advice

      reached = pi*sum(sim%disk%radius**2)/product(sim%box%edges())
      wanted = pi*sum(full**2)/product(sim%box%edges())
      advice = "compress in steps: placement = 'grown'; or use fewer or smaller disks"
      if (maxval(full) <= minval(full)) advice = "placement = 'lattice' may pack equal disks more densely; or "//advice
      call fail(error, exit_usage, "dense placement reached "//written(reached)//" of the wanted packing " &
        //written(wanted)//"; "//advice)
    end subroutine fail_to_grow

    !> Starts the growth with disks at the given positions, with random velocities. The radii of all disks are reduced by
    !> the same factor: the largest factor at which no disks overlap.
    subroutine start_at_positions()
      real(real64) :: scale
      integer :: k

      do k = 1, size(x, 2)
        sim%disk(k)%x = x(:, k)
        call stream%draw_direction(sim%disk(k)%v)
      end do
      sim%disk%radius = smallest_scale*full
      do k = 1, approaches
        call grow(1.0_real64)
      end do
      scale = minval(sim%disk%radius/full)
      sim%disk%radius = scale*full
      if (scale <= smallest_scale) call fail_to_grow()
    end subroutine start_at_positions

    !> Starts the growth with small disks at random positions, with random velocities.
    subroutine insert_small_disks()
      type(packing_t) :: packing
      real(real64) :: scale, wanted
      logical :: complete
      integer :: k

      wanted = 0
      do k = 1, size(species)
        associate (own => full(disks_before(species, k) + 1:disks_before(species, k + 1)))
          ! If all radii are equal, every term of the sum is 1, and the sum is free of rounding errors.
          wanted = wanted + own(1)**2*sum((own/own(1))**2)
        end associate
      end do
      wanted = pi*wanted/product(sim%box%edges())
      scale = sqrt(min(1.0_real64, loose/wanted))
      do
        call fill(packing, scale*full, complete)
        if (complete) exit
        scale = caution*scale
        if (scale < smallest_scale) then
          call fail_to_grow()
          return
        end if
      end do
      do k = 1, size(sim%disk)
        sim%disk(k)%x = packing%disk(k)%x
        call stream%draw_direction(sim%disk(k)%v)
        sim%disk(k)%radius = scale*full(k)
      end do
    end subroutine insert_small_disks

    !> Inserts all disks at random positions, starting with the largest disks.
    subroutine fill(packing, radius, complete)
      type(packing_t), intent(out) :: packing
      real(real64), intent(in) :: radius(:)             !! (n) radius of each disk [length]
      logical, intent(out) :: complete
      logical :: waiting(size(species))
      real(real64) :: inset(2), largest(size(species))
      integer(int32) :: s, placed
      integer :: k

      packing = packing_t(sim%box, size(sim%disk), size(species))
      waiting = .true.
      largest = [(maxval(radius, mask=species_by_id(species) == k), k=1, size(species))]
      do k = 1, size(species)
        s = maxloc(largest, dim=1, mask=waiting)
        waiting(s) = .false.
        inset = merge(0.0_real64, largest(s), sim%box%periodic)
        call packing%open_species(s, largest(s), species(s)%count, sim%box%lower + inset, sim%box%upper - inset)
        call insert_at_random(packing, s, disks_before(species, s) + 1, &
          radius(disks_before(species, s) + 1:disks_before(species, s + 1)), stream, line, placed)
        complete = placed == species(s)%count
        if (.not. complete) return
      end do
    end subroutine fill

    !> Advances the simulation by a given number of collisions per disk and brings the positions of all disks to the present time.
    subroutine move(length)
      integer, intent(in) :: length                     !! collisions per disk
      type(limits_t) :: limits
      integer(int64) :: to_come                         ! number of collisions still to be executed, summed over the disks

      call evolution%start(sim)
      to_come = int(length, int64)*sim%n_disks()
      limits%collisions = sim%tally%collisions + (to_come + 1)/2
      limits%events = sim%tally%events + 4*to_come  ! the limit on events ends the run if a disk is trapped between obstacles
      limits%time = sim%time() + maxval(sim%box%edges())      ! the time limit ends the run if the disks never collide
      call advance(evolution, sim, limits, error)
      do i = 1, sim%n_disks()
        sim%disk(i)%x = sim%position(i)
        sim%disk(i)%clock = sim%now
        ! Growth may close the gap between a disk and its last partner; the two disks may then collide again
        sim%tag(i)%last_partner = 0
      end do
    end subroutine move

    !> Grows each disk into the gap between the disk and its neighbours, up to the relative size `cap`. Two neighbours share the
    !> distance between their centres in proportion to their full radii, unless one of the two disks is already larger than its
    !> share.
    subroutine grow(cap)
      real(real64), intent(in) :: cap                   !! largest allowed size, relative to the full size
      type(packing_t) :: packing
      real(real64), allocatable :: scale(:)
      real(real64) :: room, distance, shared
      integer(int32), allocatable :: list(:)
      integer(int32) :: k, n, s

      packing = packing_t(sim%box, size(sim%disk), size(species))
      do s = 1, size(species, kind=int32)
        call packing%open_species(s, maxval(full(sim%tag%id), mask=sim%tag%species == s), species(s)%count, &
          sim%box%lower, sim%box%upper)
      end do
      do i = 1, sim%n_disks()
        call packing%add(i, sim%tag(i)%species, sim%disk(i)%x, sim%disk(i)%radius)
      end do
      allocate (list(64))
      scale = sim%disk%radius/full(sim%tag%id)
      do i = 1, sim%n_disks()
        if (scale(i) >= cap) cycle
        associate (own => full(sim%tag(i)%id))
          call packing%list_neighbours(sim%disk(i)%x, own, list, n)
          room = min(1.0_real64, wall_distance(packing, sim%disk(i)%x)/own)
          do k = 1, n
            associate (j => list(k), other => full(sim%tag(list(k))%id))
              if (j == i) cycle
              distance = magnitude(packing%separation(sim%disk(i)%x, sim%disk(j)%x))
              shared = distance/(own + other)
              if (scale(j) > shared) shared = (distance - scale(j)*other)/own
              room = min(room, shared)
            end associate
          end do
          if (room >= 1) then
            sim%disk(i)%radius = cap*own
          else if (room > scale(i)) then
            sim%disk(i)%radius = own*min(cap, scale(i) + caution*(room - scale(i)))
          end if
        end associate
      end do
    end subroutine grow
  end subroutine grow_disks

  !> Distance from a point to the nearest side or obstacle. Obstacles at distances larger than the largest radius of a disk may be
  !> ignored, because such obstacles do not limit the growth of a disk.
  pure function wall_distance(packing, x) result(distance)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: x(2)                    !! [length]
    real(real64) :: distance
    integer(int32) :: e

    associate (box => packing%box, near => packing%near)
      distance = min(never, minval([x - box%lower, box%upper - x], mask=.not. [box%periodic, box%periodic]))
      e = near%first_near(x)
      do while (e > 0)
        distance = min(distance, obstacle_gap(box, near%entry(e)%obstacle, x, 0.0_real64))
        e = near%entry(e)%next
      end do
    end associate
  end function wall_distance

end module dense_growth
