#!/usr/bin/env python3
"""What pages of a dashboard of one run, named twice, say to news: live_page.py INDEX.html RUN.html STAMP_OF_THE_RUN.

Prints "ok: …" for what holds and "failed: …" for what does not; exit code 1 if anything failed, 77 without a browser.
"""
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system" / "browser"))
from devtools import Browser, check, failures  # noqa: E402

# Says what it is told to, when it is told to.
NEWS = """window.EventSource = class {
  addEventListener(name, listener) { window.tell = runs => listener({data: JSON.stringify({runs})}); }
}"""


def button_after(browser, page, *news):
    """Whether the page offers more when it has heard this, one after the other."""
    browser.open(pathlib.Path(page).resolve().as_uri())
    for runs in news:
        browser.js(f"tell({json.dumps(runs)})")
    return browser.is_true("document.querySelector('.live button')")


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
