// One clip on the screen, and the record of what of it was really seen.
const speeds = [0.25, 0.5, 1, 1.5, 2, 3, 4];
const sticky = {speed: Number(localStorage.getItem('evac-speed')) || 1};
if (!speeds.includes(sticky.speed)) sticky.speed = 1;

/** The clip's bytes, kept as a whole: it plays, scrubs and steps without the network. */
async function fetchClip(presentation) {
  const answer = await fetch('/clip/' + presentation, {credentials: 'same-origin', cache: 'no-store'}).catch(() => { throw new Offline('no connection'); });
  if (isAway(answer.status) || answer.status === 429) throw new Offline('the server is away');
  if (!answer.ok) throw new Refusal(answer.status, {error: 'clip', message: 'the clip cannot be loaded'});
  return URL.createObjectURL(await answer.blob().catch(() => { throw new Offline('half a clip'); }));
}

class Player {
  /** @param clip  as /api/next describes it. @param changed  called whenever coverage or time have changed. */
  constructor(clip, source, changed, failed) {
    this.clip = clip;
    this.period = clip.period_s;
    this.duration = clip.frames * clip.period_s;
    this.seen = new Uint8Array(clip.frames);
    this.changed = changed;
    this.watch = {shown_at_ms: performance.now(), first_play_ms: 0, visible_ms: 0, played: [], seeks: 0, replays: 0, pauses: 0,
      stalls_ms: 0, speeds: [], max_speed: 0, interrupted: false};
    this.rested_ms = 0;
    this.view = -1;
    this.last = null;
    this.video = make('video', {playsinline: true, preload: 'auto', disablepictureinpicture: true, tabindex: '-1',
      'aria-label': 'The clip to rate'});
    this.video.muted = true;
    this.video.defaultPlaybackRate = this.video.playbackRate = sticky.speed;
    this.frame = make('.frame', {}, this.video);
    this.listen(failed);
    this.video.src = source;
  }

  listen(failed) {
    const video = this.video;
    video.addEventListener('error', () => failed(video.error ? `media error ${video.error.code}` : 'media error'));
    video.addEventListener('play', () => { this.watch.first_play_ms ||= performance.now(); this.from = video.currentTime; this.isRunning = true; if (!video.seeking) this.last = this.frameAt(video.currentTime); this.changed(); });
    video.addEventListener('pause', () => {
      if (!video.seeking && this.last !== null) this.saw(video.currentTime - this.period / 2);
      this.isRunning = false;
      if (!video.ended && !this.isQuiet) this.watch.pauses++;
      this.endInterval();
      this.changed();
    });
    video.addEventListener('seeking', () => { this.endInterval(); this.last = null; });
    video.addEventListener('seeked', () => { this.from = video.currentTime; this.saw(video.currentTime); });
    video.addEventListener('waiting', () => { this.stalledAt = performance.now(); });
    video.addEventListener('playing', () => { if (this.stalledAt) this.watch.stalls_ms += performance.now() - this.stalledAt; this.stalledAt = 0; });
    video.addEventListener('ended', () => { this.isRunning = true; this.saw(this.duration - this.period / 2); this.isRunning = false; this.endInterval(); if (this.loop) this.loopAgain(); this.changed(); });
    if (video.requestVideoFrameCallback) {
      const step = (now, data) => { this.saw(data.mediaTime); this.callback = video.requestVideoFrameCallback(step); };
      this.callback = video.requestVideoFrameCallback(step);
    } else {
      const step = () => { if (!this.isGone) { if (!video.paused) this.saw(video.currentTime); requestAnimationFrame(step); } };
      requestAnimationFrame(step);
    }
    this.clock = setInterval(() => {
      if (document.visibilityState === 'visible' && !this.restsSince) this.watch.visible_ms += 250;
      if (!video.paused) this.watch.speeds.push(video.playbackRate);
      if (this.loop && !video.paused && video.currentTime >= this.duration - this.period) this.loopAgain();
    }, 250);
  }

  /** A frame was on the screen. (A video calls itself paused before its last frames are told of, hence isRunning.) While it plays, what lies between two of them counts as well; while one scrubs, not. */
  saw(time) {
    if (document.visibilityState !== 'visible') { this.last = null; return; }
    const at = this.frameAt(time), isPlaying = this.isRunning && !this.video.seeking;
    const from = isPlaying && this.last !== null && at >= this.last ? this.last : at;
    this.seen.fill(1, from, at + 1);
    this.last = at;
    if (isPlaying) this.watch.max_speed = Math.max(this.watch.max_speed, this.video.playbackRate);
    this.changed();
  }

  /** What was seen before the page was loaded anew, as zeros and ones. */
  resume(seen) { [...seen].slice(0, this.clip.frames).forEach((one, k) => { if (one === '1') this.seen[k] = 1; }); }
  get sawEnd() { return this.seen.subarray(-Math.max(1, Math.round(1 / this.period))).every(Boolean); }

  frameAt(time) { return Math.max(0, Math.min(this.clip.frames - 1, Math.floor(time / this.period + 0.01))); }

  endInterval() {
    if (this.from === undefined) return;
    const to = this.video.currentTime;
    if (to > this.from && this.watch.played.length < 900) this.watch.played.push([round(this.from), round(to)]);
    this.from = undefined;
  }

  get coverage() { return this.seen.reduce((sum, one) => sum + one, 0) / this.clip.frames; }
  get time() { return this.video.currentTime; }
  isCovered(share) { return this.coverage >= share - 1e-9 && this.sawEnd; }

  /** What is stored beside the verdict. */
  record() {
    this.endInterval();
    const {speeds: all, ...watch} = this.watch;
    const sorted = [...all].sort((a, b) => a - b), now = performance.now();
    return {...watch, decided_ms: now, rt_ms: now - watch.shown_at_ms - this.rested_ms, coverage: this.coverage,
      median_speed: sorted.length ? sorted[sorted.length >> 1] : 0,
      viewport: `${Math.min(99999, innerWidth)}x${Math.min(99999, innerHeight)}`, pixel_ratio: devicePixelRatio || 1};
  }

  async play() { try { await this.video.play(); } catch (error) { this.changed(); } }
  toggle() { if (this.video.paused) { if (this.time >= this.duration - this.period / 2) this.video.currentTime = 0; this.play(); } else this.video.pause(); }
  seek(time) { this.watch.seeks++; this.loop = false; this.video.currentTime = Math.max(0, Math.min(this.duration - this.period / 2, time)); this.changed(); }
  step(frames) { this.video.pause(); this.seek((Math.round((this.time - this.period / 2) / this.period) + frames + 0.5) * this.period); }
  replay() { this.watch.replays++; this.loop = false; this.video.currentTime = 0; this.play(); }
  loopEnd() { this.loop = !this.loop; if (this.loop) { this.watch.replays++; this.loopAgain(); } this.changed(); }
  loopAgain() { this.video.currentTime = Math.max(0, this.duration - 2); this.play(); }
  faster(steps) {
    const at = Math.max(0, Math.min(speeds.length - 1, speeds.indexOf(sticky.speed) + steps));
    sticky.speed = speeds[at];
    localStorage.setItem('evac-speed', sticky.speed);
    this.video.playbackRate = sticky.speed;
    speak(`speed ${sticky.speed}`);
    this.changed();
  }

  /** One view alone, as large as the place allows; -1: all of them. */
  isolate(index) {
    const view = this.clip.views[index];
    this.view = view ? index : -1;
    const {width, height} = {width: session.me.width_px, height: session.me.height_px};
    const place = view || {x: 0, y: 0, width: 1, height: 1};
    this.frame.style.setProperty('--ratio', (width * place.width) / (height * place.height));
    Object.assign(this.video.style, {width: `${100 / place.width}%`, height: `${100 / place.height}%`,
      left: `${-100 * place.x / place.width}%`, top: `${-100 * place.y / place.height}%`});
    if (view) speak(`view ${view.name}`);
    this.changed();
  }

  /** From rest() to back() nobody looks: it is no time that the verdict took. */
  rest() { this.video.pause(); this.restsSince ||= performance.now(); }
  back() { if (this.restsSince) this.rested_ms += performance.now() - this.restsSince; this.restsSince = 0; }

  close() {
    this.isGone = true;
    this.isQuiet = true;
    clearInterval(this.clock);
    if (this.callback && this.video.cancelVideoFrameCallback) this.video.cancelVideoFrameCallback(this.callback);
    this.video.pause();
    this.video.removeAttribute('src');
    this.video.load();
  }
}
const round = number => Math.round(number * 1000) / 1000;
