#!/usr/bin/env python3
"""What layers by light path expressions cost: instructions of a render with eight of them over those of the same
render without, counted by Callgrind.

  layers.py PROGRAM [--integrators path,bdpt]"""
import argparse
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted_each  # noqa: E402

SCENES = ("cornell", "studio")
EIGHT = ("emitted=LE", "direct=L[DGSV]E", "diffuse=LD[DGSV]+E", "glossy=LG[DGSV]+E", "caustics=L[GS]*S[GS]*DX*E",
         "third=L[DGSV][DGSV][DGSV]E", "long=L[DGSV][DGSV][DGSV][DGSV]+E", "reflected=L[DGSV]*XRE")
LAYERS = {1: "layer all=L[DGSV]*E", 8: "; ".join("layer " + one for one in EIGHT)}
WORK = ("--size", "48x48", "--iterations", "8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="build/bin/candela-bench")
    parser.add_argument("--integrators", default="path,bdpt,vcm,pssmlt")
    options = parser.parse_args()
    for scene in SCENES:
        path = os.path.join(HERE, "../../deploy/scenes", scene, "scene.xml")
        command = [options.program, "count", "--scene", path, "--integrators", options.integrators, *WORK]
        without = counted_each(command)
        for count, layers in LAYERS.items():
            for plain, figures in zip(without, counted_each([*command, "--layers", layers])):
                if plain["mean"] != figures["mean"]:
                    sys.exit(f"layers.py: error: the image of {figures['integrator']} is another one with layers")
                cost = figures["instructions"] / plain["instructions"] - 1
                print(f"{scene:8} {figures['integrator']:8} {count} layers {100 * cost:+.1f} %", flush=True)


if __name__ == "__main__":
    main()
