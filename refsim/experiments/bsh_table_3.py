"""Table 3: bytes of a scene's copy, the link that the paper's times then mean, and what rendering can hide.

Sizes are those of the byte layout; a fixed time and a rate are fitted to the paper's milliseconds over the scenes that
have the paper's number of triangles. Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies, section 5."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import bsh_published as published
from refsim.experiments import style
from refsim.experiments.bsh_runs import ENABLED, MESHES, lists_of, missing_row, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state

HEAD_BYTES = 4
COPIES = {"bytes": "lists and vertices", "bytes_with_heads": "and per-polygon heads"}


def cases(quick: bool) -> list[Case]:
    """A case a scene; `--quick` leaves out the dragon."""
    names = [name for name in MESHES if not (quick and name == "Dragon")]
    return [{"published_scene": name, "mesh": mesh_state(MESHES[name])} for name in names]


def measure(published_scene: str, mesh: str) -> Rows:
    """One row."""
    from refsim.papers.sphere_hierarchy.byte_layout import bytes_of

    name = MESHES[published_scene]
    copy, frame, ratio = published.TABLE_3[published_scene]
    line: Row = {"published_scene": published_scene, "published_triangles": published.TABLE_2[published_scene][0]}
    said: Row = {"published_copy_ms": copy, "published_frame_ms": frame, "published_ratio_percent": ratio}
    if mesh == MISSING:
        return [{**line, "scene": name, "triangles": missing_row(name, 0)["triangles"], **said}]
    scene = scene_of(name)
    row: Row = {**line, "scene": name, "triangles": len(scene)}
    for culling in (None, ENABLED["culling"]):
        lists = lists_of(name, True, 6, "earliest_first", culling)
        sizes = bytes_of(lists)
        mark = "culled_" if culling else ""
        row[f"{mark}elements"] = int(lists.first[-1])
        row[f"{mark}list_bytes"] = sum(sizes.lists)
        row[f"{mark}total_bytes"] = sizes.total
    single = bytes_of(lists_of(name, True, 1))
    row["single_list_total_bytes"] = single.total
    row["redundancy_of_elements"] = round(row["culled_list_bytes"] / sum(single.lists), 4)
    row["redundancy_of_bytes"] = round(row["culled_total_bytes"] / single.total, 4)
    row["bytes"] = row["culled_total_bytes"]
    row["bytes_with_heads"] = row["bytes"] + 6 * HEAD_BYTES * len(scene)
    return [{**row, **said}]


def known(rows: Rows) -> Rows:
    """Scenes that are here and have as many triangles as the paper's."""
    return [row for row in rows if row["triangles"] == row["published_triangles"]]


def links(rows: Rows) -> Rows:
    """A row a content of the copy: what link fits, and how far it is off."""
    from refsim.papers.sphere_hierarchy.transfer import fit_link

    own, found = known(rows), []
    for key, content in COPIES.items():
        times = [row["published_copy_ms"] for row in own]
        fitted = fit_link([row[key] for row in own], [ms / 1e3 for ms in times])
        off = [1e3 * float(value) for value in fitted.residuals]
        found.append(
            {
                "content": content,
                "scenes": len(own),
                "fixed_ms": round(1e3 * fitted.link.fixed, 3),
                "rate_mb_per_s": round(fitted.link.rate / 1e6, 2),
                "largest_residual_ms": round(max(map(abs, off)), 3),
                "largest_residual_percent": round(100 * max(abs(a) / b for a, b in zip(off, times, strict=True)), 2),
            }
        )
    return found


def hidden(rows: Rows) -> Rows:
    """A row a scene: the paper's own times, and what a copy beside rendering would leave to wait for."""
    from refsim.papers.sphere_hierarchy.transfer import overlap

    found: Rows = []
    for row in rows:
        copy, frame = row["published_copy_ms"], row["published_frame_ms"]
        share = overlap(copy / 1e3, frame / 1e3)
        found.append(
            {
                "published_scene": row["published_scene"],
                "published_ratio_percent": row["published_ratio_percent"],
                "ratio_percent": round(100.0 * copy / frame, 2),
                "frame_ms_from_fps": round(1e3 / published.TABLE_2[row["published_scene"]][2].fps, 3),
                "published_frame_ms": frame,
                "hidden_ms": round(1e3 * share.hidden, 3),
                "exposed_ms": round(1e3 * share.exposed, 3),
                "frames_per_second_blocking": round(1e3 / (copy + frame), 3),
                "frames_per_second_hidden": round(1e3 / max(copy, frame), 3),
            }
        )
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Bytes, links, what is hidden."""
    found = {"bsh-table-3": rows, "bsh-table-3-hidden": hidden(rows)}
    return found | ({"bsh-table-3-links": links(rows)} if len(known(rows)) > 1 else {})


def plot(rows: Rows) -> Any:
    """Left the copies' times against bytes with the fit; right the lists' sizes."""
    figure = style.new_figure(3.7)
    left, right = figure.subplots(1, 2)
    present = [row for row in rows if row["triangles"] != MISSING]
    _draw_fit(left, rows)
    places = range(len(present))
    for k, (key, name, color) in enumerate(
        (("single_list_total_bytes", "one list", style.SKY), ("total_bytes", "six lists", style.ORANGE),
         ("culled_total_bytes", "six, safe culling", style.BLUE))
    ):  # fmt: skip
        heights = [row[key] / row["triangles"] for row in present]
        right.bar([place + 0.27 * (k - 1) for place in places], heights, 0.25, color=color, label=name)
    right.set_xticks(list(places), [row["published_scene"].replace(" ", "\n") for row in present], fontsize=8)
    right.set_ylabel("bytes a triangle, vertices included")
    right.set_title("What a copy moves")
    right.set_ylim(0, 240)
    right.grid(False, axis="x")
    right.legend(loc="upper left", ncols=3, fontsize=7.5, columnspacing=0.9, handlelength=1.2)
    absent = [row["scene"] for row in rows if row["triangles"] == MISSING]
    if absent:
        left.text(0.05, 0.9, f"missing: {', '.join(absent)}", transform=left.transAxes, color=style.FAINT)
    return figure


def _draw_fit(axes: Any, rows: Rows) -> None:
    own = known(rows)
    axes.set_xlabel("bytes of our layout, MB")
    axes.set_ylabel("paper's copy, ms")
    axes.set_title("The paper's copies against our bytes")
    if len(own) < 2:
        return
    link = links(rows)[0]
    sizes = [row["bytes"] for row in own]
    line = [min(sizes) * (max(sizes) / min(sizes)) ** (k / 100.0) for k in range(101)]
    axes.plot(
        [size / 1e6 for size in line], [link["fixed_ms"] + size / (1e3 * link["rate_mb_per_s"]) for size in line],
        color=style.FAINT, linewidth=1.2,
    )  # fmt: skip
    axes.plot([size / 1e6 for size in sizes], [row["published_copy_ms"] for row in own], "o", color=style.BLUE)
    for row in own:
        last = row["bytes"] == max(sizes)
        axes.annotate(
            row["published_scene"], (row["bytes"] / 1e6, row["published_copy_ms"]), fontsize=8,
            xytext=(-8, -2) if last else (-4, 8), textcoords="offset points", ha="right" if last else "left",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(0, None)
    told = f"{link['fixed_ms']:.1f} ms + bytes / ({link['rate_mb_per_s']:,.0f} MB/s)"
    axes.text(0.97, 0.06, told, transform=axes.transAxes, ha="right", fontsize=8)


EXPERIMENT = Experiment(
    "bsh-table-3",
    "Table 3: bytes of a copy, and what rendering hides",
    "Six lists with safe culling and the shared vertices, in the byte layout of section 2.1; per-polygon heads are "
    "four bytes a polygon and list more. Left: the paper's milliseconds against our bytes for the scenes with the "
    "paper's number of triangles, and the fixed time and rate that fit them best; the substitute of the Happy Buddha "
    "is left out. Right: bytes a triangle. The table of what is hidden takes the paper's own times.",
    cases,
    measure,
    plot,
    tables,
    alt="Left, the paper's milliseconds of a copy against the bytes of our layout, on one curve of a fixed time and a "
    "rate; right, bars of bytes a triangle with one list, with six and with six culled.",
)
