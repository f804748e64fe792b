"""Figures and tables of the study mis-scenes."""
import math

from matplotlib import pyplot

from draw import select, table, value

PAPER = ("Optimal weights are worth most where light sampling techniques are good in different places of one lamp, and where "
         "a light that many samples go to is hidden; elsewhere they cost their overhead.")
METHODS = ["power", "cutoff", "maximum", "best", "direct", "progressive", "crossfit", "auto"]
EQUAL_SAMPLES, EQUAL_TIME = "squared error over balance, equal samples", "squared error over balance, equal time"


def ordered(rows, key):
    names = []
    for row in rows:
        if row[key] not in names:
            names.append(row[key])
    return names


def found(rows, part, scene, method, quantity, n):
    rows = select(rows, part=part, problem=scene, method=method, quantity=quantity, n=float(n))
    return (rows[0]["value"], rows[0]["standard_error"]) if rows else (math.nan, math.nan)


def figure(rows, _maps):
    parts, scenes = ordered(rows, "part"), ordered(rows, "problem")
    counts = sorted({row["n"] for row in rows if row["quantity"] == EQUAL_TIME})
    result, axes = pyplot.subplots(len(parts), len(scenes), figsize=(2.9 * len(scenes), 3.4 * len(parts)), squeeze=False)
    for row, part in enumerate(parts):
        for column, scene in enumerate(scenes):
            panel = axes[row][column]
            for k, method in enumerate(METHODS):
                for quantity, style in ((EQUAL_SAMPLES, ":"), (EQUAL_TIME, "-")):
                    y = [found(rows, part, scene, method, quantity, n) for n in counts]
                    if all(math.isnan(v) for v, _ in y):
                        continue
                    panel.errorbar(counts, [v for v, _ in y], yerr=[0 if math.isnan(e) else e for _, e in y],
                                   fmt=f"C{k}{style}", lw=1.3, capsize=2, label=method if style == "-" else None)
            panel.axhline(1, color="k", lw=0.8)
            panel.set_xscale("log", base=4)
            panel.set_yscale("log")
            panel.set_title(f"{scene}" + (f"\n{part}" if len(parts) > 1 else ""), fontsize=9)
            panel.grid(alpha=0.3)
    axes[0][0].legend(fontsize=7)
    axes[0][0].set_ylabel("squared error over balance:\nequal samples (..), equal time (-)", fontsize=8)
    for panel in axes[-1]:
        panel.set_xlabel("iterations")
    return result


def more_figures(rows, maps):
    parts, scenes = ordered(rows, "part"), ordered(rows, "problem")
    drawn = {}
    for part in parts:
        names = [name for name in maps if name.startswith(f"{part}, ")]
        kinds = sorted({name.rsplit(", ", 1)[1] for name in names}, key=lambda kind: (kind != "gain", kind))
        shown = [scene for scene in scenes if f"{part}, {scene}, gain" in maps]
        if not shown:
            continue
        result, axes = pyplot.subplots(len(kinds), len(shown), figsize=(2.1 * len(shown) + 1, 2.1 * len(kinds)),
                                       squeeze=False)
        for row, kind in enumerate(kinds):
            for column, scene in enumerate(shown):
                panel = axes[row][column]
                panel.set_xticks([])
                panel.set_yticks([])
                pixels = maps.get(f"{part}, {scene}, {kind}")
                if pixels is None:
                    panel.set_axis_off()
                    continue
                if kind == "gain":
                    logs = [[math.log2(max(v, 1e-3)) for v in line] for line in pixels]
                    image = panel.imshow(logs, cmap="RdBu", vmin=-3, vmax=3)
                else:
                    flat = sorted(abs(v) for line in pixels for v in line)
                    top = flat[int(0.98 * (len(flat) - 1))] or 1
                    image = panel.imshow(pixels, cmap="PuOr", vmin=-top, vmax=top)
                result.colorbar(image, ax=panel, fraction=0.046, pad=0.03).ax.tick_params(labelsize=6)
                panel.set_title(f"{scene}: " + ("log2 gain" if kind == "gain" else kind), fontsize=8)
        drawn["maps-" + part.replace("+", "-").replace(" ", "-")] = result
    return drawn


def ratio(pair):
    ratio_value, error = pair
    if math.isnan(ratio_value):
        return "-"
    return f"{ratio_value:.3f}" + ("" if math.isnan(error) else f" ± {error:.3f}")


def tables(rows):
    parts, scenes = ordered(rows, "part"), ordered(rows, "problem")
    counts = sorted({row["n"] for row in rows if row["quantity"] == EQUAL_TIME})
    text = ""
    for part in parts:
        methods = [m for m in METHODS if select(rows, part=part, method=m)]
        for quantity in (EQUAL_SAMPLES, EQUAL_TIME):
            text += f"{part}: {quantity}.\n\n"
            lines = []
            for scene in scenes:
                for n in counts:
                    cells = [ratio(found(rows, part, scene, m, quantity, n)) for m in methods]
                    if any(cell != "-" for cell in cells):
                        lines.append([scene, f"{n:.0f}"] + cells)
            text += table(["scene", "iterations"] + methods, lines)
        last = counts[-1]
        text += f"{part}: CPU time over balance, and squared error over `path` in equal time, at {last:.0f} iterations.\n\n"
        lines = []
        for scene in scenes:
            microseconds = value(rows, part=part, problem=scene, method="balance", quantity="microseconds of an iteration")
            if math.isnan(microseconds):
                continue
            lines.append([scene, f"{microseconds:.2f}",
                          ratio(found(rows, part, scene, "crossfit", "seconds over balance", last)),
                          ratio(found(rows, part, scene, "path", "seconds over balance", last))] +
                         [ratio(found(rows, part, scene, m, "squared error over path, equal time", last))
                          for m in ("balance", "crossfit", "path, sobol", "optimal, sobol")])
        text += table(["scene", "µs of balance", "crossfit's time", "`path`'s time", "error: balance", "crossfit",
                       "`path`, sobol", "crossfit, sobol"], lines)
    return text
