"""A picture on disk: linear light to 8-bit sRGB, and a PNG that is there whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError


def encode_srgb(rgb: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear colour ``[..., 3]`` in [0, 1] as 8-bit sRGB, nearest value; what is outside [0, 1] saturates.

    The curve is IEC 61966-2-1's. Raises ValueError for a colour that is not a number: no pixel stands for it.
    """
    if np.isnan(rgb).any():
        raise ValueError("a colour is not a number")
    linear = np.clip(rgb, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)
    return np.floor(255.0 * curve + 0.5).astype(np.uint8)


def check_destination(path: str | Path) -> None:
    """Refuse a ``path`` that :func:`write_png` could not write, before any work is done for it; leaves no file."""
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise InputError(f"cannot write the image {str(path)!r}: the name must end in .png")
    if path.is_dir():
        raise InputError(f"cannot write the image {str(path)!r}: it is a directory")
    with _refusing(path), tempfile.TemporaryFile(dir=path.parent):
        pass


def write_png(path: str | Path, rgb: NDArray[np.floating]) -> None:
    """Write linear colour ``[height, width, 3]`` (row 0 is the top) as a PNG; an older file survives any failure."""
    from PIL import Image

    path, picture = Path(path), Image.fromarray(encode_srgb(rgb))
    with _refusing(path):
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                picture.save(file, format="PNG")
            # mkstemp makes files private; a picture gets the mode that any new file would have.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn the system's refusal into a sentence about ``path``."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(f"cannot write the image {str(path)!r}: {reason}") from error
