"""The result does not depend on threads, nor on what ran before.

Plan
- One and two threads give the same bytes: picture, every column of every pass, every count; large enough a picture for
  two threads to share slices and bins.
- The same run twice gives the same bytes. (Taps: `test_passes`.)
"""

from __future__ import annotations

import numpy as np
import pytest

from refsim.results import Trace
from tests.gsr.scenes import GLASS, MIRROR, SHINY, cornell, cornell_rays, soup, traced, wild


def bytes_of(trace: Trace) -> list[bytes]:
    assert trace.image is not None
    found = [trace.image.tobytes(), repr(dict(trace.counters)).encode()]
    for g in trace.generations:
        assert g.node is not None and g.light is not None and g.weight is not None
        columns: list[np.ndarray] = [g.alive, g.kind, g.pixel, g.parent, g.node, g.light, g.weight, *g.per_ray.values()]
        columns += [g.rays.origin, g.rays.direction, g.rays.t_max, g.hits.triangle, g.hits.t, g.hits.u, g.hits.v]
        found += [np.ascontiguousarray(column).tobytes() for column in columns] + [repr(dict(g.counters)).encode()]
    return found


@pytest.mark.parametrize("errata", ["corrected", "GSR-E1,GSR-E2,GSR-E5,GSR-E8,GSR-E9"])
def test_threads_change_nothing(errata: str) -> None:
    scene, rays = cornell(), cornell_rays(90, 70)
    one, two, three = (traced(scene, rays, passes=3, threads=threads, errata=errata) for threads in (1, 2, 3))
    assert bytes_of(one) == bytes_of(two) == bytes_of(three)
    assert one.counters["rays.shadow"] > 4096 < one.counters["stream_output.primitives"]


def test_a_run_leaves_nothing_behind() -> None:
    first = bytes_of(traced(cornell(), cornell_rays(), passes=3))
    traced(soup(5, 10, (GLASS, SHINY, MIRROR), 2), wild(14, 11, 5), passes=4)
    assert bytes_of(traced(cornell(), cornell_rays(), passes=3)) == first
