!> Generates the initial positions of all disks.
!>
!> The species are placed in the following order:
!> 1. species with fixed positions ('explicit', 'file', 'grid' or 'lattice'), in the order of the
!>    input;
!> 2. 'random' species, in the order of decreasing disk size;
!> 3. 'dense' and 'grown' species. All species of the same region are compressed together; disks
!>    placed earlier act as fixed obstacles.
!>
!> If any species is 'relaxed', all must be; their disks are placed together.
module initial_positions
  use kinds, only: int32, int64, real64
  use box_state, only: centre_range
  use disks, only: disks_before
  use group_fields, only: group_fields_t
  use input_fit, only: report_file_problem, touching_tolerance
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use packing, only: packing_t
  use partners, only: obstacle_number
  use placement, only: batch_t, by_input, by_size, in_batches
  use position_file, only: angle_row, mass_row, radius_row, spin_row
  use radii, only: drawn_radii
  use settings, only: species_settings_t
  use simulation_state, only: simulation_t
  use starting_disks, only: origin
  use status_line, only: status_line_t
  use texts, only: written
  implicit none
  private
  public :: place_disks

  !> Maximum number of reported problems per kind and species.
  integer, parameter :: most_reports = 5

  !> State of the placement of all species of a simulation.
  type :: positions_t
    type(packing_t) :: packing                              !! disks placed so far
    integer(int64) :: seed
    !> .true. to skip placements that move all disks; these disks are put at the centre of the box.
    logical :: unrelaxed
    type(problem_list_t) :: problems
  contains
    procedure :: place_in_order
    procedure :: place_batch
    procedure :: load_batch
  end type positions_t

contains

  !> Sets the positions and radii of all disks, and the velocities of disks whose file contains
  !> velocities. Waiting disks are put at the lower left corner of the box.
  subroutine place_disks(species, groups, seed, unrelaxed, line, sim, problems)
    type(species_settings_t), intent(inout) :: species(:)   !! as in `place_all`
    type(group_t), intent(in) :: groups(:)
    integer(int64), intent(in) :: seed
    logical, intent(in) :: unrelaxed
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    type(species_settings_t), allocatable :: placed(:)      ! the species without their waiting disks
    type(simulation_t) :: inside                            ! simulation without waiting disks
    integer :: s

    if (all(species%waiting == 0)) then
      call place_all(species, groups, seed, unrelaxed, line, sim, problems)
    else
      placed = species
      placed%count = species%count - species%waiting
      inside%specification_t = sim%specification_t
      inside%box = sim%box
      inside%species%count = placed%count
      call inside%list_disks()
      call place_all(placed, groups, seed, unrelaxed, line, inside, problems)
      if (problems%count == 0) call add_waiting(species, seed, placed, inside, sim)
    end if
    if (problems%count > 0) return
    do s = 1, size(species)
      if (.not. species(s)%mass_by_area) cycle
      associate (me => species(s), first => disks_before(species, s) + 1, last => disks_before(species, s + 1))
        sim%own_mass(first:last) = me%mass*(sim%disk(first:last)%radius/me%mean_radius)**2
      end associate
    end do
    call sim%simplify_masses()
  end subroutine place_disks

  !> Copies the placed disks of each species to the simulation, followed by its waiting disks.
  subroutine add_waiting(species, seed, placed, inside, sim)
    type(species_settings_t), intent(in) :: species(:)
    integer(int64), intent(in) :: seed
    type(species_settings_t), intent(in) :: placed(:)       !! the species without their waiting disks
    type(simulation_t), intent(in) :: inside                !! simulation without waiting disks
    type(simulation_t), intent(inout) :: sim
    integer :: s, k, n

    do s = 1, size(species)
      associate (first => disks_before(species, s), from => disks_before(placed, s), radius => drawn_radii(species(s), s, seed))
        n = placed(s)%count
        do k = 1, n
          sim%disk(first + k) = inside%disk(from + k)
          if (allocated(sim%own_mass)) sim%own_mass(first + k) = inside%own_mass(from + k)
          if (species(s)%spin_in_file) sim%extra(first + k)%spin = inside%extra(from + k)%spin
          if (species(s)%angle_in_file) sim%extra(first + k)%angle = inside%extra(from + k)%angle
        end do
        do k = first + n + 1, first + species(s)%count
          sim%disk(k)%x = sim%box%lower
          sim%disk(k)%radius = radius(k - first)
        end do
      end associate
    end do
  end subroutine add_waiting

  !> Sets the positions and radii of all disks, and the velocities of disks whose file contains
  !> velocities.
  subroutine place_all(species, groups, seed, unrelaxed, line, sim, problems)
    !> Settings of the species; their tables of disks are deallocated.
    type(species_settings_t), intent(inout) :: species(:)
    type(group_t), intent(in) :: groups(:)                  !! groups of the species
    integer(int64), intent(in) :: seed
    logical, intent(in) :: unrelaxed                        !! as in `positions_t`
    class(status_line_t), intent(inout) :: line             !! status line for the progress of the placement
    !> Simulation with its box, and with its disks in the order of the input.
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    type(positions_t) :: positions
    integer :: k

    positions%seed = seed
    positions%unrelaxed = unrelaxed
    positions%problems = problems
    positions%packing = packing_t(sim%box, size(sim%disk), size(species))
    call positions%place_in_order(species, groups, line, sim)
    problems = positions%problems
    if (problems%count > 0) return
    do k = 1, size(sim%disk)
      sim%disk(k)%x = positions%packing%disk(k)%x
      sim%disk(k)%radius = positions%packing%disk(k)%radius
    end do
  end subroutine place_all

  !> Places the species in the order given at the top of this file, until the first problem occurs.
  subroutine place_in_order(self, species, groups, line, sim)
    class(positions_t), intent(inout) :: self
    type(species_settings_t), intent(inout) :: species(:)
    type(group_t), intent(in) :: groups(:)
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(inout) :: sim
    integer :: turn(size(species))      ! stage of each species; 0 if placed or without disks
    integer :: s, k

    turn = [(species(k)%placement%turn(), k=1, size(species))]
    where (species%count == 0) turn = 0
    do s = 1, size(species)
      if (turn(s) == by_input) call self%place_batch([s], species, groups, line, sim)
    end do
    do while (any(turn == by_size) .and. self%problems%count == 0)
      s = maxloc(species%radius, dim=1, mask=turn == by_size)
      call self%place_batch([s], species, groups, line, sim)
      turn(s) = 0
    end do
    do s = 1, size(species)
      if (self%problems%count > 0) return
      if (turn(s) /= in_batches) cycle
      associate (members => pack([(k, k=1, size(species))], turn == in_batches .and. alike(species, s)))
        call self%place_batch(members, species, groups, line, sim)
        turn(members) = 0
      end associate
    end do
  end subroutine place_in_order

  !> True for each species with the same region and placement as species s.
  pure function alike(species, s) result(yes)
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    logical :: yes(size(species))
    integer :: k

    do k = 1, size(species)
      yes(k) = all(species(k)%region <= species(s)%region .and. species(k)%region >= species(s)%region) &
        .and. same_type_as(species(k)%placement, species(s)%placement)
    end do
  end function alike

  !> Places the disks of one or more species together.
  subroutine place_batch(self, members, species, groups, line, sim)
    class(positions_t), intent(inout) :: self
    integer, intent(in) :: members(:)                       !! indices of the species
    type(species_settings_t), intent(inout) :: species(:)
    type(group_t), intent(in) :: groups(:)
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(inout) :: sim
    type(batch_t) :: batch
    type(group_fields_t) :: fields
    integer :: before, first, last, k

    before = self%problems%count
    call self%load_batch(members, species, groups, sim, batch)
    if (self%problems%count > before) return
    associate (placement => species(members(1))%placement, packing => self%packing)
      if (self%unrelaxed .and. placement%moves_all_disks()) then
        packing%disk%radius = batch%radius
        packing%disk%x(1) = 0.5_real64*(packing%box%lower(1) + packing%box%upper(1))
        packing%disk%x(2) = 0.5_real64*(packing%box%lower(2) + packing%box%upper(2))
        return
      end if
      fields = group_fields_t(groups(members(1)), self%problems)
      call placement%place(batch, packing, line, fields)
    end associate
    self%problems = fields%problems
    if (batch%is_packed) return
    last = 0
    do k = 1, size(members)
      if (self%problems%count > before) return
      first = last + 1
      last = last + species(members(k))%count
      call add_species(self%packing, species, members(k), groups(members(k)), batch%x(:, first:last), batch%radius(first:last), &
        self%problems)
    end do
  end subroutine place_batch

  !> Collects the radii of the disks of several species. If the species have an
  !> initial-configuration file, its positions are checked and collected as well.
  subroutine load_batch(self, members, species, groups, sim, batch)
    class(positions_t), intent(inout) :: self
    integer, intent(in) :: members(:)
    type(species_settings_t), intent(inout) :: species(:)
    type(group_t), intent(in) :: groups(:)
    type(simulation_t), intent(inout) :: sim
    type(batch_t), intent(inout) :: batch
    ! the packing, plus shrunk disks at the positions from files
    type(packing_t) :: small
    integer :: before, first, last, k
    real(real64) :: scale

    before = self%problems%count
    batch%seed = self%seed
    batch%number = int(members(1), int32)
    batch%first = int(disks_before(species, members(1)) + 1, int32)
    batch%region = species(members(1))%region
    batch%largest_radius = species(members(1))%radius
    scale = species(members(1))%placement%starting_scale()
    if (scale < 1) small = self%packing
    allocate (batch%species(size(members)), batch%radius(sum(species(members)%count)))
    allocate (batch%x(2, merge(0, size(batch%radius), species(members(1))%file == "")))
    last = 0
    do k = 1, size(members)
      associate (s => members(k), me => species(members(k)))
        first = last + 1
        last = last + me%count
        batch%species(k) = me%species_t
        batch%radius(first:last) = drawn_radii(me, s, self%seed)
        if (me%file == "") cycle
        call take_from_file(species, s, groups(s), sim, self%problems)
        if (self%problems%count > before) return
        if (.not. me%polydispersity > 0) batch%radius(first:last) = me%in_file%table(radius_row, :)
        batch%x(:, first:last) = me%in_file%table(1:2, :)
        deallocate (me%in_file%table)
        if (scale < 1) call add_species(small, species, s, groups(s), batch%x(:, first:last), scale*batch%radius(first:last), &
          self%problems)
      end associate
      if (self%problems%count > before) return
    end do
  end subroutine load_batch

  !> Copies masses, orientations and, if requested, velocities of a species from its
  !> initial-configuration file to the simulation.
  subroutine take_from_file(species, s, group, sim, problems)
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s                                !! index of the species
    type(group_t), intent(in) :: group
    type(simulation_t), intent(inout) :: sim
    type(problem_list_t), intent(inout) :: problems
    integer :: k, first, last

    first = disks_before(species, s) + 1
    last = first + species(s)%count - 1
    associate (me => species(s), file => species(s)%in_file)
      if (allocated(file%error)) then
        call report_file_problem(me, group, problems)
        return
      end if
      if (me%velocities == "file") then
        do k = first, last
          sim%disk(k)%v = file%table(3:4, k - first + 1)
        end do
      end if
      if (sim%features%own_sizes) sim%own_mass(first:last) = file%table(mass_row, :)
      if (me%spin_in_file) sim%extra(first:last)%spin = file%table(spin_row, :)
      if (me%angle_in_file) sim%extra(first:last)%angle = file%table(angle_row, :)
    end associate
  end subroutine take_from_file

  !> Adds a species with known positions to the packing. Disks that overlap other disks, or are not
  !> completely inside their region, are reported.
  subroutine add_species(packing, species, s, group, x, radius, problems)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    type(group_t), intent(in) :: group
    real(real64), intent(in) :: x(:, :)                     !! shape (2, count) [length]
    real(real64), intent(in) :: radius(:)                   !! shape (count) [length]
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: lower(2), upper(2), slack
    integer(int32) :: k, blocker
    integer :: outside, overlapping      ! numbers of disks outside the region and of overlapping disks
    character(len=:), allocatable :: taken

    outside = 0
    overlapping = 0
    taken = ""
    associate (region => species(s)%region)
      if (any(packing%box%side%moves())) taken = ", less the part that a moving side takes at the start"
      call centre_range(region, packing%box, 0.0_real64, lower, upper)
      call packing%open_species(int(s, int32), maxval(radius), size(radius), &
        min(max(minval(x, dim=2), lower), upper), max(min(maxval(x, dim=2), upper), lower))
      do k = 1, species(s)%count
        if (min(outside, overlapping) >= most_reports) return
        slack = touching_tolerance*(radius(k) + maxval(species%radius))
        call centre_range(region, packing%box, radius(k), lower, upper)
        if (any(x(:, k) < lower - slack .or. x(:, k) > upper + slack)) then
          outside = outside + 1
          if (outside <= most_reports) call report_disk(species(s), k, x(:, k), "is not wholly in its region"//taken, group, &
            problems)
          cycle
        end if
        call packing%find_blocker(x(:, k), [0.0_real64, 0.0_real64], radius(k) - slack, blocker)
        call packing%add(disks_before(species, s) + k, int(s, int32), x(:, k), radius(k))
        if (blocker == 0) cycle
        overlapping = overlapping + 1
        if (overlapping <= most_reports) call report_disk(species(s), k, x(:, k), conflict(packing, species, blocker), group, &
          problems)
      end do
    end associate
  end subroutine add_species

  !> Reports a problem with disk k of a species.
  subroutine report_disk(me, k, x, what, group, problems)
    type(species_settings_t), intent(in) :: me
    integer(int32), intent(in) :: k
    real(real64), intent(in) :: x(2)                        !! [length]
    character(len=*), intent(in) :: what
    type(group_t), intent(in) :: group
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: from

    from = ""
    if (me%file /= "") from = origin(me, k, 1)//": "
    call group%complain(me%placement%culprit(), from//"disk "//written(k)//" at "//written(x(1))//", "//written(x(2)) &
      //" "//what, problems)
  end subroutine report_disk

  !> Second half of the message about a disk that overlaps another disk or an obstacle, beginning
  !> with the verb: 'overlaps disk 3 of "gas"'.
  function conflict(packing, species, blocker) result(text)
    type(packing_t), intent(in) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer(int32), intent(in) :: blocker      !! index of the other disk (> 0), or id of the obstacle
    character(len=:), allocatable :: text

    if (blocker > 0) then
      associate (other => packing%disk(blocker)%species)
        text = "overlaps disk "//written(blocker - disks_before(species, other))//" of """//species(other)%name//'"'
      end associate
    else
      associate (box => packing%box)
        text = trim(merge("is not wholly inside", "overlaps            ", &
          box%obstacle(obstacle_number(blocker))%shape%encloses))//" obstacle """//box%surface(box%surface_of(blocker))%name//'"'
      end associate
    end if
  end function conflict

end module initial_positions
