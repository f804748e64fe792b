"""Who may read the page and who may steer, in a real Chromium and by requests: controls work with the token and are refused
without, and bad requests are answered."""
import json
import os
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from page_farm import PageTest, TOKEN, eventually


class Access(PageTest):
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
