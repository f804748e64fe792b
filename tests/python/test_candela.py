"""The Python package against a farm of real processes. Skips, with a reason, where Debian's modules are absent."""
import dataclasses
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

MODULES = {"grpc": "python3-grpcio", "google.protobuf": "python3-protobuf", "numpy": "python3-numpy",
           "OpenImageIO": "python3-openimageio"}


def absent_packages():
    for module, package in MODULES.items():
        try:
            importlib.import_module(module)
        except ImportError:
            yield package


missing = list(absent_packages())
if missing:
    print(f"test_candela.py:1: Skipped\nthese Debian packages are absent: {' '.join(missing)}")
    print("[  SKIPPED ] python_client (0 ms)")
    sys.exit(0)

import numpy as np

import candela

SCENE = Path(os.environ["CANDELA_SOURCE_DIR"]) / "deploy/scenes/cornell/scene.xml"
SMALL = {"size": (24, 16), "seed": 7}
BROKEN = """<scene version='3.0.0'><integrator type='path'/>
<shape type='spehre'/></scene>"""


class Package(unittest.TestCase):
    """Without a farm."""

    def test_protocol_is_the_programs(self):
        """Claim: the package speaks the protocol of the programs it was built with."""
        answer = subprocess.run([candela.program.find_program("candela"), "version", "--json"], check=True,
                                capture_output=True, text=True)
        self.assertEqual(json.loads(answer.stdout)["protocol"], candela.farm.PROTOCOL)

    def test_module_is_the_command(self):
        """Claim: python3 -m candela is the command candela, its exit code too."""
        command = [sys.executable, "-m", "candela"]
        self.assertTrue(subprocess.check_output([*command, "version"], text=True).startswith("candela "))
        self.assertEqual(subprocess.run([*command, "rendr"], stderr=subprocess.DEVNULL).returncode, 2)

    def test_settings_become_options(self):
        """Claim: every setting reaches the command line as an option that the program has; others are refused."""
        program = candela.program
        values = {"integrator": "bdpt", "settings": {"max_depth": 5, "hide_emitters": True}, "parameters": {"a": 1},
                  "spp": 4, "iterations": 4, "time": "10m", "until": 1e-3, "seed": 1, "size": (2, 3), "filter": "box",
                  "sampler": "sobol", "isa": "avx2", "lenient": True, "aov": ["albedo", "depth"], "indices": "0-3/0-2",
                  "layers": {"a": "LDE"}, "regions": {"b": "sphere:0,0,0,1"}, "glossy_below": 0.2, "light_groups": True,
                  "partition": True, "edits": "e.json", "crop": (1, 0, 1, 2)}
        self.assertEqual(set(values), set(program.SceneSettings.__annotations__))
        arguments = program.scene_arguments(values)
        self.assertIn("hide_emitters=true", arguments)
        self.assertIn("relmse=0.001", arguments)
        self.assertIn("albedo,depth", arguments)
        self.assertIn("a=LDE", arguments)
        self.assertIn("--glossy-below=0.2", arguments)
        help_text = subprocess.check_output([program.find_program("candela"), "render", "--help"], text=True)
        for argument in arguments:
            if argument.startswith("--"):
                self.assertIn(argument.split("=")[0], help_text)
        with self.assertRaisesRegex(candela.UsageError, "did you mean 'iterations'"):
            program.scene_arguments({"iteratons": 4})

    def test_sizes(self):
        """Claim: a size is a pair or text; a text is never taken for a pair of letters, nor text for settings."""
        program = candela.program
        for size in ((64, 48), [64, 48], "64x48"):
            self.assertEqual(program.scene_arguments({"size": size}), ["--size", "64x48"])
        for size in (64, (64,), (1, 2, 3)):
            with self.assertRaisesRegex(candela.UsageError, "size: .* is not a pair"):
                program.scene_arguments({"size": size})
        with self.assertRaisesRegex(candela.UsageError, "settings: 'max_depth=5' is not a dictionary"):
            program.scene_arguments({"settings": "max_depth=5"})

    def test_short_texts(self):
        """Claim: an image and a status are printed in a line, without their files and messages."""
        image = candela.Image(np.zeros((2, 3, 3), np.float32), {"depth": np.zeros((2, 3, 1), np.float32)}, {}, b"x" * 99)
        self.assertEqual(repr(image), "<Image 3x2: rgb, depth>")
        self.assertEqual(image.shape, (2, 3, 3))
        self.assertNotIn("message", [f.name for f in dataclasses.fields(candela.Status) if f.repr])

    def test_addresses(self):
        """Claim: a master beyond this machine needs TLS or consent; three files go together."""
        with self.assertRaisesRegex(candela.UsageError, "not a loopback address"):
            candela.Farm("farm:7070")
        candela.Farm("farm:7070", insecure=True).close()
        candela.Farm("[::1]:7070").close()
        with self.assertRaisesRegex(candela.UsageError, "go together"):
            candela.Farm("localhost:7070", cert="x.pem")

    def test_nobody_answers(self):
        """Claim: an absent master is an UnreachableError after the timeout."""
        begin = time.monotonic()
        with candela.Farm("127.0.0.1:1", timeout=0.5) as farm, self.assertRaises(candela.UnreachableError):
            farm.jobs()
        self.assertLess(time.monotonic() - begin, 30)

    def test_bad_scene(self):
        """Claim: a scene that cannot be rendered is a UsageError with its file and line."""
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / "bad.xml"
            scene.write_text(BROKEN)
            with self.assertRaisesRegex(candela.UsageError, r"bad\.xml:2: .*spehre"):
                candela.render(scene, iterations=1, **SMALL)


class OnAFarm(unittest.TestCase):
    """One farm of two workers for all."""

    @classmethod
    def setUpClass(cls):
        cls.local = candela.LocalFarm(workers=2, threads=1)
        cls.farm = cls.local.__enter__()

    @classmethod
    def tearDownClass(cls):
        processes = list(cls.local._processes)
        cls.local.__exit__()
        assert all(process.poll() is not None for process in processes), "a process is left"

    def submit(self, **more):
        return self.farm.submit(SCENE, **{"iterations": 8, **SMALL, **more})

    def test_image_is_the_renders(self):
        """Claim: the farm's image, as an array, is that of render() to the last bit, with layers and metadata."""
        options = {"integrator": "bdpt", "settings": {"layers": "weighted", "layer_depth": 3, "max_depth": 3}}
        job = self.submit(**options, name="python")
        status = job.wait()
        self.assertEqual((status.state, status.iterations, status.name), ("done", 8, "python"))
        self.assertEqual(status.submitter.partition("@")[2], socket.gethostname())
        self.assertGreater(status.relmse, 0)
        there = job.image(error_layer=True)
        here = candela.render(SCENE, iterations=8, threads=1, error_layer=True, **options, **SMALL)
        self.assertEqual(there.rgb.shape, (16, 24, 3))
        self.assertEqual(there.rgb.dtype, np.float32)
        self.assertTrue(np.array_equal(there.rgb, here.rgb))
        self.assertEqual(list(there.layers), list(here.layers))
        self.assertIn("error", there.layers)
        for name in there.layers:
            self.assertTrue(np.array_equal(there.layers[name], here.layers[name]), name)
        weighted = [there.layers[name] for name in there.layers if name.startswith("weighted")]
        self.assertGreater(len(weighted), 2)
        np.testing.assert_allclose(np.sum(weighted, axis=0), there.rgb, atol=1e-4)
        self.assertEqual(there.metadata["candela:iterations"], "8")
        self.assertEqual(there.metadata["candela:integrator"], "bdpt")
        self.assertTrue(np.array_equal(np.asarray(there), there.rgb))
        self.assertEqual(job.image(layers=False).layers, {})

    def test_saved_image(self):
        """Claim: save() writes the farm's file; srgb() is what candela convert writes."""
        job = self.submit(integrator="path")
        job.wait()
        image = job.image()
        with tempfile.TemporaryDirectory() as folder:
            exr, png = Path(folder) / "a.exr", Path(folder) / "a.png"
            image.save(exr)
            self.assertEqual(os.listdir(folder), ["a.exr"])
            self.assertTrue(np.array_equal(candela.read_image(exr).rgb, image.rgb))
            subprocess.run([candela.program.find_program("candela"), "convert", exr, png], check=True)
            import OpenImageIO as oiio
            source = oiio.ImageInput.open(str(png))
            converted = source.read_image(oiio.UINT8)
            source.close()
        self.assertLessEqual(np.abs(converted.astype(int) - image.srgb().astype(int)).max(), 1)

    def test_halves(self):
        """Claim: the halves of a job are different images, whose mean is its image."""
        job = self.submit()
        job.wait()
        a, b, both = job.image(half="A"), job.image(half="B"), job.image()
        self.assertEqual((a.metadata["candela:half"], a.metadata["candela:iterations"]), ("A", "4"))
        self.assertFalse(np.array_equal(a.rgb, b.rgb))
        np.testing.assert_allclose((a.rgb + b.rgb) / 2, both.rgb, rtol=1e-5, atol=1e-7)
        with self.assertRaises(ValueError):
            job.image(half="C")
        with self.assertRaises(candela.UsageError):
            job.image(half="A", error_layer=True)

    def test_steering(self):
        """Claim: a job is watched, paused, resumed, extended and cancelled; leaving a watch ends nothing."""
        job = self.submit(iterations=1 << 30, token="python-steering")
        self.assertEqual(self.submit(iterations=1 << 30, token="python-steering").id, job.id)
        seen = set()
        for status in job.watch(0.02):
            seen.add(status.iterations)
            if len(seen) == 3:
                break
        self.assertEqual(job.pause().state, "paused")
        self.assertEqual(job.set_priority(-3).message.priority, -3)
        self.assertIn(job.resume().state, ("queued", "running"))  # a unit may still be under way
        limit = job.status().message.stop.iterations
        self.assertEqual(job.extend(iterations=10).message.stop.iterations, limit + 10)
        with self.assertRaises(ValueError):
            job.extend()
        self.assertEqual(job.cancel().state, "cancelled")
        with self.assertRaises(candela.JobError) as caught:
            job.wait()
        self.assertEqual(caught.exception.status.state, "cancelled")
        self.assertIn(job.id, [j.id for j in self.farm.jobs()])

    def test_groups(self):
        """Claim: frames are submitted as a group, listed, steered and watched together; each frame's image is that of a
        render with its parameters. The same token adds frames."""
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / "turn.xml"
            scene.write_text("""<scene version="3.0.0"><default name="frame" value="0"/><integrator type="path"/>
                <sensor type="perspective"><transform name="to_world"><translate z="-4"/></transform></sensor>
                <shape type="sphere"><transform name="to_world"><translate x="0.$frame"/></transform></shape>
                <emitter type="constant"/></scene>""")
            options = {"parameters": {"frame": "{frame}"}, "name": "turn.{frame:2}", "token": "python-frames",
                       "iterations": 4, **SMALL}
            group = self.farm.submit_frames(scene, [1, 3], **options)
            self.assertEqual(self.farm.submit_frames(scene, "1-5x2", **options).id, group.id)
            after = self.farm.submit_frames(scene, [9], parameters={"frame": "{frame}"}, depends=[group], iterations=4,
                                            **SMALL)
            status = group.wait()
            self.assertEqual((status.state, status.frames, status.states), ("done", 3, {"done": 3}))
            self.assertEqual(after.wait().state, "done")
            self.assertEqual(list(group.frames()), [1, 3, 5])
            self.assertEqual(group.frames()[3].status().name, "turn.03")
            images = dict(group.images())
            here = candela.render(scene, parameters={"frame": 3}, iterations=4, threads=1, **SMALL)
            self.assertTrue(np.array_equal(images[3].rgb, here.rgb))
            self.assertFalse(np.array_equal(images[1].rgb, images[5].rgb))
            self.assertEqual([g.name for g in self.farm.groups() if g.id == group.id], ["turn"])
            endless = self.farm.submit_frames(scene, "1-2", parameters={"frame": "{frame}"}, iterations=1 << 30, **SMALL)
        self.assertEqual(endless.set_priority(4).priority, 4)
        self.assertEqual(endless.pause().state, "paused")
        self.assertIn(endless.resume().state, ("queued", "running"))
        self.assertEqual(endless.cancel().states, {"cancelled": 2})
        with self.assertRaises(candela.JobError):
            endless.wait()

    def test_crop(self):
        """Claim: a crop is rendered alone, and its image says where it lies."""
        image = candela.render(SCENE, iterations=2, threads=1, crop=(20, 4, 4, 12), **SMALL)
        self.assertEqual(image.rgb.shape, (12, 4, 3))
        self.assertEqual(image.metadata["candela:crop"], "20,4,4,12 of 24x16")
        with self.assertRaisesRegex(candela.UsageError, "--crop"):
            candela.render(SCENE, iterations=2, crop=(21, 4, 4, 12), **SMALL)

    def test_refusals(self):
        """Claim: unknown jobs are input errors, jobs without an image are refused."""
        with self.assertRaises(candela.UsageError):
            self.farm.job("nothing").status()
        with self.assertRaises(candela.UsageError):
            list(self.farm.job("nothing").watch())

    def test_workers(self):
        """Claim: both workers are there."""
        deadline = time.monotonic() + 60
        while len(self.farm.workers()) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        self.assertEqual(sorted(w.name for w in self.farm.workers()), ["local-1", "local-2"])


class Outage(unittest.TestCase):
    def test_a_master_that_is_stopped_for_a_while(self):
        """Claim: watch() and image() wait out a master that does not answer for a while."""
        local = candela.LocalFarm(threads=1)
        with local as farm:
            job = farm.submit(SCENE, iterations=8, **SMALL)
            master = local._processes[0]
            master.send_signal(signal.SIGSTOP)
            threading.Timer(1.5, master.send_signal, (signal.SIGCONT,)).start()
            self.assertEqual(list(job.watch())[-1].state, "done")
            self.assertEqual(job.image().rgb.shape, (16, 24, 3))


if __name__ == "__main__":
    unittest.main(verbosity=2)
