"""The packages that `cmake --build build --target package` makes, installed where nothing else is: the Debian package in a root
folder of its own, the archive in another folder. No systemd: the services' own command lines are run."""
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from apart import eventually, own_namespaces
from manifests import PROGRAMS

TEST = "deploy_package"
PACKAGES = Path(os.environ["CANDELA_PACKAGES"])  # made by the tests deploy_make_DEB and deploy_make_TGZ
SCENE = "share/candela/scenes/cornell/scene.xml"
SIZE = ["--size", "16x16", "--iterations", "4"]


def newest(pattern):
    return max(PACKAGES.glob(pattern), key=lambda path: path.stat().st_mtime)


def run(*command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, **more)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


def render(prefix, folder):
    """A picture by the programs of the prefix, and a JPEG of it, which needs a module. The hash of its PNG: the EXR names the
    scene's file."""
    program = prefix / "bin/candela"
    run(program, "render", prefix / SCENE, "-o", folder / "out.exr", *SIZE, "--quiet", "--fresh")
    run(program, "convert", folder / "out.exr", folder / "out.jpg")
    assert (folder / "out.jpg").read_bytes().startswith(b"\xff\xd8\xff")
    run(program, "convert", folder / "out.exr", folder / "out.png")
    return hashlib.sha256((folder / "out.png").read_bytes()).hexdigest()


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = Path(tempfile.mkdtemp(prefix="candela-package-"))
        cls.root = cls.scratch / "root"
        for folder in ("var/lib/dpkg/info", "var/lib/dpkg/updates", "etc", "usr"):
            (cls.root / folder).mkdir(parents=True)
        (cls.root / "var/lib/dpkg/status").touch()
        cls.deb = newest("candela_*.deb")
        cls.hashes = {}
        cls.environment = dict(os.environ, XDG_STATE_HOME=str(cls.scratch / "state"))
        cls.dpkg("-i", cls.deb)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.scratch, ignore_errors=True)

    @classmethod
    def dpkg(cls, *words):
        # The root has no other package, so that nothing of this machine's is missed by chance.
        return run("dpkg", f"--root={cls.root}", "--force-script-chrootless", "--force-depends", "--no-triggers", *words)

    def files(self):
        """All that is in the root, but for dpkg's own notes and the list of users."""
        return {str(path.relative_to(self.root)) for path in self.root.rglob("*")
                if not path.is_dir() and not str(path.relative_to(self.root)).startswith("var/lib/dpkg/")
                and not re.fullmatch(r"etc/(\.pwd\.lock|g?shadow-?|passwd-?|group-?)", str(path.relative_to(self.root)))}

    def test_1_what_is_installed(self):
        """Claim: the package names the packages of all libraries that its programs load; they are on this machine. It has
        programs, modules beside no build folder, pages, completion, units, and one configuration file; and its user."""
        depends = run("dpkg-deb", "-f", self.deb, "Depends")
        for library in ("libembree3-3", "libgrpc++1.51", "libopenimageio2.4", "libc6"):
            self.assertIn(library, depends)
        for clause in depends.split(","):
            names = [re.sub(r"\(.*", "", one).strip() for one in clause.split("|")]
            self.assertTrue(any(subprocess.run(["dpkg-query", "-W", name], capture_output=True, check=False).returncode == 0
                                for name in names), clause)
        have = self.files()
        for wanted in ("usr/bin/candela", "usr/bin/candela-master", "usr/bin/candela-worker",
                       *(f"usr/lib/candela/{module.name}" for module in PROGRAMS.glob("candela-*.so")),
                       "usr/lib/systemd/system/candela-master.service", "usr/lib/systemd/system/candela-worker@.service",
                       "usr/share/man/man1/candela.1.gz", "usr/share/man/man1/candela-render.1.gz",
                       "usr/share/man/man1/candela-master.1.gz", "usr/share/man/man1/candela-worker.1.gz",
                       "usr/share/bash-completion/completions/candela", "usr/share/zsh/vendor-completions/_candela",
                       "usr/share/doc/candela/copyright", "etc/candela/config.toml"):
            self.assertIn(wanted, have)
        self.assertIn("/etc/candela/config.toml", run("dpkg-query", f"--admindir={self.root}/var/lib/dpkg", "-W", "-f", "${Conffiles}", "candela"))
        self.assertRegex((self.root / "etc/passwd").read_text(), r"(?m)^candela:.*:/var/lib/candela:")
        for program in (self.root / "usr/bin").iterdir():
            self.assertNotRegex(run("readelf", "-d", program), "RPATH|RUNPATH")
            self.assertNotIn(".debug_info", run("readelf", "-SW", program))
        # The settings that it names are the programs' own: with their # taken away the file is read.
        config = self.scratch / "config.toml"
        config.write_text(re.sub(r"(?m)^# (?=[a-z-]+ =)", "", (self.root / "etc/candela/config.toml").read_text()))
        said = subprocess.run([self.root / "usr/bin/candela-worker", "--master", "127.0.0.1:1", "--cache", self.scratch / "c"],
                              env=dict(os.environ, CANDELA_CONFIG=str(config)), capture_output=True, text=True, check=False).stderr
        self.assertIn("/etc/candela/worker", said)  # the certificate that is not there; no key is unknown

    def test_2_render(self):
        """Claim: the programs render and find their modules from where they lie: in the root, and in any folder to which they are
        moved. Both make the same bytes."""
        with tempfile.TemporaryDirectory(dir=self.scratch) as folder:
            moved = Path(folder) / "an other place"
            shutil.copytree(self.root / "usr", moved)
            by_moved = render(moved, Path(folder))
            by_package = render(self.root / "usr", Path(folder))
        self.assertEqual(by_moved, by_package)

    def test_3_services(self):
        """Claim: the units' command lines, as the user and with the folders that systemd gives, are a farm: without TLS the worker
        finds the master's token, since both are of one user. The settings come from config.toml."""
        units = self.root / "usr/lib/systemd/system"
        home = self.root / "var/lib/candela"
        cache = self.root / "var/cache/candela"
        user = [line.split(":") for line in (self.root / "etc/passwd").read_text().splitlines() if line.startswith("candela:")][0]
        for folder in (home, cache):
            folder.mkdir(parents=True, mode=0o700)
            os.chown(folder, int(user[2]), int(user[3]))
        for parent in (self.scratch, self.root):
            parent.chmod(0o755)
        # The folders that systemd would give: the paths of the installed system, seen from outside.
        environment = {"PATH": f"{self.root}/usr/bin:/usr/bin:/bin", "HOME": str(home), "STATE_DIRECTORY": str(home),
                       "CACHE_DIRECTORY": str(cache), "CANDELA_CONFIG": str(self.root / "etc/candela/config.toml"),
                       "CANDELA_MASTER_NOTIFY": "http://127.0.0.1:9/"}  # a master without the module of notices would not start
        services = []

        def start(unit, instance, ready):
            text = (units / unit).read_text()
            self.assertIn(f"\nUser={user[0]}\n", text)
            line = re.search(r"^ExecStart=(.*)$", text, re.M)[1].replace("%i", instance)
            for name, value in environment.items():
                line = line.replace("${" + name + "}", value)
            log = self.scratch / f"{unit}.log"
            with open(log, "wb") as out:
                services.append(subprocess.Popen(["setpriv", f"--reuid={user[2]}", f"--regid={user[3]}", "--clear-groups", "--",
                                                  *shlex.split(line)], env=environment, stdout=out, stderr=out, cwd="/"))
            eventually(lambda: ready in log.read_text() or services[-1].poll() is not None)
            self.assertIn(ready, log.read_text())

        try:
            start("candela-master.service", "", "listening on")
            start("candela-worker@.service", "127.0.0.1:7070", "registered as")
            candela = [self.root / "usr/bin/candela"]
            farm = ["--master", "127.0.0.1:7070", "--token-file", home / "token"]
            job = run(*candela, "submit", self.root / "usr" / SCENE, *SIZE, *farm).strip()
            run(*candela, "watch", job, "--quiet", *farm)
            image = self.scratch / "farm.exr"
            run(*candela, "fetch", job, "-o", image, *farm)
            render(self.root / "usr", self.scratch)
            self.assertIn('"rmse":0', run(*candela, "compare", image, self.scratch / "out.exr", "--json").replace(" ", ""))
        finally:
            for service in reversed(services):
                service.terminate()
            ended = [service.wait(120) for service in reversed(services)]
        self.assertEqual(ended[0], 0)

    def test_4_upgrade_and_removal(self):
        """Claim: an upgrade keeps a changed config.toml; a removal leaves it and the jobs alone, and nothing else; a purge leaves
        nothing but the administrator's own files."""
        config = self.root / "etc/candela/config.toml"
        config.write_text(config.read_text() + "# ours\n")
        (self.root / "etc/candela/master.pem").write_text("certificate\n")
        jobs = self.root / "var/lib/candela/kept"
        jobs.parent.mkdir(parents=True, exist_ok=True)
        jobs.write_text("")
        self.dpkg("-i", self.deb)
        self.assertIn("# ours", config.read_text())
        self.dpkg("-r", "candela")
        left = {path for path in self.files() if not path.startswith(("var/lib/candela/", "var/cache/candela/"))}
        self.assertEqual(left, {"etc/candela/config.toml", "etc/candela/master.pem"})
        self.assertTrue(jobs.exists())
        self.dpkg("-P", "candela")
        self.assertEqual(self.files(), {"etc/candela/master.pem"})
        for folder in ("var/lib/candela", "var/cache/candela", "usr/lib/candela", "usr/share/candela"):
            self.assertFalse((self.root / folder).exists(), folder)


class Archive(unittest.TestCase):
    def test_render(self):
        """Claim: the archive has one folder, and its programs render from wherever that is."""
        with tempfile.TemporaryDirectory(prefix="candela-package-") as folder:
            run("tar", "-xf", newest("candela-*.tar.gz"), "-C", folder)
            (prefix,) = Path(folder).iterdir()
            self.assertEqual(sorted(each.name for each in prefix.iterdir()), ["bin", "lib", "share"])
            render(prefix, Path(folder))


if __name__ == "__main__":
    own_namespaces(TEST, ("dpkg", "dpkg-deb", "setpriv", "readelf", "systemd-sysusers"))
    unittest.main(verbosity=2, argv=[sys.argv[0], *(sys.argv[1:] or ["Packages"])])
