"""A test in mount and network namespaces of its own: it may mount what it likes and take any port."""
import os
import shutil
import subprocess
import sys
import time

from manifests import skip

_APART = "CANDELA_TEST_APART"  # set in the namespaces


def own_namespaces(test, tools):
    """Runs this program again where its mounts and its network are nobody else's, and returns there. Skips `test` where one of
    `tools` is absent or the user may not."""
    if _APART in os.environ:
        subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
        return
    absent = [tool for tool in ("unshare", "ip", *tools) if not shutil.which(tool)]
    if absent:
        skip(test, f"not installed: {', '.join(absent)}")
    apart = ["unshare", "--mount", "--net", "--propagation", "private"]
    if subprocess.run([*apart, "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, check=False).returncode != 0:
        skip(test, "this user may not make mount and network namespaces (root may)")
    os.execvpe("unshare", [*apart, sys.executable, *sys.argv], dict(os.environ, **{_APART: "1"}))


def eventually(condition, seconds=120):
    """The condition's value as soon as it is true, or its last."""
    end = time.monotonic() + seconds
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(0.05)
    return value
