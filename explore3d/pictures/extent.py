"""Picture of extents: each axis seen from above with its 90 % band, and its ends with theirs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.pictures.chart import DASHED, Panel, sheet
from explore3d.pictures.figure import BAND, ESTIMATED, INK, TRUTH
from mapping import Feature, FloatArray, length_text, length_unit

EXTENTS_PER_ROW = 2
EXTENT_SIZE = (530.0, 250.0)  # of a panel, px
NORMAL_QUANTILE_95 = 1.6448536


def extent_picture(features: Sequence[Feature], truths: Sequence[FloatArray | None]) -> bytes | None:
    """SVG with one panel for each feature along a curve: place along its chord, and across it, not to one scale.

    Args:
        features: those to show; bumps and pits have no extent and are left out.
        truths: true axis (K, 3) of each, or None.
    """
    pairs = [(f, t) for f, t in zip(features, truths, strict=True) if len(f.axis) > 1 and f.details.axis_sd is not None]
    if not pairs:
        return None
    columns = min(EXTENTS_PER_ROW, len(pairs))
    width, height = EXTENT_SIZE
    return sheet([_panel(*each) for each in pairs], columns * width, height, columns, legend=True)


def _panel(feature: Feature, true: FloatArray | None) -> Panel:
    """The axis in a plane: along the chord between its ends (a ring: its first diameter), and across."""
    along, across, origin = _plane(feature)
    x, y = (feature.axis - origin) @ along, (feature.axis - origin) @ across
    sd = feature.details.axis_sd
    if sd is None or len(sd) != len(x):
        sd = np.full(len(x), feature.position_sd)
    tangent = np.gradient(np.column_stack([x, y]), axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), np.finfo(float).tiny)
    side = NORMAL_QUANTILE_95 * sd[:, None] * tangent[:, ::-1] * [-1.0, 1.0]
    x_factor, x_name = length_unit(float(np.abs(x).max()))
    spread = [y, y + side[:, 1], y - side[:, 1]]
    if true is not None:
        spread.append((true - origin) @ across)
    y_factor, y_name = length_unit(float(np.max([np.abs(each).max() for each in spread])))
    band = np.concatenate([np.column_stack([x, y]) + side, (np.column_stack([x, y]) - side)[::-1]])
    panel = Panel(f"{feature.id}: {_worst(feature, sd)}", f"along ({x_name})", f"across ({y_name})", y_ticks=5)
    panel.area(band[:, 0] / x_factor, band[:, 1] / y_factor, BAND, name="axis, 90 %")
    panel.line(x / x_factor, y / y_factor, ESTIMATED, name="axis, median")
    if true is not None:
        place = (true - origin) @ along, (true - origin) @ across
        panel.line(place[0] / x_factor, place[1] / y_factor, TRUTH, dash=DASHED, name="truth")
    for end, direction in ((0, -1.0), (-1, 1.0)):
        _end(panel, feature, end, direction, (x[end] / x_factor, y[end] / y_factor), x_factor)
    return panel


def _end(panel: Panel, feature: Feature, end: int, direction: float, place: tuple[float, float], factor: float) -> None:
    """A bar for an end that was seen; an arrow for one that goes on beyond what was explored."""
    intervals, seen = feature.details.end_intervals, feature.details.ends_seen
    if feature.closed:
        return
    x, y = place
    if intervals is None or seen is None or not seen[end]:
        panel.marks([x], [y], ESTIMATED, ">" if direction > 0 else "<", size=10.0, clipped=False)
        return
    low, high = (x + direction * value / factor for value in intervals[end])
    panel.bars([[min(low, x), max(high, x)]], [[y, y]], INK, width=1.8)
    panel.marks([low, x, high], [y, y, y], INK, "o", size=4.0)


def _plane(feature: Feature) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors along and across, and the origin."""
    axis = feature.axis
    far = axis[len(axis) // 2] if feature.closed else axis[-1]
    along = far - axis[0]
    if not np.any(along):
        along = axis[1] - axis[0]
    along = along / np.linalg.norm(along)
    up = feature.normals.mean(axis=0)
    across = np.cross(up, along)
    return along, across / max(float(np.linalg.norm(across)), np.finfo(float).tiny), axis[0]


def _worst(feature: Feature, sd: FloatArray) -> str:
    widest = length_text(NORMAL_QUANTILE_95 * float(sd.max()), 2)
    return f"{feature.length.text()[0]} long, known across to ±{widest} at its worst"
