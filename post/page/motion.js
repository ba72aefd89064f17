// ---------- where the disks are at a moment ----------

// A gap is the time between two frames. In it a disk flies from one frame to the next, by way of its turns; each
// flight is straight, or a parabola under gravity. A guessed path is a straight line.
const moment = { time: 0, frame: 0, gap: 0, share: 0 };
let X, Y, VX, VY;  // of all disks at the moment; inside the box along a periodic axis

function newMoment() {
  [X, Y, VX, VY] = Array.from({ length: 4 }, () => new Float64Array(disks));
}

// The last frame that is not later.
function frameAt(time) {
  let low = 0, high = frames - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (film.time[middle] <= time) low = middle; else high = middle - 1;
  }
  return low;
}

function move(time) {
  moment.time = Math.max(first(), Math.min(last(), time));
  moment.frame = frameAt(moment.time);
  const gap = moment.gap = Math.max(0, Math.min(moment.frame, frames - 2)), next = Math.min(gap + 1, frames - 1);
  const h = film.time[next] - film.time[gap], u = moment.share = h > 0 ? (moment.time - film.time[gap]) / h : 1;
  const [width, height] = film.edges, [left, bottom] = film.lower, [wrapX, wrapY] = film.periodic;
  const gx = film.gravity[0] / width, gy = film.gravity[1] / height, start = 2 * gap * disks, end = 2 * next * disks;
  for (let i = 0, turn = gapStart[gap], stop = gapStart[next]; i < disks; i++) {
    let u0 = 0, u1 = 1;
    let x0 = positions[start + 2 * i] / grain, y0 = positions[start + 2 * i + 1] / grain;
    let x1 = positions[end + 2 * i] / grain, y1 = positions[end + 2 * i + 1] / grain;
    if (shifts && next > gap) {
      const code = shifts[next * disks + i];
      x1 += (code >> 4) - 8;
      y1 += (code & 15) - 8;
    }
    for (; turn < stop && turning[turn] === i; turn++) {
      const t = turns[3 * turn], x = turns[3 * turn + 1], y = turns[3 * turn + 2];
      if (t <= u && t < 1) { u0 = t; x0 = x; y0 = y; } else { u1 = t; x1 = x; y1 = y; break; }
    }
    while (turn < stop && turning[turn] === i) turn++;
    const span = h * (u1 - u0), free = span > 0, share = free ? (u - u0) / (u1 - u0) : 1;
    const bend = isGuessed(gap, i) ? 0 : 0.5 * h, both = u - u0 + u - u1, product = h * (u - u0) * (u - u1);
    let x = x0 + share * (x1 - x0) + bend * gx * product, y = y0 + share * (y1 - y0) + bend * gy * product;
    VX[i] = free ? width * ((x1 - x0) / span + bend * gx * both) : 0;
    VY[i] = free ? height * ((y1 - y0) / span + bend * gy * both) : 0;
    if (wrapX) x -= Math.floor(x);
    if (wrapY) y -= Math.floor(y);
    X[i] = left + width * x;
    Y[i] = bottom + height * y;
  }
}

// The flights of a disk in a gap, in units of the box: [share of the gap, x, y] of each end, without jumps.
function knots(gap, i) {
  const at = 2 * (gap * disks + i), to = at + 2 * disks, list = [[0, positions[at] / grain, positions[at + 1] / grain]];
  let low = gapStart[gap], high = gapStart[gap + 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (turning[middle] < i) low = middle + 1; else high = middle;
  }
  for (let k = low; k < gapStart[gap + 1] && turning[k] === i; k++) list.push([...turns.subarray(3 * k, 3 * k + 3)]);
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
      result.push({ from: place(a), to: place(b), bend: film.gravity.map(g => bend * g) });
    }
  }
  return result;
}
