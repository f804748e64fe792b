"""Figure and tables of the studies that compare ways to choose the radius on the analytic scenes.

Maps are gray for the radius; red: it has shrunk without need; blue: it has a bias that is significant.
"""
import math

from matplotlib import pyplot

from draw import curve, table, value

BEST = "best fixed radius"


def scenes_of(rows):
    scenes = []
    for row in rows:
        if row["problem"] not in scenes:
            scenes.append(row["problem"])
    return scenes


def methods_of(rows):
    methods = []
    for row in rows:
        if row["method"] not in methods and row["method"] != BEST:
            methods.append(row["method"])
    return methods


def colors_of(radii, decisions):
    tints = {0: (1, 1, 1), 1: (1, 0.25, 0.2), -1: (0.2, 0.4, 1)}
    return [[[0.25 * (decision != 0) + (1 - 0.25 * (decision != 0)) * radius * tint for tint in tints[decision]]
             for radius, decision in zip(*lines)] for lines in zip(radii, decisions)]


def figure(rows, maps, mapped=None):
    methods, scenes = methods_of(rows), scenes_of(rows)
    mapped = [m for m in mapped or methods if any(name.split(" ", 1)[1] == m for name in maps)]
    result, axes = pyplot.subplots(1 + len(mapped), len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.4 * len(scenes), 2.6 + 2.1 * len(mapped)))
    for column, scene in enumerate(scenes):
        panel = axes[0][column]
        for method in [BEST] + methods:
            x, y, _ = curve(rows, problem=scene, method=method, quantity="squared error")
            shown = [(a, math.sqrt(b)) for a, b in zip(x, y) if b > 0]
            if shown:
                panel.loglog(*zip(*shown), "k--" if method == BEST else "o-", ms=3, label=method)
        panel.set_title(scene)
        panel.tick_params(labelsize=6, which="both")
        panel.grid(alpha=0.3, which="both")
        for row, method in enumerate(mapped, 1):
            axes[row][column].imshow(colors_of(maps[f"{scene} {method}"], maps[f"{scene} {method} decisions"]))
            axes[row][column].set_xticks([])
            axes[row][column].set_yticks([])
            if column == 0:
                axes[row][column].set_ylabel(f"{method}:\nradius / first")
    axes[0][0].set_ylabel("RMS error / mean")
    axes[0][0].set_xlabel("iterations")
    axes[0][-1].legend(fontsize=5)
    return result


def tables(rows):
    methods, scenes = methods_of(rows), scenes_of(rows)
    last = max(row["n"] for row in rows)

    def cell(scene, method, quantity, form):
        found = value(rows, problem=scene, method=method, n=last, quantity=quantity)
        return form.format(found) if found == found else "-"

    text = f"Squared error over that of the best fixed radius, N = {last:.0f}:\n\n"
    lines = []
    for scene in scenes:
        best = value(rows, problem=scene, method=BEST, n=last, quantity="squared error")
        lines.append([scene, cell(scene, BEST, "median radius", "{:.2g}")] +
                     [f"{value(rows, problem=scene, method=m, n=last, quantity='squared error') / best:.2g}"
                      for m in methods])
    text += table(["scene", "best radius / first"] + methods, lines)
    decided = [m for m in methods if value(rows, method=m, n=last, quantity="median radius") > 0]
    text += ("Pixels whose radius shrank without need / that have a significant bias, in percent; "
             "median radius / first:\n\n")
    lines = []
    for scene in scenes:
        line = [scene]
        for method in decided:
            shares = [100 * value(rows, problem=scene, method=method, n=last, quantity=quantity)
                      for quantity in ("false positives", "false negatives")]
            line.append("{:.0f} / {:.0f}; ".format(*shares) + cell(scene, method, "median radius", "{:.2f}"))
        lines.append(line)
    return text + table(["scene"] + decided, lines)
