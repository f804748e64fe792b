"""Plots the estimated error of two integrators over their iterations, as their jobs run: docs/python.md.

    PYTHONPATH=build/python python3 client/python/examples/convergence.py SCENE PLOT.png
"""
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import candela


def curve(farm: candela.Farm, scene: str, integrator: str, iterations: int) -> tuple[list[int], list[float]]:
    job = farm.submit(scene, integrator=integrator, iterations=iterations, size=(160, 120), seed=1)
    points = {s.iterations: s.relmse for s in job.watch(interval=0.2) if s.relmse}
    return list(points), list(points.values())


def main(scene: str, plot: str) -> None:
    figure, axes = plt.subplots(figsize=(6, 3.6))
    with candela.LocalFarm(workers=2) as farm:
        for integrator in ("path", "bdpt"):
            axes.loglog(*curve(farm, scene, integrator, 512), ".-", label=integrator)
    axes.set_xlabel("iterations")
    axes.set_ylabel("estimated relMSE")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(plot, dpi=110)


main(*sys.argv[1:])
