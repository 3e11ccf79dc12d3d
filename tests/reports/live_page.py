#!/usr/bin/env python3
"""What pages of a dashboard of one run, named twice, say to news: live_page.py INDEX.html RUN.html STAMP_OF_THE_RUN.

Prints "ok: …" for what holds and "failed: …" for what does not; exit code 1 if anything failed, 77 without a browser.
"""
import json
import pathlib
import shutil
import sys

try:
    import websocket  # noqa: F401
except ImportError:
    print("skipped: python3-websocket is not installed")
    sys.exit(77)
if shutil.which("chromium") is None:
    print("skipped: chromium is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system" / "browser"))
from devtools import Browser  # noqa: E402

# Says what it is told to, when it is told to.
NEWS = """window.EventSource = class {
  addEventListener(name, listener) { window.tell = runs => listener({data: JSON.stringify({runs})}); }
}"""
failures = []


def button_after(browser, page, *news):
    """Whether the page offers more when it has heard this, one after the other."""
    browser.open(pathlib.Path(page).resolve().as_uri())
    for runs in news:
        browser.js(f"tell({json.dumps(runs)})")
    return browser.is_true("document.querySelector('.live button')")


def check(holds, sentence):
    print(f"{'ok' if holds else 'failed'}: {sentence}")
    if not holds:
        failures.append(sentence)


def main():
    index, run, now = sys.argv[1:]
    later = now + "and more"
    browser = Browser()
    try:
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=NEWS)
        check(not button_after(browser, index, [now, now]), "the list is not old while nothing is written")
        check(button_after(browser, index, [now, later]), "the list says what was written before it first heard")
        check(not button_after(browser, run, [now, now]), "a report is not old while nothing is written")
        check(not button_after(browser, run, [later, now]), "a report is not old when another run is written")
        check(button_after(browser, run, [now, later]), "a report says what was written before it first heard")
        check(button_after(browser, run, [now, now], [now, later]), "a report says what is written later")
    finally:
        browser.close()
    print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
