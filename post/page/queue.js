// ---------- events to come, of few disks with an event log ----------

const toCome = () => upTo(film.events.time, moment.time);
const meeting = k => {
  const { i, j } = film.events;
  return `disk ${i[k] + 1} and ${j[k] < 0 ? film.surfaces[-1 - j[k]] : `disk ${j[k] + 1}`}`;
};

function tellQueue() {
  if (!film.events) return;
  const { time } = film.events, next = toCome();
  const row = (when, k) => `<li>${meeting(next + k)}<span>t = ${long(when)}</span></li>`;
  $('queue').innerHTML = time.slice(next, next + 20).map(row).join('');
  $('due').textContent = next < time.length ? `the first in ${short(time[next] - moment.time)}` : '';
  $('happened').textContent = next ? `Happened: ${meeting(next - 1)}.` : ' ';
}

// The ways of the disks to their next contact, and where they will be then.
function drawNextEvent() {
  const { time, i, j } = film.events, next = toCome(), now = moment.time;
  if (next === time.length) return;
  const both = [i[next], j[next]].filter(k => k >= 0);
  for (const k of both) drawPath(flights(k, now, time[next]), ink.accent, 2);
  move(time[next]);
  const places = both.map(k => [X[k], Y[k], radii[sizeOf[k]]]);
  move(now);
  marks.setLineDash([5 * page.dots, 4 * page.dots]);
  for (const place of places) ring(...place);
  marks.setLineDash([]);
}
