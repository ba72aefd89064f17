!> Disks from the last complete frame of a run, finished or not.
module last_frame
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use errors, only: error_t, exit_usage, fail
  use h5md_layout, only: box_group, disk_species, frame_counter, position, species_names, value_of, velocity
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: series_t
  use parameters, only: largest, smallest
  use texts, only: counted, joined, written
  implicit none
  private
  public :: count_in_run, is_run, read_last_frame

  integer, parameter :: name_length = 64
  integer(int64), parameter :: most_disks = 100000000       !! that a run can have written

contains

  !> Whether a path is that of the output of a run, finished or not.
  pure function is_run(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = index(path//"|", ".h5|") > 0 .or. index(path//"|", ".h5.part|") > 0
  end function is_run

  !> Counts the disks of the species with this name.
  subroutine count_in_run(path, name, count, error)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name                    !! of the species
    integer, intent(out) :: count
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_file_t) :: file
    integer, allocatable :: chosen(:)
    integer :: n

    call file%open(path, .false.)
    call choose(file, name, n, chosen, error)
    call file%close()
    if (.not. allocated(error)) call file%report(error)
    count = size(chosen)
  end subroutine count_in_run

  !> Finds the disks of a species in the open file of a run.
  subroutine choose(file, name, n, chosen, error)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(out) :: n                               !! disks in the file
    integer, allocatable, intent(out) :: chosen(:)          !! their rows in a frame
    type(error_t), allocatable, intent(out) :: error
    character(len=name_length), allocatable :: names(:)
    integer(int32), allocatable :: species(:)
    integer(int64) :: n_disks
    integer :: k

    n_disks = max(0_int64, file%length(disk_species))
    if (max(n_disks, file%length(species_names)) > most_disks) then
      call file%check(-1, "be read: its size is not that of a run's")
      n_disks = 0
    end if
    n = int(n_disks)
    call file%fetch_texts(species_names, name_length, names)
    allocate (species(n))
    call file%fetch(disk_species, n, species)
    allocate (chosen, source=pack([(k, k=1, n)], species == findloc(names, name, dim=1)))
    if (allocated(file%failure) .or. any(names == name)) return
    call fail(error, exit_usage, file%path//": has no species """//name//"""; its species: "//joined(names, ", "))
  end subroutine choose

  !> Reads the `count` disks of the species with this name.
  subroutine read_last_frame(path, name, count, table, chosen, error, box)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name                    !! of the species
    integer, intent(in) :: count
    real(real64), intent(out) :: table(:, :)                !! (columns,count) x, y, or x, y, vx, vy
    integer, allocatable, intent(out) :: chosen(:)          !! (count) their rows in the frame
    type(error_t), allocatable, intent(out) :: error
    type(box_t), intent(in), optional :: box                !! to which the positions are stretched
    type(hdf5_file_t) :: file
    real(real64) :: lower(2), edges(2)
    integer :: n, k

    table = 0
    call file%open(path, .false.)
    call choose(file, name, n, chosen, error)
    if (size(chosen) == count .and. .not. allocated(error)) then
      call read_vectors(file, position//value_of, n, chosen, table(1:2, :))
      if (size(table, 1) == 4) call read_vectors(file, velocity//value_of, n, chosen, table(3:4, :))
      if (present(box)) then
        lower = 0
        edges = 1
        call file%fetch(box_group//"/lower", 2, lower)
        call file%fetch(box_group//"/edges", 2, edges)
        if (.not. all(abs(lower) <= largest .and. edges >= smallest .and. edges <= largest)) &
          call file%check(-1, "be read: "//box_group)
        do k = 1, count
          table(1:2, k) = box%lower + (table(1:2, k) - lower)*(box%edges()/edges)
        end do
      end if
    end if
    call file%close()
    if (.not. allocated(error)) call file%report(error)
    if (size(chosen) /= count .and. .not. allocated(error)) call fail(error, exit_usage, path//": " &
      //counted(size(chosen, kind=int64), "disk")//" of species """//name//""", but species.count is "//written(count))
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
