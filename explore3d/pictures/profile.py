"""Picture of a profile log: the whole profile with its base, and its height over the base with features marked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.pictures.chart import DASHED, Panel, sheet
from explore3d.pictures.figure import ESTIMATED, INK, MUTED, TRACED
from mapping import Feature, FloatArray, Trace, length_text, length_unit
from mapping.base import Base, LaidTrace
from mapping.geometry.mesh import middle

PROFILE_WIDTH = 1060.0  # px
PROFILE_HEIGHT = 300.0  # of each of its two panels, px
# A profile is drawn by the lowest and highest sample of so many stretches: more than there are pixels
DRAWN_STRETCHES = 2000


def profile_picture(trace: Trace, base: Base, features: Sequence[Feature], limit: float) -> bytes:
    """SVG of two panels over one abscissa.

    Args:
        trace: one profile.
        base: the global model.
        features: what was found.
        limit: detection limit, m; drawn if finite.
    """
    feet = LaidTrace.of(trace, base).feet()
    origin, heading = profile_line(trace)
    x = (trace.centers - origin) @ heading
    up = feet.normals.mean(axis=0)
    z = (trace.centers - origin) @ up
    floor = (feet.points - origin) @ up + trace.tip_radius
    order = np.argsort(x, kind="stable")
    x_factor, x_name = length_unit(float(np.abs(x).max()))
    z_factor, z_name = length_unit(float(np.ptp(z)))
    low = float(z.min())
    upper = Panel("The profile, levelled", y_name=f"height ({z_name})", x_ticks=10)
    upper.line(*thinned(x[order] / x_factor, (z[order] - low) / z_factor), TRACED, width=1.0, name="trace")
    upper.line(*thinned(x[order] / x_factor, (floor[order] - low) / z_factor), INK, width=1.3, name="base, fitted")
    lower = _heights(x[order] / x_factor, feet.height[order], features, limit, (origin, heading, x_factor))
    lower.x_name = f"place along the profile ({x_name})"
    return sheet([upper, lower], PROFILE_WIDTH, PROFILE_HEIGHT, legend=True)


def thinned(x: FloatArray, y: FloatArray, stretches: int = DRAWN_STRETCHES) -> tuple[FloatArray, FloatArray]:
    """The line through (N,) points in order, without those that no eye sees: of each stretch its lowest and highest."""
    if len(x) <= 2 * stretches:
        return x, y
    firsts = np.linspace(0, len(x), stretches, endpoint=False).astype(int)
    low, high = np.minimum.reduceat(y, firsts), np.maximum.reduceat(y, firsts)
    middle = 0.5 * (x[firsts] + x[np.append(firsts[1:], len(x)) - 1])
    return np.repeat(middle, 2), np.column_stack([low, high]).ravel()


def profile_line(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Origin and unit direction of the abscissa: a coordinate axis if the profile runs along one, else its own."""
    spread = np.ptp(trace.centers, axis=0)
    main = int(spread.argmax())
    if spread[main] > 50 * np.delete(spread, main).max():
        return np.zeros(3), np.eye(3)[main]
    heading = trace.centers[-1] - trace.centers[0]
    return trace.centers[0], np.asarray(heading / np.linalg.norm(heading))


def _heights(
    x: FloatArray,
    height: FloatArray,
    features: Sequence[Feature],
    limit: float,
    line: tuple[FloatArray, FloatArray, float],
) -> Panel:
    origin, heading, x_factor = line
    factor, name = length_unit(float(np.abs(height).max()))
    low, high = float(height.min()) / factor, float(height.max()) / factor
    panel = Panel(
        "Height over the base, and what stands out of it",
        y_name=f"height over the base ({name})",
        x_ticks=10,
        y_limits=(low - 0.05 * (high - low), high + 0.25 * (high - low)) if high > low else None,
    )
    panel.level(0.0, INK, width=0.8)
    panel.line(*thinned(x, height / factor), TRACED, width=0.8, name="height over the base")
    places = np.array([(middle(feature.axis)[0] - origin) @ heading / x_factor for feature in features])
    crests = np.array([feature.height.median / factor for feature in features])
    finer = np.array([feature.curvature_feature for feature in features], dtype=bool)
    for mask, filled, label in ((finer, True, "finer than the tip"), (~finer, False, "gentler than the tip")):
        if mask.any():
            panel.marks(places[mask], crests[mask], ESTIMATED, "v", filled=filled, name=label)
    if np.isfinite(limit):
        said = f"detection limit of a sharp crest, {length_text(limit)}"
        panel.level(limit / factor, MUTED, width=1.2, dash=DASHED, name=said)
    named: list[float] = []
    for number in np.argsort(-np.abs(crests))[:8]:
        if any(abs(places[number] - place) < 0.05 * np.ptp(x) for place in named):
            continue  # its name would run into that of a higher one
        named.append(float(places[number]))
        panel.words(
            float(places[number]), float(crests[number]), features[number].id, dy=-9.0, anchor="middle", size=10.0
        )
    return panel
