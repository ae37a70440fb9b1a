"""Dialect: the delimiter, the decimal sign and the columns under which most lines of a text are rows of numbers."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

COMMENTS = ("#", "%", "//")
_NONE = """
    - -- --- * ** *** **** ***** ****** nan +nan -nan na n/a #n/a <na> null none nil inf -inf +inf infinity -infinity
    missing invalid bad err error ? . x 1.#qnan -1.#ind 1.#ind 1.#inf -1.#inf 1.#qnb nan(ind) -nan(ind) nan(snan) nd
    n.a. n.d. overrange underrange #num! #value! #div/0! #ref! nv out over under
"""
MISSING = frozenset(("", *_NONE.split()))
# Decimal sign and sign between thousands, in the order of trust
_SIGNS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (",", "'"), (".", " "), (",", " "))
_DELIMITERS = (";", "\t", ",", "|", None)


@dataclass(frozen=True)
class Dialect:
    """How numbers stand in lines.

    Args:
        delimiter: ";", ",", "|", a tab, or None for white space.
        decimal: "." or ",".
        thousands: sign between groups of three digits, "" if none.
        numeric: for each column whether it holds numbers.
    """

    delimiter: str | None
    decimal: str
    thousands: str
    numeric: tuple[bool, ...]


def find_dialect(lines: Sequence[str], decimal: str | None = None, least: int = 2) -> Dialect | None:
    """The dialect in which most of the lines are alike rows with so many numbers or more; None if there is none.

    Args:
        lines: of the file, a sample, without comments and blank ones.
        decimal: the sign, if somebody says it.
        least: numbers in a row.
    """
    best: tuple[tuple[float, ...], Dialect] | None = None
    cells: dict[str | None, list[list[str]]] = {}
    most = sum(any(map(str.isdigit, line)) for line in lines)  # no other line is a row
    for order, (sign, thousands) in enumerate(_SIGNS):
        if decimal is not None and sign != decimal:
            continue
        for delimiter in _DELIMITERS:
            if thousands == " " and delimiter is None:
                continue
            if delimiter not in cells:
                cells[delimiter] = [split(line, delimiter) for line in lines]
            if max(map(len, cells[delimiter]), default=0) < least:
                continue
            found = _judged(cells[delimiter], sign, thousands, least)
            if found is None:
                continue
            good, share, numeric = found
            key = (good, share, -order)
            if best is None or key > best[0]:
                best = key, Dialect(delimiter, sign, thousands, numeric)
                if good == most and share == 1.0:  # no other can be better, and the first of equals is taken
                    return best[1]
    return None if best is None else best[1]


def _judged(
    cells: Sequence[Sequence[str]], decimal: str, thousands: str, least: int
) -> tuple[int, float, tuple[bool, ...]] | None:
    """(lines that are alike, share of their columns that are numbers, which columns are)."""
    patterns = [tuple(is_number(cell, decimal, thousands) for cell in row) for row in cells]
    # rows of one kind have one number of cells, `least` of them numbers; empty and missing ones are either
    counts = Counter(len(pattern) for pattern in patterns if sum(hit is True for hit in pattern) >= least)
    if not counts:
        return None
    columns = max(counts, key=lambda count: (counts[count], count))
    rows = [each for each in patterns if len(each) == columns and sum(hit is True for hit in each) >= least]
    numeric = []
    for column in range(columns):
        hits = Counter(row[column] for row in rows)
        numeric.append((hits[True] > 0 and hits[True] >= hits[False]) or hits[False] == 0)
    good = sum(
        sum(hit is True for hit in row) >= least
        and all(hit is not False for hit, number in zip(row, numeric, strict=True) if number)
        for row in patterns
        if len(row) == columns
    )
    return good, sum(numeric) / columns, tuple(numeric)


@cache
def _grammar(decimal: str, thousands: str) -> re.Pattern[str]:
    sign = re.escape(decimal)
    whole = r"\d+" if not thousands else rf"(?:\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+|\d+)"
    return re.compile(rf"[-+]?(?:{whole}(?:{sign}\d*)?|{sign}\d+)(?:[eE][-+]?\d+)?")


def is_number(cell: str, decimal: str, thousands: str) -> bool | None:
    """True for a number, None for a cell that says there is none, False for text."""
    if cell.lower() in MISSING:
        return None
    return _grammar(decimal, thousands).fullmatch(cell) is not None


def split(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line without their quotes; a trailing comment and a delimiter at the end make none."""
    if '"' in line:
        cells = _quoted(line, delimiter)
    else:
        line = re.split(r"\s[#%]|\s//", line.rstrip(), maxsplit=1)[0]
        cells = [cell.strip() for cell in (line.split() if delimiter is None else line.strip(" \r\n").split(delimiter))]
    while delimiter is not None and len(cells) > 2 and not cells[-1]:
        cells = cells[:-1]
        if delimiter == "\t":
            break
    return cells


def _quoted(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return [(quoted or plain).strip() for quoted, plain in re.findall(r'"([^"]*)"|([^\s"]+)', line)]
    return [
        cell.strip() for cell in next(csv.reader([line.strip(" \r\n")], delimiter=delimiter, skipinitialspace=True))
    ]
