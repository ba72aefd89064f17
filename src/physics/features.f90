!> Optional features of a run. In a run without these features the motion of a disk consists of free flight and collisions, and a
!> collision changes only velocities. The features determine the arrays of the disks, the observables, the version of the collision
!> procedure, and the inputs that are refused.
module features
  implicit none
  private
  public :: features_t

  type :: features_t
    logical :: own_sizes = .false.      !! disks have individual masses and radii
    logical :: rotation = .false.       !! disks can rotate
    logical :: orientation = .false.    !! disks have an orientation; true for all disks that can rotate
    logical :: stress = .false.         !! the momentum changes in collisions are added to sums and to the log
    logical :: helfand = .false.        !! the Helfand moments are accumulated as well
  contains
    procedure :: need_general_collision
  end type features_t

contains

  !> Whether collisions need the general procedure instead of the fast one.
  pure function need_general_collision(self) result(yes)
    class(features_t), intent(in) :: self
    logical :: yes

    yes = self%rotation .or. self%stress
  end function need_general_collision

end module features
