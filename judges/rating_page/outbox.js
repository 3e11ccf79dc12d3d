// Verdicts wait on disk (IndexedDB) until the server has said that they are on its disk; order is kept.
// Another study that was or is served at this address may have entries here too: they are left alone.
const outbox = {waiting: [], isSending: false, isStopped: false, database: null, reopening: null, listeners: []};

function openOutbox() {
  return new Promise(resolve => {
    if (!('indexedDB' in window)) return resolve(null);
    const asked = indexedDB.open('evac-rating', 1);
    asked.onupgradeneeded = () => asked.result.createObjectStore('outbox', {keyPath: 'at', autoIncrement: true});
    asked.onsuccess = () => { asked.result.onclose = reopenOutbox; resolve(asked.result); };
    asked.onerror = () => resolve(null);  // private windows: memory alone
  });
}

/** Fails where the browser has closed what was open: a tab that was in the background, site data that were cleared. */
function transact(mode, act) {
  return new Promise(resolve => {
    const transaction = outbox.database.transaction('outbox', mode);
    const asked = act(transaction.objectStore('outbox'));
    transaction.oncomplete = () => resolve(asked.result);
    transaction.onerror = transaction.onabort = () => resolve(null);
  });
}

/** @returns null if the disk has not done it, never a refusal: what waits is in memory as well. */
async function inOutbox(mode, act) {
  await outbox.reopening;
  if (!outbox.database) return null;
  try {
    return await transact(mode, act);
  } catch (error) {
    await reopenOutbox();
    return outbox.database ? transact(mode, act).catch(() => null) : null;
  }
}

/** What waits is on disk again after it, under the numbers that it had: nothing is there twice, and nobody else gets them. */
function reopenOutbox() {
  outbox.reopening ||= (async () => {
    outbox.database = await Promise.race([openOutbox().catch(() => null), sleep(3000)]) || null;
    for (const entry of [...outbox.waiting]) await keep(entry, transact);
    outbox.reopening = null;
  })();
  return outbox.reopening;
}

/** An entry with a number (`at`) is on disk; one without is in memory alone. */
async function keep(entry, within = inOutbox) {
  const {resolve, reject, answered, ...plain} = entry;
  const at = await within('readwrite', store => store.put(plain)).catch(() => null);
  if (at === null) delete entry.at; else entry.at = at;
}

/** Entries without a study are of a page that knew of one alone. */
async function loadOutbox(study, rater) {
  outbox.study = study;
  outbox.rater = rater;
  outbox.database = await openOutbox();
  const all = await inOutbox('readonly', store => store.getAll()) || [];
  outbox.waiting = all.filter(entry => entry.rater === rater && (entry.study ?? study) === study);
  sayUnsent();
}

/** Of a rater who has left: nobody will ever take it. */
async function emptyOutbox() {
  for (const entry of outbox.waiting.splice(0)) await forget(entry);
  sayUnsent();
}

async function forget(entry) {
  if (entry.at !== undefined) await inOutbox('readwrite', store => store.delete(entry.at));
}

/** @returns a promise of the server's answer; it may take as long as the line is down. */
async function send(path, body) {
  const entry = {path, body, study: outbox.study, rater: outbox.rater};
  entry.answered = new Promise((resolve, reject) => { entry.resolve = resolve; entry.reject = reject; });
  entry.answered.catch(() => {});
  await keep(entry);
  outbox.waiting.push(entry);
  sayUnsent();
  flush();
  return {answered: entry.answered};
}

const maySend = () => !session.isOther && !outbox.isStopped;

async function flush() {
  if (outbox.isSending || !maySend()) return;
  outbox.isSending = true;
  try {
    while (outbox.waiting.length && maySend()) await sendFirst(outbox.waiting[0]);
  } finally {
    outbox.isSending = false;
    sayUnsent();
  }
}

/** Gives what waits some time to go. @returns how much of it is left. */
async function drain(patience_s) {
  const end = Date.now() + 1000 * patience_s;
  flush();
  while (outbox.waiting.length && maySend() && (Date.now() < end || $('#dialog').open)) await sleep(100);  // a dialog asks what to do with one of them
  return outbox.waiting.length;
}

async function sendFirst(entry) {
  let answer = null, refusal = null;
  try {
    answer = await patiently(() => post(entry.path, {...entry.body, tab_epoch: session.epoch}));
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    if (error.error === 'tab') { losePlace(); return; }  // it stays: whoever takes over sends it
    if (isNotOurs(error)) { outbox.isStopped = true; location.reload(); return; }  // it stays until its rater is back
    refusal = error;
  }
  outbox.waiting.shift();
  await forget(entry);
  sayUnsent();
  if (answer) { entry.resolve?.(answer); return; }
  entry.reject?.(refusal);
  if (refusal.error === 'answered') await offerReplace(entry, refusal.body.verdict);
  else if (refusal.error === 'withdrawn') location.reload();
  else toast(`Not stored: ${refusal.message}`, null, 10);
}

/** This clip has another verdict of ours: keep that one, or replace it. */
async function offerReplace(entry, stored) {
  if (stored.label === entry.body.label) return;
  const choice = await ask('You rated this clip before',
    [make('p', {}, `Stored: ${words[stored.label]}. Now: ${words[entry.body.label]}.`)],
    [['Keep the stored one', false], ['Replace it', true, 'primary']]);
  if (choice) await send(entry.path, {...entry.body, client_uuid: secret(), supersedes: stored.id});
}

function sayUnsent() {
  const count = outbox.waiting.length, badge = $('#unsent');
  if (!badge) return;
  badge.hidden = count === 0;
  badge.textContent = `${count} unsent`;
}
window.addEventListener('online', flush);
