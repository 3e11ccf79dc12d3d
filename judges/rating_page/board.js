// What the lead sees. Numbers never without what they rest on.
const percent = number => number.value === null ? '–' : `${(100 * number.value).toFixed(1)}\u00a0%`;
const decimal = number => number.value === null ? '–' : number.value.toFixed(3);
const range = number => number.low === undefined ? '' : `[${number.low.toFixed(2)}, ${number.high.toFixed(2)}]`;

async function board(from = 0) {
  const turn = board.turn = (board.turn || 0) + 1;
  let data;
  try {
    data = await patiently(() => get(`/api/board?from=${from}`));
  } finally {
    if (turn === board.turn) boardLater();
  }
  if (turn !== board.turn) return;  // another page of it was asked for meanwhile
  const isSamePage = board.from === from, putBack = placesOf();
  board.from = from;
  board.at = Date.now();
  drawBoard(data);
  putBack(isSamePage);
}

/** Every 15 seconds while somebody looks, and at once when somebody looks again. A refusal is said and tried again: a board that stands still looks like a study that does. */
const boardEvery_ms = 15000;
function boardLater() {
  clearTimeout(board.timer);
  board.timer = setTimeout(refreshBoard, boardEvery_ms);
}
async function refreshBoard() {
  if (document.visibilityState !== 'visible') return boardLater();
  try {
    await board(board.from);
    banner('board', '');
  } catch (error) {
    if (isNotOurs(error)) return location.reload();
    banner('board', `Not refreshed${board.at ? ` since ${new Date(board.at).toLocaleTimeString()}` : ''}: ${error.message}`);
  }
}
document.addEventListener('visibilitychange', () => { if (document.visibilityState === 'visible' && $('.board')) refreshBoard(); });

const clipsLabel = 'Clips and votes';

/** @returns what puts window, tables and focus back where they were before the board was drawn anew. */
function placesOf() {
  const left = scrollX, top = scrollY, focus = document.activeElement, name = focus && (focus.getAttribute('aria-label') || focus.textContent);
  const tables = [...document.querySelectorAll('.scroll')].map(table => ({label: table.getAttribute('aria-label'), left: table.scrollLeft, top: table.scrollTop}));
  const isOnBoard = Boolean(focus?.closest('.board'));
  return isSamePage => {
    for (const {label, left, top} of tables) $(`.scroll[aria-label="${label}"]`)?.scrollTo(left, isSamePage || label !== clipsLabel ? top : 0);
    window.scrollTo(left, top);
    const again = isOnBoard && [...document.querySelectorAll('.board .scroll, .board button')].find(one => (one.getAttribute('aria-label') || one.textContent) === name);
    if (again) (again.disabled ? again.closest('.scroll') : again).focus({preventScroll: true});
  };
}

function drawBoard(data) {
  const {progress} = data;
  const screen = show(make('.board', {},
    make('header', {}, make('h1', {}, data.study), make('p.quiet', {}, `${progress.complete} of ${plural(progress.clips, 'clip')} have ${plural(data.raters_per_clip, 'vote')}; ${progress.votes} votes, ${progress.missing} missing` +
      (progress.hours_left === null ? '' : `; ${progress.hours_left < 1 ? plural(Math.ceil(60 * progress.hours_left), 'minute') : progress.hours_left.toFixed(1) + ' h'} left at the pace of the last hour`) + (data.raters_excluded ? `; ${plural(data.raters_excluded, 'rater')} excluded` : ''))),
    ...notices(data),
    make('section.figures', {}, figure('Success', percent(data.all.majority), `majority of ${data.all.decided} decided clips`),
      figure('If undecided', `${percent(data.all.low)} … ${percent(data.all.high)}`, `${data.all.undecided} not decided`),
      figure('Alpha', decimal(data.agreement.alpha), `${range(data.agreement.alpha)} ${data.agreement.clips} clips with two votes; cannot tell is a third answer` +
        (data.agreement.dropped_replicates ? `; ${plural(data.agreement.dropped_replicates, 'replicate')} without any spread dropped` : '')),
      figure('Raw agreement', percent(data.agreement.agreement), `Fleiss kappa ${decimal(data.agreement.fleiss)}`),
      figure('Disputes', String(data.disputes.length), 'wait for an adjudicator')),
    make('section', {}, make('h2', {}, 'Raters'), ratersTable(data)),
    make('section', {}, make('h2', {}, 'Rates'), ratesTable(data)),
    make('section', {}, make('h2', {}, 'Clips'), matrix(data)),
    data.leases.length ? make('section', {}, make('h2', {}, 'Being rated now'), make('p', {}, data.leases.map(lease => `${lease.rater}: clip ${lease.clip}, ${Math.ceil(lease.left_s / 60)} min`).join(' · '))) : null));
  screen.className = 'wide-screen';
}

const figure = (name, value, under) => make('.figure', {}, make('span.quiet', {}, name), make('b', {}, value), make('small.quiet', {}, under));

function notices(data) {
  const lines = [];
  for (const rater of data.raters) for (const concern of rater.concerns) lines.push(`${rater.rater}${rater.name ? ` (${rater.name})` : ''}: ${concern}.`);
  for (const [world, index] of Object.entries(data.blinding))
    if (index.is_seen_through) lines.push(`Raters see which clips are ${world}: blinding index ${index.index.value.toFixed(2)} of ${plural(index.guesses, 'guess', 'guesses')}. Read comparisons of real and generated clips with care.`);
  if (data.all.far_apart) lines.push('Majority, soft, unanimous and Dawid–Skene rates differ by more than 3 points.');
  const byEpisode = Map.groupBy ? Map.groupBy(data.unplayable, one => one.episode) : new Map(data.unplayable.map(one => [one.episode, [one]]));
  for (const [episode, all] of byEpisode) lines.push(`${all.map(one => one.rater).join(', ')} could not play ${episode}: ${all[0].reason}.`);
  return lines.map(line => make('p.notice', {}, line));
}

function table(heads, rows, label) {
  return make('.scroll', {tabindex: '0', role: 'region', 'aria-label': label}, make('table', {}, make('thead', {}, make('tr', {}, heads.map(head => make('th', {scope: 'col'}, head)))),
    make('tbody', {}, rows.map(cells => make('tr', {}, cells.map((cell, k) => k === 0 ? make('th', {scope: 'row'}, cell) : make('td', {}, cell)))))));
}

function ratersTable(data) {
  return table(['Rater', 'Role', 'Status', 'Verdicts', 'Says success', 'Median', 'Known right', 'Same again'], data.raters.map(rater => [
    rater.rater + (rater.name ? ` ${rater.name}` : ''), rater.role, rater.status + (rater.counts ? '' : ', not counted'), String(rater.verdicts), rater.verdicts ? `${(100 * rater.success_share).toFixed(0)} %` : '–',
    rater.median_rt_s === null ? '–' : `${rater.median_rt_s.toFixed(1)} s`, rater.gold_seen ? `${rater.gold_right} of ${rater.gold_seen}` : '–', rater.repeats_seen ? `${rater.repeats_same} of ${rater.repeats_seen}` : '–']), 'Raters');
}

function ratesTable(data) {
  const hasRubrics = data.rates.some(rate => data.rates.some(other => other.task === rate.task && other.rubric !== rate.rubric));
  return table(['Task, world', 'Clips', 'Decided', 'Majority', 'Soft', 'Unanimous', 'Dawid–Skene', 'Bounds'], data.rates.map(rate => [
    `${rate.task}, ${rate.world}${hasRubrics ? `, rubric ${rate.rubric}` : ''}`, String(rate.clips), String(rate.decided), percent(rate.majority), percent(rate.soft), percent(rate.unanimous), percent(rate.dawid_skene), `${percent(rate.low)} … ${percent(rate.high)}`]), 'Rates');
}

/** Clips by the raters who saw them, a letter each; disputes first; a page at a time. */
function matrix(data) {
  const seen = new Set(data.clips.flatMap(clip => Object.keys(clip.votes)));
  const raters = data.raters.filter(rater => seen.has(rater.rater)).map(rater => rater.rater);
  const letters = {success: 'S', failure: 'F', cannot_tell: 'U'}, disputed = new Set(data.disputes);
  const rows = data.clips.map(clip => make('tr' + (disputed.has(clip.clip) ? '.disputed' : ''), {}, make('th', {scope: 'row'}, clip.episode, clip.use === 'gold' ? make('small.quiet', {}, ' known') : null),
    raters.map(rater => make('td.vote', {'data-vote': clip.votes[rater] || null}, letters[clip.votes[rater]] || '')),
    make('td', {}, clip.label ? words[clip.label] : '–'), make('td.quiet', {}, clip.how)));
  return make('.scroll', {tabindex: '0', role: 'region', 'aria-label': clipsLabel}, make('table.matrix', {}, make('thead', {}, make('tr', {}, make('th', {scope: 'col'}, 'Episode'), raters.map(rater => make('th', {scope: 'col'}, rater)), make('th', {scope: 'col'}, 'Label'), make('th', {scope: 'col'}, 'How'))), make('tbody', {}, rows)),
    pages(data));
}

/** Where the rows shown are among all of them, with ways to the others. */
function pages(data) {
  const all = data.progress.clips, first = data.clips_from, end = first + data.clips.length;
  if (first === 0 && end === all) return null;
  const to = (name, from, isThere) => make('button', {type: 'button', disabled: !isThere, onclick: () => board(from)}, name);
  board.rows = Math.max(board.rows || 1, data.clips.length);
  return make('.row', {}, to('Previous', Math.max(0, first - board.rows), first > 0), to('Next', end, end < all), make('span.quiet', {}, `${first + 1} … ${end} of ${all}, disputes first`));
}
