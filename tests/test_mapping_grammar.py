"""Features assembled from survey sweeps over closed-form ridges, bumps and rings on a plate."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base import Base
from mapping.detectors import detect
from mapping.grammar import assemble
from mapping.shapes import chain_height, step_height
from mapping.surface import Surface
from mapping.trace import Trace

TIP, RADIUS, SPACING = 0.01, 0.325e-3, 3e-5
NORMAL = np.array([0.0, 0.0, 1.0])


def plate() -> Base:
    corners = np.array([[-0.1, -0.075, 0], [0.1, -0.075, 0], [0.1, 0.075, 0], [-0.1, 0.075, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def survey(height, extra=(), pitch: float = 6e-3, seed: int = 0) -> Trace:
    """Sweeps along x, to and fro, and extra ones from point to point; white noise of the apparatus' density."""
    rng = np.random.default_rng(seed)
    lines = [((-0.095, y), (0.095, y)) for y in np.arange(-0.036, 0.037, pitch)]
    parts = []
    for number, (start, stop) in enumerate([*lines, *extra]):
        count = int(np.linalg.norm(np.subtract(stop, start)) / SPACING)
        foot = np.column_stack([np.linspace(start, stop, count), np.zeros(count)])
        noise = 0.2e-3 * np.sqrt(SPACING / 6e-6) ** -1 * rng.standard_normal((count, 3))
        centers = foot + np.outer(TIP + height(foot), NORMAL) + noise
        parts.append(Trace(10.0 * number + SPACING / 0.03 * np.arange(count), centers, np.full(count, number), TIP))
    return Trace.concatenate(parts)


def ridges(*axes):
    def height(foot):
        up = np.tile(NORMAL, (len(foot), 1))
        return np.max([chain_height(foot, up, np.asarray(axis), RADIUS, TIP) for axis in axes], axis=0)

    return height


def features(height, **options):
    trace, base = survey(height, **options), plate()
    return assemble(detect(trace, base), trace, base)


RIDGE = np.array([[-0.02, -0.025, RADIUS], [0.015, 0.03, RADIUS]])


@pytest.mark.parametrize(
    "extra",
    [
        (),
        (((-0.02, -0.025), (0.015, 0.03)),),
        (((-0.03, -0.04), (0.025, 0.045)), ((0.01, -0.03), (-0.02, 0.03))),
        tuple(((x - 0.01, y + 0.006), (x + 0.01, y - 0.006)) for x, y in np.linspace(RIDGE[0, :2], RIDGE[1, :2], 12)),
    ],
    ids=["survey alone", "along the crest", "askew", "zigzag"],
)
def test_one_ridge_is_one_ridge_however_it_was_crossed(extra):
    (ridge,) = features(ridges(RIDGE), extra=extra)
    assert ridge.kind == "ridge"
    assert not ridge.closed
    assert ridge.curvature_feature
    assert abs(ridge.height.median - 0.65e-3) < 0.05e-3
    assert ridge.length.low - 1e-3 <= 0.0652 <= ridge.length.high
    direction = (RIDGE[1] - RIDGE[0])[:2] / np.linalg.norm(RIDGE[1] - RIDGE[0])
    lateral = (ridge.axis[:, :2] - RIDGE[0, :2]) @ np.array([-direction[1], direction[0]])
    assert np.abs(lateral).max() < 0.5e-3


def test_a_bare_plate_has_no_features():
    assert features(lambda foot: np.zeros(len(foot))) == ()


def test_a_bump_is_a_bump_and_two_are_two():
    (bump,) = features(ridges([[0.001, 0.002, RADIUS]]))
    assert bump.kind == "bump"
    two = features(ridges([[0.001, 0.0005, RADIUS]], [[0.022, 0.012, RADIUS]]))
    assert [f.kind for f in two] == ["bump", "bump"]


def test_a_ring_is_one_closed_ridge():
    angle = np.linspace(0, 2 * np.pi, 60)
    ring = np.column_stack([0.03 * np.cos(angle), 0.03 * np.sin(angle), np.full(60, RADIUS)])
    (found,) = features(ridges(ring))
    assert found.kind == "ridge"
    assert found.closed
    assert abs(found.length.median - 2 * np.pi * 0.03) < 0.012


def test_a_ridge_along_the_sweeps_is_not_two_steps():
    (ridge,) = features(ridges([[-0.03, 0.001, RADIUS], [0.03, 0.001, RADIUS]]))
    assert ridge.kind == "ridge"
    assert abs(ridge.length.median - 0.06) < 4e-3


def test_a_step_is_one_step():
    (step,) = features(lambda foot: step_height(foot[:, 0] - 0.01 - 0.2 * foot[:, 1], 0.5e-3, TIP))
    assert step.kind == "step"
    assert abs(step.height.median - 0.5e-3) < 0.05e-3
    assert len(step.axis) >= 10


def test_a_tee_is_a_junction():
    found = features(ridges([[0.01, -0.035, RADIUS], [0.01, 0.035, RADIUS]], [[0.01, 0, RADIUS], [0.05, 0.02, RADIUS]]))
    assert {f.kind for f in found} == {"ridge"}
    assert len(found) >= 2
    assert all("junction" in f.notes for f in found)
