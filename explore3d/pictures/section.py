"""Picture of cross-sections: traced against estimated profiles across each feature."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from explore3d.pictures.cross_section import CrossSection
from explore3d.pictures.figure import BAND, ESTIMATED, INK, MUTED, TRACED, TRUTH, new_figure, png, styled
from mapping import FloatArray, length_unit

SECTIONS_PER_ROW = 3
# Dots beyond so many hide each other.
DOTS = 1500
# Points of the body further apart than this share of the panel are not joined.
GAP = 0.15


def section_picture(sections: Sequence[CrossSection], truths: Sequence[float | None]) -> bytes:
    """PNG with one panel per section.

    Args:
        sections: at least one.
        truths: true height of each feature, m, or None.
    """
    columns = min(SECTIONS_PER_ROW, len(sections))
    rows = -(-len(sections) // columns)
    with styled():
        figure = new_figure({1: 7.5, 2: 9.5, 3: 11.0}[columns], 3.1 * rows + 0.5)
        grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        for axes, section, true in zip(grid, sections, truths, strict=False):
            _panel(axes, section, true)
        for axes in grid[len(sections) :]:
            axes.set_visible(False)
        entries = [axes.get_legend_handles_labels() for axes in grid[: len(sections)]]
        names = {label: handle for handles, labels in entries for handle, label in zip(handles, labels, strict=True)}
        figure.legend(names.values(), names.keys(), loc="outside upper left", ncols=3, markerscale=1.6)
        return png(figure)


def _panel(axes: Any, section: CrossSection, true: float | None) -> None:
    x_factor, x_name = length_unit(float(np.abs(section.x).max()))
    shown = np.concatenate([section.predicted, section.bin_height])
    z_factor, z_name = length_unit(float(np.abs(shown).max()))
    dots = np.linspace(0, len(section.x) - 1, min(DOTS, len(section.x))).astype(int)
    few = len(section.x) <= 150
    axes.plot(
        section.x[dots] / x_factor, section.height[dots] / z_factor, ".", color=TRACED, markersize=6 if few else 2.5,
        alpha=0.9 if few else 0.45, markeredgewidth=0, zorder=1, label="trace, every sample", rasterized=True,
    )  # fmt: skip
    if not few:
        axes.errorbar(
            section.bin_x / x_factor, section.bin_height / z_factor, 1.645 * section.bin_sd / z_factor, fmt="o",
            color="#486581", markersize=2.6, elinewidth=0.9, zorder=3, label="trace, means with 90 %",
        )  # fmt: skip
    axes.fill_between(
        section.grid / x_factor, section.low / z_factor, section.high / z_factor, color=BAND, linewidth=0, zorder=2
    )
    curve = section.predicted / z_factor
    axes.plot(section.grid / x_factor, curve, color=ESTIMATED, zorder=4, label="trace of the feature found")
    if len(section.body_x):
        _body(axes, section, x_factor, z_factor)
    if true is not None:
        axes.axhline(true / z_factor, color=TRUTH, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2, label="true height")
    axes.axhline(0.0, color=MUTED, linewidth=0.6, zorder=0)
    _limits(axes, section, shown, z_factor, few)
    axes.set_title(f"{section.feature.id}, sweep {section.sweep}", fontweight="bold")
    axes.set_xlabel(f"{'across the feature' if section.across else 'along the sweep'} ({x_name})")
    axes.set_ylabel(f"height over the base ({z_name})")


def _body(axes: Any, section: CrossSection, x_factor: float, z_factor: float) -> None:
    """The estimated surface: solid where it was touched, dotted where the tip bridged it."""
    # Nothing is known between points far apart: the line is broken there.
    gaps = np.flatnonzero(np.diff(section.body_x) > GAP * np.ptp(section.x)) + 1
    x = np.insert(section.body_x, gaps, np.nan) / x_factor
    z = np.insert(section.body_z, gaps, np.nan) / z_factor
    hidden = np.insert(section.bridged, gaps, False)
    touched = np.where(hidden, np.nan, z)
    # A bridge is drawn up to the touched points that carry it.
    near = hidden | np.roll(hidden, 1) | np.roll(hidden, -1)
    bridged = np.where(near, z, np.nan)
    axes.plot(x, touched, ".-", markersize=3.5, color=INK, linewidth=1.3, zorder=5, label="estimated surface")
    if hidden.any():
        axes.plot(x, bridged, color=INK, linewidth=1.1, linestyle=(0, (1, 1.6)), zorder=5, label="bridged, not touched")


def _limits(axes: Any, section: CrossSection, shown: FloatArray, factor: float, few: bool) -> None:
    """Room for the curves and most of the samples: single wild samples do not squeeze the picture."""
    low, high = np.quantile(section.height, [0.0, 1.0] if few else [0.01, 0.99])
    low, high = min(float(low), float(shown.min())), max(float(high), float(shown.max()))
    margin = 0.12 * (high - low)
    if high > low:
        axes.set_ylim((low - margin) / factor, (high + margin) / factor)
