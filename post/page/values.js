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
