"""The table of features: a row for each that was kept or dropped, as CSV and Parquet, the same from one log or many."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from explore3d import __version__
from mapping import Dropped
from mapping.model import SIZES, ObjectModel, probability, rows

# Characters of a run's key: 64 bits, so that among a million runs the chance that any two share one is 3e-8
RUN_KEY_DIGITS = 16

Row = dict[str, Any]

# Column: its type in Parquet; lengths in m, in the frame of the base
FEATURE_COLUMNS: dict[str, str] = {
    "run": "string",
    "id": "string",
    "kind": "string",
    **dict.fromkeys("xyz", "float64"),
    **{
        f"{size}{end}": "bool" if end in ("_censored", "_bounded") else "float64"
        for size in SIZES
        for end in ("", "_low", "_high", "_censored", "_bounded")
    },
    "position_sd": "float64",
    "snr": "float64",
    "crossings": "int64",
    "log_odds": "float64",
    "probability": "float64",
    "finer_than_the_tip": "bool",
    "face": "int64",
    "kept": "bool",
    "why_dropped": "string",
}
# Bytes that are read at once, as pyarrow does by itself
_JSON_BLOCK = 2**20


def run_key(sha256: str, settings: Mapping[str, Any]) -> str:
    """The key of one analysis: of a log's bytes, the version of the program and all that it was told.

    Args:
        sha256: of the log's bytes.
        settings: of the analysis, without those that say nothing (None).
    """
    told = {name: value for name, value in settings.items() if value not in (None, (), [], {}, False)}
    text = json.dumps([sha256, __version__, told], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:RUN_KEY_DIGITS]


def feature_rows(model: ObjectModel, run: str) -> list[Row]:
    """A row for each feature, what was detected and dropped last; columns as FEATURE_COLUMNS.

    Args:
        run: key of the analysis.
    """
    kept = [row | {"kept": True, "why_dropped": None} for row in rows(model.features)]
    table = (*kept, *map(_dropped_row, model.dropped))
    return [{"run": run} | {name: _known(value) for name, value in row.items()} for row in table]


def _dropped_row(dropped: Dropped) -> Row:
    """What is known of something that is no feature; its other columns are empty."""
    row: Row = dict.fromkeys(FEATURE_COLUMNS) | {"kind": dropped.kind, "height": dropped.height, "snr": dropped.snr}
    row |= {name: float(value) for name, value in zip("xyz", dropped.point, strict=True)}
    row |= {"crossings": dropped.crossings, "log_odds": dropped.log_odds, "kept": False, "why_dropped": dropped.reason}
    row["probability"] = probability(dropped)
    return {name: value for name, value in row.items() if name != "run"}


def _known(value: Any) -> Any:
    """The value, None for a number that is not known; infinity is one that the data do not bound."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def csv_text(columns: Mapping[str, str], table: Sequence[Row]) -> str:
    """Rows as CSV with a header; what is not known is empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return text.getvalue()


def parquet_bytes(columns: Mapping[str, str], table: Sequence[Row]) -> bytes:
    """Rows as a Parquet file with these columns and types; what is not known is null."""
    import pyarrow as pa
    import pyarrow.json as pj
    import pyarrow.parquet as pq

    schema = pa.schema([(name, getattr(pa, "bool_" if kind == "bool" else kind)()) for name, kind in columns.items()])
    # by way of JSON: from lists pyarrow makes arrays with the help of pandas, whose import takes a third of a second
    lines = [json.dumps(row, default=lambda value: value.item()).encode() for row in table]
    known = pj.ParseOptions(explicit_schema=schema, unexpected_field_behavior="ignore")
    # a row lies in two blocks at most
    blocks = pj.ReadOptions(block_size=max([_JSON_BLOCK, *(len(line) + 1 for line in lines)]))
    text = io.BytesIO(b"\n".join(lines))
    made = pj.read_json(text, read_options=blocks, parse_options=known) if lines else schema.empty_table()
    stream = io.BytesIO()
    pq.write_table(made, stream, compression="zstd")
    return stream.getvalue()
