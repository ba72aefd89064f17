!> The one table of input variables. It drives reading, checking, `--print-defaults`, `--explain`,
!> `/parameters` in the output file and the reference page.
module parameters
  use kinds, only: real64
  use collisions, only: wall_rules
  use errors, only: error_t, exit_usage, fail
  use texts, only: joined, lower_case, nearest_word, shown, suggestion, written
  implicit none
  private
  public :: parameter_t, table, group_names, obstacle_groups, is_repeated, variables_of, row_of, full_names, words_of
  public :: allowed, either, defaults_text, explain, smallest, largest, most_threads, name_length

  integer, parameter :: name_length = 28
  integer, parameter :: most_threads = 1024
  real(real64), parameter :: smallest = 1.0e-100_real64    !! numbers beyond these would overflow when
  real(real64), parameter :: largest = 1.0e100_real64      !! squared or multiplied

  integer, parameter :: comment_column = 40                !! of the reference file

  type :: range_t
    real(real64) :: lower, upper             !! both belong to the range
    character(len=24) :: words
  end type range_t

  !> The groups of which each describes an obstacle, of one shape or another.
  character(len=8), parameter :: obstacle_groups(2) = [character(len=8) :: "obstacle", "wall"]

  type(range_t), parameter :: anything = range_t(-largest, largest, "")
  type(range_t), parameter :: positive = range_t(smallest, largest, "> 0")
  type(range_t), parameter :: not_negative = range_t(0, largest, ">= 0")
  type(range_t), parameter :: number_of_threads = range_t(0, most_threads, "from 0 to 1024")
  type(range_t), parameter :: unit_interval = range_t(0, 1, "from 0 to 1")
  type(range_t), parameter :: fraction = range_t(smallest, nearest(1.0_real64, -1.0), "> 0 and < 1")
  type(range_t), parameter :: energy_left = range_t(1.0e-12_real64, fraction%upper, ">= 1e-12 and < 1")
  type(range_t), parameter :: count_of_disks = range_t(1, 100000000, "from 1 to 100000000")

  type :: parameter_t
    character(len=8) :: group
    character(len=name_length) :: name
    character(len=8) :: kind                 !! "integer", "real", "logical" or "text"
    integer :: size                          !! number of values; 0: any number
    character(len=8) :: status               !! see below
    character(len=24) :: value               !! as written in a file
    character(len=80) :: help
    type(range_t) :: range = anything        !! of numbers
    character(len=16) :: unit = ""
    character(len=100) :: choices = ""        !! of texts, separated by blanks; none: free text
    character(len=60) :: goes_with = ""      !! a choice, then its words with which this variable has an effect
  end type parameter_t

  ! status     value                           line in the reference file
  ! default    the default                     as it is
  ! fallback   the default where one applies   as a comment
  ! example    an example, no default          as it is, because something must be given
  ! optional   an example, no default          as a comment; its choice needs it, if it goes with one

  character(len=8), parameter :: group_names(8) = [character(len=8) :: &
    "run", "box", "obstacle", "wall", "species", "contact", "stop", "output"]

  type(parameter_t), parameter :: run_rows(*) = [ &
    parameter_t("run", "title", "text", 1, "default", "''", "one line that describes the run"), &
    parameter_t("run", "seed", "integer", 1, "default", "1", &
      "seed of the random numbers: the same seed gives the same run", not_negative), &
    parameter_t("run", "dynamics", "text", 1, "default", "'events'", &
      "exact flight from collision to collision, or fixed time steps", choices="events steps"), &
    parameter_t("run", "dt", "real", 1, "optional", "0.001", &
      "time step; needed with dynamics = 'steps'", positive, "time"), &
    parameter_t("run", "search", "text", 1, "default", "'cells'", &
      "cost per collision O(1), O(N) or O(N**2); same trajectory", choices="cells pairs rescan"), &
    parameter_t("run", "queue", "text", 1, "default", "'calendar'", "event queue; same trajectory", &
      choices="calendar heap"), &
    parameter_t("run", "threads", "integer", 1, "default", "0", &
      "cores that the run may use; 0: OMP_NUM_THREADS, or one; same trajectory", number_of_threads)]

  type(parameter_t), parameter :: box_rows(*) = [ &
    parameter_t("box", "lower", "real", 2, "default", "0, 0", "lower left corner", unit="length"), &
    parameter_t("box", "upper", "real", 2, "default", "1, 1", "upper right corner", unit="length"), &
    parameter_t("box", "boundary", "text", 2, "default", "'wall', 'wall'", &
      "the two sides along x, the two sides along y", choices="wall periodic"), &
    parameter_t("box", "gravity", "real", 2, "default", "0, 0", "uniform acceleration of all disks", &
      unit="length/time**2")]

  type(parameter_t), parameter :: obstacle_rows(*) = [ &
    parameter_t("obstacle", "name", "text", 1, "optional", "'scatterer'", "name; default obstacle1, obstacle2, ..."), &
    parameter_t("obstacle", "centre", "real", 2, "example", "0.5, 0.5", "centre of the circular wall", unit="length"), &
    parameter_t("obstacle", "radius", "real", 1, "example", "0.2", "radius of the circular wall", positive, "length"), &
    parameter_t("obstacle", "side", "text", 1, "default", "'outside'", &
      "disks bounce off the outside, or are kept inside", choices="outside inside")]

  type(parameter_t), parameter :: wall_rows(*) = [ &
    parameter_t("wall", "name", "text", 1, "optional", "'ramp'", "name; default wall1, wall2, ..."), &
    parameter_t("wall", "from", "real", 2, "example", "0.2, 0.3", "one end of the straight wall", unit="length"), &
    parameter_t("wall", "to", "real", 2, "example", "0.8, 0.1", "the other end", unit="length")]

  type(parameter_t), parameter :: species_rows(*) = [ &
    parameter_t("species", "name", "text", 1, "optional", "'gas'", "name; default species1, species2, ..."), &
    parameter_t("species", "count", "integer", 1, "example", "100", &
      "number of disks; may be left out with grid, position or file", count_of_disks), &
    parameter_t("species", "mass", "real", 1, "default", "1", "mass of a disk; may be left to file", positive, "mass"), &
    parameter_t("species", "radius", "real", 1, "example", "0.01", &
      "radius of a disk; give it or packing_fraction, or leave it to file", positive, "length"), &
    parameter_t("species", "packing_fraction", "real", 1, "optional", "0.3", &
      "area of the disks divided by the area of their region; fixes the radius", fraction), &
    parameter_t("species", "relative_to", "text", 1, "optional", "'bed'", &
      "another species; mass and radius are then multiples of its own (radius: 1)"), &
    parameter_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", &
      "xlo, xhi, ylo, yhi of the part of the box it starts in; default the box", unit="length"), &
    parameter_t("species", "placement", "text", 1, "default", "'random'", &
      "where disks start; follows from grid, position or file if one is given", &
      choices="random grid lattice dense explicit file grown"), &
    parameter_t("species", "grid", "integer", 2, "optional", "10, 10", &
      "columns and rows of placement = 'grid'", count_of_disks, goes_with="placement grid"), &
    parameter_t("species", "file", "text", 1, "optional", "'runs/gas.h5'", &
      "text with lines x y [vx vy] or named columns, or a run whose last frame is used", goes_with="placement file grown"), &
    parameter_t("species", "scale_positions", "logical", 1, "fallback", ".false.", &
      "stretch the positions in the file of a run from its box to this one", goes_with="placement file grown"), &
    parameter_t("species", "position", "real", 0, "optional", "0.2, 0.5, 0.8, 0.5", &
      "x1, y1, x2, y2, ... of placement = 'explicit'", unit="length", goes_with="placement explicit"), &
    parameter_t("species", "velocities", "text", 1, "default", "'rest'", &
      "how disks start; follows from velocity, speed, temperature or file", &
      choices="rest equal_speed uniform maxwell explicit file"), &
    parameter_t("species", "speed", "real", 1, "fallback", "1", &
      "of 'equal_speed'; for 'uniform' the largest |vx| and |vy|", not_negative, "length/time", &
      goes_with="velocities equal_speed uniform"), &
    parameter_t("species", "temperature", "real", 1, "fallback", "1", "kT of 'maxwell'", not_negative, "energy", &
      goes_with="velocities maxwell"), &
    parameter_t("species", "exact_temperature", "real", 1, "optional", "1", &
      "scale the velocities so that kT of the species is exactly this", not_negative, "energy"), &
    parameter_t("species", "velocity", "real", 0, "optional", "1, 0", &
      "vx1, vy1, vx2, vy2, ... of 'explicit'; one pair is used for all disks", unit="length/time", &
      goes_with="velocities explicit")]

  type(parameter_t), parameter :: contact_rows(*) = [ &
    parameter_t("contact", "restitution", "real", 1, "default", "1", &
      "of two disks: 1 elastic, 0 no rebound", unit_interval), &
    parameter_t("contact", "wall_restitution", "real", 1, "optional", "1", &
      "of a disk and a wall; default as restitution", unit_interval), &
    parameter_t("contact", "wall_rule", "text", 1, "default", "'velocity'", &
      "walls reduce the whole velocity, or its normal part only", choices=wall_rules), &
    parameter_t("contact", "contact_time", "real", 1, "default", "0", &
      "TC model: elastic if a partner collided less than this ago; 0 off", not_negative, "time"), &
    parameter_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      "for species 1-1, 1-2, ..., 2-1, 2-2, ...; instead of restitution", unit_interval)]

  type(parameter_t), parameter :: stop_rows(*) = [ &
    parameter_t("stop", "time", "real", 1, "example", "1", &
      "end at this time; the first rule to be met ends the run", not_negative, "time"), &
    parameter_t("stop", "collisions", "integer", 1, "optional", "100000", &
      "end after this many collisions between disks", not_negative), &
    parameter_t("stop", "collisions_per_disk", "real", 1, "optional", "20", &
      "end when 2 collisions/N reaches this", not_negative), &
    parameter_t("stop", "events", "integer", 1, "optional", "100000", &
      "end after this many collisions of any kind: pair, side, obstacle, wall", not_negative), &
    parameter_t("stop", "energy_fraction", "real", 1, "optional", "0.1", &
      "end when collisions have left this fraction of the kinetic energy", energy_left), &
    parameter_t("stop", "wall_clock", "real", 1, "optional", "3600", &
      "stop with a checkpoint after this much computing time", positive, "s")]

  type(parameter_t), parameter :: output_rows(*) = [ &
    parameter_t("output", "frames_every_time", "real", 1, "optional", "0.1", &
      "positions and velocities; default the first and the last", positive, "time"), &
    parameter_t("output", "frames_every_collisions", "integer", 1, "optional", "1000", &
      "the same, by collisions between disks", positive), &
    parameter_t("output", "frames_every_events", "integer", 1, "optional", "1000", &
      "the same, by collisions of any kind", positive), &
    parameter_t("output", "observables_every_time", "real", 1, "optional", "0.01", &
      "energies, pressure, ...; default the first and the last", positive, "time"), &
    parameter_t("output", "observables_every_collisions", "integer", 1, "optional", "100", &
      "the same, by collisions between disks", positive), &
    parameter_t("output", "observables_every_events", "integer", 1, "optional", "100", &
      "the same, by collisions of any kind", positive), &
    parameter_t("output", "precision", "text", 1, "default", "'double'", &
      "of the frames; checkpoints are always double", choices="double single"), &
    parameter_t("output", "event_log", "logical", 1, "default", ".false.", "write every collision to /events"), &
    parameter_t("output", "checkpoint_every", "real", 1, "optional", "600", &
      "computing time between checkpoints", positive, "s")]

  type(parameter_t), parameter :: table(*) = [run_rows, box_rows, obstacle_rows, wall_rows, species_rows, &
    contact_rows, stop_rows, output_rows]

contains

  !> Whether a group may occur several times in a file, told apart by `name`.
  pure function is_repeated(group)
    character(len=*), intent(in) :: group
    logical :: is_repeated

    is_repeated = any(obstacle_groups == group) .or. group == "species"
  end function is_repeated

  !> Names of the variables of a group, in order.
  pure function variables_of(group) result(names)
    character(len=*), intent(in) :: group
    character(len=name_length), allocatable :: names(:)

    names = pack(table%name, table%group == group)
  end function variables_of

  !> Row of a variable within its group, as in `variables_of`; 0 if there is none.
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

  !> The variable of this name in every group that has one: `obstacle.radius or species.radius`; else empty.
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

  !> The words of a line.
  pure function words_of(line) result(words)
    character(len=*), intent(in) :: line
    character(len=len(line)), allocatable :: words(:)
    integer :: i

    allocate (words(count([(line(i:i) /= " " .and. line(i + 1:min(i + 1, len(line))) == " ", i=1, len(line))])))
    if (size(words) > 0) read (line, *) words
  end function words_of

  !> What may be written: `a number > 0`, `'wall' or 'periodic'`.
  pure function allowed(row) result(words)
    type(parameter_t), intent(in) :: row
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
    if (row%size > 1 .and. row%kind == "text") words = "values, each "//words
    if (row%size > 1) words = written(row%size)//" "//words
  end function allowed

  !> `'a', 'b' or 'c'`
  pure function either(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text

    text = "'"//joined(words(:size(words) - 1), "', '")
    if (size(words) > 1) text = text//"' or '"
    text = text//trim(words(size(words)))//"'"
  end function either

  !> The reference input file: every variable with its default. It is a valid input itself.
  pure function defaults_text() result(text)
    character(len=:), allocatable :: text
    character(len=1), parameter :: eol = new_line("a")
    integer :: g, k

    text = "! Every variable of Ricochet with its default; a file needs only what differs."//eol// &
      "! A variable that is commented out or called an example has no default, or not in all cases."//eol// &
      "! Groups may be in any order; &obstacle, &wall and &species may be repeated."//eol
    do g = 1, size(group_names)
      text = text//eol//margin(group_names(g))//"&"//trim(group_names(g))//eol
      do k = 1, size(table)
        if (table(k)%group == group_names(g)) text = text//reference_line(table(k))//eol
      end do
      text = text//margin(group_names(g))//"/"//eol
    end do
  end function defaults_text

  !> The reference file has no obstacles: those groups are comments.
  pure function margin(group)
    character(len=*), intent(in) :: group
    character(len=:), allocatable :: margin

    margin = ""
    if (any(obstacle_groups == group)) margin = "! "
  end function margin

  !> A variable in the reference file; a choice has a second line that lists its words.
  pure function reference_line(row) result(line)
    type(parameter_t), intent(in) :: row
    character(len=:), allocatable :: line
    character(len=comment_column) :: setting
    character(len=:), allocatable :: indent

    indent = "  "
    if (row%status == "optional" .or. row%status == "fallback") indent = "  ! "
    if (any(obstacle_groups == row%group)) indent = "!   "
    setting = indent//trim(row%name)//" = "//row%value
    line = setting//" ! "
    if (row%status == "example") line = line//"an example: "
    line = line//trim(row%help)
    if (row%unit /= "") line = line//" ["//trim(row%unit)//"]"
    if (row%choices == "") return
    setting = margin(row%group)
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

  !> Name and unit of a variable, its meaning, what is allowed, and its default or an example.
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
