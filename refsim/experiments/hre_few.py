"""Few triangles: what the cones cost against what they spare, from 6 to 100 triangles; and how points stand to quads.

The Hierarchical Ray Engine, section 7.1: "If there are few primitives, the ray casting does not take much time, and the
constant overhead of constructing the enclosing cones does not pay off. However, as the number of primitives increases,
the situation is reversed." Counted: ray–triangle tests, cone–sphere tests, and steps of construction (rays visited),
priced as in `tile_size`. Section 3: a point instead of a quad spares the "fourfold overhead" of its vertices.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE, fill_of, hits_percent, run
from refsim.experiments.tile_size import PRICES, priced
from refsim.experiments.verdicts import claim

BODIES = ("blob", "sphere")
SIZES = (6, 8, 12, 20, 32, 50, 100)
PRACTICALLY_NONE = 1.0  # percent
CORNERS = 4  # vertices of a quad, and of the one that builds a generation's cones


def cases(quick: bool) -> list[Case]:
    """A case a body and number of triangles."""
    size, tile = (64, 4) if quick else (256, 16)
    return [
        {"scene": f"{body}_{number}", "size_px": size, "tile_px": tile, "fill": fill_of(f"{body}_{number}"),
         "generations": 5}
        for body in BODIES for number in SIZES
    ]  # fmt: skip


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generations: int, backend: str = "numba"
) -> Rows:
    """One row: the counters of the three engines."""
    options: dict[str, Any] = {"generations": generations, "backend": backend}
    found = run(HIERARCHICAL, scene, size_px, fill, tile_size=tile_px, **options)
    plain, tested = (run(RAY_ENGINE, scene, size_px, fill, stencil=stencil, **options) for stencil in (False, True))
    c = found.counters
    return [
        {
            "scene": scene,
            "triangles": len(found.scene.triangles),
            "size_px": size_px,
            "tile_px": tile_px,
            "fill": fill,
            "generations": generations,
            "eye_rays_that_hit_percent": hits_percent(found)[0],
            "triangle_tests": c["intersection.triangle_tests"],
            "cone_tests": c["cone.sphere_tests"],
            "rays_visited": sum(int(passed.alive.sum()) for passed in found.generations),
            "ray_engine_tests_stencil_off": plain.counters["intersection.triangle_tests"],
            "ray_engine_tests_stencil_on": tested.counters["intersection.triangle_tests"],
            "points_drawn": c["raster.primitives"] - generations,
            "vertices_of_points": c["vertex.invocations"] - CORNERS * generations,
            "quads_drawn": plain.counters["raster.primitives"],
            "vertices_of_quads": plain.counters["vertex.invocations"],
        }
    ]


def costs(rows: Rows) -> Rows:
    """A row a case, price and Ray Engine: what the hierarchical engine costs, in the Ray Engine's tests."""
    found: Rows = []
    for row in rows:
        for stencil in ("off", "on"):
            tests = row[f"ray_engine_tests_stencil_{stencil}"]
            for price in PRICES:
                cost = priced(row, price)
                found.append({
                    "scene": row["scene"], "body": row["scene"].rpartition("_")[0], "triangles": row["triangles"],
                    "ray_engine_stencil": stencil, "price_tests": price, "cost_tests": round(cost),
                    "ray_engine_tests": tests, "cost_by_ray_engine": round(cost / tests, 3),
                    "pays_off": "yes" if cost < tests else "no",
                })  # fmt: skip
    return found


def break_even(rows: Rows) -> Rows:
    """A row a body, price and Ray Engine: the fewest triangles from which on the cones pay off."""
    found: Rows = []
    table = costs(rows)
    names = ("body", "ray_engine_stencil", "price_tests")
    for key in dict.fromkeys(tuple(row[name] for name in names) for row in table):
        own = [row for row in table if tuple(row[name] for name in names) == key]
        loses = [row["triangles"] for row in own if row["pays_off"] == "no"]
        pays = [row["triangles"] for row in own if row["triangles"] > max(loses, default=0)]
        found.append({
            **dict(zip(names, key, strict=True)),
            "fewest_triangles": own[0]["triangles"], "cost_by_ray_engine_at_fewest": own[0]["cost_by_ray_engine"],
            "pays_off_from_triangles": min(pays, default=""),
            "most_triangles": own[-1]["triangles"], "cost_by_ray_engine_at_most": own[-1]["cost_by_ray_engine"],
        })  # fmt: skip
    return found


def verdicts(rows: Rows) -> Rows:
    """Whether few triangles lose and more win; and one vertex for four."""
    found: Rows = []
    table = break_even(rows)
    for body in dict.fromkeys(row["body"] for row in table):
        for stencil in ("off", "on"):
            own = [row for row in table if (row["body"], row["ray_engine_stencil"]) == (body, stencil)]
            found += _turns(body, stencil, own)
    for row in rows:
        found += [_points(row), _vertex_unit(row)]
    return found


def _turns(body: str, stencil: str, own: Rows) -> Rows:
    named = f"{style.body_name(body)}, the Ray Engine {'with' if stencil == 'on' else 'without'} stencil"
    prices = ", ".join(f"{row['price_tests']:g}" for row in own)
    few, many = own[0]["fewest_triangles"], own[0]["most_triangles"]
    turns = "; ".join(
        f"price {row['price_tests']:g}: × {row['cost_by_ray_engine_at_fewest']:g} to "
        f"× {row['cost_by_ray_engine_at_most']:g}, pays off from {row['pays_off_from_triangles'] or 'none'}"
        for row in own
    )
    loses = [row["cost_by_ray_engine_at_fewest"] > 1.0 for row in own]
    wins = [row["cost_by_ray_engine_at_most"] < 1.0 for row in own]
    return [
        claim("7.1", "with few primitives the cones do not pay off", named,
              f"with {few} triangles the hierarchical engine costs more than the Ray Engine, a cone test and a ray "
              f"visited priced at {prices} tests; depends where it does at some of these prices",
              turns, all(loses) or (None if any(loses) else False)),
        claim("7.1", "with more primitives the situation is reversed", named,
              f"with {many} triangles it costs less, at {prices} tests; depends where it does at some of these prices",
              turns, all(wins) or (None if any(wins) else False)),
    ]  # fmt: skip


def _points(row: Row) -> Row:
    tiles = (row["size_px"] // row["tile_px"]) ** 2 * row["generations"]
    a_point = row["vertices_of_points"] / (tiles * row["triangles"])
    a_quad = row["vertices_of_quads"] / row["quads_drawn"]
    return claim(
        "3", "points spare the fourfold overhead of a quad's vertices", row["scene"],
        f"a vertex shader run a tile and triangle, where the Ray Engine's quads take {CORNERS}",
        f"{a_point:g} against {a_quad:g}", a_point == 1.0 and a_quad == CORNERS,
    )  # fmt: skip


def _vertex_unit(row: Row) -> Row:
    share = 100.0 * row["vertices_of_quads"] / row["ray_engine_tests_stencil_off"]
    return claim(
        "3", "the ray engine makes practically no use of the vertex unit", row["scene"],
        f"its vertex shader runs are at most {PRACTICALLY_NONE:g} percent of its fragment shader runs, a test each",
        f"{share:.4f} percent", share <= PRACTICALLY_NONE,
    )  # fmt: skip


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counters; costs; break-even; verdicts."""
    return {
        "few-triangles": rows, "few-triangles-costs": costs(rows), "few-triangles-break-even": break_even(rows),
        "few-triangles-verdicts": verdicts(rows),
    }


EXPERIMENT = Experiment(
    "few-triangles",
    "Few triangles: from where on cones pay off",
    "256² rays, tiles of 16 × 16 pixels, 5 generations (64² and 4 × 4 with `--quick`). Cost: ray–triangle tests, and "
    "cone–sphere tests and rays visited in the construction of cones, each at a stated price in ray–triangle tests. "
    "The price is an assumption, the counts are not.",
    cases,
    measure,
    None,
    tables,
)
