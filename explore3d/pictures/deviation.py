"""Deviation map: by how much the body departs from the model that was given of it."""

from __future__ import annotations

import numpy as np

from explore3d.pictures.figure import png, styled
from explore3d.pictures.object import SUPERSAMPLING, cameras_for, panels_for, view_directions
from explore3d.pictures.raycast import Body, render
from mapping import FloatArray, Surface, length_unit

DEVIATION_COLOURMAP = "RdBu_r"


def deviation_picture(surface: Surface, deviation: FloatArray) -> bytes:
    """PNG of the body with the departure of each vertex from the given model: red stands out, blue lies under it.

    Args:
        surface: the corrected model.
        deviation: (V,) at its vertices, m.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    areas = surface.face_areas[:, None]
    cameras = cameras_for(surface.vertices, view_directions(surface.face_normals * areas / areas.mean(), ()))
    largest = float(np.abs(deviation).max()) or 1.0
    factor, unit = length_unit(largest)
    norm = Normalize(-largest / factor, largest / factor)
    colours = colormaps[DEVIATION_COLOURMAP](norm(deviation / factor))[:, :3]
    with styled():
        figure, panels = panels_for(cameras, room=0.6)
        for axes, camera in panels:
            axes.imshow(render([Body(surface, colours)], camera).reduced(SUPERSAMPLING), interpolation="none")
        bar = figure.colorbar(
            ScalarMappable(norm, DEVIATION_COLOURMAP), ax=[axes for axes, _ in panels], shrink=0.75, aspect=28, pad=0.01
        )
        bar.set_label(f"body over its model ({unit})")
        bar.outline.set_visible(False)
        return png(figure)
