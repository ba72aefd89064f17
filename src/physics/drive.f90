!> Driving of the disks at regular intervals: white noise, Andersen thermostat, Brownian or active motion, recycling. The module
!> `kicks` executes the velocity changes, and the module `recycling` moves recycled disks.
module drive
  use kinds, only: int64, never, real64
  implicit none
  private
  public :: drive_kinds, drive_t

  !> Names of the kinds of driving in the input. Elsewhere in the program a kind of driving is represented by its position in the
  !> list `drive_kinds`.
  character(len=*), parameter :: drive_kinds = "none noise andersen brownian active recycle"
  integer, parameter, public :: no_kicks = 1, noise = 2, andersen = 3, brownian = 4, active = 5, recycle = 6

  type :: drive_t
    integer :: kind = no_kicks                       !! position in `drive_kinds`
    real(real64) :: interval = never                 !! time between kicks [time]
    !> Noise strength: growth rate of the variance of each velocity component [velocity**2/time]
    real(real64) :: strength = 0.0_real64
    logical :: keep_momentum = .false.  !! whether white noise conserves the total momentum; .false. for other kinds of driving
    real(real64) :: fraction = 1.0_real64            !! mean fraction of the disks that a kick of 'andersen' affects
    !> Temperature kT of the distribution from which velocities are drawn; 0 if velocities are not drawn [energy]
    real(real64) :: temperature = 0.0_real64
    real(real64) :: speed = 0.0_real64               !! self-propulsion speed of active disks [length/time]
    real(real64) :: rotational_diffusion = 0.0_real64   !! rotational diffusion coefficient of active disks [1/time]
    integer :: species = 0                           !! index of the only driven species; 0: all species are driven
    real(real64) :: from_region(4) = 0.0_real64      !! region in which disks are recycled: xlo, xhi, ylo, yhi [length]
    real(real64) :: to_region(4) = 0.0_real64        !! region to which recycled disks move: xlo, xhi, ylo, yhi [length]
    real(real64) :: velocity(2) = 0.0_real64         !! velocity of recycled disks, if `temperature` is 0 [length/time]
  contains
    procedure :: is_on
    procedure :: acts_on
    procedure :: acts_on_all
    procedure :: moves_disks
    procedure :: time_of
    procedure :: speed2
  end type drive_t

contains

  !> Whether the disks are driven by kicks.
  pure function is_on(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%kind /= no_kicks
  end function is_on

  !> Whether the driving acts on a species.
  elemental function acts_on(self, species) result(yes)
    class(drive_t), intent(in) :: self
    integer, intent(in) :: species                   !! index of the species
    logical :: yes

    yes = self%is_on() .and. (self%species == 0 .or. self%species == species)
  end function acts_on

  !> Whether kicks also move disks to other positions, which is the case only for recycling.
  pure function moves_disks(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%kind == recycle
  end function moves_disks

  !> Whether each kick changes the velocities of all disks.
  pure function acts_on_all(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%is_on() .and. self%species == 0 .and. .not. (self%moves_disks() .or. (self%kind == andersen .and. self%fraction < 1))
  end function acts_on_all

  !> Time of the k-th kick. The time is k times the interval, because a sum of intervals would accumulate rounding errors.
  pure function time_of(self, k) result(t)
    class(drive_t), intent(in) :: self
    integer(int64), intent(in) :: k
    real(real64) :: t                                !! time since the start of the run [time]

    t = never
    if (self%is_on()) t = k*self%interval
  end function time_of

  !> Mean square of the velocity that a kick sets or adds, for disks of a given species and mass; 0 if these disks are not driven.
  elemental function speed2(self, species, mass)
    class(drive_t), intent(in) :: self
    integer, intent(in) :: species                   !! index of the species
    real(real64), intent(in) :: mass                 !! [mass]
    real(real64) :: speed2

    speed2 = 0
    if (.not. self%acts_on(species)) return
    if (self%kind == noise) speed2 = 2*self%strength*self%interval
    if (self%kind >= andersen) speed2 = 2*self%temperature/mass + self%speed**2 + sum(self%velocity**2)
  end function speed2

end module drive
