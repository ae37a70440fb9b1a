"""Worker: one process that carries out jobs, one after the other, and is begun again if it is lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from queue import SimpleQueue
from types import TracebackType
from typing import Any

from explore3d.jobs.batch.one_log import Job

Answer = dict[str, Any]

# A job whose worker was lost is given to another so often: the second loss is the job's own doing
_TRIES = 2


@dataclass(frozen=True)
class Limits:
    """What one log may cost.

    Args:
        seconds: of the clock, None: as long as it takes.
        memory: bytes, None: as much as there is.
    """

    seconds: float | None = None
    memory: int | None = None


class Worker:
    """A process that is begun when the first job comes, and ends with the `with` block."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def carry_out(self, job: Job, limits: Limits) -> Answer:
        """The rows of a job, whatever became of it within its limits."""
        for _ in range(_TRIES):
            answer = self._asked(json.dumps({"job": job.record(), **asdict(limits)}))
            if answer is not None:
                return answer
            if self._closed:
                break
            self._stop()
        return {"run": job.row("killed", f"its worker was lost {_TRIES} times"), "features": []}

    def close(self) -> None:
        """End the process, from any thread; the log that it works on is given up, and no other is begun."""
        self._closed = True
        self._stop()

    def _stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):  # it leads a group: the copy that it has made ends, too
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()

    def _asked(self, line: str) -> Answer | None:
        """The answer to a line, None if the process is lost."""
        if self._process is None:
            self._process = _begun()
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(line + "\n")
            process.stdin.flush()
            text = process.stdout.readline()
            return dict(json.loads(text)) if text.endswith("\n") else None
        except (OSError, ValueError):  # the pipe is broken, or the line cut
            return None


def _begun() -> subprocess.Popen[str]:
    """The process; in a session of its own, so that Ctrl-C reaches the batch alone."""
    one_thread = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return subprocess.Popen(
        [sys.executable, "-m", "explore3d.jobs.batch.serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env=os.environ | one_thread,
    )


def answers_here(jobs: Sequence[Job], limits: Limits, workers: int) -> Generator[Answer, None, None]:
    """The answers to jobs as they come, by so many workers on this machine."""
    waiting: SimpleQueue[Job | None] = SimpleQueue()
    come: SimpleQueue[Answer | BaseException] = SimpleQueue()
    for job in [*jobs, *[None] * workers]:
        waiting.put(job)
    crew = [Worker() for _ in range(min(workers, len(jobs)))]

    def work(worker: Worker) -> None:
        try:
            while (job := waiting.get()) is not None:
                come.put(worker.carry_out(job, limits))
        except BaseException as error:  # told to whoever waits: it would wait forever
            come.put(error)

    threads = [threading.Thread(target=work, args=(worker,), daemon=True) for worker in crew]
    try:
        for thread in threads:
            thread.start()
        for _ in jobs:
            answer = come.get()
            if isinstance(answer, BaseException):
                raise answer
            yield answer
    finally:
        with suppress(Exception):
            while not waiting.empty():
                waiting.get_nowait()
        for _ in crew:
            waiting.put(None)
        for worker in crew:
            worker.close()
