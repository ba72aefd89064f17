!> The disks of a species as its file has them, whatever its kind: checked number by number, and joined with what the input
!> says.
module starting_disks
  use kinds, only: int64, real64
  use bounds, only: first_outside
  use box_geometry, only: box_t
  use disks, only: names_of
  use errors, only: error_t, exit_usage, fail
  use last_frame, only: datasets, is_run, read_last_frame
  use variables, only: largest, smallest
  use position_file, only: column_names, mass_row, radius_row, read_positions, spin_row
  use settings, only: species_settings_t
  use texts, only: counted, written
  implicit none
  private
  public :: origin, read_disks, resolution

  real(real64), parameter :: resolution = 1.0e-10_real64      !! of a radius at its coordinates, in double

contains

  !> Reads the disks of species s. Radii and masses are those of the input where it has them.
  subroutine read_disks(species, s, box, table, there, rows, error)
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    type(box_t), intent(in) :: box
    real(real64), allocatable, intent(out) :: table(:, :)     !! (column_names,n)
    logical, intent(out) :: there(:)                          !! (column_names) in the file
    integer, allocatable, intent(out) :: rows(:)              !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: of_species

    associate (me => species(s))
      if (.not. is_run(me%file) .and. me%scale_positions) then
        call fail(error, exit_usage, me%file//": is not the file of a run (.h5), which scale_positions needs: it says " &
          //"how large the box was")
      else if (.not. is_run(me%file)) then
        call read_positions(me%file, names_of(species), s, table, there, rows, error)
      else if (me%scale_positions) then
        call read_last_frame(me%file, me%name, table, there, rows, error, box)
      else
        call read_last_frame(me%file, me%name, table, there, rows, error)
      end if
      if (allocated(error)) return
      of_species = ""
      if (is_run(me%file)) of_species = " of species """//me%name//'"'
      if (me%count > 0 .and. size(rows) /= me%count) call fail(error, exit_usage, me%file//": " &
        //counted(size(rows, kind=int64), "disk")//of_species//", but species.count is "//written(me%count))
      if (.not. allocated(error)) call join(me, there, rows, table, error)
      if (.not. allocated(error)) call check_numbers(me, box, table, rows, error)
    end associate
  end subroutine read_disks

  !> Takes from the input what it has, and refuses what both have, or none; of a run the input may say otherwise.
  subroutine join(species, there, rows, table, error)
    type(species_settings_t), intent(in) :: species
    logical, intent(in) :: there(:)                           !! (column_names) in the file
    integer, intent(in) :: rows(:)                            !! (n) as in `origin`
    real(real64), intent(inout) :: table(:, :)                !! (column_names,n)
    type(error_t), allocatable, intent(inout) :: error
    logical :: in_file(radius_row:mass_row)
    integer :: row

    if (size(rows) == 0) return
    if (species%velocities == "file" .and. .not. there(3)) call fail(error, exit_usage, origin(species, rows, 1, 3) &
      //": there are no velocities; velocities = 'file' needs x y vx vy")
    in_file = [species%radius_in_file, species%mass_in_file]
    if (species%velocities == "file" .and. .not. species%spin_in_file) call refuse_both(spin_row, &
      trim(merge("angular_velocity      ", "rotational_temperature", species%rotational_temperature < 0)))
    do row = radius_row, mass_row
      if (.not. in_file(row)) call refuse_both(row, trim(column_names(row)))
      if (there(row) .and. in_file(row)) cycle
      if (in_file(row) .and. row == radius_row) call fail(error, exit_usage, species%file &
        //": has no radius; give species."//species%name//".radius, or a column radius in the file")
      table(row, :) = merge(species%radius, species%mass, row == radius_row)
    end do
    if (species%is_base .and. .not. species%radius_in_file .and. any(abs(table(mass_row, :) - species%mass) > 0)) &
      call fail(error, exit_usage, species%file//": has masses other than 1; as other species are relative to """ &
      //species%name//""", give its mass")
  contains
    !> Refuses a column of a text whose numbers the input has as well.
    subroutine refuse_both(row, variable)
      integer, intent(in) :: row
      character(len=*), intent(in) :: variable

      if (there(row) .and. .not. is_run(species%file)) call fail(error, exit_usage, species%file//": has a column " &
        //trim(column_names(row))//", but species."//species%name//"."//variable//" is given, too; give only one of them")
    end subroutine refuse_both
  end subroutine join

  !> Refuses numbers that the input could not have either.
  subroutine check_numbers(species, box, table, rows, error)
    type(species_settings_t), intent(in) :: species
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: table(:, :)                   !! (column_names,n)
    integer, intent(in) :: rows(:)                            !! as in `origin`
    type(error_t), allocatable, intent(inout) :: error
    real(real64) :: farthest                                  !! coordinate [length]
    integer :: k, row

    farthest = maxval(abs([box%lower, box%upper]))
    do k = 1, size(table, 2)
      row = first_outside(table(:radius_row - 1, k), [-largest, largest])
      if (row > 0) call object("is out of range (sizes up to 1e100)")
      row = first_outside(table(radius_row:, k), [smallest, largest])
      if (row > 0) row = row + radius_row - 1
      if (row > 0) call object("is not a "//trim(column_names(max(row, 1)))//"; allowed: a number > 0")
      if (.not. allocated(error)) then
        row = radius_row
        if (table(row, k) < resolution*farthest) call object("is too small a radius to be resolved at coordinates of " &
          //written(farthest))
      end if
      if (allocated(error)) return
    end do
  contains

    !> Reports a number.
    subroutine object(what)
      character(len=*), intent(in) :: what

      if (.not. allocated(error)) call fail(error, exit_usage, origin(species, rows, k, row)//": "//written(table(row, k)) &
        //" "//what)
    end subroutine object
  end subroutine check_numbers

  !> Where the values of a disk come from, for messages: a line of a text file, a row of a dataset, or a rule.
  pure function origin(species, rows, k, column) result(text)
    type(species_settings_t), intent(in) :: species
    integer, intent(in) :: rows(:)                            !! of the disks in the file; none: there is no file
    integer, intent(in) :: k                                  !! number of the disk in its species
    integer, intent(in) :: column                             !! of `column_names`
    character(len=:), allocatable :: text

    if (size(rows) == 0) then
      text = "species."//species%name//".placement"
    else if (is_run(species%file)) then
      text = species%file//": "//trim(datasets(column))//": row "//written(rows(k))
      if (column < radius_row) text = text//" of the last frame"
      if (column < 3 .and. species%scale_positions) text = text//", stretched to this box"
    else
      text = species%file//":"//written(rows(k))
    end if
  end function origin

end module starting_disks
