!> Reports settings of different groups that cannot be combined. Mutually exclusive variables of one
!> group are reported by `input_groups` instead.
module input_conflicts
  use kinds, only: never, unlimited
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use motions, only: pistons
  use settings, only: settings_t
  use simulation_state, only: drive_t
  use stop_rules, only: stop_rule_t
  use texts, only: place_of, text_t
  implicit none
  private
  public :: report_conflicts

  !> Upper limit for the number of calls of `add`.
  integer, parameter :: most_conflicts = 40
  character(len=*), parameter :: other_rule = "; give another rule"
  character(len=*), parameter :: energy = "stop.energy_fraction", rest = "stop.at_rest"

  !> Settings of different groups that cannot be combined with each other.
  type :: conflict_list_t
    integer :: count = 0
    type(text_t) :: variable(most_conflicts)            !! group, or group.variable
    type(text_t) :: other(most_conflicts)               !! the conflicting setting, and advice
  contains
    procedure :: add
    procedure :: report
  end type conflict_list_t

contains

  !> Reports all conflicts between the settings as problems.
  pure subroutine report_conflicts(settings, groups, must_end, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    logical, intent(in) :: must_end                     !! .true. if the input must contain a stop rule
    type(problem_list_t), intent(inout) :: problems
    type(conflict_list_t) :: conflicts

    call add_box_conflicts(settings, groups%name, conflicts)
    call add_energy_conflicts(settings, must_end, conflicts)
    call add_rest_conflicts(settings, conflicts)
    call add_conflicts_of_open_systems(settings, groups%name, conflicts)
    call add_drive_conflicts(settings, conflicts)
    call add_single_disk_conflicts(settings, must_end, conflicts)
    call conflicts%report(groups, problems)
  end subroutine report_conflicts

  !> Adds a conflict to the list if both settings are present.
  pure subroutine add(self, together, variable, other)
    class(conflict_list_t), intent(inout) :: self
    logical, intent(in) :: together                     !! .true. if both settings are present
    character(len=*), intent(in) :: variable            !! group, or group.variable
    character(len=*), intent(in) :: other               !! the conflicting setting, and advice

    if (.not. together) return
    self%count = self%count + 1
    self%variable(self%count)%text = variable
    self%other(self%count)%text = other
  end subroutine add

  !> Reports all listed conflicts as problems.
  pure subroutine report(self, groups, problems)
    class(conflict_list_t), intent(in) :: self
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: variable, what
    integer :: dot, k

    do k = 1, self%count
      variable = self%variable(k)%text
      what = "cannot be combined with "//self%other(k)%text
      dot = index(variable//".", ".")
      associate (group => groups(place_of(variable(:dot - 1), groups%name)))
        if (dot < len(variable)) call group%complain(variable(dot + 1:), what, problems)
        if (dot > len(variable)) call problems%add(group%line, variable, what)
      end associate
    end do
  end subroutine report

  !> Adds settings that cannot be combined with gravity, shear, time steps or Helfand moments.
  pure subroutine add_box_conflicts(settings, names, conflicts)
    type(settings_t), intent(in) :: settings
    character(len=*), intent(in) :: names(:)            !! names of all groups
    type(conflict_list_t), intent(inout) :: conflicts
    logical :: shear, steps

    associate (box => settings%box)
      shear = box%is_sheared()
      steps = settings%run%dynamics == "steps"
      call conflicts%add(any(box%periodic .and. abs(box%gravity) > 0), "box.gravity", &
        "a periodic axis along it (box.boundary): disks would fall for ever; make its sides walls")
      call conflicts%add(shear .and. .not. all(box%periodic), "box.shear_rate", "walls; make box.boundary 'periodic', 'periodic'")
      call conflicts%add(shear .and. box%has_gravity(), "box.shear_rate", "box.gravity")
      call conflicts%add(shear .and. any(names == "obstacle"), "box.shear_rate", "&obstacle")
      call conflicts%add(shear .and. any(names == "wall"), "box.shear_rate", "&wall")
      call conflicts%add(shear .and. steps, "box.shear_rate", "run.dynamics = 'steps'")
      call conflicts%add(steps .and. any(box%side%is_piston()), "run.dynamics", "side.motion = '"//pistons//"'")
      call conflicts%add(settings%output%helfand .and. box%has_gravity(), "output.helfand", &
        "box.gravity: velocities change between collisions")
      call conflicts%add(settings%output%helfand .and. shear, "output.helfand", &
        "box.shear_rate: velocities change at its periodic boundary")
    end associate
  end subroutine add_box_conflicts

  !> Adds settings that cannot be combined with the stop rule `energy_fraction` in a closed system.
  pure subroutine add_energy_conflicts(settings, must_end, conflicts)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: must_end
    type(conflict_list_t), intent(inout) :: conflicts
    logical :: shear, kicks

    if (.not. settings%stop%energy_fraction > 0) return
    associate (box => settings%box, law => settings%law, rule => settings%stop)
      shear = box%is_sheared()
      kicks = allocated(settings%drive)
      call conflicts%add(shear, energy, "box.shear_rate: the shear does work"//other_rule)
      call conflicts%add(kicks, energy, "drive.kind: kicks change the energy"//other_rule)
      call conflicts%add(box%gives_energy() .and. .not. shear, energy, "walls that give energy, by temperature, " &
        //"surface_velocity or motion of &side, &obstacle or &wall"//other_rule)
      call conflicts%add(.not. (has_time_limit(rule, must_end) .or. has_collision_limit(rule) .or. rule%events < unlimited &
        .or. law%loses_energy() .or. kicks .or. box%has_lossy_walls() .or. box%gives_energy()), energy, &
        "elastic collisions"//other_rule//", or a restitution below 1")
    end associate
  end subroutine add_energy_conflicts

  !> Adds settings that cannot be combined with the stop rule `at_rest`.
  pure subroutine add_rest_conflicts(settings, conflicts)
    type(settings_t), intent(in) :: settings
    type(conflict_list_t), intent(inout) :: conflicts
    logical :: shear

    if (.not. settings%stop%at_rest) return
    associate (box => settings%box, law => settings%law)
      shear = box%is_sheared()
      call conflicts%add(settings%run%dynamics == "steps", rest, &
        "run.dynamics = 'steps': the end of bounces has no defined time"//other_rule)
      call conflicts%add(law%contact_time > 0, rest, "contact.contact_time: bounces then never end"//other_rule)
      call conflicts%add(shear, rest, "box.shear_rate: driven disks never come to rest"//other_rule)
      call conflicts%add(allocated(settings%drive), rest, "drive.kind: driven disks never come to rest"//other_rule)
      call conflicts%add(box%gives_energy() .and. .not. shear, rest, "walls that give energy, by temperature, " &
        //"surface_velocity or motion of &side, &obstacle or &wall"//other_rule)
      call conflicts%add(.not. (law%loses_energy() .or. box%has_lossy_walls()), rest, &
        "elastic collisions"//other_rule//", or a restitution below 1")
    end associate
  end subroutine add_rest_conflicts

  !> Adds settings that cannot be combined with an open system.
  pure subroutine add_conflicts_of_open_systems(settings, names, conflicts)
    type(settings_t), intent(in) :: settings
    character(len=*), intent(in) :: names(:)            !! names of all groups
    type(conflict_list_t), intent(inout) :: conflicts
    logical :: open

    open = settings%is_open()
    call conflicts%add(settings%stop%energy_fraction > 0 .and. open, energy, &
      "&source, side.open or species.waiting: disks carry their energy in and out"//other_rule)
    call conflicts%add(settings%output%helfand .and. open, "output.helfand", &
      "&source, side.open or species.waiting: displacements are defined only while a disk is in the box")
    call conflicts%add(settings%box%is_sheared() .and. open, "box.shear_rate", "&source or species.waiting")
    call conflicts%add(settings%stop%disks_inside >= 0 .and. .not. any([settings%has_lids, names == "change"]), &
      "stop.disks_inside", "closed sides (side.open): no disk ever leaves the box")
  end subroutine add_conflicts_of_open_systems

  !> Adds settings that cannot be combined with the driving.
  pure subroutine add_drive_conflicts(settings, conflicts)
    type(settings_t), intent(in) :: settings
    type(conflict_list_t), intent(inout) :: conflicts

    if (.not. allocated(settings%drive)) return
    call add_drive_conflict(settings%drive, "source", allocated(settings%source), conflicts)
    call add_drive_conflict(settings%drive, "box.shear_rate", settings%box%is_sheared(), conflicts)
    call add_drive_conflict(settings%drive, "output.helfand", settings%output%helfand, conflicts)
  end subroutine add_drive_conflicts

  !> Adds a conflict if the input contains a setting that the type of driving does not support.
  pure subroutine add_drive_conflict(drive, setting, is_there, conflicts)
    class(drive_t), intent(in) :: drive
    character(len=*), intent(in) :: setting             !! group, or group.variable
    logical, intent(in) :: is_there
    type(conflict_list_t), intent(inout) :: conflicts
    character(len=:), allocatable :: reason      ! with `associate`, gfortran 12 would free the result twice

    reason = drive%conflict(setting)
    call conflicts%add(is_there .and. reason /= "", setting, reason)
  end subroutine add_drive_conflict

  !> Adds stop rules that a single disk can never satisfy.
  pure subroutine add_single_disk_conflicts(settings, must_end, conflicts)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: must_end
    type(conflict_list_t), intent(inout) :: conflicts
    logical :: alone

    if (settings%n_disks() /= 1) return
    associate (box => settings%box, rule => settings%stop, timed => has_time_limit(settings%stop, must_end))
      alone = all(box%periodic) .and. .not. box%has_obstacles()
      call conflicts%add(has_collision_limit(rule) .and. .not. (timed .or. rule%energy_fraction > 0 .or. rule%events < unlimited), &
        "stop.collisions", "a single disk (species.count), which has no collision partner; give time or events")
      call conflicts%add(alone .and. (box%is_sheared() .or. allocated(settings%drive)) .and. .not. timed, "stop", &
        "a single disk in a periodic box that is sheared (box.shear_rate) or driven (drive.kind): no event ever occurs; give time")
    end associate
  end subroutine add_single_disk_conflicts

  !> True if the run ends at a given time.
  pure function has_time_limit(rule, must_end) result(yes)
    type(stop_rule_t), intent(in) :: rule
    logical, intent(in) :: must_end
    logical :: yes

    yes = min(rule%time, rule%wall_clock) < never .or. .not. must_end
  end function has_time_limit

  !> True if the run ends at a number of collisions.
  pure function has_collision_limit(rule) result(yes)
    type(stop_rule_t), intent(in) :: rule
    logical :: yes

    yes = rule%collisions < unlimited .or. rule%collisions_per_disk < never
  end function has_collision_limit

end module input_conflicts
