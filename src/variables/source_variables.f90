!> Variables of the group `&source`.
module source_variables
  use variable_rows, only: in_motion, not_negative, positive, variable_t
  implicit none
  private
  public :: source_rows

  type(variable_t), parameter :: source_rows(*) = [ &
    variable_t("source", "name", "text", 1, "optional", "'pump'", &
      "Name of the source in messages, in the output file and in --set source.NAME.VARIABLE=VALUE. A name has up to 40 letters, " &
      //"digits, _ and -, and begins with a letter.", otherwise="source1, source2, ... in the order of the file"), &
    variable_t("source", "species", "text", 1, "optional", "'gas'", &
      "Species whose waiting disks enter the box. Disks wait from the start (species.waiting) or after leaving the box " &
      //"through an open side (side.open).", otherwise="the only species; needed with several species"), &
    variable_t("source", "region", "real", 4, "optional", "0, 1, 0.9, 1", &
      "Region (xlo, xhi, ylo, yhi) in which disks enter, at random free positions. Entering disks lie completely inside the " &
      //"region. Only along a periodic axis that the region spans may entering disks overlap its edges. Open sides count as " &
      //"walls. If none of 100 random positions is free for a disk, the source tries the next disk.", &
      unit="length", otherwise="the whole box"), &
    variable_t("source", "interval", "real", 1, "example", "0.1", &
      "Time between two actions of the source. At all multiples of the interval from start_time to end_time, the waiting disks " &
      //"with the lowest ids enter. Several sources act in the order of the file. Sources are not available with drive.kind = " &
      //"'recycle'.", positive, "time", may_change=in_motion), &
    variable_t("source", "count", "integer", 1, "default", "1", &
      "Largest number of disks that enter at one time. With count = 0 no disk enters.", not_negative, may_change=in_motion), &
    variable_t("source", "velocity", "real", 2, "optional", "0, -1", &
      "Velocity (x, y) of entering disks, which do not rotate. Either velocity or temperature must be given.", unit="length/time", &
      excludes="temperature", may_change=in_motion, otherwise="none; temperature or velocity must be given"), &
    variable_t("source", "temperature", "real", 1, "example", "1", &
      "Temperature kT of the Maxwell distribution from which the velocities of entering disks are drawn. If disks rotate, their " &
      //"angular velocities are drawn with the same temperature.", positive, "energy", may_change=in_motion, &
      otherwise="none; temperature or velocity must be given"), &
    variable_t("source", "start_time", "real", 1, "default", "0", &
      "Earliest time at which disks enter.", not_negative, "time", may_change=in_motion), &
    variable_t("source", "end_time", "real", 1, "optional", "10", &
      "Latest time at which disks enter.", not_negative, "time", may_change=in_motion, otherwise="no limit")]

end module source_variables
