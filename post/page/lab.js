'use strict';

// ---------- the laboratory: a form made from the program's table of variables, and runs in players ----------

const $ = id => document.getElementById(id);
const lab = JSON.parse($('data').textContent);  // page: its number; table: group -> variable; inputs: names
// Of each variable its default or an example as --set has it, what it may be, and from where to where.
for (const variable of Object.values(lab.table).flatMap(Object.values)) {
  const { type, choices, above, from, below, to } = variable, value = variable.default ?? variable.example;
  const words = [value].flat().map(one => type === 'logical' ? `.${one}.` : String(one));
  Object.assign(variable, { value: words.join(','), low: above ?? from, high: below ?? to, open: above !== null });
  variable.choices = type === 'logical' ? ['.true.', '.false.'] : choices;
}
const state = {
  input: '', groups: [],       // the input file: kind, place, given values of each group
  settings: {}, added: [],     // what the form changes: variable -> text; groups that are not in the file: [kind, name]
  cadences: {},                // those of the settings that the laboratory proposes
  running: false, stopped: false,  // the newest run goes on; or it can go on
  paused: false,               // films stand, also the one that is coming
  shown: [],                   // runs side by side: { number, figure }, the newest last
};

function make(tag, more = {}, ...children) {
  const element = Object.assign(document.createElement(tag), more);
  element.append(...children);
  return element;
}

async function ask(path, wish) {
  const options = wish && { method: 'POST', body: JSON.stringify({ page: lab.page, ...wish }) };
  const answer = await fetch(path, options).catch(() => null);
  if (answer?.ok) return answer.json();
  tell(answer ? await answer.text() : 'No answer: the laboratory has ended.', true);
  return null;
}

function tell(text, wrong = false) {
  $('status').textContent = $('status').title = text;
  $('status').classList.toggle('problem', wrong);
}

// ---------- the form ----------

const valueOf = (place, name) => state.settings[`${place}.${name}`] ?? givenIn(place)[name] ?? '';
const givenIn = place => state.groups.find(group => group.place === place)?.given ?? {};
const isNamed = kind => 'name' in lab.table[kind];

async function choose(name) {
  const form = await ask('form?' + encodeURIComponent(name));
  if (!form) return;
  Object.assign(state, { input: name, groups: form.groups, settings: form.settings, cadences: { ...form.settings }, added: [] });
  $('name').textContent = name;
  $('own').src = 'picture?' + encodeURIComponent(name);
  const [first, ...rest] = form.about.split(/\n\n+/);
  $('about').replaceChildren(make('summary', { textContent: first }), ...rest.map(part => make('p', { textContent: part })));
  $('about').open = false;
  buildForm();
  run();
}

// Groups of the file and added ones, and those without a name that the file leaves at their defaults; first what is open.
function buildForm() {
  const added = state.added.map(([kind, name]) => ({ kind, place: `${kind}.${name}`, added: true }));
  const there = [...state.groups, ...added];
  const rest = Object.keys(lab.table).filter(kind => !isNamed(kind) && !there.some(group => group.kind === kind));
  const all = [...there.filter(({ kind }) => lab.table[kind]), ...rest.map(kind => ({ kind, place: kind }))];
  const order = Object.keys(lab.table), rank = group => order.indexOf(group.kind) + (isOpen(group) ? 0 : order.length);
  all.sort((a, b) => rank(a) - rank(b));
  $('groups').replaceChildren(...all.map(buildGroup));
  const names = order.filter(isNamed).flatMap(kind => {
    const { choices } = lab.table[kind].name, taken = new Set(all.map(({ place }) => place));
    const free = k => taken.has(`${kind}.${kind}${k}`) ? free(k + 1) : `${kind}${k}`;
    return (choices ?? [free(1)]).filter(name => !taken.has(`${kind}.${name}`)).map(name => [kind, name]);
  });
  const option = pair => make('option', { value: pair.join(' '), textContent: '&' + pair.join(' ') });
  $('add').replaceChildren(make('option', { value: '', textContent: 'choose …' }), ...names.map(option));
}

// Open is where more is given than texts.
function isOpen({ kind, place, added }) {
  return added || Object.entries(lab.table[kind]).some(([name, { type, choices }]) => (type !== 'text' || choices) && valueOf(place, name));
}

function buildGroup({ kind, place, added }) {
  const names = Object.keys(lab.table[kind]).filter(name => name !== 'name');
  const used = names.filter(name => valueOf(place, name)), rest = names.filter(name => !valueOf(place, name));
  const rows = some => make('div', { className: 'group' }, ...some.map(name => buildVariable(place, lab.table[kind][name], name)));
  const summary = make('summary', { textContent: '&' + place.replace('.', ' ') });
  const details = make('details', { open: isOpen({ kind, place, added }) }, summary);
  if (added) {
    const remove = make('button', { type: 'button', className: 'reset', textContent: 'remove this group' });
    remove.addEventListener('click', () => {
      state.added = state.added.filter(pair => pair.join('.') !== place);
      state.settings = Object.fromEntries(Object.entries(state.settings).filter(([key]) => !key.startsWith(place + '.')));
      buildForm();
      changed();
    });
    details.append(make('div', { className: 'group' }, remove));
  }
  if (used.length) details.append(rows(used));
  if (rest.length && used.length) details.append(make('details', {}, make('summary', { textContent: `${rest.length} more` }), rows(rest)));
  else details.append(rows(rest));
  return details;
}

function addGroup(kind, name) {
  state.added.push([kind, name]);
  for (const [own, { needed, value }] of Object.entries(lab.table[kind]))
    if (needed && own !== 'name') state.settings[`${kind}.${name}.${own}`] = value;
  buildForm();
  $('groups').querySelector(`[data-place="${kind}.${name}.${Object.keys(lab.table[kind])[1]}"]`)?.scrollIntoView({ block: 'center' });
  changed();
}

// A row: name and unit, controls, help, and what the program says against the value.
function buildVariable(place, variable, name) {
  const key = `${place}.${name}`, given = givenIn(place)[name] ?? '', value = valueOf(place, name);
  const wanted = split(variable.value, variable), parts = split(value, variable);
  const count = variable.size || (parts.length === 2 ? 2 : 1), few = variable.choices || count <= 2;
  const controls = few ? Array.from({ length: count }, (_, k) => control(variable, parts[k] ?? '', wanted[k] ?? '')) : [control({ type: 'text' }, value, variable.value)];
  const row = make('div', { className: 'variable' }), reset = make('button', { type: 'button', className: 'reset', textContent: 'reset', title: 'as in the file' });
  const id = 'v.' + key, words = `${variable.help}; allowed: ${variable.allowed}`;
  row.dataset.place = key;
  controls.forEach(({ input, slider }, k) => {
    input.id = k ? `${id}.${k}` : id;
    for (const part of [input, slider]) part?.setAttribute('aria-label', count > 1 && few ? `${key}, value ${k + 1}` : key);
    input.setAttribute('aria-describedby', id + '.help');
  });
  const mark = () => {
    row.classList.toggle('changed', key in state.settings);
    reset.hidden = !(key in state.settings);
  };
  const take = () => {
    const values = controls.map(({ input }) => input.value.trim());
    const text = values.every(one => !one) ? '' : values.map((one, k) => one || wanted[k] || '').join(',');
    if (text === given) delete state.settings[key]; else state.settings[key] = text;
    mark();
    changed();
  };
  for (const { input, slider } of controls) {
    input.addEventListener('change', () => { slider?.follow(); take(); });
    slider?.addEventListener('input', () => { input.value = slider.read(); take(); });
  }
  reset.addEventListener('click', () => {
    delete state.settings[key];
    row.replaceWith(buildVariable(place, variable, name));
    changed();
  });
  const unit = variable.unit ? make('small', { textContent: ` [${variable.unit}]` }) : '';
  row.append(make('header', {}, make('label', { htmlFor: id }, ...name.split('_').flatMap((word, k) => k ? ['_', make('wbr'), word] : word), unit), reset),
    ...controls.map(({ input, slider }) => make('div', {}, ...(slider ? [slider] : []), input)),
    make('p', { id: id + '.help', textContent: words }));
  mark();
  return row;
}

const split = (value, { size, type, choices }) => size === 1 && type === 'text' && !choices ? [value] : value ? value.split(/\s*,\s*|\s+/) : [];

// A menu for words, a field for text, a field with a slider for a number.
function control(variable, value, wanted) {
  if (variable.choices) {
    const option = word => make('option', { value: word, textContent: word || `(${wanted})`, selected: word === value });
    return { input: make('select', {}, ...['', ...variable.choices].map(option)) };
  }
  const input = make('input', { value, placeholder: wanted, spellcheck: false });
  if (variable.type === 'text') return { input };
  input.inputMode = variable.type === 'integer' ? 'numeric' : 'text';  // decimal keyboards have no minus and no e
  return { input, slider: sliderFor(variable, input, wanted) };
}

// ---------- sliders ----------

// Linear in a narrow range, or about 0 where every number is allowed; else by factors, with 0 at the left if it is allowed.
function scaleFor({ low, high, open }, about) {
  const size = Math.abs(about);
  if (low === null) return { from: -3 * size || -1, to: 3 * size || 1 };
  if (high !== null && high - low <= 10 && !(low > 0 && high / low > 1000)) return { from: low, to: high };
  const from = Math.max(low, size / 100 || 1e-6), to = Math.min(high ?? Infinity, 100 * size || 10);
  return { from: Math.log(from), to: Math.log(to), log: true, zero: low === 0 && !open };
}

function sliderFor(variable, input, wanted) {
  const slider = make('input', { type: 'range', min: 0, max: 1000, step: 1 }), number = text => parseFloat(String(text).replace(/d/i, 'e'));
  const now = () => number(input.value || wanted) || 0;
  let scale = scaleFor(variable, now());
  slider.follow = () => {
    const place = () => {
      const value = scale.log ? Math.log(now()) : now();
      return 1000 * (value - scale.from) / (scale.to - scale.from);
    };
    if (now() && (place() < 0 || place() > 1000)) scale = scaleFor(variable, now());  // typed: a value farther away
    slider.value = now() || !scale.log ? place() : 0;
  };
  slider.read = () => {
    const share = slider.value / 1000, value = scale.from + share * (scale.to - scale.from);
    if (scale.log && scale.zero && !share) return '0';
    const exact = scale.log ? Math.exp(value) : value, step = scale.log ? 0 : (scale.to - scale.from) / 200;
    const kept = variable.type === 'integer' ? Math.round(exact) : step ? Math.round(exact / step) * step : exact;
    const bounded = variable.open && kept <= variable.low ? step : variable.open && kept >= variable.high && variable.high ? variable.high - step : kept;
    return String(variable.type === 'integer' && bounded < 1000 ? bounded : +bounded.toPrecision(3));
  };
  slider.follow();
  return slider;
}

// ---------- values and their problems ----------

let timer;
function changed() {
  clearTimeout(timer);
  timer = setTimeout($('follow').checked ? run : check, 250);
}

const wish = () => ({ input: state.input, settings: state.settings, added: state.added });

async function check() {
  const answer = await ask('check', wish());
  if (answer) showProblems(answer.problems);
}

function showProblems(problems) {
  document.querySelectorAll('.variable.wrong').forEach(row => row.classList.remove('wrong'));
  document.querySelectorAll('#form .problem').forEach(line => line.remove());
  for (const { place, text } of problems) {
    const row = [...document.querySelectorAll('.variable')].find(({ dataset }) => dataset.place === place);
    const line = make('p', { className: 'problem', textContent: text });
    if (!row) {
      $('problems').append(line);
      continue;
    }
    row.append(line);
    row.classList.add('wrong');
    for (let around = row.closest('details'); around; around = around.parentElement.closest('details')) around.open = true;
  }
  if (problems.length) tell(problems[0].text, true);
}

// ---------- runs ----------

let busy = false, again = false;  // one wish at a time; whether values have changed meanwhile
async function run(resume = false) {
  clearTimeout(timer);
  state.paused = false;
  if (busy) {
    again = true;
    return;
  }
  busy = true;
  const keep = state.shown.length > 1 || isComparing() ? state.shown[0]?.number : undefined;
  const answer = await ask('start', { ...wish(), keep, resume: resume === true });
  busy = false;
  if (answer) showProblems(answer.problems);
  if (answer?.run) {
    state.running = true;
    tell('running');
    show(answer);
    look();
  }
  if (again) {
    again = false;
    run();
  }
}

const isComparing = () => $('compare').ariaPressed === 'true';

const changes = () => Object.entries(state.settings).filter(([name, value]) => state.cadences[name] !== value)
  .map(([name, value]) => `${name} = ${value}`).join(' · ');

// A run beside the one that is kept, or in the place of the one before.
function show({ run: number, command }) {
  const most = isComparing() ? 2 : 1, same = state.shown.at(-1)?.number === number;
  const before = same || state.shown.length === most ? state.shown.pop() : null;
  const figure = before?.figure ?? make('section', { className: 'run' }, make('header'), make('div'));
  const base = `${lab.page}/${number}/`, name = `${state.input}_${number}`;
  const link = (words, part, ending) => make('a', { textContent: words, href: base + part, download: name + ending });
  const copy = make('button', { type: 'button', textContent: 'Command', title: command });
  copy.addEventListener('click', async () => {
    await navigator.clipboard.writeText(command).then(() => tell('copied: ' + command), () => prompt('The command:', command));
  });
  const words = make('p', { textContent: changes() || 'as in the file' });
  figure.firstChild.replaceChildren(words, link('Input', 'input', '.nml'), link('Output', 'output', '.h5'), copy);
  state.shown.push({ number, figure });
  if (!figure.isConnected) $('runs').append(figure);  // moved, it would load its film again
  if (!same || figure.querySelector('.coming')) place(figure, base);
  else films().forEach(one => { if (one === film(figure)) one.goOn(); else one.play(true); });
}

// The film of a new run replaces the one before when it is there, and keeps what was chosen in it.
function place(figure, base) {
  const holder = figure.lastChild, frame = make('iframe', { title: 'the run', allow: 'fullscreen', className: 'coming' });
  while (holder.children.length > 1) holder.lastChild.remove();
  holder.append(frame);
  frame.dataset.input = state.input;
  frame.src = base;
  const kept = state.shown.length > 1 ? film(state.shown[0].figure) : null;
  const wait = () => {
    if (!frame.isConnected) return;
    if (!isThere(frame)) {
      setTimeout(wait, 30);
      return;
    }
    const player = frame.contentWindow, before = holder.firstChild;
    const old = before !== frame && before.dataset.input === frame.dataset.input ? before.contentWindow : kept;
    player.theme(isDark());
    player.choices(old?.choices && { ...old.choices(), pace: kept?.choices?.().pace });
    player.addEventListener('keydown', typed);
    while (holder.firstChild !== frame) holder.firstChild.remove();
    frame.className = '';
    for (const one of films()) { one.go(-Infinity); one.play(!state.paused); }
  };
  wait();
}

const frameOf = figure => figure.querySelector('iframe'), film = figure => frameOf(figure)?.contentWindow;
const isThere = frame => frame?.contentDocument?.getElementById('clock')?.textContent;
const films = () => state.shown.map(({ figure }) => frameOf(figure)).filter(isThere).map(frame => frame.contentWindow);
const inFilm = (one, id) => one.document.getElementById(id);
const isPlaying = one => inFilm(one, 'play').ariaPressed === 'true';

const isGoing = () => state.running || films().some(isPlaying) || (!state.paused && (busy || document.querySelector('.coming')));
function pauseOrGoOn() {
  state.paused = isGoing();
  if (state.paused) {
    films().forEach(one => one.play(false));
    if (state.running) ask('stop', {});
  } else if (state.stopped || films().every(one => +inFilm(one, 'scrub').value === 1)) run(true);
  else films().forEach(one => one.play(true));
}

// ---------- heartbeats ----------

async function look() {
  const news = await ask('state?' + lab.page);
  if (!news) return;
  if (state.running && !news.running) tell(news.reason, !news.reason.startsWith('stopped'));
  Object.assign(state, { running: news.running, stopped: news.stopped });
}

setInterval(look, 2000);
setInterval(() => { $('pause').textContent = isGoing() ? 'Pause' : 'Go on'; }, 200);
addEventListener('pagehide', () => navigator.sendBeacon('leave', JSON.stringify({ page: lab.page })));
addEventListener('pageshow', event => { if (event.persisted) location.reload(); });

// ---------- what acts ----------

const isDark = () => document.documentElement.dataset.theme === 'dark';

function theme(night) {
  document.documentElement.dataset.theme = night ? 'dark' : 'light';
  for (const one of films()) {
    one.theme(night);
    one.refresh();
  }
}

function bare(on) {
  document.body.classList.toggle('bare', on);
  $('settings').ariaPressed = !on;
}

const actions = {
  run, pause: pauseOrGoOn, settings: () => bare(!document.body.classList.contains('bare')),
  theme: () => theme(!isDark()),
  compare: () => {
    const on = !isComparing();
    $('compare').ariaPressed = on;
    if (!on && state.shown.length > 1) state.shown.shift().figure.remove();
    else if (on) tell('this run stays; the next one will stand beside it');
  },
  choose: () => {  // pictures are asked for while one looks at them: a choice need not wait for the rest
    for (const image of $('inputs').querySelectorAll('img:not([src])')) image.src = image.dataset.src;
    $('inputs').showModal();
  },
};
for (const [id, action] of Object.entries(actions)) $(id).addEventListener('click', () => action());
const keys = { r: 'run', p: 'pause', c: 'compare', s: 'settings' };

// A key of the laboratory, wherever the focus is; its other keys are for all films, while none has the focus.
function typed(event) {
  const { key, target } = event, own = target.ownerDocument === document;
  if (target.matches('input:not([type=range]), select') || event.ctrlKey || event.metaKey || event.altKey || $('inputs').open) return;
  if (keys[key]) actions[keys[key]]();
  else if (own && !(target.matches('input') && /^(Arrow|Home|End|Page)/.test(key)) && !(key === ' ' && target.matches('input, button, summary'))) {
    for (const one of films()) one.pressed(key);
  }
}

addEventListener('keydown', typed);
$('form').addEventListener('submit', event => { event.preventDefault(); run(); });
$('add').addEventListener('change', () => { if ($('add').value) addGroup(...$('add').value.split(' ')); });
$('inputs').append(...lab.inputs.map(name => {
  const image = make('img', { loading: 'lazy', alt: '' });
  image.dataset.src = 'picture?' + encodeURIComponent(name);
  const button = make('button', { type: 'button' }, image, name);
  button.addEventListener('click', () => { $('inputs').close(); choose(name); });
  return button;
}));
$('inputs').addEventListener('close', () => { for (const image of $('inputs').querySelectorAll('img')) image.complete || image.removeAttribute('src'); });
theme(matchMedia('(prefers-color-scheme: dark)').matches);
bare(matchMedia('(max-width: 900px), (max-height: 500px)').matches);
choose(lab.inputs.includes('gas') ? 'gas' : lab.inputs[0]);
