"""The master's page in a real Chromium: it opens during a render, numbers and picture move, controls work with the token
and are refused without, foreign names are text, the console is silent, a restart of the master is survived, and a list of
5,000 jobs works. Skips, with a reason, where Chromium is not installed. CANDELA_PAGE_SHOTS=DIR keeps screenshots."""
import base64
import contextlib
import http.client
import importlib
import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import browser
import many_jobs

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
    print("test_page.py:1: Skipped\nChromium is not installed (Debian: chromium)")
    print("[  SKIPPED ] page (0 ms)")
    sys.exit(77)


def eventually(condition, seconds=60):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if value := condition():
            return value
        time.sleep(0.1)
    return None


class Page(unittest.TestCase):
    """One farm and one browser for all; every test has jobs of its own."""

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
            if not eventually(lambda: "registered" in (cls.folder / "candela-master-0.log").read_text()):
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
        said = cls.folder / f"candela-master-{len(cls.children)}.log"
        cls.master = cls.child("candela-master", "--listen", cls.listen, "--http", cls.http, "--data", cls.folder / "data",
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
        cls.scratch.cleanup()

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

    # What is on the canvas, as a number that changes with it; 0 while it is empty.
    PICTURE = """(() => { const c = document.querySelector('.stage canvas'); if (!c || !c.width) return 0;
      const k = document.createElement('canvas'); k.width = c.width; k.height = c.height;
      const g = k.getContext('2d', {willReadFrequently: true}); g.drawImage(c, 0, 0);
      const d = g.getImageData(0, 0, c.width, c.height).data; let h = 0, lit = 0;
      for (let i = 0; i < d.length; i += 4) { h = (h * 31 + d[i] + 3 * d[i + 1] + 7 * d[i + 2]) >>> 0; lit += d[i] > 8; }
      return lit > 100 ? h : 0; })()"""

    def test_numbers_and_picture_move_during_a_render(self):
        job = self.submit("--until", "relmse=1e-9", "--name", NAME)
        tab = self.browser.open(f"{self.url}/jobs/{job}")
        first = tab.wait(self.PICTURE)
        figure = "[...document.querySelectorAll('.figures div')].find(d => d.firstChild.textContent === 'Iterations').lastChild.textContent"
        iterations = tab.run(figure)
        tab.wait(f"{self.PICTURE} !== {first}")
        tab.wait(f"{figure} !== {json.dumps(iterations)}")
        # The plot with its limit, slope and the time left; the share of the worker; events; the plan.
        tab.wait("document.querySelector('.plot svg .limit') && document.querySelector('.plot svg .expected')")
        tab.wait("/slope .*expected; the limit/.test(document.querySelector('.plot svg').getAttribute('aria-label'))")
        tab.wait("document.querySelector('.shares') && document.querySelector('.events li')")
        self.assertIn("integrator: path", tab.wait("document.querySelector('pre').textContent"))
        # Foreign names are text.
        self.assertEqual(tab.run("document.querySelector('h1').textContent"), NAME)
        self.assertIn(NAME, tab.run("document.querySelector('.shares a').textContent"))
        self.assertEqual(tab.run("document.querySelectorAll('img').length"), 0)
        self.assertNotEqual(tab.run("document.title"), "stolen")
        # Exposure, zoom and the value of a pixel, by keys.
        shown = tab.run(self.PICTURE)
        tab.run("document.querySelector('.stage canvas').focus()")
        for key in ("]", "]", "+", "ArrowRight"):
            tab.call("Input.dispatchKeyEvent", {"type": "keyDown", "key": key, "text": key if len(key) == 1 else ""})
            tab.call("Input.dispatchKeyEvent", {"type": "keyUp", "key": key})
        tab.wait(f"{self.PICTURE} !== {shown} && document.querySelector('.tools label + input + output').textContent === '+1.0 EV'")
        readout = tab.wait("document.querySelector('.readout').textContent")
        self.assertRegex(readout, r"\(161, 128\)  \S+  \S+  \S+")
        self.shot(tab, "job")
        # The error map.
        tab.run("(() => { const s = document.querySelector('select'); s.value = 'error'; s.dispatchEvent(new Event('change')); })()")
        tab.wait("document.querySelector('.legend') && " + self.PICTURE)
        self.silent(tab)
        self.assertEqual([u for u in tab.requests() if not u.startswith(self.url)], [], "requests to others")
        tab.close()
        self.cancel(job)

    def test_every_page_fits_and_is_named(self):
        job = self.submit("--until", "relmse=1e-9")
        worker = json.loads(self.ask("GET", "/api/workers")[2])["workers"][0]["id"]
        tab = self.browser.open(self.url + "/")
        for path, there in (("/", "document.querySelector('tr.job')"), ("/?view=mosaic", "document.querySelector('li.job')"), ("/workers", "document.querySelector('tbody tr')"),
                            (f"/jobs/{job}", self.PICTURE), (f"/workers/{worker}", "document.querySelector('.events li')")):
            tab.go(self.url + path)
            tab.wait(there)
            for width, height, scheme in ((320, 640, "light"), (1280, 900, "dark"), (3840, 2160, "dark")):
                tab.resize(width, height, scheme)
                tab.wait(f"innerWidth === {width}")
                self.assertLessEqual(tab.run("document.documentElement.scrollWidth"), width, f"{path} at {width}")
            tab.resize(1280, 900)
            # Every control has a name for screen readers.
            self.assertEqual(tab.run("""[...document.querySelectorAll('button, input, select, a, canvas[role]')].filter(e =>
              !(e.textContent.trim() || e.getAttribute('aria-label') || document.querySelector(`label[for="${e.id}"]`)))
              .map(e => e.outerHTML).join()"""), "")
        tab.go(self.url + "/jobs/none")
        self.assertIn("no such job", tab.wait("document.querySelector('h1') && document.body.innerText"))
        tab.close()
        self.cancel(job)

    def test_controls_need_the_token(self):
        job = self.submit("--until", "relmse=1e-9")
        path = f"/api/jobs/{job}/pause"
        self.assertEqual(self.ask("POST", path)[0], 401)
        self.assertEqual(self.ask("POST", path, Authorization="Basic eDp5")[0], 401)
        self.assertEqual(self.ask("POST", path, Authorization="Bearer wrong")[0], 403)
        self.assertEqual(self.ask("POST", path, Authorization="Bearer " + TOKEN, Sec_Fetch_Site="cross-site")[0], 403)
        self.assertEqual(self.ask("GET", path)[0], 405)
        self.assertEqual(self.status(job)["state"] in ("queued", "running"), True)
        tab = self.browser.open(f"{self.url}/jobs/{job}")
        button = "[...document.querySelectorAll('button')].find(b => b.textContent === '%s')"
        tab.wait(button % "Pause")
        self.assertEqual(tab.run((button % "Pause") + ".offsetParent"), None, "shown without a token")

        def fill(field, value, go="document.querySelector('#dialog-go').click()"):
            tab.run(f"document.querySelector('#field-{field}').value = {json.dumps(value)}")
            tab.run(go)
        tab.run("document.querySelector('#unlock').click()")
        fill("token", "wrong-wrong-wrong")
        tab.wait("/not the token/.test(document.querySelector('dialog .trouble').textContent)")
        self.assertTrue(all("403" in e for e in tab.errors()), tab.errors())
        tab.forget_errors()
        fill("token", TOKEN)
        tab.wait("!document.querySelector('dialog').open")
        tab.run((button % "Pause") + ".click()")
        tab.wait("document.querySelector('.jobhead .badge').textContent === 'paused'")
        tab.run((button % "Resume") + ".click()")
        tab.wait("document.querySelector('.jobhead .badge').textContent === 'running'")
        tab.run((button % "Priority…") + ".click()")
        fill("priority", "7")
        self.assertTrue(eventually(lambda: self.status(job)["priority"] == 7))
        tab.run((button % "Extend…") + ".click()")
        fill("iterations", "12345")
        self.assertTrue(eventually(lambda: (self.status(job)["stop"]["iterations"] or 0) > 12345))
        tab.run((button % "Cancel…") + ".click()")
        tab.run("document.querySelector('#dialog-go').click()")
        tab.wait("document.querySelector('.jobhead .badge').textContent === 'cancelled'")
        self.silent(tab)
        tab.close()

    def test_reading_needs_a_token(self):
        """Claim: without a token the page tells nothing of the farm, by any path; it asks for the token, refuses a wrong one,
        and opens by the right one. The cookie that it then has reads and changes nothing."""
        job = self.submit("--iterations", "1")
        for path in ("farm", "jobs", f"jobs/{job}", f"jobs/{job}/name", f"jobs/{job}/details", f"jobs/{job}/tile?level=0&x=0&y=0",
                     f"jobs/{job}/pixel?x=0&y=0", "workers", "stream", f"stream?job={job}&kind=image", "nothing"):
            for wrong in ("", "Basic eDp5", "Bearer wrong"):
                code, _, text = self.ask("GET", "/api/" + path, Authorization=wrong)
                self.assertEqual(code, 401, path)
                self.assertIn(b"role 'read' is missing", text)
        farm_token = (self.folder / "data/token").read_text().strip()
        self.assertEqual(self.ask("GET", "/api/jobs", Authorization="Bearer " + farm_token)[0], 200)
        self.assertEqual(self.ask("POST", "/api/login", Authorization="Bearer wrong")[0], 403)
        code, fields, _ = self.ask("POST", "/api/login", Authorization="Bearer " + farm_token)
        self.assertEqual(code, 200)
        self.assertIn("HttpOnly; SameSite=Strict", fields["Set-Cookie"])
        cookie = fields["Set-Cookie"].split(";")[0]
        self.assertNotIn(farm_token, cookie)
        self.assertEqual(self.ask("GET", "/api/jobs", Authorization="", Cookie="a=b; " + cookie)[0], 200)
        self.assertEqual(self.ask("GET", "/api/jobs", Authorization="", Cookie=cookie[:-1])[0], 401)
        self.assertEqual(self.ask("POST", f"/api/jobs/{job}/cancel", Cookie=cookie)[0], 401)
        self.assertEqual(self.ask("POST", f"/api/jobs/{job}/cancel", Authorization="Bearer " + farm_token)[0], 403)
        tab = self.browser.open(f"http://localhost:{self.http.rpartition(':')[2]}/jobs/{job}")  # of this name it has no cookie
        tab.wait("document.querySelector('dialog').open")

        def give(token):
            tab.run(f"document.querySelector('#field-token').value = {json.dumps(token)}")
            tab.run("document.querySelector('#dialog-go').click()")
        give("wrong-wrong-wrong")
        tab.wait("/not the token/.test(document.querySelector('dialog .trouble').textContent)")
        give(farm_token)
        tab.wait("!document.querySelector('dialog').open && document.querySelector('.jobhead')")
        tab.close()

    def test_bad_requests_are_answered(self):
        job = self.submit("--iterations", "1")
        ok = {"Authorization": "Bearer " + TOKEN}
        self.assertEqual(json.loads(self.ask("GET", f"/api/jobs/{job}/name")[2]), {"name": self.status(job)["name"]})
        for method, path, code in (("GET", "/nothing", 404), ("GET", "/api/nothing", 404), ("GET", "/api/jobs/none", 404),
                                   ("GET", "/api/jobs/none/name", 404),
                                   ("GET", "/%zz", 400), ("GET", "/../../etc/passwd", 404), ("GET", "/api/jobs?offset=x", 400),
                                   ("GET", f"/api/jobs/{job}/tile?level=1", 400), ("PUT", "/api/jobs", 405),
                                   ("POST", "/", 405), ("POST", f"/api/jobs/{job}/nothing", 404),
                                   ("POST", f"/api/jobs/{job}/priority", 400), ("POST", f"/api/jobs/{job}/extend", 400),
                                   ("POST", "/api/workers/none/drain", 404), ("GET", "/api/stream?job=none", 404)):
            got, fields, text = self.ask(method, path, **ok)
            self.assertEqual(got, code, f"{method} {path}: {text}")
            self.assertEqual(text.count(b"\n"), 1, text)
            self.assertEqual(fields["X-Content-Type-Options"], "nosniff")
        self.assertEqual(self.ask("POST", f"/api/jobs/{job}/extend", "iterations=-1", **ok)[0], 400)
        self.assertEqual(self.ask("POST", f"/api/jobs/{job}/extend", "x" * 5000, **ok)[0], 413)
        self.assertEqual(self.ask("GET", "/", Host="evil.example")[0], 421)
        policy = self.ask("GET", "/")[1]["Content-Security-Policy"]
        self.assertIn("default-src 'none'", policy)
        self.assertNotIn("unsafe", policy)
        self.assertTrue(eventually(lambda: self.status(job)["state"] == "done"))

    def test_render_serves_its_page_until_it_is_told_to_end(self):
        said = self.folder / "render.log"
        with open(said, "wb") as log:
            render = subprocess.Popen([PROGRAMS / "candela", "render", SCENE, "-o", self.folder / "out.exr", "--size", "64x64",
                                       "--iterations", "8", "--threads", "1", "--page", "127.0.0.1:0", "--page-stay"],
                                      stdout=log, stderr=log)
        self.children.append(render)
        address = eventually(lambda: re.search(r"the page is at (http://\S+)\n", said.read_text()))
        self.assertTrue(address, said.read_text())
        self.assertTrue(eventually(lambda: "the page stays until Ctrl-C" in said.read_text()), said.read_text())
        self.assertTrue((self.folder / "out.exr").exists())
        tab = self.browser.open(address.group(1))
        tab.wait("document.querySelector('.jobhead .badge').textContent === 'done'")
        tab.wait(self.PICTURE)
        self.assertEqual(tab.run("document.querySelector('#unlock').hidden"), True)
        self.silent(tab)
        tab.close()
        render.send_signal(signal.SIGINT)
        self.assertEqual(render.wait(60), 0, said.read_text())

    # Ids of the jobs in sight, from the top.
    SEEN = """[...document.querySelectorAll('.job')].filter(e => { const b = e.getBoundingClientRect(); return b.height && b.bottom <= innerHeight; })
      .map(e => e.querySelector('a').getAttribute('href').slice(6))"""

    def press(self, tab, what):
        tab.run(f"document.querySelector({json.dumps(what)}).click()")

    def test_the_wall(self):
        """Claims: the order and the filters hold (order_cases.js); a job's picture comes, is small, and is kept by its revision;
        the image can be saved as EXR and PNG, the PNG with an exposure; each view has its address, and Back leads to the one
        before; the farm's figures are there."""
        job = self.submit("--iterations", "2", "--name", "wall/of <b>jobs")
        tab = self.browser.open(self.url + "/")
        cases = (SOURCE / "tests/page/order_cases.js").read_text()
        self.assertEqual(tab.run(f"(async () => ({cases})(await import('/order.js')))()"), [])
        tab.wait("document.querySelector('tr.job') && /^\\d+ of \\d+$/.test(document.querySelectorAll('.throughput b')[1].textContent)")
        self.assertEqual(tab.run("document.querySelectorAll('.throughput svg[role=img][aria-label]').length"), 3)
        self.assertTrue(eventually(lambda: self.status(job)["state"] == "done"))
        mine = f"""document.querySelector('.job a[href="/jobs/{job}"]').closest('.job')"""
        self.assertEqual(tab.wait(mine + ".querySelector('img').naturalWidth"), 96)
        tab.wait(f"/done/.test({mine}.textContent)")
        self.press(tab, ".layout")
        self.assertEqual(tab.wait(mine + ".querySelector('.thumb img').naturalWidth"), 256)
        self.assertEqual(tab.run("location.pathname + location.search"), "/?view=mosaic")
        self.shot(tab, "mosaic")
        self.press(tab, "[data-state=done]")
        self.assertEqual(tab.run("location.search"), "?view=mosaic&state=done")
        tab.run("history.back()")
        tab.wait("location.search === '?view=mosaic' && document.querySelector('.chip').getAttribute('aria-pressed') === 'true'")
        tab.run("history.back()")
        tab.wait("location.search === '' && document.querySelector('table.jobs')")
        self.press(tab, "[data-sort=error]")
        self.assertEqual(tab.run("location.search + document.querySelector('[aria-sort]').ariaSort"), "?sort=errordescending")
        self.silent(tab)
        # What lasts is kept by its address; the rest is asked for again.
        revision = next(j for j in json.loads(self.ask("GET", "/api/jobs")[2])["jobs"] if j["id"] == job)["thumbnail"]
        code, fields, small = self.ask("GET", f"/api/jobs/{job}/thumbnail?revision={revision}")
        self.assertEqual((code, fields["Content-Type"], small[1:4]), (200, "image/png", b"PNG"))
        self.assertIn("immutable", fields["Cache-Control"])
        self.assertEqual(self.ask("GET", f"/api/jobs/{job}/thumbnail?revision=old")[1]["Cache-Control"], "no-store")
        # Downloads.
        _, fields, exr = self.ask("GET", f"/api/jobs/{job}/image.exr")
        self.assertEqual(exr[:4], b"\x76\x2f\x31\x01")
        self.assertEqual(fields["Content-Disposition"], 'attachment; filename="wall_of_b_jobs.exr"')
        pngs = [self.ask("GET", f"/api/jobs/{job}/image.png" + q)[2] for q in ("", "?exposure=2")]
        self.assertEqual([p[1:4] for p in pngs], [b"PNG", b"PNG"])
        self.assertNotEqual(*pngs)
        self.assertEqual(self.ask("GET", f"/api/jobs/{job}/image.png?exposure=x")[0], 400)
        tab.close()

    def test_a_group_is_one_row(self):
        """Claims: frames are one row, which unfolds and folds; its address shows its frames alone; with the token all frames
        get a priority and are cancelled at once."""
        group = self.submit("--frames", "1-4", "--seed", "{frame}", "--name", "turn <b>.{frame}", "--iterations", "1000000")
        tab = self.browser.open(self.url + "/?name=turn")
        rows = "[...document.querySelectorAll('tbody .job .c-name a')].map(a => a.textContent)"
        tab.wait("document.querySelectorAll('tr.job').length === 1")
        self.assertEqual(tab.run(rows), ["turn <b>"])
        self.assertIn("0 of 4 frames", tab.run("document.querySelector('tr.group .note').textContent"))
        fold = "document.querySelector('tr.group .fold')"
        tab.run(fold + ".click()")
        self.assertEqual(tab.run(rows), ["turn <b>", *(f"turn <b>.{i}" for i in range(1, 5))])
        self.assertEqual(tab.run(fold + ".getAttribute('aria-expanded')"), "true")
        self.shot(tab, "group")
        tab.run(fold + ".click()")
        self.assertEqual(tab.run(rows), ["turn <b>"])
        self.assertEqual(tab.run("getComputedStyle(document.querySelector('.steer')).display"), "none", "without the token")
        tab.run("document.querySelector('#unlock').click()")
        tab.run(f"document.querySelector('#field-token').value = {json.dumps(TOKEN)}")
        tab.run("document.querySelector('#dialog-go').click()")
        tab.wait("!document.querySelector('dialog').open")

        def steer(label):
            tab.run("document.querySelector('.steer').click()")
            tab.run(f"[...document.querySelectorAll('dialog button')].find(b => b.textContent === {json.dumps(label)}).click()")
        steer("Priority…")
        tab.wait("document.querySelector('#field-priority')")
        tab.run("document.querySelector('#field-priority').value = '-3'")
        tab.run("document.querySelector('#dialog-go').click()")
        tab.wait("!document.querySelector('dialog').open")
        self.assertEqual(json.loads(self.ask("GET", f"/api/groups/{group}")[2])["priority"], -3)
        steer("Cancel all")
        tab.wait("document.querySelector('tr.group .badge').textContent === 'cancelled'")
        states = json.loads(self.ask("GET", f"/api/groups/{group}")[2])["states"]
        self.assertEqual(states["cancelled"], 4)
        tab.run("document.querySelector('tr.group .c-name a').click()")
        tab.wait("document.querySelectorAll('tr.job').length === 4 && !document.querySelector('tr.group')")
        self.assertEqual(tab.run("location.search"), "?group=" + group)
        self.silent(tab)
        tab.run("document.querySelector('#unlock').click()")  # other tests begin locked
        tab.close()

    # The largest difference of a byte between the canvas at 1:1 and a PNG in base 64, and the number of pixels.
    DIFFERENCE = """(async (png) => {
      const bytes = Uint8Array.from(atob(png), (c) => c.charCodeAt(0)), other = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
      const c = document.querySelector('.stage canvas'), w = other.width, h = other.height;
      const pixels = (image, x, y) => { const k = document.createElement('canvas'); k.width = w; k.height = h;
        const g = k.getContext('2d', {willReadFrequently: true}); g.drawImage(image, -x, -y); return g.getImageData(0, 0, w, h).data; };
      const a = pixels(c, Math.round(c.width / 2 - w / 2), Math.round(c.height / 2 - h / 2)), b = pixels(other, 0, 0);
      let most = 0, sum = 0; for (let i = 0; i < a.length; ++i) { most = Math.max(most, Math.abs(a[i] - b[i])); sum += (i & 3) < 3 ? b[i] : 0; }
      return [most, a.length / 4, sum]; })(%s)"""

    def difference(self, tab, png):
        return tab.run(self.DIFFERENCE % json.dumps(base64.b64encode(png.read_bytes()).decode()))

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

    def test_layers_and_false_color(self):
        """Claims: the chooser shows each layer as `candela convert --layer` does; false color has the range and the colors of
        `candela inspect falsecolor`; a rectangle has its own range, and the command that asks where its light comes from."""
        job = self.lit_job("--aov", "depth")
        exr = self.folder / "lit.exr"
        self.candela("fetch", job, "-o", exr, "--master", self.listen)
        tab = self.browser.open(f"{self.url}/jobs/{job}")
        tab.wait(self.PICTURE)
        kinds = "[...document.querySelectorAll('.tools select option')].map(o => o.value)"
        for value in ("image", "error", "mix", "layer:light.key", "layer:light.fill", "layer:depth"):
            self.assertIn(value, tab.run(kinds))
        press = "[...document.querySelectorAll('.tools button')].find(b => b.textContent === '%s').click()"
        tab.run(press % "1:1")
        for layer in ("light.key", "light.fill"):
            before = tab.run(self.PICTURE)
            self.change(tab, "select[aria-label=Picture]", "layer:" + layer)
            tab.wait(f"(p => p && p !== {before})({self.PICTURE})")
            png = self.folder / f"{layer}.png"
            self.candela("convert", exr, png, "--layer", layer)
            most, pixels, light = self.difference(tab, png)
            self.assertEqual(pixels, 301 * 200)
            self.assertGreater(light, pixels)
            self.assertLessEqual(most, 2, layer)
        # The error map and a layer of numbers are false color; the image is on request.
        before = tab.run(self.PICTURE)
        self.change(tab, "select[aria-label=Picture]", "layer:depth")
        tab.wait("/ value, viridis, linear/.test(document.querySelector('.legend').ariaLabel)")
        self.change(tab, "select[aria-label=Picture]", "image")
        tab.wait("document.querySelector('.scale').hidden")
        self.change(tab, "select[aria-label=Colors]", "luminance")
        self.change(tab, "select[aria-label=Scale]", "true")
        self.change(tab, "select[aria-label='Color map']", "turbo")
        label = "document.querySelector('.legend').ariaLabel"
        tab.wait(f"/ luminance, turbo, logarithmic/.test({label})")
        shown = json.loads(self.candela("inspect", "falsecolor", exr, "-o", self.folder / "false.png", "--log", "--map", "turbo", "--json").stdout)
        asked = f"/api/jobs/{job}/colors?channel=luminance&log=1&map=turbo"
        answer = json.loads(self.ask("GET", asked)[2])
        for theirs, ours in zip(shown["range"], (answer["low"], answer["high"])):
            self.assertAlmostEqual(theirs, ours, delta=1e-5 * theirs)
        self.assertEqual(len(answer["colors"]), 6 * 256)
        self.assertLessEqual(set(answer), set(json.loads((SOURCE / "docs/openapi.json").read_text())["paths"]["/api/jobs/{id}/colors"]["get"]
                                              ["responses"]["200"]["content"]["application/json"]["schema"]["properties"]))
        self.shot(tab, "false-color")
        # A rectangle, by the keyboard alone: its button, and fields for its corners.
        tab.run(press % "Rectangle")
        for i, value in enumerate((140, 120, 159, 139)):
            tab.run(f"(e => {{ e.value = {value}; e.dispatchEvent(new Event('change')); }})(document.querySelectorAll('.fields input')[{i}])")
        self.assertEqual(tab.wait("document.querySelector('.region code').textContent"),
                         f"candela inspect paths {self.folder}/lit.xml --pixels 140,120,159,139 --size 301x200 --overlay paths.png")
        tab.wait("/^20 × 20 pixels, luminance \\S+ to \\S+, mean/.test(document.querySelector('.region .note').textContent)")
        tab.run("document.querySelector('#ranged').click()")
        tab.wait("/luminance of the rectangle/.test(document.querySelector('.scale .note').textContent)")
        part = json.loads(self.ask("GET", asked + "&pixels=140,120,159,139")[2])
        self.assertEqual(part["pixels"], 400)
        self.assertIsNone(json.loads(self.ask("GET", asked + "&pixels=0,0,1,1")[2])["low"], "black")
        self.assertEqual(self.ask("GET", asked + "&pixels=0,0,301,0")[0], 400)
        tab.run("document.querySelector('.region .command button').click()")
        tab.wait("/Copied|Selected/.test(document.querySelector('.region .command .note').textContent)")
        # Drawn by the pointer: the button is still pressed.
        self.assertEqual(tab.run("document.querySelector('.tools button[aria-pressed=true]').textContent"), "Rectangle")
        box = tab.run("(b => [b.left + b.width / 2, b.top + b.height / 2])(document.querySelector('.stage canvas').getBoundingClientRect())")
        for kind, dx in (("mousePressed", 0), ("mouseMoved", 30), ("mouseReleased", 30)):
            tab.call("Input.dispatchMouseEvent", {"type": kind, "x": box[0] + dx, "y": box[1] + dx, "button": "left", "buttons": 1, "clickCount": 1})
        tab.wait("/^31 × 31 pixels/.test(document.querySelector('.region .note').textContent)")
        self.shot(tab, "rectangle")
        self.silent(tab)
        tab.close()

    def test_mix_of_lights(self):
        """Claims: sliders change the picture to the weighted sum of the layers, as `candela fetch --mix` writes it with the file
        that the page saves; the file comes back as it was; a file that is none is refused by its key."""
        job = self.lit_job()
        tab = self.browser.open(f"{self.url}/jobs/{job}")
        plain = tab.wait(self.PICTURE)
        tab.run("[...document.querySelectorAll('.tools button')].find(b => b.textContent === '1:1').click()")
        row = "[data-layer='light.%s'] input[type=%s]"
        self.assertEqual(tab.run("[...document.querySelectorAll('.light')].map(e => e.dataset.layer)"), ["light.key", "light.fill"])
        self.change(tab, row % ("key", "range"), "31", "input")
        tab.wait("document.querySelector('select[aria-label=Picture]').value === 'mix'")
        self.change(tab, row % ("fill", "number"), "3.5")
        self.change(tab, row % ("fill", "color"), "#ff8000", "input")
        tab.wait(f"(p => p && p !== {plain})({self.PICTURE})")
        self.shot(tab, "mix")
        saved = self.folder / "saved"
        saved.mkdir()

        def save():
            for old in saved.iterdir():
                old.unlink()
            self.browser.call("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(saved)})
            tab.run("[...document.querySelectorAll('.mix button')].find(b => b.textContent === 'Save mix.json').click()")
            self.assertTrue(eventually(lambda: (saved / "mix.json").exists() and (saved / "mix.json").read_text().endswith("}\n")))
            return (saved / "mix.json").read_text()
        text = save()
        mix = json.loads(text)["layers"]
        self.assertEqual(mix["light.fill"]["intensity"], 3.5)
        self.assertEqual([round(255 * t) for t in mix["light.fill"]["tint"]], [255, 55, 0])
        self.assertAlmostEqual(mix["light.key"]["intensity"], 8 * 0.31**3, places=5)
        exr, png = self.folder / "mixed.exr", self.folder / "mixed.png"
        self.candela("fetch", job, "-o", exr, "--png", png, "--mix", saved / "mix.json", "--master", self.listen)
        most, pixels, light = self.difference(tab, png)
        self.assertEqual(pixels, 301 * 200)
        self.assertGreater(light, pixels)
        self.assertLessEqual(most, 2)
        # By the keyboard; off is dark.
        tab.run(f"document.querySelector({json.dumps(row % ('key', 'range'))}).focus()")
        for _ in range(3):
            tab.call("Input.dispatchKeyEvent", {"type": "keyDown", "key": "ArrowRight"})
            tab.call("Input.dispatchKeyEvent", {"type": "keyUp", "key": "ArrowRight"})
        self.assertAlmostEqual(float(tab.run(f"document.querySelector({json.dumps(row % ('key', 'number'))}).value")), 8 * 0.34**3, places=3)
        tab.run(f"document.querySelector({json.dumps(row % ('key', 'checkbox'))}).click()")
        self.assertEqual(json.loads(save())["layers"]["light.key"]["intensity"], 0)

        def load(content):
            (self.folder / "load.json").write_text(content)
            found = tab.call("Runtime.evaluate", {"expression": "document.querySelector('#mix-file')"})["result"]["objectId"]
            tab.call("DOM.setFileInputFiles", {"files": [str(self.folder / "load.json")], "objectId": found})
        load(text)
        tab.wait(f"document.querySelector({json.dumps(row % ('key', 'checkbox'))}).checked")
        self.assertEqual(save(), text)
        for content, said in (("{", "no JSON"), ('{"layers": {"light.no": {}}}', "layers.light.no: this job has no such layer"),
                              ('{"layers": {"light.key": {"intensity": -1}}}', "layers.light.key.intensity: it is no number from 0"),
                              ('{"layers": {"light.key": {"tint": [1, 2]}}}', "layers.light.key.tint: it is no list of 3 numbers")):
            load(content)
            tab.wait(f"document.querySelector('.mix .trouble').textContent.includes({json.dumps(said)})")
        self.assertEqual(save(), text)
        # What the file says of itself: a mix, no error, and the same again by `candela reproduce`.
        tab.run("[...document.querySelectorAll('.mix button')].find(b => b.textContent === 'Reset').click()")
        self.assertEqual(json.loads(save()), {"layers": {}})
        self.silent(tab)
        tab.close()
        self.assertIn("equal: ", self.candela("reproduce", exr, "--run", "--threads", "1", "--quiet").stdout)
        refused = subprocess.run([PROGRAMS / "candela", "fetch", job, "-o", exr, "--mix", saved / "mix.json", "--error-layer", "--master",
                                  self.listen], capture_output=True, text=True, check=False)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--error-layer: the error is estimated of the image before the mix", refused.stderr)

    def test_accessible(self):
        """Claim: axe-core finds nothing, in both schemes, on a phone and on a desk."""
        axe = os.environ.get("CANDELA_AXE") or next((str(p) for p in (Path("/usr/lib/node_modules"), Path("/usr/local/lib/node_modules"))
                                                     if (p / "axe-core/axe.min.js").exists()), "")
        axe = Path(axe) if axe.endswith(".js") else Path(axe) / "axe-core/axe.min.js"
        if not axe.is_file():
            self.skipTest("axe-core is not installed: npm install -g axe-core, or CANDELA_AXE=.../axe.min.js")
        script, job, lit = axe.read_text(), self.submit("--iterations", "2"), self.lit_job("--aov", "depth")
        worker = json.loads(self.ask("GET", "/api/workers")[2])["workers"][0]["id"]
        tab = self.browser.open(self.url + "/")
        for path, there in (("/", "tr.job"), ("/?view=mosaic", "li.job"), ("/?state=done&sort=left", "table.jobs"), ("/workers", "tbody tr"),
                            (f"/jobs/{job}", ".jobhead"), (f"/workers/{worker}", ".events li"), (f"/jobs/{lit}", ".light")):
            tab.go(self.url + path)
            tab.wait(f"document.querySelector('{there}')")
            if there == ".light":  # with all that lies around a picture
                self.change(tab, "select[aria-label=Picture]", "layer:depth")
                tab.wait("document.querySelector('.ticks span')")
                tab.run("[...document.querySelectorAll('.tools button')].find(b => b.textContent === 'Rectangle').click()")
                tab.wait("!document.querySelector('.region').hidden")
            tab.run(script + ";0")
            for width, scheme in ((360, "dark"), (1280, "light")):
                tab.resize(width, 720, scheme)
                found = tab.run("axe.run().then(r => r.violations.map(v => v.id + ': ' + v.nodes.map(n => n.html).join(' ')))")
                self.assertEqual(found, [], f"{path} at {width}, {scheme}")
        tab.close()

    def test_z_5000_jobs_and_a_restart_of_the_master(self):
        """Claims: the page survives a restart of the master. Of 5,000 jobs it shows at once what matters, in the master's order,
        20 of them and more on a small screen; it holds few elements, and finds a job in no time, at the end of the list, too."""
        subprocess.run([PROGRAMS / "candela", "drain", self.worker_id(), "--master", self.listen, "--wait"], check=True,
                       capture_output=True)
        template = self.submit("--iterations", "1")
        tab = self.browser.open(self.url + "/", 1280, 720)
        tab.wait("document.querySelector('tr.job') && document.querySelector('#live').textContent === 'Live'")
        self.silent(tab)
        self.master.send_signal(signal.SIGTERM)
        self.master.wait(60)
        tab.wait("/lost/.test(document.querySelector('#live').textContent)")
        long = "unit 7 failed on 3 workers: the scene needs more memory than any of them has: " + "give it more memory " * 9
        rows = [{"id": f"jmany{i:05}", "name": f"many-{i}", "submitted_unix_ms": 10**12 + i, "finished_unix_ms": 10**12 + 2 * i,
                 "state": "failed" if i < 9 else "queued" if i < 60 else "done" if i < 4500 else "cancelled",
                 "priority": i % 3 if i < 60 else 0, "message": long if i < 9 else ""} for i in range(5000)]
        many_jobs.copy_jobs(self.folder / "data", [(template, row) for row in rows])
        self.start_master()
        tab.wait("document.querySelector('#live').textContent === 'Live' && /^many-8/.test(document.querySelector('.job .c-name').textContent)")
        count = "Number(document.querySelector('.chip b').textContent)"
        tab.wait(f"{count} >= 5000 && document.querySelector('.more').textContent.includes('more failed ones') && !/Loading/.test(document.querySelector('.more').textContent)")
        seen = tab.run(self.SEEN)
        self.assertGreaterEqual(len(seen), 20)
        order = [j for j in json.loads(self.ask("GET", "/api/jobs?order=wall")[2])["jobs"]]
        failed = [j["id"] for j in order if j["state"] == "failed"]
        self.assertEqual(seen, [j["id"] for j in order if j["id"] not in failed[5:]][:len(seen)])
        self.assertLess(tab.run("document.querySelectorAll('*').length"), 2000)
        # No message widens the page or a line.
        self.assertEqual(tab.run("document.documentElement.scrollWidth - document.documentElement.clientWidth"), 0)
        self.assertEqual(tab.run("new Set([...document.querySelectorAll('.job')].map(e => e.getBoundingClientRect().height)).size"), 1)
        self.shot(tab, "wall-5000")

        def took(script):
            return tab.run(f"""(async () => {{ const t = performance.now(); {script};
              await new Promise(requestAnimationFrame); await new Promise(requestAnimationFrame); return performance.now() - t; }})()""")
        self.assertLess(took("scrollTo(0, document.body.scrollHeight)"), 2000)
        tab.wait("/many-4500/.test([...document.querySelectorAll('.job')].at(-1).textContent)")  # the oldest of the cancelled
        self.assertLess(took("""const box = document.querySelector('input[type=search]'); box.value = 'many-4321'; box.dispatchEvent(new Event('input'))"""), 2000)
        self.assertEqual(tab.run("[...document.querySelectorAll('.job .c-name a')].map(a => a.textContent).join()"), "many-4321")
        tab.wait("location.search === '?name=many-4321'")
        # A job and back: the view and its place are what they were.
        tab.run("document.querySelector('.job a').click()")
        tab.wait("document.querySelector('.jobhead')")
        tab.run("history.back()")
        tab.wait("document.querySelector('.job') && document.querySelector('input[type=search]').value === 'many-4321'")
        tab.go(self.url + "/?state=failed&sort=submitted&order=up")
        tab.wait("document.querySelectorAll('.job').length >= 9 && !/Loading/.test(document.querySelector('.more').textContent)")
        self.assertEqual(tab.run("[...document.querySelectorAll('.job .c-name a')].slice(-9).map(a => a.textContent)"), [f"many-{i}" for i in range(9)])
        job = self.submit("--iterations", "1", "--name", "after-restart")
        tab.go(self.url + "/?name=after-restart")
        tab.wait("/after-restart/.test(document.querySelector('.job').textContent)")
        # While the master is away there is nobody to connect to, and nothing else went wrong.
        self.assertTrue(all("ERR_CONNECTION" in e or "ERR_INCOMPLETE" in e or "ERR_EMPTY" in e for e in tab.errors()), tab.errors())
        tab.close()
        self.cancel(job)

    def worker_id(self):
        return next(w["id"] for w in json.loads(self.ask("GET", "/api/workers")[2])["workers"] if w["state"] != "lost")

    def wire(self):
        """The protocol's module of workers: a process for each of 1,000 takes minutes."""
        protoc = shutil.which("protoc")
        if not protoc or importlib.util.find_spec("grpc") is None:
            self.skipTest("1,000 workers need protoc and python3-grpcio")
        made = self.folder / "proto"
        if not made.exists():
            made.mkdir()
            subprocess.run([protoc, "-I", SOURCE / "proto", f"--python_out={made}", *map(str, (SOURCE / "proto").rglob("*.proto"))],
                           check=True)
            sys.path.insert(0, str(made))
        return importlib.import_module("candela.v1.worker_pb2")

    @contextlib.contextmanager
    def calls(self, service):
        """A function that asks `service` of the master: call(name, request, class of the answer)."""
        token = (self.folder / "data" / "token").read_text().strip()
        with importlib.import_module("grpc").insecure_channel(self.listen) as channel:
            def call(name, request, answer):
                return channel.unary_unary(f"/candela.v1.{service}/{name}", request_serializer=type(request).SerializeToString,
                                           response_deserializer=answer.FromString)(
                                               request, timeout=60, metadata=(("candela-token", token),))
            yield call

    def test_zz_1000_workers(self):
        """Claims: the list has them all, follows those that leave, and finds one at once; the console is silent."""
        worker = self.wire()
        version = json.loads(subprocess.check_output([PROGRAMS / "candela", "version", "--json"]))
        with self.calls("WorkerService") as call:
            def join(i):
                return call("Register", worker.RegisterRequest(protocol=version["protocol"], build_id=version["build_id"],
                                                               name=f"node-{i:04}", host=f"rack-{i // 40}", threads=16, isas=["sse2"],
                                                               memory_bytes=1 << 36), worker.RegisterResponse)
            joined = [join(i) for i in range(1000)]
            tab = self.browser.open(self.url + "/workers")
            tab.wait("[...document.querySelectorAll('tbody tr')].filter(r => /node-/.test(r.textContent)).length === 1000")
            summary = "document.querySelector('.summary').textContent"
            tab.wait(f"/ 160\\d\\d threads/.test({summary})")
            self.assertLess(tab.run("""(async () => { const t = performance.now(), search = document.querySelector('input[type=search]');
              search.value = 'node-0777'; search.dispatchEvent(new Event('input'));
              await new Promise(requestAnimationFrame); return performance.now() - t; })()"""), 2000)
            self.assertEqual(tab.run("[...document.querySelectorAll('tbody tr')].filter(r => !r.hidden).length"), 1)
            for each in joined[:500]:
                call("Deregister", worker.DeregisterRequest(worker_id=each.worker_id, session=each.session), worker.DeregisterResponse)
            tab.wait("[...document.querySelectorAll('tbody tr')].filter(r => /node-/.test(r.textContent)).length === 500")
            tab.wait(f"/^50[01] workers/.test({summary})")
            one = self.browser.open(f"{self.url}/workers/{joined[777].worker_id}")
            one.wait("/node-0777/.test(document.body.textContent)")
            for each in (tab, one):
                self.silent(each)
                each.close()
            for each in joined[500:]:
                call("Deregister", worker.DeregisterRequest(worker_id=each.worker_id, session=each.session), worker.DeregisterResponse)

    def test_slow_network(self):
        """Claim: over 40 kB/s and 0.4 s of latency numbers and picture come and move, and a control works."""
        job = self.submit("--until", "relmse=1e-9", "--name", "far-away")
        tab = self.browser.open("about:blank")
        tab.call("Network.emulateNetworkConditions", {"offline": False, "latency": 400, "downloadThroughput": 40e3, "uploadThroughput": 40e3})
        tab.go(f"{self.url}/jobs/{job}")
        first = tab.wait(self.PICTURE)
        tab.wait(f"{self.PICTURE} !== {first}")
        began = time.monotonic()
        self.cancel(job)
        tab.wait("document.querySelector('.jobhead .badge').textContent === 'cancelled'")
        self.assertLess(time.monotonic() - began, 60)
        self.silent(tab)
        tab.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
