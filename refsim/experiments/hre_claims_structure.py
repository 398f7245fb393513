"""Claims on how the engines are built, and on the cones: sections 2.1, 3, 4 and 7.1 of The Hierarchical Ray Engine.

Counts of figure 7's runs against what the structure demands, cone angles of figure 4, and the tightest cones.
"""

from __future__ import annotations

from itertools import pairwise

from refsim.experiments import figure_4, figure_7
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from refsim.experiments.verdicts import claim

GENERATIONS = 5  # Figure 7's paths
FAR_MORE = 10.0  # an order of magnitude


def structure_claims(rows: Rows) -> Rows:
    """Sections 2.1 and 3, on the runs of figure 7."""
    found: list[Row] = []
    for view in figure_7.views(rows):
        own = figure_7.of_view(rows, view)
        body = figure_7.label(view)
        naive = figure_7.select(own, engine=RAY_ENGINE, stencil="off")
        tests = [row["triangle_tests"] / (row["size_px"] ** 2 * row["triangles"] * GENERATIONS) for row in naive]
        found.append(
            claim(
                "2.1", "the ray engine tests every ray against every primitive", body,
                "ray-triangle tests are pixels * triangles * iterations in every run without stencil",
                f"x {min(tests):.4f} to {max(tests):.4f}", all(share == 1.0 for share in tests),
            )
        )  # fmt: skip
        found += _tile_tests(body, figure_7.select(own, engine=HIERARCHICAL))
        found += [_directions(body, own), _more_quads(body, figure_7.select(own, engine=HIERARCHICAL))]
    return found


def _directions(body: str, own: Rows) -> Row:
    """The shader that intersects also bends: `shaders.intersection_fragment`, the same for both engines."""
    off = 0
    for row in own:
        cones = 0 if row["engine"] == RAY_ENGINE else (row["size_px"] // row["tile_px"]) ** 2 * GENERATIONS
        off += row["fragment_shader_runs"] - cones != row["triangle_tests"]
    return claim(
        "7", "both calculate a refracted direction for every intersection test", body,
        "both are done by one shader: fragment shader runs, but one a cone built, are the ray-triangle tests, in every "
        "run of both engines",
        f"{off} of {len(own)} runs differ", off == 0,
    )  # fmt: skip


def _more_quads(body: str, own: Rows) -> Row:
    """Sprites that are left after the test in the vertex shader; the Ray Engine draws a quad a triangle."""
    times = [row["pairs_kept"] / (row["triangles"] * GENERATIONS) for row in own]
    return claim(
        "3", "far more quads are rendered", body,
        f"at least {FAR_MORE:g} sprites are drawn for a quad of the Ray Engine, in every run; depends where more than "
        "one",
        f"x {min(times):.3g} to {max(times):.3g}",
        True if min(times) >= FAR_MORE else None if min(times) > 1.0 else False,
    )  # fmt: skip


def _tile_tests(body: str, own: Rows) -> Rows:
    vertices, sprites = [], []
    for row in own:
        cones = (row["size_px"] // row["tile_px"]) ** 2 * GENERATIONS
        vertices.append(row["cone_tests"] / (cones * row["triangles"]))
        # A fragment a tile and iteration belongs to the pass that builds the cones
        sprites.append((row["fragments"] - cones) / (row["pairs_kept"] * row["tile_px"] ** 2))
    return [
        claim(
            "3", "a vertex is tested for every tile and every primitive", body,
            "cone tests are tiles * triangles * iterations in every run",
            f"x {min(vertices):.4f} to {max(vertices):.4f}", all(share == 1.0 for share in vertices),
        ),
        claim(
            "3", "pixel shaders are invoked only where an intersection is possible", body,
            "fragments are those of the tiles that are kept, and one a cone built, in every run",
            f"x {min(sprites):.4f} to {max(sprites):.4f}", all(share == 1.0 for share in sprites),
        ),
    ]  # fmt: skip


def growth_claims(rows: Rows) -> Rows:
    """Section 7.1, on the ratios of figure 7."""
    table = figure_7.ratios(rows)
    found: list[Row] = []
    for view in figure_7.views(table):
        ratios = [row["ratio_to_ray_engine_without_stencil"] for row in figure_7.of_view(table, view)]
        grows = [b >= a for a, b in pairwise(ratios)]
        found.append(
            claim(
                "7.1", "with few primitives the gain is small, with more of them it grows", figure_7.label(view),
                "the ratio of ray-triangle tests grows with the triangles; depends where it does from the fewest to "
                "the most, but not at each step",
                f"{ratios[0]:g} to {ratios[-1]:g}, {sum(grows)} of {len(grows)} steps up",
                True if all(grows) else None if ratios[-1] > ratios[0] else False,
            )
        )  # fmt: skip
    return found


def later_claims(rows: Rows) -> Rows:
    """Section 7.1, on the tiles of figure 4."""
    found: list[Row] = []
    table = figure_4.summary(rows)
    for scene in dict.fromkeys(row["scene"] for row in table):
        empty = [row["empty_tiles_percent"] for row in table if row["scene"] == scene]
        found.append(
            claim(
                "7.1", "later, terminated areas are identified and discarded", scene,
                "the share of tiles without a ray never falls, and the last iteration has some",
                f"{empty[0]:g} to {empty[-1]:g} percent of the tiles",
                all(b >= a for a, b in pairwise(empty)) and empty[-1] > 0,
            )
        )  # fmt: skip
    return found


def tightest_claims(rows: Rows) -> Rows:
    """Section 4, on the tightest cones."""
    found: list[Row] = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene and row["tiles"]]
        ratios = [row["median_half_angle_ratio"] for row in own if row["median_half_angle_ratio"] != ""]
        more = [row["pairs_kept_more_percent"] for row in own if row["pairs_kept_more_percent"] != ""]
        found.append(
            claim(
                "4", "the incremental cone is not optimal; a tedious one is more compact", scene,
                "the median half-angle is larger than the tightest cone's, in every generation, order and tile size; "
                "depends where in some",
                f"x {min(ratios):.3f} to {max(ratios):.3f}; pairs kept {min(more):+.0f} to {max(more):+.0f} percent",
                all(r > 1 for r in ratios) or (None if any(r > 1 for r in ratios) else False),
            )
        )  # fmt: skip
    return found
