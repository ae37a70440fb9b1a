"""Readers of tables that are no text: Parquet, and the sheets of a workbook."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.arrays import numbers_log
from explore3d.log.readers.instruments import MITUTOYO, instrument_log
from explore3d.log.readers.optional import claimed, decoding, library
from explore3d.log.readers.own import POINT, TIP, TextTable
from explore3d.log.readers.packed import read_inside

MOST_SHEETS = 50  # of a workbook that are looked at


class ParquetTable:
    """The columns of numbers and times of a Parquet file."""

    name = "a Parquet file"
    unsaid: tuple[str, ...] = ("the units, unless the names of the columns do", TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(b"PAR1") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        parquet = library(path, "pyarrow.parquet", "formats", self.name)
        with decoding(path, self.name):
            with parquet.ParquetFile(path) as file:
                about = file.metadata
                groups = [about.row_group(number) for number in range(about.num_row_groups)]
                claimed(path, self.name, 8 * about.num_rows * about.num_columns)
                claimed(path, self.name, sum(group.total_byte_size for group in groups))
                table = file.read()
            names, columns = [], []
            for field, column in zip(table.schema, table.columns, strict=True):
                values = _numbers(column.to_numpy(), str(field.type))
                if values is not None and not field.name.startswith("__index_level_"):
                    names.append(field.name)
                    columns.append(values)
        if len(columns) < 2:
            raise UserError(
                f"{path}: field columns: expected two columns of numbers; found {', '.join(names) or 'none'}"
            )
        return numbers_log(path, names, np.column_stack(columns), settings, self.name)


def _numbers(values: np.ndarray, kind: str) -> np.ndarray | None:
    """A column as float64; times in seconds since the first; None if it holds something else."""
    if values.dtype.kind in "fiub":
        return values.astype(np.float64)
    if values.dtype.kind == "M":
        return (values - values[0]) / np.timedelta64(1, "s") if len(values) else values.astype(np.float64)
    return None


class Workbook:
    """A sheet of numbers in a workbook (XLSX), read as text would be; `part` names the sheet, if several hold some."""

    name = "a workbook (XLSX)"

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        """What its sheet holds.

        Raises:
            UserError: one line naming the file and what it lacks.
        """
        library(path, "openpyxl", "formats", self.name)
        with decoding(path, self.name):
            sheets = _sheets(path)
        if {"DATA", "Certificate"} <= sheets.keys():
            return instrument_log(path, settings, MITUTOYO)
        part = settings.get("part")
        if part is not None and part not in sheets:
            raise UserError(f"{path}: field part: there is no sheet {part!r}; possible: {', '.join(sheets)}")
        filled = {name: text for name, (text, numbers) in sheets.items() if numbers >= 2 or name == part}
        if part is None and len(filled) != 1:
            raise UserError(
                f"{path}: field part: expected one sheet with rows of numbers; found {', '.join(filled) or 'none'}; "
                'name one with --part "Sheet1"'
            )
        name = part or next(iter(filled))
        stream = io.BytesIO(filled[name].encode())
        given = {"decimal": "."} | {key: value for key, value in settings.items() if key != "part"}
        return read_inside(path, "sheet", stream, TextTable().read, given)


def _sheets(path: Path) -> dict[str, tuple[str, int]]:
    """Each sheet as text with ";", and how many of its rows hold two numbers."""
    import openpyxl

    with path.open("rb") as file:
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        found = {}
        for sheet in book.worksheets[:MOST_SHEETS]:
            text = io.StringIO()
            writer = csv.writer(text, delimiter=";", lineterminator="\n")
            numbers = 0
            for row in sheet.iter_rows(values_only=True):
                numbers += sum(isinstance(value, int | float) for value in row) >= 2
                writer.writerow([_cell(value) for value in row])
            found[sheet.title] = (text.getvalue(), numbers)
        return found


def _cell(value: object) -> object:
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return "" if value is None else value.replace("\n", " ") if isinstance(value, str) else value
