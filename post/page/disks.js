// ---------- scenes of two to four disks: their velocities, restitution and number ----------

// Functions called by the film of a run with few disks.
const MOST_DISKS = 4;
function redefine(name, variable, values) {
  const key = `species.${name}.${variable}`;
  set(key, values.join(','));
  state.direct = key;
}
function restitution() { return numberOf('contact.restitution'); }
function bounce(value) { set('contact.restitution', String(value)); }

// Returns a message about two overlapping disks with the numbers that the picture shows. The program numbers the disks of each
// species, and names the species of only one of them.
function withDisksOfPicture(text) {
  const [, x, y, other] = text.match(/(?:^|: )disk 1 at (\S+), (\S+) overlaps disk 1 of "(.+)"$/) ?? [], names = namesOfSpecies();
  const own = names.findIndex(name => name !== other && [x, y].every((one, k) => numberOf(`species.${name}.position`, k) === +one)), pair = [own, names.indexOf(other)].sort();
  const isFew = names.every(name => textOf(`species.${name}.position`) && ['', '1'].includes(textOf(`species.${name}.count`)));
  return other && isFew && pair[0] >= 0 ? `disk ${pair[0] + 1} would overlap disk ${pair[1] + 1}` : text;
}

const namesOfSpecies = () => [...state.groups.filter(({ kind }) => kind === 'species').map(({ place }) => place.slice(8)),
  ...state.added.filter(([kind]) => kind === 'species').map(([, name]) => name)];
function canRemoveDisk() { return state.added.some(([kind]) => kind === 'species'); }
// positions for further disks, relative to the box
const PLACES = [[0.5, 0.8], [0.5, 0.2], [0.2, 0.8], [0.8, 0.2], [0.2, 0.2], [0.8, 0.8], [0.5, 0.5]];

// Starts a run with an additional disk like the first one, at rest in a free place.
function addDisk() {
  const names = namesOfSpecies(), first = `species.${names[0]}`, radius = textOf(`${first}.radius`);
  if (names.length >= MOST_DISKS) return;
  const pair = key => split(valueOf(key)).map(Number), lower = pair('box.lower'), upper = pair('box.upper');
  const isFree = place => names.every(name => {
    const at = pair(`species.${name}.position`);
    return Math.hypot(place[0] - at[0], place[1] - at[1]) > numberOf(`species.${name}.radius`) + 1.1 * parseFloat(radius);
  });
  const place = PLACES.map(one => one.map((share, k) => +(lower[k] + share * (upper[k] - lower[k])).toPrecision(6))).find(isFree);
  const name = Array.from({ length: MOST_DISKS }, (_, k) => `disk${k + 1}`).find(one => !names.includes(one));
  if (!place) { tell('There is no free place for another disk.', true); return; }
  state.added.push(['species', name]);
  for (const [variable, text] of [['mass', '1'], ['radius', radius], ['position', place.join(',')], ['velocity', '0,0']]) state.settings[`species.${name}.${variable}`] = text;
  buildEverything();
  run();
}

// Starts a run without the most recently added disk.
function removeDisk() {
  const at = state.added.findLastIndex(([kind]) => kind === 'species');
  if (at < 0) return;
  const [[, name]] = state.added.splice(at, 1);
  state.settings = Object.fromEntries(Object.entries(state.settings).filter(([key]) => placeOf(key) !== `species.${name}`));
  buildEverything();
  run();
}

