"""Claim: the commands of docs/http.md do what it says, one after the other, on a farm of real processes."""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SOURCE, PROGRAMS = Path(os.environ["CANDELA_SOURCE_DIR"]), Path(os.environ["CANDELA_PROGRAMS"])

absent = [program for program in ("curl", "jq") if shutil.which(program) is None]
if absent:
    print(f"test_http_page.py:1: Skipped\nthese Debian packages are absent: {' '.join(absent)}")
    print("[  SKIPPED ] http_page (0 ms)")
    sys.exit(77)

blocks = re.findall(r"^```sh\n(.*?)^```", (SOURCE / "docs/http.md").read_text(), re.S | re.M)
assert len(blocks) >= 4, blocks
with tempfile.TemporaryDirectory(prefix="candela-http-") as scratch:
    folder = Path(scratch)
    (folder / "page-token").write_text("0123456789abcdef0123456789abcdef\n")
    (folder / "page-token").chmod(0o600)
    (folder / "config.toml").touch()  # not the machine's own settings
    environment = {**os.environ, "PATH": f"{PROGRAMS}:{os.environ['PATH']}", "HOME": scratch, "CANDELA_CONFIG": f"{scratch}/config.toml",
                   "XDG_STATE_HOME": scratch, "DATA": f"{scratch}/data", "PAGE_TOKEN_FILE": f"{scratch}/page-token",
                   "SCENE": str(SOURCE / "deploy/scenes/cornell/scene.xml"), "no_proxy": "*"}
    processes = []
    try:
        # The product's master, which also tells of violated invariants of its scheduler (tests/farm/checked_master.h).
        with open(folder / "master.err", "wb") as errors:
            master = subprocess.Popen([PROGRAMS / "checked-master", "--data", folder / "data", "--listen", "127.0.0.1:0",
                                       "--http", "127.0.0.1:0", "--page-token-file", folder / "page-token"],
                                      env=environment, stdout=subprocess.PIPE, stderr=errors, text=True)
        processes.append(master)
        address = master.stdout.readline().split()[-1]
        environment["URL"] = "http://" + master.stdout.readline().split()[-1]
        processes.append(subprocess.Popen([PROGRAMS / "candela-worker", "--master", address, "--threads", "1", "--cache",
                                           folder / "cache", "--name", "http"], env=environment))
        deadline = time.monotonic() + 60  # the last block but one asks for workers
        while "http" not in subprocess.run([PROGRAMS / "candela", "workers", "--master", address], env=environment,
                                           capture_output=True, text=True, check=False).stdout:
            assert time.monotonic() < deadline, "no worker came"
            time.sleep(0.1)
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(blocks)], env=environment, cwd=folder, text=True,
                              capture_output=True, timeout=300, check=False)
        print(done.stdout, done.stderr)
        assert done.returncode == 0, "a command of docs/http.md fails"
        assert "by-http" in done.stdout and "\n5\n" in done.stdout and "\n528\n" in done.stdout and "\nhttp\n" in done.stdout
        assert json.loads((folder / "answer.json").read_text())["existed"] is False
        assert (folder / "image.exr").read_bytes()[:4] == b"v/1\x01" and (folder / "image.png").read_bytes()[:4] == b"\x89PNG"
    finally:
        for process in processes[::-1]:
            process.terminate()
            process.wait(60)
        print((folder / "master.err").read_text())
    assert "invariant violated: " not in (folder / "master.err").read_text()
