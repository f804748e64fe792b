"""Figure and tables of the study vcmplus-table."""
import math

from matplotlib import pyplot

from draw import curve, table, value

PAPER = ("Table I: VCM+ needs 0.18 to 0.83 of VCM's iterations to an equal error, and 0.23 to 0.91 of its time; an "
         "iteration costs 4 to 11 % more (31 % with tests of three channels).")
RATIOS = ("iterations over vcm's", "CPU seconds over vcm's", "CPU seconds of an iteration over vcm's",
          "squared error over vcm's")


def scenes_of(rows):
    scenes = []
    for row in rows:
        if row["problem"] not in scenes:
            scenes.append(row["problem"])
    return scenes


def figure(rows, maps):
    scenes = scenes_of(rows)
    result, axes = pyplot.subplots(2, len(scenes), squeeze=False, figsize=(2.7 * len(scenes), 5.4))
    for panel, below, scene in zip(axes[0], axes[1], scenes):
        for method in ("vcm", "vcmplus"):
            x, y, _ = curve(rows, problem=scene, method=method, quantity="squared error")
            shown = [(a, math.sqrt(b)) for a, b in zip(x, y) if b > 0]
            if shown:
                panel.loglog(*zip(*shown), "o-", ms=3, label=method)
        panel.set_title(scene)
        panel.grid(alpha=0.3, which="both")
        if f"{scene} vcmplus" in maps:
            below.imshow(maps[f"{scene} vcmplus"], vmin=0, vmax=1, cmap="gray")
        below.set_xticks([])
        below.set_yticks([])
    axes[0][0].set_ylabel("RMS error / mean")
    axes[1][0].set_ylabel("vcmplus: radius / first")
    axes[0][-1].legend(fontsize=7)
    return result


def tables(rows):
    last = max(row["n"] for row in rows if row["method"] == "vcmplus")
    lines = []
    for scene in scenes_of(rows):
        cells = [scene]
        for quantity in RATIOS + ("share of pixels shrunk", "median radius"):
            found = value(rows, problem=scene, method="vcmplus", quantity=quantity, n=last)
            cells.append(f"{found:.2f}" if found == found else "-")
        lines.append(cells)
    return (f"To the error that vcm has after {last:.0f} iterations (-: not reached):\n\n" +
            table(["scene", "iterations", "CPU seconds", "of an iteration", "squared error at the end", "share shrunk",
                   "median radius"], lines))
