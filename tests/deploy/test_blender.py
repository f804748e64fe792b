"""deploy/blender/export.py with a headless Blender: the scene is read without a warning, and its picture is that of Cycles."""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from manifests import PROGRAMS, SOURCE, skip

TEST = "deploy_blender"
HERE = Path(__file__).resolve().parent
LAMPS = ("point", "area", "disk", "spot", "blended-spot", "sun", "world", "environment", "emission")
BLOCK = 8

if not shutil.which("blender"):
    skip(TEST, "there is no Blender (Debian: blender)")
try:
    import numpy as np
    import OpenImageIO as oiio
except ImportError as absent:
    skip(TEST, f"{absent} (Debian: python3-numpy, python3-openimageio)")


def blocks(path):
    """Means of 8x8 pixels."""
    pixels = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[:, :, :3]
    height, width, _ = pixels.shape
    return pixels.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean(axis=(1, 3))


class Blender(unittest.TestCase):
    def run_program(self, *command):
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
        self.assertEqual(done.returncode, 0, f"{command}: {done.stdout}{done.stderr}")
        return done.stdout + done.stderr

    def test_like_cycles(self):
        """Claim: under each kind of lamp alone, block means differ from those of Cycles by at most 4 % of the picture's mean on
        average, and the picture's mean by at most 2 %; nothing of this scene is left out."""
        for lamp in LAMPS:
            with self.subTest(lamp), tempfile.TemporaryDirectory(prefix="candela-blender-") as scratch:
                folder = Path(scratch)
                self.run_program("blender", "-b", "--factory-startup", "-P", HERE / "blender_scene.py", "--", folder, lamp, "CYCLES")
                said = self.run_program("blender", "-b", folder / "shot.blend", "-P", SOURCE / "deploy/blender/export.py", "--", folder / "out")
                self.assertNotIn("warning", said)
                checked = self.run_program(PROGRAMS / "candela", "check", folder / "out/scene.xml")
                self.assertNotIn("error", checked)
                self.run_program(PROGRAMS / "candela", "render", folder / "out/scene.xml", "-o", folder / "ours.exr", "--spp", 128,
                                 "--filter", "box", "--quiet")
                theirs, ours = blocks(folder / "cycles.exr"), blocks(folder / "ours.exr")
                mean = theirs.mean()
                difference = np.abs(theirs - ours).mean(axis=2) / mean
                print(f"{lamp}: mean of ours / Cycles {ours.mean() / mean:.3f}, blocks differ by {difference.mean():.3f} of it, at most {difference.max():.3f}")
                self.assertAlmostEqual(ours.mean() / mean, 1, delta=0.02)
                self.assertLess(difference.mean(), 0.04)

    def test_warns(self):
        """Claim: what the script leaves out, it names; an error of it is the exit code of Blender."""
        with tempfile.TemporaryDirectory(prefix="candela-blender-") as scratch:
            odd = Path(scratch) / "odd.py"
            odd.write_text("import bpy\n"
                           "material = bpy.data.materials.new('glassy')\nmaterial.use_nodes = True\n"
                           "tree = material.node_tree\nnode = tree.nodes.new('ShaderNodeBsdfGlass')\n"
                           "tree.links.new(node.outputs[0], tree.nodes['Material Output'].inputs['Surface'])\n"
                           "bpy.data.objects['Cube'].data.materials[0] = material\n")
            export = SOURCE / "deploy/blender/export.py"
            said = self.run_program("blender", "-b", "--factory-startup", "-P", odd, "-P", export, "--", Path(scratch) / "out")
            self.assertIn("warning: material 'glassy': only one Principled BSDF or Emission is taken", said)
            self.run_program(PROGRAMS / "candela", "check", Path(scratch) / "out/scene.xml")
            odd.write_text("import bpy\nbpy.data.objects.remove(bpy.data.objects['Camera'])\n")
            failed = subprocess.run(["blender", "-b", "--factory-startup", "-P", odd, "-P", export, "--", scratch], capture_output=True,
                                    text=True, check=False)
            self.assertNotEqual(failed.returncode, 0)
            self.assertIn("the scene has no camera", failed.stdout + failed.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
