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


def plot_profile(features: Sequence[Feature], axes: Any = None) -> Any:
    """Draw the features of a profile, as ObjectModel.plot: height over place, with 90 % intervals and widths."""
    if axes is None:
        import matplotlib.pyplot as plt

        _, axes = plt.subplots(figsize=(7.0, 3.5), layout="constrained")
    place = np.array([feature.axis[0, 0] for feature in features])
    factor, unit = length_unit(float(np.ptp(place)) or float(np.abs(place).max(initial=0.0)) or 1.0)
    tallest = max((abs(feature.height.median) for feature in features), default=1.0)
    scale, name = length_unit(tallest or 1.0)
    axes.axhline(0.0, color="#9aa5b1", linewidth=1.0)
    for feature, at in zip(features, place / factor, strict=True):
        colour, height = kind_of(feature).colour, feature.height
        half = 0.5 * max(feature.width.median, 0.0) / factor if np.isfinite(feature.width.median) else 0.0
        axes.plot([at - half, at + half], [height.median / scale] * 2, color=colour, linewidth=3.0)
        axes.plot([at, at], [0.0, height.median / scale], color=colour, linewidth=1.0)
        axes.plot([at, at], [height.low / scale, height.high / scale], color=colour, linewidth=5.0, alpha=0.35)
        axes.annotate(feature.id, (at, height.median / scale), (0, 6), textcoords="offset points", ha="center", size=7)
    axes.set_xlabel(f"x ({unit})")
    axes.set_ylabel(f"height over the base ({name})")
    axes.margins(x=0.05, y=0.15)
    return axes


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
