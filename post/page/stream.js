// ---------- laboratory (interactive page): film of a running simulation, whose frames a worker process sends ----------

// The page draws the newest frame, and keeps earlier frames so that the user can go back. If they need too much memory, every
// second frame in their older half is removed. When the user goes back and plays the film, the page first shows the kept frames
// and then new frames from the worker process.
// memory for frames [bytes]; numbers before the positions in a message; samples in a plot
const PAST_ROOM = 6e7, HEAD = 7, MOST_CURVE = 3000;
const SAME_TIME = 1e-13;  // largest relative difference of two times that count as equal
const NOTHING = { next: [], happened: null };
const stream = { socket: null, scene: null, live: true, fresh: 0, sent: 0, ended: false, asked: false, isChanged: true, curves: null, run: 0, wish: null };

function send(wish) {
  if (wish.do === 'play' || wish.do === 'pause') stream.asked = wish.do === 'play';
  if (stream.socket.readyState === 1) stream.socket.send(JSON.stringify(wish));
}

// Opens a connection to a worker process, sends a request, and handles the messages of the worker.
function talk(wish, heard) {
  const socket = Object.assign(new WebSocket(new URL('ws', location.href.replace(/^http/, 'ws'))), { binaryType: 'arraybuffer', leave() { this.onclose = null; this.close(); } });
  socket.onopen = () => socket.send(JSON.stringify(wish));
  socket.onmessage = ({ data }) => { if (typeof data === 'string') heard(JSON.parse(data)); else take(data); };
  socket.onclose = ({ wasClean, reason }) => { if (reason || !wasClean) heard({ is: 'gone', problems: [{ text: reason || 'No answer: the laboratory has ended.' }] }); };
  return socket;
}

function starts(on) { document.documentElement.classList.toggle('starting', on); }
const PLACING_TEXT = $('starting').textContent;

// Shows, in the place of the film, why there is none.
function refuse(lines) {
  $('starting').textContent = lines.join('\n');
  document.documentElement.classList.add('empty', 'refused');
}

function isStarting() { return document.documentElement.classList.contains('starting'); }

// Starts the run requested by the user of the laboratory. All runs of this film share a connection to one worker process.
function start(run) {
  const same = stream.wish?.input === run.input, wish = { do: 'start', ...run, pace: same ? stream.sent : null, playing: !parent.isPaused() && !parent.isComparing() };
  if (!same) [stream.sent, usual] = [0, usual || !!stream.wish];
  stream.wish = run;
  starts(true);
  $('starting').textContent = PLACING_TEXT;
  document.documentElement.classList.remove('refused');
  if (stream.socket?.readyState === 1) { send(wish); return; }
  stream.socket = talk(wish, news => {
    hear[news.is]?.(news);
    parent.hear?.(window, news);
  });
}

// Stops the worker process if placing the disks takes too long. A new worker process then executes the next run.
function leave() { stream.socket?.leave(); }

// Appends a sample to the curves. Lists without a new value keep the last one. Every second sample is removed if there are many.
function addSample(curves, news) {
  const { time } = news, before = curves.news.at(-1);
  curves.time.push(time);
  curves.news.push(news.means ? news : before);
  for (const name of [...Object.keys(ENERGIES), 'inside']) curves[name]?.forEach((values, s) => values.push((name in news ? news[name]?.[s] : values.at(-1)) ?? null));
  for (const name of ['pressure', 'left', 'entered']) curves[name]?.push((name in news ? news[name] : curves[name].at(-1)) ?? null);
  if (curves.time.length <= MOST_CURVE) return;
  const thin = list => Array.isArray(list?.[0]) ? list.map(thin) : list?.filter((_, k) => k % 2 === 0);
  for (const name of Object.keys(curves)) curves[name] = thin(curves[name]);
}

// Appends the energies immediately before and after an event of a few disks, so that the curve has a step at this time.
function addStep({ time, before, kinetic, potential, rotational }) {
  const { curves } = stream;
  if (!(time >= curves.time.at(-1))) return;
  const energy = i => masses[i] * (before[i][0] ** 2 + before[i][1] ** 2) / 2;
  const sums = kinds.map((kind, s) => before.reduce((sum, _, i) => sum + (speciesOf[i] === s ? energy(i) / kind.count : 0), 0));
  addSample(curves, { time, kinetic: sums, ...potential && { potential } });
  addSample(curves, { time, kinetic, ...potential && { potential }, ...rotational && { rotational } });
}

const hear = {
  scene({ facts, blocks, run, changed }) {
    Object.assign(facts, { events: facts.exact, colour: facts.species.length > 1 ? 'species' : 'speed' });
    const names = list => list?.map(({ name }) => name).join();
    if (names(kinds) === names(facts.species)) facts.colour = state.colour;
    stream.isChanged = true;
    if (changed) {
      film = { ...film, ...facts, changes: film.changes, scales: film.scales, speeds: film.speeds };
      kinds = film.species;
      prepareFilm();
      refresh();
      return;
    }
    stream.scene = { facts, blocks, run };  // the new scene is shown together with its first frame
  },
  numbers(news) {
    const { curves } = stream, { time } = news;
    // At an event of a few disks the curves already have a sample of this time. A change by the user at this time is a step.
    const isKnown = time <= curves.time.at(-1) && news.kinetic.every((energy, s) => energy === curves.kinetic[s].at(-1));
    if (isKnown) curves.news[curves.news.length - 1] = news; else addSample(curves, news);
    film.settles = news.settles;
    fitScales(news.speed);
    if (!state.playing && film.exact) show(moment.time, true);
  },
  events(news) {
    const own = ([time, i, j]) => [time, i - 1, j - 1];
    const next = news.next.map(own), known = past.at(-2)?.coming?.next ?? [];
    const isSame = next.length === known.length && next.every(([time], k) => time === known[k][0]);  // most frames share a list
    past.at(-1).coming = { next: isSame ? known : next, happened: news.happened && own(news.happened) };
    stream.isChanged = false;
    news.encounters.forEach(addStep);
    encounter.collisions.push(...news.encounters.filter(({ disks: pair }) => pair));
    if (!state.playing && source) show(moment.time, true);
  },
  state({ playing, ended, reason, changes }) {
    if (film && changes) film.changes = changes.map(([time, name, value]) => [time, name ? `${name} = ${value}` : value]);
    if (isStarting()) return;  // the message belongs to the previous run
    if (reason && past.length && !state.playing) show(moment.time, true);  // a refused disk returns to its place
    stream.ended = ended;
    if (playing) stream.asked = false;
    // The state after a step may arrive after the user has pressed play, before the worker process answers this request.
    if (!playing && !stream.asked && state.playing && stream.live && past.length && !parent.isComparing()) play(false);
  },
  problems({ change }) {
    if (change) return;  // a refused change belongs to the previous run
    starts(false);
    if (past.length && !state.playing) show(moment.time, true);  // a refused disk or arrow returns to its place
  },
  gone({ problems }) {
    starts(false);
    stream.ended = true;
    if (!past.length) refuse(problems.map(({ text }) => text));
  },
};

function open({ facts, blocks, run }) {
  setScene(facts, blocks);
  angles = facts.turning ? new Float32Array(disks) : null;
  const each = there => there ? kinds.map(() => []) : null;
  const curves = { time: [], kinetic: each(true), potential: each(facts.gravity.some(Boolean)), rotational: each(facts.turning), inside: each(facts.isOpen), left: facts.isOpen ? [] : null, entered: facts.isOpen ? [] : null, pressure: [], news: [] };
  Object.assign(stream, { live: true, ended: false, asked: false, curves, run });
  encounter.collisions = [];
  source = fromWorker;
}

// Adapts the scale of speeds after the disks have become much faster or slower, or when resting disks begin to move.
function fitScales(mean) {
  const [, top] = film.scales.speed, rest = VX.filter((vx, i) => vx === 0 && VY[i] === 0).length / (sumOf(moment.inside) || 1);
  if ((rest > RESTING && rest < 1) === film.speeds.rest && !(mean > 0.8 * top) && !(mean && mean < 0.1 * top && !film.speeds.rest)) return;
  film.rest = rest;
  setTop(mean > 0.8 * top || mean < 0.1 * top ? 2.2 * mean || top : top);
  prepareFilm();
  layOutStage();
  drawLegend();
}

function setTop(top) {
  film.scales = { speed: ['speed', top], ...!film.jumps && { displacement: ['displacement', Math.max(...film.edges) / 4] } };
  setBins(1.3 * top, film.rest);
}

function take(buffer) {
  if (stream.scene) { open(stream.scene); stream.scene = null; starts(false); }
  const head = new Float64Array(buffer, 0, HEAD), pairs = from => new Float32Array(buffer, 8 * HEAD + 8 * from * disks, 2 * disks);
  const frame = { time: head[0], collisions: head[1], sides: [...head.slice(2, 6)], open: [0, 1, 2, 3].map(k => head[6] >> k & 1), place: pairs(0), velocity: pairs(1) };
  if (film.turning) frame.angle = new Float32Array(buffer, 8 * HEAD + 16 * disks, disks);
  if (film.recycling) frame.recycled = new Float32Array(buffer, 8 * HEAD + (film.turning ? 20 : 16) * disks, disks);
  // The interval between two frames is so short that no disk moves farther than half of the box.
  cross(frame, ({ place }, k) => film.periodic[k % 2] ? Math.round((place[k] - frame.place[k]) / film.edges[k % 2]) : 0);
  const isFirst = !past.length, follows = stream.live && moment.time === past.at(-1)?.time;
  // A new frame replaces the last one if both have the same time (at a start), or if their times differ only by a rounding
  // error (after a change).
  if (frame.time - past.at(-1)?.time <= SAME_TIME * Math.abs(frame.time)) past.pop();
  past.push(frame);
  if (past.length > 2 && past.length * buffer.byteLength > PAST_ROOM) past = past.filter((_, k) => k % 2 === 0 || 2 * k > past.length);
  stream.fresh++;
  if (isFirst) {
    const opens = document.documentElement.classList.contains('empty');
    document.documentElement.classList.remove('empty');
    origins = frame.place;
    const squares = Array.from({ length: disks }, (_, i) => frame.velocity[2 * i] ** 2 + frame.velocity[2 * i + 1] ** 2).filter(Boolean);
    setTop(1.5 * Math.sqrt(2 * squares.reduce((sum, one) => sum + one, 0) / squares.length) || 1);  // mean over the moving disks
    move(frame.time);
    begin();
    refresh();
    if (opens) parent.arrangeAll();  // controls and plots move from the previous film to this one
    play(!parent.isPaused());
  } else if (!state.playing && follows) {
    show(frame.time, true);
    parent.went(window, frame.time);
  }
  if (!state.playing) drawn();
}

// The page confirms frames whenever it draws a picture, and at once while the film is paused. The worker process waits for
// confirmations, and is at most two frames ahead of the page.
function drawn() { for (; stream.fresh > 0; stream.fresh--) send({ do: 'got' }); }

const fromWorker = {
  grows: true,
  counted: () => moment.time === last() ? 'now' : 'an earlier moment',
  curves: () => stream.curves,
  means: () => stream.curves.news[Math.max(0, upTo(stream.curves.time, moment.time) - 1)]?.means,
  // The events to come at each frame belong to this frame. While those of the newest frame are on their way, those of the frame
  // before are valid if their first event is still to come and the user has changed nothing.
  coming() {
    const { coming } = past[moment.frame], { coming: before } = past[moment.frame - 1] ?? {};
    return coming ?? (!stream.isChanged && before?.next[0]?.[0] > moment.time ? { ...before, happened: null } : NOTHING);
  },
  hasEvents: () => !film.stepped,
  goesOn: () => isStarting() || !stream.ended || !stream.live,
  setPace(value) {
    if (value === stream.sent) return;
    stream.sent = value;
    send({ do: 'pace', pace: value });
  },
  begins() {
    stream.live = moment.time === last();
    if (stream.live && !parent.isComparing()) send({ do: 'play' });
  },
  // Shows the newest frame. Frames not drawn because of the pause are confirmed, too, because the worker process would otherwise
  // wait for them and ignore the next step.
  rest() {
    send({ do: 'pause' });
    if (stream.live && !parent.isComparing()) show(last(), true);
    drawn();
  },
  // A step beyond the last received frame is computed by the worker process.
  goOn(what) {
    play(false);
    if (what === 'step' && moment.time !== last()) return false;
    show(last(), true);
    stream.live = true;
    send({ do: what, time: paceNow() / 30 });
    return true;
  },
  newest(next) {
    const { fresh } = stream;
    drawn();
    if (parent.conducts(window)) return;  // compared runs show the same time
    if (stream.live) {
      if (fresh) show(last());
    } else {
      if (next < last()) { show(next); return; }
      show(last());
      stream.live = true;
      send({ do: 'play' });
    }
  },
};

// ---------- film as a part of the laboratory ----------

// Called by the laboratory for each of its films.
function inside() { return { film, source, state, moment, kinds, stream, overlaid, past, encounter, numbersNow, speedsOfFilm, motion: isEncounter() ? motionOfFilm : null }; }

// Converts a position in the box to a position on the page [CSS pixels].
function pixelOf(x, y) { return [across(x) / page.dots, up(y) / page.dots]; }

// Returns whether the film can show a given time. After the end of the run, its last frame is shown at all later times.
function hasReached(time) { return past.length > 0 && !isStarting() && (last() >= time || stream.ended); }

// Continues the film after the page has changed from one film to several, or from several to one.
function resume() { if (state.playing) source.begins(); }

function reach(time) {
  if (hasReached(time)) return;
  stream.live = true;
  send({ do: 'reach', time });
}

// Shows the same time as another film, while the films are paused.
function join(time) {
  if (!past.length) return;
  show(Math.min(time, last()), true);
  stream.live = moment.time === last();
  reach(time);
}

// Returns whether the film has a frame at a given time, or can still compute one.
function canShow(time) { return !(past.at(-1)?.time >= time) || past[frameAt(time)].time === time; }

// Returns the time of the last frame, between two times, that satisfies a condition. If there is none, returns the time of the
// first later frame that satisfies the condition, or null.
function frameBetween(from, to, condition) {
  let found = null;
  for (const { time } of past.slice(frameAt(from) + 1)) {
    if (time > to && found !== null) break;
    if (condition(time)) found = time;
  }
  return found;
}

function overlay(list) {
  overlaid = list;
  if (film && source.curves()?.time.length) drawEnergies();
  if (isEncounter()) tellOthers();
}

function choices(wish) {
  if (wish) {
    if (wish.pace) [pace, usual] = [wish.pace, false];
    $('pace').value = wish.speed;
    Object.assign(state, wish.state);
    Object.assign(encounter, wish.scale);
    if (film) refresh();
  }
  const { colour, arrows, sofar, total, momenta, centred, foretold } = state, { input, speed, mass } = encounter;
  return { pace, speed: $('pace').value, state: { colour, arrows, sofar, total, momenta, centred, foretold }, scale: { input, speed, mass } };
}

// Shows this film again from its first stored frame when another run starts beside it; a paused film waits there.
function replay() {
  if (!film) return;
  show(first(), true);
  stream.live = false;
  send({ do: 'pause' });
  play(!parent.isPaused());
}

// Shows the film beside others: `size` is the size of its picture, at the given distance from the left edge of the page.
// Without `size`, the film fills the whole page. A `bare` film has neither controls nor plots.
let boxSize = null;  // { left, width, height } [CSS pixels]
function arrange(size, bare) {
  boxSize = size;
  document.documentElement.classList.toggle('boxed', !!size);
  document.documentElement.classList.toggle('bare', bare);
  layout();
}

// Plots the measured values of a scan with error bars against the scanned variable.
function plotScan(canvas, { log, points, values }) {
  const scaled = value => log ? Math.log10(value) : value, ends = points.flatMap(([, mean, error]) => [mean - error, mean + error]);
  Object.assign(canvas, { width: canvas.clientWidth * page.dots, height: canvas.clientHeight * page.dots });
  const plot = prepare(canvas), { pen } = plot, from = scaled(values[0]), to = scaled(values.at(-1)), more = 0.04 * (to - from);
  const low = Math.min(0, ...ends), high = Math.max(...ends, low + 1e-9);
  const { x, y } = axes(plot, [from - more, to + more], [low, low + 1.1 * (high - low)], '', value => short(log ? +(10 ** value).toPrecision(1) : value), short);
  Object.assign(pen, { strokeStyle: ink.accent, fillStyle: ink.accent, lineWidth: 1.6 });
  pen.beginPath();
  for (const [value, mean] of points) pen.lineTo(x(scaled(value)), y(mean));
  for (const [value, mean, error] of points) {
    pen.moveTo(x(scaled(value)), y(mean - error));
    pen.lineTo(x(scaled(value)), y(mean + error));
  }
  pen.stroke();
  for (const [value, mean] of points) pen.fillRect(x(scaled(value)) - 3, y(mean) - 3, 6, 6);
  return points.map(([value, mean, error]) => `${short(value)}: ${withError({ value: mean, error })}`).join('; ');
}
