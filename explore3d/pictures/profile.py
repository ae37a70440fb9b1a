"""Picture of a profile log: the whole profile with its base, and its height over the base with features marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from explore3d.pictures.figure import ESTIMATED, INK, MUTED, TRACED, new_figure, png, styled
from mapping import Feature, FloatArray, Trace, length_text, length_unit
from mapping.base import Base


def profile_picture(trace: Trace, base: Base, features: Sequence[Feature], limit: float) -> bytes:
    """PNG of two panels over one abscissa.

    Args:
        trace: one profile.
        base: the global model.
        features: what was found.
        limit: detection limit, m; drawn if finite.
    """
    feet = base.foot(trace.centers, trace.tip_radius)
    origin, heading = profile_line(trace)
    x = (trace.centers - origin) @ heading
    up = feet.normals.mean(axis=0)
    z = (trace.centers - origin) @ up
    floor = (feet.points - origin) @ up + trace.tip_radius
    order = np.argsort(x, kind="stable")
    x_factor, x_name = length_unit(float(np.abs(x).max()))
    with styled():
        figure = new_figure(11.0, 6.4)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.7))
        z_factor, z_name = length_unit(float(np.ptp(z)))
        low = float(z.min())
        upper.plot(x[order] / x_factor, (z[order] - low) / z_factor, color=TRACED, linewidth=0.8, label="trace")
        upper.plot(x[order] / x_factor, (floor[order] - low) / z_factor, color=INK, linewidth=1.0, label="base, fitted")
        upper.set_ylabel(f"height ({z_name})")
        upper.set_title("The profile as it was recorded", fontweight="bold")
        upper.legend(loc="best", ncols=2)
        _heights(lower, x[order] / x_factor, feet.height[order], features, limit, (origin, heading, x_factor))
        lower.set_xlabel(f"place along the profile ({x_name})")
        return png(figure)


def profile_line(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Origin and unit direction of the abscissa: a coordinate axis if the profile runs along one, else its own."""
    spread = np.ptp(trace.centers, axis=0)
    main = int(spread.argmax())
    if spread[main] > 50 * np.delete(spread, main).max():
        return np.zeros(3), np.eye(3)[main]
    heading = trace.centers[-1] - trace.centers[0]
    return trace.centers[0], np.asarray(heading / np.linalg.norm(heading))


def _heights(
    axes: Any,
    x: FloatArray,
    height: FloatArray,
    features: Sequence[Feature],
    limit: float,
    line: tuple[FloatArray, FloatArray, float],
) -> None:
    origin, heading, x_factor = line
    factor, name = length_unit(float(np.abs(height).max()))
    axes.plot(x, height / factor, color=TRACED, linewidth=0.6, label="height over the base")
    places = np.array([(feature.axis[0] - origin) @ heading / x_factor for feature in features])
    crests = np.array([feature.height.median / factor for feature in features])
    finer = np.array([feature.curvature_feature for feature in features], dtype=bool)
    for mask, face, label in ((finer, ESTIMATED, "finer than the tip"), (~finer, "white", "gentler than the tip")):
        if mask.any():
            axes.plot(
                places[mask], crests[mask], "v", color=ESTIMATED, markerfacecolor=face, markersize=6, linestyle="none",
                label=label,
            )  # fmt: skip
    if np.isfinite(limit):
        axes.axhline(
            limit / factor, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)),
            label=f"detection limit of a sharp crest, {length_text(limit)}",
        )  # fmt: skip
    named: list[float] = []
    for number in np.argsort(-np.abs(crests))[:8]:
        if any(abs(places[number] - place) < 0.05 * np.ptp(x) for place in named):
            continue  # its name would run into that of a higher one
        named.append(float(places[number]))
        axes.annotate(
            features[number].id, (places[number], crests[number]), xytext=(0, 7), textcoords="offset points",
            ha="center", fontsize=7.5,
        )  # fmt: skip
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylabel(f"height over the base ({name})")
    axes.set_title("Height over the base, and what stands out of it", fontweight="bold")
    low, high = float(height.min()) / factor, float(height.max()) / factor
    axes.set_ylim(low - 0.05 * (high - low), high + 0.25 * (high - low))
    axes.legend(loc="upper left", ncols=4)
