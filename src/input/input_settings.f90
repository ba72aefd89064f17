!> From the values of the input to `settings`: what follows from what, and what contradicts what.
module input_settings
  use kinds, only: int64, never, real64
  use box_geometry, only: box_t
  use collisions, only: contact_law_t, wall_rules
  use input_obstacles, only: take_obstacles
  use input_problems, only: problem_list_t
  use input_species, only: take_species
  use parameter_values, only: parameter_group_t, range_of
  use parameters, only: obstacle_groups, row_of, words_of
  use settings, only: output_settings_t, run_settings_t, settings_t
  use stop_rules, only: stop_settings_t
  use texts, only: counted, place_of, written
  implicit none
  private
  public :: resolve_settings

  integer(int64), parameter :: unlimited = huge(1_int64)

contains

  !> Fills the settings. Values that follow from others are also put back into the groups, so that
  !> these hold every value as it is used.
  subroutine resolve_settings(groups, settings, problems)
    type(parameter_group_t), intent(inout) :: groups(:)   !! those of one name side by side
    type(settings_t), intent(out) :: settings
    type(problem_list_t), intent(inout) :: problems
    integer :: o(2), s(2)

    o = range_of(groups, obstacle_groups)
    s = range_of(groups, ["species"])
    call take_run(groups(place_of("run", groups%name)), settings%run, problems)
    call take_box(groups(place_of("box", groups%name)), settings%box, problems)
    call take_obstacles(groups(o(1):o(2)), settings%box%obstacle, problems)
    call take_species(groups(s(1):s(2)), settings%box, settings%species, problems)
    call take_contact(groups(place_of("contact", groups%name)), size(settings%species), settings%law, problems)
    call take_stop(groups(place_of("stop", groups%name)), settings%stop, problems)
    call take_output(groups(place_of("output", groups%name)), settings%output)
    call check_samples(groups(place_of("output", groups%name)), settings, problems)
    call check_end(settings, problems)
  end subroutine resolve_settings

  !> Title, seed and method.
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
    run%threads = int(group%integer_of("threads", 0_int64))
    if (run%dynamics == "steps" .and. .not. group%given("dt")) &
      call group%complain("dt", "is missing; dynamics = 'steps' needs it", problems)
  end subroutine take_run

  !> The box without its obstacles.
  subroutine take_box(group, box, problems)
    type(parameter_group_t), intent(in) :: group
    type(box_t), intent(out) :: box
    type(problem_list_t), intent(inout) :: problems
    integer :: axis

    box%lower = group%reals_of("lower")
    box%upper = group%reals_of("upper")
    box%gravity = group%reals_of("gravity")
    box%periodic = group%values(row_of("box", "boundary"))%texts == "periodic"
    if (any(box%periodic .and. abs(box%gravity) > 0)) call group%complain("gravity", "acts along a periodic axis, " &
      //"where disks would fall for ever; make the sides of that axis walls, or set the component to 0", problems)
    do axis = 1, 2
      if (box%lower(axis) >= box%upper(axis)) call group%complain("upper", written(box%upper(axis))// &
        " is not above box.lower, "//written(box%lower(axis))//", along "//merge("x", "y", axis == 1), problems)
    end do
  end subroutine take_box

  !> Restitution by pair of species, and the rule for walls.
  subroutine take_contact(group, n, law, problems)
    type(parameter_group_t), intent(inout) :: group
    integer, intent(in) :: n                              !! species
    type(contact_law_t), intent(out) :: law
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: pairs(:)
    real(real64) :: restitution

    restitution = group%real_of("restitution", 1.0_real64)
    law%wall_restitution = group%real_of("wall_restitution", restitution)
    law%wall_rule = place_of(group%text_of("wall_rule"), words_of(wall_rules))
    law%contact_time = group%real_of("contact_time", 0.0_real64)
    call group%put_reals("wall_restitution", [law%wall_restitution])
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

  !> What ends the run; at least one rule is needed.
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
    if (.not. any(group%values%given)) call problems%add(group%line, "stop", "no rule ends the run; give at least " &
      //"one of time, collisions, collisions_per_disk, events, energy_fraction, wall_clock")
  end subroutine take_stop

  !> What is written, and when.
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
    output%event_log = group%text_of("event_log") == ".true."
    output%checkpoint_every = group%real_of("checkpoint_every", never)
  end subroutine take_output

  !> A cadence in time, or a time step, must be coarse enough for the clock and for a sane number of samples.
  subroutine check_samples(group, settings, problems)
    type(parameter_group_t), intent(in) :: group          !! &output
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

  !> Whether the run can end at all: one disk meets no other, and elastic collisions cost no energy.
  subroutine check_end(settings, problems)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    logical :: by_collisions

    associate (stop_rules => settings%stop, law => settings%law)
      if (min(stop_rules%time, stop_rules%wall_clock) < never .or. stop_rules%events < unlimited) return
      by_collisions = stop_rules%collisions < unlimited .or. stop_rules%collisions_per_disk < never
      if (stop_rules%energy_fraction > 0) then
        if (by_collisions .or. any(law%restitution < 1) .or. law%wall_restitution < 1) return
        call problems%add(0, "stop.energy_fraction", &
          "is never reached by elastic collisions; give another rule, or a restitution below 1")
      else if (by_collisions .and. settings%n_disks() == 1) then
        call problems%add(0, "stop", "a single disk never collides with another; give time or events")
      end if
    end associate
  end subroutine check_end

end module input_settings
