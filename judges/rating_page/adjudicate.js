// Where raters differ: first one's own look, then theirs, then the word that counts. Both are stored.
function unfold(answer, given) {
  if (!answer) return rate();
  const box = make('.feedback.others', {role: 'alert'}, make('h3', {}, `You: ${words[given.label]}. The raters:`),
    make('ul', {}, answer.others.map(other => make('li', {}, make('b.' + other.label, {}, words[other.label]), ` ${other.rater}`,
      other.stages.length ? make('small.quiet', {}, ` reached ${other.stages.map(k => rating.clip.rubric.stages[k]?.name || k + 1).join(', ')}`) : null,
      other.flags ? make('small.quiet', {}, ` ${other.flags.split(' ').map(named).join(', ')}`) : null,
      other.note ? make('q', {}, other.note) : null))),
    make('p', {}, 'Look again if you like; then decide.'),
    make('.verdicts', {role: 'group', 'aria-label': 'Decision'}, ['success', 'failure', 'cannot_tell'].map(label =>
      make(`button.decision.${label}`, {type: 'button', 'data-decision': label, onclick: () => settle(label, answer.verdict.id, given)},
        words[label] + (label === given.label ? ' (keep)' : '')))));
  $('.answer').prepend(box);
  $('.final').hidden = true;
  rating.isBusy = true;
  $(`[data-decision="${given.label}"]`, box).focus();
}

async function settle(label, first, given) {
  const {answered} = await send('/api/verdict', {...given, ...rating.player.record(), client_uuid: secret(), label, supersedes: first, is_final: true,
    stages: rating.stages, flags: [...rating.flags], cause: label === 'failure' ? rating.cause : '', note: rating.note, ...howSure(), coverage: 1});
  await answered.catch(() => {});
  speak('decided');
  rate();
}

function adjudicated() {
  closeClip();
  show(make('.sheet', {}, make('h1', {}, 'Nothing to decide'),
    make('p', {}, 'No clip with all its votes is split, unclear or against what is known of it. Come back when raters have gone on.'),
    make('.row', {}, make('button.primary', {type: 'button', onclick: rate}, 'Look again')))).className = 'centred done';
}
