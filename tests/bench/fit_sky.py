#!/usr/bin/env python3
"""Fits the sky's coefficients to measured radiances: fit_sky.py MEASURED.csv[.gz] OUT.cpp [SAMPLE.csv]

The model is that of Hosek and Wilkie [2012]: the extended formula of Perez with nine parameters and a mean
radiance a channel, each a Bezier curve of degree 5 in the cube root of the sun's elevation, for turbidities
1 to 10 and a black and a white ground. Rows of the file: turbidity, albedo, sun_elevation_deg, theta_deg,
phi_from_sun_deg, r, g, b; a value is the mean over a pixel of 2.8125 degrees squared.

Elevations of 8 and 60 degrees and two polar angles are held out; their residuals are printed. With SAMPLE,
every 97th of them goes there, for the test where the file is absent. Needs NumPy; takes about 10 minutes.
"""
import sys
import time
from math import comb

import numpy as np

PIXEL = np.radians(2.8125)
HELD_ELEVATIONS, HELD_POLAR = (8, 60), (23.90625, 74.53125)
START = np.array([-1.1, -0.2, 0.8, 0.5, -2, 0.8, 0.1, 0.65, 1.9])  # a clear sky of any elevation
UNITS = np.array([2, 3, 1, 1, 1, 1, 3, 10, 1.0])  # parameters times these vary alike
TOWARDS_START, SMOOTH = 3e-4, 1e-3  # residuals that choose among coefficients of almost the same sky
DEGREE = 5
COARSE = 0.008  # residuals beyond it count more in the second pass


def is_held(rows):
    return np.isin(rows[:, 2], HELD_ELEVATIONS) | np.isin(rows[:, 3], HELD_POLAR)


class State:
    """The rows of one turbidity, albedo and channel."""

    def __init__(self, rows, channel):
        nodes, weights = np.polynomial.legendre.leggauss(3)
        x, y = np.meshgrid(nodes * PIXEL / 2, nodes * PIXEL / 2)
        self.weights = np.outer(weights, weights).ravel() / 4
        theta = np.radians(rows[:, 3])[:, None] + y.ravel()
        phi = np.radians(rows[:, 4])[:, None] + x.ravel()
        sun = np.pi / 2 - np.radians(rows[:, 2])[:, None]
        self.cos_gamma = np.clip(np.cos(theta) * np.cos(sun) + np.sin(theta) * np.sin(sun) * np.cos(phi), -1, 1)
        self.gamma = np.arccos(self.cos_gamma)
        self.root = np.sqrt(np.cos(theta))
        self.inverse = 1 / (np.cos(theta) + 0.01)
        self.values = rows[:, 5 + channel]
        self.keep = ~is_held(rows)
        elevations, self.row = np.unique(rows[:, 2], return_inverse=True)
        x = np.cbrt(elevations / 90)
        self.basis = np.stack([comb(DEGREE, j) * x ** j * (1 - x) ** (DEGREE - j) for j in range(DEGREE + 1)], 1)
        self.means = np.array([self.values[self.row == i].mean() for i in range(len(elevations))])
        self.scale = self.means.max()  # of the mean radiance's coefficients in this program

    def start(self):
        mean = np.linalg.lstsq(self.basis / self.means[:, None], np.ones(len(self.means)), rcond=None)[0]
        return np.concatenate([np.repeat(START, DEGREE + 1), mean])

    def model(self, q):
        """Radiances, and their derivatives by q."""
        raw = self.basis @ q[:54].reshape(9, 6).T
        c = raw.copy()
        c[:, 1] = np.minimum(c[:, 1], 0)
        c[:, 7] = np.clip(c[:, 7], 0, 0.98)
        a, b, c2, d, e, f, g, h, i = [c[self.row, k][:, None] for k in range(9)]
        mean = (self.basis @ q[54:])[self.row]
        horizon = np.exp(b * self.inverse)
        near = np.exp(np.clip(e * self.gamma, -50, 50))
        square = 1 + h * h - 2 * h * self.cos_gamma
        mie = (1 + self.cos_gamma ** 2) / (square * np.sqrt(square))
        left = 1 + a * horizon
        right = c2 + d * near + f * self.cos_gamma ** 2 + g * mie + i * self.root
        weighted = left * self.weights
        by_c = [(horizon * right) @ self.weights,
                ((a * horizon * self.inverse * right) @ self.weights) * (raw[self.row, 1] == c[self.row, 1]),
                weighted.sum(1),
                (weighted * near).sum(1),
                (weighted * d * near * self.gamma).sum(1),
                (weighted * self.cos_gamma ** 2).sum(1),
                (weighted * mie).sum(1),
                (weighted * g * mie / square * 3 * (self.cos_gamma - h)).sum(1) * (raw[self.row, 7] == c[self.row, 7]),
                (weighted * self.root).sum(1)]
        basis = self.basis[self.row]
        perez = (weighted * right).sum(1)
        jacobian = np.empty((len(self.values), 60))
        for k in range(9):
            jacobian[:, 6 * k:6 * k + 6] = (by_c[k] * mean)[:, None] * basis
        jacobian[:, 54:] = perez[:, None] * basis
        return perez * mean, jacobian

    def residuals(self, q):
        return self.model(q)[0] / self.values - 1


def regular():
    """Rows of residuals, linear in q, and what is subtracted."""
    towards = np.zeros((54, 60))
    towards[:, :54] = np.diag(np.repeat(UNITS * TOWARDS_START, 6))
    smooth = np.zeros((36, 60))
    for k in range(9):
        for i in range(4):
            smooth[4 * k + i, 6 * k + i:6 * k + i + 3] = UNITS[k] * SMOOTH * np.array([1, -2, 1])
    rows = np.concatenate([towards, smooth])
    prior = np.concatenate([np.repeat(START, 6), np.zeros(6)])
    return rows, np.concatenate([towards @ prior, np.zeros(36)])


REGULAR, REGULAR_AT = regular()


def fit(state, weights, q, steps):
    """Levenberg and Marquardt; the mean radiance's coefficients in units of state.scale."""
    unit = np.concatenate([np.ones(54), np.full(6, state.scale)])
    keep = state.keep
    weights = weights[keep]
    per_value = weights / state.values[keep]

    def at(q):
        radiance, jacobian = state.model(q * unit)
        r = np.concatenate([radiance[keep] * per_value - weights, REGULAR @ q - REGULAR_AT])
        return r, np.concatenate([jacobian[keep] * per_value[:, None] * unit, REGULAR])

    q = q / unit
    r, jacobian = at(q)
    cost, damping, calm = r @ r, 1e-3, 0
    for _ in range(steps):
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ r
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        r_next, jacobian_next = at(q - step)
        next_cost = r_next @ r_next
        if next_cost < cost:
            calm = calm + 1 if cost - next_cost < 1e-4 * cost else 0
            q, r, jacobian, cost, damping = q - step, r_next, jacobian_next, next_cost, damping / 5
            if calm > 4:
                break
        else:
            damping *= 4
            if damping > 1e8:
                break
    return q * unit, cost


def fit_twice(state, starts, steps):
    """The best from several starts, then once more with more weight on the worst rows."""
    ones = np.ones(len(state.values))
    q, _ = min((fit(state, ones, start, steps) for start in starts), key=lambda found: found[1])
    weights = np.sqrt(1 + (state.residuals(q) / COARSE) ** 2)
    return fit(state, weights, q, steps)[0]


def written(value):
    text = f"{value:.6g}"
    return (text if any(c in text for c in ".e") else text + ".0") + "f"


def write_table(path, table):
    with open(path, "w", encoding="ascii") as out:
        out.write("// Coefficients of the sky. Made by tests/bench/fit_sky.py from measured radiances; do not edit.\n"
                  '#include "worker/scene/emitters/sky_model.h"\n\nnamespace candela::scene {\n\n'
                  "// clang-format off\n"
                  "const float kSkyCoefficients[10][2][3][10][6] = {\n")
        for turbidity in range(1, 11):
            out.write("{ // turbidity %d\n" % turbidity)
            for albedo in (0, 1):
                out.write("{ // albedo %d\n" % albedo)
                for channel in range(3):
                    q = table[turbidity, albedo, channel].reshape(10, 6)
                    lines = [", ".join("{" + ",".join(written(v) for v in row) + "}" for row in q[i:i + 2])
                             for i in range(0, 10, 2)]
                    out.write("{" + ",\n ".join(lines) + "},\n")
                out.write("},\n")
            out.write("},\n")
        out.write("};\n// clang-format on\n\n}  // namespace candela::scene\n")


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    rows = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1)
    held = is_held(rows)
    if len(sys.argv) == 4:
        with open(sys.argv[3], "w", encoding="ascii") as out:
            out.write("turbidity,albedo,sun_elevation_deg,theta_deg,phi_from_sun_deg,r,g,b\n")
            for row in rows[held][::97]:
                out.write(",".join(f"{value:.10g}" for value in row) + "\n")
    table, fitted, kept_out = {}, [], []
    for turbidity in (3, 2, 1, 4, 5, 6, 7, 8, 9, 10):
        for albedo in (0, 1):
            chosen = (rows[:, 0] == turbidity) & (rows[:, 1] == albedo)
            for channel in range(3):
                begin = time.time()
                state = State(rows[chosen], channel)
                starts = [state.start()]
                for near in ((turbidity + 1, albedo), (turbidity - 1, albedo), (turbidity, 0)):
                    if near + (channel,) in table:
                        starts.append(table[near + (channel,)])
                q = fit_twice(state, starts, 120)
                table[turbidity, albedo, channel] = q
                r, out = state.residuals(q), held[chosen]
                fitted.append(r[~out])
                kept_out.append(r[out])
                print("turbidity %d albedo %d channel %d: rms %.4f worst %.4f, held out %.4f %.4f, largest %.3g, %.0f s" %
                      (turbidity, albedo, channel, np.sqrt((r[~out] ** 2).mean()), abs(r[~out]).max(),
                       np.sqrt((r[out] ** 2).mean()), abs(r[out]).max(), abs(q[:54]).max(), time.time() - begin),
                      flush=True)
    for name, parts in (("fitted", fitted), ("held out", kept_out)):
        r = abs(np.concatenate(parts))
        print("%s: %d values, rms %.4f, 99 %% below %.4f, 99.9 %% below %.4f, worst %.4f" %
              (name, len(r), np.sqrt((r ** 2).mean()), np.quantile(r, 0.99), np.quantile(r, 0.999), r.max()))
    write_table(sys.argv[2], table)


if __name__ == "__main__":
    main()
