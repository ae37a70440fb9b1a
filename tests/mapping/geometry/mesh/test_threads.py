"""Row shares: the same rows, bit for bit, however the work on them is divided."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from mapping.geometry.mesh import threads as row_shares
from mapping.geometry.mesh.threads import algebra_in_one_thread, by_shares


def squares(rows: np.ndarray) -> np.ndarray:
    return np.asarray((rows**2).sum(axis=1))


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_divided_work_is_the_work_at_once(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_shares, "cores", lambda: 3)
    rows = np.random.default_rng(1).normal(size=(count, 4))
    assert np.array_equal(by_shares(squares, rows, 10**6), squares(rows))


def test_little_work_starts_no_thread_and_much_work_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_shares, "cores", lambda: 2)
    seen: list[str] = []

    def work(rows: np.ndarray) -> np.ndarray:
        seen.append(threading.current_thread().name)
        return squares(rows)

    rows = np.ones((10, 2))
    by_shares(work, rows, 10)
    assert seen == [threading.main_thread().name]
    by_shares(work, rows, 10**5)
    assert len(seen) == 3 and threading.main_thread().name not in seen[1:]


def test_an_error_in_a_share_comes_out() -> None:
    def fails(rows: np.ndarray) -> np.ndarray:
        raise ValueError("bad row")

    with pytest.raises(ValueError, match="bad row"):
        by_shares(fails, np.ones((10, 2)), 10**6)


@pytest.mark.parametrize("number", [1, 2])
def test_no_share_is_larger_than_the_memory_is_asked_for(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_shares, "cores", lambda: number)
    seen: list[int] = []

    def work(rows: np.ndarray) -> np.ndarray:
        seen.append(len(rows))
        return squares(rows)

    rows = np.random.default_rng(2).normal(size=(4000, 3))
    assert np.array_equal(by_shares(work, rows, 15_000), squares(rows))
    assert max(seen) * 15_000 <= row_shares.MOST_VALUES


def test_algebra_takes_one_thread_within_and_as_many_as_before_afterwards() -> None:
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_info, threadpool_limits

    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(limits=2, user_api="blas"):
        assert threads() == {2}
        assert algebra_in_one_thread()(threads)() == {1}
        assert threads() == {2}
