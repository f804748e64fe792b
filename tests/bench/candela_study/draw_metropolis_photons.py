"""Figure and tables of the study metropolis-photons."""
import matplotlib.pyplot as plt
from draw import curve, value

PAPER = ("[Hachisuka 2011] spreads photons that are visible over a Markov chain. `mcppm` has chains that begin and end in an "
         "iteration, so that its expectation is that of `ppm`.")
METHODS = ["vcm", "mcppm", "mcppm, 4 mutations a path", "mcppm, 16 mutations a path"]
PROBLEMS = {"patch": "half width of the floor"}


def gains(rows, problem, method):
    """(visible fraction, variance x seconds of ppm over that of the method), by falling fraction."""
    sizes = curve(rows, problem=problem, method="ppm", quantity="variance x seconds")[0]
    points = []
    for size in sizes:
        fraction = value(rows, problem=problem, method="mcppm", n=size, quantity="visible fraction")
        of_ppm = value(rows, problem=problem, method="ppm", n=size, quantity="variance x seconds")
        own = value(rows, problem=problem, method=method, n=size, quantity="variance x seconds")
        points.append((fraction, of_ppm / own, size))
    return sorted(points, reverse=True)


def problems(rows):
    return [p for p in PROBLEMS if any(row["problem"] == p for row in rows)]


def figure(rows, _maps):
    names = problems(rows)
    result, axes = plt.subplots(1, len(names), figsize=(5 * len(names), 4), squeeze=False, layout="constrained")
    for axis, problem in zip(axes[0], names):
        for method in METHODS:
            points = gains(rows, problem, method)
            axis.loglog([p[0] for p in points], [p[1] for p in points], marker="o", label=method)
        axis.axhline(1, color="gray", linewidth=0.8)
        axis.set_title(problem)
        axis.set_xlabel("visible fraction of light paths")
        axis.set_ylabel("gain over ppm in equal time")
        axis.legend()
    return result


def tables(rows):
    text = ""
    for problem in problems(rows):
        text += f"\n| {problem}: {PROBLEMS[problem]} | visible fraction | acceptance | " + " | ".join(METHODS) + " |\n"
        text += "|---" * (3 + len(METHODS)) + "|\n"
        columns = {method: {p[2]: p[1] for p in gains(rows, problem, method)} for method in METHODS}
        for fraction, _, size in gains(rows, problem, "mcppm"):
            acceptance = value(rows, problem=problem, method="mcppm", n=size, quantity="acceptance")
            text += f"| {size:g} | {fraction:.2g} | {acceptance:.2f} | " + " | ".join(
                f"{columns[method][size]:.2g}" for method in METHODS) + " |\n"
    return text
