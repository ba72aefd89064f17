// ---------- the stage: ground (box, obstacles), disks, marks (traces, arrows, events to come) ----------

const layers = ['ground', 'disks', 'marks'].map($);
const [ground, disksBrush, marks] = layers.map((layer, k) => layer.getContext('2d', { willReadFrequently: k === 1 }));
let ink;                       // colours of the theme
let picture, pixels, palette;  // the layer of the disks; its pixels as integers; the colours of disks
let radii;                     // in pixels
let groundShown, marked;       // what the ground shows; whether there are marks

const dark = () => document.documentElement.dataset.theme === 'dark';
const cssColour = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
const css = rgb => `rgb(${rgb})`;

// Colours of species and of the scale, 0 to 255; on a dark ground the darkest are lightened, but not those of one's own.
function speciesColour({ colour, own }) {
  const parts = [1, 3, 5].map(k => parseInt((own ?? colour).slice(k, k + 2), 16));
  return parts.map(part => Math.round(dark() && !own ? part + 0.22 * (255 - part) : part));
}

function scaleColour(place) {
  const k = 3 * Math.round(dark() ? 36 + place * 219 / 255 : place);
  return viridis.slice(k, k + 3);
}

function layOutStage() {
  ink = Object.fromEntries(['ink', 'soft', 'line', 'stage', 'wall', 'obstacle', 'card', 'accent'].map(n => [n, cssColour(n)]));
  const dots = Math.min(devicePixelRatio || 1, 2), margin = page.margin = 3 * dots, [width, height] = film.edges;
  const room = roomOfStage();
  page.dots = dots;
  page.unit = Math.min((room.width * dots - 2 * margin) / width, (room.height * dots - 2 * margin) / height);
  page.width = Math.round(width * page.unit + 2 * margin);
  page.height = Math.round(height * page.unit + 2 * margin);
  for (const layer of layers) Object.assign(layer, { width: page.width, height: page.height });
  Object.assign($('stage').style, { width: page.width / dots + 'px', height: page.height / dots + 'px' });
  picture = disksBrush.createImageData(page.width, page.height);
  pixels = new Int32Array(picture.data.buffer);
  const colours = codes[state.colour] ? Array.from({ length: 256 }, (_, k) => scaleColour(k)) : kinds.map(speciesColour);
  palette = Int32Array.from(colours, ([r, g, b]) => 0xff000000 + (b << 16) + (g << 8) + r);
  groundShown = '';
  stamps = new Map();
}

// In CSS pixels: beside the controls on a flat screen, else above them. On a telephone the view has no card of its own,
// and between disks and controls is the histogram.
function roomOfStage() {
  const full = document.fullscreenElement === $('view'), bare = getComputedStyle($('view')).display === 'contents';
  const frame = bare ? $('main') : $('view'), style = getComputedStyle(frame);
  const inner = size => parseFloat(style[size]) || 0;
  const width = frame.clientWidth - inner('paddingLeft') - inner('paddingRight');
  // The height of the screen without what a telephone adds while something is too wide for it.
  const height = document.documentElement.clientHeight - (full ? 0 : $('top').offsetHeight) - inner('paddingTop') - inner('paddingBottom') - 2;
  if (cssColour('flat')) return { width: width - Math.max(260, 0.45 * width), height };
  const between = bare ? $('speeds').offsetHeight : 0;
  return { width, height: Math.max(full ? 100 : isPart ? 200 : 300, height - $('controls').offsetHeight - between - 16) };
}

function drawStage() {
  aim();
  radii = film.radii.map(radius => Math.max(0.6, radius * view.unit));
  if (stamps.size > 2 * kinds.length) stamps = new Map();  // the zoom has changed
  const seen = [view.unit, view.x, view.y, ...sidesAt(moment.shown)].join();
  if (groundShown !== seen) drawGround();
  groundShown = seen;
  drawDisks();
  drawMarks();
}

function drawGround() {
  ground.fillStyle = ink.stage;
  ground.fillRect(0, 0, page.width, page.height);
  const [x0, x1, y0, y1] = sidesAt(moment.shown);
  inBox(ground, () => {
    if (film.sides.some(side => side.motion)) {
      ground.fillStyle = ink.obstacle;
      ground.fillRect(0, 0, page.width, page.height);
      ground.fillStyle = ink.stage;
      copies([x0, x1], [y0, y1], (dx, dy) => ground.fillRect(across(x0 + dx), up(y1 + dy), (x1 - x0) * view.unit, (y1 - y0) * view.unit));
    }
    for (const [x, y, radius, inside] of film.obstacles) {
      if (inside) {
        ground.fillStyle = ink.obstacle;
        ground.fillRect(0, 0, page.width, page.height);
      }
      ground.fillStyle = inside ? ink.stage : ink.obstacle;
      ground.strokeStyle = ink.wall;
      ground.lineWidth = page.dots;
      copies([x - radius, x + radius], [y - radius, y + radius], (dx, dy) => {
        ground.beginPath();
        ground.arc(across(x + dx), up(y + dy), radius * view.unit, 0, 2 * Math.PI);
        ground.fill();
        ground.stroke();
      });
    }
    ground.strokeStyle = ink.wall;
    ground.lineWidth = 1.5 * page.dots;
    for (const [[a, b], [c, d]] of film.walls) copies([Math.min(a, c), Math.max(a, c)], [Math.min(b, d), Math.max(b, d)], (dx, dy) => {
      ground.stroke(new Path2D(`M${across(a + dx)},${up(b + dy)}L${across(c + dx)},${up(d + dy)}`));
    });
  });
  // The sides, dashed where they are periodic.
  ground.strokeStyle = ink.wall;
  ground.lineWidth = 1.5 * page.dots;
  copies([x0, x1], [y0, y1], (dx, dy) => {
    const left = across(x0 + dx), right = across(x1 + dx), bottom = up(y0 + dy), top = up(y1 + dy);
    for (const [axis, from, to] of [[0, [left, top], [left, bottom]], [0, [right, top], [right, bottom]], [1, [left, top], [right, top]], [1, [left, bottom], [right, bottom]]]) {
      ground.setLineDash(film.periodic[axis] ? [6 * page.dots, 5 * page.dots] : []);
      ground.stroke(new Path2D(`M${from}L${to}`));
    }
  });
  ground.setLineDash([]);
}

// What is seen of the room and of its periodic images: left, top, right, bottom.
function seenBox() {
  const [x0, y0] = film.lower, [width, height] = film.edges, [wrapX, wrapY] = film.periodic;
  return [wrapX ? 0 : Math.max(0, across(x0)), wrapY ? 0 : Math.max(0, up(y0 + height)),
    wrapX ? page.width : Math.min(page.width, across(x0 + width)), wrapY ? page.height : Math.min(page.height, up(y0))];
}

function inBox(brush, action) {
  const [left, top, right, bottom] = seenBox();
  brush.save();
  brush.beginPath();
  brush.rect(left, top, right - left, bottom - top);
  brush.clip();
  action();
  brush.restore();
}

// ---------- disks ----------

// Pixel by pixel into an array: far faster than thousands of arcs. Small disks are stamped; what a stamp looks like
// depends on where in a pixel the centre is.
const PHASES = 8, LARGEST_STAMP = 16;
let stamps = new Map();  // by radius

function drawDisks() {
  const code = codes[state.colour] && codesNow(state.colour), [width, height] = film.edges, wraps = film.periodic.some(Boolean);
  const { unit, x: x0, y: y0 } = view, high = page.height, stampOf = radii.map(stampFor);
  const [left, top, right, bottom] = seenBox();
  const clip = [Math.ceil(left), Math.ceil(top), Math.floor(right) - 1, Math.floor(bottom) - 1];
  pixels.fill(0);
  for (let i = 0; i < disks; i++) {
    const kind = speciesOf[i], size = sizeOf[i], r = radii[size], colour = palette[code ? code[i] : kind], x = X[i], y = Y[i];
    if (!wraps) {
      drawDisk((x - x0) * unit, high - (y - y0) * unit, r, colour, stampOf[size], clip);
      continue;
    }
    const reach = r / unit, a1 = lastCopy(0, x - reach), b0 = firstCopy(1, y + reach), b1 = lastCopy(1, y - reach);
    for (let a = firstCopy(0, x + reach); a <= a1; a++)
      for (let b = b0; b <= b1; b++) drawDisk(across(x + a * width), up(y + b * height), r, colour, stampOf[size], clip);
  }
  disksBrush.putImageData(picture, 0, 0);
}

function drawDisk(x, y, radius, colour, stamp, clip) {
  const cx = x - 0.5, cy = y - 0.5, reach = radius + 1, out = pixels;
  if (cx + reach < clip[0] || cx - reach > clip[2] || cy + reach < clip[1] || cy - reach > clip[3]) return;
  if (!stamp || cx - reach < clip[0] || cx + reach > clip[2] || cy - reach < clip[1] || cy + reach > clip[3]) {
    drawPart(cx, cy, radius, colour, clip);
    return;
  }
  const i = Math.floor(cx), j = Math.floor(cy), base = j * page.width + i, { list, rims, ends } = stamp;
  const phase = PHASES * Math.floor(PHASES * (cy - j)) + Math.floor(PHASES * (cx - i)), rim = rims[phase], end = ends[phase];
  for (let k = phase ? ends[phase - 1] : 0; k < rim; k++) out[base + list[k]] = colour;
  for (let k = rim; k < end; k++) {
    const edge = list[k], at = base + (edge >> 8), old = out[at];
    if (old === 0) out[at] = colour & 0xffffff | edge << 24; else out[at] = painted(old, colour, edge & 255);
  }
}

// A function of its own: what it hands on would make the one above slow.
function drawPart(cx, cy, radius, colour, clip) {
  eachPixel(cx, cy, radius, clip, (at, covered) => { pixels[at] = painted(pixels[at], colour, covered); });
}

// Of each phase the pixels inside, from where the centre is, and those on the rim: 256 times that, and how much of 255 is covered.
function stampFor(radius) {
  if (stamps.has(radius) || radius > LARGEST_STAMP) return stamps.get(radius);
  const all = [], rims = [], ends = [], size = Math.ceil(radius + 2);
  for (let phase = 0; phase < PHASES * PHASES; phase++) {
    const rim = [], x = (phase % PHASES + 0.5) / PHASES, y = (Math.floor(phase / PHASES) + 0.5) / PHASES;
    eachPixel(x, y, radius, [-size, -size, size, size], (at, covered) => {
      if (covered === 255) all.push(at); else if (covered) rim.push(256 * at + covered);
    });
    rims.push(all.length);
    all.push(...rim);
    ends.push(all.length);
  }
  stamps.set(radius, { list: Int32Array.from(all), rims: Int32Array.from(rims), ends: Int32Array.from(ends) });
  return stamps.get(radius);
}

// Row by row, the pixels that a disk covers, and how much of 255.
function eachPixel(cx, cy, radius, [left, top, right, bottom], action) {
  const reach = radius + 0.5, inner = radius > 0.5 ? (radius - 0.5) ** 2 : -1;
  for (let j = Math.max(top, Math.ceil(cy - reach)); j <= Math.min(bottom, Math.floor(cy + reach)); j++) {
    const dd = (j - cy) * (j - cy), half = Math.sqrt(Math.max(0, reach * reach - dd)), row = j * page.width;
    const end = Math.min(right, Math.floor(cx + half));
    for (let i = Math.max(left, Math.ceil(cx - half)); i <= end; i++) {
      const square = (i - cx) * (i - cx) + dd;
      action(row + i, square <= inner ? 255 : Math.min(255, 255 * (reach - Math.sqrt(square)) | 0));
    }
  }
}

// A pixel, so far `old`, on the rim of a disk: beside other disks the colours are mixed, what they cover adds up.
function painted(old, colour, covered) {
  const there = old >>> 24;
  if (covered === 255) return colour;
  if (there === 0) return colour & 0xffffff | covered << 24;
  const total = Math.min(255, covered + there), part = 256 * covered / total | 0, rest = 256 - part;
  const redBlue = (Math.imul(colour & 0xff00ff, part) + Math.imul(old & 0xff00ff, rest)) >>> 8 & 0xff00ff;
  const green = (Math.imul(colour & 0xff00, part) + Math.imul(old & 0xff00, rest)) >>> 8 & 0xff00;
  return redBlue | green | total << 24;
}

// ---------- marks ----------

function drawMarks() {
  const wanted = state.traced.length || state.arrows || film.exact || angles;
  if (wanted || marked) marks.clearRect(0, 0, page.width, page.height);
  marked = wanted;
  if (!wanted) return;
  inBox(marks, () => {
    if (angles) drawRadii();
    state.traced.forEach(drawTrace);
    if (state.arrows) drawArrows();
    if (film.events && moment.known) drawNextEvent();
    if (film.exact) drawNumbers();
  });
}

// A radius of each disk that is large enough for one shows how it turns; between frames evenly, as only they know its spin.
function drawRadii() {
  const at = moment.gap * disks, next = Math.min(moment.gap + 1, frames - 1) * disks;
  marks.strokeStyle = ink.stage;
  marks.lineWidth = 1.2 * page.dots;
  marks.beginPath();
  for (let i = 0; i < disks; i++) {
    const length = radii[sizeOf[i]], reach = length / view.unit, angle = angles[at + i] + moment.share * (angles[next + i] - angles[at + i]);
    if (length < 3 * page.dots) continue;
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      const x = across(X[i] + dx), y = up(Y[i] + dy);
      marks.moveTo(x, y);
      marks.lineTo(x + length * Math.cos(angle), y - length * Math.sin(angle));
    });
  }
  marks.stroke();
}

// Where a disk was in the last frames, the older part pale.
function drawTrace(i) {
  const recent = film.time[Math.max(0, moment.frame - 30)];
  for (const straight of [0, 1]) {  // dotted where the path is not known
    const part = (from, to) => flights(i, from, to).filter(flight => flight.straight === straight);
    marks.setLineDash(straight ? [page.dots, 4 * page.dots] : []);
    drawPath(part(film.time[Math.max(0, moment.frame - 300)], recent), ink.soft, 0.9);
    drawPath(part(recent, moment.shown), ink.ink, 1.6);
  }
  marks.setLineDash([]);
  marks.lineWidth = 2 * page.dots;
  ring(X[i], Y[i], Math.max(radii[sizeOf[i]], 3 * page.dots) + 2 * page.dots);
}

function ring(x, y, radius) {
  const reach = radius / view.unit;
  copies([x - reach, x + reach], [y - reach, y + reach], (dx, dy) => {
    marks.beginPath();
    marks.arc(across(x + dx), up(y + dy), radius, 0, 2 * Math.PI);
    marks.stroke();
  });
}

// A flight through periodic sides shows in each image of the box.
function drawPath(list, colour, width) {
  marks.strokeStyle = colour;
  marks.lineWidth = width * page.dots;
  marks.lineCap = marks.lineJoin = 'round';
  marks.beginPath();
  let pen = [NaN, NaN];
  for (const { from: [x0, y0], to: [x1, y1], bend: [bx, by] } of list) {
    const x = (x0 + x1) / 2 - bx, y = (y0 + y1) / 2 - by;  // a parabola is a Bézier curve
    copies([Math.min(x0, x1, x), Math.max(x0, x1, x)], [Math.min(y0, y1, y), Math.max(y0, y1, y)], (dx, dy) => {
      const start = [across(x0 + dx), up(y0 + dy)];
      if (!(Math.hypot(start[0] - pen[0], start[1] - pen[1]) <= 0.1)) marks.moveTo(...start);
      pen = [across(x1 + dx), up(y1 + dy)];
      marks.quadraticCurveTo(across(x + dx), up(y + dy), ...pen);
    });
  }
  marks.stroke();
}

// The longest arrow of a usual speed is as long as disks are apart.
function drawArrows() {
  const usual = film.scales.speed[1], apart = Math.sqrt(film.edges[0] * film.edges[1] / Math.max(10, disks));
  const length = apart * view.unit / usual / Math.sqrt(camera.zoom);
  marks.beginPath();
  for (let i = 0; i < disks; i++) {
    const vx = VX[i] * length, vy = -VY[i] * length, size = Math.hypot(vx, vy);
    if (size < 1) continue;
    const head = Math.min(6 * page.dots, 0.5 * size) / size, reach = size / view.unit;
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      const x = across(X[i] + dx) + vx, y = up(Y[i] + dy) + vy;
      marks.moveTo(x - vx, y - vy);
      marks.lineTo(x, y);
      marks.lineTo(x - head * (vx + 0.5 * vy), y - head * (vy - 0.5 * vx));
      marks.moveTo(x, y);
      marks.lineTo(x - head * (vx - 0.5 * vy), y - head * (vy + 0.5 * vx));
    });
  }
  for (const [colour, width] of [[ink.stage, 3.2], [ink.ink, 1.4]]) {  // with a rim, to be seen on dark disks, too
    marks.strokeStyle = colour;
    marks.lineWidth = width * page.dots;
    marks.lineCap = marks.lineJoin = 'round';
    marks.stroke();
  }
}

// In disks that have the room, else beside them.
function drawNumbers() {
  const code = codes[state.colour] && codesNow(state.colour), least = 7 * page.dots;
  marks.textAlign = 'center';
  marks.textBaseline = 'middle';
  for (let i = 0; i < disks; i++) {
    const r = radii[sizeOf[i]], inside = r > least, colour = palette[code ? code[i] : speciesOf[i]];
    const light = (colour & 255) * 0.3 + (colour >> 8 & 255) * 0.59 + (colour >> 16 & 255) * 0.11 > 140;
    const reach = (r + 2 * least) / view.unit, away = inside ? 0 : r + least;
    marks.font = `600 ${Math.min(20 * page.dots, Math.max(12 * page.dots, r))}px system-ui, sans-serif`;
    marks.fillStyle = !inside ? ink.ink : light ? '#101418' : '#ffffff';
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      marks.fillText(i + 1, across(X[i] + dx) + away, up(Y[i] + dy) - away);
    });
  }
}
