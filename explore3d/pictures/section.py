"""Picture of cross-sections: traced against estimated profiles across each feature."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.pictures.chart import DASHED, DOTTED, Panel, sheet
from explore3d.pictures.cross_section import CrossSection
from explore3d.pictures.figure import BAND, ESTIMATED, INK, MUTED, TRACED, TRUTH
from mapping import FloatArray, length_unit

SECTIONS_PER_ROW = 3
SECTIONS_WIDTH = {1: 720.0, 2: 910.0, 3: 1060.0}  # px, for so many panels beside one another
SECTION_HEIGHT = 300.0  # px
# Dots beyond so many hide each other.
DOTS = 1500
# Points of the body further apart than this share of the panel are not joined.
GAP = 0.15


def section_picture(sections: Sequence[CrossSection], truths: Sequence[float | None]) -> bytes:
    """SVG with one panel per section.

    Args:
        sections: at least one.
        truths: true height of each feature, m, or None.
    """
    columns = min(SECTIONS_PER_ROW, len(sections))
    panels = [_panel(section, true) for section, true in zip(sections, truths, strict=True)]
    return sheet(panels, SECTIONS_WIDTH[columns], SECTION_HEIGHT, columns, legend=True)


def _panel(section: CrossSection, true: float | None) -> Panel:
    x_factor, x_name = length_unit(float(np.abs(section.x).max()))
    fitted = not section.feature.details.free_section
    shown = np.concatenate([section.predicted[: len(section.predicted) * fitted], section.bin_height])
    z_factor, z_name = length_unit(float(np.abs(shown).max()))
    dots = np.linspace(0, len(section.x) - 1, min(DOTS, len(section.x))).astype(int)
    few = len(section.x) <= 150
    panel = Panel(
        title=f"{section.feature.id}, sweep {section.sweep}",
        x_name=f"{'across the feature' if section.across else 'along the sweep'} ({x_name})",
        y_name=f"height over the base ({z_name})",
        y_limits=_limits(section, shown, z_factor, few),
    )
    panel.level(0.0, MUTED, width=0.8)
    panel.dots(
        section.x[dots] / x_factor, section.height[dots] / z_factor, TRACED, size=4.0 if few else 1.8,
        opacity=0.9 if few else 0.55, name="trace, every sample",
    )  # fmt: skip
    grid = section.grid / x_factor
    band = np.concatenate([section.low, section.high[::-1]]) / z_factor
    if fitted:
        panel.area(np.concatenate([grid, grid[::-1]]), band, BAND)
    if true is not None:
        panel.level(true / z_factor, TRUTH, dash=DASHED, name="true height")
    if not few:
        x, z, sd = section.bin_x / x_factor, section.bin_height / z_factor, 1.645 * section.bin_sd / z_factor
        panel.bars(np.column_stack([x, x]), np.column_stack([z - sd, z + sd]), "#486581", width=1.2)
        panel.dots(x, z, "#486581", size=3.6, name="trace, means with 90 %")
    if fitted:
        panel.line(grid, section.predicted / z_factor, ESTIMATED, name="trace of the feature found")
    if len(section.body_x):
        _body(panel, section, x_factor, z_factor)
    return panel


def _body(panel: Panel, section: CrossSection, x_factor: float, z_factor: float) -> None:
    """The estimated surface: solid where it was touched, dotted where the tip bridged it."""
    # Nothing is known between points far apart: the line is broken there.
    gaps = np.flatnonzero(np.diff(section.body_x) > GAP * np.ptp(section.x)) + 1
    x = np.insert(section.body_x, gaps, np.nan) / x_factor
    z = np.insert(section.body_z, gaps, np.nan) / z_factor
    hidden = np.insert(section.bridged, gaps, False)
    touched = np.where(hidden, np.nan, z)
    # A bridge is drawn up to the touched points that carry it.
    near = hidden | np.roll(hidden, 1) | np.roll(hidden, -1)
    panel.line(x, touched, INK, width=1.7, name="estimated surface")
    panel.dots(x, touched, INK, size=4.0)
    if hidden.any():
        panel.line(x, np.where(near, z, np.nan), INK, width=1.5, dash=DOTTED, name="bridged, not touched")


def _limits(section: CrossSection, shown: FloatArray, factor: float, few: bool) -> tuple[float, float] | None:
    """Room for the curves and most of the samples: single wild samples do not squeeze the picture."""
    low, high = np.quantile(section.height, [0.0, 1.0] if few else [0.01, 0.99])
    low, high = min(float(low), float(shown.min())), max(float(high), float(shown.max()))
    margin = 0.12 * (high - low)
    return ((low - margin) / factor, (high + margin) / factor) if high > low else None
