"""Figure and tables of the study upbp-scenes."""
import math

from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("Each estimator is good at something: points in dense media, beams in thin ones. Weighted together, the five are "
         "about as good as the best of them everywhere, and better where a picture has both.")
ALL = "all"
ALONE = ("vcm", "pp3d", "pb2d", "bp2d", "bb1d")


def unique(rows, column):
    return list(dict.fromkeys(row[column] for row in rows))


def picture_top(reference):
    """The 98th percentile of a reference, which is shown as white."""
    levels = sorted(v for line in reference for v in line)
    return levels[int(0.98 * (len(levels) - 1))] or 1


def show(panel, picture, top):
    panel.set_xticks([])
    panel.set_yticks([])
    if picture is None:
        panel.set_axis_off()
    else:
        panel.imshow([[max(0, min(1, v / top)) ** 0.45 for v in line] for line in picture], vmin=0, vmax=1, cmap="gray")


def figure(rows, maps):
    scenes = unique(rows, "problem")
    methods = unique(select(rows, part="curves"), "method")
    result, axes = pyplot.subplots(1 + len(methods) + 1, len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.1 * len(scenes), 2.1 * (2 + len(methods))))
    for column, scene in enumerate(scenes):
        panel = axes[0][column]
        for k, method in enumerate(methods):
            wanted = {"part": "curves", "problem": scene, "method": method}
            _, error, _ = curve(rows, quantity="relative squared error", **wanted)
            _, seconds, _ = curve(rows, quantity="CPU seconds", **wanted)
            shown = [(s, math.sqrt(e)) for s, e in zip(seconds, error) if e > 0]
            if shown:
                panel.loglog(*zip(*shown), "o-", color=f"C{k % 10}", ls="-" if k < 10 else "--", ms=3, label=method)
        panel.set_title(scene)
        panel.grid(alpha=0.3, which="both")
        top = picture_top(maps[f"{scene} reference"])
        for row, name in enumerate(["reference"] + methods, 1):
            panel = axes[row][column]
            if column == 0:
                panel.set_ylabel(name)
            show(panel, maps.get(f"{scene} {name}"), top)
    axes[0][0].set_ylabel("relative RMS error")
    axes[0][0].set_xlabel("CPU seconds")
    axes[0][-1].legend(fontsize=6)
    return result


def more_figures(rows, maps):
    """The share of each technique in the picture of all."""
    scenes = unique(rows, "problem")
    layers = unique(select(rows, part="layers"), "method")
    if not layers:
        return {}
    result, axes = pyplot.subplots(len(scenes), 1 + len(layers), squeeze=False, constrained_layout=True,
                                   figsize=(1.9 * (1 + len(layers)), 1.9 * len(scenes)))
    for row, scene in enumerate(scenes):
        top = picture_top(maps[f"{scene} reference"])
        for column, name in enumerate(["reference"] + [f"layer {layer}" for layer in layers]):
            panel = axes[row][column]
            if row == 0:
                panel.set_title(name.removeprefix("layer "), fontsize=9)
            if column == 0:
                panel.set_ylabel(scene)
            show(panel, maps.get(f"{scene} {name}"), top)
    return {"layers": result}


def cell(number):
    return "-" if math.isnan(number) else f"{number:.3g}"


def tables(rows):
    text = ""
    for quantity, words in (("relative squared error", "Squared error"), ("noise", "Noise")):
        text += f"{words} in equal CPU time, of all techniques together over each method (below 1: together is better):\n\n"
        lines, names = [], [m for m in unique(select(rows, part="equal time"), "method") if m != ALL]
        for scene in unique(rows, "problem"):
            def at(method):
                return value(rows, part="equal time", problem=scene, method=method, quantity=quantity)
            alone = [at(m) for m in names if m in ALONE and not math.isnan(at(m))]
            best = at(ALL) / min(alone) if alone else math.nan
            lines.append([scene] + [cell(at(ALL) / at(m)) for m in names] + [cell(best), cell(at(ALL))])
        text += table(["scene"] + names + ["over the best alone", "of all"], lines)
    text += "CPU time of an iteration over that of `vcm`:\n\n"
    lines, names = [], unique(select(rows, part="equal time"), "method")
    for scene in unique(rows, "problem"):
        lines.append([scene] + [cell(value(rows, part="equal time", problem=scene, method=m,
                                           quantity="seconds of an iteration over vcm's")) for m in names])
    text += table(["scene"] + names, lines)
    layers = unique(select(rows, part="layers"), "method")
    if layers:
        text += "Share of each technique in the light of the picture of all with 1024 beams; the rest is light met by chance:\n\n"
        lines = [[scene] + [cell(value(rows, part="layers", problem=scene, method=m, quantity="share of the light"))
                            for m in layers] for scene in unique(rows, "problem")]
        text += table(["scene"] + layers, lines)
    text += "Squared bias over the squared error, at the last count:\n\n"
    last = max(row["n"] for row in select(rows, part="curves"))
    lines = []
    for scene in unique(rows, "problem"):
        wanted = {"part": "curves", "problem": scene, "n": last}
        lines.append([scene] + [cell(value(rows, method=m, quantity="bias", **wanted) /
                                     value(rows, method=m, quantity="relative squared error", **wanted)) for m in names])
    return text + table(["scene"] + names, lines)
