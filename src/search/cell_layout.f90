!> Chooses the width of the cells of the search.
module cell_layout
  use kinds, only: int32, never, real64
  use cell_faces, only: all_cells, patch_t
  use object_lists, only: largest_small_radius
  use shapes, only: spare
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: whole_box

  !> With fewer disks per cell, a prediction tests fewer candidates, but disks cross cells more
  !> often. Intended mean number of disks per cell in a dilute system.
  real(real64), parameter :: disks_per_cell = 0.6_real64

contains

  !> Chooses the cells for all disks and obstacles of a simulation. Obstacles count as disks,
  !> because each disk is also tested against the obstacles in its cell.
  pure function whole_box(sim, undivided) result(patch)
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: undivided
    type(patch_t) :: patch
    real(real64) :: small, reach, width

    small = merge(maxval(sim%disk%radius), largest_small_radius(sim%disk), undivided .or. sim%box%is_sheared())
    reach = 2*small*(1 + spare)
    width = max(sqrt(disks_per_cell*product(sim%box%edges())/(sim%n_disks() + sim%box%n_obstacles())), reach)
    if (undivided) width = never
    patch = all_cells(sim%box, int(min(max(sim%box%edges()/width, 1.0_real64), 32000.0_real64), int32), reach)
    patch%small = small
  end function whole_box

end module cell_layout
