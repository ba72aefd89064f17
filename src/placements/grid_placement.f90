!> Placement on a rectangular grid. The disks are at the centres of equal cells of the region, row
!> by row from the bottom.
module grid_placement
  use fields, only: fields_t
  use kinds, only: int64, real64
  use packing, only: packing_t
  use placement, only: batch_t, placement_t
  use status_line, only: status_line_t
  use texts, only: written
  use variable_rows, only: choice_t, count_of_disks, variable_t
  implicit none
  private
  public :: grid_placement_t, choices, rows, word

  character(len=*), parameter :: word = "grid"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "The disks form a rectangular grid that fills the region, with the numbers of columns and rows " &
      //"in grid.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("species", "grid", "integer", 2, "required", "10, 10", &
      "Numbers of columns and rows of the rectangular grid. The number of disks is the product of these two numbers.", &
      count_of_disks, &
      goes_with="placement "//word)]

  type, extends(placement_t) :: grid_placement_t
    integer :: cells(2) = 0                    !! numbers of columns and rows
  contains
    procedure :: read => read_numbers
    procedure :: count_disks
    procedure :: place
  end type grid_placement_t

contains

  !> Reads the numbers of columns and rows.
  subroutine read_numbers(self, fields)
    class(grid_placement_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read("grid", self%cells)
  end subroutine read_numbers

  !> See `placement`.
  pure subroutine count_disks(self, n, variable)
    class(grid_placement_t), intent(in) :: self
    integer(int64), intent(out) :: n
    character(len=:), allocatable, intent(out) :: variable

    n = product(int(self%cells, int64))
    variable = "grid"
  end subroutine count_disks

  !> Places the disks at the centres of the cells.
  subroutine place(self, batch, packing, line, fields)
    class(grid_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
    real(real64) :: side(2)
    integer :: k

    associate (n => self%cells, region => batch%region)
      side = (region([2, 4]) - region([1, 3]))/n
      batch%x = reshape(batch%x, [2, size(batch%radius)], pad=[0.0_real64])
      do k = 1, size(batch%radius)
        batch%x(:, k) = region([1, 3]) + ([modulo(k - 1, n(1)), (k - 1)/n(1)] + 0.5_real64)*side
      end do
      if (any(side < 2*batch%largest_radius)) call fields%complain("grid", "disks of diameter " &
        //written(2*batch%largest_radius)//" do not fit into cells of "//written(side(1))//" x "//written(side(2)))
    end associate
  end subroutine place

end module grid_placement
