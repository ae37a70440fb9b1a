"""read_table: a recorded table of x, y, z or of one profile x, z becomes the Log that the analysis takes."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.record import Log
from explore3d.log.table_columns import (
    LENGTH_ROLES,
    POSITION,
    VECTORS,
    find_columns,
    label,
    length_factors,
    time_factor,
)
from explore3d.log.table_order import Order, clipped, cloud_order, profile_order, sentinels
from explore3d.log.table_settings import TableSettings, load_settings
from explore3d.log.text import LEAST_ROWS, TableText, length_factor, read_text
from mapping import BoolArray, FloatArray, IntArray, Trace, TraceError, length_text
from mapping.base import Form

NO_MARK = frozenset(("0", "false", "no", "f", "n", "invalid", "bad", "fail", ""))
# Relative doubt of a tip's radius that nobody stated: assumed, not measured, and the model says so. A trace knows
# R = r + a of a wire: 1 % of a ball of 10 mm is a third of a wire's width of 0.65 mm, which its interval then shows;
# its height does not hang on r
TIP_DOUBT = 0.01
CLOCK = re.compile(r"(?:(?P<h>\d+):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d*)?)")

Columns = dict[str, FloatArray]


def read_table(
    path: Path | str,
    *,
    units: str | dict[str, str] | None = None,
    tip_radius: str | float | None = None,
    columns: str | dict[str, str | int] | None = None,
    frame: dict[str, Any] | None = None,
    jump: str | float | None = None,
    reference: str | None = None,
    decimal: str | None = None,
    pixel: str | float | Sequence[str | float] | None = None,
) -> Log:
    """Read a CSV or TXT table of positions of the tip.

    Delimiter (; , tab, blanks), decimal comma, header, comments and stated units are found. Rows marked invalid
    (a column `valid` with 0) or without a number are left out, counted, and said in `Log.recovered`. A table of
    x, z is one sweep along x with z outward; one of x, y, z is cut into sweeps by a column `sweep`, else where
    the finger jumped. What the file does not say comes from the arguments or from a sidecar FILE.toml with the
    same names; see TableSettings.

    Args:
        path: the file.
        units: of the coordinates, e.g. "mm"; None: stated in the header.
        tip_radius: radius of the fingertip, e.g. "2 um", or in m.
        columns: e.g. "x=X, z=Y" or {"x": 1, "z": 2}.
        frame: {"origin": (3,), "rotation": (3, 3)}: object = rotation @ table + origin.
        jump: a longer step begins a new sweep; None: ten median steps.
        reference: "centre" (default) or "bottom": the point of the ball that the coordinates give.
        decimal: "." or ",", where the file leaves open what "1,234" is.
        pixel: "1 um" or ("1 um", "2 um"): the file is a map of heights, with these distances of columns and rows.

    Raises:
        UserError: one line naming the file and the field.
    """
    path = Path(path)
    settings, sidecar = load_settings(
        path,
        units=units,
        tip_radius=tip_radius,
        columns=columns,
        frame=frame,
        jump=jump,
        reference=reference,
        decimal=decimal,
        pixel=pixel,
    )
    text = read_text(path, settings.decimal)
    if settings.pixel is not None:
        return heights_log(path, text.rows, settings.pixel, "", settings, sidecar, said=text.said)
    return table_log(text, settings, sidecar)


def heights_log(
    path: Path,
    heights: FloatArray,
    pixel: tuple[float, float],
    unit: str,
    settings: TableSettings,
    sidecar: Path | None,
    said: Sequence[str] = (),
    kind: str = "a map of heights",
) -> Log:
    """The log of a map: each row is a sweep along x, the first at y = 0; one row is a profile.

    Args:
        heights: (rows, columns), in `unit`; NaN where none was measured.
        pixel: distance of the columns and of the rows, m.
        unit: that the file states for the heights; "": none, then the settings must.
        said: what was recognised.

    Raises:
        UserError: one line naming the file and the field.
    """
    if heights.ndim != 2 or heights.shape[1] < 2:
        raise UserError(f"{path}: field heights: expected rows of two heights or more; found shape {heights.shape}")
    rows, columns = heights.shape
    along, across = np.tile(np.arange(columns) * pixel[0], rows), np.repeat(np.arange(rows) * pixel[1], columns)
    table = [along, across, heights.ravel(), np.repeat(np.arange(rows, dtype=np.float64), columns)]
    names: tuple[str, ...] = ("x", "y", "z", "sweep")
    units: tuple[str, ...] = ("m", "m", unit, "")
    if rows == 1:
        table, names, units = [along, heights[0]], ("x", "z"), ("m", unit)
    size = f"a map of {columns} x {rows} heights at {length_text(pixel[0])} x {length_text(pixel[1])}"
    text = TableText(path, names, units, np.column_stack(table), said=(size, *said), kind=kind)
    asked = settings.units if isinstance(settings.units, str) else (settings.units or {}).get("z")
    return table_log(text, settings.model_copy(update={"units": {"z": asked} if asked else None}), sidecar)


def table_log(text: TableText, settings: TableSettings, sidecar: Path | None) -> Log:
    """The log of a table, wherever its columns come from.

    Raises:
        UserError: one line naming the file and the field.
    """
    path = text.path
    if settings.tip_radius is None:
        raise UserError(
            f"{path}: field tip_radius: a table does not state the radius of the fingertip; give it with "
            f'--tip-radius "2 um", or write tip_radius = "2 um" in {path.name}.toml'
        )
    roles = find_columns(text, settings.columns)
    factors = length_factors(text, roles, settings.units)
    said = list(text.said)
    rows = _with_texts(text, roles, said)
    good, dropped = _good_rows(text, rows, roles)
    whole = bool(good.all())
    values = {role: np.array(rows[:, index] if whole else rows[good, index]) for role, index in roles.items()}
    for role, factor in factors.items():
        values[role] *= factor
    if "t" in roles:
        factor, assumed = time_factor(text, roles, values["t"])
        values["t"] *= factor
        said += [assumed] * bool(assumed)
    order = _order(values, settings.jump, text, None if text.blocks is None else text.blocks[good].astype(np.int64))
    values = {role: value[order.rows] for role, value in values.items()} if _moved(order) else values
    said += [order.said] * bool(order.said) + _doubts(text, roles, values, settings)
    trace = _trace(values, settings, text, order)
    left_out = len(rows) - int(good.sum())
    return Log(
        trace=trace,
        metadata={
            "format": "profile" if "y" not in roles else "points",
            "columns": {role: text.names[index] or index + 1 for role, index in roles.items()},
            "metres_per_unit": factors,
            "rows": len(rows),
            "rows_left_out": left_out,
            "sidecar": str(sidecar) if sidecar else None,
            "settings": settings.model_dump(mode="json"),
            "read_as": [_read_as(text, roles, factors, trace, dropped, said)],
        },
        complete=not text.cut,
        recovered="; ".join([words for words, _ in dropped] + ["the last line was incomplete"] * text.cut),
        sha256=_digest(path),
        sources=(str(path),),
        tip_sd=TIP_DOUBT * settings.tip_radius if settings.tip_sd is None else settings.tip_sd,
        tip_sd_assumed=settings.tip_sd is None,
        form=Form.read(settings.form, settings.mask),
    )


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_as(
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
            unit = text.units[index] if length_factor(text.units[index]) else f"x {factors[role]:g} m"
        names.append(f"{role} = {label(text, index)} {unit}".rstrip())
    sweeps = len(np.unique(trace.sweep[np.flatnonzero(np.diff(trace.sweep, prepend=trace.sweep[0] - 1))]))
    parts = [*names, f"{len(trace)} rows in {sweeps} sweep{'s' * (sweeps != 1)}", *(short for _, short in dropped)]
    return "; ".join([", ".join(parts), *said])


def _with_texts(text: TableText, roles: dict[str, int], said: list[str]) -> FloatArray:
    """The rows with labels as numbers, marks as 0 and 1, and times of day as seconds; what cannot be is said."""
    rows = text.rows
    for role, index in list(roles.items()):
        cells = text.texts.get(index)
        if cells is None:
            continue
        if rows is text.rows:
            rows = rows.copy()
        if role == "sweep":
            names = {name: number for number, name in enumerate(dict.fromkeys(cells))}
            rows[:, index] = [names[cell] for cell in cells]
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


def _good_rows(text: TableText, rows: FloatArray, roles: dict[str, int]) -> tuple[BoolArray, list[tuple[str, str]]]:
    """Mask of the usable rows, and what is said of the others, in a clause and in few words."""
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
    if not good.any():
        raise UserError(f"{text.path}: field samples: no row is left ({'; '.join(words for words, _ in said)})")
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


def _moved(order: Order) -> bool:
    return not np.array_equal(order.rows, np.arange(len(order.rows)))


def _order(values: Columns, jump: float | None, text: TableText, blocks: IntArray | None) -> Order:
    """The rows in the order of movement, and their sweeps: the file's own, or by the way the positions went."""
    count = len(values["x"])
    rows = np.arange(count)
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
        order = profile_order(values["x"][rows])
    else:
        points = np.stack([values["x"], values.get("y", np.zeros(count)), values["z"]]).T
        points = points[rows] if said.startswith("the rows") else points
        found_order = cloud_order(points, jump)
        if found_order is None:
            raise UserError(
                f"{text.path}: field order: the rows are in no order in which a finger could have moved, and nothing "
                'says which order it was; give a column of times or of sweeps (--columns "t=..., sweep=..."), or sort'
            )
        order = found_order
    return Order(rows[order.rows], order.sweep, "; ".join(filter(None, (said, order.said))))


def _doubts(text: TableText, roles: dict[str, int], values: Columns, settings: TableSettings) -> list[str]:
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
    known = [index for index, name in enumerate(text.names) if index not in roles.values() and name]
    unused = [label(text, index) for index in known if index not in text.texts]
    if unused and "z" not in settings.columns:
        found.append(f"not used: {', '.join(unused[:6])}")
    return found


def _trace(values: Columns, settings: TableSettings, text: TableText, order: Order) -> Trace:
    radius = settings.tip_radius
    assert radius is not None
    x, z = values["x"], values["z"]
    profile = "y" not in values
    if profile and len(x) > 1 and not np.ptp(x) > 0:
        raise UserError(f"{text.path}: field x: a profile needs x that advances; found {x[0]:g} m throughout")
    if settings.reference == "bottom":
        z = z + radius
    table = np.empty((len(x), 3))
    table[:, 0], table[:, 1], table[:, 2] = x, 0.0 if profile else values["y"], z
    rotation, origin = np.array(settings.frame.rotation, dtype=np.float64), np.array(settings.frame.origin)
    moved = settings.frame != type(settings.frame)()
    vectors = {}
    for field, names in VECTORS.items():
        if names[0] in values:
            vector = np.column_stack([values[name] for name in names])
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
