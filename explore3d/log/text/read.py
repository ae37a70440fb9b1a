"""TableText: a table of numbers as it stands in a text file; delimiter, header and units are found, not asked for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from explore3d import UserError
from explore3d.log.own import must_fit
from explore3d.log.text.decode import decoded
from explore3d.log.text.dialect import COMMENTS, MISSING, Dialect, find_dialect, split
from explore3d.log.text.header import FEW, read_header, role_of
from explore3d.log.text.spelling import length_factor
from mapping import BoolArray, FloatArray, IntArray, ShortArray

SAMPLE_LINES = 80  # at the beginning, in the middle, at the end: what finds the dialect
MOST_ODD = 1000  # cells a column, at first, that are no plain number: the rest is read again with room for all
LEAST_ROWS = 8  # fewer rows show no habit: whether x advances, whether an index counts
FAR_STEP = 10.0  # median steps: a first line so far off is no point of the path, if it is also written otherwise

_WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([a-zA-Zµμ°Å\"]{1,12})")


@dataclass(frozen=True, eq=False)
class TableText:
    """A table as written.

    Args:
        path: the file.
        names: name of each column, "" where the file has none.
        units: unit that the file states for each column, "" where it states none.
        rows: (N, C) numbers; NaN where a value is missing.
        delimiter: ";", ",", "|", a tab, or None for white space.
        decimal: "." or ",".
        first_line: number of the first row's line in the file, from 1.
        cut: True if the last line was incomplete and is left out.
        texts: cells of the columns that hold no numbers, by column.
        blocks: (N,) number of the block between blank lines.
        said: what was left out or taken for granted, each a clause.
        scale: a line of the file that speaks of a factor, "".
        kind: what the file is.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: FloatArray
    delimiter: str | None = None
    decimal: str = "."
    first_line: int = 1
    cut: bool = False
    texts: dict[int, list[str]] = field(default_factory=dict)
    blocks: ShortArray | None = None
    said: tuple[str, ...] = ()
    scale: str = ""
    kind: str = "a table"


def read_text(path: Path, decimal: str | None = None, least: int = 2) -> TableText:
    """Read a table of numbers with two columns or more.

    Args:
        path: the file.
        decimal: its decimal sign, if the file leaves it open.
        least: 1 takes a file of one column, too, where it can be no wider table.

    Raises:
        UserError: no such file, empty, not text, no rows of numbers, a row that does not fit, or numbers that mean
            two things ("1,234": 1.234 or 1234).
    """
    must_fit(path)
    data = decoded(path)
    whole = data.endswith(b"\n")
    if not whole:
        data += b"\n"
    dialect = dialect_of(path, data, decimal, least)
    return Reading(path, data, whole, dialect, decimal).table()


def dialect_of(path: Path, data: bytes, decimal: str | None, least: int = 2) -> Dialect:
    """The dialect of a text.

    Raises:
        UserError: it holds no row of numbers.
    """
    sample = _sample(data)
    dialect = find_dialect(sample, decimal)
    one = find_dialect(sample, decimal, least=1) if dialect is None else None
    dialect = one if dialect is None and least == 1 else dialect
    if dialect is None:
        some = next((line.strip() for line in sample), "")
        heights = '; heights alone are a profile whose points lie so far apart: --pixel "0.5 um"' if one else ""
        raise UserError(
            f"{path}: holds no line of two or more numbers; expected columns x, y, z or x, z; it begins {some[:40]!r}"
            f"{heights}"
        )
    return dialect


def _sample(data: bytes) -> list[str]:
    """Lines from the beginning, the middle and the end, without comments and blank ones."""
    if len(data) > 300_000:
        middle = len(data) // 2
        parts = [data[:40_000], data[middle : middle + 40_000], data[-40_000:]]
        cuts = [parts[0].rpartition(b"\n")[0], *(part.partition(b"\n")[2].rpartition(b"\n")[0] for part in parts[1:])]
        groups = [cut.decode("utf-8", "replace").split("\n") for cut in cuts]
        kept = [(line for line in lines if not _blank_or_comment(line)) for lines in groups]
        return [line for some in kept for line in islice(some, SAMPLE_LINES)]
    lines = [line for line in data.decode("utf-8", "replace").split("\n") if not _blank_or_comment(line)]
    if len(lines) > 3 * SAMPLE_LINES:
        middle = len(lines) // 2
        return lines[:SAMPLE_LINES] + lines[middle : middle + SAMPLE_LINES] + lines[-SAMPLE_LINES:]
    return lines[:SAMPLE_LINES]


class Reading:
    """One text on its way to a table."""

    def __init__(
        self, path: Path, data: bytes, whole: bool, dialect: Dialect, decimal: str | None, lines_before: int = 0
    ) -> None:
        self.lines_before = lines_before  # in the file, before `data`
        self.path, self.data, self.whole, self.dialect, self.asked = path, data, whole, dialect, decimal
        self.said: list[str] = []
        self.cut = False
        self.footer: int | None = None
        self.repeated: set[int] = set()
        self.heads: set[str] = set()

    def table(self) -> TableText:
        columns = len(self.dialect.numeric)
        preamble, start = self._preamble()
        self.start, self.heads = start, {line.strip() for line in preamble if not _blank_or_comment(line)}
        self.bytes = np.frombuffer(self.data, dtype=np.uint8)
        units_in_cells: dict[int, str] = {}
        rows, lines, blocks, spans, odd, strange, marks = self._cells()
        textual = [column for column in range(columns) if not self.dialect.numeric[column]]
        if not len(rows):
            raise UserError(f"{self.path}: holds no line of two or more numbers; expected columns x, y, z or x, z")
        self.lines, self.before = lines, self.lines_before + self.data.count(b"\n", 0, start)
        self._fill(rows, odd)
        self._unambiguous(marks)
        texts = {column: self._texts(spans[:, k]) for k, column in enumerate(textual)}
        for column, cells in list(texts.items()):
            if (parsed := self._with_units(cells)) is not None:
                rows[:, column], units_in_cells[column] = parsed
                del texts[column]
        counter = _counts(rows[:, 0])
        header = read_header(preamble, columns, self.dialect.delimiter, counter)
        if header.unfit:
            raise UserError(
                f"{self.path}: field columns: the header {header.unfit[:40]!r} does not name {columns} columns, as "
                f"line {self.before + int(lines[0]) + 1} has: {self._line(int(lines[0]))[:40]!r}"
            )
        keep = self._strange(strange, len(rows))
        if keep is not None:
            rows, lines, blocks = rows[keep], lines[keep], blocks[keep]
            texts = {c: [cell for cell, kept in zip(cells, keep, strict=True) if kept] for c, cells in texts.items()}
        units = [units_in_cells.get(c, "") or unit for c, unit in enumerate(header.units)]
        for column, unit in enumerate(units):
            axis = header.axis_units.get(header.names[column][:1].lower(), "") if header.names[column] else ""
            both = length_factor(header.all_units) is not None
            units[column] = (
                unit or axis or (header.all_units if both and not _not_a_length(header.names[column]) else "")
            )
        unknown = header.all_units if header.all_units and length_factor(header.all_units) is None else ""
        if unknown:
            self.said.append(f"the file speaks of the unit {unknown!r}, which is no length")
        return TableText(
            self.path,
            header.names,
            tuple(units),
            rows,
            self.dialect.delimiter,
            self.dialect.decimal,
            self.before + int(lines[0]) + 1,
            self.cut,
            texts,
            blocks,
            tuple(self.said),
            header.scale,
        )

    def _preamble(self) -> tuple[list[str], int]:
        """The lines before the first row, and the byte where the rows begin.

        Numbers above the line that names the columns are no rows, whatever their number.
        """
        columns, at, first = len(self.dialect.numeric), 0, None
        lines: list[tuple[int, str]] = []
        while at < len(self.data) and len(lines) < FEW:
            end = self.data.find(b"\n", at)
            lines.append((at, self.data[at:end].decode("utf-8", "replace")))
            at = end + 1
        for index, (_, line) in enumerate(lines):
            if first is None and self._is_row(line, columns):
                first = index
        if first is None:
            first = next((index for index, (_, line) in enumerate(lines) if not _blank_or_comment(line)), len(lines))
        # a line that names two columns or more, with rows below it, is the header of those rows
        limit = first
        for index in range(first + 1, len(lines) - 1):
            below = [line for _, line in lines[index + 1 : index + 4]]
            if _blank_or_comment(lines[index][1]) and not lines[index][1].strip(" #%/"):
                continue
            if index - first > 30:
                break
            header = read_header([lines[index][1]], columns, self.dialect.delimiter, True)
            named = sum(bool(name) and not self._is_row(lines[index][1], columns) for name in header.names)
            known = sum(role_of(name) is not None for name in header.names if name)
            if named and known >= 2 and any(self._is_row(line, columns) for line in below):
                if not self._same_header(lines, first, index, columns):
                    limit = index + 1
                    while limit < len(lines) and not self._is_row(lines[limit][1], columns):
                        limit += 1
                    above = [line.strip() for _, line in lines[:index] if self._is_row(line, columns)]
                    self.said.append(f"numbers above the header left out: {above[0][:30]!r}")
                break
        if limit == first:
            limit = self._without_counts(lines, first, columns)
        if limit == first:  # rows like the others but for their missing numbers: left out and counted as others are
            while limit and self._lacks_a_number(lines[limit - 1][1], columns):
                limit -= 1
        if not self.said and (above := [line.strip() for _, line in lines[:limit] if self._is_numbers(line)]):
            self.said.append(f"numbers above the rows left out: {above[0][:30]!r}")
        start = lines[limit][0] if limit < len(lines) else len(self.data)
        return [line for _, line in lines[:limit]], start

    def _same_header(self, lines: Sequence[tuple[int, str]], first: int, index: int, columns: int) -> bool:
        """True if a line only repeats the header that stands above the first row."""
        return any(line.strip() == lines[index][1].strip() for _, line in lines[:first])

    def _without_counts(self, lines: Sequence[tuple[int, str]], first: int, columns: int) -> int:
        """Skip a first line such as "0 1 2" or "9600 2": written otherwise than all others, and far from the path."""
        texts = list(islice((line for _, line in lines[first:] if self._is_row(line, columns)), 50))
        if len(texts) < LEAST_ROWS:
            return first
        cells = [split(line, self.dialect.delimiter) for line in texts]
        whole = [all(re.fullmatch(r"[-+]?\d+|", cell) for cell in row) for row in cells]
        if not whole[0] or any(whole[1:]):
            return first
        numbers = np.array([[self._value(cell) for cell in row] for row in cells])
        used = numbers[:, np.array(self.dialect.numeric)]
        steps = np.abs(np.diff(used[1:], axis=0))
        usual = np.nanmedian(steps, axis=0) if len(steps) else np.zeros(used.shape[1])
        spread = np.nanmax(used[1:], axis=0) - np.nanmin(used[1:], axis=0)
        far = np.abs(used[1] - used[0]) > FAR_STEP * np.maximum(usual, 0.1 * spread)
        known = used[0][np.isfinite(used[0])].tolist()
        named = known in (list(range(len(known))), list(range(1, len(known) + 1)))
        if not (far.any() or named):
            return first
        self.said.append(f"the line {texts[0].strip()[:30]!r} left out: a header of numbers, not a point")
        at = next(index for index, (_, line) in enumerate(lines) if index >= first and line == texts[0])
        return at + 1

    def _lacks_a_number(self, line: str, columns: int) -> bool:
        """True for a row that says in a cell that it has no number there; a number alone, such as a count, is none."""
        is_whole = len(split(line, self.dialect.delimiter)) == columns
        return is_whole and self._is_row(line, columns, least=1)

    def _is_row(self, line: str, columns: int, least: int = 2) -> bool:
        if _blank_or_comment(line):
            return False
        cells = split(line, self.dialect.delimiter)
        cells += [""] * (columns - len(cells) if columns - len(cells) == 1 else 0)
        if len(cells) != columns:
            return False
        values = [self._value(cell) for cell, number in zip(cells, self.dialect.numeric, strict=True) if number]
        return None not in values and sum(value == value for value in values) >= min(least, len(values))

    def _is_numbers(self, line: str) -> bool:
        """True for a line of nothing but numbers, two or more."""
        if _blank_or_comment(line):
            return False
        values = [self._value(cell) for cell in split(line, self.dialect.delimiter)]
        return len(values) >= 2 and all(value is not None and value == value for value in values)

    def _value(self, cell: str) -> float | None:
        """The number in a cell, NaN if it says that there is none, None if it is something else."""
        cell = cell.strip().strip('"').strip()
        if cell.lower() in MISSING:
            return float("nan")
        plain = cell.replace(self.dialect.thousands, "") if self.dialect.thousands else cell
        if self.dialect.decimal == ",":
            if "." in plain:
                return None
            plain = plain.replace(",", ".")
        try:
            return float(plain) if "_" not in plain else None
        except ValueError:
            return None

    def _cells(self) -> tuple[FloatArray, ShortArray, ShortArray, IntArray, IntArray, IntArray, IntArray]:
        from explore3d.log.text.cell_kernels import read_cells

        columns = len(self.dialect.numeric)
        most = self.data.count(b"\n", self.start)
        textual = ~np.array(self.dialect.numeric)
        delimiter = ord(self.dialect.delimiter) if self.dialect.delimiter else 0
        thousands = ord(self.dialect.thousands) if self.dialect.thousands else 0
        room = MOST_ODD
        while True:
            rows = np.empty((most, columns))
            lines, blocks = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
            spans = np.empty((most if textual.any() else 0, int(textual.sum()), 2), dtype=np.int64)
            odd, strange = np.empty((room, 4), dtype=np.int64), np.empty((room, 4), dtype=np.int64)
            marks = np.zeros((columns, 4), dtype=np.int64)
            counts = read_cells(
                self.bytes, self.start, delimiter, ord(self.dialect.decimal), thousands, textual,
                rows, lines, blocks, spans, odd, strange, marks,
            )  # fmt: skip
            count, odds, stranges, full = map(int, counts)
            if not full:
                return rows[:count], lines[:count], blocks[:count], spans[:count], odd[:odds], strange[:stranges], marks
            room = (most + 1) * columns

    def _fill(self, rows: FloatArray, odd: IntArray) -> None:
        """Write the cells that the fast way handed back: long numbers, missing values; others are an error."""
        for row, column, first, last in odd.tolist():
            cell = self.data[first:last].decode("utf-8", "replace")
            value = self._value(cell)
            if value is None:
                line = self.before + int(self.lines[row])
                if self._line(int(self.lines[row])).strip() in self.heads:
                    self.repeated.add(row)
                    continue
                if row >= len(rows) - 10:
                    rows[row:] = np.nan  # perhaps a footer: judged with the lines that do not fit
                    self._footer_from(row, cell, column, line)
                    return
                raise UserError(f"{self.path}: line {line + 1}, column {column + 1}: {cell[:30]!r} is not a number")
            rows[row, column] = value

    def _footer_from(self, row: int, cell: str, column: int, line: int) -> None:
        """A text among the numbers of the last lines is a footer only if every later line has one too."""
        tail = [self._line(int(at)) for at in self.lines[row:]]
        labelled = all(self._value(split(text, self.dialect.delimiter)[0]) is None for text in tail)
        if not labelled:
            raise UserError(f"{self.path}: line {line + 1}, column {column + 1}: {cell[:30]!r} is not a number")
        self.footer = row
        self.said.append(f"{len(tail)} lines after the numbers left out: {tail[0].strip()[:30]!r}")

    def _unambiguous(self, marks: IntArray) -> None:
        """Refuse numbers that may be a thousand times as large."""
        if self.asked is not None:
            return
        numeric = np.array(self.dialect.numeric)
        doubtful, otherwise, plain, leading = (marks[numeric, k] for k in range(4))
        sign, delimiter = self.dialect.decimal, self.dialect.delimiter
        if self.dialect.thousands:
            return
        both = doubtful.sum() > 0 and otherwise.sum() == 0
        if (both and sign == ",") or (both and ((doubtful > 0) & (plain > 0)).any()):
            other = "." if sign == "," else ","
            raise UserError(
                f"{self.path}: field decimal: all numbers with {sign!r} have three digits after it: 1{sign}234 may be "
                f'1.234 or 1234; write decimal = "{sign}" or decimal = "{other}" in {self.path.name}.toml'
            )
        if delimiter == "," and not otherwise.sum() and not doubtful.sum() and leading.sum() > 0:
            raise UserError(
                f"{self.path}: field decimal: whole numbers that begin with 0, such as in "
                f"{self._line(int(self.lines[0]))[:30]!r}: the comma may be a decimal sign; write the file with "
                "another delimiter, such as ;"
            )

    def _strange(self, strange: IntArray, rows: int) -> BoolArray | None:
        """Judge the lines that have another number of cells: footer, repeated header, cut line, or an error."""
        columns = len(self.dialect.numeric)
        count = rows if self.footer is None else self.footer
        last = int(self.lines[count - 1]) if count else -1
        footer, repeated = [], len(self.repeated)
        for line, cells, first, end in strange.tolist():
            text = self.data[first : self.data.find(b"\n", first)].decode("utf-8", "replace").strip()
            if text in self.heads:
                repeated += 1
            elif (
                line > last
                and not self.whole
                and self.data.find(b"\n", end) == len(self.data) - 1
                and self._begins(text)
            ):
                self.cut = True
            elif line > last and not self._begins(text):
                footer.append(text)
            else:
                raise UserError(
                    f"{self.path}: line {self.before + line + 1}: expected {columns} columns; found {cells}: "
                    f"{text[:40]!r}"
                )
        if footer:
            self.said.append(f"{len(footer)} lines after the numbers left out: {footer[0][:30]!r}")
        if repeated:
            self.said.append(f"{repeated} repeated header lines left out")
        if self.footer is None and not self.repeated:
            return None
        keep: BoolArray = np.arange(rows) < count
        keep[list(self.repeated)] = False
        return keep

    def _begins(self, text: str) -> bool:
        """True if a line begins with a number, as a row does."""
        cells = split(text, self.dialect.delimiter)
        value = self._value(cells[0]) if cells and cells[0] else None
        return value is not None and value == value

    def _texts(self, spans: IntArray) -> list[str]:
        return [self.data[first:last].decode("utf-8", "replace").strip() for first, last in spans.tolist()]

    def _with_units(self, cells: Sequence[str]) -> tuple[FloatArray, str] | None:
        """Numbers and their unit if every cell is "1.5 mm"; None if they are text."""
        units = set()
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            if cell.lower() in MISSING:
                continue
            hit = _WITH_UNIT.fullmatch(cell)
            value = self._value(hit[1]) if hit else None
            if hit is None or value is None:
                return None
            values[row] = value
            units.add(hit[2])
        if len(units) > 1 and all(length_factor(unit) for unit in units):
            raise UserError(f"{self.path}: field units: one column has cells in {' and in '.join(sorted(units))}")
        return (values, units.pop()) if len(units) == 1 else None

    def _line(self, line: int) -> str:
        """A line by its number from where the rows begin."""
        at = self.start
        for _ in range(line):
            at = self.data.find(b"\n", at) + 1
        return self.data[at : self.data.find(b"\n", at)].decode("utf-8", "replace")


def _blank_or_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(COMMENTS)


def _not_a_length(name: str) -> bool:
    return role_of(name) in ("t", "sweep", "valid", "index") or name.lower() in {"nx", "ny", "nz", "fx", "fy", "fz"}


def _counts(column: FloatArray) -> bool:
    """True if a column counts the rows: 0, 1, 2, ... or 1, 2, 3, ..."""
    start = column[0] if len(column) else np.nan
    if len(column) < 2 or start not in (0.0, 1.0) or column[-1] != start + len(column) - 1:  # most, at no cost
        return False
    return bool(np.array_equal(column, start + np.arange(len(column))))
