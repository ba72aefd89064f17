!> Disks that a piston may touch in the near future. A piston can eventually reach every disk in the
!> box. Until it has moved by one cell width, however, it can touch only the disks in its strip of
!> adjacent columns or rows of cells (`cell_faces: find_strips`). Contacts with a piston are
!> therefore predicted only for these disks.
module piston_strips
  use kinds, only: int16, int32, real64
  use cell_grid, only: cell_grid_t
  use partners, only: n_sides
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: change_strips, near_piston

contains

  !> Lists the disks that a piston may touch before it leaves its strip.
  function near_piston(self, k) result(disks)
    class(cell_grid_t), intent(in) :: self
    integer, intent(in) :: k                       !! index of the side
    integer(int32), allocatable :: disks(:)
    integer(int32) :: n, across, along, i, c, m
    integer :: axis, high

    axis = (k + 1)/2
    high = 1 - modulo(k, 2)
    allocate (disks(64))
    n = 0
    do across = 1, self%layout%n(axis)
      if (axis == 1) then
        if (.not. self%faces%column(high, across)%struck) cycle
      else
        if (.not. self%faces%row(high, across)%struck) cycle
      end if
      do along = 1, self%layout%n(3 - axis)
        c = self%cells%number(int(merge([across, along], [along, across], axis == 1), int16))
        do m = 1, self%cells%cell(c)%in_slots()
          call add(self%cells%cell(c)%slot(m) + 1)
        end do
        i = self%cells%chain(c)                    ! the first disk of a linked list is also in a slot
        if (i > 0) i = self%cells%next(i)
        do while (i > 0)
          call add(i)
          i = self%cells%next(i)
        end do
      end do
    end do
    do m = 1, size(self%reach%big, kind=int32)
      call add(self%reach%big(m)%disk)
    end do
    disks = disks(:n)
  contains

    !> Adds disk i to the list.
    subroutine add(i)
      integer(int32), intent(in) :: i

      if (n == size(disks)) disks = [disks, disks]
      n = n + 1
      disks(n) = i
    end subroutine add
  end function near_piston

  !> Finds the new strip of a piston that is leaving its present one, and lists the disks in both
  !> strips. The events of these disks must be predicted anew.
  subroutine change_strips(self, sim, disks)
    class(cell_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), allocatable, intent(out) :: disks(:)
    real(real64) :: now                            ! copied, because `find_strips` changes `due`
    logical :: pushed(n_sides)
    integer(int32) :: i
    integer :: k

    pushed = sim%box%side%is_piston()
    now = self%faces%due
    allocate (disks(0))
    do k = 1, n_sides
      if (pushed(k)) disks = [disks, near_piston(self, k)]
    end do
    call self%faces%find_strips(sim%box, self%layout%small, now)
    do k = 1, n_sides
      if (pushed(k)) disks = [disks, near_piston(self, k)]
    end do
    if (.not. self%lists%used) return
    do i = 1, size(disks, kind=int32)
      associate (region => self%lists%neighbourhood(disks(i)), cell => sim%tag(disks(i))%cell)
        if (sim%disk(disks(i))%radius > self%layout%small) cycle
        region%column%struck = self%faces%column(:, cell(1))%struck
        region%row%struck = self%faces%row(:, cell(2))%struck
      end associate
    end do
  end subroutine change_strips

end module piston_strips
