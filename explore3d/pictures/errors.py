"""Pictures of errors: found against true sizes, and the error while the finger's time runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from explore3d.analysis import Comparison
from explore3d.pictures.figure import ESTIMATED, INK, MUTED, TRUTH, new_figure, png, styled
from mapping import length_unit

QUANTITIES = ("height", "width", "length")


def size_picture(errors: Sequence[Comparison]) -> bytes | None:
    """PNG: each size's error with its 90 % interval, the truth at zero; None if nothing was matched."""
    rows = {name: [row for row in errors if np.isfinite(getattr(row, f"{name}_error"))] for name in QUANTITIES}
    shown = [name for name in QUANTITIES if rows[name]]
    if not shown:
        return None
    with styled():
        tallest = max(len(rows[name]) for name in shown)
        figure = new_figure(3.7 * len(shown), 1.5 + 0.32 * tallest)
        for axes, name in zip(np.atleast_1d(figure.subplots(1, len(shown))), shown, strict=True):
            _errors(axes, name, rows[name])
        return png(figure)


def _errors(axes: Any, name: str, rows: Sequence[Comparison]) -> None:
    ends = []
    for row in rows:
        interval = getattr(row.found, name)
        true = interval.median - getattr(row, f"{name}_error")
        ends.append((interval.low - true, interval.median - true, interval.high - true))
    bounds = np.array(ends)
    factor, unit = length_unit(float(np.abs(bounds[np.isfinite(bounds)]).max()))
    place = -np.arange(len(rows))
    inside = np.array([bool(getattr(row, f"{name}_inside")) for row in rows])
    for mask, face in ((inside, ESTIMATED), (~inside, "white")):
        low, middle, high = (bounds[mask, i] / factor for i in range(3))
        axes.hlines(place[mask], low, np.where(np.isfinite(high), high, middle), color=ESTIMATED, linewidth=2.2)
        axes.plot(middle, place[mask], "o", color=ESTIMATED, markerfacecolor=face, markersize=6)
    axes.axvline(0.0, color=TRUTH, linewidth=1.2)
    axes.locator_params(axis="x", nbins=5)
    axes.set_yticks(place, [row.found.id if row.found else "" for row in rows])
    axes.set_ylim(-len(rows) + 0.4, 0.6)
    axes.set_xlabel(f"found minus true ({unit})")
    axes.set_title(name.capitalize(), fontweight="bold")
    axes.grid(axis="y", visible=False)


def time_picture(curve: Sequence[tuple[float, float]], precision: float | None) -> bytes | None:
    """PNG of the worst error of an axis over the finger's time; None without two points.

    Args:
        curve: (seconds, m).
        precision: what was asked for, m, or None.
    """
    points = np.array([(t, e) for t, e in curve if np.isfinite(e)])
    if len(points) < 2:
        return None
    factor, unit = length_unit(float(np.median(points[:, 1])))
    with styled():
        figure = new_figure(7.5, 3.2)
        axes = figure.subplots()
        axes.plot(points[:, 0], points[:, 1] / factor, color=ESTIMATED, marker="o", markersize=3.5, zorder=3)
        if precision is not None:
            axes.axhline(precision / factor, color=MUTED, linestyle=(0, (4, 3)), linewidth=1.0)
            axes.annotate(
                "asked for", (0.0, precision / factor), xycoords=("axes fraction", "data"), xytext=(4, 4),
                textcoords="offset points", ha="left", fontsize=8.5, color=INK,
            )  # fmt: skip
        if points[:, 1].min() > 0 and points[:, 1].max() > 8 * points[:, 1].min():
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0.0)
        axes.set_xlabel("time of the finger (s)")
        axes.set_ylabel(f"error of the axis ({unit})")
        return png(figure)
