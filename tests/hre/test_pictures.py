"""Pictures: rays that leave query the environment, and every method makes the same bytes.

Plan
- The image of every method and backend has the same bytes, glass, mirrors and diffuse surfaces alike.
- A pixel whose path leaves shows the environment in the direction of its last ray; where nothing is hit, behind it.
- A uniform environment seen through clear glass is uniform.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim.scene import CHECKER, SKY, Uniform

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"


def picture(method: str, name: str, **options: Any) -> refsim.results.Image:  # type: ignore[name-defined]
    return refsim.render(method, name, 33, 26, fill=0.6, **options)


@pytest.mark.parametrize("name", ["torus_knot_128", "cornell_box", "cubes"])
def test_same_bytes(name: str) -> None:
    expected = picture(BRUTE, name).rgb
    assert expected.shape == (26, 33, 3) and expected.dtype == np.float32
    for method in (BRUTE, RE, HRE):
        for backend in ("numba", "numpy"):
            assert picture(method, name, backend=backend).rgb.tobytes() == expected.tobytes(), (method, backend)
    assert picture(HRE, name, tile_size=5, submission="primitive").rgb.tobytes() == expected.tobytes()
    assert len(np.unique(expected.reshape(-1, 3), axis=0)) > 10


@pytest.mark.parametrize("environment", [SKY, CHECKER])
def test_rays_that_leave_see_the_environment(environment: Any) -> None:
    image = picture(HRE, "torus_knot_128", environment=environment)
    seen = environment.lookup(image.trace.exit_rays.direction).reshape(26, 33, 3)
    # Clear glass has the colour white, so nothing is tinted
    assert (image.rgb == seen).all()
    misses = image.trace.hits.triangle < 0
    behind = environment.lookup(image.trace.generations[0].rays.direction)
    assert misses.any() and (image.rgb.reshape(-1, 3)[misses] == behind[misses]).all()
    bent = ~misses & (image.rgb.reshape(-1, 3) != behind).any(axis=1)
    assert bent.any(), "glass shows what is straight behind it"


def test_uniform_light_through_clear_glass() -> None:
    image = picture(HRE, "blob_100", environment=Uniform((0.25, 0.5, 0.75)))
    assert (image.rgb == np.array([0.25, 0.5, 0.75], np.float32)).all()
