"""Lines that run side by side are not one detail because nothing was felt between them."""

from __future__ import annotations

import numpy as np

from mapping.assembly.linking.branches import branches, spanning_tree
from mapping.assembly.linking.spanning_tree import untied

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


def test_a_link_that_turns_back_from_the_end_of_a_line_to_its_neighbour_is_a_tie() -> None:
    lower, upper = row(0, np.array([-20.0, -10.0, 0.0, 18.0])), row(8, np.arange(-22.0, 23.0, 11.0))
    chain = {0: {1}, 1: {0, 2}, 2: {1, 3}, 3: {2, 6}, 4: {5}, 5: {4, 6}, 6: {5, 7, 3}, 7: {6, 8}, 8: {7}}
    assert len(untied(chain, np.concatenate([lower, upper]), WIDE)) == 2
    away = {**chain, 3: {2, 8}, 6: {5, 7}, 8: {7, 3}}
    assert len(untied(away, np.concatenate([lower, upper]), WIDE)) == 1, "a line that goes on to the other's end is not"


def test_a_stray_between_two_lines_does_not_tie_them() -> None:
    # one hangs on its line; the other is a point of it
    for stray, xs in (([20.5, 2.2], np.arange(-29.0, 30.0, 5.5)), ([21.5, 5.9], np.array([10.0, 15.0, 20.8, 26.3]))):
        points = np.concatenate([LOWER, 1e-3 * np.array([[*stray, 0.0]]), row(8, xs)])
        assert trees(points) == 2
        assert all(line.free == (True, True) for line in branches(points, WIDE))
