!> Search without cells: every other disk is a candidate. O(N) per prediction; with `everyone` set all
!> predictions are made anew after each event, O(N**2), which is the first textbook method.
module all_pairs
  use kinds, only: int32, real64
  use box_geometry, only: next_obstacle, next_side
  use neighbour_search, only: earliest_contact, neighbour_search_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: all_pairs_t

  type, extends(neighbour_search_t) :: all_pairs_t
    private
    integer(int32), allocatable :: disk(:)         !! 0, 1, ..., n - 1, as the kernel counts them
    integer(int32), allocatable :: obstacle(:)     !! 1, 2, ...
  contains
    procedure :: build
    procedure :: predict
    procedure :: cross
  end type all_pairs_t

contains

  subroutine build(self, sim)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32) :: k

    self%disk = [(k - 1, k=1, sim%n_disks())]
    self%obstacle = [integer(int32) ::]
    if (sim%box%obstructed()) self%obstacle = [(k, k=1, size(sim%box%obstacle, kind=int32))]
  end subroutine build

  !> The earliest of: side, obstacle, any disk. All disks are inside the box until one passes a periodic
  !> side, which is an event with a prediction of its own; so images one period away are enough.
  subroutine predict(self, sim, i)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64) :: t, edges(2)
    integer(int32) :: code, image_x, image_y
    integer(int32) :: reach(2)

    call next_side(sim%box, sim%disk(i), t, code)
    call next_obstacle(sim%box, sim%disk(i), self%obstacle, t, code)
    edges = sim%box%edges()
    reach = merge(1, 0, sim%box%periodic)
    do image_y = -reach(2), reach(2)
      do image_x = -reach(1), reach(1)
        call earliest_contact(sim%disk, i, sim%n_disks(), self%disk, sim%now, .false., .true., sim%box%gravity, &
          t, code, [image_x, image_y]*edges)
      end do
    end do
    sim%disk(i)%event_time = t
    sim%disk(i)%partner = code
    if (code > 0) sim%tag(i)%partner_stamp = sim%disk(code)%stamp
  end subroutine predict

  !> There are no cells to cross: the disk has only passed a periodic side.
  subroutine cross(self, sim, i, code)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code

    call self%predict(sim, i)
  end subroutine cross

end module all_pairs
