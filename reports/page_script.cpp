#include "reports/page_parts.h"

namespace evac {

namespace {

// Three things, none of which the page needs in order to be read: filters, videos in place, two videos in step.
constexpr const char* kScript = R"js(
"use strict";
const all = (selector, inside = document) => [...inside.querySelectorAll(selector)];

// Filters: a clip is shown when it has every chosen value; many are shown only when asked for.
const filters = document.querySelector(".filters");
if (filters) {
  const clips = all(".clip"), chosen = all("select", filters), output = filters.querySelector("output");
  const more = document.querySelector(".more"), first = 30;
  let everything = false;
  const apply = () => {
    let fit = 0;
    for (const clip of clips) {
      const fits = chosen.every(s => !s.value || clip.dataset[s.dataset.filter] === s.value);
      if (fits) ++fit;
      clip.hidden = !fits || (fit > first && !everything);
    }
    output.textContent = `${fit === clips.length ? "" : `${fit} of `}${clips.length} clip${clips.length === 1 ? "" : "s"}`;
    more.hidden = everything || fit <= first;
    more.textContent = `Show all ${fit}`;
  };
  filters.hidden = false;
  filters.addEventListener("change", apply);
  filters.addEventListener("everything", () => { everything = true; apply(); });
  more.addEventListener("click", () => filters.dispatchEvent(new Event("everything")));
  apply();
}

// A clip's picture becomes its video where it stands.
document.addEventListener("click", event => {
  const link = event.target.closest("a.play");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  const video = document.createElement("video"), image = link.querySelector("img");
  Object.assign(video, {controls: true, muted: true, loop: true, playsInline: true, src: link.href});
  video.setAttribute("aria-label", link.getAttribute("aria-label"));
  if (image) { video.poster = image.src; video.style.aspectRatio = image.style.aspectRatio; }
  link.replaceWith(video);
  video.play().catch(() => {});
});

// Two videos of one initial state: started together, kept together, begun again when both have ended.
for (const pair of all(".pair")) {
  const videos = all("video", pair), button = pair.querySelector("button");
  if (videos.length !== 2) continue;
  let together = false;
  const start = () => { for (const v of videos) v.currentTime = 0; return Promise.all(videos.map(v => v.play())); };
  const stop = () => {
    together = false;
    button.textContent = "Play both";
    for (const v of videos) { v.loop = true; v.pause(); }
  };
  button.hidden = false;
  button.addEventListener("click", () => {
    if (together) return stop();
    together = true;
    button.textContent = "Stop both";
    for (const v of videos) v.loop = false;
    start().catch(stop);
  });
  const [first, second] = videos;
  first.addEventListener("timeupdate", () => {
    if (together && !first.ended && !second.ended && Math.abs(first.currentTime - second.currentTime) > 0.15) second.currentTime = first.currentTime;
  });
  for (const v of videos) v.addEventListener("ended", () => { if (together && videos.every(w => w.ended)) start().catch(stop); });
}

// A link to a pair opens the details around it.
const reveal = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target || !target.matches(".pair, .clip")) return;
  for (let d = target.closest("details"); d; d = d.parentElement.closest("details")) d.open = true;
  if (target.hidden && filters) { filters.reset(); filters.dispatchEvent(new Event("everything")); }
  target.scrollIntoView({block: "center"});
};
addEventListener("hashchange", reveal);
reveal();
)js";

}  // namespace

std::string PageScript() { return kScript; }

}  // namespace evac
