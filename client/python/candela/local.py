"""Renders on this machine: by `candela render`, or by a farm of processes that Python starts and ends."""
from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path
from typing import Optional, Unpack

from .errors import CandelaError
from .farm import Farm, PathLike
from .image import Image, read_image
from .program import SceneSettings, find_program, run_program, scene_arguments

_END_SECONDS = 30  # for a process to end by itself after SIGTERM


def render(
    scene: PathLike,
    *,
    threads: Optional[int] = None,
    workers: int = 1,
    error_layer: bool = False,
    variance_layer: bool = False,
    quiet: bool = True,
    **settings: Unpack[SceneSettings],
) -> Image:
    """Renders a scene on this machine, by `candela render`, until one of the limits is reached.

    Without `iterations`, `time` and `until` the scene's sample_count is the limit. The image is the one that a
    farm makes of the same settings, to the last bit.
    """
    with tempfile.TemporaryDirectory(prefix="candela-") as folder:
        output = Path(folder) / "image.exr"
        arguments = ["render", os.fspath(scene), "-o", str(output), f"--workers={workers}"]
        arguments += [f"--threads={threads}"] if threads is not None else []
        arguments += ["--error-layer"] if error_layer else []
        arguments += ["--variance-layer"] if variance_layer else []
        arguments += ["--quiet"] if quiet else []
        run_program(arguments + scene_arguments(settings), quiet)
        return read_image(output)


class LocalFarm:
    """A master and workers on this machine, which end with the `with` statement.

        with candela.LocalFarm(workers=2) as farm:
            job = farm.submit("scene.xml", iterations=64)

    `data`: the master's folder, to go on with its jobs another time; otherwise it is removed at the end.
    """

    def __init__(self, workers: int = 1, threads: Optional[int] = None, data: Optional[PathLike] = None) -> None:
        self._workers = workers
        self._threads = threads if threads is not None else max(1, (os.cpu_count() or 1) // max(1, workers))
        self._data = data
        self._folder: Optional[tempfile.TemporaryDirectory[str]] = None
        self._processes: list[subprocess.Popen[str]] = []
        self._farm: Optional[Farm] = None

    def __enter__(self) -> Farm:
        self._folder = tempfile.TemporaryDirectory(prefix="candela-")
        try:
            folder = Path(self._folder.name)
            data = os.fspath(self._data) if self._data is not None else str(folder / "data")
            address = self._start_master(data, folder)
            for i in range(self._workers):
                self._start(
                    "candela-worker", folder, f"worker-{i + 1}", f"--master={address}", f"--cache={folder / 'cache'}",
                    f"--threads={self._threads}", f"--name=local-{i + 1}", f"--token-file={data}/token",
                )
            self._farm = Farm(address, token_file=f"{data}/token")
            return self._farm
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *_: object) -> None:
        if self._farm is not None:
            self._farm.close()
        # Workers first: they hand back what they have.
        for process in reversed(self._processes):
            process.terminate()
            try:
                process.wait(_END_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdout is not None:
                process.stdout.close()
        self._processes.clear()
        if self._folder is not None:
            self._folder.cleanup()

    def _start_master(self, data: str, folder: Path) -> str:
        process = self._start("candela-master", folder, "master", "--listen=127.0.0.1:0", f"--data={data}")
        assert process.stdout is not None
        line = process.stdout.readline()
        if not line.startswith("listening on "):
            raise CandelaError("the master did not start: " + (folder / "master.log").read_text().strip())
        return line.removeprefix("listening on ").strip()

    def _start(self, program: str, folder: Path, name: str, *arguments: str) -> subprocess.Popen[str]:
        with open(folder / f"{name}.log", "w", encoding="utf-8") as log:
            process = subprocess.Popen(
                [find_program(program), *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if program == "candela-master" else subprocess.DEVNULL,
                stderr=log,
                text=True,
                start_new_session=True,  # Ctrl-C is for Python, which ends them in order
            )
        self._processes.append(process)
        return process
