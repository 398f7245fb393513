"""Plan: `reproduce` writes whole files, the same every time, and does not measure twice.

- Every experiment writes its CSV, and a PNG unless it is a table of verdicts; the index names them.
- Two runs in two folders give the same bytes.
- A run that is interrupted between cases goes on behind the last finished one; a second run measures nothing.
- Rows are measured again when the code that computes them, or the case, has changed; damaged rows are no rows, of that
  case alone; what is stale is swept.
- An interrupted write leaves the older file and no other; a picture is drawn again only for other rows, or damaged.
- Experiments of several topics may be chosen; without a topic there are all.
- Unknown papers, experiments, backends and numbers, and a folder that cannot be written, are refused before anything is
  measured.
"""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from refsim.errors import InputError
from refsim.experiments import files, reproduce, topics
from tests.experiments.tiny import TINY


def written(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(out.iterdir()) if path.is_file()}


def journal_files(out: Path) -> list[Path]:
    return sorted((out / files.RESUME / "figure-7").glob("*.json"))


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


@pytest.mark.parametrize(
    "damage", ["", "{", "[]", '{"key": "other"}', "key", "case", "rows", "row", "number", "digest"]
)
def test_stale_or_damaged_rows_are_no_rows(damage: str, counted, tmp_path: Path) -> None:
    list(reproduce("hre", out=tmp_path))
    whole = written(tmp_path)
    path, other, *_ = journal_files(tmp_path)
    found = json.loads(path.read_text())
    changes = {
        "key": {**found, "key": "0" * 32}, "case": json.loads(other.read_text()), "rows": {**found, "rows": None},
        "row": {**found, "rows": [7], "digest": files.rows_digest([7])},
        "number": {**found, "rows": [{**row, "tests": row["tests"] + 1} for row in found["rows"]]},
        "digest": {name: value for name, value in found.items() if name != "digest"},
    }  # fmt: skip
    path.write_text(json.dumps(changes[damage]) if damage in changes else damage)
    list(reproduce("hre", out=tmp_path))
    assert [case["size_px"] for case in counted[5:]] == [found["case"]["size_px"]]
    assert written(tmp_path) == whole and json.loads(path.read_text()) == found


def test_what_nobody_reads_again_is_swept(counted, tmp_path: Path) -> None:
    list(reproduce("hre", out=tmp_path))
    files_there = journal_files(tmp_path)
    folder = files_there[0].parent
    stale = folder / "a.json"
    (tmp_path / "timings").mkdir()
    places = (folder, tmp_path, tmp_path / "timings")
    old, young = ([place / f".a.csv.{name}.part" for place in places] for name in ("abcdefgh", "ijklmnop"))
    # By their names these are nobody's parts
    others = [tmp_path / name for name in ("a.csv.abcdefgh.part", ".a.part")]
    found = json.loads(files_there[0].read_text())
    stale.write_text(json.dumps({**found, "key": "0"}))
    # Rows of another size of run stay: its cases are others, its sources the same
    journal = files.Journal(tmp_path, "figure-7", found["key"])
    quick = journal.path(files.case_name({"size_px": 99}))
    journal.keep(files.case_name({"size_px": 99}), [])
    for parts, age in ((old, files.PART_AGE_S + 60), (young, 0.0), (others, files.PART_AGE_S + 60)):
        for part in parts:
            part.touch()
            os.utime(part, (time.time() - age,) * 2)
    list(reproduce("hre", out=tmp_path))
    assert (stale.exists(), quick.exists()) == (False, True)
    assert [part.exists() for part in (*old, *young, *others)] == [False] * 3 + [True] * 5
    assert len(counted) == 5


def test_changed_code_is_measured_again(counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from refsim.experiments import fingerprint

    list(reproduce("hre", out=tmp_path))
    sources = fingerprint._sources()
    monkeypatch.setattr(fingerprint, "_sources", lambda: {**sources, "geometry/cone.py": "changed"})
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 10
    monkeypatch.setattr(fingerprint, "_sources", lambda: {**sources, "cli.py": "changed"})
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 15  # as it was: not changed any more
    list(reproduce("hre", out=tmp_path))
    assert len(counted) == 15


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


def test_picture_is_drawn_for_other_rows_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, cases = [], TINY["errata"].cases(True)

    def plot(rows):
        drawn.append(len(rows))
        return TINY["errata"].plot(rows)

    for size in (4, 4, 3):
        experiment = replace(TINY["errata"], plot=plot, cases=lambda quick, size=size: cases[:size])
        monkeypatch.setattr(topics, "TOPICS", {"hre": (experiment,)})
        assert tmp_path / "errata.png" in list(reproduce("hre", out=tmp_path))
    assert len(drawn) == 2 and drawn[0] > drawn[1]


@pytest.mark.parametrize("damage", ["cut", "a byte"])
def test_damaged_picture_is_drawn_again(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = TINY["errata"].cases(True)[:3]
    monkeypatch.setattr(topics, "TOPICS", {"hre": (replace(TINY["errata"], cases=lambda quick: cases),)})
    list(reproduce("hre", out=tmp_path))
    path = tmp_path / "errata.png"
    whole = path.read_bytes()
    key, middle = files.figure_key(path), len(whole) // 2
    changed = whole[:2000] if damage == "cut" else whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    path.write_bytes(changed)
    assert len(whole) > 4000 and key is not None and files.figure_key(path) is None
    list(reproduce("hre", out=tmp_path))
    assert path.read_bytes() == whole and files.figure_key(path) == key


def test_csv_reads_back(tmp_path: Path) -> None:
    rows = [{"a": 1, "b": 2.5, "c": "text, with a comma"}, {"a": -3, "b": 0.1, "c": ""}]
    assert files.read_csv(files.write_csv(tmp_path / "t.csv", rows)) == rows


@pytest.mark.parametrize(
    ("paper", "only", "names"),
    [
        ("xyz", None, ("xyz", "hre")),
        ("hre", "nothing", ("nothing", "figure-7", "claims-hre")),
        ("hre", "figure-77", ("figure-77", "did you mean 'figure-7'?")),
    ],
)
def test_unknown_names_are_refused(paper, only, names, counted, tmp_path: Path) -> None:
    if paper == "hre":
        topics.TOPICS["hre"] = tuple(TINY.values())
    with pytest.raises(InputError) as refusal:
        reproduce(paper, only=only, out=tmp_path / "out")
    assert all(name in str(refusal.value) for name in names)
    assert counted == [] and not (tmp_path / "out").exists()


@pytest.mark.parametrize("options", [{"jobs": 0}, {"jobs": -1}, {"jobs": 1.5}, {"jobs": True}, {"backend": "threads"}])
def test_numbers_and_backends_that_do_not_exist_are_refused(options, counted, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=str(next(iter(options.values())))):
        reproduce("hre", out=tmp_path / "out", **options)
    assert counted == [] and not (tmp_path / "out").exists()


def test_dask_that_is_not_installed_is_named(counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"refsim\[dask\]"):
        reproduce("hre", out=tmp_path / "out", backend="dask")


def test_several_experiments_of_several_topics(counted, tmp_path: Path) -> None:
    (first,) = topics.TOPICS["hre"]
    second, third = (replace(first, id=name, title=name) for name in ("gsr-x", "gsr-y"))
    topics.TOPICS["gsr"] = (second, third)
    list(reproduce(only=["gsr-y", "figure-7"], out=tmp_path / "some"))
    assert set(written(tmp_path / "some")) == {"gsr-y.csv", "figure-7.csv"}
    list(reproduce("gsr", out=tmp_path / "one"))
    assert set(written(tmp_path / "one")) == {"gsr-x.csv", "gsr-y.csv", "index-gsr.md"}
    list(reproduce(out=tmp_path / "all"))
    names = {"gsr-x.csv", "gsr-y.csv", "figure-7.csv", "index.md", "index-gsr.md"}
    assert set(written(tmp_path / "all")) == names


@pytest.mark.parametrize("name", ["out", "out/.resume", "out/.resume/figure-7", "out/timings"])
def test_folder_that_is_a_file_is_refused(name: str, counted, tmp_path: Path) -> None:
    (experiment,) = topics.TOPICS["hre"]
    topics.TOPICS["hre"] = (experiment, replace(experiment, id="clock", timed=True))
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    with pytest.raises(InputError, match=rf"cannot write .*{tmp_path / 'out'}.*(File exists|Not a directory)"):
        reproduce("hre", out=tmp_path / "out")
    assert counted == [] and path.is_file()


def test_file_in_no_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gone" / "table.csv"
    with pytest.raises(InputError, match=f"cannot write '{path}': No such file or directory"):
        files.write_csv(path, [{"a": 1}])
