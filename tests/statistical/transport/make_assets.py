#!/usr/bin/env python3
"""Makes the meshes, images and volume of the transport scenes (assets/), from formulas alone. Run in this folder."""
import math
import struct
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from asset_files import torus, write_pfm, write_ply, write_png  # noqa: E402


def icosahedron():
    """Twenty flat triangles with the normals of the unit sphere: shading normals far from the true ones."""
    g = (1 + math.sqrt(5)) / 2
    s = 1 / math.hypot(1, g)
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
               (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                 (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                 (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    vertices = []
    for c in corners:
        p = tuple(x * s for x in c)
        vertices.append((p, p, (0.5 + math.atan2(p[2], p[0]) / (2 * math.pi), math.acos(p[1]) / math.pi)))
    return vertices, triangles


def patches(x, y):
    """Coloured patches, black between; 16 x 16."""
    if x % 4 == 0 or y % 4 == 0:
        return 0, 0, 0
    k = (x // 4 * 3 + y // 4 * 5) % 7
    return 100 + 22 * k, 230 - 25 * k, 70 + 11 * (k * k % 11)


def holes(x, y):
    """Opaque, half opaque and open; 16 x 16."""
    d = math.hypot(x % 8 - 3.5, y % 8 - 3.5)
    return (255 if d > 3.2 else 128 if d > 2 else 0,) * 3


def bumps(x, y):
    """Rounded bumps; 32 x 32, periodic."""
    h = 0.5 + 0.5 * math.sin(2 * math.pi * 4 * x / 32) * math.sin(2 * math.pi * 4 * y / 32)
    return (int(255 * h),) * 3


def waves(x, y):
    """The normals of waves along u and v; 32 x 32, periodic."""
    su, sv = 0.7 * math.cos(2 * math.pi * 4 * x / 32), 0.4 * math.cos(2 * math.pi * 3 * y / 32)
    length = math.sqrt(1 + su * su + sv * sv)
    return tuple(int(255 * (0.5 + 0.5 * c / length)) for c in (-su, -sv, 1))


def sky(x, y):
    """A blue sky over dark ground with a sun of 2 x 2 pixels; 32 x 16."""
    if y >= 8:
        return 0.15, 0.12, 0.1
    if x in (20, 21) and y in (2, 3):
        return 40.0, 36.0, 30.0
    h = 1 - y / 8
    return 0.6 - 0.35 * h, 0.65 - 0.25 * h, 0.7 + 0.2 * h


def write_vol(path, n=12):
    """A ball of smoke with streaks, empty in its corners."""
    with open(path, "wb") as f:
        f.write(b"VOL" + struct.pack("<B", 3) + struct.pack("<5i", 1, n, n, n, 1) +
                struct.pack("<6f", 0, 0, 0, 1, 1, 1))
        for z in range(n):
            for y in range(n):
                for x in range(n):
                    p = [(c + 0.5) / n * 2 - 1 for c in (x, y, z)]
                    streak = 0.6 + 0.4 * math.sin(7 * p[0] + 5 * p[1] * p[2])
                    f.write(struct.pack("<f", max(0.0, 1 - math.sqrt(sum(c * c for c in p))) * streak))


write_ply("assets/torus.ply", *torus(9, 6, 0.42, 0.17))
write_ply("assets/ball.ply", *icosahedron())
write_png("assets/patches.png", 16, 16, patches)
write_png("assets/holes.png", 16, 16, holes)
write_png("assets/bumps.png", 32, 32, bumps)
write_png("assets/waves.png", 32, 32, waves)
write_pfm("assets/sky.pfm", 32, 16, sky)
write_vol("assets/smoke.vol")
