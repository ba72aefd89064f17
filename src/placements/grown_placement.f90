!> Placement by compression, starting at positions from an initial-configuration file.
module grown_placement
  use dense_growth, only: smallest_scale
  use dense_placement, only: dense_placement_t
  use kinds, only: real64
  use variable_rows, only: choice_t
  implicit none
  private
  public :: grown_placement_t, choices, word

  character(len=*), parameter :: word = "grown"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "Lubachevsky-Stillinger compression starting from the positions in the " &
      //"initial-configuration file (file): disks grow from smaller radii to those in this input.")]

  type, extends(dense_placement_t) :: grown_placement_t
  contains
    procedure :: culprit
    procedure :: starting_scale
  end type grown_placement_t

contains

  !> See `placement`.
  pure function culprit(self) result(name)
    class(grown_placement_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = "file"
  end function culprit

  !> See `placement`.
  pure function starting_scale(self) result(scale)
    class(grown_placement_t), intent(in) :: self
    real(real64) :: scale

    scale = smallest_scale
  end function starting_scale

end module grown_placement
