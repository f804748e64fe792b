"""Figure and tables of the study regularisation."""
import math

from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("[Kaplanyan 2017, Fig. 6.4 and 6.6]: mollified connections let path tracing, bidirectional path tracing and chains "
         "find light that none of their techniques can sample, and converge about as photon mapping does.")


def unique(rows, column):
    return list(dict.fromkeys(row[column] for row in rows))


CURVES = (("relative squared error", "error"), ("noise", "noise"), ("bias", "bias"))


def figure(rows, maps):
    scenes, methods = unique(rows, "problem"), unique(rows, "method")
    result, axes = pyplot.subplots(len(CURVES) + len(methods), len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.6 * len(scenes), 2 * (len(CURVES) + len(methods))))
    for column, scene in enumerate(scenes):
        for (quantity, name), panel in zip(CURVES, axes[:, column]):
            for k, method in enumerate(methods):
                wanted = {"part": "curves", "problem": scene, "method": method}
                _, parts, _ = curve(rows, quantity=quantity, **wanted)
                _, seconds, _ = curve(rows, quantity="CPU seconds", **wanted)
                shown = [(s, math.sqrt(part)) for s, part in zip(seconds, parts) if part > 0]
                if shown:
                    panel.loglog(*zip(*shown), marker="o", color=f"C{k % 10}", ls="--" if k > 9 else "-", ms=3, label=method)
            panel.grid(alpha=0.3, which="both")
            if column == 0:
                panel.set_ylabel(f"relative {name}, root")
        axes[0][column].set_title(scene)
        levels = sorted(v for line in maps.get(f"{scene} vcm", [[1]]) for v in line)
        top = levels[int(0.97 * (len(levels) - 1))] or 1
        for row, method in enumerate(methods, len(CURVES)):
            panel = axes[row][column]
            panel.set_xticks([])
            panel.set_yticks([])
            if column == 0:
                panel.set_ylabel(method, fontsize=7)
            if picture := maps.get(f"{scene} {method}"):
                panel.imshow([[max(0, min(1, v / top)) ** 0.45 for v in line] for line in picture], vmin=0, vmax=1,
                             cmap="gray")
    axes[len(CURVES) - 1][0].set_xlabel("CPU seconds")
    axes[0][-1].legend(fontsize=5)
    return result


def cell(number):
    return "-" if math.isnan(number) else f"{number:.2g}"


def tables(rows):
    """Error, noise and bias over the iterations of each method."""
    text = ""
    for scene in unique(rows, "problem"):
        lines = []
        for method in unique(rows, "method"):
            wanted = {"part": "curves", "problem": scene, "method": method}
            for n in sorted({row["n"] for row in select(rows, **wanted)}):
                lines.append([method, cell(n)] + [cell(value(rows, n=n, quantity=q, **wanted))
                                                  for q in ("CPU seconds", *(q for q, _ in CURVES))])
        text += f"{scene}:\n\n"
        text += table(["method", "units", "CPU s", "error", "noise", "bias"], lines)
    return text
