!> Variables of the groups `&box`, `&side`, `&obstacle` and `&wall`.
module boundary_variables
  use motions, only: motion_rows
  use variable_rows, only: first_angle, in_motion, last_angle, positive, variable_t
  use wall_law, only: wall_law_rows
  implicit none
  private
  public :: boundary_rows

  type(variable_t), parameter :: box_rows(*) = [ &
    variable_t("box", "lower", "real", 2, "default", "0, 0", &
      "Lower left corner (x, y) of the box.", unit="length"), &
    variable_t("box", "upper", "real", 2, "default", "1, 1", &
      "Upper right corner (x, y) of the box. The coordinates must exceed those of box.lower.", unit="length"), &
    variable_t("box", "boundary", "text", 2, "default", "'wall', 'wall'", &
      "Kind of boundary along x (left and right side), then along y (bottom and top side).", &
      choices="wall periodic"), &
    variable_t("box", "gravity", "real", 2, "default", "0, 0", &
      "Uniform acceleration (x, y) of all disks. The component along a periodic axis must be 0. Gravity is not available with " &
      //"box.shear_rate or output.helfand.", unit="length/time**2", may_change=in_motion), &
    variable_t("box", "shear_rate", "real", 1, "default", "0", &
      "Shear rate: gradient along y of the flow velocity along x, imposed by Lees-Edwards boundary conditions. Shear needs " &
      //"box.boundary = 'periodic', 'periodic', and is not available with box.gravity, &obstacle, &wall, run.dynamics = 'steps', " &
      //"output.helfand, stop.energy_fraction or stop.at_rest.", unit="1/time")]

  type(variable_t), parameter :: side_rows(*) = [ &
    variable_t("side", "name", "text", 1, "example", "'bottom'", &
      "Side of the box to which the group applies. The side must be a wall (box.boundary), and there must be only one group for " &
      //"it.", &
      choices="left right bottom top"), &
    variable_t("side", "open", "logical", 1, "default", ".false.", &
      "Open side: a disk leaves the box when its centre reaches the side. A disk that has left waits outside until a source " &
      //"(&source) lets it in again. While the initial state is generated, the side counts as a wall. The collision rule of the " &
      //"side acts only while the side is closed. An open side cannot move. Sides can be opened or closed in a running " &
      //"simulation if the input contains a source, waiting disks, a &change of open, or a side with this variable. A side " &
      //"cannot be closed while a disk overlaps it.", may_change=in_motion), &
    motion_rows]

  type(variable_t), parameter :: obstacle_rows(*) = [ &
    variable_t("obstacle", "name", "text", 1, "optional", "'scatterer'", &
      "Name of the obstacle in messages, in the output file and in --set obstacle.NAME.VARIABLE=VALUE. A name has up to 40 " &
      //"letters, digits, _ and -, and begins with a letter. The names of all obstacles and walls must differ.", &
      otherwise="obstacle1, obstacle2, ... in the order of the file"), &
    variable_t("obstacle", "centre", "real", 2, "example", "0.5, 0.5", &
      "Centre (x, y) of the circle.", unit="length", &
      otherwise="none; needed, unless file is given"), &
    variable_t("obstacle", "radius", "real", 1, "example", "0.2", &
      "Radius of the circle.", positive, "length", otherwise="none; needed, unless file is given"), &
    variable_t("obstacle", "side", "text", 1, "default", "'outside'", &
      "Side of the circle on which the disks are. This variable is not available for arcs (from_angle, to_angle), because disks " &
      //"bounce off both faces of an arc.", choices="outside inside"), &
    variable_t("obstacle", "from_angle", "real", 1, "optional", "0", &
      "Angle at which an arc begins, measured counter-clockwise from the +x direction. With from_angle and to_angle, given " &
      //"together, the obstacle is an arc instead of a whole circle. Disks bounce off both faces and both ends of the arc.", &
      first_angle, &
      "degrees", excludes="side", otherwise="none; the obstacle is a whole circle"), &
    variable_t("obstacle", "to_angle", "real", 1, "optional", "180", &
      "Angle at which the arc ends, at most 360 degrees larger than from_angle. The arc runs counter-clockwise from from_angle " &
      //"to to_angle. Disks pass through the gap between the ends of the arc if the gap is wide enough.", last_angle, "degrees", &
      excludes="side", otherwise="none; the obstacle is a whole circle"), &
    variable_t("obstacle", "file", "text", 1, "optional", "'scatterers.txt'", &
      "Text file (column names x y radius, then one line per circle) or HDF5 file (.h5, with the datasets centre and radius) " &
      //"with many circles, given instead of the variables centre and radius. Up to 1000000 circles form " &
      //"a single obstacle, with one collision rule and one set of observables. With from_angle and to_angle, each circle is " &
      //"replaced by an arc between these two angles. The path is relative to the folder in which the program is started.", &
      excludes="centre radius", &
      otherwise="none; the group describes one circle")]

  type(variable_t), parameter :: wall_rows(*) = [ &
    variable_t("wall", "name", "text", 1, "optional", "'ramp'", &
      "Name of the wall in messages, in the output file and in --set wall.NAME.VARIABLE=VALUE. A name has up to 40 letters, " &
      //"digits, _ and -, and begins with a letter. The names of all obstacles and walls must differ.", &
      otherwise="wall1, wall2, ... in the order of the file"), &
    variable_t("wall", "from", "real", 2, "example", "0.2, 0.3", &
      "First end point (x, y) of the straight wall, inside the box. Disks bounce off both faces and both ends of the wall.", &
      unit="length", otherwise="none; needed, unless points or file is given"), &
    variable_t("wall", "to", "real", 2, "example", "0.8, 0.1", &
      "Second end point (x, y) of the straight wall, inside the box.", unit="length", &
      otherwise="none; needed, unless points or file is given"), &
    variable_t("wall", "points", "real", 0, "optional", "0, 0, 0.5, 0.2, 1, 0", &
      "Points x1, y1, x2, y2, ... of a polyline, given instead of from and to: at least two points. The polyline is closed if " &
      //"its last point equals the first.", &
      unit="length", excludes="from to", otherwise="none; the wall is one straight " &
      //"segment"), &
    variable_t("wall", "file", "text", 1, "optional", "'walls.txt'", &
      "Text file (column names x1 y1 x2 y2, then one line per wall) or HDF5 file (.h5, with the datasets from and to) with " &
      //"many straight walls, given instead of the variables from and to. Up to 1000000 walls form a single " &
      //"obstacle, with one collision rule and one set of observables. The path is relative to the folder in which the program " &
      //"is started.", excludes="from to points", &
      otherwise="none; the group describes one wall or polyline")]

  type(variable_t), parameter :: boundary_rows(*) = [box_rows, side_rows, obstacle_rows, wall_rows, wall_law_rows]

end module boundary_variables
