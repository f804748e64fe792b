"""Candela from Python: jobs on a farm, and renders on this machine, as NumPy arrays.

    import candela

    image = candela.render("scene.xml", iterations=64)          # here
    print(image.rgb.shape, image.metadata["candela:iterations"])

    farm = candela.Farm("127.0.0.1:7070")                        # on a farm
    job = farm.submit("scene.xml", integrator="bdpt", iterations=256)
    for status in job.watch():
        print(status.iterations, status.relmse)
    image = job.image(error_layer=True)

docs/python.md is the tutorial.
"""
from .errors import CandelaError, JobError, UnreachableError, UsageError
from .farm import Farm
from .group import Group, GroupStatus
from .image import Image, read_image
from .job import Job, Status
from .local import LocalFarm, render

__all__ = [
    "CandelaError",
    "Farm",
    "Group",
    "GroupStatus",
    "Image",
    "Job",
    "JobError",
    "LocalFarm",
    "Status",
    "UnreachableError",
    "UsageError",
    "read_image",
    "render",
]
