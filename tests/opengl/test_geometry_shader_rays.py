"""The recursive ray tracer in the geometry shader as a GLSL program: the same hits, records and pictures as refsim's.

Plan
- Four small scenes, P = 2 and 3, one light and two, float32 and 8-bit targets; the scene in textures and in shader
  storage. And two programs that are as legal and another: a quotient rounded twice, as OpenGL permits, moves hits by
  their last bits; of two triangles at the same t the last is taken instead of the first.
- Every hit that the port found is admissible for the ray that it shot: eye, shadow, reflected, refracted.
- Records come in refsim's order: the same pixels, states and types, pass by pass, but for pixels where a ray hit
  something else on one side than on the other. Both hits are admissible, so both courses are legal; such pixels are
  counted as `explained`. Where both sides shot the same rays, the judge must know more than one answer for them.
- Everywhere else the picture is refsim's. On 8 bits: within one level a blended target, as each target is rounded once
  and then added exactly. On float32: R·V carries some 32 eps and is raised to 48 at most, which makes 1e-4 or a
  fortieth of a level.
- All triangles instead of the grid: the same records, bit for bit, but for which triangle throws a shadow.
- A transform feedback buffer one primitive too small loses one primitive, the last; all else is drawn as before.
"""

from __future__ import annotations

from contextlib import closing
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from refsim import Material, Rays, Scene, camera_rays, load_scene
from refsim.errors import InputError
from refsim.oracle import admissible, judge
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer
from refsim.results import RayKind
from refsim.scene.light import PointLight
from refsim.scene.stages import on_ground
from tests.opengl import geometry_shader_rays_glsl as glsl
from tests.opengl.geometry_shader_rays import Port
from tests.opengl.geometry_shader_rays_passes import Drawn, otherwise, ours, pixels_of, shot, tracer_of
from tests.opengl.verdicts import note, same, within

ROOM = "geometry_shader_rays"
SIZE = (48, 48)
TWO_LIGHTS = PointLight((0.6, 0.8, 0.5)), PointLight((-0.5, 0.4, 0.7), (0.4, 0.5, 1.0))
ONE: dict[str, Any] = {"lights": 1}
TWO: dict[str, Any] = {"lights": TWO_LIGHTS, "color_format": "rgba8unorm"}
SCENES: dict[str, tuple[str, dict[str, Any]]] = {
    "knot, P 2": ("knot_on_ground_146", {"passes": 2, **ONE}),
    "glass knot, P 3": ("glass knot", {"passes": 3, **ONE}),
    "cornell box, P 2": ("cornell_box", {"passes": 2, **TWO}),
    "cornell box, P 3": ("cornell_box", {"passes": 3, **TWO}),
}
# Other programs that are as right: what of the vertex shader they replace
REWRITTEN = {
    "rounded twice": ("t = along / facing;", "t = along * (1.0 / facing);"),
    "last of a tie": ("candidate < hit.idx", "candidate > hit.idx"),
}
VARIANTS = (*glsl.STORAGES, *REWRITTEN)
EXPLAINED = {"last of a tie": 60}  # pixels at most; a wall's diagonal runs through as many pixel centres as it meets
FORTIETH = 2.0**-5  # and a little more


def scene_of(name: str) -> Scene:
    if name != "glass knot":
        return load_scene(name)
    return on_ground(load_scene("torus_knot_144"), material=Material("glass", "glass", ior=1.5, specular=0.5))


class Reference(NamedTuple):
    """refsim's side of a scene."""

    tracer: GeometryShaderTracer
    rays: Rays
    passes: list[Drawn]
    picture: np.ndarray


@cache
def reference(name: str) -> Reference:
    made, options = SCENES[name]
    scene = scene_of(made)
    view = {"view": (0, 0, 1), "fill": 0.9} if made == "cornell_box" else {"view": (0.5, 0.6, 1), "fill": 0.9}
    rays = camera_rays(scene, *SIZE, **view)
    tracer = tracer_of(scene, rays, acceleration="grid", threads=2, **options)
    return Reference(tracer, rays, *ours(tracer, rays))


def sources(variant: str, lights: int) -> tuple[str, dict[str, str]]:
    """Where the scene lies, and the shaders."""
    if variant not in REWRITTEN:
        return variant, glsl.tracing_sources(lights, variant)
    shaders, (before, after) = glsl.tracing_sources(lights, "textures"), REWRITTEN[variant]
    assert shaders["vertex_shader"].count(before) == 1
    return "textures", {**shaders, "vertex_shader": shaders["vertex_shader"].replace(before, after)}


def drawn(witness: Any, given: Reference, variant: str = "textures") -> tuple[list[Drawn], np.ndarray]:
    """The port's passes and its picture."""
    with closing(Port(witness, given.tracer, given.rays, *sources(variant, len(given.tracer.options.lights)))) as port:
        return port.recorded(), port.picture()


def assert_admissible(scene: Scene, passes: list[Drawn], branching: int) -> np.ndarray:
    """How many rays of each kind were judged."""
    judged = np.zeros(4, int)
    for k, one in enumerate(passes):
        rays = shot(one, SIZE)
        kind = record.kinds_of(rays.type, branching)
        verdicts = {any_hit: judge(scene, rays.rays, rays.hits, any_hit=any_hit) for any_hit in (False, True)}
        right = np.where(kind == RayKind.SHADOW, verdicts[True].admissible, verdicts[False].admissible)
        assert right.all(), f"pass {k}: {int((~right).sum())} rays; kind {kind[~right][0]}, key {rays.key[~right][0]}"
        judged += np.bincount(kind, minlength=4)
    return judged


def parted(scene: Scene, here: list[Drawn], there: list[Drawn]) -> np.ndarray:
    """bool[w·h]: pixels where some ray hit something else; asserts that all others' records are the same in order."""
    apart = np.zeros(SIZE[0] * SIZE[1], bool)
    for k, (a, b) in enumerate(zip(here, there, strict=True)):
        pixels = otherwise(shot(a, SIZE), shot(b, SIZE))
        if k == 0:  # a ray a pixel, the same on both sides
            assert (admissible(scene, shot(b, SIZE).rays).answers[pixels] > 1).all()
        apart[pixels] = True
        told = []
        for captured in (a.captured, b.captured):
            pixel = pixels_of(captured, SIZE)
            columns = np.column_stack([pixel, captured[:, record.STATE], captured[:, record.TYPE]])
            told.append(columns[~apart[pixel]].astype(np.int64))
        same(ROOM, f"pixels, states and types captured in pass {k}", *told)
    return apart


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_hits_records_and_picture(witness, name: str, variant: str) -> None:
    given = reference(name)
    scene, options = given.tracer.prepared.scene, given.tracer.options
    there, picture = drawn(witness, given, variant)

    judged = assert_admissible(scene, there, given.tracer.prepared.branching)
    assert (judged[[RayKind.EYE, RayKind.SHADOW, RayKind.REFLECTED]] > 200).all()
    assert judged[RayKind.REFRACTED] > 100 or name == "knot, P 2"

    apart = parted(scene, given.passes, there)
    assert apart.sum() <= EXPLAINED.get(variant, 4)
    for one in there:
        assert one.generated == one.written == len(one.captured)

    # Every surface ray shaded may have drawn into all targets of its layer
    bound = np.full(apart.shape, FORTIETH)
    if options.color_format == "rgba8unorm":
        shaded = [one.captured[one.captured[:, record.STATE] == record.SHADED] for one in there]
        surfaces = [pixels_of(records[records[:, record.TYPE] <= 0], SIZE) for records in shaded]
        bound = np.bincount(np.concatenate(surfaces), minlength=len(apart)) * (1.0 + len(options.lights))
    pair = (side.reshape(-1, 3)[~apart] * 255.0 for side in (given.picture, picture))
    within(ROOM, f"picture, levels of 8 bits, {name}, {variant}", *pair, np.repeat(bound[~apart, None], 3, axis=1))
    explained = "explained" if variant in glsl.STORAGES else "explained in the other programs"
    note(ROOM, draws=1, rays=judged.sum(), records=sum(one.written for one in there), **{explained: apart.sum()})


def test_the_other_programs_are_others(witness) -> None:
    """Control: one finds other parameters, one other triangles, which are counted and explained."""
    given = reference("cornell box, P 3")
    (once, _), (twice, _), (last, _) = (drawn(witness, given, variant) for variant in ("textures", *REWRITTEN))
    assert (once[0].captured[:, record.T] != twice[0].captured[:, record.T]).sum() > 100
    assert parted(given.tracer.prepared.scene, once, last).sum() > 10


def test_without_the_grid_the_records_are_the_same(witness) -> None:
    """No ray is near enough to be walked, so each tests all triangles."""
    given = reference("glass knot, P 3")
    grid = given.tracer.prepared.accelerator
    all_far = grid._replace(structure=grid.structure._replace(far=np.float32(-1)))
    tracer = tracer_of(given.tracer.prepared.scene, given.rays, acceleration=all_far, passes=3, **ONE)
    (walked, _), (tested, _) = drawn(witness, given), drawn(witness, given._replace(tracer=tracer))
    for a, b in zip(walked, tested, strict=True):
        both = [a.captured.copy(), b.captured.copy()]
        for records in both:  # a shadow ray takes the first triangle that it finds
            shadows = np.flatnonzero((records[:, record.TYPE] > 0) & (records[:, record.STATE] == record.SHADED))
            records[np.ix_(shadows, [record.T, record.INDEX, record.U, record.V])] = 0
        assert both[0].tobytes() == both[1].tobytes()


def test_a_buffer_one_primitive_too_small_loses_the_last(witness) -> None:
    given = reference("cornell box, P 3")
    full, picture = drawn(witness, given)
    needed = full[0].written
    assert needed > max(one.written for one in full[1:]) + 1  # so that no other pass overflows
    tracer = tracer_of(given.tracer.prepared.scene, given.rays, capacity=needed - 1, passes=3, **TWO)
    small, less = drawn(witness, given._replace(tracer=tracer))

    assert (small[0].generated, small[0].written) == (needed, needed - 1)
    assert small[0].captured.tobytes() == full[0].captured[:-1].tobytes()
    lost = full[0].captured[-1]
    assert lost[record.STATE] == record.TO_BE_SHOT
    pixel = int(pixels_of(lost[None], SIZE)[0])
    for k in (1, 2):
        assert small[k].generated == small[k].written
        before, after = (one[k].captured[pixels_of(one[k].captured, SIZE) != pixel] for one in (full, small))
        assert before.tobytes() == after.tobytes()
    elsewhere = np.arange(SIZE[0] * SIZE[1]) != pixel
    assert (picture.reshape(-1, 3)[elsewhere] == less.reshape(-1, 3)[elsewhere]).all()

    with pytest.raises(InputError, match=rf"pass 0 had 1 rays more .* {needed - 1} records"):
        ours(tracer, given.rays)
    note(ROOM, draws=2, lost=1)
