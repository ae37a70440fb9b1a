"""Lines that run side by side are not one detail because nothing was felt between them."""

from __future__ import annotations

import numpy as np

from mapping.branches import branches, spanning_tree
from mapping.ties import untied

WIDE = 3.6e-3


def row(y: float, xs: np.ndarray) -> np.ndarray:
    """Points along x at a height y, mm."""
    return 1e-3 * np.column_stack([xs, 0 * xs + y, 0 * xs])


def trees(points: np.ndarray) -> int:
    length = np.linalg.norm(points[:, None] - points[None], axis=2)
    return len(untied(spanning_tree(length), points, WIDE))


LOWER, UPPER = row(0, np.arange(-30.0, 31.0, 5.0)), row(8, np.arange(-29.0, 30.0, 5.5))


def test_two_rows_of_crossings_are_two_lines() -> None:
    points = np.concatenate([LOWER, UPPER])
    assert trees(points) == 2
    found = branches(points, WIDE)
    assert sorted(len(line.axis) for line in found) == sorted([len(LOWER), len(UPPER)])
    assert all(line.free == (True, True) and not line.junction for line in found)


def test_a_bar_that_was_crossed_between_two_lines_stays() -> None:
    bar = 1e-3 * np.array([[0.0, 3.0, 0.0], [0.0, 5.5, 0.0]])
    assert trees(np.concatenate([LOWER, bar, UPPER])) == 1


def test_an_arm_that_ends_at_a_line_stays() -> None:
    arm = 1e-3 * np.column_stack([np.zeros(5), 7.0 + 5.0 * np.arange(5), np.zeros(5)])
    assert trees(np.concatenate([LOWER, arm])) == 1
