!> Table rows that describe the variables of the groups `&box`, `&side`, `&obstacle` and `&wall`.
module boundary_variables
  use collisions, only: wall_rules
  use side_motion, only: motions
  use variable_rows, only: first_angle, in_motion, last_angle, not_negative, positive, tangential, unit_interval, variable_t, &
    wall_groups
  implicit none
  private
  public :: boundary_rows

  type(variable_t), parameter :: box_rows(*) = [ &
    variable_t("box", "lower", "real", 2, "default", "0, 0", &
      "Lower left corner of the box: its x and its y coordinate.", unit="length"), &
    variable_t("box", "upper", "real", 2, "default", "1, 1", &
      "Upper right corner of the box: its x and its y coordinate. Each coordinate must be larger than the same coordinate of " &
      //"box.lower.", unit="length"), &
    variable_t("box", "boundary", "text", 2, "default", "'wall', 'wall'", &
      "Kinds of boundaries: first the kind of the left and the right side, then the kind of the bottom and the top side.", &
      choices="wall periodic"), &
    variable_t("box", "gravity", "real", 2, "default", "0, 0", &
      "Uniform acceleration of all disks: its x and its y component. The component along a periodic axis must be 0. Gravity " &
      //"cannot be combined with box.shear_rate or output.helfand.", unit="length/time**2", may_change=in_motion), &
    variable_t("box", "shear_rate", "real", 1, "default", "0", &
      "Shear rate: the gradient along y of the flow velocity along x, imposed by Lees-Edwards boundary conditions. A shear " &
      //"rate other than 0 needs box.boundary = 'periodic', 'periodic'. Shear cannot be combined with box.gravity, &obstacle, " &
      //"&wall, run.dynamics = 'steps', output.helfand, stop.energy_fraction or stop.at_rest.", unit="1/time")]

  type(variable_t), parameter :: side_rows(*) = [ &
    variable_t("side", "name", "text", 1, "example", "'bottom'", &
      "Name of the side of the box that the group describes. The side must be a wall (box.boundary). At most one group may " &
      //"describe each side.", choices="left right bottom top"), &
    variable_t("side", "motion", "text", 1, "default", "'still'", &
      "Motion of the side along its normal. The work of a moving side on the disks is an observable. In a running simulation " &
      //"a side begins a new motion where it is. Variables of the former motion that the new one does not have are dropped, " &
      //"unless the same change sets them.", choices=motions, may_change=in_motion), &
    variable_t("side", "amplitude", "real", 1, "required", "0.05", &
      "Amplitude of the oscillation: the largest displacement of the side from its mean position, which box.lower or " &
      //"box.upper defines.", &
      positive, "length", goes_with="motion sine parabolic", may_change=in_motion), &
    variable_t("side", "period", "real", 1, "required", "1", &
      "Period of the oscillation.", positive, "time", goes_with="motion sine parabolic", may_change=in_motion), &
    variable_t("side", "phase", "real", 1, "fallback", "0", &
      "Phase of the oscillation at t = 0, in units of the period. With phase = 0 the side starts at its mean position and " &
      //"moves inwards.", unit_interval, goes_with="motion sine parabolic", may_change=in_motion), &
    variable_t("side", "position", "real", 1, "optional", "1", &
      "Coordinate of the side at the start of its motion: x of the left or right side, y of the bottom or top side.", &
      unit="length", goes_with="motion still constant_velocity piston", &
      otherwise="the coordinate in box.lower or box.upper"), &
    variable_t("side", "velocity", "real", 1, "required", "1", &
      "Velocity of the side, positive inwards. With motion = 'sawtooth' the side strikes the disks with this velocity, which " &
      //"must be > 0. With motion = 'constant_velocity' a negative velocity moves the side outwards.", unit="length/time", &
      goes_with="motion sawtooth constant_velocity", may_change=in_motion), &
    variable_t("side", "start_time", "real", 1, "fallback", "0", &
      "Time at which the side starts to move. Before this time the side stands still at its position.", not_negative, "time", &
      goes_with="motion constant_velocity", may_change=in_motion), &
    variable_t("side", "end_time", "real", 1, "required", "1", &
      "Time at which the side stops, later than start_time. After this time the side does not move.", positive, "time", &
      goes_with="motion constant_velocity", may_change=in_motion), &
    variable_t("side", "mass", "real", 1, "required", "10", &
      "Mass of the piston. Gravity does not act on the piston.", &
      positive, "mass", goes_with="motion piston", may_change=in_motion), &
    variable_t("side", "force", "real", 1, "required", "1", &
      "Constant force on the piston, directed inwards. The force divided by the length of the side is the external pressure.", &
      not_negative, "energy/length", goes_with="motion piston", may_change=in_motion)]

  type(variable_t), parameter :: obstacle_rows(*) = [ &
    variable_t("obstacle", "name", "text", 1, "optional", "'scatterer'", &
      "Name of the obstacle in messages, in the output file and in --set obstacle.NAME.VARIABLE=VALUE: up to 40 letters, " &
      //"digits, _ and -, beginning with a letter. No other obstacle or wall may have the same name.", &
      otherwise="obstacle1, obstacle2, ... in the order of the file"), &
    variable_t("obstacle", "centre", "real", 2, "example", "0.5, 0.5", &
      "Centre of the circular obstacle: its x and its y coordinate.", unit="length", &
      otherwise="none; needed, unless file is given"), &
    variable_t("obstacle", "radius", "real", 1, "example", "0.2", &
      "Radius of the circular obstacle.", positive, "length", otherwise="none; needed, unless file is given"), &
    variable_t("obstacle", "side", "text", 1, "default", "'outside'", &
      "Side of the circle on which the disks are. The variable cannot be given for an arc (from_angle, to_angle), because " &
      //"disks bounce off both faces of an arc.", choices="outside inside"), &
    variable_t("obstacle", "from_angle", "real", 1, "optional", "0", &
      "Angle at which an arc begins, counter-clockwise from the +x direction. With from_angle and to_angle the obstacle is an " &
      //"arc of the circle instead of the whole circle. Disks bounce off both faces of the arc and off its two end points. " &
      //"The variables from_angle and to_angle must be given together, and cannot be combined with side.", first_angle, &
      "degrees", excludes="side", otherwise="none; the obstacle is a whole circle"), &
    variable_t("obstacle", "to_angle", "real", 1, "optional", "180", &
      "Angle at which an arc ends. The arc extends counter-clockwise from from_angle to to_angle. The angle to_angle is " &
      //"larger than from_angle by up to 360 degrees. Disks can pass through the gap between the two ends of the arc " &
      //"if the gap is wide enough.", last_angle, "degrees", excludes="side", otherwise="none; the obstacle is a whole circle"), &
    variable_t("obstacle", "file", "text", 1, "optional", "'scatterers.txt'", &
      "File that describes many circles and replaces centre and radius. A text file contains a line of column names (x y " &
      //"radius) and one line for each circle. An HDF5 file (.h5) contains the datasets centre and radius. A file may " &
      //"describe up to 1000000 circles. All circles of the file are one obstacle with one collision rule and one set of " &
      //"observables. If from_angle and to_angle are given, the file describes arcs between these two angles. The path is " &
      //"relative to the folder in which the program is started.", excludes="centre radius", &
      otherwise="none; the group describes one circle")]

  type(variable_t), parameter :: wall_rows(*) = [ &
    variable_t("wall", "name", "text", 1, "optional", "'ramp'", &
      "Name of the wall in messages, in the output file and in --set wall.NAME.VARIABLE=VALUE: up to 40 letters, digits, _ " &
      //"and -, beginning with a letter. No other obstacle or wall may have the same name.", &
      otherwise="wall1, wall2, ... in the order of the file"), &
    variable_t("wall", "from", "real", 2, "example", "0.2, 0.3", &
      "First end point of the straight wall: its x and its y coordinate, inside the box. Disks bounce off both faces of the " &
      //"wall and off its end points.", unit="length", otherwise="none; needed, unless points or file is given"), &
    variable_t("wall", "to", "real", 2, "example", "0.8, 0.1", &
      "Second end point of the straight wall: its x and its y coordinate, inside the box.", unit="length", &
      otherwise="none; needed, unless points or file is given"), &
    variable_t("wall", "points", "real", 0, "optional", "0, 0, 0.5, 0.2, 1, 0", &
      "Points x1, y1, x2, y2, ... of a polyline, which replaces from and to. The polyline has at least two points, and is " &
      //"closed if the last point equals the first point.", &
      unit="length", excludes="from to", otherwise="none; the wall is one straight " &
      //"segment"), &
    variable_t("wall", "file", "text", 1, "optional", "'walls.txt'", &
      "File that describes many straight walls and replaces from and to. A text file contains a line of column names (x1 y1 " &
      //"x2 y2) and one line for each wall. An HDF5 file (.h5) contains the datasets from and to. A file may describe up to " &
      //"1000000 walls. All walls of the file are one obstacle with one collision rule and one set of observables. The path " &
      //"is relative to the folder in which the program is started.", excludes="from to points", &
      otherwise="none; the group describes one wall or polyline")]

  !> Variables of the contact law of a boundary, which belong to each of the groups `&side`, `&obstacle` and `&wall`.
  type(variable_t), parameter :: law_rows(*) = [ &
    variable_t("", "restitution", "real", 1, "optional", "0.9", &
      "Coefficient of restitution of collisions of disks with this boundary: 1 is elastic, 0 perfectly inelastic. The rule " &
      //"determines to which components of the velocity the coefficient applies. A thermal boundary (temperature) has no " &
      //"coefficient of restitution.", unit_interval, &
      may_change=in_motion, otherwise="contact.wall_restitution"), &
    variable_t("", "rule", "text", 1, "optional", "'normal'", &
      "Collision rule of this boundary. A thermal boundary (temperature) has no collision rule.", choices=wall_rules, &
      may_change=in_motion, otherwise="contact.wall_rule"), &
    variable_t("", "tangential_restitution", "real", 1, "optional", "0.5", &
      "Coefficient of tangential restitution of this boundary: -1 for smooth surfaces, 0 if a collision stops the slip of the " &
      //"surfaces, 1 if a collision reverses the slip. With a value above -1 the boundary is rough, and disks " &
      //"rotate.", tangential, goes_with="rule normal", &
      may_change=in_motion, otherwise="contact.wall_tangential_restitution"), &
    variable_t("", "friction", "real", 1, "optional", "0.3", &
      "Coulomb friction coefficient of this boundary: upper limit of the ratio of the tangential impulse to the normal " &
      //"impulse. Friction needs a rough boundary (tangential_restitution > -1).", not_negative, goes_with="rule normal", &
      may_change=in_motion, otherwise="contact.wall_friction"), &
    variable_t("", "temperature", "real", 1, "optional", "1", &
      "Temperature kT of a thermal boundary: after a collision a disk has a random velocity, as if the disk came from a gas " &
      //"at this temperature. A thermal boundary can slide (surface_velocity), but has no restitution and no motion.", &
      positive, "energy", excludes="restitution rule tangential_restitution friction motion", may_change=in_motion, &
      otherwise="none; the boundary is not thermal"), &
    variable_t("", "surface_velocity", "real", 1, "fallback", "0", &
      "Tangential velocity of the surface of this boundary, as of a conveyor belt. The boundary itself does not move. A " &
      //"positive velocity is directed along +x on the bottom and top side, along +y on the left and right side, from the " &
      //"first to the second point of a wall, and counter-clockwise on a circle or an arc. A value other than 0 needs a thermal " &
      //"boundary (temperature) or a rough boundary (tangential_restitution > -1).", unit="length/time", may_change=in_motion)]

  integer :: g, r
  type(variable_t), parameter :: own_law_rows(*) = [((variable_t(wall_groups(g), law_rows(r)%name, law_rows(r)%kind, &
    law_rows(r)%size, law_rows(r)%status, law_rows(r)%value, law_rows(r)%help, law_rows(r)%range, law_rows(r)%unit, &
    law_rows(r)%choices, law_rows(r)%goes_with, law_rows(r)%excludes, law_rows(r)%may_change, law_rows(r)%otherwise), &
    r=1, size(law_rows)), g=1, size(wall_groups))]

  type(variable_t), parameter :: boundary_rows(*) = [box_rows, side_rows, obstacle_rows, wall_rows, own_law_rows]

end module boundary_variables
