!> The one table of input variables. It drives reading, checking, `--print-defaults`, `--explain`,
!> `/parameters` in the output file and the reference page.
module parameters
  use kinds, only: real64
  use errors, only: error_t, exit_usage, fail
  use texts, only: lower_case, nearest_word, shown, suggestion, written
  implicit none
  private
  public :: parameter_t, table, group_names, is_repeated, variables_of, row_of
  public :: allowed, defaults_text, explain, smallest, largest, name_length

  integer, parameter :: name_length = 28
  real(real64), parameter :: smallest = 1.0e-100_real64    !! sizes beyond these would overflow when
  real(real64), parameter :: largest = 1.0e100_real64      !! squared or multiplied

  integer, parameter :: comment_column = 40                !! of the reference file

  type :: range_t
    real(real64) :: lower, upper             !! both belong to the range
    character(len=24) :: words
  end type range_t

  type :: parameter_t
    character(len=8) :: group
    character(len=name_length) :: name
    character(len=8) :: kind                 !! 'integer', 'real', 'logical' or 'text'
    integer :: size                          !! number of values; 0: any number
    character(len=8) :: status               !! see below
    character(len=24) :: value               !! as one writes it in a file
    type(range_t) :: range                   !! of numbers
    character(len=16) :: unit
    character(len=48) :: choices             !! of texts, separated by blanks; none: free text
    character(len=80) :: help
  end type parameter_t

  ! status     value                           line in the reference file
  ! default    the default                     as it is
  ! fallback   the default where one applies   as a comment
  ! example    an example, no default          as it is, for something must be given
  ! optional   an example, no default          as a comment

  character(len=8), parameter :: group_names(7) = [character(len=8) :: &
    "run", "box", "obstacle", "species", "contact", "stop", "output"]

  type(range_t), parameter :: anything = range_t(-largest, largest, "")
  type(range_t), parameter :: positive = range_t(smallest, largest, "> 0")
  type(range_t), parameter :: not_negative = range_t(0, largest, ">= 0")
  type(range_t), parameter :: unit_interval = range_t(0, 1, "from 0 to 1")
  type(range_t), parameter :: fraction = range_t(smallest, nearest(1.0_real64, -1.0), "> 0 and < 1")
  type(range_t), parameter :: energy_left = range_t(1.0e-12_real64, fraction%upper, ">= 1e-12 and < 1")
  type(range_t), parameter :: few = range_t(1, 100000000, "from 1 to 100000000")

  type(parameter_t), parameter :: run_rows(*) = [ &
    parameter_t("run", "title", "text", 1, "default", "''", anything, "", "", &
      "one line that says what the run is"), &
    parameter_t("run", "seed", "integer", 1, "default", "1", not_negative, "", "", &
      "seed of the random numbers: the same seed gives the same run"), &
    parameter_t("run", "dynamics", "text", 1, "default", "'events'", anything, "", "events steps", &
      "exact flight from collision to collision, or fixed time steps"), &
    parameter_t("run", "dt", "real", 1, "optional", "0.001", positive, "time", "", &
      "the time step; needed by dynamics = 'steps'"), &
    parameter_t("run", "search", "text", 1, "default", "'cells'", anything, "", &
      "cells pairs rescan", "cost per collision O(1), O(N) or O(N**2); same trajectory"), &
    parameter_t("run", "queue", "text", 1, "default", "'calendar'", anything, "", "calendar heap", &
      "event queue: same trajectory")]

  type(parameter_t), parameter :: box_rows(*) = [ &
    parameter_t("box", "lower", "real", 2, "default", "0, 0", anything, "length", "", &
      "lower left corner"), &
    parameter_t("box", "upper", "real", 2, "default", "1, 1", anything, "length", "", &
      "upper right corner"), &
    parameter_t("box", "boundary", "text", 2, "default", "'wall', 'wall'", anything, "", &
      "wall periodic", "the two sides along x, the two sides along y"), &
    parameter_t("box", "gravity", "real", 2, "default", "0, 0", anything, "length/time**2", "", &
      "uniform acceleration of all disks")]

  type(parameter_t), parameter :: obstacle_rows(*) = [ &
    parameter_t("obstacle", "name", "text", 1, "optional", "'scatterer'", anything, "", "", &
      "name; default obstacle1, obstacle2, ..."), &
    parameter_t("obstacle", "centre", "real", 2, "example", "0.5, 0.5", anything, "length", "", &
      "centre of the circular wall"), &
    parameter_t("obstacle", "radius", "real", 1, "example", "0.2", positive, "length", "", &
      "radius of the circular wall"), &
    parameter_t("obstacle", "side", "text", 1, "default", "'outside'", anything, "", &
      "outside inside", "disks bounce off the outside, or are kept inside")]

  type(parameter_t), parameter :: species_rows(*) = [ &
    parameter_t("species", "name", "text", 1, "optional", "'gas'", anything, "", "", &
      "name; default species1, species2, ..."), &
    parameter_t("species", "count", "integer", 1, "example", "100", few, "", "", &
      "number of disks; may be left out with grid or position"), &
    parameter_t("species", "mass", "real", 1, "default", "1", positive, "mass", "", &
      "mass of a disk"), &
    parameter_t("species", "radius", "real", 1, "example", "0.01", positive, "length", "", &
      "radius of a disk; give it or packing_fraction"), &
    parameter_t("species", "packing_fraction", "real", 1, "optional", "0.3", fraction, "", "", &
      "area of the species over the area of its region; fixes the radius"), &
    parameter_t("species", "relative_to", "text", 1, "optional", "'bed'", anything, "", "", &
      "another species: mass and radius are multiples of its (radius then 1)"), &
    parameter_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", anything, "length", &
      "", "xlo, xhi, ylo, yhi of the part it starts in; default the box"), &
    parameter_t("species", "placement", "text", 1, "default", "'random'", anything, "", &
      "random grid lattice dense explicit file", &
      "where disks start; follows from grid, position or file if one is given"), &
    parameter_t("species", "grid", "integer", 2, "optional", "10, 10", few, "", "", &
      "columns and rows of placement = 'grid'"), &
    parameter_t("species", "file", "text", 1, "optional", "'runs/gas.h5'", anything, "", "", &
      "text with lines x y [vx vy], or a run whose last frame is taken"), &
    parameter_t("species", "position", "real", 0, "optional", "0.2, 0.5, 0.8, 0.5", anything, &
      "length", "", "x1, y1, x2, y2, ... of placement = 'explicit'"), &
    parameter_t("species", "velocities", "text", 1, "default", "'rest'", anything, "", &
      "rest equal_speed uniform maxwell explicit file", &
      "how disks start; follows from velocity, speed, temperature or file"), &
    parameter_t("species", "speed", "real", 1, "fallback", "1", not_negative, "length/time", "", &
      "of 'equal_speed'; of 'uniform' the largest |vx| and |vy|"), &
    parameter_t("species", "temperature", "real", 1, "fallback", "1", not_negative, "energy", "", &
      "kT of 'maxwell'"), &
    parameter_t("species", "velocity", "real", 0, "optional", "1, 0", anything, "length/time", "", &
      "vx1, vy1, vx2, vy2, ... of 'explicit'; one pair holds for all disks")]

  type(parameter_t), parameter :: contact_rows(*) = [ &
    parameter_t("contact", "restitution", "real", 1, "default", "1", unit_interval, "", "", &
      "of two disks: 1 elastic, 0 no rebound"), &
    parameter_t("contact", "wall_restitution", "real", 1, "optional", "1", unit_interval, "", "", &
      "of a disk and a wall; default as restitution"), &
    parameter_t("contact", "wall_rule", "text", 1, "default", "'velocity'", anything, "", &
      "velocity normal", "walls reduce the whole velocity, or its normal part only"), &
    parameter_t("contact", "contact_time", "real", 1, "default", "0", not_negative, "time", "", &
      "TC model: elastic if a partner collided less than this ago; 0 off"), &
    parameter_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      unit_interval, "", "", "for species 1-1, 1-2, ..., 2-1, 2-2, ...; instead of restitution")]

  type(parameter_t), parameter :: stop_rows(*) = [ &
    parameter_t("stop", "time", "real", 1, "example", "1", not_negative, "time", "", &
      "end at this time; the first rule that is met ends the run"), &
    parameter_t("stop", "collisions", "integer", 1, "optional", "100000", not_negative, "", "", &
      "end after so many collisions of two disks"), &
    parameter_t("stop", "collisions_per_disk", "real", 1, "optional", "20", not_negative, "", "", &
      "end when 2 collisions/N reaches this"), &
    parameter_t("stop", "events", "integer", 1, "optional", "100000", not_negative, "", "", &
      "end after so many collisions of any kind: pair, side, obstacle"), &
    parameter_t("stop", "energy_fraction", "real", 1, "optional", "0.1", energy_left, "", "", &
      "end when collisions have left this part of the kinetic energy"), &
    parameter_t("stop", "wall_clock", "real", 1, "optional", "3600", positive, "s", "", &
      "stop with a checkpoint after so much computing time")]

  type(parameter_t), parameter :: output_rows(*) = [ &
    parameter_t("output", "frames_every_time", "real", 1, "optional", "0.1", positive, "time", "", &
      "positions and velocities; default the first and the last"), &
    parameter_t("output", "frames_every_collisions", "integer", 1, "optional", "1000", positive, &
      "", "", "the same, by collisions of two disks"), &
    parameter_t("output", "frames_every_events", "integer", 1, "optional", "1000", positive, &
      "", "", "the same, by collisions of any kind"), &
    parameter_t("output", "observables_every_time", "real", 1, "optional", "0.01", positive, &
      "time", "", "energies, pressure, ...; default the first and the last"), &
    parameter_t("output", "observables_every_collisions", "integer", 1, "optional", "100", &
      positive, "", "", "the same, by collisions of two disks"), &
    parameter_t("output", "observables_every_events", "integer", 1, "optional", "100", &
      positive, "", "", "the same, by collisions of any kind"), &
    parameter_t("output", "precision", "text", 1, "default", "'double'", anything, "", &
      "double single", "of the frames; checkpoints are always double"), &
    parameter_t("output", "event_log", "logical", 1, "default", ".false.", anything, "", "", &
      "write every collision to /events"), &
    parameter_t("output", "checkpoint_every", "real", 1, "optional", "600", positive, "s", "", &
      "computing time between checkpoints")]

  type(parameter_t), parameter :: table(*) = [run_rows, box_rows, obstacle_rows, species_rows, &
    contact_rows, stop_rows, output_rows]

contains

  !> A group that may stand in the file several times, told apart by its `name`.
  pure function is_repeated(group)
    character(len=*), intent(in) :: group
    logical :: is_repeated

    is_repeated = group == "obstacle" .or. group == "species"
  end function is_repeated

  !> Names of the variables of a group, in order.
  pure function variables_of(group) result(names)
    character(len=*), intent(in) :: group
    character(len=name_length), allocatable :: names(:)

    names = pack(table%name, table%group == group)
  end function variables_of

  !> Row of a variable within its group, as `variables_of` counts them; 0 if there is none.
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

  !> What may be written: `a number > 0`, `'wall' or 'periodic'`.
  pure function allowed(row) result(words)
    type(parameter_t), intent(in) :: row
    character(len=:), allocatable :: words
    integer :: blank

    select case (row%kind)
    case ("logical")
      words = ".true. or .false."
    case ("integer")
      words = merge("an integer", "integers  ", row%size == 1)
    case ("real")
      words = merge("a number", "numbers ", row%size == 1)
    case default
      words = "text in quotes"
      if (row%choices /= "") words = "'"//trim(row%choices)//"'"
      do
        blank = index(trim(words), " ", back=.true.)
        if (row%choices == "" .or. blank == 0) exit
        words = words(:blank - 1)//"'|'"//words(blank + 1:)
      end do
      call spell_out(words)
    end select
    words = trim(words)
    if (row%range%words /= "") words = words//" "//trim(row%range%words)
    if (row%size > 1 .and. row%kind == "text") words = "times "//words
    if (row%size > 1) words = written(row%size)//" "//words
  end function allowed

  !> `a|b|c` becomes `a, b or c`.
  pure subroutine spell_out(words)
    character(len=:), allocatable, intent(inout) :: words
    integer :: bar

    bar = index(words, "|", back=.true.)
    if (bar == 0) return
    words = words(:bar - 1)//" or "//words(bar + 1:)
    do
      bar = index(words, "|")
      if (bar == 0) exit
      words = words(:bar - 1)//", "//words(bar + 1:)
    end do
  end subroutine spell_out

  !> The reference input file: every variable with its default. It is a valid input itself.
  pure function defaults_text() result(text)
    character(len=:), allocatable :: text
    character(len=1), parameter :: eol = new_line("a")
    integer :: g, k

    text = "! Every variable of Ricochet with its default. A file needs only what differs."//eol// &
      "! Lines that begin with ""!"" or say so are examples: there is no default, or not always."//eol// &
      "! Groups may stand in any order; &obstacle and &species as often as there are."//eol
    do g = 1, size(group_names)
      text = text//eol//margin(group_names(g))//"&"//trim(group_names(g))//eol
      do k = 1, size(table)
        if (table(k)%group == group_names(g)) text = text//reference_line(table(k))//eol
      end do
      text = text//margin(group_names(g))//"/"//eol
    end do
  end function defaults_text

  !> The reference file has no obstacle: that group is a comment as a whole.
  pure function margin(group)
    character(len=*), intent(in) :: group
    character(len=:), allocatable :: margin

    margin = ""
    if (group == "obstacle") margin = "! "
  end function margin

  pure function reference_line(row) result(line)
    type(parameter_t), intent(in) :: row
    character(len=:), allocatable :: line
    character(len=comment_column) :: setting

    select case (row%status)
    case ("default", "example")
      setting = "  "//trim(row%name)//" = "//trim(row%value)
    case default
      setting = "  ! "//trim(row%name)//" = "//trim(row%value)
    end select
    if (row%group == "obstacle") setting = "!   "//setting(verify(setting, " !"):)
    line = setting//" ! "
    if (row%status == "example") line = line//"an example: "
    line = line//trim(row%help)
    if (row%unit /= "") line = line//" ["//trim(row%unit)//"]"
    if (row%choices == "") return
    setting = ""
    if (row%group == "obstacle") setting = "!"
    line = line//new_line("a")//setting//" ! "//allowed(row)
  end function reference_line

  !> Answers `--explain`: a variable with or without its group, or a whole group.
  pure subroutine explain(name, text, error)
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=len(name)) :: wanted
    character(len=40) :: full(size(table))
    character(len=:), allocatable :: meant
    integer :: k

    wanted = lower_case(name)
    text = ""
    do k = 1, size(table)
      full(k) = trim(table(k)%group)//"."//table(k)%name
      if (all([character(len=40) :: table(k)%name, table(k)%group, full(k)] /= wanted)) cycle
      if (text /= "") text = text//new_line("a")
      text = text//explanation(table(k))
    end do
    if (text /= "") return
    meant = nearest_word(wanted, [character(len=40) :: table%name, full, group_names])
    if (meant /= "") then
      meant = "did you mean """//meant//"""?"
    else
      meant = suggestion(wanted, group_names)
    end if
    call fail(error, exit_usage, "--explain "//shown(name)//": unknown variable; "//meant)
  end subroutine explain

  pure function explanation(row) result(text)
    type(parameter_t), intent(in) :: row
    character(len=:), allocatable :: text
    character(len=*), parameter :: indent = new_line("a")//"    "

    text = trim(row%group)//"."//trim(row%name)
    if (row%unit /= "") text = text//"  ["//trim(row%unit)//"]"
    text = text//indent//trim(row%help)//indent//"allowed: "//allowed(row)//indent
    if (row%status == "default" .or. row%status == "fallback") then
      text = text//"default: "//trim(row%value)
    else
      text = text//"example: "//trim(row%value)
    end if
  end function explanation

end module parameters
