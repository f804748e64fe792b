"""A name of the sources as they are, by which results are kept."""
import hashlib
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def sources(*without):
    """A digest of all files of the checkout but those that fit a pathspec of `without`. The commit does not matter."""
    def git(*arguments):
        return subprocess.run(["git", "-C", ROOT, *arguments, "--", ".", *(f":!{one}" for one in without)], capture_output=True, check=False).stdout
    digest = hashlib.sha256(git("ls-files", "-s") + git("diff"))
    for name in filter(None, git("ls-files", "-o", "-z", "--exclude-standard").split(b"\0")):
        digest.update(name)
        path = ROOT / name.decode()
        digest.update(path.read_bytes() if path.is_file() else b"")
    return digest.hexdigest()[:16]
