"""Store: two tables of Parquet, `runs` and `features`, that only grow.

    STORE/runs/KEY.parquet          one run: of a log's bytes, a version and settings; its name is the run's key
    STORE/features/KEY.parquet      the features of that run, written before it: a run that is there is whole
    STORE/runs/pack-NAME.parquet    many runs that were done, put together; their features have the same name

A kill at any moment leaves whole files. What it may leave twice, because it was put together and not yet taken away,
the next batch takes away when it opens the store.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from explore3d.analysis import FEATURE_COLUMNS, parquet_bytes
from explore3d.jobs.batch.places import Place

# done: has its features; the others say why there are none
STATUSES = ("done", "refused", "crashed", "killed", "out of memory", "out of time", "unreadable", "duplicate")

# Column: its type in Parquet; lengths in m, times in s
RUN_COLUMNS: dict[str, str] = {
    "run": "string",
    "log": "string",
    "object": "string",
    "sha256": "string",
    "version": "string",
    "settings": "string",
    "status": "string",
    "reason": "string",
    "seconds": "float64",
    "memory": "int64",
    "samples": "int64",
    "features": "int64",
    "tip_radius": "float64",
    "noise_white": "float64",
    "noise_correlated": "float64",
    "noise_length": "float64",
    "detection_limit": "float64",
    "base": "string",
    "tolerances": "string",
    "warnings": "string",
    "finished": "string",
}

# Loose runs from which on they are put together: a thousand files of 8 kB are slow to ask, one of 100 kB is not
PACKED_FROM = 64
_PACK = "pack-"
# Columns of a run that a store knows without being asked again; one that an older version wrote may lack the last
KNOWN_COLUMNS = ("run", "status", "tolerances")

Row = Mapping[str, Any]


class Store:
    """The two tables at a place.

    Args:
        place: where they lie.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._mend()
        self._standing = {row["run"]: row for row in self._rows(self._place.names("runs"))}

    def __contains__(self, run: str) -> bool:
        return run in self._standing

    def status(self, run: str) -> str:
        """How a run that stands there ended."""
        return str(self._standing[run]["status"])

    def verdict(self, run: str) -> str | None:
        """What became of its tolerances; None where nobody named any."""
        verdict = self._standing[run].get("tolerances")
        return None if verdict is None else str(verdict)

    def add(self, run: Row, features: Sequence[Row]) -> None:
        """Write a run and its features; one of the same key that was not done is replaced."""
        key = run["run"]
        self._place.put(f"features/{key}.parquet", parquet_bytes(FEATURE_COLUMNS, [dict(row) for row in features]))
        self._place.put(f"runs/{key}.parquet", parquet_bytes(RUN_COLUMNS, [dict(run)]))
        self._standing[key] = {name: run.get(name) for name in KNOWN_COLUMNS}

    def pack(self) -> int:
        """Put loose runs that were done together where there are many; how many were."""
        loose = [key for name in self._place.names("runs") if (key := _key(name)) and self.status(key) == "done"]
        if len(loose) < PACKED_FROM:
            return 0
        name = f"{_PACK}{hashlib.sha256(','.join(loose).encode()).hexdigest()[:16]}.parquet"
        # features first: a pack of features without one of runs is known to be unfinished
        for folder in ("features", "runs"):
            self._place.put(f"{folder}/{name}", self._together(f"{folder}/{key}.parquet" for key in loose))
        self._take_away(loose)
        return len(loose)

    def _together(self, names: Iterable[str]) -> bytes:
        import pyarrow as pa
        import pyarrow.parquet as pq

        rows = [pq.read_table(io.BytesIO(self._place.get(name))) for name in names]
        table = pa.concat_tables(rows, promote_options="default")  # those of an older version lack newer columns
        stream = io.BytesIO()
        pq.write_table(table, stream, compression="zstd")
        return stream.getvalue()

    def _mend(self) -> None:
        """Finish what a kill left half-way: an unfinished pack, and loose files that are in a finished one."""
        runs, features = self._place.names("runs"), self._place.names("features")
        finished = {name.partition("/")[2] for name in runs if not _key(name)}
        for name in features:
            if not _key(name) and name.partition("/")[2] not in finished:
                self._place.remove(name)
        loose = {key for name in (*runs, *features) if (key := _key(name))}
        if loose and finished:
            packed = {row["run"] for row in self._rows([f"runs/{name}" for name in finished])}
            self._take_away(sorted(loose & packed))

    def _take_away(self, keys: Iterable[str]) -> None:
        for key in keys:
            for folder in ("features", "runs"):
                self._place.remove(f"{folder}/{key}.parquet")

    def _rows(self, names: Sequence[str]) -> list[dict[str, Any]]:
        import pyarrow.parquet as pq

        rows: list[dict[str, Any]] = []
        for name in names:
            table = pq.ParquetFile(io.BytesIO(self._place.get(name)))
            rows += table.read(columns=[each for each in KNOWN_COLUMNS if each in table.schema_arrow.names]).to_pylist()
        return rows


def _key(name: str) -> str:
    """The key of a loose file's run, "" of a pack."""
    file = name.partition("/")[2]
    return "" if file.startswith(_PACK) else file.removesuffix(".parquet")
