// Where raters differ: first one's own look, then theirs, then the word that counts. Both are stored.
// Who was interrupted between the two comes back to the second: the server has the first and takes no other.
function unfold(clip, verdict, others) {
  const box = make('.feedback.others', {role: 'alert', tabindex: '-1'}, make('h3', {}, `You: ${words[verdict.label]}. The raters:`),
    make('ul', {}, others.map(other => make('li', {}, make('b.' + other.label, {}, words[other.label]), ` ${other.rater}`,
      other.stages.length ? make('small.quiet', {}, ` reached ${other.stages.map(k => clip.rubric.stages[k]?.name || k + 1).join(', ')}`) : null,
      other.flags ? make('small.quiet', {}, ` ${other.flags.split(' ').map(named).join(', ')}`) : null,
      other.note ? make('q', {}, other.note) : null))),
    make('p', {}, 'Look again if you like; then decide.'),
    make('.verdicts', {role: 'group', 'aria-label': 'Decision'}, ['success', 'failure', 'cannot_tell'].map(label =>
      make(`button.decision.${label}${label === verdict.label ? '.kept' : ''}`, {type: 'button', 'data-decision': label, onclick: () => settle(clip, label, verdict.id)},
        make('kbd', {}, {success: 'S', failure: 'F', cannot_tell: 'U'}[label]), words[label] + (label === verdict.label ? ' (keep)' : '')))));
  rating.answer.prepend(box);
  $('.final', rating.answer).hidden = true;
  rating.isBusy = true;
  rating.unfoldedAt = Date.now();
  refresh();
  box.focus();  // Tab leads to the decisions: on one of them, the next Enter or Space would be the last word
}

/** By key: the verdict, or where the others' are unfolded the decision. */
function word(label) {
  const decision = $(`[data-decision="${label}"]`);
  if (!decision) return decide(label);
  decision.click();
}

/** However it was given, what comes at once is no decision: nobody has read yet, a key or a button was struck twice. */
async function settle(clip, label, first) {
  if (session.isOther || !(Date.now() - rating.unfoldedAt > 800)) return;
  document.querySelectorAll('.decision').forEach(button => { button.disabled = true; });  // a second click is no second decision
  const {answered} = await send('/api/verdict', {client_uuid: secret(), presentation: clip.presentation, ...said(label), ...rating.player.record(),
    supersedes: first, is_final: true});
  sessionStorage.removeItem('evac-clip');
  const isStored = await answered.then(() => true, () => false);
  if (isStored) speak('decided');
  if (rating.clip === clip) moveOn();
}

function adjudicated() {
  closeClip();
  show(make('.sheet', {}, make('h1', {}, 'Nothing to decide'),
    make('p', {}, 'No clip with all its votes is split, unclear or against what is known of it. Come back when raters have gone on.'),
    make('.row', {}, make('button.primary', {type: 'button', onclick: rate}, 'Look again')))).className = 'centred done';
}
