"""Drives a real Chromium by its DevTools protocol: what a reader does with a page, and what the page did in return.

A program that imports this where there is no browser says so and ends with 77.
"""
import base64
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request

try:
    import websocket
except ImportError:
    print("skipped: python3-websocket is not installed")
    sys.exit(77)
if shutil.which("chromium") is None:
    print("skipped: chromium is not installed")
    sys.exit(77)

FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--autoplay-policy=no-user-gesture-required",
    "--remote-debugging-port=0", "--remote-allow-origins=*",
]


failures = []


def check(holds, sentence, found=""):
    """Prints whether the sentence holds; those that do not are in `failures`."""
    print(f"{'ok' if holds else 'failed'}: {sentence}{'' if holds else f' (found {found})'}", flush=True)
    if not holds:
        failures.append(sentence)
        print(f"failed: {sentence} (found {found})", file=sys.stderr)


class Refused(RuntimeError):
    """What the browser would not do."""


class Browser:
    """One browser with one page. `requests` and `complaints` (console errors, exceptions) grow while it lives."""

    def __init__(self):
        self.profile = tempfile.mkdtemp(prefix="evac-browser-")
        self.process = subprocess.Popen(
            [shutil.which("chromium"), *FLAGS, f"--user-data-dir={self.profile}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        self._attach(self._page_address())

    def _attach(self, address):
        self.address = address
        self.requests, self.complaints, self.answers, self.last_id = [], [], {}, 0
        self.socket = websocket.create_connection(address, timeout=60, suppress_origin=True)
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def tab(self):
        """Another tab of the same browser, with the same cookies; it goes with the browser."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        other = object.__new__(Browser)
        other._attach(self.address.rsplit("/", 1)[0] + "/" + target)
        return other

    def _page_address(self):
        port_file = pathlib.Path(self.profile) / "DevToolsActivePort"
        for _ in range(600):
            if port_file.exists() and port_file.read_text().strip():
                port = port_file.read_text().split()[0]
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                    pages = [target for target in json.load(answer) if target["type"] == "page"]
                if pages:
                    return pages[0]["webSocketDebuggerUrl"]
            time.sleep(0.1)
        raise RuntimeError("chromium opened no page")

    def close(self):
        self.socket.close()
        os.killpg(self.process.pid, signal.SIGTERM)
        self.process.wait()
        shutil.rmtree(self.profile, ignore_errors=True)

    def _note(self, message):
        method, params = message.get("method"), message.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        if method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description", details["text"]))
        if method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.complaints.append(params["entry"]["text"])
        if method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.complaints.append(str(params["args"]))

    def _receive(self):
        message = json.loads(self.socket.recv())
        if "id" in message:
            self.answers[message["id"]] = message
        self._note(message)
        return message

    def call(self, method, **params):
        self.last_id += 1
        wanted = self.last_id
        self.socket.send(json.dumps({"id": wanted, "method": method, "params": params}))
        while wanted not in self.answers:
            self._receive()
        answer = self.answers.pop(wanted)
        if "error" in answer:
            raise Refused(f"{method}: {answer['error']}")
        return answer["result"]

    def js(self, expression):
        """The value of an expression; promises are waited for."""
        result = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails'].get('exception', {}).get('description')}")
        return result["result"].get("value")

    def is_true(self, expression):
        """False too while the page is on its way to another one."""
        try:
            return self.js(f"Boolean({expression})")
        except Refused as refused:
            if "navigated" in str(refused) or "context" in str(refused):
                return False
            raise

    def wait(self, expression, patience_s=30):
        """Until the expression is true."""
        end = time.time() + patience_s
        while not self.is_true(expression):
            if time.time() > end:
                raise RuntimeError(f"never came true: {expression}")
            time.sleep(0.05)

    def open(self, url):
        self.call("Page.navigate", url="about:blank")  # so that a change of the hash alone is a new visit too
        self.wait("location.href === 'about:blank'")
        self.call("Page.navigate", url=url)
        self.wait("location.href !== 'about:blank' && document.readyState === 'complete'")

    def key(self, name, text=""):
        codes = {"Enter": 13, " ": 32, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Escape": 27,
                 "j": 74, "k": 75}
        if name == "Enter":
            text = "\r"
        common = {"key": name, "code": name, "windowsVirtualKeyCode": codes[name]}
        self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def press(self, name, shift=False):
        """A key of a page that reads letters and digits."""
        codes = {" ": ("Space", 32), "Home": ("Home", 36), "End": ("End", 35), "[": ("BracketLeft", 219),
                 "]": ("BracketRight", 221), ",": ("Comma", 188), ".": ("Period", 190), "?": ("Slash", 191),
                 "Escape": ("Escape", 27), "Enter": ("Enter", 13), "Tab": ("Tab", 9)}
        code, number = codes.get(name) or (f"Digit{name}" if name.isdigit() else f"Key{name.upper()}", ord(name.upper()))
        common = {"key": name, "code": code, "windowsVirtualKeyCode": number, "modifiers": 8 if shift else 0}
        text = "\r" if name == "Enter" else name if len(name) == 1 else ""
        self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def offline(self, is_off):
        self.call("Network.emulateNetworkConditions", offline=is_off, latency=0, downloadThroughput=-1, uploadThroughput=-1)

    def click(self, x, y):
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="none" if kind == "mouseMoved" else "left",
                      clickCount=0 if kind == "mouseMoved" else 1)

    def look(self, width, height, scheme):
        """As a screen of this size, light or dark."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                  mobile=width < 600)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def screenshot(self, path, full=False, clip=None):
        params = {"format": "png", "captureBeyondViewport": full or clip is not None}
        if clip:
            params["clip"] = {**clip, "scale": 1}
        pathlib.Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", **params)["data"]))

    def pdf(self):
        return base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"])
