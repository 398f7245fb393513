"""Thrane and Simonsen's list with boxes, in plain Python: the escape indices of a list of spheres, the boxes of what
stands between an element and the one it escapes to. Twin of `refsim.papers.sphere_hierarchy.boxes`.
"""

from __future__ import annotations

import numpy as np

from refsim.reference.list_search import Walked
from refsim.reference.one_ray import F, OneRay, every_ray, rounded_out
from refsim.reference.sphere import acceptance_margin
from refsim.reference.traversal_lists import Lists
from refsim.reference.triangle import pack


def boxes_of(lists: Lists) -> np.ndarray:
    """The box of every element of a single list, f32[k, 6], with the margins of its triangles."""
    triangles = lists.tree.triangles.astype(np.float64)
    margin = acceptance_margin(lists.tree.triangles)[:, None]
    low, high = rounded_out(triangles.min(axis=1) - margin, triangles.max(axis=1) + margin)
    is_triangle, row = lists.is_triangle(), lists.payload[:, 3]
    boxes = []
    for at, step in enumerate(lists.escape):
        end = at + step if step > 0 else len(lists.escape)
        below = row[at:end][is_triangle[at:end]]
        boxes.append(np.concatenate([low[below].min(axis=0), high[below].max(axis=0)]))
    return np.array(boxes, F)


def search_boxes(
    lists: Lists,
    origin: np.ndarray,
    direction: np.ndarray,
    t_max: np.ndarray,
    any_hit: bool = False,
    front_only: bool = False,
) -> Walked:
    """What rays f32[n, 3] hit, and their counts."""
    boxes, is_triangle = boxes_of(lists), lists.is_triangle()

    def search(ray: OneRay) -> tuple[int, ...]:
        slack, inverse = ray.slack(lists.tree.spheres[0]), F(1) / ray.kept_from_zero()
        at = 0
        while at < len(boxes) and not ray.done:
            step = int(lists.escape[at])
            if is_triangle[at]:
                ray.test(int(lists.payload[at, 3]))
            else:
                ray.nodes += 1
                one = ((boxes[at, :3] - ray.o) - slack) * inverse
                other = ((boxes[at, 3:] - ray.o) + slack) * inverse
                if slack == np.inf:
                    step = 1
                else:
                    enter = max(np.minimum(one, other).max(), F(0))
                    if enter <= np.maximum(one, other).min() and enter <= ray.best:
                        step = 1
            at = at + step if step > 0 else len(boxes)
        return ()

    records = pack(lists.tree.triangles)
    return every_ray(origin, direction, t_max, records, any_hit, front_only, search)[0]
