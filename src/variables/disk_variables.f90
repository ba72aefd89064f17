!> Variables of the groups `&species` and `&contact`.
module disk_variables
  use collisions, only: restitution_laws, wall_rules
  use placements, only: placement_rows
  use variable_rows, only: count_of_disks, fraction, in_motion, moment, not_negative, positive, &
    spread_of_radii, tangential, unit_interval, variable_t
  implicit none
  private
  public :: disk_rows

  type(variable_t), parameter :: species_rows(*) = [ &
    variable_t("species", "name", "text", 1, "optional", "'gas'", &
      "Name of the species in messages, in the output file, in relative_to and drive.species, and in --set " &
      //"species.NAME.VARIABLE=VALUE: up to 40 letters, digits, _ and -, beginning with a letter.", &
      otherwise="species1, species2, ... in the order of the file"), &
    variable_t("species", "count", "integer", 1, "example", "100", &
      "Number of disks of the species.", count_of_disks, &
      otherwise="follows from grid, position or file; needed without these"), &
    variable_t("species", "waiting", "integer", 1, "default", "0", &
      "Number of disks waiting outside the box at the start: the last disks of the species. Only the other disks have " &
      //"initial positions and velocities. Waiting disks enter through a source (&source). The packing fraction includes " &
      //"them. With an initial-configuration file (file), mass and radius must also be given.", not_negative), &
    variable_t("species", "mass", "real", 1, "default", "1", &
      "Mass of each disk. With relative_to, a multiple of the mass of the other species. With mass_scaling = 'area', the " &
      //"mass of a disk with the mean radius. If mass is not given, masses are read from the initial-configuration file " &
      //"(file), provided that the file contains masses.", &
      positive, "mass"), &
    variable_t("species", "radius", "real", 1, "example", "0.01", &
      "Radius of each disk; mean radius of a polydisperse species. With relative_to, a multiple of the radius of the other " &
      //"species (default 1). Unless radii are read from the initial-configuration file (file), the input must contain " &
      //"radius, packing_fraction or relative_to.", &
      positive, "length", otherwise="follows from packing_fraction, relative_to or file; needed without " &
      //"these"), &
    variable_t("species", "packing_fraction", "real", 1, "optional", "0.3", &
      "Packing fraction: total area of the disks of the species divided by the area of their region. It determines the " &
      //"radius.", &
      fraction, excludes="radius relative_to", otherwise="none; the radius is given in another " &
      //"way"), &
    variable_t("species", "radius_distribution", "text", 1, "optional", "'gaussian'", &
      "Distribution of the radii of a polydisperse species about their mean, truncated so that the largest radius is at most " &
      //"ten times the smallest. Needs polydispersity.", &
      choices="uniform gaussian " &
      //"lognormal", &
      otherwise="'uniform' if polydispersity is given; else all radii are equal"), &
    variable_t("species", "polydispersity", "real", 1, "required", "0.2", &
      "Polydispersity: standard deviation of the radii divided by their mean. At most 0.47 for the uniform, 0.27 for the " &
      //"Gaussian and 0.39 for the lognormal distribution. Not available for radii read from an initial-configuration file " &
      //"(file).", &
      spread_of_radii, goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "mass_scaling", "text", 1, "fallback", "'equal'", &
      "Dependence of the mass of a disk on its radius, in a polydisperse species.", choices="equal area", &
      goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "relative_to", "text", 1, "optional", "'bed'", &
      "Species relative to which mass and radius are given: with relative_to = 'bed', mass = 25 means 25 times the mass of a " &
      //"disk of the species 'bed'. If that species is polydisperse, radius is relative to its mean radius. Its radii must " &
      //"not be read from an initial-configuration file.", &
      otherwise="none; mass and radius are absolute values"), &
    variable_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", &
      "Rectangle (xlo, xhi, ylo, yhi) inside which the disks lie at the start. They may leave it later.", unit="length", &
      otherwise="the whole box"), &
    placement_rows, &
    variable_t("species", "velocities", "text", 1, "default", "'rest'", &
      "Method that generates the initial velocities. If velocities is not given, it follows from velocity, speed, temperature " &
      //"or file, whichever is given. In a periodic box without obstacles and gravity, generated velocities have zero total " &
      //"momentum.", &
      choices="rest equal_speed uniform maxwell explicit file"), &
    variable_t("species", "speed", "real", 1, "fallback", "1", &
      "Initial speed of the disks. With velocities = 'uniform', upper limit of |vx| and |vy|.", &
      not_negative, "length/time", goes_with="velocities equal_speed uniform"), &
    variable_t("species", "temperature", "real", 1, "fallback", "1", &
      "Temperature kT of the Maxwell distribution from which the initial velocities are drawn. The kinetic temperature of the " &
      //"drawn velocities fluctuates about this value, unless exact_temperature is given.", not_negative, "energy", &
      goes_with="velocities maxwell"), &
    variable_t("species", "exact_temperature", "real", 1, "optional", "1", &
      "Exact initial temperature kT of the species: velocities v relative to its centre of mass are scaled so that the sum of " &
      //"m v**2 over its N disks is 2N kT. Applies to all methods (velocities) except 'rest'. Needs at least two disks.", &
      not_negative, "energy", &
      otherwise="none; velocities are not scaled"), &
    variable_t("species", "velocity", "real", 0, "required", "1, 0", &
      "Initial velocities vx1, vy1, vx2, vy2, ... of the disks, or a single pair vx, vy for all disks.", unit="length/time", &
      goes_with="velocities explicit"), &
    variable_t("species", "angular_velocity", "real", 1, "optional", "2", &
      "Initial angular velocity of all disks of the species, positive counter-clockwise. With values other than 0 even smooth " &
      //"disks rotate.", unit="1/time", &
      otherwise="0, or from file with velocities = 'file'"), &
    variable_t("species", "rotational_temperature", "real", 1, "optional", "1", &
      "Initial temperature kT of the rotation: angular velocities are Gaussian with variance kT/I, where I is the moment of " &
      //"inertia.", not_negative, "energy", excludes="angular_velocity", &
      otherwise="none; all disks have the same angular_velocity")]

  type(variable_t), parameter :: contact_rows(*) = [ &
    variable_t("contact", "restitution", "real", 1, "default", "1", &
      "Coefficient of restitution of disk-disk collisions: 1 is elastic, 0 perfectly inelastic. Collisions reverse the " &
      //"relative velocity along the line of centres and multiply it by this coefficient.", unit_interval, may_change=in_motion), &
    variable_t("contact", "wall_restitution", "real", 1, "optional", "1", &
      "Coefficient of restitution of collisions with sides and obstacles, except thermal boundaries and boundaries with a " &
      //"coefficient of their own (restitution in &side, &obstacle or &wall).", &
      unit_interval, may_change=in_motion, &
      otherwise="contact.restitution"), &
    variable_t("contact", "restitution_law", "text", 1, "default", "'constant'", &
      "Dependence of all coefficients of restitution on the impact speed g, the normal component of the relative velocity.", &
      choices=restitution_laws, may_change=in_motion), &
    variable_t("contact", "reference_speed", "real", 1, "required", "1", &
      "Reference value g0 of the impact speed. Above g0 the coefficients of restitution have the values in the input; below " &
      //"g0 they are closer to 1, or equal to 1 with restitution_law = 'elastic_below'. With 'power' and 'viscoelastic', " &
      //"choose g0 above the impact speeds that occur; with 'elastic_below', choose g0 well below them.", &
      positive, "length/time", goes_with="restitution_law power viscoelastic elastic_below", may_change=in_motion), &
    variable_t("contact", "wall_rule", "text", 1, "default", "'velocity'", &
      "Collision rule of sides and obstacles, except thermal boundaries and boundaries with a rule of their own (rule in " &
      //"&side, &obstacle or &wall).", choices=wall_rules, may_change=in_motion), &
    variable_t("contact", "contact_time", "real", 1, "default", "0", &
      "Contact duration t_c of the TC model, which prevents inelastic collapse: a collision is elastic if one of its partners " &
      //"collided less than t_c ago. 0 switches the model off. Choose t_c far below the mean time between collisions and, for " &
      //"grains of diameter d resting under gravity g, below sqrt(d/g). The model does not prevent the collapse of resting " &
      //"grains with friction or with a tangential restitution between -1 and 1: these dissipate energy even in such elastic " &
      //"collisions. Not available with stop.at_rest.", &
      not_negative, "time", may_change=in_motion), &
    variable_t("contact", "tangential_restitution", "real", 1, "default", "-1", &
      "Coefficient of tangential restitution of disk-disk collisions: -1 for smooth surfaces, 0 if collisions stop the slip, " &
      //"1 if they reverse it. Above -1 the disks are rough and rotate. Values between -1 and 1 dissipate energy even in " &
      //"collisions that the TC model (contact_time) makes elastic. Grains resting in a dense bed then collapse or collide " &
      //"millions of times; use -1 or 1 for such grains.", &
      tangential, may_change=in_motion), &
    variable_t("contact", "friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of disk-disk collisions: upper limit of the ratio of tangential to normal impulse. Needs " &
      //"rough disks (tangential_restitution > -1). Friction dissipates energy even in collisions that the TC model " &
      //"(contact_time) makes elastic. Grains resting in a dense bed then collapse or collide millions of times; use " &
      //"tangential_restitution = 1 without friction for such grains.", &
      not_negative, may_change=in_motion, &
      otherwise="the tangential impulse has no limit"), &
    variable_t("contact", "inertia", "real", 1, "default", "0.5", &
      "Moment of inertia of a disk in units of mass times radius squared: 0.5 for a uniform disk, 1 for a ring. Matters only " &
      //"for rotating disks: with rough disks or boundaries, or with initial angular velocities.", moment, may_change=in_motion), &
    variable_t("contact", "wall_tangential_restitution", "real", 1, "optional", "0.5", &
      "Coefficient of tangential restitution of collisions with sides and obstacles, except those with a value of their own " &
      //"(tangential_restitution in &side, &obstacle or &wall): -1 for smooth surfaces, 0 if collisions stop the slip, 1 if " &
      //"they reverse it.", tangential, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.tangential_restitution"), &
    variable_t("contact", "wall_friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of collisions with sides and obstacles, except those with a value of their own (friction " &
      //"in &side, &obstacle or &wall). Needs rough boundaries (wall_tangential_restitution > -1).", &
      not_negative, goes_with="wall_rule normal", &
      may_change=in_motion, otherwise="contact.friction"), &
    variable_t("contact", "pair_restitution", "real", 0, "optional", "1, 0.9, 0.9, 0.8", &
      "Coefficients of restitution of each pair of species, given instead of contact.restitution: a symmetric n x n matrix " &
      //"for n species, listed as 1-1, 1-2, ..., 2-1, 2-2, ... in the order of the species in the input file.", unit_interval, &
      may_change=in_motion, otherwise="contact.restitution for all pairs")]

  type(variable_t), parameter :: disk_rows(*) = [species_rows, contact_rows]

end module disk_variables
