"""A farm of pods, without a container engine: the commands, user, folders, probes and signals of deploy/kubernetes and of the
container recipe, in root folders that cannot be written. The image is that of `candela render`."""
import json
import os
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from apart import eventually, own_namespaces
from manifests import KUBERNETES, PROGRAMS, SOURCE, load, pod_of, recipe
from pod import NOBODY, Pod, run

TEST = "deploy_pods"
STOPPED = 128 + 15  # how the master ends after SIGTERM, once its checkpoints are written


def certificates(folder):
    """An authority, and what each of the secrets holds."""
    def openssl(*words):
        run("openssl", *words)
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
    openssl("req", "-x509", *key, "-subj", "/CN=farm", "-days", "2", "-keyout", folder / "ca.key", "-out", folder / "ca.crt")
    held = {}
    for name, role in (("master", None), ("worker", "worker"), ("people", "submit")):
        openssl("req", *key, "-subj", f"/CN={name}", "-keyout", folder / f"{name}.key", "-out", folder / f"{name}.csr")
        (folder / "names").write_text("subjectAltName=" + (f"URI:candela:role/{role}" if role else "DNS:candela-master"))
        openssl("x509", "-req", "-days", "2", "-in", folder / f"{name}.csr", "-CA", folder / "ca.crt", "-CAkey",
                folder / "ca.key", "-CAcreateserial", "-extfile", folder / "names", "-out", folder / f"{name}.crt")
        held[name] = {"tls.crt": (folder / f"{name}.crt").read_bytes(), "tls.key": (folder / f"{name}.key").read_bytes(),
                      "ca.crt": (folder / "ca.crt").read_bytes()}
    return held


class Pods(unittest.TestCase):
    ITERATIONS = ("--size", "96x96", "--seed", "7")

    @classmethod
    def setUpClass(cls):
        objects = load(TEST)
        cls.scratch = tempfile.TemporaryDirectory(prefix="candela-pods-")
        cls.folder = Path(cls.scratch.name)
        os.chmod(cls.folder, 0o755)
        cls.programs = cls.image_programs()
        cls.secrets = certificates(cls.folder)
        cls.config = {"config.toml": (KUBERNETES / "config.toml").read_bytes()}
        cls.specs = {"master": pod_of(objects["StatefulSet", "candela-master"]),
                     "worker": pod_of(objects["Deployment", "candela-worker"])}

    @classmethod
    def tearDownClass(cls):
        # Mounts end with the namespace; the files under them are the scratch folder's.
        subprocess.run(["umount", "--recursive", "--lazy", *cls.folder.glob("*/root")], capture_output=True, check=False)
        cls.scratch.cleanup()

    @classmethod
    def image_programs(cls):
        """What the recipe's `install` puts into the image, by that very line."""
        lines = [rest for word, rest in recipe()[0] if word == "RUN" and rest.startswith("install ")]
        assert len(lines) == 1, lines
        source = cls.folder / "src"
        (source / "build").mkdir(parents=True)
        (source / "build/bin").symlink_to(PROGRAMS)
        subprocess.run(["/bin/sh", "-ec", lines[0].replace("/out/", f"{cls.folder}/out/")], cwd=source, check=True)
        return cls.folder / "out/usr/local/bin"

    def pod(self, kind, name, secret=None):
        return Pod(self.folder, name, self.specs[kind], self.programs,
                   {"config": self.config, "tls": self.secrets[secret or kind]})

    def probe(self, spec, name="readinessProbe"):
        get = spec["containers"][0][name]["httpGet"]
        ports = {each["name"]: each["containerPort"] for each in spec["containers"][0]["ports"]}
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{ports[get['port']]}{get['path']}", timeout=5) as answer:
                return answer.status == 200
        except OSError:
            return False

    def start_master(self, pod):
        process = pod.start(self.folder / "master.log")
        self.addCleanup(process.kill)
        self.assertTrue(eventually(lambda: self.probe(self.specs["master"], "startupProbe") or process.poll() is not None))
        self.assertIsNone(process.poll(), (self.folder / "master.log").read_text())
        return process

    def start_worker(self, name):
        pod = self.pod("worker", name).seal()
        process = pod.start(self.folder / f"{name}.log")
        self.addCleanup(process.kill)
        return pod, process

    def test_farm_of_pods(self):
        """Claims: as nobody, without capabilities, on a root that cannot be written, the farm renders; a worker's preStop
        drains it by its pod's name and it ends with 0; the master ends in good order on its signal and goes on from its volume; the
        metric that the autoscaler reads is there; the picture is that of `candela render`."""
        master_pod = self.pod("master", "candela-master-0").seal()
        master = self.start_master(master_pod)
        people = self.pod("worker", "people", "people")
        people.share(SOURCE / "deploy/scenes", "/scenes")
        people.seal()

        def candela(*words):
            done = people.tell("candela", *words)
            self.assertEqual(done.returncode, 0, f"candela {' '.join(words)}: {done.stderr}")
            return done.stdout

        whoami = people.tell("/bin/sh", "-c", "id -u; echo x >/x || echo x >/etc/x || grep CapEff /proc/self/status")
        self.assertEqual(whoami.stdout.split(), [str(NOBODY), "CapEff:", "0000000000000000"], whoami.stderr)

        iterations = 500
        job = candela("submit", "/scenes/cornell/scene.xml", *self.ITERATIONS, "--iterations", str(iterations)).strip()
        def show():
            return json.loads(candela("show", job, "--json"))
        def worker_states():
            return {each["name"]: each["state"] for each in json.loads(candela("workers", "--json"))["workers"]}

        with urllib.request.urlopen("http://127.0.0.1:9090/metrics", timeout=10) as answer:
            metrics = answer.read().decode()
        wanted = [line for line in metrics.splitlines() if line.startswith("candela_workers_wanted ")]
        self.assertEqual(len(wanted), 1)
        self.assertGreaterEqual(float(wanted[0].split()[1]), 1)

        first_pod, first = self.start_worker("candela-worker-abc")
        # On a busy machine the job may be done before anybody has seen its worker at work.
        self.assertTrue(eventually(lambda: worker_states().get("candela-worker-abc") == "busy" or show()["state"] == "done"))
        hook = self.specs["worker"]["containers"][0]["lifecycle"]["preStop"]["exec"]["command"]
        drained = first_pod.tell(*hook)
        self.assertEqual(drained.returncode, 0, drained.stderr)
        self.assertEqual(first.wait(self.specs["worker"]["terminationGracePeriodSeconds"]), 0)

        if show()["state"] == "done":
            candela("extend", job, "--iterations", "+300")
            iterations += 300
        master.terminate()
        self.assertEqual(master.wait(self.specs["master"]["terminationGracePeriodSeconds"]), STOPPED)
        master = self.start_master(master_pod)
        _, second = self.start_worker("candela-worker-def")
        self.assertTrue(eventually(lambda: show()["state"] == "done"), show())

        second.terminate()
        self.assertEqual(second.wait(self.specs["worker"]["terminationGracePeriodSeconds"]), 0)
        candela("fetch", job, "-o", "/tmp/farm.exr")
        candela("render", "/scenes/cornell/scene.xml", "-o", "/tmp/alone.exr", *self.ITERATIONS, "--iterations", str(iterations), "--quiet")
        difference = json.loads(candela("compare", "/tmp/farm.exr", "/tmp/alone.exr", "--json"))
        self.assertEqual(difference["rmse"], 0, difference)
        master.terminate()
        self.assertEqual(master.wait(120), STOPPED)


if __name__ == "__main__":
    own_namespaces(TEST, ("setpriv", "openssl", "strip"))
    unittest.main(verbosity=2)
