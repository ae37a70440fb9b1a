"""Points on straight, bent and meeting lines, in any order."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.linking.branches import branches

WIDTH = 3.6e-3


def spots(*ways: tuple[float, float], pitch: float = 4e-3, seed: int = 0, start: float = 0.0) -> np.ndarray:
    """Points along rays (angle, length) from the origin, shuffled and a little off the lines."""
    rng = np.random.default_rng(seed)
    rays = [np.arange(start, length, pitch)[:, None] * [np.cos(a), np.sin(a), 0.0] for a, length in ways]
    points = np.concatenate(rays) + 5e-5 * rng.standard_normal((sum(map(len, rays)), 3)) * [1, 1, 0]
    return rng.permutation(points)


def directions(found) -> list[float]:
    """Degrees modulo 180 of the chords of the branches, sorted."""
    chords = [b.axis[-1] - b.axis[0] for b in found]
    return sorted(float(np.degrees(np.arctan2(c[1], c[0]))) % 180 for c in chords)


@pytest.mark.parametrize("seed", range(5))
def test_a_line_is_one_branch_in_order(seed):
    (line,) = branches(spots((0.3, 0.03), (0.3 + np.pi, 0.03), seed=seed), WIDTH)
    assert line.free == (True, True) and not line.junction
    along = line.axis @ [np.cos(0.3), np.sin(0.3), 0]
    assert (np.diff(along) > 0).all() or (np.diff(along) < 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_three_arms_meet_in_one_point(seed):
    found = branches(spots((0.1, 0.02), (2.2, 0.02), (4.3, 0.02), seed=seed), WIDTH)
    assert len(found) == 3 and all(b.junction and sorted(b.free) == [False, True] for b in found)
    ends = [b.axis[0] if not b.free[0] else b.axis[-1] for b in found]
    assert np.linalg.norm(ends, axis=1).max() < 0.3e-3


@pytest.mark.parametrize("seed", range(5))
def test_two_lines_that_cross_go_straight_on(seed):
    points = spots((0.4, 0.02), (0.4 + np.pi, 0.02), (1.5, 0.02), (1.5 + np.pi, 0.02), seed=seed, start=3e-3)
    found = branches(points, WIDTH)
    assert len(found) == 2 and all(b.junction and b.free == (True, True) for b in found)
    np.testing.assert_allclose(directions(found), np.degrees([0.4, 1.5]), atol=2.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_bar_of_a_tee_goes_straight_on_and_its_stem_ends_on_it(seed):
    found = branches(spots((0.5, 0.02), (0.5 + np.pi, 0.02), (1.9, 0.02), seed=seed), WIDTH)
    assert sorted(b.free.count(True) for b in found) == [1, 2]
    stem = next(b for b in found if b.free.count(True) == 1)
    end = stem.axis[0] if not stem.free[0] else stem.axis[-1]
    assert np.linalg.norm(end) < 0.5e-3


def test_scatter_beside_a_line_is_no_branch():
    line = spots((0.0, 0.03))
    (found,) = branches(np.vstack([line, [[0.014, 0.003, 0.0]]]), WIDTH)
    assert np.abs(found.axis[:, 1]).max() < 1e-3


def test_scale_does_not_matter():
    points = spots((0.1, 0.02), (2.2, 0.02), (4.3, 0.02))
    for factor in (2.0**-20, 2.0**20):
        small, large = branches(points, WIDTH), branches(factor * points, factor * WIDTH)
        for a, b in zip(small, large, strict=True):
            np.testing.assert_allclose(factor * a.axis, b.axis, rtol=1e-9, atol=1e-9 * factor)
