!> Free positions in a region, chosen at random, for disks that are recycled or enter the box.
module free_positions
  use kinds, only: int32, real64
  use box_geometry, only: box_t, spans
  use box_state, only: centre_range
  use fields, only: fields_t
  use packing, only: packing_t
  use random_stream, only: random_stream_t
  use simulation_state, only: simulation_t
  use texts, only: written
  implicit none
  private
  public :: check_cover, check_obstacles, check_region, check_room, find_position, present_packing

  !> Maximum number of random positions tried for one disk at one time.
  integer, parameter :: most_trials = 100

contains

  !> Reports a region that is empty or extends beyond the box.
  subroutine check_region(fields, name, region, box, sound)
    class(fields_t), intent(inout) :: fields
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    logical, intent(out) :: sound
    real(real64) :: beyond(2, 2)

    sound = fields%is_sound(name)
    if (.not. sound) return
    beyond = box%side_excursion()
    if (any(region([1, 3]) >= region([2, 4]))) then
      call fields%complain(name, "its lower ends must be below its upper ends; give xlo, xhi, ylo, yhi")
      sound = .false.
    else if (any(region([1, 3]) < box%lower - beyond(:, 1) .or. region([2, 4]) > box%upper + beyond(:, 2))) then
      call fields%complain(name, "it extends beyond the box")
      sound = .false.
    end if
  end subroutine check_region

  !> Reports a region that is too narrow for a disk.
  subroutine check_room(fields, name, region, box, radius)
    class(fields_t), intent(inout) :: fields
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius                       !! largest radius of the disks [length]
    real(real64) :: edges(2)

    edges = region([2, 4]) - region([1, 3])
    if (any(edges <= 2*radius .and. .not. spans(region, box))) call fields%complain(name, "a disk of diameter " &
      //written(2*radius)//" needs more room; the region is "//written(edges(1))//" x "//written(edges(2)))
  end subroutine check_room

  !> Reports an obstacle that disks in the region can touch.
  subroutine check_obstacles(fields, name, region, box, radius)
    class(fields_t), intent(inout) :: fields
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius                       !! largest radius of the disks [length]
    real(real64), parameter :: nearly = 1 - 1.0e-4_real64    ! below 1, because a region may touch an obstacle
    ! centre and half edges of the rectangle for the centres of the disks [length]
    real(real64) :: middle(2), half(2)
    integer :: k

    middle = 0.5_real64*(region([1, 3]) + region([2, 4]))
    half = max(0.5_real64*(region([2, 4]) - region([1, 3])) - merge(0.0_real64, radius, spans(region, box)), 0.0_real64)
    do k = 1, box%n_obstacles()
      if (.not. is_in_the_way(box, k, middle, nearly*half, nearly*radius)) cycle
      call fields%complain(name, 'it overlaps obstacle "'//box%surface(box%obstacle(k)%surface)%name//'"')
      return
    end do
  end subroutine check_obstacles

  !> Reports an obstacle that excludes disks of any size from a whole region.
  subroutine check_cover(fields, name, region, box)
    class(fields_t), intent(inout) :: fields
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    real(real64) :: middle(2), half(2)                       ! centre and half edges of the region [length]
    integer :: k

    middle = 0.5_real64*(region([1, 3]) + region([2, 4]))
    half = 0.5_real64*(region([2, 4]) - region([1, 3]))
    do k = 1, box%n_obstacles()
      if (.not. is_in_the_way(box, k, middle, half, 0.0_real64, wholly=.true.)) cycle
      call fields%complain(name, 'no disk fits into it because of obstacle "'//box%surface(box%obstacle(k)%surface)%name//'"')
      return
    end do
  end subroutine check_cover

  !> True if a disk with its centre in a rectangle can touch an obstacle. With the argument
  !> `wholly`, true only if the obstacle excludes disks from the whole rectangle.
  pure function is_in_the_way(box, m, middle, half, radius, wholly) result(yes)
    type(box_t), intent(in) :: box
    integer, intent(in) :: m                                  !! index of the obstacle
    real(real64), intent(in) :: middle(2), half(2)      !! centre and half edges of the rectangle [length]
    real(real64), intent(in) :: radius                        !! [length]
    logical, intent(in), optional :: wholly      !! if present, only exclusion from the whole rectangle counts
    logical :: yes
    real(real64) :: d(2)
    integer :: last(2), kx, ky

    yes = .false.
    associate (shape => box%obstacle(m)%shape)
      last = merge(1, 0, box%periodic .and. .not. shape%encloses)
      do ky = -last(2), last(2)
        do kx = -last(1), last(1)
          d = middle + [kx, ky]*box%edges() - shape%middle
          yes = shape%covers(d, half, radius)
          if (.not. (yes .or. present(wholly))) yes = shape%reaches(d, half, radius)
          if (yes) return
        end do
      end do
    end associate
  end function is_in_the_way

  !> Packing of the disks in the box at their present positions, with space for further disks.
  function present_packing(sim, region, more) result(packing)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    integer, intent(in) :: more                              !! maximum number of further disks
    type(packing_t) :: packing
    real(real64), allocatable :: x(:, :)                     ! present positions; shape (2, n) [length]
    integer(int32) :: i

    allocate (x(2, sim%n_disks()))
    do i = 1, sim%n_disks()
      x(:, i) = region([1, 3])
      if (sim%is_inside(i)) x(:, i) = sim%position(i)
    end do
    packing = packing_t(sim%box, int(sim%n_disks()) + more, size(sim%species))
    call packing%open_all_species(sim%tag%species, sim%disk%radius, min(minval(x, dim=2), region([1, 3])), &
      max(maxval(x, dim=2), region([2, 4])))
    do i = 1, sim%n_disks()
      if (.not. sim%is_inside(i)) cycle
      call packing%add(i, int(sim%tag(i)%species, int32), x(:, i), sim%disk(i)%radius)
    end do
  end function present_packing

  !> Draws random positions in a region until a disk of the given radius fits.
  pure subroutine find_position(region, sim, packing, radius, stream, x, free)
    real(real64), intent(in) :: region(4)                    !! xlo, xhi, ylo, yhi [length]
    type(simulation_t), intent(in) :: sim
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: radius                       !! [length]
    type(random_stream_t), intent(inout) :: stream
    real(real64), intent(out) :: x(2)                        !! [length]
    logical, intent(out) :: free                             !! .false. if no free position was found
    real(real64) :: lower(2), upper(2), u(2)
    integer(int32) :: blocker
    integer :: trial

    ! A moving side may leave no space for the disk; along its axis, `upper` then equals `lower`.
    call centre_range(region, sim%box, radius, lower, upper, sim%now)
    free = .false.
    x = lower
    if (any(lower >= upper)) return
    do trial = 1, most_trials
      call stream%draw_uniform(u(1))
      call stream%draw_uniform(u(2))
      x = min(lower + u*(upper - lower), upper)
      call packing%find_blocker(x, [0.0_real64, 0.0_real64], radius, blocker)
      free = blocker == 0
      if (free) return
    end do
  end subroutine find_position

end module free_positions
