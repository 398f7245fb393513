"""Pictures for figures: rendered by the hierarchical algorithm, kept in memory between measuring and plotting."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.runs import HIERARCHICAL, scene_named
from refsim.image import encode_srgb
from refsim.methods import render
from refsim.results import Image


@lru_cache(maxsize=8)
def picture(
    scene: str,
    width: int,
    height: int,
    fill: float,
    generations: int = 8,
    shading: str = "smooth",
    tile_size: int = 16,
    backend: str = "numba",
) -> Image:
    """`refsim.render` of a scene with the Hierarchical Ray Engine; refraction by interpolated normals unless told."""
    options: dict[str, Any] = {"generations": generations, "shading": shading, "tile_size": tile_size}
    return render(HIERARCHICAL, scene_named(scene), width, height, fill=fill, backend=backend, **options)


def averaged(values: NDArray[np.floating], samples: int) -> NDArray[np.floating]:
    """Means over squares of samples × samples pixels: [h, w, …] -> [h / samples, w / samples, …]."""
    height, width = values.shape[0] // samples, values.shape[1] // samples
    blocks = values[: height * samples, : width * samples].reshape(height, samples, width, samples, *values.shape[2:])
    return blocks.mean(axis=(1, 3))


def srgb(image: Image) -> NDArray[np.uint8]:
    """The picture as 8-bit sRGB."""
    return encode_srgb(image.rgb)
