!> Determines the initial positions of all disks.
!>
!> Species whose positions are fixed (placement 'explicit', 'file', 'grid' or 'lattice') are placed first, in the order of the
!> input. Species with placement 'random' are placed next, the species with the largest disks first. Species with placement 'dense'
!> or 'grown' are placed last. All 'dense' and 'grown' species with the same region are compressed together, and disks that were
!> placed earlier are fixed obstacles during the compression. If one species has placement 'relaxed', all species must have this
!> placement. The disks of all 'relaxed' species are placed together, by compression or on a lattice, and equilibrated by event
!> chains.
module placement
  use images, only: images_t
  use kinds, only: int32, int64, pi, real64
  use box_geometry, only: box_t
  use box_sides, only: bounds, centre_range, spans
  use circles, only: new_circle
  use dense_growth, only: grow_disks, smallest_scale
  use disks, only: disks_before
  use errors, only: error_t
  use event_chains, only: relax, shuffle
  use input_fit, only: report_file_problem, rounding
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use packing, only: packing_t
  use partners, only: obstacle_number
  use position_file, only: angle_row, mass_row, radius_row, spin_row
  use radii, only: drawn_radii
  use random_insertion, only: insert_at_random, largest_first
  use random_stream, only: random_stream_t
  use regular_positions, only: grid_positions, lattice_positions
  use settings, only: species_settings_t
  use simulation_state, only: simulation_t
  use starting_disks, only: origin
  use status_line, only: status_line_t
  use texts, only: written
  implicit none
  private
  public :: place_disks

  integer, parameter :: stream_number = 1                   !! number that identifies the random streams of this module
  !> Upper limit of a product of two numbers: the number of attempts to place a species with placement 'random', and the number of
  !> disks of this species.
  integer(int32), parameter :: many_trials = 500000
  !> If an attempt has placed n disks, a new attempt is estimated to place at most nearly*n + few disks.
  integer(int32), parameter :: few = 5
  real(real64), parameter :: nearly = 1.25_real64  !! factor of n in the estimate nearly*n + few
  !> Smallest ratio of the packing fractions that the placements 'dense' and 'random' can reach
  real(real64), parameter :: denser = 1.5_real64
  !> Packing fraction of freezing. Above the packing fraction of freezing the fluid is not stable (Engel et al., 2013,
  !> doi:10.1103/PhysRevE.87.042134). At higher packing fractions, disks of equal radii with placement 'relaxed' start on a lattice
  !> if the lattice fits into the box. A compressed fluid would become a polycrystal, which event chains equilibrate only slowly.
  real(real64), parameter :: freezing = 0.70_real64
  integer, parameter :: most_reports = 5                    !! limit of the number of reported problems, for each kind and species

contains

  !> Sets the positions and radii of all disks, and the velocities of disks that are read from a file with velocities.
  subroutine place_disks(species, groups, seed, unrelaxed, line, sim, problems)
    !> Settings of the species, in which the procedure deallocates the tables of disks.
    type(species_settings_t), intent(inout) :: species(:)
    type(group_t), intent(in) :: groups(:)                  !! groups of the species
    integer(int64), intent(in) :: seed
    !> .true. to leave out the placement of 'relaxed' species: all their disks are then at the centre of the box
    logical, intent(in) :: unrelaxed
    class(status_line_t), intent(inout) :: line             !! status line that shows the progress of the placement
    !> Simulation that contains its box, and the disks in the order of the input
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    type(packing_t) :: packing
    type(random_stream_t) :: stream
    real(real64), allocatable :: x(:, :), radius(:)         ! (2,count), (count) positions and radii of a species [length]
    logical, dimension(size(species)) :: random, dense, together
    integer :: s, k

    packing = packing_t(sim%box, size(sim%disk), size(species))
    random = [(species(k)%placement == "random", k=1, size(species))]
    dense = [(any(["dense  ", "grown  ", "relaxed"] == species(k)%placement), k=1, size(species))]
    do s = 1, size(species)
      if (random(s) .or. dense(s)) cycle
      k = problems%count
      call find_positions(s)
      if (problems%count == k) call add_species(packing, s, x, radius)
    end do
    if (problems%count > 0) return
    do while (any(random))
      s = maxloc(species%radius, dim=1, mask=random)
      call place_at_random(s)
      if (problems%count > 0) return
      random(s) = .false.
    end do
    do s = 1, size(species)
      if (.not. dense(s)) cycle
      together = dense .and. [(all(species(k)%region <= species(s)%region .and. &
        species(k)%region >= species(s)%region .and. species(k)%placement == species(s)%placement), k=1, size(species))]
      call place_densely(pack([(k, k=1, size(species))], together))
      if (problems%count > 0) return
      dense = dense .and. .not. together
    end do
    do k = 1, size(sim%disk)
      sim%disk(k)%x = packing%disk(k)%x
      sim%disk(k)%radius = packing%disk(k)%radius
    end do
    do s = 1, size(species)
      if (.not. species(s)%mass_by_area) cycle
      associate (me => species(s), first => disks_before(species, s) + 1, last => disks_before(species, s + 1))
        sim%own_mass(first:last) = me%mass*(sim%disk(first:last)%radius/me%mean_radius)**2
      end associate
    end do
    call sim%simplify_masses()

  contains

    !> Determines the positions of a species that is placed at explicit positions, on a grid or lattice, or at positions from a
    !> file. If the positions are read from a file, masses, orientations and, if requested, velocities are also copied from the file
    !> to the simulation.
    subroutine find_positions(s)
      integer, intent(in) :: s
      integer :: first, last, k

      first = disks_before(species, s) + 1
      last = first + species(s)%count - 1
      radius = drawn_radii(species(s), s, seed)
      associate (file => species(s)%in_file)
        select case (species(s)%placement)
        case ("explicit")
          x = species(s)%position
        case ("grid")
          call grid_positions(species(s), groups(s), x, problems)
        case ("lattice")
          call lattice_positions(species(s), groups(s), packing%box, x, problems)
        case default                                        ! 'file', 'grown'
          if (allocated(file%error)) then
            call report_file_problem(species(s), groups(s), problems)
            return
          end if
          x = file%table(1:2, :)
          if (.not. species(s)%polydispersity > 0) radius = file%table(radius_row, :)
          if (species(s)%velocities == "file") then
            do k = first, last
              sim%disk(k)%v = file%table(3:4, k - first + 1)
            end do
          end if
          if (sim%features%own_sizes) sim%own_mass(first:last) = file%table(mass_row, :)
          if (species(s)%spin_in_file) sim%extra(first:last)%spin = file%table(spin_row, :)
          if (species(s)%angle_in_file) sim%extra(first:last)%angle = file%table(angle_row, :)
          deallocate (file%table)
        end select
      end associate
    end subroutine find_positions

    !> Adds a species with known positions to the packing. The procedure reports disks that overlap other disks, and disks that are
    !> not completely inside their region.
    subroutine add_species(packing, s, x, radius)
      type(packing_t), intent(inout) :: packing
      integer, intent(in) :: s
      real(real64), intent(in) :: x(:, :)                   !! (2,count) [length]
      real(real64), intent(in) :: radius(:)                 !! (count) [length]
      real(real64) :: lower(2), upper(2), slack
      integer(int32) :: k, blocker
      integer :: outside, overlapping                       ! numbers of disks outside the region, and of overlapping disks
      character(len=:), allocatable :: taken

      outside = 0
      overlapping = 0
      taken = ""
      if (any(packing%box%surface%motion%moves())) taken = ", less the part that a moving side takes at the start"
      call centre_range(species(s)%region, packing%box, 0.0_real64, lower, upper)
      call packing%open_species(int(s, int32), maxval(radius), size(radius), &
        min(max(minval(x, dim=2), lower), upper), max(min(maxval(x, dim=2), upper), lower))
      do k = 1, species(s)%count
        if (min(outside, overlapping) == most_reports) return
        slack = rounding*(radius(k) + maxval(species%radius))
        call centre_range(species(s)%region, packing%box, radius(k), lower, upper)
        if (any(x(:, k) < lower - slack .or. x(:, k) > upper + slack)) then
          call report(s, k, x(:, k), outside, "is not wholly in its region"//taken)
          cycle
        end if
        call packing%find_blocker(x(:, k), [0.0_real64, 0.0_real64], radius(k) - slack, blocker)
        call packing%add(disks_before(species, s) + k, int(s, int32), x(:, k), radius(k))
        if (blocker > 0) then
          associate (other => packing%disk(blocker)%species)
            call report(s, k, x(:, k), overlapping, "overlaps disk "//written(blocker - disks_before(species, other))//" of """ &
              //species(other)%name//'"')
          end associate
        else if (blocker < 0) then
          associate (box => packing%box)
            call report(s, k, x(:, k), overlapping, trim(merge("is not wholly inside", "overlaps            ", &
              box%obstacle(obstacle_number(blocker))%shape%encloses))//" obstacle """ &
              //box%surface(box%surface_of(blocker))%name//'"')
          end associate
        end if
      end do
    end subroutine add_species

    !> Reports a problem of disk k of species s, which is at the point p.
    subroutine report(s, k, p, count, what)
      integer, intent(in) :: s, k
      real(real64), intent(in) :: p(2)                      !! [length]
      integer, intent(inout) :: count                       !! number of reported problems of the kind `what`
      character(len=*), intent(in) :: what
      character(len=:), allocatable :: variable, from

      if (count == most_reports) return
      count = count + 1
      variable = "placement"
      from = ""
      if (species(s)%placement == "explicit") variable = "position"
      if (species(s)%file /= "") variable = "file"
      if (species(s)%file /= "") from = origin(species(s), k, 1)//": "
      call groups(s)%complain(variable, from//"disk "//written(k)//" at "//written(p(1))//", "//written(p(2))//" "//what, problems)
    end subroutine report

    !> Places the disks of a species by random sequential insertion.
    subroutine place_at_random(s)
      integer, intent(in) :: s
      real(real64) :: lower(2), upper(2)
      real(real64), allocatable :: part(:)  ! area of each disk divided by the area of the region, in the order of placement
      character(len=:), allocatable :: advice
      integer(int32) :: placed, trial

      radius = drawn_radii(species(s), s, seed)
      associate (me => species(s))
        call stream%seed(seed, [s, stream_number])
        call centre_range(me%region, packing%box, me%radius, lower, upper)
        ! The number of disks that fit varies between attempts. If the species has few disks, more attempts are made, because the
        ! number of placed disks varies more in relation to its mean.
        do trial = 1, merge(1, max(1, many_trials/me%count), me%polydispersity > 0)
          call packing%open_species(int(s, int32), me%radius, me%count, lower, upper)
          call insert_at_random(packing, int(s, int32), 1 + disks_before(species, s), radius, stream, line, placed)
          if (placed == me%count) return
          if (placed == 0 .or. me%count > nearly*placed + few) exit  ! a new attempt is unlikely to place all disks
        end do
        part = pi*radius(largest_first(radius))**2/product(me%region([2, 4]) - me%region([1, 3]))
        advice = "use fewer or smaller disks"
        if (sum(part) < denser*sum(part(:placed))) advice = "use placement = 'dense'"
        call groups(s)%complain("placement", "no more room after "//written(placed)//" of "//written(me%count) &
          //" random disks: reached "//written(sum(part(:placed)))//" of the wanted packing " &
          //written(sum(part))//"; "//advice, problems)
      end associate
    end subroutine place_at_random

    !> Places all 'dense', 'grown' or 'relaxed' species of one region by compression, in a box with the shape of the region. The
    !> compression of 'grown' species starts at positions that are read from a file. 'relaxed' disks of equal radii start on a
    !> lattice instead if their packing fraction is above the packing fraction of freezing. After the compression or the start on a
    !> lattice, 'relaxed' disks are equilibrated by event chains.
    subroutine place_densely(members)
      integer, intent(in) :: members(:)                     !! indices of the species
      ! A copy of the packing, to which the small disks at the start of the compression are added.
      type(packing_t) :: small
      type(box_t) :: box
      real(real64), allocatable :: places(:, :), full(:)    ! positions and full radii of the disks of all given species [length]
      type(error_t), allocatable :: error
      logical :: grown, relaxed
      integer :: k, last

      grown = species(members(1))%placement == "grown"
      relaxed = species(members(1))%placement == "relaxed"
      if (grown) small = packing
      allocate (places(2, 0), full(0))
      do k = 1, size(members)
        associate (s => members(k))
          radius = drawn_radii(species(s), s, seed)
          if (grown) then
            call find_positions(s)
            if (problems%count == 0) call add_species(small, s, x, smallest_scale*radius)
            if (problems%count > 0) return
            places = reshape([places, x], [2, size(full) + size(radius)])
          end if
          full = [full, radius]
        end associate
      end do
      if (relaxed .and. unrelaxed) then
        packing%disk%radius = full
        packing%disk%x(1) = 0.5_real64*(packing%box%lower(1) + packing%box%upper(1))
        packing%disk%x(2) = 0.5_real64*(packing%box%lower(2) + packing%box%upper(2))
        return
      end if
      if (relaxed) call place_on_lattice(full, places)
      box = growth_box(packing, species(members(1))%region)
      call stream%seed(seed, [members(1), stream_number])
      if (grown .or. size(places, 2) == 0) call grow_disks(box, species(members)%species_t, full, stream, line, places, error)
      if (allocated(error)) call groups(members(1))%complain("placement", error%message, problems)
      if (problems%count > 0) return
      if (relaxed) call relax(box, full, seed, species(members(1))%relaxation_sweeps, line, places)
      last = 0
      do k = 1, size(members)
        associate (s => members(k), first => last + 1)
          last = last + species(s)%count
          call add_species(packing, s, places(:, first:last), full(first:last))
        end associate
        if (problems%count > 0) return
      end do
    end subroutine place_densely

    !> Places all disks on one lattice, in random order, under three conditions. The disks must have equal radii, their packing
    !> fraction must be above the packing fraction of freezing, and the lattice must fit into the box. If a condition is not met,
    !> the array of positions remains unchanged.
    subroutine place_on_lattice(full, places)
      real(real64), intent(in) :: full(:)                   !! (n) radii of all disks [length]
      real(real64), allocatable, intent(inout) :: places(:, :)         !! (2,n) [length]
      type(species_settings_t) :: all_disks
      type(problem_list_t) :: misfits
      real(real64), allocatable :: x(:, :)

      if (minval(full) < maxval(full) .or. pi*sum(full**2) < freezing*product(packing%box%edges())) return
      all_disks = species(1)
      all_disks%count = size(full)
      all_disks%radius = full(1)
      call lattice_positions(all_disks, groups(1), packing%box, x, misfits)
      if (misfits%count > 0) return
      call shuffle(seed, x)
      call move_alloc(x, places)
    end subroutine place_on_lattice
  end subroutine place_disks

  !> Creates the box for a compression: the region, without any part that lies beyond a displaced side. Disks that were placed
  !> earlier, and their periodic images, become obstacles if they extend into the new box.
  function growth_box(packing, region) result(box)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: region(4)
    type(box_t) :: box
    real(real64) :: centre(2), radius
    type(images_t) :: images
    integer :: k, i, n, pass

    box = box_t()
    call bounds(packing%box, 0.0_real64, box%lower, box%upper)
    box%lower = max(region([1, 3]), box%lower)
    box%upper = min(region([2, 4]), box%upper)
    box%periodic = spans(region, packing%box)
    images = packing%box%images()
    do pass = 1, 2  ! the first pass counts the obstacles, the second pass creates the obstacles
      n = packing%box%n_obstacles()
      do k = 1, size(packing%disk)
        if (packing%disk(k)%species == 0) cycle
        radius = packing%disk(k)%radius
        do i = 1, images%count()
          centre = packing%disk(k)%x + images%shift(images%around(i))
          if (any(centre < box%lower - radius .or. centre > box%upper + radius)) cycle
          n = n + 1
          if (pass == 1) cycle
          allocate (box%obstacle(n)%shape, source=new_circle(centre, radius, encloses=.false.))
        end do
      end do
      if (pass == 1) call box%add_obstacles(["obstacles", "disks    "], &
        [packing%box%n_obstacles(), n - packing%box%n_obstacles()])                  ! all obstacles of the new box are elastic
    end do
    do k = 1, packing%box%n_obstacles()
      allocate (box%obstacle(k)%shape, source=packing%box%obstacle(k)%shape)
    end do
  end function growth_box

end module placement
