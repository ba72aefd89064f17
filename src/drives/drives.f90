!> Types of driving: their keywords in the input, their derived types, and the variables of the
!> group `&drive`. A new type requires a file in this folder and a line in each list of this module.
module drives
  use active, only: active_t, active_choices => choices, active_rows => rows, active_word => word
  use andersen, only: andersen_t, andersen_choices => choices, andersen_rows => rows, andersen_word => word
  use brownian, only: brownian_t, brownian_choices => choices, brownian_word => word
  use noise, only: noise_t, noise_choices => choices, noise_rows => rows, noise_word => word
  use recycle, only: recycle_t, recycle_choices => choices, recycle_count => count_choice, recycle_count_word => count_word, &
    recycle_rows => rows, recycle_word => word
  use simulation_state, only: drive_t
  use variable_rows, only: choice_t, in_motion, not_negative, positive, variable_t
  implicit none
  private
  public :: choose_drive, counting_drives, drive_choices, drive_counters, drive_rows

  !> Keywords of the types of driving, separated by blanks: all types, and those with a temperature.
  character(len=*), parameter :: with_temperature = andersen_word//" "//brownian_word//" "//active_word//" "//recycle_word
  character(len=*), parameter :: kinds = noise_word//" "//with_temperature
  !> The type of driving that counts its actions on each disk, and the name of its `counter`.
  character(len=*), parameter :: counting_drives = recycle_word, drive_counters = recycle_count_word

  type(choice_t), parameter :: drive_choices(*) = [ &
    choice_t("kind", "none", "The disks are not driven."), &
    noise_choices, andersen_choices, brownian_choices, active_choices, recycle_choices, recycle_count]

  type(variable_t), parameter :: drive_rows(*) = [ &
    variable_t("drive", "kind", "text", 1, "default", "'none'", &
      "Kind of driving. At all multiples of the time interval, driving changes the velocities of the disks; each such change is " &
      //"called a kick. Kicks of the kind 'recycle' also move disks. Driving is not available with stop.energy_fraction or " &
      //"stop.at_rest.", &
      choices="none "//kinds, may_change=in_motion), &
    variable_t("drive", "interval", "real", 1, "required", "0.01", &
      "Time between kicks. Unless the kicks themselves are studied, choose an interval well below the mean time between " &
      //"collisions. With kind = 'recycle', choose an interval shorter than the time in which a disk crosses " &
      //"from_region.", positive, "time", &
      goes_with="kind "//kinds, may_change=in_motion), &
    noise_rows, andersen_rows, &
    variable_t("drive", "temperature", "real", 1, "required", "1", &
      "Temperature kT of the Maxwell distribution from which kicks draw new velocities. The temperature 0 is allowed with kind = " &
      //"'active'. At this temperature disks move at their self-propulsion velocity alone. With kind = 'recycle', either " &
      //"temperature or velocity must be given.", not_negative, "energy", &
      goes_with="kind "//with_temperature, may_change=in_motion, &
      otherwise="none; must be given where it applies, or velocity instead if kind is 'recycle'"), &
    recycle_rows, active_rows, &
    variable_t("drive", "species", "text", 1, "fallback", "''", &
      "Name of the species that is driven. If the text is empty, all species are driven.", &
      goes_with="kind "//kinds, may_change=in_motion)]

contains

  !> Creates the driving for a keyword; for 'none' the result is not allocated.
  subroutine choose_drive(word, drive)
    character(len=*), intent(in) :: word
    class(drive_t), allocatable, intent(out) :: drive

    select case (word)
    case (noise_word)
      allocate (noise_t :: drive)
    case (andersen_word)
      allocate (andersen_t :: drive)
    case (brownian_word)
      allocate (brownian_t :: drive)
    case (active_word)
      allocate (active_t :: drive)
    case (recycle_word)
      allocate (recycle_t :: drive)
    case default                                 ! no driving
    end select
  end subroutine choose_drive

end module drives
