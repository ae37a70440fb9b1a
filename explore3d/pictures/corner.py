"""Corner plot: the posterior of one feature, each parameter alone and every pair."""

from __future__ import annotations

from typing import Any

import numpy as np

from explore3d.pictures.figure import BAND, ESTIMATED, INK, new_figure, png, styled
from mapping import Feature, FloatArray, Posterior, length_unit

HISTOGRAM_BINS = 24
# Shares of the draws inside the drawn contours.
LEVELS = (0.5, 0.9)


def corner_picture(feature: Feature) -> bytes | None:
    """PNG: histograms of the draws with their 90 % intervals, and contours of 50 and 90 % for pairs.

    None where nothing was sampled.
    """
    posterior = feature.posterior
    if posterior is None or len(posterior.samples) < 10:
        return None
    count = len(posterior.names)
    columns = [_scaled(posterior, i) for i in range(count)]
    with styled():
        figure = new_figure(1.25 * count + 1.2, 1.15 * count + 0.9)
        grid = np.atleast_2d(figure.subplots(count, count, sharex="col"))
        for i in range(count):
            for j in range(count):
                axes = grid[i, j]
                axes.grid(False)
                axes.tick_params(labelsize=6, labelrotation=45)
                axes.locator_params(nbins=3)
                if j > i:
                    axes.set_visible(False)
                elif i == j:
                    _alone(axes, columns[i][0])
                else:
                    _pair(axes, columns[j][0], columns[i][0])
                if j == 0 and i > 0:
                    axes.set_ylabel(columns[i][1], fontsize=7)
                elif j > 0:
                    axes.set_yticklabels([])
                if i == count - 1:
                    axes.set_xlabel(columns[j][1], fontsize=7)
        how = "no chain needed" if posterior.status == "not needed" else f"chain {posterior.status}"
        figure.suptitle(f"{feature.id}: {len(posterior.samples)} draws, {how}", fontweight="bold", x=0.6)
        return png(figure)


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


def _alone(axes: Any, draws: FloatArray) -> None:
    low, high = np.quantile(draws, [0.05, 0.95])
    axes.axvspan(low, high, color=BAND, linewidth=0)
    axes.hist(draws, HISTOGRAM_BINS, color=INK, histtype="step", linewidth=1.0)
    axes.axvline(float(np.median(draws)), color=ESTIMATED, linewidth=1.0)
    axes.set_yticks([])


def _pair(axes: Any, x: FloatArray, y: FloatArray) -> None:
    axes.plot(x, y, ".", color=INK, markersize=1.2, alpha=0.25, markeredgewidth=0, rasterized=True)
    counts, xs, ys = np.histogram2d(x, y, HISTOGRAM_BINS)
    smooth = _blurred(counts)
    order = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(order) / order.sum()
    levels = sorted({float(order[int(np.searchsorted(held, share))]) for share in LEVELS})
    middle = [0.5 * (edges[1:] + edges[:-1]) for edges in (xs, ys)]
    if levels[0] > 0.0:
        axes.contour(*middle, smooth.T, levels, colors=ESTIMATED, linewidths=0.8)


def _blurred(counts: FloatArray) -> FloatArray:
    """Counts smoothed by a binomial kernel, so that contours do not follow single draws."""
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    for axis in (0, 1):
        counts = np.apply_along_axis(np.convolve, axis, counts, kernel, "same")
    return counts
