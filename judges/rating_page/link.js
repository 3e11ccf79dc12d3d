// What goes to the server and back. A tab that another one took over hears 409 "tab" and falls silent.
const session = {csrf: '', epoch: 0, me: null, isOther: false};

class Refusal extends Error {
  constructor(status, body) {
    super(body.message || body.error || `status ${status}`);
    this.status = status;
    this.error = body.error;
    this.body = body;
  }
}
class Offline extends Error {}

/** No word on what was asked: of a server that is in trouble, or of a proxy before it (520 is one's own). The same may be asked again. */
const isAway = status => status >= 500 || status === 408;

/** This browser is somebody else's by now, or the address another study's: loading the page again says whose. */
const isNotOurs = refusal => refusal instanceof Refusal && (refusal.status === 401 || refusal.error === 'csrf');

async function request(path, body) {
  const options = {method: body === undefined ? 'GET' : 'POST', credentials: 'same-origin', cache: 'no-store'};
  if (body !== undefined) {
    options.headers = {'Content-Type': 'application/json', 'X-Evac-Csrf': session.csrf};
    options.body = JSON.stringify(body);
  }
  let answer;
  try {
    answer = await fetch(path, options);
  } catch (error) {
    throw new Offline('no connection');
  }
  if (isAway(answer.status)) throw new Offline('the server is away');
  let json = {};
  try { json = await answer.json(); } catch (error) { if (answer.ok) throw new Offline('half an answer'); }
  if (answer.status === 429) { await sleep(1500); return request(path, body); }
  if (!answer.ok) throw new Refusal(answer.status, json);
  return json;
}
const get = path => request(path);
const post = (path, body = {}) => request(path, body);
const sleep = milliseconds => new Promise(resolve => setTimeout(resolve, milliseconds));

/** The same again until the line is back. */
async function patiently(act) {
  for (let wait = 500;; wait = Math.min(8000, wait * 1.6)) {
    try {
      const result = await act();
      banner('offline', '');
      return result;
    } catch (error) {
      if (!(error instanceof Offline)) { banner('offline', ''); throw error; }  // who refuses is there
      banner('offline', 'No connection to the server. What you rate is kept here and sent when it is back.');
      await sleep(wait);
    }
  }
}

async function takeTab() { session.epoch = (await patiently(() => post('/api/tab'))).tab_epoch; session.isOther = false; }

// Two tabs of one browser see each other at once; the server's epoch is what decides.
const channel = 'BroadcastChannel' in window ? new BroadcastChannel('evac-rating') : null;
const tabName = secret();
if (channel) channel.onmessage = event => {
  if (event.data.took && event.data.took !== tabName) losePlace();
  if (event.data.isAnybody && session.epoch && !session.isOther) channel.postMessage({here: tabName});
};

async function isAnotherTabHere() {
  if (!channel) return false;
  if (navigator.locks) {
    const held = await navigator.locks.request('evac-rating', {ifAvailable: true}, lock => {
      if (!lock) return true;
      navigator.locks.request('evac-rating', {steal: false}, () => new Promise(() => {}));  // for as long as this tab lives
      return false;
    });
    return held;
  }
  return new Promise(resolve => {
    const hear = event => { if (event.data.here) { channel.removeEventListener('message', hear); resolve(true); } };
    channel.addEventListener('message', hear);
    channel.postMessage({isAnybody: tabName});
    setTimeout(() => { channel.removeEventListener('message', hear); resolve(false); }, 250);
  });
}

async function becomeTheTab() {
  await takeTab();
  if (channel) channel.postMessage({took: tabName});
  banner('tab', '');
}

/** Another tab writes now: nothing plays here, nothing is sent from here. */
function losePlace() {
  if (session.isOther || !session.epoch) return;
  session.isOther = true;
  document.querySelectorAll('video').forEach(video => video.pause());
  document.body.classList.add('readonly');
  banner('tab', 'This study is open in another tab. Nothing can be changed here.',
    {name: 'Take over', act: () => location.reload()});
}
