"""Threads: rows of an array divided among the cores where that is worth it, products of matrices never."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import TypeVar

import numpy as np

from mapping import FloatArray, IntArray

# Values that a share must produce to be worth a thread: some ten times what handing it over costs.
WORTHWHILE = 15_000
# Values that a share may produce: 8 MB, of which some five are held at once. At once, 4000 draws of a posterior over
# 15,000 bins took 2.2 GB; in shares of 32 MB the paper's wire takes 45 MB more, in shares of 2 MB 3 % more time.
MOST_VALUES = 2**20

Rows = TypeVar("Rows", FloatArray, IntArray)
# What a query of the nearest of some points is worth, in values: it takes about 1 us
NEAREST_COST = 30


def by_shares(work: Callable[[FloatArray], Rows], rows: FloatArray, each: int) -> Rows:
    """What `work` makes of the rows, the same bit for bit as at once: no row's result depends on another row.

    The memory that it takes does not grow with the rows. Work that a signal breaks off is waited for before the program
    ends; scipy's own threads of cKDTree are not, and read on in a tree that is gone, which ended a run by SIGTERM with
    a segmentation fault.

    Args:
        work: takes (M, P) and returns M rows; its compiled parts must release the interpreter.
        rows: (W, P).
        each: values behind one row's result.
    """
    shares = min(max(min(cores(), len(rows) * each // WORTHWHILE), -(-len(rows) * each // MOST_VALUES)), len(rows))
    if shares < 2:
        return work(rows)
    return np.concatenate(list(_threads().map(work, np.array_split(rows, shares))))


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def algebra_in_one_thread() -> Iterator[None]:
    """Within it, or within what it decorates, every product of matrices takes one thread; afterwards as many as before.

    Ours are small: threads only wait for each other, for minutes on a busy machine, and their number can decide the
    last digit. It holds for the whole process meanwhile.
    """
    import scipy.linalg  # noqa: F401  # it has an algebra of its own, which must be there to be told
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


@cache
def _threads() -> ThreadPoolExecutor:
    """One pool for all: a sampler asks for shares thousands of times."""
    return ThreadPoolExecutor(cores(), thread_name_prefix="rows")


if hasattr(os, "register_at_fork"):  # threads do not live on in a copy of the process: it gets a pool of its own
    os.register_at_fork(after_in_child=_threads.cache_clear)
