#!/usr/bin/env python3
"""Regression guard that a noisy machine cannot disturb: instructions of small renders, counted by Callgrind, and
their error at fixed seeds, both against committed figures (guard.json).

  guard.py PROGRAM            compares; exit code 1 where something became worse, 77 where nothing could be compared
  guard.py PROGRAM --update   writes guard.json anew

Instructions may grow by 3 %, which is far above what a run differs from the next (below 0.01 %: addresses). The
error is relMSE estimated from an image's halves, times its iterations: at fixed seeds it is one number to the last
bit until somebody changes what is sampled. As such a change draws other random numbers, it may grow by 30 %: over
seeds the figure's relative standard deviation is 3 to 9 %, and of a ratio up to 13 %."""
import argparse
import concurrent.futures
import json
import os
import shutil
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted_each, run_each  # noqa: E402

FIGURES = os.path.join(HERE, "guard.json")
SCENES = {"cornell": "../../deploy/scenes/cornell/scene.xml", "area": "smallvcm/area.xml"}
INTEGRATORS = ("path", "bdpt", "vcm", "ppm", "light", "pssmlt", "mmlt")
MOST_INSTRUCTIONS = 1.03
MOST_ERROR = 1.30
# Enough that the loops, not what is done once a unit, are counted. Of Markov chains --iterations counts the segments of
# all chains: two of each.
COUNT = ("--size", "24x24", "--iterations", "4", "--set", "chains=2", "--set", "bootstrap=500", "--set", "radius=0.003",
         "--set", "pssmlt.mutations=1", "--set", "mmlt.mutations=4")
ERROR = ("--size", "48x48", "--iterations", "32", "--set", "chains=16", "--set", "bootstrap=4000", "--set", "radius=0.003",
         "--set", "pssmlt.mutations=16", "--set", "mmlt.mutations=64")


def arguments(program, scene, work):
    return [program, "count", "--scene", os.path.join(HERE, SCENES[scene]), "--integrators", ",".join(INTEGRATORS), *work]


def all_cases(scenes, results):
    """Figures by (scene, integrator)."""
    return {(scene, figures["integrator"]): figures for scene, lines in zip(scenes, results) for figures in lines}


def worse_than(name, figures, was, counted):
    """What became worse in a case, a line each."""
    cost, error = figures["instructions"] / was["instructions"], figures["error"] / was["error"]
    lines = []
    if counted and cost > MOST_INSTRUCTIONS:
        lines.append(f"{name}: {100 * (cost - 1):.1f} % more instructions")
    if error > MOST_ERROR:
        lines.append(f"{name}: {100 * (error - 1):.1f} % more error")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="build/bin/candela-bench")
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    cases = [(scene, integrator) for scene in SCENES for integrator in INTEGRATORS]
    have_valgrind = shutil.which("valgrind") is not None
    if options.update and not have_valgrind:
        sys.exit("guard.py: error: valgrind is missing (Debian: valgrind)")

    renders = all_cases(SCENES, [run_each(arguments(options.program, scene, ERROR)) for scene in SCENES])
    compiler = next(iter(renders.values()))["compiler"]
    try:
        with open(FIGURES, encoding="utf-8") as stream:
            committed = json.load(stream)
    except FileNotFoundError:
        committed = {"compiler": compiler, "cases": {}}
    reason = ""
    if not have_valgrind:
        reason = "valgrind is missing: instructions are not counted"
    elif committed["compiler"] != compiler and not options.update:
        reason = f"instructions are those of {committed['compiler']}, this is {compiler}"
    counts = {case: 0 for case in cases}
    if not reason:
        with concurrent.futures.ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
            lines = pool.map(lambda scene: counted_each(arguments(options.program, scene, COUNT)), SCENES)
            counts = {case: figures["instructions"] for case, figures in all_cases(SCENES, lines).items()}
        if 0 in counts.values():
            reason = "the program was built without valgrind/callgrind.h: instructions are not counted"
            if options.update:
                sys.exit("guard.py: error: " + reason)

    measured = {f"{scene} {integrator}": {
        "instructions": counts[scene, integrator],
        "error": float(f"{renders[scene, integrator]['own_relmse'] * renders[scene, integrator]['units']:.6g}")}
        for scene, integrator in cases}
    if options.update:
        with open(FIGURES + ".part", "w", encoding="utf-8") as stream:
            json.dump({"compiler": compiler, "cases": measured}, stream, indent=1)
            stream.write("\n")
        os.replace(FIGURES + ".part", FIGURES)
        return 0

    worse = []
    print(f"{'':20}{'M instructions':>15}{'was':>10}{'ratio':>8}{'error x units':>15}{'was':>10}{'ratio':>8}")
    for name, figures in measured.items():
        was = committed["cases"].get(name)
        if was is None:
            sys.exit(f"guard.py: error: guard.json has no '{name}'; guard.py PROGRAM --update writes it")
        cost = figures["instructions"] / was["instructions"]
        error = figures["error"] / was["error"]
        shown = f"{figures['instructions'] / 1e6:15.2f}" if not reason else f"{'-':>15}"
        ratio = f"{cost:8.4f}" if not reason else f"{'-':>8}"
        print(f"{name:20}{shown}{was['instructions'] / 1e6:10.2f}{ratio}{figures['error']:15.5g}"
              f"{was['error']:10.5g}{error:8.4f}")
        worse += worse_than(name, figures, was, not reason)
        if not reason and cost < 1 / MOST_INSTRUCTIONS:
            print(f"{name}: {100 * (1 - cost):.1f} % fewer instructions: --update keeps it so")
    for line in worse:
        print("worse: " + line + " (if it is meant: guard.py PROGRAM --update)")
    if worse:
        return 1
    if reason:
        # In the form that deploy/check lists skipped tests from.
        print(f"guard.py: Skipped\n{reason}\n[  SKIPPED ] bench_guard (0 ms)")
        return 77
    return 0


if __name__ == "__main__":
    sys.exit(main())
