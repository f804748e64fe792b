"""Measures what viewers of the page cost the master: viewers.py [--viewers N] [--seconds S] [--size WxH] [--jobs N]

Each viewer asks as a browser does: the job, its stream, and after each picture all tiles of the level that fits into 1,280
pixels, with the tags of those that it has. The cost is the processor time of the master's two threads that serve the page
(`http` and `page` in /proc) while a worker renders. Also with the error map, the list of jobs, and nobody at all."""
import argparse
import http.client
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

PROGRAMS = Path(os.environ["CANDELA_PROGRAMS"])
SOURCE = Path(os.environ["CANDELA_SOURCE_DIR"])
SCENE = SOURCE / "deploy/scenes/studio/scene.xml"
TICK = os.sysconf("SC_CLK_TCK")


class Viewer(threading.Thread):
    """One open page. `kind`: image, error, or list."""

    def __init__(self, address, token, job, kind):
        super().__init__(daemon=True)
        self.token = token
        self.address, self.job, self.kind = address, job, kind
        self.tags, self.over = {}, False
        self.pictures = self.tiles = self.unchanged = self.bytes = self.events = 0
        self.trouble = None

    def get(self, path, fields=None):
        link = http.client.HTTPConnection(self.address, timeout=60)
        link.request("GET", path, headers={"Authorization": "Bearer " + self.token, **(fields or {})})
        answer = link.getresponse()
        text = answer.read()
        link.close()
        if answer.status not in (200, 304):
            raise ValueError(f"{path}: {answer.status}")
        self.bytes += len(text)
        return answer.status, answer.getheader("ETag"), text

    def run(self):
        try:
            self.watch()
        except (OSError, ValueError, http.client.HTTPException) as error:
            if not self.over:
                self.trouble = error

    def watch(self):
        self.get("/api/jobs?offset=0" if self.kind == "list" else f"/api/jobs/{self.job}")
        link = http.client.HTTPConnection(self.address, timeout=60)
        path = "/api/stream" if self.kind == "list" else f"/api/stream?job={self.job}&kind={self.kind}"
        link.request("GET", path, headers={"Authorization": "Bearer " + self.token})
        answer = link.getresponse()
        if answer.status != 200:
            raise ValueError(f"{path}: {answer.status}")
        kind = ""
        for line in answer:
            if self.over:
                return
            self.bytes += len(line)
            if line.startswith(b"event: "):
                kind = line[7:].strip()
                self.events += 1
            elif line.startswith(b"data: ") and kind == b"picture":
                self.fetch(json.loads(line[6:])["levels"])

    def fetch(self, levels):
        self.pictures += 1
        level = next((i for i, size in enumerate(levels) if size["width"] <= 1280), len(levels) - 1)
        for y in range(0, levels[level]["height"], 256):
            for x in range(0, levels[level]["width"], 256):
                key = (level, x // 256, y // 256)
                fields = {"If-None-Match": self.tags[key]} if key in self.tags else {}
                status, tag, _ = self.get(f"/api/jobs/{self.job}/tile?kind={self.kind}&level={level}&x={key[1]}&y={key[2]}", fields)
                self.tiles += status == 200
                self.unchanged += status == 304
                if tag:
                    self.tags[key] = tag


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("--viewers", type=int, default=10)
    asked.add_argument("--seconds", type=float, default=60)
    asked.add_argument("--size", default="1920x1080")
    asked.add_argument("--jobs", type=int, default=1, help="jobs in the list")
    asked.add_argument("--most", type=float, default=0, help="fail where a form takes more of a core")
    given = asked.parse_args()
    with tempfile.TemporaryDirectory(prefix="candela-viewers-") as scratch:
        folder, children = Path(scratch), []

        def child(program, *arguments):
            with open(folder / f"{program}.log", "wb") as log:
                children.append(subprocess.Popen([PROGRAMS / program, *arguments], stdout=log, stderr=log))
            return children[-1]
        try:
            return measure(given, folder, child)
        finally:
            for one in reversed(children):
                one.terminate()
                one.wait(60)


def measure(given, folder, child):
    # A plain master: one that looks at its invariants takes more CPU time.
    master = child("candela-master", "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--data", folder / "data",
                   "--unit-time", "1")
    said = folder / "candela-master.log"
    while not (found := re.search(r"listening on (\S+)\nhttp on (\S+)\n", said.read_text())):
        if master.poll() is not None:
            raise RuntimeError(said.read_text())
        time.sleep(0.1)
    listen, address = found.groups()
    token = (folder / "data/token").read_text().strip()

    def submit():
        return subprocess.run([PROGRAMS / "candela", "submit", SCENE, "--master", listen, "--size", given.size, "--until",
                               "relmse=1e-9"], check=True, capture_output=True, text=True).stdout.strip()
    job = submit()
    for _ in range(given.jobs - 1):
        submit()
    child("candela-worker", "--master", listen, "--cache", folder / "cache", "--threads", "1")

    def processor_seconds():
        """Of all threads, and of those of the page."""
        every, page = 0.0, 0.0
        for thread in Path(f"/proc/{master.pid}/task").iterdir():
            try:
                name = (thread / "comm").read_text().strip()
                fields = (thread / "stat").read_text().rsplit(")", 1)[1].split()
            except FileNotFoundError:
                continue
            seconds = (int(fields[11]) + int(fields[12])) / TICK
            every += seconds
            page += seconds if name in ("http", "page") else 0
        return every, page

    def iterations():
        viewer = Viewer(address, token, job, "image")
        return json.loads(viewer.get(f"/api/jobs/{job}")[2])["iterations"]
    while iterations() < 4:
        time.sleep(0.2)
    print(f"{given.viewers} viewers, {given.size}, windows of {given.seconds:g} s, load {os.getloadavg()[0]:.1f}", flush=True)
    worst = 0.0
    for kind in ("nobody", "image", "error", "list"):
        viewers = [] if kind == "nobody" else [Viewer(address, token, job, kind) for _ in range(given.viewers)]
        for viewer in viewers:
            viewer.start()
        time.sleep(min(5, given.seconds / 4))  # what each viewer gets at the start comes once
        before, began, done = processor_seconds(), time.monotonic(), iterations()
        counts = [(v.pictures, v.tiles, v.unchanged, v.bytes) for v in viewers]
        time.sleep(given.seconds)
        after, took = processor_seconds(), time.monotonic() - began
        every, page = ((b - a) / took for a, b in zip(before, after))
        changes = [[b - a for a, b in zip(c, (v.pictures, v.tiles, v.unchanged, v.bytes))] for c, v in zip(counts, viewers)]
        mean = [statistics.mean(c) for c in zip(*changes)] if changes else [0, 0, 0, 0]
        print(f"{kind:7} page {100 * page:5.2f} % of a core, master {100 * every:6.2f} %; {iterations() - done} iterations; each viewer: "
              f"{mean[0]:.1f} pictures, {mean[1]:.0f} tiles, {mean[2]:.0f} unchanged, {mean[3] / took / 1e3:.1f} kB/s", flush=True)
        worst = max(worst, page)
        for viewer in viewers:
            viewer.over = True
        for viewer in viewers:
            viewer.join(10)
        for viewer in viewers:
            if viewer.trouble:
                raise viewer.trouble
        if viewers and kind != "list" and mean[0] == 0:
            raise RuntimeError("no picture came")
    if given.most and worst > given.most:
        print(f"FAILED: {worst:.4f} of a core, at most {given.most} is allowed")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
