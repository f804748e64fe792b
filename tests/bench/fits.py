"""Fits of error curves with confidence intervals from independent seeds.

The rows of one seed share their samples, so a regression's own standard errors would be too small. Each seed
is therefore fitted by itself, and the interval is Student's over the seeds' independent results.
"""
import math

import numpy as np


def _beta_fraction(a, b, x):
    """The continued fraction of the incomplete beta function, by Lentz's method."""
    tiny = 1e-300
    c, d = 1.0, 1.0 - (a + b) * x / (a + 1)
    d = 1.0 / (d if abs(d) > tiny else tiny)
    value = d
    for m in range(1, 1000):
        for numerator in (m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
                          -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))):
            d = 1.0 + numerator * d
            d = 1.0 / (d if abs(d) > tiny else tiny)
            c = 1.0 + numerator / c
            c = c if abs(c) > tiny else tiny
            value *= c * d
        if abs(c * d - 1.0) < 1e-15:
            break
    return value


def student_two_sided(t, freedom):
    """The probability that a Student variable is beyond +-t."""
    a, b, x = freedom / 2, 0.5, freedom / (freedom + t * t)
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
                     + a * math.log(x) + b * math.log1p(-x)) if 0 < x < 1 else 0.0
    if x >= 1:
        return 1.0
    if x < (a + 1) / (a + b + 2):
        return front * _beta_fraction(a, b, x) / a
    return 1.0 - front * _beta_fraction(b, a, 1 - x) / b


def student_quantile(confidence, freedom):
    """t such that a Student variable is within +-t with this probability."""
    low, high = 0.0, 1.0
    while student_two_sided(high, freedom) > 1 - confidence:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if student_two_sided(middle, freedom) > 1 - confidence else (low, middle)
    return (low + high) / 2


class Interval:
    """A mean over seeds with its confidence interval; `half` is NaN for one seed."""

    def __init__(self, values, confidence=0.95):
        values = np.asarray([v for v in values if math.isfinite(v)], dtype=float)
        self.count = len(values)
        self.confidence = confidence
        self.mean = float(values.mean()) if self.count else math.nan
        self.half = math.nan
        if self.count > 1:
            error = values.std(ddof=1) / math.sqrt(self.count)
            self.half = student_quantile(confidence, self.count - 1) * float(error)

    def holds(self, value):
        return abs(self.mean - value) <= self.half

    def text(self, digits=3):
        if not self.count:
            return "-"
        if math.isnan(self.half):
            return f"{self.mean:.{digits}g}"
        return f"{self.mean:.{digits}g} ± {self.half:.2g}"


def _usable(times, errors):
    times, errors = np.asarray(times, float), np.asarray(errors, float)
    keep = (times > 0) & (errors > 0) & np.isfinite(times) & np.isfinite(errors)
    return times[keep], errors[keep]


def slope(times, errors):
    """Least squares of log error over log time: the exponent. NaN below three points."""
    times, errors = _usable(times, errors)
    if len(times) < 3 or np.ptp(np.log(times)) == 0:
        return math.nan
    return float(np.polyfit(np.log(times), np.log(errors), 1)[0])


def variance_and_floor(times, errors):
    """(V, F) of error = V / time + F, for squared errors. The relative error of all points is taken to be
    one, so squares are weighted by the fit itself, iterated from the data. F may come out negative: cutting
    it off would bias its mean over seeds. NaN below three points."""
    times, errors = _usable(times, errors)
    if len(times) < 3:
        return math.nan, math.nan
    design = np.stack([1 / times, np.ones_like(times)], axis=1)
    weights = 1 / errors
    for _ in range(20):
        (v, f), *_ = np.linalg.lstsq(design * weights[:, None], errors * weights, rcond=None)
        fitted = design @ (v, f)
        weights = 1 / np.maximum(fitted, 1e-3 * errors)
    return float(v), float(f)


def slope_over_seeds(curves, confidence=0.95):
    """curves: (times, errors) of each seed."""
    return Interval([slope(*curve) for curve in curves], confidence)


def floor_over_seeds(curves, confidence=0.95):
    return Interval([variance_and_floor(*curve)[1] for curve in curves], confidence)


def time_to(target, times, errors):
    """The time at which a curve falls to the target for good, by log-log interpolation. NaN where it never
    does, or lies below it from the first point on (that time is not known)."""
    times, errors = _usable(times, errors)
    above = np.nonzero(errors > target)[0]
    if len(times) == 0 or len(above) == 0 or above[-1] == len(errors) - 1:
        return math.nan
    i = above[-1]
    x = np.log(times[i:i + 2])
    y = np.log(errors[i:i + 2])
    return float(np.exp(x[0] + (math.log(target) - y[0]) * (x[1] - x[0]) / (y[1] - y[0])))


def quartiles(curves, points=40):
    """Median and quartiles over seeds on a grid of times that all seeds span: (grid, low, median, high).
    None where there is no such span."""
    usable = [_usable(*curve) for curve in curves]
    usable = [(t, e) for t, e in usable if len(t)]
    if not usable:
        return None
    begin, end = max(t[0] for t, _ in usable), min(t[-1] for t, _ in usable)
    if not begin < end:
        return None
    grid = np.geomspace(begin, end, points)
    on_grid = [np.exp(np.interp(np.log(grid), np.log(t), np.log(e))) for t, e in usable]
    low, median, high = np.percentile(on_grid, [25, 50, 75], axis=0)
    return grid, low, median, high
