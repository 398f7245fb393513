"""The method "traversal_list": its options and how to run it. Registered in `refsim.methods`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.options import Option, choice, real, whole
from refsim.results import Trace
from refsim.scene import Rays, Scene


def _errata(value: Any) -> Any:
    from refsim.papers.sphere_hierarchy.errata import printed_text

    printed_text(value)
    return value


def _layers(value: Any) -> tuple[int, ...]:
    rows = value if isinstance(value, tuple | list) else (value,)
    whole_numbers = all(isinstance(row, int | np.integer) and not isinstance(row, bool) for row in rows)
    if not whole_numbers or any(row < 1 for row in rows):
        raise InputError(f"layers is {value!r}; it must be the rows, from 1, at which further layers begin.")
    return tuple(int(row) for row in rows)


LIST = (
    choice("lists", 6, (1, 2, 6, 8), "Traversal lists: partitions of the directions of space (Figure 2)."),
    choice("order", "earliest_first", ("earliest_first", "latest_last"), "How siblings are sorted along a list."),
    choice(
        "culling", None, (None, "sextant_opposite", "sextant_same", "sextant_safe", "octant"),
        "Which triangles a list leaves out; needs facing='front'.",
    ),
    choice("heads", None, (None, "simple", "regular"), "Per-polygon heads, for rays that leave a polygon."),
    whole("screen_cells", None, 1, 1024, "Heads for n × n cells of the picture, for eye rays."),
    choice("head_rule", "leaf", ("leaf", "climb"), "A head is the first surviving leaf, or an ancestor of it."),
    choice("packet", True, (True, False), "256 rays walk together, or each alone: same hits, same counts."),
    real("threshold", 0.5, 0.0, 1.0, "A triangle this big against its node stays there: share of the radius."),
    Option("layers", (), "Rows of the scene at which further layers begin, traversed in a row.", _layers),
    choice("shadows", False, (False, True), "Diffuse hits send a last ray to the scene's first light."),
    choice("stage", None, (None, "fragment", "vertex"), "The bare loop, or a shader of the pipeline."),
    Option("errata", "corrected", "What stands as printed: BSH-E5, BSH-E9.", _errata),
)  # fmt: skip


def run_traversal_list(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """The tracer of "Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA"."""
    from refsim.papers.sphere_hierarchy.setup import ListOptions
    from refsim.papers.sphere_hierarchy.tracer import trace_lists

    return trace_lists(scene, rays, ListOptions.of(options))
