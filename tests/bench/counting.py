"""Instructions of `candela-bench count`, as Callgrind counts them around the render calls alone."""
import json
import os
import subprocess
import sys
import tempfile


def run(command):
    """What the command prints, read as JSON. A command that fails ends the program with its error."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{os.path.basename(sys.argv[0])}: error: {' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def counted(command):
    """The same with 'instructions': 0 where the program was built without valgrind/callgrind.h."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "out")
        figures = run(["valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={out}", *command])
        with open(out, encoding="utf-8") as stream:
            totals = [line for line in stream if line.startswith("totals:")]
    figures["instructions"] = int(totals[0].split()[1]) if totals else 0
    return figures
