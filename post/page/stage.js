// ---------- picture of the simulation in three layers: the box with its obstacles, the disks, and marks (paths, arrows, next
// events) ----------

const layers = ['ground', 'disks', 'marks'].map($);
const [ground, disksBrush, marks] = layers.map((layer, k) => layer.getContext('2d', { willReadFrequently: k === 1 }));
let ink;                       // colours of the theme
let picture, pixels, palette, paper;  // image of the disks; its pixels as integers; colours of disks and background in the same format
let radii;                     // of each size [pixels]
let warmest, sliding;          // highest temperature of a boundary; whether a boundary slides
let groundShown, marked;       // view for which the ground was drawn; whether the layer of marks contains marks

const dark = () => document.documentElement.dataset.theme === 'dark';
const cssColour = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
const css = rgb => `rgb(${rgb})`;

// In both colour themes, disks have a contrast of at least 3:1 to the background. Luminance increases along each colour scale and
// differs between species, so that different values and species can be distinguished in greyscale.
const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
const LIGHTS = { false: [0.02, 0.29, [0.11, 0.28, 0.04, 0.2, 0.07]], true: [0.14, 0.85, [0.27, 0.5, 0.14, 0.38, 0.2]] };
const toLinear = part => part <= 10.3 ? part / 3294.6 : ((part / 255 + 0.055) / 1.055) ** 2.4;
const fromLinear = part => Math.round(255 * (part <= 0.0031308 ? 12.92 * part : 1.055 * part ** (1 / 2.4) - 0.055));
const luminance = rgb => rgb.map(toLinear).reduce((sum, part, k) => sum + part * [0.2126, 0.7152, 0.0722][k], 0);

function withLuminance(rgb, wanted) {
  const own = luminance(rgb), white = own < wanted ? (wanted - own) / (1 - own) : 0, rest = own > wanted ? wanted / own : 1;
  return rgb.map(part => fromLinear(rest * toLinear(part) * (1 - white) + white));
}

function speciesColour(kind) {
  const steps = LIGHTS[dark()][2], parts = [1, 3, 5].map(k => parseInt(kind.colour.slice(k, k + 2), 16));
  return withLuminance(parts, steps[kinds.indexOf(kind) % steps.length]);
}

function scaleColour(place) {
  const at = place / 255 * (VIRIDIS.length - 1), k = Math.min(Math.floor(at), VIRIDIS.length - 2), [low, high] = LIGHTS[dark()];
  return withLuminance(VIRIDIS[k].map((part, c) => part + (at - k) * (VIRIDIS[k + 1][c] - part)), low + (high - low) * place / 255);
}

// Each function returns the value of a quantity for a disk at the time shown, scaled to the range from 0 to 1. If colours
// represent species, none of them is used.
const quantities = {
  speed: i => Math.sqrt(VX[i] * VX[i] + VY[i] * VY[i]) / film.scales.speed[1],
  displacement: i => displacement(i) / film.scales.displacement[1],
  collisions(i) {  // on a logarithmic scale
    const scale = Math.log1p(film.scales.collisions[1]), before = past[moment.frame].hits[i] / 255;
    return HITS[i] ? Math.log1p(Math.expm1(before * scale) + HITS[i]) / scale : before;
  },
};

function codesNow(name) {
  const own = quantities[name];
  return own && Uint8ClampedArray.from({ length: disks }, (_, i) => 255 * own(i));
}

function layOutStage() {
  ink = Object.fromEntries(['ink', 'soft', 'line', 'stage', 'wall', 'obstacle', 'card', 'accent', 'hot', 'cold'].map(n => [n, cssColour(n)]));
  const dots = Math.min(devicePixelRatio || 1, 2), margin = page.margin = (film.sides.some(actsOn) ? 10 : 3) * dots, [width, height] = film.edges;
  const room = roomOfStage();
  page.dots = dots;
  page.unit = Math.min((room.width * dots - 2 * margin) / width, (room.height * dots - 2 * margin) / height);
  page.width = Math.round(width * page.unit + 2 * margin);
  page.height = Math.round(height * page.unit + 2 * margin);
  for (const layer of layers) Object.assign(layer, { width: page.width, height: page.height });
  const [wide, high] = [page.width, page.height].map(size => size / dots), rest = boxSize && `0 0 ${boxSize.height - high}px ${boxSize.left + (boxSize.width - wide) / 2}px`;
  Object.assign($('stage').style, { width: wide + 'px', height: high + 'px', margin: rest ?? '' });
  picture = disksBrush.createImageData(page.width, page.height);
  pixels = new Int32Array(picture.data.buffer);
  const colours = quantities[state.colour] ? Array.from({ length: 256 }, (_, k) => scaleColour(k)) : kinds.map(speciesColour);
  const paperParts = [1, 3, 5].map(k => parseInt(ink.stage.slice(k, k + 2), 16));
  [paper, ...palette] = Int32Array.from([paperParts, ...colours], ([r, g, b]) => 0xff000000 + (b << 16) + (g << 8) + r);
  const laws = [film.sides, film.laws.obstacle, film.laws.wall].flat();
  warmest = laws.reduce((most, law) => Math.max(most, law?.temperature ?? 0), 0);
  sliding = laws.some(law => law?.surface_velocity);
  groundShown = '';
}

// Returns the space available for the picture [CSS pixels]: beside the controls on a wide screen, above them on a narrow one. On
// a mobile phone the histogram of speeds is between picture and controls.
function roomOfStage() {
  if (boxSize) return boxSize;
  const full = document.fullscreenElement === $('view'), bare = getComputedStyle($('view')).display === 'contents';
  const frame = bare ? $('main') : $('view'), style = getComputedStyle(frame);
  const inner = size => parseFloat(style[size]) || 0;
  const width = frame.clientWidth - inner('paddingLeft') - inner('paddingRight');
  // `innerHeight` would grow on a mobile phone while the page is wider than the screen.
  const height = document.documentElement.clientHeight - (full ? 0 : $('top').offsetHeight) - inner('paddingTop') - inner('paddingBottom') - 2;
  if (cssColour('flat')) return { width: width - Math.max(260, 0.45 * width), height };
  const between = bare ? $('speeds').offsetHeight : 0;
  return { width, height: Math.max(full ? 100 : isPart ? 140 : 300, height - $('controls').offsetHeight - between - 16) };
}

// Disks too small to be visible are enlarged, with a note on the page.
const leastRadius = () => clamp(0.06 * Math.sqrt(film.edges[0] * film.edges[1] / disks) * page.unit, 1.1, 3 * page.dots);
const enlarged = () => film.radii.some(radius => radius * page.unit < leastRadius());

function drawStage() {
  aim();
  radii = film.radii.map(radius => Math.max(leastRadius(), radius * view.unit));
  const seen = [view.unit, view.x, view.y, ...sidesAt(moment.shown), ...openSides(), sliding && moment.shown].join();
  if (groundShown !== seen) drawGround();
  groundShown = seen;
  drawDisks();
  drawMarks();
}

// Sets the line style of a side or an obstacle. The hottest thermal boundaries have the colour for hot, all other thermal
// boundaries the colour for cold. Sliding boundaries have moving dashes. Returns true if the boundary is thermal or slides.
const actsOn = law => !!(law && (law.temperature || law.surface_velocity));
function drawLike(law, along = 1) {
  const dash = 7 * page.dots;
  ground.strokeStyle = !law?.temperature ? ink.wall : law.temperature < warmest ? ink.cold : ink.hot;
  ground.setLineDash(law?.surface_velocity ? [dash, dash] : []);
  ground.lineDashOffset = law?.surface_velocity ? -along * law.surface_velocity * moment.shown * view.unit % (2 * dash) : 0;
  return actsOn(law);
}

function drawGround() {
  ground.fillStyle = ink.stage;
  ground.fillRect(0, 0, page.width, page.height);
  const [x0, x1, y0, y1] = sidesAt(moment.shown), line = 1.5 * page.dots;
  inBox(ground, () => {
    if (film.sides.some(side => side.motion)) {
      ground.fillStyle = ink.obstacle;
      ground.fillRect(0, 0, page.width, page.height);
      ground.fillStyle = ink.stage;
      copies([x0, x1], [y0, y1], (dx, dy) => ground.fillRect(across(x0 + dx), up(y1 + dy), (x1 - x0) * view.unit, (y1 - y0) * view.unit));
    }
    film.obstacles.forEach(drawObstacle);
    film.walls.forEach(([[a, b], [c, d]], k) => copies([Math.min(a, c), Math.max(a, c)], [Math.min(b, d), Math.max(b, d)], (dx, dy) => {
      ground.lineWidth = drawLike(film.laws.wall[k]) ? 3 * line : line;
      ground.stroke(new Path2D(`M${across(a + dx)},${up(b + dy)}L${across(c + dx)},${up(d + dy)}`));
    }));
  });
  // Periodic sides are dashed and open sides dotted. Thermal and sliding sides have a coloured band outside the box.
  copies([x0, x1], [y0, y1], (dx, dy) => {
    const left = across(x0 + dx), right = across(x1 + dx), bottom = up(y0 + dy), top = up(y1 + dy);
    [[left, bottom, left, top], [right, bottom, right, top], [left, bottom, right, bottom], [left, top, right, top]].forEach(([a, b, c, d], k) => {
      const out = (k % 2 ? 1 : -1) * 5 * page.dots, [x, y] = k < 2 ? [out, 0] : [0, -out], periodic = film.periodic[k >> 1], isOpen = openSides()[k];
      if (!periodic && !isOpen && drawLike(film.sides[k])) {
        ground.lineWidth = 6 * page.dots;
        ground.stroke(new Path2D(`M${a + x},${b + y}L${c + x},${d + y}`));
      }
      ground.strokeStyle = ink.wall;
      ground.lineWidth = line;
      ground.lineDashOffset = 0;
      ground.setLineDash((isOpen ? [1.5, 6] : periodic ? [6, 5] : []).map(length => length * page.dots));
      ground.stroke(new Path2D(`M${a},${b}L${c},${d}`));
    });
  });
  ground.setLineDash([]);
}

// Draws an obstacle. An obstacle smaller than a pixel is drawn as a square of the same area, which is much faster. Circles are
// drawn clockwise; the positive direction of a sliding circle is counter-clockwise.
function drawObstacle([x, y, radius, inside, from, to], k) {
  const size = radius * view.unit, half = 0.886 * size;
  if (to !== undefined) { drawArc([x, y, size, from, to], k); return; }
  if (inside) {
    ground.fillStyle = ink.obstacle;
    ground.fillRect(0, 0, page.width, page.height);
  }
  ground.fillStyle = inside ? ink.stage : size < 1 ? ink.wall : ink.obstacle;
  ground.lineWidth = drawLike(film.laws.obstacle[k], -1) ? 4.5 * page.dots : page.dots;
  copies([x - radius, x + radius], [y - radius, y + radius], (dx, dy) => {
    if (size < 1) { ground.fillRect(across(x + dx) - half, up(y + dy) - half, 2 * half, 2 * half); return; }
    ground.beginPath();
    ground.arc(across(x + dx), up(y + dy), size, 0, 2 * Math.PI);
    ground.fill();
    ground.stroke();
  });
}

// Draws an arc between two angles [degrees] in the line style of a wall. The canvas measures angles clockwise; the arc is drawn
// counter-clockwise.
function drawArc([x, y, size, from, to], k) {
  ground.lineWidth = (drawLike(film.laws.obstacle[k]) ? 4.5 : 1.5) * page.dots;
  const radius = size / view.unit;
  copies([x - radius, x + radius], [y - radius, y + radius], (dx, dy) => {
    ground.beginPath();
    ground.arc(across(x + dx), up(y + dy), size, -from * Math.PI / 180, -to * Math.PI / 180, true);
    ground.stroke();
  });
}

// Returns left, top, right and bottom of the visible part of the box and its periodic images [pixels].
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

// ---------- drawing of the disks ----------

// Disks are drawn pixel by pixel into an array, which is much faster than drawing thousands of arcs on the canvas. If they are
// large enough, stripes distinguish the species: pattern 0 is plain, 1 has horizontal, 2 vertical, and 3 both horizontal and
// vertical stripes. Between the stripes the background is visible.
const SMALLEST_PATTERN = 3.5, PATTERNS = [0, 1, 2, 3];
const isStriped = (kind, radius) => PATTERNS[kind % PATTERNS.length] > 0 && radius >= SMALLEST_PATTERN * page.dots;
const bare = share => share - Math.floor(share) > 0.66;  // the last third of each period of the stripes is transparent

function drawDisks() {
  const code = codesNow(state.colour), [width, height] = film.edges, wraps = film.periodic.some(Boolean);
  const patterns = kinds.map((_, s) => radii.map(radius => isStriped(s, radius) ? PATTERNS[s % PATTERNS.length] : 0));
  const [left, top, right, bottom] = seenBox(), clip = [Math.ceil(left), Math.ceil(top), Math.floor(right) - 1, Math.floor(bottom) - 1];
  pixels.fill(0);
  for (let i = 0; i < disks; i++) {
    const kind = speciesOf[i], size = sizeOf[i], r = radii[size], pattern = patterns[kind][size], colour = palette[code ? code[i] : kind];
    const x = X[i], y = Y[i], reach = r / view.unit;
    if (!wraps) { drawDisk(across(x), up(y), r, colour, pattern, clip); continue; }
    const a1 = lastCopy(0, x - reach), b0 = firstCopy(1, y + reach), b1 = lastCopy(1, y - reach);
    for (let a = firstCopy(0, x + reach); a <= a1; a++)
      for (let b = b0; b <= b1; b++) drawDisk(across(x + a * width), up(y + b * height), r, colour, pattern, clip);
  }
  disksBrush.putImageData(picture, 0, 0);
}

function drawDisk(x, y, radius, colour, stripes, [left, top, right, bottom]) {
  const cx = x - 0.5, cy = y - 0.5, reach = radius + 0.5, inner = (radius - 0.5) ** 2;
  const often = 1 / Math.max(3.5 * page.dots, 0.55 * radius);  // stripes per pixel; a stripe runs through the centre
  const low = Math.max(top, Math.ceil(cy - reach)), high = Math.min(bottom, Math.floor(cy + reach));
  for (let j = low; j <= high; j++) {
    const between = stripes & 1 && bare((j - cy) * often + 0.33), dd = (j - cy) * (j - cy), half = Math.sqrt(Math.max(0, reach * reach - dd)), end = Math.min(right, Math.floor(cx + half));
    for (let i = Math.max(left, Math.ceil(cx - half)), at = j * page.width + i; i <= end; i++, at++) {
      const square = (i - cx) * (i - cx) + dd;
      if (square > inner) pixels[at] = painted(pixels[at], colour, 255 * (reach - Math.sqrt(square)) | 0);
      else pixels[at] = between || (stripes & 2 && bare((i - cx) * often + 0.33)) ? paper : colour;
    }
  }
}

// Returns the new colour of a pixel at the rim of a disk. The disk covers a fraction of the pixel, `covered` (0 to 255). If
// several disks cover parts of the pixel, their colours are mixed and the covered fractions added.
function painted(old, colour, covered) {
  const there = old >>> 24;
  if (there === 0) return colour & 0xffffff | covered << 24;
  const total = Math.min(255, covered + there), part = 256 * covered / total | 0, rest = 256 - part;
  const redBlue = (Math.imul(colour & 0xff00ff, part) + Math.imul(old & 0xff00ff, rest)) >>> 8 & 0xff00ff;
  const green = (Math.imul(colour & 0xff00, part) + Math.imul(old & 0xff00, rest)) >>> 8 & 0xff00;
  return redBlue | green | total << 24;
}

// ---------- drawing of marks: arrows, paths and next events ----------

function drawMarks() {
  const wanted = state.traced.length || state.arrows || film.exact || angles;
  if (wanted || marked) marks.clearRect(0, 0, page.width, page.height);
  marked = wanted;
  if (!wanted) return;
  inBox(marks, () => {
    if (angles) drawRadii();
    if (!isCentred()) state.traced.forEach(drawTrace);
    if (film.events && state.foretold && !isCentred()) drawNextEvent();
    if (isEncounter() && state.momenta) drawMomenta();
    if (state.arrows) drawArrows();
    if (film.exact) drawNumbers();
    drawHandles();
  });
  drawArrowKeys();
}

// Draws the orientation of each disk as a line from its centre to its rim, except in small disks.
const LEAST_TO_TURN = 2;
function drawRadii() {
  marks.strokeStyle = ink.stage;
  marks.lineWidth = 1.2 * page.dots;
  marks.beginPath();
  for (let i = 0; i < disks; i++) {
    const length = radii[sizeOf[i]], reach = length / view.unit, angle = angles[i];
    if (length < LEAST_TO_TURN * page.dots) continue;
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      const x = across(X[i] + dx), y = up(Y[i] + dy);
      marks.moveTo(x, y);
      marks.lineTo(x + length * Math.cos(angle), y - length * Math.sin(angle));
    });
  }
  marks.stroke();
}

// Draws the recent path of a disk, with its older part pale. Without an event log the path is approximate and therefore dotted.
function drawTrace(i) {
  const [old, recent] = [300, 30].map(k => frameTime(moment.frame - k));
  for (const [from, to, colour, width] of [[old, recent, ink.soft, 0.9], [recent, moment.shown, ink.ink, 1.6]]) {
    marks.setLineDash(film.note ? [page.dots, 4 * page.dots] : []);
    drawPath(flights(i, from, to), colour, width);
  }
  marks.setLineDash([]);
  marks.lineWidth = 2 * page.dots;
  ring(X[i], Y[i], Math.max(radii[sizeOf[i]], 3 * page.dots) + 2 * page.dots);
}

// Draws the free flights of the disks that take part in the next event, and their positions at the event, labelled with its time.
function drawNextEvent() {
  const [when, ...both] = source.coming().next[0] ?? [], places = [], after = when - moment.time, g = film.gravity;
  marks.strokeStyle = ink.accent;
  for (const i of both.filter(k => k >= 0)) {
    const from = [X[i], Y[i]], to = [VX[i], VY[i]].map((v, k) => from[k] + (v + 0.5 * g[k] * after) * after);
    drawPath([{ from, to, bend: g.map(one => one * after * after / 4) }], ink.accent, 2);
    marks.setLineDash([5 * page.dots, 4 * page.dots]);
    ring(...to, radii[sizeOf[i]]);
    marks.setLineDash([]);
    places.push([across(to[0]), up(to[1]), radii[sizeOf[i]]]);
  }
  if (places.length && film.exact) labelEvent(`next event: t = ${short(when)}`, places.sort(([, one], [, other]) => one - other));
}

// Writes a label above the upper of the marked disks or, if there is no room below the keys of the arrows, below the lower.
function labelEvent(words, places) {
  const size = 12 * page.dots, [x, y, r] = places[0], [, low, wide] = places.at(-1), isAbove = y - r > 5 * size;
  Object.assign(marks, { font: `${size}px system-ui, sans-serif`, fillStyle: ink.accent, textAlign: 'center', textBaseline: 'middle' });
  const half = marks.measureText(words).width / 2 + 4 * page.dots;
  marks.fillText(words, clamp(x, half, page.width - half), isAbove ? y - r - size : low + wide + size);
}

function ring(x, y, radius) {
  const reach = radius / view.unit;
  copies([x - reach, x + reach], [y - reach, y + reach], (dx, dy) => {
    marks.beginPath();
    marks.arc(across(x + dx), up(y + dy), radius, 0, 2 * Math.PI);
    marks.stroke();
  });
}

// Draws free flights of a disk. A flight that crosses a periodic side appears in each visible periodic image of the box.
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

// The arrow for a typical speed is as long as the mean distance between neighbouring disks.
const arrowScale = () => Math.sqrt(film.edges[0] * film.edges[1] / Math.max(10, disks)) * view.unit / arrowSpeed() / Math.sqrt(camera.zoom);

function drawArrows() {
  const length = arrowScale(), [ux, uy] = frameVelocity();
  marks.beginPath();
  for (let i = 0; i < disks; i++) {
    const vx = (VX[i] - ux) * length, vy = (uy - VY[i]) * length, size = Math.hypot(vx, vy);
    if (size < 1) continue;
    const head = Math.min(6 * page.dots, 0.5 * size) / size, reach = size / view.unit;
    const r = radii[sizeOf[i]], hidden = r < 5 * page.dots ? Math.max(head, 1 - r / size) : 1;  // starts at the rim of a small disk
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      const x = across(X[i] + dx) + vx, y = up(Y[i] + dy) + vy;
      marks.moveTo(x - hidden * vx, y - hidden * vy);
      marks.lineTo(x, y);
      marks.lineTo(x - head * (vx + 0.5 * vy), y - head * (vy - 0.5 * vx));
      marks.moveTo(x, y);
      marks.lineTo(x - head * (vx - 0.5 * vy), y - head * (vy + 0.5 * vx));
    });
  }
  for (const [colour, width] of [[ink.stage, 3.2], [ink.ink, 1.4]]) {  // a light rim makes arrows visible on dark disks
    marks.strokeStyle = colour;
    marks.lineWidth = width * page.dots;
    marks.lineCap = marks.lineJoin = 'round';
    marks.stroke();
  }
}

// Draws reference arrows in the upper left corner, labelled with the speed and the momentum that they represent.
function drawArrowKeys() {
  const { dots } = page, thin = (x, y, size) => {
    const end = x + size, head = Math.min(6 * dots, 0.5 * size);
    Object.assign(marks, { strokeStyle: ink.ink, lineWidth: 1.4 * dots });
    marks.stroke(new Path2D(`M${x},${y}L${end},${y}M${end - head},${y - head / 2}L${end},${y}L${end - head},${y + head / 2}`));
  };
  const keys = state.arrows ? [['speed', arrowSpeed(), arrowScale(), thin]] : [];
  if (isEncounter() && state.momenta) keys.push(['momentum', arrowSpeed() * encounter.mass, momentumScale(), (x, y, size) => drawArrow(x, y, size, 0, ink.soft)]);
  keys.forEach(([name, typical, scale, draw], k) => {
    const value = +typical.toPrecision(1), size = value * scale, words = `${name} ${short(value)}`, y = (17 + 22 * k) * dots;
    marks.font = `${12 * dots}px system-ui, sans-serif`;
    Object.assign(marks, { textAlign: 'left', textBaseline: 'middle', fillStyle: ink.card, globalAlpha: 0.85 });
    marks.fillRect(6 * dots, y - 11 * dots, size + marks.measureText(words).width + 22 * dots, 22 * dots);
    marks.globalAlpha = 1;
    draw(12 * dots, y, size);
    marks.fillStyle = ink.ink;
    marks.fillText(words, 18 * dots + size, y);
  });
}

// Draws the number of each disk inside it or, if it is too small, beside it.
function drawNumbers() {
  const code = codesNow(state.colour), least = 7 * page.dots;
  marks.textAlign = 'center';
  marks.textBaseline = 'middle';
  for (let i = 0; i < disks; i++) {
    const r = radii[sizeOf[i]], inside = r > least, colour = palette[code ? code[i] : speciesOf[i]];
    const light = luminance([0, 8, 16].map(shift => colour >> shift & 255)) > 0.2;
    const reach = (r + 2 * least) / view.unit, away = inside ? 0 : r + least;
    marks.font = `600 ${Math.min(20 * page.dots, Math.max(12 * page.dots, r))}px system-ui, sans-serif`;
    marks.fillStyle = !inside ? ink.ink : light ? '#101418' : '#ffffff';
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      marks.fillText(i + 1, across(X[i] + dx) + away, up(Y[i] + dy) - away);
    });
  }
}
