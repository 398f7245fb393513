"""What a scene becomes before the first ray: options of the method "traversal_list", layers, lists, heads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.culling import check_culling
from refsim.papers.sphere_hierarchy.errata import Printed, printed_text
from refsim.papers.sphere_hierarchy.hierarchy import hierarchy_of
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.scene.mesh import Scene


class ListOptions(NamedTuple):
    """The method's options, checked; names and meanings as in `refsim.list_method`."""

    generations: int
    ior: float
    facing: str
    smooth: bool
    lists: int
    order: str
    culling: str | None
    heads: str | None
    head_rule: str
    screen_cells: int | None
    packet: bool
    threshold: float
    layers: tuple[int, ...]
    shadows: bool
    stage: str | None
    printed: Printed
    threads: int | None

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> ListOptions:
        """From option values; `InputError` for a culling rule that does not fit the rest."""
        check_culling(options["culling"], options["lists"], options["facing"])
        given = {name: options[name] for name in cls._fields if name in options}
        return cls(**given, smooth=options["shading"] == "smooth", printed=printed_text(options["errata"]))


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene ready for rays: the lists of each layer and, where asked for, the heads of every polygon in them."""

    scene: Scene
    options: ListOptions
    layers: tuple[TraversalLists, ...]
    heads: tuple[Any, ...] | None


def prepare(scene: Scene, options: ListOptions) -> Prepared:
    """Builds hierarchies, lists and per-polygon heads. Raises `InputError` for layers that the scene does not have."""
    cuts = (0, *options.layers, len(scene))
    if any(begin >= end for begin, end in pairwise(cuts)):
        raise InputError(f"layers begin at rows {options.layers}; they must ascend within {len(scene)} triangles.")
    layers = []
    for begin, end in pairwise(cuts):
        hierarchy = hierarchy_of(np.ascontiguousarray(scene.triangles[begin:end]), options.threshold)
        layers.append(build_lists(hierarchy, options.lists, options.order, options.culling))
    heads = None
    if options.heads is not None:
        from refsim.papers.sphere_hierarchy.polygon_heads import polygon_heads

        heads = tuple(
            polygon_heads(lists, scene.triangles, options.heads, options.head_rule, options.threads, scene.epsilon)
            for lists in layers
        )  # fmt: skip
    return Prepared(scene, options, tuple(layers), heads)
