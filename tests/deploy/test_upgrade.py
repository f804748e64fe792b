"""An upgrade as docs/farm.md says, from the package of one build to that of another, while a job is rendered on two machines."""
import json
import os
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from apart import eventually, own_namespaces
from machine import OnAMachine
from manifests import SOURCE
from other_build import build_of, make_other_build

TEST = "deploy_upgrade"
PACKAGES = Path(os.environ["CANDELA_PACKAGES"])  # made by the test deploy_make_DEB
SCENE = "/usr/share/candela/scenes/cornell/scene.xml"
PICTURE = "--size 32x32 --seed 3"


def section(title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", (SOURCE / "docs/farm.md").read_text(), re.M | re.S)[1]


def commands(title):
    """The lines of the blocks of a section of docs/farm.md."""
    return [line for block in re.findall(r"^```\n(.*?)^```$", section(title), re.M | re.S) for line in block.splitlines()]


def attribute(exr, name):
    """A text of an EXR's header."""
    data = exr.read_bytes()
    at = data.index(name.encode() + b"\0string\0") + len(name) + 8
    size = int.from_bytes(data[at:at + 4], "little")
    return data[at + 4:at + 4 + size].decode()


def install_on(prefix):
    """The installed programs and their modules, as another machine has them."""
    shutil.rmtree(prefix, ignore_errors=True)
    (prefix / "bin").mkdir(parents=True)
    shutil.copy("/usr/bin/candela-worker", prefix / "bin")
    shutil.copytree("/usr/lib/candela", prefix / "lib/candela")


class Upgrade(OnAMachine):
    def expect_registered(self, log, child):
        self.assertTrue(eventually(lambda: "registered as" in log.read_text() or child.poll() is not None))
        self.assertIsNone(child.poll(), log.read_text())

    def job(self, job):
        return json.loads(self.run_line(f"candela show {job} --json"))

    def workers_now(self):
        return json.loads(self.run_line("candela workers --json"))["workers"]

    def second_machine(self, programs, name):
        """A worker of the programs in a folder, as the service of another machine has it: what it says, and its process."""
        log = self.scratch / f"{name}.log"
        with open(log, "wb") as out:
            child = subprocess.Popen([programs / "bin/candela-worker", "--master", "127.0.0.1:7070", "--cache", self.scratch / "second-cache",
                                      "--name", "second", "--threads", "1", "--token-file", "/var/lib/candela/token"],
                                     stdout=out, stderr=out, env=self.environment)
        self.staying.append(child)
        return log, child

    def test_upgrade_under_a_job(self):
        """Claim: the upgrade of docs/farm.md from one build to another, with a job under way on two machines: the master's machine
        goes on with the job from the last checkpoint that the old master wrote; the worker of the other machine is refused with
        one sentence, also when it starts again, until that machine has the new build; each iteration is in the picture once, which
        names both builds. Programs that differ in their build id alone make the same picture as one of them."""
        package = max(PACKAGES.glob("candela_*.deb"), key=lambda path: path.stat().st_mtime)
        other, new, old = make_other_build(package, self.scratch)
        shutil.copy(package, self.folder)
        self.environment["PATH"] = f"/usr/local/bin:{os.environ['PATH']}"
        self.run_line("sudo apt install ./candela_*.deb")
        self.assertEqual(build_of("/usr/bin/candela-worker"), old)
        for line in commands("One machine, no certificates"):
            self.run_line(line)
        self.environment.update(CANDELA_MASTER="127.0.0.1:7070", CANDELA_TOKEN_FILE="/var/lib/candela/token")
        second = self.scratch / "second"  # another machine has programs of its own
        install_on(second)
        log, child = self.second_machine(second, "second-before")
        self.expect_registered(log, child)
        job = self.run_line(f"candela submit {SCENE} {PICTURE} --iterations 100000000").strip()
        before = eventually(lambda: self.job(job)["iterations"])

        # As the page says, with the new package in the place of the old one.
        (self.folder / package.name).unlink()
        shutil.copy(other, self.folder)
        backup, install = commands("Upgrade")[:2]
        for line in (backup, install):
            self.run_line(line)
        self.assertEqual(build_of("/usr/bin/candela-worker"), new)
        self.assertGreaterEqual(self.job(job)["iterations"], before, "iterations are lost")
        self.assertTrue(eventually(lambda: self.job(job)["iterations"] > before))
        self.run_line(f"candela pause {job}")  # what is rendered here is rendered again below

        # The other machine: refused, and again if its service starts it again.
        refusal = f"build_id: the master refuses this worker: the worker is build {old}, this farm {new} (install the same build on both"
        self.assertTrue(eventually(lambda: child.poll() is not None), log.read_text())
        for _ in range(2):
            self.assertNotEqual(child.returncode, 0)
            self.assertEqual(log.read_text().count(refusal), 1, log.read_text())
            log, child = self.second_machine(second, "second-refused")
            child.wait(120)
        self.assertEqual([w["build_id"] for w in self.workers_now() if w["state"] not in ("lost", "awaited")], [new])
        install_on(second)
        self.expect_registered(*self.second_machine(second, "second-after"))
        self.run_line(f"candela resume {job}")
        # Its old programs are listed too, for a minute, as a worker that the new master awaits.
        self.assertTrue(eventually(lambda: any(w["units_merged"] > 0 for w in self.workers_now() if w["name"] == "second")))

        self.run_line(f"candela cancel {job}")
        for line in commands("Upgrade")[2:]:
            self.run_line(line)
        self.run_line(f"candela fetch {job} -o farm.exr")
        indices = "/".join(attribute(self.folder / "farm.exr", f"candela:indices_{half}") for half in "ab")
        self.run_line(f"candela render {SCENE} {PICTURE} --indices {indices} -o alone.exr --quiet")
        self.assertEqual(json.loads(self.run_line("candela compare farm.exr alone.exr --json"))["rmse"], 0)
        # The picture names both builds, and nobody tries to make it again.
        self.assertIn(f"goes on with build {new}; it has work of build {old}", self.run_line(f"candela events {job}"))
        refused = subprocess.run(["candela", "reproduce", "farm.exr"], cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False)
        self.assertEqual(refused.returncode, 2)
        self.assertIn(f"it has samples of several builds: {old}, {new}\n", refused.stderr)


if __name__ == "__main__":
    own_namespaces(TEST, ("setpriv", "dpkg", "dpkg-deb", "systemd-analyze"))
    unittest.main(verbosity=2)
