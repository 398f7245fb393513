"""What copying lists to the device takes, and how much of it rendering hides (sections 4 and 5, Table 3).

A model: a copy costs a fixed time and its bytes over a rate; a copy that does not block runs beside the kernel that
renders the frame before, as fast as alone. The device then holds two scenes. No machine is measured here: rates and
times are the caller's, the paper's for instance, and `fit_link` tells which link fits such times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError


class Link(NamedTuple):
    """rate in bytes a second; fixed, seconds that each copy takes beyond that."""

    rate: float
    fixed: float = 0.0


class LinkFit(NamedTuple):
    """The link that fits measured copies best; residuals f64[n], measured − fitted seconds."""

    link: Link
    residuals: NDArray[np.float64]


class Overlap(NamedTuple):
    """Seconds of preparing and copying that rendering hides, and that it does not."""

    hidden: float
    exposed: float


class Schedule(NamedTuple):
    """Frames one after the other; f64[n] seconds a frame.

    hidden, exposed  parts of its preparation and copy before and after the frame before it was rendered
    start            when its kernel begins, seconds from the first preparation
    total            when the last kernel ends
    blocking         the same frames where nothing overlaps
    """

    hidden: NDArray[np.float64]
    exposed: NDArray[np.float64]
    start: NDArray[np.float64]
    total: float
    blocking: float


def copy_seconds(link: Link, size: int, copies: int = 1) -> float:
    """What `copies` copies of `size` bytes together take."""
    _check_link(link)
    if size < 0 or copies < 0:
        raise InputError(f"{copies} copies of {size} bytes cannot be: neither may be negative.")
    return copies * link.fixed + size / link.rate


def merging_gap(link: Link) -> int:
    """Bytes that may as well be copied as left out: more of them cost more than a further copy."""
    _check_link(link)
    return int(link.fixed * link.rate)


def overlap(prepared: float, rendering: float) -> Overlap:
    """Of `prepared` seconds (a copy, with the host's work before it) those hidden behind `rendering` seconds."""
    _times([prepared, rendering], "times")
    hidden = min(prepared, rendering)
    return Overlap(hidden, prepared - hidden)


def schedule(prepared: Sequence[float], rendering: Sequence[float]) -> Schedule:
    """Frames of which each is prepared and copied while the one before is rendered; the first has none before it."""
    ahead, kernels = _times(prepared, "prepared"), _times(rendering, "rendering")
    if len(ahead) != len(kernels) or not len(ahead):
        raise InputError(f"a schedule needs a copy for each of one frame or more, not {len(ahead)} for {len(kernels)}.")
    before = np.append(0.0, kernels[:-1])
    hidden = np.minimum(ahead, before)
    exposed = ahead - hidden
    start = np.cumsum(before + exposed)
    total, blocking = float(start[-1] + kernels[-1]), float(ahead.sum() + kernels.sum())
    return Schedule(hidden, exposed, start, total, blocking)


def fit_link(sizes: ArrayLike, seconds: ArrayLike) -> LinkFit:
    """Fixed time and rate by least squares over measured copies of `sizes` bytes: seconds = fixed + bytes / rate.

    Raises `InputError` for fewer than two different sizes, and where more bytes take no more time: no rate does that.
    """
    x, y = _times(sizes, "sizes"), _times(seconds, "seconds")
    if len(x) != len(y) or len(np.unique(x)) < 2:
        raise InputError(f"a fit needs copies of two sizes or more with a time each, not {len(x)} and {len(y)}.")
    off = x - x.mean()
    slope = float((off * y).sum() / (off * off).sum())
    if not slope > 0.0:
        raise InputError("a fit of these copies has no rate: larger ones take no longer.")
    fixed = float(y.mean() - slope * x.mean())
    return LinkFit(Link(1.0 / slope, fixed), y - (fixed + slope * x))


def _times(values: ArrayLike, name: str) -> NDArray[np.float64]:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or not np.isfinite(array).all() or (array < 0).any():
        raise InputError(f"{name} must be finite numbers from 0, one dimension.")
    return array


def _check_link(link: Link) -> None:
    if not (np.isfinite(link.rate) and link.rate > 0.0 and np.isfinite(link.fixed) and link.fixed >= 0.0):
        raise InputError(f"a link needs a rate above 0 and a fixed time from 0, not {link.rate!r} and {link.fixed!r}.")
