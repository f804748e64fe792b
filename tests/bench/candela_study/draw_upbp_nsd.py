"""Figure and tables of the study upbp-nsd."""
from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("Estimators of light in a medium with fewer blurred dimensions are not always better: points win where the "
         "kernel is wider than about a mean free path, beams where it is narrower. So the paper combines both. Its "
         "figure has normalised standard deviations against the kernel's width, in a setting of its own that it does "
         "not give as numbers.")
BUILT = (("P-P3D", "C3-"), ("P-B2D[s]", "C0--"), ("P-B2D[l]", "C0-"), ("B-P2D[s]", "C2:"), ("B-P2D[l]", "C2-."),
         ("B-B1D[ss]", "C1--"), ("B-B1D[sl]", "C1:"), ("B-B1D[ll]", "C1-"))
PARTS = (("fixed", "crossing 2 mean free paths deep on both rays"), ("uniform", "crossing uniform over 20 mean free paths"))


def names(rows):
    found = []
    for row in select(rows, part="uniform", quantity="nsd"):
        if row["method"] not in found:
            found.append(row["method"])
    return found


def figure(rows, _maps):
    result, axes = pyplot.subplots(2, 2, figsize=(14, 11))
    for panel, (part, what) in zip(axes[0], PARTS):
        for name in names(rows):
            x, y, _ = curve(rows, part=part, method=name, quantity="nsd")
            panel.loglog(*zip(*[(a, b) for a, b in zip(x, y) if b > 1e-3]), color="0.8", lw=0.8, zorder=1)
        for name, style in BUILT:
            x, y, _ = curve(rows, part=part, method=name, quantity="nsd")
            panel.loglog(*zip(*[(a, b) for a, b in zip(x, y) if b > 1e-3]), style, lw=1.6, label=name)
            x, y, e = curve(rows, part=part, method=name, quantity="nsd, simulated")
            panel.errorbar(x, y, yerr=e, fmt=style[:2] + "o", ms=3, lw=1)
        panel.set_title(f"{what}; grey: all 25", fontsize=10)
        panel.set_xlabel("width of the kernel, mean free paths")
        panel.set_ylabel("standard deviation / mean, one pair of rays")
        panel.legend(fontsize=8)

    panel = axes[1][0]
    shown = [name for name, _ in BUILT]
    exact = [value(rows, part="many", method=name, quantity="nsd") for name in shown]
    found = [value(rows, part="many", method=name, quantity="nsd, simulated") for name in shown]
    floor = [value(rows, part="many", method=name, quantity="floor") for name in shown]
    places = range(len(shown))
    panel.bar([p - 0.25 for p in places], exact, 0.25, color="C0", label="closed form")
    panel.bar(list(places), found, 0.25, color="C1", label="simulated")
    panel.bar([p + 0.25 for p in places], floor, 0.25, color="0.6", label="floor: the eye ray's own")
    panel.set_yscale("symlog", linthresh=0.1)
    panel.set_xticks(list(places), shown, rotation=30, fontsize=8)
    panel.set_title("50 light paths meet one eye path, width 1, fixed crossing", fontsize=10)
    panel.legend(fontsize=8)

    panel = axes[1][1]
    for k, name in enumerate(("P-P3D", "P-B2D[s]", "P-B2D[l]", "B-P2D[s]", "B-P2D[l]", "B-B1D[ss]", "B-B1D[ll]")):
        x, y, e = curve(rows, part="two beams", method=name, quantity="mean")
        _, expected, _ = curve(rows, part="two beams", method=name, quantity="expectation")
        panel.errorbar([a * (1 + 0.02 * k) for a in x], [a / b for a, b in zip(y, expected)],
                       yerr=[a / b for a, b in zip(e, expected)], fmt="o", ms=4, label=name)
    panel.axhline(1, color="k", lw=0.8)
    panel.set_xscale("log")
    panel.set_title("rays at 30 degrees, the renderer's kernels: mean over expectation", fontsize=10)
    panel.set_xlabel("radius of the kernel, mean free paths")
    panel.legend(fontsize=8)
    for panel in axes.flat:
        panel.grid(alpha=0.3)
    return result


def tables(rows):
    text = "Normalised standard deviation by kernel width (closed form; simulated in brackets):\n\n"
    head, lines = ["estimator"], []
    for part, _ in PARTS:
        head += [f"{part}, u = {u:g}" for u in (0.1, 1.0)]
    for name in names(rows):
        cells = [name]
        for part, _ in PARTS:
            for u in (0.1, 1.0):
                exact = value(rows, part=part, method=name, quantity="nsd", n=u)
                found = value(rows, part=part, method=name, quantity="nsd, simulated", n=u)
                cells.append(f"{exact:.4g} ({found:.4g})" if found == found else f"{exact:.4g}")
        lines.append(cells)
    text += table(head, lines)
    text += "Width from which a sampled point is better than a beam, in mean free paths:\n\n"
    text += table(["crossing", "beam", "width"], [[row["problem"], row["method"], f"{row['value']:.4f}"]
                                                  for row in select(rows, part="crossovers")])
    text += "Slope of log(spread) over log(width) at 0.001 mean free paths:\n\n"
    return text + table(["estimator", "slope"], [[row["method"], f"{row['value']:.4f}"]
                                                 for row in select(rows, part="slopes")])
