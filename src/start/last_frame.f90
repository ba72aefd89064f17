!> Disks from the last complete frame of a run, finished or not.
module last_frame
  use kinds, only: int64, real64
  use box_geometry, only: box_t
  use errors, only: error_t, exit_usage, fail
  use h5md_layout, only: angular_velocity, box_group, disk_mass, disk_radius, disk_species, frame_counter, orientation, &
    position, species_names, value_of, velocity
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: series_t
  use variables, only: largest, most_disks, smallest
  use position_file, only: mass_row, radius_row, spin_row
  use texts, only: counted, joined, written
  implicit none
  private
  public :: datasets, is_run, read_last_frame

  integer, parameter :: name_length = 64
  !> Where each of `position_file: column_names` is in the file of a run; what stands before the radius is in frames.
  character(len=48), parameter :: datasets(*) = [character(len=48) :: position//value_of, position//value_of, &
    velocity//value_of, velocity//value_of, angular_velocity//value_of, orientation//value_of, disk_radius, disk_mass]

contains

  !> Whether a path is that of the output of a run, finished or not.
  pure function is_run(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = index(path//"|", ".h5|") > 0 .or. index(path//"|", ".h5.part|") > 0
  end function is_run

  !> Finds the disks of a species in the open file of a run.
  subroutine choose(file, name, n, chosen, error)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(out) :: n                               !! disks in the file
    integer, allocatable, intent(out) :: chosen(:)          !! their rows in a frame
    type(error_t), allocatable, intent(out) :: error
    character(len=name_length), allocatable :: names(:)
    integer(int64), allocatable :: species(:)
    integer(int64) :: n_disks
    integer :: k

    n_disks = max(0_int64, file%length(disk_species))
    if (max(n_disks, file%length(species_names)) > most_disks) then
      call file%check(-1, "be read: its size is not that of a run's")
      n_disks = 0
    end if
    n = int(n_disks)
    if (n == 0) call expect(file, disk_species, 1_int64)
    if (file%length(species_names) < 1) call expect(file, species_names, 1_int64)
    call file%fetch_texts(species_names, name_length, names)
    allocate (species(n))
    call file%fetch(disk_species, n, species)
    allocate (chosen, source=pack([(k, k=1, n)], species == findloc(names, name, dim=1)))
    if (allocated(file%failure) .or. any(names == name)) return
    call fail(error, exit_usage, file%path//": has no species """//name//"""; its species: "//joined(names, ", "))
  end subroutine choose

  !> Reads the disks of the species with this name.
  subroutine read_last_frame(path, name, table, there, chosen, error, box)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name                    !! of the species
    real(real64), allocatable, intent(out) :: table(:, :)   !! (`position_file: column_names`,n)
    logical, intent(out) :: there(:)                        !! whether these are known
    integer, allocatable, intent(out) :: chosen(:)          !! (n) rows of the disks in the frame
    type(error_t), allocatable, intent(out) :: error
    type(box_t), intent(in), optional :: box                !! to which the positions are stretched
    type(hdf5_file_t) :: file
    real(real64) :: lower(2), edges(2)
    character(len=:), allocatable :: dataset
    integer :: n, k, row

    there = .true.
    call file%open(path, .false.)
    call choose(file, name, n, chosen, error)
    allocate (table(size(there), size(chosen)), source=0.0_real64)
    if (size(chosen) > 0 .and. .not. allocated(error)) then
      call read_element(file, trim(datasets(1)), n, chosen, table(1:2, :))
      call read_element(file, trim(datasets(3)), n, chosen, table(3:4, :))
      do row = spin_row, mass_row
        dataset = trim(datasets(row))
        there(row) = file%length(dataset) >= 0
        if (there(row) .and. row < radius_row) call read_element(file, dataset, n, chosen, table(row:row, :))
        if (there(row) .and. row >= radius_row) call read_numbers(file, dataset, n, chosen, table(row, :))
      end do
      if (present(box)) then
        lower = 0
        edges = 1
        call file%fetch(box_group//"/lower", 2, lower)
        call file%fetch(box_group//"/edges", 2, edges)
        if (.not. all(abs(lower) <= largest .and. edges >= smallest .and. edges <= largest)) &
          call file%check(-1, "be read: "//box_group)
        do k = 1, size(chosen)
          table(1:2, k) = box%lower + (table(1:2, k) - lower)*(box%edges()/edges)
        end do
      end if
    end if
    call file%close()
    if (.not. allocated(error)) call file%report(error)
  end subroutine read_last_frame

  !> Reads a number of each chosen disk.
  subroutine read_numbers(file, name, n, chosen, numbers)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(in) :: n                                !! disks in the file
    integer, intent(in) :: chosen(:)
    real(real64), intent(inout) :: numbers(:)               !! (chosen)
    real(real64), allocatable :: all(:)

    allocate (all(n), source=0.0_real64)
    call expect(file, name, int(n, int64))
    call file%fetch(name, n, all)
    numbers = all(chosen)
  end subroutine read_numbers

  !> Says what is wrong with a dataset that has not n values.
  subroutine expect(file, name, n)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: n
    integer(int64) :: there

    there = file%length(name)
    if (there < 0) then
      call file%check(-1, "be read: "//name//" is missing")
    else if (there /= n) then
      call file%check(-1, "be read: "//name//" has "//counted(there, "value")//" instead of "//written(n))
    end if
  end subroutine expect

  !> Reads numbers or vectors of the chosen disks from the last frame.
  subroutine read_element(file, name, n, chosen, values)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(in) :: n                                !! disks in the file
    integer, intent(in) :: chosen(:)
    real(real64), intent(inout) :: values(:, :)             !! (width,chosen)
    type(series_t) :: series
    integer(int64) :: frames(1), there
    real(real64), allocatable :: frame(:, :)
    integer :: width

    frames = 0
    width = size(values, 1)
    allocate (frame(width, n))
    call expect(file, frame_counter, 1_int64)
    call file%fetch(frame_counter, 1, frames)
    if (file%length(name) < 0) call file%check(-1, "be read: "//name//" is missing")
    there = file%length(name)/(int(width, int64)*n)
    if (frames(1) < 1 .or. frames(1) > there) call file%check(-1, "be read: "//frame_counter//" is "//written(frames(1)) &
      //", but "//name//" has room for "//counted(there, "frame")//" of "//counted(int(n, int64), "disk"))
    series = series_t(name, rank=width, shape=merge([n, 1], [width, n], width == 1))
    call series%find(file)
    call series%read(file, frames(1), frame)
    if (.not. allocated(file%failure)) values = frame(:, chosen)
  end subroutine read_element

end module last_frame
