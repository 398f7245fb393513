"""Figure 7: both engines from 100 to 5,000 triangles, in counts instead of frames per second.

The Hierarchical Ray Engine, section 7.1: 256² rays, 16 × 16 tiles, paths of 5 rays. What the paper measured in time
is counted here: ray–triangle tests (fragment shader runs), cone–sphere tests (vertex shader runs), fragments. The
Ray Engine is run without the stencil, as section 2.1 has it, and with it; all three under each early-test policy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import published, style, tile_size
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE, counts, hits_percent, run

# Body, how near the eye comes, and the normal that bends a ray. Every pixel shows the body but on the knot and on the
# farther sphere.
View = tuple[str, float, str]
BODIES: tuple[View, ...] = (
    ("torus_knot", 0.55, "geometric"),
    ("torus_knot", 0.55, "smooth"),
    ("blob", 0.55, "geometric"),
    ("sphere", 0.55, "geometric"),
    ("sphere", 0.40, "geometric"),
    ("blob", 0.55, "smooth"),
    ("sphere", 0.40, "smooth"),
)
PRICE = max(tile_size.PRICES)  # ray–triangle tests: the dearest cone test and construction step that are considered
SIZES = (100, 200, 500, 1000, 2000, 3000, 4000, 5000)
QUICK_SIZES = (100, 500, 1000)
POLICIES = ("ideal", "mesa", "none")


def cases(quick: bool) -> list[Case]:
    """A case a run. `--quick`: 128² in 8 × 8 tiles, without the policy `none` (which equals `mesa` here) and without
    interpolated normals.
    """
    sizes, policies = (QUICK_SIZES, POLICIES[:2]) if quick else (SIZES, POLICIES)
    frame = {"size_px": 128, "tile_px": 8} if quick else {"size_px": 256, "tile_px": 16}
    found = []
    for body, fill, shading in BODIES:
        if shading == "smooth" and quick:
            continue
        # Policies are compared once a body, with the default normals
        own = policies if shading == "geometric" else POLICIES[:1]
        # Without a stencil test there is nothing to reject early, so one policy stands for all
        runs = [(HIERARCHICAL, True, policy) for policy in own]
        runs += [(RAY_ENGINE, False, "ideal"), *((RAY_ENGINE, True, policy) for policy in own)]
        found += [
            {"body": body, "fill": fill, "shading": shading, "triangles": number, **frame, "generations": 5,
             "engine": engine, "stencil": stencil, "early_tests": policy}
            for number in sizes for engine, stencil, policy in runs
        ]  # fmt: skip
    return found


def measure(
    body: str,
    fill: float,
    shading: str,
    triangles: int,
    size_px: int,
    tile_px: int,
    generations: int,
    engine: str,
    stencil: bool,
    early_tests: str,
    backend: str = "numba",
) -> Rows:
    """One row: the counters of one run."""
    own: dict[str, Any] = {"tile_size": tile_px} if engine == HIERARCHICAL else {"stencil": stencil}
    found = run(
        engine, f"{body}_{triangles}", size_px, fill,
        generations=generations, shading=shading, early_tests=early_tests, backend=backend, **own,
    )  # fmt: skip
    hits = hits_percent(found)
    row: Row = {
        "body": body,
        "fill": fill,
        "shading": shading,
        "triangles": triangles,
        "size_px": size_px,
        "tile_px": tile_px if engine == HIERARCHICAL else "",
        "engine": engine,
        "stencil": "on" if stencil else "off",
        "early_tests": early_tests,
        **counts(found),
        **{f"hits_in_generation_{k}_percent": share for k, share in enumerate(hits)},
    }
    return [row]


def select(rows: Rows, **wanted: Any) -> Rows:
    """Rows whose columns have the wanted values."""
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def tests(rows: Rows, engine: str, stencil: str, policy: str) -> int:
    """Ray–triangle tests of the one row of that engine."""
    (row,) = select(rows, engine=engine, stencil=stencil, early_tests=policy)
    return int(row["triangle_tests"])


def views(rows: Rows) -> list[View]:
    """Body, fill and shading of all rows, each once."""
    return list(dict.fromkeys((row["body"], row["fill"], row["shading"]) for row in rows))


def of_view(rows: Rows, view: View, **wanted: Any) -> Rows:
    """The rows of a view whose columns have the wanted values."""
    body, fill, shading = view
    return select(rows, body=body, fill=fill, shading=shading, **wanted)


def rays_visited(row: Row) -> int:
    """Rays that the construction of cones visits: a ray lives where the one before hit, and all are glass."""
    shares = [row[f"hits_in_generation_{k}_percent"] for k in range(sum(name.startswith("hits_in") for name in row))]
    return round(row["size_px"] ** 2 * (1.0 + sum(shares[:-1]) / 100.0))


def ratios(rows: Rows) -> Rows:
    """Tests of the Ray Engine ÷ tests of the hierarchical engine, per body and triangle count; also with cone tests and
    rays visited at a price; and as how many iterations of all pixels the Ray Engine's tests with stencil are."""
    found = []
    for view in views(rows):
        for number in dict.fromkeys(row["triangles"] for row in of_view(rows, view)):
            own = of_view(rows, view, triangles=number)
            (ideal,) = select(own, engine=HIERARCHICAL, early_tests="ideal")
            hierarchical = ideal["triangle_tests"]
            plain, tested = (tests(own, RAY_ENGINE, stencil, "ideal") for stencil in ("off", "on"))
            cost = tile_size.priced({**ideal, "rays_visited": rays_visited(ideal)}, PRICE)
            row = {
                **dict(zip(("body", "fill", "shading"), view, strict=True)),
                "triangles": number,
                "eye_rays_that_hit_percent": ideal["hits_in_generation_0_percent"],
                "pairs_kept_percent": round(100.0 * ideal["pairs_kept"] / ideal["cone_tests"], 2),
                "ratio_to_ray_engine_without_stencil": round(plain / hierarchical, 2),
                "ratio_to_ray_engine_with_stencil": round(tested / hierarchical, 2),
                f"ratio_at_price_{PRICE}_without_stencil": round(plain / cost, 2),
                f"ratio_at_price_{PRICE}_with_stencil": round(tested / cost, 2),
                "ray_engine_iterations_with_stencil": round(tested / (ideal["size_px"] ** 2 * number), 3),
            }
            if select(own, early_tests="mesa"):
                late = tests(own, RAY_ENGINE, "on", "mesa") / tests(own, HIERARCHICAL, "on", "mesa")
                row["ratio_without_early_tests_mesa"] = round(late, 2)
            found.append(row)
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All runs, the ratios, and what the paper's text says."""
    return {"figure-7": rows, "figure-7-ratios": ratios(rows), "figure-7-published": published.published_rows()}


def label(view: View) -> str:
    """How a figure names a view."""
    body, fill, shading = view
    return body.replace("_", " ") + (", nearer" if fill < 0.5 else "") + (", smooth" if shading == "smooth" else "")


def plot(rows: Rows) -> Any:
    """Tests, ratios, pairs and policies; the text's own numbers below."""
    figure = style.new_figure(7.1)
    grid = figure.subplots(2, 2)
    found = ratios(rows)
    _plot_tests(grid[0, 0], rows)
    _plot_ratios(grid[0, 1], found)
    _plot_pairs(grid[1, 0], found)
    _plot_policies(grid[1, 1], rows)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    figure.supxlabel(_published_sentence(), fontsize=8, color="#444444")
    return figure


def _lines(axes: Any, rows: Rows) -> list[tuple[View, dict[str, Any]]]:
    """Logarithmic axes, and each view's look, the same in all panels."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("triangles")
    axes.set_xticks([100, 200, 500, 1000, 2000, 5000])
    axes.set_xlim(85, 1.15 * max(row["triangles"] for row in rows))
    style.count_ticks(axes.xaxis)
    style.count_ticks(axes.yaxis)
    looks = dict(zip(dict.fromkeys(view[:2] for view in BODIES), zip(style.CYCLE, style.MARKERS, strict=False),
                     strict=False))  # fmt: skip
    # Interpolated normals: the same look, open
    return [
        (view, {"color": looks[view[:2]][0], "marker": looks[view[:2]][1], "label": label(view),
                "fillstyle": "none" if view[2] == "smooth" else "full"})
        for view in views(rows)
    ]  # fmt: skip


def _curve(axes: Any, rows: Rows, column: str, look: dict[str, Any]) -> None:
    axes.plot([row["triangles"] for row in rows], [row[column] for row in rows], **look)


def _plot_tests(axes: Any, rows: Rows) -> None:
    for view, look in _lines(axes, rows):
        own = of_view(rows, view, engine=HIERARCHICAL, early_tests="ideal")
        _curve(axes, own, "triangle_tests", look)
    exhaustive = of_view(rows, views(rows)[0], engine=RAY_ENGINE, stencil="off")
    look = {"linestyle": "--", "color": style.BLACK, "label": "Ray Engine, no stencil"}
    _curve(axes, exhaustive, "triangle_tests", look)
    axes.set_ylabel("ray–triangle tests a frame")
    axes.set_title("Tests")


def _plot_ratios(axes: Any, found: Rows) -> None:
    for view, look in _lines(axes, found):
        own = of_view(found, view)
        _curve(axes, own, "ratio_to_ray_engine_without_stencil", look)
        faint = {**look, "label": None, "linestyle": ":", "markersize": 3, "linewidth": 1.2}
        _curve(axes, own, "ratio_to_ray_engine_with_stencil", faint)
    said = published.SAID_SPEEDUP
    axes.axhline(said, color=style.FAINT, linewidth=1, zorder=1)
    place = {"transform": axes.get_yaxis_transform(), "ha": "left", "va": "bottom"}
    axes.text(0.01, said * 1.03, f"{said:g}: section 8", fontsize=7.5, color="#555555", **place)
    style.plain_ticks(axes.yaxis)
    axes.set_ylabel("Ray Engine ÷ hierarchical")
    axes.set_title("Tests, ratio (dotted: with stencil)")


def _plot_pairs(axes: Any, found: Rows) -> None:
    for view, look in _lines(axes, found):
        _curve(axes, of_view(found, view), "pairs_kept_percent", look)
    style.plain_ticks(axes.yaxis)
    axes.set_ylabel("percent of all pairs")
    axes.set_title("Pairs of tile and triangle kept")


def _plot_policies(axes: Any, rows: Rows) -> None:
    """Fragment shader runs at the largest count, by policy, as a share of the Ray Engine without stencil."""
    largest = max(row["triangles"] for row in rows)
    shown = [view for view in views(rows) if of_view(rows, view, early_tests="mesa")]
    policies = [policy for policy in POLICIES if select(rows, early_tests=policy)]
    kinds = [(RAY_ENGINE, "Ray Engine", style.FAINT), (HIERARCHICAL, "hierarchical", style.BLUE)]
    bars = [(*kind, policy) for kind in kinds for policy in policies]
    width = 0.84 / len(bars)
    for i, (engine, name, color, policy) in enumerate(bars):
        shares = []
        for view in shown:
            own = of_view(rows, view, triangles=largest)
            shares.append(100.0 * tests(own, engine, "on", policy) / tests(own, RAY_ENGINE, "off", "ideal"))
        places = [k + (i - (len(bars) - 1) / 2) * width for k in range(len(shown))]
        look = {"hatch": {"ideal": "", "mesa": "////", "none": "...."}[policy], "edgecolor": "white", "linewidth": 0.4}
        axes.bar(places, shares, width * 0.94, color=color, label=f"{name}, {policy}", **look)
    axes.set_xticks(range(len(shown)), [label(view).replace(" ", "\n", 1) for view in shown])
    axes.grid(False, axis="x")
    axes.set_ylim(0, 100)
    axes.set_ylabel("shader runs, percent of the\nRay Engine without stencil")
    axes.set_title(f"Early stencil test, {largest:,} triangles")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, fontsize=8)


def _published_sentence() -> str:
    p = published
    rates = f"{p.TESTS_PER_SECOND['ray engine'] / 1e6:.1f} M/s and {p.TESTS_PER_SECOND['hierarchical'] / 1e9:.2f} G/s"
    return (
        f"The paper's text (times, not counts): {p.SIDE}² × {p.TRIANGLES:,} × {p.ITERATIONS} × {p.FPS['ray engine']} "
        f"and {p.FPS['hierarchical']:g} frames/s give {rates}; ratio {p.SPEEDUP:.1f}.\n"
        f"It says a speed-up of {p.SAID_SPEEDUP:g}, and {p.SAID_AT_100:g} at 100 triangles."
    )


EXPERIMENT = Experiment(
    "figure-7",
    "Both engines from 100 to 5,000 triangles",
    "256² rays, tiles of 16 × 16 pixels, 5 generations (128² and 8 × 8 with `--quick`). Filled markers: rays bent by "
    "the triangles' normals; open ones: by the vertices'. Counts, not times: the paper's picture of frame rates is not "
    "made here, and the numbers of its text stand beside.",
    cases,
    measure,
    plot,
    tables,
    alt="Four charts over the number of triangles for several bodies: tests a frame of both engines, their ratio with "
    "the paper's beside it, the share of pairs that the cones keep, and bars of shader runs by how early the "
    "stencil is tested.",
)
