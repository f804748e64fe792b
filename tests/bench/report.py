#!/usr/bin/env python3
"""Makes one self-contained HTML page of what candela-bench measured: docs/bench.md says what is in it."""
import argparse
import csv
import html
import io
import math
import os
import sys

try:
    import numpy as np
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
except ImportError as missing:
    sys.exit(f"report.py: error: {missing.name} is missing (Debian: python3-numpy python3-matplotlib)")

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fits  # noqa: E402
from report_blocks import Heading, Note, Picture, Table, write_whole  # noqa: E402

SQUARED = ("relmse", "relmse_trimmed", "relmse_fixed")  # errors that are a variance and a squared bias
FIGURES = SQUARED + ("rmse", "smape", "flip")
TITLES = {"relmse": "relMSE", "relmse_trimmed": "relMSE, worst 0.1 % of pixels left out",
          "relmse_fixed": "relMSE, fixed floor", "rmse": "RMSE", "smape": "SMAPE", "flip": "HDR-FLIP"}
TIMES = {"cpu_seconds": "CPU seconds", "wall_seconds": "seconds", "units": "iterations"}
NUMBERS = ("seed", "units", "cpu_seconds", "wall_seconds", "reference_factor", "reference_relmse", "own_relmse",
           "rays", "eye_samples", "light_paths", "deltas", "delta_bytes", "peak_memory_bytes") + FIGURES
ALWAYS = ("seed", "units", "cpu_seconds", "wall_seconds")  # of the numbers those that no row can be without
OF_A_SCENE = ("width", "height", "scene_hash", "reference_hash")  # what its rows have in common
OF_A_CURVE = ("integrator", "settings", "threads")
NEEDED = ("scene", "variant", "truth", "command", "run", "version", "build_id", "cpu", "cores",
          "memory_bytes", "load_at_start", "started") + OF_A_SCENE + OF_A_CURVE + NUMBERS


class BadInput(Exception):
    pass


def number(text, file, line, column):
    if text == "":
        return math.nan
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"{file}:{line}: '{text}' in column {column} is not a number") from None


def read_csv(file, needed):
    """Lines of a CSV file as dictionaries, each with '_where' for messages."""
    try:
        with open(file, newline="", encoding="utf-8-sig") as stream:  # spreadsheets write a byte order mark
            reader = csv.DictReader(stream, strict=True)
            missing = [c for c in needed if c not in (reader.fieldnames or [])]
            if missing:
                raise BadInput(f"{file}:1: no column {missing[0]}")
            lines = []
            for line in reader:
                if None in line or None in line.values():
                    raise BadInput(f"{file}:{reader.line_num}: as many cells as columns are wanted")
                line["_where"] = (file, reader.line_num)
                lines.append(line)
            return lines
    except OSError as error:
        raise BadInput(f"{file}: {error.strerror}") from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: not CSV: {error}") from None


def read_rows(sources):
    """All rows of folders or CSV files. Where several sources have a variant, it carries its source's name."""
    rows = []
    for source in sources:
        file = os.path.join(source, "rows.csv") if os.path.isdir(source) else source
        for row in read_csv(file, NEEDED):
            for column in NUMBERS:
                row[column] = number(row[column], *row["_where"], column)
            if row["truth"] not in ("good", "noisy", "unknown"):
                raise BadInput(f"{row['_where'][0]}:{row['_where'][1]}: '{row['truth']}' in column truth is none "
                               "of good, noisy, unknown")
            for column in ALWAYS:
                if not (math.isfinite(row[column]) and row[column] >= 0):
                    raise BadInput(f"{row['_where'][0]}:{row['_where'][1]}: column {column} must be a number, "
                                   "not below 0")
            row["_folder"] = os.path.dirname(file)
            row["_source"] = source
            rows.append(row)
    if not rows:
        raise BadInput(f"{sources[0]}: no rows")
    names = source_names(sources)
    for key in {(r["scene"], r["variant"]) for r in rows}:
        mine = [r for r in rows if (r["scene"], r["variant"]) == key]
        if len({r["_source"] for r in mine}) > 1:
            for row in mine:
                row["variant"] += " of " + names[row["_source"]]
    one_run_a_curve(rows)
    return rows


def source_names(sources):
    """What tells the sources apart: their last folders, as few as that takes."""
    files = [os.path.realpath(os.path.join(s, "rows.csv") if os.path.isdir(s) else s) for s in sources]
    if len(set(files)) < len(files):
        raise BadInput("the same rows are given twice")
    for depth in range(1, 64):
        names = {s: "/".join(os.path.abspath(s).split(os.sep)[-depth:]) for s in sources}
        if len(set(names.values())) == len(sources):
            break
    return names


def one_run_a_curve(rows):
    """Refuses rows of which a curve would be made of several experiments."""
    first, seen = {}, {}
    for row in rows:
        here = f"{row['_where'][0]}:{row['_where'][1]}"
        curve = (row["scene"], row["variant"])
        for name, columns in ((curve[:1], OF_A_SCENE), (curve, OF_A_CURVE)):
            other = first.setdefault(name, row)
            for column in columns:
                if row[column] != other[column]:
                    raise BadInput(f"{here}: {row['variant']} on {row['scene']} has another {column} than in "
                                   f"{other['_where'][0]}:{other['_where'][1]}: give one of them another name")
        point = curve + (row["seed"], row["units"])
        if point in seen:
            raise BadInput(f"{here}: the row of {row['variant']} on {row['scene']}, seed {row['seed']:.0f}, after "
                           f"{row['units']:.0f} units stands in {seen[point]}, too")
        seen[point] = here


def read_peers(file):
    peers = read_csv(file, ("scene", "name", "seconds", "error"))
    for peer in peers:
        for column in ("seconds", "error"):
            peer[column] = number(peer[column], *peer["_where"], column)
            if not (peer[column] > 0 and math.isfinite(peer[column])):
                raise BadInput(f"{file}:{peer['_where'][1]}: {column} must be above 0, and finite")
        peer["figure"] = peer.get("figure") or "relmse"
        if peer["figure"] not in FIGURES:
            raise BadInput(f"{file}:{peer['_where'][1]}: unknown figure '{peer['figure']}' "
                           f"(there is {', '.join(FIGURES)})")
    return peers


def plain(name):
    """For matplotlib, to which dollars are the ends of a formula."""
    return name.replace("$", r"\$")


def in_order(values):
    return list(dict.fromkeys(values))


class Curves:
    """The rows of one scene: (times, errors) by variant and seed. Rows whose reference is too noisy are kept
    apart: they are drawn as crosses and enter no line, fit or table."""

    def __init__(self, rows, figure, time):
        self.good, self.noisy, self.unknown = {}, {}, set()
        for row in sorted(rows, key=lambda r: r["units"]):
            if not row[figure] > 0:  # nothing that a logarithm could show, or not known
                continue
            into = self.noisy if row["truth"] == "noisy" else self.good
            if row["truth"] == "unknown":
                self.unknown.add(row["variant"])
            times, errors = into.setdefault(row["variant"], {}).setdefault(row["seed"], ([], []))
            times.append(row[time])
            errors.append(row[figure])

    def seeds(self, variant):
        return list(self.good.get(variant, {}).values())


def picture(name, figure):
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, bbox_inches="tight")
    pyplot.close(figure)
    return Picture(safe(name), data.getvalue())


def plot(scene, variants, curves, peers, figure, time, colours):
    if not curves.good and not curves.noisy:
        return Note(f"{TITLES[figure]}: no row has one above 0.")
    drawing, axes = pyplot.subplots(figsize=(7, 4.6))
    for variant in variants:
        colour = colours[variant]
        seeds = curves.seeds(variant)
        label = plain(variant) + (" (reference's error unknown)" if variant in curves.unknown else "")
        band = fits.quartiles(seeds)
        if band is not None:
            grid, low, median, high = band
            axes.fill_between(grid, low, high, color=colour, alpha=0.2, linewidth=0)
            axes.plot(grid, median, color=colour, label=label)
            label = None
        for times, errors in seeds:
            axes.plot(times, errors, ".", color=colour, markersize=3, label=label)
            label = None
        for times, errors in curves.noisy.get(variant, {}).values():
            axes.plot(times, errors, "x", color=colour, markersize=4, alpha=0.5, label=label)
            label = None
    styles = ("--", "-.", ":")
    mine = [p for p in peers if p["scene"] == scene and p["figure"] == figure]
    for i, name in enumerate(in_order(p["name"] for p in mine) if time == "cpu_seconds" else []):
        line = sorted((p["seconds"], p["error"]) for p in mine if p["name"] == name)
        axes.plot(*zip(*line), styles[i % 3], color="black", marker="o", markersize=3, linewidth=1,
                  alpha=0.4 + 0.6 / (1 + i // 3), label=plain(name))
    axes.set(xscale="log", yscale="log", xlabel=TIMES[time], ylabel=TITLES[figure], title=plain(scene))
    axes.grid(True, which="both", alpha=0.25)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    return picture(f"error-{scene}-{figure}", drawing)


def slopes(variants, curves, figure):
    header = ["", f"seeds", f"exponent of {TITLES[figure]}"]
    if figure in SQUARED:
        header.append("floor F of V / t + F")
    lines = []
    for variant in variants:
        seeds = curves.seeds(variant)
        fitted = fits.slope_over_seeds(seeds)
        line = [variant, fitted.count, fitted.text()]
        if figure in SQUARED:
            floor = fits.floor_over_seeds(seeds)
            seen = floor.count > 1 and floor.mean - floor.half > 0
            line.append(floor.text() + ("" if floor.count < 2 else ": above 0" if seen else ": none seen"))
        lines.append(line)
    return Table(header, lines)


def targets_of(curves, baseline):
    """Three errors that the baseline's median reaches, from early to late."""
    band = fits.quartiles(curves.seeds(baseline))
    if band is None:
        return []
    _, _, median, _ = band
    high, low = median[0], median[-1]
    return [10 ** (math.log10(high) + share * math.log10(low / high)) for share in (0.4, 0.7, 0.98)] \
        if low < high else []


def ratios(variants, curves, baseline, targets):
    """Time of each variant over the baseline's, by seed where both have it: median (quartiles)."""
    lines = []
    for variant in variants:
        line = [variant]
        for target in targets:
            mine, theirs = curves.good.get(variant, {}), curves.good[baseline]
            times = {s: fits.time_to(target, *c) for s, c in mine.items()}
            base = {s: fits.time_to(target, *c) for s, c in theirs.items()}
            both = [times[s] / base[s] for s in times
                    if s in base and math.isfinite(times[s]) and math.isfinite(base[s])]
            if not both:
                line.append("not within the rows")
                continue
            low, median, high = np.percentile(both, [25, 50, 75])
            missing = len(times) - len(both)
            line.append(f"{median:.3g} ({low:.3g} to {high:.3g})" + (f", {missing} seeds not" if missing else ""))
        lines.append(line)
    return Table([f"time over {baseline}'s to"] + [f"{t:.2g}" for t in targets], lines)


def read_image(folder, name):
    file = os.path.join(folder, "images", name + ".npy")
    if not os.path.exists(file):
        return None
    try:
        image = np.load(file, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise BadInput(f"{file}: not an image: {error}") from None
    if image.ndim != 3 or image.shape[2] != 3:
        raise BadInput(f"{file}: not an image: its shape is {image.shape}")
    return image.astype(float)


def shown(image):
    """sRGB of an image whose 95th percentile becomes white."""
    white = max(np.percentile(image, 95), 1e-12)
    linear = np.clip(np.nan_to_num(image / white), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def error_images(scene, rows, variants):
    """Of each variant's lowest seed, after its last unit: the picture and the root of its relMSE terms."""
    reference = None
    pictures = []
    for variant in variants:
        mine = [r for r in rows if r["variant"] == variant]
        seed = min(r["seed"] for r in mine)
        last = max((r for r in mine if r["seed"] == seed), key=lambda r: r["units"])
        reference = read_image(last["_folder"], "reference-" + safe(scene)) if reference is None else reference
        image = read_image(last["_folder"], last["run"])
        if image is not None and reference is not None and image.shape == reference.shape:
            pictures.append((f"{variant}: {last['units']:.0f} iterations, {last['cpu_seconds']:.3g} s", image))
    if reference is None or not pictures:
        return Note("No images beside these rows.")
    floor = 0.01 * reference.mean() ** 2
    columns = 1 + len(pictures)
    height = 3.2 * reference.shape[0] / reference.shape[1] + 0.4
    drawing, axes = pyplot.subplots(2, columns, figsize=(3.2 * columns, 2 * height), squeeze=False)
    axes[0][0].imshow(shown(reference))
    axes[0][0].set_title("reference", fontsize=8)
    axes[1][0].axis("off")
    for i, (title, image) in enumerate(pictures, start=1):
        terms = ((image - reference) ** 2 / np.maximum(reference ** 2 + floor, 1e-300)).mean(axis=2)
        axes[0][i].imshow(shown(image))
        axes[0][i].set_title(plain(title), fontsize=8)
        drawn = axes[1][i].imshow(np.sqrt(np.maximum(np.nan_to_num(terms, posinf=1e6), 1e-12)), cmap="inferno",
                                  norm=matplotlib.colors.LogNorm(vmin=1e-3, vmax=1))
    drawing.colorbar(drawn, ax=axes[1][0], fraction=0.3, label="relative error of a pixel")
    for axis in axes.flat:
        axis.set_xticks([])
        axis.set_yticks([])
    return picture(f"error-{scene}-images", drawing)


def safe(text):
    """File names as candela-bench makes them of names, by bytes."""
    return "".join(chr(b) if b < 128 and (chr(b).isalnum() or chr(b) in "-.") else "_" for b in text.encode())


def costs(rows, variants):
    lines = []
    for variant in variants:
        last = {}
        for row in sorted((r for r in rows if r["variant"] == variant), key=lambda r: r["units"]):
            last[row["seed"]] = row
        def middle(value):
            values = [v for v in map(value, last.values()) if math.isfinite(v)]
            return f"{np.median(values):.3g}" if values else "-"
        lines.append([variant, middle(lambda r: r["units"]), middle(lambda r: r["cpu_seconds"]),
                      middle(lambda r: r["cpu_seconds"] / r["wall_seconds"] if r["wall_seconds"] else math.nan),
                      middle(lambda r: 1e-6 * r["rays"] / r["cpu_seconds"] if r["cpu_seconds"] else math.nan),
                      middle(lambda r: r["delta_bytes"] / r["deltas"] / 1e3 if r["deltas"] else math.nan),
                      middle(lambda r: r["peak_memory_bytes"] / 1e6)])
    return Table(["at its last row (medians over seeds)", "iterations", "CPU s", "CPU s / wall s", "M rays / CPU s",
                  "kB a delta", "peak MB"], lines)


def machines(rows):
    seen = in_order((r["build_id"], r["cpu"], r["cores"], r["memory_bytes"], r["load_at_start"], r["started"])
                    for r in rows)
    return Table(["build", "CPU", "cores", "memory, bytes", "load at start", "started"], seen)


def blocks(rows, peers, options):
    """The report, scene by scene."""
    variants_of_all = in_order(r["variant"] for r in rows)
    cycle = pyplot.rcParams["axes.prop_cycle"].by_key()["color"]
    colours = {v: cycle[i % len(cycle)] for i, v in enumerate(variants_of_all)}
    parts = []
    for scene in in_order(r["scene"] for r in rows):
        mine = [r for r in rows if r["scene"] == scene]
        variants = in_order(r["variant"] for r in mine)
        parts.append(Heading(scene))
        for figure in options.figures:
            curves = Curves(mine, figure, options.time)
            left_out = sum(len(t) for seeds in curves.noisy.values() for t, _ in seeds.values())
            parts.append(plot(scene, variants, curves, peers, figure, options.time, colours))
            if left_out:
                parts.append(Note(f"{left_out} rows (crosses) are left out of lines, fits and tables: "
                                  "the reference is not good enough for them."))
            parts.append(slopes(variants, curves, figure))
            baseline = options.baseline if options.baseline in variants else variants[0]
            targets = targets_of(curves, baseline) if curves.seeds(baseline) else []
            if targets and options.time != "units":
                parts.append(ratios(variants, curves, baseline, targets))
        parts.append(costs(mine, variants))
        parts.append(error_images(scene, mine, variants))
    return parts


def page(parts, rows, options):
    commands = in_order(r["command"] for r in sorted(rows, key=lambda r: -r["units"]))
    return f"""<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(options.title)}</title>
<style>body{{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em}}img{{max-width:100%}}
table{{border-collapse:collapse;margin:.6em 0 1.4em;font-size:90%}}td,th{{padding:.15em .8em;border-bottom:1px solid #ccc;
text-align:left}}.warning{{color:#a00}}pre{{white-space:pre-wrap;font-size:80%}}</style></head><body>
<h1>{html.escape(options.title)}</h1>
<p>Lines are medians over seeds, bands quartiles. An exponent is the mean over seeds of a least-squares line through log error
over log {TIMES[options.time]}, with Student's 95 % interval over seeds. Ratios are medians (quartiles) over seeds; below 1 is
faster. False colour: root of the mean relative squared error of a pixel, of the lowest seed.</p>
{''.join(part.html() for part in parts)}<h2>Measured with</h2>{machines(rows).html()}
<details><summary>Commands: each makes its row again</summary><pre>{html.escape(chr(10).join(commands))}</pre></details>
</body></html>
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="+", help="folders of candela-bench run --out, or CSV files of rows")
    parser.add_argument("--out", default="report.html", help="default: report.html")
    parser.add_argument("--markdown", metavar="FILE", help="the same in Markdown, with its pictures in FILE's folder under "
                        "figures/; without the machines and commands")
    parser.add_argument("--title", default="Error over time")
    parser.add_argument("--figures", default="relmse,relmse_trimmed,flip",
                        help="of " + ", ".join(FIGURES) + "; default: %(default)s")
    parser.add_argument("--time", choices=list(TIMES), default="cpu_seconds", help="the abscissa")
    parser.add_argument("--baseline", help="the variant others are compared with; default: a scene's first")
    parser.add_argument("--peers", help="CSV of other renderers' curves: scene,name,seconds,error[,figure]; "
                        "seconds are CPU seconds")
    options = parser.parse_args()
    options.figures = options.figures.split(",")
    try:
        for figure in options.figures:
            if figure not in FIGURES:
                raise BadInput(f"--figures: unknown '{figure}' (there is {', '.join(FIGURES)})")
        rows = read_rows(options.rows)
        peers = read_peers(options.peers) if options.peers else []
        scenes = in_order(r["scene"] for r in rows)
        if options.markdown and len(set(map(safe, scenes))) < len(scenes):
            raise BadInput("--markdown: the pictures of two scenes would have one name "
                           f"(there is {', '.join(scenes)})")
        for scene in in_order(p["scene"] for p in peers):
            if scene not in scenes:
                print(f"report.py: warning: {options.peers}: no rows of scene '{scene}'", file=sys.stderr)
        if options.baseline and all(r["variant"] != options.baseline for r in rows):
            raise BadInput(f"--baseline: no variant '{options.baseline}' "
                           f"(there is {', '.join(in_order(r['variant'] for r in rows))})")
        parts = blocks(rows, peers, options)
        write_whole(options.out, page(parts, rows, options))
        if options.markdown:
            pictures = (os.path.join(os.path.dirname(options.markdown), "figures"), "figures")
            write_whole(options.markdown, "".join(part.markdown(pictures) for part in parts))
    except BadInput as error:
        print(f"report.py: error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"report.py: error: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
