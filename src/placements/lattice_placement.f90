!> Placement on a triangular lattice.
module lattice_placement
  use box_geometry, only: spans
  use box_state, only: box_state_t, centre_range
  use fields, only: fields_t
  use kinds, only: real64
  use packing, only: packing_t
  use placement, only: batch_t, placement_t
  use shapes, only: magnitude
  use status_line, only: status_line_t
  use texts, only: written
  use variable_rows, only: choice_t
  implicit none
  private
  public :: lattice_placement_t, choices, find_lattice, word

  character(len=*), parameter :: word = "lattice"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "The disks form a triangular lattice that fills the region, up to the closest packing 0.9069.")]

  type, extends(placement_t) :: lattice_placement_t
  contains
    procedure :: place
  end type lattice_placement_t

  !> A triangular lattice in a rectangle.
  type :: lattice_t
    real(real64) :: edges(2) = 0.0_real64                   !! edges of the rectangle [length]
    logical :: periodic(2) = .false.
    integer :: columns = 0
    real(real64) :: step(2) = 0.0_real64                    !! spacing of columns and of rows [length]
    real(real64) :: distance = 0.0_real64                   !! shortest distance between neighbours [length]
  contains
    procedure :: choose
    procedure :: measure
  end type lattice_t

contains

  !> Places the disks on the lattice.
  subroutine place(self, batch, packing, line, fields)
    class(lattice_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
    character(len=:), allocatable :: misfit

    call find_lattice(batch%region, packing%box, size(batch%radius), batch%largest_radius, batch%x, misfit)
    if (misfit /= "") call fields%complain("placement", misfit)
  end subroutine place

  !> Positions on a triangular lattice, row by row from the bottom. The lattice is stretched along
  !> one axis to fill the region. The number of rows is chosen such that the distance between
  !> neighbours is as large as possible. If there are more lattice sites than disks, the last sites
  !> remain empty.
  pure subroutine find_lattice(region, box, count, radius, x, misfit)
    real(real64), intent(in) :: region(4)                   !! xlo, xhi, ylo, yhi [length]
    type(box_state_t), intent(in) :: box
    integer, intent(in) :: count                            !! number of disks
    real(real64), intent(in) :: radius                      !! largest radius of the disks [length]
    real(real64), allocatable, intent(out) :: x(:, :)       !! (2,count) [length]
    !> Reason why the disks do not fit; empty if they fit.
    character(len=:), allocatable, intent(out) :: misfit
    type(lattice_t) :: lattice, other
    real(real64) :: lower(2), upper(2), first(2), closest
    integer :: k, row, fits, more, middle

    misfit = ""
    lattice%periodic = spans(region, box%box_t)
    call centre_range(region, box, radius, lower, upper)
    lattice%edges = upper - lower
    call lattice%choose(count)
    allocate (x(2, count))
    first = lower + merge([0.25_real64, 0.5_real64]*lattice%step, [0.0_real64, 0.0_real64], lattice%periodic)
    do k = 1, count
      row = (k - 1)/lattice%columns
      x(:, k) = first + [modulo(k - 1, lattice%columns) + 0.5_real64*modulo(row, 2), real(row, real64)]*lattice%step
    end do
    closest = 2*radius*(1 - 2*epsilon(closest))
    if (lattice%distance >= closest) return
    other = lattice
    fits = 0
    more = count
    do while (more - fits > 1)  ! bisection, because the distance decreases with the number of disks
      middle = fits + (more - fits)/2
      call other%choose(middle)
      if (other%distance < closest) more = middle
      if (other%distance >= closest) fits = middle
    end do
    misfit = written(count)//" disks of diameter "//written(2*radius)//" do not fit; on the lattice their centres are " &
      //written(lattice%distance)//" apart; up to "//written(fits)//" fit"
  end subroutine find_lattice

  !> Chooses, among the lattices with at least n sites, the one with the largest distance between
  !> neighbours.
  pure subroutine choose(self, n)
    class(lattice_t), intent(inout) :: self
    integer, intent(in) :: n
    real(real64) :: step(2), distance
    integer :: rows

    self%distance = -1
    do rows = 1, n
      ! A periodic lattice must have an even number of rows, because alternate rows are shifted.
      if (self%periodic(2) .and. modulo(rows, 2) == 1 .and. rows > 1) cycle
      call self%measure(1 + (n - 1)/rows, rows, step, distance)
      ! more rows could only reduce the distance between neighbours
      if (rows > 2 .and. 2*step(2) <= self%distance) exit
      if (distance <= self%distance) cycle
      self%distance = distance
      self%columns = 1 + (n - 1)/rows
      self%step = step
    end do
  end subroutine choose

  !> Spacings of columns and rows of a lattice, and the shortest distance between neighbours.
  pure subroutine measure(self, columns, rows, step, distance)
    class(lattice_t), intent(in) :: self
    integer, intent(in) :: columns, rows
    real(real64), intent(out) :: step(2), distance        !! [length]
    real(real64) :: gaps(2)

    gaps = [columns - 1, rows - 1]
    if (rows > 1) gaps(1) = gaps(1) + 0.5_real64          ! alternate rows are shifted by half a spacing
    gaps = merge(real([columns, rows], real64), gaps, self%periodic)
    distance = huge(distance)
    step = self%edges
    where (gaps > 0) step = step/gaps
    if (columns > 1 .or. self%periodic(1)) distance = step(1)
    if (rows > 1) then
      distance = min(distance, magnitude([0.5_real64*step(1), step(2)]))
      if (rows > 2) distance = min(distance, 2*step(2))
    else if (self%periodic(2)) then
      distance = min(distance, step(2))
    end if
  end subroutine measure

end module lattice_placement
