/* Ricochet for other programs: event-driven simulation of hard disks.

   A handle is a simulation at work. Any number may be open; each belongs to one thread at a time. No function prints,
   ends the process (but for memory that the system refuses), or handles signals. A message is the program's own, of up
   to `room` bytes with the zero at its end; a code is 0 or the program's exit code: 2 bad input, 3 files, 4 broken off.
   A count or a room below 0 counts as 0.
   Lengths, times and energies are in the units of the input. Disks are in the order of the input.

   libricochet.so needs no HDF5. libricochet_files.so has the same functions, its ricochet_open accepts species that start
   from the file of a run, and it has the functions at the end of this page. A handle of the one is good for the other. */
#ifndef RICOCHET_H
#define RICOCHET_H
#include <stdint.h>

typedef struct ricochet ricochet;

/* A simulation at its start: the text of an input file, which needs no &stop, and overrides GROUP.VARIABLE=VALUE, a line for
   each. `threads`: 0 takes what the input says, or one. NULL after a failure. */
ricochet *ricochet_open(const char *text, const char *overrides, int threads, char *message, int room, int *code);

/* Frees a simulation; NULL is allowed. */
void ricochet_close(ricochet *);

/* Goes on until the first of these values is reached, counted from the start of the run: those not wanted are INFINITY
   and INT64_MAX, and without any the stop rule of the input counts, if it has one. After `patience` seconds it returns 1: call
   it again. In what parts a simulation advances leaves no trace in it. A time that is NAN is refused with 2; after another
   code above 1 it cannot go on. */
int ricochet_advance(ricochet *, double time, int64_t collisions, int64_t events, double patience, char *message, int room);

double ricochet_time(ricochet *);
void ricochet_count(ricochet *, int64_t counts[3]);            /* disks; collisions of pairs; of pairs and with surfaces */

/* Copies what frames hold (position, velocity, collisions, image, angular_velocity, orientation), or radius, mass,
   species: `width` numbers for each disk, one disk after the other. Returns the width, at most 2; 0: it is not there. */
int ricochet_column(ricochet *, const char *name, double *values);

/* Copies the observables of this moment, at most 4 numbers each, and a line `name width` for each of them; a count has a
   negative width. Returns the bytes of the names without the zero at their end; without room for all nothing is copied. */
int ricochet_observables(ricochet *, char *names, int room, double *values);

/* Changes, now, what acts on disks: GROUP.VARIABLE=VALUE, a line for each, of box.gravity, drive, and the laws of contacts,
   surfaces and their motions. What the change does to the total energy counts as work. Nothing changes after a code. */
int ricochet_change(ricochet *, const char *overrides, char *message, int room);

/* Gives the disks other velocities, now: x and y of one disk after the other. Likewise. */
int ricochet_set_velocities(ricochet *, const double *velocities, char *message, int room);

/* Copies a text about this moment: `input`, a file with overrides and changes; `parameters`, GROUP.VARIABLE = JSON for each
   that has a value; `changes`, TIME GROUP.VARIABLE=VALUE for each; `note`, of a collapse that was passed, or of a gas too cold to go on. Returns its bytes
   without the zero at its end; without room for all nothing is copied. */
int ricochet_text(ricochet *, const char *what, char *text, int room);

/* The next collisions, at most `most`, as in the event log: time, i, j, size and components of the change of momentum.
   Returns how many there are, fewer if nothing happens for long; -1: time steps do not know. The simulation stays as it is. */
int ricochet_next_events(ricochet *, int most, double records[][6]);

/* --- libricochet_files.so --- */

/* Writes OUT.h5.part, as a run of this input would have left it that was stopped now, but with samples of its start only,
   or after a change with samples of now only: `ricochet INPUT -o OUT.h5 --resume` goes on from it. `path` is OUT.h5. */
int ricochet_save(ricochet *, const char *path, int force, char *message, int room);

/* The simulation of the last checkpoint of a run, finished or not. */
ricochet *ricochet_load(const char *path, int threads, char *message, int room, int *code);
#endif
