// ---------- events to come, for few disks ----------

// What the program keeps in its queue, computed anew from this moment's places and velocities: for each disk the
// first disk, side or obstacle that it would meet if nothing else came in between. Crossings of cells are left out.
const coming = { shown: false, first: null, list: [], lost: [], happened: [] };

function predict() {
  const list = [];
  for (let i = 0; i < disks; i++) {
    const next = [...pairsOf(i), ...sidesOf(i)].reduce(earlier, null), own = obstaclesOf(i, next?.after ?? last() - first());
    const event = own.reduce(earlier, next);
    if (event && isFinite(event.after)) list.push(event);
  }
  const seen = new Set();
  return list.map(event => ({ ...event, time: moment.time + event.after })).sort((a, b) => a.time - b.time)
    .filter(({ key }) => !seen.has(key) && seen.add(key));
}

const earlier = (a, b) => !a || b.after < a.after ? b : a;
const radiusOf = i => film.radii[sizeOf[i]];

// Two disks fly past each other in a straight line, under gravity too: it moves both alike.
function pairsOf(i) {
  const list = [], [along, up] = film.periodic.map((p, axis) => p ? [-2, -1, 0, 1, 2].map(k => k * film.edges[axis]) : [0]);
  for (let j = 0; j < disks; j++) if (j !== i) for (const sx of along) for (const sy of up) {
    const dx = X[j] + sx - X[i], dy = Y[j] + sy - Y[i], vx = VX[j] - VX[i], vy = VY[j] - VY[i];
    const b = dx * vx + dy * vy, c = dx * dx + dy * dy - (radiusOf(i) + radiusOf(j)) ** 2, root = b * b - (vx * vx + vy * vy) * c;
    if (b >= 0 || root < 0) continue;
    list.push({ i, j, dx, dy, after: Math.max(0, c / (Math.sqrt(root) - b)), key: [Math.min(i, j), Math.max(i, j)].join(), name: `disk ${j + 1}` });
  }
  return list;
}

function sidesOf(i) {
  const names = [['left', 'right'], ['bottom', 'top']];
  return [[X[i], VX[i]], [Y[i], VY[i]]].flatMap(([place, speed], axis) => film.periodic[axis] ? [] : [1, -1].map((sign, end) => {
    const wall = film.lower[axis] + end * film.edges[axis];
    const after = fallTime(sign * (place - wall) - radiusOf(i), sign * speed, sign * film.gravity[axis]);
    return { i, j: -1, after, key: `${i} ${names[axis][end]}`, name: `the ${names[axis][end]} side` };
  }));
}

// When a gap closes that changes with speed v and acceleration a.
function fallTime(gap, v, a) {
  gap = Math.max(0, gap);
  const square = v * v - 2 * a * gap, root = Math.sqrt(square);
  if (square < 0 || (v >= 0 && a >= 0)) return Infinity;
  return v < 0 ? 2 * gap / (root - v) : (v + root) / -a;
}

function obstaclesOf(i, horizon) {
  const nearest = (d, axis) => film.periodic[axis] ? d - film.edges[axis] * Math.round(d / film.edges[axis]) : d;
  const r = radiusOf(i), round = ([cx, cy, radius, inside], k) => [(x, y) => {
    const far = Math.hypot(nearest(x - cx, 0), nearest(y - cy, 1));
    return inside ? radius - r - far : far - radius - r;
  }, `obstacle ${k + 1}`];
  const straight = ([[x0, y0], [x1, y1]], k) => [(x, y) => {
    const ex = x1 - x0, ey = y1 - y0, dx = nearest(x - (x0 + x1) / 2, 0), dy = nearest(y - (y0 + y1) / 2, 1);
    const share = Math.max(-0.5, Math.min(0.5, (dx * ex + dy * ey) / (ex * ex + ey * ey)));
    return Math.hypot(dx - share * ex, dy - share * ey) - r;
  }, `wall ${k + 1}`];
  return [...film.obstacles.map(round), ...film.walls.map(straight)]
    .map(([gap, name]) => ({ i, j: -1, after: approach(i, gap, horizon), key: `${i} ${name}`, name }));
}

// When a gap to something of any shape closes: the disk flies ahead by what it may without touching, again and again.
function approach(i, gap, horizon) {
  const [gx, gy] = film.gravity, g = Math.hypot(gx, gy), close = 1e-10 * radiusOf(i);
  const gapAt = t => gap(X[i] + t * (VX[i] + gx * t / 2), Y[i] + t * (VY[i] + gy * t / 2));
  for (let t = 0, step = 0; step < 2000 && t <= horizon; step++) {
    const room = gapAt(t), v = Math.hypot(VX[i] + gx * t, VY[i] + gy * t);
    if (room < 100 * close && gapAt(t + 1e-7 * radiusOf(i) / (v || 1)) > room) {  // it has just left
      t += 1e-6 * radiusOf(i) / (v || 1);
      continue;
    }
    if (room < close) return t;
    t += 2 * room / (v + Math.sqrt(v * v + 2 * g * room));
    if (!isFinite(t)) break;
  }
  return Infinity;
}

function updateQueue() {
  if (!coming.shown) return;
  const known = moment.time < last() && moment.known;
  const before = coming.list, list = known ? predict() : [];
  const same = (a, b) => a.key === b.key && Math.abs(a.time - b.time) < 1e-6 * (1 + Math.abs(a.time));
  const forward = before.length && moment.time >= coming.time && moment.time <= before[0].time + 1e-3 * (last() - first());
  if (forward) {
    const gone = before.filter(old => !list.some(event => same(event, old)));
    if (gone.length) {
      coming.happened = gone.filter(old => old.time <= moment.time);
      coming.lost = gone.filter(old => old.time > moment.time);
      list.forEach(event => { event.fresh = !before.some(old => same(event, old)); });
    } else list.forEach(event => { event.fresh = before.find(old => same(event, old))?.fresh; });
  } else coming.happened = coming.lost = [];
  Object.assign(coming, { list, first: list[0] ?? null, time: moment.time });
}

const meeting = ({ i, name }) => `disk ${i + 1} and ${name}`;

function tellQueue() {
  if (!coming.shown) return;
  const row = event => {
    const item = document.createElement('li'), time = document.createElement('span');
    item.textContent = meeting(event);
    item.className = event.fresh ? 'fresh' : '';
    time.textContent = `t = ${long(event.time)}`;
    item.append(time);
    return item;
  };
  $('queue').replaceChildren(...coming.list.slice(0, 20).map(row));
  $('due').textContent = coming.first ? `the first in ${short(coming.first.after)}` : '';
  const say = (list, words) => list.length ? `${words}: ${list.map(meeting).join('; ')}.` : '';
  $('happened').textContent = [say(coming.happened, 'Happened'), say(coming.lost, 'No longer true')].join(' ').trim() || ' ';
  $('predicted').textContent = film.guesses[moment.gap]
    ? `Collisions between these two frames are not in the file: ${remedy}.`
    : 'Predicted in this page, from the places and velocities of this moment: what each disk meets first if nothing comes in '
      + 'between. Green: predicted anew at the last event.';
}

// A line between the two, and where they will be at contact.
function drawNextEvent({ i, j, dx, dy, after }) {
  const [gx, gy] = film.gravity, ahead = k => [X[k] + after * (VX[k] + gx * after / 2), Y[k] + after * (VY[k] + gy * after / 2)];
  const [x, y] = ahead(i);
  marks.strokeStyle = ink.accent;
  marks.lineWidth = 2 * page.dots;
  marks.setLineDash([5 * page.dots, 4 * page.dots]);
  ring(x, y, radii[sizeOf[i]]);
  if (j >= 0) ring(...ahead(j), radii[sizeOf[j]]);
  marks.setLineDash([]);
  const [x1, y1] = j >= 0 ? [X[i] + dx, Y[i] + dy] : [x, y];
  copies([Math.min(X[i], x1), Math.max(X[i], x1)], [Math.min(Y[i], y1), Math.max(Y[i], y1)], (sx, sy) => {
    marks.beginPath();
    marks.moveTo(across(X[i] + sx), up(Y[i] + sy));
    marks.lineTo(across(x1 + sx), up(y1 + sy));
    marks.stroke();
  });
}
