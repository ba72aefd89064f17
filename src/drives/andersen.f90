!> Andersen thermostat: each kick draws new velocities from the Maxwell distribution for a random
!> fraction of the disks.
module andersen
  use kinds, only: real64
  use brownian, only: brownian_t
  use fields, only: fields_t
  use random_stream, only: random_stream_t
  use variable_rows, only: choice_t, in_motion, part_of_all, variable_t
  implicit none
  private
  public :: andersen_t, choices, rows, word

  character(len=*), parameter :: word = "andersen"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("kind", word, "Andersen thermostat: kicks assign a new velocity from the Maxwell distribution to each disk with " &
      //"the given probability (fraction).")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("drive", "fraction", "real", 1, "required", "0.1", &
      "Probability that a kick changes the velocity of a given disk. The collision frequency of the Andersen thermostat is this " &
      //"probability divided by interval.", part_of_all, goes_with="kind "//word, may_change=in_motion)]

  type, extends(brownian_t) :: andersen_t
    real(real64) :: fraction = 1.0_real64        !! probability that a disk is affected by a kick
  contains
    procedure :: read => read_thermostat
    procedure :: acts_on_all
    procedure :: draw_hit
  end type andersen_t

contains

  !> Reads the variables of the Andersen thermostat.
  subroutine read_thermostat(self, fields)
    class(andersen_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call self%brownian_t%read(fields)
    call fields%read("fraction", self%fraction)
  end subroutine read_thermostat

  !> True if each kick changes the velocities of all disks.
  pure function acts_on_all(self) result(yes)
    class(andersen_t), intent(in) :: self
    logical :: yes

    yes = self%brownian_t%acts_on_all() .and. .not. self%fraction < 1
  end function acts_on_all

  !> Decides at random whether a kick affects a disk.
  subroutine draw_hit(self, stream, is_hit)
    class(andersen_t), intent(in) :: self
    type(random_stream_t), intent(inout) :: stream
    logical, intent(out) :: is_hit
    real(real64) :: u

    call stream%draw_uniform(u)
    is_hit = u < self%fraction
  end subroutine draw_hit

end module andersen
