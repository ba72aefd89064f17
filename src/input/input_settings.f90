!> From the values of the input to `settings`: what follows from what, and what contradicts what.
module input_settings
  use kinds, only: int64, never, real64
  use box_geometry, only: box_t
  use collisions, only: contact_law_t, grip_t, normal_rule, wall_law_t, wall_rules
  use disks, only: names_of
  use drive, only: active, drive_kinds, drive_t
  use input_surfaces, only: refuse_grip, take_grip, take_obstacles, take_wall_laws
  use input_problems, only: problem_list_t
  use input_species, only: take_species
  use input_groups, only: group_t, range_of
  use variables, only: obstacle_groups, row_of, track_of, variables_of, words_of
  use settings, only: output_settings_t, run_settings_t, settings_t, species_settings_t
  use stop_rules, only: stop_settings_t
  use texts, only: counted, joined, place_of, shown, suggestion, written
  implicit none
  private
  public :: resolve_settings

  integer(int64), parameter :: unlimited = huge(1_int64)

contains

  !> Fills the settings. Values that follow from others are also put back into the groups, so that
  !> these hold every value as it is used.
  subroutine resolve_settings(groups, settings, problems)
    type(group_t), intent(inout) :: groups(:)   !! those of one name side by side
    type(settings_t), intent(out) :: settings
    type(problem_list_t), intent(inout) :: problems
    type(wall_law_t) :: wall_law                          ! of `&contact`
    integer :: o(2), s(2), w(2)

    o = range_of(groups, obstacle_groups)
    w = range_of(groups, ["side"])
    s = range_of(groups, ["species"])
    call take_run(groups(place_of("run", groups%name)), settings%run, problems)
    call take_box(groups(place_of("box", groups%name)), settings%box, problems)
    call take_obstacles(groups(o(1):o(2)), settings%box, problems)
    call take_species(groups(s(1):s(2)), settings%box, settings%species, problems)
    call take_contact(groups(place_of("contact", groups%name)), size(settings%species), settings%law, wall_law, problems)
    call take_wall_laws(groups(w(1):w(2)), groups(o(1):o(2)), wall_law, settings%box, problems)
    call take_drive(groups(place_of("drive", groups%name)), settings%species, settings%drive, problems)
    call take_stop(groups(place_of("stop", groups%name)), settings%stop, problems)
    call take_output(groups(place_of("output", groups%name)), settings%output)
    call check_cadences(groups(place_of("output", groups%name)), problems)
    call settle_features(settings, problems)
    call check_samples(groups(place_of("output", groups%name)), settings, problems)
    if (settings%drive%is_on()) call check_drive(groups(place_of("drive", groups%name)), settings, problems)
    call check_end(settings, problems)
    call check_shear(groups(place_of("box", groups%name)), groups(o(1):o(2))%name, settings, problems)
  end subroutine resolve_settings

  !> Title, seed and method.
  subroutine take_run(group, run, problems)
    type(group_t), intent(in) :: group
    type(run_settings_t), intent(out) :: run
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

  !> The box without its obstacles.
  subroutine take_box(group, box, problems)
    type(group_t), intent(in) :: group
    type(box_t), intent(out) :: box
    type(problem_list_t), intent(inout) :: problems
    integer :: axis

    box = box_t()
    box%lower = group%reals_of("lower")
    box%upper = group%reals_of("upper")
    box%gravity = group%reals_of("gravity")
    box%shear_rate = group%real_of("shear_rate", 0.0_real64)
    box%periodic = group%values(row_of("box", "boundary"))%texts == "periodic"
    if (any(box%periodic .and. abs(box%gravity) > 0)) call group%complain("gravity", "acts along a periodic axis (box.boundary), " &
      //"where disks would fall for ever; make the sides of that axis walls, or set the component to 0", problems)
    do axis = 1, 2
      if (box%lower(axis) >= box%upper(axis)) call group%complain("upper", written(box%upper(axis))// &
        " is not above box.lower, "//written(box%lower(axis))//", along "//merge("x", "y", axis == 1), problems)
    end do
  end subroutine take_box

  !> What a sheared box cannot have beside its shear.
  subroutine check_shear(group, obstacles, settings, problems)
    type(group_t), intent(in) :: group          !! &box
    character(len=*), intent(in) :: obstacles(:)          !! names of the groups that describe obstacles
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    if (.not. settings%box%is_sheared()) return
    if (.not. all(settings%box%periodic)) call refuse("walls: it needs box.boundary = 'periodic', 'periodic'")
    if (settings%box%falling()) call refuse("box.gravity")
    do k = 1, size(obstacle_groups)
      if (any(obstacles == obstacle_groups(k))) call refuse("&"//trim(obstacle_groups(k)))
    end do
    if (settings%run%dynamics /= "events") call refuse("run.dynamics = '"//settings%run%dynamics//"'")
    if (settings%stop%energy_fraction > 0) call refuse("stop.energy_fraction: the shear does work")

  contains

    !> Reports what it does not go with.
    subroutine refuse(what)
      character(len=*), intent(in) :: what

      call group%complain("shear_rate", "does not go with "//what, problems)
    end subroutine refuse
  end subroutine check_shear

  !> Restitution by pair of species, and the rule for walls.
  subroutine take_contact(group, n, law, wall_law, problems)
    type(group_t), intent(inout) :: group
    integer, intent(in) :: n                              !! species
    type(contact_law_t), intent(out) :: law
    type(wall_law_t), intent(out) :: wall_law
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: pairs(:)
    real(real64) :: restitution

    restitution = group%real_of("restitution", 1.0_real64)
    wall_law%restitution = group%real_of("wall_restitution", restitution)
    wall_law%rule = place_of(group%text_of("wall_rule"), words_of(wall_rules))
    call take_grip(group, "", grip_t(), law%grip, problems)
    call take_grip(group, "wall_", law%grip, wall_law%grip, problems)
    if (wall_law%rule /= normal_rule) call refuse_grip(group, "wall_", problems)
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
  end subroutine take_contact

  !> What disks can do follows from all that the input says; what excludes each other is refused.
  subroutine settle_features(settings, problems)
    type(settings_t), intent(inout) :: settings
    type(problem_list_t), intent(inout) :: problems

    associate (law => settings%law, box => settings%box)
      law%rotation = law%grip%is_rough() .or. box%has_rough_walls() .or. any(abs(settings%species%angular_velocity) > 0) &
        .or. any(settings%species%rotational_temperature >= 0)
      law%orientation = settings%drive%kind == active
      law%detailed = law%rotation .or. box%gives_energy() .or. settings%drive%is_on() .or. settings%output%virial_tensor
      if (settings%stop%energy_fraction > 0 .and. box%gives_energy() .and. .not. box%is_sheared()) &
        call problems%add(0, "stop.energy_fraction", "cannot be told where walls give energy, by temperature, speed or " &
        //"motion of &side, &obstacle or &wall; give another rule")
    end associate
  end subroutine settle_features

  !> What ends the run; at least one rule is needed.
  subroutine take_stop(group, stop_rules, problems)
    type(group_t), intent(in) :: group
    type(stop_settings_t), intent(out) :: stop_rules
    type(problem_list_t), intent(inout) :: problems

    stop_rules%time = group%real_of("time", never)
    stop_rules%collisions = group%integer_of("collisions", unlimited)
    stop_rules%collisions_per_disk = group%real_of("collisions_per_disk", never)
    stop_rules%events = group%integer_of("events", unlimited)
    stop_rules%energy_fraction = group%real_of("energy_fraction", 0.0_real64)
    stop_rules%wall_clock = group%real_of("wall_clock", never)
    if (.not. any(group%values%given)) call problems%add(group%line, "stop", "no rule ends the run; give at least " &
      //"one of "//joined(variables_of("stop"), ", "))
  end subroutine take_stop

  !> What is written, and when.
  subroutine take_output(group, output)
    type(group_t), intent(in) :: group
    type(output_settings_t), intent(out) :: output

    output%frames_every_time = group%real_of("frames_every_time", never)
    output%frames_every_collisions = group%integer_of("frames_every_collisions", unlimited)
    output%frames_every_events = group%integer_of("frames_every_events", unlimited)
    output%frames_every_collisions_per_disk = group%real_of("frames_every_collisions_per_disk", never)
    output%observables_every_time = group%real_of("observables_every_time", never)
    output%observables_every_collisions = group%integer_of("observables_every_collisions", unlimited)
    output%observables_every_events = group%integer_of("observables_every_events", unlimited)
    output%observables_every_collisions_per_disk = group%real_of("observables_every_collisions_per_disk", never)
    output%single_precision = group%text_of("precision") == "single"
    output%event_log = group%text_of("event_log") == ".true."
    output%virial_tensor = group%text_of("virial_tensor") == ".true."
    output%checkpoint_every = group%real_of("checkpoint_every", never)
  end subroutine take_output

  !> Frames and observables have one cadence each.
  subroutine check_cadences(group, problems)
    type(group_t), intent(in) :: group          !! &output
    type(problem_list_t), intent(inout) :: problems
    integer :: j, k

    do k = 2, size(group%values)
      if (.not. group%values(k)%given .or. track_of(group%values(k)%name) == "") cycle
      do j = 1, k - 1
        if (group%values(j)%given .and. track_of(group%values(j)%name) == track_of(group%values(k)%name)) exit
      end do
      if (j < k) call group%complain(trim(group%values(k)%name), "is given with "//trim(group%values(j)%name) &
        //"; give one of them", problems)
    end do
  end subroutine check_cadences

  !> A cadence in time, or a time step, must be coarse enough for the clock and for a sane number of samples.
  subroutine check_samples(group, settings, problems)
    type(group_t), intent(in) :: group          !! &output
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    character(len=*), parameter :: names(2) = [character(len=22) :: "frames_every_time", "observables_every_time"]
    real(real64), parameter :: most = 1.0e9_real64
    real(real64) :: number
    integer :: k

    if (settings%stop%time >= never) return
    do k = 1, 2
      number = settings%stop%time/group%real_of(names(k), never)
      if (number > most) call group%complain(trim(names(k)), &
        written(number)//" samples until stop.time; allowed: up to "//written(most), problems)
    end do
    if (settings%run%dynamics /= "steps" .or. .not. settings%run%dt > 0) return
    number = settings%stop%time/settings%run%dt
    if (number > most**2) &
      call problems%add(0, "run.dt", written(number)//" steps until stop.time; allowed: up to "//written(most**2))
  end subroutine check_samples

  !> Kind and size of the kicks, and whom they reach.
  subroutine take_drive(group, species, drive, problems)
    type(group_t), intent(inout) :: group
    type(species_settings_t), intent(in) :: species(:)
    type(drive_t), intent(out) :: drive
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: wanted

    call group%check_choices(problems)
    drive%kind = place_of(group%text_of("kind"), words_of(drive_kinds))
    drive%interval = group%real_of("interval", never)
    drive%strength = group%real_of("strength", 0.0_real64)
    drive%keep_momentum = group%text_of("keep_momentum") == ".true."
    drive%fraction = group%real_of("fraction", 1.0_real64)
    drive%temperature = group%real_of("temperature", 0.0_real64)
    drive%speed = group%real_of("speed", 0.0_real64)
    drive%rotational_diffusion = group%real_of("rotational_diffusion", 0.0_real64)
    wanted = group%text_of("species")
    if (wanted == "") return
    drive%species = place_of(wanted, names_of(species))
    if (drive%species == 0) call group%complain("species", "there is no species "//shown(wanted)//"; " &
      //suggestion(wanted, names_of(species)), problems)
  end subroutine take_drive

  !> What cannot go together with kicks. Nothing tells when an energy that they change has fallen for good, and a number of
  !> kicks must be countable.
  subroutine check_drive(group, settings, problems)
    type(group_t), intent(in) :: group          !! &drive
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    real(real64), parameter :: most = 1.0e15_real64
    real(real64) :: number

    if (settings%stop%energy_fraction > 0) call problems%add(0, "stop.energy_fraction", &
      "cannot be used with drive.kind = '"//group%text_of("kind")//"', as kicks change the energy; give another rule")
    number = 0
    if (settings%stop%time < never) number = settings%stop%time/settings%drive%interval
    if (number > most) call group%complain("interval", &
      written(number)//" kicks until stop.time; allowed: up to "//written(most), problems)
  end subroutine check_drive

  !> Whether the run can end at all: one disk meets no other, and elastic collisions cost no energy.
  subroutine check_end(settings, problems)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    logical :: by_collisions

    associate (stop_rules => settings%stop, law => settings%law, box => settings%box)
      if (min(stop_rules%time, stop_rules%wall_clock) < never) return
      if ((settings%drive%is_on() .or. box%is_sheared()) .and. settings%n_disks() == 1 .and. all(box%periodic) &
        .and. .not. box%has_obstacles()) call problems%add(0, "stop", "a single disk in a periodic box that is sheared " &
        //"(box.shear_rate) or where disks are kicked (drive.kind) meets nothing, for ever; give time")
      if (stop_rules%events < unlimited) return
      by_collisions = stop_rules%collisions < unlimited .or. stop_rules%collisions_per_disk < never
      if (stop_rules%energy_fraction > 0 .and. .not. settings%drive%is_on()) then
        if (by_collisions .or. law%loses_energy() .or. box%has_lossy_walls() &
          .or. box%gives_energy()) return
        call problems%add(0, "stop.energy_fraction", &
          "is never reached by elastic collisions; give another rule, or a restitution below 1")
      else if (by_collisions .and. settings%n_disks() == 1) then
        call problems%add(0, "stop", "a single disk never collides with another; give time or events")
      end if
    end associate
  end subroutine check_end

end module input_settings
