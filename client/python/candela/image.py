"""OpenEXR images as NumPy arrays with their layers and metadata."""
from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import UsageError

Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Image:
    """An image of a job: linear Rec.709 RGB, height x width x 3. So is each of its layers, but for AOVs, which
    have as many channels as their values have: one (depth, coverage, indices), two (uv) or three.

    numpy.asarray(image) is `rgb`.
    """

    rgb: Array
    layers: dict[str, Array] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)  # "candela:iterations" and so on
    exr: bytes = field(default=b"", repr=False)  # the file as the farm made it

    def __repr__(self) -> str:
        layers = "".join(f", {name}" for name in self.layers)
        return f"<Image {self.width}x{self.height}: rgb{layers}>"

    @property
    def shape(self) -> tuple[int, ...]:
        """That of `rgb`: height, width, 3."""
        return self.rgb.shape

    @property
    def width(self) -> int:
        return int(self.rgb.shape[1])

    @property
    def height(self) -> int:
        return int(self.rgb.shape[0])

    def __array__(self, dtype: Any = None, copy: Any = None) -> npt.NDArray[Any]:
        return self.rgb if dtype is None else self.rgb.astype(dtype)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the EXR file whole, or not at all."""
        target = Path(path)
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=target.name, delete=False) as file:
            file.write(self.exr)
        os.replace(file.name, target)

    def srgb(self, exposure: float = 0) -> npt.NDArray[np.uint8]:
        """The image for a screen: 8 bits of sRGB, as `candela convert` makes it."""
        linear = np.clip(np.nan_to_num(self.rgb.astype(np.float64) * 2**exposure), 0, 1)
        curve = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
        return (255 * curve + 0.5).astype(np.uint8)


def read_image(path: str | os.PathLike[str]) -> Image:
    """Reads an EXR file with R, G and B, and its layers: channels NAME.R, NAME.G and NAME.B, or NAME and other
    letters that layers of Candela have."""
    try:
        import OpenImageIO as oiio
    except ImportError as error:
        raise UsageError("OpenImageIO's Python module is missing (Debian: python3-openimageio)") from error
    source = oiio.ImageInput.open(os.fspath(path))
    if source is None:
        raise UsageError(f"{os.fspath(path)}: {oiio.geterror()}")
    try:
        spec = source.spec()
        pixels = source.read_image(oiio.FLOAT)
        if pixels is None:
            raise UsageError(f"{os.fspath(path)}: {source.geterror()}")
    finally:
        source.close()
    channel = {name: i for i, name in enumerate(spec.channelnames)}

    def planes(prefix: str, letters: str = "RGB") -> Array:
        return np.ascontiguousarray(pixels[:, :, [channel[prefix + c] for c in letters]], dtype=np.float32)

    if not all(c in channel for c in "RGB"):
        raise UsageError(f"{os.fspath(path)}: the image has no channels R, G and B")
    layers: dict[str, Array] = {}
    for full_name in spec.channelnames:
        name, dot, _ = full_name.rpartition(".")
        for letters in ("RGB", "XYZ", "UV", "Z", "Y", "I"):
            if dot and name not in layers and all(f"{name}.{c}" in channel for c in letters):
                layers[name] = planes(name + ".", letters)
    metadata = {a.name: a.value for a in spec.extra_attribs if isinstance(a.value, str)}
    return Image(planes(""), layers, metadata, Path(path).read_bytes())


def decode_image(exr: bytes) -> Image:
    """The image of a file in memory."""
    with tempfile.TemporaryDirectory(prefix="candela-") as folder:
        path = Path(folder) / "image.exr"
        path.write_bytes(exr)
        return read_image(path)
