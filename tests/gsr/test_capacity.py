"""Room in the two vertex buffers: S_VB is enough for every scene, one record less than is captured is refused.

Plan
- Properties: on soups of glass, mirror and diffuse triangles, for any depth and number of lights, no pass captures more
  than S_VB, the occupancy is the number of rays passed on and spawned, and a buffer of exactly that many records gives
  the same bytes.
- S_VB is reached: everything hits, is in shadow, and reflects (chain) or refracts (tree).
- A buffer one record too small: one sentence with the pass, what is missing, what there is and what is needed; counted
  by the buffer; nothing comes back. The command line says it in one line and ends with 2. Less room than the eye rays
  take is refused before anything is drawn.
- No read-back: nobody asks a captured buffer for its count, no draw is told one.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Material, Rays, Scene
from refsim.cli import main
from refsim.counters import Counters
from refsim.errors import InputError
from refsim.methods import METHODS
from refsim.options import checked
from refsim.papers.geometry_shader_rays import tracer as tracer_module
from refsim.papers.geometry_shader_rays.setup import options_of, prepared
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting
from refsim.results import Trace
from refsim.scene import PointLight
from tests.gsr.scenes import (
    GLASS,
    MIRROR,
    SHINY,
    TILES,
    assembled,
    between_mirrors,
    cornell,
    cornell_rays,
    cornell_trace,
    court,
    court_rays,
    enclosed,
    facing_mirrors,
    quad,
    soup,
    traced,
    wild,
)

PALETTES = ((GLASS,), (GLASS, SHINY), (MIRROR, SHINY, GLASS), (Material("plain", "diffuse"),), (TILES, SHINY))


def tracer_of(scene: Scene, rays: Rays, capacity: int | None = None, **given_options: Any) -> GeometryShaderTracer:
    given_options = {"acceleration": "naive", **given_options}
    options = checked("geometry_shader", METHODS["geometry_shader"].options, given_options)
    shared = options_of(scene, options)
    assert rays.width is not None and rays.height is not None
    setting = Setting(capacity=capacity)
    return GeometryShaderTracer(prepared(scene, rays, options, shared), rays.width, rays.height, shared, setting)


def occupancies(trace: Trace) -> list[int]:
    found = [generation.occupancy for generation in trace.generations]
    return [occupancy.vertices for occupancy in found if occupancy is not None]


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 14),
    palette=st.sampled_from(PALETTES),
    lights=st.integers(1, 2),
    passes=st.integers(1, 5),
    dead=st.sampled_from([0.0, 0.4]),
    shadows=st.booleans(),
)
def test_no_soup_overflows(
    seed: int, count: int, palette: tuple[Material, ...], lights: int, passes: int, dead: float, shadows: bool
) -> None:
    scene, rays = soup(seed, count, palette, lights), wild(6, 5, seed, dead)
    trace = traced(scene, rays, passes=passes, shadows=shadows)
    for generation, captured in zip(trace.generations, occupancies(trace), strict=True):
        occupancy, counters = generation.occupancy, generation.counters
        assert occupancy is not None and captured <= occupancy.capacity
        passed = [counters[f"geometry.passed_{kind}"] for kind in ("eye", "shadow", "reflected", "refracted")]
        spawned = [counters[f"geometry.spawned_{kind}"] for kind in ("shadow", "reflected", "refracted")]
        assert captured == sum(passed) + sum(spawned) == counters["stream_output.primitives"]
        assert occupancy.bytes == 64 * captured and occupancy.capacity_bytes == 64 * occupancy.capacity
        assert counters["stream_output.overflowed"] == 0
    most = max(occupancies(trace))
    if most >= len(rays):  # a buffer holds the eye rays in any case
        exact = traced(scene, rays, passes=passes, shadows=shadows, capacity=most)
        assert exact.image is not None and trace.image is not None
        assert exact.image.tobytes() == trace.image.tobytes() and dict(exact.counters) == dict(trace.counters)
        if most > len(rays):
            with pytest.raises(InputError, match=f"{most - 1} records hold"):
                traced(scene, rays, passes=passes, shadows=shadows, capacity=most - 1)


def shadowed_room(material: Material, lights: int) -> Scene:
    """Walls all around, and the lights in a closed cell of their own: every ray hits, the walls' shadow rays too."""
    corners = [(x, y, z) for x in (1.5, 1.56) for y in (1.5, 1.56) for z in (1.5, 1.56)]
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    cell = np.concatenate([quad(*(corners[k] for k in face)) for face in faces])
    walls = enclosed(material)
    places = [PointLight((1.52 + 0.02 * k, 1.53, 1.53)) for k in range(lights)]
    return assembled("shadowed room", [(walls.triangles, material), (cell, material)], *places)


@pytest.mark.parametrize("passes", [1, 2, 3, 4])
@pytest.mark.parametrize("lights", [1, 2])
def test_a_chain_fills_the_buffers_to_the_last_record(passes: int, lights: int) -> None:
    """N_0 = 1, N_k = 1 + L: a pass captures the rays of its depth and the next."""
    trace = traced(shadowed_room(TILES, lights), wild(4, 3, 5), passes=passes)
    depths = [1] + [1 + lights] * (passes - 1) + [0]
    assert occupancies(trace) == [12 * (depths[k] + depths[k + 1]) for k in range(passes)]
    capacities = {g.occupancy.capacity for g in trace.generations if g.occupancy is not None}
    largest = sorted(depths, reverse=True)
    assert capacities == {12 * (largest[0] + largest[1])}


def test_glass_fills_what_its_tree_has() -> None:
    """Two passes: the eye ray, its shadow ray, a reflected and a refracted one: 4 a pixel, where glass lets in."""
    trace = traced(shadowed_room(GLASS, 1), wild(4, 3, 6), passes=2)
    assert occupancies(trace)[0] == 12 * 4
    occupancy = trace.generations[0].occupancy
    assert occupancy is not None and occupancy.capacity == 12 * 4


@pytest.mark.parametrize("passes", [2, 3, 5])
def test_one_record_too_few(passes: int) -> None:
    scene, rays = cornell(), cornell_rays()
    right = cornell_trace(passes)
    most = max(occupancies(right))
    full, needed = occupancies(right).index(most), len(rays) * {2: 1 + 4, 3: 4 + 8, 5: 16 + 32}[passes]
    exact = traced(scene, rays, passes=passes, capacity=most)
    assert exact.image is not None and right.image is not None and exact.image.tobytes() == right.image.tobytes()
    with pytest.raises(InputError) as refused:
        traced(scene, rays, passes=passes, capacity=most - 1)
    assert str(refused.value) == (
        f"geometry_shader: pass {full} had 1 rays more than the stream-output buffer's {most - 1} records hold; "
        f"S_VB needs {needed} records of 64 bytes."
    )


def test_the_buffer_counts_what_it_leaves_out() -> None:
    """Court, two passes: 8 eye rays, of which 7 hit and send 7 shadow and 5 reflected rays: 19 records."""
    rays = court_rays()
    tracer, counters = tracer_of(court(), rays, capacity=14, passes=2), Counters()
    with pytest.raises(InputError, match=r"pass 0 had 5 rays more .* 14 records"):
        tracer.draw_passes(rays, counters)
    assert tracer.buffers[1].overflowed == counters["stream_output.overflowed"] == 5
    assert counters["stream_output.generated"] == 19 and counters["stream_output.primitives"] == 14


@pytest.mark.parametrize("capacity", [1, 7])
def test_less_room_than_eye_rays(capacity: int) -> None:
    with pytest.raises(InputError, match=rf"capacity is {capacity}; .* 8 "):
        traced(court(), court_rays(), capacity=capacity)


def test_the_command_says_it_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    row = ("render", "geometry_shader", "cornell_box", "--size", "12", "--acceleration", "naive", "--capacity")
    assert main((*row, "145")) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1
    assert "1 rays more than the stream-output buffer's 145 records" in err and f"S_VB needs {144 * 4} records" in err
    assert list(tmp_path.iterdir()) == []
    assert main((*row, "146")) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["cornell_box.png"]


@pytest.mark.parametrize("passes", [1, 2, 5])
def test_no_count_is_read_back(passes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pass draws as many vertices as the one before captured, and nobody says how many these are."""
    rays, told = between_mirrors(5, 4), []
    tracer = tracer_of(facing_mirrors(), rays, passes=passes)
    real = tracer_module.draw

    def draw(pipeline: Any, **arguments: Any) -> None:
        told.append(arguments)
        real(pipeline, **arguments)

    monkeypatch.setattr(tracer_module, "draw", draw)
    tracer.draw_passes(rays, Counters())
    assert [buffer.read_backs for buffer in tracer.buffers] == [0, 0]
    assert len(told) == passes
    for arguments in told:
        assert not {"vertex_count", "indices", "instances"} & set(arguments)
    # Ping-pong: what is captured is what the next pass draws
    for before, after in pairwise(told):
        assert before["stream_output"] is after["vertices"] and before["vertices"] is after["stream_output"]
    # Control: asking is seen
    assert tracer.buffers[passes % 2].count > 0 and tracer.buffers[passes % 2].read_backs == 1


def test_a_tracer_draws_again() -> None:
    """The buffers and targets of one tracer serve picture after picture, and nothing of the last one stays."""
    tracer = tracer_of(court(), court_rays(), passes=3)
    first = tracer.draw_passes(court_rays(), Counters()).copy()
    other = court_rays([6, 6, 6, 6, 6, 6, 6, 0])
    away = tracer.draw_passes(other, Counters()).copy()
    assert (away[:3, 0, :7] == first[:3, 0, 6:7]).all() and (away[:3, 0, 7] == first[:3, 0, 0]).all()
    assert (tracer.draw_passes(court_rays(), Counters()) == first).all()
