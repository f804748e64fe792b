"""A machine of a test's own for the commands of pages: folders that they write to, hosts that they name, and stand-ins for programs
that are not there."""
import os
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

from apart import eventually
from manifests import PROGRAMS, SOURCE

SCENE = SOURCE / "deploy/scenes/cornell/scene.xml"
STAY = re.compile(r"candela-(master(?! backup)|worker) ")  # commands that do not end by themselves

SYSTEMCTL = """#!/bin/bash
# The part of systemd that units need: the user, the environment that it promises, ExecStart, and the signals of the units.
set -euo pipefail
unit_file() {
  local name="${1%%@*}" folder
  [[ $1 == *@* ]] && name="$name@"
  for folder in /etc /usr/lib; do
    [[ -f $folder/systemd/system/$name.service ]] && echo "$folder/systemd/system/$name.service" && return
  done
  echo "there is no unit $1" >&2
  return 1
}
start() {
  local file line
  file="$(unit_file "$1")"
  grep -qx User=candela "$file"
  line="$(sed -n 's/^ExecStart=//p' "$file")"
  line="${line//%i/${1#*@}}"
  export STATE_DIRECTORY=/var/lib/candela CACHE_DIRECTORY=/var/cache/candela HOME=/var/lib/candela
  install -d -m 700 "$STATE_DIRECTORY" "$CACHE_DIRECTORY"
  chown -R candela:candela "$STATE_DIRECTORY" "$CACHE_DIRECTORY"
  unset CANDELA_TLS_CERT CANDELA_TLS_KEY CANDELA_TLS_CA CANDELA_MASTER XDG_STATE_HOME
  eval "exec setpriv --reuid=candela --regid=candela --init-groups -- $line" </dev/null >"/var/log/${1%%@*}.log" 2>&1 &
  echo $! >"/run/${1%%@*}.pid"
  echo "$1" >"/run/${1%%@*}.unit"
  # A reader's next command comes some seconds later.
  for _ in {1..600}; do grep -qE 'listening on|registered as' "/var/log/${1%%@*}.log" && return; sleep 0.1; done
}
stop() {
  local pid
  [[ -f /run/$1.pid ]] || return 0
  pid="$(cat "/run/$1.pid")"
  kill "$pid" 2>/dev/null || true
  for _ in {1..1200}; do [[ -e /proc/$pid ]] || break; sleep 0.1; done
  rm "/run/$1.pid"
}
command="$1"
shift
case "$command" in
  daemon-reload)
    shopt -s nullglob
    units=(/etc/systemd/system/candela*.service /usr/lib/systemd/system/candela*.service)
    [[ ${#units[@]} == 0 ]] || systemd-analyze verify --man=no "${units[@]}" ;;
  enable)
    [[ $1 == --now ]] && shift
    for unit; do start "$unit"; done ;;
  reload)
    MAINPID="$(cat "/run/$1.pid")"
    eval "$(sed -n 's/^ExecReload=//p' "$(unit_file "$1")")" ;;
  try-restart)  # of what runs, in the order that is asked for
    for unit; do
      name="${unit%%[@.]*}"
      [[ -f /run/$name.pid ]] || continue
      stop "$name"
      (start "$(cat "/run/$name.unit")")
      echo "$name" >>/var/log/restarts
    done ;;
  stop) for unit; do stop "${unit%%[@.]*}"; done ;;
  disable) ;;
  *) echo "systemctl $command: unknown here" >&2; exit 1 ;;
esac
"""
# apt installs a file by dpkg; nothing is fetched.
APT = """#!/bin/bash
set -euo pipefail
case "$1" in
  install) exec dpkg --no-triggers -i "$2" ;;
  remove) exec dpkg --no-triggers -r "$2" ;;
  purge) exec dpkg --no-triggers -P "$2" ;;
  *) exit 1 ;;
esac
"""
SBATCH = """#!/bin/bash
cat >/var/log/sbatch
echo "Submitted batch job 7"
"""


def make_machine():
    """Folders that commands write to are this test's own; names of the pages are this machine."""
    scratch = Path(tempfile.mkdtemp(prefix="candela-commands-"))
    scratch.chmod(0o755)  # services have a user of their own
    # Changes lie over the machine's folders, and are gone with the namespace.
    over = scratch / "over"
    over.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "none", over], check=True)

    def lay_over(lower, place):
        upper, work = (over / f"{lower.strip('/').replace('/', '-')}-{part}" for part in ("upper", "work"))
        upper.mkdir()
        work.mkdir()
        subprocess.run(["mount", "-t", "overlay", "-o", f"lowerdir={lower},upperdir={upper},workdir={work}", "none", place], check=True)

    packages = scratch / "var/lib/dpkg"
    packages.mkdir(parents=True)
    (scratch / "run").mkdir()
    lay_over("/var/lib/dpkg", packages)
    for folder in ("/etc", "/usr"):
        lay_over(folder, folder)
    for folder in ("/var", "/run"):
        subprocess.run(["mount", "--rbind", scratch / folder.strip("/"), folder], check=True)
    for folder in ("/etc/candela", "/etc/systemd/system", "/var/lib", "/var/cache", "/var/log", "/var/tmp", "/var/backups/candela", "/run/systemd/system"):
        Path(folder).mkdir(parents=True, exist_ok=True)
    local = scratch / "usr-local-bin"
    local.mkdir()
    subprocess.run(["mount", "--bind", local, "/usr/local/bin"], check=True)
    Path("/etc/hosts").write_text("127.0.0.1 localhost render.example.org\n")
    for name, text in (("systemctl", SYSTEMCTL), ("sbatch", SBATCH), ("apt", APT), ("sudo", '#!/bin/bash\nexec "$@"\n')):
        path = Path("/usr/local/bin") / name
        path.write_text(text)
        path.chmod(0o755)
    return scratch


class OnAMachine(unittest.TestCase):
    """Tests on one machine; each begins with nothing running."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = make_machine()
        cls.folder = cls.scratch / "home"
        cls.folder.mkdir()
        (cls.folder / "build").symlink_to(PROGRAMS.parent)
        (cls.folder / "deploy").symlink_to(SOURCE / "deploy")
        cls.path = f"/usr/local/bin:{PROGRAMS}:{os.environ['PATH']}"
        cls.held = {"DIR": str(cls.scratch / "dir"), "DATA": "/var/lib/candela", "HOST": "render.example.org"}
        cls.staying = []

    @classmethod
    def tearDownClass(cls):
        # A folder on which something is mounted cannot be removed.
        for places in (["--recursive", "/var"], [cls.scratch / "var/lib/dpkg"], [cls.scratch / "over"]):
            subprocess.run(["umount", "--lazy", *places], check=True)
        shutil.rmtree(cls.scratch)

    def setUp(self):
        self.stop()
        # Tokens of this test's masters are not for the programs of who runs it.
        self.environment = dict(os.environ, PATH=self.path, XDG_STATE_HOME=str(self.scratch / "state"))
        self.environment.pop("CANDELA_MASTER", None)
        subprocess.run("rm -rf /etc/candela/* /var/lib/candela /var/cache/candela tls; mkdir -p /etc/candela", shell=True, check=True, cwd=self.folder)

    def tearDown(self):
        self.stop()

    def run_line(self, line):
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", line], cwd=self.folder, env=self.environment, timeout=300,
                              capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
        self.assertEqual(done.returncode, 0, f"{line}\n{done.stdout}{done.stderr}")
        return done.stdout

    def start(self, line):
        """A program that stays; returns when it is ready."""
        said = self.scratch / f"{len(self.staying)}.log"
        with open(said, "wb") as log:
            child = subprocess.Popen(shlex.split(line), cwd=self.folder, stdout=log, stderr=log,
                                     env=self.environment)
        self.staying.append(child)
        ready = "listening on" if line.startswith("candela-master") else "registered as"
        self.assertTrue(eventually(lambda: ready in said.read_text() or child.poll() is not None), line)
        self.assertIsNone(child.poll(), f"{line}\n{said.read_text()}")

    def stop(self):
        for child in reversed(self.staying):
            child.terminate()
        for child in self.staying:
            child.wait(120)
        self.staying.clear()
        for pid in Path("/run").glob("candela*.pid"):
            number = int(pid.read_text())
            try:
                os.kill(number, signal.SIGTERM)
                self.assertTrue(eventually(lambda: not Path(f"/proc/{number}").exists()))
            except ProcessLookupError:
                pass
            pid.unlink()

    def workers(self, how=""):
        return re.findall(r"^(w[a-z0-9]{10})\b", self.run_line(f"candela workers {how}"), re.M)

    def have_job(self, iterations=16):
        self.held["ID"] = self.run_line(f"candela submit {SCENE} --size 32x32 --iterations {iterations}").strip()

    def run_page_line(self, line):
        line = re.sub(r"\b(ID|WORKER|DIR|DATA|PLACE|HOST)\b", lambda word: self.held.get(word[1], word[1]), line)
        if line.startswith("export "):
            self.environment.update(word.split("=", 1) for word in line.split()[1:])
        elif STAY.match(line):
            if line.startswith("candela-master"):
                self.stop()
            self.start(line)
        else:
            return self.run_line(line)
        return ""

    def say_master(self):
        """As farm.md has told whoever reads its further pages."""
        self.environment["CANDELA_MASTER"] = "127.0.0.1:7070"
