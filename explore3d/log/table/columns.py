"""Which column of a table is which: by what the user says, by the header, or by their number."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Literal

import numpy as np

from explore3d import UNITS, UserError, unit_factor
from explore3d.log.text import LEAST_ROWS, NO_UNIT, TableText, length_factor, role_of, time_factor_of
from mapping import FloatArray

Role = Literal["x", "y", "z", "t", "sweep", "valid", "nx", "ny", "nz", "cx", "cy", "cz", "fx", "fy", "fz"]
POSITION: tuple[Role, ...] = ("x", "y", "z")
VECTORS = {"normals": ("nx", "ny", "nz"), "contacts": ("cx", "cy", "cz"), "force": ("fx", "fy", "fz")}
LENGTH_ROLES: tuple[Role, ...] = (*POSITION, "cx", "cy", "cz")
MOST_LABELS = 16  # columns that a message names one by one: more than there are roles
EVEN = 0.01  # share of the usual step by which the steps of a scan may differ and still be called even


def find_columns(table: TableText, given: Mapping[Role, str | int]) -> dict[str, int]:
    """Role -> index of its column; a profile has x and z alone.

    Raises:
        UserError: a column that the table does not have, or positions that cannot be told apart.
    """
    roles: dict[str, int] = {role: _index(table, role, column) for role, column in given.items()}
    for role, column in roles.items():
        if other := next((each for each in roles if roles[each] == column and each != role), None):
            raise UserError(
                f"{table.path}: field columns: {role} and {other} are both column {label(table, column)}; expected a "
                "column of its own for each"
            )
    positions_given = any(role in roles for role in POSITION)
    for role in ("t", "sweep", "valid", *(name for names in VECTORS.values() for name in names)):
        if role not in roles and (index := _named(table, role)) is not None and index not in roles.values():
            roles[role] = index
    if not positions_given:
        roles |= _positions(table, set(roles.values()))
    if "z" not in roles and {"x", "y"} <= roles.keys():
        roles["z"] = roles.pop("y")  # a profile whose height is called y
    if not {"x", "z"} <= roles.keys():
        raise UserError(f"{table.path}: field columns: x and z (or x, y, z) are needed; found {', '.join(roles)}")
    for role in ("x", "y", "z"):
        if role in roles and roles[role] in table.texts:
            some = table.texts[roles[role]][0][:30]
            raise UserError(
                f"{table.path}: field columns.{role}: {label(table, roles[role])} holds text, such as {some!r}"
            )
    for field, names in VECTORS.items():
        some_names = [name for name in names if name in roles]
        # one force alone is what presses; beside it there is friction, which says nothing of how the finger yields
        if len(some_names) not in ((0, 1, 3) if field == "force" else (0, 3)):
            raise UserError(
                f"{table.path}: field columns: {field} need {', '.join(names)}; found {', '.join(some_names)}"
            )
    return roles


def length_factors(
    table: TableText, roles: Mapping[str, int], units: str | Mapping[Role, str] | None
) -> dict[str, float]:
    """Metres per unit of each column of lengths.

    Raises:
        UserError: a unit that nobody states, or that the file and the user state differently.
    """
    factors: dict[str, float] = {}
    for role in (role for role in LENGTH_ROLES if role in roles):
        stated = table.units[roles[role]].strip()
        known = length_factor(stated)
        column = label(table, roles[role])
        if known is None and stated.lower() not in NO_UNIT:
            raise UserError(
                f"{table.path}: field units: the file states {stated!r} for column {column}, which is no unit of "
                f"length that is known; possible: {', '.join(UNITS['length'])}"
            )
        asked = units if isinstance(units, str) else (units or {}).get(role, "")
        if asked and known is not None and not np.isclose(unit_factor(asked), known, rtol=1e-9):
            raise UserError(
                f"{table.path}: field units: {asked!r} is asked for, but the file states {stated!r} for column "
                f"{column}; leave the unit out to take the file's own"
            )
        if not (asked or known is not None):
            raise UserError(
                f"{table.path}: field units: missing for column {column}; give them with "
                f'--units mm, or write units = "mm" in {table.path.name}.toml'
            )
        if table.scale and not asked:
            raise UserError(
                f"{table.path}: field units: the file speaks of a factor ({table.scale[:40]!r}): are the numbers "
                f'already multiplied by it? then give the unit: --units mm, or units = "mm" in {table.path.name}.toml'
            )
        factors[role] = unit_factor(asked) if asked else known or 1.0
    return factors


# An hour's clock in so many units since 1970 is what a time without a unit and of that size can only be
_EPOCH_UNITS = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"))


def time_factor(table: TableText, roles: Mapping[str, int], times: FloatArray) -> tuple[float, str]:
    """Seconds per unit of the column of times, and what is taken for granted about it."""
    unit = table.units[roles["t"]]
    factor = time_factor_of(unit)
    if factor is not None:
        return factor, ""
    if unit.lower() not in NO_UNIT:
        return 1.0, f"times are in {unit!r}, which is no unit of time that is known; taken as seconds"
    size = float(np.max(np.abs(times))) if len(times) else 0.0
    for least, factor, name in _EPOCH_UNITS:
        if size > least:
            return factor, f"times taken as {name} since 1970"
    return 1.0, ""


def _positions(table: TableText, taken: set[int]) -> dict[str, int]:
    named: dict[str, int] = {
        role: index for role in POSITION if (index := _named(table, role)) is not None and index not in taken
    }
    if len(named) >= 2:
        if "x" not in named:
            named["x"] = named.pop("y")  # a profile along y
        return named
    if _named(table, "depth") is not None:
        raise UserError(
            f"{table.path}: field columns: a depth may count downwards; if it grows outwards, say "
            f'--columns "x=..., z={table.names[_named(table, "depth") or 0]}", else turn its sign'
        )
    if any(table.names):
        raise _cannot_tell(table, "")
    free = [index for index in range(len(table.names)) if index not in taken and index not in table.texts]
    return _by_number(table, free)


def _by_number(table: TableText, free: list[int]) -> dict[str, int]:
    """Positions without names: two columns are a profile, three are x, y, z, if nothing speaks against it."""
    known = np.isfinite(table.rows[:, free]).all(axis=1)
    rows = table.rows if known.all() else table.rows[known]
    columns = [rows[:, index] for index in free]
    if len(rows) < LEAST_ROWS:
        if len(free) == 2:
            return {"x": free[0], "z": free[1]}
        if len(free) == 3:
            return dict(zip(POSITION, free, strict=True))
        raise _cannot_tell(table, "")
    marks = [index for index, column in zip(free, columns, strict=True) if is_mark(column)]
    if marks and len(free) > 2:
        raise _cannot_tell(table, f"column {marks[0] + 1} holds nothing but 0 and 1: a mark?")
    counter = counts(columns[0])
    if len(free) == 2:
        if counter:
            raise _cannot_tell(table, "column 1 counts the rows: an index, or x in steps of 1?")
        if advances(columns[1]) and not advances(columns[0]):
            raise _cannot_tell(table, "column 2 advances and column 1 does not: is x the second?")
        return {"x": free[0], "z": free[1]}
    if counter and len(free) in (3, 4):
        if len(free) == 4 or not np.ptp(columns[1]) > 0:
            return dict(zip(POSITION, free[-3:], strict=True))
        if advances(columns[1]):
            return {"x": free[1], "z": free[2]}
        raise _cannot_tell(table, "column 1 counts the rows: an index, or x in steps of 1?")
    if len(free) == 3:
        if advances(columns[0]) and np.ptp(columns[1]) > 0:
            why = "a time" if advances(columns[1]) else "x, with a height beside it"
            raise _cannot_tell(table, f"column 1 never turns back: x of one slanting sweep, or {why}?")
        return dict(zip(POSITION, free, strict=True))
    raise _cannot_tell(table, "")


def counts(column: FloatArray) -> bool:
    """True if a column counts the rows: from 0 or 1 on in steps of 1."""
    if column[0] not in (0.0, 1.0) or column[-1] != column[0] + len(column) - 1:  # most columns, at no cost
        return False
    return bool(np.array_equal(column, column[0] + np.arange(len(column))))


def is_mark(column: FloatArray) -> bool:
    """True if a column holds both 0 and 1, and nothing else."""
    if column.min() != 0.0 or column.max() != 1.0:  # most columns, at no cost
        return False
    return bool(((column == 0.0) | (column == 1.0)).all())


def advances(column: FloatArray) -> bool:
    """True if a column never turns back: as time does, or x of one sweep."""
    steps = np.diff(column)
    return bool((steps > 0).all() or (steps < 0).all())


def _cannot_tell(table: TableText, why: str) -> UserError:
    is_map = not any(table.names) and not table.texts and len(table.names) > len(POSITION)
    heights = '; if it is a map of heights, say how far its pixels are apart: --pixel "1 um"' if is_map else ""
    return UserError(
        f"{table.path}: field columns: cannot tell x, y, z or x, z among {_labels(table)}{': ' * bool(why)}{why}; "
        f'say which with --columns "{_example(table)}" (names or numbers){heights}'
    )


def _example(table: TableText) -> str:
    """How to say which column is which: of a table with three columns of numbers or more, y too."""
    numbers = [index + 1 for index in range(len(table.names)) if index not in table.texts]
    marks = [each for each in numbers if len(table.rows) and is_mark(table.rows[:, each - 1])]
    plausible = [each for each in numbers if each not in marks]
    roles = POSITION if len(plausible) >= len(POSITION) else ("x", "z")
    numbered = plausible if len(plausible) >= len(roles) else [1, 2]
    return ", ".join(f"{role}={number}" for role, number in zip(roles, numbered, strict=False))


def _named(table: TableText, role: str) -> int | None:
    """The column of that name; the plain letter before other words.

    Raises:
        UserError: two columns may be it.
    """
    found = [index for index, name in enumerate(table.names) if name and role_of(name) == role]
    plain = [index for index in found if table.names[index].strip().lower() == role]
    found = plain or found
    if len(found) > 1 and role in (*POSITION, "t", "sweep"):
        which = " and ".join(f"{table.names[index]!r} (column {index + 1})" for index in found)
        raise UserError(
            f"{table.path}: field columns: {which} may both be {role}; say which with "
            f'--columns "{_example(table)}" (numbers)'
        )
    return found[0] if found else None


def _index(table: TableText, role: str, column: str | int) -> int:
    if isinstance(column, int):
        if 1 <= column <= len(table.names):
            return column - 1
        raise UserError(
            f"{table.path}: field columns.{role}: there is no column {column}; possible: 1 to {len(table.names)}"
        )
    for same in (column.__eq__, lambda name: name.lower() == column.lower()):
        for index, name in enumerate(table.names):
            if same(name):
                return index
    near = get_close_matches(column, table.names, n=1)
    hint = f" did you mean {near[0]!r}?" if near else ""
    raise UserError(
        f"{table.path}: field columns.{role}: there is no column {column!r};{hint} possible: {_labels(table)}"
    )


def _labels(table: TableText) -> str:
    count = len(table.names)
    labels = [label(table, index) for index in range(min(count, MOST_LABELS))]
    return ", ".join(labels) + (f" and {count - MOST_LABELS} more" if count > MOST_LABELS else "")


def label(table: TableText, index: int) -> str:
    """A column by its name, or by its number from 1."""
    return repr(table.names[index]) if table.names[index] else str(index + 1)
