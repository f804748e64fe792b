"""Figure and tables of the study regularisation."""
import math

from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("[Kaplanyan 2017, Fig. 6.4 and 6.6]: mollified connections let path tracing, bidirectional path tracing and chains "
         "find light that none of their techniques can sample, and converge about as photon mapping does.")


def unique(rows, column):
    return list(dict.fromkeys(row[column] for row in rows))


def figure(rows, maps):
    scenes, methods = unique(rows, "problem"), unique(rows, "method")
    result, axes = pyplot.subplots(1 + len(methods), len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.6 * len(scenes), 2 * (2 + len(methods))))
    for column, scene in enumerate(scenes):
        panel = axes[0][column]
        for k, method in enumerate(methods):
            wanted = {"part": "curves", "problem": scene, "method": method}
            _, error, _ = curve(rows, quantity="relative squared error", **wanted)
            _, seconds, _ = curve(rows, quantity="CPU seconds", **wanted)
            shown = [(s, math.sqrt(e)) for s, e in zip(seconds, error) if e > 0]
            if shown:
                panel.loglog(*zip(*shown), "o-", color=f"C{k}", ms=3, label=method)
        panel.set_title(scene)
        panel.grid(alpha=0.3, which="both")
        levels = sorted(v for line in maps.get(f"{scene} vcm", [[1]]) for v in line)
        top = levels[int(0.97 * (len(levels) - 1))] or 1
        for row, method in enumerate(methods, 1):
            panel = axes[row][column]
            panel.set_xticks([])
            panel.set_yticks([])
            if column == 0:
                panel.set_ylabel(method, fontsize=7)
            if picture := maps.get(f"{scene} {method}"):
                panel.imshow([[max(0, min(1, v / top)) ** 0.45 for v in line] for line in picture], vmin=0, vmax=1,
                             cmap="gray")
    axes[0][0].set_ylabel("relative RMS error")
    axes[0][0].set_xlabel("CPU seconds")
    axes[0][-1].legend(fontsize=5)
    return result


def cell(number):
    return "-" if math.isnan(number) else f"{number:.2g}"


def tables(rows):
    text = ""
    for scene in unique(rows, "problem"):
        lines = []
        for method in unique(rows, "method"):
            wanted = {"part": "curves", "problem": scene, "method": method}
            counts = sorted({row["n"] for row in select(rows, **wanted)})
            first, last = counts[0], counts[-1]
            lines.append([method, cell(last), cell(value(rows, n=last, quantity="CPU seconds", **wanted))] +
                         [cell(value(rows, n=last, quantity=q, **wanted))
                          for q in ("relative squared error", "noise", "bias")] +
                         [cell(value(rows, n=first, quantity="relative squared error", **wanted))])
        text += f"{scene}:\n\n"
        text += table(["method", "units", "CPU s", "error", "noise", "bias", "error at 1/8"], lines)
    return text
