// Nine pictures of a clip, first and last among them, and the bar under them.
const pictures = 9;

function filmstrip(player, source) {
  const strip = make('.film', {'aria-label': 'Filmstrip', role: 'group'});
  const times = [...Array(pictures).keys()].map(k => (Math.round(k * (player.clip.frames - 1) / (pictures - 1)) + 0.5) * player.period);
  const canvases = times.map((time, k) => {
    const canvas = make('canvas', {width: 160, height: Math.round(160 * session.me.height_px / session.me.width_px)});
    const name = k === 0 ? 'First frame' : k === pictures - 1 ? 'Last frame' : `Frame at ${time.toFixed(1)} seconds`;
    strip.append(make('button.still', {type: 'button', tabindex: '-1', 'aria-label': name, onclick: () => { player.video.pause(); player.seek(time); }}, canvas));
    return canvas;
  });
  draw(source, times, canvases, player);
  return strip;
}

/** A second, hidden video goes from picture to picture, so that the one that is rated is never disturbed. */
async function draw(source, times, canvases, player) {
  const video = make('video', {preload: 'auto', playsinline: true});
  video.muted = true;
  video.src = source;
  try {
    await new Promise((resolve, reject) => { video.onloadeddata = resolve; video.onerror = reject; });
    for (let k = 0; k < times.length && !player.isGone; ++k) {
      const seeked = new Promise(resolve => { video.onseeked = resolve; });
      video.currentTime = times[k];
      await seeked;
      canvases[k].getContext('2d').drawImage(video, 0, 0, canvases[k].width, canvases[k].height);
    }
  } catch (error) {  // the large video says so too
  }
  video.removeAttribute('src');
  video.load();
}

/** @returns the bar; bar.refresh() after every change. */
function scrubber(player) {
  const seconds = Math.floor(player.duration);
  const range = make('input', {type: 'range', min: 0, max: player.clip.frames - 1, step: 1, value: 0, 'aria-label': 'Time in the clip', tabindex: '-1'});
  range.addEventListener('input', () => { player.video.pause(); player.seek((Number(range.value) + 0.5) * player.period); });
  const seen = make('.seen', {'aria-hidden': 'true'});
  const ticks = make('.ticks', {'aria-hidden': 'true'}, [...Array(seconds).keys()].map(second => {
    const tick = make('i');
    tick.style.left = `${100 * (second + 1) / player.duration}%`;
    return tick;
  }));
  const bar = make('.scrub', {}, seen, ticks, range);
  bar.refresh = () => {
    const at = Math.min(player.clip.frames - 1, Math.floor(player.time / player.period + 0.01));
    if (document.activeElement !== range || !player.video.paused) range.value = at;
    range.setAttribute('aria-valuetext', `${player.time.toFixed(1)} of ${player.duration.toFixed(1)} seconds`);
    seen.style.background = runsOf(player.seen);
  };
  return bar;
}

/** What was seen, as stripes. */
function runsOf(seen) {
  const stops = [];
  for (let from = 0; from < seen.length;) {
    let to = from;
    while (to < seen.length && seen[to] === seen[from]) to++;
    const colour = seen[from] ? 'var(--seen)' : 'transparent';
    stops.push(`${colour} ${100 * from / seen.length}% ${100 * to / seen.length}%`);
    from = to;
  }
  return `linear-gradient(90deg, ${stops.join(', ')})`;
}
