'use strict';

// ---------- what the file holds ----------

const $ = id => document.getElementById(id);
let film, frames, disks, kinds;  // facts; the number of frames, of disks; species
let positions, grain;            // frame by frame x1 y1 x2 y2 ..., in units of 1 / grain of the room
let speciesOf, sizeOf, masses;   // by disk
let origins;                     // x1 y1 x2 y2 ... where displacements count from, in units of the room
let codes, viridis;              // places on the colour scales, frame by frame; the colours of the scale
let angles;                      // orientations frame by frame, not wrapped; none if disks have none
let shifts;                      // periods crossed since the frame before, x + 8 and y + 8 in four bits each
let gapStart, turning, turns;    // collisions between frames: first one of each gap; disk; share of the gap, x, y in the room
let gains;                       // kinetic energy that the disk has from each of them
let guessed, guessedRow;         // bits, gap by gap: disks whose paths there are not known; bytes of a gap
let headings, headingsStart;     // of these disks in the frame before, a full turn in 256 parts; first one of each gap
let pairs, others;               // times of all collisions of two disks, and of other ones, if they are known

function load({ facts, blocks }) {
  const bytes = name => {
    const text = atob(blocks[name]), array = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) array[k] = text.charCodeAt(k);
    return array;
  };
  film = facts;
  frames = film.time.length;
  kinds = film.species;
  speciesOf = new Uint16Array(bytes('species').buffer);
  sizeOf = bytes('sizes');
  disks = speciesOf.length;
  positions = new (film.exact ? Float64Array : Uint16Array)(bytes('positions').buffer);
  grain = film.exact ? 1 : 65535;
  codes = Object.fromEntries(Object.keys(film.scales).map(name => [name, bytes(name)]));
  viridis = bytes('palette');
  angles = blocks.angles && new Float32Array(bytes('angles').buffer);
  shifts = blocks.shifts && bytes('shifts');
  gapStart = [0];
  new Uint32Array(bytes('gaps').buffer).forEach((count, gap) => gapStart.push(gapStart[gap] + count));
  turning = new Uint32Array(bytes('turning').buffer);
  [turns, gains] = ['turns', 'gains'].map(name => new (film.exact ? Float64Array : Float32Array)(bytes(name).buffer));
  headings = bytes('headings');
  headingsStart = [0];
  film.guesses.forEach((count, gap) => headingsStart.push(headingsStart[gap] + count));
  [pairs, others] = ['pairs', 'others'].map(name => new Float64Array(bytes(name).buffer));
  masses = new Float32Array(bytes('mass').buffer);
  origins = new Float32Array(bytes('origins').buffer);
  guessed = bytes('guessed');
  guessedRow = Math.ceil(disks / 8);
}

const first = () => film.time[0], last = () => film.time[frames - 1];
const isGuessed = (gap, disk) => guessed[gap * guessedRow + (disk >> 3)] >> (disk & 7) & 1;
