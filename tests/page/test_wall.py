"""The wall of jobs and the list of workers in a real Chromium: order, filters, addresses, groups of frames, a restart of the
master, 5,000 jobs, 1,000 workers."""
import contextlib
import importlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import many_jobs
from page_farm import PageTest, PROGRAMS, SOURCE, TOKEN, eventually


class Wall(PageTest):
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
        self.assertEqual(tab.run("(async () => { const {duration} = await import('/dom.js'); return [59, 3599, 86399, 8.6e7, 1.2e10, 1e14].map(duration); })()"),
                         ["59 s", "59 min 59 s", "23 h 59 min", "995 d 8 h", "380 years", "> 999 years"])
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
        # The address keeps what lasts; the rest is asked for again.
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
