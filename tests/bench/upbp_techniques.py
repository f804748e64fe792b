#!/usr/bin/env python3
"""CPU seconds of an iteration of upbp's techniques over vcm's, beside those of SmallUPBP.

    upbp_techniques.py CANDELA_BENCH [--rounds N] [--iterations N] [--size WxH]

Techniques render in turn, round after round; the figures are medians over rounds of CPU seconds (user and system)
over vcm's of the same round. Radii, path length, the number of paths that leave beams, long query beams and single
techniques without merging on surfaces are SmallUPBP's."""
import argparse
import os
import statistics

import counting

SCENES = ["smallupbp/fog-mirror.xml", "smallupbp/thick-mirror.xml"]
RADII = ["radius=0.0015", "radius_pp3d=0.001", "radius_pb2d=0.001", "radius_bp2d=0.001", "radius_bb1d=0.001"]
ALONE = ["pp3d", "pb2d", "bb1d"]
TECHNIQUES = ["vcm", *ALONE, "vcm,pp3d,pb2d,bb1d", "all"]
# CPU seconds of an iteration, 256 x 256, in thin fog: SmallUPBP, on a machine of this kind.
PEER = {"vcm": 0.708, "pp3d": 0.308, "pb2d": 0.726, "bb1d": 3.14, "vcm,pp3d,pb2d,bb1d": 4.94}


def seconds(program, scene, technique, options):
    command = [program, "count", "--scene", scene, "--size", options.size, "--integrator", "upbp",
               "--iterations", str(options.iterations)]
    settings = [f"techniques={technique}", f"beam_paths={options.beam_paths}", *RADII, "query_beams=long"]
    if technique in ALONE:
        settings.append("merge_surfaces=false")
    for setting in settings:
        if not (technique == "vcm" and setting.startswith(("radius_", "beam_", "query_"))):
            command += ["--set", f"upbp.{setting}"]
    found = counting.run(command)
    return found["cpu_seconds"] / found["units"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=2)
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--beam-paths", type=int, default=1000)
    options = parser.parse_args()
    here = os.path.dirname(os.path.abspath(__file__))
    print("| scene | techniques | CPU s | over vcm | SmallUPBP, over its vcm | ratio of both |\n|---|---|---|---|---|---|")
    for scene in SCENES:
        rounds = [{t: seconds(options.program, os.path.join(here, scene), t, options) for t in TECHNIQUES}
                  for _ in range(options.rounds)]
        for technique in TECHNIQUES:
            over = statistics.median(r[technique] / r["vcm"] for r in rounds)
            spent = statistics.median(r[technique] for r in rounds)
            peer = PEER.get(technique) if scene == SCENES[0] else None
            theirs = f"{peer / PEER['vcm']:.2f} | {over / (peer / PEER['vcm']):.2f}" if peer else "- | -"
            print(f"| `{os.path.basename(scene)[:-4]}` | `{technique}` | {spent:.2f} | {over:.2f} | {theirs} |",
                  flush=True)


if __name__ == "__main__":
    main()
