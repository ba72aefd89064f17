!> Table rows that describe the variables of the groups `&run`, `&stop` and `&output`.
module run_variables
  use variable_rows, only: energy_left, not_negative, number_of_threads, on_resume, per_decade, positive, variable_t
  implicit none
  private
  public :: output_rows, run_rows, stop_rows

  type(variable_t), parameter :: run_rows(*) = [ &
    variable_t("run", "title", "text", 1, "default", "''", &
      "One-line description of the run. The description is stored in the output file and has no effect on the trajectory.", &
      may_change=on_resume), &
    variable_t("run", "seed", "integer", 1, "default", "1", &
      "Seed of the random numbers that determine random positions, radii, velocities and kicks. The same input with the same " &
      //"seed gives a bit-identical run; runs that differ only in their seed are statistically independent.", &
      not_negative), &
    variable_t("run", "dynamics", "text", 1, "default", "'events'", &
      "Method by which the simulation advances in time.", choices="events steps"), &
    variable_t("run", "dt", "real", 1, "optional", "0.001", &
      "Length of a time step in time-stepped dynamics. dt must be given with run.dynamics = 'steps', and has no effect with " &
      //"'events'. Choose dt so small that no disk moves by more than half of the smallest radius in one step.", &
      positive, "time", &
      otherwise="none; needed with run.dynamics = 'steps'"), &
    variable_t("run", "search", "text", 1, "default", "'cells'", &
      "Method of the search for collision partners. All choices give bit-identical trajectories and differ only in speed; " &
      //"'pairs' and 'rescan' exist for comparison.", choices="cells pairs rescan", may_change=on_resume), &
    variable_t("run", "queue", "text", 1, "default", "'calendar'", &
      "Priority queue of the predicted events. Both choices give bit-identical trajectories; 'heap' exists for comparison. " &
      //"The queue has no effect with run.dynamics = 'steps'.", choices="calendar heap", may_change=on_resume), &
    variable_t("run", "threads", "integer", 1, "default", "0", &
      "Largest number of threads (cores) that the run may use. The value 0 stands for the value of the environment variable " &
      //"OMP_NUM_THREADS, or for 1 if OMP_NUM_THREADS is not set. The trajectory is bit-identical for any number of threads. " &
      //"Small systems, sheared boxes, boxes with a piston, and runs with run.dynamics = 'steps' or run.search other than " &
      //"'cells' use one thread.", number_of_threads, &
      may_change=on_resume)]

  type(variable_t), parameter :: stop_rows(*) = [ &
    variable_t("stop", "time", "real", 1, "example", "1", &
      "Time at which the run ends. The first stop rule that is met ends the run. At least one variable of &stop must be given.", &
      not_negative, &
      "time", may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "collisions", "integer", 1, "optional", "100000", &
      "Number of collisions of two disks after which the run ends.", not_negative, may_change=on_resume, &
      otherwise="no limit"), &
    variable_t("stop", "collisions_per_disk", "real", 1, "optional", "20", &
      "Number of collisions per disk after which the run ends: 2C/N for C collisions between the N disks.", &
      not_negative, may_change=on_resume, &
      otherwise="no limit"), &
    variable_t("stop", "events", "integer", 1, "optional", "100000", &
      "Number of events after which the run ends. Events are collisions of disks with disks, sides and obstacles.", &
      not_negative, may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "energy_fraction", "real", 1, "optional", "0.1", &
      "Fraction of the initial kinetic energy at which the run ends. The run ends when the initial kinetic energy minus all " &
      //"energy dissipated in collisions has decreased to this fraction. The rule needs inelastic collisions or another stop " &
      //"rule. The rule cannot be combined with driving, shear, or thermal, sliding or moving boundaries.", &
      energy_left, may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "at_rest", "logical", 1, "optional", ".true.", &
      "End of the run when all disks have come to rest. With box.gravity, a disk comes to rest when its series of ever " &
      //"shorter bounces has ended. Without gravity, the run ends when no disk moves. The rule needs inelastic collisions. " &
      //"The rule cannot be combined with run.dynamics = 'steps', contact.contact_time, driving, shear, or thermal, sliding " &
      //"or moving boundaries.", may_change=on_resume, &
      otherwise=".false.: disks at rest do not end the run"), &
    variable_t("stop", "wall_clock", "real", 1, "optional", "3600", &
      "Wall-clock time after which the run stops with a checkpoint and exit code 75. The same command with --resume continues " &
      //"the run.", positive, "s", may_change=on_resume, otherwise="no limit")]

  type(variable_t), parameter :: output_rows(*) = [ &
    variable_t("output", "frames_every_time", "real", 1, "optional", "0.1", &
      "Time between frames. A frame contains the positions and velocities of all disks. Frames of the initial and the final " &
      //"state are always written.", positive, "time", may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_collisions", "integer", 1, "optional", "1000", &
      "Number of collisions of two disks between frames.", positive, may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_events", "integer", 1, "optional", "1000", &
      "Number of events (collisions of disks with disks, sides and obstacles) between frames.", positive, &
      may_change=on_resume, otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_collisions_per_disk", "real", 1, "optional", "1", &
      "Number of collisions per disk between frames: 2C/N for C collisions between the N disks.", positive, may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_at", "real", 0, "optional", "0.1, 1, 10", &
      "Times of single frames, in increasing order. These frames are written in addition to the frames that frames_every_... " &
      //"and frames_per_decade define. Times after the end of the run are allowed, because --resume with a later stop " &
      //"reaches them.", not_negative, "time", may_change=on_resume, otherwise="no such frames"), &
    variable_t("output", "frames_per_decade", "integer", 1, "optional", "10", &
      "Number of frames per decade (power of ten) of the time. The times of the frames are equally spaced on a logarithmic " &
      //"scale and start at decades_from, which must be given. These frames are written in addition to the frames that " &
      //"frames_every_... and frames_at define.", per_decade, may_change=on_resume, &
      otherwise="no such frames"), &
    variable_t("output", "decades_from", "real", 1, "optional", "0.001", &
      "Time of the first frame of frames_per_decade and of the first sample of observables_per_decade. decades_from may be " &
      //"given only together with one of these two variables.", positive, "time", may_change=on_resume, &
      otherwise="none; needed with frames_per_decade and observables_per_decade"), &
    variable_t("output", "observables_every_time", "real", 1, "optional", "0.01", &
      "Time between samples of the observables: energies, pressure, counts, ... The observables of the initial and the final " &
      //"state are always sampled.", &
      positive, "time", may_change=on_resume, otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_collisions", "integer", 1, "optional", "100", &
      "Number of collisions of two disks between samples of the observables.", positive, may_change=on_resume, &
      otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_events", "integer", 1, "optional", "100", &
      "Number of events (collisions of disks with disks, sides and obstacles) between samples of the observables.", &
      positive, may_change=on_resume, otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_collisions_per_disk", "real", 1, "optional", "0.1", &
      "Number of collisions per disk between samples of the observables: 2C/N for C collisions between the N disks.", &
      positive, may_change=on_resume, &
      otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_at", "real", 0, "optional", "0.1, 1, 10", &
      "Times of single samples of the observables, in increasing order. These samples are taken in addition to the samples " &
      //"that observables_every_... and observables_per_decade define. Times after the end of the run are allowed, because " &
      //"--resume with a later stop reaches them.", not_negative, "time", may_change=on_resume, &
      otherwise="no such samples"), &
    variable_t("output", "observables_per_decade", "integer", 1, "optional", "10", &
      "Number of samples of the observables per decade (power of ten) of the time. The times of the samples are equally " &
      //"spaced on a logarithmic scale and start at decades_from, which must be given. These samples are taken in addition to " &
      //"the samples that observables_every_... and observables_at define.", per_decade, &
      may_change=on_resume, otherwise="no such samples"), &
    variable_t("output", "frame_columns", "text", 0, "optional", "'position', 'velocity'", &
      "Quantities that frames contain. Positions are always written. A quantity that the disks of the run do not have is " &
      //"refused. Scripts that need a quantity that the file does not contain report an error.", &
      choices="position velocity event_count image angular_velocity orientation recycled", &
      otherwise="all quantities that the run has"), &
    variable_t("output", "precision", "text", 1, "default", "'double'", &
      "Precision of positions and velocities in frames. Checkpoints are always in double precision.", &
      choices="double single"), &
    variable_t("output", "event_log", "logical", 1, "default", ".false.", &
      "Event log: the group /events of the output file contains the time, the two partners and the change of momentum of " &
      //"every event."), &
    variable_t("output", "virial_tensor", "logical", 1, "default", ".false.", &
      "Output of the observables virial_tensor and kinetic_tensor, from which the pressure tensor (stress tensor) can be " &
      //"calculated. Both observables are always written if disks rotate, if the system is sheared or driven, with thermal, " &
      //"sliding or moving boundaries, and with helfand = .true. In all other systems the value .true. adds both observables, " &
      //"at a small cost."), &
    variable_t("output", "helfand", "logical", 1, "default", ".false.", &
      "Accumulation of the Helfand moments of momentum and energy. The script transport.py calculates the shear viscosity, " &
      //"the bulk viscosity and the thermal conductivity from these moments. The moments cannot be combined with box.gravity " &
      //"or box.shear_rate."), &
    variable_t("output", "checkpoint_every", "real", 1, "optional", "600", &
      "Wall-clock time between checkpoints. A run that was killed can be resumed from its last checkpoint.", positive, "s", &
      may_change=on_resume, otherwise="a checkpoint only when the run stops or ends")]

end module run_variables
