// ---------- texts and numbers beside the picture ----------

const short = value => (Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3)
  ? value.toExponential(2) : String(+value.toPrecision(4))).replaceAll('-', '−');

const safe = text => text.replace(/[&<]/g, sign => `&#${sign.charCodeAt(0)};`);

const long = value => String(+value.toPrecision(8)).replace('-', '−');

const numbered = (value, noun) => `${short(value)} ${noun}${value === 1 ? '' : 's'}`;

function tell() {
  const { time, collisions } = moment;
  const share = (time - first()) / (last() - first() || 1);
  $('scrub').value = share;
  markChanges();
  $('scrub').setAttribute('aria-valuetext', `time ${short(time)} of ${short(last())}`);
  const letter = isPart && parent.isComparing() ? `${parent.letterOf(window)}: ` : '', counted = source.counted();
  const count = film.isOpen ? `${sumOf(moment.inside)} disks inside` : film.endsByEnergy ? energyLeft() : disks > 1 ? `${numbered(+collisions.toPrecision(3), 'collision')} per disk` : '';
  const ended = text => text + (count && ' · ');  // films beside others show only the last part, because all have the same time
  $('clock').innerHTML = `<span class="time">t = <b>${long(+moment.shown.toPrecision(5))}</b>${counted ? ' · ' : ended('')}</span>`
    + `<span class="counted">${counted && ended(counted)}</span><span>${count && letter + count}</span>`;
  $('traced').hidden = !state.traced.length;
  $('foretelling').hidden = !film.events || state.traced.length > 0;  // the buttons of a disk need its place
  $('hint').textContent = state.traced.length ? '' : hint();
  $('push').hidden = !isPart || state.traced.length !== 1 || !isInside(state.traced[0]);
  $('disk').innerHTML = state.traced.map(i =>
    `disk <b>${i + 1}</b> (${safe(kinds[speciesOf[i]].name)}) ${isInside(i) ? `at <b>${short(X[i])}, ${short(Y[i])}</b>` : 'is outside'}`).join('<br>');
}

// Returns the remaining kinetic energy in words. Runs that end at a fraction of their energy are compared at equal fractions.
function energyLeft() {
  const total = means => sumOf(kinds.map(({ count }, s) => count * means[s])), start = total(source.curves().kinetic.map(([first]) => first));
  return start > 0 ? `${short(+(100 * total(moment.kinetic) / start).toPrecision(3))} % of the energy left` : '';
}

// Marks on the time line the times at which the run was changed. An element behind the slider shows the marks, because browsers
// draw no background for a slider. The thumb of the slider is 16 pixels wide, and a mark 2.
function markChanges() {
  const shares = film.changes.map(([time]) => (time - first()) / (last() - first() || 1)).filter(share => share >= 0 && share <= 1);
  const marks = shares.map(share => `linear-gradient(var(--accent), var(--accent)) calc(7px + ${share} * (100% - 14px)) 50% / 2px 60% no-repeat`);
  if ($('marked').marks === marks.join()) return;
  $('marked').style.background = $('marked').marks = marks.join();
  $('scrub').title = film.changes.map(([time, words]) => `t = ${short(time)}: ${words}`).join('\n');
}

// Returns the words below the controls while no disk is selected.
function hint() {
  if (!isPart) return 'Select a disk to see its trace.';
  if (!state.playing) return `Drag a disk${canAim() ? ' or the end of its arrow' : ''}, or select it to see its trace.`;
  return `${film.sides.some((_, k) => canHold(k)) ? 'Drag a side of the box, or select' : 'Select'} a disk to see its trace.`;
}

// Describes the picture and each plot for screen readers.
const listed = words => words.filter(Boolean).join(', ');
function describe() {
  const [width, height] = film.edges, each = kinds.map(({ name, sizes }, s) => `${moment.inside[s]} ${name} (${sizes})`);
  const surfaces = film.sides.map((law, k) => openSides()[k] ? `${film.surfaces[k]} is open` : describeLaw(film.surfaces[k], law));
  const kinetic = kinds.map(({ name }, s) => moment.kinetic[s] !== null && `${name} ${short(moment.kinetic[s])}`), pressure = lastOf('pressure');
  const words = {
    stage: `${listed(each)} in a box of ${short(width)} by ${short(height)}; time ${short(moment.shown)}; `
      + `coloured by ${state.colour}. ${listed(surfaces)} A click on a disk shows its trace.`,
    histogram: `Histogram of the speeds. ${$('bars').textContent}`,
    energy: `Energies against time. Mean kinetic energy of a disk now: ${listed(kinetic)}.`,
    inside: `Numbers of disks against time. ${$('flows').textContent}`,
    pressure: `Pressure against time.${pressure === null ? '' : ` Now: ${short(pressure)}.`}`,
  };
  for (const [id, text] of Object.entries(words)) $(id).setAttribute('aria-label', text);
}

const describeLaw = (name, { temperature, speed, motion }) => (temperature || speed || motion) && `${name} ${listed([
  temperature && `heats: kT = ${short(temperature)}`, speed && `slides with ${short(speed)}`, motion && `moves (${motion})`])}`;

// Returns a label with the colour of a species.
function chip(kind, text) {
  const element = Object.assign(document.createElement('span'), { className: 'chip', textContent: text });
  element.style.setProperty('--own', css(speciesColour(kind)));
  return element;
}

const PATTERN_WORDS = ['', ', striped', ', striped upright', ', chequered'];

// Returns the name of the fill pattern of a species, if its disks are large enough for one at zoom 1.
function patternOf(s) {
  const radius = Math.max(leastRadius(), page.unit * film.radii[sizeOf[speciesOf.indexOf(s)]]);
  return isStriped(s, radius) ? PATTERN_WORDS[s % PATTERN_WORDS.length] : '';
}

function drawLegend() {
  const scale = film.scales[state.colour], legend = $('legend');
  legend.replaceChildren();
  if (!scale) legend.replaceChildren(...kinds.map((kind, s) => chip(kind, `${kind.name}, ${kind.sizes}${patternOf(s)}`)));
  else {
    const stops = Array.from({ length: 17 }, (_, k) => css(scaleColour(255 * k / 16)));
    const middle = state.colour === 'collisions' ? Math.expm1(Math.log1p(scale[1]) / 2) : scale[1] / 2;
    legend.innerHTML = `<div id="scale"><i></i>
      <span><b>0</b><b>${short(+middle.toPrecision(2))}</b><b>≥ ${short(+scale[1].toPrecision(2))}</b></span></div>`;
    // the security policy of the page refuses inline styles
    legend.querySelector('i').style.background = `linear-gradient(to right, ${stops})`;
  }
  // The initial motion is described, because a note about a dragged side would change the size of the picture.
  const sides = film.sides.map((law, k) => ({ ...law, motion: film.atStart[k].motion }));
  const notes = [scale?.[0], film.sides.some(({ open }) => open !== undefined) && 'dotted: open side', ...sides.map((law, k) => describeLaw(film.surfaces[k], law))].filter(Boolean);
  if (notes.length) legend.append(Object.assign(document.createElement('p'), { textContent: notes.join('; ') }));
}

// Writes a note below the controls if the picture is approximate or not to scale.
function tellLimits() {
  const tiny = angles && film.radii.every(radius => Math.max(leastRadius(), radius * page.unit) < LEAST_TO_TURN * page.dots);
  $('between').textContent = [film.note && `Frames only: ${film.note}.`, enlarged() && 'Small disks are drawn larger than they are.',
    tiny && 'Zoom in to see how disks turn.'].filter(Boolean).join(' ');
}

// ---------- axes and curves of the small plots ----------

function prepare(canvas) {
  const pen = canvas.getContext('2d'), width = canvas.width / page.dots, height = canvas.height / page.dots;
  pen.setTransform(page.dots, 0, 0, page.dots, 0, 0);
  pen.clearRect(0, 0, width, height);
  const size = parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;  // texts are larger on a projector
  return { pen, size, left: 42 * size, right: width - 4, top: 6, bottom: height - 26 * size };
}

// Draws two axes for values from (x0, y0) to (x1, y1) with about three tick labels each. Returns two functions that convert
// values to pixels.
function axes(plot, [x0, x1], [y0, y1], words, name = short, nameOfY = name) {
  const { pen, size, left, right, top, bottom } = plot;
  const x = value => left + (value - x0) / (x1 - x0) * (right - left);
  const y = value => bottom - (value - y0) / (y1 - y0) * (bottom - top);
  Object.assign(pen, { font: `${11 * size}px system-ui, sans-serif`, fillStyle: ink.soft, strokeStyle: ink.line, lineWidth: 1 });
  Object.assign(pen, { textAlign: 'right', textBaseline: 'middle' });
  for (const value of round(y0, y1)) {
    pen.beginPath();
    pen.moveTo(left, y(value));
    pen.lineTo(right, y(value));
    pen.stroke();
    pen.fillText(nameOfY(value), left - 6, y(value));
  }
  Object.assign(pen, { textAlign: 'center', textBaseline: 'top' });
  for (const value of round(x0, x1)) if (x(value) < right - 40 * size) pen.fillText(name(value), x(value), bottom + 5);
  pen.textAlign = 'right';
  pen.fillText(words, right, bottom + 5);
  return { x, y };
}

// Returns round numbers between two values, spaced by 1, 2 or 5 times a power of ten.
function round(low, high) {
  const least = (high - low) / 4, power = 10 ** Math.floor(Math.log10(least) + 1e-9), values = [];
  const step = power * [1, 2, 5, 10].find(k => k * power >= least * (1 - 1e-9));
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  return values;
}

// Plots curves { time, values, colour, dash, letter } against time on an axis that includes 0. Curves are pale after the time
// `now`; null values leave gaps; a single value is a point. Each value of curves with `steps` holds until the next sample.
// Returns a function that converts times to pixels.
function plotLines(canvas, lines, now) {
  const range = lines.map(({ time }) => [time[0], time.at(-1)]), start = Math.min(...range.map(([t]) => t));
  const end = Math.max(...range.map(([, t]) => t)), plot = prepare(canvas), { pen } = plot;
  let low = 0, high = 0;
  for (const { values } of lines) for (const value of values) if (value < low) low = value; else if (value > high) high = value;
  const { x, y } = axes(plot, [start, end > start ? end : start + 1], [low, low + 1.06 * (high - low || 1)], 'time');
  pen.lineJoin = 'round';
  for (const { time, values, colour, dash = [], letter, steps } of lines) {
    const seen = upTo(time, now);
    Object.assign(pen, { lineWidth: letter ? 1.2 : 1.8, strokeStyle: colour, fillStyle: colour });
    pen.setLineDash(dash);
    for (const [from, to, alpha] of [[0, seen, 1], [Math.max(0, seen - 1), time.length, 0.35]]) {
      pen.globalAlpha = alpha;
      pen.beginPath();
      for (let k = from, drawn = false; k < to; k++) {
        if (values[k] !== null && drawn && steps) pen.lineTo(x(time[k]), y(values[k - 1]));
        if (values[k] !== null) pen[drawn ? 'lineTo' : 'moveTo'](x(time[k]), y(values[k]));
        drawn = values[k] !== null;
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    if (time.length === 1 && values[0] !== null) pen.fillRect(x(time[0]) - 2, y(values[0]) - 2, 4, 4);
    if (letter) pen.fillText(letter, Math.min(plot.right, x(time.at(-1)) + 10), Math.max(y(values.at(-1) ?? 0) - 12, 0));
  }
  pen.setLineDash([]);
  return x;
}

// ---------- histogram of speeds ----------

const FEWEST = 10;  // fewest disks of a species for a histogram
let counted;        // species with a histogram
// True if Maxwell's law applies. Disks that never collide and touch no heat bath keep their speeds.
const settled = () => film.settles && (film.heated || past.at(-1).collisions > 0);

let sums;           // histograms of all frames so far, and the index of the last of these frames

// Sets histogram bins from zero to a maximum speed. If many disks are at rest, the axis is logarithmic, because on a linear axis
// the bar of the resting disks would dwarf all others.
const RESTING = 0.02;  // fraction of disks at rest above which the axis is logarithmic
function setBins(most, resting) {
  const rest = resting > RESTING && resting < 1;
  film.speeds = { rest, edges: Array.from({ length: 41 }, (_, k) => rest ? most * 10 ** (k / 10 - 4) : most * k / 40) };
}

// Returns the fraction of the disks of each species in each bin, at the time shown or averaged over all frames received so far.
function speedsNow() {
  const { edges, rest } = film.speeds, bins = edges.length - 1, width = edges[1] - edges[0];
  const seen = kinds.map(() => 0), bin = speed => rest ? speed > 0 ? Math.max(1, upTo(edges, speed)) : 0 : Math.floor(speed / width);
  const counts = kinds.map(() => new Float64Array(bins + 1)), add = (i, speed) => {
    const k = bin(speed);
    seen[speciesOf[i]]++;
    if (k <= bins) counts[speciesOf[i]][k]++;
  };
  if (state.sofar) {
    if (sums?.time !== moment.time) {
      eachSpeed(add);
      sums = { time: moment.time, counts, seen };
    }
    return sums;
  }
  for (let i = 0; i < disks; i++) if (isInside(i)) add(i, Math.sqrt(VX[i] * VX[i] + VY[i] * VY[i]));
  return { counts, seen };
}

function drawHistogram() {
  if (!counted.length) return;
  const own = speedsOfFilm(), { edges, rest, counts, seen } = own, plot = prepare($('histogram')), { pen } = plot;
  const others = overlaid.map(one => ({ letter: one.letter, ...one.speeds() })).filter(one => one.rest === rest), all = [own, ...others];
  if (rest) {
    drawSpeedsAndRest(plot, counts, seen, others);
    return;
  }
  tellBars();
  const top = Math.max(...all.map(one => one.edges.at(-1))), width = edges[1];
  const peak = Math.max(...all.flatMap(one => one.counted.map(s => Math.sqrt(narrowness(one, s)) * Math.exp(-0.5))));
  const { x, y } = axes(plot, [0, top], [0, peak > 0 ? 1.6 * peak : 4 / top], 'speed');
  pen.save();
  pen.beginPath();
  pen.rect(plot.left, plot.top, plot.right - plot.left, plot.bottom - plot.top);
  pen.clip();
  for (const s of counted) {
    const one = 1 / (seen[s] * width);
    pen.fillStyle = curveColour(s);
    pen.globalAlpha = 0.45;
    pen.beginPath();
    counts[s].forEach((n, bin) => n && pen.rect(x(bin * width), y(n * one), x(width) - x(0) - 0.5, plot.bottom - y(n * one)));
    pen.fill();
  }
  pen.globalAlpha = 1;
  for (const one of all) if (one.settled) for (const s of one.counted) drawMaxwell(pen, one, s, x, y, top);
  const density = (n, bin, one, s) => y(n / (one.seen[s] * (one.edges[bin + 1] - one.edges[bin])));
  others.forEach(one => drawOutline(pen, one, x, density, 0));
  pen.restore();
}

// Returns m/E of a species with mean kinetic energy E. Its Maxwell distribution has the maximum √(m/E) e^(−1/2).
const narrowness = ({ kinds: own, energies }, s) => own[s].mass / (energies[s] || Infinity);

function drawMaxwell(pen, one, s, x, y, top) {
  const b = narrowness(one, s);
  if (!(b > 0)) return;
  Object.assign(pen, { lineWidth: one.letter ? 1.2 : 2, strokeStyle: curveColour(s, one.letter) });
  pen.setLineDash(DASHES[s % DASHES.length]);
  pen.beginPath();
  for (let k = 0; k <= 120; k++) {
    const v = k / 120 * top;
    pen.lineTo(x(v), y(b * v * Math.exp(-b * v * v / 2)));
  }
  pen.stroke();
}

function tellBars() {
  const words = 'Bars: share of the disks per unit of speed.' + (settled() ? ' Curves: Maxwell’s law at the mean kinetic energy of the species.' : '');
  if ($('bars').textContent !== words) $('bars').textContent = words;
}

// Returns the histogram of the speeds in this film, and the energies of its Maxwell curves. Other films on the page draw both
// for comparison.
function speedsOfFilm() {
  const isSettled = settled(), energies = kinds.map((_, s) => (isSettled ? film.curves?.mean?.[s] : null) ?? moment.kinetic[s]);
  return { kinds, counted, settled: isSettled, energies, ...film.speeds, ...speedsNow() };
}

// Draws the histogram of speeds of a compared run as a line above the bars, labelled with the letter of the run.
function drawOutline(pen, one, x, height, from) {
  one.kinds.forEach((kind, s) => {
    let best = [0, Infinity];
    Object.assign(pen, { lineWidth: 1.2, strokeStyle: curveColour(s, one.letter), fillStyle: ink.ink });
    pen.setLineDash([]);
    pen.beginPath();
    one.counts[s].slice(from, from + one.edges.length - 1).forEach((n, bin) => {
      const top = height(n, bin, one, s);
      pen.lineTo(x(one.edges[bin]), top);
      pen.lineTo(x(one.edges[bin + 1]), top);
      if (top < best[1]) best = [x(one.edges[bin]), top];
    });
    pen.stroke();
    pen.fillText(one.letter, best[0], Math.max(best[1] - 13, 8));
  });
}

// If many disks are at rest, both axes are logarithmic and no Maxwell curve is drawn.
function drawSpeedsAndRest(plot, counts, seen, others) {
  const edges = film.speeds.edges.map(Math.log10), most = Math.log10(1.5 * Math.max(10, ...kinds.map(kind => kind.count)));
  const { pen } = plot, power = value => short(+(10 ** value).toPrecision(1));
  const { x, y } = axes(plot, [edges[0], edges.at(-1)], [-0.3, most], 'speed', value => Number.isInteger(value) ? power(value) : '');
  pen.globalAlpha = 0.6;
  for (const s of counted) {
    pen.fillStyle = curveColour(s);
    counts[s].slice(1, edges.length).forEach((n, bin) => n && pen.fillRect(x(edges[bin]), y(Math.log10(n)), x(edges[bin + 1]) - x(edges[bin]) - 0.5, plot.bottom - y(Math.log10(n))));
  }
  pen.globalAlpha = 1;
  others.forEach(one => drawOutline(pen, one, speed => x(Math.log10(speed)), n => y(n ? Math.log10(n) : -0.3), 1));
  // The number of disks at rest measures the size of a crater.
  const atRest = one => one.counted.map(s => `${one.counts[s][0]} of ${one.seen[s]} ${one.kinds[s].name}`).join(', ');
  const own = { counted, counts, seen, kinds }, runs = [...others, { ...own, letter: parent.letterOf?.(window) }];
  $('bars').textContent = others.length ? `At rest: ${runs.map(one => `${one.letter}: ${atRest(one)}`).join('; ')}.`
    : `At rest: ${atRest(own)}. Bars: the number of disks at each speed; both axes grow by factors of ten.`;
}

// ---------- plots of energies and pressure against time ----------

const ENERGIES = { kinetic: [], potential: [5, 3], rotational: [1.5, 2.5] }, DASHES = [[], [7, 2], [2, 2], [7, 2, 2, 2]];
let cursorAt;      // conversion of times to pixels
let overlaid = [];  // compared runs in the same plots: letter, curves, kinds, and functions for present speeds and numbers

// Curves of compared runs have the colours of the runs, unless several species need colours. Curves without a letter have the
// colour of the present run.
const RUN_COLOURS = ['#0072b2', '#d55e00', '#009e73', '#b5649a'];
function runColour(letter) { return RUN_COLOURS[(letter.charCodeAt(0) - 65) % RUN_COLOURS.length]; }
const hasRunColours = () => overlaid.length > 0 && kinds.length === 1;
const curveColour = (s, letter = parent.letterOf?.(window)) => hasRunColours() && letter ? runColour(letter) : css(speciesColour(kinds[s % kinds.length]));

const share = s => state.total ? moment.inside[s] : 1;
const there = () => Object.keys(ENERGIES).filter(kind => source.curves()[kind]);
const lastOf = (name, s) => {
  const { time, [name]: all } = source.curves(), values = s === undefined ? all : all[s];
  return values?.[Math.max(0, upTo(time, moment.time) - 1)] ?? null;
};

// Without gravity, the kinetic energy of a few disks changes only in events. The steps of very many disks are too small to be
// seen; their samples are connected by lines.
const isStepwise = () => film.exact && !film.gravity.some(Boolean);

function drawEnergies() {
  const lines = [], add = (curves, own, letter) => {
    for (const [name, dash] of Object.entries(ENERGIES)) curves[name]?.forEach((values, s) => lines.push({
      time: curves.time, values: state.total ? values.map((e, k) => e === null ? e : e * (curves.inside?.[s][k] ?? own[s].count)) : values,
      colour: curveColour(s, letter), dash, letter, steps: isStepwise(),
    }));
  };
  for (const { letter, curves, kinds: own } of overlaid) add(curves, own, letter);
  add(source.curves(), kinds);
  cursorAt = plotLines($('energy'), lines, overlaid.length ? Infinity : moment.time);
}

function drawPressure() {
  const { time, pressure: measured } = source.curves(), colourOf = letter => hasRunColours() ? curveColour(0, letter) : ink.accent;
  const falls = film.gravity.some(Boolean), pressure = falls ? null : measured;  // depends on the height under gravity
  const lines = overlaid.filter(({ curves }) => curves.pressure && !falls).map(({ letter, curves }) => ({ time: curves.time, values: curves.pressure, colour: colourOf(letter), letter }));
  if (pressure?.some(one => one !== null)) lines.push({ time, values: pressure, colour: colourOf() });
  $('pressures').hidden = !lines.length;
  if (lines.length) plotLines($('pressure'), lines, overlaid.length ? Infinity : moment.time);
  const now = pressure && lastOf('pressure'), before = ({ letter, curves: { time: times, pressure: values } }) => [letter, values[Math.max(0, upTo(times, moment.time) - 1)]];
  const known = [...overlaid.filter(({ curves }) => curves.pressure && !falls).map(before), [parent.letterOf?.(window), now]].filter(([, value]) => typeof value === 'number');
  $('force').textContent = known.map(([letter, value]) => overlaid.length ? `${letter}: ${short(value)}` : short(value)).join(', ');
}

// Plots the numbers of disks inside an open system, and of those that have left and entered.
function drawInside() {
  $('population').hidden = !film.isOpen;
  if (!film.isOpen) return;
  const ofRun = ({ time, inside, left, entered }, letter) => [
    ...inside.map((values, s) => ({ time, values, letter, colour: curveColour(s, letter) })),
    ...[[left, ENERGIES.potential], [entered, ENERGIES.rotational]].filter(([values]) => values?.some(Boolean)).map(([values, dash]) => ({ time, values, letter, dash, colour: ink.soft })),
  ];
  const others = overlaid.filter(({ curves }) => curves.inside).flatMap(({ letter, curves }) => ofRun(curves, letter));
  plotLines($('inside'), [...others, ...ofRun(source.curves())], overlaid.length ? Infinity : moment.time);
  const soFar = name => lastOf(name) ?? 0, leaves = film.sides.some(({ open }) => open !== undefined);
  $('flows').textContent = `Inside: ${moment.inside.join(' + ')}.${leaves ? ` Left (dashed): ${soFar('left')}.` : ''}${film.sources.length ? ` Entered (dotted): ${soFar('entered')}.` : ''}`;
}

function layTableOut() {
  const heads = ['', 'disks', ...there().map(name => name + { kinetic: '', potential: ' (dashed)', rotational: ' (dotted)' }[name])];
  const rows = kinds.map(({ count }) => ['', count, ...heads.slice(2).map(() => '')]);
  const cells = (row, tag) => `<tr>${row.map(one => `<${tag}>${one}</${tag}>`).join('')}</tr>`;
  $('energies').innerHTML = cells(heads, 'th') + rows.map(row => cells(row, 'td')).join('');
  kinds.forEach((kind, s) => $('energies').rows[s + 1].cells[0].append(chip(kind, kind.name)));
}

function tellEnergies() {
  $('whose').textContent = state.total ? 'species' : 'disk';
  $('laboratory').hidden = !isCentred();  // momenta and velocities above are relative to the centre of mass
  kinds.forEach((_, s) => there().forEach((name, k) => {
    const now = name === 'rotational' ? lastOf(name, s) : moment[name][s];
    $('energies').rows[s + 1].cells[2 + k].textContent = now === null ? '' : short(now * share(s));
  }));
  if (film.isOpen) kinds.forEach((_, s) => { $('energies').rows[s + 1].cells[1].textContent = moment.inside[s]; });
}

// ---------- table of measured values with errors, and theoretical values ----------

// Rounds a number to a multiple of a power of ten, for example to 0.01 if the power is −2.
const rounded = (value, power) => Math.abs(power) > 7 ? short(value)
  : (Math.round(value / 10 ** power) * 10 ** power).toFixed(Math.max(0, -power)).replace('-', '−');
const secondDigit = error => Math.floor(Math.log10(error.toPrecision(2))) - 1;

// Returns a mean and its error, rounded to two digits of the error, or a question mark if the run is
// too short for an error. A line can break before the sign ±, but not after it.
function withError({ value, error, short: isShort }) {
  if (value === null) return isShort ? 'too short' : '';
  if (!error) return isShort ? `${short(value)} ±\u00a0?` : short(value);
  return [value, error].map(one => rounded(one, secondDigit(error))).join(' ±\u00a0');
}

// Returns a theoretical value with at least as many decimals as the mean beside it.
function lawOf({ theory, error }) {
  if (!theory || !error) return theory === null ? '' : short(theory);
  return rounded(theory, Math.min(secondDigit(error), Math.floor(Math.log10(Math.abs(theory))) - 3));
}

// Returns the temperature and the mean speed of each species at the time shown.
function speedsAndTemperature() {
  let mass = 0, px = 0, py = 0, energy = 0;
  const speeds = kinds.map(() => 0);
  for (let i = 0; i < disks; i++) {
    if (!isInside(i)) continue;
    mass += masses[i];
    px += masses[i] * VX[i];
    py += masses[i] * VY[i];
    energy += 0.5 * masses[i] * (VX[i] * VX[i] + VY[i] * VY[i]);
    speeds[speciesOf[i]] += Math.sqrt(VX[i] * VX[i] + VY[i] * VY[i]);
  }
  const thermal = energy - 0.5 * (px * px + py * py) / mass;  // relative to the mean motion
  const mean = (sum, count) => count ? sum / count : null;
  return [mean(Math.max(0, thermal), sumOf(moment.inside)), ...speeds.map((sum, s) => mean(sum, moment.inside[s]))];
}

// Returns name, present value, mean with error, and theoretical value of each quantity at the time shown.
function numbersNow() {
  const means = source.means?.() ?? [];
  if (!means.length || disks < FEWEST) return [];
  const now = [...speedsAndTemperature(), lastOf('pressure')];
  return means.map((one, k) => ({ ...one, now: now[k] ?? null }));
}

// Explains the theoretical temperature, which is smaller than the kT in the pressure of an ideal gas, N kT per area, or why it is
// missing.
function temperatureInWords(rows) {
  const theory = rows.find(({ name }) => name === 'temperature')?.theory;
  if (!theory) return `The temperature is not predicted: the mean speeds in theory follow from the measured one.${film.gravity.some(Boolean) ? ' Under gravity the pressure depends on the height.' : ''}`;
  return `The temperature excludes the mean motion: in theory it is kT (1 − 1/N), with N = ${disks} and kT = ${short(theory / (1 - 1 / disks))}.`;
}

// For a single run, the table lists the present, mean and theoretical value of each quantity. For several runs, it lists the
// mean (or the present value if there is no mean) and the theoretical value of each run.
function tellNumbers() {
  const own = numbersNow(), seen = value => value === null ? '' : short(value), some = (rows, what) => rows.some(one => one[what] !== null);
  $('measured').hidden = !own.length;
  if (!own.length) return;
  const runs = overlaid.map(({ letter, numbers }) => [letter, numbers()]), texts = { now: one => seen(one.now), mean: withError, theory: lawOf };
  runs.push([parent.letterOf?.(window), own]);
  const columns = runs.length === 1
    ? Object.entries(texts).filter(([name]) => name === 'mean' ? some(own, 'value') || own.some(one => one.short) : some(own, name)).map(([name, text]) => [name, own, text])
    : runs.flatMap(([letter, rows]) => [[letter, rows, one => one.value === null ? seen(one.now) : withError(one)],
      ...(some(rows, 'theory') ? [['theory', rows, texts.theory]] : [])]);
  const kind = k => columns[k - 1]?.[0] === 'theory' ? ' class="law"' : '';
  const cells = (row, tag) => `<tr>${row.map((one, k) => `<${tag}${kind(k)}>${one}</${tag}>`).join('')}</tr>`;
  const isShort = columns.some(([, rows]) => rows.some(one => one.short && one.value !== null));
  const notes = [isShort && '± ?: the run is too short for an error.', columns.some(([name]) => name === 'theory') && temperatureInWords(own)].filter(Boolean);
  const note = notes.length ? `<caption>${notes.join(' ')}</caption>` : '';
  $('numbers').innerHTML = note + cells(['', ...columns.map(([name]) => name)], 'th') + own.map(({ name }) => [safe(name),
    ...columns.map(([, rows, text]) => text(rows.find(one => one.name === name) ?? { now: null, value: null, theory: null }))])
    .filter(row => row.slice(1).some(Boolean)).map(row => cells(row, 'td')).join('');
}

// ---------- list of the next events in a simulation of few disks ----------

const meeting = ([, i, j]) => `disk ${i + 1} and ${j < 0 ? film.surfaces[-1 - j] : `disk ${j + 1}`}`;

function tellQueue() {
  if (!film.events) return;
  const { next: known, happened } = source.coming(), next = state.foretold ? known : [];
  $('queue').innerHTML = next.map(one => `<li>${meeting(one)}<span>t = ${long(one[0])}</span></li>`).join('');
  $('due').textContent = next.length ? `the first in ${short(next[0][0] - moment.time)}` : '';
  $('happened').textContent = happened ? `Happened: ${meeting(happened)}.` : ' ';
}
