"""The store: whole after a kill at any moment, skipped where it knows a run, put together where there are many."""

from __future__ import annotations

import io
from pathlib import Path
from shutil import copytree
from typing import Any

import pyarrow.parquet as pq
import pytest

from explore3d.analysis import FEATURE_COLUMNS
from explore3d.jobs.batch.places import Folder
from explore3d.jobs.batch.store import PACKED_FROM, RUN_COLUMNS, Store


def run(number: int, status: str = "done") -> dict[str, Any]:
    return dict.fromkeys(RUN_COLUMNS) | {"run": f"{number:016x}", "status": status, "seconds": 0.1}


def features(number: int) -> list[dict[str, Any]]:
    return [dict.fromkeys(FEATURE_COLUMNS) | {"run": f"{number:016x}", "id": f"bump-{k}", "kept": True} for k in (1, 2)]


def filled(path: Path, numbers: range) -> Store:
    store = Store(Folder(path))
    for number in numbers:
        store.add(run(number), features(number))
    return store


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of as many runs as are put together; to be copied, not changed."""
    path = tmp_path_factory.mktemp("store")
    filled(path, range(PACKED_FROM))
    return path


def rows(path: Path, table: str) -> list[dict[str, Any]]:
    return [row for file in sorted((path / table).glob("*.parquet")) for row in pq.read_table(file).to_pylist()]


def test_what_stands_there_is_known_to_whoever_opens_it_next(tmp_path: Path) -> None:
    filled(tmp_path, range(3))
    store = Store(Folder(tmp_path))
    assert f"{2:016x}" in store and f"{3:016x}" not in store and store.status(f"{2:016x}") == "done"


def test_many_loose_runs_are_put_together_and_lose_nothing(many: Path, tmp_path: Path) -> None:
    copytree(many, tmp_path, dirs_exist_ok=True)
    store = Store(Folder(tmp_path))
    store.add(run(1000, "refused"), [])
    before = sorted(map(str, rows(tmp_path, "runs"))), sorted(map(str, rows(tmp_path, "features")))
    assert store.pack() == PACKED_FROM and store.pack() == 0
    after = sorted(map(str, rows(tmp_path, "runs"))), sorted(map(str, rows(tmp_path, "features")))
    assert before == after
    assert len(list((tmp_path / "runs").iterdir())) == 2  # the refused one stays loose: it may be done again
    assert all(f"{number:016x}" in Store(Folder(tmp_path)) for number in (*range(PACKED_FROM), 1000))


class Killed(Exception):
    pass


class Fragile(Folder):
    """A folder whose user is killed at its n-th change."""

    def __init__(self, path: Path, changes: int) -> None:
        super().__init__(path)
        self.left = changes

    def _change(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise Killed

    def put(self, name: str, content: bytes) -> None:
        self._change()
        super().put(name, content)

    def remove(self, name: str) -> None:
        self._change()
        super().remove(name)


@pytest.mark.parametrize("changes", [0, 3, 50, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 4, 17))])
def test_a_kill_while_runs_are_put_together_is_mended_by_the_next_to_open(
    many: Path, tmp_path: Path, changes: int
) -> None:
    copytree(many, tmp_path, dirs_exist_ok=True)
    with pytest.raises(Killed):
        Store(Fragile(tmp_path, changes)).pack()
    store = Store(Folder(tmp_path))
    assert sorted(row["run"] for row in rows(tmp_path, "runs")) == [f"{k:016x}" for k in range(PACKED_FROM)]
    assert len(rows(tmp_path, "features")) == 2 * PACKED_FROM
    assert all(f"{number:016x}" in store for number in range(PACKED_FROM))


def test_a_kill_between_features_and_run_leaves_a_run_that_is_not_known(tmp_path: Path) -> None:
    with pytest.raises(Killed):
        Store(Fragile(tmp_path, 1)).add(run(5), features(5))
    store = Store(Folder(tmp_path))
    assert f"{5:016x}" not in store
    store.add(run(5), features(5))
    assert len(rows(tmp_path, "features")) == 2


def test_one_without_a_result_is_replaced_by_its_result(tmp_path: Path) -> None:
    store = Store(Folder(tmp_path))
    store.add(run(1, "out of time"), [])
    store.add(run(1), features(1))
    assert [row["status"] for row in rows(tmp_path, "runs")] == ["done"] and store.status(f"{1:016x}") == "done"


def test_a_store_in_an_object_store_is_the_same(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    from explore3d.jobs.batch.places import place_of

    place = place_of("memory://bucket/store")
    store = Store(place)
    for number in range(PACKED_FROM):
        store.add(run(number), features(number))
    store.pack()
    (pack,) = place.names("features")
    assert len(pq.read_table(io.BytesIO(place.get(pack)))) == 2 * PACKED_FROM
    assert f"{7:016x}" in Store(place_of("memory://bucket/store"))
