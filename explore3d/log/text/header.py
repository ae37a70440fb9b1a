"""Header: names and units from the lines before the numbers, found by what they say and not by how many they are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from explore3d.log.text.dialect import COMMENTS, is_number, split
from explore3d.log.text.spelling import is_unit, length_factor, name_and_unit

# Names that instruments give to a column, by what they mean; letters and digits only, in lower case
NAMES = {
    "x": "x xpos posx xposition positionx xaxis axisx xachse xcoordinate coordinatex xcoord xtip tipx px position "
    "pos distance travel lateral lateralposition scanposition scandistance traceposition weg strecke abscissa "
    "xcenter xcentre xdistance xlength",
    "y": "y ypos posy yposition positiony yaxis axisy yachse ycoordinate coordinatey ycoord ytip tipy py ycenter "
    "ycentre",
    "z": "z height zpos posz zposition positionz zaxis axisz zachse zcoordinate coordinatez zcoord ztip tipz pz "
    "totalprofile profile rawprofile raw topography elevation hoehe höhe hauteur altura zheight heightz zvalue "
    "zcenter zcentre",
    "t": "t time timestamp elapsed elapsedtime zeit stamp datetime date seconds",
    "sweep": "sweep line track pass scan scanline trace sweepid linenumber lineno",
    "valid": "valid ok mask isvalid",
    "index": "index idx n no nr number point pointno pointnumber sample i id row rownumber unnamed0 seq count nummer",
    "depth": "depth tiefe penetration",
}
ROLE_OF = {name: role for role, names in NAMES.items() for name in names.split()}
VECTOR_NAMES = frozenset(f"{letter}{axis}" for letter in "ncf" for axis in "xyz")
FEW = 400  # lines of a preamble that are looked at: instruments write tens

_UNITS_SAID = re.compile(
    r"(?i)\b(?:(?P<axis>[xyz])[\s_-]*(?:axis|achse)?[\s_-]*)?(?:units?|einheit(?:en)?|unité)\b"
    r"\s*[:=;,\t ]\s*[\"'\[(]*(?P<unit>[^\s\"'\]);,]+)"
)
_ALL_IN = re.compile(r"(?i)\b(?:all|values|coordinates|positions|lengths|data)\b.*\bin\s+\[?(?P<unit>[a-zµμÅ]+)\b")
_SCALE = re.compile(
    r"(?i)\b\w*(?:scale|factor|multiplier|gain)\w*\b[^\d+-]{0,20}(?P<number>[-+]?\d+(?:[.,]\d+)?(?:e[-+]?\d+)?)"
)


@dataclass(frozen=True)
class Header:
    """What the lines before the numbers say.

    Args:
        names: of each column, "" if not named.
        units: that each column's header states, "".
        line: index of the line with the names, None without one.
        all_units: unit that the file states for all lengths, "" if none.
        axis_units: {"x": unit} where the file states one for an axis alone.
        scale: a line that speaks of a factor other than 1, "" if none.
        unfit: a line with names whose number is not that of the columns, "" if none.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    line: int | None
    all_units: str
    axis_units: dict[str, str]
    scale: str
    unfit: str = ""


def role_of(name: str) -> str | None:
    """What a column of that name is, None if the name is not known."""
    bare = re.sub(r"[^a-z0-9äöüé]", "", name.lower())
    return bare if bare in VECTOR_NAMES else ROLE_OF.get(bare)


def read_header(lines: Sequence[str], columns: int, delimiter: str | None, counter: bool) -> Header:
    """The header of a table.

    Args:
        lines: all lines before the first row of numbers.
        columns: of the rows.
        delimiter: of the rows; the header may have another.
        counter: True if the first column counts the rows, so that it may be without a name.
    """
    best: tuple[int, int, list[str]] | None = None
    unfit = ""
    for at, line in enumerate(lines):
        cells, known, fits = _names(line, columns, delimiter, counter)
        unknown = not line.lstrip().startswith(COMMENTS) and _last(lines, at)
        if fits and (best is None or known >= best[0]) and (known or unknown):
            best = known, at, cells
        elif not fits and known >= 2 and len(cells) == known:
            unfit = line.strip()
    names, units = ["" for _ in range(columns)], ["" for _ in range(columns)]
    named_at: int | None = None
    if best is not None:
        named_at = best[1]
        parts = [name_and_unit(cell) for cell in best[2]]
        names, units = [name for name, _ in parts], [unit for _, unit in parts]
        for below in lines[named_at + 1 : named_at + 3]:
            row = _cells(below, columns, delimiter, counter)
            if row is not None and all(is_unit(cell) for cell in row) and any(row):
                stated = [cell.strip("[](){}<> ") for cell in row]
                units = [old or new for old, new in zip(units, stated, strict=True)]
    all_units, axis_units, scale = _said(lines)
    if best is not None and best[0]:
        unfit = ""
    return Header(tuple(names), tuple(units), named_at, all_units, axis_units, scale, unfit)


def _last(lines: Sequence[str], at: int) -> bool:
    """True if nothing but units, rules and blanks stands between a line and the rows: a header of unknown names."""
    rest = [bare for line in lines[at + 1 :] if (bare := line.strip(" #%/\r\n\t"))]
    return all(
        all(is_unit(cell) for cell in re.split(r"[;,\t|\s]+", line)) or not re.search(r"\w", line) for line in rest
    )


def _bare(line: str) -> str:
    return line.strip().lstrip("#%/!").strip() if line.lstrip().startswith((*COMMENTS, "!")) else line.strip(" \r\n")


def _ways(line: str, delimiter: str | None) -> list[list[str]]:
    """The cells of a header, by each delimiter that it may have; "x (mm)" is one name where white space delimits."""
    ways = [split(re.sub(r"(?<=\S)\s+(?=[\[(])", "", line) if delimiter is None else line, delimiter)]
    for other in ("\t", ";", ",", "|"):
        if other != delimiter and other in line:
            ways.append(split(line, other))
    if delimiter is None:
        ways.append([cell for cell in re.split(r"\s{2,}|\t", line) if cell])
    else:
        ways.append(line.split())
    return ways


def _cells(line: str, columns: int, delimiter: str | None, counter: bool) -> list[str] | None:
    """A header line's cells if they are as many as the columns; a counter's name may be missing."""
    bare = _bare(line)
    if not bare:
        return None
    for cells in _ways(bare, delimiter):
        if len(cells) == columns:
            return cells
        # trailing empty names were cut off with a delimiter at the end of the line
        if delimiter not in (None, "\t") and len(cells) == columns + 1 and not cells[-1]:
            return cells[:-1]
    if counter:
        return next((["", *cells] for cells in _ways(bare, delimiter) if len(cells) == columns - 1), None)
    return None


def _names(line: str, columns: int, delimiter: str | None, counter: bool) -> tuple[list[str], int, bool]:
    """(cells, how many have a known name, whether they may be the names of the columns)."""
    bare = _bare(line)
    fitting = []
    for cells in filter(None, [_cells(line, columns, delimiter, counter), *_ways(bare, delimiter)]):
        known = sum(role_of(name_and_unit(cell)[0]) is not None for cell in cells)
        fits = len(cells) == columns and not any(is_number(cell, ".", "") for cell in cells)
        fits = fits and not all(is_unit(cell) for cell in cells)
        fitting.append((fits, known, cells))
    if not fitting:
        return [], 0, False
    fits, known, cells = max(fitting, key=lambda way: (way[0], way[1]))
    return cells, known, fits


def _said(lines: Sequence[str]) -> tuple[str, dict[str, str], str]:
    """Unit of everything, units of axes, and a line about a factor, from the words before the numbers."""
    everything, axes, scale = "", {}, ""
    for line in lines:
        for hit in _UNITS_SAID.finditer(line):
            if hit["axis"]:
                axes[hit["axis"].lower()] = hit["unit"]
            elif not everything:
                everything = hit["unit"]
        if (words := _ALL_IN.search(line)) and length_factor(words["unit"]) and not everything:
            everything = words["unit"]
        if factor := _SCALE.search(line):
            try:
                one = float(factor["number"].replace(",", ".")) == 1.0
            except ValueError:
                one = False
            scale = scale if one else line.strip()
    return everything, axes, scale
