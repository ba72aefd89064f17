!> Optional features of a run. Without these features, the motion consists of free flight and of
!> collisions that change only velocities. The features determine which per-disk data and
!> observables are available, which collision procedure is used, and which inputs are rejected.
module features
  implicit none
  private
  public :: features_t

  type :: features_t
    logical :: own_sizes = .false.      !! whether disks have individual masses and radii
    logical :: rotation = .false.       !! whether disks can rotate
    logical :: orientation = .false.    !! whether disks have an orientation; always with rotation
    !> Whether the stress tensor and the event log include momentum changes.
    logical :: stress = .false.
    logical :: helfand = .false.        !! whether the Helfand moments are accumulated
    ! Features of runs with scheduled changes; their data and observables exist from the start.
    logical :: changes = .false.        !! whether changes are scheduled
    logical :: collapses = .false.      !! whether an inelastic collapse is possible, now or after a change
    logical :: moving(4) = .false.      !! whether each side moves, now or after a change
    logical :: open = .false.           !! whether disks can leave or enter the box, now or after a change
  contains
    procedure :: unite
    procedure :: need_general_collision
  end type features_t

contains

  !> Adds those features of another system of the same run that determine data and observables.
  pure subroutine unite(self, other)
    class(features_t), intent(inout) :: self
    type(features_t), intent(in) :: other

    self%changes = .true.
    self%stress = self%stress .or. other%stress
    self%collapses = self%collapses .or. other%collapses
    self%moving = self%moving .or. other%moving
    self%open = self%open .or. other%open
  end subroutine unite

  !> True if collisions need the general procedure instead of the fast one.
  pure function need_general_collision(self) result(yes)
    class(features_t), intent(in) :: self
    logical :: yes

    yes = self%rotation .or. self%stress
  end function need_general_collision

end module features
