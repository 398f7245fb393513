"""Geometry shaders and transform feedback: the same records in the same order, the same pictures, the same counts.

Plan
- Random plans of 0 to 8 outputs a primitive, points and triangles in, points and strips out, strips captured without a
  geometry shader; several instances: records byte for byte, planes, and the counts of OpenGL's queries: primitives
  generated and written, samples passed, geometry shader invocations, primitives they emitted. Vertex invocations are
  exact in Mesa where nothing is indexed; an indexed vertex it may shade once for several uses, refsim counts each.
- Nothing emitted at all, and everything.
- A buffer too small: whole primitives, the rest counted, for every capacity around the size of one primitive.
- Draw-auto: glDrawTransformFeedback draws what was captured, overflow or not, as refsim draws a buffer with no count.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.opengl import case as cases
from tests.opengl import emitters
from tests.opengl.emitters import PIPELINES, TARGETS
from tests.opengl.verdicts import note, same

SEED = 34001
SIZE = (48, 32)
COUNT = 90
ALL = 0x5555  # emit, eight times


def vertices(rng, plans=None):
    """Random vertices, positions in whole 1/64 moved off pixel centres by the odd 1/128."""
    place = rng.integers(-64, 64, (COUNT, 2)) / 64 + 1 / 128
    return {
        "position": np.column_stack([place, rng.integers(0, 5, COUNT) / 4, np.ones(COUNT)]).astype(np.float32),
        "value": rng.integers(-50, 50, COUNT).astype(np.float32) / 4,
        "id": rng.integers(0, 1000, COUNT),
        "plan": rng.integers(0, 2**16, COUNT) if plans is None else np.full(COUNT, plans),
    }


def both(witness, pipeline, columns, capture=9 * COUNT * 3, **others):
    """Outcomes of refsim and OpenGL."""
    given = cases.case(pipeline, emitters.glsl(pipeline), columns, TARGETS, SIZE, capture=capture, **others)
    note("geometry", draws=1)
    return cases.ours(given), witness.draw(given)


def same_everywhere(what, ours, theirs):
    """Records in order, planes, counts."""
    same("geometry", f"number of records, {what}", len(ours.records), len(theirs.records))
    for name in theirs.records.dtype.names:
        same("geometry", f"{name}, {what}", ours.records[name], theirs.records[name])
    assert ours.records.tobytes() == theirs.records.tobytes()
    for target in TARGETS:
        same("geometry", f"{target}, {what}", ours.planes.color[target], theirs.planes.color[target])
    generated = ours.counts["stream_output.generated"]
    counts = {**dict.fromkeys(theirs.counts, 0), **ours.counts, "primitives.generated": generated}
    for name in ("fragment.written", "primitives.generated", "stream_output.primitives", "assembly.primitives",
                 "geometry.invocations", "geometry.primitives_out"):  # fmt: skip
        same("geometry", f"{name}, {what}", counts[name], theirs.counts[name])


@pytest.mark.parametrize("name", PIPELINES)
def test_random_plans_make_the_same_records(witness, name):
    pipeline = PIPELINES[name]
    for k in range(6):
        columns = vertices(np.random.default_rng([SEED, k]))
        ours, theirs = both(witness, pipeline, columns)
        same_everywhere(f"{name}, seed {SEED}, {k}", ours, theirs)
        if pipeline.topology != emitters.STRIP:
            invocations = (outcome.counts["vertex.invocations"] for outcome in (ours, theirs))
            same("geometry", f"vertex invocations, {name}", *invocations)


def test_instances_and_indices(witness):
    pipeline = PIPELINES["strips, no geometry shader, discarded"]
    rng = np.random.default_rng([SEED, 10])
    indices = rng.integers(0, COUNT, 40)
    ours, theirs = both(witness, pipeline, vertices(rng), indices=indices, instances=3)
    same_everywhere("indexed strips, three instances", ours, theirs)
    assert ours.counts["vertex.invocations"] == 120


@pytest.mark.parametrize("plan", [0, ALL, 0x0555, 0x0255, 0xAAAA], ids=hex)
def test_fixed_plans(witness, plan):
    pipeline = PIPELINES["points to strips"]
    ours, theirs = both(witness, pipeline, vertices(np.random.default_rng(SEED), plan))
    same_everywhere(f"plan {plan:x}", ours, theirs)
    # Six triangles of eight vertices; four of six; three of five; none of single ones
    assert len(ours.records) == COUNT * 3 * {0: 0, ALL: 6, 0x0555: 4, 0x0255: 3, 0xAAAA: 0}[plan]


@pytest.mark.parametrize("name", ["points to points", "points to strips"])
@pytest.mark.parametrize("capture", [1, 2, 3, 4, 5, 6, 50, 100])
def test_a_full_buffer_takes_whole_primitives_only(witness, name, capture):
    pipeline = PIPELINES[name]
    ours, theirs = both(witness, pipeline, vertices(np.random.default_rng([SEED, 20])), capture)
    same_everywhere(f"{name}, room for {capture}", ours, theirs)
    corners = pipeline.rasterized.corners
    assert len(ours.records) == capture // corners * corners
    lost = theirs.counts["primitives.generated"] - theirs.counts["stream_output.primitives"]
    assert ours.counts["stream_output.overflowed"] == lost > 0


@pytest.mark.parametrize("name", ["points to points", "triangles to strips, discarded"])
@pytest.mark.parametrize("capture", [9 * COUNT * 3, 100], ids=["room for all", "overflowing"])
def test_draw_auto_draws_what_was_captured(witness, name, capture):
    first = PIPELINES[name]
    columns = vertices(np.random.default_rng([SEED, 30]))
    given = cases.case(first, emitters.glsl(first), columns, TARGETS, SIZE, capture=capture)
    then = cases.case(emitters.RECORDS_AS_POINTS, emitters.RECORD_GLSL, {}, TARGETS, SIZE)
    ours, theirs = cases.ours(given, then=then), witness.draw(given, then)
    for target in TARGETS:
        same("geometry", f"{target} of {name}", ours.planes.color[target], theirs.planes.color[target])
    assert (ours.planes.color["id"] != 0).any()
    note("geometry", draws=2)
