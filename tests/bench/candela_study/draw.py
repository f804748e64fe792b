#!/usr/bin/env python3
"""Draws the figure of a study and writes its page from its CSV file.

    draw.py DIR/NAME.csv    writes DIR/NAME.png and DIR/NAME.md

A study NAME has a module draw_NAME.py ("-" becomes "_") with PAPER, the words on what the paper says, and two
functions: figure(rows, maps) returns a matplotlib figure, tables(rows) Markdown. A third, more_figures(rows, maps),
may return further figures by name, which become DIR/NAME-FIGURE.png. The maps are those of DIR/NAME-maps.csv, by name,
as lists of rows of numbers.
"""
import csv
import importlib
import math
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
COLUMNS = ["part", "problem", "method", "alpha", "n", "quantity", "value", "standard_error"]


class BadInput(Exception):
    pass


def read(path):
    """The head as a dictionary, and the rows with numbers as floats (NaN if empty)."""
    head, lines = {}, []
    try:
        with open(path, encoding="utf-8", newline="") as stream:
            for line in stream:
                if line.startswith("# ") and not lines:
                    key, _, value = line[2:].rstrip("\n").partition(": ")
                    head[key] = value
                else:
                    lines.append(line)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from None
    reader = csv.DictReader(lines, strict=True)
    if reader.fieldnames != COLUMNS:
        raise BadInput(f"{path}: the columns are not {', '.join(COLUMNS)}")
    rows = []
    for row in reader:
        for name in ("alpha", "n", "value", "standard_error"):
            row[name] = float(row[name]) if row[name] else math.nan
        rows.append(row)
    return head, rows


def read_maps(path):
    """Maps by name; none if there is no such file."""
    maps = {}
    if os.path.exists(path):
        csv.field_size_limit(1 << 28)
        with open(path, encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream, strict=True):
                width, values = int(row["width"]), [float(v) for v in row["values"].split()]
                if len(values) != width * int(row["height"]):
                    raise BadInput(f"{path}: map {row['name']} has {len(values)} values")
                maps[row["name"]] = [values[i:i + width] for i in range(0, len(values), width)]
    return maps


def select(rows, **wanted):
    """Rows whose columns have these values; an alpha or n within rounding."""
    def fits(row):
        return all(math.isclose(row[k], v, rel_tol=1e-6) if isinstance(v, float) else row[k] == v
                   for k, v in wanted.items())
    return [row for row in rows if fits(row)]


def curve(rows, over="n", **wanted):
    """(x, value, standard error), sorted by x."""
    found = sorted(select(rows, **wanted), key=lambda row: row[over])
    return [row[over] for row in found], [row["value"] for row in found], [row["standard_error"] for row in found]


def value(rows, **wanted):
    found = select(rows, **wanted)
    return found[0]["value"] if found else math.nan


def alpha_name(alpha):
    for name, fraction in (("1/2", 0.5), ("2/3", 2 / 3), ("3/4", 0.75), ("9/10", 0.9)):
        if abs(alpha - fraction) < 1e-6:
            return name
    return f"{alpha:.2g}"


def table(names, lines):
    text = "| " + " | ".join(names) + " |\n|" + "---|" * len(names) + "\n"
    return text + "".join("| " + " | ".join(line) + " |\n" for line in lines) + "\n"


def page(head, paper, tables, figures=()):
    name = head["study"]
    pictures = "".join(f"![{file}]({file}.png)\n\n" for file in [name] + [f"{name}-{figure}" for figure in figures])
    return (f"# {name}: {head['summary']}\n\n{pictures}    {head['command']}\n\n"
            f"**The paper** ({head['source']}). {paper}\n\n**Run**: seeds {head['seeds']}, "
            f"{head['cpu_seconds']} CPU seconds on one {head['cpu']} ({head['cores']} cores), commit "
            f"{head['commit'][:12] or 'unknown'}, build {head['build']}.\n\n{tables}")


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: draw.py DIR/NAME.csv")
    path = sys.argv[1]
    try:
        import matplotlib
        matplotlib.use("Agg")
    except ImportError:
        sys.exit("draw.py: error: matplotlib is missing (Debian: python3-matplotlib)")
    try:
        head, rows = read(path)
        maps = read_maps(os.path.splitext(path)[0] + "-maps.csv")
        sys.path.insert(0, HERE)
        study = importlib.import_module("draw_" + head.get("study", "").replace("-", "_"))
    except (BadInput, ImportError) as error:
        sys.exit(f"draw.py: error: {error}")
    base = os.path.splitext(path)[0]
    more = study.more_figures(rows, maps) if hasattr(study, "more_figures") else {}
    figures = {base: study.figure(rows, maps), **{f"{base}-{name}": drawn for name, drawn in more.items()}}
    for path, figure in figures.items():
        if not figure.get_constrained_layout():
            figure.tight_layout()
        figure.savefig(path + ".png", dpi=80)
    with open(base + ".md", "w", encoding="utf-8") as stream:
        stream.write(page(head, study.PAPER, study.tables(rows), more))
    print("".join(path + ".png\n" for path in figures) + base + ".md")


if __name__ == "__main__":
    main()
