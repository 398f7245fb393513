"""Plan: `reproduce` writes whole files, the same every time, and does not measure twice.

- Every experiment writes its CSV, and a PNG unless it is a table of verdicts; the index names them.
- Two runs in two folders give the same bytes.
- A run that is interrupted between cases goes on behind the last finished one; a second run measures nothing.
- Rows are measured again when the code that computes them, or the case, has changed; a damaged journal is no journal.
- An interrupted write leaves the older file and no other; a picture is drawn again only for other rows.
- Unknown papers and experiments, and a folder that cannot be written, are refused before anything is measured.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from refsim.errors import InputError
from refsim.experiments import files, reproduce, reproduction, topics
from tests.experiments.tiny import TINY


def written(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(out.iterdir()) if path.is_file()}


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """`figure-7` alone, whose measurement is cheap and noted."""
    calls: list[dict] = []

    def measure(**case) -> list[dict]:
        calls.append(case)
        return [{"size_px": case["size_px"], "tests": 7 * case["size_px"]}]

    def cases(quick: bool) -> list[dict]:
        return [{"size_px": k} for k in range(5)]

    experiment = replace(TINY["figure-7"], cases=cases, measure=measure, plot=None, tables=None)
    monkeypatch.setattr(topics, "TOPICS", {"hre": (experiment,)})
    return calls


def test_every_experiment_writes_its_files_and_the_same_again(tiny, tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    paths = list(reproduce("hre", quick=True, out=first))
    assert all(path.is_file() for path in paths)
    for name in tiny:
        assert (first / f"{name}.csv").is_file()
        assert (first / f"{name}.png").is_file() is (name != "claims-hre")
    list(reproduce("hre", quick=True, out=second))
    assert written(first) == written(second)
    assert {path.name for path in paths} == set(written(first))
    index = (first / "index.md").read_text()
    assert all(path.name in index for path in paths if path.name != "index.md")
    for path in first.glob("*.png"):
        with Image.open(path) as picture:
            assert picture.size[0] >= 900


def test_interrupted_run_goes_on(counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep, kept = files.Journal.keep, []

    def stop_after_three(journal, case, rows):
        keep(journal, case, rows)
        kept.append(case)
        if len(kept) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(files.Journal, "keep", stop_after_three)
    with pytest.raises(KeyboardInterrupt):
        list(reproduce("hre", out=tmp_path))
    assert written(tmp_path) == {}
    assert [case["size_px"] for case in counted] == [0, 1, 2]
    list(reproduce("hre", out=tmp_path))
    assert [case["size_px"] for case in counted] == [0, 1, 2, 3, 4]
    whole = written(tmp_path)["figure-7.csv"]
    assert whole.decode().splitlines() == ["size_px,tests", *(f"{k},{7 * k}" for k in range(5))]
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 5 and written(tmp_path)["figure-7.csv"] == whole


@pytest.mark.parametrize("damage", ["", "{", '{"key": "other", "cases": {}}', "[]"])
def test_stale_or_damaged_journal_is_no_journal(damage: str, counted, tmp_path: Path) -> None:
    list(reproduce("hre", out=tmp_path))
    journal = tmp_path / files.RESUME / "figure-7.json"
    journal.write_text(damage)
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 10


def test_changed_code_is_measured_again(counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from refsim.experiments import fingerprint

    list(reproduce("hre", out=tmp_path))
    sources = fingerprint._sources()
    monkeypatch.setattr(fingerprint, "_sources", lambda: {**sources, "geometry/cone.py": "changed"})
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 10
    monkeypatch.setattr(fingerprint, "_sources", lambda: {**sources, "cli.py": "changed"})
    journal = json.loads((tmp_path / files.RESUME / "figure-7.json").read_text())
    assert fingerprint.rows_key(TINY["figure-7"]) != journal["key"]


def test_fingerprint_sees_the_numerical_rooms() -> None:
    from refsim.experiments import fingerprint

    named = fingerprint._numerical()
    assert {"methods.py", "geometry/cone.py", "pipeline/draw.py", "scene/camera.py", "reference/cone.py"} <= named
    assert not {name for name in named if name.startswith(("experiments", "oracle", "cli"))}


def test_interrupted_write_leaves_the_older_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "table.csv"
    files.write_csv(path, [{"a": 1}])

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", stop)
    with pytest.raises(KeyboardInterrupt):
        files.write_csv(path, [{"a": 2}])
    assert written(tmp_path) == {"table.csv": b"a\n1\n"}


def test_picture_is_drawn_for_other_rows_only(tmp_path: Path) -> None:
    drawn = []

    def plot(rows):
        drawn.append(rows)
        return TINY["errata"].plot(rows)

    experiment = replace(TINY["errata"], plot=plot)
    rows = [row for case in experiment.cases(True)[:3] for row in experiment.measure(**case)]
    reproduction.draw_figure(experiment, rows, tmp_path)
    reproduction.draw_figure(experiment, rows, tmp_path)
    assert len(drawn) == 1
    reproduction.draw_figure(experiment, rows[:-1], tmp_path)
    assert len(drawn) == 2


def test_csv_reads_back(tmp_path: Path) -> None:
    rows = [{"a": 1, "b": 2.5, "c": "text, with a comma"}, {"a": -3, "b": 0.1, "c": ""}]
    assert files.read_csv(files.write_csv(tmp_path / "t.csv", rows)) == rows


@pytest.mark.parametrize(
    ("paper", "only", "names"),
    [("xyz", None, ("xyz", "hre")), ("hre", "figure-99", ("figure-99", "figure-7", "claims-hre"))],
)
def test_unknown_names_are_refused(paper, only, names, counted, tmp_path: Path) -> None:
    if paper == "hre":
        topics.TOPICS["hre"] = tuple(TINY.values())
    with pytest.raises(InputError) as refusal:
        reproduce(paper, only=only, out=tmp_path / "out")
    assert all(name in str(refusal.value) for name in names)
    assert counted == [] and not (tmp_path / "out").exists()


def test_folder_that_is_a_file_is_refused(counted, tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(InputError, match="out"):
        reproduce("hre", out=tmp_path / "out")
    assert counted == []
