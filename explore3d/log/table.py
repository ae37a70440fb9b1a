"""read_table: a recorded table of x, y, z or of one profile x, z becomes the Log that the analysis takes."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.record import Log
from explore3d.log.table_columns import LENGTH_ROLES, VECTORS, find_columns, length_factors, time_factor
from explore3d.log.table_settings import TableSettings, load_settings
from explore3d.log.table_text import TableText, read_text
from mapping import BoolArray, FloatArray, IntArray, Trace, TraceError

JUMP = 10.0  # median steps: noise alone never makes a step so long, a lifted finger nearly always does

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

    Raises:
        UserError: one line naming the file and the field.
    """
    path = Path(path)
    text = read_text(path)
    settings, sidecar = load_settings(
        path, units=units, tip_radius=tip_radius, columns=columns, frame=frame, jump=jump, reference=reference
    )
    if settings.tip_radius is None:
        raise UserError(
            f"{path}: field tip_radius: a table does not state the radius of the fingertip; give it with "
            f'--tip-radius "2 um", or write tip_radius = "2 um" in {path.name}.toml'
        )
    roles = find_columns(text, settings.columns)
    factors = length_factors(text, roles, settings.units)
    good, dropped = _good_rows(text, roles)
    values = {role: text.rows[good, index] for role, index in roles.items()}
    for role, factor in factors.items():
        values[role] *= factor
    if "t" in roles:
        values["t"] *= time_factor(text, roles)
    return Log(
        trace=_trace(values, settings, text),
        metadata={
            "format": "profile" if "y" not in roles else "points",
            "columns": {role: text.names[index] or index + 1 for role, index in roles.items()},
            "metres_per_unit": factors,
            "rows": len(text.rows),
            "rows_left_out": len(text.rows) - int(good.sum()),
            "sidecar": str(sidecar) if sidecar else None,
            "settings": settings.model_dump(mode="json"),
        },
        complete=not text.cut,
        recovered="; ".join(dropped + (["the last line was incomplete"] if text.cut else [])),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        sources=(str(path),),
    )


def _good_rows(text: TableText, roles: dict[str, int]) -> tuple[BoolArray, list[str]]:
    """Mask of the usable rows, and what is said of the others."""
    used = [index for role, index in roles.items() if role != "valid"]
    finite: BoolArray = np.all(np.isfinite(text.rows[:, used]), axis=1)
    valid: BoolArray = np.ones(len(text.rows), dtype=np.bool_)
    if "valid" in roles:
        mark = text.rows[:, roles["valid"]]
        valid = np.isfinite(mark) & (mark != 0)
    said = []
    if not valid.all():
        said.append(f"{int((~valid).sum())} of {len(valid)} rows are marked invalid and left out")
    if not finite[valid].all():
        said.append(f"{int((~finite & valid).sum())} of {len(valid)} rows lack a number and are left out")
    if not (valid & finite).any():
        raise UserError(f"{text.path}: field samples: no row is left ({'; '.join(said)})")
    return valid & finite, said


def _trace(values: Columns, settings: TableSettings, text: TableText) -> Trace:
    radius = settings.tip_radius
    assert radius is not None
    x, z = values["x"], values["z"]
    profile = "y" not in values
    if profile and len(x) > 1 and not np.ptp(x) > 0:
        raise UserError(f"{text.path}: field x: a profile needs x that advances; found {x[0]:g} m throughout")
    if settings.reference == "bottom":
        z = z + radius
    table = np.column_stack([x, np.zeros_like(x) if profile else values["y"], z])
    rotation, origin = np.array(settings.frame.rotation, dtype=np.float64), np.array(settings.frame.origin)
    moved = settings.frame != type(settings.frame)()
    vectors = {}
    for field, names in VECTORS.items():
        if names[0] in values:
            vector = np.column_stack([values[name] for name in names])
            vectors[field] = vector @ rotation.T + (origin if names[0] in LENGTH_ROLES else 0.0) if moved else vector
    t = values["t"] if "t" in values else np.arange(len(x), dtype=np.float64)
    centers = table @ rotation.T + origin if moved else table
    try:
        sweep = _sweeps(values, table, settings.jump, text)
        return Trace(t, centers, sweep, radius, vectors.get("normals"), vectors.get("contacts"), vectors.get("force"))
    except TraceError as error:
        raise UserError(f"{text.path}: {error}") from error


def _sweeps(values: Columns, points: FloatArray, jump: float | None, text: TableText) -> IntArray:
    """(N,) number of the sweep: the file's own, one for a profile, else counted up at each jump."""
    if "sweep" in values:
        numbers = values["sweep"]
        if not (numbers == np.rint(numbers)).all():
            raise UserError(f"{text.path}: field sweep: must be whole numbers; found {numbers[numbers % 1 != 0][0]:g}")
        return numbers.astype(np.int64)
    if "y" not in values and jump is None:
        return np.zeros(len(points), dtype=np.int64)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moving = steps[steps > 0]
    limit = jump if jump is not None else JUMP * float(np.median(moving)) if len(moving) else np.inf
    return np.concatenate([[0], np.cumsum(steps > limit)]).astype(np.int64)
