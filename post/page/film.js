'use strict';

// ---------- what the file holds ----------

const $ = id => document.getElementById(id);
let film, frames, disks, kinds;  // facts; the number of frames, of disks; species
let positions, grain;            // frame by frame x1 y1 x2 y2 ..., in units of 1 / grain of the box
let speciesOf, sizeOf;           // by disk
let codes, viridis;              // places on the colour scales, frame by frame; the colours of the scale
let shifts;                      // periods crossed since the frame before, x + 8 and y + 8 in four bits each
let gapStart, turning, turns;    // collisions between frames: first one of each gap; disk; share of the gap, x, y in the box
let guessed, guessedRow;         // bits, gap by gap: disks whose paths there are not known; bytes of a gap

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
  shifts = blocks.shifts && bytes('shifts');
  gapStart = [0];
  new Uint32Array(bytes('gaps').buffer).forEach((count, gap) => gapStart.push(gapStart[gap] + count));
  turning = new Uint32Array(bytes('turning').buffer);
  turns = new (film.exact ? Float64Array : Float32Array)(bytes('turns').buffer);
  guessed = bytes('guessed');
  guessedRow = Math.ceil(disks / 8);
}

const first = () => film.time[0], last = () => film.time[frames - 1];
const isGuessed = (gap, disk) => guessed[gap * guessedRow + (disk >> 3)] >> (disk & 7) & 1;
