!> Names of variables and keywords in earlier versions of the program, with their present names. An
!> error message about an old name suggests the present name.
module old_names
  use variables, only: name_length
  implicit none
  private
  public :: new_name, present_names

  type :: old_name_t
    character(len=8) :: group
    !> Old name of the variable, or its present name if only a keyword was renamed.
    character(len=name_length) :: name
    character(len=20) :: choice               !! old keyword; blank if the variable was renamed
    character(len=name_length) :: now
  end type old_name_t

  type(old_name_t), parameter :: list(*) = [ &
    old_name_t("side", "begin", "", "start_time"), &
    old_name_t("side", "end", "", "end_time"), &
    old_name_t("side", "motion", "steady", "constant_velocity"), &
    old_name_t("side", "motion", "free", "piston"), &
    old_name_t("side", "speed", "", "surface_velocity"), &
    old_name_t("obstacle", "speed", "", "surface_velocity"), &
    old_name_t("wall", "speed", "", "surface_velocity"), &
    old_name_t("drive", "speed", "", "self_propulsion_speed"), &
    old_name_t("species", "radius_spread", "", "polydispersity"), &
    old_name_t("species", "radius_distribution", "normal", "gaussian"), &
    old_name_t("species", "mass_by", "", "mass_scaling"), &
    old_name_t("species", "mass_scaling", "number", "equal"), &
    old_name_t("contact", "restitution_speed", "", "reference_speed"), &
    old_name_t("output", "frames_from", "", "decades_from"), &
    old_name_t("output", "frame_columns", "collisions", "event_count")]

contains

  !> Present name of a renamed variable or keyword; empty if the name never changed.
  pure function new_name(group, name, choice) result(now)
    character(len=*), intent(in) :: group, name
    character(len=*), intent(in) :: choice     !! old keyword; blank to look up a variable
    character(len=:), allocatable :: now
    integer :: k

    now = ""
    do k = 1, size(list)
      if (list(k)%group == group .and. list(k)%name == name .and. list(k)%choice == choice) now = trim(list(k)%now)
    end do
  end function new_name

  !> Present names of the variables or keywords that replace an old one; empty if it was not
  !> replaced. The old name of a variable may include its group.
  pure function present_names(name, of_choices) result(names)
    character(len=*), intent(in) :: name
    logical, intent(in) :: of_choices
    character(len=:), allocatable :: names
    type(old_name_t) :: old
    integer :: k

    names = ""
    do k = 1, size(list)
      old = list(k)
      if (of_choices .and. old%choice /= "" .and. old%choice == name) then
        names = names//" or "//trim(old%group)//"."//trim(old%name)//" = '"//trim(old%now)//"'"
      else if (.not. of_choices .and. old%choice == "" .and. &
        any([character(len=name_length + 9) :: old%name, trim(old%group)//"."//old%name] == name)) then
        names = names//" or "//trim(old%group)//"."//trim(old%now)
      end if
    end do
    names = names(min(5, len(names) + 1):)
  end function present_names

end module old_names
