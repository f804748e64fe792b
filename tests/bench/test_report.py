#!/usr/bin/env python3
"""Tests of report.py, fits.py, guard.py and start_guard.py. Statistical ones state their false-alarm rate; seeds are fixed."""
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
try:
    import numpy as np
    import matplotlib  # noqa: F401
except ImportError as missing:
    # In the form that deploy/check lists skipped tests from.
    print(f"test_report.py: Skipped\n{missing.name} is missing\n[  SKIPPED ] bench_report (0 ms)")
    sys.exit(77)

sys.path.insert(0, HERE)
import fits  # noqa: E402
import guard  # noqa: E402
import report  # noqa: E402
import start_guard  # noqa: E402


def estimator_curves(generator, seeds, bias, exponent=1.0, values=400, doublings=9):
    """(N, squared error) of running means whose samples accumulate, as those of one render do: variance 1 a
    unit at exponent 1, and a squared bias. Errors of another exponent: variance N^-exponent."""
    units = 2.0 ** np.arange(doublings)
    curves = []
    for _ in range(seeds):
        steps = np.diff(np.concatenate([[0.0], units]))
        sums = np.cumsum(generator.standard_normal((doublings, values)) * np.sqrt(steps)[:, None], axis=0)
        means = sums / units[:, None] * units[:, None] ** ((1 - exponent) / 2) + bias
        curves.append((units, (means ** 2).mean(axis=1)))
    return curves


class Fits(unittest.TestCase):
    def test_student(self):
        # Tables: 0.975 quantiles.
        for freedom, quantile in ((1, 12.7062), (2, 4.30265), (7, 2.36462), (30, 2.04227)):
            self.assertAlmostEqual(fits.student_quantile(0.95, freedom), quantile, places=4)

    # Among 300 intervals of 95 %, all but 3 standard deviations of the count (3.8 each) hold the truth: the chance
    # that fewer than 270 do is below 2e-4, and that all 300 do 2e-7: an interval that is too wide is wrong too.
    def covered(self, interval_of, truth):
        generator = np.random.default_rng(1)
        held = sum(interval_of(generator).holds(truth) for _ in range(300))
        self.assertGreaterEqual(held, 270)
        self.assertLess(held, 300)

    def test_slope_of_pure_variance(self):
        self.covered(lambda g: fits.slope_over_seeds(estimator_curves(g, 8, 0)), -1)

    def test_slope_of_another_rate(self):
        self.covered(lambda g: fits.slope_over_seeds(estimator_curves(g, 5, 0, 2 / 3)), -2 / 3)

    def test_floor_of_a_bias(self):
        # V = 1, bias^2 = 0.01: reached at N = 100 of 256.
        self.covered(lambda g: fits.floor_over_seeds(estimator_curves(g, 8, 0.1, values=800)), 0.01)

    def test_no_floor_where_there_is_none(self):
        self.covered(lambda g: fits.floor_over_seeds(estimator_curves(g, 8, 0, values=800)), 0)

    def test_a_floor_is_not_taken_for_a_slope(self):
        slope = fits.slope_over_seeds(estimator_curves(np.random.default_rng(2), 8, 0.1))
        self.assertGreater(slope.mean - slope.half, -0.9)

    def test_time_to_target(self):
        times = [1, 2, 4, 8]
        self.assertAlmostEqual(fits.time_to(0.3, times, [1, 0.5, 0.25, 0.125]), 2 * 0.5 / 0.3, places=9)
        # For good: after a firefly.
        self.assertAlmostEqual(fits.time_to(0.3, times, [0.2, 0.6, 0.6, 0.15]), 8 / math.sqrt(2) ** 0 / 2 * 2 ** 0.5,
                               places=9)
        self.assertTrue(math.isnan(fits.time_to(0.1, times, [1, 0.5, 0.25, 0.125])))
        self.assertTrue(math.isnan(fits.time_to(2, times, [1, 0.5, 0.25, 0.125])))

    def test_few_points(self):
        self.assertTrue(math.isnan(fits.slope([1, 2], [1, 0.5])))
        one = fits.slope_over_seeds([([1, 2, 4], [1, 0.5, 0.25])])
        self.assertAlmostEqual(one.mean, -1)
        self.assertTrue(math.isnan(one.half))
        self.assertIsNone(fits.quartiles([([1], [1])]))
        self.assertAlmostEqual(fits.slope([1, 2, 4, 8], [1, math.inf, 0.25, 0.125]), -1)


def rows_of(curves, variant, factor=math.inf, seconds_a_unit=0.5):
    rows = []
    for seed, (units, errors) in enumerate(curves, start=1):
        for n, error in zip(units, errors):
            row = dict.fromkeys(report.NEEDED, "1")
            row.update(scene="box", variant=variant, integrator=variant, seed=seed, units=int(n), cpu="a CPU",
                       cpu_seconds=n * seconds_a_unit, wall_seconds=n * seconds_a_unit, started="2026-11-21T20:00:00Z",
                       run=f"box-{variant}-{seed}-0123456789ab", truth="good" if error / 1e-9 < factor else "noisy", command=f"candela-bench run <{variant}>")
            for figure in report.FIGURES:
                row[figure] = error
            rows.append(row)
    return rows


class Report(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def write(self, name, rows, columns=None):
        with open(self.path(name), "w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, columns or list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        return self.path(name)

    def run_report(self, *arguments):
        return subprocess.run([sys.executable, os.path.join(HERE, "report.py"), *arguments], capture_output=True,
                              text=True, check=False)

    def error_of(self, *arguments):
        done = self.run_report(*arguments, "--out", self.path("never.html"))
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertFalse(os.path.exists(self.path("never.html")))
        return done.stderr

    def test_a_page_with_slopes_ratios_peers_and_images(self):
        generator = np.random.default_rng(3)
        # The second is the first at a quarter of the time for the same errors.
        curves = estimator_curves(generator, 4, 0)
        rows = rows_of(curves, "path") + rows_of(curves, "a<b", seconds_a_unit=0.125)
        file = self.write("rows.csv", rows)
        os.mkdir(self.path("images"))
        np.save(self.path("images/reference-box.npy"), np.ones((8, 9, 3), np.float32))
        np.save(self.path("images/box-path-1-0123456789ab.npy"), np.full((8, 9, 3), 1.1, np.float32))
        peers = self.write("peers.csv", [{"scene": "box", "name": "other", "seconds": 1, "error": 0.5},
                                         {"scene": "box", "name": "other", "seconds": 9, "error": 0.05}])
        os.mkdir(self.path("docs"))
        done = self.run_report(file, "--peers", peers, "--baseline", "path", "--out", self.path("r.html"),
                               "--markdown", self.path("docs/r.md"))
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.path("docs/r.md"), encoding="utf-8") as stream:
            text = stream.read()
        self.assertIn("| a<b | 0.25 (0.25 to 0.25) |", text)
        for picture in re.findall(r"\]\((figures/[^)]*)\)", text):
            self.assertTrue(os.path.isfile(self.path("docs/" + picture)), picture)
        self.assertEqual(text.count("]("), 4)
        with open(self.path("r.html"), encoding="utf-8") as stream:
            page = stream.read()
        self.assertEqual(page.count("data:image/png;base64,"), 4)  # three figures, and the error images
        self.assertIn("a&lt;b", page)
        self.assertNotIn("a<b", page)
        self.assertNotIn("src=\"http", page)
        ratio = re.search(r"<td>a&lt;b</td><td>([0-9.]+) \(([0-9.]+) to ([0-9.]+)\)", page)
        self.assertEqual(ratio.groups(), ("0.25", "0.25", "0.25"))
        self.assertIn("a CPU", page)
        self.assertIn("candela-bench run &lt;path&gt;", page)

    def test_rows_with_a_noisy_reference_are_in_no_line_and_no_fit(self):
        curves = [(2.0 ** np.arange(8), np.maximum(2.0 ** -np.arange(8), 0.02)) for _ in range(3)]
        rows = rows_of(curves, "path")
        for row in rows:
            row["truth"] = "noisy" if row["relmse"] <= 0.02 else "good"
        drawn = report.Curves(report.read_rows([self.write("rows.csv", rows)]), "relmse", "cpu_seconds")
        self.assertAlmostEqual(fits.slope_over_seeds(drawn.seeds("path")).mean, -1, places=9)
        done = self.run_report(self.path("rows.csv"), "--out", self.path("r.html"), "--figures", "relmse")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.path("r.html"), encoding="utf-8") as stream:
            self.assertIn("6 rows (crosses) are left out", stream.read())

    def test_bad_input_is_one_clear_error(self):
        good = rows_of(estimator_curves(np.random.default_rng(4), 2, 0), "path")
        self.assertIn("no-such.csv: No such file", self.error_of(self.path("no-such.csv")))
        bad = [dict(row) for row in good]
        bad[3]["relmse"] = "many"
        self.assertIn("bad.csv:5: 'many' in column relmse is not a number", self.error_of(self.write("bad.csv", bad)))
        bad[3].update(relmse="1", truth="maybe")
        self.assertIn("'maybe' in column truth", self.error_of(self.write("bad.csv", bad)))
        fewer = [c for c in good[0] if c != "flip"]
        self.assertIn("no column flip", self.error_of(
            self.write("fewer.csv", [{c: r[c] for c in fewer} for r in good], fewer)))
        self.assertIn("no rows", self.error_of(self.write("none.csv", [], list(good[0]))))
        with open(self.path("cut.csv"), "w", encoding="utf-8") as stream:
            stream.write(",".join(good[0]) + "\n1,2\n")
        self.assertIn("cut.csv:2: as many cells", self.error_of(self.path("cut.csv")))
        file = self.write("rows.csv", good)
        self.assertIn("--figures: unknown 'psnr'", self.error_of(file, "--figures", "psnr"))
        self.assertIn("--baseline: no variant 'x'", self.error_of(file, "--baseline", "x"))
        peers = self.write("peers.csv", [{"scene": "box", "name": "other", "seconds": 0, "error": 1}])
        self.assertIn("peers.csv:2: seconds must be above 0", self.error_of(file, "--peers", peers))

    def test_a_curve_is_one_experiment(self):
        good = rows_of(estimator_curves(np.random.default_rng(5), 2, 0), "path")
        self.assertIn("rows.csv:20: the row of path on box, seed 1, after 1 units stands in " + self.path("rows.csv:2, too"),
                      self.error_of(self.write("rows.csv", good + good[:1])))
        other = [dict(row) for row in good]
        for row in other[9:]:
            row["settings"] = "max_depth=2"
        self.assertIn("rows.csv:11: path on box has another settings than in " + self.path("rows.csv:2"),
                      self.error_of(self.write("rows.csv", other)))

    def test_folders_of_one_name(self):
        good = rows_of(estimator_curves(np.random.default_rng(5), 2, 0), "path")
        folders = []
        for build in ("new", "old"):
            os.makedirs(self.path(build + "/results"))
            self.write(build + "/results/rows.csv", good)
            folders.append(self.path(build + "/results"))
        self.assertEqual({r["variant"] for r in report.read_rows(folders)},
                         {"path of new/results", "path of old/results"})
        self.assertIn("given twice", self.error_of(folders[0], folders[0] + "/rows.csv"))

    def test_names_that_are_formulas_and_rows_without_an_error(self):
        curves = estimator_curves(np.random.default_rng(5), 2, 0)
        rows = rows_of(curves, "$x_{$") + rows_of(curves, "größe")
        os.mkdir(self.path("images"))
        np.save(self.path("images/reference-box.npy"), np.ones((8, 9, 3), np.float32))
        np.save(self.path("images/" + rows[len(rows) // 2]["run"] + ".npy"), np.full((8, 9, 3), 1.1, np.float32))
        for row in rows:
            row["relmse"] = ""
            row["flip"] = 0
        done = self.run_report(self.write("rows.csv", rows), "--out", self.path("r.html"))
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.path("r.html"), encoding="utf-8") as stream:
            page = stream.read()
        self.assertIn("relMSE: no row has one above 0.", page)
        # Powers of ten at the axes are formulas, names are not.
        self.assertTrue(matplotlib.rcParams["text.parse_math"])
        self.assertFalse(matplotlib.cbook.is_math_text(report.plain("$x_{$ and $x$")))
        self.assertFalse("No images beside these rows" in page)
        self.assertEqual(page.count("data:image/png;base64,"), 2)  # one figure, and the error images

    def test_bad_cells_and_peers(self):
        good = rows_of(estimator_curves(np.random.default_rng(5), 2, 0), "path")
        for column, value in (("seed", ""), ("units", ""), ("cpu_seconds", "-1"), ("wall_seconds", "inf")):
            bad = [dict(row) for row in good]
            bad[3][column] = value
            self.assertIn(f"bad.csv:5: column {column} must be a number", self.error_of(self.write("bad.csv", bad)))
        file = self.write("rows.csv", good)
        peers = self.write("peers.csv", [{"scene": "box", "name": "other", "seconds": "inf", "error": 1}])
        self.assertIn("peers.csv:2: seconds must be above 0, and finite", self.error_of(file, "--peers", peers))
        with open(self.path("bom.csv"), "w", encoding="utf-8-sig") as stream:
            stream.write("scene,name,seconds,error\nBox,other,1,1\n")
        done = self.run_report(file, "--peers", self.path("bom.csv"), "--out", self.path("r.html"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("no rows of scene 'Box'", done.stderr)
        two = [dict(row, scene=scene) for scene in ("a b", "a_b") for row in good]
        self.assertIn("--markdown: the pictures of two scenes",
                      self.error_of(self.write("two.csv", two), "--markdown", self.path("never.md")))

    def test_rows_of_the_program(self):
        """What candela-bench writes is what the report reads, and its commands make their rows again."""
        program = os.environ.get("CANDELA_BENCH")
        if not program:
            self.skipTest("$CANDELA_BENCH is not set")
        scene = os.path.join(HERE, "../../deploy/scenes/cornell/scene.xml")
        reference = self.path("truth.exr")
        made = subprocess.run([program, "reference", "--scene", scene, "--size", "16x16", "--integrators", "path,bdpt",
                               "--iterations", "128", "--batches", "4", "--out", reference], capture_output=True,
                              text=True, check=False)
        self.assertEqual(made.returncode, 0, made.stderr)
        out = self.path("out, 1")
        run = subprocess.run([program, "run", "--scene", scene, "--reference", reference, "--integrators", "path,light",
                              "--seeds", "1,2", "--time", "0.3", "--set", "max_depth=5", "--out", out],
                             capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 0, run.stderr)
        rows = report.read_rows([out])
        self.assertEqual({(r["variant"], r["seed"]) for r in rows},
                         {(v, s) for v in ("path", "light") for s in (1, 2)})
        row = rows[-1]
        again = subprocess.run(row["command"].replace("candela-bench", program, 1), shell=True, capture_output=True,
                               text=True, check=False)
        self.assertEqual(again.returncode, 0, again.stderr)
        last = list(csv.DictReader(again.stdout.splitlines()))[-1]
        for column in ("units", "rays") + report.FIGURES:
            self.assertEqual(float(last[column]), row[column], column)
        done = self.run_report(out, "--out", self.path("r.html"))
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.path("r.html"), encoding="utf-8") as stream:
            self.assertNotIn("No images beside these rows", stream.read())


class Guard(unittest.TestCase):
    def test_what_is_worse_is_named(self):
        was = {"instructions": 1000, "error": 2.0}
        self.assertEqual(guard.worse_than("a", {"instructions": 1029, "error": 2.5}, was, True), [])
        self.assertEqual(guard.worse_than("a", {"instructions": 1040, "error": 1.0}, was, True),
                         ["a: 4.0 % more instructions"])
        self.assertEqual(guard.worse_than("a", {"instructions": 0, "error": 3.0}, was, False), ["a: 50.0 % more error"])

    def test_all_cases_have_committed_figures(self):
        with open(guard.FIGURES, encoding="utf-8") as stream:
            cases = json.load(stream)["cases"]
        self.assertEqual(sorted(cases), sorted(f"{s} {i}" for s in guard.SCENES for i in guard.INTEGRATORS))
        for figures in cases.values():
            self.assertGreater(figures["instructions"], 1e7)
            self.assertGreater(figures["error"], 0)

    def test_a_dearer_start_is_named(self):
        was = {"instructions": 1000, "libraries": ["a.so", "b.so"]}
        same = {"instructions": 1090, "libraries": ["a.so", "c.so"], "kB": 50000}
        self.assertEqual(start_guard.worse_than("x", same, was), [])
        self.assertEqual(start_guard.worse_than("x", {**same, "libraries": ["a.so", "b.so", "c.so"]}, was),
                         ["x: 3 libraries, not 2: c.so"])
        self.assertEqual(start_guard.worse_than("x", {**same, "instructions": 1110}, was), ["x: 11.0 % more instructions"])
        self.assertEqual(start_guard.worse_than("x", {**same, "kB": 60000}, was), ["x: 61.4 MB of memory"])
        self.assertEqual(start_guard.worse_than("x", {"libraries": [], "kB": 1}, was), [])  # without Valgrind


if __name__ == "__main__":
    unittest.main()
