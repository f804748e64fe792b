#!/usr/bin/env python3
"""Fails for each #include "..." of the product that runs up, or sideways, against include_order.txt.

usage: check_includes.py LIST ROOT      check the tree at ROOT
       check_includes.py --self-test    check this program on made-up trees
"""

import os
import re
import sys
import tempfile

PRODUCT = ("common", "worker", "master", "client")
GENERATED = ("candela/v1/",)  # of proto/
INCLUDE = re.compile(r'\s*#\s*include\s*"([^"]+)"')


def covers(name, path):
    """Whether the part `name` has the file `path`, which has no ending."""
    if name.endswith("*"):
        return path.startswith(name[:-1])
    return path == name or path.startswith(name + "/")


class Order:
    def __init__(self, text):
        self.floor = {}  # part -> number
        self.allow, self.never = [], []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.split("#")[0].split()
            if not words:
                continue
            if words[0] == "allow" and len(words) == 3:
                self.allow.append((words[1], words[2]))
            elif words[0] == "never" and len(words) in (3, 5) and (len(words) == 3 or words[3] == "but"):
                self.never.append((words[1], words[2], words[4] if len(words) == 5 else None))
            elif words[0] in ("allow", "never"):
                sys.exit(f"include_order line {number}: not a rule: {line.strip()}")
            else:
                for name in words:
                    if name in self.floor:
                        sys.exit(f"include_order line {number}: {name} has a floor already")
                    self.floor[name] = number

    def part(self, path):
        fitting = [name for name in self.floor if covers(name, path)]
        return max(fitting, key=lambda name: len(name.rstrip("*")), default=None)

    def fault(self, source, target):
        """Why the file `source` may not include `target`; None if it may. Both without endings."""
        for where, what, but in self.never:
            if covers(where, source) and covers(what, target) and not (but and covers(but, source)):
                return f"{where} never includes {what}"
        a, b = self.part(source), self.part(target)
        if b is None:
            return "it has no floor in the list"
        if a == b or self.floor[b] < self.floor[a] or (a, b) in self.allow:
            return None
        return f"{b} is " + ("beside" if self.floor[a] == self.floor[b] else "above") + f" {a}"


def check(order, root):
    faults = []
    for top in PRODUCT:
        for folder, folders, files in os.walk(os.path.join(root, top)):
            folders.sort()
            for name in sorted(files):
                stem, ending = os.path.splitext(name)
                if ending not in (".h", ".cpp"):
                    continue
                path = os.path.relpath(os.path.join(folder, name), root)
                source = os.path.join(os.path.dirname(path), stem)
                if order.part(source) is None:
                    faults.append(f"{path}:1: the file has no floor in the list")
                    continue
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    for number, line in enumerate(file, 1):
                        found = INCLUDE.match(line)
                        if not found or found[1].startswith(GENERATED):
                            continue
                        why = order.fault(source, os.path.splitext(found[1])[0])
                        if why:
                            faults.append(f"{path}:{number}: includes {found[1]}: {why}")
    return faults


def self_test():
    order = """
common/base
common/film
worker/low  worker/beside
worker/scene  worker/friend
worker/scene/accel
worker/deep*
master/farm
client
client/embedded
allow worker/friend worker/scene
never worker master
never client master but client/embedded
never worker common/film/sums
"""
    files = {
        "common/base/a.h": [],
        "common/film/sums.h": ["common/base/a.h", "candela/v1/job.pb.h"],
        "common/base/up.h": ["common/film/sums.h"],
        "common/base/higher.h": ["worker/low/b.h"],
        "worker/low/b.h": ["common/base/a.h", "worker/low/c.h", "common/film/sums.h"],
        "worker/low/sideways.cpp": ["worker/beside/d.h"],
        "worker/scene/scene.cpp": ["worker/low/b.h", "worker/scene/accel.h", "worker/friend/f.h"],
        "worker/scene/accel.cpp": ["worker/scene/scene.h"],
        "worker/friend/f.h": ["worker/scene/scene.h"],
        "worker/deep_water.cpp": ["worker/scene/accel.h", "worker/deep_sea.h"],
        "worker/new/g.h": [],
        "worker/low/lost.cpp": ["worker/nowhere/h.h", "lost.h"],
        "master/farm/farm.cpp": ["common/film/sums.h"],
        "client/main.cpp": ["master/farm/farm.h"],
        "client/embedded/local.cpp": ["master/farm/farm.h", "client/main.h"],
        "worker/deep_master.cpp": ["common/base/a.h", "master/farm/farm.h"],
    }
    expected = {
        "common/base/up.h:1: includes common/film/sums.h: common/film is above common/base",
        "common/base/higher.h:1: includes worker/low/b.h: worker/low is above common/base",
        "worker/low/b.h:3: includes common/film/sums.h: worker never includes common/film/sums",
        "worker/low/sideways.cpp:1: includes worker/beside/d.h: worker/beside is beside worker/low",
        "worker/scene/scene.cpp:2: includes worker/scene/accel.h: worker/scene/accel is above worker/scene",
        "worker/scene/scene.cpp:3: includes worker/friend/f.h: worker/friend is beside worker/scene",
        "worker/new/g.h:1: the file has no floor in the list",
        "worker/low/lost.cpp:1: includes worker/nowhere/h.h: it has no floor in the list",
        "worker/low/lost.cpp:2: includes lost.h: it has no floor in the list",
        "client/main.cpp:1: includes master/farm/farm.h: client never includes master",
        "worker/deep_master.cpp:2: includes master/farm/farm.h: worker never includes master",
    }
    with tempfile.TemporaryDirectory() as root:
        for path, includes in files.items():
            os.makedirs(os.path.join(root, os.path.dirname(path)), exist_ok=True)
            with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                file.writelines(f'#include "{name}"\n' for name in includes)
        found = set(check(Order(order), root))
    for line in sorted(expected - found):
        print("not found: " + line)
    for line in sorted(found - expected):
        print("found without cause: " + line)
    return found == expected


def main():
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(0 if self_test() else 1)
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        order = Order(file.read())
    faults = check(order, sys.argv[2])
    for fault in faults:
        print(fault)
    if faults:
        sys.exit(f"{len(faults)} includes run up or sideways: move what both need below them, or the list is wrong")


if __name__ == "__main__":
    main()
