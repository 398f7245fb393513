"""backend="numpy" is the method's twin: rays, hits, kinds, counts of every generation, bit for bit.

Plan
- For meshes and option combinations that Hypothesis draws (partition, order, culling, heads, cells, head rule, layers,
  shadows, facing, shading, threshold, loop, errata; glass, mirrors and diffuse triangles): no difference at all.
- A table on a scene with ground and light, so that every option takes effect at least once; the forms as shaders too,
  with what their stages count.
- Every row of the table makes another trace than the row without it, so that no option is idle in both.
- Refused by both, in the same sentence.
- Longer tier: the table's options in pairs.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim import InputError, Rays, Scene
from refsim.results import Trace
from refsim.scene import Material
from tests.bsh.meshes import meshes, rays_at
from tests.bsh.traced import eye_rays, mixed
from tests.hre.bits import differences

METHOD = "traversal_list"
SURFACES = (Material("glass", "glass"), Material("mirror", "mirror"), Material("clay", "diffuse"))
PARTITIONS = [(1, None), (2, None), (6, None), (8, None), (6, "sextant_safe"), (6, "sextant_same"), (8, "octant")]
PARTITIONS += [(6, "sextant_opposite")]


def both(scene: Scene, rays: Rays, **options: Any) -> list[str]:
    """Where the two backends differ."""
    return differences(*(refsim.trace(METHOD, scene, rays, backend=name, **options) for name in ("numba", "numpy")))


@st.composite
def drawn(draw: st.DrawFn) -> tuple[Scene, Rays, dict[str, Any]]:
    """A scene of all surfaces, rays as an image, options."""
    triangles, seed = draw(meshes(most=20)), draw(st.integers(0, 2**16))
    ids = np.random.default_rng(seed).integers(0, 3, len(triangles)).astype(np.int32)
    scene, rays = Scene(triangles, materials=SURFACES, material_ids=ids), rays_at(triangles, 72, seed)
    lists, culling = draw(st.sampled_from(PARTITIONS))
    errata = draw(st.sampled_from(("corrected", "BSH-E9", "as_printed")))
    rows = draw(st.sets(st.integers(1, len(triangles) - 1), max_size=2)) if len(triangles) > 1 else ()
    options: dict[str, Any] = {
        "lists": lists,
        "culling": culling,
        "facing": "both" if culling is None and draw(st.booleans()) else "front",
        "errata": errata,
        "packet": errata == "as_printed" or draw(st.booleans()),
        "heads": draw(st.sampled_from((None, "simple", "regular"))) if scene.epsilon > 0 else None,
        "screen_cells": draw(st.sampled_from((None, 1, 3))),
        "head_rule": draw(st.sampled_from(("leaf", "climb"))),
        "order": draw(st.sampled_from(("earliest_first", "latest_last"))),
        "threshold": draw(st.sampled_from((0.5, 1.0, 0.2))),
        "shading": draw(st.sampled_from(("geometric", "smooth"))),
        "shadows": draw(st.booleans()),
        "generations": draw(st.integers(1, 4)),
        "layers": tuple(sorted(rows)),
    }
    return scene, Rays.unchecked(rays.origin, rays.direction, rays.t_max, 9, 8), options


@given(case=drawn())
@settings(max_examples=60)
def test_the_backends_agree(case: tuple[Scene, Rays, dict[str, Any]]) -> None:
    scene, rays, options = case
    assert both(scene, rays, **options) == []


# Each beside the options before it; the last names of a row are what the row is about
TABLE: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({}, {"lists": 1}),
    ({}, {"lists": 2}),
    ({}, {"lists": 8}),
    ({}, {"order": "latest_last"}),
    ({}, {"threshold": 1.0}),
    ({}, {"facing": "front"}),
    ({}, {"shading": "smooth"}),
    ({}, {"material": "mirror"}),
    ({}, {"ior": 1.2}),
    ({}, {"generations": 2}),
    ({}, {"shadows": True}),
    ({}, {"screen_cells": 5}),
    ({"screen_cells": 5}, {"head_rule": "climb"}),
    ({}, {"heads": "simple"}),
    ({}, {"heads": "regular"}),
    ({"heads": "regular"}, {"head_rule": "climb"}),
    ({"heads": "simple"}, {"errata": "BSH-E9"}),
    ({}, {"errata": ("BSH-E5",)}),
    ({"heads": "regular", "errata": "BSH-E9"}, {"errata": "as_printed"}),
    ({}, {"layers": (30, 100)}),
    ({"facing": "front"}, {"culling": "sextant_safe"}),
    ({"facing": "front"}, {"culling": "sextant_same"}),
    ({"facing": "front"}, {"culling": "sextant_opposite"}),
    ({"facing": "front", "lists": 8}, {"culling": "octant"}),
    ({"shadows": True, "layers": (50,)}, {"stage": "fragment"}),
    ({"shadows": True, "layers": (50,)}, {"stage": "vertex"}),
]
ROWS = [(*row, "+".join(f"{k}={v}" for part in row for k, v in part.items())) for row in TABLE]
SMALL = {"name": "torus_knot_100", "width": 14, "height": 12}


def plain(**options: Any) -> Trace:
    return refsim.trace(METHOD, mixed(), eye_rays(**SMALL), backend="numpy", **{"generations": 3, **options})


@pytest.mark.parametrize(("before", "more"), [row[:2] for row in ROWS], ids=[row[2] for row in ROWS])
def test_each_option_by_itself(before: dict[str, Any], more: dict[str, Any]) -> None:
    with_it = plain(**{**before, **more})
    compiled = refsim.trace(METHOD, mixed(), eye_rays(**SMALL), **{"generations": 3, **before, **more})
    assert differences(compiled, with_it) == []
    assert differences(plain(**before), with_it) != [], "the option does nothing here"


@pytest.mark.parametrize("option", [{"packet": False}, {"threads": 2}], ids=str)
def test_how_it_is_run_changes_nothing(option: dict[str, Any]) -> None:
    assert differences(plain(shadows=True), plain(shadows=True, **option)) == []


@pytest.mark.parametrize(
    "options",
    [
        {"culling": "octant", "facing": "front"},
        {"culling": "sextant_safe"},
        {"culling": "sextant_safe", "lists": 8, "facing": "front"},
        {"layers": (0,)},
        {"layers": (5, 5)},
        {"layers": (7, 3)},
        {"layers": (102,)},
        {"screen_cells": 4},
        {"screen_cells": 1025},
        {"lists": 3},
        {"heads": "all"},
        {"errata": "BSH-E8"},
        {"threshold": 1.5},
        {"threshold": 0.0},
        {"culling": "octant", "layers": (200,)},
    ],
    ids=str,
)
def test_refused_in_the_same_sentence(options: dict[str, Any]) -> None:
    rays = eye_rays(**SMALL)[:9] if options == {"screen_cells": 4} else eye_rays(**SMALL)
    sentences = []
    for backend in ("numba", "numpy"):
        with pytest.raises(InputError) as refusal:
            refsim.trace(METHOD, mixed(), rays, backend=backend, **options)
        sentences.append(str(refusal.value))
    assert sentences[0] == sentences[1]


@pytest.mark.slow
@pytest.mark.parametrize("pair", list(itertools.combinations(range(len(TABLE)), 2)), ids=str)
def test_options_in_pairs(pair: tuple[int, int]) -> None:
    first, second = ({**TABLE[k][0], **TABLE[k][1]} for k in pair)
    options = {"generations": 3, **first, **second}
    options["facing"] = "front" if options.get("culling") else options.get("facing", "both")
    if options.get("culling"):
        options["lists"] = 8 if options["culling"] == "octant" else 6
    assert both(mixed(), eye_rays(**SMALL), **options) == []
