!> Dense random packings by Lubachevsky-Stillinger compression (Lubachevsky and Stillinger, 1990,
!> doi:10.1007/BF01025983): initially small disks move as an elastic gas and grow to their full
!> size. The original algorithm grows the disks continuously. Here, the disks move in short runs of
!> event-driven dynamics at constant size. These runs alternate with growth steps, in which every
!> disk grows into the gap between it and its neighbours. If initial positions are given, the disks
!> start there with the largest size at which they do not overlap.
module dense_growth
  use kinds, only: int32, int64, never, pi, real64
  use box_geometry, only: box_t, obstacle_gap
  use box_state, only: box_state_t
  use contact_law, only: elastic_contacts
  use disks, only: disks_before, species_by_id, species_t
  use errors, only: error_t, exit_usage, fail
  use event_driven, only: event_driven_t
  use evolution, only: limits_t
  use packing, only: packing_t
  use partners, only: obstacle_number
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

  real(real64), parameter :: loose = 0.4_real64      !! packing fraction of the small disks inserted at random
  !> Maximum ratio of the relative sizes of two disks during growth. The relative size of a disk is
  !> its radius divided by its full radius.
  real(real64), parameter :: lead = 1.02_real64
  !> Fraction of the available gap that is filled in a growth step.
  real(real64), parameter :: caution = 0.9_real64
  !> Minimum initial size, relative to the full size.
  real(real64), parameter :: smallest_scale = 1.0e-3_real64
  !> Number of initial growth steps of disks at given positions. Each step closes nine tenths of the
  !> remaining gaps, so that the disks reach the largest possible size.
  integer, parameter :: approaches = 6
  integer, parameter :: run_length = 2                  !! collisions per disk between two growth steps
  integer, parameter :: mixing_length = 10              !! collisions per disk after the growth
  !> Number of growth steps between two checks of the progress. The growth has failed if less than a
  !> tenth of the remaining growth was achieved since the previous check.
  integer, parameter :: jumps_per_check = 50

  !> Growing elastic disks.
  type :: growth_t
    type(simulation_t) :: sim
    type(event_driven_t), allocatable :: evolution
    real(real64), allocatable :: full(:)                !! final radii, in the order of the species [length]
    type(random_stream_t) :: stream
    type(error_t), allocatable :: error
  contains
    procedure :: start_at_positions
    procedure :: insert_small_disks
    procedure :: fill
    procedure :: grow_to_full_size
    procedure :: move
    procedure :: grow
    procedure :: fail_to_grow
  end type growth_t

contains

  !> Generates a dense packing of the disks of several species in a box.
  subroutine grow_disks(box, species, full, stream, line, x, error)
    type(box_t), intent(in) :: box      !! box with its obstacles; gravity and shear are ignored
    type(species_t), intent(in) :: species(:)
    real(real64), intent(in) :: full(:)                 !! final radii, in the order of the species [length]
    type(random_stream_t), intent(inout) :: stream
    class(status_line_t), intent(inout) :: line         !! status line for the progress
    !> Positions of the disks, species by species; shape (2, n) [length]. On entry, the initial
    !> positions, or shape (2,0) for random positions; on return, the final positions.
    real(real64), allocatable, intent(inout) :: x(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(growth_t) :: growth
    integer(int32) :: i

    growth%full = full
    growth%stream = stream
    associate (sim => growth%sim)
      sim%box = box_state_t(box)
      sim%box%gravity = 0
      sim%box%shear_rate = 0
      sim%species = species
      sim%law = elastic_contacts(size(species))
      call sim%list_disks()
    end associate
    if (size(x, 2) == 0) call growth%insert_small_disks(line)
    if (size(x, 2) > 0) call growth%start_at_positions(x)
    if (.not. allocated(growth%error)) call growth%grow_to_full_size(line)
    if (.not. allocated(growth%error)) call growth%move(mixing_length)
    stream = growth%stream
    call move_alloc(growth%error, error)
    if (allocated(error)) return
    associate (sim => growth%sim)
      if (size(x, 2) == 0) x = reshape(x, [2, size(sim%disk)], pad=[0.0_real64])
      do i = 1, sim%n_disks()
        x(:, sim%tag(i)%id) = sim%disk(i)%x
      end do
    end associate
  end subroutine grow_disks

  !> Alternately moves and grows the disks until they have their full radii.
  subroutine grow_to_full_size(self, line)
    class(growth_t), intent(inout) :: self
    class(status_line_t), intent(inout) :: line
    real(real64) :: missing_size, missing_before
    integer :: jump

    allocate (self%evolution)
    allocate (self%evolution%search)
    missing_before = 1
    jump = 0
    do
      call self%move(run_length)
      if (allocated(self%error)) return
      associate (sim => self%sim)
        missing_size = 1 - minval(sim%disk%radius/self%full(sim%tag%id))
      end associate
      if (missing_size <= 0) return
      call line%show_share("growing disks to their full size", 1 - missing_size)
      jump = jump + 1
      if (modulo(jump, jumps_per_check) == 0) then
        if (missing_size > 0.9_real64*missing_before) then
          call self%fail_to_grow()
          return
        end if
        missing_before = missing_size
      end if
      call self%grow(min(1.0_real64, lead*(1 - missing_size)))
    end do
  end subroutine grow_to_full_size

  !> Reports that the growth failed, and which packing fraction was reached.
  subroutine fail_to_grow(self)
    class(growth_t), intent(inout) :: self
    real(real64) :: reached, wanted
    character(len=:), allocatable :: advice

    reached = pi*sum(self%sim%disk%radius**2)/product(self%sim%box%edges())
    wanted = pi*sum(self%full**2)/product(self%sim%box%edges())
    advice = "compress in steps: placement = 'grown'; or use fewer or smaller disks"
    if (maxval(self%full) <= minval(self%full)) &
      advice = "placement = 'lattice' may pack equal disks more densely; or "//advice
    call fail(self%error, exit_usage, "dense placement reached "//written(reached)//" of the wanted packing " &
      //written(wanted)//"; "//advice)
  end subroutine fail_to_grow

  !> Starts with disks at the given positions and with random velocities. All radii are reduced by
  !> the same factor, just enough to remove all overlaps.
  subroutine start_at_positions(self, x)
    class(growth_t), intent(inout) :: self
    real(real64), intent(in) :: x(:, :)                 !! shape (2, n) [length]
    real(real64) :: scale
    integer :: k

    do k = 1, size(x, 2)
      self%sim%disk(k)%x = x(:, k)
      call self%stream%draw_direction(self%sim%disk(k)%v)
    end do
    self%sim%disk%radius = smallest_scale*self%full
    do k = 1, approaches
      call self%grow(1.0_real64)
    end do
    scale = minval(self%sim%disk%radius/self%full)
    self%sim%disk%radius = scale*self%full
    if (scale <= smallest_scale) call self%fail_to_grow()
  end subroutine start_at_positions

  !> Starts with small disks at random positions and with random velocities.
  subroutine insert_small_disks(self, line)
    class(growth_t), intent(inout) :: self
    class(status_line_t), intent(inout) :: line
    type(packing_t) :: packing
    real(real64) :: scale, wanted
    logical :: complete
    integer :: k

    wanted = 0
    do k = 1, size(self%sim%species)
      associate (own => self%full(disks_before(self%sim%species, k) + 1:disks_before(self%sim%species, k + 1)))
        ! For equal radii every term of the sum is 1, so that the sum is free of rounding errors.
        wanted = wanted + own(1)**2*sum((own/own(1))**2)
      end associate
    end do
    wanted = pi*wanted/product(self%sim%box%edges())
    scale = sqrt(min(1.0_real64, loose/wanted))
    do
      call self%fill(packing, scale*self%full, line, complete)
      if (complete) exit
      scale = caution*scale
      if (scale < smallest_scale) then
        call self%fail_to_grow()
        return
      end if
    end do
    do k = 1, size(self%sim%disk)
      self%sim%disk(k)%x = packing%disk(k)%x
      call self%stream%draw_direction(self%sim%disk(k)%v)
      self%sim%disk(k)%radius = scale*self%full(k)
    end do
  end subroutine insert_small_disks

  !> Inserts all disks at random positions, in the order of decreasing size.
  subroutine fill(self, packing, radius, line, complete)
    class(growth_t), intent(inout) :: self
    type(packing_t), intent(out) :: packing
    real(real64), intent(in) :: radius(:)               !! radius of each disk [length]
    class(status_line_t), intent(inout) :: line
    logical, intent(out) :: complete
    logical :: waiting(size(self%sim%species))
    real(real64) :: inset(2), largest(size(self%sim%species))
    integer(int32) :: s, placed
    integer :: k

    associate (box => self%sim%box, species => self%sim%species)
      packing = packing_t(box, size(radius), size(species))
      waiting = .true.
      largest = [(maxval(radius, mask=species_by_id(species) == k), k=1, size(species))]
      do k = 1, size(species)
        s = maxloc(largest, dim=1, mask=waiting)
        waiting(s) = .false.
        inset = merge(0.0_real64, largest(s), box%periodic)
        call packing%open_species(s, largest(s), species(s)%count, box%lower + inset, box%upper - inset)
        call insert_at_random(packing, s, disks_before(species, s) + 1, &
          radius(disks_before(species, s) + 1:disks_before(species, s + 1)), self%stream, line, placed)
        complete = placed == species(s)%count
        if (.not. complete) return
      end do
    end associate
  end subroutine fill

  !> Advances the simulation by a number of collisions per disk, then advances all disks to the
  !> present time.
  subroutine move(self, length)
    class(growth_t), intent(inout) :: self
    integer, intent(in) :: length                       !! number of collisions per disk
    type(limits_t) :: limits
    integer(int64) :: to_come                           ! remaining collisions, summed over the disks
    integer(int32) :: i

    associate (sim => self%sim)
      call self%evolution%start(sim)
      to_come = int(length, int64)*sim%n_disks()
      limits%collisions = sim%tally%collisions + (to_come + 1)/2
      limits%events = sim%tally%events + 4*to_come      ! ends the run if a disk is trapped between obstacles
      limits%time = sim%time() + maxval(sim%box%edges())          ! ends the run if the disks never collide
      call advance(self%evolution, sim, limits, self%error)
      do i = 1, sim%n_disks()
        sim%disk(i)%x = sim%position(i)
        sim%disk(i)%clock = sim%now
        ! Growth may close the gap between a disk and its last partner; the two may then collide
        ! again.
        sim%tag(i)%last_partner = 0
      end do
    end associate
  end subroutine move

  !> Grows each disk into the gap between it and its neighbours, up to the relative size `cap`.
  !> Neighbours share the distance between their centres in proportion to their full radii, unless
  !> one of the two already exceeds its share.
  subroutine grow(self, cap)
    class(growth_t), intent(inout) :: self
    real(real64), intent(in) :: cap                     !! maximum size, relative to the full size
    type(packing_t) :: packing
    real(real64), allocatable :: full(:), scale(:)      ! full radius [length] and relative size of each disk
    real(real64) :: room, distance, shared
    integer(int32), allocatable :: list(:)
    integer(int32) :: i, k, n

    associate (sim => self%sim)
      allocate (full(sim%n_disks()))
      full(:) = self%full(sim%tag%id)
      packing = packing_t(sim%box, size(sim%disk), size(sim%species))
      call packing%open_all_species(sim%tag%species, full, sim%box%lower, sim%box%upper)
      do i = 1, sim%n_disks()
        call packing%add(i, sim%tag(i)%species, sim%disk(i)%x, sim%disk(i)%radius)
      end do
      allocate (list(64))
      scale = sim%disk%radius/full
      do i = 1, sim%n_disks()
        if (scale(i) >= cap) cycle
        call packing%list_neighbours(sim%disk(i)%x, full(i), list, n)
        room = min(1.0_real64, wall_distance(packing, sim%disk(i)%x)/full(i))
        do k = 1, n
          associate (j => list(k), other => full(list(k)))
            if (j == i) cycle
            distance = magnitude(packing%separation(sim%disk(i)%x, sim%disk(j)%x))
            shared = distance/(full(i) + other)
            if (scale(j) > shared) shared = (distance - scale(j)*other)/full(i)
            room = min(room, shared)
          end associate
        end do
        if (room >= 1) then
          sim%disk(i)%radius = cap*full(i)
        else if (room > scale(i)) then
          sim%disk(i)%radius = full(i)*min(cap, scale(i) + caution*(room - scale(i)))
        end if
      end do
    end associate
  end subroutine grow

  !> Distance from a point to the nearest side or obstacle. Obstacles farther away than the largest
  !> radius may be ignored, because they do not limit the growth.
  pure function wall_distance(packing, x) result(distance)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: x(2)                    !! [length]
    real(real64) :: distance
    integer(int32) :: e

    associate (box => packing%box, near => packing%near)
      distance = min(never, minval([x - box%lower, box%upper - x], mask=.not. [box%periodic, box%periodic]))
      e = near%first_near(x)
      do while (e > 0)
        distance = min(distance, obstacle_gap(box%box_t, obstacle_number(near%entry(e)%code), x, 0.0_real64))
        e = near%entry(e)%next
      end do
    end associate
  end function wall_distance

end module dense_growth
