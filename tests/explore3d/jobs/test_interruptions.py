"""Ended at any moment and by anything, a job leaves the older session bit for bit, its own log, and one line."""

from __future__ import annotations

import importlib
import json
import os
import random
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from calibration_sphere import sphere_scene
from in_process import explore3d_main
from interrupting import Ended, bare_tile, digests, explore3d

import hw
from explore3d.errors import UserError
from explore3d.jobs.merge import load
from explore3d.jobs.run import run
from explore3d.jobs.session import MARKER, Session
from explore3d.log.own.reader import read_log
from explore3d.scene.scene import load_scene
from hw.errors import LinkError
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.trace import Trace

# The exit statuses that are right; CPython ends itself by SIGINT, which a shell calls 130, where Ctrl-C met an exec()
SIGNALS = {"SIGINT": (130, -2), "SIGTERM": (143,), "SIGKILL": (-9,)}
# The campaign's moments: a dozen of those that were looked at while building, and the fifty that are reported
BUILDING, REPORTED = (21, 12), (2026, 50)
FULL = "full disk"
# s after its first file: about how long each job takes on a machine with nothing else to do
LASTS = {"run": 3.0, "analyze": 2.0, "merge": 1.0, "calibrate": 0.4}


@dataclass(frozen=True)
class Older:
    """Complete older sessions, each made when it is first asked for, and what is needed to make them again."""

    folder: Path
    scene: Path

    def of(self, job: str) -> Path:
        """The folder of a complete session of a job."""
        made = self.folder / job
        if not made.exists():
            if job == "run":
                run(self.scene, made)
            elif job == "second":
                run(bare_tile(self.folder, seed=5), made)
            else:
                words = self.words(job, made)
                made.mkdir()
                assert explore3d(*words).status == 0
        return made

    def words(self, job: str, out: Path) -> list[object]:
        if job == "run":
            return ["run", self.scene, "--out", out]
        if job == "analyze":
            return ["analyze", self.of("run") / "log.mcap", "--out", out]
        if job == "merge":
            return ["merge", self.of("analyze"), self.of("second") / "log.mcap", "--out", out]
        sphere = sphere_scene(self.folder, 'rate = "1 kHz"', fineness=4)
        return ["calibrate", sphere, "--radius", "12.5 mm", "--lines", 60, "--out", out / "tip.toml"]

    def first_sign(self, job: str, out: Path) -> Path:
        return out / ("tip-2.mcap" if job == "calibrate" else "unfinished-1")


@pytest.fixture(scope="module")
def older(tmp_path_factory: pytest.TempPathFactory) -> Older:
    folder = tmp_path_factory.mktemp("older")
    return Older(folder, bare_tile(folder))


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A file system of 16 MB in a folder; skips the test where none can be made."""
    place = folder / "disk"
    place.mkdir(exist_ok=True)
    if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", place]).returncode != 0:
        pytest.skip("a small disk can only be made by root, with mount")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", place], check=True)


def check(ended: Ended, job: str, how: str, out: Path, before: dict[str, str]) -> str:
    """What came of an interruption, in a word; fails unless nothing older was lost and the line is right."""
    said = f"{job} {how}: status {ended.status}: {ended.err}"
    assert "Traceback" not in ended.err, said
    # the signal may meet a program that is only tidying up: what it names is all there then; merge writes no report
    if ended.status == 0 or re.search(r"^(model|report): ", ended.out, re.MULTILINE):
        assert_whole(job, out, before)
        return "finished"
    # or it was whole, and took its place, before it could say so; by a kill, before all of it was at its place
    if how in SIGNALS and not untouched(out, before):
        assert ended.status in SIGNALS[how] and "as it was" not in ended.err, said
        if (out / ".part-commit").is_dir():
            come_next(out)
        assert MARKER not in before or digests(out)[MARKER] != before[MARKER], said
        assert_whole(job, out, before)
        return "finished"
    assert untouched(out, before), said
    logs = [*out.glob("unfinished-*/log.mcap"), *(path for path in out.glob("tip-*.mcap") if path.name not in before)]
    samples = 0
    for log in logs:
        try:
            samples += len(read_log(log).trace)
        except UserError as error:
            assert "samples: the log holds none" in str(error) and how in ("SIGKILL", FULL), said
    if how == "SIGKILL":
        assert ended.status in SIGNALS[how], said
        return "killed"
    assert ended.status in ((2, 3) if how == FULL else SIGNALS[how]), said
    if samples:
        assert re.match(r"explore3d: stopped after .*; kept: .*; go on with: explore3d .* --resume$", ended.last), said
        return "kept"
    assert ended.last.startswith("explore3d: ") and ("as it was" in ended.last or how == FULL), said
    return "as it was"


def untouched(out: Path, before: dict[str, str]) -> bool:
    """True if every file of the older session is there, bit for bit."""
    after = digests(out)
    return all(after.get(name) == digest for name, digest in before.items())


def come_next(out: Path) -> None:
    """Enter the session as the next job would, which finishes what takes its place there, and leave it at once."""
    with suppress(KeyboardInterrupt), Session(out, overwrite=True):
        raise KeyboardInterrupt


def assert_whole(job: str, out: Path, before: dict[str, str]) -> None:
    """A job that says it is done has left everything: each file opens, and nothing unfinished lies about."""
    if job == "calibrate":
        assert tomllib.loads((out / "tip.toml").read_text())["radius"]
        assert all(len(read_log(path).trace) for path in out.glob("tip-*.mcap"))
        assert digests(out)["tip-1.mcap"] == before["tip-1.mcap"]
        return
    record = state(out)
    assert record["state"] == "complete" and set(record["files"]) <= {each.name for each in out.iterdir()}
    assert load(out).provenance["complete"]
    assert job == "merge" or (out / "report.html").read_text().rstrip().endswith("</html>")
    assert all(len(read_log(path).trace) for path in out.glob("*.mcap"))
    assert not list(out.glob("unfinished-*")) and not list(out.glob(".part-*"))


def interrupt(older: Older, job: str, how: str, share: float, folder: Path) -> str:
    """End a job by a signal after a share of its time, over a copy of the older session."""
    out = folder / "out"
    shutil.copytree(older.of(job), out)
    before = digests(out)
    words = older.words(job, out)
    ended = explore3d(*words, after=share * LASTS[job], how=how, when=older.first_sign(job, out))
    return check(ended, job, how, out, before)


def fill(older: Older, job: str, free: int, folder: Path) -> str:
    """Carry a job out over a copy of the older session, on a disk with so many bytes left."""
    with small_disk(folder) as disk:
        out = disk / "out"
        shutil.copytree(older.of(job), out)
        before = digests(out)
        state = os.statvfs(disk)
        (disk / "filler").write_bytes(bytes(max(0, state.f_bavail * state.f_frsize - free)))
        return check(explore3d(*older.words(job, out)), job, FULL, out, before)


@pytest.mark.parametrize(
    ("job", "how"),
    [
        ("run", "SIGINT"),
        pytest.param("merge", "SIGTERM", marks=pytest.mark.slow),
        pytest.param("run", "SIGKILL", marks=pytest.mark.slow),
    ],
)
def test_a_job_that_a_signal_ends_leaves_the_older_session(older: Older, tmp_path: Path, job: str, how: str) -> None:
    for attempt in range(4):
        (tmp_path / str(attempt)).mkdir()
        came = interrupt(older, job, how, 0.3 / 2**attempt, tmp_path / str(attempt))
        if came != "finished":
            break
    assert came in ("kept", "killed", "as it was")


@pytest.mark.parametrize("free", [60_000, pytest.param(250_000, marks=pytest.mark.slow)])
def test_a_full_disk_leaves_the_older_session_and_the_log(older: Older, tmp_path: Path, free: int) -> None:
    assert fill(older, "run", free, tmp_path) == "kept"


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [BUILDING, REPORTED])
def test_fifty_interruptions_at_random_moments_cost_nothing(
    older: Older, tmp_path: Path, seed: int, count: int
) -> None:
    chance = random.Random(seed)
    jobs = (["run"] * 24 + ["analyze"] * 9 + ["merge"] * 8 + ["calibrate"] * 9)[:: 50 // count]
    jobs = jobs[:count]
    hows = (*SIGNALS, FULL)
    came: list[str] = []
    for number, job in enumerate(jobs):
        how, what = hows[number % 4], "finished"
        share = chance.random()
        # results as large as the older ones must not fit beside them, nor a model without its report
        size = sum(path.stat().st_size for path in older.of(job).rglob("*") if path.is_file())
        most = {"merge": 1e4, "calibrate": 1e4}.get(job, 0.9 * size if number % 8 > 3 else 0.1 * size)
        free = int(chance.random() * most)
        for attempt in range(4):
            if what != "finished":
                break
            folder = tmp_path / f"{number}-{attempt}"
            folder.mkdir()
            what = (
                fill(older, job, free >> attempt, folder)
                if how == FULL
                else interrupt(older, job, how, share / 2**attempt, folder)
            )
        came.append(f"{job} {how}: {what}")
        print(came[-1], flush=True)
        assert what != "finished", came[-1]
    assert len(came) == count


# --- going on ---------------------------------------------------------------------------------------------


def state(folder: Path) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((folder / "session.json").read_text())
    return record


def test_a_time_budget_that_ends_the_survey_is_said_first_and_gone_on_with(older: Older, tmp_path: Path) -> None:
    out = tmp_path / "out"
    short = explore3d("run", bare_tile(tmp_path, "10 s"), "--out", out)
    assert short.status == 3
    first = short.out.splitlines()[0]
    assert re.match(
        r"stopped after 4 of 13 sweeps: the time budget of 10 s was used up; go on with: .* --resume", first
    )
    assert short.out.splitlines()[1].startswith("NOT INSPECTED: ")
    assert " % of the surface that was swept" in short.out.splitlines()[2]
    page, model = (out / "report.html").read_text(), json.loads((out / "model.json").read_text())
    assert page.index("Stopped after 4 of 13 sweeps") < page.index("Nothing was found")
    assert next(iter(model)) == "stopped" and model["provenance"]["complete"] is False
    assert state(out)["state"] == "stopped"
    analysis = run(bare_tile(tmp_path), out, resume=True)
    assert analysis.stopped is None and state(out)["state"] == "complete"
    assert {path.name for path in out.glob("*.mcap")} == {"log.mcap"}
    log, whole = read_log(out / "log.mcap"), read_log(older.of("run") / "log.mcap")
    assert (log.trace.centers == whole.trace.centers).all() and (log.trace.t == whole.trace.t).all()


def test_a_pulled_cable_is_said_first_with_status_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def cut(scene: object, arm: bool = False) -> SimulatedFinger:
        finger = whole(scene, arm)
        touch, made = finger.execute, [0]

        def execute(move: Move) -> Trace:
            made[0] += move.purpose == "sweep"
            if made[0] > 3:
                raise LinkError("the cable was pulled")
            return touch(move)

        finger.execute = execute
        return finger

    job = importlib.import_module("explore3d.jobs.run")
    whole = job.scene_finger
    monkeypatch.setattr(job, "scene_finger", cut)
    assert explore3d_main(monkeypatch, "run", bare_tile(tmp_path), "--out", tmp_path / "out") == 3
    first, warning, second, *_ = capsys.readouterr().out.splitlines()
    assert re.match(
        r"stopped after 3 of 13 sweeps: .*the cable was pulled; go on with: explore3d run .* --resume$", first
    )
    assert warning.startswith("NOT INSPECTED: ")
    assert second.startswith("no features found on the ") and second.endswith(" % of the surface that was swept")


def test_what_is_said_of_a_finger_that_was_handed_in_goes_on(tmp_path: Path) -> None:
    scene = load_scene(bare_tile(tmp_path))
    finger = scene.open_finger()
    touch, made = finger.execute, [0]

    def execute(move: Move) -> Trace:
        made[0] += move.purpose == "sweep"
        if made[0] == 4:
            raise RuntimeError("the robot's program ended")
        return touch(move)

    finger.execute = execute  # type: ignore[method-assign]
    with pytest.raises(RuntimeError) as ended:
        run(scene, tmp_path / "out", finger=finger, report=False)
    call = ended.value.__notes__[-1].partition("go on with: ")[2]
    assert call.startswith("explore3d.run(") and call.endswith(", finger=..., report=False, resume=True)")
    names = {"explore3d": importlib.import_module("explore3d"), "again": scene.open_finger()}
    analysis = eval(call.replace("finger=...", "finger=again"), names)
    assert analysis.stopped is None and state(tmp_path / "out")["state"] == "complete"


def test_another_scene_needs_overwrite_and_is_refused_before_anything_moves(
    older: Older, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(older.of("run"), out)
    before = digests(out)
    other = tmp_path / "other.toml"
    other.write_text(older.scene.read_text().replace("seed = 4", "seed = 6"))
    shutil.copytree(older.scene.parent / "meshes", tmp_path / "meshes")
    (tmp_path / "second").mkdir()
    shutil.copy(older.of("run") / "log.mcap", tmp_path / "second")
    for words in (["run", other], ["run", other, "--resume"], ["analyze", tmp_path / "second"]):
        assert explore3d_main(monkeypatch, *words, "--out", out) == 2
        err = capsys.readouterr().err
        assert "--overwrite" in err.splitlines()[-1] and "exploration" not in err
        assert digests(out) == before and not list(out.glob("unfinished-*"))
    run(other, out, overwrite=True)
    assert "seed = 6" in (out / "scene.toml").read_text() and state(out)["state"] == "complete"


def test_no_thread_reads_on_in_what_a_signal_took_away() -> None:
    """scipy's trees leave their own threads behind when a signal breaks a query off: a run ended with status -11."""
    top = Path(hw.__file__).parents[1]
    files = [path for name in ("explore3d", "planners", "mapping", "hw") for path in (top / name).rglob("*.py")]
    assert len(files) > 300
    assert [path for path in files if re.search(r"query\w*\([^)]*workers=", path.read_text())] == []
