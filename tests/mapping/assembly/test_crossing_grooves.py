"""Two grooves that cross under a raster are two grooves, as wide as they are, and nothing is in their crossing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mapping import BoolArray, FloatArray, Trace
from mapping.assembly import assemble
from mapping.base import fit_base
from mapping.detection import detect
from mapping.inference.joint import refine_all

TIP, WHITE, HALF_LENGTH, DEEP = 3e-3, 5e-6, 12e-3, 0.15e-3
SPACING = 5e-6  # of the rim's places: a ball 0.5 mm inside it is held 1 nm higher between two of them


def felt(angles: tuple[float, float], widths: tuple[float, float]) -> Trace:
    """A raster over two grooves through 0: where it is in one of them the ball rests on the nearest place of the rim
    that the other one left, or on the bottom."""
    x, y = np.arange(-16e-3, 16e-3, 0.1e-3), np.arange(-15.7e-3, 16e-3, 1e-3)
    feet = np.concatenate([np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), row)]) for k, row in enumerate(y)])
    rims = [_rim(angle, 0.5 * width) for angle, width in zip(angles, widths, strict=True)]
    left = [rim[~_inside(rim, angles[1 - k], 0.5 * widths[1 - k])] for k, rim in enumerate(rims)]
    away, _ = cKDTree(np.concatenate(left)).query(feet)
    cut = np.any([_inside(feet, angle, 0.5 * width) for angle, width in zip(angles, widths, strict=True)], axis=0)
    height = np.where(cut, np.maximum(np.sqrt(np.maximum(TIP**2 - away**2, 0.0)) - TIP, -DEEP), 0.0)
    height += WHITE * np.random.default_rng(1).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(y)), len(x))
    return Trace(1e-2 * np.arange(len(feet)), np.column_stack([feet, TIP + height]), sweep, TIP)


def _rim(angle: float, half: float) -> FloatArray:
    along = np.arange(-HALF_LENGTH, HALF_LENGTH, SPACING)
    aside = np.arange(-half, half, SPACING)
    sides = [np.column_stack([along, np.full(len(along), side)]) for side in (-half, half)]
    ends = [np.column_stack([np.full(len(aside), end), aside]) for end in (-HALF_LENGTH, HALF_LENGTH)]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.asarray(np.concatenate([*sides, *ends]) @ turn)


def _inside(places: FloatArray, angle: float, half: float) -> BoolArray:
    along = places @ [np.cos(angle), np.sin(angle)]
    aside = places @ [-np.sin(angle), np.cos(angle)]
    return np.asarray((np.abs(along) < HALF_LENGTH) & (np.abs(aside) < half))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angles", "widths"), [((np.pi / 4, -np.pi / 4), (1e-3, 1e-3)), ((np.pi / 3, -np.pi / 3), (1e-3, 1.4e-3))]
)
def test_two_grooves_that_cross_are_two_grooves(angles: tuple[float, float], widths: tuple[float, float]) -> None:
    trace = felt(angles, widths)
    base = fit_base(trace)
    detections = detect(trace, base)
    found = assemble(detections, trace, base)
    features = refine_all(found, trace, 1, base=base, noise=detections.noise, confirm=None)
    assert [feature.kind for feature in features] == ["groove", "groove"]
    by_width = sorted(features, key=lambda feature: feature.width.median)
    for feature, width in zip(by_width, sorted(widths), strict=True):
        assert feature.width.median == pytest.approx(width, abs=30e-6)
        assert feature.length.median == pytest.approx(2.0 * HALF_LENGTH, abs=1e-3)
