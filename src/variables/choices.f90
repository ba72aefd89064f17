!> Meanings of all keywords.
module choices
  use restitution_law, only: law_choices
  use wall_law, only: rule_choices
  use drives, only: drive_choices
  use motions, only: motion_choices
  use placements, only: placement_choices
  use sample_values, only: all_columns
  use variable_rows, only: choice_t
  implicit none
  private
  public :: meaning_of

  integer :: k                               !! index in the table

  type(choice_t), parameter :: list(*) = [ &
    choice_t("dynamics", "events", "Event-driven dynamics: the disks move exactly from one collision to the next, without a time " &
      //"step."), &
    choice_t("dynamics", "steps", "Time-stepped dynamics, for comparison: all disks move for a time step dt, and then " &
      //"overlapping pairs collide. Collisions take place up to one step too late, and short contacts can be missed. This choice " &
      //"is not available with box.shear_rate or a piston."), &
    choice_t("search", "cells", "The program searches the 3 x 3 cells around a disk, or neighbour lists if disks of very " &
      //"different sizes crowd the cells. The cost per event does not depend on the number N of disks."), &
    choice_t("search", "pairs", "The program searches all disks, at a cost of O(N) per event."), &
    choice_t("search", "rescan", "The program searches all pairs of disks again after each event, at a cost of O(N**2) " &
      //"per event."), &
    choice_t("queue", "calendar", "Events are stored in a calendar queue, with a cost per event that does not depend on N."), &
    choice_t("queue", "heap", "Events are stored in a heap with four children per node, with a cost of O(log N) per event."), &
    choice_t("boundary", "wall", "Disks bounce off the two sides that bound the box in this direction. The collision rule " &
      //"is set for all sides in " &
      //"&contact, and for single sides in &side."), &
    choice_t("boundary", "periodic", "Opposite sides are identified (periodic boundary conditions). Along this axis the box " &
      //"must be longer than two disk diameters, and box.gravity must be 0."), &
    choice_t("name", "left", "Side at the smallest x."), &
    choice_t("name", "right", "Side at the largest x."), &
    choice_t("name", "bottom", "Side at the smallest y."), &
    choice_t("name", "top", "Side at the largest y."), &
    motion_choices, &
    choice_t("side", "outside", "Disks bounce off the outside of the circle."), &
    choice_t("side", "inside", "The circle is a container that encloses all disks. A container has no periodic images."), &
    rule_choices, &
    choice_t("radius_distribution", "uniform", "The radii are uniformly distributed about the mean radius."), &
    choice_t("radius_distribution", "gaussian", "The radii have a Gaussian distribution about the mean radius."), &
    choice_t("radius_distribution", "lognormal", "The radii have a lognormal distribution: the logarithm of the radius is " &
      //"Gaussian."), &
    choice_t("mass_scaling", "equal", "All disks have the same mass."), &
    choice_t("mass_scaling", "area", "The mass of a disk is proportional to its area. The variable mass is the mass of a disk " &
      //"with the mean radius."), &
    placement_choices, &
    choice_t("velocities", "rest", "All disks start at rest."), &
    choice_t("velocities", "equal_speed", "All disks have the same speed, in random directions."), &
    choice_t("velocities", "uniform", "Velocity components are uniformly distributed between -speed and speed."), &
    choice_t("velocities", "maxwell", "Velocities are drawn from the Maxwell distribution with kT = temperature."), &
    choice_t("velocities", "explicit", "The velocities are listed in the variable velocity."), &
    choice_t("velocities", "file", "The velocities are read from the initial-configuration file (file), and also the angular " &
      //"velocities if the file contains them."), &
    law_choices, &
    drive_choices, &
    (choice_t("frame_columns", all_columns(k)%name, all_columns(k)%meaning), k=1, size(all_columns)), &
    choice_t("precision", "double", "Numbers have 64 bits."), &
    choice_t("precision", "single", "Numbers have 32 bits, about seven significant digits. The file is half as large as with " &
      //"'double'.")]

contains

  !> Meaning of a keyword; empty if the keyword does not exist.
  pure function meaning_of(name, word) result(meaning)
    character(len=*), intent(in) :: name     !! name of the variable
    character(len=*), intent(in) :: word
    character(len=:), allocatable :: meaning
    integer :: c

    meaning = ""
    do c = 1, size(list)
      if (list(c)%name == name .and. list(c)%word == word) meaning = trim(list(c)%meaning)
    end do
  end function meaning_of

end module choices
