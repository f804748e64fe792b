#!/usr/bin/env python3
"""Error of ppm and vcm against alpha and iterations on the torus in glass (torus/torus.xml): the experiment of Fig. 1
of Hachisuka et al.'s supplement (2012), and the rates of variance and bias.

    alpha_experiment.py run CANDELA FOLDER    renders what FOLDER lacks, and writes FOLDER/results.json
    alpha_experiment.py plot FOLDER FIGURES   draws FIGURES/alpha-error.png and FIGURES/convergence-rate.png
    alpha_experiment.py table FOLDER          prints the figures
    alpha_experiment.py mesh FILE.ply         makes the torus

Needs Python's numpy and OpenImageIO to run and matplotlib to plot (Debian: python3-numpy, python3-openimageio,
python3-matplotlib).

Of an image of N iterations with independent halves A and B of N/2 each, the mean square of (A - B)/2 over pixels is
an unbiased estimate of its variance, and the mean square difference to an independent, unbiased reference, less the
reference's own variance, one of its squared error. Their difference is the squared bias, but drowns in their noise where
bias is small. So bias is measured as an amplitude: P, the image at the constant radius r_1 (alpha = 1) less the
reference, is the pattern of the bias of one first iteration; (image - reference) is projected onto it. Two independent
references and two independent images at r_1 keep noise from being projected onto itself.
"""
import argparse
import json
import math
import os
import struct
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ALPHAS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2 / 3, 0.7, 0.8, 0.9]
FITTED = [0.5, 2 / 3, 0.8]  # drawn in the figure of rates


def make_mesh(path, rings=48, sides=24, major=0.36, minor=0.13):
    """A torus about the y axis with its true normals."""
    vertices, triangles = [], []
    for i in range(rings):
        a = 2 * math.pi * i / rings
        for j in range(sides):
            b = 2 * math.pi * j / sides
            n = (math.cos(b) * math.cos(a), math.sin(b), -math.cos(b) * math.sin(a))
            c = (major * math.cos(a), 0, -major * math.sin(a))
            vertices.append(tuple(c[k] + minor * n[k] for k in range(3)) + n)
            right, up = (i + 1) % rings, (j + 1) % sides
            triangles.append((i * sides + j, right * sides + j, right * sides + up))
            triangles.append((i * sides + j, right * sides + up, i * sides + up))
    with open(path, "wb") as f:
        f.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(vertices))
        for name in "x y z nx ny nz".split():
            f.write(b"property float %s\n" % name.encode())
        f.write(b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(triangles))
        for v in vertices:
            f.write(struct.pack("<6f", *v))
        for t in triangles:
            f.write(struct.pack("<B3i", 3, *t))


def read_exr(path):
    """The image and its estimated standard deviation, as doubles."""
    import numpy
    import OpenImageIO
    pixels = OpenImageIO.ImageBuf(path).get_pixels(OpenImageIO.FLOAT).astype(numpy.float64)
    return pixels[..., 0:3], pixels[..., 3:6]


def render(args, name, integrator, settings, iterations, seed, sampler):
    """An EXR for each of the increasing numbers of iterations, of one render that is stopped and resumed."""
    files = [os.path.join(args.folder, "%s-%d.exr" % (name, n)) for n in iterations]
    if all(os.path.exists(f) for f in files):
        return files
    state = os.path.join(args.folder, name + ".exr")
    for k, (n, file) in enumerate(zip(iterations, files)):
        command = [args.candela, "render", os.path.join(HERE, "torus", "torus.xml"), "--integrator", integrator,
                   "--iterations", str(n), "--size", "%dx%d" % (args.size, args.size), "--threads",
                   str(args.threads), "--seed", str(seed), "--sampler", sampler, "--error-layer", "--quiet",
                   "-o", state, "--keep-state", "--fresh" if k == 0 else "--resume"]
        for key, value in settings.items():
            command += ["--set", "%s=%s" % (key, value)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        os.replace(state, file)
    return files


def run(args):
    import numpy
    os.makedirs(args.folder, exist_ok=True)
    if not os.path.exists(os.path.join(HERE, "torus", "torus.ply")):
        make_mesh(os.path.join(HERE, "torus", "torus.ply"))
    reference, deviation = read_exr(render(args, "reference", "path", {}, [args.reference], 4242, "sobol")[0])
    other = read_exr(render(args, "reference-other", "path", {}, [args.reference // 2], 4243, "sobol")[0])[0]
    mean = reference.mean()
    reference_variance = (deviation**2).mean() / mean**2
    results = dict(size=args.size, radius=args.radius, reference_iterations=args.reference,
                   reference_variance=reference_variance, pattern_squared={}, runs=[])
    most = max(args.iterations)
    for integrator in args.integrators.split(","):
        constant = [
            read_exr(render(args, "%s-constant-%d" % (integrator, seed), integrator,
                            dict(alpha="1", radius=str(args.radius)), [most], seed, "independent")[0])[0]
            for seed in (1001, 1002)
        ]
        pattern = constant[0] - other
        pattern_squared = (pattern * (constant[1] - reference)).mean()
        results["pattern_squared"][integrator] = pattern_squared / mean**2
        for alpha in ALPHAS:
            for seed in range(1, args.seeds + 1):
                name = "%s-%.3f-%d" % (integrator, alpha, seed)
                settings = dict(alpha="%.6f" % alpha, radius=str(args.radius))
                for n, file in zip(args.iterations, render(args, name, integrator, settings, args.iterations,
                                                           seed, "independent")):
                    image, deviation = read_exr(file)
                    results["runs"].append(
                        dict(integrator=integrator, alpha=alpha, seed=seed, iterations=n,
                             variance=(deviation**2).mean() / mean**2,
                             squared_error=((image - reference)**2).mean() / mean**2 - reference_variance,
                             amplitude=((image - reference) * pattern).mean() / pattern_squared,
                             mean_ratio=image.mean() / mean))
            print("%s alpha %.3f done" % (integrator, alpha), flush=True)
    # No figure is trimmed: single bright pixels are in them.
    assert numpy.isfinite([r["squared_error"] for r in results["runs"]]).all()
    with open(os.path.join(args.folder, "results.json"), "w") as f:
        json.dump(results, f, indent=1)


def collect(results):
    """(integrator, alpha, iterations) -> (mean squared error, variance, amplitude of bias), over seeds."""
    groups = {}
    for r in results["runs"]:
        groups.setdefault((r["integrator"], r["alpha"], r["iterations"]), []).append(r)
    return {
        key: tuple(sum(r[part] for r in runs) / len(runs) for part in ("squared_error", "variance", "amplitude"))
        for key, runs in groups.items()
    }


def variance_factor(alpha, n):
    """Variance of the mean of n iterations over that of the first, where it is the photons' alone."""
    return (math.gamma(1 + alpha) / ((2 - alpha) * n * n) *
            (math.exp(math.lgamma(n + 2) - math.lgamma(n + alpha)) - 1 / math.gamma(alpha)))


def bias_factor(alpha, n):
    """Bias of the mean of n iterations over that of the first, where bias is in proportion to the squared radius."""
    ratio = math.exp(math.lgamma(n + 1 + alpha) - math.lgamma(n + 1)) / math.gamma(1 + alpha)
    return (ratio - 1) / (alpha * n)


def fit(table, integrator):
    """Eye noise E and photon noise V of variance E / N + V variance_factor: the least squares of relative residuals over
    all alphas and N, and the root mean square of those residuals."""
    keys = [k for k in table if k[0] == integrator]
    # Normal equations of E and V, each row divided by the measured variance.
    rows = [(1 / n / table[k][1], variance_factor(a, n) / table[k][1]) for k in keys for _, a, n in [k]]
    ee, ev, vv = (sum(r[i] * r[j] for r in rows) for i, j in ((0, 0), (0, 1), (1, 1)))
    e, v = sum(r[0] for r in rows), sum(r[1] for r in rows)
    determinant = ee * vv - ev * ev
    eye, photon = (e * vv - v * ev) / determinant, (ee * v - ev * e) / determinant
    if eye < 0:
        eye, photon = 0.0, v / vv
    return eye, photon, math.sqrt(sum((r[0] * eye + r[1] * photon - 1)**2 for r in rows) / len(rows))


def best_alpha(eye, photon, pattern_squared, n):
    """That of least error by the fit; the eye's noise is the same for all."""
    return min((photon * variance_factor(a / 1000, n) + pattern_squared * bias_factor(a / 1000, n)**2, a / 1000)
               for a in range(10, 1000))[1]


def load(args):
    with open(os.path.join(args.folder, "results.json")) as f:
        results = json.load(f)
    return results, collect(results)


def axis(values, table):
    return sorted({k[values] for k in table})


def table_text(args):
    results, table = load(args)
    print("relative to the image's mean; reference's RMS noise %.4f" % math.sqrt(results["reference_variance"]))
    for integrator in axis(0, table):
        pattern_squared = results["pattern_squared"][integrator]
        counts = axis(2, table)
        print("\n%s: RMS error (in brackets: RMS noise, RMS bias along the pattern)" % integrator)
        print("| alpha |" + "".join(" N = %d |" % n for n in counts))
        print("|---|" + "---|" * len(counts))
        for alpha in axis(1, table):
            print("| %.3f |" % alpha + "".join(
                " %.4f (%.4f, %.4f) |" % (math.sqrt(max(0, error)), math.sqrt(variance), amplitude *
                                          math.sqrt(max(0, pattern_squared)))
                for error, variance, amplitude in (table[integrator, alpha, n] for n in counts)))
        print("best alpha: " + ", ".join(
            "%.2f at %d" % (min(axis(1, table), key=lambda a: table[integrator, a, n][0]), n) for n in counts))
        print("amplitude of the bias, measured / by the exact sum of squared radii:")
        for alpha in axis(1, table):
            print("  %.3f: " % alpha + "  ".join(
                "%.3f/%.3f" % (table[integrator, alpha, n][2], bias_factor(alpha, n)) for n in counts))
        a, b = counts[-3 if len(counts) > 2 else 0], counts[-1]
        print("slopes against log N from %d to %d of log variance (-alpha) and log bias (alpha - 1):" % (a, b))
        for alpha in axis(1, table):
            va, vb = table[integrator, alpha, a], table[integrator, alpha, b]
            bias = math.log(vb[2] / va[2]) / math.log(b / a) if va[2] > 0 and vb[2] > 0 else math.nan
            print("  %.3f: %.3f (%.3f), %.3f (%.3f)" %
                  (alpha, math.log(vb[1] / va[1]) / math.log(b / a), -alpha, bias, alpha - 1))
        eye, photon, spread = fit(table, integrator)
        print("fit: variance %.3g / N + %.3g f (residual %.0f %%), squared bias %.3g g^2" %
              (eye, photon, 100 * spread, pattern_squared))
        for scale in (1, 1 / 3, 1 / 10):
            print("best alpha by the fit if r_1 were %.4f: " % (scale * results["radius"]) + ", ".join(
                "%.2f at 1e%d" % (best_alpha(eye, photon / scale**2, pattern_squared * scale**4, 10**k), k)
                for k in range(2, 9)))


def plot(args):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    results, table = load(args)
    integrators, counts, alphas = axis(0, table), axis(2, table), axis(1, table)
    os.makedirs(args.figures, exist_ok=True)

    figure, axes = plt.subplots(1, len(integrators), figsize=(5 * len(integrators), 4), squeeze=False)
    for ax, integrator in zip(axes[0], integrators):
        for k, n in enumerate(counts):
            errors = [math.sqrt(max(0, table[integrator, a, n][0])) for a in alphas]
            colour = plt.cm.viridis(k / max(1, len(counts) - 1) * 0.9)
            ax.semilogy(alphas, errors, "o-", ms=3, color=colour, label="N = %d" % n)
            best = min(range(len(alphas)), key=lambda i: errors[i])
            ax.semilogy([alphas[best]], [errors[best]], "o", ms=8, mfc="none", color=colour)
        ax.axvline(2 / 3, color="grey", lw=0.8, ls=":")
        ax.set_title(integrator)
        ax.set_xlabel("alpha (dotted: 2/3; circles: smallest)")
        ax.set_ylabel("RMS error / mean")
        ax.grid(alpha=0.3, which="both")
        ax.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(os.path.join(args.figures, "alpha-error.png"), dpi=110)

    figure, axes = plt.subplots(len(integrators), 2, figsize=(10, 4 * len(integrators)), squeeze=False)
    for row, integrator in zip(axes, integrators):
        for alpha in FITTED:
            near = min(alphas, key=lambda a: abs(a - alpha))
            for ax, part, power, name in ((row[0], 1, -near, "N^-alpha"), (row[1], 2, near - 1, "N^-(1-alpha)")):
                shown = [(n, table[integrator, near, n][part]) for n in counts if table[integrator, near, n][part] > 0]
                if not shown:
                    continue
                line, = ax.loglog(*zip(*shown), "o-", ms=3, label="alpha = %.2f" % near)
                n0, v0 = shown[-1]
                ax.loglog(counts, [v0 * (n / n0)**power for n in counts], "--", lw=1, color=line.get_color())
                what = "variance" if part == 1 else "bias / bias of iteration 1"
                ax.set_title("%s: %s, dashed %s" % (integrator, what, name))
        for ax in row:
            ax.set_xlabel("iterations")
            ax.grid(alpha=0.3, which="both")
            ax.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(os.path.join(args.figures, "convergence-rate.png"), dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    p = commands.add_parser("run")
    p.add_argument("candela")
    p.add_argument("folder")
    p.add_argument("--size", type=int, default=48)
    p.add_argument("--radius", type=float, default=0.03, help="of the first iteration, fraction of the scene's")
    p.add_argument("--integrators", default="ppm,vcm")
    p.add_argument("--iterations", type=int, nargs="+", default=[16, 64, 256, 1024])
    p.add_argument("--seeds", type=int, default=1)
    p.add_argument("--reference", type=int, default=32768, help="iterations of path")
    p.add_argument("--threads", type=int, default=1)
    p = commands.add_parser("plot")
    p.add_argument("folder")
    p.add_argument("figures")
    p = commands.add_parser("table")
    p.add_argument("folder")
    p = commands.add_parser("mesh")
    p.add_argument("file")
    args = parser.parse_args()
    if args.command == "mesh":
        make_mesh(args.file)
    else:
        dict(run=run, plot=plot, table=table_text)[args.command](args)


if __name__ == "__main__":
    sys.exit(main())
