// ---------- film of a run that has not finished ----------

// A page made by `player.py --live` requests new frames from the server of that script until the run ends. The film is paced so
// that it reaches the newest frame when the next answer is expected. The user can move to any earlier time of the film. In the
// laboratory, a worker process sends the frames instead.
const enclosed = JSON.parse($('film').textContent);
const isPart = parent !== window && !enclosed;
const live = { on: false, stamp: '', newest: true, heard: 0, pace: 0 };

async function ask() {
  const answer = await fetch('film?known=' + encodeURIComponent(live.stamp)).catch(() => null);
  const news = answer?.ok ? await answer.text() : null;
  if (news) receive(JSON.parse(news));
  if (news === null) $('live').textContent = 'No answer: the server has ended. The film stays as it is.';
  if (!live.on) return;
  setTimeout(ask, news === null ? 5000 : 1500);
}

function receive(news) {
  const started = live.stamp !== '', { time } = moment;
  const now = performance.now(), taken = Math.min(10, (now - live.heard) / 1000);
  live.heard = now;
  loadFilm(news);
  live.stamp = news.stamp;
  live.on = !news.end;
  $('warning').textContent = news.end ? news.warning : '';
  live.pace = started ? (last() - time) / taken : 0;
  tellLive(news.end);
  if (!started) begin();
  else prepareFilm();
  if (started && usual) pace = usualPace();
  move(started ? time : live.newest ? last() : first());
  refresh();
  if (!started) play(true);
}

function tellLive(end) {
  $('live').textContent = end ? `The run ${end}, at t = ${short(last())}.` : live.on ? `Live: the run is at t = ${short(last())}; `
    + (live.newest ? 'the film follows it.' : 'End follows it.') : '';
}

// Sets whether the film follows the newest frame.
function follow(newest) {
  if (!live.on) return;
  live.newest = newest;
  tellLive('');
  if (newest) { show(last(), true); play(true); }
}

// ---------- actions when the page is loaded ----------

listen();
document.documentElement.classList.toggle('part', isPart);
document.documentElement.classList.toggle('empty', isPart);
if (isPart) {
  addEventListener('keydown', event => parent.typed(event));
  addEventListener('scroll', () => parent.scrolled?.(), { passive: true });
}
$('film').remove();
if (enclosed) {
  loadFilm(enclosed);
  begin();
  move(first());
  refresh();
  if (!fromAddress() && !matchMedia('(prefers-reduced-motion: reduce)').matches) play(true);
} else if (!isPart) {
  live.on = true;
  ask();
}
