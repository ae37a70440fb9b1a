"""inspect: what a file holds and how it is understood, what it leaves open, and how to settle that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.format import LOG
from explore3d.log.readers import read_recording, reader_of
from explore3d.log.record import Log
from explore3d.log.table_columns import EVEN, advances, counts
from explore3d.log.table_order import sentinels
from explore3d.log.text import TableText, read_text
from mapping import FloatArray, length_text

SAMPLE_GAP = 5.0  # usual steps: a longer one within a sweep is a gap, samples were lost or left out there
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
            values = "" if column["least"] is None else f", {column['least']:.8g} to {column['greatest']:.8g}"
            missing = f", {column['missing']} missing" if column["missing"] else ""
            lines.append(f"  column {number}: {column['name'] or 'no name'}{unit}{values}{missing}: {column['is']}")
        if len(self.columns) > MOST_LISTED_COLUMNS:
            lines.append(f"  and {len(self.columns) - MOST_LISTED_COLUMNS} more columns")
        if self.read_as:
            lines.append(f"read as: {self.read_as}")
        if self.samples:
            extent = " x ".join(map(length, self.extent))
            unit = "" if self.metres else " (unit not stated)"
            lines.append(f"samples: {self.samples:,} in {self.sweeps} sweeps; extent {extent}{unit}")
            lines.append(
                f"spacing: {length(self.spacing)}; {self.gaps} gaps longer than {SAMPLE_GAP:g} spacings, "
                f"{self.duplicates} repeated positions"
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
    columns = _columns(file, settings) if reader.name == "a table of numbers" else []
    doubts: list[str] = []
    log, assumed = _read(path, settings, doubts)
    # without a table and without a log there is nothing to tell
    if log is None and not columns:
        raise UserError(doubts[-1])
    doubts = [each.removeprefix(f"{file}: ") for each in doubts]
    found = Inspection(
        str(path), reader.name, file.stat().st_size, columns, doubtful=tuple(doubts), unsaid=reader.unsaid
    )
    return found if log is None else _with_log(found, log, assumed)


def _read(path: Path, settings: Mapping[str, Any], doubts: list[str]) -> tuple[Log | None, set[str]]:
    """The log, and what had to be assumed to read it; each refusal on the way is a doubt."""
    assumed: dict[str, Any] = {}
    for more in ({}, {"tip_radius": 1.0}, {"units": "m"}):
        if any(settings.get(key) is not None for key in more):
            continue
        assumed |= more
        try:
            return read_recording(path, dict(settings) | assumed), set(assumed)
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
        read_as if metres else read_as.replace(" x 1 m", " (unit not stated)"),
        len(log.trace),
        len(np.unique(sweep)),
        tuple(float(size) for size in np.ptp(centers, axis=0)),
        spacing,
        int((steps > SAMPLE_GAP * spacing).sum()),
        int((steps == 0).sum()),
        None if "tip_radius" in assumed else log.trace.tip_radius,
        metres,
        (*found.doubtful, *(part.removeprefix("doubtful: ") for part in odd)),
        found.unsaid,
        log.recovered,
    )


def _columns(path: Path, settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    from explore3d.log.table_settings import load_settings

    given, _ = load_settings(path, **{key: value for key, value in settings.items() if value is not None})
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
    return f"goes up and down ({back:.0%} of the steps down)" + more
