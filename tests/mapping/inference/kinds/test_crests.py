"""The trace of a found feature is felt beside it and nowhere else."""

from __future__ import annotations

import numpy as np

from mapping.feature import Feature, Interval, Support
from mapping.inference.kinds.kind import feature_trace

TIP, BODY = 0.01, 0.02


def bump(height: float, width: float) -> Feature:
    """A bump on top of a cylinder about the y axis."""
    return Feature(
        kind="bump",
        axis=np.array([[0.0, 0.0, BODY]]),
        normals=np.array([[0.0, 0.0, 1.0]]),
        height=Interval(height, height, height),
        width=Interval(width, width, width),
        length=Interval(0.0, 0.0, 0.0),
        evidence=Support(5.0, 1, (3,)),
        curvature_feature=True,
        position_sd=1e-4,
    )


def around(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Feet and normals on the cylinder, rad from its top."""
    normals = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    return BODY * normals, normals


def test_a_bump_is_as_high_as_it_says_at_its_top() -> None:
    height = feature_trace(bump(6e-4, 4e-3), *around(np.zeros(1)), TIP)
    np.testing.assert_allclose(height, 6e-4, rtol=1e-9)


def test_a_low_wide_bump_on_a_cylinder_is_not_felt_on_its_other_sides() -> None:
    angle = np.linspace(-np.pi, np.pi, 361)
    height = feature_trace(bump(5e-5, 8e-3), *around(angle), TIP)
    assert height.max() <= 5e-5 * (1.0 + 1e-9)
    assert (height[np.abs(angle) > 0.35] == 0.0).all()
