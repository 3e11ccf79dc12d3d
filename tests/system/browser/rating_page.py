#!/usr/bin/env python3
"""A rating session as people have it, in real browsers: rating_page.py EVAC STUDY [FOLDER_FOR_SCREENSHOTS].

Three raters at once, an adjudicator and a lead; two tabs, a reload in a clip, a line that goes away, a server that is killed, undo, a clip that does
not play, somebody who leaves. Prints "ok: …" and "failed: …"; exit code 1 if anything failed, 77 without a browser.
"""
import json
import pathlib
import signal
import subprocess
import sys
import time
import traceback
from concurrent.futures import ThreadPoolExecutor

from devtools import Browser, check, failures

SIZES = [(360, 740), (1280, 800), (2560, 1440)]
EVAC, STUDY = sys.argv[1], sys.argv[2]
FOLDER = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None


class Server:
    """`evac rate serve`, at one port for all its lives."""

    def __init__(self, study=STUDY):
        self.study, self.port = study, 0
        self.start()

    def start(self):
        self.process = subprocess.Popen([EVAC, "rate", "serve", self.study, "--port", str(self.port)], stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().strip()
        self.port = int(self.url.rstrip("/").rsplit(":", 1)[1])

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


def evac(*words):
    return subprocess.run([EVAC, "rate", *words], capture_output=True, text=True, check=True).stdout


def links(role, count, url, study=STUDY):
    return evac("invite", study, "--role", role, "--count", str(count), "--url", url).split()


def look(browser, name):
    """Screenshots at three widths, light and dark, and no page is wider than its window."""
    for width, height in SIZES:
        browser.look(width, height, "dark" if width == 2560 else "light")
        time.sleep(0.4)
        wide = browser.js("document.scrollingElement.scrollWidth")
        check(wide <= width, f"{name} at {width} px: nothing is wider than the window", wide)
        if FOLDER:
            browser.screenshot(FOLDER / f"{name}-{width}.png")
    browser.look(1280, 800, "light")
    time.sleep(0.2)


def text(browser, selector):
    return browser.js(f"document.querySelector({selector!r})?.textContent || ''")


class Rater:
    """One person with a browser of their own, who uses keys alone."""

    def __init__(self, link, name):
        self.browser, self.name, self.said = Browser(), name, {}
        self.browser.look(1280, 800, "light")
        self.browser.open(link)
        self.browser.wait("document.querySelector('#consent')")

    def join(self):
        self.browser.js(f"document.querySelector('#name').value = {self.name!r}; document.querySelector('#consent').click()")
        self.browser.js("document.querySelector('button.primary').click()")
        self.browser.wait("document.querySelector('.rubric') || document.querySelector('.rate') || document.querySelector('.done') || document.querySelector('.board')")

    def clip(self):
        return self.browser.js("rating.clip?.presentation || ''")

    def ready(self):
        """Until a clip was watched to its end and the verdict is open."""
        self.browser.wait("document.querySelector('.verdict:not(:disabled)') && !document.querySelector('.feedback')", 60)

    def say(self, key, label):
        self.ready()
        clip = self.clip()
        self.browser.press(key)
        self.said[clip] = label
        self.browser.wait(f"!rating.clip || rating.clip.presentation !== {clip!r} || document.querySelector('.feedback') || !document.querySelector('.rate')")

    def sent(self):
        """Until the server has said that it keeps all verdicts."""
        self.browser.wait("outbox.waiting.length === 0", 60)

    def is_next_playable(self):
        """Of the clip that is fetched ahead."""
        return self.browser.js("""rating.prefetched.then(ready => new Promise(say => {
            const video = document.createElement('video');
            video.onloadeddata = () => say(true);
            video.onerror = () => say(false);
            video.src = ready.source;
        }))""")

    def fast(self):
        for _ in range(4):
            self.browser.press("]")

    def shown(self):
        try:
            return self.browser.js("""JSON.stringify({text: document.body.innerText.slice(0, 300), clip: rating.clip?.presentation,
                time: document.querySelector('video')?.currentTime, unsent: outbox.waiting.length, isOther: session.isOther})""")
        except Exception as error:
            return f"cannot be asked: {error}"

    def at_end(self):
        return self.browser.js("Boolean(document.querySelector('.done') || document.querySelector('[data-guess]'))")

    def rate_all(self, label_of):
        while not self.at_end():
            if self.browser.js("Boolean(document.querySelector('.sheet'))"):
                self.browser.press("Enter")  # a break: its button has the focus
                self.browser.wait("document.querySelector('.rate') || document.querySelector('.done') || document.querySelector('[data-guess]')")
                continue
            self.browser.wait("document.querySelector('.verdict:not(:disabled)') || document.querySelector('.sheet')", 60)
            if self.browser.js("Boolean(document.querySelector('.sheet'))"):
                continue
            label = label_of(len(self.said))
            self.say({"success": "s", "failure": "f", "cannot_tell": "u"}[label], label)

    def practise(self):
        while self.browser.js("rating.clip?.kind === 'practice' || !rating.clip"):
            self.browser.wait("rating.clip")
            if self.browser.js("rating.clip.kind !== 'practice'"):
                break
            self.ready()
            self.browser.press("s")
            self.browser.wait("document.querySelector('.feedback')")
            self.browser.press("Enter")
            self.browser.wait("!document.querySelector('.feedback')")

    def guess(self):
        while self.browser.js("Boolean(document.querySelector('[data-guess]'))"):
            left = text(self.browser, ".sheet")
            self.browser.js("document.querySelector('[data-guess=unsure]').click()")
            self.browser.wait(f"document.querySelector('.done') || document.querySelector('.sheet').textContent !== {left!r}")


def rows():
    return [json.loads(line) for line in evac("export", STUDY, "--jsonl", "-").splitlines()]


def current(name=None):
    return {row["presentation"]: row for row in rows() if row["is_current"] and row["label"] != "retracted"}


def first_rater(server, ann):
    browser = ann.browser
    look(browser, "join")
    ann.join()
    look(browser, "brief")
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")
    check("Practice" in text(browser, "h1"), "practice comes first", text(browser, "h1"))
    check(browser.js("[...document.querySelectorAll('.verdict')].every(b => b.disabled)"), "no verdict before the clip was seen")
    look(browser, "practice")
    ann.fast()
    ann.practise()
    undo(ann)
    reload_in_a_clip(ann)
    keys(ann)
    space_after_a_click(ann)
    brackets_of_other_keyboards(ann)
    pause_in_a_clip(ann)
    a_box_opened_at_the_last_moment(ann)
    menu_after_a_verdict(ann)
    change(ann)
    server_in_trouble(ann)
    disk_that_is_closed(ann)
    more_comes_at_the_end(ann)
    second_tab(ann)
    line_goes_away(ann, server)
    ann.rate_all(lambda k: "failure" if k % 4 == 3 else "success")
    if browser.js("Boolean(document.querySelector('[data-guess]'))"):
        look(browser, "guess")
    ann.guess()
    look(browser, "done")


def other_rater(rater, label_of):
    rater.join()
    rater.browser.press("Enter")
    rater.browser.wait("document.querySelector('.rate')")
    rater.fast()
    rater.practise()
    rater.rate_all(label_of)
    rater.guess()


def reload(browser):
    browser.js("window.isOld = true")
    browser.call("Page.reload")
    browser.wait("!window.isOld && document.readyState === 'complete' && typeof rating === 'object'")


def wait_here(browser, expression):
    """The page before may not have let go yet: this one takes over then."""
    browser.wait(f"{expression} || document.querySelector('#dialog').open && document.querySelector('#dialog').textContent.includes('another tab')")
    browser.js("document.querySelector('#dialog').open && document.querySelector('#dialog button.primary')?.click()")
    browser.wait(expression)


def undo(ann):
    browser = ann.browser
    ann.ready()
    look(browser, "rate")
    before = ann.clip()
    ann.say("s", "success")
    browser.press("z")
    browser.wait(f"rating.clip?.presentation === {before!r}")
    check(before not in current(), "undo takes the verdict back")
    check(any(row["label"] == "retracted" and row["presentation"] == before for row in rows()), "undo is a row of its own")
    ann.said.pop(before)
    ann.say("u", "cannot_tell")


def reload_in_a_clip(ann):
    browser = ann.browser
    browser.wait("document.querySelector('video')?.currentTime > 0.2")
    before = ann.clip()
    reload(browser)
    browser.wait("rating.clip")
    check(ann.clip() == before, "a reload goes on with the same clip", (before, ann.clip()))
    ann.say("s", "success")
    ann.sent()
    check(current()[before]["interrupted"] == 1, "the verdict knows of the reload")


def keys(ann):
    browser = ann.browser
    ann.ready()
    browser.wait("document.querySelector('video').paused")
    browser.press("Home")
    browser.wait("document.querySelector('video').currentTime < 0.15")
    browser.press(".")
    browser.wait("Math.abs(document.querySelector('video').currentTime - 0.15) < 0.06")
    check(True, "Home and . go to the first frame and the next")
    browser.press("1")
    browser.press("x")
    browser.press("4")
    browser.press("x")
    check(browser.js("rating.stages === 1 && rating.flags.has('blur_hides')"), "digits are stages, after X flags")
    check(browser.js("[...document.querySelectorAll('.stage, .flag, .cause')].every((b, k) => b.querySelector('kbd').hidden === !b.querySelector('kbd').textContent)"),
          "what has no key shows none")
    browser.press("x")
    browser.press("b")
    browser.press("2")
    check(browser.js("rating.cause === session.me.causes[1] && rating.stages === 1 && rating.flags.size === 1 && !document.querySelector('.flags').open"),
          "after B they are causes, and the flags are closed")
    browser.press("2")
    browser.press("b")
    browser.press("c")
    browser.press("c")
    check(browser.js("rating.confidence === 2 && document.querySelector('[data-sure=\"2\"]').getAttribute('aria-pressed') === 'true'"),
          "C says how sure: fairly")
    browser.press("n")
    for letter in "sfu":
        browser.press(letter)
    check(browser.js("document.querySelector('textarea').value === 'sfu' && !rating.isBusy"), "keys are letters in the note")
    browser.press("Escape")
    browser.press("?")
    browser.wait("document.querySelector('#dialog').open")
    look(browser, "help")
    browser.js("document.querySelector('#hand').click()")
    check("Backspace" in text(browser, "dl.keys"), "the help shows the right hand's keys", text(browser, "dl.keys"))
    hidden = browser.js("""[...document.styleSheets].flatMap(sheet => [...sheet.cssRules]).flatMap(rule => [rule, ...rule.cssRules || []])
        .filter(rule => rule.style?.display === 'none' && document.querySelector('dl.keys kbd').matches(rule.selectorText)).map(rule => rule.selectorText)""")
    check(hidden == [], "no screen hides the keys of which the help tells", hidden)
    browser.js("document.querySelector('#dialog button.primary').click()")
    check(text(browser, ".flag kbd") == "6", "the flags show the right hand's digits", text(browser, ".flag kbd"))
    browser.press("7")
    check(browser.js("rating.stages === 3"), "7 is the second stage for the right hand", browser.js("rating.stages"))
    browser.press("7")
    stages = []
    for code in ("Numpad7", "Numpad1", "Numpad2", "Numpad7"):
        browser.js(f"document.body.dispatchEvent(new KeyboardEvent('keydown', {{key: '{code[-1]}', code: '{code}', bubbles: true}}))")
        stages.append(browser.js("rating.stages"))
    check(stages == [3, 3, 3, 1], "and so it is on the keypad, where 1 and 2 are none", stages)
    clip = ann.clip()
    ann.say(";", "failure")
    browser.js("localStorage.removeItem('evac-keys')")
    ann.sent()
    row = current()[clip]
    check((row["stages"], row["flags"], row["confidence"], row["note"]) == (1, "blur_hides", 2, "sfu"),
          "stages, flags, how sure and note are stored", row)
    browser.press("h")
    browser.wait("document.querySelector('.history')")
    look(browser, "history")
    browser.js("document.querySelector('#dialog button.primary').click()")


def space_after_a_click(ann):
    browser = ann.browser
    browser.js("rating.player.replay()")  # the dialogs before have stopped it
    ann.ready()
    browser.js("""window.toggled = 0;
        const toggle = rating.player.toggle;
        rating.player.toggle = () => { toggled++; toggle.call(rating.player); };""")
    browser.click(*browser.js("(at => [at.x + at.width / 2, at.y + at.height / 2])(document.querySelector('.stage').getBoundingClientRect())"))
    check(browser.js("rating.stages === 1"), "a click marks a stage", browser.js("rating.stages"))
    browser.press(" ")
    check(browser.js("rating.stages === 1 && toggled === 1"), "Space plays after it, and un-marks nothing", browser.js("[rating.stages, toggled]"))
    browser.js("document.querySelector('.stage').focus()")
    browser.press(" ")
    check(browser.js("rating.stages === 0 && toggled === 1"), "on a stage that was come to by keys it un-marks", browser.js("[rating.stages, toggled]"))
    browser.js("document.activeElement.blur()")


def brackets_of_other_keyboards(ann):
    """AltGr is Ctrl and Alt to Windows and a state of its own elsewhere, Option is Alt; the key is often a digit's."""
    browser = ann.browser
    before = browser.js("sticky.speed")
    for held in ("ctrlKey: true, altKey: true", "modifierAltGraph: true", "altKey: true"):
        speeds = [browser.js(f"""document.body.dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}', code: 'Digit1', bubbles: true, {held}}}));
            sticky.speed""") for key in "[]"]
        check(speeds[0] < speeds[1] == before and browser.js("rating.stages === 0"), f"[ and ] are slower and faster with {held}", (before, speeds))


def pause_in_a_clip(ann):
    browser = ann.browser
    browser.js("rating.player.replay()")  # the dialogs before have stopped it
    ann.ready()
    clip = ann.clip()
    browser.press("x")
    browser.press("2")
    browser.press("n")
    browser.press("q")
    browser.press("Escape")
    browser.js("[...document.querySelectorAll('.bar button')].find(b => b.textContent === 'Pause').click()")
    browser.wait("!document.querySelector('.rate')")
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")
    check(ann.clip() == clip and browser.js("!document.querySelector('.verdict').disabled"), "after a pause the same clip goes on, seen as it was")
    check(browser.js("rating.flags.has('object_disappears') && document.querySelector('textarea').value === 'q'"), "and what was marked is marked")
    browser.press("2")
    check(browser.js("rating.flags.size === 0 && rating.stages === 0"), "flags that were open are open: digits are theirs")
    ann.say("s", "success")
    ann.ready()
    browser.press("1")
    check(browser.js("rating.stages === 1 && !document.querySelector('.flags').open"), "the next clip's flags are closed: digits are stages")
    browser.press("1")


def a_box_opened_at_the_last_moment(ann):
    """A browser tells of an opened box later, when the page that had it may be gone."""
    browser = ann.browser
    before = len(browser.complaints)
    browser.js("""document.querySelector('.flags summary').click();
        [...document.querySelectorAll('.bar button')].find(b => b.textContent === 'Pause').click()""")
    browser.wait("!document.querySelector('.rate')")
    browser.js("new Promise(done => setTimeout(done, 200))")  # what is told meanwhile is heard
    check(browser.complaints[before:] == [], "a box opened when the page goes is nobody's any more", browser.complaints[before:])
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")


def menu_after_a_verdict(ann):
    """And what was fetched ahead is not what the server would give again."""
    browser = ann.browser
    ann.ready()
    clip = ann.clip()
    browser.js("rating.prefetched = Promise.resolve({clip: {done: true}, source: null})")
    browser.press("s")
    ann.said[clip] = "success"
    browser.js("openMenu()")
    time.sleep(1)
    check(browser.js("!document.querySelector('.rate')"), "the next clip does not come over the menu")
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")
    check(ann.clip() != clip, "nobody is at the end because an old answer says so")


def change(ann):
    browser = ann.browser
    ann.ready()
    here, clip = ann.clip(), next(clip for clip, row in current().items() if row["note"] == "sfu")  # of keys(): with all that can be said
    browser.press("1")
    asked = browser.js(f"get('/api/history').then(said => said.verdicts.findIndex(one => one.presentation === {clip!r}))")
    browser.press("h")
    browser.wait("document.querySelector('#dialog').open && document.querySelector('.history')")
    browser.js(f"document.querySelectorAll('.history button')[{asked}].click()")
    browser.wait(f"rating.clip?.presentation === {clip!r} && rating.isOpen")
    form = browser.js("[rating.stages, [...rating.flags].join(), rating.note, rating.confidence].join(' ')")
    check(form == "1 blur_hides sfu 2", "a change begins with what was said", form)
    kept = browser.js("JSON.parse(sessionStorage.getItem('evac-clip')).presentation")
    check(kept == here, "a page that is loaded anew now goes on with the clip that waits", (kept, here))
    browser.press("u")
    ann.said[clip] = "cannot_tell"
    browser.wait(f"rating.clip?.presentation === {here!r}")
    ann.sent()
    row = current()[clip]
    check((row["label"], row["stages"], row["flags"], row["confidence"], row["note"]) == ("cannot_tell", 1, "blur_hides", 2, "sfu"),
          "and changes nothing else", row)
    check(browser.js("!rating.isOpen && !rating.supersedes"), "the clip after it is rated as any other")
    found = browser.js("""[rating.stages, document.querySelector('[data-stage="0"]').getAttribute('aria-pressed'), document.querySelector('.verdict').disabled,
        rating.player.watch.interrupted].join(' ')""")
    check(found == "1 true false false", "and what was seen and marked of it before is seen and marked", found)
    browser.press("1")


def server_in_trouble(ann):
    """500, and what a proxy makes of a server that is away: no word on the verdict."""
    browser = ann.browser
    ann.ready()
    clip = ann.clip()
    browser.js("""window.fetched = fetch;
        window.troubles = [500, 520];
        window.fetch = (path, options) => path === '/api/verdict' && troubles.length
          ? Promise.resolve(new Response('', {status: troubles.shift()})) : fetched(path, options);""")
    ann.say("s", "success")
    browser.wait("troubles.length === 0 || outbox.waiting.length === 0")
    left = browser.js("troubles.length")
    check(left == 0, "a verdict that meets a server in trouble is sent again", left)
    ann.sent()
    browser.js("window.fetch = fetched")
    check(current().get(clip, {}).get("label") == "success", "and arrives")


def disk_that_is_closed(ann):
    """By the browser: a tab that was in the background, site data that were cleared."""
    browser = ann.browser
    ann.ready()
    while not ann.is_next_playable():  # which is told at once, and asks for another: that needs the line
        ann.say("s", "success")
        ann.ready()
    clip, count = ann.clip(), "inOutbox('readonly', store => store.count())"
    browser.offline(True)
    browser.js("outbox.database.close()")
    browser.press("s")
    ann.said[clip] = "success"
    browser.wait("outbox.waiting.length === 1")
    check(browser.js(count) == 1, "a verdict that finds the disk closed waits there all the same", browser.js(count))
    browser.js("window.at = outbox.waiting[0].at; inOutbox('readwrite', store => store.clear()).then(() => outbox.database.close())")
    browser.js("reopenOutbox()")
    found = browser.js("inOutbox('readonly', store => store.getAll()).then(all => all.map(entry => entry.at - at).join())")
    check(found == "0", "what waits is there again after all was cleared, once and under its number", found)
    holds = "(event => { dispatchEvent(event); return event.defaultPrevented; })(new Event('beforeunload', {cancelable: true}))"
    check(not browser.js(holds), "who closes the page is not asked while all that waits is on disk")
    browser.js("delete outbox.waiting[0].at")
    check(browser.js(holds), "but where some of it is in memory alone")
    browser.js("outbox.waiting[0].at = at")
    browser.offline(False)
    ann.sent()
    check(current().get(clip, {}).get("label") == "success" and browser.js(count) == 0, "and it arrives, and waits no more", browser.js(count))


def more_comes_at_the_end(ann):
    """As if a wave had come: the server says that nothing is left, and who asks who they are is given more."""
    browser = ann.browser
    ann.ready()
    browser.js("""window.fetched = fetch;
        window.before = rating.player;
        window.saidDone = false;
        window.fetch = (path, options) => {
          if (path !== '/api/next' || saidDone) return fetched(path, options);
          saidDone = true;
          return Promise.resolve(new Response(JSON.stringify({done: true, progress: {done: rating.done, total: rating.done, practice_left: 0}})));
        };
        rating.prefetched = null;
        void rate();""")
    browser.wait("saidDone && rating.player !== before && (rating.player || !document.querySelector('.rate'))")
    check(browser.js("Boolean(document.querySelector('.rate') && rating.player)"), "nobody is at the end while clips are left", text(browser, "h1"))
    browser.js("window.fetch = fetched")
    if browser.js("!document.querySelector('.rate')"):
        reload(browser)
        wait_here(browser, "rating.player")


def second_tab(ann):
    other = ann.browser.tab()
    other.open(ann.browser.js("location.origin") + "/")
    other.wait("document.querySelector('#dialog').open")
    check("another tab" in text(other, "#dialog"), "a second tab says that there is a first one")
    ann.browser.wait("rating.clip")
    ann.browser.offline(True)
    ann.browser.js("send('/api/heartbeat', {presentation: rating.clip.presentation}).then(() => true)")
    check(ann.browser.js("inOutbox('readonly', store => store.count())") == 1, "what the first one cannot send waits on disk")
    other.js("document.querySelector('#dialog button.primary').click()")
    other.wait("rating.clip")
    left = other.js("inOutbox('readonly', store => store.count())")
    check(left == 0, "who takes over sends it, though it was said after this page was loaded", left)
    ann.browser.offline(False)
    ann.browser.wait("session.isOther", 70)
    check(ann.browser.js("document.querySelector('video')?.paused !== false"), "the first tab stops playing")
    check("another tab" in text(ann.browser, "#banner"), "and says why", text(ann.browser, "#banner"))
    if FOLDER:
        ann.browser.screenshot(FOLDER / "other-tab-1280.png")
    other.call("Page.close")
    ann.browser.call("Page.bringToFront")
    reload(ann.browser)
    ann.browser.wait("rating.clip || document.querySelector('#dialog').open")
    if ann.browser.js("document.querySelector('#dialog').open"):
        ann.browser.js("document.querySelector('#dialog button.primary').click()")
        ann.browser.wait("rating.clip")


def line_goes_away(ann, server):
    browser = ann.browser
    ann.ready()
    while not ann.is_next_playable():  # which is told at once, and asks for another: that needs the line
        ann.say("s", "success")
        ann.ready()
    browser.offline(True)
    ann.say("s", "success")
    browser.wait("!document.querySelector('#unsent').hidden")
    check("1 unsent" in text(browser, "#unsent"), "what is not sent is counted", text(browser, "#unsent"))
    ann.ready()
    check(browser.js("inHand().length === 2 && inHand().includes(outbox.waiting[0].body.presentation)"), "a clip whose verdict waits is not asked for again")
    look(browser, "offline")
    clip = ann.clip()
    browser.press("s")
    ann.said[clip] = "success"
    browser.wait("outbox.waiting.length === 2")
    server.kill()
    browser.offline(False)
    time.sleep(1)
    server.start()
    browser.wait("outbox.waiting.length === 0", 60)
    check(clip in current(), "verdicts arrive when line and server are back")
    browser.wait("rating.clip && !rating.isBusy")


def compare(ann, name):
    stored = current()
    wrong = {clip: (label, stored.get(clip, {}).get("label")) for clip, label in ann.said.items() if stored.get(clip, {}).get("label") != label}
    check(not wrong, f"the store has what {name} said, row by row ({len(ann.said)} clips)", wrong)


def leave(rater):
    browser = rater.browser
    browser.press("Enter")
    browser.wait("document.querySelector('.rate')")
    rater.ready()
    browser.offline(True)
    browser.press("s")
    browser.wait("outbox.waiting.length === 1")
    browser.js("void leave()")
    browser.wait("document.querySelector('#erase')")
    browser.js("document.querySelector('#dialog button.primary').click()")
    browser.wait("document.querySelector('#dialog').open && !document.querySelector('#erase')")
    check("could not be sent" in text(browser, "#dialog"), "nobody leaves with verdicts that are to count and wait", text(browser, "#dialog"))
    browser.js("document.querySelector('#dialog button').click()")
    before = len(rows())
    browser.offline(False)
    rater.sent()
    check(len(rows()) == before + 1, "when the line is back they are sent", (before, len(rows())))
    browser.js("void leave()")
    browser.wait("document.querySelector('#erase')")
    look(browser, "leave")
    browser.js("document.querySelector('#dialog button.bad').click()")
    browser.wait("document.querySelector('h1')?.textContent.includes('left')")
    browser.open(browser.js("location.origin") + "/")
    browser.wait("document.querySelector('h1')?.textContent.includes('invitation')")
    check(True, "who left is out")
    if FOLDER:
        browser.screenshot(FOLDER / "no-invitation-1280.png")


def somebody_elses_link(rater, link):
    browser = rater.browser
    before = browser.js("session.me.rater")
    for button in ("first-of-type", "nth-of-type(2)"):
        browser.open(link)
        browser.wait("document.querySelector('#dialog').open")
        check(rater.name in text(browser, "#dialog"), "a link that is not theirs asks who is here", text(browser, "#dialog"))
        browser.js(f"document.querySelector('#dialog button:{button}').click()")
        wait_here(browser, "document.querySelector('.done') || document.querySelector('#consent')")
    check(browser.js("Boolean(document.querySelector('#consent'))"), "and counts when they say so")
    browser.open(browser.js("location.origin") + "/")
    wait_here(browser, "document.querySelector('.done')")
    check(browser.js("session.me.rater") == before, "until somebody has joined by it, the first one is here")


def interrupted(judge, clip):
    """Between the first look and the decision."""
    browser = judge.browser
    reload(browser)
    wait_here(browser, "document.querySelector('.others')")
    check(judge.clip() == clip, "an adjudicator who was interrupted finds the others' verdicts of the same clip")
    check(browser.js("document.activeElement.matches('.others') && document.querySelector('.kept').matches('.decision.success')"), "and what was said first")


def decided_at_once(browser):
    """Whatever is struck before anybody can have read the others' verdicts."""
    is_open = "Boolean(document.querySelector('.decision:not(:disabled)'))"
    browser.press("Enter")
    browser.press(" ")
    check(browser.js(is_open), "Enter and Space decide nothing where nobody went to a decision")
    browser.js("rating.unfoldedAt = Date.now(); document.querySelector('.decision.success').click()")
    check(browser.js(is_open), "nor does a decision that is clicked at once")


def adjudicate(judge):
    browser = judge.browser
    judge.join()
    decided = 0
    browser.wait("document.querySelector('.rate') || document.querySelector('.done')")
    judge.fast()
    while browser.js("Boolean(document.querySelector('.rate'))") and decided < 60:
        judge.ready()
        clip = judge.clip()
        if decided == 0:
            look(browser, "adjudicate-blind")
        check(decided > 0 or not browser.js("Boolean(document.querySelector('.others'))"), "nothing of the others before one's own word")
        browser.press("s")
        browser.wait("document.querySelector('.others')")
        if decided == 0:
            decided_at_once(browser)
            look(browser, "adjudicate")
            interrupted(judge, clip)
        if decided == 1:
            browser.press("s")
            check(browser.js("Boolean(document.querySelector('.decision:not(:disabled)'))"), "a key struck twice is no decision")
        browser.wait("Date.now() - rating.unfoldedAt > 1000")
        for key in "s" if decided == 1 else ("Tab", "Enter"):  # the first of the decisions is Success
            browser.press(key)
        browser.wait(f"document.querySelector('.done') || (rating.clip?.presentation !== {clip!r} && document.querySelector('.rate') && !document.querySelector('.others'))")
        decided += 1
    check(decided > 0, "there was something to decide", decided)
    check(json.loads(evac("status", STUDY, "--json"))["disputes"] == [], "no dispute is left")


def goes_on(browser):
    """The board: nothing moves under the reader, and it comes back after a refusal."""
    browser.js("document.querySelector('.scroll[aria-label=Raters]').focus(); window.scrollTo(0, 60); window.before = scrollY")
    browser.js("refreshBoard()")
    check(browser.js("document.activeElement.getAttribute('aria-label') === 'Raters' && scrollY === before"), "a board that is refreshed stays where it was")
    browser.js("window.fetched = fetch; window.fetch = () => Promise.resolve(new Response('{}', {status: 403})); window.before = board.timer; refreshBoard()")
    browser.wait("!document.querySelector('#banner').hidden")
    check(browser.js("board.timer !== before"), "a refused refresh is tried again")
    browser.js("window.fetch = fetched; refreshBoard()")
    browser.wait("document.querySelector('#banner').hidden")
    browser.js("window.fetch = () => Promise.resolve(new Response('', {status: 500})); void refreshBoard()")
    browser.wait("!document.querySelector('#banner').hidden")
    browser.js("window.fetch = fetched")
    browser.wait("document.querySelector('#banner').hidden")
    check(True, "a server in trouble is asked again until it answers")


def main():
    if FOLDER:
        FOLDER.mkdir(parents=True, exist_ok=True)
    server, people = Server(), []
    try:
        for link, name in zip(links("rater", 4, server.url), ["Ann", "Bob", "Cleo", "Dan"]):
            people.append(Rater(link, name))
        ann, bob, cleo, dan = people
        at_once = [(first_rater, server, ann), (other_rater, bob, lambda k: "failure" if k % 3 == 0 else "success"),
                   (other_rater, cleo, lambda k: "success")]
        with ThreadPoolExecutor(len(at_once)) as threads:
            for rated in [threads.submit(*work) for work in at_once]:
                rated.result()
        for rater in (ann, bob, cleo):
            compare(rater, rater.name)
            check(len(rater.said) >= 24, f"{rater.name} rated 24 clips or more", len(rater.said))
        somebody_elses_link(cleo, links("rater", 1, server.url)[0])
        dan.join()
        leave(dan)
        judge = Rater(links("adjudicator", 1, server.url)[0], "Eve")
        people.append(judge)
        adjudicate(judge)
        lead = Rater(links("lead", 1, server.url)[0], "Fay")
        people.append(lead)
        lead.join()
        look(lead.browser, "board")
        goes_on(lead.browser)
        told = json.loads(evac("status", STUDY, "--json"))
        check(f"{told['progress']['votes']} votes" in text(lead.browser, ".board"), "the board shows the store's numbers", text(lead.browser, "header"))
        check(len(told["unplayable"]) >= 3 and "could not play" in text(lead.browser, ".board"), "the lead hears what did not play", told["unplayable"])
        doubled = [row for row in rows() if row["label"] != "retracted" and row["is_current"]]
        check(len(doubled) == len({row["presentation"] for row in doubled}), "nothing is doubled")
        for rater in people:
            away = [u for u in rater.browser.requests if not u.startswith((server.url, "about:", "data:", "blob:"))]
            check(not away, f"{rater.name}'s page asks nobody else", away[:3])
            bad = [c for c in rater.browser.complaints if "ERR_INTERNET_DISCONNECTED" not in c and "ERR_CONNECTION" not in c and "401" not in c]
            print(f"   console of {rater.name}: {bad[:4]}")
            check(not [c for c in bad if "Error:" in c or "Content Security" in c], f"no script of {rater.name}'s page failed", bad[:4])
    except Exception as error:  # what the pages showed then
        check(False, f"the session went on: {type(error).__name__} {error}")
        traceback.print_exc()
        for rater in people:
            print(f"   {rater.name}: {rater.shown()}", file=sys.stderr)
    finally:
        for rater in people:
            rater.browser.close()
        server.kill()
    print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
