!> Variables of the groups `&run`, `&change`, `&stop` and `&output`.
module run_variables
  use drives, only: drive_counters
  use sample_values, only: column_words
  use variable_rows, only: energy_left, not_negative, number_of_threads, on_resume, per_decade, positive, variable_t
  implicit none
  private
  public :: change_rows, output_rows, run_rows, stop_rows

  type(variable_t), parameter :: run_rows(*) = [ &
    variable_t("run", "title", "text", 1, "default", "''", &
      "One-line description of the run, stored in the output file.", &
      may_change=on_resume), &
    variable_t("run", "seed", "integer", 1, "default", "1", &
      "Seed of all random numbers: initial positions, radii, velocities, and kicks. The same input with the same seed gives a " &
      //"bit-identical run; runs that differ only in their seed are statistically independent.", &
      not_negative), &
    variable_t("run", "dynamics", "text", 1, "default", "'events'", &
      "Algorithm that advances the simulation in time.", choices="events steps"), &
    variable_t("run", "dt", "real", 1, "optional", "0.001", &
      "Time step of time-stepped dynamics (run.dynamics = 'steps'). Choose the time step so small that no disk moves by more " &
      //"than half the smallest radius in one step.", &
      positive, "time", &
      otherwise="none; needed with run.dynamics = 'steps'"), &
    variable_t("run", "search", "text", 1, "default", "'cells'", &
      "Method that finds collision partners. The trajectories are bit-identical with all methods; 'pairs' and 'rescan' are " &
      //"slower and exist for comparison.", choices="cells pairs rescan", may_change=on_resume), &
    variable_t("run", "queue", "text", 1, "default", "'calendar'", &
      "Priority queue of the predicted events. The trajectories are bit-identical with both queues; 'heap' exists for " &
      //"comparison. The variable has no effect with run.dynamics = 'steps'.", choices="calendar heap", may_change=on_resume), &
    variable_t("run", "threads", "integer", 1, "default", "0", &
      "Largest number of threads (cores) of the run. With 0 the number is read from the environment variable " &
      //"OMP_NUM_THREADS; if this variable is not set, the number is 1. The trajectory is bit-identical for any number of " &
      //"threads. Small systems, sheared boxes, open systems, boxes with a piston, and runs with run.dynamics = 'steps' or " &
      //"run.search other than 'cells' use a single thread.", &
      number_of_threads, &
      may_change=on_resume)]

  type(variable_t), parameter :: change_rows(*) = [ &
    variable_t("change", "name", "text", 1, "optional", "'quench'", &
      "Name of the change in messages and in --set change.NAME.VARIABLE=VALUE. A name has up to 40 letters, digits, _ and -. The " &
      //"names of all changes must differ.", may_change=on_resume, otherwise="1, 2, ... in the order of the file"), &
    variable_t("change", "time", "real", 1, "example", "1", &
      "Time of the change. The change takes place after the collisions and before the kicks and samples of the same time. With " &
      //"run.dynamics = 'steps', the change takes place at the end of the step that contains this time. Times after the end of " &
      //"the run are allowed.", &
      positive, "time", may_change=on_resume), &
    variable_t("change", "set", "text", 0, "example", "'box.gravity=0, -1'", &
      "Variables to change and their new values, each in quotes and written as for the option --set: GROUP.VARIABLE=VALUE or " &
      //"GROUP.NAME.VARIABLE=VALUE. An empty VALUE restores the default. Only variables that may change in a running " &
      //"simulation are allowed. A side begins a new motion at its present position. The energy that the change adds is " &
      //"counted in the observable work.", may_change=on_resume)]

  type(variable_t), parameter :: stop_rows(*) = [ &
    variable_t("stop", "time", "real", 1, "example", "1", &
      "Time at which the run ends. The group &stop needs at least one stop rule; the run ends as soon as one of them is met.", &
      not_negative, &
      "time", may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "collisions", "integer", 1, "optional", "100000", &
      "Number of disk-disk collisions after which the run ends.", not_negative, may_change=on_resume, &
      otherwise="no limit"), &
    variable_t("stop", "collisions_per_disk", "real", 1, "optional", "20", &
      "Number of collisions per disk after which the run ends. With N disks and C collisions, the number of collisions per disk " &
      //"is 2C/N.", &
      not_negative, may_change=on_resume, &
      otherwise="no limit"), &
    variable_t("stop", "events", "integer", 1, "optional", "100000", &
      "Number of events after which the run ends: collisions of disks with disks, sides and obstacles, and departures through " &
      //"open sides.", &
      not_negative, may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "disks_inside", "integer", 1, "optional", "0", &
      "Number of disks in the box at which the run ends. The run ends when a disk leaves through an open side (side.open) " &
      //"and at most this number of disks remains.", not_negative, may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "energy_fraction", "real", 1, "optional", "0.1", &
      "Fraction of the initial kinetic energy at which the run ends. The remaining energy is the initial kinetic energy minus " &
      //"all energy dissipated in collisions. This rule needs inelastic collisions or a second stop rule. The rule is not " &
      //"available with driving, with shear, or with thermal, sliding or moving boundaries.", &
      energy_left, may_change=on_resume, otherwise="no limit"), &
    variable_t("stop", "at_rest", "logical", 1, "optional", ".true.", &
      "End of the run when all disks have come to rest. With box.gravity, a disk comes to rest when its sequence of ever shorter " &
      //"bounces has converged; without gravity, a disk is at rest when it no longer moves. This rule needs inelastic " &
      //"collisions. The rule is not available with run.dynamics = 'steps', contact.contact_time, driving, shear, or thermal, " &
      //"sliding or moving boundaries.", &
      may_change=on_resume, &
      otherwise=".false.: disks at rest do not end the run"), &
    variable_t("stop", "wall_clock", "real", 1, "optional", "3600", &
      "Wall-clock time after which the run stops with a checkpoint and exit code 75. The same command with --resume " &
      //"continues the run.", positive, "s", may_change=on_resume, otherwise="no limit")]

  type(variable_t), parameter :: output_rows(*) = [ &
    variable_t("output", "frames_every_time", "real", 1, "optional", "0.1", &
      "Time between frames, which contain positions and velocities of all disks. The initial and the final state are always " &
      //"written.", positive, "time", may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_collisions", "integer", 1, "optional", "1000", &
      "Number of disk-disk collisions between frames.", positive, may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_events", "integer", 1, "optional", "1000", &
      "Number of events (collisions of disks with disks, sides and obstacles) between frames.", positive, &
      may_change=on_resume, otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_every_collisions_per_disk", "real", 1, "optional", "1", &
      "Number of collisions per disk between frames. With N disks and C collisions, the number of collisions per disk is 2C/N.", &
      positive, may_change=on_resume, &
      otherwise="frames of the initial and the final state only"), &
    variable_t("output", "frames_at", "real", 0, "optional", "0.1, 1, 10", &
      "Times of additional frames, in increasing order. Times after the end of the run are allowed, because a run resumed " &
      //"with a later end (--resume) reaches them.", not_negative, "time", may_change=on_resume, otherwise="no such frames"), &
    variable_t("output", "frames_per_decade", "integer", 1, "optional", "10", &
      "Number of additional frames per decade of time, equally spaced on a logarithmic scale from decades_from onwards.", &
      per_decade, may_change=on_resume, &
      otherwise="no such frames"), &
    variable_t("output", "decades_from", "real", 1, "optional", "0.001", &
      "Time of the first frame of frames_per_decade and of the first sample of observables_per_decade.", positive, "time", &
      may_change=on_resume, &
      otherwise="none; needed with frames_per_decade and observables_per_decade"), &
    variable_t("output", "observables_every_time", "real", 1, "optional", "0.01", &
      "Time between samples of the observables: energies, pressure, counts, ... The initial and the final state are always " &
      //"sampled.", &
      positive, "time", may_change=on_resume, otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_collisions", "integer", 1, "optional", "100", &
      "Number of disk-disk collisions between samples of the observables.", positive, may_change=on_resume, &
      otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_events", "integer", 1, "optional", "100", &
      "Number of events (collisions of disks with disks, sides and obstacles) between samples of the observables.", &
      positive, may_change=on_resume, otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_every_collisions_per_disk", "real", 1, "optional", "0.1", &
      "Number of collisions per disk between samples of the observables. With N disks and C collisions, the number of collisions " &
      //"per disk is 2C/N.", &
      positive, may_change=on_resume, &
      otherwise="samples of the initial and the final state only"), &
    variable_t("output", "observables_at", "real", 0, "optional", "0.1, 1, 10", &
      "Times of additional samples of the observables, in increasing order. Times after the end of the run are allowed, " &
      //"because a run resumed with a later end (--resume) reaches them.", not_negative, "time", may_change=on_resume, &
      otherwise="no such samples"), &
    variable_t("output", "observables_per_decade", "integer", 1, "optional", "10", &
      "Number of additional samples of the observables per decade of time, equally spaced on a logarithmic scale from " &
      //"decades_from onwards.", per_decade, &
      may_change=on_resume, otherwise="no such samples"), &
    variable_t("output", "frame_columns", "text", 0, "optional", "'position', 'velocity'", &
      "Quantities stored in frames. Positions are always stored. Quantities that do not exist in the run are refused. Scripts " &
      //"report an error if the file lacks a quantity that they need.", &
      choices=column_words//drive_counters, &
      otherwise="all quantities that the run has"), &
    variable_t("output", "precision", "text", 1, "default", "'double'", &
      "Precision of positions and velocities in frames. Checkpoints are always in double precision.", &
      choices="double single"), &
    variable_t("output", "event_log", "logical", 1, "default", ".false.", &
      "Event log: time, partners and change of momentum of every event, written to the group /events of the output file."), &
    variable_t("output", "virial_tensor", "logical", 1, "default", ".false.", &
      "Output of the observables virial_tensor and kinetic_tensor, from which the pressure tensor (stress tensor) follows. The " &
      //"two tensors are always written for rotating disks, in sheared or driven systems, with thermal, sliding or moving " &
      //"boundaries, and with helfand = .true. In other systems this output slows the run down slightly."), &
    variable_t("output", "helfand", "logical", 1, "default", ".false.", &
      "Accumulation of the Helfand moments of momentum and energy, from which transport.py calculates shear viscosity, bulk " &
      //"viscosity and thermal conductivity. Helfand moments are not available with box.gravity or box.shear_rate."), &
    variable_t("output", "checkpoint_every", "real", 1, "optional", "600", &
      "Wall-clock time between checkpoints. A killed run can be resumed from its last checkpoint.", positive, "s", &
      may_change=on_resume, otherwise="a checkpoint only when the run stops or ends")]

end module run_variables
