#!/usr/bin/env python3
"""What AOVs and layers by light path expressions cost: instructions of a render with them over those of the same
render without, counted by Callgrind.

  outputs.py aovs|layers PROGRAM [--integrators path,bdpt]"""
import argparse
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted_each  # noqa: E402

SCENES = ("cornell", "studio")
EIGHT = ("emitted=LE", "direct=L[DGSV]E", "diffuse=LD[DGSV]+E", "glossy=LG[DGSV]+E", "caustics=L[GS]*S[GS]*DX*E",
         "third=L[DGSV][DGSV][DGSV]E", "long=L[DGSV][DGSV][DGSV][DGSV]+E", "reflected=L[DGSV]*XRE")
AOVS = ("depth", "albedo", "albedo,normal,depth")
# By kind: integrators, and by the name of a case the options of the program.
KINDS = {
    "aovs": ("path,bdpt,vcm", {aovs: ["--aov", aovs] for aovs in AOVS}),
    "layers": ("path,bdpt,vcm,pssmlt", {"1 layers": ["--layers", "layer all=L[DGSV]*E"],
                                        "8 layers": ["--layers", "; ".join("layer " + one for one in EIGHT)]}),
}
WORK = ("--size", "48x48", "--iterations", "8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("program", help="build/bin/candela-bench")
    parser.add_argument("--integrators")
    options = parser.parse_args()
    integrators, cases = KINDS[options.kind]
    for scene in SCENES:
        path = os.path.join(HERE, "../../deploy/scenes", scene, "scene.xml")
        command = [options.program, "count", "--scene", path, "--integrators", options.integrators or integrators, *WORK]
        without = counted_each(command)
        for name, more in cases.items():
            for plain, figures in zip(without, counted_each([*command, *more])):
                if plain["mean"] != figures["mean"]:
                    sys.exit(f"outputs.py: error: the image of {figures['integrator']} is another one with {name}")
                cost = figures["instructions"] / plain["instructions"] - 1
                print(f"{scene:8} {figures['integrator']:8} {name:20} {100 * cost:+.1f} %", flush=True)


if __name__ == "__main__":
    main()
