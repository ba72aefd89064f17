!> Search without cells: every other disk is a candidate. O(N) per prediction; with `everyone` set all
!> predictions are repeated after each event, O(N**2), which is the first textbook method.
module all_pairs
  use images, only: images_t
  use kinds, only: int32, real64
  use box_geometry, only: next_obstacle
  use box_sides, only: next_side
  use neighbour_search, only: earliest_contact, list_capacity, neighbour_search_t, prospect_t
  use partners, only: looks_again
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: all_pairs_t

  type, extends(neighbour_search_t) :: all_pairs_t
  contains
    procedure :: build
    procedure :: predict
    procedure :: cross
  end type all_pairs_t

contains

  !> There is nothing to sort the disks into.
  subroutine build(self, sim)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
  end subroutine build

  !> The earliest of: side, obstacle, any disk. All disks are inside the box until one passes a periodic
  !> side, which is an event with a prediction of its own; so the images in reach are enough.
  subroutine predict(self, sim, i)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    type(prospect_t) :: near
    type(images_t) :: images
    real(real64) :: t
    integer(int32) :: first, k, m
    integer :: image

    near%disk = i
    call next_side(sim%box, sim%disk(i), near%time, near%partner)
    call next_obstacle(sim%box, sim%disk(i), sim%tag(i)%met, [(m, m=1, sim%box%n_obstacles())], near%time, near%partner)
    images = sim%images()
    t = images%look_again(sim%now)
    if (t < near%time) near%partner = looks_again
    near%time = min(t, near%time)
    do first = 0, sim%n_disks() - 1, list_capacity
      near%n = min(list_capacity, sim%n_disks() - first)
      near%list(:near%n) = [(first + k, k=0, near%n - 1)]
      do image = 1, images%count()
        call earliest_contact(sim%disk, sim%tag, near, sim%now, sim%box%gravity, 0, &
          images%image(images%around(image, sim%now)))
      end do
    end do
    sim%disk(i)%event_time = near%time
    sim%disk(i)%partner = near%partner
    if (near%partner > 0) sim%tag(i)%partner_stamp = sim%disk(near%partner)%stamp
  end subroutine predict

  !> There are no cells to cross: the disk has only passed a periodic side, or looks again.
  subroutine cross(self, sim, i, code)
    class(all_pairs_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code

    call self%predict(sim, i)
  end subroutine cross

end module all_pairs
