"""Figure and tables of the study fppm-comparison."""
import draw_radii
from draw_radii import tables  # noqa: F401

PAPER = ("The F test on weighted contributions keeps the radius where the irradiance is constant and shrinks it where it is "
         "not; the chi-squared test on counts rejects even light of uneven photon density and misses edges of "
         "contributions. FPPM then has less error than CPPM and SPPM at equal iterations.")


def figure(rows, maps):
    return draw_radii.figure(rows, maps, ["cppm", "fppm", "appm"])
