"""Corner plot: the posterior of one feature, each parameter alone and every pair."""

from __future__ import annotations

import numpy as np

from explore3d.pictures.chart import Panel, drawing, text_at
from explore3d.pictures.figure import BAND, ESTIMATED, INK, MUTED
from mapping import Feature, FloatArray, Posterior, length_unit

HISTOGRAM_BINS = 24
# Shares of the draws inside the drawn contours.
LEVELS = (0.5, 0.9)
CORNER_CELL = 105.0  # px
CORNER_FONT = 9.5  # px
TITLE_HEIGHT = 26.0  # px
# Room for the names beside the first column and below the last row, and between two cells, px
CORNER_LEFT, CORNER_BELOW, CORNER_GAP = 84.0, 56.0, 6.0
# Dots of a pair beyond so many hide each other
PAIR_DOTS = 400


def corner_picture(feature: Feature) -> bytes | None:
    """SVG: histograms of the draws with their 90 % intervals, and contours of 50 and 90 % for pairs.

    None where nothing was sampled.
    """
    posterior = feature.posterior
    if posterior is None or len(posterior.samples) < 10:
        return None
    count = len(posterior.names)
    columns = [_scaled(posterior, i) for i in range(count)]
    how = "no chain needed" if posterior.status == "not needed" else f"chain {posterior.status}"
    content = text_at(8.0, 17.0, f"{feature.id}: {len(posterior.samples)} draws, {how}", bold=True)
    for i in range(count):
        for j in range(i + 1):
            panel = _alone(columns[i][0]) if i == j else _pair(columns[j][0], columns[i][0])
            left, below = (CORNER_LEFT if j == 0 else 0.0), (CORNER_BELOW if i == count - 1 else 0.0)
            panel.margins = left + CORNER_GAP, CORNER_GAP, below + CORNER_GAP
            panel.x_words = i == count - 1
            panel.x_name = columns[j][1] if i == count - 1 else ""
            if j == 0 and i > 0:
                panel.y_name = columns[i][1]
            else:
                panel.y_words = ()
            x, y = CORNER_LEFT + CORNER_CELL * j - left, TITLE_HEIGHT + CORNER_CELL * i
            content += panel.svg(x, y, CORNER_CELL + left, CORNER_CELL + below)
    side = CORNER_CELL * count
    return drawing(CORNER_LEFT + side + CORNER_GAP, TITLE_HEIGHT + side + CORNER_BELOW, content)


def _scaled(posterior: Posterior, index: int) -> tuple[FloatArray, str]:
    """Draws of a parameter in a unit that reads well, about their median where that is far from zero; and its name."""
    draws, name, unit = posterior.samples[:, index], posterior.names[index], posterior.units[index]
    if unit != "m":
        return draws, f"{name}\n({unit})" if unit else name
    middle, spread = float(np.median(draws)), float(np.ptp(draws))
    factor, short = length_unit(max(spread, np.finfo(float).tiny))
    if abs(middle) < 3.0 * spread:
        return draws / factor, f"{name}\n({short})"
    big, long = length_unit(middle)
    return (draws - middle) / factor, f"{name}\n- {middle / big:.4g} {long} ({short})"


def _cell() -> Panel:
    return Panel(x_ticks=3, y_ticks=3, x_grid=False, y_grid=False, font=CORNER_FONT)


def _alone(draws: FloatArray) -> Panel:
    panel = _cell()
    low, high = np.quantile(draws, [0.05, 0.95])
    counts, edges = np.histogram(draws, HISTOGRAM_BINS)
    panel.span(float(low), float(high), BAND)
    steps = np.concatenate([[0.0], np.repeat(counts, 2), [0.0]])
    panel.line(np.repeat(edges, 2), steps, INK, width=1.2)
    panel.upright(float(np.median(draws)), ESTIMATED)
    return panel


def _pair(x: FloatArray, y: FloatArray) -> Panel:
    panel = _cell()
    few = np.linspace(0, len(x) - 1, min(PAIR_DOTS, len(x))).astype(int)
    panel.dots(x[few], y[few], MUTED, size=1.2, opacity=0.6)
    counts, xs, ys = np.histogram2d(x, y, HISTOGRAM_BINS)
    smooth = _blurred(counts)
    order = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(order) / order.sum()
    levels = sorted({float(order[int(np.searchsorted(held, share))]) for share in LEVELS})
    middle_x, middle_y = (0.5 * (edges[1:] + edges[:-1]) for edges in (xs, ys))
    for level in levels if levels[0] > 0.0 else []:
        panel.bars(*contour(middle_x, middle_y, smooth, level), ESTIMATED, width=1.0)
    return panel


def _blurred(counts: FloatArray) -> FloatArray:
    """Counts smoothed by a binomial kernel, so that contours do not follow single draws."""
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    for axis in (0, 1):
        counts = np.apply_along_axis(np.convolve, axis, counts, kernel, "same")
    return counts


def contour(x: FloatArray, y: FloatArray, values: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Where values (len(x), len(y)) on a grid pass a level: x (S, 2) and y (S, 2) of the ends of straight pieces.

    Each cell of the grid is cut into two triangles, over which the values are linear: no case is ambiguous.
    """
    i, j = (each.ravel() for each in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij"))
    corners = [
        np.stack([np.stack([i, j]), np.stack([i + 1, j]), np.stack([i + 1, j + 1])]),
        np.stack([np.stack([i, j]), np.stack([i, j + 1]), np.stack([i + 1, j + 1])]),
    ]
    rows, columns = np.moveaxis(np.concatenate(corners, axis=2), 0, 1)  # (3, T) each: the triangles' corners
    place, height = np.stack([x[rows], y[columns]]), values[rows, columns] - level
    crossed = []
    for first, second in ((0, 1), (1, 2), (2, 0)):
        passes = (height[first] > 0) != (height[second] > 0)
        share = np.divide(height[first], height[first] - height[second], where=passes, out=np.zeros(height.shape[1]))
        point = place[:, first] + share * (place[:, second] - place[:, first])
        crossed.append(np.where(passes, point, np.nan))
    points = np.stack(crossed)  # (3 sides, 2, T): two sides are passed, or none
    through = np.isfinite(points[:, 0]).sum(axis=0) == 2
    order = np.argsort(~np.isfinite(points[:, 0, through]), axis=0, kind="stable")[:2]
    ends = np.take_along_axis(points[:, :, through], order[:, None, :], axis=0)
    return ends[:, 0].T, ends[:, 1].T
