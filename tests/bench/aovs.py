#!/usr/bin/env python3
"""What AOVs cost: instructions of a render with them over those of the same render without, counted by Callgrind.

  aovs.py PROGRAM [--integrators path,bdpt]"""
import argparse
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted_each  # noqa: E402

SCENES = ("cornell", "studio")
AOVS = ("depth", "albedo", "albedo,normal,depth")
WORK = ("--size", "48x48", "--iterations", "8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="build/bin/candela-bench")
    parser.add_argument("--integrators", default="path,bdpt,vcm")
    options = parser.parse_args()
    for scene in SCENES:
        path = os.path.join(HERE, "../../deploy/scenes", scene, "scene.xml")
        command = [options.program, "count", "--scene", path, "--integrators", options.integrators, *WORK]
        without = counted_each(command)
        for aovs in AOVS:
            for plain, figures in zip(without, counted_each([*command, "--aov", aovs])):
                if plain["mean"] != figures["mean"]:
                    sys.exit(f"aovs.py: error: the image of {figures['integrator']} is another one with --aov {aovs}")
                cost = figures["instructions"] / plain["instructions"] - 1
                print(f"{scene:8} {figures['integrator']:8} {aovs:20} {100 * cost:+.1f} %", flush=True)


if __name__ == "__main__":
    main()
