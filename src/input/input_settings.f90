!> Converts the groups of the input to `settings`, derives missing values, and checks that the
!> values are compatible.
module input_settings
  use kinds, only: int64, never, real64, unlimited
  use box_geometry, only: box_t
  use box_state, only: box_state_t
  use contact_law, only: contact_law_t
  use restitution_law, only: chosen_restitution_law
  use tangential_law, only: tangential_law_t
  use wall_law, only: wall_law_t, wall_rules
  use disks, only: names_of, source_t
  use drives, only: choose_drive
  use group_fields, only: group_fields_t
  use input_conflicts, only: report_conflicts
  use input_groups, only: group_t, range_of
  use input_problems, only: problem_list_t
  use input_species, only: check_name, take_species
  use input_surfaces, only: check_least, take_grip, take_obstacles, take_wall_laws
  use placement, only: placement_t
  use settings, only: output_settings_t, run_settings_t, sampled, sampled_by, sampling_t, settings_t
  use simulation_state, only: drive_t
  use stop_rules, only: stop_rule_t
  use texts, only: counted, joined, place_of, shown, suggestion, written
  use variables, only: is_repeated, obstacle_groups, row_of, variables_of, words_of
  implicit none
  private
  public :: check_interval, resolve_settings

contains

  !> Converts the groups to settings. Derived values are also stored in the groups, which then
  !> contain all values used in the run.
  subroutine resolve_settings(groups, settings, problems, stepped, running, t)
    type(group_t), intent(inout) :: groups(:)             !! groups of the same name are adjacent
    type(settings_t), intent(out) :: settings
    type(problem_list_t), intent(inout) :: problems
    !> .true. if the caller ends the run; `&stop` may then be empty.
    logical, intent(in), optional :: stepped
    type(box_state_t), intent(in), optional :: running    !! see `take_wall_laws`
    real(real64), intent(in), optional :: t               !! see `take_wall_laws`
    logical :: must_end
    type(wall_law_t) :: all_walls                       ! default contact law of walls, from `&contact`
    integer :: e(2), o(2), s(2), w(2), k

    must_end = .true.
    if (present(stepped)) must_end = .not. stepped
    o = range_of(groups, obstacle_groups)
    w = range_of(groups, ["side"])
    s = range_of(groups, ["species"])
    e = range_of(groups, ["source"])
    do k = 1, size(groups)
      if (.not. is_repeated(groups(k)%name)) call groups(k)%check_choices(problems)
    end do
    call take_run(groups(place_of("run", groups%name)), settings%run, problems)
    call take_box(groups(place_of("box", groups%name)), settings%box, problems)
    call take_obstacles(groups(o(1):o(2)), settings%box, problems)
    call take_species(groups(s(1):s(2)), settings%box, settings%run%seed, settings%species, problems)
    call take_contact(groups(place_of("contact", groups%name)), size(settings%species), settings%law, all_walls, problems)
    call take_wall_laws(groups(w(1):w(2)), groups(o(1):o(2)), all_walls, settings%box, problems, running, t)
    settings%has_lids = any([(groups(k)%given("open"), k=w(1), w(2))])
    call take_drive(groups(place_of("drive", groups%name)), names_of(settings%species), settings%drive, problems)
    call take_sources(groups(e(1):e(2)), names_of(settings%species), settings%box, settings%source, problems)
    call take_stop(groups(place_of("stop", groups%name)), must_end, settings%stop, problems)
    call take_output(groups(place_of("output", groups%name)), settings%output, problems)
    call check_groups(settings, groups, must_end, problems)
  end subroutine resolve_settings

  !> Reads the title, the seed and the numerical method.
  subroutine take_run(group, run, problems)
    type(group_t), intent(in) :: group
    type(run_settings_t), intent(inout) :: run
    type(problem_list_t), intent(inout) :: problems

    run%title = group%text_of("title")
    run%seed = group%integer_of("seed", 1_int64)
    run%dynamics = group%text_of("dynamics")
    run%dt = group%real_of("dt", 0.0_real64)
    run%search = group%text_of("search")
    run%queue = group%text_of("queue")
    run%threads = int(group%integer_of("threads", 0_int64))
    if (run%dynamics == "steps" .and. .not. group%given("dt")) &
      call group%complain("dt", "is missing; dynamics = 'steps' needs it", problems)
  end subroutine take_run

  !> Reads the box, without its obstacles.
  subroutine take_box(group, box, problems)
    type(group_t), intent(in) :: group
    type(box_t), intent(inout) :: box
    type(problem_list_t), intent(inout) :: problems
    integer :: axis

    box = box_t()
    box%lower = group%reals_of("lower")
    box%upper = group%reals_of("upper")
    box%gravity = group%reals_of("gravity")
    box%shear_rate = group%real_of("shear_rate", 0.0_real64)
    box%periodic = group%values(row_of("box", "boundary"))%texts == "periodic"
    do axis = 1, 2
      if (box%lower(axis) >= box%upper(axis)) call group%complain("upper", written(box%upper(axis))// &
        " is not above box.lower, "//written(box%lower(axis))//", along "//merge("x", "y", axis == 1), problems)
    end do
  end subroutine take_box

  !> Reads the coefficients of restitution for all pairs of species, and the default contact law of
  !> walls.
  subroutine take_contact(group, n, law, all_walls, problems)
    type(group_t), intent(inout) :: group
    integer, intent(in) :: n                            !! number of species
    type(contact_law_t), intent(inout) :: law
    type(wall_law_t), intent(inout) :: all_walls
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: pairs(:)
    real(real64) :: restitution

    restitution = group%real_of("restitution", 1.0_real64)
    all_walls%restitution = group%real_of("wall_restitution", restitution)
    all_walls%rule = place_of(group%text_of("wall_rule"), words_of(wall_rules))
    law%by_speed = chosen_restitution_law(group%text_of("restitution_law"), group%real_of("reference_speed", 0.0_real64))
    all_walls%by_speed = law%by_speed
    call check_least(group, "restitution", law%by_speed, problems)
    call check_least(group, "wall_restitution", law%by_speed, problems)
    call check_least(group, "pair_restitution", law%by_speed, problems)
    call take_grip(group, "", tangential_law_t(), law%tangential, problems)
    call take_grip(group, "wall_", law%tangential, all_walls%tangential, problems)
    law%inertia = group%real_of("inertia", 0.5_real64)
    law%contact_time = group%real_of("contact_time", 0.0_real64)
    call group%put_reals("wall_restitution", [all_walls%restitution])
    allocate (law%restitution(n, n), source=restitution)
    allocate (pairs, source=group%reals_of("pair_restitution"))
    if (size(pairs) == 0 .or. n == 0) return
    if (size(pairs) /= n**2) then
      call group%complain("pair_restitution", counted(size(pairs, kind=int64), "value")//" instead of "// &
        written(n**2)//", one for each pair of species", problems)
      return
    end if
    law%restitution = reshape(pairs, [n, n])
    if (any(law%restitution /= transpose(law%restitution))) call group%complain("pair_restitution", &
      "must be symmetric: the value for species a and b is the value for b and a", problems)
  end subroutine take_contact

  !> Reads the driving and the species to which it is applied.
  subroutine take_drive(group, species, drive, problems)
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: species(:)          !! names of the species
    class(drive_t), allocatable, intent(inout) :: drive
    type(problem_list_t), intent(inout) :: problems
    type(group_fields_t) :: fields
    character(len=:), allocatable :: wanted

    call choose_drive(group%text_of("kind"), drive)
    if (.not. allocated(drive)) return
    drive%interval = group%real_of("interval", never)
    fields%group = group
    call drive%read(fields)
    wanted = group%text_of("species")
    if (wanted == "") return
    drive%species = place_of(wanted, species)
    if (drive%species == 0) &
      call group%complain("species", "there is no species "//shown(wanted)//"; "//suggestion(wanted, species), problems)
  end subroutine take_drive

  !> Reads all sources.
  subroutine take_sources(groups, species, box, sources, problems)
    type(group_t), intent(inout) :: groups(:)
    character(len=*), intent(in) :: species(:)          !! names of the species
    type(box_t), intent(in) :: box
    type(source_t), allocatable, intent(inout) :: sources(:)
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    if (size(groups) == 0) return
    allocate (sources(size(groups)))
    do k = 1, size(groups)
      call check_name(groups, k, problems)
      call take_source(groups(k), species, box, sources(k), problems)
    end do
  end subroutine take_sources

  !> Reads one source. If the source names no species, the input must contain a single species, to
  !> which the disks of the source belong.
  subroutine take_source(group, species, box, source, problems)
    type(group_t), intent(inout) :: group
    character(len=*), intent(in) :: species(:)          !! names of the species
    type(box_t), intent(in) :: box
    type(source_t), intent(inout) :: source
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: wanted

    call group%check_choices(problems)
    source%name = trim(group%instance)
    wanted = group%text_of("species")
    if (wanted == "" .and. size(species) == 1) wanted = trim(species(1))
    source%species = max(place_of(wanted, species), 1)
    if (wanted == "") then
      call group%demand("species", problems)
    else if (place_of(wanted, species) == 0) then
      call group%complain("species", "there is no species "//shown(wanted)//"; "//suggestion(wanted, species), problems)
    end if
    source%region = [box%lower(1), box%upper(1), box%lower(2), box%upper(2)]
    if (group%given("region") .and. .not. group%faulty("region")) source%region = group%reals_of("region")
    call group%demand("interval", problems)
    source%interval = group%real_of("interval", never)
    source%count = int(min(group%integer_of("count", 1_int64), int(huge(1), int64)))
    if (group%given("velocity") .and. .not. group%faulty("velocity")) source%velocity = group%reals_of("velocity")
    source%temperature = group%real_of("temperature", 0.0_real64)
    if (.not. (group%given("velocity") .or. group%given("temperature"))) &
      call group%complain("velocity", "is missing; give velocity or temperature", problems)
    source%start_time = group%real_of("start_time", 0.0_real64)
    source%end_time = group%real_of("end_time", never)
  end subroutine take_source

  !> Reads the stop rules.
  subroutine take_stop(group, must_end, rule, problems)
    type(group_t), intent(in) :: group
    logical, intent(in) :: must_end                     !! .true. if the input must contain a stop rule
    type(stop_rule_t), intent(inout) :: rule
    type(problem_list_t), intent(inout) :: problems

    rule%time = group%real_of("time", never)
    rule%collisions = group%integer_of("collisions", unlimited)
    rule%collisions_per_disk = group%real_of("collisions_per_disk", never)
    rule%events = group%integer_of("events", unlimited)
    rule%disks_inside = group%integer_of("disks_inside", -1_int64)
    rule%energy_fraction = group%real_of("energy_fraction", 0.0_real64)
    rule%wall_clock = group%real_of("wall_clock", never)
    rule%at_rest = group%text_of("at_rest") == ".true."
    if (must_end .and. count(group%values%given) == merge(1, 0, group%given("at_rest") .and. .not. rule%at_rest)) &
      call problems%add(group%line, "stop", "no rule ends the run; give at least one of "//joined(variables_of("stop"), ", "))
  end subroutine take_stop

  !> Reads the contents of the output and the sampling schedules.
  subroutine take_output(group, output, problems)
    type(group_t), intent(in) :: group
    type(output_settings_t), intent(inout) :: output
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    do k = 1, size(sampled)
      call take_sampling(group, trim(sampled(k)), output%sampling(k), problems)
    end do
    if (group%given("decades_from") .and. all(output%sampling%per_decade == 0)) call group%complain("decades_from", &
      "has no effect without frames_per_decade or observables_per_decade", problems)
    k = row_of("output", "frame_columns")
    if (group%values(k)%is_set()) output%frame_columns = group%values(k)%texts
    output%single_precision = group%text_of("precision") == "single"
    output%event_log = group%text_of("event_log") == ".true."
    output%virial_tensor = group%text_of("virial_tensor") == ".true."
    output%helfand = group%text_of("helfand") == ".true."
    output%checkpoint_every = group%real_of("checkpoint_every", never)
  end subroutine take_output

  !> Reads the sampling schedule of frames or observables.
  subroutine take_sampling(group, what, sampling, problems)
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: what                !! one of `sampled`
    type(sampling_t), intent(out) :: sampling
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    sampling%every = [(group%real_of(what//"_every_"//trim(sampled_by(k)), never), k=1, size(sampled_by))]
    sampling%per_decade = int(group%integer_of(what//"_per_decade", 0_int64))
    sampling%from = group%real_of("decades_from", never)
    if (sampling%per_decade > 0 .and. .not. group%given("decades_from")) call group%complain(what//"_per_decade", &
      "needs decades_from, the time of the first of them", problems)
    if (.not. group%given(what//"_at")) return
    sampling%at = group%reals_of(what//"_at")
    if (any(sampling%at(2:) <= sampling%at(:size(sampling%at) - 1))) call group%complain(what//"_at", &
      "the times must increase", problems)
  end subroutine take_sampling

  !> Reports settings of different groups that cannot be combined, and intervals that are too short.
  subroutine check_groups(settings, groups, must_end, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    logical, intent(in) :: must_end                     !! .true. if the input must contain a stop rule
    type(problem_list_t), intent(inout) :: problems

    call report_conflicts(settings, groups, must_end, problems)
    call check_columns(settings%output, groups, problems)
    call check_placements(settings, groups, problems)
    call check_sources(settings, groups, problems)
    if (settings%run%dynamics == "steps") call check_number("run", "dt", "steps", 1.0e18_real64, settings%stop, groups, problems)
    call check_number("drive", "interval", "kicks", 1.0e15_real64, settings%stop, groups, problems)
    call check_number("output", "frames_every_time", "samples", 1.0e9_real64, settings%stop, groups, problems)
    call check_number("output", "observables_every_time", "samples", 1.0e9_real64, settings%stop, groups, problems)
  end subroutine check_groups

  !> Reports columns that are listed twice in output.frame_columns.
  subroutine check_columns(output, groups, problems)
    type(output_settings_t), intent(in) :: output
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    integer :: g, k

    g = place_of("output", groups%name)
    if (g == 0 .or. .not. allocated(output%frame_columns)) return
    associate (columns => output%frame_columns)
      do k = 1, size(columns)
        if (any(columns(:k - 1) == columns(k))) call groups(g)%complain("frame_columns", &
          "'"//trim(columns(k))//"' is named twice", problems)
      end do
    end associate
  end subroutine check_columns

  !> Checks the conditions for placements that move all disks of the run.
  subroutine check_placements(settings, groups, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    logical :: moves_all(size(settings%species))
    real(real64) :: whole(4)
    character(len=:), allocatable :: word      ! with `associate`, gfortran 12 would free the result twice
    integer :: s(2), k, other

    s = range_of(groups, ["species"])
    associate (species => settings%species, own => groups(s(1):s(2)), box => settings%box)
      moves_all = [(species(k)%placement%moves_all_disks(), k=1, size(species))]
      if (.not. any(moves_all)) return
      whole = [box%lower(1), box%upper(1), box%lower(2), box%upper(2)]
      k = findloc(moves_all, .true., dim=1)
      other = findloc(moves_all, .false., dim=1)
      word = own(k)%text_of("placement")
      if (other > 0) call own(k)%complain("placement", "'"//word//"' applies to all species of a run; """ &
        //species(other)%name//""" has placement = '"//own(other)%text_of("placement")//"'", problems)
      call refuse_placement(any(groups%name == "obstacle"), "obstacle", species(k)%placement, own(k), problems)
      call refuse_placement(any(groups%name == "wall"), "wall", species(k)%placement, own(k), problems)
      call refuse_placement(any(box%side%moves()), "side.motion", species(k)%placement, own(k), problems)
      call refuse_placement(box%has_gravity(), "box.gravity", species(k)%placement, own(k), problems)
      do k = 1, size(species)
        if (moves_all(k) .and. any(abs(species(k)%region - whole) > 0)) call own(k)%complain("region", "must be the whole " &
          //"box with placement = '"//word//"'", problems)
      end do
    end associate
  end subroutine check_placements

  !> Reports a variable that is set although it cannot be combined with the placement.
  subroutine refuse_placement(is_there, variable, placement, group, problems)
    logical, intent(in) :: is_there
    character(len=*), intent(in) :: variable
    class(placement_t), intent(in) :: placement
    type(group_t), intent(in) :: group
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: reason

    reason = placement%conflict(variable)
    if (is_there .and. reason /= "") call group%complain("placement", reason, problems)
  end subroutine refuse_placement

  !> Reports sources whose interval is too short for the entries to be counted exactly.
  subroutine check_sources(settings, groups, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: last                                ! latest known time of an entry [time]
    integer :: s(2), k

    s = range_of(groups, ["source"])
    do k = 1, s(2) - s(1) + 1
      associate (source => settings%source(k))
        last = max(source%start_time, merge(min(source%end_time, settings%stop%time), 0.0_real64, &
          min(source%end_time, settings%stop%time) < never))
        call check_interval(source, groups(s(1) + k - 1), last, "the end of the source or of the run", problems)
      end associate
    end do
  end subroutine check_sources

  !> Reports a source whose interval is too short for its entries up to a time to be counted
  !> exactly.
  subroutine check_interval(source, group, last, until, problems)
    type(source_t), intent(in) :: source
    type(group_t), intent(in) :: group
    real(real64), intent(in) :: last                     !! time [time]
    character(len=*), intent(in) :: until                !! name of this time in the message
    type(problem_list_t), intent(inout) :: problems
    real(real64), parameter :: most = 1.0e15_real64

    if (last/source%interval > most) call group%complain("interval", &
      written(last/source%interval)//" intervals until "//until//"; allowed: up to "//written(most), problems)
  end subroutine check_interval

  !> Reports an interval so short that the time limit stop.time comprises more than `most`
  !> intervals.
  subroutine check_number(group, name, of_what, most, rule, groups, problems)
    character(len=*), intent(in) :: group, name, of_what
    real(real64), intent(in) :: most
    type(stop_rule_t), intent(in) :: rule
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: number

    if (rule%time >= never) return
    associate (own => groups(place_of(group, groups%name)))
      number = rule%time/own%real_of(name, never)
      if (number > most) call own%complain(name, written(number)//" "//of_what &
        //" until stop.time; allowed: up to "//written(most), problems)
    end associate
  end subroutine check_number

end module input_settings
