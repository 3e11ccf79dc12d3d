#!/usr/bin/env python3
"""Reads a report as people do, in a real browser: report_page.py INDEX.html [FOLDER_FOR_SCREENSHOTS].

Prints "ok: …" for what holds and "failed: …" for what does not; exit code 1 if anything failed, 77 without a browser.
"""
import pathlib
import sys
import time

from devtools import Browser, check, failures

SIZES = [(320, 640), (390, 844), (1280, 800), (2200, 1200)]


def choose(browser, name, value):
    browser.js(f"""(() => {{ const field = document.querySelector('.filters [name={name}]');
        if (field.type === 'checkbox') field.checked = {'true' if value else 'false'}; else field.value = {value!r};
        field.dispatchEvent(new Event('input', {{bubbles: true}})); }})()""")


def shown(browser):
    return browser.js("document.querySelector('.filters output').textContent")


def filters(browser):
    total = browser.js("run.count")
    check(shown(browser).startswith(f"{total} clip"), "the browser starts with every clip", shown(browser))
    world = browser.js("run.world.values[0]")
    choose(browser, "world", world)
    of_world = browser.js(f"[...run.world.rows].filter(w => w === 0).length")
    check(shown(browser) == f"{of_world} of {total} clips", "a filter leaves the clips that fit", shown(browser))
    choose(browser, "outcome", "failure")
    reason = browser.js("run.reason.clause(Array.from({length: run.count}, (_, i) => i).find(i => run.world.rows[i] === 0 "
                        "&& run.outcome.of(i) === 'failure'))")
    choose(browser, "reason", reason)
    both = browser.js("run.outcome && Array.from({length: run.count}, (_, i) => i).filter(i => run.world.rows[i] === 0 "
                      "&& run.outcome.of(i) === 'failure' && run.reason.clause(i) === " + repr(reason) + ").length")
    check(0 < both < of_world and shown(browser) == f"{both} of {total} clips", "filters narrow each other",
          shown(browser))
    browser.js("document.querySelector('.filters').reset()")
    choose(browser, "flips", True)
    flips = browser.js("Array.from({length: run.count}, (_, i) => i).filter(isFlip).length")
    check(flips > 0 and shown(browser) == f"{flips} of {total} clips", "flips can be asked for alone", shown(browser))
    browser.js("document.querySelector('.filters').reset()")
    browser.wait(f"document.querySelector('.filters output').textContent.startsWith('{total} clip')")
    held = browser.js("document.querySelectorAll('.clip').length")
    check(held <= 120, "the page holds only the clips in sight", held)


def title(browser):
    return browser.js("document.querySelector('dialog h2').textContent")


def keys(browser):
    browser.js("document.querySelector('.browser').scrollIntoView(); document.querySelector('.clip a').focus()")
    browser.key("ArrowRight")
    browser.wait("document.activeElement.closest('.clip')?.dataset.at === '1'")
    browser.key("Enter")
    browser.wait("document.querySelector('dialog').open")
    first = browser.js("location.hash")
    browser.key("j")
    browser.wait(f"location.hash !== {first!r}")
    browser.key("k")
    browser.wait(f"location.hash === {first!r}")
    browser.key("Escape")
    browser.wait("!document.querySelector('dialog').open")
    check(True, "arrow keys choose a clip, Enter opens it, j and k go on and back, Escape closes")


def deep_link(browser, url):
    clip = browser.js("run.count - 1")
    anchor, wanted = browser.js(f"anchorOf({clip})"), browser.js(f"run.state.of({clip})")
    browser.open(f"{url}#{anchor}")
    check(browser.js("document.querySelector('dialog').open") and wanted in title(browser),
          "a link to a clip opens that clip", title(browser))
    browser.key("Escape")


def flipped_cell(browser):
    """Where a flip's cell stands, in the window."""
    return browser.js("""(() => {
        const strip = [...document.querySelectorAll('.states[data-task]')].find(s => s.querySelector('.s-flip'));
        strip.scrollIntoView({block: 'center'});
        const ten = [...strip.querySelectorAll('svg')].find(s => s.querySelector('.s-flip'));
        const x = Number(ten.querySelector('.s-flip').getAttribute('d').match(/M([0-9.]+)/)[1]);
        const box = ten.getBoundingClientRect();
        return {x: box.left + x + 5, y: box.top + 12}; })()""")


def sampled(browser, seconds):
    """How far apart the two videos ran, and how far they came."""
    return browser.js(f"""new Promise(done => {{
        const [a, b] = document.querySelectorAll('dialog video'), start = performance.now(), apart = [];
        const tick = () => {{
            const shorter = Math.min(a.duration, b.duration);
            if (Math.max(a.currentTime, b.currentTime) < shorter - 0.2) apart.push(Math.abs(a.currentTime - b.currentTime));
            if (performance.now() - start < {seconds * 1000}) setTimeout(tick, 20);
            else done({{apart, times: [a.currentTime, b.currentTime], paused: [a.paused, b.paused]}});
        }};
        tick(); }})""")


def synchronous_videos(browser):
    place = flipped_cell(browser)
    browser.click(place["x"], place["y"])
    browser.wait("document.querySelector('dialog').open && document.querySelectorAll('dialog video').length === 2")
    browser.wait("[...document.querySelectorAll('dialog video')].every(v => v.readyState >= 3)")
    period = browser.js("run.taskOf(0).period_s")
    browser.js("document.querySelector('.playing').focus()")
    browser.key(" ", " ")
    browser.wait("[...document.querySelectorAll('dialog video')].every(v => v.currentTime > 0.3)")
    seen = sampled(browser, 1.0)
    worst = max(seen["apart"]) if seen["apart"] else None
    check(worst is not None and worst < period, f"both videos of a flip play within one frame ({period} s)", worst)
    print(f"   furthest apart: {worst} s in {len(seen['apart'])} samples")
    browser.js("document.querySelector('.playing').click()")
    browser.wait("[...document.querySelectorAll('dialog video')].every(v => v.paused && !v.seeking)")
    browser.js("""(() => { const scrub = document.querySelector('dialog input[type=range]');
        scrub.value = 300; scrub.dispatchEvent(new Event('input')); })()""")
    browser.wait("[...document.querySelectorAll('dialog video')].every(v => !v.seeking)")
    times = browser.js("[...document.querySelectorAll('dialog video')].map(v => v.currentTime)")
    check(abs(times[0] - times[1]) < period and times[0] > 0, "one scrubber moves both", times)
    browser.key("Escape")
    browser.wait("!document.querySelector('dialog').open")


def every_size(browser, url, folder):
    for width, height in SIZES:
        for scheme in ("light", "dark"):
            browser.look(width, height, scheme)
            browser.open(url)
            wide = browser.js("document.scrollingElement.scrollWidth")
            check(wide <= width, f"at {width} px, {scheme}, nothing is wider than the window", wide)
            ink, ground = browser.js("(s => [s.color, s.backgroundColor])(getComputedStyle(document.body))")
            check(ink != ground, f"at {width} px, {scheme}, letters stand out", ink)
            if folder and width in (390, 1280):
                browser.screenshot(folder / f"first-{width}-{scheme}.png")
                sections(browser, folder, width, scheme)
    browser.look(1280, 800, "light")


def sections(browser, folder, width, scheme):
    for box in browser.js("""[...document.querySelectorAll('main > section[id]')].map(s => { const b = s.getBoundingClientRect();
            return {id: s.id, x: 0, y: b.top + scrollY, width: innerWidth, height: Math.min(b.height, 1700)}; })"""):
        name = box.pop("id")
        browser.screenshot(folder / f"{name}-{width}-{scheme}.png", clip=box)


def without_script(browser, url):
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    browser.open(url)
    there, seen = browser.js("""(all => [all.length, all.filter(b => b.width > 10 && b.height > 10).length])(
        [...document.querySelectorAll('svg.chart, .states > svg, svg.strip')].map(s => s.getBoundingClientRect()))""")
    check(0 < there == seen, "every chart is seen without script", f"{seen} of {there}")
    browser.call("Emulation.setScriptExecutionDisabled", value=False)


def main():
    page = pathlib.Path(sys.argv[1]).resolve()
    folder = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    url, browser = page.as_uri(), Browser()
    try:
        browser.look(1280, 800, "light")
        start = time.time()
        browser.open(url)
        check("Policy evaluation" in browser.js("document.title"), "the report opens from disk")
        paint = browser.js("performance.getEntriesByName('first-contentful-paint')[0]?.startTime")
        print(f"   first paint after {paint} ms, loaded after {time.time() - start:.2f} s")
        filters(browser)
        keys(browser)
        deep_link(browser, url)
        synchronous_videos(browser)
        pdf = browser.pdf()
        check(pdf.startswith(b"%PDF") and len(pdf) > 20000, "it prints", len(pdf))
        if folder:
            (folder / "print.pdf").write_bytes(pdf)
        every_size(browser, url, folder)
        without_script(browser, url)
        away = [u for u in browser.requests if not u.startswith(("file:", "about:", "data:"))]
        check(not away, "nothing is asked of any network", away[:5])
        check(not browser.complaints, "the console has nothing to complain of", browser.complaints[:5])
    finally:
        browser.close()
    print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
