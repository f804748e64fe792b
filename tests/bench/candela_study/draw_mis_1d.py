"""Figures and tables of the study mis-1d."""
import math

from matplotlib import pyplot

from draw import curve, select, table, value

PAPER = ("Weights of multiple importance sampling that may be negative have the least variance there is; heuristics can "
         "lie far above it. Fig. 1 of the supplement draws the weights for two integrands: with a technique that follows "
         "the integrand (D1) and with one that does not (D2). Section 3: the regression of Owen and Zhou is the direct "
         "estimator; that of Fan et al. is inconsistent.")
LINES = ["D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8"]
STRATEGIES = ["balance", "power", "cutoff", "maximum", "best", "optimal"]
CONVERGENCE = ["D1", "D2", "D3", "D5", "D7", "R1 spherical+parallel", "R2 spherical+parallel", "R4 spherical+area",
               "R5 spherical+area", "L1 uniform+power", "L1 power+unshadowed", "L1 uniform+power+unshadowed"]
ESTIMATORS = (("balance", "k-"), ("direct, ridge 0", "C0:"), ("direct", "C0-"), ("crossfit", "C1-"),
              ("progressive", "C2-"), ("fan", "C3-"))


def count(maps, problem):
    return next(i for i in range(9) if f"{problem}, p{i + 1}" not in maps)


def figure(_rows, maps):
    result, axes = pyplot.subplots(len(LINES), 1 + len(STRATEGIES), figsize=(19, 2 * len(LINES)), sharex=True)
    for row, problem in enumerate(LINES):
        f = maps[f"{problem}, f"][0]
        x = [k / (len(f) - 1) for k in range(len(f))]
        panel = axes[row][0]
        panel.plot(x, f, "k-", lw=1.6, label="f")
        for i in range(count(maps, problem)):
            panel.plot(x, maps[f"{problem}, p{i + 1}"][0], f"C{i}-", lw=1, label=f"p{i + 1}")
        panel.set_ylim(0, 3.2)
        panel.set_ylabel(problem)
        panel.legend(fontsize=6)
        for column, strategy in enumerate(STRATEGIES):
            panel = axes[row][column + 1]
            for i in range(count(maps, problem)):
                panel.plot(x, maps[f"{problem}, {strategy} w{i + 1}"][0], f"C{i}-", lw=1.2)
            panel.axhline(0, color="k", lw=0.5)
            panel.set_ylim((-2.2, 3.2) if strategy == "optimal" else (-0.05, 1.05))
    for column, title in enumerate(["integrand and densities"] + STRATEGIES):
        axes[0][column].set_title(title, fontsize=10)
    return result


def more_figures(rows, maps):
    convergence, axes = pyplot.subplots(3, 4, figsize=(17, 11))
    for panel, problem in zip(axes.flat, CONVERGENCE):
        optimum = value(rows, part="variance", problem=problem, method="optimal", quantity="variance")
        balance = value(rows, part="variance", problem=problem, method="balance", quantity="variance")
        scale = optimum if optimum > 1e-12 * balance else balance
        for method, style in ESTIMATORS:
            x, y, _ = curve(rows, part="convergence", problem=problem, method=method,
                            quantity="squared error x batches")
            panel.loglog(x, [max(v / scale, 1e-6) for v in y], style, lw=1.4, label=method)
        for method, style in (("power", "0.6"), ("maximum", "0.8")):
            other = value(rows, part="variance", problem=problem, method=method, quantity="variance")
            if other == other:
                panel.axhline(other / scale, color=style, ls="--", lw=1, label=method)
        panel.set_ylim(1e-6 if scale != optimum else 0.5, None)
        panel.set_title(problem + ("" if scale == optimum else " (optimum 0: over balance)"), fontsize=10)
        panel.set_xlabel("batches T")
        panel.grid(alpha=0.3)
    axes[0][0].set_ylabel("T x squared error over the optimum")
    axes[0][0].legend(fontsize=7)

    lamps, axes = pyplot.subplots(2, 6, figsize=(16, 5.4), layout="constrained")
    for column in range(6):
        problem = f"R{column + 1} spherical+parallel"
        for row, strategy in enumerate(("balance", "optimal")):
            panel = axes[row][column]
            shown = panel.imshow(maps[f"{problem}, {strategy} w1"], origin="lower", cmap="RdBu", vmin=-1, vmax=2)
            panel.set_xticks([])
            panel.set_yticks([])
            panel.set_title(f"R{column + 1}, {strategy}", fontsize=9)
    lamps.colorbar(shown, ax=axes, label="weight of spherical beside parallel", shrink=0.8, extend="both")
    return {"convergence": convergence, "lamps": lamps}


def tables(rows):
    problems = []
    for row in select(rows, part="variance", quantity="integral"):
        problems.append(row["problem"])
    lines = []
    for problem in problems:
        def variance(method):
            return value(rows, part="variance", problem=problem, method=method, quantity="variance")
        integral = value(rows, part="variance", problem=problem, method="", quantity="integral")
        lines.append([problem, f"{integral:.7g}"] +
                     [f"{variance(m):.6g}" for m in STRATEGIES + ["best, all samples"]])
    text = "Variance of one batch, by quadrature:\n\n"
    text += table(["problem", "integral", *STRATEGIES, "best, all samples"], lines)

    last = max(row["n"] for row in rows if row["part"] == "convergence")
    text += f"Squared error times batches over the optimal variance (over that of balance where the optimum is 0), and in "
    text += f"brackets the bias in percent of the integral where it is more than 4 standard errors, after 16 and {last:.0f} batches:\n\n"
    lines = []
    for problem in problems:
        optimum = value(rows, part="variance", problem=problem, method="optimal", quantity="variance")
        balance = value(rows, part="variance", problem=problem, method="balance", quantity="variance")
        integral = value(rows, part="variance", problem=problem, method="", quantity="integral")
        scale = optimum if optimum > 1e-12 * balance else balance
        for batches in (16.0, last):
            cells = [problem, f"{batches:.0f}"]
            for method, _ in ESTIMATORS:
                found = select(rows, part="convergence", problem=problem, method=method, n=batches)
                by = {row["quantity"]: row for row in found}
                cell = f"{by['squared error x batches']['value'] / scale:.3g}"
                bias = by["bias"]
                if bias["standard_error"] > 0 and abs(bias["value"]) > 4 * bias["standard_error"] \
                        and abs(bias["value"]) > 1e-7 * integral and method not in ("balance",):
                    cell += f" ({100 * bias['value'] / integral:+.2g})"
                cells.append(cell)
            lines.append(cells)
    text += table(["problem", "T", *[method for method, _ in ESTIMATORS]], lines)

    worst = max(select(rows, part="regression"), key=lambda row: row["value"] if not math.isnan(row["value"]) else 0)
    text += (f"Owen and Zhou's regression by singular values: the largest difference from the direct estimator over all "
             f"problems and runs is {worst['value']:.1e} of the integral ({worst['problem']}, {worst['n']:.0f} batches).\n\n")

    text += "Fan et al., one batch of four samples of each of the first two techniques, lambda = 1:\n\n"
    lines = []
    for problem in ("D1", "D2", "D5"):
        cells = [problem]
        for method in ("without p2", "without p1", "without the intercept", "direct, ridge 0"):
            bias = select(rows, part="fan", problem=problem, method=method, quantity="relative bias")[0]
            spread = value(rows, part="fan", problem=problem, method=method, quantity="variance")
            cells.append(f"{100 * bias['value']:+.1f} ± {100 * bias['standard_error']:.1f} % ({spread:.3g})")
        cells.append(f"{value(rows, part='fan', problem=problem, method='optimal', quantity='variance'):.3g}")
        lines.append(cells)
    return text + table(["bias (variance)", "without p2", "without p1", "without the intercept",
                         "direct, ridge 0", "optimal variance"], lines)
