!> Placement by compression (see `dense_growth`). All species of a region are compressed together;
!> disks placed earlier act as fixed obstacles.
module dense_placement
  use box_geometry, only: box_t, spans
  use box_state, only: bounds
  use circles, only: new_circle
  use dense_growth, only: grow_disks
  use errors, only: error_t
  use fields, only: fields_t
  use images, only: images_t
  use kinds, only: real64
  use packing, only: packing_t
  use placement, only: batch_t, in_batches, placement_t, stream_number
  use random_stream, only: random_stream_t
  use status_line, only: status_line_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: dense_placement_t, choices, growth_box, word

  character(len=*), parameter :: word = "dense"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "Lubachevsky-Stillinger compression: randomly placed disks grow while they move and " &
      //"collide, up to a packing fraction of about 0.84. Dense packings generated in this way are not in equilibrium.")]

  type, extends(placement_t) :: dense_placement_t
  contains
    procedure :: turn
    procedure :: place
    procedure :: bytes
  end type dense_placement_t

contains

  !> See `placement`.
  pure function turn(self)
    class(dense_placement_t), intent(in) :: self
    integer :: turn

    turn = in_batches
  end function turn

  !> Compresses the disks in a box with the shape of the region, starting at their positions if
  !> these are given.
  subroutine place(self, batch, packing, line, fields)
    class(dense_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
    type(random_stream_t) :: stream
    type(box_t) :: box
    type(error_t), allocatable :: error

    box = growth_box(packing, batch%region)
    call stream%seed(batch%seed, [int(batch%number), stream_number])
    call grow_disks(box, batch%species, batch%radius, stream, line, batch%x, error)
    if (allocated(error)) call fields%complain("placement", error%message)
  end subroutine place

  !> Creates the box for a compression: the region, cut off at displaced sides. Disks placed earlier
  !> and their periodic images become obstacles if they extend into the box.
  function growth_box(packing, region) result(box)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: region(4)
    type(box_t) :: box
    real(real64) :: centre(2), radius
    type(images_t) :: images
    integer :: k, i, n, pass

    box = box_t()
    call bounds(packing%box, 0.0_real64, box%lower, box%upper)
    box%lower = max(region([1, 3]), box%lower)
    box%upper = min(region([2, 4]), box%upper)
    box%periodic = spans(region, packing%box%box_t)
    images = packing%box%images()
    do pass = 1, 2  ! first count the obstacles, then create them
      n = packing%box%n_obstacles()
      do k = 1, size(packing%disk)
        if (packing%disk(k)%species == 0) cycle
        radius = packing%disk(k)%radius
        do i = 1, images%count()
          centre = packing%disk(k)%x + images%shift(images%around(i))
          if (any(centre < box%lower - radius .or. centre > box%upper + radius)) cycle
          n = n + 1
          if (pass == 1) cycle
          allocate (box%obstacle(n)%shape, source=new_circle(centre, radius, encloses=.false.))
        end do
      end do
        ! all obstacles of the new box are elastic
      if (pass == 1) call box%add_obstacles(["obstacles", "disks    "], &
        [packing%box%n_obstacles(), n - packing%box%n_obstacles()])
    end do
    do k = 1, packing%box%n_obstacles()
      allocate (box%obstacle(k)%shape, source=packing%box%obstacle(k)%shape)
    end do
  end function growth_box

  !> See `placement`.
  pure function bytes(self, own_sizes, periods) result(number)
    class(dense_placement_t), intent(in) :: self
    logical, intent(in) :: own_sizes
    real(real64), intent(in) :: periods
    real(real64) :: number

    number = 310 + periods
  end function bytes

end module dense_placement
