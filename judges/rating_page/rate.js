// The screen that matters: one clip, one verdict.
const rating = {player: null, clip: null, film: null, isBusy: false, done: 0, sinceBreak: 0, breakAt: Date.now(), prefetched: null, last: null, turn: 0, held: null, aside: null};

/** The next clip and its bytes. What was fetched ahead comes first: so a rater goes on while the line is down. That nothing is left is
    never believed of an answer from before: it left out the clips in hand, and whoever dropped one since would not be asked of it. */
async function nextClip() {
  if (rating.prefetched) {
    const ahead = rating.prefetched;
    rating.prefetched = null;
    const ready = await ahead.catch(() => null);
    if (ready && !ready.clip.done) return ready;
  }
  while (outbox.waiting.length && !session.isOther) { flush(); await sleep(200); }  // else the same clip would be given again
  return patiently(() => fetchNext([]));
}

/** What the server holds for unanswered and must not give again: the clip on the screen, and those whose verdicts are on their way. */
const mostHeld = 8;  // that a request may name
const inHand = () => [...new Set([rating.clip.presentation, ...outbox.waiting.map(entry => entry.body.presentation).filter(Boolean)])];

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
  if (rating.held) return goOn();
  const turn = ++rating.turn;
  rating.isOver = true;
  try {
    const ready = await nextClip();
    if (turn !== rating.turn) return;
    if (ready.clip.done) {
      session.me.progress = ready.clip.progress;
      return session.me.role === 'adjudicator' ? adjudicated() : finished();
    }
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
  rating.held = null;
}

/** A break in a clip: the clip, what was seen of it and what was marked wait as they are; its place may go to others meanwhile. */
function hold() {
  rating.player.rest();
  clearInterval(rating.beat);
  rating.held = [...$('#screen').childNodes];
}

function goOn() {
  show(...rating.held).className = 'rate';
  rating.held = null;
  rating.breakAt = Date.now();
  rating.player.back();
  keepPlace();
  refresh();
  $('.feedback .primary, .others')?.focus();
  if (!rating.isBusy && !rating.player.isCovered(session.me.cover)) rating.player.play();
}

/** Another clip is changed first: what was seen of this one and what was marked waits until the server gives it again. */
function setAside() {
  if (!rating.player || rating.isOver || rating.isBusy || rating.isOpen) return;
  rating.player.rest();
  clearInterval(rating.beat);
  if (rating.aside) forgetAside();
  const {player, clip, source, scrub, answer, film, stages, flags, cause, confidence, note, saidCovered} = rating;
  rating.aside = {player, clip, source, scrub, answer, film, stages, flags, cause, confidence, note, saidCovered, nodes: [...$('#screen').childNodes]};
  rating.player = rating.source = null;  // whoever comes next closes neither
}

function forgetAside() {
  rating.aside.player.close();
  URL.revokeObjectURL(rating.aside.source);
  rating.aside = null;
}

function putBack() {
  const {nodes, ...state} = rating.aside;
  Object.assign(rating, state, {aside: null, isBusy: false, isOver: false, isOpen: false, supersedes: null});
  show(...nodes).className = 'rate';
  rating.player.back();
  capDigits();  // another hand may have come meanwhile
  sayUnsent();
  keepPlace();
  fetchAhead();
  refresh();
  speak(headline(rating.clip));
  if (!rating.player.isCovered(session.me.cover)) rating.player.play();
}

/** After a verdict: the next clip; to somebody who went to the menu meanwhile it comes with Go on. */
function moveOn() {
  if (rating.held) return closeClip();
  rate();
}

function keepPlace() {
  const {presentation} = rating.clip;
  const beat = () => post('/api/heartbeat', {tab_epoch: session.epoch, presentation}).catch(error => { if (error.error === 'tab') losePlace(); });
  clearInterval(rating.beat);
  rating.beat = setInterval(beat, 60000);
}

function fetchAhead() {
  const held = inHand();
  if (rating.clip.kind !== 'clip' || held.length > mostHeld) return;
  const ahead = fetchNext(held);
  ahead.catch(() => {});
  rating.prefetched = ahead;
}

/** @param isOpen  it was rated before: what is said of it now is a change. */
function showClip(clip, source, isOpen = false) {
  closeClip();
  if (rating.aside?.clip.presentation === clip.presentation) {
    URL.revokeObjectURL(source);
    return putBack();
  }
  Object.assign(rating, {clip, source, isBusy: false, stages: 0, flags: new Set(), cause: '', confidence: 0, note: '', film: null, isOpen, supersedes: null,
    isOver: false, saidCovered: false});
  const resumed = JSON.parse(sessionStorage.getItem('evac-clip') || 'null');
  const player = new Player(clip, source, refresh, why => unplayable(clip, why));
  rating.player = player;
  if (resumed && resumed.presentation === clip.presentation) {  // reloaded before the verdict: go on where it was
    player.watch.interrupted = true;
    player.resume(resumed.seen || '');
    player.video.addEventListener('loadedmetadata', () => { player.video.currentTime = Math.max(0, resumed.time - 3 * player.period); }, {once: true});  // the last frames were not told of
  }
  layOut(player, source);
  player.isolate(-1);
  player.play();
  keepPlace();
  fetchAhead();
  refresh();
  speak(`${headline(clip)}. ${clip.rubric.instruction}`);
  if (clip.verdict) fill(clip.verdict);
  if (clip.verdict && clip.kind === 'adjudication') unfold(clip, clip.verdict, clip.others);  // the first look is stored: only the decision is left
}

/** What was said before stands in the form, so that who changes one thing keeps the others. */
function fill(verdict) {
  rating.clip.rubric.stages.forEach((stage, k) => { if (verdict.stages >> k & 1) toggleStage(k); });
  verdict.flags.split(' ').filter(flag => session.me.flags.includes(flag)).forEach(toggleFlag);
  if (verdict.cause) setCause(verdict.cause);
  if (verdict.confidence) setConfidence(verdict.confidence);
  rating.note = $('textarea', rating.answer).value = verdict.note;
  $('.noted').open = Boolean(verdict.note);
}

function headline(clip) {
  if (clip.kind === 'practice') return `Practice, ${plural(clip.progress.practice_left, 'clip')} to go`;
  if (clip.kind === 'adjudication') return 'A clip to decide on';
  return `Clip ${Math.min(clip.progress.total, rating.done + 1)} of ${clip.progress.total}`;
}

function layOut(player, source) {
  const {clip} = player;
  rating.done = Math.max(rating.done, clip.progress.done);
  rating.scrub = scrubber(player);
  rating.answer = make('section.answer', {'aria-label': 'Verdict'}, ...column(clip));
  const screen = show(
    make('header.bar', {},
      make('h1', {}, headline(clip)),
      make('span.badge', {id: 'unsent', hidden: true}),
      make('progress', {max: Math.max(1, clip.progress.total), value: rating.done, 'aria-label': 'Progress'}),
      make('.row.tight', {},
        make('button.quiet', {type: 'button', onclick: openHistory, 'aria-keyshortcuts': 'H'}, 'History'),
        make('button.quiet', {type: 'button', onclick: openHelp, 'aria-keyshortcuts': '?'}, 'Help'),
        make('button.quiet', {type: 'button', onclick: openMenu}, 'Pause'))),
    make('section.watch', {'aria-label': 'Clip'},
      make('.place', {}, player.frame, make('.playmark', {'aria-hidden': 'true'})),
      filmstrip(player, source), rating.scrub, transport(player)),
    rating.answer);
  screen.className = 'rate';
  player.frame.addEventListener('click', () => player.toggle());
  sayUnsent();
}

function transport(player) {
  const button = (name, label, keys, act) => make('button.tool', {type: 'button', tabindex: '-1', title: keys ? `${label} (${keys})` : label, 'aria-label': label, onclick: act}, name);
  const views = player.clip.views.length > 1 ? make('.row.tight.views', {role: 'group', 'aria-label': 'Views'},
    button('All', 'All views', 'V', () => player.isolate(-1)),
    player.clip.views.map((view, k) => button(String(k + 1), `View ${view.name}`, digitKey(k) && `Shift+${digitKey(k)}`, () => player.isolate(k)))) : null;
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

/** Of these boxes one at most is open. `toggle` is told of late, when another clip may be shown already: they know each other, not the page. */
function oneOpen(...boxes) {
  for (const box of boxes) box.addEventListener('toggle', () => { if (box.open) boxes.forEach(other => { other.open = other === box; }); });
  return boxes;
}

function column(clip) {
  const stages = clip.rubric.stages.map((stage, k) => make('button.stage', {type: 'button', 'aria-pressed': 'false', 'data-stage': k,
    title: stage.description || stage.name, onclick: () => toggleStage(k)}, digitCap(k), make('span', {}, stage.name, stage.description ? make('small', {}, stage.description) : null)));
  const flags = session.me.flags.map((flag, k) => make('button.flag', {type: 'button', 'aria-pressed': 'false', 'data-flag': flag,
    onclick: () => toggleFlag(flag)}, digitCap(k), named(flag)));
  const causes = session.me.causes.map((cause, k) => make('button.cause', {type: 'button', 'aria-pressed': 'false', 'data-cause': cause,
    onclick: () => setCause(cause)}, digitCap(k), named(cause)));
  const [flagBox, causeBox] = oneOpen(
    make('details.more.flags', {}, make('summary', {}, make('kbd', {}, 'X'), 'Flags', make('span.chosen', {})),
      make('.chips', {role: 'group', 'aria-label': 'Flags'}, flags)),
    make('details.more.causes', {}, make('summary', {}, make('kbd', {}, 'B'), 'Cause, if it fails', make('span.chosen-cause', {})),
      make('.chips', {role: 'group', 'aria-label': 'Cause of the failure'}, causes)));
  return [
    make('h2.instruction', {}, clip.rubric.instruction),
    make('p.success', {}, make('b', {}, 'Success: '), clip.rubric.success || 'the task is done as the instruction says'),
    stages.length ? make('.group', {role: 'group', 'aria-label': 'Stages reached'}, make('h3', {}, 'Reached'), make('.stages', {}, stages)) : null,
    flagBox, causeBox,
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
  if (!rating.isBusy && !rating.isOpen) sessionStorage.setItem('evac-clip', JSON.stringify({presentation: player.clip.presentation, time: player.time, seen: player.seen.join('')}));
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

/** What the form says, with a label. */
const said = label => ({label, stages: rating.stages, flags: [...rating.flags], cause: label === 'failure' ? rating.cause : '', note: rating.note, ...howSure()});

/** A verdict. It is kept here first, then sent; the next clip comes after 600 ms, undo stays for longer. */
async function decide(label) {
  const player = rating.player;
  if (!player || rating.isBusy || session.isOther || !(player.isCovered(session.me.cover) || rating.isOpen)) return;
  rating.isBusy = true;
  rating.isOver = rating.clip.kind === 'clip';  // of the other kinds there is something to read, or to decide
  player.isQuiet = true;
  player.video.pause();
  const {clip, turn, isOpen} = rating, uuid = secret();
  const record = player.record();
  const body = {client_uuid: uuid, presentation: clip.presentation, ...said(label), ...record};
  if (rating.supersedes) body.supersedes = rating.supersedes;
  $(`.verdict.${label}`).classList.add('given');
  refresh();
  const {answered} = await send('/api/verdict', body);
  if (clip.kind === 'adjudication') return compare(clip, answered);
  if (!isOpen) sessionStorage.removeItem('evac-clip');  // of a change it is of the clip that waits
  if (clip.kind === 'practice') return learn(clip, answered);
  if (!isOpen) rating.done++, rating.sinceBreak++;
  rating.last = {uuid, clip};
  toast(`${words[label]} kept`, {name: 'Undo (Z)', act: undo}, 8);
  speak(`${words[label]} kept`);
  await sleep(600);
  if (rating.clip === clip && rating.turn === turn) next();
}

/** The server's word on a clip that goes on; nothing if it was refused (which was said) or another clip is here by now. */
async function wordOn(clip, answered) {
  const answer = await answered.catch(() => null);
  if (rating.clip !== clip || !rating.player) return null;
  if (!answer) moveOn();
  return answer;
}
async function learn(clip, answered) {
  const answer = await wordOn(clip, answered);
  if (answer) feedback(clip, answer);
}
async function compare(clip, answered) {
  const answer = await wordOn(clip, answered);
  if (answer) unfold(clip, answer.verdict, answer.others);
}

function next() {
  const isLong = Date.now() - rating.breakAt > 25 * 60e3;
  if (rating.sinceBreak >= session.me.break_every || (isLong && rating.sinceBreak > 0)) { closeClip(); return pause(); }
  return rate();
}

async function undo() {
  const last = rating.last;
  if (!last || session.isOther) return;
  rating.last = null;
  const turn = ++rating.turn;
  rating.held = null;
  hideToast();
  const {answered} = await send('/api/retract', {client_uuid: secret(), of_uuid: last.uuid});
  rating.done--;
  rating.sinceBreak = Math.max(0, rating.sinceBreak - 1);
  rating.prefetched = null;
  await answered.catch(() => {});
  speak('undone');
  if (turn === rating.turn) rate();
}

/** It does not play here: no vote, no blame; the lead hears of it. */
async function unplayable(clip, why) {
  closeClip();
  const turn = ++rating.turn;
  rating.prefetched = null;
  toast('This clip cannot be played; the lead is told.', null, 4);
  await send('/api/unplayable', {presentation: clip.presentation, reason: String(why).slice(0, 190)});
  while (outbox.waiting.length && !session.isOther) await sleep(100);
  if (turn === rating.turn) rate();
}
