// ---------- settings that the user can change ----------

const state = { playing: false, colour: '', traced: [], arrows: false, sofar: null, total: false, momenta: true, centred: false, foretold: true };
let pace;          // time of the film per second of real time, at speed 1
let usual = true;  // whether the pace is determined by the length and the speeds of this film

function begin() {
  lookAtAll();
  const names = ['species', ...Object.keys(film.scales)];
  state.colour = film.colour;
  state.traced = film.traced ?? [];
  state.sofar ??= disks < 200;
  if (usual) pace = film.pace ?? usualPace();
  $('colour').replaceChildren(...names.map(name => new Option(name, name, false, name === state.colour)));
  prepareFilm();
}

// At this pace the film lasts at least 15 seconds, and a disk of typical speed crosses at most half of the box per second.
function usualPace() {
  const most = Math.min((last() - first()) / 15 || Infinity, 0.5 * Math.max(...film.edges) / film.scales.speed[1]) || 1;
  const power = 10 ** Math.floor(Math.log10(most));
  return power * Math.floor(most / power);
}

// Prepares the controls and scales that depend on the frames received so far.
function prepareFilm() {
  sums = null;
  const alike = s => kinds[s].count >= FEWEST && kinds[s].alike;
  counted = kinds.map((_, s) => s).filter(s => (film.speeds.rest && disks >= FEWEST) || alike(s));
  $('coming').hidden = !film.events;
  $('speeds').hidden = !counted.length;
  $('sofar').hidden = film.speeds.rest;
  $('speeds').classList.toggle('rest', film.speeds.rest);
  $('event').hidden = !source.hasEvents();
  prepareEncounter();
}

// ---------- drawing ----------

let told = 0;  // time at which texts and plots were last drawn

function show(time, anew = false) {
  move(time);
  deselectAbsent();
  drawStage();
  if (state.playing && !anew && performance.now() - told < (disks > 4000 ? 250 : 90)) return;  // less often than the disks
  told = performance.now();
  if (source.grows) drawEnergies();
  $('cursor').style.transform = `translateX(${Math.min(cursorAt(moment.time), $('energy').width / page.dots - 4)}px)`;
  drawHistogram();
  drawPressure();
  drawInside();
  tellNumbers();
  tellEnergies();
  tell();
  tellQueue();
  tellEncounter();
  if (!state.playing) describe();
}

function layout() {
  if (!film || !$('main').clientWidth) return;  // there is no film yet, or it is hidden
  tell();  // first, because the stage takes the space that plots and texts leave
  $('pressures').hidden = $('population').hidden = false;  // visible, so that they can be measured
  layOutStage();
  drawLegend();  // its texts depend on the size of the disks on the screen
  tellLimits();
  layOutStage();
  for (const canvas of ['histogram', 'energy', 'pressure', 'inside', 'polygon'].map($)) {
    const { clientWidth, clientHeight } = canvas;  // read once, because reading it forces a layout
    Object.assign(canvas, { width: Math.round(clientWidth * page.dots), height: Math.round(clientHeight * page.dots) });
  }
  layTableOut();
  drawEnergies();
  show(moment.time, true);
}

function press(pairs) {
  for (const [id, on] of Object.entries(pairs)) $(id).setAttribute('aria-pressed', on);
}

function refresh() {
  press({
    sofar: state.sofar, total: state.total, arrows: state.arrows, follow: camera.follow >= 0,
  });
  $('foretold').checked = state.foretold;
  const speed = 10 ** +$('pace').value;
  const perSecond = short(+(pace * speed).toPrecision(2)), words = `×${+speed.toPrecision(2)} (${perSecond} time unit${perSecond === '1' ? '' : 's'} per second)`;
  $('times').textContent = words;
  $('pace').setAttribute('aria-valuetext', words);
  source.setPace?.(paceNow());
  layout();
}

// ---------- time ----------

const paceNow = () => live.on && live.newest ? live.pace : pace * 10 ** +$('pace').value;

let ticking;  // request of the next animation frame
function play(on) {
  if (state.playing === on) return;
  state.playing = on;
  press({ play: on });
  $('play').setAttribute('aria-label', on ? 'pause' : 'play');
  if (isPart) parent.played(window, on);
  if (!on) {
    cancelAnimationFrame(ticking);
    source.rest?.();
    show(moment.time, true);
    remember();
    return;
  }
  if (moment.time === last() && !source.goesOn()) show(first());
  source.begins?.();
  let before = performance.now();
  ticking = requestAnimationFrame(function tick(stamp) {
    const passed = Math.min(0.1, Math.max(0, stamp - before) / 1000);
    before = stamp;
    const next = moment.time + passed * paceNow();
    if (source.newest) source.newest(next); else show(next);
    if (moment.time === last() && !source.goesOn()) play(false); else ticking = requestAnimationFrame(tick);
  });
}

function go(time) {
  follow(false);
  play(false);
  show(time, true);
  if (isPart) parent.went(window, moment.time);
  remember();
}

const step = frame => go(frameTime(frame));
const back = () => step(frameTime(moment.frame) < moment.time ? moment.frame : moment.frame - 1);
const next = () => { if (!source.goOn?.('step')) step(moment.frame + 1); };
const toEvent = () => { if (!$('event').hidden && !source.goOn?.('event')) go(source.nextEvent()); };

// While the film is paused, the address of the page contains the time shown and is thus a link to this time.
let remembering;
function remember() {
  clearTimeout(remembering);
  if (source === fromFile) remembering = setTimeout(() => history.replaceState(null, '', '#t=' + +moment.time.toPrecision(10)), 300);
}

function fromAddress() {
  const time = parseFloat(new URLSearchParams(location.hash.slice(1)).get('t'));
  if (isFinite(time)) go(time);
  return isFinite(time);
}

// ---------- mouse and touch input on the picture of the disks ----------

const pointers = new Map();  // fingers or mouse buttons that are down
let moved = 0;               // distance that they have moved [pixels]

const onStage = ({ clientX, clientY }) => {
  const box = $('stage').getBoundingClientRect();
  return [(clientX - box.left) * page.dots, (clientY - box.top) * page.dots];
};

function look() {
  $('stage').style.touchAction = camera.zoom > 1 ? 'none' : 'pan-y';  // without zoom, a finger scrolls the page
  press({ follow: camera.follow >= 0 });
  show(moment.time, true);
}

function zoomBy(factor, px, py) {
  zoom(factor, px, py);
  look();
}

// ---------- in the laboratory: dragging of a side during the simulation, or of a disk during a pause ----------

// { side }, { disk } or { tip } of an arrow; the pointer; its first position; the distance from there to the side, disk or tip;
// and the time of the last message to the worker [ms]
let grabbed = null;
const GRIP = 14;  // largest distance from which the mouse can drag a side [CSS pixels]
const CURSORS = ['ew-resize', 'ns-resize'];  // over a vertical and a horizontal side
const HOLDABLE = [undefined, 'still', 'constant_velocity', 'piston'], TOLD_AGAIN = 100;
const isFinger = ({ pointerType }) => pointerType === 'touch', reachOf = (event, mouse) => isFinger(event) ? 22 : mouse;  // [CSS pixels]

const canHold = k => !film.periodic[k >> 1] && !past.at(-1)?.open[k] && HOLDABLE.includes(film.sides[k].motion);

// Returns the index of the side near a point of the canvas, or -1 if there is none that can be dragged now.
function sideAt(px, py, event) {
  if (!isPart || !state.playing || !stream.live) return -1;
  const [x0, x1, y0, y1] = sidesAt(moment.shown), reach = reachOf(event, GRIP) * page.dots;
  const gaps = [x0, x1].map(x => Math.abs(across(x) - px)).concat([y0, y1].map(y => Math.abs(up(y) - py)));
  return gaps.findIndex((gap, k) => gap < reach && canHold(k));
}

// Returns the side or the disk at a point of the canvas if it can be dragged. With a finger, only the disk whose trace is shown
// can be dragged; a finger that starts on another disk scrolls the page or moves the picture.
function grabAt(px, py, event) {
  if (!isPart) return null;
  const own = { pointer: event.pointerId, from: [px, py] }, away = (x, y) => [x - backAcross(px), y - backUp(py)];
  const tip = tipAt(px, py, event);
  if (tip !== null) return { ...own, tip, away: away(...tipOf(tip)) };
  if (!state.playing && moment.time === last() && !isCentred()) {
    const i = isFinger(event) && !isEncounter() ? diskAt(px, py, reachOf(event), state.traced) : diskAt(px, py, 0);
    return i === null ? null : { ...own, disk: i, away: away(X[i], Y[i]) };
  }
  const side = sideAt(px, py, event), place = side < 0 ? 0 : sidesAt(moment.shown)[side];
  return side < 0 ? null : { ...own, side, away: side < 2 ? away(place, 0) : away(0, place), told: -Infinity };
}

// Returns whether a drag must not scroll the page. A vertical motion along a left or right side scrolls the page.
const keepsFromScrolling = () => grabbed !== null && !(grabbed.side < 2);

function drag(px, py) {
  const { side, disk, tip, from, away, told } = grabbed, to = [backAcross(px) + away[0], backUp(py) + away[1]];
  if (tip !== undefined) {
    dragTip(tip, ...to);
    return;
  }
  if (disk !== undefined) {
    [X[disk], Y[disk]] = grabbed.to = isEncounter() ? to.map(one => toStep(one, stepOf(film.edges[0]) / 5)) : to;
    drawStage();
    return;
  }
  const axis = side >> 1, isAlong = told < 0 && Math.abs([px, py][axis] - from[axis]) < SLIP * page.dots;
  if (isAlong || performance.now() < told + TOLD_AGAIN) return;
  grabbed.told = performance.now();
  send({ do: 'hold', side, to: to[axis] });
}

// Ends the dragging. If the browser cancels the gesture, a disk stays where it was.
function release(cancelled) {
  const { side, disk, tip, to, velocity, told } = grabbed;
  grabbed = null;
  if (side !== undefined && told >= 0) send({ do: 'hold', side, to: null });
  if ((to || velocity) && cancelled) show(moment.time, true);
  else if (velocity) redefine(tip, 'velocity', velocity);
  else if (to) redefine(disk, 'position', to);
}

function pointerMoved(event) {
  const before = pointers.get(event.pointerId), here = onStage(event);
  if (!before) {
    $('stage').style.cursor = tipAt(...here, event) !== null ? 'grab' : CURSORS[sideAt(...here, event) >> 1] ?? '';
    return;
  }
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
  pointers.set(event.pointerId, here);
  const dx = here[0] - before[0], dy = here[1] - before[1];
  moved += Math.hypot(dx, dy);
  if (moved < SLIP * page.dots) return;
  if (grabbed) {
    if (grabbed.pointer === event.pointerId) drag(...here);
    return;
  }
  if (others.length) {
    const distance = place => Math.hypot(place[0] - others[0][0], place[1] - others[0][1]);
    zoom(distance(here) / Math.max(1, distance(before)), (here[0] + others[0][0]) / 2, (here[1] + others[0][1]) / 2);
  } else if (camera.zoom > 1) pan(dx, dy);
  look();
}

// Returns the disk nearest to a point of the canvas, or null if the point is farther than `distance` [CSS pixels] from its rim.
// Only the disks in `list` are searched, by default all disks.
function diskAt(px, py, distance, list = Array(disks).keys()) {
  let nearest = null, least = distance * page.dots;
  for (const i of list) {
    const reach = (radii[sizeOf[i]] + least) / view.unit;
    copies([X[i] - reach, X[i] + reach], [Y[i] - reach, Y[i] + reach], (dx, dy) => {
      const gap = Math.hypot(across(X[i] + dx) - px, up(Y[i] + dy) - py) - radii[sizeOf[i]];
      if (gap < least) [nearest, least] = [i, gap];
    });
  }
  return nearest;
}

// Shows the path of the disk nearest to a point of the canvas, or no path if there is none nearby.
function pick(px, py, event) {
  const i = diskAt(px, py, reachOf(event, 12));
  trace(i === null ? [] : [i]);
}

function trace(some) {
  state.traced = some;
  camera.follow = some.length === 1 ? some[0] : -1;
  look();
}

// Deselects a disk that leaves the box, unless the film was made to show its path.
function deselectAbsent() {
  const isKept = i => isInside(i) || film.traced?.includes(i);
  if (state.traced.every(isKept)) return;
  state.traced = state.traced.filter(isKept);
  if (!isKept(camera.follow)) camera.follow = -1;
  press({ follow: camera.follow >= 0 });
}

function followOrNot() {
  camera.follow = camera.follow < 0 ? state.traced[0] : -1;
  if (camera.follow >= 0 && camera.zoom === 1) camera.zoom = Math.min(4, mostZoom());
  look();
}

// ---------- event handlers of the page ----------

function on(id, action) { $(id).addEventListener('click', action); }

const turn = name => () => {
  state[name] = !state[name];
  refresh();
  if (isPart) parent.chosen(window);
};
const actions = {
  play: () => play(!state.playing), first: () => step(0), last: () => { if (live.on) follow(true); else go(last()); }, back, next, event: toEvent,
  clear: () => trace([]), push: () => send({ do: 'push', disk: state.traced[0] }), follow: followOrNot, arrows: turn('arrows'), sofar: turn('sofar'), total: turn('total'),
  nearer: () => zoomBy(1.5), farther: () => zoomBy(1 / 1.5),
  whole: () => { lookAtAll(); look(); }, theme: () => { theme(!dark()); refresh(); },
  full: () => { if (document.fullscreenElement) document.exitFullscreen(); else $('view').requestFullscreen(); },
};
const keys = {
  ' ': 'play', ArrowLeft: 'back', ArrowRight: 'next', n: 'event', Home: 'first', End: 'last', '+': 'nearer', '=': 'nearer', '-': 'farther',
  0: 'whole', f: 'full', v: 'arrows',
};

function pressed(key) { if (film) actions[keys[key]]?.(); }

function theme(night) { document.documentElement.dataset.theme = night ? 'dark' : 'light'; }

function listen() {
  for (const button of document.querySelectorAll('[data-path]'))
    button.innerHTML = `<svg viewBox="0 0 24 24"><path d="${button.dataset.path}"/></svg>`;
  for (const [id, action] of Object.entries(actions)) on(id, action);
  listenEncounter();
  $('full').hidden = !document.fullscreenEnabled;
  onSlide($('scrub'), () => go(first() + $('scrub').value * (last() - first())));
  onSlide($('pace'), () => { follow(false); refresh(); if (isPart) parent.chosen(window); });
  $('foretold').addEventListener('change', turn('foretold'));
  $('colour').addEventListener('change', () => { state.colour = $('colour').value; refresh(); });
  const stage = $('stage');
  stage.addEventListener('pointerdown', event => {
    const here = onStage(event);
    if (!pointers.size) [moved, grabbed] = [0, grabAt(...here, event)];
    else if (moved < SLIP * page.dots) grabbed = null;  // two fingers zoom
    pointers.set(event.pointerId, here);
    stage.setPointerCapture(event.pointerId);
  });
  // The browser sends this event after `pointerdown`. Only a listener that is not passive can prevent scrolling.
  stage.addEventListener('touchstart', event => { if (keepsFromScrolling()) event.preventDefault(); }, { passive: false });
  stage.addEventListener('pointermove', pointerMoved);
  stage.addEventListener('pointercancel', event => {
    pointers.delete(event.pointerId);
    if (grabbed?.pointer === event.pointerId) release(true);
  });
  stage.addEventListener('pointerup', event => {
    const isClick = moved < SLIP * page.dots;
    if (grabbed?.pointer === event.pointerId) { if (isClick) grabbed = null; else release(false); }
    if (pointers.delete(event.pointerId) && isClick) pick(...onStage(event), event);
  });
  stage.addEventListener('wheel', event => {
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...onStage(event));
  }, { passive: false });
  addEventListener('keydown', event => {
    if (event.target.matches('select') || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches('input') && event.key.startsWith('Arrow')) return;
    if (!keys[event.key] || (event.key === ' ' && event.target.matches('button, [type=checkbox]'))) return;
    event.preventDefault();
    pressed(event.key);
  });
  addEventListener('resize', layout);
  addEventListener('hashchange', fromAddress);
  document.addEventListener('fullscreenchange', layout);
  const darkness = matchMedia('(prefers-color-scheme: dark)');
  theme(darkness.matches);
  darkness.addEventListener('change', () => { theme(darkness.matches); refresh(); });
}
