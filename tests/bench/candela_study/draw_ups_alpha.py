"""Figure and tables of the study ups-alpha."""
import math

from matplotlib import pyplot

from draw import alpha_name, curve, table, value

PAPER = ("Variance of the mean of N iterations falls as N^-alpha and bias as N^(alpha-1) (Eq. 46), so that alpha = 2/3 "
         "balances variance and squared bias; Fig. 1 shows RMS errors of a torus scene, lowest at 2/3.")
RATES = (0.5, 2 / 3, 0.75, 0.9)


def counts_of(rows):
    return sorted({row["n"] for row in rows if row["part"] == "scene" and row["method"] == "theory"})


def figure(rows, _maps):
    result, axes = pyplot.subplots(2, 3, figsize=(15, 8.5))
    counts = counts_of(rows)
    for panel, method in zip(axes[0], ("ppm", "vcm")):
        for k, n in enumerate(counts):
            x, squares, _ = curve(rows, over="alpha", part="scene", method=method, n=n, quantity="squared error")
            errors = [math.sqrt(max(s, 0)) for s in squares]
            color = pyplot.cm.viridis(0.9 * k / max(1, len(counts) - 1))
            panel.semilogy(x, errors, "o-", ms=3, color=color, label=f"N = {n:.0f}")
            best = min(range(len(x)), key=lambda i: errors[i])
            panel.semilogy([x[best]], [errors[best]], "o", ms=9, mfc="none", color=color)
        panel.axvline(2 / 3, color="grey", ls=":", lw=1)
        panel.set_title(f"torus, {method}: RMS error / mean")
        panel.set_xlabel("alpha (dotted: 2/3; circles: the smallest)")

    panel = axes[0][2]
    largest = max(row["n"] for row in rows if row["part"] == "toy" and row["method"] == "exact")
    for k, (field, n) in enumerate((f, n) for f in ("quad", "step") for n in (64.0, 4096.0, largest)):
        x, squares, _ = curve(rows, over="alpha", part="toy", method="exact", problem=field, n=n,
                              quantity="squared error")
        if x:
            panel.semilogy(x, [math.sqrt(s) for s in squares], "o-" if field == "quad" else "s--", ms=3,
                           color=f"C{k % 3}", label=f"{field}, N = {n:.0f}")
    panel.axvline(2 / 3, color="grey", ls=":", lw=1)
    panel.set_title("one pixel, exact: RMS error")
    panel.set_xlabel("alpha")

    for panel, method in zip(axes[1], ("ppm", "vcm")):
        for k, alpha in enumerate(RATES):
            x, y, e = curve(rows, part="scene", method=method, alpha=alpha, quantity="variance")
            if not x:
                continue
            panel.errorbar(x, y, [0 if s != s else s for s in e], fmt=f"C{k}o-", ms=3,
                           label=f"alpha = {alpha_name(alpha)}")
            panel.loglog(x, [y[-1] * (n / x[-1])**-alpha for n in x], f"C{k}--", lw=1)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_title(f"torus, {method}: variance, dashed N^-alpha")
        panel.set_xlabel("N iterations")
    panel = axes[1][2]
    for k, alpha in enumerate(RATES):
        for method, style in (("ppm", "o"), ("vcm", "s")):
            x, y, e = curve(rows, part="scene", method=method, alpha=alpha, quantity="bias")
            shown = [(a, b, c) for a, b, c in zip(x, y, e) if b > 0 and not c > b]
            if shown:
                a, b, c = zip(*shown)
                panel.errorbar(a, b, [0 if s != s else s for s in c], fmt=f"C{k}{style}", ms=4,
                               label=f"{method}, alpha = {alpha_name(alpha)}")
        x, y, _ = curve(rows, part="scene", method="theory", alpha=alpha, quantity="bias")
        panel.loglog(x, y, f"C{k}--", lw=1)
    panel.set_title("torus: bias over that of the first radius, dashed the exact sum", fontsize=10)
    panel.set_xlabel("N iterations")
    for panel in axes.flat:
        panel.grid(alpha=0.3, which="both")
        panel.legend(fontsize=7)
    return result


def tables(rows):
    counts = counts_of(rows)
    alphas = sorted({row["alpha"] for row in rows if row["part"] == "scene" and row["method"] == "theory"})
    text = "RMS error over the mean of the torus; standard errors of the last column in brackets:\n\n"
    lines = []
    for alpha in alphas:
        cells = [alpha_name(alpha)]
        for method in ("ppm", "vcm"):
            _, squares, errors = curve(rows, part="scene", method=method, alpha=alpha, quantity="squared error")
            roots = [math.sqrt(max(s, 0)) for s in squares]
            cells += [f"{root:.4f}" for root in roots]
            if errors and errors[-1] == errors[-1] and roots[-1] > 0:
                cells[-1] += f" ({errors[-1] / (2 * roots[-1]):.4f})"
        lines.append(cells)
    text += table(["alpha"] + [f"{m}, N = {n:.0f}" for m in ("ppm", "vcm") for n in counts], lines)

    text += (f"Slopes from N = {counts[max(0, len(counts) - 3)]:.0f} to {counts[-1]:.0f} (exact: of the sums of the "
             "radii over the same range; limit: -alpha and alpha - 1):\n\n")
    lines = []
    for alpha in alphas:
        cells = [alpha_name(alpha)]
        for quantity, limit in (("variance", -alpha), ("bias", alpha - 1)):
            for method in ("ppm", "vcm"):
                _, slopes, errors = curve(rows, part="scene", method=method, alpha=alpha,
                                          quantity="slope of " + quantity)
                known = slopes and errors[0] == errors[0] and errors[0] < 0.15
                cells.append(f"{slopes[0]:.2f} ± {errors[0]:.2f}" if known else "-")
            exact = value(rows, part="scene", method="theory", alpha=alpha, quantity="slope of " + quantity)
            cells += [f"{exact:.2f}", f"{limit:.2f}"]
        lines.append(cells)
    text += table(["alpha", "variance, ppm", "vcm", "exact", "limit", "bias, ppm", "vcm", "exact", "limit"], lines)

    worst, count = 0.0, 0
    for row in rows:
        if row["part"] != "toy" or row["method"] != "simulated" or not row["standard_error"] > 0:
            continue
        exact = value(rows, part="toy", method="exact", problem=row["problem"], alpha=row["alpha"], n=row["n"],
                      quantity=row["quantity"])
        if exact == exact:
            worst, count = max(worst, abs(row["value"] - exact) / row["standard_error"]), count + 1
    return text + (f"One pixel: of {count} simulated biases and variances the one farthest from the exact sum is "
                   f"{worst:.1f} standard errors away.\n")
