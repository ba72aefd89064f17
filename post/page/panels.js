// ---------- words and numbers ----------

const short = value => (Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3)
  ? value.toExponential(2) : String(+value.toPrecision(4))).replace('-', '−');

const safe = text => text.replace(/[&<]/g, sign => `&#${sign.charCodeAt(0)};`);

const long = value => String(+value.toPrecision(8)).replace('-', '−');

function tell() {
  const { time, frame, gap } = moment;
  $('scrub').value = (time - first()) / (last() - first() || 1);
  $('clock').innerHTML = `t = <b>${long(+moment.shown.toPrecision(5))}</b> · frame ${frame + 1}/${frames}`
    + (disks > 1 ? ` · ${short(+collisionsNow().toPrecision(3))} collisions per disk` : '');
  $('traced').hidden = !state.traced.length;
  $('disk').innerHTML = state.traced.map(i =>
    `disk <b>${i + 1}</b> (${safe(kinds[speciesOf[i]].name)}) at <b>${short(X[i])}, ${short(Y[i])}</b>`).join('<br>');
  const unknown = film.guesses[gap];
  $('guess').textContent = !film.guesses.some(count => count) ? '' : !unknown ? 'Here all paths are true.'
    : film.kicked ? 'Here the film shows frames as they are: kicks bend the paths between them.'
    : (stands(gap) ? `Here the film shows frames as they are: ${unknown} of ${disks} disks collide between two.`
      : `Here ${unknown} of ${disks} disks, which collide, stand until the next frame.`)
      + (film.logged ? '' : ' output.event_log = .true. in the input would tell their paths.');
}

// The colour of a species, to be chosen by the user.
function chooser(kind) {
  const label = document.createElement('label'), input = document.createElement('input');
  const hex = speciesColour(kind).map(part => part.toString(16).padStart(2, '0')).join('');
  Object.assign(input, { type: 'color', value: '#' + hex, title: `another colour for ${kind.name}` });
  input.addEventListener('input', () => { kind.own = input.value; layOutStage(); show(moment.time, true); });
  input.addEventListener('change', refresh);
  label.className = 'chip';
  label.append(input, `${kind.name}, ${kind.sizes}`);
  return label;
}

function drawLegend() {
  const scale = film.scales[state.colour], legend = $('legend');
  legend.replaceChildren();
  if (!scale) {
    legend.replaceChildren(...kinds.map(chooser));
    return;
  }
  const stops = Array.from({ length: 17 }, (_, k) => css(scaleColour(255 * k / 16)));
  const middle = state.colour === 'collisions' ? Math.expm1(Math.log1p(scale[1]) / 2) : scale[1] / 2;
  legend.innerHTML = `<div id="scale"><i></i>
    <span><b>0</b><b>${short(+middle.toPrecision(2))}</b><b>≥ ${short(+scale[1].toPrecision(2))}</b></span></div><p>${scale[0]}</p>`;
  legend.querySelector('i').style.background = `linear-gradient(to right, ${stops})`;  // the page's policy refuses it in the text
}

// ---------- small plots ----------

function prepare(canvas) {
  const pen = canvas.getContext('2d'), width = canvas.width / page.dots, height = canvas.height / page.dots;
  pen.setTransform(page.dots, 0, 0, page.dots, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, left: 42, right: width - 4, top: 6, bottom: height - 26 };
}

// Axes from (x0, y0) to (x1, y1) with three or so round numbers each; returns the maps to pixels.
function axes(plot, [x0, x1], [y0, y1], words, name = short) {
  const { pen, left, right, top, bottom } = plot;
  const x = value => left + (value - x0) / (x1 - x0) * (right - left);
  const y = value => bottom - (value - y0) / (y1 - y0) * (bottom - top);
  pen.font = '11px system-ui, sans-serif';
  pen.fillStyle = ink.soft;
  pen.strokeStyle = ink.line;
  pen.lineWidth = 1;
  pen.textAlign = 'right';
  pen.textBaseline = 'middle';
  for (const value of round(y0, y1)) {
    pen.beginPath();
    pen.moveTo(left, y(value));
    pen.lineTo(right, y(value));
    pen.stroke();
    pen.fillText(name(value), left - 6, y(value));
  }
  pen.textAlign = 'center';
  pen.textBaseline = 'top';
  for (const value of round(x0, x1)) if (x(value) < right - 40) pen.fillText(name(value), x(value), bottom + 5);
  pen.textAlign = 'right';
  pen.fillText(words, right, bottom + 5);
  return { x, y };
}

// The multiples of a number of one digit, 1, 2 or 5.
function round(low, high) {
  const least = (high - low) / 4, power = 10 ** Math.floor(Math.log10(least) + 1e-9), values = [];
  const step = power * [1, 2, 5, 10].find(k => k * power >= least * (1 - 1e-9));
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  return values;
}

// ---------- speeds ----------

let counted;  // species that have a histogram

// Sums over the frames up to each one are computed once, on first use.
let sums;
function speedsUpTo(frame) {
  if (!sums) {
    const counts = film.speeds.counts[0].map(row => new Float64Array(row.length)), energies = kinds.map(() => 0);
    sums = film.speeds.counts.map((own, k) => {
      counted.forEach(s => own[s].forEach((n, bin) => { counts[s][bin] += n; }));
      kinds.forEach((_, s) => { energies[s] += film.kinetic[k][s]; });
      return { counts: counts.map(c => c.slice()), energies: energies.map(e => e / (k + 1)) };
    });
  }
  return sums[frame];
}

// Of the moment if velocities are known well enough then, else of the frame before.
function speedsNow() {
  const { frame, gap, share } = moment, h = (film.time[gap + 1] ?? film.time[gap]) - film.time[gap];
  const rounding = Math.max(...film.edges) / grain / h;
  if (!share || frame !== gap || film.guesses[gap] || rounding > 1e-3 * film.scales.speed[1]) return { counts: film.speeds.counts[frame], energies: film.kinetic[frame] };
  const bins = film.speeds.edges.length - 1, width = film.speeds.edges[1];
  const counts = kinds.map(() => new Array(bins).fill(0));
  for (let i = 0; i < disks; i++) {
    const bin = Math.floor(Math.hypot(VX[i], VY[i]) / width);
    if (bin < bins) counts[speciesOf[i]][bin]++;
  }
  return { counts, energies: moment.kinetic };
}

function drawHistogram(frame) {
  if (!counted.length) return;
  if (film.speeds.rest) {
    drawSpeedsAndRest(film.speeds.counts[frame]);
    return;
  }
  const top = film.speeds.edges.at(-1), width = film.speeds.edges[1];
  const { counts, energies } = state.sofar ? speedsUpTo(frame) : speedsNow();
  const samples = state.sofar ? frame + 1 : 1;
  const peak = Math.max(...counted.map(s => Math.sqrt(kinds[s].mass / (energies[s] || Infinity)) * Math.exp(-0.5)));
  const high = peak > 0 ? 1.6 * peak : 4 / top;
  const plot = prepare($('histogram')), { pen } = plot;
  const { x, y } = axes(plot, [0, top], [0, high], 'speed');
  pen.save();
  pen.beginPath();
  pen.rect(plot.left, plot.top, plot.right - plot.left, plot.bottom - plot.top);
  pen.clip();
  for (const s of counted) {
    const one = 1 / (kinds[s].count * samples * width);
    pen.fillStyle = css(speciesColour(kinds[s]));
    pen.globalAlpha = 0.45;
    pen.beginPath();
    Array.from(counts[s], (n, bin) => n && pen.rect(x(bin * width), y(n * one), x(width) - x(0) - 0.5, plot.bottom - y(n * one)));
    pen.fill();
  }
  pen.globalAlpha = 1;
  pen.lineWidth = 2;
  for (const s of film.settles ? counted : []) {
    const b = kinds[s].mass / energies[s];
    if (!isFinite(b)) continue;
    pen.strokeStyle = css(speciesColour(kinds[s]));
    pen.beginPath();
    for (let k = 0; k <= 120; k++) {
      const v = k / 120 * top;
      pen.lineTo(x(v), y(b * v * Math.exp(-b * v * v / 2)));
    }
    pen.stroke();
  }
  pen.restore();
}

// Where many disks are at rest there is no Maxwell curve, but speeds of many sizes: both axes grow by factors.
function drawSpeedsAndRest(counts) {
  const edges = film.speeds.edges.map(Math.log10), most = Math.log10(1.5 * Math.max(10, ...kinds.map(kind => kind.count)));
  const plot = prepare($('histogram')), { pen } = plot, power = value => short(+(10 ** value).toPrecision(1));
  const { x, y } = axes(plot, [edges[0], edges.at(-1)], [-0.3, most], 'speed', value => Number.isInteger(value) ? power(value) : '');
  pen.globalAlpha = 0.6;
  for (const s of counted) {
    pen.fillStyle = css(speciesColour(kinds[s]));
    counts[s].slice(1).forEach((n, bin) => n && pen.fillRect(x(edges[bin]), y(Math.log10(n)), x(edges[bin + 1]) - x(edges[bin]) - 0.5, plot.bottom - y(Math.log10(n))));
  }
  pen.globalAlpha = 1;
  $('bars').textContent = `At rest: ${counted.map(s => `${counts[s][0]} of ${kinds[s].count} ${kinds[s].name}`).join(', ')}. `
    + 'Bars: the number of disks at each speed; both axes grow by factors of ten.';
}

// ---------- energies ----------

let cursorAt;  // from time to pixels

const share = s => state.total ? kinds[s].count : 1;

function layEnergyOut() {
  const all = [film.kinetic, ...(film.potential ? [film.potential] : [])];
  const values = all.flatMap(series => series.flatMap(row => row.map((e, s) => e * share(s))));
  const low = values.reduce((a, b) => Math.min(a, b), 0), high = values.reduce((a, b) => Math.max(a, b), 0) || 1;
  const plot = prepare($('energy')), { pen } = plot;
  const { x, y } = axes(plot, [first(), last() > first() ? last() : first() + 1], [low, low + 1.06 * (high - low)], 'time');
  pen.lineWidth = 1.6;
  pen.lineJoin = 'round';
  const between = energiesBetween(x);
  all.forEach((series, dashed) => kinds.forEach((kind, s) => {
    const place = ([time, ...energies]) => [x(time), y(energies[dashed][s] * share(s))];
    const at = k => [film.time[k], film.kinetic[k], film.potential?.[k]];
    pen.fillStyle = pen.strokeStyle = css(speciesColour(kind));
    for (const known of [true, false]) {
      pen.setLineDash(dashed ? [4, 3] : []);
      pen.globalAlpha = known ? 1 : 0.35;
      pen.beginPath();
      for (let gap = 0; gap < frames - 1; gap++) {
        if (known === !!film.guesses[gap]) continue;
        if (!gap || known === !!film.guesses[gap - 1]) pen.moveTo(...place(at(gap)));  // else dashes go on
        between[gap]?.forEach(row => pen.lineTo(...place(row)));
        pen.lineTo(...place(at(gap + 1)));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    if (sparse(x)) for (let k = 0; k < frames; k++) if (film.guesses[k] || film.guesses[k - 1]) {
      pen.beginPath();
      pen.arc(...place(at(k)), 2.2, 0, 2 * Math.PI);
      pen.fill();
    }
  }));
  pen.setLineDash([]);
  $('guide').textContent = film.guesses.some(count => count) && sparse(x) ? 'Dots: frames. What happens along the pale lines between them is not in this page.' : '';
  cursorAt = x;
  const heads = ['', 'disks', 'kinetic', ...(film.potential ? ['potential (dashed)'] : [])];
  const rows = kinds.map(({ name, count }) => [`<span class="chip">${safe(name)}</span>`, count, ...heads.slice(2).map(() => '')]);
  const cells = (row, tag) => `<tr>${row.map(one => `<${tag}>${one}</${tag}>`).join('')}</tr>`;
  $('energies').innerHTML = cells(heads, 'th') + rows.map(row => cells(row, 'td')).join('');
  $('energies').querySelectorAll('.chip').forEach((chip, s) => chip.style.setProperty('--own', css(speciesColour(kinds[s]))));
}

// Whether frames lie so far apart on the axis of time that they can be told from one another.
const sparse = x => (x(last()) - x(first())) / frames > 6;

// Of each gap with known paths that is several pixels wide, energies pixel by pixel: time, kinetic, potential.
function energiesBetween(x) {
  const { time } = moment, rows = [];
  for (let gap = 0; gap < frames - 1; gap++) {
    const start = film.time[gap], h = film.time[gap + 1] - start, steps = Math.floor(2 * (x(start + h) - x(start)));
    if (film.guesses[gap] || steps < 3) continue;
    rows[gap] = Array.from({ length: steps - 1 }, (_, k) => {
      move(start + (k + 1) / steps * h);
      return [moment.time, moment.kinetic, moment.potential];
    });
  }
  move(time);
  return rows;
}

// ---------- pressure ----------

// Up to the moment; the rest is still to come.
function drawPressure() {
  if (!film.pressure) return;
  const { time, value } = film.pressure, plot = prepare($('pressure')), { pen } = plot;
  const high = value.reduce((a, b) => Math.max(a, b), 0) || 1, now = time.findLastIndex(t => t <= moment.time);
  const { x, y } = axes(plot, [first(), last() > first() ? last() : first() + 1], [0, 1.06 * high], 'time');
  pen.lineWidth = 1.6;
  pen.strokeStyle = ink.accent;
  for (const [from, to, alpha] of [[0, now, 1], [now, time.length - 1, 0.3]]) {
    pen.globalAlpha = alpha;
    pen.beginPath();
    for (let k = Math.max(0, from); k <= to; k++) pen.lineTo(x(time[k]), y(value[k]));
    pen.stroke();
  }
  pen.globalAlpha = 1;
  $('force').textContent = now < 0 ? '' : short(value[now]);
}
