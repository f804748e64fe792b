"""Every command of the pages for users is run as it stands, in the order of its page, in a folder of its own.

The commands are the fenced blocks called `sh`. Images are small: a stand-in for `candela` gives renders a size and a limit if the page
gives none. Placeholders (ID, FOLDER, HOST) are what a reader would put there. docs/http.md is run by http_page."""
import http.server
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import unittest
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from apart import eventually, own_namespaces
from machine import SCENE, STAY, OnAMachine
from manifests import PROGRAMS, SOURCE

TEST = "deploy_pages"
PAGES = ("aovs", "inspect", "inspect-tools", "inspect-volume", "pictures", "notices", "from-blender", "layers", "frames", "reproduce", "README")
# Pages with commands in such blocks that others run.
ELSEWHERE = {"http": "tests/doors/test_http_page.py", "farm": "tests/deploy/test_commands.py"}
# Commands of README in blocks without a language, which set up a checkout, and what runs them.
CHECKOUT = {
    "deploy/quickstart": "deploy/quickstart",
    "deploy/check": ".ci/run",
    "cmake -G Ninja -S . -B build && cmake --build build": "deploy/lib.sh",
    "ctest --test-dir build -L unit": "deploy/check",
    "tests/fuzz/run.sh 600": "tests/nightly/all",
}
LAMP_OF_TABLE = '<emitter type="point" id="{}"><point name="position" value="0, 1.9, 0"/><rgb name="intensity" value="0.1"/></emitter>'
# A picture is small, and a render without a limit short. Options of the page go before.
CANDELA = """#!/bin/bash
more=()
case "${1:-}" in
  render | submit)
    [[ " $* " == *" --size "* ]] || more+=(--size 48x36)
    [[ " $* " =~ " --"(spp|time|until|iterations|indices|resume)" " ]] || more+=(--spp 8) ;;
  inspect)
    [[ "$2" != volume && " $* " != *" --region "* || " $* " == *" --pixels "* ]] || more+=(--size 48x36)
    [[ "$2" == falsecolor || " $* " == *" --spp "* ]] || more+=(--spp 4) ;;
esac
exec "$CANDELA_REAL" "$@" "${more[@]}"
"""


def text_of(page):
    return (SOURCE / ("README.md" if page == "README" else f"docs/{page}.md")).read_text()


def blocks(page, language="sh"):
    return [block for found, block in re.findall(r"^```(\w*)\n(.*?)^```$", text_of(page), re.M | re.S) if found == language]


class Receiver(http.server.ThreadingHTTPServer):
    """Keeps the notices that a master sends: pairs of headers and body."""

    def __init__(self):
        self.notices, self.came = [], threading.Condition()
        super().__init__(("127.0.0.1", 0), Take)
        threading.Thread(target=self.serve_forever, daemon=True).start()


class Take(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        with self.server.came:
            self.server.notices.append((self.headers, body))
            self.server.came.notify_all()
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_):
        pass


class Pages(OnAMachine):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        small = cls.scratch / "small"
        small.mkdir()
        (small / "candela").write_text(CANDELA)
        (small / "candela").chmod(0o755)
        cls.path = f"{small}:{cls.path}"

    def setUp(self):
        super().setUp()
        self.environment["CANDELA_REAL"] = str(PROGRAMS / "candela")
        self.home = self.folder
        self.folder = self.home / self.id().rsplit(".", 1)[1]
        self.folder.mkdir()
        for name in ("deploy", "build"):
            (self.folder / name).symlink_to((self.home / name).resolve())
        self.held = {"HOST": "127.0.0.1"}

    def run_blocks(self, page, count):
        """All that the blocks print. A master or worker in them stays until the test ends; variables hold within a block."""
        found = blocks(page)
        self.assertEqual(len(found), count, f"blocks of {page}")
        return "".join(self.run_block(block) for block in found)

    def run_block(self, block):
        said, waiting = "", []
        block = re.sub(r"\b(ID|FOLDER|HOST)\b(?!=)", lambda word: self.held.get(word[1], word[1]), block)
        for line in block.splitlines():
            line = re.sub(r"\s+# .*$", "", line)
            if STAY.match(line):
                self.assertEqual(waiting, [])
                self.start(line)
            elif line.startswith("export "):
                self.environment.update(word.split("=", 1) for word in line.split()[1:])
            else:
                waiting.append(line)
        return said + (self.run_line("\n".join(waiting)) if waiting else "")

    def start_farm(self, more=""):
        self.start(f"candela-master --listen 127.0.0.1:7070 --data /var/lib/candela {more}")
        self.start("candela-worker --master 127.0.0.1:7070 --cache /var/cache/candela")
        self.environment["CANDELA_MASTER"] = "127.0.0.1:7070"

    def have_scene(self, name="scene.xml", more="", lamp=""):
        """A scene of the reader's, with a parameter `frame`, as those pages assume that speak of scene.xml."""
        text = SCENE.read_text()
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        if lamp:
            text, times = re.subn(r'<shape type="rectangle"(?: id="\w*")?>(?=(?:(?!</shape>).)*<emitter)', f'<shape type="rectangle" id="{lamp}">', text, flags=re.S)
            self.assertEqual(times, 1)
        path.write_text(re.sub(r"(<scene[^>]*>)", r'\1<default name="frame" value="1"/>', text, count=1)
                        .replace("</scene>", f'{more}</scene>')
                        .replace("</sampler>", '<integer name="seed" value="$frame"/></sampler>'))

    def pictures(self, *names):
        for name in names:
            start = {"exr": b"v/1\x01", "png": b"\x89PNG", "jpg": b"\xff\xd8", "tif": b"II*\0"}[name.rsplit(".", 1)[1]]
            self.assertEqual((self.folder / name).read_bytes()[:len(start)], start, name)

    def test_inspect(self):
        """Claim: the commands of the tutorial run in its order; the file of an edit that it shows is that of the scene; each of the
        six edits changes the picture that `--edits none` renders; each picture of the page is of a file that its commands write."""
        said = "".join(self.run_block(block) for block in blocks("inspect"))
        self.pictures("studio.exr", "studio.png", "falsecolor.png", "paths.png", "around.png", "volume.png", "moved.png")
        self.assertIn(blocks("inspect", "text")[0].strip(), said)
        self.assertEqual(json.loads((SOURCE / "deploy/scenes/studio/edits/caustic.json").read_text()), json.loads(blocks("inspect", "json")[0]))
        edited = re.findall(r"^(candela render .* -o (\w+)\.exr .*--edits) (\S+)$", text_of("inspect"), re.M)
        self.assertEqual(len({edits for _, _, edits in edited}), 6)
        for render, name, _ in edited:
            self.run_line(render.replace(f"{name}.exr", "before.exr") + " none")
            change = json.loads(self.run_line(f"candela inspect falsecolor {name}.exr --minus before.exr -o change.png --percentiles 0,100 --json"))
            self.assertGreater(max(map(abs, change["range"])), 0.01, name)
        for picture in re.findall(r"\(figures/inspect/(\S+)\.\w+\)", text_of("inspect")):
            self.assertTrue(list(self.folder.glob(f"{picture}.*")) or picture in ("cornell", "room"), picture)

    def test_inspect_tools(self):
        self.run_blocks("inspect-tools", 1)
        self.pictures("error.png", "depth.png", "around.exr")
        self.assertTrue(json.loads((self.folder / "paths.json").read_text())["clusters"])
        for name in ("paths.ply", "lobe.ply"):
            self.assertTrue((self.folder / name).read_text().startswith("ply\n"), name)

    def test_inspect_volume(self):
        if not (PROGRAMS / "candela-vdb.so").exists():
            self.skipTest("the build has no OpenVDB (Debian: libopenvdb-dev)")
        self.run_blocks("inspect-volume", 1)
        self.pictures("slices.png")
        self.assertGreater((self.folder / "light.vdb").stat().st_size, 1000)

    def test_aovs(self):
        self.have_scene()
        self.run_blocks("aovs", 1)
        self.pictures("out.exr", "objects.png")

    def test_pictures(self):
        libraries = PROGRAMS / "oidn_2"  # a stand-in, if Open Image Denoise is not installed
        self.environment["LD_LIBRARY_PATH"] = str(libraries)
        self.run_blocks("pictures", 2)
        self.pictures("out.png", "out.jpg", "out.tif", "depth.png", "normal.tif", "clean.exr", "clean.png", "both.exr")
        self.run_line("candela convert both.exr denoised.png --layer denoised")

    def test_layers(self):
        self.have_scene()
        example, partition, mix, lamps = blocks("layers")
        for block in (example, partition):
            self.run_block(block)
        self.pictures("caustics.png")
        (self.folder / "mix.json").write_text(blocks("layers", "json")[0])
        self.start_farm()
        self.have_scene("scene.xml", lamp="key", more=LAMP_OF_TABLE.format("fill"))
        self.run_block(mix)
        self.assertIn("mixed.exr", self.run_line("candela compare mixed.exr mixed.exr; ls"))
        self.have_scene("scene.xml", lamp="key1", more=LAMP_OF_TABLE.format("rim1"))
        self.held["ID"] = self.run_block(lamps).strip()
        self.run_line(f"candela watch {self.held['ID']}")
        # The rows of the table of examples, and the element, in a scene with those names.
        self.have_scene("named.xml", "".join(LAMP_OF_TABLE.format(name) for name in ("key", "rim1")) +
                        '<shape type="sphere" id="mirror"><point name="center" value="0.4, 0.4, 0.4"/><float name="radius" value="0.2"/>'
                        '<bsdf type="conductor"/></shape>'
                        '<shape type="cube"><transform name="to_world"><scale value="0.1"/></transform><bsdf type="null"/>'
                        '<medium name="interior" type="homogeneous" id="fog"/></shape>')
        rows = [row for row in re.findall(r"^\|.*?\| `(--layer .*)` \|$", text_of("layers"), re.M)]
        self.assertEqual(len(rows), 6)
        for row in (*(row.replace("` `", " ") for row in rows), '--layer "rim=L{rim*}[DGSV]*E"'):
            self.assertIn(row, text_of("layers"))
            self.run_line(f"candela plan named.xml --integrator bdpt {row}")
        element = blocks("layers", "xml")[0]
        self.have_scene("element.xml")
        path = self.folder / "element.xml"
        text, times = re.subn(r"<integrator.*?</integrator>", lambda _: element, path.read_text(), flags=re.S)
        self.assertEqual(times, 1)
        path.write_text(text)
        self.run_line("candela render element.xml -o element.exr --iterations 2; candela convert element.exr caustics.png --layer caustics")

    def test_frames(self):
        self.have_scene()
        self.have_scene("comp.xml")
        for frame in range(1, 25, 2):
            self.have_scene(f"shots/scene.{frame:04}.xml")
        self.start_farm()
        said = self.run_blocks("frames", 3)
        self.pictures(*(f"shot.{frame:04}.exr" for frame in range(1, 25)), "part.exr")
        self.assertRegex(said, r"(?m)^name +comp|comp")
        self.run_line("candela watch comp walk")
        # The words of the page within sentences.
        for words in ("list --mine", "list --name 'sho*'", "list --state done,running", "list --unfold", "show shot", "extend comp --spp +8"):
            self.run_line(f"candela {words}")

    def test_notices(self):
        self.have_scene()
        receiver = Receiver()
        self.addCleanup(receiver.server_close)
        self.addCleanup(receiver.shutdown)
        for name, text in (("notify-send", f'echo "$@" >>{self.folder}/told\n'), ("publish.sh", f'echo "published $CANDELA_JOB_STATE" >>{self.folder}/told\n')):
            path = (self.scratch / "small" if name == "notify-send" else self.folder) / name
            path.write_text(f"#!/bin/sh\n{text}")
            path.chmod(0o755)
        # The line of the configuration, with the address of a receiver that is there.
        Path("/etc/candela/config.toml").write_text(
            re.sub(r"https://\S+/candela", f"http://127.0.0.1:{receiver.server_port}/candela", blocks("notices", "toml")[0]))
        self.start_farm()
        self.held["ID"] = self.run_line("candela submit scene.xml --name first").strip()
        self.run_blocks("notices", 1)
        self.assertEqual((self.folder / "told").read_text().splitlines(), ["first is done", "published done"])
        with receiver.came:
            self.assertTrue(receiver.came.wait_for(lambda: len(receiver.notices) >= 2, 60))
        secret = Path("/var/lib/candela/notify-secret").read_bytes()
        for headers, body in receiver.notices:
            names = {"secret": secret, "body": body, "headers": headers}
            exec(blocks("notices", "python")[0], names)  # as the page tells the receiver  # pylint: disable=exec-used
            self.assertIs(names["genuine"], True)
            self.assertEqual(json.loads(body)["event"], "job-done")
            self.assertLessEqual({"id", "unix_ms", "text", "job"}, set(json.loads(body)))

    def test_reproduce(self):
        self.have_scene()
        self.have_scene("moved/scene.xml")
        self.start_farm()
        said = self.run_blocks("reproduce", 1)
        self.assertEqual(said.count("\nequal: ") + said.startswith("equal: "), 3, said)

    def test_from_blender(self):
        if not shutil.which("blender"):
            self.skipTest("there is no Blender (Debian: blender)")
        self.held["FOLDER"] = "exported"
        subprocess.run(["blender", "-b", "--factory-startup", "-P", SOURCE / "tests/deploy/blender_scene.py", "--", self.folder, "spot"],
                       check=True, capture_output=True, env=self.environment)
        self.run_blocks("from-blender", 1)
        self.pictures("shot.exr", "shot.png")

    def test_readme(self):
        self.have_scene()
        one_machine, several = blocks("README")
        # The programs of the checkout, with small images.
        (self.folder / "build").unlink()
        (self.folder / "build").mkdir()
        (self.folder / "build/bin").symlink_to(self.scratch / "small")
        self.run_line("candela render scene.xml -o reference.exr --seed 1")
        before, resumed, after = re.match(r"(.*\n)([^\n]*--resume[^\n]*\n)(.*)", one_machine, re.S).groups()
        self.run_block(before)
        # Ctrl-C, and the command that goes on.
        child = subprocess.Popen(shlex.split(resumed.split("#")[0].replace("--resume", "--spp 500")), cwd=self.folder, env=self.environment)
        self.assertTrue(eventually(lambda: (self.folder / "out.exr.candela").is_dir() or child.poll() is not None))
        child.send_signal(signal.SIGINT)
        self.assertIn(child.wait(120), (0, 128 + signal.SIGINT))
        self.assertTrue((self.folder / "out.exr.candela").is_dir(), "the render ended before Ctrl-C")
        self.run_block(resumed)
        self.assertIn("equal: ", self.run_block(after))
        self.pictures("out.exr", "out.png")
        (self.folder / "out.exr").unlink()
        self.run_block(several)
        self.pictures("out.exr")

    def test_all_commands_are_run(self):
        """Claim: each block of commands of README and docs/ that these pages have is called sh and is run; a block of these pages
        without a language, or of indented lines, has no command."""
        for page in PAGES:
            text = re.sub(r"^```\w+\n.*?^```$", "", text_of(page), flags=re.M | re.S)
            lines = [line.strip() for block in re.findall(r"^```\n(.*?)^```$", text, re.M | re.S) for line in block.splitlines()]
            lines += [line.strip() for line in re.findall(r"^    (\S.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S), re.M)]
            for line in lines:
                command = re.sub(r"\s+# .*$", "", line)
                run_by = CHECKOUT.get(command) if page == "README" else None
                self.assertTrue(run_by or not re.match(r"(candela|build/|deploy/|cmake|ctest|tests/|curl|export)", line), f"{page}: {line}")
                if run_by:
                    self.assertTrue((SOURCE / run_by).exists(), run_by)
        with_blocks = {path.stem for path in (SOURCE / "docs").glob("*.md") if "\n```sh\n" in path.read_text()}
        self.assertEqual(with_blocks - set(ELSEWHERE), set(PAGES) - {"README"})


if __name__ == "__main__":
    own_namespaces(TEST, ("jq",))
    unittest.main(verbosity=2)
