!> Variables of the groups `&species` and `&contact`.
module disk_variables
  use contact_law, only: contact_rows
  use placements, only: placement_rows
  use variable_rows, only: count_of_disks, fraction, not_negative, positive, spread_of_radii, variable_t
  implicit none
  private
  public :: disk_rows

  type(variable_t), parameter :: species_rows(*) = [ &
    variable_t("species", "name", "text", 1, "optional", "'gas'", &
      "Name of the species in messages, in the output file, in relative_to and drive.species, and in --set " &
      //"species.NAME.VARIABLE=VALUE. A name has up to 40 letters, digits, _ and -, and begins with a letter.", &
      otherwise="species1, species2, ... in the order of the file"), &
    variable_t("species", "count", "integer", 1, "example", "100", &
      "Number of disks of the species.", count_of_disks, &
      otherwise="follows from grid, position or file; needed without these"), &
    variable_t("species", "waiting", "integer", 1, "default", "0", &
      "Number of disks waiting outside the box at the start, which are the last disks of the species. Only the other disks have " &
      //"initial positions and velocities. Waiting disks enter through a source (&source). The packing fraction includes the " &
      //"waiting disks. With an initial-configuration file (file), mass and radius must also be given.", not_negative), &
    variable_t("species", "mass", "real", 1, "default", "1", &
      "Mass of each disk. With relative_to, the value is a multiple of the mass of the other species. With mass_scaling = " &
      //"'area', the value is the mass of a disk with the mean radius. If mass is not given, masses are read from the " &
      //"initial-configuration file (file), provided that the file contains masses.", &
      positive, "mass"), &
    variable_t("species", "radius", "real", 1, "example", "0.01", &
      "Radius of each disk, or mean radius of a polydisperse species. With relative_to, the value is a multiple of the radius of " &
      //"the other species (default 1). Unless radii are read from the initial-configuration file (file), the input must contain " &
      //"radius, packing_fraction or relative_to.", &
      positive, "length", otherwise="follows from packing_fraction, relative_to or file; needed without " &
      //"these"), &
    variable_t("species", "packing_fraction", "real", 1, "optional", "0.3", &
      "Packing fraction: total area of the disks of the species divided by the area of their region. The radius is calculated " &
      //"from the packing fraction.", &
      fraction, excludes="radius relative_to", otherwise="none; the radius is given in another " &
      //"way"), &
    variable_t("species", "radius_distribution", "text", 1, "optional", "'gaussian'", &
      "Distribution of the radii of a polydisperse species about their mean, truncated so that the largest radius is at most ten " &
      //"times the smallest. A distribution can be given only together with polydispersity.", &
      choices="uniform gaussian " &
      //"lognormal", &
      otherwise="'uniform' if polydispersity is given; else all radii are equal"), &
    variable_t("species", "polydispersity", "real", 1, "required", "0.2", &
      "Polydispersity: standard deviation of the radii divided by their mean. The largest value is 0.47 for the uniform, 0.27 " &
      //"for the Gaussian and 0.39 for the lognormal distribution. Polydispersity is not available for radii read from an " &
      //"initial-configuration file (file).", &
      spread_of_radii, goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "mass_scaling", "text", 1, "fallback", "'equal'", &
      "Dependence of the mass of a disk on its radius, in a polydisperse species.", choices="equal area", &
      goes_with="radius_distribution uniform gaussian lognormal"), &
    variable_t("species", "relative_to", "text", 1, "optional", "'bed'", &
      "Species relative to which mass and radius are given: with relative_to = 'bed', mass = 25 means 25 times the mass of a " &
      //"disk of the species 'bed'. If the species 'bed' is polydisperse, radius is relative to its mean radius. The radii of " &
      //"the species 'bed' must not be read from an initial-configuration file.", &
      otherwise="none; mass and radius are absolute values"), &
    variable_t("species", "region", "real", 4, "optional", "0, 1, 0, 0.5", &
      "Rectangle (xlo, xhi, ylo, yhi) inside which the disks lie at the start. During the run the disks may leave this region.", &
      unit="length", &
      otherwise="the whole box"), &
    placement_rows, &
    variable_t("species", "velocities", "text", 1, "default", "'rest'", &
      "Method that generates the initial velocities. If velocities is not given, it follows from velocity, speed, temperature " &
      //"or file, whichever is given. In a periodic box without obstacles and gravity, generated velocities have zero total " &
      //"momentum.", &
      choices="rest equal_speed uniform maxwell explicit file"), &
    variable_t("species", "speed", "real", 1, "fallback", "1", &
      "Initial speed of the disks. With velocities = 'uniform', the value is the upper limit of |vx| and |vy|.", &
      not_negative, "length/time", goes_with="velocities equal_speed uniform"), &
    variable_t("species", "temperature", "real", 1, "fallback", "1", &
      "Temperature kT of the Maxwell distribution from which the initial velocities are drawn. The kinetic temperature of the " &
      //"drawn velocities fluctuates about this value, unless exact_temperature is given.", not_negative, "energy", &
      goes_with="velocities maxwell"), &
    variable_t("species", "exact_temperature", "real", 1, "optional", "1", &
      "Exact initial temperature kT of the species. The velocities v relative to the centre of mass of the species are scaled so " &
      //"that the sum of m v**2 over its N disks is 2N kT. The scaling applies to all values of velocities except 'rest', " &
      //"and needs at least two disks.", &
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

  type(variable_t), parameter :: disk_rows(*) = [species_rows, contact_rows]

end module disk_variables
