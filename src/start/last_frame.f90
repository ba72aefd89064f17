!> Disks from the last complete frame of a run, finished or not.
module last_frame
  use kinds, only: int32, int64, real64
  use errors, only: error_t, exit_usage, fail
  use h5md_layout, only: disk_species, frame_counter, position, species_names, value_of, velocity
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: series_t
  use texts, only: joined, written
  implicit none
  private
  public :: read_last_frame

  integer, parameter :: name_length = 64
  integer(int64), parameter :: most_disks = 100000000       !! that a run can have written

contains

  !> Reads the `count` disks of the species with this name.
  subroutine read_last_frame(path, name, count, n_columns, table, chosen, error)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name                    !! of the species
    integer, intent(in) :: count
    integer, intent(in) :: n_columns                        !! wanted: 2, or 4 with velocities
    real(real64), allocatable, intent(out) :: table(:, :)   !! (n_columns,count) x, y, vx, vy
    integer, allocatable, intent(out) :: chosen(:)          !! (count) their rows in the frame
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    character(len=name_length), allocatable :: names(:)
    integer(int32), allocatable :: species(:)
    integer(int64) :: n_disks
    integer :: k

    call file%open(path, .false.)
    n_disks = max(0_int64, file%length(disk_species))
    if (max(n_disks, file%length(species_names)) > most_disks) then
      call file%check(-1, "be read: its size is not that of a run's")
      call file%close()
      call file%report(error)
      return
    end if
    call file%fetch_texts(species_names, name_length, names)
    allocate (species(n_disks))
    call file%fetch(disk_species, size(species), species)
    allocate (chosen, source=pack([(k, k=1, size(species))], species == findloc(names, name, dim=1)))
    if (size(chosen) == count) then
      allocate (table(n_columns, count))
      call read_vectors(file, position//value_of, size(species), chosen, table(1:2, :))
      if (n_columns == 4) call read_vectors(file, velocity//value_of, size(species), chosen, table(3:4, :))
    end if
    call file%close()
    call file%report(error)
    if (allocated(error)) return
    if (all(names /= name)) then
      call fail(error, exit_usage, path//": has no species """//name//"""; its species: "//joined(names, ", "))
    else if (size(chosen) /= count) then
      call fail(error, exit_usage, path//": "//written(size(chosen))//" disks of species """// &
        name//""", but species.count is "//written(count))
    end if
  end subroutine read_last_frame

  !> Reads a vector of each chosen disk from the last frame.
  subroutine read_vectors(file, name, n, chosen, vectors)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(in) :: n                                !! disks in the file
    integer, intent(in) :: chosen(:)
    real(real64), intent(inout) :: vectors(:, :)            !! (2,chosen)
    type(series_t) :: series
    integer(int64) :: frames(1)
    real(real64), allocatable :: frame(:, :)

    frames = 0
    allocate (frame(2, n))
    call file%fetch(frame_counter, 1, frames)
    series = series_t(name, rank=2, shape=[2, n])
    call series%open(file)
    call series%read(file, frames(1), frame)
    call series%close()
    if (.not. allocated(file%failure)) vectors = frame(:, chosen)
  end subroutine read_vectors

end module last_frame
