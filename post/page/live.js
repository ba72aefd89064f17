// ---------- a run that goes on ----------

// A page without a film asks the server of `player.py --live` for one, and goes on asking until the run has ended.
const live = { on: false, stamp: '' };

async function ask() {
  const answer = await fetch('film?known=' + encodeURIComponent(live.stamp)).catch(() => null);
  const news = answer?.ok ? await answer.text() : null;
  if (news) receive(JSON.parse(news));
  if (news === null) $('live').textContent = 'No answer: player.py has ended. The film stays as it is.';
  if (!live.on) return;
  setTimeout(ask, news === null ? 5000 : 1500);
}

function receive(news) {
  const started = live.stamp !== '', { time } = moment, own = started ? kinds.map(kind => kind.own) : [];
  load(news);
  kinds.forEach((kind, s) => { kind.own = own[s]; });
  live.stamp = news.stamp;
  live.on = !news.end;
  $('warning').textContent = news.end ? news.warning : '';
  $('live').textContent = news.end ? `The run ${news.end}, at t = ${short(last())}.` : `Live: the run is at t = ${short(last())}.`;
  if (!started) begin();
  else prepareFilm();
  move(started ? time : last());
  refresh();
  if (!started) play(true);
}

// ---------- here it begins ----------

listen();
const enclosed = JSON.parse($('film').textContent);
$('film').remove();
if (enclosed) {
  load(enclosed);
  begin();
  move(first());
  refresh();
  if (!fromAddress() && !matchMedia('(prefers-reduced-motion: reduce)').matches) play(true);
} else {
  live.on = true;
  ask();
}
