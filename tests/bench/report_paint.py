#!/usr/bin/env python3
"""How long a report takes to show, in a real browser: report_paint.py INDEX.html (Debian's chromium and python3-websocket).

First paint, the page ready, the clip list filtered, and the longest pause between two frames while all clips scroll by.
EVAC_BENCH_PAGE=FILE build/release/bin/evac_bench --benchmark_filter=ReportOfARun/100000 writes the page of 10^5 episodes.
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "system" / "browser"))
from devtools import Browser  # noqa: E402

SCROLL = """new Promise(done => {
  const list = document.querySelector('#clips .browser') ?? document.scrollingElement, steps = 120, pauses = [];
  document.querySelector('#clips').scrollIntoView();
  let step = 0, last = performance.now();
  const next = now => {
    pauses.push(now - last);
    last = now;
    if (++step > steps) return done([Math.max(...pauses), pauses.sort((a, b) => a - b)[steps / 2]]);
    list.scrollTop = list.scrollHeight * step / steps;
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""
FILTER = """(() => {
  const field = document.querySelector('.filters [name=outcome]'), begin = performance.now();
  field.value = 'failure';
  field.dispatchEvent(new Event('input', {bubbles: true}));
  document.querySelector('.filters output').offsetHeight;
  return [performance.now() - begin, document.querySelector('.filters output').textContent];
})()"""


def main():
    browser = Browser()
    try:
        browser.look(1280, 800, "light")
        browser.open(pathlib.Path(sys.argv[1]).resolve().as_uri())
        paints = browser.js("performance.getEntriesByType('paint').map(entry => [entry.name, entry.startTime])")
        ready = browser.js("performance.getEntriesByType('navigation')[0].loadEventEnd")
        for name, at_ms in paints:
            print(f"{name}: {at_ms:.0f} ms")
        print(f"ready: {ready:.0f} ms")
        print("filter: {:.0f} ms, {}".format(*browser.js(FILTER)))
        browser.js("document.querySelector('.filters').reset()")
        print("scrolling through all clips: longest pause {:.0f} ms, median frame {:.0f} ms".format(*browser.js(SCROLL)))
    finally:
        browser.close()


if __name__ == "__main__":
    main()
