// Who is here, and where they go.
async function start() {
  const invite = /^\/r\/([0-9a-f]{32})$/.exec(location.pathname);
  let me;
  try {
    me = await patiently(() => get('/api/me'));
  } catch (error) {
    if (error instanceof Refusal && (error.status === 401 || error.status === 403)) return invite ? join(invite[1]) : noInvitation();
    throw error;
  }
  session.me = me;
  session.csrf = me.csrf;
  if (invite && localStorage.getItem('evac-link') !== invite[1] && await isSomebodyNew(me)) return join(invite[1]);
  if (invite) history.replaceState(null, '', '/');
  document.title = `${me.study} · rating`;
  if (me.role === 'lead') return board();
  const isBusy = await isAnotherTabHere();
  if (isBusy) {
    const choice = await ask('Open in another tab', [make('p', {}, 'This study is open in another tab of this browser. Only one may write.')], [['Leave it there', false], ['Take over', true, 'primary']]);
    if (!choice) { session.epoch = -1; session.isOther = true; return show(make('.sheet', {}, make('h1', {}, 'Open in another tab'), make('p', {}, 'Go on there, or load this page again to take over.'))).className = 'centred'; }
  }
  await becomeTheTab();
  await loadOutbox(me.study_id, me.rater);  // not before: until then the other tab adds answers, and sends some
  await flush();
  rating.done = rating.doneAtStart = me.progress.done;
  rating.started = Date.now();
  const hasBegun = me.progress.done > 0 || sessionStorage.getItem('evac-clip');
  return me.role === 'adjudicator' || hasBegun ? rate() : brief();
}

window.addEventListener('unhandledrejection', event => {
  if (event.reason instanceof Offline) return;
  toast(`Something went wrong: ${event.reason?.message || event.reason}. Your answers are kept.`, {name: 'Reload', act: () => location.reload()}, 30);
});
window.addEventListener('beforeunload', event => { if (outbox.waiting.some(entry => entry.at === undefined)) event.preventDefault(); });
start();
