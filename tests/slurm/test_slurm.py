"""Workers that a real Slurm starts, requeues, preempts and loses: the image is that of `candela render`, byte for byte.
Slurm runs on virtual nodes of this machine. Skips, with a reason, where it is not installed."""
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import cluster
from cluster import eventually

PROGRAMS = Path(os.environ["CANDELA_PROGRAMS"])
SCENE = Path(os.environ["CANDELA_SOURCE_DIR"]) / "deploy/scenes/cornell/scene.xml"

absent = cluster.missing_programs()
if absent:
    print(f"test_slurm.py:1: Skipped\nSlurm is not installed: {', '.join(absent)} (Debian: slurm-wlm, munge)")
    print("[  SKIPPED ] slurm (0 ms)")
    sys.exit(77)

# Samples per pixel of a job during which workers come and go, some seconds on three of them, and of one that only ends.
LONG, SHORT = 160, 48


class Slurm(unittest.TestCase):
    """One cluster and one farm for all; every test has jobs of its own."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="candela-slurm-")
        cls.folder = Path(cls.scratch.name)
        (cls.folder / "cluster").mkdir()
        cls.slurm = cluster.Cluster(cls.folder / "cluster", 3)
        try:
            cls.slurm.start()
            cls.start_master()
        except BaseException:
            cls.tearDownClass()
            raise

    @classmethod
    def start_master(cls):
        said = cls.folder / "master.log"
        with open(said, "wb") as log:
            # The product's master, which also tells of violated invariants of its scheduler (tests/farm/checked_master.h).
            cls.master = subprocess.Popen([PROGRAMS / "checked-master", "--listen", "127.0.0.1:0", "--data",
                                           cls.folder / "data", "--unit-time", "0.2", "--lease-time", "5",
                                           "--checkpoint-interval", "1"], stdout=log, stderr=log)
        listening = re.compile(r"127\.0\.0\.1:[1-9][0-9]*")
        if not eventually(lambda: listening.search(said.read_text()), 60):
            raise RuntimeError(said.read_text())
        cls.address = listening.search(said.read_text()).group(0)

    @classmethod
    def tearDownClass(cls):
        cls.slurm.stop()
        if hasattr(cls, "master"):
            cls.master.terminate()
            cls.master.wait(60)
            violations = [line for line in (cls.folder / "master.log").read_text().splitlines()
                          if line.startswith("invariant violated: ")]
        cls.scratch.cleanup()
        if hasattr(cls, "master") and violations:
            raise AssertionError("\n".join(violations))

    def tearDown(self):
        self.slurm.run("scancel", "--state=PENDING", "-u", str(os.getuid()), check=False)
        self.slurm.run("scancel", "-u", str(os.getuid()), check=False)
        self.assertTrue(eventually(lambda: not self.slurm.run("squeue", "-h").strip()), "Slurm still has jobs")

    def candela(self, *arguments):
        done = subprocess.run([PROGRAMS / "candela", *arguments], capture_output=True, text=True, check=False,
                              env=dict(os.environ, CANDELA_MASTER=self.address))
        self.assertEqual(done.returncode, 0, f"candela {' '.join(map(str, arguments))}: {done.stderr}")
        return done.stdout

    def submit_workers(self, workers, *more):
        """As a site would: candela slurm --submit. Returns Slurm's number of the job."""
        said = self.slurm.run(PROGRAMS / "candela", "slurm", "--submit", "--master", self.address, "--workers",
                              str(workers), "--cpus", "2", "--program", str(PROGRAMS / "candela-worker"), "--cache",
                              str(self.folder / "cache"), "--logs", str(self.folder), *more)
        return re.search(r"Submitted batch job (\d+)", said).group(1)

    def submit(self, seed, *more, spp=LONG):
        """A job; its id."""
        return self.candela("submit", SCENE, "--size", "128x128", "--spp", str(spp), "--seed", str(seed), *more).strip()

    def status(self, job):
        return json.loads(self.candela("show", job, "--json"))

    def finished(self, job):
        state = self.status(job)["state"]
        self.assertNotIn(state, ("failed", "cancelled"))
        return state == "done"

    def states_of_workers(self, slurm_job):
        workers = json.loads(self.candela("workers", "--json"))["workers"]
        return [w["state"] for w in workers if w["name"].startswith(f"slurm-{slurm_job}-")]

    def live_workers(self, slurm_job):
        return [state for state in self.states_of_workers(slurm_job) if state in ("idle", "busy")]

    def log(self, slurm_job):
        return "".join(path.read_text(errors="replace") for path in sorted(self.folder.glob(f"*-{slurm_job}-*.log")))

    def expect_picture(self, job, seed, spp=LONG):
        """The job ends, and its pixels are those of `candela render`."""
        self.assertTrue(eventually(lambda: self.finished(job)), self.status(job))
        farm, alone = self.folder / f"{job}.exr", self.folder / f"{job}-alone.exr"
        self.candela("fetch", job, "-o", farm)
        self.candela("render", SCENE, "-o", alone, "--size", "128x128", "--spp", str(spp), "--seed", str(seed), "--quiet")
        difference = json.loads(self.candela("compare", farm, alone, "--json"))
        self.assertEqual(difference["rmse"], 0, difference)

    def test_array_renders(self):
        """Claim: an array renders two jobs of different priority, the higher one first."""
        low = self.submit(1, "--priority", "0", spp=SHORT)
        high = self.submit(2, "--priority", "5", spp=SHORT)
        workers = self.submit_workers(3)
        self.expect_picture(high, 2, SHORT)
        self.expect_picture(low, 1, SHORT)
        ends = [self.status(job)["finished_unix_ms"] for job in (high, low)]
        self.assertLess(*ends, "the lower priority was done first")
        self.assertEqual(len(self.live_workers(workers)), 3)

    def test_scaling(self):
        """Claim: tasks may join and be cancelled while a job runs; who is cancelled delivers and leaves."""
        job = self.submit(3)
        first = self.submit_workers(1)
        self.assertTrue(eventually(lambda: len(self.live_workers(first)) == 1))
        second = self.submit_workers(2)
        self.assertTrue(eventually(lambda: len(self.live_workers(second)) == 2))
        self.slurm.run("scancel", "--batch", "--signal=TERM", first)
        self.assertTrue(eventually(lambda: not self.slurm.tasks(first)), "the worker does not leave")
        self.assertEqual(self.states_of_workers(first), [], "it left without a word")
        self.expect_picture(job, 3)

    def test_preemption(self):
        """Claim: a job of a higher partition takes the nodes; the workers are requeued and come back."""
        job = self.submit(4)
        workers = self.submit_workers(3, "--partition", "spare")
        self.assertTrue(eventually(lambda: len(self.live_workers(workers)) == 3))
        urgent = self.slurm.run("sbatch", "--parsable", "-p", "urgent", "-N", "2", "-c", "2", "--output=/dev/null",
                                "--wrap", "sleep 3").strip()
        self.assertTrue(eventually(lambda: self.slurm.tasks(urgent).get(urgent) == "RUNNING"), "nothing was preempted")
        waiting = [state for state in self.slurm.tasks(workers).values() if state != "RUNNING"]
        self.assertGreaterEqual(len(waiting), 2)
        self.assertTrue(eventually(lambda: self.all_run(workers, 3)), "they stay away")
        self.assertTrue(eventually(lambda: len(self.live_workers(workers)) == 3))
        self.expect_picture(job, 4)

    @unittest.skipUnless(os.environ.get("CANDELA_LONG"), "a minute of Slurm's clock: only with CANDELA_LONG=1")
    def test_time_limit(self):
        """Claim: before its time limit a worker delivers, leaves and ends well; another array goes on."""
        job = self.submit(5)
        # Slurm counts limits in minutes, and warns up to half a minute before it was asked to: here 10 s after the start or later.
        short = self.submit_workers(2, "--time", "1", "--notice", "20")
        self.assertTrue(eventually(lambda: not self.slurm.tasks(short)))
        states = re.findall(r"JobState=(\w+)", self.slurm.run("scontrol", "show", "job", short))
        self.assertEqual(states, ["COMPLETED"] * 2, self.log(short))
        self.assertEqual(self.states_of_workers(short), [], "it left without a word")
        self.submit_workers(3)
        self.expect_picture(job, 5)

    def test_node_dies(self):
        """Claim: a node that dies with its worker costs what that worker had; Slurm starts it again elsewhere."""
        job = self.submit(6)
        workers = self.submit_workers(2)
        self.assertTrue(eventually(lambda: len(self.live_workers(workers)) == 2))
        node = self.slurm.run("squeue", "-h", "-j", workers, "-t", "RUNNING", "-o", "%N").split()[0]
        own = [pid for pid in self.processes_named(f"slurm-{workers}-") if node in self.node_of(pid)]
        self.assertEqual(len(own), 1, "no worker on the node")
        # Slurm's step first: it would tell of the worker's end.
        own.insert(0, int(Path(f"/proc/{own[0]}/stat").read_text().rpartition(")")[2].split()[1]))
        self.slurm.kill_node(node, own)
        try:
            self.assertTrue(eventually(lambda: "down" in self.slurm.run("sinfo", "-h", "-n", node, "-o", "%t")))
            self.assertTrue(eventually(lambda: self.all_run(workers, 2)), "not requeued")
            self.expect_picture(job, 6)
        finally:
            self.slurm.start_node(node)
            self.assertTrue(eventually(lambda: "idle" in self.slurm.run("sinfo", "-h", "-n", node, "-o", "%t") or
                                       "mix" in self.slurm.run("sinfo", "-h", "-n", node, "-o", "%t")))

    def all_run(self, slurm_job, tasks):
        """Whether all tasks run. Slurm lets what it requeues wait for two minutes; an administrator need not."""
        states = self.slurm.tasks(slurm_job)
        for task, state in states.items():
            if state == "PENDING":
                self.slurm.run("scontrol", "update", f"JobId={task}", "StartTime=now", check=False)
        return list(states.values()) == ["RUNNING"] * tasks

    @staticmethod
    def processes_named(worker):
        """Processes of workers whose names begin so."""
        found = []
        for path in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = path.read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue
            if "--name" in words and words[words.index("--name") + 1].startswith(worker):
                found.append(int(path.parent.name))
        return found

    @staticmethod
    def node_of(pid):
        text = Path(f"/proc/{pid}/environ").read_bytes().decode(errors="replace")
        return [word.partition("=")[2] for word in text.split("\0") if word.startswith("SLURMD_NODENAME=")]

    def test_script_in_the_repository(self):
        """Claim: deploy/slurm/candela-workers.sbatch works with what farm.md says of it."""
        job = self.submit(7, spp=SHORT)
        script = Path(os.environ["CANDELA_SOURCE_DIR"]) / "deploy/slurm/candela-workers.sbatch"
        self.slurm.run("sbatch", "--array=1-2", "--cpus-per-task=2", f"--output={self.folder}/own-%a.log", str(script),
                       environment={"CANDELA_MASTER": self.address, "CANDELA_CACHE": str(self.folder / "cache"),
                                    "PATH": f"{PROGRAMS}:{os.environ['PATH']}"})
        self.expect_picture(job, 7, SHORT)


if __name__ == "__main__":
    unittest.main(verbosity=2)
