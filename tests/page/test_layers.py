"""The picture of a job in a real Chromium: its layers, false color, a rectangle, and mixes of lights, each as the command makes
it."""
import base64
import json
import os
import subprocess
import sys
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from page_farm import PageTest, PROGRAMS, SOURCE, eventually


class Layers(PageTest):
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
            self.change(tab, "select[aria-label=Picture]", "layer:" + layer)
            png = self.folder / f"{layer}.png"
            self.candela("convert", exr, png, "--layer", layer)
            # The canvas may still be drawn anew for its size, with the picture before.
            until = time.monotonic() + 60
            while True:
                most, pixels, light = self.difference(tab, png)
                if most <= 2 or time.monotonic() > until:
                    break
                time.sleep(0.05)
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
                         f"candela inspect paths {self.folder}/lit.xml --pixels 140,120,159,139 --size 301x200 --set max_depth=3 --overlay paths.png")
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

    def test_command_of_an_edited_job(self):
        """Claim: the command of a rectangle, as the page shows it, finds the light of a job whose edits and longest paths are not those
        of the scene; the rectangle's panel stands next to the picture, above the mix of lights."""
        edits = self.folder / "dim.json"
        edits.write_text(json.dumps({"edits": [{"name": "dim", "direction": "light", "select": "LX*D{floor}", "scale": 0.25}]}, indent=2))
        job = self.lit_job("--edits", edits, "--set", "max_depth=2")
        tab = self.browser.open(f"{self.url}/jobs/{job}")
        tab.wait(self.PICTURE)
        tab.run("[...document.querySelectorAll('.tools button')].find(b => b.textContent === 'Rectangle').click()")
        for i, value in enumerate((20, 150, 279, 189)):
            tab.run(f"(e => {{ e.value = {value}; e.dispatchEvent(new Event('change')); }})(document.querySelectorAll('.fields input')[{i}])")
        shown = tab.wait("/^260 × 40 pixels, luminance .* mean (\\S+)$/.exec(document.querySelector('.region .note').textContent)?.[1]")
        command = tab.run("document.querySelector('.region code').textContent")
        said = json.loads(subprocess.run(command + " --json", shell=True, capture_output=True, text=True, check=True, cwd=self.folder,
                                         env={**os.environ, "PATH": f"{PROGRAMS}:{os.environ['PATH']}"}).stdout)
        self.assertAlmostEqual(said["luminance"], float(shown), delta=0.02 * float(shown), msg=command)
        self.assertLess(*tab.run("['.region', '.mix'].map(e => document.querySelector(e).getBoundingClientRect().top)"))
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
        # The file says this of itself: a mix, no error, and the same again by `candela reproduce`.
        tab.run("[...document.querySelectorAll('.mix button')].find(b => b.textContent === 'Reset').click()")
        self.assertEqual(json.loads(save()), {"layers": {}})
        self.silent(tab)
        tab.close()
        self.assertIn("equal: ", self.candela("reproduce", exr, "--run", "--threads", "1", "--quiet").stdout)
        refused = subprocess.run([PROGRAMS / "candela", "fetch", job, "-o", exr, "--mix", saved / "mix.json", "--error-layer", "--master",
                                  self.listen], capture_output=True, text=True, check=False)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--error-layer: the error is estimated of the image before the mix", refused.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
