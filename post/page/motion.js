// ---------- where the disks are at a moment ----------

// A gap is the time between two frames. In it a disk flies from one frame to the next, by way of its turns; each
// flight is straight, or a parabola under gravity. A disk whose path is not known stands still until the next frame;
// where many do, all stand: the frame is shown as it is.
const moment = { time: 0, frame: 0, gap: 0, share: 0, known: true, shown: 0, kinetic: [], potential: [] };
const MANY = 0.1;  // of the disks
let X, Y, VX, VY;  // of all disks at the moment; inside the box along a periodic axis
let UX, UY;        // the same places in units of the room, without jumps since the frame before
let HITS;          // collisions of each disk since the frame before
let ANCHOR, FALL;  // of its flight: the frame that it begins or ends in, else -1; what the square of its speed has won since

const stands = gap => film.guesses[gap] > MANY * disks;

// The last frame that is not later.
const frameAt = time => Math.max(0, upTo(film.time, time) - 1);

function move(time) {
  moment.time = Math.max(first(), Math.min(last(), time));
  moment.frame = frameAt(moment.time);
  const gap = moment.gap = Math.max(0, Math.min(moment.frame, frames - 2)), next = Math.min(gap + 1, frames - 1);
  const h = film.time[next] - film.time[gap], passed = h > 0 ? (moment.time - film.time[gap]) / h : 1;
  const u = moment.share = stands(gap) && passed < 1 ? 0 : passed;
  const [width, height] = film.edges, [left, bottom] = film.lower, [wrapX, wrapY] = film.periodic, [gX, gY] = film.gravity;
  const gx = gX / width, gy = gY / height, start = 2 * gap * disks, end = 2 * next * disks;
  const gained = kinds.map(() => 0), fallen = kinds.map(() => 0);  // energy of each species since the frame before
  const known = moment.known = !film.guesses[gap], falls = gX !== 0 || gY !== 0;
  moment.shown = film.time[gap] + u * h;
  for (let i = 0, turn = gapStart[gap], stop = gapStart[next], heading = headingsStart[gap]; i < disks; i++) {
    const kind = speciesOf[i], xa = positions[start + 2 * i] / grain, ya = positions[start + 2 * i + 1] / grain;
    const unknown = !known && isGuessed(gap, i), guess = unknown && u < 1;
    let u0 = 0, u1 = 1, x0 = xa, y0 = ya, hits = 0;
    let x1 = positions[end + 2 * i] / grain, y1 = positions[end + 2 * i + 1] / grain;
    if (shifts && next > gap) {
      const code = shifts[next * disks + i];
      x1 += (code >> 4) - 8;
      y1 += (code & 15) - 8;
    }
    if (guess) [x1, y1] = [x0, y0];
    const xb = x1, yb = y1;
    for (; turn < stop && turning[turn] === i; turn++) {
      const t = turns[3 * turn], x = turns[3 * turn + 1], y = turns[3 * turn + 2];
      if (t <= u) { hits++; gained[kind] += gains[turn]; }
      if (t <= u && t < 1) { u0 = t; x0 = x; y0 = y; } else { u1 = t; x1 = x; y1 = y; break; }
    }
    while (turn < stop && turning[turn] === i) turn++;
    const span = h * (u1 - u0), free = span > 0 && !unknown, share = free ? (u - u0) / (u1 - u0) : 1;
    const bend = guess ? 0 : 0.5 * h, both = u - u0 + u - u1, product = h * (u - u0) * (u - u1);
    let x = x0 + share * (x1 - x0) + bend * gx * product, y = y0 + share * (y1 - y0) + bend * gy * product;
    VX[i] = free ? width * ((x1 - x0) / span + bend * gx * both) : 0;
    VY[i] = free ? height * ((y1 - y0) / span + bend * gy * both) : 0;
    if (guess) {
      const angle = 2 * Math.PI * headings[heading++] / 256, speed = codes.speed[gap * disks + i] / 255 * film.scales.speed[1];
      VX[i] = speed * Math.cos(angle);
      VY[i] = speed * Math.sin(angle);
    }
    UX[i] = x;
    UY[i] = y;
    HITS[i] = hits;
    ANCHOR[i] = u0 === 0 ? gap : u1 === 1 ? next : -1;
    if (falls) {
      const work = gX * width * (x - xa) + gY * height * (y - ya);
      fallen[kind] += masses[i] * work;
      FALL[i] = 2 * (ANCHOR[i] === gap ? work : gX * width * (x - xb) + gY * height * (y - yb));
    }
    if (wrapX) x -= Math.floor(x);
    if (wrapY) y -= Math.floor(y);
    X[i] = left + width * x;
    Y[i] = bottom + height * y;
  }
  const { frame } = moment, between = known && frame === gap;
  moment.kinetic = kinds.map((kind, s) => film.kinetic[frame][s] + (between ? (gained[s] + fallen[s]) / kind.count : 0));
  moment.potential = film.potential && kinds.map((kind, s) => film.potential[frame][s] - (between ? fallen[s] / kind.count : 0));
}

// How many of these ascending numbers are not larger.
function upTo(values, value) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
}

// Where the sides are at a time: a picture only, events are those of the log. Left, right, bottom, top.
function sidesAt(time) {
  return film.sides.map(({ place, motion, amplitude, period, phase }, k) => {
    if (!motion) return place;
    const s = time / period + phase, part = s - Math.floor(s);
    const f = motion === 'sine' ? Math.sin(2 * Math.PI * part) : 16 * (part < 0.5 ? part * (0.5 - part) : (part - 0.5) * (part - 1));
    return place + (k % 2 ? -1 : 1) * amplitude * f;
  });
}

// Collisions per disk, of the frame if their moments are not known.
function collisionsNow() {
  return pairs.length ? film.collisions[0] + 2 * upTo(pairs, moment.shown) / disks : film.collisions[moment.frame];
}

// The next event of the log.
const nextEvent = () => Math.min(...[pairs, others].map(times => times[upTo(times, moment.time)] ?? last()));

// The periods crossed since the first frame, x1 y1 x2 y2 ..., or nothing without periods; summed up as the film goes on.
let crossings;
function crossedUntil(gap) {
  if (!shifts) return null;
  if (!crossings || gap < crossings.gap) crossings = { gap: 0, sum: new Int32Array(2 * disks) };
  while (crossings.gap < gap) {
    const row = ++crossings.gap * disks;
    for (let i = 0; i < disks; i++) {
      crossings.sum[2 * i] += (shifts[row + i] >> 4) - 8;
      crossings.sum[2 * i + 1] += (shifts[row + i] & 15) - 8;
    }
  }
  return crossings.sum;
}

// Places 0 to 255 of the disks on a colour scale at the moment.
function codesNow(name) {
  const { frame, gap, share } = moment, row = codes[name].subarray(frame * disks, (frame + 1) * disks);
  if (frame !== gap || !share) return row;
  const between = codesBetween[name](film.scales[name][1], codes[name]), known = moment.known, result = new Uint8ClampedArray(disks);
  for (let i = 0; i < disks; i++) result[i] = known || !isGuessed(gap, i) ? 255 * between(i) : row[i];
  return result;
}

const codesBetween = {
  speed: (top, all) => {
    const { exact } = film, falls = film.gravity.some(Boolean);
    return i => {
      const anchor = ANCHOR[i], x = VX[i], y = VY[i];
      if (exact || anchor < 0) return Math.sqrt(x * x + y * y) / top;
      const before = all[anchor * disks + i] / 255;
      return falls ? Math.sqrt(Math.max(0, before * before + FALL[i] / (top * top))) : before;
    };
  },
  displacement: top => {
    const [width, height] = film.edges, crossed = crossedUntil(moment.gap);
    return i => {
      const x = width * (UX[i] + (crossed ? crossed[2 * i] : 0) - origins[2 * i]);
      const y = height * (UY[i] + (crossed ? crossed[2 * i + 1] : 0) - origins[2 * i + 1]);
      return Math.sqrt(x * x + y * y) / top;
    };
  },
  collisions: (top, all) => i => {
    const before = all[moment.gap * disks + i] / 255, scale = Math.log1p(top);
    return HITS[i] ? Math.log1p(Math.expm1(before * scale) + HITS[i]) / scale : before;
  },
};

// The flights of a disk in a gap, in units of the room: [share of the gap, x, y] of each end, without jumps.
function knots(gap, i) {
  const at = 2 * (gap * disks + i), to = at + 2 * disks, list = [[0, positions[at] / grain, positions[at + 1] / grain]];
  const first = gapStart[gap] + turning.subarray(gapStart[gap], gapStart[gap + 1]).indexOf(i);
  for (let k = first; k >= gapStart[gap] && k < gapStart[gap + 1] && turning[k] === i; k++) list.push([...turns.subarray(3 * k, 3 * k + 3)]);
  const code = shifts ? shifts[(gap + 1) * disks + i] : 0x88;
  list.push([1, positions[to] / grain + (code >> 4) - 8, positions[to + 1] / grain + (code & 15) - 8]);
  return list;
}

// The path of a disk between two frames or moments, flight by flight: from, to, and what bends it (0, 0 if straight).
function flights(i, from, to) {
  const result = [], [width, height] = film.edges, [left, bottom] = film.lower;
  for (let gap = Math.min(frameAt(from), frames - 2); gap >= 0 && gap < frames - 1 && film.time[gap] < to; gap++) {
    const h = film.time[gap + 1] - film.time[gap], points = knots(gap, i), straight = isGuessed(gap, i);
    for (let k = 1; k < points.length; k++) {
      const [u0, x0, y0] = points[k - 1], [u1, x1, y1] = points[k], span = h * (u1 - u0);
      const a = Math.max(0, (from - film.time[gap] - h * u0) / span), b = Math.min(1, (to - film.time[gap] - h * u0) / span);
      if (!(span > 0 && b > a)) continue;
      const at = (s, start, end, g) => start + s * (end - start) + (straight ? 0 : 0.5 * g * span * span * s * (s - 1));
      const place = s => [at(s, left + width * x0, left + width * x1, film.gravity[0]), at(s, bottom + height * y0, bottom + height * y1, film.gravity[1])];
      const bend = straight ? 0 : (b - a) ** 2 * span * span / 4;
      result.push({ from: place(a), to: place(b), bend: film.gravity.map(g => bend * g), straight });
    }
  }
  return result;
}
