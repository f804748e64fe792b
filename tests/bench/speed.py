#!/usr/bin/env python3
"""Speed of `path`, `bdpt` and `light` with two builds of candela-bench, in turn: instructions, and CPU seconds as
medians, on ten scenes that were looked at while the code was made faster and ten that were not (docs/lab/speed.md).

  speed.py BEFORE AFTER [--rounds 5] [--scenes FOLDER] [--only NAME ...]

BEFORE and AFTER are programs (build/bin/candela-bench). FOLDER has the scenes cornell-box, veach-mis and so on of the
benchmarks; without it they are left out."""
import argparse
import os
import statistics
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from counting import counted, run  # noqa: E402

CORNELL = os.path.join(HERE, "../../deploy/scenes/cornell/scene.xml")
HEAD = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="%d"/></integrator>
<sensor type="perspective"><float name="fov" value="38"/>
<transform name="to_world"><lookat origin="0, 1.4, 4.6" target="0, 0.7, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><rfilter type="box"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="8"/><rotate x="1" angle="-90"/></transform>
<bsdf type="diffuse"/></shape>
"""
POINT = """<emitter type="point"><point name="position" x="-1" y="3" z="1.5"/>
<rgb name="intensity" value="20, 19, 17"/></emitter>"""
SPOT = """<emitter type="spot"><transform name="to_world"><lookat origin="2, 4, 2" target="0, 0.5, 0" up="0, 1, 0"/>
</transform><rgb name="intensity" value="60, 55, 50"/></emitter>"""
SUN = """<emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.4"/>
<rgb name="irradiance" value="3, 3, 3"/></emitter>"""
SKY = '<emitter type="constant"/>'
AREA = '<emitter type="area"><rgb name="radiance" value="40, 38, 30"/></emitter>'
DISK = ('<shape type="disk"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>'
        f'<translate y="3"/></transform>{AREA}</shape>')


def ball(x, y, z, radius, inner='<bsdf type="diffuse"/>'):
    return (f'<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/>'
            f'<float name="radius" value="{radius}"/>{inner}</shape>')


def medium(sigma_t, albedo, phase=""):
    return (f'<bsdf type="null"/><medium type="homogeneous" name="interior"><rgb name="sigma_t" value="{sigma_t}"/>'
            f'<rgb name="albedo" value="{albedo}"/>{phase}</medium>')


def cube(inner):
    return ('<shape type="cube"><transform name="to_world"><scale value="0.7"/><rotate y="1" angle="30"/>'
            f'<translate y="0.71"/></transform>{inner}</shape>')


def rod(i):
    x, z = -1.2 + 0.5 * i, -0.3 * (i % 3)
    return (f'<shape type="cylinder"><point name="p0" x="{x}" y="0" z="{z}"/><point name="p1" x="{x}" y="1.4" z="{z}"/>'
            '<float name="radius" value="0.12"/></shape>')


LAMP = ball(-1, 3, 1.5, 0.3, AREA)
HG = '<phase type="hg"><float name="g" value="0.8"/></phase>'
GLASS, ROUGH, MIRROR = ('<bsdf type="dielectric"/>', '<bsdf type="roughconductor"/>', '<bsdf type="conductor"/>')
BALLS = ball(-0.9, 0.5, 0, 0.5) + ball(0.1, 0.5, 0.3, 0.5, GLASS) + ball(1.1, 0.5, 0, 0.5, ROUGH) + ball(
    0.2, 0.9, -1.5, 0.9, '<bsdf type="plastic"/>')
MANY = "".join(ball(-1.5 + 0.35 * i, 0.17, 0.5 * (i % 5) - 1, 0.17) for i in range(10))


def scene(depth, *parts):
    return HEAD % depth + "".join(parts) + "</scene>"


def in_cornell(*parts):
    with open(CORNELL, encoding="utf-8") as stream:
        return stream.read().replace("</scene>", "".join(parts) + "</scene>")


# name: (text, or a file of the repository, or of FOLDER, integrator, size)
TUNED = {
    "cornell": (CORNELL, "path", 160),
    "glass-ball": (in_cornell(ball(0.36, 0.84, 0.36, 0.28, GLASS)), "path", 160),
    "balls": (scene(12, BALLS, LAMP), "path", 160),
    "balls-point": (scene(12, BALLS, POINT), "path", 160),
    "box-balls": (in_cornell(*(ball(0.3 * i - 0.7, 1.5, 0.2 * (i % 3), 0.13) for i in range(6))), "path", 160),
    "smallvcm-point": (os.path.join(HERE, "smallvcm/point.xml"), "bdpt", 96),
    "smallvcm-light": (os.path.join(HERE, "smallvcm/point.xml"), "light", 128),
    "dense": (scene(1000, ball(0, 0.8, 0, 0.8, medium("200, 200, 200", "0.99, 0.99, 0.99")), LAMP), "path", 48),
    "dense-color": (scene(1000, ball(0, 0.8, 0, 0.8, medium("300, 220, 150", "0.999, 0.99, 0.97")), LAMP), "path", 40),
    "dense-hg": (scene(1000, cube(medium("80, 80, 80", "1, 1, 1", HG)), LAMP), "path", 32),
}
HELD_OUT = {
    "cornell-box": ("cornell-box/scene.xml", "path", 128),
    "veach-mis": ("veach-mis/scene.xml", "path", 160),
    "veach-bidir": ("veach-bidir/scene.xml", "path", 128),
    "veach-ajar": ("veach-ajar/scene.xml", "path", 128),
    "rods-disk": (scene(12, "".join(map(rod, range(6))), DISK), "path", 160),
    "mirror-room": (in_cornell(ball(0.36, 0.84, 0.36, 0.28, MIRROR)), "path", 160),
    "balls-spot": (scene(16, BALLS, SPOT), "path", 160),
    "ten-balls-sun": (scene(8, MANY, SUN), "path", 192),
    "wax-sky": (scene(800, cube(medium("120, 140, 200", "0.98, 0.95, 0.8")), SKY), "path", 64),
    "lamp-in-glass": (scene(16, ball(0, 1, 0, 0.5, GLASS), ball(0, 1, 0, 0.15, AREA)), "path", 192),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scenes", help="a folder")
    parser.add_argument("--only", nargs="*", default=[])
    options = parser.parse_args()
    print("| scene | integrator | instructions | CPU s before | after | ratio |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for kind, scenes in (("tuned on", TUNED), ("not tuned on", HELD_OUT)):
            ratios = []
            for name, (what, integrator, size) in scenes.items():
                if options.only and name not in options.only:
                    continue
                path = what
                if what.startswith("<"):
                    path = os.path.join(folder, name + ".xml")
                    with open(path, "w", encoding="utf-8") as stream:
                        stream.write(what)
                elif not os.path.isabs(what):
                    if options.scenes is None:
                        continue
                    path = os.path.join(options.scenes, what)
                command = ["count", "--scene", path, "--integrators", integrator, "--iterations", "8", "--size"]
                small = max(8, size // 8)
                before, after = ([program, *command] for program in (options.before, options.after))
                counts = [counted([*c, f"{small}x{small}"])["instructions"] for c in (before, after)]
                times = [[], []]
                for _ in range(options.rounds):
                    for c, seconds in zip((before, after), times):
                        seconds.append(run([*c, f"{size}x{size}"])["cpu_seconds"])
                a, b = map(statistics.median, times)
                ratios.append(b / a)
                print(f"| {name} | {integrator} | {counts[1] / counts[0]:.3f} | {a:.3f} | {b:.3f} | {b / a:.3f} |",
                      flush=True)
            if ratios:
                print(f"| geometric mean, {kind} | | | | | {statistics.geometric_mean(ratios):.3f} |", flush=True)


if __name__ == "__main__":
    main()
