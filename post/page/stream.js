// ---------- a run of the laboratory: frames as a worker makes them ----------

// The page draws the newest frame; those before are kept, as far as there is room, to go back to. A film that has been gone
// back in plays until it is where the worker is, which goes on then.
const PAST_ROOM = 6e7, HEAD = 6, MOST_CURVE = 3000;  // bytes of frames; numbers before the places; samples of a plot
const stream = { socket: null, scene: null, live: true, fresh: 0, sent: 0, ended: false, numbers: {}, events: { next: [], happened: null }, curves: null, run: 0, wish: null };

function send(wish) { if (stream.socket.readyState === 1) stream.socket.send(JSON.stringify(wish)); }

// A worker of its own for a wish; what it says.
function talk(wish, heard) {
  const socket = Object.assign(new WebSocket(new URL('ws', location.href.replace(/^http/, 'ws'))), { binaryType: 'arraybuffer', leave() { this.onclose = null; this.close(); } });
  socket.onopen = () => socket.send(JSON.stringify(wish));
  socket.onmessage = ({ data }) => { if (typeof data === 'string') heard(JSON.parse(data)); else take(data); };
  socket.onclose = ({ wasClean, reason }) => { if (reason || !wasClean) heard({ is: 'gone', problems: [{ text: reason || 'No answer: the laboratory has ended.' }] }); };
  return socket;
}

function starts(on) { document.documentElement.classList.toggle('starting', on); }
const isStarting = () => document.documentElement.classList.contains('starting');

// The run that the laboratory wishes, on the same line for all runs of this film.
function start(run) {
  const same = stream.wish?.input === run.input, wish = { do: 'start', ...run, pace: same ? stream.sent : null, playing: !parent.isPaused() };
  if (!same) [stream.sent, usual] = [0, usual || !!stream.wish];
  $('scan').hidden ||= !same;
  stream.wish = run;
  starts(true);
  if (stream.socket?.readyState === 1) { send(wish); return; }
  stream.socket = talk(wish, news => {
    hear[news.is]?.(news);
    parent.hear?.(window, news);
  });
}

// The next run has another worker: this one finds no place for its disks, or not soon.
function leave() { stream.socket.leave(); }

const hear = {
  scene({ facts, blocks, run, changed }) {
    Object.assign(facts, { events: facts.exact, colour: facts.species.length > 1 ? 'species' : 'speed' });
    const names = list => list?.map(({ name }) => name).join();
    if (names(kinds) === names(facts.species)) facts.colour = state.colour;
    if (changed) {
      film = { ...film, ...facts, scales: film.scales, speeds: film.speeds };
      kinds = film.species;
      prepareFilm();
      refresh();
      return;
    }
    stream.scene = { facts, blocks, run };  // it is shown with its first frame
  },
  numbers(news) {
    const { curves } = stream, { time } = news;
    stream.numbers = news;
    if (time <= curves.time.at(-1)) return;
    curves.time.push(time);
    for (const name of Object.keys(ENERGIES)) curves[name]?.forEach((values, s) => values.push(news[name]?.[s] ?? null));
    curves.pressure.push(news.pressure);
    if (curves.time.length > MOST_CURVE) {
      const thin = list => Array.isArray(list?.[0]) ? list.map(thin) : list?.filter((_, k) => k % 2 === 0);
      for (const name of Object.keys(curves)) curves[name] = thin(curves[name]);
    }
    film.settles = news.settles;
    fitScales(news.mean_speed.value);
  },
  events(news) {
    const own = ([time, i, j]) => [time, i - 1, j - 1];
    Object.assign(stream.events, { next: news.next.map(own), happened: news.happened && own(news.happened) });
    if (!state.playing && source) show(moment.time, true);
  },
  state({ playing, ended }) {
    if (isStarting()) return;  // that is said of the run before
    stream.ended = ended;
    if (!playing && state.playing && stream.live && past.length) play(false);
  },
  problems({ change }) { if (!change) starts(false); },  // a change that cannot be was one of the run before
  gone: () => starts(false),
};

function open({ facts, blocks, run }) {
  setScene(facts, blocks);
  angles = facts.turning ? new Float32Array(disks) : null;
  const each = there => there ? kinds.map(() => []) : null;
  const curves = { time: [], kinetic: each(true), potential: each(facts.gravity.some(Boolean)), rotational: each(facts.turning), pressure: [] };
  Object.assign(stream, { live: true, ended: false, curves, run, events: { next: [], happened: null }, numbers: {} });
  source = fromWorker;
}

// Gases are heated and cooled, and disks that rest are set in motion.
function fitScales(mean) {
  const [, top] = film.scales.speed, rest = VX.filter((vx, i) => vx === 0 && VY[i] === 0).length / disks;
  if ((rest > RESTING && rest < 1) === film.speeds.rest && !(mean > 0.8 * top) && !(mean && mean < 0.1 * top && !film.speeds.rest)) return;
  film.rest = rest;
  setTop(mean > 0.8 * top || mean < 0.1 * top ? 2.2 * mean || top : top);
  prepareFilm();
  layOutStage();
  drawLegend();
}

function setTop(top) {
  film.scales = { speed: ['speed (reduced units)', top], displacement: ['displacement', Math.max(...film.edges) / 4] };
  setBins(1.3 * top, film.rest);
}

function take(buffer) {
  if (stream.scene) { open(stream.scene); stream.scene = null; starts(false); }
  const head = new Float64Array(buffer, 0, HEAD), pairs = from => new Float32Array(buffer, 8 * HEAD + 8 * from * disks, 2 * disks);
  const frame = { time: head[0], collisions: head[1], sides: [...head.slice(2)], place: pairs(0), velocity: pairs(1) };
  if (film.turning) frame.angle = new Float32Array(buffer, 8 * HEAD + 16 * disks, disks);
  // Frames are so dense that no disk crosses half of the box between two.
  cross(frame, ({ place }, k) => film.periodic[k % 2] ? Math.round((place[k] - frame.place[k]) / film.edges[k % 2]) : 0);
  const isFirst = !past.length, follows = stream.live && moment.time === past.at(-1)?.time;
  if (past.at(-1)?.time === frame.time) past.pop();  // as of the start, and of a change
  past.push(frame);
  while (past.length > 2 && past.length * buffer.byteLength > PAST_ROOM) past.shift();
  stream.fresh++;
  if (isFirst) {
    document.documentElement.classList.remove('empty');
    origins = frame.place;
    const squares = Array.from({ length: disks }, (_, i) => frame.velocity[2 * i] ** 2 + frame.velocity[2 * i + 1] ** 2).filter(Boolean);
    setTop(1.5 * Math.sqrt(2 * squares.reduce((sum, one) => sum + one, 0) / squares.length) || 1);  // of those that move
    move(frame.time);
    begin();
    refresh();
    play(!parent.isPaused());
  } else if (!state.playing && follows) show(frame.time, true);
  if (!state.playing) drawn();
}

// Each frame is answered: the worker is never more than two ahead.
function drawn() { for (; stream.fresh > 0; stream.fresh--) send({ do: 'got' }); }

const fromWorker = {
  grows: true,
  counted: () => moment.time === last() ? 'now' : 'gone back',
  curves: () => stream.curves,
  numbers: () => stream.numbers,
  coming: () => stream.live ? stream.events : { next: [], happened: null },
  hasEvents: () => !film.stepped,
  goesOn: () => isStarting() || !stream.ended || !stream.live,
  setPace(value) {
    if (value === stream.sent) return;
    stream.sent = value;
    send({ do: 'pace', pace: value });
  },
  begins() {
    stream.live = moment.time === last();
    if (stream.live) send({ do: 'play' });
  },
  rest() { send({ do: 'pause' }); if (stream.live) show(last(), true); },  // and so with what comes until it is heard
  // One step beyond what is there is the worker's.
  goOn(what) {
    play(false);
    if (what === 'step' && moment.time !== last()) return false;
    show(last(), true);
    stream.live = true;
    send({ do: what, time: paceNow() / 30 });
    return true;
  },
  newest(next) {
    if (stream.live) {
      if (!stream.fresh) return;
      show(last());
      drawn();
    } else {
      drawn();
      if (next < last()) { show(next); return; }
      show(last());
      stream.live = true;
      send({ do: 'play' });
    }
  },
};

// ---------- a part of the laboratory ----------

// What the laboratory asks its films for, which stand side by side.
function inside() { return { film, source, state, moment, kinds, stream, overlaid }; }

function overlay(list) {
  overlaid = list;
  if (film && source.curves()?.time.length) drawEnergies();
}

function choices(wish) {
  if (wish) {
    if (wish.pace) [pace, usual] = [wish.pace, false];
    $('pace').value = wish.speed;
    Object.assign(state, wish.state);
    if (film) refresh();
  }
  const { colour, arrows, sofar, total } = state;
  return { pace, speed: $('pace').value, state: { colour, arrows, sofar, total } };
}

// From the start of what is kept, as long as another run starts beside it.
function replay() {
  if (!film) return;
  show(first(), true);
  stream.live = false;
  send({ do: 'pause' });
  play(true);
}

// A box among others, with room for the stage of `size`; none: a page of its own.
let boxSize = null;
function arrange(size, bare) {
  boxSize = size;
  document.documentElement.classList.toggle('boxed', !!size);
  document.documentElement.classList.toggle('bare', bare);
  layout();
}

// Measured values of a scan and their errors against the variable, as far as they are there.
function showScan({ x: variable, y: measured, log, points, values }) {
  const canvas = $('curve'), scaled = value => log ? Math.log10(value) : value;
  $('scan').hidden = false;
  $('scan').querySelector('h2').textContent = `Scan: ${measured}`;
  Object.assign(canvas, { width: canvas.clientWidth * page.dots, height: canvas.clientHeight * page.dots });
  const plot = prepare(canvas), { pen } = plot, ends = points.flatMap(([, mean, error]) => [mean - error, mean + error]);
  const low = Math.min(0, ...ends), high = Math.max(...ends, low + 1e-9), from = scaled(values[0]), to = scaled(values.at(-1)), more = 0.04 * (to - from);
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
  const words = points.map(([value, mean, error]) => `${short(value)}: ${withError({ value: mean, error })}`).join('; ');
  $('scan').querySelector('p').textContent = `Against ${variable}. ${words}`;
  canvas.setAttribute('aria-label', `${measured} against ${variable}. ${words}`);
}
