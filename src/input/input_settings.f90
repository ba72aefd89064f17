!> From the values of the input to `settings`: what follows from what, and what contradicts what.
module input_settings
  use kinds, only: int64, never, real64
  use input_checks, only: check_geometry
  use input_problems, only: problem_list_t
  use input_species, only: check_name, take_species
  use parameter_values, only: parameter_group_t
  use parameters, only: row_of
  use settings, only: box_settings_t, contact_settings_t, obstacle_settings_t, output_settings_t, &
    run_settings_t, settings_t, species_settings_t
  use stop_rules, only: stop_settings_t
  use texts, only: shown, written
  implicit none
  private
  public :: resolve_settings

  integer(int64), parameter :: unlimited = huge(1_int64)
  real(real64), parameter :: none(0) = [real(real64) ::]

contains

  !> Fills the settings. Values that follow from others are also put back into the groups, so that
  !> these hold everything as it is used.
  subroutine resolve_settings(groups, settings, problems)
    type(parameter_group_t), intent(inout) :: groups(:)   !! those of one name side by side
    type(settings_t), intent(out) :: settings
    type(problem_list_t), intent(inout) :: problems
    integer :: k, o(2), s(2)

    o = range_of(groups, "obstacle")
    s = range_of(groups, "species")
    do k = 1, size(groups)
      select case (groups(k)%name)
      case ("run")
        call take_run(groups(k), settings%run, problems)
      case ("box")
        call take_box(groups(k), settings%box, problems)
      case ("stop")
        call take_stop(groups(k), settings%stop, problems)
      case ("output")
        call take_output(groups(k), settings%output)
        call check_cadences(groups(k), settings, problems)
      case default   ! below: they need those above
      end select
    end do
    call take_obstacles(groups(o(1):o(2)), settings%obstacles, problems)
    call take_species(groups(s(1):s(2)), settings%box, settings%species, problems)
    do k = 1, size(groups)
      if (groups(k)%name == "contact") call take_contact(groups(k), settings%species, settings%contact, problems)
    end do
    call check_geometry(groups(o(1):o(2)), groups(s(1):s(2)), settings, problems)
    call check_end(settings, problems)
  end subroutine resolve_settings

  !> First and last of the groups of one name; the last before the first if there are none.
  pure function range_of(groups, name) result(range)
    type(parameter_group_t), intent(in) :: groups(:)
    character(len=*), intent(in) :: name
    integer :: range(2)
    integer :: k

    range = [1, count(groups%name == name)]
    do k = 1, size(groups)
      if (groups(k)%name == name) exit
      range = range + 1
    end do
  end function range_of

  subroutine take_run(group, run, problems)
    type(parameter_group_t), intent(in) :: group
    type(run_settings_t), intent(out) :: run
    type(problem_list_t), intent(inout) :: problems

    run%title = group%text_of("title")
    run%seed = group%integer_of("seed", 1_int64)
    run%dynamics = group%text_of("dynamics")
    run%dt = group%real_of("dt", 0.0_real64)
    run%search = group%text_of("search")
    run%queue = group%text_of("queue")
    if (run%dynamics == "steps" .and. .not. group%given("dt")) then
      call problems%add(group%line_of("dynamics"), "run.dt", "is needed by dynamics = 'steps'")
    end if
  end subroutine take_run

  subroutine take_box(group, box, problems)
    type(parameter_group_t), intent(in) :: group
    type(box_settings_t), intent(out) :: box
    type(problem_list_t), intent(inout) :: problems
    integer :: axis

    box%lower = group%reals_of("lower", none)
    box%upper = group%reals_of("upper", none)
    box%gravity = group%reals_of("gravity", none)
    box%periodic = group%values(row_of("box", "boundary"))%texts == "periodic"
    if (any(box%periodic .and. abs(box%gravity) > 0)) call problems%add(group%line_of("gravity"), &
      "box.gravity", "has no floor to pull to along a periodic axis: disks would fall for ever; " &
      //"make that axis a wall, or the component 0")
    do axis = 1, 2
      if (box%lower(axis) < box%upper(axis)) cycle
      call problems%add(group%line_of(merge("upper", "lower", group%given("upper"))), "box.upper", &
        written(box%upper(axis))//" is not above box.lower, "//written(box%lower(axis))// &
        ", along "//merge("x", "y", axis == 1))
    end do
  end subroutine take_box

  subroutine take_obstacles(groups, obstacles, problems)
    type(parameter_group_t), intent(in) :: groups(:)
    type(obstacle_settings_t), allocatable, intent(out) :: obstacles(:)
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    allocate (obstacles(size(groups)))
    do k = 1, size(groups)
      obstacles(k)%name = trim(groups(k)%instance)
      obstacles(k)%centre = groups(k)%reals_of("centre", [0.0_real64, 0.0_real64])
      obstacles(k)%radius = groups(k)%real_of("radius", 0.0_real64)
      obstacles(k)%inside = groups(k)%text_of("side") == "inside"
      call check_name(groups, k, problems)
      if (.not. groups(k)%given("centre")) call problems%add(groups(k)%line, "obstacle.centre", "is missing; 2 numbers")
      if (.not. groups(k)%given("radius")) &
        call problems%add(groups(k)%line, "obstacle.radius", "is missing; a number > 0")
    end do
  end subroutine take_obstacles

  subroutine take_contact(group, species, contact, problems)
    type(parameter_group_t), intent(inout) :: group
    type(species_settings_t), intent(in) :: species(:)
    type(contact_settings_t), intent(out) :: contact
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: pairs(:)
    real(real64) :: restitution
    integer :: n

    n = size(species)
    restitution = group%real_of("restitution", 1.0_real64)
    contact%wall_restitution = group%real_of("wall_restitution", restitution)
    contact%smooth_walls = group%text_of("wall_rule") == "normal"
    contact%contact_time = group%real_of("contact_time", 0.0_real64)
    call group%put_reals("wall_restitution", [contact%wall_restitution])
    allocate (contact%restitution(n, n), source=restitution)
    pairs = group%reals_of("pair_restitution", none)
    if (size(pairs) == 0 .or. n == 0) return
    if (size(pairs) /= n**2) then
      call problems%add(group%line_of("pair_restitution"), "contact.pair_restitution", &
        written(size(pairs))//" values; "//written(n)//" species have "//written(n**2)//" pairs")
      return
    end if
    contact%restitution = reshape(pairs, [n, n])
    if (any(contact%restitution /= transpose(contact%restitution))) then
      call problems%add(group%line_of("pair_restitution"), "contact.pair_restitution", &
        "must be symmetric: the value for species a and b is the value for b and a")
    end if
  end subroutine take_contact

  subroutine take_stop(group, stop_rules, problems)
    type(parameter_group_t), intent(in) :: group
    type(stop_settings_t), intent(out) :: stop_rules
    type(problem_list_t), intent(inout) :: problems

    stop_rules%time = group%real_of("time", never)
    stop_rules%collisions = group%integer_of("collisions", unlimited)
    stop_rules%collisions_per_disk = group%real_of("collisions_per_disk", never)
    stop_rules%events = group%integer_of("events", unlimited)
    stop_rules%energy_fraction = group%real_of("energy_fraction", 0.0_real64)
    stop_rules%wall_clock = group%real_of("wall_clock", never)
    if (.not. any(group%values%given)) then
      call problems%add(group%line, "stop", "no rule ends the run; give at least one of time, "// &
        "collisions, collisions_per_disk, events, energy_fraction, wall_clock")
    end if
  end subroutine take_stop

  !> Whether the run can end at all: one disk meets no other, and elastic collisions cost no energy.
  subroutine check_end(settings, problems)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    logical :: alone, elastic

    associate (stop_rules => settings%stop)
      if (min(stop_rules%time, stop_rules%wall_clock) < never .or. stop_rules%events < unlimited) return
      alone = sum(settings%species%count) == 1 .and. stop_rules%energy_fraction <= 0
      elastic = stop_rules%energy_fraction > 0 .and. stop_rules%collisions == unlimited &
        .and. .not. stop_rules%collisions_per_disk < never &
        .and. all(settings%contact%restitution >= 1) .and. settings%contact%wall_restitution >= 1
      if (alone .and. (stop_rules%collisions < unlimited .or. stop_rules%collisions_per_disk < never)) &
        call problems%add(0, "stop", "one disk never collides with another; give time or events")
      if (elastic) call problems%add(0, "stop.energy_fraction", &
        "is never reached by elastic collisions; give another rule, or a restitution below 1")
    end associate
  end subroutine check_end

  subroutine take_output(group, output)
    type(parameter_group_t), intent(in) :: group
    type(output_settings_t), intent(out) :: output

    output%frames_every_time = group%real_of("frames_every_time", never)
    output%frames_every_collisions = group%integer_of("frames_every_collisions", unlimited)
    output%frames_every_events = group%integer_of("frames_every_events", unlimited)
    output%observables_every_time = group%real_of("observables_every_time", never)
    output%observables_every_collisions = group%integer_of("observables_every_collisions", unlimited)
    output%observables_every_events = group%integer_of("observables_every_events", unlimited)
    output%single_precision = group%text_of("precision") == "single"
    output%event_log = group%logical_of("event_log")
    output%checkpoint_every = group%real_of("checkpoint_every", never)
  end subroutine take_output

  !> A cadence in time must be one that the clock can resolve, and give a sane number of samples.
  subroutine check_cadences(group, settings, problems)
    type(parameter_group_t), intent(in) :: group
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    character(len=*), parameter :: names(2) = [character(len=22) :: &
      "frames_every_time", "observables_every_time"]
    real(real64), parameter :: most = 1.0e9_real64
    real(real64) :: samples
    integer :: k

    if (settings%stop%time >= never) return
    do k = 1, 2
      samples = settings%stop%time/group%real_of(names(k), never)
      if (samples > most) call problems%add(group%line_of(names(k)), "output."//names(k), &
        written(samples)//" samples until stop.time; allowed: up to "//written(most))
    end do
    samples = settings%stop%time/max(settings%run%dt, 1.0_real64/never)
    if (settings%run%dynamics == "steps" .and. settings%run%dt > 0 .and. samples > most**2) then
      call problems%add(0, "run.dt", written(samples)//" steps until stop.time; allowed: up to "//written(most**2))
    end if
  end subroutine check_cadences

end module input_settings
