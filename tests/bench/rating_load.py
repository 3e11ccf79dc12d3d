#!/usr/bin/env python3
"""A full house for the rating server: how long a verdict takes until it is on disk, and whether any is lost or doubled.

  tests/bench/rating_load.py RUN [--raters 200] [--players 50] [--seconds 120] [--kills 10]

Makes a study of RUN's clips, starts `evac rate serve`, lets raters answer every few seconds over keep-alive connections
while players ask for ranges of their clips and a lead looks at the board, kills the server (-9) at random moments and
starts it again. At the end the store is compared with what was answered 200. Exit 1 if they differ or p99 is 50 ms or
more. Nothing but Python's own library is needed."""
import argparse
import asyncio
import hashlib
import json
import pathlib
import random
import re
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import uuid


class Server:
    def __init__(self, evac, study):
        self.command, self.study, self.port, self.down_s = [evac, "rate", "serve", str(study)], study, 0, []

    def start(self):
        log = self.study / "serve.log"
        with open(log, "w") as out:
            self.process = subprocess.Popen(self.command + ["--port", str(self.port)], stdout=out, stderr=out)
        while True:
            found = re.search(r"http://[^/\s]+:(\d+)/\n", log.read_text())
            if found:
                self.port = int(found[1])
                return
            if self.process.poll() is not None:
                sys.exit(f"the server ended: {log.read_text()}")
            time.sleep(0.005)

    def kill(self):
        began = time.monotonic()
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.start()
        self.down_s.append(time.monotonic() - began)


class Client:
    """One browser: one connection kept open, made anew when it breaks, from an address of its own."""

    def __init__(self, server, number):
        self.server, self.address = server, f"127.0.{1 + number // 250}.{1 + number % 250}"
        self.name, self.cookie, self.reader, self.writer = "none", "", None, None

    async def once(self, method, path, body=b"", head=""):
        if not self.writer:
            self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self.server.port,
                                                                     local_addr=(self.address, 0))
        csrf = hashlib.sha256(("csrf " + self.cookie).encode()).hexdigest()[:32]
        self.writer.write((f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.server.port}\r\n"
                           f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n"
                           f"Cookie: {self.name}={self.cookie}\r\nX-Evac-Csrf: {csrf}\r\n{head}\r\n").encode() + body)
        text = (await self.reader.readuntil(b"\r\n\r\n")).decode()
        length = int(re.search(r"(?i)content-length: *(\d+)", text)[1])
        return int(text.split(" ", 2)[1]), text, await self.reader.readexactly(length)

    async def ask(self, method, path, body=None, head=""):
        """Until it is answered, however often the server dies. @returns status, head, body, seconds of the last try."""
        data = b"" if body is None else json.dumps(body).encode()
        while True:
            began = time.monotonic()
            try:
                status, text, answer = await self.once(method, path, data, head)
            except (OSError, asyncio.IncompleteReadError):
                self.writer = None
                await asyncio.sleep(0.02)
                continue
            if status not in (429, 503):
                return status, text, answer, time.monotonic() - began
            await asyncio.sleep(0.5)

    async def join(self, link):
        status, text, answer, _ = await self.ask("POST", "/api/join", {"invite": link, "uuid": uuid.uuid4().hex})
        if status != 200:
            sys.exit(f"join: {status} {answer.decode()}")
        self.name, self.cookie = re.search(r"(evac_rating_[0-9a-f]+)=([0-9a-f]{32})", text).groups()


async def rate(client, tally, until, think_s):
    await asyncio.sleep(random.random() * think_s)
    epoch = json.loads((await client.ask("POST", "/api/tab", {}))[2])["tab_epoch"]
    while time.monotonic() < until:
        status, _, answer, seconds = await client.ask("POST", "/api/next", {"tab_epoch": epoch})
        if status != 200 or "presentation" not in json.loads(answer):
            tally["out of clips"] += 1
            return
        tally["next"].append(seconds)
        presentation = client.clip = json.loads(answer)["presentation"]
        await asyncio.sleep(random.uniform(0.5, 1.5) * think_s)
        name = uuid.uuid4().hex
        body = {"client_uuid": name, "presentation": presentation, "tab_epoch": epoch, "coverage": 1,
                "label": random.choice(["success", "failure", "cannot_tell"]), "rt_ms": 1000 * think_s}
        status, _, answer, seconds = await client.ask("POST", "/api/verdict", body)
        if status != 200:
            sys.exit(f"verdict: {status} {answer.decode()}")
        tally["verdict"].append(seconds)
        tally["answered"].append(name)


async def play(rater, number, tally, until):
    """What a video element does: parts of the file, one after the other, faster than it is shown."""
    client = Client(rater.server, number)
    client.cookie = rater.cookie
    while time.monotonic() < until:
        clip, at = rater.clip, 0
        while clip and clip == rater.clip and time.monotonic() < until:
            status, text, part, seconds = await client.ask("GET", "/clip/" + clip, head=f"Range: bytes={at}-{at + 16383}\r\n")
            if status != 206:
                break
            tally["range"].append(seconds)
            tally["bytes"] += len(part)
            at = (at + len(part)) % int(re.search(r"(?i)content-range: bytes \d+-\d+/(\d+)", text)[1])
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.1)


async def lead(client, tally, until):
    while time.monotonic() < until:
        tally["board"].append((await client.ask("GET", "/api/board"))[3])
        await asyncio.sleep(5)


async def murder(server, kills, seconds):
    moments = sorted(random.uniform(0.05, 0.95) * seconds for _ in range(kills))
    began = time.monotonic()
    for moment in moments:
        await asyncio.sleep(max(0, moment - (time.monotonic() - began)))
        await asyncio.to_thread(server.kill)


def line(name, seconds):
    values = sorted(seconds)
    at = lambda q: 1000 * values[min(len(values) - 1, int(q * len(values)))]
    print(f"{name:<14} n {len(values):>6}   median {at(0.5):6.1f}   p99 {at(0.99):6.1f}   longest {at(1):7.1f} ms")
    return at(0.99)


async def house(options, server, links, lead_link):
    tally = {"next": [], "verdict": [], "answered": [], "range": [], "board": [], "bytes": 0, "out of clips": 0}
    raters = [Client(server, k) for k in range(options.raters)]
    for rater in raters:
        rater.clip = None
    await asyncio.gather(*(rater.join(link) for rater, link in zip(raters, links)))
    head = Client(server, options.raters)
    await head.join(lead_link)
    until = time.monotonic() + options.seconds
    await asyncio.gather(*(rate(rater, tally, until, options.think_s) for rater in raters),
                         *(play(raters[k % len(raters)], options.raters + 1 + k, tally, until)
                           for k in range(options.players)),
                         lead(head, tally, until), murder(server, options.kills, options.seconds))
    return tally


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--evac", default="build/release/bin/evac")
    parser.add_argument("--raters", type=int, default=200)
    parser.add_argument("--players", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--think-s", type=float, default=3)
    options = parser.parse_args()
    random.seed(1)
    with tempfile.TemporaryDirectory() as folder:
        study = pathlib.Path(folder) / "study"
        said = lambda *words: subprocess.run([options.evac, "rate", *words], check=True, capture_output=True, text=True).stdout
        said("new", str(study), "--run", str(options.run), "--raters", "50", "--height", "128")
        secrets = lambda text: [word[-32:] for word in text.split()]
        links = secrets(said("invite", str(study), "--count", str(options.raters)))
        lead_link = secrets(said("invite", str(study), "--role", "lead"))[0]
        server = Server(options.evac, study)
        server.start()
        try:
            tally = asyncio.run(house(options, server, links, lead_link))
            with open(f"/proc/{server.process.pid}/status") as status:
                memory_kb = int(re.search(r"VmHWM:\s+(\d+)", status.read())[1])
        finally:
            server.process.kill()
            server.process.wait()
        stored = [row[0] for row in sqlite3.connect(study / "study.sqlite").execute("SELECT client_uuid FROM verdicts")]
    p99 = line("verdict", tally["verdict"])
    line("next clip", tally["next"])
    if tally["range"]:
        line("part of a clip", tally["range"])
    line("lead's board", tally["board"])
    if server.down_s:
        print(f"killed {len(server.down_s)} times; back after {1000 * min(server.down_s):.0f} … {1000 * max(server.down_s):.0f} ms")
    print(f"{len(tally['verdict']) / options.seconds:.0f} verdicts a second of {options.raters} raters, "
          f"{tally['bytes'] / 1e6 / options.seconds:.1f} MB a second to {options.players} players, "
          f"server's memory at most {memory_kb / 1024:.0f} MiB, {tally['out of clips']} raters ran out of clips")
    lost, extra = set(tally["answered"]) - set(stored), set(stored) - set(tally["answered"])
    doubled = len(stored) - len(set(stored))
    print(f"{len(stored)} verdicts stored, {len(lost)} lost, {doubled} doubled, {len(extra)} that nobody was told of")
    return 1 if lost or doubled or extra or p99 >= 50 else 0


if __name__ == "__main__":
    sys.exit(main())
