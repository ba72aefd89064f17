'use strict';

// ---------- what is shown, whatever it comes from ----------

const $ = id => document.getElementById(id);
let film, disks, kinds;         // facts; the number of disks; species
let speciesOf, sizeOf, masses;  // by disk
let X, Y, VX, VY;               // of all disks at the moment; inside the box along a periodic axis
let angles, HITS;               // orientations at the moment, if disks have them; collisions since the frame before
let source;                     // the file, or what comes from a worker: how to get to a moment, and what is known of it
const moment = { time: 0, shown: 0, frame: 0, kinetic: [], potential: [], collisions: 0 };

function bytes(text) {
  const letters = atob(text), array = new Uint8Array(letters.length);
  for (let k = 0; k < letters.length; k++) array[k] = letters.charCodeAt(k);
  return array;
}

// The box, its disks, and which of them has what.
function setScene(facts, blocks) {
  film = facts;
  kinds = film.species;
  speciesOf = new Uint16Array(bytes(blocks.species).buffer);
  sizeOf = bytes(blocks.sizes);
  masses = new Float32Array(bytes(blocks.mass).buffer);
  disks = speciesOf.length;
  [X, Y, VX, VY, HITS] = Array.from({ length: 5 }, () => new Float64Array(disks));
}

const first = () => source.first(), last = () => source.last();
const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

// How many of these ascending numbers are not larger.
function upTo(values, value) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
}

// The mean energies of the disks of each species at the moment.
function energiesNow(height) {
  const kinetic = kinds.map(() => 0), potential = kinds.map(() => 0);
  for (let i = 0; i < disks; i++) {
    kinetic[speciesOf[i]] += 0.5 * masses[i] * (VX[i] * VX[i] + VY[i] * VY[i]);
    potential[speciesOf[i]] -= masses[i] * height(i);
  }
  const mean = (sum, s) => sum / kinds[s].count;
  Object.assign(moment, { kinetic: kinetic.map(mean), potential: potential.map(mean) });
}

// Where the sides are at a time: a picture only, events are those of the engine. Left, right, bottom, top.
function sidesAt(time) {
  return source.sides?.() ?? film.sides.map(({ place, motion, amplitude, period, phase }, k) => {
    if (!period) return place;
    const s = time / period + phase, part = s - Math.floor(s);
    const f = motion === 'sine' ? Math.sin(2 * Math.PI * part) : 16 * (part < 0.5 ? part * (0.5 - part) : (part - 0.5) * (part - 1));
    return place + (k % 2 ? -1 : 1) * amplitude * f;
  });
}

// ---------- a film: frames, and what happens between them ----------

// A gap is the time between two frames. In it a disk flies from the first one on, by way of its turns; each flight is
// straight, or a parabola under gravity. A disk whose path is not known stands still until the next frame; where many do,
// all stand: the frame is shown as it is.
const MANY = 0.1;                // of the disks
let frames;                      // their number
let positions, grain;            // frame by frame x1 y1 x2 y2 ..., in units of 1 / grain of the room
let velocities, fastest;         // the same, in units of 1 / 32767 of the fastest component of each frame
let turnings, shifts, hits;      // orientations, not wrapped; periods crossed since the frame before, x + 8 and y + 8 in four
                                 // bits each; places on the scale of collisions: frame by frame, if there are any
let gapStart, turning, turns;    // collisions between frames: first one of each gap; disk; share of the gap, new velocity
let guessed, guessedRow;         // bits, gap by gap: disks whose paths there are not known; bytes of a gap
let pairs, others;               // times of all collisions of two disks, and of other ones, if they are known
let origins;                     // x1 y1 x2 y2 ... where displacements count from
let crossed;                     // periods crossed since the first frame, x1 y1 x2 y2 ..., until a frame
let UX, UY;                      // places of all disks at the moment without jumps since the frame before

function loadFilm({ facts, blocks }) {
  setScene(facts, blocks);
  frames = film.time.length;
  const block = (name, kind) => new kind(bytes(blocks[name]).buffer), real = film.exact ? Float64Array : Float32Array;
  positions = block('positions', film.exact ? Float64Array : Uint16Array);
  velocities = block('velocities', film.exact ? Float64Array : Int16Array);
  fastest = block('fastest', Float64Array).map(speed => film.exact ? 1 : speed / 32767);
  grain = film.exact ? 1 : 65535;
  turnings = blocks.angles && block('angles', Float32Array);
  angles = turnings && new Float32Array(disks);
  [shifts, hits] = ['shifts', 'hits'].map(name => blocks[name] && bytes(blocks[name]));
  gapStart = [0];
  block('gaps', Uint32Array).forEach((count, gap) => gapStart.push(gapStart[gap] + count));
  turning = block('turning', Uint32Array);
  turns = block('turns', real);
  [pairs, others] = [block('pairs', Float64Array), block('others', Float64Array)];
  origins = block('origins', Float32Array).map((place, k) => place * film.edges[k % 2]);
  guessed = bytes(blocks.guessed);
  guessedRow = Math.ceil(disks / 8);
  crossed = { frame: 0, sum: new Int32Array(2 * disks) };
  [UX, UY] = [new Float64Array(disks), new Float64Array(disks)];
  source = fromFile;
}

const isGuessed = (gap, disk) => guessed[gap * guessedRow + (disk >> 3)] >> (disk & 7) & 1;
const stands = gap => film.guesses[gap] > MANY * disks;
const frameAt = time => Math.max(0, upTo(film.time, time) - 1);  // the last one that is not later

function moveInFilm(time) {
  moment.time = clamp(time, first(), last());
  const frame = moment.frame = frameAt(moment.time), [width, height] = film.edges, [left, bottom] = film.lower;
  const h = (film.time[frame + 1] ?? film.time[frame]) - film.time[frame], stop = gapStart[frame + 1];
  const passed = stands(frame) ? 0 : moment.time - film.time[frame], share = h > 0 ? passed / h : 0;
  const [wrapX, wrapY] = film.periodic, [gx, gy] = film.gravity, unit = fastest[frame], unknown = film.guesses[frame];
  moment.shown = film.time[frame] + passed;
  for (let i = 0, at = 2 * frame * disks, turn = gapStart[frame]; i < disks; i++, at += 2) {
    let x = width * positions[at] / grain, y = height * positions[at + 1] / grain, met = 0;
    let vx = unit * velocities[at], vy = unit * velocities[at + 1], since = 0, dt;
    if (!(unknown && isGuessed(frame, i))) {
      for (; turn < stop && turning[turn] === i && turns[3 * turn] <= share; turn++) {
        dt = h * turns[3 * turn] - since;
        x += (vx + 0.5 * gx * dt) * dt;
        y += (vy + 0.5 * gy * dt) * dt;
        vx = turns[3 * turn + 1];
        vy = turns[3 * turn + 2];
        since += dt;
        met++;
      }
      dt = passed - since;
      x += (vx + 0.5 * gx * dt) * dt;
      y += (vy + 0.5 * gy * dt) * dt;
      vx += gx * dt;
      vy += gy * dt;
    }
    while (turn < stop && turning[turn] === i) turn++;
    [UX[i], UY[i], VX[i], VY[i], HITS[i]] = [x, y, vx, vy, met];
    if (wrapX) x -= width * Math.floor(x / width);
    if (wrapY) y -= height * Math.floor(y / height);
    X[i] = left + x;
    Y[i] = bottom + y;
  }
  if (shifts) crossUntil(frame);
  for (let i = 0, at = frame * disks; angles && i < disks; i++, at++)
    angles[i] = turnings[at] + share * ((turnings[at + disks] ?? turnings[at]) - turnings[at]);
  const { sum } = crossed, [Gx, Gy] = [gx * width, gy * height];
  energiesNow(i => gx * (left + UX[i]) + gy * (bottom + UY[i]) + Gx * sum[2 * i] + Gy * sum[2 * i + 1]);
  moment.collisions = pairs.length ? film.collisions[0] + 2 * upTo(pairs, moment.shown) / disks : film.collisions[frame];
}

function crossUntil(frame) {
  if (frame < crossed.frame) crossed = { frame: 0, sum: crossed.sum.fill(0) };
  while (crossed.frame < frame) {
    const row = ++crossed.frame * disks;
    for (let i = 0; i < disks; i++) {
      crossed.sum[2 * i] += (shifts[row + i] >> 4) - 8;
      crossed.sum[2 * i + 1] += (shifts[row + i] & 15) - 8;
    }
  }
}

// The path of a disk between two moments, flight by flight: from, to, and what bends it (0, 0 if straight).
function flightsInFilm(i, from, to) {
  const result = [], [left, bottom] = film.lower;
  for (let gap = frameAt(from); gap < frames - 1 && film.time[gap] < to; gap++) {
    const h = film.time[gap + 1] - film.time[gap], at = 2 * (gap * disks + i), straight = isGuessed(gap, i);
    let place = [0, 1].map(k => film.lower[k] + film.edges[k] * positions[at + k] / grain), since = 0;
    let velocity = [0, 1].map(k => fastest[gap] * velocities[at + k]);
    if (straight) {
      const code = shifts ? shifts[(gap + 1) * disks + i] : 0x88, moved = [(code >> 4) - 8, (code & 15) - 8];
      const end = [0, 1].map(k => film.lower[k] + film.edges[k] * (positions[at + 2 * disks + k] / grain + moved[k]));
      velocity = [0, 1].map(k => (end[k] - place[k]) / h);
    }
    const g = straight ? [0, 0] : film.gravity, start = gapStart[gap], own = [];
    for (let k = start + turning.subarray(start, gapStart[gap + 1]).indexOf(i); k >= start && turning[k] === i && k < gapStart[gap + 1]; k++)
      own.push([h * turns[3 * k], [turns[3 * k + 1], turns[3 * k + 2]]]);
    for (const [end, after] of [...own, [h, velocity]]) {
      const along = t => [0, 1].map(k => place[k] + (velocity[k] + 0.5 * g[k] * (t - since)) * (t - since));
      const a = Math.max(since, from - film.time[gap]), b = Math.min(end, to - film.time[gap]);
      if (b > a) result.push({ from: along(a), to: along(b), bend: g.map(one => one * (b - a) ** 2 / 4), straight });
      [place, velocity, since] = [along(end), after, end];
    }
  }
  return result;
}

const fromFile = {
  first: () => film.time[0],
  last: () => film.time[frames - 1],
  move: moveInFilm,
  frameTime: k => film.time[clamp(k, 0, frames - 1)],
  counted: () => `frame ${moment.frame + 1}/${frames}`,
  curves: () => film.curves,
  // Where a disk was in the last frames: the older part, the newer one.
  trace: i => [300, 30, 0].map(k => film.time[Math.max(0, moment.frame - k)]).map((from, k, all) => k < 2
    && flightsInFilm(i, from, k ? moment.shown : all[1])).slice(0, 2),
  displacement: i => Math.hypot(UX[i] + film.edges[0] * crossed.sum[2 * i] - origins[2 * i],
    UY[i] + film.edges[1] * crossed.sum[2 * i + 1] - origins[2 * i + 1]),
  collisions(i) {  // as a place on the scale
    const scale = Math.log1p(film.scales.collisions[1]), before = hits[moment.frame * disks + i] / 255;
    return HITS[i] ? Math.log1p(Math.expm1(before * scale) + HITS[i]) / scale : before;
  },
  // Each frame's speeds in turn, up to that of the moment.
  eachSpeed(action) {
    for (let frame = 0; frame <= moment.frame; frame++)
      for (let i = 0, at = 2 * frame * disks; i < disks; i++, at += 2)
        action(i, fastest[frame] * Math.hypot(velocities[at], velocities[at + 1]));
    return moment.frame + 1;
  },
  coming() {
    const { time, i, j } = film.events, next = upTo(time, moment.time), one = k => [time[k], i[k], j[k]];
    return { happened: next ? one(next - 1) : null, next: Array.from(time.slice(next, next + 20), (_, k) => one(next + k)) };
  },
  nextEvent: () => Math.min(...[pairs, others].map(times => times[upTo(times, moment.time)] ?? last())),
  hasEvents: () => pairs.length + others.length > 0,
  goesOn: () => live.on,
};
