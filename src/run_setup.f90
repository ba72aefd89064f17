!> Where names in the input become types: the only place that knows all ways to search and to move on.
module run_setup
  use all_pairs, only: all_pairs_t
  use cell_grid, only: cell_grid_t
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use evolution, only: evolution_t
  use initial_state, only: create_simulation
  use renumbering, only: renumber
  use settings, only: run_settings_t, settings_t
  use simulation_state, only: simulation_t
  use time_stepped, only: time_stepped_t
  implicit none
  private
  public :: new_simulation, choose_evolution

contains

  !> The state at the start of a run, disks in an order that suits the memory.
  subroutine new_simulation(settings, sim, error)
    type(settings_t), intent(in) :: settings
    type(simulation_t), intent(out) :: sim
    type(error_t), allocatable, intent(out) :: error

    call create_simulation(settings, sim, error)
    if (.not. allocated(error)) call renumber(sim)
  end subroutine new_simulation

  !> The dynamics that the input names, with its search and queue.
  subroutine choose_evolution(settings, evolution)
    type(run_settings_t), intent(in) :: settings
    class(evolution_t), allocatable, intent(out) :: evolution
    type(event_driven_t), allocatable :: events
    type(time_stepped_t), allocatable :: steps

    if (settings%dynamics == "steps") then
      allocate (steps)
      steps%dt = settings%dt
      steps%every_pair = settings%search /= "cells"
      call move_alloc(steps, evolution)
    else
      allocate (events)
      if (settings%search == "cells") then
        allocate (cell_grid_t :: events%search)
      else
        allocate (all_pairs_t :: events%search)
        events%search%everyone = settings%search == "rescan"
      end if
      events%windowed = settings%queue == "calendar"
      call move_alloc(events, evolution)
    end if
  end subroutine choose_evolution

end module run_setup
