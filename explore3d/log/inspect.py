"""inspect: what a file holds and how it is understood, what it leaves open, and how to settle that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError, count_text
from explore3d.log.own import LOG, SAMPLE_GAP, Log
from explore3d.log.readers import Reader, read_recording, reader_of
from explore3d.log.table import (
    EVEN,
    POSITION,
    TableSettings,
    advances,
    counts,
    find_columns,
    load_settings,
    sentinels,
    table_log,
)
from explore3d.log.text import TableText, read_pieces, read_text
from mapping import FloatArray, length_text

TABLE = "a table of numbers"
READ_WHOLE = 256 * 2**20  # bytes of a table that is held at once: 1.5e7 rows of two columns, in 1 GB
MOST_LISTED_COLUMNS = 16  # columns that are listed one by one


@dataclass(frozen=True)
class Inspection:
    """What is known of a file.

    Args:
        path: the file.
        kind: what it is, by its content.
        size: bytes.
        columns: of a table in text, each {"name", "unit", "least", "greatest", "missing", "is"}.
        read_as: how it is understood, one line; "" if it is not.
        samples, sweeps: how many.
        extent: (3,) of the positions, in metres, or in the file's unit where that is not stated.
        spacing: usual distance between neighbouring samples of a sweep, as extent.
        gaps, duplicates: how many.
        tip_radius: m, None where the file does not say it.
        metres: False if the unit is not known.
        doubtful: what keeps the file from being analysed, or is odd, with how to settle it.
        unsaid: what files of this kind do not say.
        recovered: what was lost or left out.
    """

    path: str
    kind: str
    size: int
    columns: list[dict[str, Any]] = field(default_factory=list)
    read_as: str = ""
    samples: int = 0
    sweeps: int = 0
    extent: tuple[float, ...] = ()
    spacing: float = 0.0
    gaps: int = 0
    duplicates: int = 0
    tip_radius: float | None = None
    metres: bool = True
    doubtful: tuple[str, ...] = ()
    unsaid: tuple[str, ...] = ()
    recovered: str = ""

    def lines(self) -> list[str]:
        """The same for people."""
        length = length_text if self.metres else lambda value: f"{value:.6g}"
        lines = [f"{self.path}: {self.kind}, {self.size:,} bytes"]
        for number, column in enumerate(self.columns[:MOST_LISTED_COLUMNS], 1):
            unit = f" [{column['unit']}]" if column["unit"] else ""
            values = "" if column["least"] is None else f", {_number(column['least'])} to {_number(column['greatest'])}"
            missing = f", {column['missing']} missing" if column["missing"] else ""
            lines.append(f"  column {number}: {column['name'] or 'no name'}{unit}{values}{missing}: {column['is']}")
        if len(self.columns) > MOST_LISTED_COLUMNS:
            lines.append(f"  and {len(self.columns) - MOST_LISTED_COLUMNS} more columns")
        if self.read_as:
            lines.append(f"read as: {self.read_as}")
        if self.samples:
            extent = " x ".join(map(length, self.extent))
            unit = "" if self.metres else " (unit not stated)"
            lines.append(f"samples: {self.samples:,} in {count_text(self.sweeps, 'sweep')}; extent {extent}{unit}")
            lines.append(
                f"spacing: {length(self.spacing)}; {count_text(self.gaps, 'gap')} longer than {SAMPLE_GAP:g} spacings, "
                f"{count_text(self.duplicates, 'repeated position')}"
            )
        if self.tip_radius is not None:
            lines.append(f"tip radius: {length_text(self.tip_radius)}")
        if self.recovered:
            lines.append(f"left out or lost: {self.recovered}")
        lines += [f"not in the file: {', '.join(self.unsaid)}"] if self.unsaid else []
        return lines + [f"doubtful: {each}" for each in self.doubtful] + ["nothing is doubtful"] * (not self.doubtful)


def inspect(path: Path | str, **settings: Any) -> Inspection:
    """Look into a file as `analyze` would, without needing what only the user knows.

    Args:
        path: anything that load_logs takes.
        settings: of read_table and tip_radius, as far as they are known.

    Raises:
        UserError: no such file, or nothing that any reader takes.
    """
    path = Path(path)
    file = path / LOG if path.is_dir() else path
    reader = reader_of(file)
    doubts: list[str] = []
    if reader.name == TABLE and file.stat().st_size > READ_WHOLE:
        return _in_pieces(file, reader, settings)
    columns = _columns(file, settings) if reader.name == TABLE else []
    log, assumed = _read(settings, doubts, lambda given: read_recording(path, given))
    # without a table and without a log there is nothing to tell
    if log is None and not columns:
        raise UserError(doubts[-1])
    doubts = [each.removeprefix(f"{file}: ") for each in doubts]
    found = Inspection(
        str(path), reader.name, file.stat().st_size, columns, doubtful=tuple(doubts), unsaid=reader.unsaid
    )
    return found if log is None else _with_log(found, log, assumed)


def _in_pieces(path: Path, reader: Reader, settings: Mapping[str, Any]) -> Inspection:
    """A table that is too long to be held at once: columns, samples and extent of all, the rest of its first piece."""
    given, _ = _settings(path, settings)
    sums: list[_Column] = []
    first: TableText | None = None
    rows = 0
    for text in read_pieces(path, given.decimal):
        first = first or text
        sums = sums or [_Column() for _ in text.names]
        for index, column in enumerate(sums):
            column.add(text, index)
        rows += len(text.rows)
    assert first is not None
    columns = [column.record(first, index) for index, column in enumerate(sums)]
    doubts: list[str] = []

    def read(asked: Mapping[str, Any]) -> Log:
        assert first is not None
        return table_log(first, *_settings(path, asked)) if given.average is None else read_recording(path, asked)

    log, assumed = _read(settings, doubts, read)
    doubts = [each.removeprefix(f"{path}: ") for each in doubts]
    doubts += (
        []
        if given.average is not None
        else [
            "it is long and was looked at in pieces: how it is read, sweeps, spacing, gaps and repeats are those of "
            f"its first {len(first.rows):,} rows"
        ]
    )
    found = Inspection(
        str(path), reader.name, path.stat().st_size, columns, doubtful=tuple(doubts), unsaid=reader.unsaid
    )
    if log is None:
        return replace(found, samples=rows)
    if given.average is not None:
        return _with_log(found, log, assumed)
    roles, factors = find_columns(first, given.columns), log.metadata["metres_per_unit"]
    extent = tuple(
        factors[role] * (sums[roles[role]].greatest - sums[roles[role]].least) if role in roles else 0.0
        for role in POSITION
    )
    return replace(_with_log(found, log, assumed), samples=rows, extent=extent)


@dataclass
class _Column:
    """What the pieces of a column tell of it."""

    least: float = np.inf
    greatest: float = -np.inf
    missing: int = 0
    up: int = 0
    down: int = 0
    last: float = np.nan

    def add(self, text: TableText, index: int) -> None:
        """Take in a piece."""
        values = text.rows[:, index]
        finite = values[np.isfinite(values)]
        self.missing += 0 if index in text.texts else len(values) - len(finite)
        if len(finite):
            steps = np.diff(finite, prepend=self.last)  # the first of all is compared with NaN: neither up nor down
            self.up, self.down = self.up + int((steps > 0).sum()), self.down + int((steps < 0).sum())
            self.least = min(self.least, float(finite.min()))
            self.greatest = max(self.greatest, float(finite.max()))
            self.last = float(finite[-1])

    def record(self, text: TableText, index: int) -> dict[str, Any]:
        """As _column gives it of a whole table."""
        texts, some = text.texts.get(index), np.isfinite(self.last)
        moves = self.up + self.down
        habit = "goes up and down" if self.up and self.down else "advances" if moves else "constant"
        habit += _downwards(self.down / moves) if self.up and self.down else ""
        return {
            "name": text.names[index],
            "unit": text.units[index],
            "least": self.least if some else None,
            "greatest": self.greatest if some else None,
            "missing": self.missing,
            "is": f"text, such as {texts[0][:20]!r}" if texts else habit if some else "holds no number",
        }


def _read(
    settings: Mapping[str, Any], doubts: list[str], read: Callable[[Mapping[str, Any]], Log]
) -> tuple[Log | None, set[str]]:
    """The log, and what had to be assumed to read it; each refusal on the way is a doubt."""
    assumed: dict[str, Any] = {}
    for more in ({}, {"tip_radius": 1.0}, {"units": "m"}):
        if any(settings.get(key) is not None for key in more):
            continue
        assumed |= more
        try:
            return read(dict(settings) | assumed), set(assumed)
        except UserError as error:
            if str(error) not in doubts:
                doubts.append(str(error))
    return None, set()


def _with_log(found: Inspection, log: Log, assumed: set[str]) -> Inspection:
    centers, sweep = log.trace.centers, log.trace.sweep
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)[np.diff(sweep) == 0]
    moving = steps[steps > 0]
    spacing = float(np.median(moving)) if len(moving) else 0.0
    read_as = "; ".join(log.metadata.get("read_as", []))
    metres = "units" not in assumed
    odd = [part for part in read_as.split("; ") if part.startswith("doubtful: ")]
    return Inspection(
        found.path,
        found.kind,
        found.size,
        found.columns,
        read_as if metres else read_as.replace(" m (as told)", " (unit not stated)"),
        len(log.trace),
        len(np.unique(sweep)),
        tuple(float(size) for size in np.ptp(centers, axis=0)),
        spacing,
        int((steps > SAMPLE_GAP * spacing).sum()),
        int((steps == 0).sum()) + int(log.metadata.get("rows_repeated", 0)),
        None if "tip_radius" in assumed else log.trace.tip_radius,
        metres,
        (*found.doubtful, *(part.removeprefix("doubtful: ") for part in odd)),
        found.unsaid,
        log.recovered,
    )


def _settings(path: Path, settings: Mapping[str, Any]) -> tuple[TableSettings, Path | None]:
    return load_settings(path, **{key: value for key, value in settings.items() if value is not None})


def _columns(path: Path, settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    given, _ = _settings(path, settings)
    try:
        text = read_text(path, given.decimal)
    except UserError:
        return []  # the reader says the same, and is heard
    return [_column(text, index) for index in range(len(text.names))]


def _column(text: TableText, index: int) -> dict[str, Any]:
    values = text.rows[:, index]
    finite = values[np.isfinite(values)]
    texts = text.texts.get(index)
    return {
        "name": text.names[index],
        "unit": text.units[index],
        "least": float(finite.min()) if len(finite) else None,
        "greatest": float(finite.max()) if len(finite) else None,
        "missing": 0 if texts else len(values) - len(finite),
        "is": f"text, such as {texts[0][:20]!r}" if texts else _habit(finite),
    }


def _habit(values: FloatArray) -> str:
    """How the numbers of a column go."""
    if not len(values):
        return "holds no number"
    if len(values) == 1 or not np.ptp(values) > 0:
        return "constant"
    none = sentinels(values)
    more = f"; {int(none.sum())} times {values[none][0]:g}, far off all others" if none.any() else ""
    steps = np.diff(values[~none])
    if set(np.unique(values[:1000])) <= {0.0, 1.0} and set(np.unique(values)) == {0.0, 1.0}:
        return "a mark, 0 or 1"
    if counts(values):
        return "counts the rows"
    if len(steps) and advances(values[~none]):
        even = np.ptp(steps) <= 2 * EVEN * abs(float(np.median(steps)))
        return ("advances evenly" if even else "advances") + more
    back = float((steps < 0).mean()) if len(steps) else 0.0
    if back == 0.0 or (steps <= 0).all():
        return f"goes {'down' if back else 'up'}, and stands between" + more
    return f"goes up and down{_downwards(back)}" + more


def _downwards(share: float) -> str:
    """Which share of a column's steps goes down, in words."""
    return f" ({100.0 * share:.0f} % of the steps down)"


def _number(value: float) -> str:
    """A number as a table has it; zero has no sign."""
    return f"{value + 0.0:.8g}"
