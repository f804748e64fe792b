#!/usr/bin/env python3
"""Makes the gallery's meshes, images and volume (assets/), from formulas alone. Run in this folder."""
import math
import struct
import zlib
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from asset_files import torus, write_pfm, write_ply, write_png  # noqa: E402


def write_obj(path, vertices, triangles):
    with open(path, "w", newline="\n") as f:
        f.write("# a torus\no torus\n")
        for p, _, _ in vertices:
            f.write("v %.6f %.6f %.6f\n" % p)
        for _, _, uv in vertices:
            f.write("vt %.6f %.6f\n" % uv)
        for _, n, _ in vertices:
            f.write("vn %.6f %.6f %.6f\n" % n)
        for t in triangles:
            f.write("f %s\n" % " ".join("%d/%d/%d" % (v + 1, v + 1, v + 1) for v in t))


def write_serialized(path, vertices, triangles):
    body = struct.pack("<I", 0x0001 | 0x0002 | 0x1000)  # normals, texture coordinates, single precision
    body += b"torus\0" + struct.pack("<QQ", len(vertices), len(triangles))
    for part in range(3):
        body += b"".join(struct.pack("<%df" % len(v[part]), *v[part]) for v in vertices)
    body += b"".join(struct.pack("<3I", *t) for t in triangles)
    mesh = struct.pack("<HH", 0x041C, 4) + zlib.compress(body, 9)
    with open(path, "wb") as f:
        f.write(mesh + struct.pack("<QI", 0, 1))


def tiles(x, y):
    """Coloured tiles with dark joints; 32 x 32."""
    if x % 8 == 0 or y % 8 == 0:
        return 40, 34, 30
    hue = (x // 8 * 3 + y // 8 * 5) % 7
    return 120 + 17 * hue, 190 - 20 * hue, 90 + 9 * (hue * hue % 11)


def dots(x, y):
    """White where a leaf is, black where it has holes; 32 x 32."""
    d = math.hypot(x % 16 - 7.5, y % 16 - 7.5)
    return (0, 0, 0) if d < 4.6 else (255, 255, 255)


def height(x, y):
    """Rounded bumps, for bump maps; 64 x 64, periodic."""
    h = 0.5 + 0.5 * math.sin(2 * math.pi * 4 * x / 64) * math.sin(2 * math.pi * 2 * y / 64)
    return (int(255 * h),) * 3


def hills(x, y):
    """Hills around a hollow that is below 0; 33 x 33."""
    u, v = (x - 16) / 16, (y - 16) / 16
    h = 0.25 * math.cos(5 * u) * math.cos(4 * v + 1) + 0.35 * (u * u + v * v) - 0.1
    return (h * (1 - u * u) * (1 - v * v),) * 3


def normals(x, y):
    """The normals of waves along u; 64 x 64, periodic."""
    slope = 0.6 * math.cos(2 * math.pi * 6 * x / 64)
    l = math.hypot(1, slope)
    return tuple(int(255 * (0.5 + 0.5 * c / l)) for c in (-slope, 0, 1))


def sky(x, y):
    """A blue sky over dark ground with a sun of 2 x 2 pixels; 32 x 16."""
    if y >= 8:
        return 0.12, 0.10, 0.08
    if x in (20, 21) and y in (3, 4):
        return 60.0, 55.0, 45.0
    h = 1 - y / 8
    return 0.25 + 0.35 * (1 - h), 0.4 + 0.25 * (1 - h), 0.9 - 0.2 * (1 - h)


def write_vol(path, n=16):
    """A ball of smoke with streaks."""
    with open(path, "wb") as f:
        f.write(b"VOL" + struct.pack("<B", 3) + struct.pack("<5i", 1, n, n, n, 1) +
                struct.pack("<6f", 0, 0, 0, 1, 1, 1))
        for z in range(n):
            for y in range(n):
                for x in range(n):
                    p = [(c + 0.5) / n * 2 - 1 for c in (x, y, z)]
                    r = math.sqrt(sum(c * c for c in p))
                    streak = 0.6 + 0.4 * math.sin(7 * p[0] + 5 * p[1] * p[2])
                    f.write(struct.pack("<f", max(0.0, 1 - r) * streak))


def write_curves(path, curves):
    """Control points x y z radius, an empty line between curves."""
    with open(path, "w", newline="\n") as f:
        f.write("\n".join("".join("%.5f %.5f %.5f %.5f\n" % p for p in curve) for curve in curves))


def spring(turns=4, points=9):
    """A coil that gets thinner towards its top."""
    n = turns * points
    return [(0.42 * math.cos(2 * math.pi * i / points), 0.06 + 1.2 * i / n, 0.42 * math.sin(2 * math.pi * i / points),
             0.07 - 0.05 * i / n) for i in range(n + 3)]


def stems(count=7):
    """Bent stems of five points."""
    return [[(0.1 * math.cos(a) * (1 + t * t), 0.3 * t, 0.1 * math.sin(a) * (1 + t * t), 0.05 - 0.008 * t)
             for t in range(5)] for a in (2 * math.pi * k / count for k in range(count))]


def write_field(path, n=20):
    """The distance field of two balls that melt into each other."""
    with open(path, "wb") as f:
        f.write(b"VOL" + struct.pack("<B", 3) + struct.pack("<5i", 1, n, n, n, 1) +
                struct.pack("<6f", 0, 0, 0, 1, 1, 1))
        for z in range(n):
            for y in range(n):
                for x in range(n):
                    p = [c / (n - 1) for c in (x, y, z)]
                    a = math.dist(p, (0.36, 0.4, 0.5)) - 0.24
                    b = math.dist(p, (0.68, 0.6, 0.5)) - 0.2
                    h = max(0.0, 0.15 - abs(a - b)) / 0.15
                    f.write(struct.pack("<f", min(a, b) - h * h * 0.15 / 4))


vertices, triangles = torus(24, 12, 0.62, 0.26)
write_obj("assets/torus.obj", vertices, triangles)
write_ply("assets/torus.ply", vertices, triangles, "a torus")
write_serialized("assets/torus.serialized", vertices, triangles)
write_ply("assets/colored.ply", vertices, triangles, "a torus with colors",
          [tuple(int(127.5 + 110 * math.sin(2 * math.pi * (uv[0] * 2 + k / 3))) for k in range(3))
           for _, _, uv in vertices])
write_png("assets/tiles.png", 32, 32, tiles)
write_png("assets/dots.png", 32, 32, dots)
write_png("assets/height.png", 64, 64, height)
write_png("assets/normals.png", 64, 64, normals)
write_pfm("assets/sky.pfm", 32, 16, sky)
write_pfm("assets/hills.pfm", 33, 33, hills)
write_vol("assets/smoke.vol")
write_curves("assets/spring.txt", [spring()])
write_curves("assets/stems.txt", stems())
write_field("assets/balls.vol")
with open("assets/pebble.pbrt", "w", newline="\n") as f:
    f.write("# A box that subdivision rounds.\n")
    f.write('Shape "loopsubdiv" "integer levels" 4\n')
    f.write('  "point3 P" [-0.7 -0.7 -0.7  0.7 -0.7 -0.7  0.7 0.7 -0.7  -0.7 0.7 -0.7\n')
    f.write('              -0.4 -0.4 0.9  0.4 -0.4 0.9  0.4 0.4 0.9  -0.4 0.4 0.9]\n')
    f.write('  "integer indices" [0 2 1  0 3 2  4 5 6  4 6 7  0 1 5  0 5 4  2 3 7  2 7 6  0 4 7  0 7 3  1 2 6  1 6 5]\n')
with open("assets/metal.spd", "w", newline="\n") as f:
    f.write("# a reflectance that rises towards the red: wavelength in nm, value\n")
    for w in range(380, 781, 20):
        f.write("%d %.4f\n" % (w, 0.12 + 0.75 / (1 + math.exp((560 - w) / 28))))
