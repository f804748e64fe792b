"""Figure and tables of the study fppm-scenes."""
import math

from matplotlib import pyplot

from draw import curve, table, value
from draw_radii import methods_of, scenes_of

PAPER = ("FPPM has less error than CPPM and SPPM after equal iterations, in rooms with indirect light, under a textured "
         "light, and in a split Cornell box, whose wall leaks less light.")
ERROR = "relative squared error"
MAPPED = ("cppm", "fppm")


def figure(rows, maps):
    scenes = scenes_of(rows)
    methods = [m for m in methods_of(rows) if m != "reference"]
    result, axes = pyplot.subplots(1 + len(MAPPED), len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.4 * len(scenes), 2.6 + 2.1 * len(MAPPED)))
    for column, scene in enumerate(scenes):
        panel = axes[0][column]
        for method in methods:
            x, y, _ = curve(rows, problem=scene, method=method, quantity=ERROR)
            panel.loglog(x, [math.sqrt(max(v, 1e-12)) for v in y], "o-", ms=3, label=method)
        panel.set_title(scene)
        panel.tick_params(labelsize=6, which="both")
        panel.grid(alpha=0.3, which="both")
        for row, method in enumerate(MAPPED, 1):
            image = axes[row][column].imshow(maps[f"{scene} {method}"], vmin=0, vmax=1, cmap="gray")
            axes[row][column].set_xticks([])
            axes[row][column].set_yticks([])
            if column == 0:
                axes[row][column].set_ylabel(f"{method}:\nradius / first")
    axes[0][0].set_ylabel("root of relative squared error")
    axes[0][0].set_xlabel("iterations")
    axes[0][-1].legend(fontsize=5)
    result.colorbar(image, ax=axes[1:, -1], fraction=0.05)
    return result


def tables(rows):
    scenes = scenes_of(rows)
    methods = [m for m in methods_of(rows) if m != "reference"]
    last = max(row["n"] for row in rows if row["n"] == row["n"])
    text = f"Relative squared error over that of ppm (first column: of ppm itself), N = {last:.0f}:\n\n"
    lines = []
    for scene in scenes:
        errors = [value(rows, problem=scene, method=m, n=last, quantity=ERROR) for m in methods]
        lines.append([scene, f"{errors[0]:.3g}"] + [f"{error / errors[0]:.3g}" for error in errors[1:]])
    text += table(["scene"] + methods, lines)
    for rival in ("ppm", "cppm"):
        wins = sum(value(rows, problem=s, method="fppm", n=last, quantity=ERROR) <
                   value(rows, problem=s, method=rival, n=last, quantity=ERROR) for s in scenes)
        text += f"fppm has less error than {rival} on {wins} of {len(scenes)} scenes.\n\n"
    return text
