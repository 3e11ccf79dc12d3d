// One initial state, its videos of all worlds side by side under one play button and one scrubber.

// Keeps videos together: whichever is ahead waits until the others are there too.
const TOGETHER_S = 0.04;
class Transport {
  constructor(videos, onTime) {
    this.videos = videos;
    this.onTime = onTime;
    this.playing = false;
    this.speed = 1;
    this.loop = true;
    this.frame = requestAnimationFrame(() => this.follow());
  }
  end() { cancelAnimationFrame(this.frame); this.pause(); for (const v of this.videos) { v.removeAttribute("src"); v.load(); } }
  length(v) { return Number.isFinite(v.duration) ? v.duration : 0; }
  get leader() { return this.videos.reduce((a, b) => this.length(b) > this.length(a) ? b : a); }
  get duration() { return this.videos.length ? this.length(this.leader) : 0; }
  get time() { return this.videos.length ? this.leader.currentTime : 0; }

  play() {
    this.playing = true;
    if (this.time >= this.duration - 0.02) this.seek(0);
    for (const v of this.videos) if (v.currentTime < this.length(v) - 0.02) v.play().catch(() => {});
  }
  pause() {
    this.playing = false;
    for (const v of this.videos) v.pause();
    if (this.videos.length) this.seek(this.time);
  }
  seek(time) {
    const to = Math.min(Math.max(time, 0), this.duration);
    for (const v of this.videos) v.currentTime = Math.min(to, this.length(v));
  }
  setSpeed(speed) { this.speed = speed; for (const v of this.videos) v.playbackRate = speed; }

  follow() {
    this.frame = requestAnimationFrame(() => this.follow());
    if (!this.videos.length) return;
    if (this.playing) this.keepTogether();
    this.onTime(this.time, this.duration, this.playing);
  }
  keepTogether() {
    const running = this.videos.filter(v => v.currentTime < this.length(v) - 0.02 && !v.ended);
    if (!running.length) { if (this.loop && this.duration) this.play(); else this.pause(); return; }
    const last = Math.min(...running.map(v => v.currentTime));
    for (const v of running) {
      const ahead = v.currentTime - last;
      if (ahead > TOGETHER_S && !v.paused) v.pause();
      if (ahead < TOGETHER_S / 2 && v.paused) v.play().catch(() => {});
    }
  }
}

// Eight frames of a video, drawn one after the other by a second, unseen player; a click goes there.
const FRAMES = 8;
const filmstrip = (link, seek) => {
  const cells = Array.from({length: FRAMES}, () => element("canvas", {width: 96, height: 48}));
  const strip = element("div", {className: "film", ariaHidden: "true"}, ...cells);
  const player = element("video", {muted: true, preload: "auto", src: link});
  let next = 0;
  const timeOf = k => (k + 0.5) / FRAMES * player.duration;
  player.addEventListener("loadedmetadata", () => {
    for (const cell of cells) cell.height = Math.round(96 * player.videoHeight / player.videoWidth);
    player.currentTime = timeOf(0);
  });
  player.addEventListener("seeked", () => {
    if (!strip.isConnected && next > 0) return;
    const cell = cells[next];
    cell.getContext("2d").drawImage(player, 0, 0, cell.width, cell.height);
    if (++next < FRAMES) player.currentTime = timeOf(next); else { player.removeAttribute("src"); player.load(); }
  });
  strip.addEventListener("click", event => {
    const k = cells.indexOf(event.target);
    if (k >= 0) seek(k / FRAMES);
  });
  return strip;
};

const stagesOf = i => {
  const reached = run.stages.of(i), names = run.taskOf(i).stages;
  if (!reached) return null;
  return element("ul", {className: "stages"}, ...names.map((name, k) =>
      element("li", {className: reached[k] === "1" ? "yes" : "no"}, `${name} `,
          element("span", {ariaLabel: reached[k] === "1" ? "reached" : "not reached"}, reached[k] === "1" ? "✓" : "✗"))));
};

const otherVerdicts = i => run.judges.filter(judge => judge.label.of(i)).map(judge =>
    element("p", {className: "quiet"}, `${judge.name}: `, outcomeBadge(judge.label.of(i)), judge.reason.of(i) && ` ${judge.reason.of(i)}`));

const viewer = (() => {
  const title = element("h2"), worlds = element("div", {className: "screens"});
  const play = element("button", {type: "button", className: "playing"}, "Play");
  const scrub = element("input", {type: "range", min: "0", max: "1000", value: "0", ariaLabel: "Time in all videos"});
  const clock = element("output", {className: "clock"}, "0.0 s");
  const speed = element("select", {ariaLabel: "Speed"}, ...["0.25", "0.5", "1", "2"].map(s => element("option", {value: s, selected: s === "1"}, `${s}×`)));
  const repeat = element("label", {}, element("input", {type: "checkbox", checked: true}), " repeat");
  const button = (text, label, act) => { const made = element("button", {type: "button", ariaLabel: label, title: label}, text); made.addEventListener("click", act); return made; };
  const dialog = element("dialog", {className: "viewer"});
  const link = element("a", {className: "permalink"}, "link to this");
  let transport = null, current = -1, step = index => index, scrubbing = false;

  const stepBy = by => { const to = step(current, by); if (to >= 0 && to !== current) open(to); };
  const toggle = () => { if (transport.playing) transport.pause(); else transport.play(); };
  const frame = by => { transport.pause(); transport.seek(transport.time + by * run.taskOf(current).period_s); };
  const close = () => dialog.close();
  dialog.append(
      element("header", {}, title, element("p", {className: "tools"}, link, button("‹ prev", "Previous clip (k)", () => stepBy(-1)), button("next ›", "Next clip (j)", () => stepBy(1)), button("✕", "Close (Esc)", close))),
      worlds,
      element("div", {className: "transport"}, play, button("‹", "One frame back (←)", () => frame(-1)), scrub, button("›", "One frame on (→)", () => frame(1)), clock, speed, repeat));
  document.body.append(dialog);

  play.addEventListener("click", toggle);
  scrub.addEventListener("input", () => { transport.seek(scrub.value / 1000 * transport.duration); });
  scrub.addEventListener("pointerdown", () => { scrubbing = true; });
  scrub.addEventListener("pointerup", () => { scrubbing = false; });
  speed.addEventListener("change", () => transport.setSpeed(Number(speed.value)));
  one("input", repeat).addEventListener("change", event => { transport.loop = event.target.checked; });
  dialog.addEventListener("click", event => { if (event.target === dialog) close(); });
  dialog.addEventListener("close", () => {
    transport?.end();
    transport = null;
    worlds.replaceChildren();
    if (location.hash.startsWith("#clip-")) history.replaceState(null, "", "#clips");
  });
  dialog.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target === speed) return;
    const acts = {" ": toggle, ArrowLeft: () => frame(-1), ArrowRight: () => frame(1), j: () => stepBy(1), k: () => stepBy(-1)};
    if (event.key === " " && event.target.closest("button, a, input[type=checkbox]")) return;
    if (acts[event.key]) { event.preventDefault(); acts[event.key](); }
  });

  const screen = (i, chosen) => {
    const path = run.video(i), ratio = run.taskOf(i).ratio;
    const label = `Video of ${run.id(i)}`;
    let video = null, picture = element("p", {className: "novideo"}, "no video");
    if (path) {
      picture = video = element("video", {muted: true, playsInline: true, preload: "auto", src: path, ariaLabel: label});
      video.poster = run.thumbnail(i);
      video.style.aspectRatio = ratio;
      video.addEventListener("error", () => { if (video.getAttribute("src")) video.replaceWith(element("p", {className: "novideo"}, `The video cannot be played: ${path}`)); });
    }
    const reason = run.reason.of(i), end = run.end.of(i);
    const figure = element("figure", {className: chosen ? "chosen" : ""}, picture,
        path ? filmstrip(path, share => { transport.pause(); transport.seek(share * transport.length(video)); }) : "",
        element("figcaption", {}, element("p", {}, element("b", {}, run.world.of(i)), " ", outcomeBadge(run.outcome.of(i))),
            stagesOf(i), reason && element("p", {}, reason), ...otherVerdicts(i),
            element("p", {className: "quiet"}, `Stopped: ${run.stop.of(i)}${end ? `, ${end}` : ""}`)));
    return {figure, video};
  };

  const open = i => {
    transport?.end();
    current = i;
    const screens = run.together(i).map(k => screen(k, k === i));
    title.textContent = `${run.task.of(i)} · ${run.policy.of(i)} · ${run.state.of(i)} · seed ${run.seed.of(i)}`;
    link.href = "#" + anchorOf(i);
    worlds.replaceChildren(...screens.map(s => s.figure));
    worlds.dataset.worlds = screens.length;
    transport = new Transport(screens.map(s => s.video).filter(Boolean), (time, duration, playing) => {
      clock.textContent = `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
      play.textContent = playing ? "Pause" : screens.length > 1 ? "Play all" : "Play";
      if (!scrubbing) scrub.value = duration ? time / duration * 1000 : 0;
    });
    transport.setSpeed(Number(speed.value));
    transport.loop = one("input", repeat).checked;
    if (location.hash !== link.hash) history.replaceState(null, "", link.hash);
    if (!dialog.open) { dialog.showModal(); play.focus(); }
  };
  // `next(i, by)`: which clip follows i in the list that the viewer was opened from.
  return {open: (i, next = (k => k)) => { step = next; open(i); }, get transport() { return transport; }};
})();
