"""What a scene becomes before the first ray: options of the method "traversal_list", layers, lists, heads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from refsim.papers.sphere_hierarchy.culling import check_culling
from refsim.papers.sphere_hierarchy.errata import Printed, printed_text
from refsim.papers.sphere_hierarchy.layers import Layers
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.polygon_heads import PolygonHeads, polygon_heads
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
    heads: tuple[PolygonHeads, ...] | None


def prepare(scene: Scene, options: ListOptions) -> Prepared:
    """Builds hierarchies, lists and per-polygon heads. Raises `InputError` for layers that the scene does not have."""
    layers = Layers.of(
        scene, options.layers, threshold=options.threshold, lists=options.lists, order=options.order,
        culling=options.culling,
    ).lists  # fmt: skip
    # Where the scene is a single point nothing is hit, and there is no side to leave on
    if options.heads is None or not scene.epsilon > 0:
        return Prepared(scene, options, layers, None)
    # A ray that leaves a polygon goes on through the lists of every layer, so each layer has heads for all polygons
    heads = [
        polygon_heads(lists, scene.triangles, options.heads, options.head_rule, options.threads, scene.epsilon)
        for lists in layers
    ]
    return Prepared(scene, options, layers, tuple(heads))
