!> All disks, listed by square tiles of cells, so that each domain finds those in its patch without a look at all of them.
module disk_tiles
  use kinds, only: int16, int32
  use cell_faces, only: patch_t
  use sorting, only: sort_by_count
  use team, only: many
  implicit none
  private
  public :: disk_tiles_t

  integer(int32), parameter :: side = 16           !! of a tile [cells]

  type :: disk_tiles_t
    integer(int32) :: n(2) = 0                     !! columns, rows of tiles
    integer(int32), allocatable, private :: first(:)   !! (tiles+1) where the list of each begins
    integer(int32), allocatable, private :: disk(:)    !! (disks) numbers, tile by tile
  contains
    procedure :: sort
    procedure :: list
  end type disk_tiles_t

contains

  !> Sorts disks by the tiles that their cells are in.
  subroutine sort(self, whole, cell)
    class(disk_tiles_t), intent(inout) :: self
    integer(int32), intent(in) :: whole(2)         !! columns, rows of the whole grid
    integer(int16), intent(in) :: cell(:, :)       !! (2,disks) in it
    integer(int32) :: tile(size(cell, 2)), place(size(cell, 2)), i
    logical :: shared

    self%n = (whole - 1)/side + 1
    shared = size(tile) >= many
    !$omp parallel do if (shared)
    do i = 1, size(tile, kind=int32)
      tile(i) = 1 + (cell(1, i) - 1)/side + self%n(1)*((cell(2, i) - 1)/side)
    end do
    !$omp end parallel do
    call sort_by_count(tile, product(self%n), self%first, place)
    if (allocated(self%disk)) deallocate (self%disk)
    allocate (self%disk(size(tile)))
    !$omp parallel do if (shared)
    do i = 1, size(tile, kind=int32)
      self%disk(place(i)) = i
    end do
    !$omp end parallel do
  end subroutine sort

  !> Lists the disks in the cells of a patch.
  pure subroutine list(self, patch, cell, disks)
    class(disk_tiles_t), intent(in) :: self
    type(patch_t), intent(in) :: patch
    integer(int16), intent(in) :: cell(:, :)       !! (2,disks) as they were sorted by
    integer(int32), allocatable, intent(out) :: disks(:)
    logical :: column(patch%whole(1)), row(patch%whole(2))
    logical :: in_tiles(maxval(self%n), 2)
    integer(int32) :: i, k, n, m, t, tx, ty

    column = [(modulo(k - patch%first(1), patch%whole(1)) < patch%n(1), k=1, patch%whole(1))]
    row = [(modulo(k - patch%first(2), patch%whole(2)) < patch%n(2), k=1, patch%whole(2))]
    in_tiles = .false.
    do k = 1, size(column, kind=int32)
      if (column(k)) in_tiles((k - 1)/side + 1, 1) = .true.
    end do
    do k = 1, size(row, kind=int32)
      if (row(k)) in_tiles((k - 1)/side + 1, 2) = .true.
    end do
    do m = 1, 2                                    ! count, then list
      n = 0
      do ty = 1, self%n(2)
        do tx = 1, self%n(1)
          if (.not. (in_tiles(tx, 1) .and. in_tiles(ty, 2))) cycle
          t = tx + self%n(1)*(ty - 1)
          do k = self%first(t), self%first(t + 1) - 1
            i = self%disk(k)
            if (.not. (column(cell(1, i)) .and. row(cell(2, i)))) cycle
            n = n + 1
            if (m == 2) disks(n) = i
          end do
        end do
      end do
      if (m == 1) allocate (disks(n))
    end do
  end subroutine list

end module disk_tiles
