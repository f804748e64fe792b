"""A Debian package of the same programs under another build id, as a later build would make it. Its version is higher. What
differs between two builds of other sources is more; what a farm looks at is the id."""
import re
import subprocess


def build_of(program):
    """The build id that a program tells."""
    return re.search(r"\d+\.\d+\.\d+-[0-9a-f]{16}", subprocess.check_output([program, "--version"], text=True))[0]


def make_other_build(package, folder):
    """Path of the made package, its build id, and that of `package`."""
    root = folder / "other-build"
    subprocess.run(["dpkg-deb", "-R", package, root], check=True)
    programs = [root / "usr/bin" / name for name in ("candela", "candela-master", "candela-worker")]
    old = build_of(programs[2])
    new = old[:-16] + "0123456789abcdef"
    for program in programs:
        data = program.read_bytes()
        assert old.encode() in data, f"{program} does not have its build id as text"
        program.write_bytes(data.replace(old.encode(), new.encode()))
    control = root / "DEBIAN/control"
    text, times = re.subn(r"(?m)^(Version: .*)$", r"\1.1", control.read_text())
    assert times == 1
    control.write_text(text)
    made = folder / "candela_other_amd64.deb"
    subprocess.run(["dpkg-deb", "--root-owner-group", "-Znone", "-b", root, made], check=True, capture_output=True)
    return made, new, old
