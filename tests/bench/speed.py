#!/usr/bin/env python3
"""Speed of two builds of `candela`, in turn (A B A B): CPU seconds of whole processes, start-up included, as medians,
and CPU seconds times the noise of the image. Ten scenes that were looked at while the code was made faster and ten
that were not (docs/lab/speed.md).

  speed.py BEFORE AFTER [--rounds 5] [--scenes FOLDER] [--only NAME ...]

BEFORE and AFTER are programs (build/bin/candela). FOLDER has the scenes cornell-box, veach-mis and so on of the
benchmarks; without it they are left out. Noise: the median relMSE, without the worst 0.1 % of pixels, between the images
of one round and of the next, whose seeds differ; it is not measured where loading takes most of the time."""
import argparse
import array
import json
import math
import os
import statistics
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
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


def terrain(path, side, normals):
    """A PLY of 2 (side - 1)^2 triangles."""
    extra = "property float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\n"
    with open(path, "wb") as out:
        out.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {side * side}\nproperty float x\n"
                   f"property float y\nproperty float z\n{extra if normals else ''}"
                   f"element face {2 * (side - 1) ** 2}\nproperty list uchar int vertex_indices\nend_header\n"
                   ).encode())
        for i in range(side):
            row = array.array("f")
            for j in range(side):
                x, z = 4 * i / side - 2, 4 * j / side - 2
                row.extend((x, 0.3 + 0.2 * math.sin(9 * x) * math.cos(7 * z), z))
                if normals:
                    row.extend((0, 1, 0, i / side, j / side))
            out.write(row.tobytes())
        for i in range(side - 1):
            for first in range(i * side, i * side + side - 1):
                out.write(struct.pack("<BiiiBiii", 3, first, first + 1, first + side,
                                      3, first + 1, first + side + 1, first + side))


def mesh(name):
    return f'<shape type="ply"><string name="filename" value="{name}"/><bsdf type="diffuse"/></shape>'


# Meshes by name: the vertices on a side, and whether they have normals and (u, v).
MESHES = {"normals.ply": (1000, True), "plain.ply": (700, False)}

# name: (text, or a file of the repository, or of FOLDER, integrator, size, iterations)
TUNED = {
    "cornell": (CORNELL, "path", 256, 8),
    "glass-ball": (in_cornell(ball(0.36, 0.84, 0.36, 0.28, GLASS)), "path", 256, 8),
    "balls": (scene(12, BALLS, LAMP), "path", 256, 8),
    "balls-point": (scene(12, BALLS, POINT), "path", 256, 8),
    "smallvcm-point": (os.path.join(HERE, "smallvcm/point.xml"), "bdpt", 160, 8),
    "smallvcm-light": (os.path.join(HERE, "smallvcm/point.xml"), "light", 256, 8),
    "dense": (scene(1000, ball(0, 0.8, 0, 0.8, medium("200, 200, 200", "0.99, 0.99, 0.99")), LAMP), "path", 64, 16),
    "dense-color": (scene(1000, ball(0, 0.8, 0, 0.8, medium("300, 220, 150", "0.999, 0.99, 0.97")), LAMP), "path", 64,
                    16),
    "dense-hg": (scene(1000, cube(medium("80, 80, 80", "1, 1, 1", HG)), LAMP), "path", 48, 16),
    "load-normals": (scene(4, mesh("normals.ply"), SUN), "path", 64, 4),
}
HELD_OUT = {
    "cornell-box": ("cornell-box/scene.xml", "path", 224, 8),
    "veach-mis": ("veach-mis/scene.xml", "path", 256, 8),
    "veach-bidir": ("veach-bidir/scene.xml", "path", 192, 8),
    "veach-ajar": ("veach-ajar/scene.xml", "path", 192, 8),
    "mirror-room": (in_cornell(ball(0.36, 0.84, 0.36, 0.28, MIRROR)), "path", 256, 8),
    "balls-spot": (scene(16, BALLS, SPOT), "path", 256, 8),
    "ten-balls-sun": (scene(8, MANY, SUN), "path", 320, 8),
    "lamp-in-glass": (scene(16, ball(0, 1, 0, 0.5, GLASS), ball(0, 1, 0, 0.15, AREA)), "path", 320, 8),
    "wax-sky": (scene(800, cube(medium("120, 140, 200", "0.98, 0.95, 0.8")), SKY), "path", 96, 16),
    "load-plain": (scene(4, mesh("plain.ply"), SKY), "path", 64, 4),
}


def render(program, scene_path, integrator, size, iterations, seed, image):
    """CPU seconds, of user and system."""
    before = os.times()
    command = [program, "render", scene_path, "--integrator", integrator, "--size", f"{size}x{size}", "--iterations",
               str(iterations), "--seed", str(seed), "--threads", "1", "--quiet", "--fresh", "--output", image]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"speed.py: error: {' '.join(command)}: {done.stderr.strip()}")
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def noise(program, images):
    pairs = zip(images, images[1:])
    return statistics.median(json.loads(subprocess.run(
        [program, "compare", a, b, "--json"], capture_output=True, text=True, check=False).stdout)["relmse_trimmed"]
        for a, b in pairs)


def file_of(name, what, folder, scenes):
    """The scene's file; None: it is in a folder that was not given."""
    if what.startswith("<"):
        path = os.path.join(folder, name + ".xml")
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(what)
        for ply, (side, normals) in MESHES.items():
            if ply in what:
                terrain(os.path.join(folder, ply), side, normals)
        return path
    if os.path.isabs(what):
        return what
    return None if scenes is None else os.path.join(scenes, what)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scenes", help="a folder")
    parser.add_argument("--only", nargs="*", default=[])
    options = parser.parse_args()
    programs = (options.before, options.after)
    print("| scene | integrator | CPU s before | after | ratio | CPU x noise |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for kind, scenes in (("tuned on", TUNED), ("not tuned on", HELD_OUT)):
            ratios = []
            for name, (what, integrator, size, iterations) in scenes.items():
                path = file_of(name, what, folder, options.scenes)
                if path is None or (options.only and name not in options.only):
                    continue
                seconds, images = ([], []), ([], [])
                for number in range(options.rounds):
                    for which, program in enumerate(programs):
                        images[which].append(os.path.join(folder, f"{which}-{number}.exr"))
                        seconds[which].append(render(program, path, integrator, size, iterations, number,
                                                     images[which][-1]))
                a, b = map(statistics.median, seconds)
                row = [b / a]
                if options.rounds > 1 and not name.startswith("load"):
                    row.append(b / a * noise(options.after, images[1]) / noise(options.after, images[0]))
                ratios.append(row)
                print(f"| {name} | {integrator} | {a:.2f} | {b:.2f} |", *(f"{r:.3f} |" for r in row), flush=True)
            if ratios:
                means = [statistics.geometric_mean(row[i] for row in ratios if len(row) > i)
                         for i in range(max(map(len, ratios)))]
                print(f"| geometric mean, {kind} | | | |", *(f"{m:.3f} |" for m in means), flush=True)


if __name__ == "__main__":
    main()
