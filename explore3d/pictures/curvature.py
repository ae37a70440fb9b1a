"""Curvature maps: the two principal curvatures of the estimated surface, seen from above it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from explore3d.pictures.figure import png, styled
from explore3d.pictures.object import SUPERSAMPLING, cameras_for, panels_for, view_directions
from explore3d.pictures.raycast import Body, render
from mapping import BoolArray, FloatArray, Surface

if TYPE_CHECKING:
    from mapping.geometry.curvature import Curvature

# Values within so many standard deviations of zero are drawn flat: their colour would be noise.
SIGNIFICANT = 3.0
FLAT_COLOUR = np.array([0.93, 0.93, 0.93])
NOT_VALID = np.array([0.75, 0.75, 0.75])
CURVATURE_COLOURMAP = "RdBu_r"


def curvature_picture(surface: Surface, curvature: Curvature, tip_radius: float) -> bytes:
    """PNG of k1 and k2 in units of 1/r: red bulges out, blue bends in; pale where
    the value is within three standard deviations of zero, grey where none is valid.

    Args:
        surface: the estimated surface.
        curvature: at its vertices.
        tip_radius: r, m.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    areas = surface.face_areas[:, None]
    direction = view_directions(surface.face_normals * areas / areas.mean(), ())[0]
    cameras = cameras_for(surface.vertices, [direction, direction])
    scaled = [np.asarray(values) * tip_radius for values in (curvature.k1, curvature.k2)]
    norm = Normalize(*_span(scaled, curvature.valid))
    with styled():
        figure, panels = panels_for(cameras, room=0.6)
        for (axes, camera), values, name in zip(panels, scaled, ("larger, k₁", "smaller, k₂"), strict=True):
            colours = colormaps[CURVATURE_COLOURMAP](norm(values))[:, :3]
            colours[np.abs(values) < SIGNIFICANT * curvature.sd * tip_radius] = FLAT_COLOUR
            colours[~curvature.valid] = NOT_VALID
            axes.imshow(render([Body(surface, colours)], camera).reduced(SUPERSAMPLING), interpolation="none")
            axes.set_title(f"Principal curvature, {name}", fontweight="bold")
        bar = figure.colorbar(
            ScalarMappable(norm, CURVATURE_COLOURMAP), ax=[axes for axes, _ in panels], shrink=0.75, aspect=28, pad=0.01
        )
        bar.set_label("curvature × tip radius")
        bar.outline.set_visible(False)
        return png(figure)


def _span(values: list[FloatArray], valid: BoolArray) -> tuple[float, float]:
    """A symmetric range that 99 % of the values fit in, at most twice the tip's own curvature."""
    known = np.concatenate([each[valid] for each in values])
    known = known[np.isfinite(known)]
    top = min(2.0, float(np.quantile(np.abs(known), 0.99))) if len(known) else 1.0
    return -max(top, 1e-9), max(top, 1e-9)
