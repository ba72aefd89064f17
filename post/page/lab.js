'use strict';

// ---------- laboratory: an input form and several films, each of which has its own worker process ----------

const $ = id => document.getElementById(id);
const lab = JSON.parse($('data').textContent);  // table of variables by group, and the inputs to choose from
const state = {
  input: null, groups: [],   // the input (name, title, sliders, ...); the groups of its file, with kind, address and values
  settings: {}, added: [],   // variables that the form changes, with their texts; groups that are not in the file: [kind, name]
  has: {},                   // settings of the present run
  waiting: {},               // variables whose text was refused, with text and message
  runs: 0,                   // number of runs so far
  boxes: [],                 // runs { figure, frame, letter, words, run, shown } kept for comparison, and the present one at the end
  paused: false, started: false, note: '',   // whether the films are paused; whether the input has a run; error in the address
  direct: null,              // the latest change, if it was made in the picture or in a table instead of the form
};
// Variables that can be changed while a simulation is running. Changing any other variable starts a new run.
const acts = key => /^(box\.gravity|contact\.|drive\.|(side|wall|obstacle)\.\w+\.(restitution|rule|tangential_restitution|friction|temperature|surface_velocity|velocity|mass|force|open)|source\.\w+\.(count|interval|velocity|temperature|\w+_time))/.test(key);
const MEASURED = { 'all/kinetic_energy': 'mean kinetic energy', 'all/mean_speed': 'mean speed', virial_pressure: 'pressure', dissipated_energy: 'energy lost per time', collisions: 'collisions per time' };
const IMPOSSIBLE = 'One value is not possible: the form says why.';
const MOST_KEPT = 3, FULL = 0.5;  // largest number of kept runs; packing fraction that random placement reaches easily

function make(tag, more = {}, ...children) {
  const element = Object.assign(document.createElement(tag), more);
  element.append(...children);
  return element;
}

function tell(text, wrong = false) {
  $('status').textContent = $('status').title = text;
  $('status').classList.toggle('problem', wrong);
}

const short = value => String(+(+value).toPrecision(3)).replace('-', '−');

// ---------- changes of values ----------

function set(key, text) {
  const old = textOf(key);
  delete state.waiting[key];
  state.note = '';
  state.direct = null;
  delete state.settings[key];  // makes the latest setting the last in the list
  if (text !== givenAs(key)) state.settings[key] = text;
  sync();
  if (text !== old) changed(key);
}

const wish = () => ({ input: state.input.name, added: state.added, settings: { ...state.settings } });
const differs = key => (state.settings[key] ?? givenAs(key)) !== (state.has[key] ?? givenAs(key));

// ---------- sliders ----------

// A slider is described by [variable or variable[component], label, smallest value, largest value, 'log' for a logarithmic
// scale].
function sliderOf([name, text, from, to, log]) {
  const [key, at] = name.replace(']', '').split('[');
  return { key, at: at === undefined ? -1 : +at, words: text, from, to, log: !!log };
}

const textWith = ({ key, at }, text) => at < 0 ? text : split(valueOf(key)).map((one, k) => k === at ? text : one).join(',');

// Returns the largest slider value for which the packing fraction of the disks in their region stays below a limit.
function mostOf({ key, to = Infinity }) {
  const [kind, name, variable] = key.split('.');
  if (kind !== 'species' || !['count', 'radius'].includes(variable) || textOf(`species.${name}.placement`)) return to;
  const sizes = {}, all = state.groups.filter(group => group.kind === 'species').map(({ place }) => {
    const other = textOf(`${place}.relative_to`), radius = numberOf(`${place}.radius`);
    sizes[place] = other ? radius * sizes[`species.${other}`] : radius;
    return { place, area: Math.PI * sizes[place] ** 2 * (textOf(`${place}.position`) ? 1 : numberOf(`${place}.count`)), region: textOf(`${place}.region`) };
  });
  const own = all.find(({ place }) => place === `species.${name}`), [x0, y0] = split(valueOf('box.lower')).map(Number);
  const [x1, y1] = split(valueOf('box.upper')).map(Number), box = own.region ? split(own.region).map(Number) : [x0, x1, y0, y1];
  const rest = all.filter(one => one !== own && one.region === own.region).reduce((sum, { area }) => sum + area, 0);
  const room = (FULL * (box[1] - box[0]) * (box[3] - box[2]) - rest) / own.area, value = numberOf(key);
  const most = room > 0 ? value * (variable === 'count' ? room : Math.sqrt(room)) : value;
  return isFinite(most) ? Math.min(to, most) : to;
}

// Returns distinct rounded values that cover the range of a slider.
function valuesOf(spec, steps) {
  const { key, from, to, log } = spec, top = mostOf(spec), whole = variableOf(key).type === 'integer';
  const unit = whole ? 1 : 10 ** Math.floor(Math.log10((to - from) / 100));
  const near = value => log && !whole ? +value.toPrecision(3) : +(Math.round(value / unit) * unit).toPrecision(12);
  return [...new Set(Array.from({ length: steps + 1 }, (_, k) => near(log ? from * (top / from) ** (k / steps) : from + k / steps * (top - from))))];
}

// The simulation program checks the text that the user types. It accepts no decimal commas, which are therefore replaced by
// points.
function buildSlider(spec) {
  const { key, at } = spec, id = 'slide.' + key + at;
  const range = make('input', { type: 'range', min: 0, id }), field = make('input', { inputMode: 'text', spellcheck: false });
  const row = make('div', { className: 'slider' }, make('label', { htmlFor: id, textContent: spec.words }),
    make('small'), make('div', {}, range, field), make('p', { className: 'problem' }));
  field.setAttribute('aria-label', `${spec.words}: value`);
  let values;
  onSlide(range, () => set(key, textWith(spec, String(values[range.value]))));
  field.addEventListener('change', () => set(key, textWith(spec, field.value.trim().replaceAll(',', '.'))));
  row.sync = () => {
    const value = numberOf(key, Math.max(at, 0)), text = shownOf(key) || valueOf(key);
    if (document.activeElement !== range) {
      values = valuesOf(spec, 1000);
      range.max = values.length - 1;
      range.value = (values.findIndex(one => one >= value) + values.length) % values.length;
    }
    if (document.activeElement !== field) field.value = at < 0 ? text : split(text)[at] ?? '';
    row.children[1].textContent = [acts(key) ? 'at once' : 'new run', inheritedInWords(key)].filter(Boolean).join('; ');
    range.setAttribute('aria-valuetext', `${short(value)}, from ${short(values[0])} to ${short(values.at(-1))}`);
    mark(row, key);
  };
  return row;
}

function mark(row, key) {
  row.classList.toggle('changed', key in state.settings);
  row.classList.toggle('wrong', key in state.waiting);
  row.lastChild.textContent = state.waiting[key]?.said ?? '';
}

// ---------- form with all input variables, made from the program's table of variables ----------

function buildEverything() {
  if (!$('everything').open) { $('groups').replaceChildren(); return; }
  const added = state.added.map(([kind, name]) => ({ kind, place: `${kind}.${name}` })), there = [...state.groups, ...added];
  const isNamed = kind => 'name' in lab.table[kind], order = Object.keys(lab.table);
  const rest = order.filter(kind => !isNamed(kind) && !there.some(group => group.kind === kind)).map(kind => ({ kind, place: kind }));
  const all = [...there, ...rest].filter(({ kind }) => lab.table[kind]).sort((a, b) => order.indexOf(a.kind) - order.indexOf(b.kind));
  $('groups').replaceChildren(...all.map(({ kind, place }) => {
    const names = Object.keys(lab.table[kind]).filter(name => name !== 'name');
    return make('details', { open: names.some(name => textOf(`${place}.${name}`)) }, make('summary', { textContent: '&' + place.replace('.', ' ') }),
      ...names.map(name => buildVariable(`${place}.${name}`)));
  }));
  const free = (kind, k = 1) => all.some(({ place }) => place === `${kind}.${kind}${k}`) ? free(kind, k + 1) : `${kind}${k}`;
  const more = order.filter(isNamed).flatMap(kind => (lab.table[kind].name.choices ?? [free(kind)])
    .filter(name => !all.some(({ place }) => place === `${kind}.${name}`)).map(name => `${kind} ${name}`));
  $('add').replaceChildren(new Option('choose …', ''), ...more.map(pair => new Option('&' + pair, pair)));
}

function buildVariable(key) {
  const { choices, type, help, allowed, unit, default: usual, example } = variableOf(key), id = 'v.' + key;
  const menu = type === 'logical' ? ['.true.', '.false.'] : choices?.length && variableOf(key).size === 1 ? choices : null;
  const input = menu ? make('select', { id }, ...['', ...menu].map(word => new Option(word, word))) : make('input', { id, spellcheck: false });
  const more = usual === null && words(example) ? ` Example: ${words(example)}.` : '';
  const row = make('div', { className: 'variable' }, make('label', { htmlFor: id, textContent: nameOf(key) + (unit ? ` [${unit}]` : '') }),
    input, make('p', { id: id + '.help', textContent: `${help} Allowed: ${allowed}.${more}` }), make('p', { className: 'problem' }));
  row.dataset.place = key;
  input.setAttribute('aria-describedby', id + '.help');
  input.addEventListener('change', () => set(key, input.value.trim()));
  row.sync = () => {
    const fallback = defaultInWords(key);
    if (menu) input.options[0].text = `(${fallback})`; else input.placeholder = fallback;
    if (document.activeElement !== input || menu) input.value = shownOf(key);
    mark(row, key);
  };
  row.sync();
  return row;
}

function sync() {
  for (const row of document.querySelectorAll('.slider, .variable')) row.sync();
  $('ends').textContent = stopInWords();
}

function addGroup(kind, name) {
  state.added.push([kind, name]);
  for (const [own, { needed, default: usual, example }] of Object.entries(lab.table[kind]))
    if (needed && own !== 'name') state.settings[`${kind}.${name}.${own}`] = words(usual ?? example);
  buildEverything();
  run();
}

// ---------- choice of an input file ----------

// Unless the address of the page contains values, the run starts before the form is complete, so that disks appear early. Kept
// runs of another input are removed, because runs of different inputs cannot be compared in one plot.
async function choose(name, settings = {}) {
  const input = lab.inputs.find(one => one.name === name);
  if (name !== state.input?.name) {
    state.boxes.slice(0, -1).forEach(remove);
    current().letter = 'A';
  }
  Object.assign(state, { input: { ...input, sliders: input.sliders.map(sliderOf) }, groups: [], settings: {}, has: {}, waiting: {}, added: [], note: '', started: false });
  scan = scanner?.leave();
  drawScan();
  const isPlain = !Object.keys(settings).length;
  if (isPlain) run();
  $('name').textContent = input.title;
  $('own').hidden = !input.picture;
  if (input.picture) $('own').src = input.picture;
  $('sentence').textContent = input.sentence;
  $('sliders').replaceChildren();
  const answer = await fetch('form?' + encodeURIComponent(name)).catch(() => null);
  if (!answer?.ok) { tell(answer ? await answer.text() : 'No answer: the laboratory has ended.', true); return; }
  const form = await answer.json();
  if (state.input.name !== name) return;  // another input has been chosen meanwhile
  state.groups = form.groups;
  if (!isPlain) begin(settings);
  $('about').replaceChildren(...form.about.split(/\n\n+/).map(text => make('p', { textContent: text })));
  $('about').parentElement.hidden = !form.about;
  const noSliders = make('p', { textContent: 'Your own inputs have no sliders. All their variables are below, under Everything.' });
  $('sliders').replaceChildren(...(state.input.sliders.length ? state.input.sliders.map(buildSlider) : [noSliders]));
  $('scanning').hidden = !state.input.sliders.length;
  $('scanned').replaceChildren(...state.input.sliders.map((slider, k) => new Option(slider.words, k)));
  buildEverything();
  sync();
}

// Starts a run with the values in the address of the page, adding groups that the input file lacks.
function begin(settings) {
  const keys = Object.keys(settings), wrong = keys.find(key => !isVariable(key));
  state.settings = Object.fromEntries(keys.filter(isVariable).map(key => [key, settings[key]]));
  const places = [...new Set(Object.keys(state.settings).map(placeOf))].filter(place => place.includes('.') && !state.groups.some(group => group.place === place));
  state.added = places.map(place => [place.split('.')[0], place.slice(place.indexOf('.') + 1)]);
  run();
  if (wrong) state.note = `There is no variable ${wrong}.`;
}

// ---------- the address: the input, and the values that differ from its file ----------

function toAddress() {
  const pairs = [['input', state.input.name], ...Object.entries(state.settings)];
  history.replaceState(null, '', '#' + pairs.map(pair => pair.map(encodeURIComponent).join('=')).join('&').replaceAll('%2C', ','));
}

function fromAddress() {
  const { input, ...settings } = Object.fromEntries(new URLSearchParams(location.hash.slice(1))), known = name => lab.inputs.find(one => one.name === name)?.name;
  if (known(input)) { choose(input, settings); return; }
  choose(known('gas') ?? lab.inputs[0].name);
  if (input) state.note = `There is no input ${input}.`;
}

function buildInputs() {
  const subjects = [...new Set(lab.inputs.map(({ subject }) => subject))];
  $('inputs').replaceChildren(make('header', {}, make('h2', { textContent: 'What shall run?' }), make('button', { type: 'button', textContent: 'Close', onclick: () => $('inputs').close() })),
    ...subjects.flatMap(subject => [make('h3', { textContent: subject }), make('div', {}, ...lab.inputs.filter(one => one.subject === subject).map(({ name, title, sentence, picture }) =>
      make('button', { type: 'button', onclick: () => { $('inputs').close(); choose(name); } },
        ...(picture ? [make('img', { src: picture, alt: '', width: 144, height: 144 })] : []), make('b', { textContent: title }), make('span', { textContent: sentence }))))]));
}

// ---------- runs ----------

const current = () => state.boxes.at(-1), filmOf = box => box.frame.contentWindow, isThere = box => !!filmOf(box)?.start;
const shownBoxes = () => state.boxes.filter(box => box.shown || box === current()), films = () => shownBoxes().filter(isThere).map(filmOf);
function isPaused() { return state.paused; }
function isComparing() { return shownBoxes().length > 1; }

function newBox() {
  const taken = state.boxes.map(({ letter }) => letter), letter = [...'ABCDEFGHIJ'].find(one => !taken.includes(one));
  const frame = make('iframe', { title: 'the run', allow: 'fullscreen', src: 'view' });
  const advice = make('p', { className: 'advice', textContent: 'Change a slider: the next run appears here.' });
  const figure = make('section', { className: 'run' }, make('p', { className: 'caption' }), advice, frame), box = { letter, figure, frame, words: '', changes: [], shown: true };
  state.boxes.push(box);
  $('runs').append(figure);
  return box;
}

// Two runs never start at the same time: values changed during the start of a run take effect in the next one.
const PLACING = 2000;  // time after which placing disks is abandoned in favour of newer settings [ms]
let busy = 0, again = false, timer, latest = {};
function run() {
  timer = clearTimeout(timer);
  latest = {};
  const box = current(), now = performance.now();
  again = busy && now < busy + PLACING;
  if (again) { timer = setTimeout(run, busy + PLACING - now); return; }
  if (busy && isThere(box)) filmOf(box).leave();
  busy = now;
  tell('');
  state.paused = !!state.input.paused;  // the films of some inputs wait at the start
  tellPause();
  const begin = () => {
    box.frame.onload = null;
    if (!box.run) dress();
    if (state.boxes.length > 1 && !box.run) filmOf(box).choices(filmOf(state.boxes.at(-2)).choices());
    box.wished = { ...wish(), words: settingsInWords(), run: ++state.runs };
    filmOf(box).start(box.wished);
  };
  if (isThere(box)) begin(); else box.frame.onload = begin;  // replaces an earlier request that waits for the frame
}

// If the variable can change in a running simulation, applies the change while the slider moves. Otherwise starts a new run.
function changed(key) {
  if (busy || !acts(key) || !current()?.run) { run(); return; }
  latest[key] = state.settings[key] ?? givenAs(key);
  timer ??= setTimeout(() => { filmOf(current()).send({ do: 'change', settings: latest }); latest = {}; timer = undefined; }, 25);
}

// Handles messages from the worker process of a film.
function hear(source, news) {
  const box = state.boxes.find(one => one.frame.contentWindow === source);
  if (!box) return;
  if (news.is === 'scene' && box === current()) buildOpenSystem(news.facts);
  if (news.is === 'scene' && !news.changed) {
    Object.assign(box, { run: news.run, words: box.wished.words, changes: [] });
    Object.assign(state, { has: { ...box.wished.settings }, started: true });
    toAddress();
    ready();
    clock.next = null;
    for (const kept of state.boxes) if (kept !== box && kept.shown && isThere(kept)) filmOf(kept).replay();
    tell(Object.keys(state.waiting).length ? IMPOSSIBLE : state.note, !!state.note);
    arrangeAll();
  } else if (news.is === 'problems') {
    // the variable cannot change in a running simulation
    if (!news.change) { showProblems(news.problems); ready(); } else if (!busy) run();
  } else if (news.is === 'state') {
    box.changes = news.changes ?? box.changes;
    if (box === current()) for (const [, key, value] of box.changes) if (key) state.has[key] = value;
    if (news.reason) tell(news.reason, true);
    else if (box.refused && $('status').textContent === box.refused) tell(Object.keys(state.waiting).length ? IMPOSSIBLE : '');
    box.refused = news.reason;
    toAddress();
    tellShelf();
  } else if (news.is === 'file') {
    const href = URL.createObjectURL(new Blob([filmOf(box).bytes(news.body)]));
    make('a', { href, download: news.name }).click();
    URL.revokeObjectURL(href);
  } else if (news.is === 'gone') { ready(); tell(news.problems[0].text.replace('It ', `Run ${box.letter} `), true); }
}

function ready() { busy = 0; if (again) run(); }

// Shows each error message once: beside the variable that caused the error or, if the message names no variable, beside the
// variable that the user changed last. The refused text stays in the form while the variable keeps its old value. A change made in
// the picture is undone, and the line at the top shows the reason. All changes without errors take effect. If no value was changed
// and the input file itself cannot run, all messages appear in the place of the film.
function showProblems(problems) {
  const changes = () => Object.keys({ ...state.has, ...state.settings }).filter(differs), before = changes();
  let undone = null;
  for (const { place, text: asFile } of problems) {
    const text = withDisksOfPicture(asFile), key = before.includes(place) ? place : before.at(-1);
    if (!key || !differs(key)) continue;
    const most = mostOf({ key });
    if (key === state.direct) undone = text;
    else state.waiting[key] = { text: textOf(key), said: most < numberOf(key) ? `too full: at most ${short(most)}` : text };
    if (key in state.has) state.settings[key] = state.has[key]; else delete state.settings[key];
  }
  sync();
  const lines = problems.map(({ place, text }) => place ? `${place}: ${text}` : text), isOfFile = !before.length && !state.started;
  if (isOfFile) filmOf(current()).refuse(lines);
  tell(undone ?? (before.length ? IMPOSSIBLE : isOfFile ? 'This input cannot run. Correct the file, then start over.' : lines.join('\n')), true);
  toAddress();
  again ||= before.length > 0 && (changes().length > 0 || !state.started || !current().run);
}

// ---------- earlier runs that remain visible for comparison ----------

function keep() {
  if (!current()?.run) return;
  if (state.boxes.length > MOST_KEPT) { tell(`${MOST_KEPT} runs are kept, which is the largest number: remove one`, true); return; }
  newBox();
  arrangeAll();
  run();
}

function remove(box) {
  box.figure.remove();
  state.boxes.splice(state.boxes.indexOf(box), 1);
  regroup();
}

// Arranges the films after one of them has been shown, hidden or removed. Unless they are paused, all continue from the same
// time.
function regroup() {
  clock.next = null;
  arrangeAll();
  if (!state.paused) filmOf(current()).resume?.();
}

const whatIs = ({ words: text, changes }) => text + (changes.length ? `, then ${changeInWords(changes.at(-1))}` : '');

// Returns the line above the film of a run. If the run only repeats the previous one, the line says how to change that.
function captionOf(box) {
  const before = shownBoxes().at(-2), text = whatIs(box);
  return `${box.letter}: ${box === current() && before && whatIs(before) === text ? 'change a slider' : text}`;
}

function tellShelf() {
  $('shelf').replaceChildren(...state.boxes.filter(({ run: number }) => number).map(box => {
    const file = part => make('button', { type: 'button', textContent: part, onclick: () => filmOf(box).send({ do: 'keep', part }) });
    const seen = make('input', { type: 'checkbox', checked: box.shown, ariaLabel: `run ${box.letter} is seen` });
    seen.addEventListener('change', () => {
      box.shown = seen.checked;
      filmOf(box).play(box.shown && !state.paused);
      regroup();
    });
    const away = make('button', { type: 'button', textContent: '×', ariaLabel: `remove run ${box.letter}`, onclick: () => remove(box) });
    const own = box === current(), parts = [make('b', { textContent: `${box.letter}: ` }), whatIs(box)];
    return make('li', {}, make('p', {}, ...(own ? [] : [seen, ' ']), ...parts), make('p', { className: 'links' }, ...['input', ...(box.changes.length ? ['script'] : []), 'output'].map(file), ...(own ? [] : [away])));
  }));
  const changes = current()?.changes ?? [];
  $('changes').replaceChildren(...changes.slice(-6).map(change => make('li', { textContent: `t = ${short(change[0])}: ${changeInWords(change)}` })));
  state.boxes.forEach(box => { box.figure.firstChild.textContent = captionOf(box); });
}

// Returns the width of the scroll bar of an element [CSS pixels]; touch screens have none.
function widthOfScrollBar() {
  const box = document.body.appendChild(make('div', { className: 'measure' })), width = box.offsetWidth - box.clientWidth;
  box.remove();
  return width;
}
const scrollBar = widthOfScrollBar();

// Returns the run whose film contains the controls and the plots: the newest run, as soon as it has a picture.
const leader = () => isThere(current()) && filmOf(current()).inside().film ? current() : shownBoxes().at(-2) ?? current();

// Arranges the films of all runs side by side at equal size. The plots belong to the film of one run, and include curves of the
// others.
function arrangeAll() {
  const boxes = shownBoxes(), many = isComparing(), { clientWidth, clientHeight } = $('runs');
  const upright = clientWidth < 560, count = many ? boxes.length : 1, edge = parseFloat(getComputedStyle($('runs')).paddingLeft);
  const width = Math.floor((clientWidth - 2 * edge - scrollBar) / count);
  const shapes = films().map(one => one.inside().film?.edges).filter(Boolean).map(([x, y]) => y / x), highest = clientHeight * (upright ? 0.36 : 0.56) - 26;
  const size = { width: width - 12, height: Math.floor(Math.min(highest, (width - 12) * Math.max(0.5, ...shapes))) }, lead = leader();
  $('runs').classList.toggle('many', many);
  $('runs').style.gridTemplateColumns = many ? `repeat(${count}, ${width}px) 1fr` : 'minmax(0, 1fr)';
  for (const box of state.boxes) {
    const bare = many && box !== lead, column = boxes.indexOf(box), left = many && !bare ? column * width : 0;
    box.figure.style.gridColumn = bare ? column + 1 : '';
    box.figure.hidden = column < 0;
    box.figure.style.height = bare ? `${size.height + 50}px` : '';
    box.figure.classList.toggle('lead', !bare);
    box.figure.classList.toggle('waiting', bare && box === current());
    box.figure.firstChild.style.setProperty('--run', many && isThere(box) && filmOf(box).inside().kinds?.length === 1 ? filmOf(box).runColour(box.letter) : 'transparent');
    box.figure.firstChild.style.width = many ? `${size.width}px` : '';
    box.figure.firstChild.style.marginLeft = `${left}px`;
    if (isThere(box)) filmOf(box).arrange(many ? { ...size, left } : null, bare);
  }
  scrolled();
  tellShelf();
  overlayAll();
  drawScan();
}

// Scrolls the pictures of the other runs along with the page of the run that contains the plots.
function scrolled() {
  const by = isComparing() ? Math.max(0, filmOf(leader()).scrollY) : 0;
  $('runs').style.setProperty('--scrolled', `${by}px`);
}

function overlayAll() {
  const box = current();
  if (!box || !isThere(box)) return;
  const others = shownBoxes().filter(one => one !== box && isThere(one) && one.run);
  filmOf(box).overlay(others.map(({ letter, frame }) => {
    const { stream, kinds, numbersNow, speedsOfFilm, motion } = frame.contentWindow.inside();
    return { letter, kinds, curves: stream.curves, numbers: numbersNow, speeds: speedsOfFilm, motion };
  }));
}
function letterOf(source) { return state.boxes.find(box => filmOf(box) === source)?.letter; }
setInterval(() => { if (shownBoxes().length > 1) overlayAll(); }, 1000);

// ---------- the time of compared runs ----------

// The newest film determines the time that all films show. All worker processes advance to a requested time, which is shown
// when the slowest process has reached it. While a film replays stored frames, the times of its frames are requested. A time is
// left out if another film has no frame at this time and would have to show an earlier one.
const clock = { next: null, shown: 0 };  // time requested; when the films were last drawn [ms]
function conducts(source) {
  if (!isComparing()) return false;
  if (source !== filmOf(current())) return true;
  const all = films(), now = performance.now();
  if (all.some(one => one.isStarting())) return true;  // such a film still shows the time of its previous run
  if (clock.next === null) request(all, 1 / 60);
  if (clock.next === null || !all.every(one => one.hasReached(clock.next))) return true;
  for (const one of all) one.show(clock.next);
  const passed = Math.min(0.1, (now - clock.shown) / 1000);
  clock.shown = now;
  request(all, passed);
  return true;
}

function request(all, passed) {
  const film = filmOf(current()), { moment } = film.inside(), { pace, speed } = film.choices(), perSecond = pace * 10 ** speed;
  const target = moment.time + passed * perSecond, last = one => one.inside().past.at(-1)?.time ?? -Infinity;
  const longest = all.reduce((one, other) => last(other) > last(one) ? other : one), isStored = last(longest) > moment.time;
  const repeated = isStored && longest.frameBetween(moment.time, target, time => all.every(one => one.canShow(time)));
  const isDue = repeated <= Math.max(target, moment.time + (performance.now() - clock.shown) / 1000 * perSecond);
  clock.next = !isStored ? target : isDue ? repeated : null;
  if (clock.next !== null) for (const one of all) one.reach(clock.next);
}

// If the films are paused and the user moves one of them to another time, all others show that time, too.
function went(source, time) {
  clock.next = null;
  if (state.paused) for (const one of films()) if (one !== source) one.join(time);
}

// Repeats an action on one film in all others.
function played(source, on) {
  if (source === filmOf(current())) state.paused = !on;
  for (const one of films()) if (one !== source && one.inside().film) one.play(on);
  tellPause();
}

function tellPause() { $('pause').textContent = state.paused ? 'Go on' : 'Pause'; }

// Gives all films the speed of one film, and whether it shows arrows, the next event, and the centre-of-mass frame.
function chosen(source) {
  const { pace, speed, state: { arrows, momenta, centred, foretold } } = source.choices();
  for (const one of films()) if (one !== source) one.choices({ pace, speed, state: { arrows, momenta, centred, foretold } });
}

// ---------- scan: measurement of one quantity for five values of an input variable ----------

let scan, scanner;  // measured quantity and values; the worker that measures
function beginScan() {
  const spec = state.input.sliders[$('scanned').value], { key, log } = spec, values = valuesOf(spec, 4), texts = values.map(value => textWith(spec, String(value)));
  scan = { x: spec.words, y: MEASURED[$('measured').value], log, points: [], values, said: '' };
  drawScan();
  $('points').scrollIntoView({ block: 'nearest' });
  scanner?.leave();
  scanner = filmOf(current()).talk({ do: 'scan', ...wish(), variable: key, values: texts, of: $('measured').value }, addToScan);
  tell('scanning …');
}

function drawScan() {
  $('curve').hidden = $('points').hidden = !scan;
  if (!scan || !$('curve').clientWidth || !filmOf(current()).inside?.().film) return;
  const text = `${scan.y} against ${scan.x}`, found = filmOf(current()).plotScan($('curve'), scan);
  $('points').textContent = `${text}. ${found}`;
  $('curve').setAttribute('aria-label', $('points').textContent);
}

function addToScan({ is, index, mean, error, problems }) {  // values that cannot be measured appear as a gap
  if (problems) scan.said = (is === 'scan' ? `${short(scan.values[index])}: ` : '') + problems[0].text;
  else scan.points.push([scan.values[index], mean, error]);
  drawScan();
  if (is === 'scan' && index < scan.values.length - 1) return;
  tell(scan.said, !!scan.said);
  scanner.leave();
}

// ---------- event handlers of the page ----------

const isBare = () => document.body.classList.contains('bare');
function bare(on) {
  document.body.classList.toggle('bare', on);
  $('settings').ariaPressed = !on;
  arrangeAll();
}

// Gives all films the colour theme (dark or light) of the page.
function dress() {
  for (const one of state.boxes.filter(isThere).map(filmOf)) {
    one.document.documentElement.classList.toggle('larger', document.documentElement.classList.contains('larger'));
    one.document.documentElement.dataset.theme = document.documentElement.dataset.theme;
    if (one.inside().film) one.refresh();
  }
  arrangeAll();
}

const actions = {
  film: () => { current().frame.focus(); filmOf(current()).document.getElementById('play').focus(); },
  run, keep, scan: beginScan, choose: () => $('inputs').showModal(),
  pause: () => filmOf(current()).play(state.paused), settings: () => bare(!isBare()),
  larger: () => { $('larger').ariaPressed = document.documentElement.classList.toggle('larger'); dress(); },
  theme: () => { const { dataset } = document.documentElement; dataset.theme = dataset.theme === 'dark' ? 'light' : 'dark'; dress(); },
  another: () => { if ($('add').value) addGroup(...$('add').value.split(' ')); },
};
for (const [id, action] of Object.entries(actions)) $(id).addEventListener('click', () => action());
const MOVES = new Set(['ArrowLeft', 'ArrowRight', 'Home', 'End', 'n', ' ']);  // keys that act on the newest film, which the others follow
const keys = { r: 'run', p: 'pause', c: 'keep', s: 'settings', l: 'larger' };

// Keyboard shortcuts of the laboratory work unless an input field or a menu has the focus. Shortcuts for films apply to the film
// with the focus or, if there is none, to all films.
function typed(event) {
  const { key, target } = event, own = target.ownerDocument === document;
  if (key === 'Enter' && target.matches('input:not([type])')) target.blur();  // the text is complete, so the next keys are shortcuts
  if (target.matches('input:not([type=range]), select') || event.ctrlKey || event.metaKey || event.altKey || $('inputs').open) return;
  if (keys[key]) actions[keys[key]]();
  else if (own && !(target.matches('input') && /^(Arrow|Home|End|Page)/.test(key)) && !(key === ' ' && target.matches('input, button, summary'))) {
    for (const one of MOVES.has(key) ? [filmOf(current())] : films()) one.pressed(key);
  }
}

addEventListener('keydown', typed);
addEventListener('resize', () => arrangeAll());
$('form').addEventListener('submit', event => event.preventDefault());
$('everything').addEventListener('toggle', buildEverything);
$('scanning').addEventListener('toggle', drawScan);
for (const button of $('heat').querySelectorAll('button')) button.addEventListener('click', () => filmOf(current()).send({ do: 'heat', factor: +button.dataset.factor }));
$('measured').replaceChildren(...Object.entries(MEASURED).map(([name, text]) => new Option(text, name)));
addEventListener('pageshow', event => { if (event.persisted) location.reload(); });
document.documentElement.dataset.theme = matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
buildInputs();
newBox();
const narrow = matchMedia('(max-width: 1099px), (max-height: 500px)');
narrow.addEventListener('change', () => bare(narrow.matches));  // the form then becomes a drawer, which is initially closed
bare(narrow.matches);
addEventListener('hashchange', fromAddress);
fromAddress();
