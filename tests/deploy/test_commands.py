"""Every command of the pages on running a farm is run as it stands, in the order of the page, on a machine of its own.

Placeholders (ID, WORKER, DIR, DATA, PLACE, HOST) are what a reader would put there. There is no systemd in the test: a stand-in
for systemctl runs what the units say. Slurm's sbatch is one too; the test `slurm` has a real Slurm."""
import os
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from apart import eventually, own_namespaces
from machine import SCENE, OnAMachine
from manifests import SOURCE

TEST = "deploy_commands"
PACKAGES = Path(os.environ["CANDELA_PACKAGES"])  # made by the test deploy_make_DEB
PAGES = ("farm", "services", "keeping", "page", "failures")
PAGE_OF_FARM = (SOURCE / "docs/farm.md").read_text()
PAGE_OF_SERVICES = (SOURCE / "docs/services.md").read_text()

# Commands within sentences of farm.md and services.md: None: run here too; else the test that runs the like, and a word of it.
WITHIN = {
    "candela workers --wanted": None,
    "candela tls add carol --role read": None,
    "candela render": ("tests/slurm/test_slurm.py", '"render"'),
    "ctest -L deploy": ("tests/deploy/CMakeLists.txt", "LABELS deploy"),
    "ctest -L slurm": ("tests/slurm/CMakeLists.txt", "LABELS"),
    "scancel --batch --signal=TERM JOB_TASK": ("tests/slurm/test_slurm.py", '"scancel", "--batch", "--signal=TERM"'),
    "sbatch": ("tests/slurm/test_slurm.py", '"sbatch"'),
    "kubectl apply -k deploy/kubernetes": ("tests/deploy/test_manifests.py", "kustomize"),
    "ssh -L 9090:127.0.0.1:9090 HOST": ("tests/page/page_farm.py", "127.0.0.1"),  # ssh's own; what it forwards is the page
}
PROGRAM = re.compile(r"(candela|candela-master|candela-worker|ctest|scancel|sbatch|kubectl|ssh|systemctl|curl|openssl)( (?!-?-?$)|$)")


def blocks(page):
    """The commands of each fenced block without a language, comments taken off."""
    text = (SOURCE / f"docs/{page}.md").read_text()
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S):
        if language:
            continue
        lines = (re.sub(r"(^|\s+)# .*$", "", line) for line in block.splitlines())
        yield [line for line in lines if line.strip()]


class Commands(OnAMachine):
    """The machine has the package's file, and Candela only where the page installs it or the test says so."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        shutil.copy(max(PACKAGES.glob("candela_*.deb"), key=lambda path: path.stat().st_mtime), cls.folder)
        cls.path_of_package = f"/usr/local/bin:{os.environ['PATH']}"

    def page(self, name):
        found = list(blocks(name))
        self.assertTrue(found)
        return found

    def configure(self, text, section):
        """The lines of a block of the page, with the `#` of the installed file taken away."""
        wanted = re.search(rf"^```toml\n(\[{section}\]\n.*?)^```$", text, re.M | re.S)[1].splitlines()[1:]
        path = Path("/etc/candela/config.toml")
        before, after = path.read_text().split(f"[{section}]")
        for line in wanted:
            after, times = re.subn(rf"^# {re.escape(line)}(?=\s|$)", line, after, count=1, flags=re.M)
            self.assertEqual(times, 1, f"{line} is not in the installed config.toml")
        path.write_text(f"{before}[{section}]{after}")

    def test_farm(self):
        """Claim: the blocks of docs/farm.md, in order, on a machine that has nothing of Candela but the package: certificates,
        master, worker, a picture, ten jobs, day by day, an upgrade, a removal, and a farm without certificates."""
        install, tls, master, start_master, worker, start_worker, first, ten, days, upgrade, verify, remove, alone = self.page("farm")
        self.environment["PATH"] = self.path_of_package
        self.assertNotEqual(subprocess.run(["bash", "-c", "command -v candela"], env=self.environment, check=False).returncode, 0)
        for line in (*install, *tls):
            self.run_page_line(line)
        self.run_line("candela tls add carol --role read")
        for line in master:
            self.run_page_line(line)
        self.configure(PAGE_OF_FARM, "master")
        for line in (*start_master, *worker):
            self.run_page_line(line)
        self.configure(PAGE_OF_FARM, "worker")
        for line in (*start_worker, *first, *ten):
            self.run_page_line(line)
        self.assertTrue((self.folder / "first.png").read_bytes().startswith(b"\x89PNG"))
        self.assertEqual(self.run_line("candela list --state done --json").count('"name": "box.') or
                         self.run_line("candela list --state done --json").count('"name":"box.'), 10)
        self.have_job(100_000_000)
        self.held["WORKER"] = self.workers()[0]
        for line in days:
            self.run_page_line(line)
        self.run_line("candela workers --wanted")
        for line in upgrade:
            self.run_page_line(line)
        self.assertEqual(Path("/var/log/restarts").read_text().split(), ["candela-master", "candela-worker"])
        for line in verify:
            self.run_page_line(line)
        removal, purge = remove
        self.run_page_line(removal)
        self.assertEqual(list(Path("/run").glob("candela*.pid")), [], "a service still runs")
        self.assertTrue(Path("/var/lib/candela/jobs").is_dir())
        self.run_page_line(purge)
        self.assertFalse(Path("/var/lib/candela").exists())
        # The farm without certificates, on a machine that has just the package.
        subprocess.run("rm -rf /etc/candela/*", shell=True, check=True)
        for name in [name for name in self.environment if name.startswith("CANDELA_TLS") or name == "CANDELA_MASTER"]:
            del self.environment[name]
        self.run_page_line(install[0])
        for line in alone:
            said = self.run_page_line(line)
        self.assertRegex(said, r"(?m)^w[a-z0-9]{10}\b")
        self.run_page_line(purge)

    def test_services(self):
        """Claim: the blocks of docs/services.md, in order: master, worker, TLS, systemd and its credentials, Slurm."""
        master, worker, tls, systemd, credentials, slurm = self.page("services")
        for line in (*master, *worker, *tls):
            self.run_page_line(line)
        self.stop()
        # The page's configuration, and its certificates where that looks for them.
        for made in (*self.folder.glob("tls/*.pem"), *self.folder.glob("tls/*.key")):
            shutil.copy(made, "/etc/candela")
        Path("/etc/candela/config.toml").write_text(re.search(r"^```toml\n(.*?)^```$", PAGE_OF_SERVICES, re.M | re.S)[1])
        users = [line for line in systemd if "sysusers" in line]
        for line in users:
            self.run_page_line(line)
        subprocess.run("chown candela /etc/candela/*.pem /etc/candela/*.key", shell=True, check=True)  # as the page says
        for line in systemd:
            self.run_page_line(line)
        tls_files = "--tls-cert tls/alice.pem --tls-key tls/alice.key --tls-ca tls/ca.pem"
        self.assertTrue(eventually(lambda: self.workers(f"--master render.example.org:7070 {tls_files}")), "no worker of the units")
        for line in credentials:
            self.run_page_line(line)
        for unit in ("candela-master", "candela-worker@"):
            self.assertIn("LoadCredential", Path(f"/etc/systemd/system/{unit}.service.d/tls.conf").read_text())
        for line in slurm:
            self.run_page_line(line)
        self.run_line("bash -n workers.sbatch")
        self.assertTrue((self.folder / "workers.sbatch").read_text().startswith("#!/"))
        self.assertIn("#SBATCH", Path("/var/log/sbatch").read_text())

    def test_keeping(self):
        """Claim: the blocks of docs/keeping.md: lists, a backup and a second one on its base, and the farm from a backup."""
        lists, backups, restore = self.page("keeping")
        self.say_master()
        self.run_page_line("candela-master --data /var/lib/candela")
        self.have_job()
        self.have_job()
        self.held["PLACE"] = re.search(r"--after (\S+)", self.run_line("candela list --limit 1 2>&1"))[1]
        for line in (*lists, *backups):
            self.run_page_line(line)
        self.stop()  # as the page says before it
        for line in restore:
            self.run_page_line(line)
        self.assertIn(self.held["ID"][:5], self.run_line("candela list"))

    def test_page(self):
        """Claim: the block of docs/page.md makes a token, and a master takes it. (What scripts send: http_page.)"""
        (controls,) = self.page("page")
        self.say_master()
        for line in controls:
            self.run_page_line(line)
        self.have_job()

    def test_failures(self):
        """Claim: the commands of docs/failures.md mend a job whose film is gone."""
        (mends,) = self.page("failures")
        self.say_master()
        def start():
            self.run_page_line("candela-master --data /var/lib/candela")
            self.start("candela-worker --master 127.0.0.1:7070 --cache /var/cache/candela")
        start()
        self.have_job()
        self.run_line(f"candela watch {self.held['ID']}")
        self.stop()
        for film in Path("/var/lib/candela/jobs").glob("*/film*"):
            film.unlink()
        start()
        for line in mends:
            self.run_page_line(line)
            self.run_line(f"candela watch {self.held['ID']}")
        self.assertIn("80/80 spp", self.run_line(f"candela show {self.held['ID']}"))

    def test_commands_within_sentences(self):
        """Claim: each command in a sentence of docs/farm.md or docs/services.md is run here or by the test named above."""
        text = re.sub(r"^```.*?^```$", "", PAGE_OF_FARM + PAGE_OF_SERVICES, flags=re.M | re.S)
        spans = {" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)}
        found = {span for span in spans if PROGRAM.match(span) and not re.fullmatch(r"candela(-master|-worker)?", span)}
        self.assertEqual(found - set(WITHIN), set(), "a command that nothing runs")
        for command, run_by in WITHIN.items():
            self.assertIn(command, found | spans, "a command that the page no longer has")
            if run_by:
                self.assertIn(run_by[1], (SOURCE / run_by[0]).read_text(), command)

    def test_all_pages_are_run(self):
        """Claim: a page on running a farm with commands in blocks has a test above, or is Kubernetes', which test_pods plays."""
        linked = set(re.findall(r"\]\((\w+)\.md\)", PAGE_OF_FARM + PAGE_OF_SERVICES))
        with_blocks = {name for name in linked | {"farm"} if any(blocks(name))}
        self.assertEqual(with_blocks - {"kubernetes"}, set(PAGES))


if __name__ == "__main__":
    own_namespaces(TEST, ("openssl", "curl", "systemd-analyze", "setpriv", "dpkg"))
    unittest.main(verbosity=2)
