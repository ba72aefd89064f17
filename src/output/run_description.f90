!> Writes the constant contents of an output file: format and author, box, disks, all parameters,
!> and provenance.
module run_description
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: compiler_version
  use kinds, only: int32, int64, real64
  use build_info, only: build_flags, git_commit
  use changes, only: text_of_change
  use disks, only: names_of
  use h5md_layout, only: all_disks, box_group, changes_at_work, disk_id, disk_mass, disk_radius, disk_species, earlier_changes, &
    observables_group, parameters_group, provenance, saved_at, species_counts, species_names, wall_time
  use hdf5_handle, only: hdf5_version
  use hdf5_objects, only: hdf5_file_t, scalar
  use input_surfaces, only: has_many
  use input_groups, only: group_t, value_t, range_of
  use variables, only: is_repeated, obstacle_groups, table
  use settings, only: run_input_t
  use simulation_state, only: simulation_t
  use system, only: host_name
  use texts, only: growing_text_t
  use version, only: program_version
  implicit none
  private
  public :: describe_end, describe_run, describes

  !> Maximum number of values in an attribute, because HDF5 limits attributes to 64 kB.
  integer, parameter :: longest_attribute = 1000
  !> Maximum length of the stated reason why the run ended.
  integer, parameter :: longest_note = 500

contains

  !> Writes all datasets that are not time series. Values known only at the end of the run are
  !> written as placeholders.
  subroutine describe_run(file, input, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(run_input_t), intent(in) :: input
    type(simulation_t), intent(in) :: sim
    integer :: k, range(2)

    call describe_format(file)
    call describe_box(file, sim)
    call describe_disks(file, sim)
    call describe_origin(file, input)
    call describe_input(file, input)
    call file%put(species_names, names_of(sim%species))
    call file%put(species_counts, [size(sim%species)], int(sim%species%count, int32))
    call describe_populations(file, sim)
    do k = 1, size(obstacle_groups)
      range = range_of(input%groups, obstacle_groups(k:k))
      call describe_table(file, input%groups(range(1):range(2)))
      call describe_rows(file, input%groups(range(1):range(2)))
    end do
    call file%put(parameters_group//"seed", scalar, [input%settings%run%seed])
    call describe_end(file, input%settings%run%threads, 0.0_real64, [0.0_real64, 0.0_real64], "")
  end subroutine describe_run

  !> Writes the format version, the author and the creator, as required by H5MD.
  subroutine describe_format(file)
    type(hdf5_file_t), intent(inout) :: file

    call file%make_group("h5md/author")
    call file%make_group("h5md/creator")
    call file%make_group("h5md/modules/thermodynamics")
    call file%put("h5md@version", [2], [1_int32, 1_int32])
    call file%put("h5md/author@name", author())
    call file%put("h5md/creator@name", "ricochet")
    call file%put("h5md/creator@version", program_version)
    call file%put("h5md/modules/thermodynamics@version", [2], [1_int32, 0_int32])
  end subroutine describe_format

  !> Writes the boundary conditions and edges of the box.
  subroutine describe_box(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: sim
    character(len=8) :: boundary(2)

    boundary = merge("periodic", "none    ", sim%box%periodic)
    call file%make_group(box_group)
    call file%put(box_group//"@dimension", scalar, [2_int32])
    call file%put(box_group//"@boundary", boundary)
    call file%put(box_group//"/edges", [2], sim%box%edges())
    call file%put(box_group//"/lower", [2], sim%box%lower)
  end subroutine describe_box

  !> Writes the constant properties of the disks, in the order of the input.
  subroutine describe_disks(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: sim
    integer(int32), allocatable :: numbers(:)
    real(real64), allocatable :: sizes(:)
    integer(int32) :: i

    allocate (numbers(sim%n_disks()), sizes(sim%n_disks()))
    numbers = [(i, i=1, sim%n_disks())]
    call file%put(disk_id, [size(numbers)], numbers)
    numbers(sim%tag%id) = sim%tag%species
    call file%put(disk_species, [size(numbers)], numbers)
    sizes(sim%tag%id) = sim%masses()
    call file%put(disk_mass, [size(sizes)], sizes)
    sizes(sim%tag%id) = sim%disk%radius
    call file%put(disk_radius, [size(sizes)], sizes)
  end subroutine describe_disks

  !> Writes the text of the input and the value of every variable used in the run.
  subroutine describe_input(file, input)
    type(hdf5_file_t), intent(inout) :: file
    type(run_input_t), intent(in) :: input
    character(len=:), allocatable :: group, changes
    integer :: g, k

    do g = 1, size(input%groups)
      associate (own => input%groups(g))
        if (any(obstacle_groups == own%name)) cycle     ! obstacles are written by `describe_table`
        group = parameters_group//trim(own%name)
        if (is_repeated(own%name)) group = group//"/"//trim(own%instance)
        call file%make_group(group)
        do k = 1, size(own%values)
          if (.not. changes_nothing(trim(own%name)//"."//own%values(k)%name)) call describe_value(file, group, own%values(k))
        end do
      end associate
    end do
    call file%put(parameters_group//"input", input%text)
    call file%put(parameters_group//"overrides", overrides_text(input))
    changes = ""
    if (allocated(input%changes)) then
      changes = input%changes
      call file%put(earlier_changes, changes)
    end if
    if (allocated(input%settings%schedule)) then
      do k = 1, size(input%settings%schedule)
        changes = changes//text_of_change(input%settings%schedule(k))
      end do
    end if
    if (changes /= "") call file%put(changes_at_work, changes)
  end subroutine describe_input

  !> Writes the dimension and the number of particles for each group of observables, as required by
  !> the thermodynamics module of H5MD.
  subroutine describe_populations(file, sim)
    type(hdf5_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: sim
    character(len=:), allocatable :: group
    integer(int32) :: n
    integer :: s

    do s = 0, size(sim%species)
      group = observables_group//all_disks
      n = sim%n_disks()
      if (s > 0) group = observables_group//sim%species(s)%name
      if (s > 0) n = sim%species(s)%count
      call file%make_group(group)
      call file%put(group//"@dimension", scalar, [2_int32])
      ! in an open system the number of disks is an observable
      if (.not. sim%features%open) call file%put(group//"/particle_number", scalar, [n])
    end do
  end subroutine describe_populations

  !> Writes the provenance: how the program was built, and on which computer the file was created.
  subroutine describe_origin(file, input)
    type(hdf5_file_t), intent(inout) :: file
    type(run_input_t), intent(in) :: input

    call file%make_group(provenance)
    call file%put(provenance//"@program_version", program_version)
    if (.not. input%saved_at < 0) call file%put(saved_at, scalar, [input%saved_at])
    call file%put(provenance//"@git_commit", git_commit)
    call file%put(provenance//"@compiler", compiler_version())
    call file%put(provenance//"@flags", build_flags)
    call file%put(provenance//"@hdf5_version", hdf5_version())
    call file%put(provenance//"@host", host_name())
  end subroutine describe_origin

  !> User name, from the environment variables.
  function author() result(name)
    character(len=:), allocatable :: name
    integer :: length

    call get_environment_variable("USER", length=length)
    allocate (character(len=length) :: name)
    call get_environment_variable("USER", name)
    if (name == "") name = "unknown"
  end function author

  !> True if a variable has no influence on the results of a run. The only such variable,
  !> `run.threads`, is not stored among the parameters in the output file.
  pure function changes_nothing(variable) result(yes)
    !> Name of a variable, or a text that starts with it.
    character(len=*), intent(in) :: variable
    logical :: yes

    yes = index(variable, "run.threads") == 1
  end function changes_nothing

  !> Overrides of the command line, with one variable per line.
  pure function overrides_text(input) result(text)
    type(run_input_t), intent(in) :: input
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: k

    do k = 1, size(input%overrides)
      if (.not. changes_nothing(input%overrides(k)%text)) call growing%add(input%overrides(k)%text//new_line("a"))
    end do
    text = growing%text()
  end function overrides_text

  !> True if a file describes the given input.
  function describes(file, input) result(yes)
    type(hdf5_file_t), intent(inout) :: file
    type(run_input_t), intent(in) :: input
    logical :: yes
    character(len=:), allocatable :: text, overrides

    call file%fetch_text(parameters_group//"input", text)
    call file%fetch_text(parameters_group//"overrides", overrides)
    yes = text == input%text .and. overrides == overrides_text(input)
  end function describes

  !> Writes the value of a variable that has a value.
  subroutine describe_value(file, group, value)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(value_t), intent(in) :: value
    integer, allocatable :: extents(:)
    character(len=:), allocatable :: name

    name = group//"@"//trim(value%name)
    extents = scalar
    if (.not. value%is_set()) return
    select case (value%kind)
    case ("real")
      if (size(value%reals) > longest_attribute) name = group//"/"//trim(value%name)
      if (size(value%reals) > 1) extents = [size(value%reals)]
      call file%put(name, extents, value%reals)
    case ("integer")
      if (size(value%texts) > 1) extents = [size(value%texts)]
      call file%put(name, extents, value%integers())
    case ("logical")
      call file%put(name, extents, [merge(1_int32, 0_int32, value%texts(1) == ".true.")])
    case default
      if (size(value%texts) > 1) then
        call file%put(name, value%texts)
      else
        call file%put(name, trim(value%texts(1)))
      end if
    end select
  end subroutine describe_value

  !> Writes all groups of one name as a table, with a dataset for each variable. A variable with two
  !> keywords becomes a dataset named after the second keyword. The dataset contains 1 for groups
  !> with this keyword and 0 for the others.
  subroutine describe_table(file, groups)
    type(hdf5_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    character(len=64) :: texts(size(groups))
    character(len=:), allocatable :: path, second
    real(real64), allocatable :: values(:)
    integer :: g, k, n

    if (size(groups) == 0) return
    n = size(groups)
    do k = 1, size(groups(1)%values)
      associate (row => table(groups(1)%values(k)%row))
        path = parameters_group//trim(row%group)//"/"
        second = trim(row%choices(index(trim(row%choices), " ", back=.true.) + 1:))
        ! `file` is left out, because `describe_rows` stores the obstacles read from the file.
        if (row%name == "file") cycle
        if (row%kind == "text") then
          do g = 1, n
            texts(g) = groups(g)%text_of(trim(row%name))
          end do
          if (second == "") call file%put(path//trim(row%name), texts)
          if (second /= "") call file%put(path//second, [n], merge(1_int32, 0_int32, texts == second))
        else
          if (.not. any([(groups(g)%values(k)%is_set(), g=1, n)])) cycle
          ! Lists of points are left out, because `describe_rows` stores the obstacles made from
          ! them.
          if (row%size == 0) cycle
          ! NaN in groups without a value
          values = spread(ieee_value(0.0_real64, ieee_quiet_nan), 1, row%size*n)
          do g = 1, n
            if (size(groups(g)%reals_of(trim(row%name))) /= row%size) cycle
            values(row%size*(g - 1) + 1:row%size*g) = groups(g)%values(k)%reals
          end do
          if (row%size == 1) call file%put(path//trim(row%name), [n], values)
          if (row%size > 1) call file%put(path//trim(row%name), [row%size, n], values)
        end if
      end associate
    end do
  end subroutine describe_table

  !> Writes a table of all obstacles in the groups of one name, in the order of their boundary ids.
  !> The table contains the geometry of each obstacle and the number of its group. A table of the
  !> groups would not be sufficient, because a file or a polyline describes several obstacles in one
  !> group.
  subroutine describe_rows(file, groups)
    type(hdf5_file_t), intent(inout) :: file
    type(group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: path
    integer(int32), allocatable :: group(:)
    real(real64), allocatable :: values(:)
    integer :: g, k, n(size(groups))                  ! n: number of obstacles in each group

    if (.not. any([(has_many(groups(g)), g=1, size(groups))])) return
    path = parameters_group//trim(groups(1)%name)//"_rows/"
    allocate (values(0))
    do k = 1, size(groups(1)%values)
      associate (row => table(groups(1)%values(k)%row))
        if (row%status /= "example") cycle            ! the others are stored by `describe_table`
        values = [(groups(g)%reals_of(trim(row%name)), g=1, size(groups))]
        n = [(size(groups(g)%reals_of(trim(row%name)))/row%size, g=1, size(groups))]
        if (row%size == 1) call file%put(path//trim(row%name), [size(values)], values)
        if (row%size > 1) call file%put(path//trim(row%name), [row%size, size(values)/row%size], values)
      end associate
    end do
    group = [(spread(int(g, int32), 1, n(g)), g=1, size(groups))]
    call file%put(path//"group", [size(group)], group)
  end subroutine describe_rows

  !> Writes the values that are known only at the end of the run. Values from earlier parts of the
  !> run are overwritten.
  subroutine describe_end(file, threads, wall_seconds, rate, note)
    type(hdf5_file_t), intent(inout) :: file
    integer, intent(in) :: threads                    !! number of threads in the last part of the run
    real(real64), intent(in) :: wall_seconds          !! total wall time of all parts of the run [s]
    !> Collisions per processor time [1/s], and number of events executed by the serial engine, in
    !> the last part of the run.
    real(real64), intent(in) :: rate(2)
    character(len=*), intent(in) :: note              !! reason why the run ended, if no stop rule was met
    character(len=longest_note) :: padded

    padded = note
    call file%put(provenance//"@threads", scalar, [int(threads, int64)])
    call file%put(wall_time, scalar, [wall_seconds])
    call file%put(provenance//"@collisions_per_second", scalar, rate(:1))
    call file%put(provenance//"@events_on_one_core", scalar, [int(rate(2), int64)])
    call file%put(provenance//"@note", padded)
  end subroutine describe_end

end module run_description
