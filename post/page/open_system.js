// ---------- buttons of open systems: they let disks in, and open or close sides ----------

const LET_IN = 50;  // largest number of disks let in by one click

// Labels the buttons of the newest run: one for each source, and one for each side that can be open.
function buildOpenSystem({ sources, sides, surfaces }) {
  const ofSources = sources.map(source => [`add ${LET_IN} disks${sources.length > 1 ? ` (${source})` : ''}`, { do: 'insert', source, count: LET_IN }]);
  const ofSides = sides.flatMap(({ open }, side) => open === undefined ? [] : [[`${open ? 'close' : 'open'} ${surfaces[side]}`, { do: 'open_side', side, open: !open }]]);
  const all = [...ofSources, ...ofSides], buttons = $('open_system');
  while (buttons.children.length > all.length) buttons.lastChild.remove();
  while (buttons.children.length < all.length) buttons.append(make('button', { type: 'button' }));
  all.forEach(([textContent, wish], k) => Object.assign(buttons.children[k], { textContent, onclick: () => filmOf(current()).send(wish) }));
  buttons.hidden = !all.length;
}

const doorInWords = (key, value) => `the ${key.split('.')[1]} side is ${/^\W*t/i.test(value) ? 'open' : 'closed'}`;
