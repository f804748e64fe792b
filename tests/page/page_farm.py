"""A farm and a Chromium for tests of the master's page. Importing this skips the test, with a reason, where Chromium is not
installed. CANDELA_PAGE_SHOTS=DIR keeps screenshots."""
import http.client
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import browser

PROGRAMS = Path(os.environ["CANDELA_PROGRAMS"])
SOURCE = Path(os.environ["CANDELA_SOURCE_DIR"])
SCENE = SOURCE / "deploy/scenes/cornell/scene.xml"
TOKEN = "correct-horse-battery-staple"
NAME = "<script>document.title='stolen'</script><img src=x onerror=alert(1)>"
SHOTS = os.environ.get("CANDELA_PAGE_SHOTS")
# Two lamps of other colors, one of which the sphere keeps from a part of the floor.
LIT_SCENE = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>
<sensor type="perspective"><float name="fov" value="50"/><transform name="to_world"><lookat origin="0, 2, 5" target="0, 0.5, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="301"/><integer name="height" value="200"/></film></sensor>
<bsdf type="diffuse" id="grey"/>
<shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform><ref id="grey"/></shape>
<shape type="sphere" id="ball"><point name="center" x="0" y="0.7" z="0"/><float name="radius" value="0.7"/><ref id="grey"/></shape>
<emitter type="point" id="key"><point name="position" x="-3" y="4" z="2"/><rgb name="intensity" value="16, 9, 4"/></emitter>
<emitter type="point" id="fill"><point name="position" x="3" y="2" z="2"/><rgb name="intensity" value="0.4, 0.9, 2"/></emitter>
</scene>"""

if browser.program() is None:
    print(f"{Path(sys.argv[0]).name}:1: Skipped\nChromium is not installed (Debian: chromium)")
    print(f"[  SKIPPED ] {Path(sys.argv[0]).stem} (0 ms)")
    sys.exit(77)


def eventually(condition, seconds=60):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if value := condition():
            return value
        time.sleep(0.1)
    return None


class PageTest(unittest.TestCase):
    """One farm and one browser for all tests of a file; every test has jobs of its own."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="candela-page-")
        cls.folder = Path(cls.scratch.name)
        (cls.folder / "token").write_text(TOKEN + "\n")
        (cls.folder / "token").chmod(0o600)
        os.environ["XDG_STATE_HOME"] = str(cls.folder / "state")
        cls.children = []
        cls.listen, cls.http = "127.0.0.1:0", "127.0.0.1:0"
        try:
            cls.start_master()
            cls.worker = cls.child("candela-worker", "--master", cls.listen, "--cache", cls.folder / "cache", "--threads", "1",
                                   "--name", NAME)
            if not eventually(lambda: "registered" in (cls.folder / "checked-master-0.log").read_text()):
                raise RuntimeError((cls.folder / "candela-worker-1.log").read_text())
            cls.browser = browser.Browser()
            tab = cls.browser.open(f"{cls.url}/#token={TOKEN}")  # from then on the browser may read
            tab.wait("/^Jobs/.test(document.title)")
            assert tab.run("location.hash") == "", "the token stays in the address"
            tab.close()
        except BaseException:
            cls.tearDownClass()
            raise

    @classmethod
    def child(cls, program, *arguments):
        with open(cls.folder / f"{program}-{len(cls.children)}.log", "wb") as log:
            cls.children.append(subprocess.Popen([PROGRAMS / program, *arguments], stdout=log, stderr=log))
        return cls.children[-1]

    @classmethod
    def start_master(cls):
        # The product's master, which also tells of violated invariants of its scheduler (tests/farm/checked_master.h).
        said = cls.folder / f"checked-master-{len(cls.children)}.log"
        cls.master = cls.child("checked-master", "--listen", cls.listen, "--http", cls.http, "--data", cls.folder / "data",
                               "--page-token-file", cls.folder / "token", "--unit-time", "0.3", "--checkpoint-interval", "1", "--lease-time", "120")
        found = eventually(lambda: re.search(r"listening on (\S+)\nhttp on (\S+)\n", said.read_text()))
        if not found:
            raise RuntimeError(said.read_text())
        cls.listen, cls.http = found.groups()
        cls.url = "http://" + cls.http

    @classmethod
    def tearDownClass(cls):
        if hasattr(cls, "browser"):
            cls.browser.close()
        for child in reversed(cls.children):
            child.terminate()
        for child in cls.children:
            child.wait(60)
        violations = [line for log in cls.folder.glob("checked-master-*.log") for line in log.read_text().splitlines()
                      if line.startswith("invariant violated: ")]
        cls.scratch.cleanup()
        if violations:
            raise AssertionError("\n".join(violations))

    def submit(self, *arguments):
        done = subprocess.run([PROGRAMS / "candela", "submit", SCENE, "--master", self.listen, "--size", "320x256", *arguments],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.strip()

    def ask(self, method, path, body=None, **fields):
        """Status, fields and text of one request; reading shows the token unless `fields` say otherwise."""
        if method in ("GET", "HEAD"):
            fields.setdefault("Authorization", "Bearer " + TOKEN)
        connection = http.client.HTTPConnection(self.http, timeout=60)
        connection.request(method, path, body, {k.replace("_", "-"): v for k, v in fields.items()})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer.status, dict(answer.getheaders()), text

    def status(self, job):
        code, _, text = self.ask("GET", f"/api/jobs/{job}")
        self.assertEqual(code, 200, text)
        return json.loads(text)

    def cancel(self, *jobs):
        for job in jobs:
            self.ask("POST", f"/api/jobs/{job}/cancel", Authorization="Bearer " + TOKEN)

    def silent(self, tab):
        self.assertEqual(tab.errors(), [])

    def shot(self, tab, name):
        if SHOTS:
            tab.screenshot(Path(SHOTS) / f"{name}.png")

    # The canvas as a number that changes with it; 0 while it is empty.
    PICTURE = """(() => { const c = document.querySelector('.stage canvas'); if (!c || !c.width) return 0;
      const k = document.createElement('canvas'); k.width = c.width; k.height = c.height;
      const g = k.getContext('2d', {willReadFrequently: true}); g.drawImage(c, 0, 0);
      const d = g.getImageData(0, 0, c.width, c.height).data; let h = 0, lit = 0;
      for (let i = 0; i < d.length; i += 4) { h = (h * 31 + d[i] + 3 * d[i + 1] + 7 * d[i + 2]) >>> 0; lit += d[i] > 8; }
      return lit > 100 ? h : 0; })()"""

    def candela(self, *arguments):
        done = subprocess.run([PROGRAMS / "candela", *map(str, arguments)], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def change(self, tab, what, value, event="change"):
        tab.run(f"(() => {{ const e = document.querySelector({json.dumps(what)}); e.value = {json.dumps(value)}; "
                f"e.dispatchEvent(new Event('{event}', {{bubbles: true}})); }})()")

    def lit_job(self, *arguments):
        """A job with two light groups that is done, and its id."""
        scene = self.folder / "lit.xml"
        scene.write_text(LIT_SCENE)
        job = self.candela("submit", scene, "--master", self.listen, "--spp", "4", "--light-groups", *arguments).stdout.strip()
        self.assertTrue(eventually(lambda: self.status(job)["state"] == "done"))
        return job
