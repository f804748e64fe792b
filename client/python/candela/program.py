"""The programs that this package calls, and the options that it gives them."""
from __future__ import annotations

import difflib
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Mapping, Sequence, TypedDict, Union

from .errors import UsageError, error_of_code

Duration = Union[float, str]


class SceneSettings(TypedDict, total=False):
    """What submit() and render() take beside the scene. Whatever is left out, the scene decides.

    See `candela submit --help` for the meaning of each.
    """

    integrator: str
    settings: Mapping[str, object]  # of the integrator, such as {"max_depth": 8}
    parameters: Mapping[str, object]  # the scene's $parameters
    spp: int
    iterations: int
    time: Duration  # seconds, or text such as "10m"
    until: float  # the estimated relMSE to stop at
    indices: str  # exactly these iterations of each half, such as "0-31/0-29", in place of a limit
    seed: int
    size: Union[tuple[int, int], str]  # pixels: (width, height), or text such as "640x480"
    crop: Union[tuple[int, int, int, int], str]  # pixels of the whole image: (left, top, width, height)
    filter: str
    sampler: str
    isa: str
    aov: Union[str, Sequence[str]]  # layers of what the camera sees first, such as ["albedo", "normal"]
    layers: Union[str, Mapping[str, str]]  # expressions by the names of layers, such as {"caustics": "LS+DE"}
    regions: Mapping[str, str]  # for @NAME in expressions, such as {"box": "box:0,0,0,1,1,1"}
    glossy_below: float
    light_groups: bool
    partition: bool
    edits: str  # a file of edits of light transport, or its JSON
    lenient: bool  # warn of unknown parameters of the scene, and go on


def find_program(name: str) -> str:
    """The program of this name: in $CANDELA_PROGRAMS, beside this package in a build, or on the path."""
    folders = [os.environ.get("CANDELA_PROGRAMS", ""), str(Path(__file__).resolve().parents[2] / "bin")]
    for folder in filter(None, folders):
        path = Path(folder) / name
        if os.access(path, os.X_OK):
            return str(path)
    found = shutil.which(name)
    if found is None:
        raise UsageError(f"there is no program {name}: set $CANDELA_PROGRAMS to the folder that has it")
    return found


def text_of(value: object) -> str:
    """A value as scene files and the command line write it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def size_text(value: object) -> str:
    """A size as --size takes it. The program checks the numbers."""
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence) and len(value) == 2:
        return f"{value[0]}x{value[1]}"
    raise UsageError(f"size: {value!r} is not a pair of numbers such as (640, 480)")


def crop_text(value: object) -> str:
    """A window as --crop takes it. The program checks the numbers."""
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence) and len(value) == 4:
        return ",".join(str(number) for number in value)
    raise UsageError(f"crop: {value!r} is not four numbers such as (640, 360, 200, 100)")


def pairs_of(key: str, value: object) -> Any:
    if isinstance(value, Mapping):
        return value.items()
    raise UsageError(f"{key}: {value!r} is not a dictionary of names and values")


def scene_arguments(settings: Mapping[str, Any]) -> list[str]:
    """The options of `candela submit` and `candela render` for these settings."""
    known = SceneSettings.__annotations__
    arguments: list[str] = []
    for key, value in settings.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)
            raise UsageError(f"there is no setting '{key}'" + (f" (did you mean '{near[0]}'?)" if near else ""))
        if value is None:
            continue
        if key == "settings":
            for name, inner in pairs_of(key, value):
                arguments += ["--set", f"{name}={text_of(inner)}"]
        elif key == "parameters":
            for name, inner in pairs_of(key, value):
                arguments += ["--define", f"{name}={text_of(inner)}"]
        elif key == "until":
            arguments += ["--until", f"relmse={value!r}"]
        elif key == "size":
            arguments += ["--size", size_text(value)]
        elif key == "crop":
            arguments += ["--crop", crop_text(value)]
        elif key == "aov":
            arguments += ["--aov", value if isinstance(value, str) else ",".join(value) or "none"]
        elif key == "layers" and isinstance(value, str):
            arguments += ["--layer", value]
        elif key in ("layers", "regions"):
            for name, inner in pairs_of(key, value):
                arguments += [f"--{key[:-1]}", f"{name}={inner}"]
        elif key in ("lenient", "light_groups", "partition"):
            arguments += [f"--{key.replace('_', '-')}"] if value else []
        else:
            arguments.append(f"--{key.replace('_', '-')}={text_of(value)}")
    return arguments


def run_program(arguments: Sequence[str], quiet: bool) -> str:
    """The standard output of `candela ARGUMENTS`. Raises what its exit code and its message say.

    The program's progress and warnings go to standard error unless `quiet`.
    """
    command = [find_program("candela"), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        message = ""
        try:
            for line in process.stderr:
                if line.startswith("candela: error: "):
                    message = line.removeprefix("candela: error: ").strip()
                elif not quiet:
                    print(line, end="", flush=True, file=_standard_error())
            output = process.stdout.read()
        except KeyboardInterrupt:
            # The terminal has sent it the signal as well. It keeps what can be resumed.
            process.wait()
            raise
        code = process.wait()
    if code != 0:
        raise error_of_code(code, message or f"candela ended with exit code {code}")
    return output


def _standard_error() -> Any:
    import sys

    return sys.stderr
