!> Converts the groups of the input to `settings`, calculates values that follow from other values, and checks whether the values
!> are compatible.
module input_settings
  use kinds, only: int64, never, real64
  use box_geometry, only: box_t
  use collisions, only: tangential_law_t, restitution_laws, series_terms, wall_law_t, wall_rules
  use disks, only: names_of
  use drive, only: drive_kinds, noise
  use input_groups, only: group_t, range_of
  use input_problems, only: problem_list_t
  use input_species, only: take_species
  use input_surfaces, only: check_least, take_grip, take_obstacles, take_wall_laws
  use partners, only: n_sides
  use settings, only: sampled, sampled_by, sampling_t, settings_t
  use side_motion, only: piston
  use texts, only: counted, joined, place_of, shown, suggestion, written
  use variables, only: is_repeated, obstacle_groups, row_of, variables_of, words_of
  implicit none
  private
  public :: resolve_settings

  integer(int64), parameter :: unlimited = huge(1_int64)

contains

  !> Fills the settings. Calculated values are also stored in the groups, so that the groups contain all values that the run uses.
  subroutine resolve_settings(groups, settings, problems, stepped)
    type(group_t), intent(inout) :: groups(:)             !! groups of the same name are adjacent
    type(settings_t), intent(out) :: settings
    type(problem_list_t), intent(inout) :: problems
    logical, intent(in), optional :: stepped              !! .true. if the caller ends the run, so that `&stop` may be empty
    logical :: must_end
    type(wall_law_t) :: wall_law                          ! default contact law of walls, from `&contact`
    integer :: o(2), s(2), w(2), k

    must_end = .true.
    if (present(stepped)) must_end = .not. stepped
    o = range_of(groups, obstacle_groups)
    w = range_of(groups, ["side"])
    s = range_of(groups, ["species"])
    do k = 1, size(groups)
      if (.not. is_repeated(groups(k)%name)) call groups(k)%check_choices(problems)
    end do
    call take_run(groups(place_of("run", groups%name)))
    call take_box(groups(place_of("box", groups%name)))
    call take_obstacles(groups(o(1):o(2)), settings%box, problems)
    call take_species(groups(s(1):s(2)), settings%box, settings%run%seed, settings%species, problems)
    call take_contact(groups(place_of("contact", groups%name)), size(settings%species))
    call take_wall_laws(groups(w(1):w(2)), groups(o(1):o(2)), wall_law, settings%box, problems)
    call take_drive(groups(place_of("drive", groups%name)))
    call take_stop(groups(place_of("stop", groups%name)))
    call take_output(groups(place_of("output", groups%name)))
    call check_conflicts(settings, groups, must_end, problems)

  contains

    !> Sets title, seed and numerical method.
    subroutine take_run(group)
      type(group_t), intent(in) :: group

      associate (run => settings%run)
        run%title = group%text_of("title")
        run%seed = group%integer_of("seed", 1_int64)
        run%dynamics = group%text_of("dynamics")
        run%dt = group%real_of("dt", 0.0_real64)
        run%search = group%text_of("search")
        run%queue = group%text_of("queue")
        run%threads = int(group%integer_of("threads", 0_int64))
        if (run%dynamics == "steps" .and. .not. group%given("dt")) &
          call group%complain("dt", "is missing; dynamics = 'steps' needs it", problems)
      end associate
    end subroutine take_run

    !> Sets up the box without its obstacles.
    subroutine take_box(group)
      type(group_t), intent(in) :: group
      integer :: axis

      settings%box = box_t()
      associate (box => settings%box)
        box%lower = group%reals_of("lower")
        box%upper = group%reals_of("upper")
        box%gravity = group%reals_of("gravity")
        box%shear_rate = group%real_of("shear_rate", 0.0_real64)
        box%periodic = group%values(row_of("box", "boundary"))%texts == "periodic"
        do axis = 1, 2
          if (box%lower(axis) >= box%upper(axis)) call group%complain("upper", written(box%upper(axis))// &
            " is not above box.lower, "//written(box%lower(axis))//", along "//merge("x", "y", axis == 1), problems)
        end do
      end associate
    end subroutine take_box

    !> Sets the coefficients of restitution for each pair of species, and the default contact law of walls.
    subroutine take_contact(group, n)
      type(group_t), intent(inout) :: group
      integer, intent(in) :: n                            !! number of species
      real(real64), allocatable :: pairs(:)
      real(real64) :: restitution

      associate (law => settings%law)
        restitution = group%real_of("restitution", 1.0_real64)
        wall_law%restitution = group%real_of("wall_restitution", restitution)
        wall_law%rule = place_of(group%text_of("wall_rule"), words_of(wall_rules))
        law%by_speed%speed = group%real_of("reference_speed", 0.0_real64)
        law%by_speed%c = series_terms(max(1, place_of(group%text_of("restitution_law"), words_of(restitution_laws))))
        wall_law%by_speed = law%by_speed
        call check_least(group, "restitution", law%by_speed, problems)
        call check_least(group, "wall_restitution", law%by_speed, problems)
        call check_least(group, "pair_restitution", law%by_speed, problems)
        call take_grip(group, "", tangential_law_t(), law%tangential, problems)
        call take_grip(group, "wall_", law%tangential, wall_law%tangential, problems)
        law%inertia = group%real_of("inertia", 0.5_real64)
        law%contact_time = group%real_of("contact_time", 0.0_real64)
        call group%put_reals("wall_restitution", [wall_law%restitution])
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
      end associate
    end subroutine take_contact

    !> Sets the kind and the strength of the driving, and the driven species.
    subroutine take_drive(group)
      type(group_t), intent(in) :: group
      character(len=:), allocatable :: wanted

      associate (drive => settings%drive, known => names_of(settings%species))
        drive%kind = place_of(group%text_of("kind"), words_of(drive_kinds))
        drive%interval = group%real_of("interval", never)
        drive%strength = group%real_of("strength", 0.0_real64)
        drive%keep_momentum = drive%kind == noise .and. group%text_of("keep_momentum") == ".true."
        drive%fraction = group%real_of("fraction", 1.0_real64)
        drive%temperature = group%real_of("temperature", 0.0_real64)
        drive%speed = group%real_of("self_propulsion_speed", 0.0_real64)
        drive%rotational_diffusion = group%real_of("rotational_diffusion", 0.0_real64)
        if (drive%moves_disks()) call take_regions(group)
        wanted = group%text_of("species")
        if (wanted == "") return
        drive%species = place_of(wanted, known)
        if (drive%species == 0) &
          call group%complain("species", "there is no species "//shown(wanted)//"; "//suggestion(wanted, known), problems)
      end associate
    end subroutine take_drive

    !> Sets the regions and the velocity of recycled disks.
    subroutine take_regions(group)
      type(group_t), intent(in) :: group

      associate (drive => settings%drive)
        if (group%given("velocity")) drive%velocity = group%reals_of("velocity")
        if (group%given("from_region")) drive%from_region = group%reals_of("from_region")
        if (group%given("to_region")) drive%to_region = group%reals_of("to_region")
      end associate
    end subroutine take_regions

    !> Sets the stop rules.
    subroutine take_stop(group)
      type(group_t), intent(in) :: group

      associate (rule => settings%stop)
        rule%time = group%real_of("time", never)
        rule%collisions = group%integer_of("collisions", unlimited)
        rule%collisions_per_disk = group%real_of("collisions_per_disk", never)
        rule%events = group%integer_of("events", unlimited)
        rule%energy_fraction = group%real_of("energy_fraction", 0.0_real64)
        rule%wall_clock = group%real_of("wall_clock", never)
        rule%at_rest = group%text_of("at_rest") == ".true."
        if (must_end .and. count(group%values%given) == merge(1, 0, group%given("at_rest") .and. .not. rule%at_rest)) &
          call problems%add(group%line, "stop", "no rule ends the run; give at least one of "//joined(variables_of("stop"), ", "))
      end associate
    end subroutine take_stop

    !> Sets the contents of the output and the sampling schedules.
    subroutine take_output(group)
      type(group_t), intent(in) :: group
      integer :: k

      do k = 1, size(sampled)
        call take_sampling(group, trim(sampled(k)), settings%output%sampling(k))
      end do
      if (group%given("decades_from") .and. all(settings%output%sampling%per_decade == 0)) call group%complain("decades_from", &
        "has no effect without frames_per_decade or observables_per_decade", problems)
      associate (output => settings%output)
        k = row_of("output", "frame_columns")
        if (group%values(k)%is_set()) output%frame_columns = group%values(k)%texts
        output%single_precision = group%text_of("precision") == "single"
        output%event_log = group%text_of("event_log") == ".true."
        output%virial_tensor = group%text_of("virial_tensor") == ".true."
        output%helfand = group%text_of("helfand") == ".true."
        output%checkpoint_every = group%real_of("checkpoint_every", never)
      end associate
    end subroutine take_output

    !> Sets the sampling schedule of frames or observables.
    subroutine take_sampling(group, what, sampling)
      type(group_t), intent(in) :: group
      character(len=*), intent(in) :: what                !! one of `sampled`
      type(sampling_t), intent(out) :: sampling
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
  end subroutine resolve_settings

  !> Reports settings of different groups that cannot be combined, and intervals that are too short. The module `input_groups`
  !> reports variables of the same group that exclude each other.
  subroutine check_conflicts(settings, groups, must_end, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    logical, intent(in) :: must_end                       !! .true. if the input must contain a stop rule
    type(problem_list_t), intent(inout) :: problems
    character(len=*), parameter :: other_rule = "; give another rule", energy = "stop.energy_fraction", &
      rest = "stop.at_rest"
    logical :: shear, timed, counted, by_energy, single, alone

    associate (box => settings%box, law => settings%law, rule => settings%stop, kicks => settings%drive%is_on())
      shear = box%is_sheared()
      by_energy = rule%energy_fraction > 0
      timed = min(rule%time, rule%wall_clock) < never .or. .not. must_end
      counted = rule%collisions < unlimited .or. rule%collisions_per_disk < never
      single = settings%n_disks() == 1
      alone = single .and. all(box%periodic) .and. .not. box%has_obstacles()
      call refuse(any(box%periodic .and. abs(box%gravity) > 0), "box.gravity", "a periodic axis along it (box.boundary): disks " &
        //"would fall for ever; make its sides walls")
      call refuse(shear .and. .not. all(box%periodic), "box.shear_rate", "walls; make box.boundary 'periodic', 'periodic'")
      call refuse(shear .and. box%has_gravity(), "box.shear_rate", "box.gravity")
      call refuse(shear .and. any(groups%name == "obstacle"), "box.shear_rate", "&obstacle")
      call refuse(shear .and. any(groups%name == "wall"), "box.shear_rate", "&wall")
      call refuse(shear .and. settings%run%dynamics == "steps", "box.shear_rate", "run.dynamics = 'steps'")
      call refuse(settings%run%dynamics == "steps" .and. any(box%surface%motion%kind == piston), "run.dynamics", &
        "side.motion = 'piston'")
      call refuse(settings%output%helfand .and. box%has_gravity(), "output.helfand", &
        "box.gravity: velocities change between collisions")
      call refuse(settings%output%helfand .and. shear, "output.helfand", &
        "box.shear_rate: velocities change at its periodic boundary")
      call refuse(by_energy .and. shear, energy, "box.shear_rate: the shear does work"//other_rule)
      call refuse(by_energy .and. kicks, energy, "drive.kind: kicks change the energy"//other_rule)
      call refuse(by_energy .and. box%gives_energy() .and. .not. shear, energy, "walls that give energy, by temperature, " &
        //"surface_velocity or motion of &side, &obstacle or &wall"//other_rule)
      call refuse(by_energy .and. .not. (timed .or. counted .or. rule%events < unlimited .or. law%loses_energy() .or. kicks &
        .or. box%has_lossy_walls() .or. box%gives_energy()), energy, "elastic collisions"//other_rule//", or a restitution below 1")
      call refuse(rule%at_rest .and. settings%run%dynamics == "steps", rest, &
        "run.dynamics = 'steps': the end of bounces has no defined time"//other_rule)
      call refuse(rule%at_rest .and. law%contact_time > 0, rest, "contact.contact_time: bounces then never end"//other_rule)
      call refuse(rule%at_rest .and. shear, rest, "box.shear_rate: driven disks never come to rest"//other_rule)
      call refuse(rule%at_rest .and. kicks, rest, "drive.kind: driven disks never come to rest"//other_rule)
      call refuse(rule%at_rest .and. box%gives_energy() .and. .not. shear, rest, "walls that give energy, by temperature, " &
        //"surface_velocity or motion of &side, &obstacle or &wall"//other_rule)
      call refuse(rule%at_rest .and. .not. (law%loses_energy() .or. box%has_lossy_walls()), rest, &
        "elastic collisions"//other_rule//", or a restitution below 1")
      call refuse(single .and. counted .and. .not. (timed .or. by_energy .or. rule%events < unlimited), "stop.collisions", &
        "a single disk (species.count), which has no collision partner; give time or events")
      call refuse(settings%drive%keep_momentum .and. settings%n_driven() == 1, "drive.keep_momentum", &
        "a single driven disk, whose velocity would never change; set it to .false.")
      call refuse(shear .and. settings%drive%moves_disks(), "box.shear_rate", "drive.kind = 'recycle'")
      call refuse(settings%output%helfand .and. settings%drive%moves_disks(), "output.helfand", &
        "drive.kind = 'recycle': recycled disks jump")
      call refuse(alone .and. (shear .or. kicks) .and. .not. timed, "stop", &
        "a single disk in a periodic box that is sheared (box.shear_rate) or driven (drive.kind): no event ever occurs; give time")
    end associate
    call check_columns()
    call check_relaxed()
    if (settings%run%dynamics == "steps") call limit("run", "dt", "steps", 1.0e18_real64)
    call limit("drive", "interval", "kicks", 1.0e15_real64)
    call limit("output", "frames_every_time", "samples", 1.0e9_real64)
    call limit("output", "observables_every_time", "samples", 1.0e9_real64)

  contains

    !> Reports columns of the frames that output.frame_columns names twice.
    subroutine check_columns()
      integer :: g, k

      g = place_of("output", groups%name)
      if (g == 0 .or. .not. allocated(settings%output%frame_columns)) return
      associate (columns => settings%output%frame_columns)
        do k = 1, size(columns)
          if (any(columns(:k - 1) == columns(k))) call groups(g)%complain("frame_columns", &
            "'"//trim(columns(k))//"' is named twice", problems)
        end do
      end associate
    end subroutine check_columns

    !> Checks the conditions for placement = 'relaxed'. Event chains move all disks of the run, and require a box without obstacles
    !> and moving sides. The chains sample the uniform distribution of positions, which is the equilibrium distribution only without
    !> gravity.
    subroutine check_relaxed()
      character(len=*), parameter :: with = "'relaxed' cannot be combined with "
      logical :: relaxed(size(settings%species))
      real(real64) :: whole(4)
      integer :: s(2), k, other

      s = range_of(groups, ["species"])
      associate (species => settings%species, own => groups(s(1):s(2)), box => settings%box)
        relaxed = [(species(k)%placement == "relaxed", k=1, size(species))]
        if (.not. any(relaxed)) return
        whole = [box%lower(1), box%upper(1), box%lower(2), box%upper(2)]
        k = findloc(relaxed, .true., dim=1)
        other = findloc(relaxed, .false., dim=1)
        if (other > 0) call own(k)%complain("placement", "'relaxed' applies to all species of a run; """//species(other)%name &
          //""" has placement = '"//species(other)%placement//"'", problems)
        if (any(groups%name == "obstacle")) call own(k)%complain("placement", with//"&obstacle", problems)
        if (any(groups%name == "wall")) call own(k)%complain("placement", with//"&wall", problems)
        if (any(box%surface(:n_sides)%motion%moves())) call own(k)%complain("placement", with//"sides that move (side.motion) " &
          //"or are displaced (side.position)", problems)
        if (box%has_gravity()) call own(k)%complain("placement", with//"box.gravity: in equilibrium the density would depend on " &
          //"the height", problems)
        do k = 1, size(species)
          if (relaxed(k) .and. any(abs(species(k)%region - whole) > 0)) call own(k)%complain("region", "must be the whole box " &
            //"with placement = 'relaxed'", problems)
        end do
      end associate
    end subroutine check_relaxed

    !> Reports that a variable or group cannot be combined with another setting, if both are present.
    subroutine refuse(together, variable, other)
      logical, intent(in) :: together                     !! .true. if both settings are present
      character(len=*), intent(in) :: variable, other
      integer :: dot

      if (.not. together) return
      dot = index(variable//".", ".")
      associate (group => groups(place_of(variable(:dot - 1), groups%name)), what => "cannot be combined with "//other)
        if (dot < len(variable)) call group%complain(variable(dot + 1:), what, problems)
        if (dot > len(variable)) call problems%add(group%line, variable, what)
      end associate
    end subroutine refuse

    !> Reports an interval that is too short, because more than `most` intervals would elapse before stop.time.
    subroutine limit(group, name, of_what, most)
      character(len=*), intent(in) :: group, name, of_what
      real(real64), intent(in) :: most
      real(real64) :: number

      if (settings%stop%time >= never) return
      associate (own => groups(place_of(group, groups%name)))
        number = settings%stop%time/own%real_of(name, never)
        if (number > most) call own%complain(name, written(number)//" "//of_what &
          //" until stop.time; allowed: up to "//written(most), problems)
      end associate
    end subroutine limit
  end subroutine check_conflicts

end module input_settings
