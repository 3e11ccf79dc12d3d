// Every key has one meaning; none has any while somebody writes. Two maps: keys for the left and for the right hand.
const keyHelp = [  // [keys, meaning, the right hand's]
  ['Space', 'play, pause'], ['J  L', 'one second back, on'], [',  .', 'one frame back, on'], ['Home  End', 'first, last frame'],
  ['[  ]', 'slower, faster'], ['R', 'again from the start', 'O'], ['A', 'loop the last two seconds', 'P'],
  ['S  F  U', 'success, failure, cannot tell; an adjudicator’s decision too', 'K  ;  U'], ['1 … 9', 'stage reached', '6 … 0  -'],
  ['Shift+1 … 9  V', 'one view alone, all views', 'Shift+6 … 0  M'], ['X, then 1 … 6', 'flags', 'Y, then 6 … 0 and -'],
  ['B, then 1 … 7', 'why it fails', 'B, then 6 … 0 and -'],
  ['C', 'how sure: sure, fairly, a guess', 'I'], ['N', 'note (Esc leaves it)'], ['Z', 'undo the last verdict', 'Backspace'], ['H', 'what you said'], ['?', 'this help, and the task'],
];
/** What the left hand's keys are to the right hand: keys beside each other, none used twice. The others are there already. */
const rightHand = {K: 'S', ';': 'F', O: 'R', P: 'A', M: 'V', Y: 'X', I: 'C', Backspace: 'Z'};
const rightDigits = ['Digit6', 'Digit7', 'Digit8', 'Digit9', 'Digit0', 'Minus'];
const isRightHanded = () => localStorage.getItem('evac-keys') === 'right';

/** The key of the k-th stage, flag or view; null where there is none. */
const digitKey = k => isRightHanded() ? ['6', '7', '8', '9', '0', '-'][k] || null : k < 9 ? String(k + 1) : null;
const digitCap = k => make('kbd', {'data-digit': k, hidden: !digitKey(k)}, digitKey(k));
function capDigits() {
  document.querySelectorAll('[data-digit]').forEach(cap => cap.replaceWith(digitCap(Number(cap.dataset.digit))));
}

/** Which stage, flag or view a key stands for, from 0; -1: none. To the right hand the keypad has the digits that buttons show, and no others. */
function digitOf(code) {
  if (isRightHanded()) {
    const right = rightDigits.indexOf(code.replace('NumpadSubtract', 'Minus').replace('Numpad', 'Digit'));
    if (right >= 0 || code.startsWith('Numpad')) return right;
  }
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(code);
  return digit ? Number(digit[1]) - 1 : -1;
}

function openHelp() {
  rating.player?.video.pause();
  const hand = make('input', {type: 'checkbox', id: 'hand'});
  hand.checked = isRightHanded();
  const keys = make('dl.keys', {});
  const list = () => keys.replaceChildren(...keyHelp.map(([key, meaning, right]) => make('div', {},
    make('dt', {}, (isRightHanded() && right || key).split('  ').map(one => make('kbd', {}, one))), make('dd', {}, meaning))));
  list();
  hand.addEventListener('change', () => { localStorage.setItem('evac-keys', hand.checked ? 'right' : 'left'); list(); capDigits(); });
  const clip = rating.clip;
  ask('Keys', [keys, make('label.check', {for: 'hand'}, hand, 'Keys for the right hand'),
    clip ? rubricCard(clip.rubric) : null].filter(Boolean), [['Close', null, 'primary']]);
}

/** However they were opened, by key or by mouse: what is open is what digits mean. One of them is open at a time (column). */
function openChips(name, of) {
  const box = $('.' + name);
  box.open = !box.open;
  if (box.open) document.querySelectorAll('.flags, .causes').forEach(other => { other.open = other === box; });
  const last = of.findLastIndex((one, k) => digitKey(k));
  speak(box.open ? `${name}: ${digitKey(0)} to ${digitKey(last)}` : `${name} closed`);
}

function openNote() {
  const box = $('.noted');
  box.open = true;
  $('textarea', box).focus();
}

const acts = {
  ' ': player => player.toggle(), J: player => player.seek(player.time - 1), L: player => player.seek(player.time + 1),
  ',': player => player.step(-1), '.': player => player.step(1), Home: player => player.seek(0), End: player => player.seek(player.duration),
  '[': player => player.faster(-1), ']': player => player.faster(1), R: player => player.replay(), A: player => player.loopEnd(),
  V: player => player.isolate(-1), X: () => openChips('flags', session.me.flags), B: () => openChips('causes', session.me.causes), C: nextConfidence, N: openNote, H: openHistory,
  S: () => word('success'), F: () => word('failure'), U: () => word('cannot_tell'),
};

/** Many keyboards have [ and ] with AltGr (for Windows that is Ctrl and Alt) or Option alone, often on a digit. */
const isBracketByAlt = event => (event.key === '[' || event.key === ']') && !event.metaKey && (event.altKey || event.getModifierState('AltGraph'));

/** A button that was clicked lets go of the keys: Space plays, and Enter does not press it again. Who came by Tab (no detail) stays on it. */
document.addEventListener('click', event => {
  if (event.detail > 0) event.target.closest('.rate button, .rate summary')?.blur();
}, true);

document.addEventListener('keydown', event => {
  const isPlain = !event.ctrlKey && !event.metaKey && !event.altKey;
  if (!(isPlain || isBracketByAlt(event)) || event.isComposing || $('#dialog').open) return;
  const target = event.target;
  if (target.matches('textarea, input[type=text]')) {
    if (event.key === 'Escape') { target.blur(); event.preventDefault(); }
    return;
  }
  if (!$('.rate')) return;
  if (!onRateScreen(event)) return;
  event.preventDefault();
});

/** @returns whether the key was ours. */
function onRateScreen(event) {
  const player = rating.player;
  if (!player) return false;
  const isButton = event.target.matches('button, summary') && (event.key === ' ' || event.key === 'Enter');
  if (isButton) return false;
  const code = isBracketByAlt(event) ? '' : event.code;
  const digit = digitOf(code);
  if (digit >= 0) return onDigit(digit, event.shiftKey, player), true;
  if (event.key === '?') return openHelp(), true;
  let key = event.key.length === 1 ? event.key.toUpperCase() : event.key;
  if (isRightHanded() && rightHand[key]) key = rightHand[key];
  if (key === 'Z') return undo(), true;
  const act = acts[key];
  if (!act || (event.repeat && 'SFUXBCNHRA'.includes(key))) return false;
  if (session.isOther) return true;
  act(player);
  return true;
}

function onDigit(k, isShifted, player) {
  if (isShifted) return k < player.clip.views.length ? player.isolate(k) : undefined;
  if ($('.flags').open) return session.me.flags[k] && toggleFlag(session.me.flags[k]);
  if ($('.causes').open) return session.me.causes[k] && setCause(session.me.causes[k]);
  toggleStage(k);
}
