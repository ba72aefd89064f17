!> Features of a run beyond free flight and collisions that change two velocities. They decide which arrays the disks have,
!> which observables exist, which version of a collision is executed, and which inputs are refused.
module features
  implicit none
  private
  public :: features_t

  type :: features_t
    logical :: own_sizes = .false.      !! masses and radii are not those of the species
    logical :: rotation = .false.       !! disks can turn
    logical :: orientation = .false.    !! disks have a direction, as all have that can turn
    logical :: stress = .false.         !! the changes of momentum are summed, and logged
    logical :: helfand = .false.        !! and what disks carry is summed over time
  contains
    procedure :: are_rare
  end type features_t

contains

  !> Whether collisions take more than the usual path.
  pure function are_rare(self) result(yes)
    class(features_t), intent(in) :: self
    logical :: yes

    yes = self%rotation .or. self%stress
  end function are_rare

end module features
