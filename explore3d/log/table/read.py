"""read_table: a recorded table of x, y, z or of one profile x, z becomes the Log that the analysis takes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.table.averaged import averaged
from explore3d.log.table.columns import find_columns, length_factors, time_factor
from explore3d.log.table.rows import (
    Samples,
    blocks_of,
    doubts,
    good_rows,
    is_moved,
    nothing_left,
    order_of,
    read_as,
    repeated,
    trace_of,
    with_texts,
)
from explore3d.log.table.settings import TableSettings, load_settings
from explore3d.log.text import TEXT_PIECE, TableText, read_pieces, read_text
from mapping import FloatArray, length_text
from mapping.base import Form

# Relative doubt of a tip's radius that nobody stated: assumed, not measured, and the model says so. A trace knows
# R = r + a of a wire: 1 % of a ball of 10 mm is a third of a wire's width of 0.65 mm, which its interval then shows;
# its height does not hang on r
TIP_DOUBT = 0.01


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
    average: int | None = None,
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
        pixel: "1 um" or ("1 um", "2 um"): the file is a map of heights, with these distances of columns and rows; one
            column or one row of heights is a profile.
        average: runs of so many rows become one sample each, their mean; the file is read in pieces (see `averaged`).

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
        average=average,
    )
    if settings.average is not None and settings.pixel is None:
        _must_know_the_tip(path, settings)
        share = min(1.0, TEXT_PIECE / path.stat().st_size) if path.is_file() else 1.0
        return _log(averaged(read_pieces(path, settings.decimal), settings, share), settings, sidecar)
    if settings.pixel is not None:
        text = read_text(path, settings.decimal, least=1)
        unit = text.units[0] if len(set(text.units)) == 1 else ""
        heights = text.rows.T if text.rows.shape[1] == 1 else text.rows  # one column is one profile
        return heights_log(path, heights, settings.pixel, unit, settings, sidecar, said=text.said)
    text = read_text(path, settings.decimal)
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
    if rows == 1:
        size = f"a profile of {columns} heights at {length_text(pixel[0])}"
    text = TableText(path, names, units, np.column_stack(table), said=(size, *said), kind=kind)
    asked = settings.units if isinstance(settings.units, str) else (settings.units or {}).get("z")
    return table_log(text, settings.model_copy(update={"units": {"z": asked} if asked else None}), sidecar)


def table_log(text: TableText, settings: TableSettings, sidecar: Path | None) -> Log:
    """The log of a table, wherever its columns come from.

    Raises:
        UserError: one line naming the file and the field.
    """
    _must_know_the_tip(text.path, settings)
    if settings.average is not None:
        return _log(averaged([text], settings), settings, sidecar)
    roles = find_columns(text, settings.columns)
    factors = length_factors(text, roles, settings.units)
    said = list(text.said)
    rows = with_texts(text, roles, said)
    good, dropped = good_rows(text, rows, roles)
    if not good.any():
        raise nothing_left(text.path, dropped)
    whole = bool(good.all())
    values = {role: np.array(rows[:, index] if whole else rows[good, index]) for role, index in roles.items()}
    for role, factor in factors.items():
        values[role] *= factor
    if "t" in roles:
        factor, assumed = time_factor(text, roles, values["t"])
        values["t"] *= factor
        said += [assumed] * bool(assumed)
    order = order_of(values, settings.jump, text, blocks_of(text, good))
    values = {role: value[order.rows] for role, value in values.items()} if is_moved(order) else values
    said += [order.said] * bool(order.said)
    again = repeated(values, order.sweep)
    if again.any():
        count = int(again.sum())
        words = f"{count} of {len(rows)} rows repeat the one before and are left out"
        dropped.append((words, f"{count} left out: they repeat the one before"))
        values = {role: value[~again] for role, value in values.items()}
        order = replace(order, sweep=order.sweep[~again])
    said += doubts(text, roles, values, settings)
    left_out = len(rows) - len(order.sweep)
    samples = Samples(
        text, roles, factors, values, order, len(rows), left_out, dropped, said, repeated=int(again.sum())
    )
    return _log(samples, settings, sidecar)


def _must_know_the_tip(path: Path, settings: TableSettings) -> None:
    if settings.tip_radius is None:
        raise UserError(
            f"{path}: field tip_radius: a table does not state the radius of the fingertip; give it with "
            f'--tip-radius "2 um", or write tip_radius = "2 um" in {path.name}.toml'
        )


def _log(found: Samples, settings: TableSettings, sidecar: Path | None) -> Log:
    text, roles, path = found.text, found.roles, found.text.path
    assert settings.tip_radius is not None
    trace = trace_of(found.values, settings, text, found.order)
    about = {} if found.average is None else {"average": found.average}
    return Log(
        trace=trace,
        metadata={
            "format": "profile" if "y" not in roles else "points",
            "columns": {role: text.names[index] or index + 1 for role, index in roles.items()},
            "metres_per_unit": found.factors,
            "rows": found.rows,
            "rows_left_out": found.left_out,
            "rows_repeated": found.repeated,
            "sidecar": str(sidecar) if sidecar else None,
            "settings": settings.model_dump(mode="json"),
            "read_as": [read_as(text, roles, found.factors, trace, found.dropped, found.said)],
        }
        | about,
        complete=not found.cut,
        recovered="; ".join([words for words, _ in found.dropped] + ["the last line was incomplete"] * found.cut),
        sha256=_digest(path),
        sources=(str(path),),
        tip_sd=TIP_DOUBT * settings.tip_radius if settings.tip_sd is None else settings.tip_sd,
        tip_sd_assumed=settings.tip_sd is None,
        form=Form.read(settings.form, settings.mask),
        tolerances=tuple(each.tolerance() for each in settings.tolerance) or None,
        in_contact=settings.in_contact,
        timed="t" in roles,
    )


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
