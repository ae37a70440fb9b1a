"""A batch: rows equal to single runs, a row with its reason for all that goes wrong, and going on after any end."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from in_process import explore3d_main
from mischief import MARK, installed
from small_profiles import TIP, write_profile

from explore3d import UserError
from explore3d.jobs import Told
from explore3d.jobs.analyze import analyze
from explore3d.jobs.batch import Limits, batch, tasks_of
from explore3d.jobs.batch.batch import Batch
from explore3d.jobs.batch.cluster import _answer
from explore3d.jobs.batch.one_log import Job
from explore3d.jobs.batch.worker import Worker

ROOT = Path(__file__).parents[4]
SAID = Told(TIP, quick=True)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Workers find this program and the reader of mischief."""
    path = os.pathsep.join([str(ROOT), str(installed(tmp_path / "package"))])
    monkeypatch.setenv("PYTHONPATH", path)
    return tmp_path


def rows(store: Path, table: str) -> list[dict[str, Any]]:
    return [row for file in sorted((store / table).glob("*.parquet")) for row in pq.read_table(file).to_pylist()]


@pytest.mark.slow
def test_each_log_has_its_row_equal_to_a_single_run_and_is_not_done_again(here: Path) -> None:
    scans = here / "scans"
    scans.mkdir()
    first = write_profile(scans / "a.csv", 1)
    shutil.copy(first, scans / "b.csv")
    (scans / "c.csv").write_text("x [mm],z [mm]\n")
    (scans / "d.csv").write_bytes(MARK + b"kill")
    (scans / "e.csv").write_bytes(MARK + b"stumble")
    (scans / "f.csv").symlink_to(scans / "absent")
    tasks = tasks_of([str(scans / "?.csv")], SAID)
    told: list[int] = []
    result = batch(tasks, here / "store", workers=1, tell=lambda standing: told.append(standing.done))
    status = {Path(row["log"]).name: (row["status"], row["reason"]) for row in rows(here / "store", "runs")}
    assert {name: each[0] for name, each in status.items()} == {
        "a.csv": "done",
        "b.csv": "duplicate",
        "c.csv": "refused",
        "d.csv": "killed",
        "e.csv": "crashed",
        "f.csv": "unreadable",
    }
    assert status["b.csv"][1] == f"the same bytes and settings as {first}"
    assert "SIGKILL" in status["d.csv"][1]
    assert status["e.csv"][1].startswith("ZeroDivisionError: a fault of the reader: stumble (mischief.py, line")
    assert told == [0, 1, 2, 3, 4] and len(result.failures) == 5
    analyze(first, here / "single", tip_radius=TIP, quick=True)
    single = pq.read_table(here / "single" / "features.parquet").to_pylist()
    assert single == rows(here / "store", "features") and len(single) == 2
    again = batch(tasks, here / "store")  # begins no worker
    assert again.known == 5 and dict(again.statuses) == {"unreadable": 1}
    assert len(rows(here / "store", "runs")) == 6


@pytest.mark.slow
def test_limits_of_time_and_memory_cost_one_row_each_and_retry_does_them_again(here: Path) -> None:
    slow, large = here / "slow.csv", here / "large.csv"
    slow.write_bytes(MARK + b"sleep")
    large.write_bytes(MARK + b"eat")
    tasks = tasks_of([str(slow), str(large)], SAID)
    result = batch(tasks, here / "store", workers=1, limits=Limits(1.0, 1 << 30))
    assert {(Path(log).name, status) for log, status, _ in result.failures} == {
        ("slow.csv", "out of time"),
        ("large.csv", "out of memory"),
    }
    assert "not done after 1 s" in result.failures[0][2]
    assert batch(tasks, here / "store").known == 2
    assert batch(tasks, here / "store", workers=1, limits=Limits(0.9, 1 << 30), retry=True).known == 0
    assert len(rows(here / "store", "runs")) == 2


def test_a_store_that_is_none_or_in_use_is_refused(here: Path) -> None:
    tasks = tasks_of([str(write_profile(here / "a.csv"))], SAID)
    (here / "other").mkdir()
    (here / "other" / "thesis.tex").write_text("")
    with pytest.raises(UserError, match=r"holds files that are no store \(thesis.tex\)"):
        batch(tasks, here / "other")
    with pytest.raises(UserError, match="cannot be a store"):
        batch(tasks, here / "a.csv")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["a.csv"], "--out is missing"),
        (["absent*.csv", "--out", "store"], "absent*.csv: names no file"),
        (["a.csv", "--out", "store", "--time-limit", "soon"], "--time-limit: "),
        (["a.csv", "--out", "store", "--memory-limit", "2"], "--memory-limit: expected a number and one of kB, MB"),
        (["a.csv", "--out", "store", "--tip-radius", "2 kg"], "tip_radius: "),
        (["a.csv", "--out", "store", "--model", "absent.stl"], "--model absent.stl: no such mesh file"),
    ],
)
def test_a_wrong_call_is_one_line_and_begins_nothing(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    monkeypatch.chdir(here)
    (here / "a.csv").write_text("")
    assert explore3d_main(monkeypatch, "batch", *words) == 2
    assert complaint in capsys.readouterr().err.splitlines()[-1]
    assert not (here / "store").exists()


def test_a_batch_that_is_interrupted_says_what_is_kept(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*given: Any) -> Any:
        yield {"run": jobs[0].row("done"), "features": []}
        raise KeyboardInterrupt

    paths = [write_profile(here / f"{name}.csv", seed) for seed, name in enumerate("ab")]
    tasks = tasks_of([str(path) for path in paths], SAID)
    jobs = [Job.of(task) for task in tasks]
    monkeypatch.setattr(sys.modules["explore3d.jobs.batch.batch"], "_answers", interrupted)
    with pytest.raises(KeyboardInterrupt) as caught:
        batch(tasks, here / "store")
    assert caught.value.__notes__ == [
        "stopped after 1 of 2 logs: interrupted (Ctrl-C)",
        f"kept: {here / 'store'}; the same command goes on with it",
    ]
    assert [row["log"] for row in rows(here / "store", "runs")] == [str(paths[0])]


def test_a_scheduler_that_does_not_answer_or_cannot_be_asked_is_one_line(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.modules["explore3d.jobs.batch.cluster"], "PATIENCE", 0.5)
    path = write_profile(here / "a.csv")
    words = ["batch", path, "--out", here / "store", "--tip-radius", "2 um", "--scheduler", "tcp://127.0.0.1:9"]
    assert explore3d_main(monkeypatch, *words) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "does not answer" in line or 'pip install "explore3d[cluster]"' in line


@pytest.mark.slow
def test_a_worker_that_is_lost_is_begun_again(here: Path) -> None:
    (task,) = tasks_of([str(write_profile(here / "a.csv"))], SAID)
    with Worker() as worker:
        assert worker.carry_out(Job.of(task), Limits())["run"]["status"] == "done"
        assert worker._process is not None
        os.kill(worker._process.pid, signal.SIGKILL)
        assert worker.carry_out(Job.of(task), Limits())["run"]["status"] == "done"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_neither_a_worker_nor_its_copies_grow_with_the_logs(here: Path) -> None:
    paths = [write_profile(here / f"{number:03d}.csv", 300 + number) for number in range(60)]
    with Worker() as worker:
        copies, kept = [], []
        for task in tasks_of([str(path) for path in paths], SAID):
            copies.append(worker.carry_out(Job.of(task), Limits())["run"]["memory"])
            assert worker._process is not None
            kept.append(resident(worker._process.pid))
        again = worker.carry_out(Job.of(task), Limits())["run"]["memory"]
    assert max(kept[40:]) < 1.01 * max(kept[:20])
    assert abs(again / copies[-1] - 1.0) < 0.02 and sum(copies[40:]) < 1.02 * sum(copies[:20])


def resident(pid: int) -> int:
    """Bytes that a process has in memory."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


# A campaign of 200 logs, 20 of them bad in ten ways

GOOD = 180
BAD = {
    "truncated": "refused",
    "wrong radius": "refused",
    "empty": "refused",
    "not a log": "refused",
    "killed": "killed",
    "memory": "out of memory",
    "time": "out of time",
    "unreadable": "unreadable",
    "nan": "refused",
    "duplicate": "duplicate",
}


def campaign(folder: Path) -> tuple[Path, Path]:
    """A manifest of 180 good logs and of two bad ones of each way; and the folder of a package to install."""
    scans, lines = folder / "scans", ["file,object,tip_radius"]
    scans.mkdir()
    for number in range(GOOD):
        write_profile(scans / f"good-{number:03d}.csv", 1000 + number, samples=300)
        lines.append(f"scans/good-{number:03d}.csv,good,2 um")
    for way in BAD:
        for number in (1, 2):
            path = scans / f"{way.replace(' ', '-')}-{number}.csv"
            _spoil(path, way, number)
            lines.append(f"scans/{path.name},{way},{'2 kg' if way == 'wrong radius' else '2 um'}")
    random.Random(22).shuffle(rest := lines[1:])
    (folder / "list.csv").write_text("\n".join([lines[0], *rest]) + "\n")
    return folder / "list.csv", installed(folder / "package")


def _spoil(path: Path, way: str, number: int) -> None:
    if way == "unreadable":
        path.symlink_to(path.with_name("absent"))
    elif way == "duplicate":
        shutil.copy(path.with_name(f"good-{number:03d}.csv"), path)
    elif way in ("killed", "memory", "time"):
        word = {"killed": b"kill", "memory": b"eat", "time": b"sleep"}[way]
        path.write_bytes(MARK + word + b" %d" % number)
    elif way == "empty":
        path.write_text("" if number == 1 else "\n")
    elif way == "not a log":
        path.write_text(f"Dear reader {number},\nthis is a letter.\n")
    else:
        write_profile(path, 5000 + number)
        text = path.read_text()
        if way == "truncated":
            path.write_text(text[: 60 * number])
        if way == "nan":
            head, *rest = text.splitlines()
            path.write_text("\n".join([head, *(f"{line.split(',')[0]},nan" for line in rest), str(number)]))


def command(manifest: Path, store: Path, package: Path, *more: str) -> tuple[list[str], dict[str, str]]:
    words = [sys.executable, "-m", "explore3d", "batch", "--manifest", str(manifest), "--out", str(store), "--quick"]
    words += ["--time-limit", "20 s", "--memory-limit", "1.5 GB", *more]
    return words, os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(package)])}


def started(words: list[str], env: dict[str, str], cwd: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(words, env=env, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.mark.slow
def test_two_hundred_logs_twenty_of_them_bad_in_ten_ways_killed_on_the_way(tmp_path: Path) -> None:
    manifest, package = campaign(tmp_path)
    words, env = command(manifest, tmp_path / "store", package)
    random_moments, before = random.Random(1), 0
    for _ in range(3):
        process = started(words, env, tmp_path)
        time.sleep(6.0 + 6.0 * random_moments.random())
        process.kill()
        process.wait()
        time.sleep(1.0)
        stands = rows(tmp_path / "store", "runs")
        assert len(stands) >= before  # nothing that was there is lost
        before = len(stands)
    assert started(words, env, tmp_path).wait() == 0
    runs = rows(tmp_path / "store", "runs")
    found = Counter((row["object"], row["status"]) for row in runs)
    good = found.pop(("good", "done"))
    twins = sum(number for (_, status), number in found.items() if status == "duplicate")
    assert good + found.get(("duplicate", "done"), 0) == GOOD and twins == 2 and len(runs) == 200
    for way, status in BAD.items():
        if way != "duplicate":
            assert found[(way, status)] == 2, (way, found)
    assert all(row["reason"] for row in runs if row["status"] != "done")
    features: dict[str, list[dict[str, Any]]] = {row["run"]: [] for row in runs}
    for row in rows(tmp_path / "store", "features"):
        features[row["run"]].append(row)
    for run in [row for row in runs if row["status"] == "done"]:
        analyze(run["log"], tmp_path / "single", tip_radius="2 um", quick=True, overwrite=True)
        assert pq.read_table(tmp_path / "single" / "features.parquet").to_pylist() == features[run["run"]]
    began = time.perf_counter()
    assert started(words, env, tmp_path).wait() == 0
    assert time.perf_counter() - began < 5.0
    assert len(rows(tmp_path / "store", "runs")) == 200


@pytest.mark.slow
def test_a_cluster_started_by_hand_does_the_same_and_a_lost_worker_loses_nothing(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    package = installed(tmp_path / "package")
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(package)])}
    paths = [write_profile(tmp_path / f"p{k:02d}.csv", k) for k in range(30)]
    scheduler = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "38786", "--no-dashboard"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "tcp://127.0.0.1:38786", "--nthreads", "1"]
    running = [started(scheduler, env, tmp_path)]
    try:
        time.sleep(3.0)
        running += [started([*worker, "--no-nanny"], env, tmp_path) for _ in range(2)]
        words = [
            sys.executable,
            "-m",
            "explore3d",
            "batch",
            str(tmp_path / "p*.csv"),
            "--tip-radius",
            "2 um",
            "--quick",
        ]
        words += ["--out", str(tmp_path / "store"), "--scheduler", "tcp://127.0.0.1:38786"]
        process = started(words, env, tmp_path)
        while not list((tmp_path / "store" / "runs").glob("*")) and process.poll() is None:
            time.sleep(0.2)
        running[1].kill()
        assert process.wait() == 0
    finally:
        for each in running:
            each.kill()
            each.wait()
    runs = rows(tmp_path / "store", "runs")
    assert len(runs) == len(paths) and {row["status"] for row in runs} == {"done"}


def test_a_result_that_a_lost_worker_held_is_waited_for(tmp_path: Path) -> None:
    """Its future is told as finished, and is pending again when the result is asked for."""

    class Future:
        status = "pending"

        def __init__(self, error: Exception | None = None) -> None:
            self.error = error

        def result(self) -> dict[str, Any]:
            if self.error is not None:
                raise self.error
            return {"run": {"status": "done"}, "features": []}

        def exception(self) -> Exception | None:
            return self.error

    (task,) = tasks_of([str(write_profile(tmp_path / "a.csv"))], SAID)
    assert _answer(Future(), Job.of(task))["run"]["status"] == "done"
    lost = _answer(Future(RuntimeError("four workers died")), Job.of(task))["run"]
    assert lost["status"] == "killed" and lost["reason"] == "lost on the cluster: RuntimeError: four workers died"


def test_a_result_counts_what_failed() -> None:
    result = Batch(2)
    result.note({"status": "refused", "log": "a", "reason": "why", "tolerances": None})
    result.note({"status": "done", "log": "b", "reason": None, "tolerances": "fail"})
    assert result.record() == {
        "logs": 2,
        "known": 0,
        "statuses": {"refused": 1, "done": 1},
        "verdicts": {"fail": 1},
        "failures": [{"log": "a", "status": "refused", "reason": "why"}],
    }
