#!/usr/bin/env python3
"""Claim: files of equal renders are equal byte for byte, whatever threads, workers and moments made them, but for the name
of the job and what the image says of its run (candela:job, candela:run:...). A PNG has neither. So is the file of the render
that `candela reproduce` makes of one.

Usage: check_equal_renders.py CANDELA SCENE"""
import os
import struct
import subprocess
import sys
import tempfile


def parts_of(exr):
    """Attributes by name, and the bytes behind the header and its table of chunks."""
    attributes, at = {}, 8
    while exr[at] != 0:
        name, kind, rest = exr[at:].split(b"\0", 2)
        size, = struct.unpack("<I", rest[:4])
        attributes[name.decode()] = (kind, rest[4:4 + size])
        at += len(name) + len(kind) + 6 + size
    first_chunk, = struct.unpack("<Q", exr[at + 1:at + 9])
    return attributes, exr[first_chunk:]


def names_the_job(name):
    return name == "candela:job" or name.startswith("candela:run:")


def main():
    candela, scene = sys.argv[1:]
    made = []
    with tempfile.TemporaryDirectory() as folder:
        for threads, workers in (("1", "1"), ("3", "2")):
            paths = [os.path.join(folder, threads + end) for end in (".exr", ".png")]
            subprocess.run([candela, "render", scene, "--size", "40x24", "--iterations", "6", "--threads", threads, "--workers",
                            workers, "--error-layer", "--quiet", "-o", paths[0], "--png", paths[1]], check=True)
            made.append([open(path, "rb").read() for path in paths])
        again = os.path.join(folder, "again.exr")
        subprocess.run([candela, "reproduce", paths[0], "--run", "--quiet", "-o", again], check=True, stdout=subprocess.DEVNULL)
        made.append([open(again, "rb").read(), made[0][1]])
    first, first_png = made[0]
    attributes, chunks = parts_of(first)
    for second, second_png in made[1:]:
        others, other_chunks = parts_of(second)
        if attributes["candela:job"] == others["candela:job"]:
            sys.exit("two renders are one job")
        for name in sorted(set(attributes) | set(others)):
            if not names_the_job(name) and attributes.get(name) != others.get(name):
                sys.exit(f"{name} differs: {attributes.get(name)} and {others.get(name)}")
        if chunks != other_chunks:
            sys.exit("the pixels differ")
        if first_png != second_png:
            sys.exit("the PNGs differ")


if __name__ == "__main__":
    main()
