!> Converts the species of the input to settings: names, placement, velocities, and relations
!> between species.
module input_species
  use kinds, only: int64, pi, real64
  use box_geometry, only: box_t
  use disks, only: longest_name
  use drives, only: drive_counters
  use group_fields, only: group_fields_t
  use h5md_layout, only: beside_species
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use observables, only: own_names
  use placements, only: choose_placement, common_variable
  use radii, only: drawn_radii, widest_spread
  use settings, only: species_settings_t
  use texts, only: counted, digits, letters, place_of, shown, suggestion, written
  use variables, only: largest, most_disks, row_of, smallest
  implicit none
  private
  public :: take_species, check_name

contains

  !> Reads the settings of all species. Derived values are also stored in the groups of the input.
  subroutine take_species(groups, box, seed, species, problems)
    type(group_t), intent(inout) :: groups(:)             !! groups of the species
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
      call take_placement(groups(k), box, species(k), problems)
      call take_spread(groups(k), species(k), problems)
      species(k)%waiting = int(min(groups(k)%integer_of("waiting", 0_int64), int(most_disks, int64)))
      call take_count(groups(k), species(k), problems)
      call check_waiting(groups(k), species(k), problems)
      call take_velocities(groups(k), species(k), problems)
    end do
    call share_variable(groups, species, problems)
    call resolve_sizes(groups, seed, species, problems)
    total = sum(int(species%count, int64))
    if (total > most_disks) call problems%add(0, "species.count", counted(total, "disk")//"; allowed: up to "// &
      written(most_disks))
    do k = 1, size(groups)
      associate (group => groups(k), s => species(k))
        call group%put_text("count", written(s%count))
        if (.not. s%mass_in_file) call group%put_reals("mass", [s%mass])
        if (s%mass_in_file) call group%values(row_of("species", "mass"))%clear()
        if (.not. s%radius_in_file) call group%put_reals("radius", [s%radius])
        ! A packing fraction given by the user is not overwritten. Its rounded value, when read
        ! again, could lead to another radius.
        if (s%radius > 0 .and. s%radius < sqrt(area(s%region)) .and. .not. (s%polydispersity > 0 &
          .or. group%given("packing_fraction"))) call group%put_reals("packing_fraction", [s%count*pi*s%radius**2/area(s%region)])
        call group%put_reals("region", s%region)
      end associate
    end do
  end subroutine take_species

  !> Reads how the initial positions are generated.
  subroutine take_placement(group, box, s, problems)
    type(group_t), intent(in) :: group
    type(box_t), intent(in) :: box
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems
    type(group_fields_t) :: fields

    s%name = trim(group%instance)
    fields = group_fields_t(group, problems)
    call choose_placement(group%text_of("placement"), s%placement)
    call s%placement%read(fields)
    problems = fields%problems
    s%file = group%text_of("file")
    s%radius_in_file = s%file /= "" .and. .not. (group%given("radius") .or. group%given("packing_fraction") &
      .or. group%given("relative_to"))
    s%mass_in_file = s%file /= "" .and. .not. (group%given("mass") .or. group%given("relative_to"))
    s%scale_positions = group%text_of("scale_positions") == ".true."
    s%region = [box%lower(1), box%upper(1), box%lower(2), box%upper(2)]
    if (group%values(row_of("species", "region"))%is_set()) s%region = group%reals_of("region")
  end subroutine take_placement

  !> Reads the polydispersity, and whether the masses depend on the radii.
  subroutine take_spread(group, s, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems

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

  !> Determines the number of disks, which is given explicitly or implied by the placement. A number
  !> implied by an initial-configuration file is determined later, by `input_fit`.
  subroutine take_count(group, s, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: source
    integer(int64) :: n

    s%count = int(group%integer_of("count", 0_int64))
    call s%placement%count_disks(n, source)
    if (group%faulty("count")) return
    if (n == 0) then
      if (s%file /= "" .and. .not. group%given("packing_fraction")) return
      if (source /= "") then
        if (group%faulty(source)) return
      end if
      call group%demand("count", problems)
    else if (group%given("count")) then
      if (n /= s%count - s%waiting) call group%complain(source, "describes "//counted(n, "disk")//", but species.count is "// &
        s%count_text(), problems)
    else if (n + s%waiting > most_disks) then
      call group%complain(source, counted(n + s%waiting, "disk")//"; allowed: up to "//written(most_disks), problems)
    else
      s%count = int(n) + s%waiting
    end if
  end subroutine take_count

  !> Checks the number of waiting disks. Radii and masses of waiting disks must be given in the
  !> input, because initial-configuration files contain no waiting disks.
  subroutine check_waiting(group, s, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(problem_list_t), intent(inout) :: problems

    if (s%waiting == 0 .or. group%faulty("count")) return
    if (s%waiting > s%count .and. s%count > 0) call group%complain("waiting", written(s%waiting)//" is more than species.count, " &
      //written(s%count), problems)
    if (s%radius_in_file) call group%complain("waiting", "needs radius: the file contains no waiting disks", problems)
    if (s%mass_in_file) call group%complain("waiting", "needs mass: the file contains no waiting disks", problems)
  end subroutine check_waiting

  !> Reads how the initial velocities are generated.
  subroutine take_velocities(group, s, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems
    type(group_fields_t) :: fields

    s%velocities = group%text_of("velocities")
    s%speed = group%real_of("speed", 0.0_real64)
    s%temperature = group%real_of("temperature", 0.0_real64)
    s%exact_temperature = group%real_of("exact_temperature", -1.0_real64)
    s%angular_velocity = group%real_of("angular_velocity", 0.0_real64)
    s%rotational_temperature = group%real_of("rotational_temperature", -1.0_real64)
    s%spin_in_file = s%velocities == "file" .and. .not. (group%given("angular_velocity") &
      .or. group%given("rotational_temperature"))
    fields = group_fields_t(group, problems)
    call fields%read("velocity", s%velocity)
    problems = fields%problems
    associate (n => size(s%velocity, 2), inside => s%count - s%waiting)
      if (n > 1 .and. n /= inside .and. s%count > 0) call group%complain("velocity", "has "//written(n)//" pairs for "// &
        counted(int(inside, int64), "disk")//"; allowed: one pair, or one for each disk", problems)
    end associate
  end subroutine take_velocities

  !> Sets a variable that must be equal for all species. Species without a given value receive the
  !> value of another species.
  subroutine share_variable(groups, species, problems)
    type(group_t), intent(inout) :: groups(:)
    type(species_settings_t), intent(inout) :: species(:)
    type(problem_list_t), intent(inout) :: problems
    type(group_fields_t) :: fields
    integer :: k
    integer :: first_given               ! index of the first species whose group sets the variable, or 0

    first_given = findloc([(groups(k)%given(common_variable), k=1, size(groups))], .true., dim=1)
    do k = 1, merge(size(groups), 0, first_given > 0)
      associate (shared => groups(first_given)%integer_of(common_variable, 0_int64))
        if (groups(k)%given(common_variable)) then
          if (groups(k)%integer_of(common_variable, 0_int64) /= shared) call groups(k)%complain(common_variable, &
            "must be the same for all species; """//trim(groups(first_given)%instance)//""" has "//written(shared), problems)
        else if (species(k)%placement%moves_all_disks()) then
          call groups(k)%put_text(common_variable, written(shared))
          fields%group = groups(k)
          call species(k)%placement%read(fields)
        end if
      end associate
    end do
  end subroutine share_variable

  !> Determines the masses and radii of all species. If a species is relative to a second species,
  !> and this one is relative to a third, the factors are multiplied.
  subroutine resolve_sizes(groups, seed, species, problems)
    type(group_t), intent(in) :: groups(:)
    integer(int64), intent(in) :: seed
    type(species_settings_t), intent(inout) :: species(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64), dimension(size(species)) :: mass, radius
    character(len=:), allocatable :: wanted
    ! base: index of the species in `relative_to`, or 0
    integer :: base(size(species)), k, j, step
    logical :: fits

    do k = 1, size(species)
      wanted = groups(k)%text_of("relative_to")
      base(k) = 0
      if (wanted /= "") base(k) = place_of(wanted, groups%instance)
      mass(k) = groups(k)%real_of("mass", 1.0_real64)
      call find_radius(groups(k), species(k), k, seed, radius(k), problems)
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

  !> Determines the radius of a species from one of three values: the radius itself, the packing
  !> fraction, or (with `relative_to`) the ratio to the radius of another species. The result is 0
  !> if the radius is unknown.
  subroutine find_radius(group, s, number, seed, radius, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    integer, intent(in) :: number                         !! index of the species
    integer(int64), intent(in) :: seed
    real(real64), intent(out) :: radius                   !! [length]
    type(problem_list_t), intent(inout) :: problems
    logical :: given, relative

    given = group%given("radius")
    relative = group%given("relative_to")
    radius = group%real_of("radius", 0.0_real64)
    if (group%given("packing_fraction") .and. (given .or. relative)) then
      radius = 0                                        ! exclusions are reported by `input_groups`
    else if (group%given("packing_fraction")) then
      if (s%count > 0 .and. area(s%region) > 0) &
        radius = sqrt(group%real_of("packing_fraction", 0.0_real64)*area(s%region)/(pi*s%count))
      if (s%polydispersity > 0 .and. radius > 0) radius = radius*sqrt(s%count/sum(drawn_radii(s, number, seed)**2))
    else if (relative .and. .not. given) then
      radius = 1
    else if (.not. (given .or. s%radius_in_file)) then
      call group%complain("radius", "is missing; give radius, packing_fraction or relative_to", problems)
    end if
  end subroutine find_radius

  !> Checks the name of an obstacle or species. The name must be unique, and valid in paths of the
  !> output file, in overrides and in messages.
  subroutine check_name(groups, k, problems)
    type(group_t), intent(in) :: groups(:)                !! groups of all obstacles, or of all species
    integer, intent(in) :: k
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: name
    integer :: j

    name = trim(groups(k)%instance)
    if (verify(name, letters//digits//"_-") > 0 .or. verify(name(1:1), letters) > 0 .or. len(name) > longest_name) then
      call groups(k)%complain("name", shown(name)//" is not a valid name; allowed: up to "//written(longest_name)// &
        " letters, digits, _ and -, beginning with a letter", problems)
    else if (any([own_names() == name, beside_species == name, drive_counters == name])) then
      call groups(k)%complain("name", shown(name)//" is reserved for the output file", problems)
    end if
    do j = 1, k - 1                                       ! an array expression would copy all names
      if (groups(j)%instance == name) exit
    end do
    if (j < k) call groups(k)%complain("name", shown(name)//" is already the name of the group in line "// &
      written(groups(j)%line), problems)
  end subroutine check_name

  !> Area of a region; 0 if the lower limits exceed the upper limits.
  pure function area(region)
    real(real64), intent(in) :: region(4)                 !! xlo, xhi, ylo, yhi [length]
    real(real64) :: area

    area = max(region(2) - region(1), 0.0_real64)*max(region(4) - region(3), 0.0_real64)
  end function area

end module input_species
