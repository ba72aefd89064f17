!> Reads the disks of one species from an initial-configuration file in any of the supported
!> formats. All numbers in the file are checked. Quantities missing from the file are taken from the
!> input.
module starting_disks
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use kinds, only: int64, real64
  use box_geometry, only: box_t
  use disks, only: names_of
  use errors, only: exit_usage, fail
  use h5md_layout, only: angular_velocity, disk_mass, disk_radius, orientation, position, value_of, velocity
  use position_file, only: column_names, mass_row, radius_row, read_positions, spin_row
  use settings, only: disks_in_file_t, species_settings_t
  use texts, only: counted, written
  use variables, only: largest, smallest
  implicit none
  private
  public :: origin, read_disks, resolution

  !> Minimum ratio of a radius to the largest coordinate.
  real(real64), parameter :: resolution = 1.0e-10_real64
  !> Datasets in the output of a run, in the order of `position_file: column_names`. Radius and mass
  !> are constant; all other quantities are read from the frames.
  character(len=48), parameter :: datasets(*) = [character(len=48) :: position//value_of, position//value_of, &
    velocity//value_of, velocity//value_of, angular_velocity//value_of, orientation//value_of, disk_radius, disk_mass]

  interface
    !> Reads the disks of one species from the last frame of a run. There are two implementations,
    !> of which the linker selects one: `last_frame` reads the file; `last_frame_without_hdf5`
    !> reports that HDF5 files cannot be read.
    module subroutine read_last_frame(path, name, disks, box)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: name                    !! name of the species
      type(disks_in_file_t), intent(inout) :: disks
      !> Box to which the positions are scaled; default: positions are not scaled.
      type(box_t), intent(in), optional :: box
    end subroutine read_last_frame
  end interface

contains

  !> True if the path belongs to a finished or unfinished output of a run.
  pure function is_run(path) result(yes)
    character(len=*), intent(in) :: path
    logical :: yes

    yes = index(path//"|", ".h5|") > 0 .or. index(path//"|", ".h5.part|") > 0
  end function is_run

  !> Reads the disks of species s. Radii and masses in the input take precedence over those in the
  !> file.
  subroutine read_disks(species, s, box)
    type(species_settings_t), intent(inout) :: species(:)
    integer, intent(in) :: s
    type(box_t), intent(in) :: box
    type(box_t), allocatable :: new_box                       ! box to which the positions are scaled
    character(len=:), allocatable :: of_species

    associate (me => species(s))
      if (me%scale_positions) new_box = box
      if (is_run(me%file)) then
        call read_last_frame(me%file, me%name, me%in_file, new_box)
      else if (me%scale_positions) then
        call refuse(me, me%file//": is not the output of a run (.h5); scale_positions needs one, " &
          //"because it contains the size of its box")
      else
        call read_positions(me%file, names_of(species), s, me%in_file)
      end if
      if (allocated(me%in_file%error)) return
      associate (n => size(me%in_file%rows, kind=int64))
        of_species = ""
        if (is_run(me%file)) of_species = " of species """//me%name//'"'
        if (me%count > 0 .and. n /= me%count - me%waiting) call refuse(me, me%file//": "//counted(n, "disk")//of_species &
          //", but species.count is "//me%count_text())
        if (n > 0) call join(me)
        if (n > 0) call check_numbers(me, maxval(abs([box%lower, box%upper])))
      end associate
    end associate
  end subroutine read_disks

  !> Records why the disks in the file cannot be used; only the first reason is kept.
  subroutine refuse(me, why)
    type(species_settings_t), intent(inout) :: me
    character(len=*), intent(in) :: why

    if (.not. allocated(me%in_file%error)) call fail(me%in_file%error, exit_usage, why)
  end subroutine refuse

  !> Completes the table of disks with values from the input. Quantities missing from both the file
  !> and the input are reported. Quantities given in both are reported if the file is a text file.
  !> If the file is the output of a run, the value in the input takes precedence.
  subroutine join(me)
    type(species_settings_t), intent(inout) :: me
    logical :: wanted(radius_row:mass_row)
    real(real64) :: own(radius_row:mass_row)
    integer :: row

    wanted = [me%radius_in_file, me%mass_in_file]
    own = [me%radius, me%mass]
    if (me%velocities == "file" .and. .not. me%in_file%there(3)) call refuse(me, origin(me, 1, 3) &
      //": there are no velocities; velocities = 'file' needs x y vx vy")
    if (me%velocities == "file" .and. .not. me%spin_in_file) call refuse_both(spin_row, &
      trim(merge("angular_velocity      ", "rotational_temperature", me%rotational_temperature < 0)))
    do row = radius_row, mass_row
      if (.not. wanted(row)) call refuse_both(row, trim(column_names(row)))
      if (wanted(row) .and. me%in_file%there(row)) cycle
      if (wanted(row) .and. row == radius_row) call refuse(me, me%file//": has no radius; give species."//me%name &
        //".radius, or a column radius in the file")
      me%in_file%table(row, :) = own(row)
    end do
    if (me%is_base .and. .not. me%radius_in_file .and. any(abs(me%in_file%table(mass_row, :) - me%mass) > 0)) &
      call refuse(me, me%file//": has masses other than 1; as other species are relative to """//me%name//""", give its mass")

  contains

    !> Reports a quantity that is given twice, in a column of a text file and in the input.
    subroutine refuse_both(row, variable)
      integer, intent(in) :: row
      character(len=*), intent(in) :: variable

      if (me%in_file%there(row) .and. .not. is_run(me%file)) call refuse(me, me%file//": has a column " &
        //trim(column_names(row))//", but species."//me%name//"."//variable//" is given, too; give only one of them")
    end subroutine refuse_both
  end subroutine join

  !> Reports each number in the file that is outside the range allowed in the input.
  subroutine check_numbers(me, farthest)
    type(species_settings_t), intent(inout) :: me
    real(real64), intent(in) :: farthest                      !! largest coordinate in the box [length]
    logical :: wrong
    integer :: k, row

    do k = 1, size(me%in_file%rows)
      do row = 1, mass_row
        associate (number => me%in_file%table(row, k))
          wrong = .not. ieee_is_finite(number)                ! debug builds stop when NaN is compared
          if (.not. wrong) wrong = number > largest .or. number < merge(smallest, -largest, row >= radius_row)
          if (.not. wrong) cycle
        end associate
        if (row < radius_row) call object("is out of range (sizes up to 1e100)")
        if (row >= radius_row) call object("is not a "//trim(column_names(row))//"; allowed: a number > 0")
        return
      end do
      row = radius_row
      if (.not. me%in_file%table(row, k) < resolution*farthest) cycle
      call object("is too small a radius to be resolved at coordinates of "//written(farthest))
      return
    end do

  contains

    !> Reports an invalid number in the file.
    subroutine object(what)
      character(len=*), intent(in) :: what

      call refuse(me, origin(me, k, row)//": "//written(me%in_file%table(row, k))//" "//what)
    end subroutine object
  end subroutine check_numbers

  !> Location of a disk in its file, for messages: a line of a text file or a row of a dataset.
  pure function origin(me, k, column) result(text)
    type(species_settings_t), intent(in) :: me
    integer, intent(in) :: k                                  !! index of the disk in its species
    integer, intent(in) :: column                             !! index in `column_names`
    character(len=:), allocatable :: text

    if (is_run(me%file)) then
      text = me%file//": "//trim(datasets(column))//": row "//written(me%in_file%rows(k))
      if (column < radius_row) text = text//" of the last frame"
      if (column < 3 .and. me%scale_positions) text = text//", stretched to this box"
    else
      text = me%file//":"//written(me%in_file%rows(k))
    end if
  end function origin

end module starting_disks
