!> Checks the positions of disks moved by the user in a running simulation, by the same rules as the
!> initial positions of a run.
module moved_disks
  use box_state, only: bounds
  use errors, only: error_t, exit_usage, fail
  use input_fit, only: touching_tolerance
  use kinds, only: int32, real64
  use packing, only: packing_t
  use partners, only: obstacle_number
  use simulation_state, only: simulation_t
  use texts, only: written
  implicit none
  private
  public :: check_positions

contains

  !> Reports the first disk, in the order of the input, that overlaps another disk, an obstacle or a
  !> side at the present time.
  subroutine check_positions(sim, error)
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    type(packing_t) :: packing
    real(real64) :: x(2, size(sim%disk)), radius(size(sim%disk)), lower(2), upper(2), inset(2, 2), slack
    integer(int32) :: id(size(sim%disk)), species(size(sim%disk)), i, blocker
    ! whether a side is periodic or open; indices: axis, lower or upper side
    logical :: passed(2, 2)

    id = sim%tag%id
    species(id) = sim%tag%species
    radius(id) = sim%disk%radius
    do i = 1, sim%n_disks()
      x(:, id(i)) = sim%position(i)
    end do
    call bounds(sim%box, sim%now, lower, upper)
    passed = transpose(reshape(sim%box%open, [2, 2])) .or. spread(sim%box%periodic, 2, 2)
    packing = packing_t(sim%box, int(sim%n_disks()), size(sim%species))
    call packing%open_all_species(int(species), radius, minval(x, dim=2), maxval(x, dim=2))
    do i = 1, sim%n_disks()                                   ! disk i in the order of the input
      if (allocated(sim%waits)) then
        if (sim%waits(i)) cycle
      end if
      slack = touching_tolerance*(radius(i) + maxval(radius))
      inset = merge(0.0_real64, radius(i) - slack, passed)
      if (any(x(:, i) < lower + inset(:, 1) .or. x(:, i) > upper - inset(:, 2))) then
        call complain(i, "is not wholly inside the box")
        return
      end if
      call packing%find_blocker(x(:, i), [0.0_real64, 0.0_real64], radius(i) - slack, blocker)
      if (blocker > 0) call complain(i, "overlaps disk "//written(blocker))
      if (blocker < 0) call complain(i, trim(merge("is not wholly inside", "overlaps            ", &
        sim%box%obstacle(obstacle_number(blocker))%shape%encloses))//" obstacle """ &
        //sim%box%surface(sim%box%surface_of(blocker))%name//'"')
      if (blocker /= 0) return
      call packing%add(i, species(i), x(:, i), radius(i))
    end do
  contains

    !> Reports a problem with the disk of id k.
    subroutine complain(k, what)
      integer(int32), intent(in) :: k
      character(len=*), intent(in) :: what

      call fail(error, exit_usage, "position: disk "//written(k)//" at "//written(x(1, k))//", "//written(x(2, k))//" "//what)
    end subroutine complain
  end subroutine check_positions

end module moved_disks
