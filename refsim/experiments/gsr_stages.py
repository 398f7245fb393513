"""Sentences of sections 3 and 4 on what passes between the stages, each checked on the records of small draws.

*Taps* copy what every stage of a pass held. A row says what was counted and of how many; what number makes the sentence
true stands in the ledger. Recursive Ray Tracing in Geometry Shader, sections 3, 4.2 and 4.3, Listings 1 to 5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER, head, run
from refsim.experiments.registry import Case, Experiment, Rows, Tables
from refsim.papers.geometry_shader_rays import record
from refsim.pipeline import Taps
from refsim.pipeline.enums import FragmentFate
from refsim.reference.blend import Operands, blend
from refsim.results import Trace

FULL, QUICK = 32, 16
BOX, ROOM = "cornell box from afar", "mirroring room"
BLACK = (0.0, 0.0, 0.0)
STATE, TYPE = 2, 3  # components of uv_state
Counted = tuple[float, int]  # what was counted, of how many
Ints = NDArray[np.int64]


@lru_cache(maxsize=8)
def tapped(view: str, size: int, errata: str = "corrected", **options: Any) -> tuple[Trace, Taps]:
    """Two passes of a view on black, and what the stages held."""
    taps, given = Taps(), {"passes": 2, "refractions": False, "background": BLACK, **options}
    return run(GEOMETRY_SHADER, view, size, errata=errata, taps=taps, **given), taps


def _types(columns: Mapping[str, Any]) -> Ints:
    found: Ints = columns["uv_state"][:, TYPE].astype(np.int64)
    return found


def emission_order(size: int) -> Counted:
    """Invocations whose emissions are not in the order input, shadow, reflected."""
    _, taps = tapped(BOX, size)
    tap = taps.geometry[0]
    rank = np.select([_types(tap.varyings) == 0, _types(tap.varyings) > 0], [0, 1], 2)
    wrong = {int(tap.invocation[i + 1]) for i, (a, b) in enumerate(pairwise(rank))
             if tap.invocation[i] == tap.invocation[i + 1] and a >= b}  # fmt: skip
    return len(wrong), len(np.unique(tap.invocation))


def most_outputs(size: int) -> Counted:
    """Records captured of one input."""
    _, taps = tapped(BOX, size)
    return int(np.bincount(taps.geometry[0].invocation).max()), len(np.unique(taps.geometry[0].invocation))


def finished_emit(size: int) -> Counted:
    """Emissions of rays that the pass before shaded, as `state > 1` returns."""
    _, taps = tapped(BOX, size)
    done = np.flatnonzero(taps.vertex[1].varyings["uv_state"][:, STATE] >= record.SHADED)
    return int(np.isin(taps.geometry[1].invocation, done).sum()), len(done)


def new_rays_drawn(size: int) -> Counted:
    """New rays that the fragment shader of the same pass does not discard."""
    _, taps = tapped(BOX, size)
    tap = taps.fragment[0]
    new = taps.geometry[0].varyings["uv_state"][tap.vertices[:, 0], STATE] < record.SHADED
    return int((tap.fate[new] != FragmentFate.DISCARDED).sum()), int(new.sum())


def misses_drawn(size: int) -> Counted:
    """Rays that miss and still reach the fragment shader, as Listing 4 is printed; Listing 5 has a branch for each."""
    found, taps = tapped(BOX, size, "GSR-E2")
    reached = sum(int((tap.varyings["dir_idx"][:, 3] < 0)[tap.varyings["uv_state"][:, STATE] >= record.SHADED].sum())
                  for tap in taps.geometry)  # fmt: skip
    return reached, sum(int((g.hits.triangle < 0).sum()) for g in found.generations)


def pixels_covered(size: int) -> Counted:
    """Pixels that the points of the eye rays do not cover exactly once."""
    _, taps = tapped(ROOM, size, "GSR-E8")
    tap = taps.fragment[0]
    eye = _types(taps.geometry[0].varyings)[tap.vertices[:, 0]] == 0
    times = np.zeros((size, size), np.int64)
    np.add.at(times, (tap.y[eye], tap.x[eye]), 1)
    return int((times != 1).sum()), size * size


def _composed(size: int, backwards: bool) -> int:
    """Pixels in which Eq. 1, in NumPy and in the order of the captured buffer or its reverse, is not the picture."""
    found, taps = tapped(BOX, size, "GSR-E8,GSR-E10")
    held = np.zeros((size, size, 3), np.float32)
    for tap in taps.fragment:
        order = np.argsort(tap.vertices[:, 0], kind="stable")
        for i in order[::-1] if backwards else order:
            if tap.fate[i] == FragmentFate.WRITTEN:
                color, place = tap.outputs["light0"][i], (tap.y[i], tap.x[i])
                source, alpha = color[:3], np.full(3, color[3], np.float32)
                held[place] = blend(
                    "add", "one", "src-alpha", Operands(source, held[place], source, source, alpha, alpha, alpha)
                )
    assert found.image is not None
    return int((found.image != held).any(axis=2).sum())


def buffer_order(size: int) -> Counted:
    """Primitives hit the framebuffer in the order of the buffer."""
    return _composed(size, False), size * size


def reversed_order(size: int) -> Counted:
    """The same in the reverse order."""
    return _composed(size, True), size * size


def intermixed(size: int) -> Counted:
    """Neighbours in the buffer that are rays of different kinds; sorted by kind there would be two."""
    _, taps = tapped(BOX, size)
    types = _types(taps.stream_output[0].records)
    return int((types[1:] != types[:-1]).sum()), len(types) - 1


def packed(size: int) -> Counted:
    """Listings 1 and 2: records whose ray is not, bit for bit, the one that the next pass unpacks and shoots."""
    found, taps = tapped(BOX, size)
    after, records = found.generations[1], taps.stream_output[0].records
    assert after.slot is not None
    wrong = np.zeros(len(after.slot), np.bool_)
    for name, part, last in (("orig_t", after.rays.origin, after.rays.t_max), ("dir_idx", after.rays.direction, None)):
        kept = records[name][after.slot]
        wrong |= (kept[:, :3] != part).any(axis=1)
        wrong |= kept[:, 3] != (last if last is not None else -1)
    return int(wrong.sum()), len(wrong)


def kinds_of_quads(size: int) -> Counted:
    """The most kinds of rays that a pass of the previous method holds."""
    found = run(FRAGMENT_GRID, BOX, size, passes=3, refractions=False)
    kinds = [len(np.unique(g.kind[g.alive])) for g in found.generations]
    return max(kinds), len(kinds)


def kinds_of_points(size: int) -> Counted:
    """The most kinds of rays that a pass of points shoots."""
    found, _ = tapped(BOX, size)
    return max(len(np.unique(g.kind[g.alive])) for g in found.generations), len(found.generations)


STATEMENTS: dict[str, tuple[str, str, Callable[[int], Counted]]] = {
    "emission-order": ("section 4.2", "inputs", emission_order),
    "most-outputs": ("section 4.2", "records an input", most_outputs),
    "finished-emit": ("section 4.2, Listing 4", "records", finished_emit),
    "new-rays-drawn": ("section 4.2, Listing 5", "fragments", new_rays_drawn),
    "misses-drawn": ("Listings 4 and 5", "rays", misses_drawn),
    "pixels-covered": ("section 4.3", "pixels", pixels_covered),
    "buffer-order": ("section 4.3", "pixels", buffer_order),
    "reversed-order": ("section 4.3", "pixels", reversed_order),
    "intermixed": ("section 4.4", "neighbours", intermixed),
    "packed": ("Listings 1 to 3", "records", packed),
    "kinds-of-quads": ("section 1", "kinds a pass", kinds_of_quads),
    "kinds-of-points": ("section 4.3", "kinds a pass", kinds_of_points),
}
STAGES = ("vertex.invocations", "geometry.invocations", "stream_output.primitives", "fragment.invocations",
          "fragment.discarded", "fragment.written")  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case a statement, and one for the stages."""
    return [{"part": name, "size_px": QUICK if quick else FULL} for name in (*STATEMENTS, "passes")]


def measure(part: str, size_px: int) -> Rows:
    """One row; of the passes one each."""
    if part == "passes":
        found, _ = tapped(BOX, size_px)
        return [
            {"part": part, **head(BOX, size_px, found), "pass": k,
             **{name.replace(".", "_"): g.counters[name] for name in STAGES}}
            for k, g in enumerate(found.generations)
        ]  # fmt: skip
    place, unit, check = STATEMENTS[part]
    measured, of = check(size_px)
    about = " ".join((check.__doc__ or "").split())
    return [{"part": "statements", "id": part, "place": place, "counted": about, "measured": measured, "of": of,
             "unit": unit}]  # fmt: skip


def of_part(rows: Rows, part: str) -> Rows:
    """`statements` or `passes`."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Statements, and what each stage of each pass did."""
    return {"gsr-stages": of_part(rows, "statements"), "gsr-stages-passes": of_part(rows, "passes")}


EXPERIMENT = Experiment(
    "gsr-stages",
    "What sections 3 and 4 say of the stages, on the records of small draws",
    "32² pixels (16² with `--quick`), two passes of the Cornell box seen from afar, without glass: what each stage "
    "held is copied out and counted. The other table: what every stage of each pass took and gave (Figure 2).",
    cases,
    measure,
    None,
    tables,
)
