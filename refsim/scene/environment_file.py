"""Picture files of environments: .npy, Radiance .hdr and whatever Pillow reads, as linear RGB float32[h, w, 3].

Radiance: Greg Ward, "Real Pixels" (Graphics Gems II, 1991) and the Radiance file format notes: RGBE pixels, flat or
with run-length encoding by component, in the usual -Y h +X w order.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError

__all__ = ["read_environment_image"]

Float32 = NDArray[np.float32]


def read_environment_image(path: Path) -> Float32:
    """The picture in the file; ``InputError`` names the file and what is wrong with it."""
    label = f"environment file {str(path)!r}"
    if path.is_dir():
        raise InputError(f"{label} is a folder, not a picture")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{label} does not exist") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{label} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not data:
        raise InputError(f"{label} is empty")
    ending = path.suffix.lower()
    if ending == ".npy":
        return _npy(label, data)
    return _radiance(label, data) if ending in (".hdr", ".pic", ".rgbe") else _pillow(label, data)


def _npy(label: str, data: bytes) -> Float32:
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # whatever a damaged file provokes
        raise InputError(f"{label} cannot be read as .npy: {error}") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind != "f" or array.ndim != 3 or array.shape[2] != 3:
        raise InputError(f"{label} must hold floats of shape [h, w, 3]")
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float32)


def _pillow(label: str, data: bytes) -> Float32:
    try:
        from PIL import Image
    except ImportError:
        raise InputError(f"{label} needs Pillow to be read (or save it as .hdr or .npy)") from None
    try:
        with Image.open(io.BytesIO(data)) as picture:
            picture.load()
            if picture.mode.startswith("I"):  # 16-bit grey
                encoded = np.repeat(np.asarray(picture, np.float32)[:, :, None] / 65535.0, 3, axis=2)
            elif picture.mode == "F":  # floating point is linear already
                return np.repeat(np.asarray(picture, np.float32)[:, :, None], 3, axis=2)
            else:
                encoded = np.asarray(picture.convert("RGB"), np.float32) / 255.0
    except Exception as error:  # Pillow raises many kinds
        text = str(error) if not isinstance(error, OSError) or "cannot identify" not in str(error) else "unknown format"
        raise InputError(f"{label} cannot be read as a picture: {text}") from None
    return _linear(encoded)


def _linear(encoded: NDArray[np.floating]) -> Float32:
    # IEC 61966-2-1, sRGB to linear.
    low = encoded / 12.92
    high = ((encoded + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(np.float32)


def _radiance(label: str, data: bytes) -> Float32:
    size = re.search(rb"\n\n-Y +(\d{1,6}) +\+X +(\d{1,6})\n", data[:65_536])
    if not data.startswith(b"#?") or size is None:
        raise InputError(f"{label} is not a Radiance picture with -Y +X rows")
    height, width = int(size[1]), int(size[2])
    body = data[size.end() :]
    if not height or not width or b"32-bit_rle_xyze" in data[: size.start()]:
        raise InputError(f"{label} is a Radiance picture without pixels or not of RGB")
    # A run-length encoded row takes at least 4 bytes and a run; this bounds what a damaged header can ask for.
    if len(body) < height * 4 or height * width > len(body) * 64:
        raise InputError(f"{label} is truncated")
    rows = np.empty((height, width, 4), np.uint8)
    offset = 0
    for row in range(height):
        encoded = body[offset : offset + 4]
        if 8 <= width < 32_768 and encoded == bytes((2, 2, width >> 8, width & 255)):
            offset = _run_lengths(label, body, offset + 4, rows[row])
            continue
        flat = body[offset : offset + width * 4]
        if len(flat) < width * 4:
            raise InputError(f"{label} is truncated")
        rows[row] = np.frombuffer(flat, np.uint8).reshape(width, 4)
        offset += width * 4
    exponent = rows[:, :, 3:].astype(np.int32)
    # Mantissas are in 1/256 and the exponent has a bias of 128; exponent 0 means black.
    scale = np.where(exponent > 0, np.ldexp(np.float32(1.0), exponent - 136), np.float32(0.0))
    return (rows[:, :, :3] * scale).astype(np.float32)


def _run_lengths(label: str, body: bytes, offset: int, row: NDArray[np.uint8]) -> int:
    width = len(row)
    for component in range(4):
        filled = 0
        while filled < width:
            head = body[offset : offset + 2]
            count = (head[0] - 128 if head[0] > 128 else head[0]) if len(head) == 2 else 0
            run = len(head) == 2 and head[0] > 128
            values = head[1:] if run else body[offset + 1 : offset + 1 + count]
            if count == 0 or filled + count > width or len(values) < (1 if run else count):
                raise InputError(f"{label} is truncated or has a damaged row")
            row[filled : filled + count, component] = np.frombuffer(values, np.uint8)
            filled += count
            offset += 2 if run else 1 + count
    return offset
