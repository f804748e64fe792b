"""Figure and tables of the study vcmplus-table."""
import math

from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("Table I: VCM+ needs 0.18 to 0.83 of VCM's iterations to an equal error, and 0.23 to 0.91 of its time; an "
         "iteration costs 4 to 11 % more (31 % with tests of three channels). Table II: k = 0.5 to 0.9 matters by 3 % "
         "and less. Table III: alpha_f = 0.01, 0.05, 0.1 give 0.84, 0.87, 0.91 of VCM's error (Kitchen) and 0.76, 0.80, "
         "0.86 (Glass). Fig. 14: VCM+ is better at every first radius, most at the largest, and equal at the smallest.")
MAPS = (("radius", "vcmplus: radius / first"), ("merging vcm", "vcm: share of merging"),
        ("merging vcmplus", "vcmplus: share of merging"))


def unique(rows, column, **wanted):
    found = []
    for row in select(rows, **wanted):
        if row[column] not in found:
            found.append(row[column])
    return found


def figure(rows, maps):
    scenes = unique(rows, "problem", part="table")
    result, axes = pyplot.subplots(1 + len(MAPS), len(scenes), squeeze=False, constrained_layout=True,
                                   figsize=(2.1 * len(scenes), 2.1 * (1 + len(MAPS))))
    for column, scene in enumerate(scenes):
        panel = axes[0][column]
        for method in unique(rows, "method", part="table", problem=scene):
            x, y, _ = curve(rows, part="table", problem=scene, method=method, quantity="relative error")
            shown = [(a, math.sqrt(b)) for a, b in zip(x, y) if b > 0]
            if shown:
                panel.loglog(*zip(*shown), "o-", ms=3, label=method)
        panel.set_title(scene)
        panel.grid(alpha=0.3, which="both")
        for panel, (name, _) in zip(axes[1:, column], MAPS):
            if f"{scene} {name}" in maps:
                panel.imshow(maps[f"{scene} {name}"], vmin=0, vmax=1, cmap="gray")
            else:
                panel.text(0.5, 0.5, "no merging", ha="center", va="center", transform=panel.transAxes)
            panel.set_xticks([])
            panel.set_yticks([])
    axes[0][0].set_ylabel("relative RMS error")
    for panel, (_, label) in zip(axes[1:, 0], MAPS):
        panel.set_ylabel(label)
    axes[0][-1].legend(fontsize=7)
    return result


def cell(rows, digits=2, **wanted):
    found = select(rows, **wanted)
    if not found or math.isnan(found[0]["value"]):
        return "-"
    error = found[0]["standard_error"]
    text = f"{found[0]['value']:.{digits}f}"
    return text if math.isnan(error) else f"{text} ± {error:.{digits}f}"


def ratios(rows, part):
    counts = sorted({row["n"] for row in select(rows, part=part, quantity="iterations over vcm's")})
    last = counts[-1]
    names = (["scene"] + [f"iterations, {n:.0f}" for n in counts[-3:]] +
             ["CPU seconds", "of an iteration", "error", "squared error", "iterations, squared error"])
    lines = []
    for scene in unique(rows, "problem", part=part):
        wanted = {"part": part, "problem": scene, "method": "vcmplus"}
        line = [scene] + [cell(rows, n=n, quantity="iterations over vcm's", **wanted) for n in counts[-3:]]
        for quantity in ("CPU seconds over vcm's", "CPU seconds of an iteration over vcm's", "error over vcm's",
                         "error over vcm's, squared error", "iterations over vcm's, squared error"):
            line.append(cell(rows, n=last, quantity=quantity, **wanted))
        lines.append(line)
    return table(names, lines)


def states(rows):
    last = max(row["n"] for row in select(rows, part="table"))
    lines = []
    for scene in unique(rows, "problem", part="table"):
        wanted = {"part": "table", "problem": scene, "n": last}
        reference = value(rows, part="reference", problem=scene, quantity="relative error")
        error = value(rows, quantity="relative error", method="vcm", **wanted)
        lines.append([scene] +
                     [cell(rows, method="vcmplus", quantity=quantity, **wanted)
                      for quantity in ("share of pixels shrunk", "median radius")] +
                     [cell(rows, method=method, quantity="share of merging", **wanted)
                      for method in ("vcm", "vcmplus")] +
                     [cell(rows, part="cost", problem=scene, quantity="CPU seconds at equal radii over vcm's"),
                      f"{reference / error:.2f}"])
    return table(["scene", "pixels shrunk", "median radius", "merging of vcm", "of vcmplus",
                  "CPU seconds at equal radii", "noise of a reference over vcm's error"], lines)


def parameters(rows):
    scenes = unique(rows, "problem", part="parameters")
    lines = [[method] + [cell(rows, part="parameters", problem=scene, method=method, quantity="error over vcm's")
                         for scene in scenes] for method in unique(rows, "method", part="parameters")]
    return table(["error over vcm's"] + scenes, lines)


def tables(rows):
    last = max(row["n"] for row in select(rows, part="table"))
    text = ("Ratios of `vcmplus` over `vcm`: medians over seeds ± standard errors. `iterations, n`: to the relative error "
            f"that `vcm` has after n; the other columns for n = {last:.0f}. Relative errors are squared, each pixel's over "
            "its own squared luminance plus 1 % of the squared mean; squared errors over the squared mean alone.\n\n" +
            ratios(rows, "table") + f"State after {last:.0f} iterations:\n\n" + states(rows))
    for part in unique(rows, "part"):
        if part.endswith("first disc"):
            text += part + ":\n\n" + ratios(rows, part)
    if select(rows, part="parameters"):
        n = select(rows, part="parameters")[0]["n"]
        text += f"Parameters, after {n:.0f} iterations:\n\n" + parameters(rows)
    return text
