"""Shapes and file formats that the scenes' assets are made with."""
import math
import struct
import zlib


def torus(rings, sides, major, minor):
    """Vertices (position, normal, uv) and triangles of a torus about the y axis."""
    vertices, triangles = [], []
    for i in range(rings + 1):
        a = 2 * math.pi * i / rings
        for j in range(sides + 1):
            b = 2 * math.pi * j / sides
            r = major + minor * math.cos(b)
            vertices.append(((r * math.cos(a), minor * math.sin(b), -r * math.sin(a)),
                             (math.cos(b) * math.cos(a), math.sin(b), -math.cos(b) * math.sin(a)),
                             (i / rings, j / sides)))
    for i in range(rings):
        for j in range(sides):
            a, b = i * (sides + 1) + j, (i + 1) * (sides + 1) + j
            triangles += [(a, b, b + 1), (a, b + 1, a + 1)]
    return vertices, triangles


def write_ply(path, vertices, triangles, comment="", colors=None):
    """colors: of the vertices, three bytes each."""
    with open(path, "wb") as f:
        f.write(b"ply\nformat binary_little_endian 1.0\n")
        if comment:
            f.write(b"comment %s\n" % comment.encode())
        f.write(b"element vertex %d\n" % len(vertices))
        for name in "x y z nx ny nz u v".split():
            f.write(b"property float %s\n" % name.encode())
        if colors:
            f.write(b"property uchar red\nproperty uchar green\nproperty uchar blue\n")
        f.write(b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(triangles))
        for i, (p, n, uv) in enumerate(vertices):
            f.write(struct.pack("<8f", *p, *n, *uv))
            if colors:
                f.write(bytes(colors[i]))
        for t in triangles:
            f.write(struct.pack("<B3i", 3, *t))


def write_png(path, width, height, pixel):
    rows = b"".join(b"\0" + bytes(c for x in range(width) for c in pixel(x, y)) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)) +
                chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def write_pfm(path, width, height, pixel):
    with open(path, "wb") as f:
        f.write(b"PF\n%d %d\n-1.0\n" % (width, height))
        for y in reversed(range(height)):
            for x in range(width):
                f.write(struct.pack("<3f", *pixel(x, y)))
