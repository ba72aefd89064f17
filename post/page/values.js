// ---------- values of the input variables: given, by default, or changed by the user ----------

const givenIn = place => state.groups.find(group => group.place === place)?.given ?? {};
const placeOf = key => key.slice(0, key.lastIndexOf('.')), nameOf = key => key.slice(key.lastIndexOf('.') + 1);
const variableOf = key => lab.table[key.split('.')[0]][nameOf(key)];
const words = value => value === null || value === undefined ? '' : [value].flat().map(one => typeof one === 'boolean' ? `.${one}.` : String(one)).join(',');
const givenAs = key => givenIn(placeOf(key))[nameOf(key)] ?? '';
const textOf = key => state.settings[key] ?? givenAs(key);

const isVariable = key => key?.includes('.') && !!lab.table[key.split('.')[0]]?.[nameOf(key)];
// Returns the text given for a variable or, if there is none, its default, which may be the value of another variable.
const actingOf = key => textOf(key) || defaultOf(key);
function defaultOf(key) {
  const { default: usual, otherwise } = variableOf(key);
  return isVariable(otherwise) ? actingOf(otherwise) : words(usual);
}

// Returns the default of a variable as text, or words that describe what happens without a value.
function defaultInWords(key) {
  const { otherwise } = variableOf(key);
  return defaultOf(key) || (isVariable(otherwise) ? defaultInWords(otherwise) : otherwise ?? '');
}

const valueOf = key => actingOf(key) || words(variableOf(key).example);
const split = text => text.split(/\s*,\s*|\s+/).flatMap(one => /^[2-9]\*./.test(one) ? Array(+one[0]).fill(one.slice(2)) : one);
const numberOf = (key, at = 0) => parseFloat(split(valueOf(key))[at]?.replace(/d/i, 'e'));
const shownOf = key => state.waiting[key]?.text ?? textOf(key);

// ---------- variables and their values in words ----------

// Returns the label of the slider of a variable if the slider shows all of a value that differs from the input file.
function labelOf(key, value = '') {
  const given = split(givenAs(key)), isAll = ({ at }) => at < 0 || split(value).every((one, k) => k === at || +one === +given[k]);
  return state.input.sliders.find(one => one.key === key && isAll(one));
}

// Returns the name of a variable as a phrase, for example "velocity of disk1".
function phraseOf(key) {
  const [kind, ...rest] = placeOf(key).split('.'), [name] = rest, what = nameOf(key).replaceAll('_', ' ');
  const owner = { species: name, side: `the ${name} side` }[kind] ?? (name ? `${kind} ${name}` : '');
  return owner ? `${what} of ${owner}` : what;
}

// Returns a value as text: numbers with minus signs, and several numbers in parentheses.
function valueInWords(text) {
  const parts = split(String(text)).map(one => isFinite(parseFloat(one)) ? one.replaceAll('-', '−') : one);
  return parts.length > 1 ? `(${parts.join(', ')})` : parts[0];
}

// Returns a variable and its value as text, with the label of its slider or else its name.
function inWords([key, value]) {
  if (/^side\.\w+\.open$/.test(key)) return doorInWords(key, value);
  const slider = labelOf(key, value), shown = slider?.at >= 0 ? split(value)[slider.at] : value;
  return `${slider ? slider.words.replace(/ \(.*/, '') : phraseOf(key)} = ${valueInWords(shown)}`;
}

// Returns the stop rules of the input in words. The laboratory itself ignores them.
const STOPS = {
  time: value => `until t = ${value}`, energy_fraction: value => `until ${short(100 * value)} % of the energy is left`,
  collisions_per_disk: value => `for ${value} collisions per disk`, collisions: value => `for ${value} collisions`,
  events: value => `for ${value} events`, disks_inside: value => `until ${value} disks are inside`, at_rest: () => 'until all disks rest',
};
function stopInWords() {
  const rules = Object.keys(STOPS).filter(name => textOf(`stop.${name}`)).map(name => STOPS[name](textOf(`stop.${name}`)));
  return rules.length ? `Here a run has no end. The downloaded input runs ${rules.join(' or ')}.` : '';
}

// Returns the changes of a run in words. The variables of a group that was added are not listed.
function settingsInWords() {
  const isOfAdded = key => state.added.some(([kind, name]) => placeOf(key) === `${kind}.${name}`);
  const added = state.added.map(([kind, name]) => `${kind === 'species' ? '' : `${kind} `}${name} added`);
  const others = Object.entries(wish().settings).filter(([key]) => !isOfAdded(key)).map(inWords);
  return [...others, ...added].join(' · ') || 'as in the file';
}

const changeInWords = ([, key, value]) => key ? inWords([key, value]) : value;  // a change without a variable is already in words

// Returns which variable determines the value of a variable that has none of its own: the walls have the restitution of two disks.
function inheritedInWords(key) {
  const { otherwise } = variableOf(key), other = !textOf(key) && isVariable(otherwise) ? otherwise : null;
  return other ? `as ${(labelOf(other)?.words ?? phraseOf(other)).replace(/ \(.*/, '')}` : '';
}
