// The screen that matters: one clip, one verdict.
const rating = {player: null, clip: null, film: null, isBusy: false, done: 0, sinceBreak: 0, breakAt: Date.now(), prefetched: null, last: null, turn: 0};

/** The next clip and its bytes. What was fetched ahead comes first: so a rater goes on while the line is down. */
async function nextClip() {
  if (rating.prefetched) {
    const ahead = rating.prefetched;
    rating.prefetched = null;
    const ready = await ahead.catch(() => null);
    if (ready && (!ready.clip.done || outbox.waiting.length === 0)) return ready;
  }
  while (outbox.waiting.length && !session.isOther) { flush(); await sleep(200); }  // else the same clip would be given again
  return patiently(() => fetchNext([]));
}

async function fetchNext(held) {
  const clip = await post('/api/next', {tab_epoch: session.epoch, held});
  if (clip.done) return {clip, source: null};
  try {
    return {clip, source: await fetchClip(clip.presentation)};
  } catch (error) {
    if (error instanceof Offline) throw error;
    return {clip, source: null, problem: error.message};
  }
}

/** Shows what comes next. Of two that are under way (undo while a clip fails to play, say) the later one counts: it asked the server last. */
async function rate() {
  const turn = ++rating.turn;
  try {
    const ready = await nextClip();
    if (turn !== rating.turn) return;
    if (ready.clip.done) return session.me.role === 'adjudicator' ? adjudicated() : finished();
    if (!ready.source) return unplayable(ready.clip, ready.problem);
    showClip(ready.clip, ready.source);
  } catch (error) {
    if (error instanceof Refusal && error.error === 'tab') return losePlace();
    if (isNotOurs(error) || error.error === 'withdrawn') return location.reload();
    throw error;
  }
}

function closeClip() {
  rating.player?.close();
  if (rating.source) URL.revokeObjectURL(rating.source);
  clearInterval(rating.beat);
  rating.player = null;
  rating.source = null;
}

function showClip(clip, source) {
  closeClip();
  Object.assign(rating, {clip, source, isBusy: false, stages: 0, flags: new Set(), cause: '', confidence: 0, note: '', film: null});
  const resumed = JSON.parse(sessionStorage.getItem('evac-clip') || 'null');
  const player = new Player(clip, source, refresh, why => unplayable(clip, why));
  rating.player = player;
  if (resumed && resumed.presentation === clip.presentation) {  // reloaded before the verdict: go on where it was
    player.watch.interrupted = true;
    player.resume(resumed.seen || '');
    player.video.addEventListener('loadedmetadata', () => { player.video.currentTime = resumed.time; }, {once: true});
  }
  layOut(player, source);
  player.isolate(-1);
  player.play();
  rating.beat = setInterval(() => post('/api/heartbeat', {tab_epoch: session.epoch, presentation: clip.presentation})
    .catch(error => { if (error.error === 'tab') losePlace(); }), 60000);
  if (clip.kind === 'clip') {
    const ahead = fetchNext([clip.presentation]);
    ahead.catch(() => {});
    rating.prefetched = ahead;
  }
  refresh();
  speak(`${headline(clip)}. ${clip.rubric.instruction}`);
}

function headline(clip) {
  if (clip.kind === 'practice') return `Practice, ${plural(clip.progress.practice_left, 'clip')} to go`;
  if (clip.kind === 'adjudication') return 'A clip on which raters differ';
  return `Clip ${Math.min(clip.progress.total, rating.done + 1)} of ${clip.progress.total}`;
}

function layOut(player, source) {
  const {clip} = player;
  rating.done = Math.max(rating.done, clip.progress.done);
  rating.scrub = scrubber(player);
  const screen = show(
    make('header.bar', {},
      make('h1', {}, headline(clip)),
      make('span#unsent.badge', {hidden: true}),
      make('progress', {max: Math.max(1, clip.progress.total), value: rating.done, 'aria-label': 'Progress'}),
      make('.row.tight', {},
        make('button.quiet', {type: 'button', onclick: openHistory, 'aria-keyshortcuts': 'H'}, 'History'),
        make('button.quiet', {type: 'button', onclick: openHelp, 'aria-keyshortcuts': '?'}, 'Help'),
        make('button.quiet', {type: 'button', onclick: openMenu}, 'Pause'))),
    make('section.watch', {'aria-label': 'Clip'},
      make('.place', {}, player.frame, make('.playmark', {'aria-hidden': 'true'})),
      filmstrip(player, source), rating.scrub, transport(player)),
    make('section.answer', {'aria-label': 'Verdict'}, ...column(clip)));
  screen.className = 'rate';
  player.frame.addEventListener('click', () => player.toggle());
  const badge = $('.badge', screen);
  badge.id = 'unsent';
  sayUnsent();
}

function transport(player) {
  const button = (name, label, keys, act) => make('button.tool', {type: 'button', tabindex: '-1', title: `${label} (${keys})`, 'aria-label': label, onclick: act}, name);
  const views = player.clip.views.length > 1 ? make('.row.tight.views', {role: 'group', 'aria-label': 'Views'},
    button('All', 'All views', 'V', () => player.isolate(-1)),
    player.clip.views.map((view, k) => button(String(k + 1), `View ${view.name}`, `Shift+${k + 1}`, () => player.isolate(k)))) : null;
  return make('.transport', {},
    button('|‹', 'First frame', 'Home', () => player.seek(0)),
    button('−1 s', 'One second back', 'J', () => player.seek(player.time - 1)),
    button('‹', 'One frame back', ',', () => player.step(-1)),
    make('button.tool.play', {type: 'button', tabindex: '-1', onclick: () => player.toggle(), 'aria-label': 'Play or pause', title: 'Play or pause (Space)'}, '▶'),
    button('›', 'One frame on', '.', () => player.step(1)),
    button('+1 s', 'One second on', 'L', () => player.seek(player.time + 1)),
    button('›|', 'Last frame', 'End', () => player.seek(player.duration)),
    button('Again', 'Again from the start', 'R', () => player.replay()),
    button('Last 2 s', 'Loop the last two seconds', 'A', () => player.loopEnd()),
    make('span.clock', {}),
    make('.row.tight', {role: 'group', 'aria-label': 'Speed'},
      button('−', 'Slower', '[', () => player.faster(-1)), make('output.speed', {}, ''), button('+', 'Faster', ']', () => player.faster(1))),
    views);
}

function column(clip) {
  const stages = clip.rubric.stages.map((stage, k) => make('button.stage', {type: 'button', 'aria-pressed': 'false', 'data-stage': k,
    title: stage.description || stage.name, 'aria-keyshortcuts': String(k + 1), onclick: () => toggleStage(k)},
    make('kbd', {}, String(k + 1)), make('span', {}, stage.name, stage.description ? make('small', {}, stage.description) : null)));
  const flags = session.me.flags.map((flag, k) => make('button.flag', {type: 'button', 'aria-pressed': 'false', 'data-flag': flag,
    onclick: () => toggleFlag(flag)}, make('kbd', {}, String(k + 1)), named(flag)));
  const causes = session.me.causes.map(cause => make('button.cause', {type: 'button', 'aria-pressed': 'false', 'data-cause': cause,
    onclick: () => setCause(cause)}, named(cause)));
  return [
    make('h2.instruction', {}, clip.rubric.instruction),
    make('p.success', {}, make('b', {}, 'Success: '), clip.rubric.success || 'the task is done as the instruction says'),
    stages.length ? make('.group', {role: 'group', 'aria-label': 'Stages reached'}, make('h3', {}, 'Reached'), make('.stages', {}, stages)) : null,
    make('details.more', {}, make('summary', {}, make('kbd', {}, 'X'), 'Flags', make('span.chosen', {})),
      make('.chips', {role: 'group', 'aria-label': 'Flags'}, flags)),
    make('details.more', {}, make('summary', {}, 'Cause, if it fails', make('span.chosen-cause', {})),
      make('.chips', {role: 'group', 'aria-label': 'Cause of the failure'}, causes)),
    make('.chips.sure', {role: 'group', 'aria-label': 'How sure you are'}, make('kbd', {}, 'C'), make('span.quiet', {}, 'How sure?'), sureness.map(([level, name]) =>
      make('button', {type: 'button', 'aria-pressed': 'false', 'data-sure': level, 'aria-keyshortcuts': 'C', onclick: () => setConfidence(level)}, name))),
    make('details.more.noted', {}, make('summary', {}, make('kbd', {}, 'N'), 'Note'),
      make('textarea', {rows: 3, maxlength: 500, 'aria-label': 'Note', oninput: event => { rating.note = event.target.value; }})),
    make('.final', {},
      make('.verdicts', {role: 'group', 'aria-label': 'Verdict'},
        [['success', 'S'], ['failure', 'F'], ['cannot_tell', 'U']].map(([label, key]) =>
          make(`button.verdict.${label}`, {type: 'button', 'data-label': label, disabled: true, 'aria-keyshortcuts': key, onclick: () => decide(label)},
            make('kbd', {}, key), words[label]))),
      make('p.why', {'aria-live': 'off'}, '')),
  ].filter(Boolean);
}

function refresh() {
  const player = rating.player;
  if (!player || !$('.rate')) return;
  sessionStorage.setItem('evac-clip', JSON.stringify({presentation: player.clip.presentation, time: player.time, seen: player.seen.join('')}));
  rating.scrub.refresh();
  const isCovered = player.isCovered(session.me.cover) || rating.isOpen, may = isCovered && !rating.isBusy && !session.isOther;
  document.querySelectorAll('.verdict').forEach(button => { button.disabled = !may; });
  const share = Math.floor(100 * Math.min(1, player.coverage));
  $('.why').textContent = isCovered ? '' : player.coverage >= session.me.cover - 1e-9 ? 'Watch the end of the clip first.' : `Watch the clip first: ${share} % seen of ${Math.round(100 * session.me.cover)} %.`;
  $('.clock').textContent = `${player.time.toFixed(1)} / ${player.duration.toFixed(1)} s`;
  $('.speed').textContent = `${sticky.speed}×`;
  const isPaused = player.video.paused;
  $('.play').textContent = isPaused ? '▶' : '❚❚';
  $('.place').classList.toggle('paused', isPaused);
  document.querySelectorAll('.views .tool').forEach((button, k) => button.setAttribute('aria-pressed', String(k - 1 === player.view)));
  if (isCovered && !rating.saidCovered) { rating.saidCovered = true; speak('seen; the verdict is open'); }
  if (!isCovered) rating.saidCovered = false;
}

function toggleStage(k) {
  if (!rating.clip || k >= rating.clip.rubric.stages.length) return;
  rating.stages ^= 1 << k;
  $(`[data-stage="${k}"]`).setAttribute('aria-pressed', String(Boolean(rating.stages >> k & 1)));
}
function toggleFlag(flag) {
  if (!rating.flags.delete(flag)) rating.flags.add(flag);
  $(`[data-flag="${flag}"]`).setAttribute('aria-pressed', String(rating.flags.has(flag)));
  $('.chosen').textContent = rating.flags.size ? ` · ${[...rating.flags].map(named).join(', ')}` : '';
}
function setCause(cause) {
  rating.cause = rating.cause === cause ? '' : cause;
  document.querySelectorAll('[data-cause]').forEach(button => button.setAttribute('aria-pressed', String(button.dataset.cause === rating.cause)));
  $('.chosen-cause').textContent = rating.cause ? ` · ${named(rating.cause)}` : '';
}
/** How sure a rater is, if they say: 3 … 1. */
const sureness = [[3, 'sure'], [2, 'fairly'], [1, 'a guess']];
function setConfidence(level) {
  rating.confidence = rating.confidence === level ? 0 : level;
  document.querySelectorAll('[data-sure]').forEach(button => button.setAttribute('aria-pressed', String(Number(button.dataset.sure) === rating.confidence)));
}
const howSure = () => rating.confidence ? {confidence: rating.confidence} : {};
/** Sure, fairly, a guess, nothing said. */
function nextConfidence() {
  setConfidence(rating.confidence === 0 ? 3 : rating.confidence === 1 ? 1 : rating.confidence - 1);
  speak(rating.confidence ? sureness.find(([level]) => level === rating.confidence)[1] : 'not said how sure');
}

/** A verdict. It is kept here first, then sent; the next clip comes after 600 ms, undo stays for longer. */
async function decide(label) {
  const player = rating.player;
  if (!player || rating.isBusy || session.isOther || !(player.isCovered(session.me.cover) || rating.isOpen)) return;
  rating.isBusy = true;
  player.isQuiet = true;
  player.video.pause();
  const clip = rating.clip, uuid = secret();
  const {tab, ...record} = player.record();
  if (rating.isOpen) record.coverage = Math.max(record.coverage, session.me.cover);
  const body = {client_uuid: uuid, presentation: clip.presentation, label, stages: rating.stages, flags: [...rating.flags],
    cause: label === 'failure' ? rating.cause : '', note: rating.note, ...howSure(), ...record};
  if (rating.supersedes) body.supersedes = rating.supersedes;
  $(`.verdict.${label}`).classList.add('given');
  refresh();
  const {answered} = await send('/api/verdict', body);
  sessionStorage.removeItem('evac-clip');
  if (clip.kind === 'practice') return feedback(await answered, label);
  if (clip.kind === 'adjudication') return unfold(await answered, body);
  if (!rating.isOpen) rating.done++, rating.sinceBreak++;
  rating.last = {uuid, clip};
  rating.isOpen = false;
  rating.supersedes = null;
  toast(`${words[label]} kept`, {name: 'Undo (Z)', act: undo}, 8);
  speak(`${words[label]} kept`);
  await sleep(600);
  if (rating.clip === clip) next();
}

function next() {
  const isLong = Date.now() - rating.breakAt > 25 * 60e3;
  if (rating.sinceBreak >= session.me.break_every || (isLong && rating.sinceBreak > 0)) return pause();
  return rate();
}

async function undo() {
  const last = rating.last;
  if (!last || session.isOther) return;
  rating.last = null;
  hideToast();
  const {answered} = await send('/api/retract', {client_uuid: secret(), of_uuid: last.uuid});
  rating.done--;
  rating.sinceBreak = Math.max(0, rating.sinceBreak - 1);
  rating.prefetched = null;
  await answered.catch(() => {});
  speak('undone');
  rate();
}

/** It does not play here: no vote, no blame; the lead hears of it. */
async function unplayable(clip, why) {
  closeClip();
  rating.prefetched = null;
  toast('This clip cannot be played; the lead is told.', null, 4);
  await send('/api/unplayable', {presentation: clip.presentation, reason: String(why).slice(0, 190)});
  while (outbox.waiting.length && !session.isOther) await sleep(100);
  rate();
}
