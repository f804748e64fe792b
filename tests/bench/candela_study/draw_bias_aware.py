"""Figure and tables of the study bias-aware."""
from matplotlib import pyplot

from draw import alpha_name, curve, table, value

PAPER = ("The balance heuristic ignores bias, so its error can lie arbitrarily far from the best one (Eq. 45). A "
         "bias-aware heuristic (Eq. 41), for a bias that is the same for every sample, keeps the gap below "
         "(1/min n_i - 1/sum n_i) mu^2 (Eq. 42). With a progressive radius of alpha = 2/3 the plain heuristic keeps a "
         "gap of the same order (Eq. 47 to 50).")
PROBLEMS = (("constant", "b = 0.2 everywhere"), ("hidden", "b = 0.2; a quarter for merging alone"),
            ("leak", "b = 1 on a tenth"), ("bump", "b = blur of a bump"), ("edge", "b = blur of an edge, 2D"))
FIXED = (("balance", "gap", "balance", "C0-"), ("bias-aware", "gap", "bias-aware, Eq. 41", "C1-"),
         ("bias-aware, constant b", "gap", "with the mean |b|", "C2-"), ("bound", "Eq. 42", "bound, Eq. 42", "k--"),
         ("bound", "with the terms left out", "bound with its missing terms", "k:"))


def figure(rows, _maps):
    result, axes = pyplot.subplots(2, 4, figsize=(17, 8))
    panels = list(axes.flat)
    for panel, (problem, what) in zip(panels, PROBLEMS):
        for method, quantity, label, style in FIXED:
            x, y, _ = curve(rows, part="fixed", problem=problem, method=method, quantity=quantity)
            shown = [(a, b) for a, b in zip(x, y) if b > 1e-13]
            panel.loglog(*zip(*shown), style, lw=1.4, label=label)
        panel.set_title(f"{problem}: {what}", fontsize=10)
        panel.set_xlabel("N samples of both")
        panel.set_ylabel("squared error - the best one")
    panels[0].legend(fontsize=7)

    for problem, _ in PROBLEMS:
        x, gap, _ = curve(rows, part="fixed", problem=problem, method="bias-aware", quantity="gap")
        _, bound, _ = curve(rows, part="fixed", problem=problem, method="bound", quantity="Eq. 42")
        panels[5].semilogx(x, [g / b for g, b in zip(gap, bound)], lw=1.4, label=problem)
    panels[5].axhline(1, color="k", ls="--", lw=1)
    panels[5].set_title("bias-aware gap over the bound of Eq. 42", fontsize=10)
    panels[5].set_xlabel("N samples of both")
    panels[5].legend(fontsize=7)

    for panel, problem in zip(panels[6:], ("constant", "hidden")):
        for k, alpha in enumerate((0.5, 2 / 3, 0.75, 0.9)):
            for method, style in (("balance", "-"), ("best", "--"), ("bound", ":")):
                x, y, _ = curve(rows, part="progressive", problem=problem, method=method, alpha=alpha,
                                quantity="Eq. 47" if method == "bound" else "squared error")
                panel.loglog(x, y, f"C{k}{style}", lw=1.4,
                             label=f"alpha = {alpha_name(alpha)}" if method == "balance" else None)
        panel.set_title(f"{problem}, progressive (-- best, .. Eq. 47)", fontsize=10)
        panel.set_xlabel("N iterations")
        panel.set_ylabel("squared error, balance")
        panel.legend(fontsize=7)
    for panel in panels:
        panel.grid(alpha=0.3)
    return result


def tables(rows):
    last = max(row["n"] for row in rows if row["part"] == "fixed")
    lines = []
    for problem, what in PROBLEMS:
        cells = [f"{problem}: {what}"]
        for method in ("best", "balance", "bias-aware", "bias-aware, constant b", "technique 1 alone"):
            error = value(rows, part="fixed", problem=problem, method=method, quantity="squared error", n=last)
            cells.append(f"{error * last:.3g}" if error == error else "-")
        gap = value(rows, part="fixed", problem=problem, method="bias-aware", quantity="gap", n=last)
        cells.append(f"{gap / value(rows, part='fixed', problem=problem, method='bound', quantity='Eq. 42', n=last):.2g}")
        lines.append(cells)
    text = f"N times squared error at N = {last:.0f} (mu = 1):\n\n"
    text += table(["bias", "best", "balance", "bias-aware", "mean &#124;b&#124;", "technique 1 alone", "gap / Eq. 42"],
                  lines)

    quantities = ("share beyond Eq. 42", "largest gap over Eq. 42",
                  "largest gap over the bound with the terms left out")
    counts = sorted({row["n"] for row in rows if row["part"] == "random"})
    text += "Random problems of eight cells, one b for all cells, bias-aware weights:\n\n"
    text += table(["N"] + list(quantities),
                  [[f"{n:.0f}"] + [f"{value(rows, part='random', method='bias-aware', quantity=q, n=n):.3g}"
                                   for q in quantities] for n in counts])

    last = max(row["n"] for row in rows if row["part"] == "progressive")
    text += f"Progressive radii, squared error at N = {last:.0f} iterations:\n\n"
    lines = []
    for problem in ("constant", "hidden"):
        for alpha in (0.5, 2 / 3, 0.75, 0.9):
            def at(method, quantity, n=last):
                return value(rows, part="progressive", problem=problem, method=method, alpha=alpha, n=n,
                             quantity=quantity)
            lines.append([problem, alpha_name(alpha)] +
                         [f"{at(m, 'squared error'):.3g}" for m in ("best", "bias-aware", "balance")] +
                         [f"{at('balance', 'bias')**2 / at('balance', 'squared error'):.2f}",
                          f"{at('balance', 'gap') / at('bound', 'Eq. 47'):.3g}"])
    return text + table(["problem", "alpha", "best", "bias-aware", "balance", "its share of bias", "gap / Eq. 47"], lines)
