"""Instructions of `candela-bench count`, as Callgrind counts them around the render calls alone."""
import json
import os
import subprocess
import sys
import tempfile


def run_each(command, environment=None):
    """What the command prints, each line read as JSON. A command that fails ends the program with its error."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        sys.exit(f"{os.path.basename(sys.argv[0])}: error: {' '.join(command)}: {done.stderr.strip()}")
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]  # others are warnings


def run(command):
    """The same of a command that prints one line."""
    return run_each(command)[0]


def instructions_in(path):
    """The total of a file of Callgrind's; 0 where there is none."""
    try:
        with open(path, encoding="utf-8") as stream:
            totals = [line for line in stream if line.startswith("totals:")]
    except FileNotFoundError:
        return 0
    return int(totals[0].split()[1]) if totals else 0


def counted_each(command):
    """run_each with 'instructions' in each line: 0 where the program was built without valgrind/callgrind.h."""
    clock = os.path.join(os.path.dirname(command[0]), "libclock_for_valgrind.so")
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "out")
        lines = run_each(["valgrind", "--tool=callgrind", "--instr-atstart=no", "--collect-atstart=no", f"--callgrind-out-file={out}", *command],
                         {**os.environ, "LD_PRELOAD": clock})
        for number, figures in enumerate(lines, 1):
            figures["instructions"] = instructions_in(f"{out}.{number}")
    return lines


def counted(command):
    """The same of a command that prints one line."""
    return counted_each(command)[0]
