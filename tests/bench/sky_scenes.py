#!/usr/bin/env python3
"""Scenes with an environment beside lamps (docs/lab/shadow-rays.md), into a folder: sky_scenes.py OUT

A field of 200 displaced balls (1.02 million triangles) on a plane, and a room with a window. 96x72, depth 10.
"""
import math
import os
import random
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "statistical"))
from asset_files import write_pfm  # noqa: E402

HEAD = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="10"/></integrator>
<sensor type="perspective"><float name="fov" value="45"/>
<transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="72"/><rfilter type="box"/></film>
</sensor>
"""
METAL = ('<bsdf type="roughconductor"><float name="alpha" value="0.15"/><string name="material" value="Al"/></bsdf>')
PLASTIC = ('<bsdf type="roughplastic"><float name="alpha" value="0.1"/>'
           '<rgb name="diffuse_reflectance" value="0.5, 0.2, 0.15"/></bsdf>')
CHECKER = ('<bsdf type="diffuse"><texture name="reflectance" type="checkerboard">'
           '<rgb name="color0" value="0.2, 0.2, 0.25"/><rgb name="color1" value="0.8, 0.75, 0.7"/>'
           '<transform name="to_uv"><scale x="12" y="12"/></transform></texture></bsdf>')


def icosphere(levels):
    """Vertices and triangles of the unit sphere."""
    g = (1 + math.sqrt(5)) / 2
    s = 1 / math.hypot(1, g)
    vertices = [tuple(x * s for x in c) for c in
                [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
                 (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                 (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                 (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(levels):
        middles = {}

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                m = [x + y for x, y in zip(vertices[a], vertices[b])]
                n = math.sqrt(sum(x * x for x in m))
                middles[key] = len(vertices)
                vertices.append(tuple(x / n for x in m))
            return middles[key]

        finer = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    return vertices, triangles


def write_balls(folder):
    """Flat triangles in three files, one for each material."""
    rnd = random.Random(5)
    sphere, triangles = icosphere(4)
    vertices, count = [[], [], []], [0, 0, 0]
    for i in range(200):
        r = rnd.uniform(0.25, 0.6)
        cx, cz = rnd.uniform(-9, 9), rnd.uniform(-9, 9)
        phase = [rnd.uniform(0, 6.28) for _ in range(6)]
        k = [rnd.uniform(2, 9) for _ in range(6)]
        for x, y, z in sphere:
            d = r * (1 + 0.06 * (math.sin(k[0] * x + phase[0]) * math.sin(k[1] * y + phase[1]) +
                                 math.sin(k[2] * z + phase[2]) * math.sin(k[3] * x + phase[3]) +
                                 math.sin(k[4] * y + phase[4]) * math.sin(k[5] * z + phase[5])))
            vertices[i % 3].append(struct.pack("<3f", cx + d * x, r + d * y, cz + d * z))
        count[i % 3] += 1
    for i in range(3):
        with open(os.path.join(folder, f"balls{i}.ply"), "wb") as f:
            f.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices[i])}\nproperty float x\n"
                     f"property float y\nproperty float z\nelement face {count[i] * len(triangles)}\n"
                     "property list uchar int vertex_indices\nend_header\n").encode())
            f.write(b"".join(vertices[i]))
            for ball in range(count[i]):
                first = ball * len(sphere)
                f.write(b"".join(struct.pack("<B3i", 3, *(first + v for v in t)) for t in triangles))


def sky(x, y):
    """Uneven, without a sun; 64 x 32."""
    if y >= 16:
        return 0.15, 0.12, 0.1
    h = 1 - y / 16
    cloud = 0.35 * max(0.0, math.sin(x * 0.39) * math.cos(y * 0.5 + 0.1 * x))
    return 0.6 - 0.35 * h + cloud, 0.65 - 0.25 * h + cloud, 0.7 + 0.2 * h + cloud


def with_sun(strength):
    def pixel(x, y):
        if x in (40, 41) and y in (5, 6):
            return tuple(strength * c for c in (4.0, 3.6, 3.0))
        return sky(x, y)
    return pixel


def rgb(v):
    return "{:g}, {:g}, {:g}".format(*(v if isinstance(v, tuple) else (v, v, v)))


def diffuse(v):
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{rgb(v)}"/></bsdf>'


def area(radiance):
    return f'<emitter type="area"><rgb name="radiance" value="{rgb(radiance)}"/></emitter>'


def rectangle(steps, inside):
    return f'<shape type="rectangle"><transform name="to_world">{steps}</transform>{inside}</shape>\n'


def lamp(radiance, at="0, 6, 2", side=1.0):
    return rectangle(f'<scale x="{side:g}" y="{side:g}"/><rotate x="1" angle="90"/><translate value="{at}"/>',
                     area(radiance))


def lamps(count, radiance):
    rnd = random.Random(3)
    return "".join(lamp(radiance * rnd.uniform(0.3, 3),
                        "{:g}, {:g}, {:g}".format(rnd.uniform(-9, 9), rnd.uniform(1.5, 4), rnd.uniform(-9, 9)),
                        rnd.uniform(0.05, 0.2)) for _ in range(count))


def constant(radiance=1.0):
    return f'<emitter type="constant"><rgb name="radiance" value="{rgb(radiance)}"/></emitter>\n'


def point(intensity, at):
    return (f'<emitter type="point"><point name="position" value="{at}"/>'
            f'<rgb name="intensity" value="{rgb(intensity)}"/></emitter>\n')


def image(name):
    return f'<emitter type="envmap"><string name="filename" value="{name}"/></emitter>\n'


def field(ground=diffuse(0.5), balls=(diffuse((0.7, 0.5, 0.4)), diffuse((0.4, 0.6, 0.7)), diffuse(0.6))):
    return (HEAD.format("0, 5, 13", "0, 0, 1") +
            rectangle('<scale x="60" y="60"/><rotate x="1" angle="-90"/>', ground) +
            "".join(f'<shape type="ply"><string name="filename" value="balls{i}.ply"/>{balls[i]}</shape>\n'
                    for i in range(3)))


def room():
    """The left wall has a window of 2.4 x 1.4."""
    wall = diffuse(0.7)
    left = '<scale x="{}" y="{}"/><rotate y="1" angle="90"/><translate value="-3, {}, {}"/>'
    out = HEAD.format("0, 1.6, 3.8", "0, 1.3, 0")
    for steps, material in (
            ('<scale x="3" y="4"/><rotate x="1" angle="-90"/>', diffuse((0.5, 0.4, 0.3))),
            ('<scale x="3" y="4"/><rotate x="1" angle="90"/><translate value="0, 3, 0"/>', wall),
            ('<scale x="3" y="1.5"/><translate value="0, 1.5, -4"/>', wall),
            ('<scale x="3" y="1.5"/><rotate y="1" angle="180"/><translate value="0, 1.5, 4"/>', wall),
            ('<scale x="4" y="1.5"/><rotate y="1" angle="-90"/><translate value="3, 1.5, 0"/>',
             diffuse((0.3, 0.6, 0.3))),
            (left.format(4, 0.4, 0.4, 0), wall), (left.format(4, 0.4, 2.6, 0), wall),
            (left.format(1.4, 0.7, 1.5, -2.6), wall), (left.format(1.4, 0.7, 1.5, 2.6), wall)):
        out += rectangle(steps, material)
    for x, z, r, material in ((-1, -1, 0.6, diffuse(0.6)), (1, 0, 0.5, PLASTIC), (0.2, 1.2, 0.4, METAL)):
        out += (f'<shape type="sphere"><point name="center" value="{x}, {r}, {z}"/>'
                f'<float name="radius" value="{r}"/>{material}</shape>\n')
    return out


GLOSSY = (diffuse(0.6), METAL, PLASTIC)
SCENES = {
    "lamp": field() + constant() + lamp(20),
    "strong": field() + constant() + lamp(200),
    "weak": field() + constant() + lamp(2),
    "glossy": field(balls=GLOSSY) + constant() + lamp(20),
    "point": field() + constant() + point(30, "0, 6, 2"),
    "lamps40": field() + constant() + lamps(40, 40),
    "lamps150": field() + constant() + lamps(150, 15),
    "window": room() + constant(3) + lamp(8, "0, 2.95, 0", 0.4),
    "uneven": field(ground=CHECKER) + image("sky.pfm") + lamp(20),
    "sunlamp": field() + image("sunny.pfm") + lamp(20),
    "moderate": field() + image("moderate.pfm") + lamp(20),
    "sunglossy": field(balls=GLOSSY) + image("sunny.pfm") + lamp(20),
    "sun40": field() + image("sunny.pfm") + lamps(40, 40),
    "sunwindow": room() + image("sunny.pfm") + lamp(8, "0, 2.95, 0", 0.4),
    "sunalone": field() + image("sunny.pfm"),
}


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: sky_scenes.py OUT")
    folder = sys.argv[1]
    os.makedirs(folder, exist_ok=True)
    write_pfm(os.path.join(folder, "sky.pfm"), 64, 32, sky)
    write_pfm(os.path.join(folder, "moderate.pfm"), 64, 32, with_sun(10))
    write_pfm(os.path.join(folder, "sunny.pfm"), 64, 32, with_sun(100))
    write_balls(folder)
    for name, text in SCENES.items():
        with open(os.path.join(folder, name + ".xml"), "w", encoding="utf-8") as f:
            f.write(text + "</scene>\n")


if __name__ == "__main__":
    main()
