!> Optional features of a run. In a run without optional features the motion of a disk consists of free flight and collisions, and a
!> collision changes only velocities. The features determine which data of disks and which observables exist, which collision
!> procedure is used, and which inputs are rejected.
module features
  implicit none
  private
  public :: features_t

  type :: features_t
    logical :: own_sizes = .false.      !! whether disks have individual masses and radii
    logical :: rotation = .false.       !! whether disks can rotate
    logical :: orientation = .false.    !! whether disks have an orientation (always, if disks can rotate)
    logical :: stress = .false.         !! whether momentum changes are added to the stress and the event log
    logical :: helfand = .false.        !! whether the Helfand moments are accumulated
  contains
    procedure :: need_general_collision
  end type features_t

contains

  !> Whether collisions need the general procedure instead of the fast procedure.
  pure function need_general_collision(self) result(yes)
    class(features_t), intent(in) :: self
    logical :: yes

    yes = self%rotation .or. self%stress
  end function need_general_collision

end module features
