!> Reads disks from the last complete frame in the output of a run, finished or unfinished.
submodule(starting_disks) last_frame
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use h5md_layout, only: box_group, disk_species, frame_counter, presence, species_names, value_of
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: series_t
  use variables, only: most_disks
  use texts, only: joined
  implicit none

  integer, parameter :: name_length = 64

contains

  !> See `starting_disks`.
  module subroutine read_last_frame(path, name, disks, box)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name
    type(disks_in_file_t), intent(inout) :: disks
    type(box_t), intent(in), optional :: box
    type(hdf5_file_t) :: file
    character(len=name_length), allocatable :: names(:)
    integer(int64), allocatable :: species(:)
    integer(int64) :: frames(1)
    real(real64) :: lower(2), edges(2)
    integer :: n, k, row                                    ! n: number of disks in the file

    call file%open(path, .false.)
    if (max(file%length(disk_species), file%length(species_names)) > most_disks) &
      call file%check(-1, "be read: its number of disks is not valid")
    n = int(max(0_int64, file%length(disk_species)))
    allocate (species(n))
    call file%fetch(disk_species, n, species)
    call file%fetch_texts(species_names, name_length, names)
    allocate (disks%rows, source=pack([(k, k=1, n)], species == findloc(names, name, dim=1)))
    if (.not. (allocated(file%failure) .or. any(names == name))) call fail(disks%error, exit_usage, path//": has no species """ &
      //name//"""; its species: "//joined(names, ", "))
    frames = 0
    call file%fetch(frame_counter, 1, frames)
    allocate (disks%table(size(datasets), size(disks%rows)), source=0.0_real64)
    allocate (disks%there(size(datasets)), source=.true.)
    if (size(disks%rows) > 0) then
      call read_rows(1, 2)
      call check_presence()
      call read_rows(3, 4)
      do row = spin_row, mass_row
        disks%there(row) = file%length(trim(datasets(row))) >= 0
        if (disks%there(row)) call read_rows(row, row)
      end do
      if (present(box)) then
        lower = 0
        edges = 1
        call file%fetch(box_group//"/lower", 2, lower)
        call file%fetch(box_group//"/edges", 2, edges)
        if (.not. all(abs(lower) <= largest .and. edges >= smallest .and. edges <= largest)) &
          call file%check(-1, "be read: "//box_group//" has values out of range")
        do k = 1, size(disks%rows)
          disks%table(1:2, k) = box%lower + (disks%table(1:2, k) - lower)*(box%edges()/edges)
        end do
      end if
    end if
    call file%close()
    if (.not. allocated(disks%error)) call file%report(disks%error)

  contains

    !> Reports disks that were outside the box in the last frame, where their positions are NaN.
    subroutine check_presence()
      integer, allocatable :: absent(:)

      if (file%length(presence//value_of) < 0) return
      absent = pack(disks%rows, any(ieee_is_nan(disks%table(1:2, :)), dim=1))
      if (size(absent) == 0 .or. allocated(disks%error)) return
      call fail(disks%error, exit_usage, path//": in the last frame "//written(size(absent))//" disks of species """//name &
        //""" are not in the box, the first of them disk "//written(absent(1))//"; a start needs all disks of the species")
    end subroutine check_presence

    !> Reads a range of rows of the table for all disks. Constant quantities such as radii and
    !> masses are stored in datasets outside the frames.
    subroutine read_rows(first, last)
      integer, intent(in) :: first, last
      type(series_t) :: series
      real(real64), allocatable :: values(:, :)             ! shape (last - first + 1, number of disks)
      integer :: width

      width = last - first + 1
      allocate (values(width, n), source=0.0_real64)
      if (first >= radius_row) then
        call file%fetch(trim(datasets(first)), n, values(1, :))
      else
        series = series_t(trim(datasets(first)), rank=width, shape=merge([n, 1], [width, n], width == 1))
        call series%find(file)
        if (frames(1) < 1 .or. frames(1) > series%capacity) call file%check(-1, "be read: "//frame_counter//" is " &
          //written(frames(1)))
        call series%load(file, frames(1), values)
        call series%close(file)
      end if
      disks%table(first:last, :) = values(:, disks%rows)
    end subroutine read_rows
  end subroutine read_last_frame

end submodule last_frame
