"""The order and the filters of the list of jobs, in Node without a browser. Skips, with a reason, where Node is not installed;
test_wall.py runs the same cases in its browser."""
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCE = Path(os.environ["CANDELA_SOURCE_DIR"])

if shutil.which("node") is None:
    print("test_order.py:1: Skipped\nNode is not installed (Debian: nodejs)")
    print("[  SKIPPED ] page_order (0 ms)")
    sys.exit(77)
with tempfile.TemporaryDirectory(prefix="candela-order-") as scratch:
    folder = Path(scratch)
    (folder / "package.json").write_text('{"type": "module"}')
    for name in ("order.js", "dom.js"):
        shutil.copy(SOURCE / "master/http/page" / name, folder)
    (folder / "run.js").write_text("import * as order from './order.js';\n"
                                   f"const wrong = ({(SOURCE / 'tests/page/order_cases.js').read_text()}\n)(order);\n"
                                   "console.log(wrong.join('\\n') || 'all hold');\nprocess.exit(wrong.length ? 1 : 0);\n")
    sys.exit(subprocess.run(["node", folder / "run.js"], check=False).returncode)
