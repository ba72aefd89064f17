'use strict';

// ---------- data of the film, which comes from a file or from a worker process ----------

const $ = id => document.getElementById(id);
let film, disks, kinds;         // facts of the film; number of disks; species
let speciesOf, sizeOf, masses;  // by disk: index of its species, index of its size, mass
let X, Y, VX, VY;               // present positions and velocities; positions are wrapped into a periodic box
let UX, UY, HITS;               // positions continuous since the previous frame; events since that frame
let angles;                     // present orientations, if the disks have any
let source;                     // source of frames and events: a file or a worker
let past = [];                  // frames: time, position and velocity (x1 y1 x2 y2 ...), angle, image counters relative to the first frame, ...
let origins;                    // positions x1 y1 x2 y2 ... from which displacements are measured
// `inside`: disks of each species in the box
const moment = { time: 0, shown: 0, frame: 0, inside: [], kinetic: [], potential: [], collisions: 0 };

function bytes(text) {
  const letters = atob(text), array = new Uint8Array(letters.length);
  for (let k = 0; k < letters.length; k++) array[k] = letters.charCodeAt(k);
  return array;
}

// Stores the box, the disks and their properties.
function setScene(facts, blocks) {
  film = facts;
  kinds = film.species;
  speciesOf = new Uint16Array(bytes(blocks.species).buffer);
  sizeOf = bytes(blocks.sizes);
  masses = new Float32Array(bytes(blocks.mass).buffer);
  film.atStart = film.sides;
  disks = speciesOf.length;
  [X, Y, VX, VY, UX, UY, HITS] = Array.from({ length: 7 }, () => new Float64Array(disks));
  past = [];
}

// Positions of disks outside the box are NaN; such disks are not drawn.
const isInside = i => !isNaN(X[i]);

const first = () => past[0].time, last = () => past.at(-1).time;
const sumOf = values => values.reduce((sum, one) => sum + one, 0);
const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

// Returns the number of elements of a sorted list that do not exceed a value, by binary search.
function upTo(values, value, number = one => one) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (number(values[middle]) <= value) low = middle + 1; else high = middle;
  }
  return low;
}

const frameAt = time => Math.max(0, upTo(past, time, frame => frame.time) - 1);  // the last frame at or before this time
const frameTime = k => past[clamp(k, 0, past.length - 1)].time;

// Stores in a frame the image counters of each disk (box periods crossed since the first frame), in the order x1, y1, x2, y2 and
// so on. `moved` returns how much a counter has changed since the previous frame.
function cross(frame, moved) {
  const before = past.at(-1);
  // 0 for a disk outside
  if (film.periodic.some(Boolean)) frame.crossed = new Int16Array(2 * disks).map((_, k) => before ? before.crossed[k] + moved(before, k) : 0);
  return frame;
}

// ---------- motion of the disks between frames ----------

// Positions between two frames are calculated from the earlier frame and the velocity changes in the event log. Between
// collisions a disk moves along a straight line or, under gravity, a parabola. Without an event log, each disk is shown at its
// position in the last frame. Frames from a worker process follow each other so closely that no event log is needed.
// velocity changes. start: index of the first change after each frame; turns: disk, fraction of the
// interval and new velocity of each change
let ways;
let events;  // events of the log: time (when), partners (i, j), number of disk-disk collisions so far (pairs)

function move(time) {
  moment.time = clamp(time, first(), last());
  const k = moment.frame = frameAt(moment.time), here = past[k], then = past[k + 1], { place, velocity, crossed } = here;
  const passed = film.known ? moment.time - here.time : 0, share = passed && then ? passed / (then.time - here.time) : 0;
  const [width, height] = film.edges, [left, bottom] = film.lower, [wrapX, wrapY] = film.periodic, [gx, gy] = film.gravity;
  const { start, disk, turns } = ways ?? {}, stop = start?.[k + 1];
  moment.shown = here.time + passed;
  for (let i = 0, turn = start?.[k]; i < disks; i++) {
    let x = place[2 * i], y = place[2 * i + 1], vx = velocity[2 * i], vy = velocity[2 * i + 1], since = 0, met = 0, dt;
    if (passed) {
      for (; turn < stop && disk[turn] === i && turns[3 * turn] <= share; turn++) {
        dt = (then.time - here.time) * turns[3 * turn] - since;
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
    while (turn < stop && disk[turn] === i) turn++;
    UX[i] = X[i] = x;
    UY[i] = Y[i] = y;
    VX[i] = vx;
    VY[i] = vy;
    HITS[i] = met;
    if (wrapX) X[i] -= width * Math.floor((x - left) / width);
    if (wrapY) Y[i] -= height * Math.floor((y - bottom) / height);
    if (angles) angles[i] = here.angle[i] + (share && share * (then.angle[i] - here.angle[i]));
  }
  moment.collisions = events?.when.length ? past[0].collisions + 2 * events.pairs[upTo(events.when, moment.shown)] / disks : here.collisions;
  const kinetic = kinds.map(() => 0), potential = kinds.map(() => 0), inside = kinds.map(({ count }) => count), { isOpen } = film;
  for (let i = 0; i < disks; i++) {
    if (isOpen && !isInside(i)) {
      inside[speciesOf[i]]--;
      continue;
    }
    kinetic[speciesOf[i]] += 0.5 * masses[i] * (VX[i] * VX[i] + VY[i] * VY[i]);
    potential[speciesOf[i]] -= masses[i] * (gx * (UX[i] + (crossed ? width * crossed[2 * i] : 0)) + gy * (UY[i] + (crossed ? height * crossed[2 * i + 1] : 0)));
  }
  const mean = (sum, s) => inside[s] ? sum / inside[s] : null;
  Object.assign(moment, { inside, kinetic: kinetic.map(mean), potential: potential.map(mean) });
}

// Returns for each side whether it is open at the time shown.
const openSides = () => past[moment.frame].open ?? film.open.findLast(([time]) => time <= moment.shown)[1];

// Returns the positions of the left, right, bottom and top side of the box at a given time, for drawing only.
function sidesAt(time) {
  return past[moment.frame].sides ?? film.sides.map(({ place, motion, amplitude, period, phase, velocity, start_time: start, end_time: end, way }, k) => {
    if (way?.[0].length > 1) {
      const [times, places] = way, then = clamp(upTo(times, time), 1, times.length - 1), here = then - 1;
      return places[here] + clamp((time - times[here]) / (times[then] - times[here] || 1), 0, 1) * (places[then] - places[here]);
    }
    if (motion === 'constant_velocity') return place + (k % 2 ? -1 : 1) * velocity * (Math.min(Math.max(time, start), end) - start);
    if (!period) return place;
    const s = time / period + phase, part = s - Math.floor(s);
    const f = motion === 'sine' ? Math.sin(2 * Math.PI * part) : 16 * (part < 0.5 ? part * (0.5 - part) : (part - 0.5) * (part - 1));
    return place + (k % 2 ? -1 : 1) * amplitude * f;
  });
}

function displacement(i) {
  const { crossed } = past[moment.frame], [x, y] = [0, 1].map(k => crossed ? film.edges[k] * crossed[2 * i + k] : 0);
  return Math.hypot(UX[i] + x - origins[2 * i], UY[i] + y - origins[2 * i + 1]);
}

// Returns the free flights of a disk between two times. A flight has a start, an end, and the offset of the control point of
// its parabola, (0, 0) for a straight line. Without an event log, straight lines connect the positions in successive frames.
// Paths of disks outside the box are left out. So is the path of a recycled disk between the frames before and after it was
// recycled.
function flights(i, from, to) {
  const result = [], plus = (a, b) => a.map((one, axis) => one + b[axis]);
  for (let k = frameAt(from); k < past.length - 1 && past[k].time < to; k++) {
    const here = past[k], then = past[k + 1], h = then.time - here.time, own = [], { start, disk, turns } = ways ?? {};
    if (isNaN(here.place[2 * i]) || (isNaN(then.place[2 * i]) && !film.known) || (here.recycled && here.recycled[i] !== then.recycled[i])) continue;
    const pair = array => [array[2 * i], array[2 * i + 1]], g = film.known ? film.gravity : [0, 0];
    let place = pair(here.place), velocity = pair(here.velocity), since = 0;
    if (!film.known) velocity = pair(then.place).map((end, axis) => (end - place[axis] + (here.crossed ? film.edges[axis] * (then.crossed[2 * i + axis] - here.crossed[2 * i + axis]) : 0)) / h);
    else for (let turn = start[k] + disk.subarray(start[k], start[k + 1]).indexOf(i); turn >= start[k] && turn < start[k + 1] && disk[turn] === i; turn++)
      own.push([h * turns[3 * turn], [turns[3 * turn + 1], turns[3 * turn + 2]]]);
    for (const [end, after] of [...own, [h, velocity]]) {
      const along = t => plus(place, velocity.map((v, axis) => (v + 0.5 * g[axis] * (t - since)) * (t - since)));
      const a = Math.max(since, from - here.time), b = Math.min(end, to - here.time);
      if (b > a) result.push({ from: along(a), to: along(b), bend: g.map(one => one * (b - a) ** 2 / 4) });
      [place, velocity, since] = [along(end), after, end];
    }
  }
  return result;
}

// Calls `action` for the speed of each disk in each frame received so far or, if there are very many, in some of the frames.
function eachSpeed(action) {
  const some = Math.ceil((moment.frame + 1) * disks / 2e6);
  for (let k = moment.frame; k >= 0; k -= some)
    for (let i = 0, { place, velocity } = past[k]; i < disks; i++) if (!isNaN(place[2 * i])) action(i, Math.hypot(velocity[2 * i], velocity[2 * i + 1]));
}

// ---------- film of a run that is stored in a file ----------

const running = counts => counts.reduce((sums, one) => { sums.push(sums.at(-1) + one); return sums; }, [0]);

function loadFilm({ facts, blocks }) {
  setScene(facts, blocks);
  const { exact, time, lower, edges } = film, real = exact ? Float64Array : Float32Array;
  const block = (name, kind) => new kind(bytes(blocks[name] ?? '').buffer), part = (array, k, width) => array?.subarray(k * width, (k + 1) * width);
  const positions = block('positions', exact ? Float64Array : Uint16Array), velocities = block('velocities', exact ? Float64Array : Int16Array);
  const fastest = block('fastest', Float64Array), [shifts, hits, counts, present] = ['shifts', 'hits', 'recycled', 'present'].map(name => blocks[name] && bytes(blocks[name]));
  const turned = blocks.angles && block('angles', Float32Array);
  const signs = (before, k) => (shifts[past.length * disks + (k >> 1)] >> (k % 2 ? 0 : 4) & 15) - 8;
  time.forEach((when, k) => past.push(cross({
    time: when, collisions: film.collisions[k], hits: part(hits, k, disks), angle: part(turned, k, disks), recycled: part(counts, k, disks),
    place: real.from(part(positions, k, 2 * disks), (one, n) => present?.[k * disks + (n >> 1)] === 0 ? NaN : lower[n % 2] + edges[n % 2] * one / (exact ? 1 : 65535)),
    velocity: real.from(part(velocities, k, 2 * disks), one => exact ? one : one * fastest[k] / 32767),
  }, signs)));
  angles = turned && new Float32Array(disks);
  origins = block('origins', Float32Array).map((one, k) => lower[k % 2] + edges[k % 2] * one);
  ways = film.known ? { disk: block('turning', Uint32Array), turns: block('turns', real), start: running(block('gaps', Uint32Array)) } : null;
  events = { when: block('when', Float64Array), i: block('i', Int32Array), j: block('j', Int32Array) };
  events.pairs = running(events.j.map(j => j >= 0));
  source = fromFile;
  const atRest = past.at(-1).velocity.filter((v, k, all) => v === 0 && all[k ^ 1] === 0).length / (2 * disks);
  let most = 1.3 * film.scales.speed[1];
  if (atRest > RESTING) past.forEach(({ velocity }) => velocity.forEach((v, k) => { most = Math.max(most, 1.01 * Math.hypot(v, velocity[k ^ 1])); }));
  setBins(most, atRest);
}

const fromFile = {
  counted: () => film.known ? '' : `frame ${moment.frame + 1}/${past.length}`,  // between frames the disks move along their paths
  curves: () => film.curves,
  coming() {
    const { when, i, j } = events, next = upTo(when, moment.time), one = k => [when[k], i[k], j[k]];
    return { happened: next ? one(next - 1) : null, next: Array.from(when.slice(next, next + 20), (_, k) => one(next + k)) };
  },
  nextEvent: () => events.when[upTo(events.when, moment.time)] ?? last(),
  hasEvents: () => events.when.length > 0,
  goesOn: () => live.on,
};
