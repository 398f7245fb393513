"""Plan: however a run is cut into processes, stopped and taken up, it measures each case once and writes the same.

- Real experiments: one process or two, one thread or two, joblib or Dask: the same bytes.
- A run that is killed again and again, at moments that a seed chooses, measures no finished case a second time, loses
  none, leaves no worker behind, and in the end has written what an undisturbed run writes.
- Ctrl-C is exit code 130 and no worker left.
- A case that fails, and a worker that dies, are one sentence that names the case; what is finished is kept.
- The cluster that Dask's configuration names is the one that works; one that does not answer is one
  sentence, and so is an address that is none.
- Where workers cannot see the folder, the rows are kept where they arrive.
- Timed experiments run alone, after the others, in the process that was started; what they write lies apart.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import dask
import distributed
import pytest

from refsim.errors import InputError
from refsim.experiments import experiments_of, files, reproduce, topics, work
from refsim.experiments.outcome import Outcome
from tests.experiments import bsh_tiny, counted
from tests.experiments.tiny import TINY

ROOT = Path(__file__).resolve().parents[2]


def written(out: Path) -> dict[str, bytes]:
    """All files but those of the journal."""
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in sorted(out.rglob("*")) if path.is_file() and files.RESUME not in path.parts
    }  # fmt: skip


def start(kind: str, out: Path, log: Path, jobs: int = 2, backend: str = "joblib") -> subprocess.Popen[bytes]:
    """The command in a process, and a session, of its own."""
    command = [sys.executable, "-m", "tests.experiments.counted", kind, str(out), str(log), str(jobs), backend]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, cwd=ROOT, env=environment, start_new_session=True)


def noted(log: Path) -> list[tuple[str, int]]:
    """Cases begun, and the process of each."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [(name, int(process)) for name, process in (line.split() for line in lines)]


def kept(out: Path) -> set[str]:
    """Cases whose rows are in the journal."""
    texts = [path.read_text() for path in (out / files.RESUME).glob("*/*.json")]
    cases = [work.json.loads(text)["case"] for text in texts]
    return {f"{case['name']}/{case['k']}" for case in cases}


def all_gone(log: Path) -> bool:
    """None of the processes that measured anything is left; they are given a moment to end."""
    until = time.monotonic() + 20
    left = {process for _, process in noted(log)}
    while left and time.monotonic() < until:
        left = {process for process in left if alive(process)}
        time.sleep(0.02)
    return not left


def alive(process: int) -> bool:
    """A zombie is not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What a run in this process writes."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(topics, "TOPICS", counted.counted("good", folder / "log"))
        list(reproduce(out=folder / "out"))
    return written(folder / "out")


def test_real_experiments_are_the_same_whoever_runs_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = bsh_tiny.tiny_cases("bsh-threshold")
    compiled = replace(experiments_of("bsh")["bsh-threshold"], cases=lambda quick: cases)
    monkeypatch.setattr(topics, "TOPICS", {"hre": (TINY["figure-7"], TINY["tile-size"]), "bsh": (compiled,)})
    found = []
    for jobs, backend, threads in ((1, "joblib", "2"), (2, "joblib", "1"), (2, "dask", "2")):
        shares = {"NUMBA_NUM_THREADS": threads}
        monkeypatch.setattr("refsim.experiments.pool._shares", lambda jobs, shares=shares: shares)
        out = tmp_path / f"{jobs}-{backend}-{threads}"
        paths = list(reproduce(quick=True, out=out, jobs=jobs, backend=backend))
        found.append(written(out))
        assert {path.relative_to(out).as_posix() for path in paths} == set(found[-1])
    assert all(other == found[0] for other in found[1:])
    assert {"index.md", "index-bsh.md", "figure-7.png", "tile-size.csv", "bsh-threshold.csv"} <= set(found[0])


def test_killed_at_any_moment(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    chance = random.Random(2006)
    out, log = tmp_path / "out", tmp_path / "log"
    for kill, jobs in enumerate((2, 1, 1)):
        finished, begun = kept(out), len(noted(log))
        run = start("good", out, log, jobs)
        moment = begun + chance.randint(1, 4)
        while run.poll() is None and len(noted(log)) < moment:
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, counted.SLOW_S))
        run.kill()
        run.communicate(timeout=60)  # workers hold the pipes as long as they live
        assert run.returncode == -signal.SIGKILL, kill
        assert all_gone(log)
        again = {name for name, _ in noted(log)[begun:]}
        assert again and not again & finished
        assert finished <= kept(out)
    finished, begun = kept(out), len(noted(log))
    assert 0 < len(finished) < 18
    run = start("good", out, log)
    out_text, errors = run.communicate(timeout=120)
    assert (run.returncode, errors) == (0, b"")
    counts = Counter(name for name, _ in noted(log)[begun:])
    assert set(counts) == {name for name in names() if name not in finished} and set(counts.values()) == {1}
    assert written(out) == undisturbed
    assert {Path(line).relative_to(out).as_posix() for line in out_text.decode().splitlines()} == set(undisturbed)


def names() -> list[str]:
    sizes = {"first": counted.CASES, "second": counted.CASES // 2, "clock": 2}
    return [f"{name}/{k}" for name, size in sizes.items() for k in range(size)]


@pytest.mark.parametrize("backend", ["joblib", "dask"])
def test_ctrl_c(backend: str, tmp_path: Path) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    run = start("good", out, log, 2, backend)
    while run.poll() is None and len(noted(log)) < 4:
        time.sleep(0.005)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to all of them
    _, errors = run.communicate(timeout=60)
    assert (run.returncode, errors.decode()) == (130, "refsim: interrupted\n")
    assert all_gone(log)
    assert kept(out) and not list((out / files.RESUME).glob("*/.*.part"))


def test_a_case_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for jobs in (1, 2):
        out, log = tmp_path / f"out-{jobs}", tmp_path / f"log-{jobs}"
        monkeypatch.setattr(topics, "TOPICS", {"hre": counted.counted("bad", log)["hre"][:1]})
        with pytest.raises(InputError) as refusal:
            list(reproduce(out=out, jobs=jobs))
        sentence = str(refusal.value)
        assert sentence.startswith('first, case {"k": 5, ') and "\n" not in sentence
        assert "ZeroDivisionError: nothing left (counted.py, line " in sentence
        assert {"first/0", "first/1"} <= kept(out) and "first/5" not in kept(out)
        assert jobs == 1 or all_gone(log)


def test_a_worker_that_dies_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    monkeypatch.setattr(topics, "TOPICS", {"hre": counted.counted("fatal", log)["hre"][:1]})
    with pytest.raises(InputError, match=r'a worker was lost .* first, case {"k": 5, .* run again'):
        list(reproduce(out=out, jobs=2))
    finished, begun = kept(out), len(noted(log))
    assert {"first/0", "first/1"} <= finished
    (tmp_path / "log.spared").touch()
    list(reproduce(out=out))
    assert not finished & {name for name, _ in noted(log)[begun:]}
    assert kept(out) == {f"first/{k}" for k in range(counted.CASES)}


def test_cluster_of_the_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    monkeypatch.setattr(topics, "TOPICS", {"gsr": counted.counted("good", log)["gsr"]})
    local = {"threads_per_worker": 2, "dashboard_address": None, "silence_logs": "CRITICAL"}
    with distributed.LocalCluster(n_workers=1, **local) as cluster:
        with distributed.Client(cluster) as client:
            workers = set(client.run(os.getpid).values())
        with dask.config.set({"scheduler-address": cluster.scheduler_address}):
            list(reproduce(out=tmp_path / "out", jobs=5, backend="dask"))
    assert {process for _, process in noted(log)} == workers
    assert len(kept(tmp_path / "out")) == 6
    nobody = {"scheduler-address": "tcp://127.0.0.1:9", "distributed.comm.timeouts.connect": "200ms"}
    with dask.config.set(nobody), pytest.raises(InputError, match=r"no Dask worker answers: .*127\.0\.0\.1:9"):
        list(reproduce(out=tmp_path / "other", backend="dask"))


def test_address_that_is_none_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # In processes of their own: Dask leaves its configuration in pieces when it refuses an address
    for address, reason in (("foo://bar:1", "'foo'"), ("tcp://nonsense", "'nonsense'"), ("tls://127.0.0.1:9", "TLS")):
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", address)
        run = start("good", tmp_path / "out", tmp_path / "log", 2, "dask")
        _, errors = run.communicate(timeout=60)
        last = errors.decode().splitlines()[-1]
        assert run.returncode == 2 and last.startswith("refsim: no Dask worker answers: ") and reason in last
        assert b"Traceback" not in errors and noted(tmp_path / "log") == []


def test_rows_are_kept_where_they_arrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topics, "TOPICS", {"gsr": counted.counted("good", tmp_path / "log")["gsr"]})
    call, seen = work.Measurement.__call__, []

    def elsewhere(self: work.Measurement) -> str:
        """As on a machine that has no such folder."""
        with monkeypatch.context() as patch:
            patch.setattr(Path, "is_dir", lambda path: False)
            rows = call(self)
        seen.append(self.journal.path(self.case).exists())
        return rows

    monkeypatch.setattr(work.Measurement, "__call__", elsewhere)
    list(reproduce(out=tmp_path / "out"))
    assert seen == [False] * 6
    assert len(kept(tmp_path / "out")) == 6


def test_timed_experiments_run_alone_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    monkeypatch.setattr(topics, "TOPICS", counted.counted("good", log))
    outcome = Outcome(False, out)
    list(reproduce(out=out, jobs=2, outcome=outcome))
    last = noted(log)[-2:]
    assert last == [("clock/0", os.getpid()), ("clock/1", os.getpid())]
    assert os.getpid() not in {process for _, process in noted(log)[:-2]}
    assert {name for name in written(out) if "clock" in name} == {"timings/clock.csv", "timings/clock.png"}
    assert "[timings/clock.csv](timings/clock.csv)" in (out / "index.md").read_text()
    assert outcome.complete and list(outcome.tables) and set(outcome.cases) == {"first", "second", "sums", "clock"}
    assert outcome.tables["sums"]["sums"] == [{"name": "first", "rows": 18}, {"name": "second", "rows": 7}]
