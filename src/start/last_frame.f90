!> Disks from the last complete frame of a run, finished or not.
module last_frame
  use kinds, only: int32, int64, real64
  use errors, only: error_t, exit_usage, fail
  use hdf5_items, only: fetch_item, fetch_texts
  use hdf5_objects, only: hdf5_file_t
  use texts, only: joined, written
  implicit none
  private
  public :: read_last_frame

  character(len=*), parameter :: disks = "particles/disks/"
  integer, parameter :: name_length = 64

contains

  !> Reads the `count` disks of the species with this name.
  subroutine read_last_frame(path, name, count, n_columns, table, error)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name                    !! of the species
    integer, intent(in) :: count
    integer, intent(in) :: n_columns                        !! wanted: 2, or 4 with velocities
    real(real64), allocatable, intent(out) :: table(:, :)   !! (n_columns,count) x, y, vx, vy
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    character(len=name_length), allocatable :: names(:)
    integer(int32), allocatable :: species(:)
    integer, allocatable :: chosen(:)
    integer :: k

    call file%open(path, .false.)
    call fetch_texts(file, "parameters/species/names", name_length, names)
    allocate (species(max(0_int64, file%length(disks//"species"))))
    call file%fetch(disks//"species", size(species), species)
    allocate (chosen, source=pack([(k, k=1, size(species))], species == findloc(names, name, dim=1)))
    if (size(chosen) == count) call read_columns(file, size(species), chosen, n_columns, table)
    call file%close()
    call file%failure(error)
    if (allocated(error)) return
    if (all(names /= name)) then
      call fail(error, exit_usage, path//": has no species """//name//"""; its species: "//joined(names, ", "))
    else if (size(chosen) /= count) then
      call fail(error, exit_usage, path//": "//written(size(chosen))//" disks of species """// &
        name//""", but species.count is "//written(count))
    end if
  end subroutine read_last_frame

  subroutine read_columns(file, n, chosen, n_columns, table)
    type(hdf5_file_t), intent(inout) :: file
    integer, intent(in) :: n                                !! disks in the file
    integer, intent(in) :: chosen(:)
    integer, intent(in) :: n_columns
    real(real64), allocatable, intent(out) :: table(:, :)
    real(real64), allocatable :: vectors(:)
    integer(int64) :: frames(1)

    frames = 0
    allocate (table(n_columns, size(chosen)), vectors(2*n))
    call file%fetch(disks//"committed", 1, frames)
    call fetch_item(file, disks//"position/value", frames(1), 2*n, vectors)
    if (allocated(file%trouble)) return
    table(1, :) = vectors(2*chosen - 1)
    table(2, :) = vectors(2*chosen)
    if (n_columns == 2) return
    call fetch_item(file, disks//"velocity/value", frames(1), 2*n, vectors)
    if (allocated(file%trouble)) return
    table(3, :) = vectors(2*chosen - 1)
    table(4, :) = vectors(2*chosen)
  end subroutine read_columns

end module last_frame
