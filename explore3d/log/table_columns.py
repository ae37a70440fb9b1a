"""Which column of a table is which: by what the user says, by the header, or by their number."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Literal

from explore3d import UNITS, UserError, unit_factor
from explore3d.log.table_text import TableText

Role = Literal["x", "y", "z", "t", "sweep", "valid", "nx", "ny", "nz", "cx", "cy", "cz", "fx", "fy", "fz"]
POSITION: tuple[Role, ...] = ("x", "y", "z")
VECTORS = {"normals": ("nx", "ny", "nz"), "contacts": ("cx", "cy", "cz"), "force": ("fx", "fy", "fz")}
LENGTH_ROLES: tuple[Role, ...] = (*POSITION, "cx", "cy", "cz")

_SYNONYMS = {
    "t": ("t", "time"),
    "sweep": ("sweep", "line", "track"),
    "valid": ("valid", "ok", "mask"),
    "z": ("z", "height"),
}


def find_columns(table: TableText, given: Mapping[Role, str | int]) -> dict[str, int]:
    """Role -> index of its column; a profile has x and z alone.

    Raises:
        UserError: a column that the table does not have, or positions that cannot be told apart.
    """
    roles: dict[str, int] = {role: _index(table, role, column) for role, column in given.items()}
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
    for field, names in VECTORS.items():
        some = [name for name in names if name in roles]
        if some and len(some) < 3:
            raise UserError(f"{table.path}: field columns: {field} need {', '.join(names)}; found {', '.join(some)}")
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
        stated = table.units[roles[role]]
        stated = stated if stated in UNITS["length"] else ""
        asked = units if isinstance(units, str) else (units or {}).get(role, "")
        if asked and stated and unit_factor(asked) != unit_factor(stated):
            raise UserError(
                f"{table.path}: field units: {asked!r} is asked for, but the file states {stated!r} for column "
                f"{_label(table, roles[role])}"
            )
        if not (asked or stated):
            raise UserError(
                f"{table.path}: field units: missing for column {_label(table, roles[role])}; give them with "
                f'--units mm, or write units = "mm" in {table.path.name}.toml'
            )
        factors[role] = unit_factor(asked or stated)
    return factors


def time_factor(table: TableText, roles: Mapping[str, int]) -> float:
    """Seconds per unit of the column of times; seconds unless its header says otherwise."""
    return UNITS["time"].get(table.units[roles["t"]], 1.0)


def _positions(table: TableText, taken: set[int]) -> dict[str, int]:
    named: dict[str, int] = {
        role: index for role in POSITION if (index := _named(table, role)) is not None and index not in taken
    }
    if "x" in named and len(named) >= 2:
        return named
    free = [index for index in range(len(table.names)) if index not in taken]
    if len(free) == 2:
        return {"x": free[0], "z": free[1]}
    if len(free) == 3:
        return dict(zip(POSITION, free, strict=True))
    raise UserError(
        f"{table.path}: field columns: cannot tell x, y, z or x, z among {_labels(table)}; "
        'say which with --columns "x=1, z=2" (names or numbers)'
    )


def _named(table: TableText, role: str) -> int | None:
    wanted = _SYNONYMS.get(role, (role,))
    return next((i for name in wanted for i, have in enumerate(table.names) if have.strip().lower() == name), None)


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
    return ", ".join(_label(table, index) for index in range(len(table.names)))


def _label(table: TableText, index: int) -> str:
    return repr(table.names[index]) if table.names[index] else str(index + 1)
