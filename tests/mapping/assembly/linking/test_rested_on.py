"""Strokes that bend or lie nearer to each other than a ball is wide: where it may have rested tells their courses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from explore3d.bench.scenes import FIRST_BUILT_WITH, FeltShape, felt_shape
from mapping import Feature
from mapping.assembly import assemble
from mapping.assembly.linking import Branch, Inspection, rested_on, strokes
from mapping.base import fit_base
from mapping.detection import detect
from mapping.geometry.mesh import distances


def told(felt: FeltShape) -> list[Feature]:
    """What the rules say of a shape."""
    base = fit_base(felt.trace)
    return list(assemble(detect(felt.trace, base), felt.trace, base, proposals=(), faint=False))


def off(features: list[Feature], felt: FeltShape) -> float:
    """How far axes are from the courses, or 95 % of these from them, m."""
    course = np.vstack(felt.courses)
    dense = np.concatenate([np.linspace(each.axis[:-1], each.axis[1:], 20).reshape(-1, 3) for each in features])
    from_axes = np.min([distances(course, each.axis) for each in features], axis=0)
    return max(float(cKDTree(course).query(dense)[0].max()), float(np.quantile(from_axes, 0.95)))


def test_places_that_balls_may_have_rested_on_lie_along_a_bend_of_any_radius() -> None:
    tip, height, turn = 10e-3, 0.65e-3, np.linspace(0.0, 1.5 * np.pi, 200)
    course = 3e-3 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(200)])
    along, aside = np.arange(-9e-3, 9e-3, 0.7e-3), np.arange(-9e-3, 9e-3, 2e-3)
    rows = np.array([[x, y, 0.0] for y in aside for x in along] + [[y, x, 0.0] for y in aside for x in along])
    felt = np.maximum(height - cKDTree(course).query(rows)[0] ** 2 / (2.0 * tip), 0.0)
    sweep = np.repeat(np.arange(2 * len(aside)), len(along))
    up = np.tile([0.0, 0.0, 1.0], (len(rows), 1))
    inspection = Inspection(rows, felt, np.full(len(rows), 1e-6), sweep, 0.7e-3, up)
    half_width = float(np.sqrt(2.0 * tip * height))
    found = rested_on(np.arange(len(rows)), inspection, tip, half_width)
    assert cKDTree(course).query(found)[0].max() < 0.5e-3
    assert cKDTree(found).query(course)[0].max() < 1.2e-3


@pytest.mark.slow
def test_an_s_that_bends_within_the_balls_reach_is_one_ridge_along_it() -> None:
    felt = felt_shape("S 3 mm", FIRST_BUILT_WITH)
    (ridge,) = told(felt)
    assert ridge.kind == "ridge" and not ridge.closed
    assert off([ridge], felt) < 0.5e-3


@pytest.mark.slow
def test_the_bar_of_a_letter_is_a_ridge_and_its_legs_meet_in_a_corner() -> None:
    felt = felt_shape("A", FIRST_BUILT_WITH)
    found = told(felt)
    assert [each.kind for each in found] == ["ridge"] * 3
    assert off(found, felt) < 0.6e-3
    assert max(abs(each.height.median - felt.height) for each in found) < 0.1 * felt.height


def test_a_line_that_bends_is_of_no_strokes_and_one_with_corners_of_as_many_as_it_has() -> None:
    turn = np.linspace(0.0, np.pi, 40)
    arc = 4e-3 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(40)])
    assert strokes(Branch(arc, (True, True), junction=False), 0.4e-3, 4e-3) == []
    square = np.repeat([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0], [0.0, 0.0]], 2, axis=0)[1:-1].reshape(4, 2, 2)
    sides = np.concatenate([np.linspace(*side, 12)[:-1] for side in square])
    ring = 1e-3 * np.column_stack([sides, np.zeros(len(sides))])
    found = strokes(Branch(ring, (True, True), junction=False, closed=True), 0.4e-3, 4e-3)
    assert len(found) == 4 and not any(any(each.free) for each in found)
    corners = 1e-3 * np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [8.0, 8.0, 0.0], [0.0, 8.0, 0.0]])
    ends = np.concatenate([each.axis for each in found])
    assert cKDTree(ends).query(corners)[0].max() < 1e-6
