"""Pictures of errors: found against true sizes, and the error while the finger's time runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.analysis import Comparison
from explore3d.pictures.chart import DASHED, Panel, sheet
from explore3d.pictures.figure import ESTIMATED, MUTED, TRUTH
from mapping import length_unit

QUANTITIES = ("height", "width", "length")
SIZES_WIDTH = 355.0  # of a panel, px
ROW = 31.0  # of one feature, px
TIME_SIZE = (720.0, 310.0)  # px


def size_picture(errors: Sequence[Comparison]) -> bytes | None:
    """SVG: each size's error with its 90 % interval, the truth at zero; None if nothing was matched."""
    rows = {name: [row for row in errors if np.isfinite(getattr(row, f"{name}_error"))] for name in QUANTITIES}
    shown = [name for name in QUANTITIES if rows[name]]
    if not shown:
        return None
    tallest = max(len(rows[name]) for name in shown)
    panels = [_errors(name, rows[name]) for name in shown]
    return sheet(panels, SIZES_WIDTH * len(shown), 110.0 + ROW * tallest, len(shown))


def _errors(name: str, rows: Sequence[Comparison]) -> Panel:
    ends = []
    for row in rows:
        interval = getattr(row.found, name)
        true = interval.median - getattr(row, f"{name}_error")
        ends.append((interval.low - true, interval.median - true, interval.high - true))
    bounds = np.array(ends)
    factor, unit = length_unit(float(np.abs(bounds[np.isfinite(bounds)]).max()))
    place = -np.arange(float(len(rows)))
    panel = Panel(
        name.capitalize(),
        f"found minus true ({unit})",
        x_ticks=4,
        y_limits=(-len(rows) + 0.4, 0.6),
        y_words=[(y, row.found.id if row.found else "") for y, row in zip(place.tolist(), rows, strict=True)],
        y_grid=False,
    )
    panel.upright(0.0, TRUTH, width=1.6)
    inside = np.array([bool(getattr(row, f"{name}_inside")) for row in rows])
    for mask, filled in ((inside, True), (~inside, False)):
        low, middle, high = (bounds[mask, i] / factor for i in range(3))
        ends_x = np.column_stack([low, np.where(np.isfinite(high), high, middle)])
        panel.bars(ends_x, np.column_stack([place[mask], place[mask]]), ESTIMATED, width=2.9)
        panel.marks(middle, place[mask], ESTIMATED, "o", filled=filled)
    return panel


def time_picture(curve: Sequence[tuple[float, float]], precision: float | None) -> bytes | None:
    """SVG of the worst error of an axis over the finger's time; None without two points.

    Args:
        curve: (seconds, m).
        precision: what was asked for, m, or None.
    """
    points = np.array([(t, e) for t, e in curve if np.isfinite(e)])
    if len(points) < 2:
        return None
    factor, unit = length_unit(float(np.median(points[:, 1])))
    panel = Panel(x_name="time of the finger (s)", y_name=f"error of the axis ({unit})")
    panel.log_y = bool(points[:, 1].min() > 0 and points[:, 1].max() > 8 * points[:, 1].min())
    if precision is not None:
        panel.level(precision / factor, MUTED, dash=DASHED)
        panel.words(-np.inf, precision / factor, "asked for", dx=5.0, dy=-5.0)
    panel.line(points[:, 0], points[:, 1] / factor, ESTIMATED)
    panel.marks(points[:, 0], points[:, 1] / factor, ESTIMATED, "o", size=5.0)
    if not panel.log_y:
        panel.y_limits = (0.0, panel.limits()[1][1])
    return sheet([panel], *TIME_SIZE)
