"""Picture of extents: each line laid out straight with its 90 % band, and its ends with theirs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.pictures.chart import DASHED, Panel, sheet
from explore3d.pictures.figure import BAND, ESTIMATED, INK, TRUTH
from mapping import Feature, FloatArray, length_text, length_unit
from mapping.geometry.mesh import arclengths, directions, nearest_on

EXTENTS_PER_ROW = 2
EXTENT_SIZE = (530.0, 250.0)  # of a panel, px
NORMAL_QUANTILE_95 = 1.6448536


def extent_picture(features: Sequence[Feature], truths: Sequence[FloatArray | None]) -> bytes | None:
    """SVG with one panel for each feature along a curve: place along it, and beside it, not to one scale.

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
    """The line laid out straight: place along it, and how far the truth and the band lie beside it on the surface."""
    s, sd = arclengths(feature.axis), feature.details.axis_sd
    if sd is None or len(sd) != len(s):
        sd = np.full(len(s), feature.position_sd)
    side, straight = NORMAL_QUANTILE_95 * sd, np.zeros(len(s))
    place = None if true is None else _beside(feature, true)
    x_factor, x_name = length_unit(float(s[-1]))
    y_factor, y_name = length_unit(max(float(side.max()), 0.0 if place is None else float(np.abs(place[1]).max())))
    panel = Panel(f"{feature.id}: {_worst(feature, sd)}", f"along it ({x_name})", f"beside it ({y_name})", y_ticks=5)
    band = np.concatenate([side, -side[::-1]])
    panel.area(np.concatenate([s, s[::-1]]) / x_factor, band / y_factor, BAND, name="axis, 90 %")
    panel.line(s / x_factor, straight, ESTIMATED, name="axis, median")
    if place is not None:
        panel.line(place[0] / x_factor, place[1] / y_factor, TRUTH, dash=DASHED, name="truth")
    for end, direction in ((0, -1.0), (-1, 1.0)):
        _end(panel, feature, end, direction, (s[end] / x_factor, 0.0), x_factor)
    return panel


def _beside(feature: Feature, true: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the points (K, 3) of another line lie along the feature's, and beside it on the surface, to the left, m.

    Beyond an end the line goes straight on.
    """
    axis, way = feature.axis, directions(feature.axis)
    on, s = nearest_on(true, axis)
    near = np.linalg.norm(axis[:, None] - on, axis=2).argmin(axis=0)
    away, along = true - on, way[near]
    ahead = np.einsum("ij,ij->i", away, along)
    left = np.einsum("ij,ij->i", away, np.cross(feature.normals[near], along))
    beyond = np.zeros(len(s), dtype=bool) if feature.closed else (s == 0.0) | (s == arclengths(axis)[-1])
    s = np.where(beyond, s + ahead, s)
    order = np.argsort(s, kind="stable")
    return s[order], left[order]


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


def _worst(feature: Feature, sd: FloatArray) -> str:
    widest = length_text(NORMAL_QUANTILE_95 * float(sd.max()), 2)
    return f"{feature.length.text()[0]} long, ±{widest} across at worst"
