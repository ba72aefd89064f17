/* C interface of Ricochet, an event-driven simulation of hard disks.

   A complete program, to be compiled with `cc gas.c -lricochet -lm`:

       #include <math.h>
       #include <stdio.h>
       #include "ricochet.h"

       int main(void)
       {
           const char *input = "&box boundary = 'periodic', 'periodic' /\n"
                               "&species name = 'gas' count = 100 packing_fraction = 0.3 temperature = 1 /\n";
           char message[400];
           int code, status;
           int64_t counts[3];
           double position[100][2];
           ricochet *gas = ricochet_open(input, "run.seed=4\n", 1, message, sizeof message, &code);

           if (!gas) {
               fprintf(stderr, "%s\n", message);
               return code;
           }
           do      // until each disk has had ten collisions on average, in slices of at most 0.1 s
               status = ricochet_advance(gas, INFINITY, 500, INT64_MAX, 0.1, message, sizeof message);
           while (status == 1);
           if (status == 0) {
               ricochet_count(gas, counts);
               ricochet_column(gas, "position", position[0]);
               printf("time %.3f, %lld collisions, first disk at %.3f, %.3f\n", ricochet_time(gas),
                      (long long)counts[1], position[0][0], position[0][1]);
           } else {
               fprintf(stderr, "%s\n", message);
           }
           ricochet_close(gas);
           return status;
       }

   A handle represents an open simulation. Any number of simulations may be open at the same time, but a handle must be
   used by only one thread at a time. The functions print nothing, do not handle signals, and end the process only if no
   memory is left.

   Lengths, times, masses and energies are in the units of the input. Disks are in the order of the input.

   `message` is a buffer of `room` bytes for an error message and its terminating zero. Longer messages are truncated.
   Exit codes are 0 for success, 2 for invalid input, 3 for a file that cannot be read or written, and 4 for an
   aborted simulation. Negative counts and negative values of `room` are treated as 0.

   The library libricochet.so does not require HDF5. The library libricochet_files.so additionally contains ricochet_save
   and ricochet_load, and its version of ricochet_open accepts species that start from the output file of a run. A handle
   returned by one of the two libraries can be passed to functions of the other library. */
#ifndef RICOCHET_H
#define RICOCHET_H
#include <stdint.h>

typedef struct ricochet ricochet;

/* Opens a simulation in its initial state.
   text:       contents of an input file; the group &stop may be missing
   overrides:  lines of the form GROUP.VARIABLE=VALUE, which take precedence over the text; may be empty
   threads:    number of threads; 0 for the number in the input, which is one by default
   code:       exit code
   Returns a handle, or NULL after a failure. */
ricochet *ricochet_open(const char *text, const char *overrides, int threads, char *message, int room, int *code);

/* Opens a copy of a simulation in its present state. Returns a handle, or NULL after a failure. */
ricochet *ricochet_copy(ricochet *, char *message, int room, int *code);

/* Closes a simulation and frees its memory. NULL is allowed. */
void ricochet_close(ricochet *);

/* Advances a simulation until one of three limits is reached: a time, a number of disk-disk collisions, or a number of
   events, all counted from the start of the run. INFINITY and INT64_MAX represent no limit. Without any limit, the stop
   rule of the input applies, if it contains one. A limit on collisions or events is reached exactly: the simulation may
   stop between simultaneous events, and the next call executes the remaining events. In a time-stepped simulation the limit
   may be exceeded, because a step is always completed. The results do not depend on the number of calls.
   Returns 0 when a limit is reached, and 1 if `patience` seconds have passed before; in this case call the function again.
   Otherwise the function returns an exit code: 2 if `time` is NAN, and other codes if the simulation cannot be continued. */
int ricochet_advance(ricochet *, double time, int64_t collisions, int64_t events, double patience, char *message, int room);

/* Advances a simulation like ricochet_advance, but by at most one event. In a time-stepped simulation, all events of the
   next step with events are executed. The function also returns 0 if one of the limits is reached before an event occurs.
   ricochet_last_events copies the executed events. */
int ricochet_advance_event(ricochet *, double time, int64_t collisions, int64_t events, double patience, char *message, int room);

/* Copies the latest events.
   most:     maximum number of events
   records:  for each event, the same values as in ricochet_next_events
   Returns the number of copied events. If the input sets output.event_log, at least the last 1,000,000 events are
   available; otherwise only the events of the last call of ricochet_advance_event are available. */
int ricochet_last_events(ricochet *, int most, double records[][6]);

/* Time since the start of the run. */
double ricochet_time(ricochet *);

/* Stores the number of disks, the number of disk-disk collisions, and the number of events. Events are collisions of disks
   with disks, sides and obstacles, and departures through open sides. */
void ricochet_count(ricochet *, int64_t counts[3]);

/* Copies one property of all disks.
   name:    position, velocity, event_count, present, image, angular_velocity, orientation, radius, mass or species
   values:  array of WIDTH numbers for each disk
   Returns WIDTH: 2 for position, velocity and image, 1 for the other properties, or 0 if the disks do not have the
   property. Positions and velocities of disks outside the box (present = 0) are NAN. */
int ricochet_column(ricochet *, const char *name, double *values);

/* Copies all observables at the present time.
   names:   buffer of `room` bytes for a line `NAME WIDTH` per observable; the width is negative for integer observables
   values:  array of |WIDTH| numbers, at most 4, for each observable
   Returns the length of the names in bytes, without the terminating zero. Nothing is copied unless `room` exceeds this
   length. */
int ricochet_observables(ricochet *, char *names, int room, double *values);

/* Changes forces, contact laws and motions at the present time.
   overrides:  lines GROUP.VARIABLE=VALUE for box.gravity, drive, contact, side, source, wall and obstacle
   A side starts its new motion at its present position. Variables that only the former motion of the side uses are
   dropped. The change of the total energy counts as work. Returns an exit code; if it is not 0, nothing is changed. */
int ricochet_change(ricochet *, const char *overrides, char *message, int room);

/* Schedules a change at a later time, like a group &change in the input.
   time:       time of the change, later than the present time
   overrides:  as for ricochet_change
   The change is made after the collisions and before the kicks at this time. Returns an exit code; if it is not 0, the
   change is not scheduled. */
int ricochet_schedule(ricochet *, double time, const char *overrides, char *message, int room);

/* Sets the velocities of all disks at the present time.
   velocities:  x and y component for each disk; ignored for disks outside the box
   The change of the total energy counts as work. Returns an exit code; if it is not 0, nothing is changed. */
int ricochet_set_velocities(ricochet *, const double *velocities, char *message, int room);

/* Sets the positions of all disks at the present time.
   positions:  x and y for each disk; ignored for disks outside the box
   The call fails if disks would overlap each other, an obstacle or a side at these positions, or if the box is sheared.
   The change of the total energy counts as work. Returns an exit code; if it is not 0, nothing is changed. */
int ricochet_set_positions(ricochet *, const double *positions, char *message, int room);

/* Copies a text that describes the simulation at the present time.
   what:  "input": an input file that includes overrides and changes;
          "saved input": an input file for resuming a run from a file saved now, with a group &change for each change
          scheduled since the last call of a function that changed the simulation;
          "parameters": a line GROUP.VARIABLE = JSON for each variable with a value;
          "changes": a line TIME GROUP.VARIABLE=VALUE for each change;
          "note": a note about inelastic collapses, or about disks that are too slow to continue (may be empty)
   text:  buffer of `room` bytes
   Returns the length of the text in bytes, without the terminating zero. Nothing is copied unless `room` exceeds this
   length. */
int ricochet_text(ricochet *, const char *what, char *text, int room);

/* Predicts the next events without changing the simulation.
   most:     maximum number of events
   records:  for each event, the time, i and j, and the magnitude and the two components of the momentum change of disk i,
             as in the event log of a run
   Returns the number of predicted events, which is less than `most` if no event occurs for a long time. In a
   time-stepped simulation, which cannot predict events, the function returns -1. */
int ricochet_next_events(ricochet *, int most, double records[][6]);

/* --- Only in libricochet_files.so --- */

/* Saves a simulation in the format of a run that was interrupted at the present time. The command
   `ricochet INPUT -o OUT.h5 --resume` continues the simulation. The saved file contains only the samples of the initial state
   or, after a change, only the samples of the present state.
   path:   path of the finished output, OUT.h5; the saved file is OUT.h5.part
   force:  nonzero to replace an existing output
   Returns an exit code. */
int ricochet_save(ricochet *, const char *path, int force, char *message, int room);

/* Opens a simulation in the state of the last checkpoint of a finished or unfinished run.
   path:     output of the run
   threads:  number of threads; 0 for the number in the input, which is one by default
   code:     exit code
   Returns a handle, or NULL after a failure. */
ricochet *ricochet_load(const char *path, int threads, char *message, int room, int *code);
#endif
