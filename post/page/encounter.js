// ---------- teaching of collisions: velocities, momenta and energies of two to four disks ----------

// In the laboratory, the page of a run of two to four disks between walls has a panel with momenta, energies and the last
// collision. While the film is paused at its newest frame, the tips of the velocity arrows can be dragged, and masses and
// velocities can be edited in the panel. At the start of a run, these edits change the input; later, they change the moving
// disks.
const NO_SPEED = 1e-9;  // fraction of the typical speed below which a velocity is shown as 0
// typical speed and mass of the arrows; disk-disk collisions so far
const encounter = { input: '', speed: 1, mass: 1, collisions: [], rows: '' };
const isEncounter = () => !!film?.masses;
const isCentred = () => state.centred && isEncounter();
const canAim = () => isEncounter() && !state.centred && !state.playing && moment.time === last();

// Returns total mass, momentum, kinetic energy, centre of mass and its velocity, given the velocities of all disks.
function totals(velocity = i => [VX[i], VY[i]]) {
  const all = { mass: 0, px: 0, py: 0, x: 0, y: 0, energy: 0 };
  film.masses.forEach((mass, i) => {
    const [vx, vy] = velocity(i);
    all.mass += mass;
    all.px += mass * vx;
    all.py += mass * vy;
    all.x += mass * X[i];
    all.y += mass * Y[i];
    all.energy += mass * (vx * vx + vy * vy) / 2;
  });
  return { ...all, x: all.x / all.mass, y: all.y / all.mass, vx: all.px / all.mass, vy: all.py / all.mass };
}

// Returns the velocity of the frame of reference in which velocities are shown.
function frameVelocity() {
  if (!isCentred()) return [0, 0];
  const { vx, vy } = totals();
  return [vx, vy];
}

// The scale of the arrows does not change while the user edits velocities, unless an arrow would become very long or short.
function prepareEncounter() {
  document.documentElement.classList.toggle('encounter', isEncounter());
  $('encounter').hidden = !isEncounter();
  if (!isEncounter()) return;
  const [, top] = film.scales.speed, { input } = stream.wish, isOther = input !== encounter.input;
  if (isOther) Object.assign(state, { arrows: true, momenta: true, centred: false });
  if (isOther || top > 3 * encounter.speed || top < encounter.speed / 5)
    Object.assign(encounter, { input, speed: top, mass: film.masses.reduce((sum, one) => sum + one / disks, 0) });
  buildBodies();
}

// ---------- the arrows ----------

// Returns the speed whose arrow is as long as the mean distance between neighbouring disks.
const arrowSpeed = () => isEncounter() ? encounter.speed : film.scales.speed[1];

// Returns the position in the box of the tip of a disk's arrow.
function tipOf(i) {
  const length = arrowScale() / view.unit;
  return [X[i] + VX[i] * length, Y[i] + VY[i] * length];
}

// Returns the disk whose arrow ends near a point of the canvas, or null.
function tipAt(px, py, event) {
  if (!canAim() || !state.arrows) return null;
  const reach = reachOf(event, GRIP) * page.dots, away = film.masses.map((_, i) => {
    const [x, y] = tipOf(i);
    return Math.hypot(across(x) - px, up(y) - py);
  });
  const nearest = Math.min(...away);
  return nearest < reach ? away.indexOf(nearest) : null;
}

// Rounds a dragged velocity or position to a step with few digits, for the input file.
const stepOf = value => 10 ** Math.floor(Math.log10(value)) / 20, toStep = (value, step) => +(Math.round(value / step) * step).toPrecision(6);

function dragTip(i, x, y) {
  const length = arrowScale() / view.unit, step = stepOf(encounter.speed);
  [VX[i], VY[i]] = grabbed.velocity = [x - X[i], y - Y[i]].map(one => toStep(one / length, step));
  drawStage();
  tellEncounter();
}

const nameIfAlone = i => kinds[speciesOf[i]].count === 1 ? kinds[speciesOf[i]].name : null;

// Changes the velocity or position of a disk. At the start of a run its input is changed, later the running simulation.
function redefine(i, variable, values) {
  if (isEncounter() && last() === 0 && nameIfAlone(i)) parent.redefine(nameIfAlone(i), variable, values);
  else if (variable === 'position') send({ do: 'place', disk: i, position: values });
  else send({ do: 'aim', disk: i, velocity: values });
}

// Draws a thick arrow with a dark rim, which makes it visible on a disk of the same colour.
function drawArrow(x, y, dx, dy, colour) {
  const size = Math.hypot(dx, dy), half = 3 * page.dots, head = Math.min(7 * half, 0.6 * size), neck = size - head;
  if (size < 1) return;
  const corners = [[0, -half], [neck, -half], [neck, -head / 2], [size, 0], [neck, head / 2], [neck, half], [0, half]];
  const path = new Path2D(`M${corners.map(([a, b]) => [x + (a * dx - b * dy) / size, y + (a * dy + b * dx) / size]).join('L')}Z`);
  Object.assign(marks, { strokeStyle: ink.ink, fillStyle: colour, lineWidth: page.dots, lineJoin: 'miter' });
  marks.fill(path);
  marks.stroke(path);
}

// Returns the length of the arrow of a momentum of 1 [pixels].
const momentumScale = () => arrowScale() / encounter.mass;

// Draws momenta as thick arrows in the colours of the disks, below the velocity arrows, and the centre of mass with the total momentum.
function drawMomenta() {
  const [ux, uy] = frameVelocity(), length = momentumScale(), all = totals();
  marks.globalAlpha = 0.75;
  film.masses.forEach((mass, i) => drawArrow(across(X[i]), up(Y[i]), mass * (VX[i] - ux) * length, -mass * (VY[i] - uy) * length, css(speciesColour(kinds[speciesOf[i]]))));
  const [x, y, r] = [across(all.x), up(all.y), 5 * page.dots];
  drawArrow(x, y, (all.px - all.mass * ux) * length, -(all.py - all.mass * uy) * length, ink.soft);
  marks.globalAlpha = 1;
  Object.assign(marks, { strokeStyle: ink.ink, lineWidth: 1.5 * page.dots });
  marks.stroke(new Path2D(`M${x - 2 * r},${y}L${x + 2 * r},${y}M${x},${y - 2 * r}L${x},${y + 2 * r}`));
  ring(all.x, all.y, r);
}

// Draws a circle at the tip of each arrow that can be dragged.
function drawHandles() {
  if (!canAim() || !state.arrows) return;
  for (let i = 0; i < disks; i++) {
    const [x, y] = tipOf(i);
    marks.beginPath();
    marks.arc(across(x), up(y), 7 * page.dots, 0, 2 * Math.PI);
    Object.assign(marks, { fillStyle: ink.card, strokeStyle: ink.ink, lineWidth: 1.5 * page.dots, globalAlpha: 0.8 });
    marks.fill();
    marks.globalAlpha = 1;
    marks.stroke();
  }
}

// ---------- the panel ----------

const exactly = (value, scale, digits = 6) => Math.abs(value) < NO_SPEED * scale ? '0' : String(+value.toPrecision(digits)).replace('-', '−');
// Shows 4 digits of the largest value, or 3 in a narrow table, and thus the same number of decimals in each row of a column.
const digitsShown = () => $('bodies').clientWidth < 28 * parseFloat(getComputedStyle($('bodies')).fontSize) ? 3 : 4;
const alike = (value, scale, digits) => exactly(+value.toFixed(Math.min(Math.max(digits - 1 - Math.floor(Math.log10(scale)), 0), 20)), scale);
const cellsOf = (row, tag) => `<tr>${row.map(one => `<${tag}>${one}</${tag}>`).join('')}</tr>`;

// Makes a row with fields for mass and velocity for each disk, unless the rows for these disks exist.
function buildBodies() {
  const names = film.masses.map((_, i) => nameIfAlone(i) ?? i), rows = `${stream.wish.input} ${names}`;
  $('fewer').disabled = !parent.canRemoveDisk();
  $('more').disabled = disks >= 4;
  if (encounter.rows === rows) return;
  encounter.rows = rows;
  $('bodies').innerHTML = cellsOf(HEADS, 'th')
    + names.map((_, i) => cellsOf([i + 1, ...Array(6).fill('')], 'td')).join('') + cellsOf(['all', ...Array(6).fill('')], 'td');
  names.forEach((name, i) => ['mass', 'velocity along x', 'velocity along y'].forEach((words, k) => {
    const field = Object.assign(document.createElement('input'), { inputMode: 'decimal', ariaLabel: `${words} of disk ${i + 1}`, disabled: k === 0 && typeof name !== 'string' });
    field.addEventListener('change', () => enter(i, k, field));
    field.addEventListener('keydown', event => { if (event.key === 'Enter') field.blur(); event.stopPropagation(); });
    $('bodies').rows[i + 1].cells[k + 1].append(field);
  }));
}

const ofFrame = value => +value.toPrecision(7);  // frames have single precision

function enter(i, k, field) {
  const value = Number(field.value.trim().replace(',', '.').replace('−', '-'));
  field.classList.toggle('wrong', !isFinite(value) || field.value.trim() === '');
  if (field.matches('.wrong')) return;
  if (k === 0) parent.redefine(nameIfAlone(i), 'mass', [value]);
  else redefine(i, 'velocity', k === 1 ? [value, ofFrame(VY[i])] : [ofFrame(VX[i]), value]);
}

// Returns mass, velocity, momentum and energy of each disk and of all disks, relative to the centre of mass or to the box.
function motionNow(centred) {
  const all = totals(), [ux, uy] = centred ? [all.vx, all.vy] : [0, 0];
  const rows = film.masses.map((mass, i) => [mass, VX[i] - ux, VY[i] - uy, mass * (VX[i] - ux), mass * (VY[i] - uy), mass * ((VX[i] - ux) ** 2 + (VY[i] - uy) ** 2) / 2]);
  const frame = all.mass * (ux * ux + uy * uy) / 2;  // energy due to the motion of the frame of reference
  rows.push([all.mass, all.vx - ux, all.vy - uy, all.px - all.mass * ux, all.py - all.mass * uy, all.energy - frame]);
  return rows;
}

// Returns the numbers of a table of `motionNow` as texts.
function motionInWords(rows) {
  const { mass, speed } = encounter, p = mass * speed, scales = [1e-9, speed, speed, p, p, p * speed], digits = digitsShown();
  return rows.map(row => row.map((value, k) => k ? alike(value, scales[k], digits) : exactly(value, scales[k], 4)));
}

const HEADS = ['disk', 'mass', 'v<sub>x</sub>', 'v<sub>y</sub>', 'p<sub>x</sub>', 'p<sub>y</sub>', 'energy'];

// Shows the same tables for each compared run, beside those of this run.
function tellOthers() {
  const others = overlaid.filter(({ motion }) => motion), own = parent.letterOf?.(window);
  $('others').hidden = !others.length;
  $('letter').textContent = others.length ? ` of run ${own}` : '';
  $('others').innerHTML = others.map(({ letter, motion }) => {
    const { rows, collision } = motion(state.centred), words = motionInWords(rows);
    const table = words.map((row, i) => cellsOf([i < words.length - 1 ? i + 1 : 'all', ...row], 'td')).join('');
    return `<div><h2>Run ${letter}</h2><table class="bodies">${cellsOf(HEADS, 'th')}${table}</table>
      <p>${collisionInWords(collision)}</p><table>${collision ? balanceOf(collision) : ''}</table></div>`;
  }).join('');
}

// Called by the page of a compared run.
function motionOfFilm(centred) { return { rows: motionNow(centred), collision: lastCollision(centred) }; }

function tellEncounter() {
  if (!isEncounter()) return;
  const aims = canAim();
  motionInWords(motionNow(state.centred)).forEach((row, i) => row.forEach((text, k) => {
    const cell = $('bodies').rows[i + 1].cells[k + 1], field = cell.firstElementChild;
    if (!field) cell.textContent = text;
    else {
      if (k) field.readOnly = !aims;
      if (field.ownerDocument.activeElement !== field && !field.matches('.wrong')) field.value = text;
    }
  }));
  $('frame').textContent = state.centred ? ', centre-of-mass frame' : '';
  const bounce = parent.restitution();
  if (document.activeElement !== $('bounce')) $('bounce').value = bounce;
  $('restitution').textContent = `restitution ${short(bounce)}`;
  $('bounce').setAttribute('aria-valuetext', `${short(bounce)}, from 0 to 1`);
  press({ momenta: state.momenta, centred: state.centred, elastic: bounce === 1, inelastic: bounce === 0 });
  tellLastCollision();
  tellOthers();
  drawPolygon();
}

// Returns the last collision of two disks up to the time shown, with total momentum and energy before and after it.
function lastCollision(centred) {
  const { collisions } = encounter, one = collisions[upTo(collisions, moment.time, ({ time }) => time) - 1];
  if (!one) return null;
  const [before, after] = [one.before, one.after].map(list => {
    const sum = totals(i => list[i]), m = centred ? sum.mass : 0;
    return { px: sum.px - m * sum.vx, py: sum.py - m * sum.vy, energy: sum.energy - m * (sum.vx ** 2 + sum.vy ** 2) / 2 };
  });
  return { ...one, before, after };
}

const collisionInWords = one => one ? `Last collision: disks ${one.disks[0] + 1} and ${one.disks[1] + 1}, at t = ${long(+one.time.toPrecision(5))}.` : 'No collision of two disks yet.';

// Compares momentum, energy and relative velocity before and after the last collision up to the time shown.
function tellLastCollision() {
  const one = lastCollision(state.centred);
  $('balance').hidden = !one;
  $('when').textContent = collisionInWords(one);
  if (one) $('balance').innerHTML = balanceOf(one);
}

function balanceOf({ before, after, approach, separation }) {
  const { mass, speed } = encounter, p = mass * speed, e = p * speed, share = 1 - after.energy / before.energy, isLost = share > NO_SPEED, lost = isLost ? ` (${short(+(100 * share).toPrecision(3))} % lost)` : '';
  const rows = [
    ['momentum', ...[before, after].map(({ px, py }) => `(${exactly(px, p)}, ${exactly(py, p)})`)],
    ['kinetic energy', exactly(before.energy, e), exactly((isLost ? after : before).energy, e) + lost],
    ['speed of approach, separation', exactly(approach, speed), `${exactly(separation, speed)} (ratio ${exactly(separation / approach, 1)})`],
  ];
  return cellsOf(['', 'before', 'after'], 'th') + rows.map(row => cellsOf(row, 'td')).join('');
}

// Draws the momenta one after another, tip to tail, and their sum.
function drawPolygon() {
  const canvas = $('polygon'), { pen } = prepare(canvas), [ux, uy] = frameVelocity(), [width, height] = [canvas.width, canvas.height].map(size => size / page.dots);
  const steps = film.masses.map((mass, i) => [mass * (VX[i] - ux), mass * (VY[i] - uy)]), places = [[0, 0]];
  for (const [px, py] of steps) places.push([places.at(-1)[0] + px, places.at(-1)[1] + py]);
  const range = axis => [Math.min(...places.map(one => one[axis])), Math.max(...places.map(one => one[axis]))];
  const [[x0, x1], [y0, y1]] = [range(0), range(1)], long = steps.reduce((sum, [px, py]) => sum + Math.hypot(px, py), 0) || 1;
  const unit = Math.min((width - 30) / long, (height - 24) / Math.max(y1 - y0, 0.3 * long));
  const x = px => width / 2 + (px - (x0 + x1) / 2) * unit, y = py => height / 2 - (py - (y0 + y1) / 2) * unit;
  const apart = (y1 - y0) * unit < 12 ? 9 : 0;  // offset of arrows that would cover each other [CSS pixels]
  const arrow = (k, from, to, colour, dash) => {
    const [ax, bx] = [x(from[0]), x(to[0])], [ay, by] = [from, to].map(one => y(one[1]) + (k - disks / 2) * apart);
    const [dx, dy] = [bx - ax, by - ay], size = Math.hypot(dx, dy), head = Math.min(7, size) / (size || 1);
    pen.beginPath();
    pen.moveTo(ax, ay);
    for (const turn of [0, 0.5, 0, -0.5]) pen.lineTo(bx - (turn && head) * (dx + turn * dy), by - (turn && head) * (dy - turn * dx));
    Object.assign(pen, { strokeStyle: colour, lineWidth: 2 });
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
  };
  steps.forEach((_, i) => arrow(i, places[i], places[i + 1], css(speciesColour(kinds[speciesOf[i]])), []));
  arrow(disks, places[0], places.at(-1), ink.ink, [5, 4]);
  const [px, py] = places.at(-1).map(one => exactly(one, encounter.mass * encounter.speed));
  canvas.setAttribute('aria-label', `momenta, tip to tail; their sum is (${px}, ${py})`);
}

const encounterActions = {
  momenta: turn('momenta'), centred: turn('centred'), elastic: () => parent.bounce(1), inelastic: () => parent.bounce(0),
  more: () => parent.addDisk(), fewer: () => parent.removeDisk(),
};
function listenEncounter() {
  for (const [id, action] of Object.entries(encounterActions)) on(id, action);
  onSlide($('bounce'), () => parent.bounce(+$('bounce').value));
}
