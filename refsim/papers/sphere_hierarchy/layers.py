"""Layers (section 5): several lists in a row, "for instance, a static mid-poly one and a dynamic low-poly layer
recomputed at each frame".

In: a scene and the rows at which further layers begin; out: `Layers`, whose lists `search.search` goes through in turn.
A layer that moves is rebuilt or refitted alone, and only its bytes are copied (`byte_ranges.Changes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.byte_layout import bytes_of
from refsim.papers.sphere_hierarchy.byte_ranges import Changes, whole_copy
from refsim.papers.sphere_hierarchy.hierarchy import THRESHOLD, build_hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.refit import refit
from refsim.scene.mesh import Scene


def split_layers(scene: Scene, rows: Sequence[int] = ()) -> list[NDArray[np.float32]]:
    """The triangles of each layer, f32[k, 3, 3]: rows (968,) are the layers [0, 968) and [968, n).

    Raises `InputError` for rows that are no whole numbers, do not ascend or leave a layer empty.
    """
    n, before = len(scene), 0
    if not isinstance(rows, Sequence | np.ndarray):
        raise InputError(f"layers must be rows at which layers begin, not {rows!r}.")
    for row in rows:
        if isinstance(row, bool) or not isinstance(row, int | np.integer):
            raise InputError(f"layers must be whole numbers, the rows at which layers begin, not {row!r}.")
        if not before < row < n:
            raise InputError(
                f"layers name row {row}: rows must ascend from 1 to {n - 1}, so that no layer is empty."
            )
        before = int(row)
    bounds = [0, *map(int, rows), n]
    return [scene.triangles[a:b] for a, b in pairwise(bounds)]


class Frame(NamedTuple):
    """Layers after one of them changed, and what must be copied of it."""

    layers: Layers
    changes: Changes


@dataclass(frozen=True, eq=False)
class Layers:
    """Lists one after the other. Triangles are numbered through: a layer's follow those of the layer before."""

    lists: tuple[TraversalLists, ...]
    threshold: float = THRESHOLD

    @classmethod
    def of(
        cls, scene: Scene, rows: Sequence[int] = (), *, threshold: float = THRESHOLD, lists: int = 6,
        order: str = "earliest_first", culling: str | None = None,
    ) -> Layers:  # fmt: skip
        """The layers of a scene, each with a hierarchy of its own."""
        blocks = split_layers(scene, rows)
        return cls(tuple(_built(block, threshold, lists, order, culling) for block in blocks), threshold)

    @property
    def bytes(self) -> int:
        """Bytes of all layers on the device."""
        return sum(bytes_of(lists).total for lists in self.lists)

    def rebuild(self, number: int, triangles: ArrayLike) -> Frame:
        """Layer `number` built anew of triangles f32[k, 3, 3], any number from 1; all its bytes are copied."""
        old = self._layer(number)
        lists = _built(triangles, self.threshold, old.count, old.order, old.culling)
        return Frame(self._with(number, lists), whole_copy(lists))

    def refit(self, number: int, triangles: ArrayLike, gap: int = 0) -> Frame:
        """Layer `number` refitted to its own triangles, moved; the bytes that differ are copied."""
        lists, changes = refit(self._layer(number), triangles, gap)
        return Frame(self._with(number, lists), changes)

    def _layer(self, number: int) -> TraversalLists:
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or not 0 <= number < len(self.lists):
            raise InputError(f"there is no layer {number!r}; there are {len(self.lists)}, counted from 0.")
        return self.lists[number]

    def _with(self, number: int, lists: TraversalLists) -> Layers:
        return Layers((*self.lists[:number], lists, *self.lists[number + 1 :]), self.threshold)


def _built(triangles: ArrayLike, threshold: float, lists: int, order: str, culling: str | None) -> TraversalLists:
    scene = Scene(np.array(triangles, np.float32))  # a copy, so that the caller may go on with its own
    return build_lists(build_hierarchy(scene, threshold), lists, order, culling)
