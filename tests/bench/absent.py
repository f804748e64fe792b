#!/usr/bin/env python3
"""What features cost a scene that has none of them: the program, against one whose sources are made to know nothing of
them, on a scene of diffuse boxes under a lamp.

  absent.py BUILD OUT [--integrators path,bdpt,vcm,ppm] [--without NAME ...]

Each removal is a list of replacements in a copy of the sources under OUT, which is built there with BUILD's settings; a
replacement that does not apply exactly once is an error. The picture must be the same to the last bit. What is compared
are instructions (Callgrind). Media, surfaces that light passes straight, and the environment need no removal: kernels
without them are compiled beside those with them, and the plan chooses."""
import argparse
import os
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(HERE))
ROOM = os.path.join(ROOT, "deploy/scenes/cornell/scene.xml")
BSDF, TEXTURE, PATH, WALK = ("worker/scene/bsdf.h", "worker/scene/textures/texture.h", "worker/estimators/path.h",
                             "worker/transport/walk.h")
REMOVALS = {
    "textures": [
        (TEXTURE, "Spectrum eval(Vec2 uv) const { return texture == nullptr ? constant : texture->eval(uv); }",
         "Spectrum eval(Vec2 /*uv*/) const { return constant; }"),
        (TEXTURE, "float eval(Vec2 uv) const { return texture == nullptr ? constant : luminance(texture->eval(uv)); }",
         "float eval(Vec2 /*uv*/) const { return constant; }"),
    ],
    "bump maps, masks, blends": [
        (PATH, "    arena_.clear();\n", ""),
        (WALK, "    arena.clear();\n", ""),
        ("worker/transport/light_vertices.h", "        slot.arena.clear();\n", ""),
        ("worker/scene/shapes/geometry.cpp", "triangle.partials = record.reads_partials;", "triangle.partials = false;"),
    ],
    "specular surfaces": [
        (BSDF, "return traits_.purely_delta;", "return false;"),
        (PATH, "previous_delta_ = next.delta;", "previous_delta_ = false;"),
        (WALK, "depart(v, pdf, next.delta, reverse, out);", "depart(v, pdf, false, reverse, out);"),
        (WALK, "if (next.delta) {", "if (false) {"),
    ],
    "thin lens": [
        ("worker/integrators/eye_samples.h", "context.scene.reads_lens() ? sampler.next_2d() : Vec2{0.5f, 0.5f}",
         "Vec2{0.5f, 0.5f}"),
        ("worker/transport/technique/connect_lens.h", "c.scene.reads_lens() ? draws.draw_2d(kLens) : Vec2{0.5f, 0.5f}",
         "Vec2{0.5f, 0.5f}"),
    ],
}
REMOVALS["all of these"] = [edit for edits in REMOVALS.values() for edit in edits]


def fail(text):
    sys.exit("absent.py: error: " + text)


def run(command, **arguments):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **arguments)
    if done.returncode != 0:
        fail(f"{' '.join(command)}: {(done.stderr + done.stdout).strip()[-2000:]}")
    return done.stdout


def settings_of(build):
    """What decides the code: compiler, flags, launcher."""
    wanted = ("CMAKE_BUILD_TYPE", "CMAKE_CXX_COMPILER", "CMAKE_CXX_FLAGS", "CMAKE_CXX_COMPILER_LAUNCHER",
              "CMAKE_CXX_FLAGS_RELWITHDEBINFO")
    try:
        with open(os.path.join(build, "CMakeCache.txt"), encoding="utf-8") as stream:
            lines = [line.strip() for line in stream]
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}: not a build folder")
    return ["-D" + line for line in lines if line.split(":")[0] in wanted]


def sources(folder, edits):
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("proto", "master", "worker", "client", "common", "deploy", "tests"):
        shutil.copytree(os.path.join(ROOT, name), os.path.join(folder, name))
    for name in ("CMakeLists.txt", ".clang-format", "LICENSE", "README.md"):
        if os.path.exists(os.path.join(ROOT, name)):
            shutil.copy(os.path.join(ROOT, name), folder)
    for file, old, new in edits:
        with open(os.path.join(folder, file), encoding="utf-8") as stream:
            text = stream.read()
        if text.count(old) != 1:
            fail(f"{file}: '{old[:60]}' is there {text.count(old)} times, not once: mend REMOVALS")
        with open(os.path.join(folder, file), "w", encoding="utf-8") as stream:
            stream.write(text.replace(old, new))


def count(program, integrator):
    figures = counted([program, "count", "--scene", ROOM, "--integrator", integrator, "--size", "32x32", "--iterations", "8"])
    if figures["instructions"] == 0:
        fail("nothing was counted: the program was built without valgrind/callgrind.h")
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", help="the build folder, of these sources")
    parser.add_argument("out", help="a folder for the copies and their builds")
    parser.add_argument("--integrators", default="path,bdpt,vcm,ppm")
    parser.add_argument("--without", action="append", choices=list(REMOVALS), help="default: each and all")
    options = parser.parse_args()
    integrators = options.integrators.split(",")
    if shutil.which("valgrind") is None:
        fail("valgrind is missing (Debian: valgrind)")
    os.makedirs(options.out, exist_ok=True)
    whole = {i: count(os.path.join(options.build, "bin/candela-bench"), i) for i in integrators}
    print("| without | " + " | ".join(integrators) + " |\n" + "|---" * (1 + len(integrators)) + "|")
    for name in options.without or REMOVALS:
        folder = os.path.join(options.out, "".join(c if c.isalnum() else "-" for c in name))
        sources(os.path.join(folder, "source"), REMOVALS[name])
        run(["cmake", "-G", "Ninja", "-S", os.path.join(folder, "source"), "-B", os.path.join(folder, "build"),
             "-DCANDELA_TESTS=ON", *settings_of(options.build)])
        run(["cmake", "--build", os.path.join(folder, "build"), "--target", "candela-bench"])
        cells = []
        for integrator in integrators:
            figures = count(os.path.join(folder, "build/bin/candela-bench"), integrator)
            if (figures["mean"], figures["rays"]) != (whole[integrator]["mean"], whole[integrator]["rays"]):
                fail(f"without {name}, {integrator} renders another picture")
            cells.append(f"{100 * (whole[integrator]['instructions'] / figures['instructions'] - 1):+.2f} %")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
