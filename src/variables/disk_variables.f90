!> Table rows that describe the variables of the groups `&species`, `&contact` and `&drive`.
module disk_variables
  use collisions, only: restitution_laws, wall_rules
  use drive, only: drive_kinds
  use variable_rows, only: count_of_disks, fraction, in_motion, moment, not_negative, number_of_sweeps, part_of_all, positive, &
    spread_of_radii, tangential, unit_interval, variable_t
  implicit none
  private
  public :: disk_rows

  type(variable_t), parameter :: species_rows(*) = [ &
    variable_t("species", "name", "text", 1, "optional", "'gas'", &
      "Name of the species in messages, in the output file, in relative_to, in drive.species and in --set " &
      //"species.NAME.VARIABLE=VALUE: up to 40 letters, digits, _ and -, beginning with a letter.", &
      otherwise="species1, species2, ... in the order of the file"), &
    variable_t("species", "count", "integer", 1, "example", "100", &
      "Number of disks of the species.", count_of_disks, &
      otherwise="follows from grid, position or file; needed without these"), &
    variable_t("species", "mass", "real", 1, "default", "1", &
      "Mass of each disk. With relative_to, the value is a multiple of the mass of the other species. With mass_scaling = " &
      //"'area', the value applies to a disk that has the mean radius. If mass is not given and the starting file (file) " &
      //"contains masses, these masses are used.", &
      positive, "mass"), &
    variable_t("species", "radius", "real", 1, "example", "0.01", &
      "Radius of each disk; with polydispersity, the mean radius. With relative_to, the value is a multiple of the radius of " &
      //"the other species, and its default is 1. One of the variables radius, packing_fraction and relative_to must be " &
      //"given, unless the starting file (file) contains radii.", &
      positive, "length", otherwise="follows from packing_fraction, relative_to or file; needed without " &
      //"these"), &
    variable_t("species", "packing_fraction", "real", 1, "optional", "0.3", &
      "Packing fraction: total area of the disks of the species, divided by the area of its region. The program calculates " &
      //"the radius from the packing fraction.", &
      fraction, excludes="radius relative_to", otherwise="none; the radius is given in another " &
      //"way"), &
    variable_t("species", "radius_distribution", "text", 1, "optional", "'gaussian'", &
      "Distribution of the radii about their mean in a polydisperse species. The distribution is truncated so that the " &
      //"largest radius is at most ten times the smallest radius. The variable polydispersity must also be given.", &
      choices="uniform gaussian " &
      //"lognormal", &
      otherwise="'uniform' if polydispersity is given; else all radii are equal"), &
    variable_t("species", "polydispersity", "real", 1, "required", "0.2", &
      "Polydispersity: standard deviation of the radii divided by the mean radius. The largest allowed value is 0.47 for the " &
      //"uniform, 0.27 for the Gaussian and 0.39 for the lognormal distribution. Polydispersity cannot be combined with radii " &
      //"from a starting file (file).", &
      spread_of_radii, goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "mass_scaling", "text", 1, "fallback", "'equal'", &
      "Dependence of the mass of a disk on its radius in a polydisperse species.", choices="equal area", &
      goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "relative_to", "text", 1, "optional", "'bed'", &
      "Name of another species relative to which mass and radius of this species are given. For example, mass = 25 with " &
      //"relative_to = 'bed' is 25 times the mass of a disk of the species 'bed'. The radii of the other species must not " &
      //"come from a starting file (file). If the other species is polydisperse, its mean radius is used.", &
      otherwise="none; mass and radius are absolute values"), &
    variable_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", &
      "Rectangle in which the disks start: xlo, xhi, ylo, yhi. At the start each disk lies completely inside the rectangle; " &
      //"later the disks may leave the rectangle.", unit="length", otherwise="the whole box"), &
    variable_t("species", "placement", "text", 1, "default", "'random'", &
      "Method that generates the initial positions. If placement is not given, the method follows from grid, position or " &
      //"file if one of these variables is given.", &
      choices="random grid lattice dense explicit file grown relaxed"), &
    variable_t("species", "relaxation_sweeps", "integer", 1, "fallback", "1000", &
      "Number of sweeps of event-chain Monte Carlo that equilibrate the start with placement = 'relaxed'. A sweep consists of " &
      //"as many event chains as the run has disks, and an event chain moves about as many disks as the square root of the " &
      //"number of disks. The value applies to all species of the run and may be given in the group of any species.", &
      number_of_sweeps, goes_with="placement relaxed"), &
    variable_t("species", "grid", "integer", 2, "required", "10, 10", &
      "Numbers of columns and of rows of the rectangular grid. The product of the two numbers is the number of disks.", &
      count_of_disks, &
      goes_with="placement grid"), &
    variable_t("species", "file", "text", 1, "required", "'runs/gas.h5'", &
      "Starting file: a text file with lines `x y [vx vy]` or with named columns (x y vx vy omega angle radius mass species), " &
      //"or the output file (.h5) of another run, whose last frame is used. Count, mass and radius are read from the file if " &
      //"the input does not contain them. The path is relative to the folder in which the program is started.", &
      goes_with="placement file grown"), &
    variable_t("species", "scale_positions", "logical", 1, "fallback", ".false.", &
      "Scaling of the positions in the starting file (file) from the box of the earlier run to the box of this run. The " &
      //"starting file must be the output file (.h5) of a run.", &
      goes_with="placement file grown"), &
    variable_t("species", "position", "real", 0, "required", "0.2, 0.5, 0.8, 0.5", &
      "Positions of the disks: x1, y1, x2, y2, ..., one pair for each disk.", unit="length", goes_with="placement explicit"), &
    variable_t("species", "velocities", "text", 1, "default", "'rest'", &
      "Method that generates the initial velocities. Without this variable, the method follows from the one of the variables " &
      //"velocity, speed, temperature and file that is given. In a periodic box without obstacles and gravity, generated " &
      //"velocities have zero total momentum.", &
      choices="rest equal_speed uniform maxwell explicit file"), &
    variable_t("species", "speed", "real", 1, "fallback", "1", &
      "Speed of the disks at the start. With velocities = 'uniform' the value is the upper limit of |vx| and of |vy|.", &
      not_negative, "length/time", goes_with="velocities equal_speed uniform"), &
    variable_t("species", "temperature", "real", 1, "fallback", "1", &
      "Temperature kT of the Maxwell distribution from which the initial velocities are drawn. The temperature of the drawn " &
      //"velocities deviates from this value at random, unless exact_temperature is given.", not_negative, "energy", &
      goes_with="velocities maxwell"), &
    variable_t("species", "exact_temperature", "real", 1, "optional", "1", &
      "Temperature kT that the species has exactly at the start. All velocities v relative to the centre of mass of the " &
      //"species are multiplied by a common factor, so that the sum of m v**2 over the N disks of the species is 2N kT. The " &
      //"variable applies to all methods (velocities) except 'rest', and needs at least two disks.", not_negative, "energy", &
      otherwise="none; velocities are not scaled"), &
    variable_t("species", "velocity", "real", 0, "required", "1, 0", &
      "Velocities of the disks at the start: vx1, vy1, vx2, vy2, ..., one pair for each disk, or a single pair for all " &
      //"disks.", unit="length/time", goes_with="velocities explicit"), &
    variable_t("species", "angular_velocity", "real", 1, "optional", "2", &
      "Angular velocity of all disks of the species at the start, positive counter-clockwise. With a value other than 0 the " &
      //"disks rotate, even if they are smooth.", unit="1/time", &
      otherwise="0, or from file with velocities = 'file'"), &
    variable_t("species", "rotational_temperature", "real", 1, "optional", "1", &
      "Temperature kT of the rotation at the start: angular velocities are Gaussian with variance kT/I, where I is the " &
      //"moment of inertia.", not_negative, "energy", excludes="angular_velocity", &
      otherwise="none; all disks have the same angular_velocity")]

  type(variable_t), parameter :: contact_rows(*) = [ &
    variable_t("contact", "restitution", "real", 1, "default", "1", &
      "Coefficient of restitution of collisions of two disks: 1 is elastic, 0 perfectly inelastic. The relative velocity " &
      //"along the line of centres is reversed and multiplied by this coefficient.", unit_interval, may_change=in_motion), &
    variable_t("contact", "wall_restitution", "real", 1, "optional", "1", &
      "Coefficient of restitution of collisions with sides and obstacles. The coefficient applies to all sides and obstacles " &
      //"without a separate coefficient (restitution in &side, &obstacle or &wall), except thermal boundaries.", &
      unit_interval, may_change=in_motion, &
      otherwise="contact.restitution"), &
    variable_t("contact", "restitution_law", "text", 1, "default", "'constant'", &
      "Dependence of the coefficients of restitution of disks and boundaries on the impact speed g, which is the normal " &
      //"component of the relative velocity.", choices=restitution_laws, may_change=in_motion), &
    variable_t("contact", "reference_speed", "real", 1, "required", "1", &
      "Reference value g0 of the impact speed. At impact speeds above g0 the coefficients of restitution have the values in " &
      //"the input; at lower impact speeds the coefficients are closer to 1. Choose g0 above the impact speeds that occur.", &
      positive, "length/time", goes_with="restitution_law power viscoelastic", may_change=in_motion), &
    variable_t("contact", "wall_rule", "text", 1, "default", "'velocity'", &
      "Collision rule of all sides and obstacles without a separate rule (rule in &side, &obstacle or &wall), except thermal " &
      //"boundaries.", choices=wall_rules, may_change=in_motion), &
    variable_t("contact", "contact_time", "real", 1, "default", "0", &
      "Contact duration t_c of the TC model, which prevents inelastic collapse: a collision is elastic if one of its partners " &
      //"had another collision less than t_c ago. The value 0 switches the TC model off. Choose t_c far below the mean time " &
      //"between collisions and, for grains of diameter d that rest under gravity g, below sqrt(d/g). The TC model does not " &
      //"prevent the collapse of resting grains with friction or with a tangential restitution between -1 and 1, which " &
      //"dissipate energy even in these elastic collisions. The TC model cannot be combined with stop.at_rest.", &
      not_negative, "time", may_change=in_motion), &
    variable_t("contact", "tangential_restitution", "real", 1, "default", "-1", &
      "Coefficient of tangential restitution of collisions of two disks: -1 for smooth surfaces, 0 if a collision stops the " &
      //"slip of the surfaces, 1 if a collision reverses the slip. With a value above -1 the disks are rough and rotate. A " &
      //"value between -1 and 1 dissipates energy even in collisions that the TC model (contact_time) makes elastic; grains " &
      //"that rest in a dense bed then collapse or collide millions of times. Use -1 or 1 for such grains.", &
      tangential, may_change=in_motion), &
    variable_t("contact", "friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of collisions of two disks: upper limit of the ratio of the tangential impulse to the " &
      //"normal impulse. Friction needs rough disks (tangential_restitution > -1). Friction dissipates energy even in " &
      //"collisions that the TC model (contact_time) makes elastic; grains that rest in a dense bed then collapse or collide " &
      //"millions of times. Use tangential_restitution = 1 without friction for such grains.", &
      not_negative, may_change=in_motion, &
      otherwise="the tangential impulse has no limit"), &
    variable_t("contact", "inertia", "real", 1, "default", "0.5", &
      "Moment of inertia of a disk divided by its mass times its radius squared: 0.5 for a uniform disk, 1 for a ring. The " &
      //"value has an effect only if disks rotate, which is the case with rough disks or boundaries, or if disks rotate at " &
      //"the start.", moment, may_change=in_motion), &
    variable_t("contact", "wall_tangential_restitution", "real", 1, "optional", "0.5", &
      "Coefficient of tangential restitution of collisions with all sides and obstacles without a separate value " &
      //"(tangential_restitution in &side, &obstacle or &wall): -1 for smooth surfaces, 0 if a collision stops the slip of " &
      //"the surfaces, 1 if a collision reverses the slip.", tangential, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.tangential_restitution"), &
    variable_t("contact", "wall_friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of collisions with all sides and obstacles without a separate value (friction in &side, " &
      //"&obstacle or &wall). Friction needs rough boundaries (wall_tangential_restitution > -1).", &
      not_negative, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.friction"), &
    variable_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      "Coefficients of restitution for each pair of species, as a symmetric matrix in the order 1-1, 1-2, ..., 2-1, 2-2, ... " &
      //"For n species, n*n values must be given; species are numbered in the order of the input file. These values replace " &
      //"contact.restitution.", unit_interval, may_change=in_motion, otherwise="contact.restitution for all pairs")]

  type(variable_t), parameter :: drive_rows(*) = [ &
    variable_t("drive", "kind", "text", 1, "default", "'none'", &
      "Kind of driving. Driving changes the velocities of the disks at all multiples of the time interval; such a change is " &
      //"called a kick. A kick of the kind 'recycle' also moves disks. Driving cannot be combined with stop.energy_fraction or " &
      //"stop.at_rest.", &
      choices=drive_kinds, may_change=in_motion), &
    variable_t("drive", "interval", "real", 1, "required", "0.01", &
      "Time between two kicks. Choose an interval well below the mean time between collisions, unless the kicks themselves " &
      //"are studied. With kind = 'recycle', choose an interval that is shorter than the time in which a disk passes through " &
      //"from_region.", positive, "time", goes_with="kind noise andersen brownian active recycle", may_change=in_motion), &
    variable_t("drive", "strength", "real", 1, "required", "0.1", &
      "Strength of the noise: rate at which the kicks increase the variance of each velocity component. The rate is equal for " &
      //"disks of all masses.", &
      positive, "velocity**2/time", goes_with="kind noise", may_change=in_motion), &
    variable_t("drive", "keep_momentum", "logical", 1, "fallback", ".true.", &
      "Conservation of the total momentum of the driven disks: each kick also subtracts the mean velocity that the noise adds " &
      //"to the driven disks.", goes_with="kind noise", may_change=in_motion), &
    variable_t("drive", "fraction", "real", 1, "required", "0.1", &
      "Probability that a kick changes the velocity of a given disk. The probability divided by interval is the collision " &
      //"frequency of the Andersen thermostat.", part_of_all, goes_with="kind andersen", may_change=in_motion), &
    variable_t("drive", "temperature", "real", 1, "required", "1", &
      "Temperature kT of the Maxwell distribution from which a kick draws new velocities. With kind = 'recycle', either " &
      //"temperature or velocity must be given.", positive, "energy", &
      goes_with="kind andersen brownian active recycle", may_change=in_motion, &
      otherwise="none; must be given where it applies, or velocity instead if kind is 'recycle'"), &
    variable_t("drive", "velocity", "real", 2, "required", "0, -1", &
      "Velocity of each disk after it has been recycled. If velocity is given, recycled disks do not rotate. Either " &
      //"temperature or velocity must be given.", &
      unit="length/time", goes_with="kind recycle", excludes="temperature", may_change=in_motion, &
      otherwise="none; velocity or temperature must be given where it applies"), &
    variable_t("drive", "from_region", "real", 4, "required", "0, 1, 0, 0.1", &
      "Region (xlo, xhi, ylo, yhi) in which disks are recycled: at all multiples of the time interval each disk whose centre is " &
      //"in this region moves to a random free position in to_region. After 100 random positions that are not free, the disk " &
      //"stays where it is until the next multiple of the interval. Disks move in the order of their ids.", &
      unit="length", goes_with="kind recycle", may_change=in_motion), &
    variable_t("drive", "to_region", "real", 4, "required", "0, 1, 0.9, 1", &
      "Region (xlo, xhi, ylo, yhi) to which recycled disks move. A recycled disk lies completely inside this region, except " &
      //"along a periodic axis that the region spans. The region must not overlap from_region, an obstacle or a straight wall.", &
      unit="length", goes_with="kind recycle", may_change=in_motion), &
    variable_t("drive", "self_propulsion_speed", "real", 1, "required", "1", &
      "Self-propulsion speed of an active disk: each kick adds a velocity of this magnitude along the orientation of the disk.", &
      not_negative, "length/time", &
      goes_with="kind active", may_change=in_motion), &
    variable_t("drive", "rotational_diffusion", "real", 1, "fallback", "0", &
      "Rotational diffusion coefficient D_r of the orientation of an active disk: the variance of the orientation angle grows " &
      //"at the rate 2 D_r.", not_negative, "1/time", goes_with="kind active", may_change=in_motion), &
    variable_t("drive", "species", "text", 1, "fallback", "''", &
      "Name of the only species that is driven. If the text is empty, all species are driven.", &
      goes_with="kind noise andersen brownian active recycle", may_change=in_motion)]

  type(variable_t), parameter :: disk_rows(*) = [species_rows, contact_rows, drive_rows]

end module disk_variables
