#!/usr/bin/env python3
"""Guard on what a start costs: a render of 16 x 16 pixels, and a master without work. Counted are instructions, by
Callgrind, from the first one of the dynamic linker to the end; shared libraries, those loaded later included; and the
most memory that was resident.

  start_guard.py FOLDER            FOLDER: where the programs are (build/bin). Compares with start_guard.json; exit code 1
                                   where a start became dearer, 77 where instructions could not be counted
  start_guard.py FOLDER --update   writes start_guard.json anew

A library more than committed is an error. Instructions may grow by 10 %: threads wait more or less from run to run, which
is below 2 %. Memory is bound by a number of the specification, for it depends on the machine."""
import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import instructions_in  # noqa: E402

FIGURES = os.path.join(HERE, "start_guard.json")
SCENE = os.path.join(HERE, "../../deploy/scenes/cornell/scene.xml")
MOST_INSTRUCTIONS = 1.10
MOST_KB = 60 * 1000 * 1000 // 1024
IDLE_SECONDS = 1


def run_to_end(command, environment):
    """Runs a command that ends by itself; most memory in kB."""
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    error = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"start_guard.py: error: {' '.join(command)}: {error.strip()}")
    return usage.ru_maxrss


def run_idle(command, environment):
    """Runs a master until it has served for a moment; most memory in kB."""
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    if not process.stdout.readline().startswith("listening"):
        process.kill()
        sys.exit(f"start_guard.py: error: {' '.join(command)} does not listen")
    time.sleep(IDLE_SECONDS)
    process.send_signal(signal.SIGTERM)
    process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 128 + signal.SIGTERM:
        sys.exit(f"start_guard.py: error: {' '.join(command)} ended with {process.returncode}")
    return usage.ru_maxrss


def cases(programs, work):
    """Command and how it is run, by name. Each call has a folder of its own."""
    return {
        "candela render": (run_to_end, [os.path.join(programs, "candela"), "render", SCENE, "--size", "16x16", "--iterations", "1",
                                        "--threads", "1", "--quiet", "-o", os.path.join(work, "out.exr")]),
        "candela-master": (run_idle, [os.path.join(programs, "candela-master"), "--data", os.path.join(work, "data"),
                                      "--listen", "127.0.0.1:0"]),
    }


def libraries_in(folder):
    """Names of the libraries that the dynamic linker said (LD_DEBUG=files) it initialised."""
    names = set()
    for name in os.listdir(folder):
        if name.startswith("linker."):
            with open(os.path.join(folder, name), encoding="utf-8") as stream:
                names.update(os.path.basename(path) for path in re.findall(r"calling init: (\S+)", stream.read()))
    return names


def measure(programs, name, count):
    """Figures of a case."""
    figures = {}
    with tempfile.TemporaryDirectory() as work:
        run, command = cases(programs, work)[name]
        environment = {**os.environ, "LD_DEBUG": "files", "LD_DEBUG_OUTPUT": os.path.join(work, "linker")}
        run(command, environment)
        figures["libraries"] = sorted(libraries_in(work))
    with tempfile.TemporaryDirectory() as work:
        run, command = cases(programs, work)[name]
        figures["kB"] = run(command, dict(os.environ))
    if count:
        with tempfile.TemporaryDirectory() as work:
            run, command = cases(programs, work)[name]
            out = os.path.join(work, "callgrind.out")
            run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", *command], dict(os.environ))
            figures["instructions"] = instructions_in(out)
    return figures


def worse_than(name, figures, was):
    """What became worse in a case, a line each."""
    lines = []
    added = sorted(set(figures["libraries"]) - set(was["libraries"]))
    if len(figures["libraries"]) > len(was["libraries"]):
        lines.append(f"{name}: {len(figures['libraries'])} libraries, not {len(was['libraries'])}: {', '.join(added)}")
    if figures["kB"] > MOST_KB:
        lines.append(f"{name}: {figures['kB'] * 1024 / 1e6:.1f} MB of memory")
    cost = figures.get("instructions", 0) / was["instructions"]
    if cost > MOST_INSTRUCTIONS:
        lines.append(f"{name}: {100 * (cost - 1):.1f} % more instructions")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", help="build/bin")
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    count = shutil.which("valgrind") is not None
    if options.update and not count:
        sys.exit("start_guard.py: error: valgrind is missing (Debian: valgrind)")
    programs = os.path.abspath(options.programs)
    measured = {name: measure(programs, name, count) for name in cases(programs, "")}
    if options.update:
        committed = {name: {"instructions": figures["instructions"], "libraries": figures["libraries"]}
                     for name, figures in measured.items()}
        with open(FIGURES + ".part", "w", encoding="utf-8") as stream:
            json.dump(committed, stream, indent=1)
            stream.write("\n")
        os.replace(FIGURES + ".part", FIGURES)
        return 0

    with open(FIGURES, encoding="utf-8") as stream:
        committed = json.load(stream)
    worse = []
    print(f"{'':16}{'M instructions':>15}{'was':>10}{'libraries':>11}{'was':>6}{'MB':>8}{'at most':>9}")
    for name, figures in measured.items():
        was = committed[name]
        shown = f"{figures['instructions'] / 1e6:15.2f}" if count else f"{'-':>15}"
        print(f"{name:16}{shown}{was['instructions'] / 1e6:10.2f}{len(figures['libraries']):11}{len(was['libraries']):6}"
              f"{figures['kB'] * 1024 / 1e6:8.1f}{MOST_KB * 1024 / 1e6:9.1f}")
        worse += worse_than(name, figures, was)
    for line in worse:
        print("worse: " + line + " (if it is meant: start_guard.py FOLDER --update)")
    if worse:
        return 1
    if not count:
        # In the form that deploy/check lists skipped tests from.
        print("start_guard.py: Skipped\nvalgrind is missing: instructions are not counted\n[  SKIPPED ] bench_start_guard (0 ms)")
        return 77
    return 0


if __name__ == "__main__":
    sys.exit(main())
