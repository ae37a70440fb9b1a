"""batch: every log that is not in the store yet is analysed on its own; what comes of it is a row, whatever it is."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from explore3d import FolderError, UserError, count_text
from explore3d.analysis import run_key
from explore3d.jobs import cause, locked
from explore3d.jobs.batch.cluster import answers_of_cluster
from explore3d.jobs.batch.one_log import Job
from explore3d.jobs.batch.places import is_remote, place_of
from explore3d.jobs.batch.store import Store
from explore3d.jobs.batch.tasks import Task
from explore3d.jobs.batch.worker import Answer, Limits, answers_here
from mapping.geometry.mesh import cores

LOCK = ".lock"


@dataclass(frozen=True)
class Standing:
    """How far a batch is.

    Args:
        done: logs that have a row by now, of those to be analysed.
        of: logs to be analysed.
        failed: of those done, without a result.
        left: estimate of the seconds that the rest takes; None before the second is done.
    """

    done: int
    of: int
    failed: int
    left: float | None


@dataclass
class Batch:
    """What became of a batch.

    Args:
        logs: that were named.
        known: of them, in the store already.
        statuses: how many of the others ended how.
        failures: (log, status, reason) of those without a result.
        verdicts: of how many logs, those in the store already included, the tolerances are kept, broken, undecided.
    """

    logs: int
    known: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    failures: list[tuple[str, str, str]] = field(default_factory=list)
    verdicts: Counter[str] = field(default_factory=Counter)

    def record(self) -> dict[str, Any]:
        """The same in JSON's types."""
        failures = [dict(zip(("log", "status", "reason"), each, strict=True)) for each in self.failures]
        counts = {"statuses": dict(self.statuses), "verdicts": dict(self.verdicts)}
        return {"logs": self.logs, "known": self.known, **counts, "failures": failures}

    def note(self, row: dict[str, Any]) -> None:
        """Count a run's row."""
        self.statuses[row["status"]] += 1
        self.judge(row["tolerances"])
        if row["status"] != "done":
            self.failures.append((row["log"], row["status"], row["reason"] or ""))

    def judge(self, verdict: str | None) -> None:
        """Count a verdict, if there is one."""
        if verdict:
            self.verdicts[verdict] += 1


def batch(
    tasks: Sequence[Task],
    out: Path | str,
    *,
    limits: Limits | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    models: bool = False,
    retry: bool = False,
    tell: Callable[[Standing], None] = lambda standing: None,
) -> Batch:
    """Analyse logs, each on its own, into a store that is appended to; what stands there already is skipped.

    Args:
        tasks: the logs, and what each is told (tasks_of).
        out: path or address of the store (docs/batch.md).
        limits: what one log may cost.
        workers: processes on this machine; None: one a core.
        scheduler: address of a Dask scheduler whose workers see the same files.
        models: keep each run's folder with model and report in `models/KEY` of the store.
        retry: do those again that stand there without a result.
        tell: is told how far it is.

    Raises:
        UserError: a store that cannot be written or that another batch writes to, a scheduler that does not answer.
    """
    if not hasattr(os, "fork"):
        raise UserError("batch needs a system that can fork processes (Linux, macOS)")
    if models and is_remote(str(out)):
        raise UserError(f"{out}: models and reports are kept in stores of this machine alone")
    with _owned(str(out)):
        store, result = Store(place_of(str(out))), Batch(len(tasks))
        keep = str((Path(out) / "models").resolve()) if models else None
        jobs = list(_to_do(tasks, store, result, keep, retry))
        first_done, failed = 0.0, sum(result.statuses.values())
        tell(Standing(0, len(jobs), failed, None))
        try:
            if jobs:
                with closing(_answers(jobs, limits or Limits(), workers or cores(), scheduler)) as answers:
                    for done, answer in enumerate(answers, 1):
                        first_done = time.perf_counter() if done == 1 else first_done
                        store.add(answer["run"], answer["features"])
                        result.note(answer["run"])
                        # before the first one workers began: that is not repeated
                        spent = (time.perf_counter() - first_done) / max(done - 1, 1)
                        left = None if done == 1 else spent * (len(jobs) - done)
                        tell(Standing(done, len(jobs), len(result.failures), left))
        except UserError:  # refused: no worker has begun
            raise
        except BaseException as error:
            kept = result.known + sum(result.statuses.values())
            error.add_note(f"stopped after {kept} of {count_text(len(tasks), 'log')}: {cause(error)}")
            error.add_note(f"kept: {out}; the same command goes on with it")
            raise
        store.pack()
    return result


def _answers(jobs: Sequence[Job], limits: Limits, workers: int, scheduler: str | None) -> Generator[Answer, None, None]:
    # not by a cluster within this machine: of a log of 400 samples its messages and watchers took 39 ms of 47 that the
    # batch itself spends, and a program that calls batch had to be guarded against being imported by its processes
    if scheduler is None:
        return answers_here(jobs, limits, workers)
    return answers_of_cluster(jobs, limits, scheduler)


def _to_do(tasks: Sequence[Task], store: Store, result: Batch, models: str | None, retry: bool) -> Iterator[Job]:
    """The jobs that are not in the store; what is told without an analysis is written there at once."""
    first: dict[str, str] = {}
    for task in tasks:
        try:
            job = Job.of(task, models)
        except (OSError, UserError) as error:
            lost = Job(task, "", {"log": task.log})
            _write(store, result, lost.row("unreadable", getattr(error, "strerror", None) or str(error)))
            continue
        if job.run in first:
            twin = Job(task, job.sha256, job.settings | {"duplicate": task.log})
            if twin.run in store:
                result.known += 1
            else:
                same = f"the same bytes and settings as {first[job.run]}"
                _write(store, result, job.row("duplicate", same, run=run_key(twin.sha256, twin.settings)))
            continue
        first[job.run] = task.log
        if job.run in store and not (retry and store.status(job.run) != "done"):
            result.known += 1
            result.judge(store.verdict(job.run))
        else:
            yield job


def _write(store: Store, result: Batch, row: dict[str, Any]) -> None:
    store.add(row, [])
    result.note(row)


@contextmanager
def _owned(out: str) -> Iterator[None]:
    """The store, to which no other batch of this machine writes meanwhile."""
    if is_remote(out):
        yield
        return
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        others = [path.name for path in folder.iterdir() if path.name not in (LOCK, "runs", "features", "models")]
        if others and not (folder / "runs").is_dir():
            raise FolderError(
                f"{out}: holds files that are no store ({others[0]}); choose a new or empty folder with --out"
            )
        lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise FolderError(f"{out}: cannot be a store: {error.strerror or error}") from error
    try:
        if not locked(lock):
            raise FolderError(f"{out}: another batch is writing there; choose another --out")
        yield
    finally:
        os.close(lock)
