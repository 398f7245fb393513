"""What there is to reproduce: topics, and the experiments of each in order."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from refsim.errors import InputError
from refsim.experiments import (
    bsh_claims,
    bsh_compared,
    bsh_equations,
    bsh_figure_1,
    bsh_figure_2,
    bsh_figure_3,
    bsh_figure_4,
    bsh_growth,
    bsh_histogram,
    bsh_holes,
    bsh_lists,
    bsh_locality,
    bsh_table_1,
    bsh_table_2,
    bsh_table_3,
    bsh_threshold,
    cost_model,
    cover,
    depth_24,
    depth_24_sheets,
    draw_stages,
    errata,
    figure_1,
    figure_2,
    figure_3,
    figure_4,
    figure_5,
    figure_6,
    figure_7,
    glass_mirrors,
    gsr_claims,
    gsr_equations,
    gsr_errata,
    gsr_figure_1,
    gsr_figure_3,
    gsr_figure_4,
    gsr_moving_light,
    gsr_order,
    gsr_paper_case,
    gsr_set_up,
    gsr_stages,
    gsr_table_1,
    gsr_table_2,
    gsr_table_3,
    hre_behind_glass,
    hre_caustics,
    hre_claims,
    hre_coherence,
    hre_equations,
    hre_few,
    sensitivity,
    sensitivity_grid,
    sensitivity_hierarchy,
    sensitivity_lists,
    sensitivity_nodes,
    shoot_out,
    shoot_out_speed,
    tightest_cone,
    tile_size,
    tiles_16,
)
from refsim.experiments.registry import Experiment

# A topic is a paper, or the pipeline that runs the papers
TOPICS: dict[str, tuple[Experiment, ...]] = {
    "hre": tuple(
        module.EXPERIMENT
        for module in (
            cover, figure_1, figure_2, figure_3, figure_4, figure_5, figure_6, figure_7, tile_size, tiles_16,
            tightest_cone, glass_mirrors, depth_24, depth_24_sheets, errata, hre_equations, hre_coherence, hre_few,
            hre_behind_glass, hre_caustics, hre_claims,
        )
    ),
    "gsr": tuple(
        module.EXPERIMENT
        for module in (
            gsr_figure_1, gsr_figure_3, gsr_figure_4, gsr_table_1, gsr_table_2, gsr_table_3, gsr_errata, gsr_order,
            gsr_moving_light, gsr_equations, gsr_paper_case, gsr_stages, gsr_set_up, gsr_claims,
        )
    ),
    "bsh": tuple(
        module.EXPERIMENT
        for module in (
            bsh_figure_1, bsh_figure_2, bsh_figure_3, bsh_figure_4, bsh_table_1, bsh_table_2, bsh_table_3, bsh_growth,
            bsh_histogram, bsh_threshold, bsh_holes, bsh_lists, bsh_locality, bsh_compared, bsh_equations,
            bsh_claims,
        )
    ),
    "pipeline": (draw_stages.EXPERIMENT,),
    # What compares the papers; experiments of this topic may need those of any other
    "across": (
        shoot_out.EXPERIMENT, shoot_out_speed.EXPERIMENT, sensitivity_hierarchy.EXPERIMENT,
        sensitivity_nodes.EXPERIMENT, sensitivity_grid.EXPERIMENT, sensitivity_lists.EXPERIMENT, sensitivity.EXPERIMENT,
        cost_model.EXPERIMENT,
    ),
}  # fmt: skip
TITLES = {
    "hre": "The Hierarchical Ray Engine (Szécsi, WSCG 2006)",
    "gsr": "Recursive Ray Tracing in Geometry Shader (Ralovich, Magdics, 2010)",
    "bsh": "Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies (Toczek, Houzet, Mancini, 2010)",
    "pipeline": "The pipeline",
    "across": "Across the papers",
}
INDICES = {
    "hre": "index.md",
    "gsr": "index-gsr.md",
    "bsh": "index-bsh.md",
    "pipeline": "index-pipeline.md",
    "across": "index-across.md",
}


def experiments_of(topic: str) -> dict[str, Experiment]:
    """The topic's experiments by id, in order; `InputError` for a topic that is not known."""
    if topic not in TOPICS:
        raise InputError(f"there is no topic {topic!r}; choose from {', '.join(TOPICS)}.")
    return {experiment.id: experiment for experiment in TOPICS[topic]}


def chosen(topic: str | None, only: Sequence[str] | None) -> dict[str, list[Experiment]]:
    """Topic -> its experiments, of all topics where `topic` is None, and only those of the ids where they are given;
    `InputError` for what is not known."""
    known = {name: experiments_of(name) for name in (TOPICS if topic is None else (topic,))}
    names = [name for own in known.values() for name in own]
    for name in only or ():
        if name not in names:
            raise InputError(_unknown(name, topic, names))
    return {name: [e for e in own.values() if only is None or e.id in only] for name, own in known.items()}


def _unknown(name: str, topic: str | None, names: Sequence[str]) -> str:
    """What is wrong with a name: it is another topic's, or it is misspelt."""
    for other, own in TOPICS.items():
        if any(experiment.id == name for experiment in own):
            return f"{name!r} is not of the topic {topic!r} but of {other!r}."
    near = get_close_matches(name, names, 1)
    mend = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(names)}."
    return f"there is no figure or table {name!r}{'' if topic is None else f' of {topic!r}'}; {mend}"
