#!/usr/bin/env python3
"""The master's CPU time against workers and deltas a second: figure.py CSV OUT.svg (the CSV is candela-swarm's)."""
import csv
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "candela"  # equal figures are equal files
import matplotlib.pyplot as plt

rows = list(csv.DictReader(open(sys.argv[1])))
sizes = sorted({row["size"] for row in rows}, key=lambda size: int(size.split("x")[0]))
figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
for axis, column, label in ((axes[0], "workers", "workers"), (axes[1], "deltas_per_s", "deltas merged a second")):
    for size, mark in zip(sizes, "osd^"):
        points = sorted((float(r[column]), float(r["master_cores"])) for r in rows if r["size"] == size)
        axis.plot(*zip(*points), marker=mark, label=size.replace("x", " x "))
    axis.set_xscale("log")
    axis.set_xlabel(label)
    axis.set_ylim(0, 1.05)
    axis.axhline(1, color="0.6", linewidth=0.8)
    axis.grid(alpha=0.3)
axes[0].set_ylabel("CPU time of the master, of one core")
axes[0].legend(title="film", frameon=False)
figure.tight_layout()
figure.savefig(sys.argv[2], metadata={"Date": None})
