!> The one table of input variables. It drives reading, checking, `--print-defaults`, `--explain`,
!> `/parameters` in the output file and the reference page.
module variables
  use kinds, only: real64
  use collisions, only: restitution_laws, wall_rules
  use drive, only: drive_kinds
  use side_motion, only: motions
  use texts, only: joined, written
  implicit none
  private
  public :: variable_t, table, group_names, obstacle_groups, wall_groups, is_repeated, variables_of, row_of
  public :: change_of, full_names, in_motion, on_resume
  public :: track_of, words_of, excludes, allowed, either, smallest, largest, most_disks, most_threads, name_length

  integer, parameter :: name_length = 37, help_length = 1000
  integer, parameter :: most_threads = 1024, most_disks = 100000000
  real(real64), parameter :: smallest = 1.0e-100_real64    !! numbers beyond these would overflow when
  real(real64), parameter :: largest = 1.0e100_real64      !! squared or multiplied

  !> When a variable may have another value than at the start of a run: never; on `--resume`, because it has no effect on
  !> the trajectory; or in a running simulation, because it acts on disks and neither places nor describes them.
  character(len=9), parameter :: never = "never", on_resume = "on resume", in_motion = "running"

  type :: range_t
    real(real64) :: lower, upper             !! both belong to the range
    character(len=24) :: words
  end type range_t

  !> The groups of which each describes an obstacle, of one shape or another.
  character(len=8), parameter :: obstacle_groups(2) = [character(len=8) :: "obstacle", "wall"]
  !> Those of which each describes a wall of any kind. The reference file has none.
  character(len=8), parameter :: wall_groups(*) = [character(len=8) :: "side", obstacle_groups]

  type(range_t), parameter :: anything = range_t(-largest, largest, "")
  type(range_t), parameter :: positive = range_t(smallest, largest, "> 0")
  type(range_t), parameter :: not_negative = range_t(0, largest, ">= 0")
  type(range_t), parameter :: number_of_threads = range_t(0, most_threads, "from 0 to 1024")
  type(range_t), parameter :: unit_interval = range_t(0, 1, "from 0 to 1")
  type(range_t), parameter :: fraction = range_t(smallest, nearest(1.0_real64, -1.0), "> 0 and < 1")
  type(range_t), parameter :: part_of_all = range_t(smallest, 1, "> 0 and <= 1")
  type(range_t), parameter :: energy_left = range_t(1.0e-12_real64, fraction%upper, ">= 1e-12 and < 1")
  type(range_t), parameter :: spread_of_radii = range_t(0, fraction%upper, ">= 0 and < 1")
  type(range_t), parameter :: tangential = range_t(-1, 1, "from -1 to 1")
  type(range_t), parameter :: moment = range_t(smallest, 1, "> 0 and <= 1")
  type(range_t), parameter :: per_decade = range_t(1, 1000, "from 1 to 1000")
  type(range_t), parameter :: count_of_disks = range_t(1, most_disks, "from 1 to 100000000")

  type :: variable_t
    character(len=8) :: group
    character(len=name_length) :: name
    character(len=8) :: kind                 !! "integer", "real", "logical" or "text"
    integer :: size                          !! number of values; 0: any number
    character(len=8) :: status               !! see below
    character(len=24) :: value               !! as written in a file
    character(len=help_length) :: help       !! full sentences
    type(range_t) :: range = anything        !! of numbers
    character(len=16) :: unit = ""
    character(len=100) :: choices = ""        !! of texts, separated by blanks; none: free text
    character(len=60) :: goes_with = ""      !! a choice, then its words with which this variable has an effect
    character(len=80) :: excludes = ""       !! variables of the same group that are not given with it
    character(len=9) :: may_change = never   !! when it may have another value than at the start
  end type variable_t

  ! status     value                           line in the reference file
  ! default    the default                     as it is
  ! fallback   the default where one applies   as a comment
  ! example    an example, no default          as it is, because something must be given
  ! required   an example, no default          as a comment; must be given with the choice that it goes with
  ! optional   an example, no default          as a comment

  character(len=8), parameter :: group_names(10) = [character(len=8) :: &
    "run", "box", "side", "obstacle", "wall", "species", "contact", "drive", "stop", "output"]

  type(variable_t), parameter :: run_rows(*) = [ &
    variable_t("run", "title", "text", 1, "default", "''", "one line that describes the run", may_change=on_resume), &
    variable_t("run", "seed", "integer", 1, "default", "1", &
      "seed of the random numbers: the same seed gives the same run", not_negative), &
    variable_t("run", "dynamics", "text", 1, "default", "'events'", &
      "exact flight from collision to collision, or fixed time steps", choices="events steps"), &
    variable_t("run", "dt", "real", 1, "optional", "0.001", &
      "time step; needed with dynamics = 'steps'", positive, "time"), &
    variable_t("run", "search", "text", 1, "default", "'cells'", &
      "cost per collision O(1), O(N) or O(N**2); same trajectory", choices="cells pairs rescan", may_change=on_resume), &
    variable_t("run", "queue", "text", 1, "default", "'calendar'", "event queue; same trajectory", &
      choices="calendar heap", may_change=on_resume), &
    variable_t("run", "threads", "integer", 1, "default", "0", &
      "cores that the run may use; 0: OMP_NUM_THREADS, or one; same trajectory", number_of_threads, may_change=on_resume)]

  type(variable_t), parameter :: box_rows(*) = [ &
    variable_t("box", "lower", "real", 2, "default", "0, 0", "lower left corner", unit="length"), &
    variable_t("box", "upper", "real", 2, "default", "1, 1", "upper right corner", unit="length"), &
    variable_t("box", "boundary", "text", 2, "default", "'wall', 'wall'", &
      "the two sides along x, the two sides along y", choices="wall periodic"), &
    variable_t("box", "gravity", "real", 2, "default", "0, 0", "uniform acceleration of all disks", &
      unit="length/time**2", may_change=in_motion), &
    variable_t("box", "shear_rate", "real", 1, "default", "0", &
      "gradient along y of the velocity along x; both axes periodic (Lees and Edwards)", unit="1/time")]

  type(variable_t), parameter :: side_rows(*) = [ &
    variable_t("side", "name", "text", 1, "example", "'bottom'", "which side of the box, where it is a wall", &
      choices="left right bottom top"), &
    variable_t("side", "motion", "text", 1, "default", "'still'", &
      "how it moves; sawtooth: it stays and strikes; piston: pushed by disks and force", choices=motions, may_change=in_motion), &
    variable_t("side", "amplitude", "real", 1, "required", "0.05", "how far it moves from its place", positive, &
      "length", goes_with="motion sine parabolic", may_change=in_motion), &
    variable_t("side", "period", "real", 1, "required", "1", "of the motion", positive, "time", &
      goes_with="motion sine parabolic", may_change=in_motion), &
    variable_t("side", "phase", "real", 1, "fallback", "0", &
      "in periods, at the time 0: at 0 it moves inwards through its place", unit_interval, goes_with="motion sine parabolic", &
      may_change=in_motion), &
    variable_t("side", "position", "real", 1, "optional", "1", &
      "where the side is at the start of its motion; default: the box's side", unit="length", &
      goes_with="motion still constant_velocity piston"), &
    variable_t("side", "velocity", "real", 1, "required", "1", "inwards: with which it strikes (> 0), or moves (< 0: outwards)", &
      unit="length/time", goes_with="motion sawtooth constant_velocity", may_change=in_motion), &
    variable_t("side", "start_time", "real", 1, "fallback", "0", "time at which it starts to move; before, it is at its place", &
      not_negative, "time", goes_with="motion constant_velocity", may_change=in_motion), &
    variable_t("side", "end_time", "real", 1, "required", "1", "time at which it stops; it stays where it is then", positive, &
      "time", goes_with="motion constant_velocity", may_change=in_motion), &
    variable_t("side", "mass", "real", 1, "required", "10", "mass of the piston", positive, "mass", &
      goes_with="motion piston", may_change=in_motion), &
    variable_t("side", "force", "real", 1, "required", "1", "constant force that pushes the piston inwards", not_negative, &
      "energy/length", goes_with="motion piston", may_change=in_motion)]

  type(variable_t), parameter :: obstacle_rows(*) = [ &
    variable_t("obstacle", "name", "text", 1, "optional", "'scatterer'", "name; default obstacle1, obstacle2, ..."), &
    variable_t("obstacle", "centre", "real", 2, "example", "0.5, 0.5", "centre of the circular wall", unit="length"), &
    variable_t("obstacle", "radius", "real", 1, "example", "0.2", "radius of the circular wall", positive, "length"), &
    variable_t("obstacle", "side", "text", 1, "default", "'outside'", &
      "disks bounce off the outside, or are kept inside", choices="outside inside"), &
    variable_t("obstacle", "file", "text", 1, "optional", "'scatterers.txt'", "file of many circles instead of centre and " &
      //"radius: a line of names, then x y radius for each, or HDF5 (.h5: centre, radius); one law, one set of sums", &
      excludes="centre radius")]

  type(variable_t), parameter :: wall_rows(*) = [ &
    variable_t("wall", "name", "text", 1, "optional", "'ramp'", "name; default wall1, wall2, ..."), &
    variable_t("wall", "from", "real", 2, "example", "0.2, 0.3", "one end of the straight wall", unit="length"), &
    variable_t("wall", "to", "real", 2, "example", "0.8, 0.1", "the other end", unit="length"), &
    variable_t("wall", "points", "real", 0, "optional", "0, 0, 0.5, 0.2, 1, 0", "x1, y1, x2, y2, ... of a polyline instead of " &
      //"from and to; it is closed if the last point equals the first", unit="length", excludes="from to"), &
    variable_t("wall", "file", "text", 1, "optional", "'walls.txt'", "file of many straight walls instead of from and " &
      //"to: a line of names, then x1 y1 x2 y2 for each, or HDF5 (.h5: from, to); one law, one set of sums", &
      excludes="from to points")]

  !> The law of a wall, in the group of each.
  type(variable_t), parameter :: law_rows(*) = [ &
    variable_t("", "restitution", "real", 1, "optional", "0.9", &
      "of a disk and this wall; default contact.wall_restitution", unit_interval, may_change=in_motion), &
    variable_t("", "rule", "text", 1, "optional", "'normal'", "default contact.wall_rule", choices=wall_rules, &
      may_change=in_motion), &
    variable_t("", "tangential_restitution", "real", 1, "optional", "0.5", &
      "of a rough wall; default contact.wall_tangential_restitution", tangential, goes_with="rule normal", may_change=in_motion), &
    variable_t("", "friction", "real", 1, "optional", "0.3", "Coulomb's coefficient; default contact.wall_friction", &
      not_negative, goes_with="rule normal", may_change=in_motion), &
    variable_t("", "temperature", "real", 1, "optional", "1", "kT of a thermal wall, instead of restitution and rule", &
      positive, "energy", excludes="restitution rule tangential_restitution friction motion", may_change=in_motion), &
    variable_t("", "surface_velocity", "real", 1, "fallback", "0", &
      "of the surface: to +x, +y, from -> to, counter-clockwise; if thermal or rough", unit="length/time", may_change=in_motion)]
  integer, private :: g, r
  type(variable_t), parameter :: wall_law_rows(*) = [((variable_t(wall_groups(g), law_rows(r)%name, law_rows(r)%kind, &
    law_rows(r)%size, law_rows(r)%status, law_rows(r)%value, law_rows(r)%help, law_rows(r)%range, law_rows(r)%unit, &
    law_rows(r)%choices, law_rows(r)%goes_with, law_rows(r)%excludes, law_rows(r)%may_change), &
    r=1, size(law_rows)), g=1, size(wall_groups))]

  type(variable_t), parameter :: species_rows(*) = [ &
    variable_t("species", "name", "text", 1, "optional", "'gas'", "name; default species1, species2, ..."), &
    variable_t("species", "count", "integer", 1, "example", "100", &
      "number of disks; may be left out with grid, position or file", count_of_disks), &
    variable_t("species", "mass", "real", 1, "default", "1", "mass of a disk; may be left to file", positive, "mass"), &
    variable_t("species", "radius", "real", 1, "example", "0.01", &
      "radius of a disk; give it or packing_fraction, or leave it to file", positive, "length"), &
    variable_t("species", "packing_fraction", "real", 1, "optional", "0.3", &
      "area of the disks divided by the area of their region; fixes the radius", fraction, excludes="radius relative_to"), &
    variable_t("species", "radius_distribution", "text", 1, "optional", "'gaussian'", &
      "of radii that differ; follows from polydispersity: uniform", choices="uniform gaussian lognormal"), &
    variable_t("species", "polydispersity", "real", 1, "required", "0.2", &
      "standard deviation of the radii over their mean, which is then radius", spread_of_radii, &
      goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "mass_scaling", "text", 1, "fallback", "'equal'", &
      "all disks have one mass, or by area, and mass is that of the mean radius", choices="equal area", &
      goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "relative_to", "text", 1, "optional", "'bed'", &
      "another species; mass and radius are then multiples of its own (radius: 1)"), &
    variable_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", &
      "xlo, xhi, ylo, yhi of the part of the box it starts in; default the box", unit="length"), &
    variable_t("species", "placement", "text", 1, "default", "'random'", &
      "where disks start; follows from grid, position or file if one is given", &
      choices="random grid lattice dense explicit file grown"), &
    variable_t("species", "grid", "integer", 2, "required", "10, 10", &
      "columns and rows of placement = 'grid'", count_of_disks, goes_with="placement grid"), &
    variable_t("species", "file", "text", 1, "required", "'runs/gas.h5'", &
      "text with lines x y [vx vy] or named columns, or a run whose last frame is used", goes_with="placement file grown"), &
    variable_t("species", "scale_positions", "logical", 1, "fallback", ".false.", &
      "stretch the positions in the file of a run from its box to this one", goes_with="placement file grown"), &
    variable_t("species", "position", "real", 0, "required", "0.2, 0.5, 0.8, 0.5", &
      "x1, y1, x2, y2, ... of placement = 'explicit'", unit="length", goes_with="placement explicit"), &
    variable_t("species", "velocities", "text", 1, "default", "'rest'", &
      "how disks start; follows from velocity, speed, temperature or file", &
      choices="rest equal_speed uniform maxwell explicit file"), &
    variable_t("species", "speed", "real", 1, "fallback", "1", &
      "of 'equal_speed'; for 'uniform' the largest |vx| and |vy|", not_negative, "length/time", &
      goes_with="velocities equal_speed uniform"), &
    variable_t("species", "temperature", "real", 1, "fallback", "1", "kT of 'maxwell'", not_negative, "energy", &
      goes_with="velocities maxwell"), &
    variable_t("species", "exact_temperature", "real", 1, "optional", "1", &
      "scale the velocities so that kT of the species is exactly this", not_negative, "energy"), &
    variable_t("species", "velocity", "real", 0, "required", "1, 0", &
      "vx1, vy1, vx2, vy2, ... of 'explicit'; one pair is used for all disks", unit="length/time", &
      goes_with="velocities explicit"), &
    variable_t("species", "angular_velocity", "real", 1, "optional", "2", "of all disks at the start", unit="1/time"), &
    variable_t("species", "rotational_temperature", "real", 1, "optional", "1", &
      "mean of I omega**2 at the start, instead of angular_velocity", not_negative, "energy", excludes="angular_velocity")]

  type(variable_t), parameter :: contact_rows(*) = [ &
    variable_t("contact", "restitution", "real", 1, "default", "1", &
      "of two disks: 1 elastic, 0 no rebound", unit_interval, may_change=in_motion), &
    variable_t("contact", "wall_restitution", "real", 1, "optional", "1", &
      "of a disk and a wall; default as restitution", unit_interval, may_change=in_motion), &
    variable_t("contact", "restitution_law", "text", 1, "default", "'constant'", &
      "slower contacts of disks and with walls lose less: 1 - restitution ~ g**(1/5)", choices=restitution_laws, &
      may_change=in_motion), &
    variable_t("contact", "reference_speed", "real", 1, "required", "1", &
      "speed g along the normal from which on restitutions are as given", positive, "length/time", &
      goes_with="restitution_law power viscoelastic", may_change=in_motion), &
    variable_t("contact", "wall_rule", "text", 1, "default", "'velocity'", &
      "walls reduce the whole velocity, or its normal part only", choices=wall_rules, may_change=in_motion), &
    variable_t("contact", "contact_time", "real", 1, "default", "0", &
      "TC model: elastic if a partner collided less than this ago; 0 off", not_negative, "time", may_change=in_motion), &
    variable_t("contact", "tangential_restitution", "real", 1, "default", "-1", &
      "of rough disks: -1 smooth, 0 the slip ends, 1 it is reversed", tangential, may_change=in_motion), &
    variable_t("contact", "friction", "real", 1, "optional", "0.3", &
      "Coulomb's coefficient; default: the tangential force has no limit", not_negative, may_change=in_motion), &
    variable_t("contact", "inertia", "real", 1, "default", "0.5", &
      "moment of inertia of a disk over mass times radius squared", moment, may_change=in_motion), &
    variable_t("contact", "wall_tangential_restitution", "real", 1, "optional", "0.5", &
      "of a disk and a wall with rule 'normal'; default as tangential_restitution", tangential, goes_with="wall_rule normal", &
      may_change=in_motion), &
    variable_t("contact", "wall_friction", "real", 1, "optional", "0.3", "of the same; default as friction", &
      not_negative, goes_with="wall_rule normal", may_change=in_motion), &
    variable_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      "for species 1-1, 1-2, ..., 2-1, 2-2, ...; instead of restitution", unit_interval, may_change=in_motion)]

  type(variable_t), parameter :: drive_rows(*) = [ &
    variable_t("drive", "kind", "text", 1, "default", "'none'", &
      "kicks: random changes of velocity, a heat bath, Brownian or active disks", choices=drive_kinds, may_change=in_motion), &
    variable_t("drive", "interval", "real", 1, "required", "0.01", "time from kick to kick", positive, "time", &
      goes_with="kind noise andersen brownian active", may_change=in_motion), &
    variable_t("drive", "strength", "real", 1, "required", "0.1", &
      "growth of the variance of each component of all velocities", positive, "velocity**2/time", goes_with="kind noise", &
      may_change=in_motion), &
    variable_t("drive", "keep_momentum", "logical", 1, "fallback", ".false.", &
      "subtract the mean velocity that each kick gives", goes_with="kind noise", may_change=in_motion), &
    variable_t("drive", "fraction", "real", 1, "required", "0.1", &
      "of the disks that a kick reaches, on average", part_of_all, goes_with="kind andersen", may_change=in_motion), &
    variable_t("drive", "temperature", "real", 1, "required", "1", "kT of the new velocities", positive, "energy", &
      goes_with="kind andersen brownian active", may_change=in_motion), &
    variable_t("drive", "self_propulsion_speed", "real", 1, "required", "1", "added along the orientation of a disk", &
      not_negative, "length/time", goes_with="kind active", may_change=in_motion), &
    variable_t("drive", "rotational_diffusion", "real", 1, "fallback", "0", &
      "of the orientation: its variance grows by twice this per time", not_negative, "1/time", goes_with="kind active", &
      may_change=in_motion), &
    variable_t("drive", "species", "text", 1, "fallback", "''", "the only species that is kicked; '' all", &
      goes_with="kind noise andersen brownian active", may_change=in_motion)]

  type(variable_t), parameter :: stop_rows(*) = [ &
    variable_t("stop", "time", "real", 1, "example", "1", &
      "end at this time; the first rule to be met ends the run", not_negative, "time", may_change=on_resume), &
    variable_t("stop", "collisions", "integer", 1, "optional", "100000", &
      "end after this many collisions between disks", not_negative, may_change=on_resume), &
    variable_t("stop", "collisions_per_disk", "real", 1, "optional", "20", &
      "end when 2 collisions/N reaches this", not_negative, may_change=on_resume), &
    variable_t("stop", "events", "integer", 1, "optional", "100000", &
      "end after this many collisions of any kind: pair, side, obstacle, wall", not_negative, may_change=on_resume), &
    variable_t("stop", "energy_fraction", "real", 1, "optional", "0.1", &
      "end when collisions have left this fraction of the kinetic energy", energy_left, may_change=on_resume), &
    variable_t("stop", "at_rest", "logical", 1, "optional", ".true.", &
      "End of the run when all disks have come to rest: when the ever shorter bounces of each under box.gravity have ended " &
      //"or, without gravity, when no disk moves. It needs collisions that lose energy, run.dynamics = 'events' and surfaces " &
      //"that stand still.", may_change=on_resume), &
    variable_t("stop", "wall_clock", "real", 1, "optional", "3600", &
      "stop with a checkpoint after this much computing time", positive, "s", may_change=on_resume)]

  type(variable_t), parameter :: output_rows(*) = [ &
    variable_t("output", "frames_every_time", "real", 1, "optional", "0.1", &
      "positions and velocities; default the first and the last", positive, "time", may_change=on_resume), &
    variable_t("output", "frames_every_collisions", "integer", 1, "optional", "1000", &
      "a frame after so many collisions between disks", positive, may_change=on_resume), &
    variable_t("output", "frames_every_events", "integer", 1, "optional", "1000", &
      "a frame after so many collisions of any kind", positive, may_change=on_resume), &
    variable_t("output", "frames_every_collisions_per_disk", "real", 1, "optional", "1", &
      "a frame whenever 2 collisions/N has grown by this", positive, may_change=on_resume), &
    variable_t("output", "frames_at", "real", 0, "optional", "0.1, 1, 10", &
      "frames at these times, too, in their order", not_negative, "time", may_change=on_resume), &
    variable_t("output", "frames_per_decade", "integer", 1, "optional", "10", &
      "frames at so many times in each power of ten, too, from decades_from on", per_decade, may_change=on_resume), &
    variable_t("output", "decades_from", "real", 1, "optional", "0.001", &
      "first time of frames_per_decade and observables_per_decade", positive, "time", may_change=on_resume), &
    variable_t("output", "observables_every_time", "real", 1, "optional", "0.01", &
      "energies, pressure, ...; default the first and the last", positive, "time", may_change=on_resume), &
    variable_t("output", "observables_every_collisions", "integer", 1, "optional", "100", &
      "a sample after so many collisions between disks", positive, may_change=on_resume), &
    variable_t("output", "observables_every_events", "integer", 1, "optional", "100", &
      "a sample after so many collisions of any kind", positive, may_change=on_resume), &
    variable_t("output", "observables_every_collisions_per_disk", "real", 1, "optional", "0.1", &
      "a sample whenever 2 collisions/N has grown by this", positive, may_change=on_resume), &
    variable_t("output", "observables_at", "real", 0, "optional", "0.1, 1, 10", &
      "samples at these times, too, in their order", not_negative, "time", may_change=on_resume), &
    variable_t("output", "observables_per_decade", "integer", 1, "optional", "10", &
      "samples at so many times in each power of ten, too, from decades_from on", per_decade, may_change=on_resume), &
    variable_t("output", "frame_columns", "text", 0, "optional", "'position', 'velocity'", &
      "what frames have beside the positions; default: all that there is", &
      choices="position velocity event_count image angular_velocity orientation"), &
    variable_t("output", "precision", "text", 1, "default", "'double'", &
      "of the frames; checkpoints are always double", choices="double single"), &
    variable_t("output", "event_log", "logical", 1, "default", ".false.", "write every collision to /events"), &
    variable_t("output", "virial_tensor", "logical", 1, "default", ".false.", &
      "gather it for smooth disks, too, at some cost"), &
    variable_t("output", "helfand", "logical", 1, "default", ".false.", &
      "sum up over time what disks carry, for viscosities and conductivity"), &
    variable_t("output", "checkpoint_every", "real", 1, "optional", "600", &
      "computing time between checkpoints", positive, "s", may_change=on_resume)]

  type(variable_t), parameter :: table(*) = [run_rows, box_rows, side_rows, obstacle_rows, wall_rows, &
    wall_law_rows, species_rows, contact_rows, drive_rows, stop_rows, output_rows]

contains

  !> When a variable may have another value, by its full name, which may hold that of an instance: `side.left.velocity`.
  pure function change_of(name) result(when)
    character(len=*), intent(in) :: name
    character(len=len(never)) :: when
    integer :: k

    when = never
    do k = 1, size(table)
      if (table(k)%group == name(:index(name, ".") - 1) .and. table(k)%name == name(index(name, ".", back=.true.) + 1:)) &
        when = table(k)%may_change
    end do
  end function change_of

  !> Whether a group may occur several times in a file, told apart by `name`.
  elemental function is_repeated(group)
    character(len=*), intent(in) :: group
    logical :: is_repeated

    is_repeated = any(wall_groups == group) .or. group == "species"
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

  !> Whether one variable is not given with another of its group; of those that time the same samples, one is.
  pure function excludes(one, other) result(yes)
    integer, intent(in) :: one, other        !! rows
    logical :: yes

    yes = any(words_of(table(one)%excludes) == table(other)%name)
    if (other < one .and. track_of(table(one)%name) /= "") yes = track_of(table(one)%name) == track_of(table(other)%name)
  end function excludes

  !> Whose samples a variable times: `frames` of frames_every_time; empty if it is no cadence.
  pure function track_of(name) result(track)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: track

    track = name(:max(index(name, "_every_") - 1, 0))
  end function track_of

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

  !> `'a', 'b' or 'c'`
  pure function either(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text

    text = "'"//joined(words(:size(words) - 1), "', '")
    if (size(words) > 1) text = text//"' or '"
    text = text//trim(words(size(words)))//"'"
  end function either

end module variables
