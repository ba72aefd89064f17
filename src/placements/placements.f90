!> List of all placements: their keywords in the input, their types, and their variables in the
!> group `&species`. A new placement requires a file in this folder and a line in each list of this
!> module.
module placements
  use dense_placement, only: dense_placement_t, dense_choices => choices, dense_word => word
  use explicit_placement, only: explicit_placement_t, explicit_choices => choices, explicit_rows => rows, explicit_word => word
  use file_placement, only: file_placement_t, file_choices => choices, file_word => word
  use grid_placement, only: grid_placement_t, grid_choices => choices, grid_rows => rows, grid_word => word
  use grown_placement, only: grown_placement_t, grown_choices => choices, grown_word => word
  use lattice_placement, only: lattice_placement_t, lattice_choices => choices, lattice_word => word
  use placement, only: placement_t
  use random_placement, only: random_placement_t, random_choices => choices, random_word => word
  use relaxed_placement, only: relaxed_placement_t, relaxed_choices => choices, relaxed_rows => rows, relaxed_word => word, &
    relaxed_sweeps => sweeps
  use variable_rows, only: choice_t, variable_t
  implicit none
  private
  public :: choose_placement, common_variable, placement_choices, placement_rows

  !> Keywords of the placements, separated by blanks: all placements, and those that start at
  !> positions from an initial-configuration file.
  character(len=*), parameter :: words = random_word//" "//grid_word//" "//lattice_word//" "//dense_word//" "//explicit_word &
    //" "//file_word//" "//grown_word//" "//relaxed_word
  character(len=*), parameter :: with_file = file_word//" "//grown_word
  !> Variable that must be equal for all species.
  character(len=*), parameter :: common_variable = relaxed_sweeps

  type(choice_t), parameter :: placement_choices(*) = [ &
    random_choices, grid_choices, lattice_choices, dense_choices, explicit_choices, file_choices, grown_choices, &
    relaxed_choices]

  type(variable_t), parameter :: placement_rows(*) = [ &
    variable_t("species", "placement", "text", 1, "default", "'"//random_word//"'", &
      "Method that generates the initial positions. If placement is not given, it follows from grid, position or file if one " &
      //"of these is given.", &
      choices=words), &
    relaxed_rows, grid_rows, &
    variable_t("species", "file", "text", 1, "required", "'runs/gas.h5'", &
      "Initial-configuration file: either a text file (lines `x y [vx vy]`, or named columns x y vx vy omega angle radius mass " &
      //"species) or the output file (.h5) of another run, whose last frame is used. Count, mass and radius are read from the " &
      //"file unless the input contains them. " &
      //"The path is relative to the folder in which the program is started.", &
      goes_with="placement "//with_file), &
    variable_t("species", "scale_positions", "logical", 1, "fallback", ".false.", &
      "Scaling of the positions in an output file (file) from the box of the earlier run to the box of this run.", &
      goes_with="placement "//with_file), &
    explicit_rows]

contains

  !> Creates the placement for a keyword. An invalid keyword, which has been reported, gives the
  !> default.
  subroutine choose_placement(word, placement)
    character(len=*), intent(in) :: word
    class(placement_t), allocatable, intent(out) :: placement

    select case (word)
    case (grid_word)
      allocate (grid_placement_t :: placement)
    case (lattice_word)
      allocate (lattice_placement_t :: placement)
    case (dense_word)
      allocate (dense_placement_t :: placement)
    case (explicit_word)
      allocate (explicit_placement_t :: placement)
    case (file_word)
      allocate (file_placement_t :: placement)
    case (grown_word)
      allocate (grown_placement_t :: placement)
    case (relaxed_word)
      allocate (relaxed_placement_t :: placement)
    case default
      allocate (random_placement_t :: placement)
    end select
  end subroutine choose_placement

end module placements
