"""Cluster: the same workers, one in each process of a Dask cluster (extra `cluster`)."""

from __future__ import annotations

import threading
from collections.abc import Generator, Sequence
from importlib.util import find_spec
from typing import Any

from explore3d import UserError
from explore3d.jobs.batch.one_log import Job
from explore3d.jobs.batch.worker import Answer, Limits, Worker

# Seconds in which a scheduler must answer
PATIENCE = 10.0

_own = threading.local()


def answers_of_cluster(jobs: Sequence[Job], limits: Limits, scheduler: str) -> Generator[Answer, None, None]:
    """The answers to jobs as they come, by the workers of a Dask cluster.

    A worker that is lost costs nothing: what it worked on is given to another.

    Args:
        scheduler: address of one whose workers see the same files, "tcp://host:8786".

    Raises:
        UserError: distributed is not installed, or no scheduler answers.
    """
    if find_spec("distributed") is None:
        raise UserError(f'--scheduler {scheduler}: needs Dask distributed: pip install "explore3d[cluster]"')
    from distributed import Client, as_completed

    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise UserError(f"--scheduler {scheduler}: does not answer: {error}") from error
    try:
        by_key = {client.submit(_carry_out, job.record(), limits, pure=False): job for job in jobs}
        for future in as_completed(list(by_key), loop=client.loop):
            yield _answer(future, by_key.pop(future))
            future.release()
    finally:
        client.close()


def _answer(future: Any, job: Job) -> Answer:
    """What came of a job; a result whose worker was lost before it was fetched is computed again, and waited for."""
    try:
        return dict(future.result())
    except Exception as error:  # whatever the cluster lost it to costs this log alone
        return {"run": job.row("killed", f"lost on the cluster: {type(error).__name__}: {error}"), "features": []}


def _carry_out(record: dict[str, Any], limits: Limits) -> Answer:
    """What a thread of a Dask worker does with a job: its own worker carries it out."""
    worker = getattr(_own, "worker", None)
    if worker is None:
        worker = _own.worker = Worker()
    answer: Answer = worker.carry_out(Job.read(record), limits)
    return answer
