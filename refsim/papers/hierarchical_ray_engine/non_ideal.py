"""Non-ideal objects behind glass: the engine's passes over ideal triangles, and its exit rays on all others.

Section 5 of The Hierarchical Ray Engine: paths are followed "through multiple ideal reflections and refractions, until
the exiting rays do not hit an ideal surface any more. These final rays we get as a result can […] be traced against the
non-ideal geometry"; section 9 leaves it as future work. Here a generation's triangles are drawn in two draws over the
same cones, chosen from one vertex buffer by index: the ideal ones (glass, mirrors), and the non-ideal ones (diffuse).

    rule "final_rays"   as the paper says: every pass draws the ideal triangles alone, and one more pass, with cones of
                        its own, draws the non-ideal ones over the rays that left. What stands in front of glass,
                        between two glass bodies or inside one is drawn through: the path has passed it by then.
    rule "nearest"      the correction, and the default: every pass draws the non-ideal triangles too, into the depth
                        that the ideal ones left. Where one is nearer the path ends there, and the draw takes the
                        pixel's stencil bit back: a pixel whose path has ended is not shaded in the next pass.

`refsim.trace("hierarchical_ray_engine", …)` draws both kinds at once. The rule "nearest" finds the same hits unless
an ideal and a non-ideal triangle are hit at one depth: here the ideal one was drawn first and stays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.geometry.cone import Printed
from refsim.papers.hierarchical_ray_engine import passes, shaders
from refsim.papers.hierarchical_ray_engine.errata import printed_formulas
from refsim.papers.hierarchical_ray_engine.path_end_shaders import END_TARGETS, EndUniforms, PathTextures, end_pass
from refsim.papers.hierarchical_ray_engine.results import cones_of, generation_of, ray_textures, trace_of
from refsim.papers.hierarchical_ray_engine.tracer import (
    CORNERS_OF_CONE_PASS,
    EngineOptions,
    build_cones,
    depth_scale,
    next_target,
    read_back,
    stencil_state,
    with_cones,
)
from refsim.papers.hierarchical_ray_engine.vertices import corner_vertices, tile_vertices, triangle_vertices
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, Texture
from refsim.pipeline.state import DepthStencilFormat, DynamicState, EarlyTests, ScissorRect
from refsim.results import Generation, Trace
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays

Rule = Literal["nearest", "final_rays"]
RULES: tuple[Rule, ...] = get_args(Rule)
AfterPass = Callable[[int, Framebuffer, Counters], None]


@dataclass(frozen=True, eq=False)
class Followed:
    """Paths followed to their ends: a generation a pass, and targets (`path_end_shaders.PathEnd`) of where they ended.

    `ends` is padded to whole tiles; `image` is the part that holds rays. A path that goes on after the last generation
    has none: its generation is −1.
    """

    generations: list[Generation]
    ends: Framebuffer
    image: ScissorRect


def engine_options(
    generations: int = 5,
    ior: float = 1.5,
    facing: str = "both",
    shading: str = "geometric",
    depth_format: DepthStencilFormat = DepthStencilFormat.DEPTH32FLOAT_STENCIL8,
    threads: int | None = None,
) -> EngineOptions:
    """Options as `refsim.trace` names them; `InputError` for a value that none has."""
    if isinstance(generations, bool) or not isinstance(generations, int) or not 1 <= generations <= 64:
        raise InputError(f"generations is {generations!r}; it must be a whole number from 1 to 64.")
    if facing not in ("both", "front") or shading not in ("geometric", "smooth"):
        raise InputError(f"facing is both or front and shading geometric or smooth, not {facing!r} and {shading!r}.")
    if not (isinstance(ior, int | float) and 0.0 < ior < np.inf):
        raise InputError(f"ior is {ior!r}; it must be a finite number above 0.")
    smooth = shading == "smooth"
    return EngineOptions(generations, ior, facing, smooth, EarlyTests.IDEAL, depth_format, True, threads, None)


def check_tile_size(tile_size: int) -> None:
    """`InputError` for what is no size of a tile."""
    if isinstance(tile_size, bool) or not isinstance(tile_size, int) or not 1 <= tile_size <= 64:
        raise InputError(f"tile_size is {tile_size!r}; it must be a whole number from 1 to 64.")


def trace_non_ideal(
    scene: Scene,
    rays: Rays,
    *,
    rule: Rule = "nearest",
    tile_size: int = 16,
    errata: str | Sequence[str] = "corrected",
    **options: Any,
) -> Trace:
    """The paths of `rays`, glass and mirrors followed and diffuse triangles found by `rule`; a `refsim.results.Trace`.

    `options` are those of `engine_options`. With "final_rays" one generation follows the passes: the rays with which
    the paths left, shot at the non-ideal triangles (`rays.*` does not count them again). `refsim.shading.shade` makes
    a picture of either. `InputError` names an argument that is wrong.
    """
    if rule not in RULES:
        raise InputError(f"rule is {rule!r}; it must be one of {', '.join(map(repr, RULES))}.")
    followed = follow(scene, rays, engine_options(**options), tile_size, printed_formulas(errata), rule)
    found = trace_of("hierarchical_ray_engine", scene, rays, followed.generations)
    return replace(found, options={"rule": rule, "tile_size": tile_size, **options})


def ending_triangles(trace: Trace) -> NDArray[np.int32]:
    """int32[n]: the non-ideal triangle on which each path ends; −1 where it leaves the scene or does not end."""
    ends = np.full(len(trace.generations[0].rays), -1, np.int32)
    diffuse = trace.scene.optical_indices() < 0
    for generation in trace.generations:
        triangle = generation.hits.triangle
        ended = (triangle >= 0) & diffuse[triangle]
        ends[ended] = triangle[ended]
    return ends


def rows_of(planes: NDArray[Any], image: ScissorRect, count: int) -> NDArray[Any]:
    """The image's part of planes [k, h, w] as contiguous rows [count, k]."""
    return np.ascontiguousarray(planes[:, : image.height, : image.width].reshape(len(planes), -1)[:, :count].T)


def erasing_state(generation: int, image: ScissorRect) -> DynamicState:
    """The stencil state of a generation, but what passes clears the generation's bit: the path ends there."""
    state = stencil_state(generation, image)
    return state._replace(stencil_reference=state.stencil_reference & ~state.stencil_write_mask)


def follow(
    scene: Scene,
    rays: Rays,
    options: EngineOptions,
    tile_size: int,
    printed: Printed,
    rule: Rule,
    epsilon: np.float32 | None = None,
    after_pass: AfterPass | None = None,
) -> Followed:
    """All generations. `epsilon`: how far off a surface a new ray starts (the scene's); `after_pass(k, target,
    counters)` may draw with what pass k found."""
    check_tile_size(tile_size)
    engine = _Engine(scene, rays, options, tile_size, printed, scene.epsilon if epsilon is None else epsilon)
    ideal, others = engine.triangles_by_kind()
    textures, stencil, kind = engine.eye, None, Texture(np.zeros((1, *engine.shape), np.int32))
    found: list[Generation] = []
    for k in range(options.generations):
        counters = Counters()
        target = next_target(*engine.size, options.depth_format, stencil)
        draws = [(ideal, stencil_state(k, engine.image))]
        if rule == "nearest":
            draws.append((others, erasing_state(k, engine.image)))
        cones = engine.draw_triangles(draws, textures, target, counters)
        tested = sum(len(rows) for rows, _ in draws)
        generation = generation_of(rays, textures, target, engine.image, found, counters, cones, tested)
        engine.keep_ends(k, textures, target, kind, generation.counters)
        if after_pass is not None:
            after_pass(k, target, generation.counters)
        found.append(generation)
        textures = shaders.RayTextures(target.texture("origin"), target.texture("direction"))
        stencil, kind = target.stencil, target.texture("kind")
    if rule == "final_rays":
        found.append(engine.final_rays(others, found[-1]))
    return Followed(found, engine.ends, engine.image)


class _Engine:
    """What all passes of one run share: buffers, sizes, pipelines, and the targets of the paths' ends."""

    def __init__(
        self, scene: Scene, rays: Rays, options: EngineOptions, tile_size: int, printed: Printed, epsilon: np.float32
    ) -> None:
        self.scene, self.rays, self.options = scene, rays, options
        self.tile_size, self.printed, self.epsilon = tile_size, printed, epsilon
        self.eye, (width, height) = ray_textures(rays, tile_size)
        self.shape = self.eye.origin.data.shape[1:]
        self.size = self.shape[1], self.shape[0]
        self.image = ScissorRect(0, 0, width, height)
        self.triangles, self.corners = triangle_vertices(scene, options.ior), corner_vertices()
        self.tiles = tile_vertices(*self.size, tile_size)
        self.scale = depth_scale(scene, rays)
        self.ends = Framebuffer(*self.size, END_TARGETS, options.depth_format)
        for name, nothing in (("triangle", -1.0), ("generation", -1.0), ("hit", (np.inf, 0.0, 0.0))):
            self.ends.clear_color(name, nothing)
        self.pipeline = passes.hierarchical_pass(
            "tile", options.facing, options.smooth, options.early_tests, options.depth_format, printed.E4
        )

    def triangles_by_kind(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Rows of the vertex buffer: ideal triangles, and all others."""
        ideal = self.scene.optical_indices(self.options.ior) >= 0
        return np.flatnonzero(ideal).astype(np.uint32), np.flatnonzero(~ideal).astype(np.uint32)

    def draw_triangles(
        self,
        draws: Sequence[tuple[NDArray[np.uint32], DynamicState]],
        textures: Any,
        target: Framebuffer,
        counters: Counters,
    ) -> Any:
        """Cones of the rays, then the triangles of each draw on every tile whose cone meets their spheres."""
        options = self.options
        cone_target = build_cones(textures, self.tile_size, self.printed, self.corners, counters, options)
        uniforms = shaders.TileUniforms(
            self.scale, self.epsilon, np.float32(self.tile_size), read_back(cone_target, "tile")
        )
        for rows, state in draws:
            if len(rows):
                draw(
                    self.pipeline,
                    vertices=(self.triangles, self.tiles),
                    indices=rows,
                    instances=self.tiles.count,
                    uniforms=uniforms,
                    textures=with_cones(textures, cone_target),
                    framebuffer=target,
                    counters=counters,
                    dynamic=state,
                    threads=options.threads,
                )
        counters.add("cone.sphere_tests", counters["vertex.invocations"] - CORNERS_OF_CONE_PASS)
        counters.add("cone.pairs_kept", counters["raster.primitives"] - 1 - counters["raster.clipped"])
        return cones_of(cone_target, self.tile_size)

    def keep_ends(self, k: int, textures: Any, target: Framebuffer, kind: Texture, counters: Counters) -> None:
        """Draws the rays whose path ended in pass k into the targets that stay."""
        hit, following = target.texture("hit"), target.texture("origin")
        draw(
            end_pass(self.options.depth_format),
            vertices=self.corners,
            uniforms=EndUniforms(np.int32(k)),
            textures=PathTextures(
                textures.origin, textures.direction, hit, following, target.texture("triangle"), kind
            ),
            framebuffer=self.ends,
            counters=counters,
            dynamic=DynamicState(None, self.image, 1, 1, 1),
            threads=self.options.threads,
        )

    def final_rays(self, others: NDArray[np.uint32], last: Generation) -> Generation:
        """Section 5: "these final rays" against the non-ideal triangles, all in one pass. The stencil that marks the
        paths which have ended lets no other pixel through; paths that go on are handed on."""
        counters = Counters()
        textures = shaders.RayTextures(self.ends.texture("origin"), self.ends.texture("direction"))
        target = next_target(*self.size, self.options.depth_format, self.ends.stencil)
        state = DynamicState(None, self.image, 1, 1, 0)
        cones = self.draw_triangles([(others, state)], textures, target, counters)
        counters.add("intersection.triangle_tests", int(target.invocations.sum()))
        counters.check()
        count, image = len(self.rays), self.image
        column = {name: rows_of(self.ends.color(name), image, count) for name in ("origin", "direction", "kind")}
        rays = Rays.unchecked(
            np.ascontiguousarray(column["origin"][:, :3]), column["direction"],
            np.ascontiguousarray(column["origin"][:, 3]), self.rays.width, self.rays.height,
        )  # fmt: skip
        t, u, v = (np.ascontiguousarray(part) for part in rows_of(target.color("hit"), image, count).T)
        hits = Hits(rows_of(target.color("triangle"), image, count)[:, 0], t, u, v)
        pixel = np.arange(count, dtype=np.int32)
        tests = rows_of(target.invocations[None], image, count)[:, 0]
        return Generation(
            rays, hits, rays.t_max > 0, column["kind"][:, 0], pixel, np.full(count, -1, np.int32),
            {"triangle_tests": tests}, counters, cones, last.next_rays, last.next_kind,
        )  # fmt: skip
