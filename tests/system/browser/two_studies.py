#!/usr/bin/env python3
"""Two studies on one host, one browser: two_studies.py EVAC STUDY OTHER.

A rater's answer waits for the line while the same browser joins the other study; then another one waits while the other study is served at
the first one's address. Both arrive. Prints "ok: …" and "failed: …"; exit code 1 if anything failed, 77 without a browser.
"""
import sys
import time
import traceback

from devtools import check, failures
from rating_page import STUDY, Rater, Server, current, links, reload

OTHER = sys.argv[3]


def say_offline(ann):
    """An answer that has to wait. @returns its clip."""
    browser = ann.browser
    browser.call("Page.bringToFront")
    browser.wait("rating.player && !rating.isBusy")
    browser.js("rating.player.replay()")  # what ran while nobody looked was not seen
    ann.ready()
    clip = ann.clip()
    browser.offline(True)
    browser.press("s")
    browser.wait("outbox.waiting.length === 1")
    return clip


def is_stored(clip, patience_s=60):
    end = time.time() + patience_s
    while time.time() < end:
        if clip in current():
            return True
        time.sleep(0.2)
    return False


def wait_for_study(browser, study):
    browser.wait(f"typeof session === 'object' && session.me?.study_id === {study!r}", 60)


def join_the_other(ann, there):
    """@returns what the other study is called by its pages."""
    tab = ann.browser.tab()
    tab.open(links("rater", 1, there.url, OTHER)[0])
    tab.wait("document.querySelector('#consent')")
    tab.js("document.querySelector('#consent').click()")
    tab.js("document.querySelector('button.primary').click()")
    tab.wait("document.querySelector('.rubric')")
    study = tab.js("session.me.study_id")
    tab.call("Page.close")
    return study


def session(here, there, ann):
    browser = ann.browser
    ann.join()
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")
    ann.fast()
    first = browser.js("session.me.study_id")
    clip = say_offline(ann)
    second = join_the_other(ann, there)
    check(first != second, "two studies have two names", (first, second))
    browser.offline(False)
    check(is_stored(clip), "what waited while this browser joined another study arrives")
    check(browser.js("session.me?.study_id") == first, "and its rater is still in")

    clip = say_offline(ann)
    here.kill()
    there.kill()
    there.port = here.port
    there.start()
    browser.offline(False)
    wait_for_study(browser, second)
    browser.wait("document.querySelector('.rubric') || document.querySelector('.rate') || document.querySelector('#dialog').open")
    check(browser.js("outbox.waiting.length") == 0, "another study's page sends nothing of the first one's")
    kept = browser.js("inOutbox('readonly', store => store.getAll()).then(all => all.length)")
    check(kept == 1, "and leaves it where it is", kept)
    there.kill()
    here.start()
    reload(browser)
    wait_for_study(browser, first)
    browser.wait("rating.clip || document.querySelector('#dialog').open || document.querySelector('.rubric')")
    if browser.js("document.querySelector('#dialog').open"):  # the page before has not let go yet
        browser.js("document.querySelector('#dialog button.primary').click()")
    check(is_stored(clip), "it is sent when its study is back")


def main():
    servers = [Server(STUDY), Server(OTHER)]
    ann = Rater(links("rater", 1, servers[0].url)[0], "Ann")
    try:
        session(*servers, ann)
    except Exception as error:  # what the page showed then
        check(False, f"the session went on: {type(error).__name__} {error}")
        traceback.print_exc()
        print(f"   Ann: {ann.shown()}", file=sys.stderr)
    finally:
        ann.browser.close()
        for server in servers:
            server.kill()
    print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
