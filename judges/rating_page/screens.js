// Everything around the clips: join, brief, practice, pauses, the end.
function noInvitation() {
  show(make('.sheet', {}, make('h1', {}, 'An invitation is needed'),
    make('p', {}, 'This page opens with a link from whoever runs the study. A link works once, for one person; if yours was used already, ask for another one.')))
    .className = 'centred';
}

/** A link was opened where somebody takes part already: whose is this browser? @returns whether the link counts. */
async function isSomebodyNew(me) {
  const who = me.rater + (me.name ? ` (${me.name})` : '');
  const isNew = await ask('Who is here?', [make('p', {}, `${who} takes part in this browser already. The link that was opened may be for somebody else.`),
    make('p', {}, `A browser is one person’s: who uses the link takes it over, and ${who} cannot go on here. Answers that were given stay.`)],
  [[`Go on as ${who}`, false], ['Use the link', true, 'bad']]);
  if (!isNew || me.role === 'lead') return Boolean(isNew);
  await loadOutbox(me.study_id, me.rater);
  if (outbox.waiting.length) await becomeTheTab();
  if (!await drain(handover_s)) return true;
  await ask('Not yet', [make('p', {}, `${plural(outbox.waiting.length, 'answer')} of ${who} could not be sent, and would be lost. Open the link again when the connection is back.`)], [[`Go on as ${who}`, null, 'primary']]);
  return false;
}

/** /r/<link>: what this is, who is asked, and what leaving means. */
function join(invite) {
  const uuid = sessionStorage.getItem('evac-join') || secret();
  sessionStorage.setItem('evac-join', uuid);
  const name = make('input', {type: 'text', maxlength: 60, autocomplete: 'nickname', id: 'name'});
  const consent = make('input', {type: 'checkbox', id: 'consent'});
  const button = make('button.primary', {type: 'submit', disabled: true}, 'Begin');
  consent.addEventListener('change', () => { button.disabled = !consent.checked; });
  const problem = make('p.problem', {role: 'alert'});
  const enter = async event => {
    event.preventDefault();
    button.disabled = true;
    try {
      await patiently(() => post('/api/join', {invite, uuid, name: name.value.trim()}));
      history.replaceState(null, '', '/');
      localStorage.setItem('evac-link', invite);
      sessionStorage.removeItem('evac-join');
      sessionStorage.removeItem('evac-clip');  // of whoever was here before
      await start();
    } catch (error) {
      problem.textContent = error.status === 410 ? 'This link was used already. A link works once; ask for another one.'
        : error.status === 404 ? 'This link is not known here. Was it copied whole?' : error.message;
      button.disabled = false;
    }
  };
  const screen = show(make('form.sheet', {onsubmit: enter},
    make('h1', {}, 'Rate robot clips'),
    make('p', {}, 'You will watch short clips of a robot at work and say of each whether it did what it was told. You are not told where a clip comes from, and it does not matter: judge only what you see.'),
    make('ul', {},
      make('li', {}, 'Every answer is kept the moment you give it. You can stop at any time and go on later in this browser.'),
      make('li', {}, 'Stored are your answers, the name below if you give one, and how you watched: times, pauses, window size, and a hash of your browser’s name. No sound, no camera, no tracking.'),
      make('li', {}, 'You can leave the study at any time (Pause, then Leave) and decide whether your answers may be used. If you wish, your name, your notes and that hash are erased; the answers themselves stay stored, under a number.')),
    screenCheck(),
    make('label', {for: 'name'}, 'Name or nickname ', make('span.quiet', {}, '(may stay empty)')), name,
    make('label.check', {for: 'consent'}, consent, 'I have read this and take part of my own will.'),
    problem, make('.row', {}, button)));
  screen.className = 'centred';
}

const isByTouch = () => !matchMedia('(any-pointer: fine)').matches;

/** Is this a place where clips can be seen and keys reached? Said, never enforced. */
function screenCheck() {
  const hints = [];
  if (Math.min(innerWidth, innerHeight) < 600) hints.push('This is a small screen; a larger one shows more. It works here too, by touch.');
  if (isByTouch()) hints.push('No mouse or keyboard seems to be here. Every key has a button as well.');
  const video = document.createElement('video');
  if (!video.canPlayType('video/mp4; codecs="avc1.640028"')) hints.push('This browser may not play the clips (H.264). Chrome, Edge, Safari and Firefox do.');
  return hints.length ? make('.notice', {}, hints.map(hint => make('p', {}, hint))) : null;
}

function rubricCard(rubric) {
  return make('section.rubric', {}, make('h2', {}, rubric.instruction),
    make('p', {}, make('b', {}, 'Success: '), rubric.success || 'the task is done as the instruction says'),
    rubric.stages.length ? make('ol', {}, rubric.stages.map(stage => make('li', {}, make('b', {}, stage.name), stage.description ? ' — ' + stage.description : ''))) : null);
}

/** What the tasks are, with clips whose label is known. */
async function brief() {
  const examples = (await patiently(() => get('/api/examples'))).examples;
  const left = session.me.progress.practice_left;
  const screen = show(make('.sheet.wide', {},
    make('h1', {}, 'What to look for'),
    make('.rubrics', {}, session.me.rubrics.map(rubricCard)),
    examples.length ? make('section', {}, make('h2', {}, 'Examples'), make('.examples', {}, examples.map(example))) : null,
    make('section', {}, make('h2', {}, 'How'),
      make('p', {}, `Watch at least ${Math.round(100 * session.me.cover)} % of a clip and its end; then press `, make('kbd', {}, 'S'), ' success, ', make('kbd', {}, 'F'),
        ' failure or ', make('kbd', {}, 'U'), ' if it cannot be told. Digits mark the stages that were reached. ', make('kbd', {}, '?'), ' shows every key. ', make('kbd', {}, 'Z'), ' undoes.'),
      isByTouch() ? make('p', {}, 'By touch: tap Success, Failure or Can’t tell, and the stages that were reached. After a verdict Undo is there for some seconds.') : null),
    make('.row', {}, make('button.primary', {type: 'button', onclick: rate}, left ? `Practise on ${plural(left, 'clip')}` : 'Rate clips'))));
  screen.className = 'centred';
  $('.primary', screen).focus({preventScroll: true});
}

function example(one) {
  const box = make('figure.example', {});
  fetchClip(one.presentation).then(source => {
    const video = make('video', {controls: true, loop: true, playsinline: true, preload: 'metadata'});
    video.muted = true;
    video.src = source;
    box.prepend(video);
  }, () => {});
  box.append(make('figcaption', {}, make('b.' + one.label, {}, words[one.label]), make('span', {}, one.instruction), make('small.quiet', {}, one.reason)));
  return box;
}

/** After a practice clip: what is known of it. */
function feedback(clip, answer) {
  const known = answer.feedback;
  if (!known) return rate();
  const isRight = known.label === answer.verdict.label;
  const box = make('.feedback', {role: 'alert'}, make('h3', {}, isRight ? 'That is what we say too' : `We say: ${words[known.label]}`),
    known.reason ? make('p.quiet', {}, known.reason) : null,
    make('button.primary', {type: 'button', onclick: rate}, answer.progress.practice_left ? 'Next' : 'Practice is over: rate clips'));
  rating.answer.prepend(box);
  $('.primary', box).focus();
}

/** A break; the clip that is held, if one is, comes back with Go on. */
function pause() {
  rating.sinceBreak = 0;
  rating.breakAt = Date.now();
  const {total} = session.me.progress, left = Math.max(0, (rating.clip?.progress.total ?? total) - rating.done);
  const pace = rating.started && rating.done > rating.doneAtStart ? (Date.now() - rating.started) / 60e3 / (rating.done - rating.doneAtStart) : 0;
  const screen = show(make('.sheet', {}, make('h1', {}, 'A break'),
    make('p.big', {}, `${rating.done} of ${rating.clip?.progress.total ?? total} clips`),
    make('progress', {max: Math.max(1, rating.clip?.progress.total ?? total), value: rating.done}),
    pace ? make('p', {}, left ? `At today’s pace the rest takes about ${plural(Math.max(1, Math.round(pace * left)), 'minute')}.` : 'Only the end is left.') : null,
    make('p.quiet', {}, 'Look away from the screen for a while. Everything so far is kept; you may close the page and come back.'),
    make('.row', {}, make('button.primary', {type: 'button', onclick: rate}, 'Go on'), make('button', {type: 'button', onclick: brief}, 'Read the task again'),
      make('button', {type: 'button', onclick: leave}, 'Leave the study'))));
  screen.className = 'centred';
  $('.primary', screen).focus({preventScroll: true});
}

/** What is under way must not come over the menu; a clip that is over does not come back. */
function openMenu() {
  rating.turn++;
  if (!rating.player || rating.isOver) closeClip(); else hold();
  pause();
}

/** How much a rater is asked in all, as things are. */
const askedInAll = progress => progress.total + progress.practice_left;

/** The end for now, unless there is more since the server said so: clips that were added are given to who asks who they are. First the
    question about origins, then what was recorded. */
async function finished() {
  closeClip();
  const before = askedInAll(session.me.progress);
  const me = session.me = {...session.me, ...await patiently(() => get('/api/me'))};
  if (askedInAll(me.progress) > before) return rate();
  const {clips} = await patiently(() => get('/api/guesses'));
  if (clips.length) return guess(clips[0], clips.length);
  const screen = show(make('.sheet', {}, make('h1', {}, 'Thank you'),
    make('p.big', {}, `${plural(me.progress.done, 'clip')} rated`),
    make('p', {}, 'There is nothing left for you now. If clips are added later, the same page shows them.'),
    make('p.quiet', {}, `You are ${me.rater}${me.name ? ` (${me.name})` : ''} in the study ${me.study}.`),
    make('.row', {}, make('button', {type: 'button', onclick: download}, 'Download my data'), make('button', {type: 'button', onclick: openHistory}, 'Look at my answers'),
      make('button', {type: 'button', onclick: leave}, 'Leave the study'))));
  screen.className = 'centred done';
}

async function guess(clip, left) {
  const source = await patiently(() => fetchClip(clip.presentation));
  const video = make('video', {controls: true, autoplay: true, loop: true, playsinline: true});
  video.muted = true;
  video.src = source;
  const say = async answer => {
    await patiently(() => post('/api/guess', {presentation: clip.presentation, guess: answer}));
    URL.revokeObjectURL(source);
    finished();
  };
  const screen = show(make('.sheet.wide', {}, make('h1', {}, 'One last question'),
    make('p', {}, 'Some clips are recorded from a robot, others are generated by a computer. Which is this one? A guess is fine.'), make('.guessed', {}, video),
    make('.row', {}, make('button.primary', {type: 'button', 'data-guess': 'real', onclick: () => say('real')}, 'Recorded'),
      make('button.primary', {type: 'button', 'data-guess': 'generated', onclick: () => say('generated')}, 'Generated'),
      make('button', {type: 'button', 'data-guess': 'unsure', onclick: () => say('unsure')}, 'I cannot say')),
    make('p.quiet', {}, `${plural(left, 'clip')} to go`)));
  screen.className = 'centred';
}

async function download() {
  const data = await patiently(() => get('/api/mine'));
  const link = make('a', {href: URL.createObjectURL(new Blob([JSON.stringify(data, null, 1)], {type: 'application/json'})), download: `my-ratings-${data.rater}.json`});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const handover_s = 10;  // what waits longer than that for a line is not on its way

async function leave() {
  const erase = make('input', {type: 'checkbox', id: 'erase'});
  const choice = await ask('Leave the study',
    [make('p', {}, 'Your link and this session end now. May the answers you gave be used?'),
      make('p.quiet', {}, `Either way they stay stored under ${session.me.rater}, with how you watched: times, pauses, window size.`),
      make('label.check', {for: 'erase'}, erase, 'Erase my name, my notes and the hash of my browser’s name')],
    [['Stay', null], ['Leave, do not use my answers', 'exclude', 'bad'], ['Leave, my answers may be used', 'keep', 'primary']]);
  if (!choice) return;
  if (choice === 'keep' && await drain(handover_s)) return stay('You have not left', `${plural(outbox.waiting.length, 'answer')} of yours could not be sent, and would be lost.`);
  try {
    await post('/api/withdraw', {verdicts: choice, erase: erase.checked});  // once: nobody must leave later, while already going on
  } catch (error) {
    if (isNotOurs(error)) return location.reload();
    return stay('Leaving is not confirmed', error instanceof Offline ? 'The server gave no answer.' : error.message);
  }
  session.epoch = 0;
  closeClip();
  sessionStorage.removeItem('evac-clip');
  await emptyOutbox();
  show(make('.sheet', {}, make('h1', {}, 'You have left the study'),
    make('p', {}, choice === 'keep' ? 'Your answers stay in it.' : 'No result that is made from now on uses your answers; they stay stored, marked as not to be used.'),
    make('p', {}, erase.checked ? 'Your name, your notes and the hash of your browser’s name are erased from the study. Whoever runs it may have copies from before.' : ''))).className = 'centred done';
}

function stay(title, why) {
  return ask(title, [make('p', {}, `${why} What you rated is kept in this browser. Try again when the connection is back.`)], [['Close', null, 'primary']]);
}

async function openHistory() {
  rating.player?.video.pause();
  const {verdicts} = await patiently(() => get('/api/history'));
  const dialog = $('#dialog');
  const list = verdicts.length ? make('ul.history', {}, verdicts.map((verdict, k) => make('li', {},
    make('b.' + verdict.label, {}, words[verdict.label]), make('span.quiet', {}, new Date(verdict.created_ms).toLocaleTimeString()),
    verdict.note ? make('span', {}, verdict.note) : null,
    make('button', {type: 'button', 'aria-label': `Change answer ${verdicts.length - k}`, onclick: () => { dialog.close(); reopen(verdict); }}, 'Change')))) : make('p', {}, 'Nothing yet.');
  await ask('What you said, newest first', [list], [['Close', null, 'primary']]);
}

/** A clip that was rated, to say something else of it. */
async function reopen(verdict) {
  try {
    const clip = await patiently(() => post('/api/open', {tab_epoch: session.epoch, presentation: verdict.presentation}));
    const source = await patiently(() => fetchClip(verdict.presentation));
    rating.prefetched = null;
    rating.turn++;
    setAside();
    showClip(clip, source, Boolean(clip.verdict));  // undone meanwhile: it is asked as if for the first time
    rating.supersedes = clip.verdict?.id;
    refresh();
  } catch (error) {
    if (error instanceof Refusal && error.error === 'tab') return losePlace();
    toast(error.message);
  }
}
