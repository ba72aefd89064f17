!> From the groups that describe obstacles to their shapes.
module input_obstacles
  use box_geometry, only: obstacle_t
  use circles, only: new_circle
  use input_problems, only: problem_list_t
  use input_species, only: check_name
  use kinds, only: real64
  use name_index, only: name_index_t
  use parameter_values, only: parameter_group_t
  use parameters, only: table
  use segments, only: new_segment
  implicit none
  private
  public :: take_obstacles

contains

  !> Fills the list of obstacles; it is empty if one of them is incomplete.
  subroutine take_obstacles(groups, obstacles, problems)
    type(parameter_group_t), intent(in) :: groups(:)      !! all whose name is in `obstacle_groups`
    type(obstacle_t), allocatable, intent(out) :: obstacles(:)
    type(problem_list_t), intent(inout) :: problems
    type(name_index_t) :: names
    logical :: complete
    integer :: k, v

    names = name_index_t(groups%instance)
    complete = .true.
    do k = 1, size(groups)
      call check_name(groups, k, names, problems)
      do v = 1, size(groups(k)%values)
        associate (value => groups(k)%values(v))
          if (table(value%row)%status /= "example") cycle       ! has a default, or may be left out
          call groups(k)%demand(trim(value%name), problems)
          complete = complete .and. value%is_set()
        end associate
      end do
    end do
    allocate (obstacles(merge(size(groups), 0, complete)))
    do k = 1, size(obstacles)
      obstacles(k)%name = trim(groups(k)%instance)
      call take_shape(groups(k), obstacles(k))
    end do
  end subroutine take_obstacles

  !> The shape that a group describes.
  subroutine take_shape(group, obstacle)
    type(parameter_group_t), intent(in) :: group
    type(obstacle_t), intent(inout) :: obstacle

    select case (group%name)
    case ("wall")
      allocate (obstacle%shape, source=new_segment(group%reals_of("from"), group%reals_of("to")))
    case default                                          ! "obstacle"
      allocate (obstacle%shape, source=new_circle(group%reals_of("centre"), group%real_of("radius", 0.0_real64), &
        encloses=group%text_of("side") == "inside"))
    end select
  end subroutine take_shape

end module input_obstacles
