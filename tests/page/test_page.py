"""The master's page in a real Chromium: it opens during a render, numbers and picture move, every page fits its window and is
accessible, a slow network is no trouble, and `candela render` serves the page, too."""
import json
import os
import re
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from page_farm import PageTest, NAME, PROGRAMS, SCENE, eventually


class Page(PageTest):
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
