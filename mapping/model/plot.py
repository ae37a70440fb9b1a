"""A model drawn with matplotlib, for notebooks: the base and its features, each in its kind's colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mapping import Feature, Surface, length_unit
from mapping.geometry.mesh import middle
from mapping.inference.kinds import kind_of
from mapping.model.feature_mesh import drawn_at_least, feature_mesh

# Features are drawn at least this share of the base's size wide, else no eye finds them
PLOTTED_SHARE = 0.006
# matplotlib sorts and draws every face by itself: beyond so many only every n-th is drawn, as a veil
MOST_PLOTTED_FACES = 4000


def plot_model(base: Surface, features: Sequence[Feature], axes: Any = None) -> Any:
    """Draw a base and features; arguments and result as for ObjectModel.plot."""
    if axes is None:
        import matplotlib.pyplot as plt

        axes = plt.figure(figsize=(7.0, 6.0)).add_subplot(projection="3d", computed_zorder=False)
    factor, unit = length_unit(0.3 * base.size)
    faces = base.faces[:: -(-len(base.faces) // MOST_PLOTTED_FACES)]
    axes.plot_trisurf(*(base.vertices / factor).T, triangles=faces, color="#dfe4ea", alpha=0.35, zorder=1)
    for feature in features:
        mesh = feature_mesh(drawn_at_least(feature, PLOTTED_SHARE * base.size))
        axes.plot_trisurf(*(mesh.vertices / factor).T, triangles=mesh.faces, color=kind_of(feature).colour, zorder=2)
        axes.text(*(middle(feature.axis)[0] / factor), f"  {feature.id}", zorder=3)
    low, high = base.bounds / factor
    half = 0.5 * float(np.max(high - low))
    for name, centre in zip("xyz", 0.5 * (low + high), strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"set_{name}label")(f"{name} ({unit})")
    axes.set_box_aspect((1, 1, 1))
    return axes
