"""Features are drawn, and traced, in the shape that their record describes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping.feature import Details, Feature, Interval, Support
from mapping.inference.families.bell import width_at_half_height
from mapping.inference.kinds.kind import feature_trace
from mapping.model.feature_mesh import drawn_at_least, feature_mesh

HEIGHT, SCALE, EXPONENT = 0.5e-3, 1e-3, 1.0
UP = np.array([[0.0, 0.0, 1.0]])


def bump(**details: float) -> Feature:
    height, width, none = (Interval(v, v, v) for v in (HEIGHT, float(width_at_half_height(SCALE, EXPONENT)), 0.0))
    return Feature(
        "bump", np.zeros((1, 3)), UP, height, width, none, Support(9.0, 3), True, 1e-5, details=Details(**details)
    )


BELL = bump(scale=SCALE, exponent=EXPONENT)


def test_a_bell_is_drawn_as_the_bell_that_was_fitted() -> None:
    mesh = feature_mesh(BELL)
    u, z = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]), mesh.vertices[:, 2]
    above = z > 0
    assert above.sum() > 100
    assert z[above] == pytest.approx(HEIGHT / (1.0 + (u[above] / SCALE) ** 2))
    assert u[~above].min() == pytest.approx(u.max())  # the skirt is cut off where it is hardly higher than the base
    assert z[above].min() < 0.05 * HEIGHT
    assert (mesh.face_normals[:, 2] > -1e-12).all()


def test_a_ridge_that_runs_out_is_drawn_as_its_section_along_its_axis() -> None:
    axis = np.array([[0.0, 0.0, 0.0], [9e-3, 0.0, 0.0]])
    mesh = feature_mesh(replace(BELL, kind="ridge", axis=axis, normals=np.repeat(UP, 2, axis=0)))
    u, z = np.abs(mesh.vertices[:, 1]), mesh.vertices[:, 2]
    assert z[z > 0] == pytest.approx(HEIGHT / (1.0 + (u[z > 0] / SCALE) ** 2))
    assert set(np.round(1e3 * mesh.vertices[:, 0])) == {0.0, 9.0}
    flank = (mesh.face_normals[:, 2] > 0.0) & (np.abs(mesh.face_normals[:, 0]) < 1e-9)
    assert flank.sum() == 2 * (len(u) // 2 - 3)  # all but the foot and the ends look outwards


def test_a_bell_enlarged_to_be_seen_keeps_its_proportions() -> None:
    small, large = feature_mesh(BELL), feature_mesh(drawn_at_least(BELL, 0.1))
    factor = 0.1 / BELL.width.median
    assert large.vertices == pytest.approx(factor * small.vertices)


def test_a_cap_is_drawn_as_half_an_ellipsoid() -> None:
    mesh = feature_mesh(bump(radius=1e-3))
    u, z = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]), mesh.vertices[:, 2]
    half = 0.5 * bump().width.median
    assert (u / half) ** 2 + (z / HEIGHT) ** 2 == pytest.approx(np.ones(len(u)))


def test_a_tip_far_finer_than_a_bell_traces_the_bell_itself() -> None:
    feet = np.column_stack([np.linspace(-2e-3, 2e-3, 41), np.zeros(41), np.zeros(41)])
    body = HEIGHT / (1.0 + (feet[:, 0] / SCALE) ** 2)
    traced = feature_trace(BELL, feet, np.repeat(UP, 41, axis=0), 1e-6 * SCALE)
    assert np.abs(traced - body).max() < 1e-4 * HEIGHT
