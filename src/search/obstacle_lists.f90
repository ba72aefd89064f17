!> Which obstacles reach into which cell, so that a disk asks only those that it can meet in its own.
module obstacle_lists
  use kinds, only: int16, int32, real64
  use box_geometry, only: box_t, next_obstacle
  use cell_faces, only: cell_faces_t, patch_t
  use disks, only: disk_t, tag_t
  use images, only: images_t
  use partners, only: n_sides
  use shapes, only: shape_t, spare
  use sorting, only: sort_by_count
  implicit none
  private
  public :: obstacle_lists_t

  type :: obstacle_lists_t
    private
    integer(int32) :: columns = 0
    integer(int32), allocatable :: first(:)        !! (cells+1) first entry of a cell in `list`; none without obstacles
    integer(int32), allocatable :: list(:)         !! codes of the obstacles that reach into the cell, descending
  contains
    procedure :: renew
    procedure :: next_contact
    procedure :: reach_into
  end type obstacle_lists_t

  !> Obstacles in cells, before they are sorted by cell.
  type :: entries_t
    integer(int32) :: n = 0
    integer(int32), allocatable :: cell(:), code(:)    !! (n, and room for more)
  end type entries_t

contains

  !> The earlier of a known event and the contacts with the obstacles in reach of the disk's cell.
  pure subroutine next_contact(self, box, disk, tag, t, code)
    class(obstacle_lists_t), intent(in) :: self
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(in) :: tag                 !! of the disk
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    integer(int32) :: c

    if (.not. allocated(self%first)) return
    c = tag%cell(1) + self%columns*(tag%cell(2) - 1)
    call next_obstacle(box, disk, tag%met, self%list(self%first(c):self%first(c + 1) - 1), t, code)
  end subroutine next_contact

  !> Whether there are obstacles in reach of a cell.
  pure function reach_into(self, cell) result(yes)
    class(obstacle_lists_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)          !! column and row, from 1
    logical :: yes
    integer(int32) :: c

    yes = .false.
    if (.not. allocated(self%first)) return
    c = cell(1) + self%columns*(cell(2) - 1)
    yes = self%first(c + 1) > self%first(c)
  end function reach_into

  !> Lists which obstacles a disk with its centre in a cell can touch, for every cell.
  subroutine renew(self, box, patch, faces)
    class(obstacle_lists_t), intent(inout) :: self
    type(box_t), intent(in) :: box
    type(patch_t), intent(in) :: patch             !! the cells
    type(cell_faces_t), intent(in) :: faces
    type(entries_t) :: entries
    integer(int32), allocatable :: place(:)
    type(images_t) :: images
    integer(int32) :: k
    integer :: image

    if (allocated(self%first)) deallocate (self%first, self%list)
    if (.not. box%has_obstacles()) return
    self%columns = patch%n(1)
    allocate (entries%cell(64), entries%code(64))
    do k = n_sides + 1, size(box%surface)
      associate (shape => box%surface(k)%shape)
        images = merge(images_t(), box%images(), shape%encloses)
        do image = 1, images%count()
          call enter(shape, 1 - k, images%shift(images%around(image)) - box%lower, patch, faces, entries)
        end do
      end associate
    end do
    allocate (place(entries%n), self%list(entries%n))
    call sort_by_count(entries%cell(:entries%n), product(patch%n), self%first, place)
    self%list(place) = entries%code(:entries%n)
  end subroutine renew

  !> Adds the cells that an image of an obstacle reaches into.
  subroutine enter(shape, code, shift, patch, faces, entries)
    class(shape_t), intent(in) :: shape
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: shift(2)           !! from the middle of the shape, to the corner of the box [length]
    type(patch_t), intent(in) :: patch
    type(cell_faces_t), intent(in) :: faces
    type(entries_t), intent(inout) :: entries
    real(real64) :: half(2), room(2), to_shape(2), corner(2, 2)
    integer(int32) :: low(2), high(2), here(2), ix, iy

    half = 0.5_real64*(faces%width + faces%overlap)*(1 + spare)
    to_shape = shape%middle + shift
    room = (half + shape%extent() + patch%small)*(1 + spare)
    low = int(max(min(ceiling((to_shape - room)/faces%width + 0.5_real64), patch%whole), 1), int32)
    high = int(max(min(floor((to_shape + room)/faces%width + 0.5_real64), patch%whole), 1), int32)
    if (shape%encloses) low = 1
    if (shape%encloses) high = patch%whole
    do iy = low(2), high(2)
      do ix = low(1), high(1)
        here = modulo([ix, iy] - patch%first, patch%whole) + 1
        if (any(here > patch%n)) cycle
        call faces%rectangle([ix, iy], patch%whole, corner(:, 1), corner(:, 2))
        if (.not. shape%reaches(0.5_real64*(corner(:, 1) + corner(:, 2)) - to_shape, &
          0.5_real64*(corner(:, 2) - corner(:, 1))*(1 + spare), patch%small)) cycle
        entries%n = entries%n + 1
        if (entries%n > size(entries%cell)) then
          entries%cell = [entries%cell, entries%cell]
          entries%code = [entries%code, entries%code]
        end if
        entries%cell(entries%n) = here(1) + patch%n(1)*(here(2) - 1)
        entries%code(entries%n) = code
      end do
    end do
  end subroutine enter

end module obstacle_lists
