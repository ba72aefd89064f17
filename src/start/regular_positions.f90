!> Regular positions in a region: a rectangular grid, or a triangular lattice.
module regular_positions
  use kinds, only: real64
  use box_geometry, only: box_t
  use box_sides, only: centre_range, spans
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use settings, only: species_settings_t
  use shapes, only: magnitude
  use texts, only: written
  implicit none
  private
  public :: grid_positions, lattice_positions

contains

  !> Positions on a rectangular grid: the centres of nx*ny equal cells of the region, row by row from the bottom.
  subroutine grid_positions(species, group, x, problems)
    type(species_settings_t), intent(in) :: species
    type(group_t), intent(in) :: group
    real(real64), allocatable, intent(out) :: x(:, :)       !! (2,count) [length]
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: side(2)
    integer :: k

    associate (n => species%grid, region => species%region)
      side = (region([2, 4]) - region([1, 3]))/n
      allocate (x(2, species%count))
      do k = 1, species%count
        x(:, k) = region([1, 3]) + ([modulo(k - 1, n(1)), (k - 1)/n(1)] + 0.5_real64)*side
      end do
      if (any(side < 2*species%radius)) call group%complain("grid", "disks of diameter "//written(2*species%radius) &
        //" do not fit into cells of "//written(side(1))//" x "//written(side(2)), problems)
    end associate
  end subroutine grid_positions

  !> Positions on a triangular lattice, row by row from the bottom. The lattice is stretched along one axis so that it fills the
  !> region. The number of rows is chosen such that the distance between neighbours is as large as possible. If the lattice has more
  !> positions than the species has disks, the last positions remain empty.
  subroutine lattice_positions(species, group, box, x, problems)
    type(species_settings_t), intent(in) :: species
    type(group_t), intent(in) :: group
    type(box_t), intent(in) :: box
    real(real64), allocatable, intent(out) :: x(:, :)       !! (2,count) [length]
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: lower(2), upper(2), first(2), step(2), distance, found, closest
    logical :: periodic(2)
    integer :: columns, k, row, fits, more

    periodic = spans(species%region, box)
    call centre_range(species%region, box, species%radius, lower, upper)
    call choose_lattice(species%count)
    allocate (x(2, species%count))
    first = lower + merge([0.25_real64, 0.5_real64]*step, [0.0_real64, 0.0_real64], periodic)
    do k = 1, species%count
      row = (k - 1)/columns
      x(:, k) = first + [modulo(k - 1, columns) + 0.5_real64*modulo(row, 2), real(row, real64)]*step
    end do
    closest = 2*species%radius*(1 - 2*epsilon(closest))
    if (distance >= closest) return
    found = distance
    fits = 0
    more = species%count
    do while (more - fits > 1)  ! bisection is possible, because the distance decreases with the number of disks
      call choose_lattice(fits + (more - fits)/2)
      if (distance < closest) more = fits + (more - fits)/2
      if (distance >= closest) fits = fits + (more - fits)/2
    end do
    call group%complain("placement", written(species%count)//" disks of diameter "//written(2*species%radius) &
      //" do not fit; on the lattice their centres are "//written(found)//" apart; up to "//written(fits)//" fit", problems)

  contains

    !> Finds the lattice with at least n positions that has the largest distance between neighbours.
    subroutine choose_lattice(n)
      integer, intent(in) :: n
      real(real64) :: its_step(2), its_distance
      integer :: rows

      distance = -1
      do rows = 1, n
        ! A periodic lattice must have an even number of rows, because alternate rows are shifted.
        if (periodic(2) .and. modulo(rows, 2) == 1 .and. rows > 1) cycle
        call measure_lattice(1 + (n - 1)/rows, rows, its_step, its_distance)
        if (rows > 2 .and. 2*its_step(2) <= distance) exit  ! with more rows, the distance between neighbours could only be smaller
        if (its_distance <= distance) cycle
        distance = its_distance
        columns = 1 + (n - 1)/rows
        step = its_step
      end do
    end subroutine choose_lattice

    !> Lattice spacings between columns and between rows, and the shortest distance between neighbours.
    subroutine measure_lattice(columns, rows, step, distance)
      integer, intent(in) :: columns, rows
      real(real64), intent(out) :: step(2), distance        !! [length]
      real(real64) :: gaps(2)

      gaps = [columns - 1, rows - 1]
      if (rows > 1) gaps(1) = gaps(1) + 0.5_real64          ! alternate rows are shifted by half a spacing
      gaps = merge(real([columns, rows], real64), gaps, periodic)
      distance = huge(distance)
      step = upper - lower
      where (gaps > 0) step = step/gaps
      if (columns > 1 .or. periodic(1)) distance = step(1)
      if (rows > 1) then
        distance = min(distance, magnitude([0.5_real64*step(1), step(2)]))
        if (rows > 2) distance = min(distance, 2*step(2))
      else if (periodic(2)) then
        distance = min(distance, step(2))
      end if
    end subroutine measure_lattice
  end subroutine lattice_positions

end module regular_positions
