"""How far a claim reaches: one factor at a time from a stated baseline, every setting judged by the paper's own rule.

    claims ─▶ cases: the runs of all settings, each once ─▶ rows ─▶ a line a setting ─▶ a summary a claim

A `Claim` says what is run at a setting and how its value comes from the runs' counters; a `Sweep` is one parameter and
its settings. Each setting is also seen by further cameras: a line has the value that the baseline's camera gives, and
beside it the range over all of them. A setting that stands in several sweeps, as the baseline does, is counted once.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from refsim.experiments.registry import Case, Row, Rows
from refsim.experiments.runs import MISSING, mesh_state

Config = Mapping[str, Any]
HOLDS, FAILS = "yes", "no"
RULED_OUT = "ruled out"  # `counted` of a setting that the claim's own words exclude
RATIO, DIFFERENCE = "ratio", "difference"
# The cameras of all papers' sweeps but each one's own, which is `front`: directions from the scene to the eye
DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "right": (1.0, 0.4, 0.3), "back": (-0.35, 0.5, -1.0), "left": (-1.0, 0.4, -0.3), "above": (0.2, 1.0, 0.35),
    "low": (0.3, 0.05, 1.0), "corner": (1.0, 0.9, 0.9), "along z": (0.0, 0.0, 1.0),
}  # fmt: skip
CAMERAS = ("front", *DIRECTIONS)


@dataclass(frozen=True)
class Sweep:
    """A parameter; its settings as label -> what differs from the baseline; those that `--quick` runs, if any."""

    parameter: str
    settings: Mapping[str, Config]
    quick: tuple[str, ...] = ()

    def chosen(self, quick: bool) -> dict[str, Config]:
        """The settings of a run."""
        return {label: over for label, over in self.settings.items() if not quick or label in self.quick}


@dataclass(frozen=True)
class Claim:
    """A claim of a headline.

    claim      what the ledger calls it; `said` is more of the paper's words
    runs       configuration of a setting -> the configurations that have to be run
    value      configuration of a setting, their rows -> the number that the claim is about, in `unit`
    low, high  the claim holds from `low` to `high`; `strict`: not at these themselves. `rule` says it in words
    base       the baseline; `quick` is what differs in that of `--quick`
    spread     how two values are compared: by their ratio or by their difference
    """

    headline: str
    claim: str
    said: str
    rule: str
    unit: str
    base: Config
    sweeps: tuple[Sweep, ...]
    runs: Callable[[Config], list[Config]]
    value: Callable[[Config, Rows], float]
    low: float = -math.inf
    high: float = math.inf
    strict: bool = False
    quick: Config = field(default_factory=dict)
    spread: str = RATIO

    def baseline(self, quick: bool) -> Config:
        """The configuration from which every sweep departs."""
        return {**self.base, **(self.quick if quick else {})}

    def holds(self, value: float) -> bool:
        """Whether the claim holds at that value."""
        return self.low < value < self.high if self.strict else self.low <= value <= self.high


def camera_sweep(quick: Sequence[str] = ()) -> Sweep:
    """All cameras."""
    return Sweep("camera", {name: {"camera": name} for name in CAMERAS}, tuple(quick))


def scene_name(config: Config) -> str:
    """The scene's name in the library or among the meshes; a mesh has no number of triangles to choose."""
    return f"{config['body']}_{config['triangles']}" if config["triangles"] else str(config["body"])


def scenes_of(runs: Iterable[Config]) -> str:
    """Names of all scenes of a setting; where a body comes in several sizes, from which to which."""
    found = list(runs)
    bodies = list(dict.fromkeys(config["body"] for config in found))
    sizes = list(dict.fromkeys(config["triangles"] for config in found))
    if len(bodies) == 1 and len(sizes) > 1:
        return f"{bodies[0]}_{min(sizes)} to {max(sizes)}"
    return ", ".join(dict.fromkeys(map(scene_name, found)))


def _key(config: Config) -> str:
    return json.dumps(dict(sorted(config.items())))


def cases_of(claims: Sequence[Claim], quick: bool, crossed: Sequence[str]) -> list[Case]:
    """Every configuration that some setting needs, once, with the cameras that look at it."""
    cameras: dict[str, tuple[Config, dict[str, None]]] = {}
    for claim in claims:
        base = claim.baseline(quick)
        for sweep in claim.sweeps:
            for over in sweep.chosen(quick).values():
                for seen in _seen(base, over, crossed):
                    for config in claim.runs(seen):
                        bare = {name: value for name, value in config.items() if name != "camera"}
                        cameras.setdefault(_key(bare), (bare, {}))[1][config["camera"]] = None
    return [
        {**bare, "cameras": list(names), "mesh": mesh_state(scene_name(bare))} for bare, names in cameras.values()
    ]  # fmt: skip


def _seen(base: Config, over: Config, crossed: Sequence[str]) -> list[Config]:
    """A setting as the baseline's camera sees it, then as the crossed ones do; with another camera, by that alone."""
    config = {**base, **over}
    own = config["camera"] != base["camera"]
    others = [] if own else [name for name in crossed if name != config["camera"]]
    return [config, *({**config, "camera": name} for name in others)]


def _known(rows: Rows, claims: Sequence[Claim]) -> dict[str, Row]:
    """The measured rows by configuration, which the runs of any claim spell out."""
    names = list(claims[0].runs(claims[0].base)[0])
    return {_key({name: row[name] for name in names}): row for row in rows}


def lines(rows: Rows, claims: Sequence[Claim], crossed: Sequence[str]) -> Rows:
    """A line a claim, parameter and setting that was run.

    The baseline stands in every sweep, and some other settings in several: `counted` is `yes` where one stands first.
    """
    known = _known(rows, claims)
    found: Rows = []
    for claim in claims:
        base = next((b for b in map(claim.baseline, (False, True)) if _was_run(claim, b, known)), None)
        if base is None:
            continue
        counted: set[str] = set()
        for sweep in claim.sweeps:
            run = {name: over for name, over in sweep.settings.items() if _was_run(claim, {**base, **over}, known)}
            # Where nothing but the baseline was run, nothing varied
            for label, over in run.items() if len(run) > 1 else ():
                line = _line(claim, sweep.parameter, label, base, over, known, crossed)
                config = _key({**base, **over})
                found.append(line | {"counted": FAILS if config in counted else HOLDS})
                counted.add(config)
    return found


def _was_run(claim: Claim, config: Config, known: Mapping[str, Row]) -> bool:
    return all(_key(run) in known for run in claim.runs(config))


def _line(
    claim: Claim, parameter: str, label: str, base: Config, over: Config, known: Mapping[str, Row],
    crossed: Sequence[str],
) -> Row:  # fmt: skip
    config = {**base, **over}
    values = [
        _value(claim, seen, known) for seen in _seen(base, over, crossed) if _was_run(claim, seen, known)
    ]  # fmt: skip
    absent = MISSING in values
    line: Row = {
        "headline": claim.headline,
        "claim": claim.claim,
        "parameter": parameter,
        "setting": label,
        "scene": scenes_of(claim.runs(config)),
        "value": values[0],
        "unit": claim.unit,
        "baseline": HOLDS if config == base else FAILS,
        "holds": MISSING if absent else HOLDS if claim.holds(values[0]) else FAILS,
        "cameras": len(values),
    }
    across = ("", "", "") if absent else (sum(map(claim.holds, values)), min(values), max(values))
    return line | dict(zip(("cameras_that_hold", "least_of_cameras", "most_of_cameras"), across, strict=True))


def _value(claim: Claim, config: Config, known: Mapping[str, Row]) -> Any:
    """Five digits; `missing` where a run had no mesh."""
    rows = [known[_key(run)] for run in claim.runs(config)]
    if any(row["mesh"] == MISSING for row in rows):
        return MISSING
    return float(f"{claim.value(config, rows):.5g}")


def apart(found: Rows) -> Rows:
    """The lines of different settings, each once; those without a mesh are left out."""
    return [line for line in found if line["counted"] == HOLDS and line["holds"] != MISSING]


def summary(found: Rows, claims: Sequence[Claim]) -> Rows:
    """A line a claim: at how many settings it holds, between what the value lies, and what moves it most."""
    rows: Rows = []
    for claim in claims:
        all_own = [line for line in found if (line["headline"], line["claim"]) == (claim.headline, claim.claim)]
        own = apart(all_own)
        if not own:
            continue
        values = [line["value"] for line in own]
        good = [line for line in own if line["holds"] == HOLDS]
        parameter, moves = _strongest(all_own, claim.spread)
        rows.append(
            {
                "headline": claim.headline,
                "claim": claim.claim,
                "rule": claim.rule,
                "settings": len(own),
                "holds": len(good),
                "baseline_holds": next(line["holds"] for line in own if line["baseline"] == HOLDS),
                "least": min(values),
                "most": max(values),
                "unit": claim.unit,
                "moved_most_by": parameter,
                "moves": moves,
                "moves_by": claim.spread,
                "only_at": _named(good[0]) if len(good) == 1 else "",
                "fails_only_at": _named(_but(own, good)) if len(good) == len(own) - 1 else "",
                "with_cameras": sum(line["cameras"] for line in own),
                "with_cameras_holds": sum(line["cameras_that_hold"] for line in own),
                "least_of_cameras": min(line["least_of_cameras"] for line in own),
                "most_of_cameras": max(line["most_of_cameras"] for line in own),
                "missing": sum(line["holds"] == MISSING for line in all_own),
            }
        )
    return rows


def _but(own: Rows, good: Rows) -> Row:
    return next(line for line in own if line not in good)


def _named(line: Row) -> str:
    return "the baseline" if line["baseline"] == HOLDS else f"{line['parameter']}: {line['setting']}"


def _strongest(own: Rows, spread: str) -> tuple[str, float]:
    """The parameter whose settings' values are furthest apart, and how far."""
    found: dict[str, list[float]] = {}
    for line in own:
        if line["holds"] != MISSING and line["counted"] != RULED_OUT:
            found.setdefault(line["parameter"], []).append(line["value"])
    by = {name: max(values) / min(values) if spread == RATIO else max(values) - min(values)
          for name, values in found.items()}  # fmt: skip
    name = max(by, key=by.__getitem__)
    return name, round(by[name], 3)
