!> The table of all input variables. The table is used for reading and checking the input, for
!> `--print-defaults` and `--explain`, for the group `/parameters` of the output file, and for
!> generating the reference page of the documentation.
module variables
  use boundary_variables, only: boundary_rows
  use disk_variables, only: disk_rows
  use drives, only: drive_rows
  use run_variables, only: change_rows, output_rows, run_rows, stop_rows
  use source_variables, only: source_rows
  use texts, only: joined, written
  use variable_rows, only: at_no_time, in_motion, largest, most_disks, most_threads, name_length, obstacle_groups, on_resume, &
    smallest, variable_t, wall_groups
  implicit none
  private
  public :: variable_t, table, group_names, obstacle_groups, wall_groups, is_repeated, variables_of, row_of
  public :: change_of, excluded_by, first_sentence, full_names, in_motion, on_resume
  public :: track_of, words_of, excludes, allowed, either, smallest, largest, most_disks, most_threads, name_length

  character(len=8), parameter :: group_names(12) = [character(len=8) :: &
    "run", "box", "side", "obstacle", "wall", "species", "contact", "drive", "source", "change", "stop", "output"]

  type(variable_t), parameter :: rows(*) = [run_rows, boundary_rows, disk_rows, drive_rows, source_rows, change_rows, stop_rows, &
    output_rows]
  !> No constant, because the compiler would compute expressions that contain it, which takes
  !> seconds.
  type(variable_t), protected :: table(size(rows)) = rows

contains

  !> When a variable may be changed after the start of a run: `never`, `on_resume` or `in_motion`.
  !> The name may include the name of a side or species, as in `side.left.velocity`.
  pure function change_of(name) result(when)
    character(len=*), intent(in) :: name
    character(len=len(at_no_time)) :: when
    integer :: k

    when = at_no_time
    do k = 1, size(table)
      if (table(k)%group == name(:index(name, ".") - 1) .and. table(k)%name == name(index(name, ".", back=.true.) + 1:)) &
        when = table(k)%may_change
    end do
  end function change_of

  !> True if a group may occur several times in an input file. Groups of the same name are then
  !> distinguished by their variable `name`.
  elemental function is_repeated(group)
    character(len=*), intent(in) :: group
    logical :: is_repeated

    is_repeated = any(wall_groups == group) .or. group == "species" .or. group == "source" .or. group == "change"
  end function is_repeated

  !> Names of the variables in a group, in the order of the table.
  pure function variables_of(group) result(names)
    character(len=*), intent(in) :: group
    character(len=name_length), allocatable :: names(:)

    names = pack(table%name, table%group == group)
  end function variables_of

  !> Index of a variable in its group; 0 if the group does not contain the variable.
  pure function row_of(group, name) result(row)
    character(len=*), intent(in) :: group, name
    integer :: row
    integer :: k

    row = 0
    do k = 1, size(table)
      if (table(k)%group /= group) cycle
      row = row + 1
      if (table(k)%name == name) return
    end do
    row = 0
  end function row_of

  !> Full names of all variables with a given name, such as `obstacle.radius or species.radius`;
  !> empty if there are none.
  pure function full_names(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, size(table)
      if (table(k)%name /= name) cycle
      if (text /= "") text = text//" or "
      text = text//trim(table(k)%group)//"."//name
    end do
  end function full_names

  !> True if two variables of a group must not both be set. Two sampling intervals for the same kind
  !> of samples exclude each other, too.
  pure function excludes(one, other) result(yes)
    integer, intent(in) :: one, other        !! rows
    logical :: yes

    yes = table(one)%excludes /= ""
    if (yes) yes = any(words_of(table(one)%excludes) == table(other)%name)
    if (other < one .and. track_of(table(one)%name) /= "") yes = track_of(table(one)%name) == track_of(table(other)%name)
  end function excludes

  !> Variables of the same group that must not be set together with a variable.
  pure function excluded_by(row) result(names)
    integer, intent(in) :: row
    character(len=name_length), allocatable :: names(:)
    integer :: k

    names = pack(table%name, [(table(k)%group == table(row)%group .and. (excludes(row, k) .or. excludes(k, row)), &
      k=1, size(table))])
  end function excluded_by

  !> First sentence of a help text.
  pure function first_sentence(help) result(sentence)
    character(len=*), intent(in) :: help
    character(len=:), allocatable :: sentence

    sentence = help(:index(trim(help)//" ", ". "))
  end function first_sentence

  !> Kind of samples whose interval a variable sets, such as `frames` for frames_every_time; empty
  !> for other variables.
  pure function track_of(name) result(track)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: track

    track = name(:max(index(name, "_every_") - 1, 0))
  end function track_of

  !> Splits a line into words.
  pure function words_of(line) result(words)
    character(len=*), intent(in) :: line
    character(len=len(line)), allocatable :: words(:)
    integer :: first, k, n

    n = 0
    do k = 1, len_trim(line)
      if (line(k:k) /= " " .and. line(k + 1:min(k + 1, len(line))) == " ") n = n + 1
    end do
    allocate (words(n))
    first = 1
    do k = 1, n
      first = first + verify(line(first:), " ") - 1
      words(k) = line(first:first + index(line(first:)//" ", " ") - 2)
      first = first + len_trim(words(k))
    end do
  end function words_of

  !> Description of the allowed values, such as `a number > 0` or `'wall' or 'periodic'`.
  pure function allowed(row) result(words)
    type(variable_t), intent(in) :: row
    character(len=:), allocatable :: words

    select case (row%kind)
    case ("logical")
      words = ".true. or .false."
    case ("integer")
      words = trim(merge("an integer", "integers  ", row%size == 1))
    case ("real")
      words = trim(merge("a number", "numbers ", row%size == 1))
    case default
      words = "text in quotes"
      if (row%choices /= "") words = either(words_of(row%choices))
    end select
    if (row%range%words /= "") words = words//" "//trim(row%range%words)
    if (row%size /= 1 .and. row%kind == "text") words = "values, each "//words
    if (row%size > 1) words = written(row%size)//" "//words
  end function allowed

  !> Joins words to a list of alternatives such as `'a', 'b' or 'c'`.
  pure function either(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text

    text = "'"//joined(words(:size(words) - 1), "', '")
    if (size(words) > 1) text = text//"' or '"
    text = text//trim(words(size(words)))//"'"
  end function either

end module variables
