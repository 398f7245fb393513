"""Caustics by the engine: light rays through glass, splatted on a floor; and a ball's caustic against the formulas.

The Hierarchical Ray Engine computes caustics "when using the technique to trace photon paths" (section 7), and leaves
the implementation to future work (section 9). Light falls on a ball of glass, and receivers at several distances are
compared with Snell's law at both surfaces (`refsim.reference.caustics`, float64), photon by photon and as a profile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.caustic_pictures import lit_scene, picture
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.verdicts import claim
from refsim.papers.hierarchical_ray_engine.caustics import Caustic, ParallelLight, Receiver, caustic
from refsim.reference import caustics as exact
from refsim.scene import Scene, load_scene

PLANES = (1.2, 1.35, 1.5, 2.0, 3.0)  # distances of receivers from the ball's centre, in radii
SHADINGS = ("smooth", "geometric")
PICTURES = ("torus_knot", "blob")
HALF = 1.0  # half the side of a ball's receiver, in radii
INNERMOST, OUTERMOST = 0.01, 0.95
LOWEST_HEIGHT, HIGHEST_HEIGHT = 0.02, 0.8
PROFILE, RINGS, LANDING, PICTURED = (f"caustics-{name}" for name in ("profile", "rings", "landing", "pictures"))
ROUNDING = 1e-12  # float64 sums of up to two million parts of one size: 2^-53 times the root of their number, and more
FATES = ("caustic", "direct", "absorbed", "left", "unfinished")


def cases(quick: bool) -> list[Case]:
    """Balls of several meshes, planes behind the finest, and pictures."""
    meshes, across, rings = ((224, 896, 3584), 192, 25) if quick else ((896, 3584, 14336, 57600), 768, 50)
    landing = [
        {"part": "landing", "body": f"sphere_{n}", "shading": shading, "plane_radii": 2.0, "photons_across": 96}
        for n in meshes for shading in SHADINGS
    ]  # fmt: skip
    ball = {"body": f"sphere_{3584 if quick else 14336}", "shading": "smooth", "photons_across": across, "rings": rings}
    profiles = [{"part": "profile", **ball, "plane_radii": plane} for plane in PLANES]
    small = {"photons_across": 256, "map_px": 128, "size_px": 96, "samples": 1}
    large = {"photons_across": 1536, "map_px": 640, "size_px": 300, "samples": 2}
    pictures = [
        {"part": "picture", "body": f"{body}_{1000 if quick else 5000}", **(small if quick else large)}
        for body in PICTURES
    ]
    return [*landing, *profiles, *pictures]


def measure(part: str, **case: Any) -> Rows:
    """Rows of one case by table: its account, and what its part is about."""
    work: dict[str, Callable[..., list[tuple[str, Row]]]] = {
        "landing": _landing, "profile": _profile, "picture": _picture,
    }  # fmt: skip
    return [{"table": table, **row} for table, row in work[part](**case)]


@lru_cache(maxsize=2)
def ball_of(body: str) -> Scene:
    """The unit ball with its own normals at the vertices."""
    scene = load_scene(body)
    length = np.linalg.norm(scene.triangles.astype(np.float64), axis=-1, keepdims=True)
    return scene.replace(normals=(scene.triangles / length).astype(np.float32))


@lru_cache(maxsize=2)
def ball_caustic(body: str, shading: str, plane_radii: float, photons_across: int) -> Caustic:
    """Parallel light down on the ball, a receiver across it below."""
    floor = Receiver((-HALF, -plane_radii, HALF), (2.0 * HALF, 0.0, 0.0), (0.0, 0.0, -2.0 * HALF))
    light = ParallelLight((0.0, -1.0, 0.0))
    return caustic(ball_of(body), light, floor, photons_across=photons_across, resolution=(256, 256), shading=shading)


def deepest_facet(scene: Scene) -> float:
    """How far inside the unit sphere the mesh's planes go, in radii."""
    a, b, c = np.moveaxis(scene.triangles.astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    return float(1.0 - (np.einsum("ij,ij->i", normal, a) / np.linalg.norm(normal, axis=1)).min())


def heights_and_places(found: Caustic) -> tuple[np.ndarray, np.ndarray]:
    """Of photons bent by the ball's two surfaces: height before, and height on the receiver, negative beyond the axis;
    radii."""
    start = found.light.rays.origin.astype(np.float64)[:, [0, 2]]
    height = np.linalg.norm(start, axis=1)
    rows = np.flatnonzero((found.generation == 2) & (found.triangle >= 0) & (height > LOWEST_HEIGHT))
    place = found.point[rows][:, [0, 2]].astype(np.float64)
    return height[rows], np.einsum("ij,ij->i", place, start[rows]) / height[rows]


def _landing(body: str, shading: str, plane_radii: float, photons_across: int) -> list[tuple[str, Row]]:
    found = ball_caustic(body, shading, plane_radii, photons_across)
    height, place = heights_and_places(found)
    inner = height < HIGHEST_HEIGHT
    height, place = height[inner], place[inner]
    off = place - exact.height_on_plane(height, plane_radii)
    offset = float(ball_of(body).epsilon)
    started = place - exact.height_on_plane(height, plane_radii, exact.Ball(offset=offset))
    paraxial = height < 0.15
    slope = float((place[paraxial] @ height[paraxial]) / (height[paraxial] @ height[paraxial]))
    third = height[paraxial] @ exact.height_on_plane(height[paraxial], plane_radii) / (height[paraxial] ** 2).sum()
    row = {
        "body": body, "shading": shading, "plane_radii": plane_radii, "photons": len(height),
        "deepest_facet_radii": round(deepest_facet(ball_of(body)), 6),
        "start_offset_radii": round(offset, 6),
        "rms_from_exact_radii": round(float(np.sqrt((off**2).mean())), 6),
        "largest_from_exact_radii": round(float(np.abs(off).max()), 6),
        "rms_from_exact_with_start_offset_radii": round(float(np.sqrt((started**2).mean())), 6),
        "focal_length_radii": round(plane_radii / (1.0 - slope), 4),
        "focal_length_exact_same_heights_radii": round(plane_radii / (1.0 - float(third)), 4),
        "focal_length_paraxial_radii": exact.focal_length(1.5),
    }  # fmt: skip
    return [("caustics", _account("landing", body, shading, plane_radii, photons_across, found)), (LANDING, row)]


def _profile(body: str, shading: str, plane_radii: float, photons_across: int, rings: int) -> list[tuple[str, Row]]:
    found = ball_caustic(body, shading, plane_radii, photons_across)
    place = found.point[(found.generation == 2) & (found.triangle >= 0)].astype(np.float64)
    edges = np.geomspace(INNERMOST, OUTERMOST * HALF, rings + 1)
    counts, _ = np.histogram(np.hypot(place[:, 0], place[:, 2]), edges)
    area = np.pi * (edges[1:] ** 2 - edges[:-1] ** 2)
    measured = counts * float(found.light.energy[0]) / area
    formula = exact.irradiance_profile(edges, plane_radii)
    head = {"body": body, "plane_radii": plane_radii}
    profile: list[tuple[str, Row]] = [
        (PROFILE, {**head, "inner_radii": round(float(edges[k]), 5), "outer_radii": round(float(edges[k + 1]), 5),
                     "photons": int(counts[k]), "irradiance_w_per_m2": round(float(measured[k]), 5),
                     "exact_w_per_m2": round(float(formula[k]), 5)})
        for k in range(rings)
    ]  # fmt: skip
    ring = exact.ring_radius(plane_radii)
    outer = edges[1:] > 0.5 * ring  # the light on the axis is bright too
    peak = int(np.flatnonzero(outer)[np.argmax(measured[outer])])
    row: Row = {
        **head,
        "ring_exact_radii": round(ring, 5),
        "ring_measured_from_radii": round(float(edges[peak]), 5) if ring else "",
        "ring_measured_to_radii": round(float(edges[peak + 1]), 5) if ring else "",
        "within_largest_exact_percent": round(100.0 * _inside(edges, formula), 3),
        "within_largest_measured_percent": round(100.0 * _inside(edges, measured), 3),
    }
    account = _account("profile", body, shading, plane_radii, photons_across, found)
    return [("caustics", account), (RINGS, row), *profile]


def _inside(edges: np.ndarray, irradiance: np.ndarray) -> float:
    """Share of the light that falls on the ball (π W) which arrives within the outermost ring."""
    return float((irradiance * (edges[1:] ** 2 - edges[:-1] ** 2)).sum())


def _account(part: str, body: str, shading: str, plane: float | str, across: int, found: Caustic) -> Row:
    """Photons and energy by fate, and how far the sums are apart."""
    account = found.account
    energy = {name: float(values.sum()) for name, values in account.energy.items()}
    ends = sum(energy[name] for name in FATES) + energy["tinted"]
    # Exact sums: the digits of what rounding leaves must not depend on the machine
    light = math.fsum(part for lit in (found.irradiance, found.direct) for part in lit.ravel().tolist())
    texel = found.texel_area
    return {
        "part": part, "body": body, "shading": shading, "plane_radii": plane, "photons_across": across,
        "photons_sent": account.photons["sent"],
        **{f"photons_{name}": account.photons[name] for name in FATES},
        "sent_w": float(f"{energy['sent']:.6g}"),
        **{f"{name}_w": float(f"{energy[name]:.6g}") for name in (*FATES, "tinted")},
        "account_open_w": float(f"{abs(ends - energy['sent']):.1e}"),
        "light_map_off_w": float(f"{abs(light * texel - energy['caustic'] - energy['direct']):.1e}"),
        "light_map_off_bound_w": float(f"{float(account.rounding.sum()):.1e}"),
        "most_photons_in_a_texel": int(found.photons.max()),
        "brightest_w_per_m2": round(float(found.irradiance.max()), 3),
    }  # fmt: skip


def _picture(body: str, photons_across: int, map_px: int, size_px: int, samples: int) -> list[tuple[str, Row]]:
    found = lit_scene(body, photons_across, map_px).caustic
    account = _account("picture", body, "smooth", "", photons_across, found)
    head = {"body": body, "photons_across": photons_across, "map_px": map_px, "size_px": size_px, "samples": samples}
    return [("caustics", account), (PICTURED, {**head, "photons_caustic": account["photons_caustic"]})]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Accounts of every run; the ball's profiles and rings; how far photons land from the exact place; pictures."""
    found: dict[str, Rows] = {table: [] for table in ("caustics", PROFILE, RINGS, LANDING, PICTURED)}
    for row in rows:
        found[row["table"]].append({name: value for name, value in row.items() if name != "table"})
    return {**found, "caustics-verdicts": [_adds_up(row) for row in found["caustics"]]}


def _adds_up(row: Row) -> Row:
    """Whether all light that is sent is found again, and makes a caustic."""
    body = ", ".join(str(row[name]) for name in ("part", "body", "shading", "plane_radii") if row[name] != "")
    return claim(
        "9", "caustics by the engine", body,
        f"photons make a caustic; what is sent falls on the receiver, is absorbed, leaves or is unfinished, to "
        f"{ROUNDING:g} of it, and the light map holds what fell, to the rounding of its texels",
        f"{row['photons_caustic']} photons make it; {row['account_open_w']:g} of {row['sent_w']:g} W are not found "
        f"again; the map is off by {row['light_map_off_w']:g} W, may be by {row['light_map_off_bound_w']:g}",
        row["photons_caustic"] > 0 and row["account_open_w"] <= ROUNDING * row["sent_w"]
        and row["light_map_off_w"] <= row["light_map_off_bound_w"],
    )  # fmt: skip


def plot(rows: Rows) -> Any:
    """Pictures above; profiles and landing errors below."""
    figure = style.new_figure(6.9)
    upper, lower = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.05))
    places = upper.subgridspec(1, 2)
    for place, row in zip((places[0], places[1]), [row for row in rows if row["table"] == PICTURED], strict=True):
        axes = figure.add_subplot(place)
        style.no_frame(axes)
        axes.imshow(picture(row["body"], row["photons_across"], row["map_px"], row["size_px"], row["samples"]),
                    interpolation="lanczos")  # fmt: skip
        axes.set_title(f"glass {style.body_name(row['body'])}, light from the left")
        axes.set_xlabel(f"{row['photons_caustic'] / 1e3:,.0f} k photons make the caustic", fontsize=8)
    places = lower.subgridspec(1, 2, width_ratios=(1.5, 1.0))
    left, right = figure.add_subplot(places[0]), figure.add_subplot(places[1])
    _plot_profiles(left, [row for row in rows if row["table"] == PROFILE])
    _plot_landing(right, [row for row in rows if row["table"] == LANDING])
    return figure


def _plot_profiles(axes: Any, rows: Rows) -> None:
    planes = list(dict.fromkeys(row["plane_radii"] for row in rows))
    for k, plane in enumerate(planes):
        own = [row for row in rows if row["plane_radii"] == plane]
        middle = [0.5 * (row["inner_radii"] + row["outer_radii"]) for row in own]
        formula = [row["exact_w_per_m2"] or np.nan for row in own]
        found = [row["irradiance_w_per_m2"] or np.nan for row in own]
        axes.plot(middle, formula, color=style.CYCLE[k], linewidth=1.2)
        label = f"z = {plane:g} R" + (" (focus)" if plane == exact.focal_length(1.5) else "")
        axes.plot(middle, found, style.MARKERS[k], color=style.CYCLE[k], markersize=3.2, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    style.plain_ticks(axes.xaxis)
    axes.set_xlabel("distance from the axis, ball radii")
    axes.set_ylabel("irradiance, multiples of the light's")
    axes.set_title("Behind a glass ball: photons, Snell's law (lines)")
    axes.set_ylim(bottom=2e-3)
    axes.legend(loc="lower left", fontsize=8)


def _plot_landing(axes: Any, rows: Rows) -> None:
    for k, shading in enumerate(SHADINGS):
        own = [row for row in rows if row["shading"] == shading]
        number = [int(row["body"].rpartition("_")[2]) for row in own]
        axes.plot(number, [row["rms_from_exact_radii"] for row in own], style.MARKERS[k] + "-", color=style.CYCLE[k],
                  label=f"{shading} normals")  # fmt: skip
    smooth = [row for row in rows if row["shading"] == SHADINGS[0]]
    started = [row["rms_from_exact_with_start_offset_radii"] for row in smooth]
    axes.plot(number, started, "^-", color=style.GREEN, linewidth=1.2, label="smooth, formula with offset")
    sags = [row["deepest_facet_radii"] for row in smooth]
    axes.plot(number, sags, ":", color=style.FAINT, label="deepest facet")
    axes.axhline(rows[0]["start_offset_radii"], color=style.FAINT, linewidth=1.0, linestyle="--",
                 label="offset of a new ray")  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    style.count_ticks(axes.xaxis)
    axes.set_xlabel("triangles of the ball")
    axes.set_ylabel(f"rms at z = {rows[0]['plane_radii']:g} R, ball radii")
    axes.set_title("Photons from their exact place")
    axes.set_ylim(bottom=1e-5)
    axes.legend(fontsize=7.5, loc="lower left")


EXPERIMENT = Experiment(
    "caustics",
    "Caustics: photons through the engine",
    "Above: tinted glass over a floor, lit from the left by a point light; photons run through the engine as light "
    "rays and are splatted on the floor. Below left: parallel light behind a ball of radius R and index 1.5; between "
    "ball and focus the light piles up in a ring. Below right: photons that fall on the ball within "
    f"{HIGHEST_HEIGHT:g} R of the axis, against Snell's law: interpolated normals err by the facets' depth, which "
    "falls as 1/triangles, and by the offset of a new ray from the surface, which does not fall (the formula with that "
    "offset shows it); geometric ones by the facets' tilt.",
    cases,
    measure,
    plot,
    tables,
    alt="Two pictures of a glass knot and a glass blob above a floor, each with a bright curved caustic in its shadow. "
    "Below, profiles of light behind a glass ball at five distances, whose marks lie on the lines of the formula, and "
    "the photons' distance from their exact place falling with the number of triangles for two kinds of normals.",
)
