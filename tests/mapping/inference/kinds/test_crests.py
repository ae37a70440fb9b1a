"""The trace of a found feature is felt beside it and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates import chain_height
from mapping.inference.kinds.crests import crest_radius
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


def test_a_bent_ridge_leaves_what_its_chain_of_capsules_does() -> None:
    """Of many legs, compiled: a hundred of them in numpy took as long as a hundred sweeps."""
    feet, up = around(np.linspace(-0.3, 0.3, 400))
    turn = np.linspace(0.0, 2.0, 90)
    course = np.column_stack([4e-3 * np.sin(turn), 5e-3 * (1.0 - np.cos(turn)), 0.0 * turn])
    normals = (course + np.array([0.0, 0.0, BODY])) * [1.0, 0.0, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axis = BODY * normals + course * [0.0, 1.0, 0.0]
    ridge = replace(bump(5e-4, 1e-3), kind="ridge", axis=axis, normals=normals)
    radius = crest_radius(ridge)
    whole = chain_height(feet, up, axis + (5e-4 - radius) * normals, radius, TIP)
    height = feature_trace(ridge, feet, up, TIP)
    assert (height > 1e-4).sum() > 50
    np.testing.assert_allclose(height, np.minimum(whole, 5e-4), atol=1e-15)
