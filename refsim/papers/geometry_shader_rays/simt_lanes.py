"""The lanes of a traced picture: which blocks of each shader every invocation ran, for `simt.account`.

In: a trace of "geometry_shader" or "fragment_grid". Out: blocks by shader, lanes in the order of the draw: rays in that
of the vertex buffer, finished ones among them; fragments of points in the order in which they were emitted; those of a
viewport quad in tiles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.counters import GEOMETRY_OUT
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.acceleration import Accelerator
from refsim.papers.geometry_shader_rays.bvh_nodes import search_hierarchy
from refsim.papers.geometry_shader_rays.costs import Search, Setup, Work, blocks, search_work
from refsim.papers.geometry_shader_rays.errata import printed_text
from refsim.papers.geometry_shader_rays.fragment_grid_costs import shooting_blocks
from refsim.papers.geometry_shader_rays.grid_traversal import search_grid
from refsim.papers.geometry_shader_rays.naive import all_triangles
from refsim.papers.geometry_shader_rays.pass_costs import surfaces_of
from refsim.papers.geometry_shader_rays.setup import lights_of
from refsim.papers.geometry_shader_rays.simt import Account, Block, account, pixel_order
from refsim.results import Generation, RayKind, Trace

TRAVERSE = {"naive": all_triangles, "grid": search_grid, "bvh": search_hierarchy}
Lanes = NDArray[np.int64]


def setup_of(trace: Trace) -> Setup:
    """What decides the cost of a trace's blocks."""
    options = trace.options
    choice = options["acceleration"]
    return Setup(
        choice.traverse if isinstance(choice, Accelerator) else TRAVERSE[choice],
        options.get("stages", "vertex"),
        len(lights_of(trace.scene, options["lights"])),
        int(options["shading"] == "smooth"),
        int(options.get("primary") == "raster"),
        options["background"],
        printed_text(options.get("errata", "corrected")),
        surfaces_of(trace.scene)[0],
    )


NOTHING = Work()


def _steps(work: Work, less: Work = NOTHING) -> int:
    return work.arithmetic + work.fetches - less.arithmetic - less.fetches


def _searched(search: Search, searched: Lanes, cells: Lanes, tests: Lanes) -> list[Block]:
    """What a search runs through."""
    return [
        Block("search", _steps(search.outside), searched),
        Block("walking", _steps(search.walking), (cells > 0).astype(np.int64)),
        Block("cells", _steps(search.cell), cells, False),
        Block("tests", _steps(search.test), tests, False),
    ]


class _Pass:
    """A pass of the geometry shader's method and its lanes."""

    def __init__(self, trace: Trace, k: int) -> None:
        self.trace, self.k, self.setup = trace, k, setup_of(trace)
        self.cost, self.search = blocks(self.setup), search_work(self.setup.traverse)
        self.generation: Generation = trace.generations[k]
        self.next = trace.generations[k + 1] if k + 1 < len(trace.generations) else None
        self.lanes = self.generation.counters["vertex.invocations"]

    def lane(self, of_row: NDArray[Any]) -> Lanes:
        """Numbers of the generation's rows as numbers of lanes; 0 for finished rays."""
        lanes = np.zeros(self.lanes, np.int64)
        assert self.generation.slot is not None
        lanes[self.generation.slot] = of_row
        return lanes

    def shooting(self) -> list[Block]:
        g, cost = self.generation, self.cost
        cells, tests = self.lane(g.per_ray["cells"]), self.lane(g.per_ray["triangle_tests"])
        later = "vertex.eye" if self.k == 0 else "vertex.later"
        searched = g.alive
        if self.setup.rasterised and self.k == 0:  # the others hit the triangle that was drawn
            drawn = (g.hits.triangle >= 0) & (g.per_ray["cells"] == 0) & (g.per_ray["triangle_tests"] == 1)
            searched = searched & ~drawn
        return [
            Block("start", _steps(cost["vertex.finished"]), np.ones(self.lanes, np.int64), False),
            Block("shot", _steps(cost[later], cost["vertex.finished"]), self.lane(g.alive)),
            *_searched(self.search, self.lane(searched), cells, tests),
        ]

    def passed(self) -> NDArray[np.bool_]:
        """Rows of the rays that were passed on."""
        g = self.generation
        hit = g.hits.triangle >= 0
        passed = sum(g.counters[name] for name in GEOMETRY_OUT if "passed" in name)
        return hit | (g.alive & (g.kind >= RayKind.REFLECTED)) if passed > int(hit.sum()) else hit

    def spawning(self) -> list[Block]:
        g, cost = self.generation, self.cost
        sends = (g.hits.triangle >= 0) & (g.kind != RayKind.SHADOW) & (self.next is not None)
        if self.setup.printed.E5:
            sends &= g.kind == RayKind.EYE
        found = [
            Block("start", _steps(cost["geometry.kept"]), np.ones(self.lanes, np.int64), False),
            Block("spawning", _steps(cost["geometry.spawning"], cost["geometry.kept"]), self.lane(sends)),
            Block("passed", _steps(cost["geometry.passed"]), self.lane(self.passed())),
        ]
        for kind in (RayKind.SHADOW, RayKind.REFLECTED, RayKind.REFRACTED):
            children = np.zeros(len(g.rays), np.int64)
            if self.next is not None:
                children = np.bincount(self.next.parent[self.next.kind == kind], minlength=len(g.rays))
            name = kind.name.lower()
            found.append(Block(name, _steps(cost[f"geometry.{name}"]), self.lane(children)))
        return found

    def shading(self) -> list[Block]:
        """Fragments of all emitted points; those not passed on are new and discarded."""
        g, cost = self.generation, self.cost
        count = g.counters["fragment.invocations"]
        rows = np.flatnonzero(self.passed())
        ready = np.ones(count, np.bool_)
        if self.setup.stages == "vertex_only":
            ready[:], ready[rows] = False, True
        elif self.next is not None:
            assert self.next.slot is not None
            ready[self.next.slot] = False
        if self.setup.stages != "vertex_only" and self.setup.printed.E3:  # no ray ever is to be shaded
            rows, ready = rows[:0], np.zeros(count, np.bool_)
        discarded = cost["fragment.discarded"]
        whole = np.zeros(count, np.int64)
        names = np.full(len(rows), "fragment.missed", object)
        hit = g.hits.triangle[rows] >= 0
        names[hit & (g.kind[rows] == RayKind.SHADOW)] = "fragment.shadow"
        surface = hit & (g.kind[rows] != RayKind.SHADOW)
        numbers = surfaces_of(self.trace.scene)[1][g.hits.triangle[rows][surface]]
        names[surface] = [f"fragment.surface.{n}" for n in numbers]
        own = np.array([_steps(cost[name], discarded) for name in names], np.int64)
        found = [Block("start", _steps(discarded), np.ones(count, np.int64), False)]
        for name, rows_of in (("shadow", names == "fragment.shadow"), ("missed", names == "fragment.missed"),
                              ("surface", surface)):  # fmt: skip
            trips = whole.copy()
            trips[ready] = own * rows_of
            found.append(Block(name, 1, trips))
        return found


def accounts(trace: Trace, width: int, reconverge: bool = True, quads: bool = False) -> dict[str, Account]:
    """The account of each shader over all passes.

    Of "geometry_shader": "vertex", "geometry", "fragment", and "together", what vertex and geometry shader are as one;
    a trace whose geometry shader intersects has only the last two. `quads`: each point's fragment fills a quad. Of
    "fragment_grid": "fragment", the passes that shoot rays.
    """
    if trace.method == "fragment_grid":
        return {"fragment": _summed([account(each, width, reconverge) for each in _quad_lanes(trace, width)])}
    if trace.method != "geometry_shader":
        raise InputError(f"{trace.method!r} has no account of warps; geometry_shader and fragment_grid have.")
    passes = [_Pass(trace, k) for k in range(len(trace.generations))]
    stages = trace.options["stages"]
    drawn: dict[str, list[list[Block]]] = {"fragment": [each.shading() for each in passes]}
    if stages != "geometry":
        drawn["vertex"] = [each.shooting() for each in passes]
    if stages == "vertex":
        drawn["geometry"] = [each.spawning() for each in passes]
    if stages != "vertex_only":
        drawn["together"] = [each.shooting() + each.spawning() for each in passes]
    return {
        shader: _summed([account(each, width, reconverge, quads and shader == "fragment") for each in draws])
        for shader, draws in drawn.items()
    }


def _summed(found: list[Account]) -> Account:
    total = found[0]
    for each in found[1:]:
        total = total.plus(each)
    return total


def _quad_lanes(trace: Trace, width: int) -> list[list[Block]]:
    """The shooting passes of "fragment_grid": every pixel is a lane, dead ones too."""
    setup = setup_of(trace)
    search = search_work(setup.traverse)
    rays = trace.generations[0].rays
    if rays.width is None or rays.height is None:
        raise InputError("an account of fragments needs rays that are a picture's, of known width and height.")
    order = pixel_order(rays.width, rays.height, width)
    inside = order >= 0
    pixels = np.where(inside, order, 0)

    def lanes(values: NDArray[Any]) -> Lanes:
        return np.where(inside, values[pixels], 0).astype(np.int64)

    found = []
    for g in trace.generations:
        cost = shooting_blocks(setup, int(g.kind[0]))
        sent = g.parent_generation >= 0
        senders = trace.generations[g.parent_generation].hits.triangle if sent else np.full(len(rays), -1)
        cells, tests = lanes(g.per_ray["cells"]), lanes(g.per_ray["triangle_tests"])
        found.append([
            Block("start", _steps(cost.idle), inside.astype(np.int64), False),
            Block("refused", _steps(cost.refused, cost.idle), lanes((senders >= 0) & ~g.alive)),
            Block("sent", _steps(cost.sent, cost.idle), lanes(g.alive)),
            *_searched(search, lanes(g.alive), cells, tests),
        ])  # fmt: skip
    return found
