!> Descriptions of the choices of text variables. Variables with the same name in several groups have the same choices.
module choices
  implicit none
  private
  public :: meaning_of

  type :: choice_t
    character(len=19) :: name                !! name of the variable
    character(len=17) :: word                !! the choice
    character(len=300) :: meaning            !! description in one or more full sentences or phrases
  end type choice_t

  type(choice_t), parameter :: list(*) = [ &
    choice_t("dynamics", "events", "Event-driven: exact motion from one collision to the next, without a time step."), &
    choice_t("dynamics", "steps", "Time-stepped: all disks move for a fixed time step dt, after which overlapping pairs " &
      //"collide. Collisions are up to one step late, and short contacts can be missed. This method exists for comparison, and " &
      //"cannot be combined with box.shear_rate or a piston."), &
    choice_t("search", "cells", "Search in the nine cells around a disk, or in neighbour lists if the sizes of the disks " &
      //"differ much. The cost per event does not depend on the number N of disks."), &
    choice_t("search", "pairs", "Search among all disks. The cost per event is O(N)."), &
    choice_t("search", "rescan", "Search among all disks, with new predictions for all pairs after each event. The cost per " &
      //"event is O(N**2)."), &
    choice_t("queue", "calendar", "Calendar queue, whose cost per event does not depend on N."), &
    choice_t("queue", "heap", "Heap with four children per node, whose cost per event is O(log N)."), &
    choice_t("boundary", "wall", "Disks bounce off both sides. The collision rule of all sides is set in &contact, and the " &
      //"rule of a single side in a group &side."), &
    choice_t("boundary", "periodic", "Opposite sides are identified (periodic boundary condition). Along this axis the box " &
      //"must be longer than two diameters of a disk, and box.gravity must be 0."), &
    choice_t("name", "left", "Side at the smallest x."), &
    choice_t("name", "right", "Side at the largest x."), &
    choice_t("name", "bottom", "Side at the smallest y."), &
    choice_t("name", "top", "Side at the largest y."), &
    choice_t("motion", "still", "The side stands still at its position."), &
    choice_t("motion", "sine", "The position of the side is a sinusoidal oscillation about the mean position."), &
    choice_t("motion", "parabolic", "The side oscillates about its mean position with piecewise constant acceleration, " &
      //"close to a sine."), &
    choice_t("motion", "sawtooth", "The side does not change its position but strikes each disk with a constant velocity: the " &
      //"limit of a fast oscillation with small amplitude."), &
    choice_t("motion", "constant_velocity", "The side moves with a constant velocity from start_time to end_time, and stands " &
      //"still before and after this time, for compressions or expansions."), &
    choice_t("motion", "piston", "The side is a piston with a mass, accelerated by collisions and by a constant force, which " &
      //"corresponds to a constant pressure. A piston cannot be combined with run.dynamics = 'steps'."), &
    choice_t("side", "outside", "Disks bounce off the outside of the circle."), &
    choice_t("side", "inside", "The circle is a container: all disks stay inside it. The circle has no periodic images."), &
    choice_t("rule", "velocity", "Both components of the velocity are multiplied by the coefficient of restitution; the " &
      //"normal component is reversed. A single disk without gravity follows the same path as in elastic collisions, but " &
      //"becomes slower."), &
    choice_t("rule", "normal", "The normal component of the velocity is reversed and multiplied by the coefficient of " &
      //"restitution. The tangential component does not change (smooth wall), unless tangential_restitution makes the wall " &
      //"rough."), &
    choice_t("wall_rule", "velocity", "Both components of the velocity are multiplied by the coefficient of restitution; the " &
      //"normal component is reversed. A single disk without gravity follows the same path as in elastic collisions, but " &
      //"becomes slower."), &
    choice_t("wall_rule", "normal", "The normal component of the velocity is reversed and multiplied by the coefficient of " &
      //"restitution. The tangential component does not change (smooth wall), unless tangential_restitution makes the wall " &
      //"rough."), &
    choice_t("radius_distribution", "uniform", "Uniform distribution about the mean radius."), &
    choice_t("radius_distribution", "gaussian", "Gaussian distribution about the mean radius."), &
    choice_t("radius_distribution", "lognormal", "Lognormal distribution, whose logarithm is Gaussian."), &
    choice_t("mass_scaling", "equal", "All disks have the same mass."), &
    choice_t("mass_scaling", "area", "The mass of a disk is proportional to its area; mass is the mass of a disk that has the " &
      //"mean radius."), &
    choice_t("placement", "random", "Random sequential insertion: uniformly distributed positions without overlaps, up to a " &
      //"packing fraction of about 0.54."), &
    choice_t("placement", "grid", "Rectangular grid that fills the region. The variable grid sets the numbers of columns and " &
      //"rows."), &
    choice_t("placement", "lattice", "Triangular lattice that fills the region, up to the closest packing 0.9069."), &
    choice_t("placement", "dense", "Lubachevsky-Stillinger compression: random disks grow while they move and collide, up " &
      //"to a packing fraction of about 0.84. The result is not in equilibrium at high density."), &
    choice_t("placement", "explicit", "Positions that the variable position lists."), &
    choice_t("placement", "file", "Positions in the starting file (file)."), &
    choice_t("placement", "grown", "Lubachevsky-Stillinger compression that starts at the positions in the starting file " &
      //"(file): disks grow from smaller radii to the radii in this input."), &
    choice_t("placement", "relaxed", "Dense start in equilibrium: a lattice or a packing as with 'dense', equilibrated by " &
      //"event-chain Monte Carlo, with swaps of disks whose radii differ. All species of the run must use this " &
      //"placement, in a box without obstacles, moving sides and gravity. The option --check omits this placement."), &
    choice_t("velocities", "rest", "All disks start at rest."), &
    choice_t("velocities", "equal_speed", "All disks have the same speed, in random directions."), &
    choice_t("velocities", "uniform", "Both components are uniformly distributed between -speed and speed."), &
    choice_t("velocities", "maxwell", "Velocities are drawn from the Maxwell distribution with kT = temperature."), &
    choice_t("velocities", "explicit", "Velocities that the variable velocity lists."), &
    choice_t("velocities", "file", "Velocities in the starting file (file), and angular velocities if the file contains " &
      //"angular velocities."), &
    choice_t("restitution_law", "constant", "Coefficients of restitution do not depend on the impact speed."), &
    choice_t("restitution_law", "power", "Below reference_speed, 1 - e is proportional to g**(1/5), where e is the " &
      //"coefficient of restitution and g is the impact speed."), &
    choice_t("restitution_law", "viscoelastic", "Viscoelastic bodies: below reference_speed, the coefficient of restitution " &
      //"is e = 1 - y + 3/5 y**2, where y is proportional to g**(1/5) and g is the impact speed. The coefficients " &
      //"of restitution in the input must be at least 7/12."), &
    choice_t("kind", "none", "No driving."), &
    choice_t("kind", "noise", "White-noise driving: a kick adds a Gaussian random number to each velocity component, which " &
      //"heats the disks."), &
    choice_t("kind", "andersen", "Andersen thermostat: a kick gives each disk, with the probability fraction, a new " &
      //"velocity from the Maxwell distribution."), &
    choice_t("kind", "brownian", "Event-driven Brownian dynamics: a kick gives all disks new velocities from the Maxwell " &
      //"distribution."), &
    choice_t("kind", "active", "Active Brownian disks: as 'brownian', with an additional velocity (self_propulsion_speed) " &
      //"along the orientation of each disk, which diffuses."), &
    choice_t("kind", "recycle", "Recycling, as in a hopper that is refilled: each disk in from_region moves to a random free " &
      //"position in to_region, with a new velocity. Displacements of disks are not defined in such a run."), &
    choice_t("frame_columns", "position", "Positions of the disks."), &
    choice_t("frame_columns", "velocity", "Velocities of the disks."), &
    choice_t("frame_columns", "event_count", "Number of events of each disk since the start."), &
    choice_t("frame_columns", "image", "Number of periods by which each disk has moved, if a boundary is periodic."), &
    choice_t("frame_columns", "angular_velocity", "Angular velocities, if disks rotate."), &
    choice_t("frame_columns", "orientation", "Orientations, if disks rotate or are active."), &
    choice_t("frame_columns", "recycled", "Number of times that each disk has been recycled, if drive.kind is 'recycle'."), &
    choice_t("precision", "double", "64 bits per number."), &
    choice_t("precision", "single", "32 bits per number: half the size of 'double', about seven significant digits.")]

contains

  !> Description of a choice; empty if the table does not contain the choice.
  pure function meaning_of(name, word) result(meaning)
    character(len=*), intent(in) :: name     !! name of the variable
    character(len=*), intent(in) :: word
    character(len=:), allocatable :: meaning
    integer :: k

    meaning = ""
    do k = 1, size(list)
      if (list(k)%name == name .and. list(k)%word == word) meaning = trim(list(k)%meaning)
    end do
  end function meaning_of

end module choices
