"""Outlines: half of a line's section as a polyline, from its middle outwards to where it meets the base."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray

# Points of an outline. Between two of them, d apart, the ball rests by d^2 / 8 r lower than on what lies between: by
# 0.1 um of a groove 4 mm wide under a ball of 3 mm, by 3 um of its last stretch where it runs out
OUTLINE_POINTS = 41
# A section that runs out ends where so much of its height is left: half of the least error of a shape that is reckoned
# with (MISFIT_SHARES of mapping.inference.configuration)
LEAST_LEFT = 5e-3


def upright_outline(half: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances from the middle and heights (W, J) of sections with a flat top or bottom and upright walls, m.

    Args:
        half: (W,) half widths, m.
        height: (W,) of the top, or, negative, of the bottom, m.
    """
    share = np.append(np.linspace(0.0, 1.0, OUTLINE_POINTS - 1), 1.0)
    level = np.append(np.ones(OUTLINE_POINTS - 1), 0.0)
    return np.multiply.outer(half, share), np.multiply.outer(height, level)


def smooth_outline(
    height: FloatArray, half: FloatArray, taper: FloatArray, off: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The same of sections that run out, `off` (W,) m beside their middle (theory equation 4.10a).

    Args:
        height: (W,) in the middle, negative of hollows, m.
        half: (W,) half widths at half of the height, m.
        taper: (W,) tapers.
    """
    k = np.where(np.abs(taper) < 1e-5, 1e-5, taper)[:, None]
    scale = half[:, None] / np.sqrt(np.expm1(k * np.log(2.0)) / k)
    left = np.linspace(1.0, LEAST_LEFT, OUTLINE_POINTS)
    across = scale * np.sqrt(np.expm1(-k * np.log(left)) / k)
    under = np.maximum(1.0 + k * ((across**2 + off[:, None] ** 2) / scale**2), 0.0)
    with np.errstate(divide="ignore"):  # beyond the edge of a section that has one nothing is left
        share = np.where(under > 0.0, under, 1.0) ** (-1.0 / k) * (under > 0.0)
    share[:, -1] = 0.0
    return np.asarray(across), height[:, None] * share


def round_outline(height: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same of round sections of a radius (W,) whose crests stand at a height (W,), m."""
    lowest = np.arccos(np.clip(1.0 - height / radius, -1.0, 1.0))
    turn = np.multiply.outer(np.minimum(lowest, 0.5 * np.pi), np.linspace(0.0, 1.0, OUTLINE_POINTS))
    up = (height - radius)[:, None] + radius[:, None] * np.cos(turn)
    return radius[:, None] * np.sin(turn), np.maximum(up, 0.0)


def flat_outline(height: FloatArray, half: FloatArray, run: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same of sections with a flat top, half of its width (W,), and straight flanks of a run (W,), m."""
    share = np.linspace(0.0, 1.0, OUTLINE_POINTS // 2)
    across = np.concatenate([np.multiply.outer(half, share), half[:, None] + np.multiply.outer(run, share)], axis=1)
    level = np.concatenate([np.ones_like(share), 1.0 - share])
    return across, np.multiply.outer(height, level)


def shouldered_outline(height: FloatArray, half: FloatArray, shoulder: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same of sections with a flat top between edges rounded by a radius `shoulder` (W,), m."""
    share = np.linspace(0.0, 1.0, OUTLINE_POINTS // 2)
    top = np.multiply.outer(half, share)
    edge, up = round_outline(height, shoulder)
    return np.concatenate([top, half[:, None] + edge], axis=1), np.concatenate(
        [0.0 * top + height[:, None], up], axis=1
    )
