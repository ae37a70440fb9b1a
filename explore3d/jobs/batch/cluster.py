"""Cluster: the same workers, one in each process of a Dask cluster (extra `cluster`)."""

from __future__ import annotations

import logging
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


def is_installed() -> bool:
    """True if Dask distributed is there."""
    return find_spec("distributed") is not None


def answers_of_cluster(
    jobs: Sequence[Job], limits: Limits, workers: int, scheduler: str | None
) -> Generator[Answer, None, None]:
    """The answers to jobs as they come, by the workers of a Dask cluster.

    A worker that is lost costs nothing: what it worked on is given to another.

    Args:
        workers: processes of one thread each on this machine, where no scheduler is given.
        scheduler: address of one whose workers see the same files, "tcp://host:8786".

    Raises:
        UserError: distributed is not installed, or no scheduler answers.
    """
    if not is_installed():
        raise UserError(f'--scheduler {scheduler}: needs Dask distributed: pip install "explore3d[cluster]"')
    import dask
    from distributed import Client, LocalCluster, as_completed

    # Dask's own limit of memory is that of its process; a log's is held where the log is analysed
    with dask.config.set({"distributed.worker.daemon": False}):
        if scheduler is None:
            cluster = LocalCluster(
                n_workers=min(workers, len(jobs)),
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )
        else:
            cluster = None
        try:
            client = Client(scheduler if cluster is None else cluster, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError) as error:
            raise UserError(f"--scheduler {scheduler}: does not answer: {error}") from error
        try:
            by_key = {client.submit(_carry_out, job.record(), limits, pure=False): job for job in jobs}
            for future in as_completed(list(by_key), loop=client.loop):
                yield _answer(future, by_key.pop(future))
                future.release()
        finally:
            client.close()
            if cluster is not None:
                cluster.close()


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
