"""Rows of a table as samples: which are usable, in what order the finger made them, and the trace that they are."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UNITS, UserError, count_text
from explore3d.log.table.columns import LENGTH_ROLES, POSITION, VECTORS, label
from explore3d.log.table.order import Order, clipped, cloud_order, profile_order, sentinels
from explore3d.log.table.settings import TableSettings
from explore3d.log.text import LEAST_ROWS, TableText, length_factor
from mapping import BoolArray, FloatArray, IntArray, Trace, TraceError

NO_MARK = frozenset(("0", "false", "no", "f", "n", "invalid", "bad", "fail", ""))
CLOCK = re.compile(r"(?:(?P<h>\d+):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d*)?)")

Columns = dict[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Samples:
    """What the rows of a table are.

    Args:
        text: the table, or its first piece.
        roles: column of each role.
        factors: metres per unit of the columns of lengths.
        values: (N,) of each role, in SI units, in the order of movement.
        order: its sweeps.
        rows: that the file has.
        left_out: of them.
        dropped: what is said of those, in a clause and in few words.
        said: what was recognised or is doubtful.
        average: what averaging did, for the log; None: nothing.
        repeated: rows of those left out that say again what the one before said.
    """

    text: TableText
    roles: dict[str, int]
    factors: dict[str, float]
    values: Columns
    order: Order
    rows: int
    left_out: int
    dropped: list[tuple[str, str]]
    said: list[str]
    average: dict[str, Any] | None = None
    repeated: int = 0
    cut_short: bool = False

    @property
    def cut(self) -> bool:
        """True if the file ends within a line."""
        return self.text.cut or self.cut_short


def nothing_left(path: Path, dropped: list[tuple[str, str]]) -> UserError:
    """There is no row to go on with."""
    return UserError(f"{path}: field samples: no row is left ({'; '.join(words for words, _ in dropped)})")


def read_as(
    text: TableText,
    roles: dict[str, int],
    factors: dict[str, float],
    trace: Trace,
    dropped: list[tuple[str, str]],
    said: list[str],
) -> str:
    """One line: which column is what, in which unit, how many rows and sweeps, what was left out or recognised."""
    names = []
    for role, index in roles.items():
        unit = ""
        if role in factors:
            # the unit as it is written, where it is what was used
            unit = text.units[index] if length_factor(text.units[index]) else f"{_unit_of(factors[role])} (as told)"
        names.append(f"{role} = {label(text, index)} {unit}".rstrip())
    sweeps = len(np.unique(trace.sweep[np.flatnonzero(np.diff(trace.sweep, prepend=trace.sweep[0] - 1))]))
    rows = f"{count_text(len(trace), 'row')} in {count_text(sweeps, 'sweep')}"
    parts = [*names, rows, *(short for _, short in dropped)]
    return "; ".join([", ".join(parts), *said])


def _unit_of(factor: float) -> str:
    """The name of the unit of so many metres."""
    return next(name for name, metres in UNITS["length"].items() if np.isclose(metres, factor, rtol=1e-9, atol=0.0))


def with_texts(
    text: TableText, roles: dict[str, int], said: list[str], numbers: dict[str, int] | None = None
) -> FloatArray:
    """The rows with labels as numbers, marks as 0 and 1, and times of day as seconds; what cannot be is said.

    Args:
        numbers: of the labels so far; new ones are added. None: there was no piece before this one.
    """
    rows = text.rows
    for role, index in list(roles.items()):
        cells = text.texts.get(index)
        if cells is None:
            continue
        if rows is text.rows:
            rows = rows.copy()
        if role == "sweep":
            numbers = {} if numbers is None else numbers
            rows[:, index] = [numbers.setdefault(cell, len(numbers)) for cell in cells]
        elif role == "valid":
            rows[:, index] = [cell.lower() not in NO_MARK for cell in cells]
        elif role == "t" and (seconds := _seconds(cells)) is not None:
            rows[:, index] = seconds
        else:
            del roles[role]
            said.append(f"column {label(text, index)} holds text, such as {cells[0][:20]!r}, and is not used")
    return rows


def _seconds(cells: list[str]) -> FloatArray | None:
    """Seconds of ISO times (from the first on) or of clock times; None if they are neither."""
    try:
        times = [datetime.fromisoformat(cell.replace(",", ".").replace("/", "-")) for cell in cells]
        return np.array([(time - times[0]).total_seconds() for time in times])
    except (ValueError, TypeError):
        clock = [CLOCK.fullmatch(cell) for cell in cells]
    if not all(clock):
        return None
    return np.array([3600 * int(c["h"] or 0) + 60 * int(c["m"]) + float(c["s"].replace(",", ".")) for c in clock if c])


def good_rows(text: TableText, rows: FloatArray, roles: dict[str, int]) -> tuple[BoolArray, list[tuple[str, str]]]:
    """Mask of the usable rows, perhaps of none, and what is said of the others, in a clause and in few words."""
    used = [index for role, index in roles.items() if role != "valid"]
    finite: BoolArray = np.isfinite(rows[:, used[0]])
    for index in used[1:]:
        finite = finite & np.isfinite(rows[:, index])
    valid: BoolArray = np.ones(len(rows), dtype=np.bool_)
    if "valid" in roles:
        mark = rows[:, roles["valid"]]
        valid = np.isfinite(mark) & (mark != 0)
    said = []
    if not valid.all():
        count = int((~valid).sum())
        said.append((f"{count} of {len(valid)} rows are marked invalid and left out", f"{count} left out: invalid"))
    if not finite[valid].all():
        count = int((~finite & valid).sum())
        said.append((f"{count} of {len(valid)} rows lack a number and are left out", f"{count} left out: no number"))
    good = valid & finite
    for role in (role for role in POSITION if role in roles):
        column = np.where(good, rows[:, roles[role]], np.nan)
        none = sentinels(column)
        if none.any():
            which = ", ".join(f"{value:g}" for value in np.unique(column[none])[:3])
            count = int(none.sum())
            said.append(
                (
                    f"{count} of {len(valid)} rows have {which} in {role}, far off all others, and are left out",
                    f"{count} left out: {role} is {which}",
                )
            )
            good &= ~none
    padding = _zeros_at_the_end(rows, good, [roles[role] for role in POSITION if role in roles])
    if padding > 1 and len(rows) >= LEAST_ROWS:
        said.append((f"{padding} rows of zeros at the end are left out", f"{padding} left out: zeros at the end"))
        good[np.flatnonzero(good)[-padding:]] = False
    return good, said


def _zeros_at_the_end(rows: FloatArray, good: BoolArray, columns: list[int]) -> int:
    """How many of the last usable rows are nothing but zeros: a program's unused room."""
    kept = np.flatnonzero(good)
    tail = kept[-1:]
    if rows[tail][:, columns].any():
        return 0
    some = np.any(rows[kept][:, columns] != 0, axis=1)
    return int(len(kept) - 1 - np.flatnonzero(some)[-1]) if some.any() else 0


def is_moved(order: Order) -> bool:
    """True if the rows do not stand in the order of movement."""
    return order.rows is not None


def order_of(values: Columns, jump: float | None, text: TableText, blocks: IntArray | None) -> Order:
    """The rows in the order of movement, and their sweeps: the file's own, or by the way the positions went."""
    count = len(values["x"])
    rows: IntArray | None = None
    said = ""
    if "t" in values and (backwards := int((np.diff(values["t"]) < 0).sum())):
        if backwards > count // 20 and count >= LEAST_ROWS and "sweep" not in values:
            rows = np.argsort(values["t"], kind="stable")
            said = "the rows stood in no order and are sorted by time"
        else:
            said = f"the clock steps back {backwards} times"
    if "sweep" in values:
        numbers = values["sweep"]
        if not (numbers == np.rint(numbers)).all():
            raise UserError(f"{text.path}: field sweep: must be whole numbers; found {numbers[numbers % 1 != 0][0]:g}")
        return Order(rows, numbers.astype(np.int64), said)
    if blocks is not None and count >= LEAST_ROWS and 0 < blocks[-1] - blocks[0] < count // 4 and jump is None:
        found = int(blocks[-1] - blocks[0]) + 1
        return Order(rows, blocks - blocks[0], "; ".join([*[said] * bool(said), f"{found} sweeps between blank lines"]))
    if "y" not in values and jump is None:
        order = profile_order(values["x"] if rows is None else values["x"][rows])
    else:
        points = np.stack([values["x"], values.get("y", np.zeros(count)), values["z"]]).T
        points = points if rows is None else points[rows]
        found_order = cloud_order(points, jump)
        if found_order is None:
            raise UserError(
                f"{text.path}: field order: the rows are in no order in which a finger could have moved, and nothing "
                'says which order it was; give a column of times or of sweeps (--columns "t=..., sweep=..."), or sort'
            )
        order = found_order
    moved = rows if order.rows is None else order.rows if rows is None else rows[order.rows]
    return Order(moved, order.sweep, "; ".join(filter(None, (said, order.said))))


def blocks_of(text: TableText, good: BoolArray) -> IntArray | None:
    """(N,) number of the block between blank lines of each usable row; None if there is one block."""
    if text.blocks is None or text.blocks[0] == text.blocks[-1]:
        return None
    return np.asarray(text.blocks[good].astype(np.int64))


def repeated(values: Columns, sweep: IntArray) -> BoolArray:
    """(N,) mask of the rows that say again what the one before said, but for the time: one reading, and no second one.

    A controller is asked more often than it looks, a program writes a row twice; taken for readings of their own they
    make the noise look smaller, and correlated.
    """
    again: BoolArray = np.append(False, np.diff(sweep) == 0)
    for role in values.keys() - {"t"}:
        again[1:] &= values[role][1:] == values[role][:-1]
    return again


def doubts(text: TableText, roles: dict[str, int], values: Columns, settings: TableSettings) -> list[str]:
    """What is odd about the values, and not mended."""
    found = []
    if said := clipped(values["z"]):
        found.append(f"doubtful: z: {said}")
    still: BoolArray = np.ones(max(len(values["z"]) - 1, 0), dtype=np.bool_)
    for role in (role for role in POSITION if role in values):
        still &= values[role][1:] == values[role][:-1]
    same = int(still.sum())
    if same:
        found.append(f"{same} rows repeat the one before")
    forces = [name for name in VECTORS["force"] if name in roles]
    if len(forces) == 1:
        found.append(f"force: {forces[0]} alone, none taken to act across it")
    known = [index for index, name in enumerate(text.names) if index not in roles.values() and name]
    unused = [label(text, index) for index in known if index not in text.texts]
    if unused and "z" not in settings.columns:
        found.append(f"not used: {', '.join(unused[:6])}")
    return found


def trace_of(values: Columns, settings: TableSettings, text: TableText, order: Order) -> Trace:
    radius = settings.tip_radius
    assert radius is not None
    x, z = values["x"], values["z"]
    profile = "y" not in values
    if profile and len(x) > 1 and not np.ptp(x) > 0:
        raise UserError(f"{text.path}: field x: a profile needs x that advances; found the same in all {len(x)} rows")
    if settings.reference == "bottom":
        z = z + radius
    table = np.empty((len(x), 3))
    table[:, 0], table[:, 1], table[:, 2] = x, 0.0 if profile else values["y"], z
    rotation, origin = np.array(settings.frame.rotation, dtype=np.float64), np.array(settings.frame.origin)
    moved = settings.frame != type(settings.frame)()
    vectors = {}
    for field, names in VECTORS.items():
        if any(name in values for name in names):
            vector = np.column_stack([values.get(name, np.zeros(len(x))) for name in names])
            vectors[field] = vector @ rotation.T + (origin if names[0] in LENGTH_ROLES else 0.0) if moved else vector
    t = values["t"] if "t" in values else np.arange(len(x), dtype=np.float64)
    centers = table @ rotation.T + origin if moved else table
    for own in (t, centers, order.sweep):
        own.setflags(write=False)  # so that they need not be copied
    try:
        return Trace(
            t, centers, order.sweep, radius, vectors.get("normals"), vectors.get("contacts"), vectors.get("force")
        )
    except TraceError as error:
        raise UserError(f"{text.path}: {error}") from error
