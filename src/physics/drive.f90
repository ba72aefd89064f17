!> What drives the disks from outside: kicks at multiples of an interval. What a kick does is in `kicks`.
module drive
  use kinds, only: int64, never, real64
  implicit none
  private
  public :: drive_kinds, drive_t

  !> The kinds of kicks by their names in the input; a kind is its number in this list.
  character(len=*), parameter :: drive_kinds = "none noise andersen brownian active"
  integer, parameter, public :: no_kicks = 1, noise = 2, andersen = 3, brownian = 4, active = 5

  type :: drive_t
    integer :: kind = no_kicks                       !! in `drive_kinds`
    real(real64) :: interval = never                 !! [time]
    real(real64) :: strength = 0.0_real64            !! of noise: growth of the variance of each component [velocity**2/time]
    logical :: keep_momentum = .false.               !! of noise
    real(real64) :: fraction = 1.0_real64            !! of the disks that a kick of 'andersen' reaches, on average
    real(real64) :: temperature = 0.0_real64         !! kT of the velocities that the others give [energy]
    real(real64) :: speed = 0.0_real64               !! of active disks along their orientation [length/time]
    real(real64) :: rotational_diffusion = 0.0_real64   !! of their orientation [1/time]
    integer :: species = 0                           !! number of the only one that is kicked; 0: all are
  contains
    procedure :: is_on
    procedure :: reaches
    procedure :: reaches_all
    procedure :: time_of
    procedure :: speed2
  end type drive_t

contains

  !> Whether there are kicks.
  pure function is_on(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%kind /= no_kicks
  end function is_on

  !> Whether kicks are for disks of a species.
  elemental function reaches(self, species) result(yes)
    class(drive_t), intent(in) :: self
    integer, intent(in) :: species                   !! its number
    logical :: yes

    yes = self%is_on() .and. (self%species == 0 .or. self%species == species)
  end function reaches

  !> Whether each kick changes the velocities of all disks.
  pure function reaches_all(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%is_on() .and. self%species == 0 .and. .not. (self%kind == andersen .and. self%fraction < 1)
  end function reaches_all

  !> When kick k comes: a product, not a sum, so that it does not drift.
  pure function time_of(self, k) result(t)
    class(drive_t), intent(in) :: self
    integer(int64), intent(in) :: k
    real(real64) :: t                                !! since the start of the run [time]

    t = never
    if (self%is_on()) t = k*self%interval
  end function time_of

  !> Mean square of the velocity that a kick gives, or adds, to disks of a species and a mass; 0 if none reaches them.
  elemental function speed2(self, species, mass)
    class(drive_t), intent(in) :: self
    integer, intent(in) :: species                   !! its number
    real(real64), intent(in) :: mass                 !! [mass]
    real(real64) :: speed2

    speed2 = 0
    if (.not. self%reaches(species)) return
    if (self%kind == noise) speed2 = 2*self%strength*self%interval
    if (self%kind >= andersen) speed2 = 2*self%temperature/mass + self%speed**2
  end function speed2

end module drive
