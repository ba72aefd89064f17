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

   A handle represents an open simulation. Any number of simulations may be open, but only one thread at a time may use
   the same simulation. The functions print nothing and do not handle signals. The functions do not end the process,
   except when no memory is left.

   Lengths, times, masses and energies are in the units of the input. Disks are in the order of the input.

   `message` is a buffer of `room` bytes for an error message, including the zero at its end; a longer message is truncated.
   An exit code is 0 for success, 2 for invalid input, 3 for a file that cannot be read or written, and 4 for a
   simulation that broke off. Negative values of counts and of `room` are treated as 0.

   libricochet.so does not need HDF5. libricochet_files.so also contains ricochet_save and ricochet_load, and
   its ricochet_open also accepts species that start from the output file of a run. A handle that one of the two libraries
   has returned can be passed to functions of the other library. */
#ifndef RICOCHET_H
#define RICOCHET_H
#include <stdint.h>

typedef struct ricochet ricochet;

/* Opens a simulation in its initial state.
   text:       contents of an input file; the group &stop may be missing
   overrides:  lines of the form GROUP.VARIABLE=VALUE, which take precedence over the text; may be empty
   threads:    number of threads; 0 for the value in the input or, if the input contains none, one
   code:       exit code
   Returns a handle, or NULL after a failure. */
ricochet *ricochet_open(const char *text, const char *overrides, int threads, char *message, int room, int *code);

/* Opens a copy of a simulation in its present state. Returns a handle, or NULL after a failure. */
ricochet *ricochet_copy(ricochet *, char *message, int room, int *code);

/* Closes a simulation and frees its memory. NULL is allowed. */
void ricochet_close(ricochet *);

/* Advances a simulation until the first of three limits is reached: a time, a number of collisions of disks with disks, or a
   number of events, all counted from the start of the run. INFINITY and INT64_MAX stand for no limit. If no argument is a limit,
   the stop rule of the input applies, provided that the input contains one. A limit on collisions or events is reached exactly:
   if several events are simultaneous, the simulation may stop between them, and the next call executes the remaining ones. Only
   with time steps may the limit be exceeded, because a step is always completed. The results do not depend on the number of calls
   with which a simulation is advanced.
   Returns 0 when a limit is reached, 1 if `patience` seconds have passed before a limit is reached (call the function again), or
   an exit code: 2 if `time` is NAN, other codes if the simulation cannot be continued. */
int ricochet_advance(ricochet *, double time, int64_t collisions, int64_t events, double patience, char *message, int room);

/* Advances a simulation like ricochet_advance, but at most by one event or, with time steps, by all events of the next step with
   events. The function also returns 0 if one of the limits was reached before an event occurred. ricochet_last_events copies the
   events that were executed. */
int ricochet_advance_event(ricochet *, double time, int64_t collisions, int64_t events, double patience, char *message, int room);

/* Copies the latest events.
   most:     largest number of events
   records:  for each event the same values as in ricochet_next_events
   Returns the number of copied events. If output.event_log is true in the input, at least the last 1,000,000 events can be
   copied. If output.event_log is false, only the events of the last call of ricochet_advance_event can be copied. */
int ricochet_last_events(ricochet *, int most, double records[][6]);

/* Time since the start of the run. */
double ricochet_time(ricochet *);

/* Stores three numbers: the number of disks, the number of collisions of disks with disks, and the number of events. Events are
   collisions of disks with disks, sides and obstacles, and departures through open sides. */
void ricochet_count(ricochet *, int64_t counts[3]);

/* Copies one property of all disks.
   name:    position, velocity, event_count, present, image, angular_velocity, orientation, radius, mass or species
   values:  array of WIDTH numbers for each disk
   Returns WIDTH: 2 for position, velocity and image, 1 for the other properties, or 0 if the disks do not have this
   property. Positions and motions of disks outside of the box (present = 0) are NAN. */
int ricochet_column(ricochet *, const char *name, double *values);

/* Copies all observables at the present time.
   names:   buffer of `room` bytes for a line `NAME WIDTH` per observable; the width of an integer observable is negative
   values:  array of |WIDTH| numbers for each observable, at most 4
   Returns the length of the names in bytes, without the zero at the end. Nothing is copied unless `room` is larger
   than this length. */
int ricochet_observables(ricochet *, char *names, int room, double *values);

/* Changes forces, contact laws and motions at the present time.
   overrides:  lines GROUP.VARIABLE=VALUE of box.gravity, drive, contact, side, source, wall and obstacle
   A side starts a new motion where it is. Variables of its former motion that the new motion does not have are dropped.
   The change of the total energy counts as work. Returns an exit code; if the code is not 0, nothing is changed. */
int ricochet_change(ricochet *, const char *overrides, char *message, int room);

/* Plans a change at a later time, with the same effect as a group &change of the input.
   time:       time of the change, later than the present time
   overrides:  as for ricochet_change
   The functions that advance the simulation make the change after the collisions and before the kicks at this time. Returns an exit
   code; if the code is not 0, the change is not planned. */
int ricochet_schedule(ricochet *, double time, const char *overrides, char *message, int room);

/* Sets the velocities of all disks at the present time.
   velocities:  x and y component for each disk; those of disks outside of the box have no effect
   The change of the total energy counts as work. Returns an exit code; if the code is not 0, nothing is changed. */
int ricochet_set_velocities(ricochet *, const double *velocities, char *message, int room);

/* Sets the positions of all disks at the present time.
   positions:  x and y for each disk; those of disks outside of the box have no effect
   If disks overlap each other, an obstacle or a side at these positions, or if the box is sheared, the result is an error. The
   change of the total energy counts as work. Returns an exit code; if the code is not 0, nothing is changed. */
int ricochet_set_positions(ricochet *, const double *positions, char *message, int room);

/* Copies a text that describes the simulation at the present time.
   what:  "input" for an input file that includes overrides and changes;
          "saved input" for an input file with which the program continues a file that is saved now: scheduled changes
          since the last call of a function that changes the simulation are groups &change;
          "parameters" for a line GROUP.VARIABLE = JSON for each variable that has a value;
          "changes" for a line TIME GROUP.VARIABLE=VALUE for each change;
          "note" for a note about inelastic collapses, or about disks that are too slow to continue (may be empty)
   text:  buffer of `room` bytes
   Returns the length of the text in bytes, without the zero at the end. Nothing is copied unless `room` is larger
   than this length. */
int ricochet_text(ricochet *, const char *what, char *text, int room);

/* Predicts the next events without changing the simulation.
   most:     largest number of events
   records:  for each event the time, i and j, and the magnitude and two components of the momentum change of disk i, as in the
             event log of a run
   Returns the number of predicted events, which is smaller than `most` if no event occurs for a long time. The result is -1
   for time-stepped dynamics, which cannot predict events. */
int ricochet_next_events(ricochet *, int most, double records[][6]);

/* --- Only in libricochet_files.so --- */

/* Saves a simulation as the unfinished output of a run that was stopped at the present time. The command
   `ricochet INPUT -o OUT.h5 --resume` continues this run. The file contains only the samples of the initial state
   or, after a change, only the samples of the present state.
   path:   path of the finished output, OUT.h5; the file that is written is OUT.h5.part
   force:  nonzero to replace an existing output
   Returns an exit code. */
int ricochet_save(ricochet *, const char *path, int force, char *message, int room);

/* Opens a simulation in the state of the last checkpoint of a finished or unfinished run.
   path:     output of the run
   threads:  number of threads; 0 for the value in the input or, if the input contains none, one
   code:     exit code
   Returns a handle, or NULL after a failure. */
ricochet *ricochet_load(const char *path, int threads, char *message, int room, int *code);
#endif
