!> Converts the species of the input to settings: names, placement, velocities, and relations between species.
module input_species
  use kinds, only: int64, pi, real64
  use box_geometry, only: box_t
  use disks, only: longest_name
  use h5md_layout, only: beside_species
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use observables, only: own_names
  use radii, only: drawn_radii, widest_spread
  use settings, only: species_settings_t
  use texts, only: counted, digits, letters, place_of, shown, suggestion, written
  use variables, only: largest, most_disks, row_of, smallest
  implicit none
  private
  public :: take_species, check_name

contains

  !> Fills the settings of all species. Values that the procedure calculates are also stored in the groups of the input.
  subroutine take_species(groups, box, seed, species, problems)
    type(group_t), intent(inout) :: groups(:)             !! the species
    type(box_t), intent(in) :: box
    integer(int64), intent(in) :: seed                    !! seed of the run
    type(species_settings_t), allocatable, intent(out) :: species(:)
    type(problem_list_t), intent(inout) :: problems
    integer(int64) :: total
    integer :: k

    allocate (species(size(groups)))
    if (size(groups) == 0) call problems%add(0, "species", "the input has no &species; give at least one")
    do k = 1, size(groups)
      call check_name(groups, k, problems)
      if (groups(k)%given("file") .and. .not. groups(k)%given("velocities")) call groups(k)%put_text("velocities", "file")
      call groups(k)%infer_choices()
      if (groups(k)%text_of("velocities") == "file" .and. .not. groups(k)%given("file")) &
        call groups(k)%complain("velocities", "'file' needs species.file", problems)
      call groups(k)%check_choices(problems)
      call take_placement(groups(k), species(k))
      call take_spread(groups(k), species(k))
      call take_count(groups(k), species(k))
      call take_velocities(groups(k), species(k))
    end do
    call take_sweeps()
    call resolve_sizes()
    total = sum(int(species%count, int64))
    if (total > most_disks) call problems%add(0, "species.count", counted(total, "disk")//"; allowed: up to "// &
      written(most_disks))
    do k = 1, size(groups)
      associate (group => groups(k), s => species(k))
        call group%put_text("count", written(s%count))
        if (.not. s%mass_in_file) call group%put_reals("mass", [s%mass])
        if (s%mass_in_file) call group%values(row_of("species", "mass"))%clear()
        if (.not. s%radius_in_file) call group%put_reals("radius", [s%radius])
        if (s%radius > 0 .and. s%radius < sqrt(area(s%region)) .and. .not. s%polydispersity > 0) &
          call group%put_reals("packing_fraction", [s%count*pi*s%radius**2/area(s%region)])
        call group%put_reals("region", s%region)
      end associate
    end do

  contains

    !> Sets the method and the parameters of the initial positions.
    subroutine take_placement(group, s)
      type(group_t), intent(in) :: group
      type(species_settings_t), intent(inout) :: s

      s%name = trim(group%instance)
      s%placement = group%text_of("placement")
      s%file = group%text_of("file")
      s%radius_in_file = s%file /= "" .and. .not. (group%given("radius") .or. group%given("packing_fraction") &
        .or. group%given("relative_to"))
      s%mass_in_file = s%file /= "" .and. .not. (group%given("mass") .or. group%given("relative_to"))
      s%scale_positions = group%text_of("scale_positions") == ".true."
      s%region = [box%lower(1), box%upper(1), box%lower(2), box%upper(2)]
      if (group%values(row_of("species", "region"))%is_set()) s%region = group%reals_of("region")
      s%grid = 0
      associate (grid => group%values(row_of("species", "grid")))
        if (grid%is_set()) s%grid = int(grid%integers())
      end associate
      call take_pairs(group, "position", s%position)
    end subroutine take_placement

    !> Sets the polydispersity, and whether the masses depend on the radii.
    subroutine take_spread(group, s)
      type(group_t), intent(in) :: group
      type(species_settings_t), intent(inout) :: s

      s%polydispersity = group%real_of("polydispersity", 0.0_real64)
      s%distribution = group%text_of("radius_distribution")
      s%mass_by_area = s%polydispersity > 0 .and. group%text_of("mass_scaling") == "area"
      s%mass_in_file = s%mass_in_file .and. .not. s%mass_by_area
      if (s%polydispersity > widest_spread(s%distribution)) call group%complain("polydispersity", "radii would differ by more " &
        //"than a factor of 10; allowed with '"//s%distribution//"': up to "//written(widest_spread(s%distribution)) &
        //"; or give several species", problems)
      if (s%radius_in_file .and. group%given("polydispersity")) call group%complain("polydispersity", &
        "has no effect on the radii of a file; give their mean as radius", problems)
    end subroutine take_spread

    !> Converts a list x1, y1, x2, y2, ... to an array (2,n).
    subroutine take_pairs(group, name, pairs)
      type(group_t), intent(in) :: group
      character(len=*), intent(in) :: name
      real(real64), allocatable, intent(out) :: pairs(:, :)

      associate (values => group%reals_of(name))
        if (modulo(size(values), 2) == 1) call group%complain(name, counted(size(values, kind=int64), "value")// &
          "; each disk has two, x and y", problems)
        pairs = reshape(values, [2, size(values)/2])
      end associate
    end subroutine take_pairs

    !> Sets the number of disks, which is given directly or follows from the grid or from the list of positions. If the number of
    !> disks follows from a starting file, the module `input_fit` sets the number later.
    subroutine take_count(group, s)
      type(group_t), intent(in) :: group
      type(species_settings_t), intent(inout) :: s
      character(len=:), allocatable :: source
      integer(int64) :: n

      s%count = int(group%integer_of("count", 0_int64))
      source = "position"
      n = size(s%position, 2, kind=int64)
      if (s%grid(1) > 0) source = "grid"
      if (s%grid(1) > 0) n = product(int(s%grid, int64))
      if (group%faulty("count")) return
      if (n == 0) then
        if (s%file /= "" .and. .not. group%given("packing_fraction")) return
        if (.not. (group%faulty("position") .or. group%faulty("grid"))) call group%demand("count", problems)
      else if (group%given("count")) then
        if (n /= s%count) call group%complain(source, "describes "//counted(n, "disk")//", but species.count is "// &
          written(s%count), problems)
      else if (n > most_disks) then
        call group%complain(source, counted(n, "disk")//"; allowed: up to "//written(most_disks), problems)
      else
        s%count = int(n)
      end if
    end subroutine take_count

    !> Sets the method and the parameters of the initial velocities.
    subroutine take_velocities(group, s)
      type(group_t), intent(in) :: group
      type(species_settings_t), intent(inout) :: s

      s%velocities = group%text_of("velocities")
      s%speed = group%real_of("speed", 0.0_real64)
      s%temperature = group%real_of("temperature", 0.0_real64)
      s%exact_temperature = group%real_of("exact_temperature", -1.0_real64)
      s%angular_velocity = group%real_of("angular_velocity", 0.0_real64)
      s%rotational_temperature = group%real_of("rotational_temperature", -1.0_real64)
      s%spin_in_file = s%velocities == "file" .and. .not. (group%given("angular_velocity") &
        .or. group%given("rotational_temperature"))
      call take_pairs(group, "velocity", s%velocity)
      associate (n => size(s%velocity, 2))
        if (n > 1 .and. n /= s%count .and. s%count > 0) call group%complain("velocity", "has "//written(n)//" pairs for "// &
          counted(int(s%count, int64), "disk")//"; allowed: one pair, or one for each disk", problems)
      end associate
    end subroutine take_velocities

    !> Sets the number of sweeps for placement = 'relaxed'. All species must have the same number of sweeps, because a sweep moves
    !> the disks of all species.
    subroutine take_sweeps()
      integer :: k, giver                                 ! giver: index of the first species with a given number, or 0

      giver = findloc([(groups(k)%given("relaxation_sweeps"), k=1, size(groups))], .true., dim=1)
      do k = 1, size(groups)
        if (groups(k)%given("relaxation_sweeps")) then
          associate (first => groups(giver)%integer_of("relaxation_sweeps", 0_int64))
            if (groups(k)%integer_of("relaxation_sweeps", 0_int64) /= first) call groups(k)%complain("relaxation_sweeps", &
              "must be the same for all species; """//trim(groups(giver)%instance)//""" has "//written(first), problems)
          end associate
        else if (giver > 0 .and. species(k)%placement == "relaxed") then
          call groups(k)%put_text("relaxation_sweeps", written(groups(giver)%integer_of("relaxation_sweeps", 0_int64)))
        end if
        if (species(k)%placement == "relaxed") &
          species(k)%relaxation_sweeps = groups(k)%integer_of("relaxation_sweeps", 0_int64)
      end do
    end subroutine take_sweeps

    !> Sets the masses and radii of all species. A species to which another species is relative may itself be relative to a third
    !> species; the factors are then multiplied.
    subroutine resolve_sizes()
      real(real64), dimension(size(species)) :: mass, radius
      character(len=:), allocatable :: wanted
      integer :: base(size(species)), k, j, step            ! base: index of the species that `relative_to` names, or 0
      logical :: fits

      do k = 1, size(species)
        wanted = groups(k)%text_of("relative_to")
        base(k) = 0
        if (wanted /= "") base(k) = place_of(wanted, groups%instance)
        mass(k) = groups(k)%real_of("mass", 1.0_real64)
        radius(k) = own_radius(groups(k), species(k), k)
        if (wanted == "") cycle
        if (base(k) == 0) then
          radius(k) = 0
          call groups(k)%complain("relative_to", "there is no species "//shown(wanted)//"; "// &
            suggestion(wanted, groups%instance), problems)
          cycle
        end if
        species(base(k))%is_base = .true.
        if (species(base(k))%radius_in_file) call groups(k)%complain("relative_to", "the species """//species(base(k))%name &
          //""" has its radii from a file; give mass and radius instead", problems)
      end do
      do k = 1, size(species)
        species(k)%mass = 1
        species(k)%radius = 1
        fits = .false.
        j = k
        do step = 1, size(species)
          species(k)%mass = species(k)%mass*mass(j)
          species(k)%radius = species(k)%radius*radius(j)
          fits = max(species(k)%mass, species(k)%radius) <= largest .and. species(k)%mass >= smallest
          j = base(j)
          if (j == 0 .or. .not. fits) exit
        end do
        if (j == 0 .and. fits) cycle
        call groups(k)%complain("relative_to", "leads back to the species itself, or to sizes out of range", problems)
        species(k)%radius = 0
      end do
      species%mean_radius = species%radius
    end subroutine resolve_sizes

    !> Radius of a species: the given radius or, with `relative_to`, the factor relative to the radius of another species. If the
    !> packing fraction is given, the radius follows from the packing fraction. The result is 0 if the radius is unknown.
    function own_radius(group, s, number) result(radius)
      type(group_t), intent(in) :: group
      type(species_settings_t), intent(in) :: s
      integer, intent(in) :: number                       !! index of the species
      real(real64) :: radius
      logical :: given, relative

      given = group%given("radius")
      relative = group%given("relative_to")
      radius = group%real_of("radius", 0.0_real64)
      if (group%given("packing_fraction") .and. (given .or. relative)) then
        radius = 0                                        ! `input_groups` reports variables that exclude each other
      else if (group%given("packing_fraction")) then
        if (s%count > 0 .and. area(s%region) > 0) &
          radius = sqrt(group%real_of("packing_fraction", 0.0_real64)*area(s%region)/(pi*s%count))
        if (s%polydispersity > 0 .and. radius > 0) radius = radius*sqrt(s%count/sum(drawn_radii(s, number, seed)**2))
      else if (relative .and. .not. given) then
        radius = 1
      else if (.not. (given .or. s%radius_in_file)) then
        call group%complain("radius", "is missing; give radius, packing_fraction or relative_to", problems)
      end if
    end function own_radius
  end subroutine take_species

  !> Checks the name of an obstacle or species. The name must be unique and must be valid in paths of the output file, in overrides
  !> and in messages.
  subroutine check_name(groups, k, problems)
    type(group_t), intent(in) :: groups(:)                !! the groups of all obstacles, or of all species
    integer, intent(in) :: k
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: name
    integer :: j

    name = trim(groups(k)%instance)
    if (verify(name, letters//digits//"_-") > 0 .or. verify(name(1:1), letters) > 0 .or. len(name) > longest_name) then
      call groups(k)%complain("name", shown(name)//" is not a valid name; allowed: up to "//written(longest_name)// &
        " letters, digits, _ and -, beginning with a letter", problems)
    else if (any(own_names() == name) .or. any(beside_species == name)) then
      call groups(k)%complain("name", shown(name)//" is reserved for the output file", problems)
    end if
    do j = 1, k - 1                                       ! a loop, because an array expression would copy all names
      if (groups(j)%instance == name) exit
    end do
    if (j < k) call groups(k)%complain("name", shown(name)//" is already the name of the group in line "// &
      written(groups(j)%line), problems)
  end subroutine check_name

  !> Area of a region; 0 if the lower limits of the region exceed its upper limits.
  pure function area(region)
    real(real64), intent(in) :: region(4)                 !! xlo, xhi, ylo, yhi [length]
    real(real64) :: area

    area = max(region(2) - region(1), 0.0_real64)*max(region(4) - region(3), 0.0_real64)
  end function area

end module input_species
