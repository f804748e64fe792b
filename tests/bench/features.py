#!/usr/bin/env python3
"""What features of a scene cost where they do nothing: the same light transport rendered without a feature, with the
feature out of sight (on a small ball inside a closed box), and with it in sight but without effect (an opaque mask, a
flat bump map, a texture of one colour ...).

  features.py PROGRAM [--integrators path,bdpt,vcm,ppm] [--feature NAME ...] [--time [SECONDS]]

By default instructions are counted (Callgrind), which repeat on a busy machine; --time takes CPU seconds instead, of
renders in turn, medians over rounds. The ratio is to the scene without the feature, whose ball is diffuse. The mean of
the image and the rays are compared too: where they differ by more than noise the transport was not the same, and the
row says so."""
import argparse
import os
import statistics
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted, run  # noqa: E402

ROOM = os.path.join(HERE, "../../deploy/scenes/cornell/scene.xml")
BALL = """
  <shape type="sphere" id="ball">
    <point name="center" x="-0.35" y="0.62" z="-0.32"/>
    <float name="radius" value="0.1"/>
    {material}
  </shape>
"""
DIFFUSE = '<bsdf type="diffuse"/>'
CHECKS = """<texture type="checkerboard" name="{name}">
      <rgb name="color0" value="{value}"/><rgb name="color1" value="{other}"/>
    </texture>"""
MEDIUM = """<bsdf type="null"/>
    <medium type="homogeneous" name="interior">
      <float name="sigma_t" value="5"/><rgb name="albedo" value="0.8, 0.8, 0.8"/>
    </medium>"""
# Material of the hidden ball.
OUT_OF_SIGHT = {
    "textures": '<bsdf type="diffuse">' + CHECKS.format(name="reflectance", value="0.2, 0.2, 0.2", other="0.6, 0.6, 0.6") + "</bsdf>",
    "bump maps": '<bsdf type="bumpmap">' + CHECKS.format(name="texture", value="0, 0, 0", other="0.1, 0.1, 0.1") + DIFFUSE + "</bsdf>",
    "masks": '<bsdf type="mask"><float name="opacity" value="0.5"/>' + DIFFUSE + "</bsdf>",
    "mirrors": '<bsdf type="conductor"/>',
    "glass": '<bsdf type="dielectric"/>',
    "rough metal": '<bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf>',
    "media": MEDIUM,
}
ENVIRONMENT = '<emitter type="constant"><rgb name="radiance" value="1e-7, 1e-7, 1e-7"/></emitter>'


def white(text):
    """The definition of the white walls, and what is inside its twosided."""
    begin = text.index('<bsdf type="twosided" id="white">')
    end = text.index("</bsdf>", text.index("</bsdf>", begin) + 1) + len("</bsdf>")
    definition = text[begin:end]
    inner = definition[definition.index("<bsdf", 5):definition.rindex("</bsdf>")].strip()
    return definition, inner


def replaced(text, old, new):
    if text.count(old) != 1:
        sys.exit(f"features.py: error: {ROOM} has '{old[:40]}' {text.count(old)} times instead of once")
    return text.replace(old, new)


def scenes():
    """name -> (kind, scene text); the first is the one without any of the features."""
    with open(ROOM, encoding="utf-8") as stream:
        room = stream.read()

    def with_ball(material, text=room):
        return replaced(text, "</scene>", BALL.format(material=material) + "</scene>")

    plain = with_ball(DIFFUSE)
    result = {"none": ("", plain)}
    for name, material in OUT_OF_SIGHT.items():
        result[name + ", out of sight"] = (name, with_ball(material))
    result["environment, next to black"] = ("environment", replaced(plain, "</scene>", ENVIRONMENT + "</scene>"))
    lens = replaced(plain, '<sensor type="perspective">', '<sensor type="thinlens"><float name="aperture_radius" '
                    'value="1e-4"/><float name="focus_distance" value="4"/>')
    result["thin lens, next to a point"] = ("thin lens", lens)
    definition, inner = white(plain)
    flat = CHECKS.format(name="reflectance", value="0.74, 0.73, 0.70", other="0.74, 0.73, 0.70")
    in_sight = {
        "textures": '<bsdf type="twosided" id="white"><bsdf type="diffuse">' + flat + "</bsdf></bsdf>",
        "bump maps": '<bsdf type="twosided" id="white"><bsdf type="bumpmap">'
                     + CHECKS.format(name="texture", value="0.1, 0.1, 0.1", other="0.1, 0.1, 0.1") + inner + "</bsdf></bsdf>",
        "masks": '<bsdf type="mask" id="white"><float name="opacity" value="1"/>'
                 + replaced(definition, ' id="white"', "") + "</bsdf>",
    }
    for name, material in in_sight.items():
        result[name + ", in sight, no effect"] = (name, replaced(plain, definition, material))
    return result


def instructions(command):
    figures = counted(command)
    if figures["instructions"] == 0:
        sys.exit("features.py: error: nothing was counted: the program was built without valgrind/callgrind.h")
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="build/bin/candela-bench")
    parser.add_argument("--integrators", default="path,bdpt,vcm,ppm")
    parser.add_argument("--feature", action="append", help="only this; may be repeated")
    parser.add_argument("--time", action="store_true", help="CPU seconds instead of instructions")
    parser.add_argument("--rounds", type=int, default=7, help="of --time")
    options = parser.parse_args()
    chosen = {name: text for name, (kind, text) in scenes().items()
              if kind == "" or not options.feature or kind in options.feature}
    if len(chosen) == 1:
        sys.exit("features.py: error: no such feature; there are " + ", ".join(sorted({k for k, _ in scenes().values() if k})))
    integrators = options.integrators.split(",")
    size = ("--size", "128x128", "--iterations", "16") if options.time else ("--size", "32x32", "--iterations", "8")
    table = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in chosen.items():
            with open(os.path.join(folder, f"{name}.xml"), "w", encoding="utf-8") as stream:
                stream.write(text)
        for integrator in integrators:
            commands = {name: [options.program, "count", "--scene", os.path.join(folder, f"{name}.xml"),
                               "--integrator", integrator, *size] for name in chosen}
            if not options.time:
                for name, command in commands.items():
                    table[name, integrator] = instructions(command)
                continue
            rounds = [{name: run(command) for name, command in commands.items()} for _ in range(options.rounds)]
            for name in chosen:
                # The ratio within a round: what slows the machine down for a while slows both.
                ratios = [r[name]["cpu_seconds"] / r["none"]["cpu_seconds"] for r in rounds]
                table[name, integrator] = dict(rounds[0][name], ratio=statistics.median(ratios))

    print("| | " + " | ".join(integrators) + " |\n|---" * 1 + "|---" * len(integrators) + "|")
    for name in chosen:
        cells = []
        for integrator in integrators:
            figures, plain = table[name, integrator], table["none", integrator]
            ratio = figures.get("ratio") or figures["instructions"] / plain["instructions"]
            rays, mean = figures["rays"] / plain["rays"], figures["mean"] / plain["mean"]
            note = "" if abs(rays - 1) < 0.02 and abs(mean - 1) < 0.03 else f" (rays {rays:.3f}, mean {mean:.3f})"
            cells.append(f"{ratio:.4f}{note}" if name != "none" else "1")
        print(f"| {name} | " + " | ".join(cells) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
