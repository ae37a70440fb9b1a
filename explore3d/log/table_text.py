"""TableText: a table of numbers as it stands in a text file; delimiter, header and units are found, not asked for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from explore3d import UNITS, UserError
from mapping import FloatArray

COMMENTS = ("#", "%", "//")
MISSING = frozenset({"", "-", "--", "---", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "***"})

_MAGIC = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive (a spreadsheet? export it as CSV)",
    b"\x1f\x8b": "a gzip archive (unpack it first)",
    b"\x28\xb5\x2f\xfd": "a zstd archive (unpack it first)",
    b"\x89HDF": "an HDF5 file",
    b"PAR1": "a Parquet file",
    b"\x7fELF": "a program",
    b"\x89MCAP": "an MCAP log, but its beginning is damaged",
}
# delimiter (None: white space) and decimal sign, in the order of trust
_DIALECTS = ((";", "."), ("\t", "."), (",", "."), (None, "."), (";", ","), ("\t", ","), (None, ","))
_UNIT = re.compile(r"\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]\s*$|\s*/\s*(?P<slash>[^\s/]+)\s*$")


@dataclass(frozen=True, eq=False)
class TableText:
    """A table as written.

    Args:
        path: the file.
        names: name of each column, "" where the file has no header.
        units: unit that the file states for each column, "" where it states none.
        rows: (N, C) numbers; NaN where a value is missing.
        delimiter: ";", ",", a tab, or None for white space.
        decimal: "." or ",".
        first_line: number of the first row's line in the file, from 1.
        cut: True if the last line was incomplete and is left out.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: FloatArray
    delimiter: str | None
    decimal: str
    first_line: int
    cut: bool = False


def read_text(path: Path) -> TableText:
    """Read a table of numbers with two columns or more.

    Raises:
        UserError: no such file, empty, not text, no rows of numbers, a row that does not fit.
    """
    text = _decode(path)
    lines = text.splitlines()
    at, delimiter, decimal = _first_row(path, lines)
    columns = len(_split(lines[at], delimiter))
    numbers = [n for n in range(at, len(lines)) if lines[n].strip() and not lines[n].lstrip().startswith(COMMENTS)]
    names, units = _header(lines[:at], columns, delimiter)
    cut = len(numbers) > 1 and not text.endswith("\n") and len(_cells(lines[numbers[-1]], delimiter, columns)) < columns
    if cut:
        del numbers[-1]
    rows = _numbers(path, lines, numbers, columns, (delimiter, decimal))
    return TableText(path, names, units, rows, delimiter, decimal, at + 1, cut)


def _decode(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror}") from error
    if not data.strip():
        raise UserError(f"{path}: is empty")
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise UserError(f"{path}: is {what}; expected a log (.mcap) or a table of numbers (CSV, TXT)")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data:
        raise UserError(f"{path}: is a binary file; expected a log (.mcap) or a table of numbers (CSV, TXT)")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")  # instruments write "µm" so


def _first_row(path: Path, lines: Sequence[str]) -> tuple[int, str | None, str]:
    """Index of the first line of numbers, and the dialect in which it is one."""
    for at, line in enumerate(lines):
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        for delimiter, decimal in _DIALECTS:
            cells = _split(line, delimiter)
            known = [_number(cell, decimal) for cell in cells]
            if len(cells) >= 2 and None not in known and sum(value == value for value in known) >= 2:
                return at, delimiter, decimal
    some = next((line.strip() for line in lines if line.strip()), "")
    raise UserError(
        f"{path}: holds no line of two or more numbers; expected columns x, y, z or x, z; it begins {some[:40]!r}"
    )


def _split(line: str, delimiter: str | None) -> list[str]:
    cells = [cell.strip().strip('"').strip() for cell in line.strip().split(delimiter)]
    # a delimiter at the end of the line makes no column
    return cells[:-1] if delimiter not in (None, "\t") and len(cells) > 2 and not cells[-1] else cells


def _cells(line: str, delimiter: str | None, columns: int) -> list[str]:
    """The cells of a line of a table with that many columns: "1;2;" is three if the table has three."""
    cells = _split(line, delimiter)
    missing = len(cells) == columns - 1 and delimiter is not None and line.rstrip().endswith(delimiter)
    return [*cells, ""] if missing else cells


def _number(cell: str, decimal: str) -> float | None:
    """The number in a cell, NaN if it says that there is none, None if it is something else."""
    if cell.lower() in MISSING:
        return float("nan")
    if decimal == ",":
        if "." in cell:
            return None
        cell = cell.replace(",", ".")
    try:
        return float(cell) if "_" not in cell else None
    except ValueError:
        return None


def _header(before: Sequence[str], columns: int, delimiter: str | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units from the lines before the numbers: plain ones first, else the last fitting comment."""
    plain = [line for line in before if line.strip() and not line.lstrip().startswith(COMMENTS)]
    comments = [line.lstrip().lstrip("#%/") for line in before if line.lstrip().startswith(COMMENTS)]
    names, units = ("",) * columns, ("",) * columns
    for line in reversed(plain or comments):
        # "x (mm)" is one name even where white space delimits
        cells = tuple(_split(re.sub(r"\s+([\[(])", r"\1", line), delimiter))
        if len(cells) != columns:
            continue
        if all(_is_unit(cell) for cell in cells) and not any(units):
            units = tuple(cell.strip("[]() ") for cell in cells)
            continue
        split = [_UNIT.split(cell)[0] for cell in cells]
        stated = [_UNIT.search(cell) for cell in cells]
        names = tuple(split)
        if not any(units):
            units = tuple((hit["unit"] or hit["slash"] or "") if hit else "" for hit in stated)
        break
    return names, units


def _is_unit(cell: str) -> bool:
    bare = cell.strip("[]() ")
    return cell.startswith(("[", "(")) or bare in ("", "-", "1") or any(bare in units for units in UNITS.values())


def _numbers(
    path: Path, lines: Sequence[str], wanted: Sequence[int], columns: int, dialect: tuple[str | None, str]
) -> FloatArray:
    delimiter, decimal = dialect
    body = [lines[n].rstrip("; ,") if delimiter in (";", ",") else lines[n] for n in wanted]
    if decimal == ",":
        body = [line.replace(",", ".") for line in body]
    try:
        rows = np.loadtxt(body, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
        if rows.shape[1] == columns:
            return rows
    except ValueError:
        pass  # some cell is empty or wrong: the careful way below says which and where
    return np.array([_row(path, n, lines[n], columns, dialect) for n in wanted])


def _row(path: Path, index: int, line: str, columns: int, dialect: tuple[str | None, str]) -> list[float]:
    cells = _cells(line, dialect[0], columns)
    if len(cells) != columns:
        raise UserError(f"{path}: line {index + 1}: expected {columns} columns; found {len(cells)}: {line[:40]!r}")
    row = []
    for column, cell in enumerate(cells, 1):
        number = _number(cell, dialect[1])
        if number is None:
            raise UserError(f"{path}: line {index + 1}, column {column}: {cell[:30]!r} is not a number")
        row.append(number)
    return row
