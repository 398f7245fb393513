"""Plan: what docs/conventions.md says is what the pipeline does; the page is read, not repeated.

- Its code blocks run as one program; its list of contents leads to its sections; the README leads to it.
- Tables of names are complete: constants, comparisons, stencil operations, formats, blend factors and operations,
  emissions, counters and laws, what is left out, every field of every state; every OpenGL call of the witness is there.
- Tables of formulas, evaluated, give what the stages give: on all 8-bit values, or on random and special floats.

What its program computes is compared with draws in `test_conventions_program`.
"""

from __future__ import annotations

import importlib
import re
from dataclasses import fields, is_dataclass, replace
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from refsim.counters import LAWS, OF_SHADERS, REGISTRY
from refsim.errors import InputError
from refsim.experiments.files import read_csv
from refsim.pipeline import enums, geometry, state
from refsim.pipeline.assembly import RESTART, assembled
from refsim.pipeline.interpolation import Interpolation, interpolation_of
from refsim.pipeline.layout import f32, i32
from refsim.pipeline.program import fragment_tests
from refsim.pipeline.vertex_buffer import record_type
from refsim.reference import blend
from tests.package.conventions_page import PAGE, ROOT, bare, pairs, program, table, worth
from tests.pipeline import device_loops
from tests.raster.drawing import LIST

F = np.float32
SPECIAL = np.array([0, -0.0, 0.5, 1, -1, 2, 1e-40, np.inf, -np.inf, np.nan], F)


def named(enum) -> list[str]:
    return [member.value if isinstance(member.value, str) else member.name.lower() for member in enum]


def test_the_page_hangs_together() -> None:
    assert program()["np"] is np
    titles = re.findall(r"^## (.+)$", PAGE, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
    assert re.findall(r"\]\(#([\w-]+)\)", PAGE) and set(re.findall(r"\]\(#([\w-]+)\)", PAGE)) == anchors
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", PAGE)]
    assert links and all((ROOT / "docs" / link).is_file() for link in links)
    assert "(docs/conventions.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_constants() -> None:
    for _, value, place in table("constant", "value"):
        module, _, name = bare(place).rpartition(".")
        found = float(getattr(importlib.import_module(module), name))
        assert found == (2.0 ** worth(value) - 1 if name == "FULL" else worth(value)), place


def test_primitives() -> None:
    rows = table("topology", "primitive i has vertices")
    assert {bare(row[0].split(",")[0]) for row in rows} == set(named(enums.PrimitiveTopology))
    for name, vertices, _ in rows:
        topology = enums.PrimitiveTopology(bare(name.split(",")[0]))
        numbers = np.arange(4, dtype=np.int64)
        numbers = numbers[numbers % 2 == 1] if "odd" in name else numbers[::2] if "even" in name else numbers
        said = [[worth(re.sub(r"(\d)i", r"\1 * i", part), i=i) for part in vertices.split(",")] for i in numbers]
        assert assembled(topology, 24).invocations(topology, numbers).tolist() == said
    assert sorted(RESTART.values()) == [int(code, 16) for code in re.findall(r"`(0xF+)`", PAGE)]


def test_interpolation_by_annotation() -> None:
    class Varyings(NamedTuple):
        plain: f32
        number: i32
        perspective: Annotated[f32, Interpolation.PERSPECTIVE]
        linear: Annotated[f32, Interpolation.LINEAR]
        flat: Annotated[f32, Interpolation.FLAT]

    kinds = interpolation_of(Varyings)
    said = {row[0].split("-")[0].split(" ")[0]: row[1] for row in table("a varying is", "by annotation")}
    for name, kind in kinds.items():
        word = {"plain": "none (float32)", "number": "none (int32)"}.get(name, f"Interpolation.{kind.name}")
        assert [key for key, cell in said.items() if word in cell] == [kind.value]


def test_comparisons_and_stencil_operations() -> None:
    functions = pairs("function", "passes if")
    assert list(functions) == named(enums.CompareFunction)
    new, stored = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    for code, expression in enumerate(functions.values()):
        holds = np.empty(len(new), bool)
        device_loops.comparisons(np.full(len(new), code, np.int32), new, stored, holds)
        assert holds.tolist() == [bool(worth(expression, new=a, stored=b)) for a, b in zip(new, stored, strict=True)]
    operations = pairs("operation", "the value s becomes")
    assert list(operations) == named(enums.StencilOperation)
    for code, expression in enumerate(operations.values()):
        for reference in (0, 7, 255):
            values, after = np.arange(256, dtype=np.int32), np.empty(256, np.int32)
            device_loops.operations(np.full(256, code, np.int32), values, np.full(256, reference, np.int32), after)
            assert after.tolist() == [worth(expression, s=s, reference=reference) for s in range(256)]


def test_early_tests() -> None:
    rows = table("policy", "plain shader")
    assert [bare(row[0]) for row in rows] == named(enums.EarlyTests)
    face = state.StencilFaceState(enums.CompareFunction.EQUAL)
    tested = state.DepthStencilState(depth_compare=enums.CompareFunction.LESS, stencil_front=face, stencil_back=face)
    kinds = ({}, {"discards": True}, {"writes_depth": True})
    for policy, *cells in rows:
        for cell, options in zip(cells, kinds, strict=True):
            found = fragment_tests(replace(LIST.fragment, **options), tested, enums.EarlyTests(bare(policy)))
            early = ["stencil"] * found.early_stencil + ["depth"] * found.tests_first
            assert cell == (", ".join(early) or "—")


def test_formats() -> None:
    rows = table("format", "components")
    assert [bare(row[0]) for row in rows] == named(enums.TextureFormat)
    for name, components, holds in rows:
        form = enums.TextureFormat(bare(name))
        assert form.components == int(components)
        assert holds.split(",")[0] == ("k / 255" if form.is_unorm8 else "float32" if form.is_float else "int32")


def test_blend_factors_and_operations() -> None:
    factors = table("factor", "for colour")
    assert [bare(row[0]) for row in factors] == named(enums.BlendFactor)
    operations = pairs("operation", "result of the products a (source) and b (destination)")
    assert list(operations) == named(enums.BlendOperation)
    values = np.random.default_rng(7).uniform(0, 1, (7, 50)).astype(F)
    for alpha, column in ((False, 1), (True, 2)):
        s, d, s1, c, sa, da, s1a = values
        s, d, s1, c = (sa, da, s1a, c) if alpha else (s, d, s1, c)
        operands = blend.Operands(s, d, s1, c, sa, da, s1a, alpha)
        names = {"s": s, "d": d, "s1": s1, "c": c, "sa": sa, "da": da, "s1a": s1a, "ca": c}
        lanes = [dict(zip(names, lane, strict=True)) for lane in zip(*names.values(), strict=True)]
        said = {bare(row[0]): np.array([worth(bare(row[column]), **lane) for lane in lanes], F) for row in factors}
        for name, found in said.items():
            assert np.array_equal(found, blend.factor(name, operands))
        for (source, destination), (operation, cell) in product(product(said, said), operations.items()):
            if operation in ("min", "max") and (source, destination) != ("one", "one"):
                continue
            formula = cell.split("`")[0]
            products = [lane | {"a": lane["s"] * x, "b": lane["d"] * y}
                        for lane, x, y in zip(lanes, said[source], said[destination], strict=True)]  # fmt: skip
            found = np.array([worth(formula, **lane) for lane in products], F)
            assert np.array_equal(found, blend.blend(operation, source, destination, operands))


def test_geometry_and_stream_output() -> None:
    codes = pairs("emission", "value")
    assert {name: int(getattr(geometry, name)) for name in codes} == {name: int(v) for name, v in codes.items()}
    *said, last = table("field", "type")
    kind = record_type(program()["Record"])
    assert [(bare(row[0]), int(row[2])) for row in said] == [(name, kind.fields[name][1]) for name in kind.names]
    assert int(last[2]) == kind.itemsize == program()["records"].dtype.itemsize


def test_counters_and_laws() -> None:
    rows = table("counter", "counts")
    stages = ("draw", "vertex", "assembly", "geometry", "stream_output", "raster", "stencil", "depth", "fragment")
    own = [name for name in REGISTRY if name.split(".")[0] in (*stages, "blend") and name not in OF_SHADERS]
    assert sorted(bare(row[0]) for row in rows) == sorted(own)
    small = {row["counter"]: row["count"] for row in read_csv(ROOT / "figures" / "draw-stages.csv")}
    assert {bare(row[0]): int(row[2]) for row in rows} == small
    laws = re.findall(r"^    (\w+\.\w+) = (.+)$", PAGE, re.MULTILINE)
    assert [((left,), tuple(right.split(" + "))) for left, right in laws] == [tuple(law) for law in LAWS]


def test_what_is_left_out_is_refused() -> None:
    reasons = pairs("asked for", "is refused, because")
    assert reasons == enums.LEFT_OUT
    for name, reason in reasons.items():
        with pytest.raises(InputError, match=reason):
            replace(LIST, topology=name)


def test_every_state_has_its_line() -> None:
    rows = table("refsim", "OpenGL 4.6")
    said = [bare(row[0]) for row in rows if re.match(r"`[A-Z]\w+\.", row[0])]
    classes = (state.Pipeline, state.VertexState, state.VertexBufferLayout, state.GeometryState, state.FragmentState,
               state.StreamOutputState, state.ColorTargetState, state.BlendState, state.BlendComponent,
               state.DepthStencilState, state.StencilFaceState, state.DynamicState)  # fmt: skip
    every = [f"{cls.__name__}.{name}" for cls in classes
             for name in ([part.name for part in fields(cls)] if is_dataclass(cls) else cls._fields)]  # fmt: skip
    assert sorted(said) == sorted(every)
    assert all(len(row) == 5 and all(row) for row in rows)
    witness = (ROOT / "tests" / "opengl" / "states.py").read_text(encoding="utf-8")
    calls = set(re.findall(r"\bgl\.(gl\w+)\(", witness)) - {"glEnable", "glDisable", "glDisablei", "glEnablei"}
    assert calls and [call for call in calls if f"`{call}" not in " ".join(row[1] for row in rows)] == []
