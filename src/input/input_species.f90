!> The species of the input: names, placements, velocities, and the relations between them.
module input_species
  use kinds, only: int64, pi, real64
  use input_problems, only: problem_list_t
  use parameter_values, only: parameter_group_t
  use parameters, only: largest, row_of, smallest
  use settings, only: box_settings_t, species_settings_t
  use texts, only: shown, suggestion, written
  implicit none
  private
  public :: take_species, check_name

  !> Names that the output file uses for its own groups and datasets.
  character(len=*), parameter :: reserved(*) = [character(len=20) :: "all", "total_energy", &
    "momentum", "collisions", "wall_collisions", "wall_impulse", "obstacle_collisions", "virial", &
    "pressure", "dissipated_energy", "names", "counts"]
  character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
  integer, parameter :: longest_name = 40
  integer, parameter :: most_disks = 100000000
  real(real64), parameter :: none(0) = [real(real64) ::]

contains

  !> Fills the settings of all species; derived values go back into the groups.
  subroutine take_species(groups, box, species, problems)
    type(parameter_group_t), intent(inout) :: groups(:)   !! the species
    type(box_settings_t), intent(in) :: box
    type(species_settings_t), allocatable, intent(out) :: species(:)
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    allocate (species(size(groups)))
    if (size(groups) == 0) call problems%add(0, "species", "there is none; give at least one")
    do k = 1, size(groups)
      call check_name(groups, k, problems)
      call take_placement(groups(k), species(k), box, problems)
      call take_velocities(groups(k), species(k), problems)
    end do
    call resolve_sizes(groups, species, problems)
    if (sum(int(species%count, int64)) > most_disks) call problems%add(0, "species.count", &
      written(sum(int(species%count, int64)))//" disks; allowed: up to "//written(most_disks))
    do k = 1, size(groups)
      associate (group => groups(k), s => species(k))
        call group%put_integer("count", int(s%count, int64))
        call group%put_reals("mass", [s%mass])
        call group%put_reals("radius", [s%radius])
        if (s%radius < sqrt(area(s%region))) call group%put_reals("packing_fraction", &
          [s%count*pi*s%radius**2/area(s%region)])
        call group%put_reals("region", s%region)
      end associate
    end do
  end subroutine take_species

  !> A name must fit into file paths, override paths and messages, and be the only one of its kind.
  subroutine check_name(groups, k, problems)
    type(parameter_group_t), intent(in) :: groups(:)   !! all obstacles, or all species
    integer, intent(in) :: k
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: name, where
    integer :: j

    where = trim(groups(k)%name)//".name"
    name = trim(groups(k)%instance)
    associate (line => groups(k)%line_of("name"))
      if (verify(name, letters//"0123456789_-") > 0 .or. verify(name(1:1), letters) > 0 &
        .or. len(name) > longest_name) then
        call problems%add(line, where, shown(name)//" is no name; allowed: up to "// &
          written(longest_name)//" letters, digits, _ and -, beginning with a letter")
      else if (any(reserved == name)) then
        call problems%add(line, where, shown(name)//" is a name that the output file uses itself")
      end if
      do j = 1, k - 1
        if (groups(j)%instance /= name) cycle
        call problems%add(line, where, shown(name)//" names the one in line "//written(groups(j)%line)//" already")
        exit
      end do
    end associate
  end subroutine check_name

  subroutine take_placement(group, s, box, problems)
    type(parameter_group_t), intent(inout) :: group
    type(species_settings_t), intent(inout) :: s
    type(box_settings_t), intent(in) :: box
    type(problem_list_t), intent(inout) :: problems

    s%name = trim(group%instance)
    call infer(group, "placement", [character(len=8) :: "position", "grid", "file"], &
      [character(len=8) :: "explicit", "grid", "file"])
    s%placement = group%text_of("placement")
    call pair_up(group, "placement", "explicit", "position", problems)
    call pair_up(group, "placement", "grid", "grid", problems)
    call pair_up(group, "placement", "file", "file", problems)
    s%file = group%text_of("file")
    s%region = group%reals_of("region", [box%lower(1), box%upper(1), box%lower(2), box%upper(2)])
    s%grid = 0
    associate (grid => group%values(row_of("species", "grid")))
      if (allocated(grid%integers)) s%grid = int(grid%integers)
    end associate
    call take_pairs(group, "position", s%position, problems)
    call take_count(group, s, problems)
  end subroutine take_placement

  subroutine take_velocities(group, s, problems)
    type(parameter_group_t), intent(inout) :: group
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems

    call infer(group, "velocities", [character(len=11) :: "velocity", "temperature", "speed", "file"], &
      [character(len=11) :: "explicit", "maxwell", "equal_speed", "file"])
    s%velocities = group%text_of("velocities")
    call pair_up(group, "velocities", "explicit", "velocity", problems)
    if (s%velocities == "file") call pair_up(group, "velocities", "file", "file", problems)
    if (s%velocities /= "maxwell") call leave_out(group, "velocities", "'maxwell'", "temperature", problems)
    if (s%velocities /= "equal_speed" .and. s%velocities /= "uniform") &
      call leave_out(group, "velocities", "'equal_speed' or 'uniform'", "speed", problems)
    s%speed = group%real_of("speed", 0.0_real64)
    s%temperature = group%real_of("temperature", 0.0_real64)
    call take_pairs(group, "velocity", s%velocity, problems)
    if (size(s%velocity, 2) == 1 .and. s%count > 1) then
      s%velocity = spread(s%velocity(:, 1), 2, s%count)
    else if (size(s%velocity, 2) > 0 .and. size(s%velocity, 2) /= s%count .and. s%count > 0) then
      call problems%add(group%line_of("velocity"), "species.velocity", &
        written(size(s%velocity, 2))//" pairs for "//written(s%count)//" disks")
    end if
  end subroutine take_velocities

  !> A choice that is not given follows from the first given variable that only makes sense with it.
  subroutine infer(group, choice, variables, consequences)
    type(parameter_group_t), intent(inout) :: group
    character(len=*), intent(in) :: choice
    character(len=*), intent(in) :: variables(:), consequences(:)
    integer :: k

    if (group%given(choice)) return
    do k = size(variables), 1, -1
      if (group%given(trim(variables(k)))) call group%put_text(choice, consequences(k))
    end do
  end subroutine infer

  !> The variable and the word of the choice need each other.
  subroutine pair_up(group, choice, word, variable, problems)
    type(parameter_group_t), intent(inout) :: group
    character(len=*), intent(in) :: choice, word, variable
    type(problem_list_t), intent(inout) :: problems

    if (group%text_of(choice) /= word) then
      call leave_out(group, choice, "'"//word//"'", variable, problems)
    else if (.not. group%given(variable)) then
      call problems%add(group%line_of(choice), "species."//variable, &
        "is missing; "//choice//" = '"//word//"' needs it")
    end if
  end subroutine pair_up

  !> A variable without effect has no value; if it is given, that is a mistake, for nothing is ignored
  !> silently.
  subroutine leave_out(group, choice, words, variable, problems)
    type(parameter_group_t), intent(inout) :: group
    character(len=*), intent(in) :: choice, words, variable
    type(problem_list_t), intent(inout) :: problems

    call group%unset(variable)
    if (.not. group%given(variable) .or. group%faulty(choice)) return
    call problems%add(group%line_of(variable), "species."//variable, "has no effect with "// &
      choice//" = '"//group%text_of(choice)//"'; it goes with "//words)
  end subroutine leave_out

  !> x1, y1, x2, y2, ... as (2,n).
  subroutine take_pairs(group, name, pairs, problems)
    type(parameter_group_t), intent(in) :: group
    character(len=*), intent(in) :: name
    real(real64), allocatable, intent(out) :: pairs(:, :)
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: values(:)

    allocate (values, source=group%reals_of(name, none))
    if (modulo(size(values), 2) == 1) call problems%add(group%line_of(name), "species."//name, &
      written(size(values))//" values; two belong to a disk, x and y")
    pairs = reshape(values, [2, size(values)/2])
  end subroutine take_pairs

  !> The number of disks, given or following from the grid or the list of positions.
  subroutine take_count(group, s, problems)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(inout) :: s
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: source
    integer(int64) :: given, counted

    given = group%integer_of("count", 0_int64)
    s%count = int(given)
    counted = given
    source = "position"
    if (size(s%position, 2) > 0) counted = size(s%position, 2)
    if (s%grid(1) > 0) then
      source = "grid"
      counted = product(int(s%grid, int64))
    end if
    if (group%faulty("count")) return
    if (.not. group%given("count")) then
      if (counted == 0 .and. .not. (group%faulty("position") .or. group%faulty("grid"))) then
        call problems%add(group%line, "species.count", "is missing; an integer >= 1")
      else if (counted > most_disks) then
        call problems%add(group%line_of(source), "species."//source, written(counted)// &
          " disks; allowed: up to "//written(most_disks))
      else
        s%count = int(counted)
      end if
    else if (counted /= given) then
      call problems%add(group%line_of(source), "species."//source, "holds "//written(counted)// &
        " disks, but species.count is "//written(given))
    end if
  end subroutine take_count

  !> Masses and radii, multiplied along the chain of `relative_to`.
  subroutine resolve_sizes(groups, species, problems)
    type(parameter_group_t), intent(in) :: groups(:)
    type(species_settings_t), intent(inout) :: species(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64), dimension(size(species)) :: mass, radius
    integer :: base(size(species)), k, j, step
    logical :: fits

    do k = 1, size(species)
      call find_base(groups, k, base(k), problems)
      mass(k) = groups(k)%real_of("mass", 1.0_real64)
      call own_radius(groups(k), species(k), radius(k), problems)
      if (groups(k)%given("relative_to") .and. base(k) == 0) radius(k) = 0
    end do
    do k = 1, size(species)
      species(k)%mass = 1
      species(k)%radius = 1
      j = k
      do step = 1, size(species)
        species(k)%mass = species(k)%mass*mass(j)
        species(k)%radius = species(k)%radius*radius(j)
        fits = max(species(k)%mass, species(k)%radius) <= largest .and. species(k)%mass >= smallest
        j = base(j)
        if (j == 0 .or. .not. fits) exit
      end do
      if (j == 0 .and. fits) cycle
      call problems%add(groups(k)%line_of("relative_to"), "species.relative_to", &
        "leads back to the species itself, or to sizes out of range")
      species(k)%radius = 0
    end do
  end subroutine resolve_sizes

  !> The species that `relative_to` names; 0 if there is none.
  subroutine find_base(groups, k, base, problems)
    type(parameter_group_t), intent(in) :: groups(:)
    integer, intent(in) :: k
    integer, intent(out) :: base
    type(problem_list_t), intent(inout) :: problems
    character(len=longest_name) :: names(size(groups))
    character(len=:), allocatable :: wanted
    integer :: j

    base = 0
    wanted = groups(k)%text_of("relative_to")
    if (wanted == "") return
    do j = 1, size(groups)
      names(j) = groups(j)%instance(:longest_name)
      if (groups(j)%instance == wanted) base = j
    end do
    if (base == 0) call problems%add(groups(k)%line_of("relative_to"), "species.relative_to", &
      shown(wanted)//" is no species; "//suggestion(wanted, names))
  end subroutine find_base

  !> The radius as given, or a multiple, or from the packing fraction; 0 if it cannot be known.
  subroutine own_radius(group, s, radius, problems)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    real(real64), intent(out) :: radius
    type(problem_list_t), intent(inout) :: problems

    radius = group%real_of("radius", 0.0_real64)
    if (group%given("packing_fraction")) then
      if (group%given("radius") .or. group%given("relative_to")) then
        call problems%add(group%line_of("packing_fraction"), "species.packing_fraction", &
          "fixes the radius, which "//trim(merge("radius     ", "relative_to", &
          group%given("radius")))//" does already; give one of them")
        radius = 0
      else if (s%count > 0 .and. area(s%region) > 0) then
        radius = sqrt(group%real_of("packing_fraction", 0.0_real64)*area(s%region)/(pi*s%count))
      end if
    else if (.not. group%given("radius")) then
      if (group%given("relative_to")) then
        radius = 1
      else
        call problems%add(group%line, "species.radius", "is missing; give radius, packing_fraction or relative_to")
      end if
    end if
  end subroutine own_radius

  pure function area(region)
    real(real64), intent(in) :: region(4)
    real(real64) :: area

    area = max(region(2) - region(1), 0.0_real64)*max(region(4) - region(3), 0.0_real64)
  end function area

end module input_species
