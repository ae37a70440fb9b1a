"""Pieces of one line are joined where nothing denies the line between them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.linking.branches import Branch, rejoined

WIDE = 3.6e-3


def piece(start: tuple[float, float], stop: tuple[float, float], count: int = 5) -> Branch:
    """A straight piece in the plane z = 0 that ends free, mm."""
    return Branch(1e-3 * np.linspace([*start, 0.0], [*stop, 0.0], count), (True, True), junction=False)


def nowhere(start: np.ndarray, stop: np.ndarray) -> bool:
    return False


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_two_pieces_of_a_line_become_one_whichever_way_they_run(turn: int) -> None:
    first, second = piece((0, 0), (20, 0)), piece((30, 0.5), (50, 1))
    if turn & 1:
        first = piece((20, 0), (0, 0))
    if turn & 2:
        second = piece((50, 1), (30, 0.5))
    (whole,) = rejoined([first, second], WIDE, nowhere)
    assert len(whole.axis) == 10 and whole.free == (True, True)
    assert (np.diff(whole.axis[:, 0]) > 0).all() or (np.diff(whole.axis[:, 0]) < 0).all()


def test_pieces_stay_apart_where_a_place_between_them_felt_no_crest() -> None:
    pieces = [piece((0, 0), (20, 0)), piece((30, 0), (50, 0))]
    assert rejoined(pieces, WIDE, lambda start, stop: True) == pieces


@pytest.mark.parametrize("other", [((0, 8), (20, 8)), ((25, 5), (25, 25)), ((80, 0), (99, 0))])
def test_neighbours_turns_and_far_lines_are_no_continuation(other: tuple) -> None:
    assert len(rejoined([piece((0, 0), (20, 0)), piece(*other)], WIDE, nowhere)) == 2


def test_an_end_at_which_lines_meet_is_not_joined() -> None:
    met = Branch(piece((0, 0), (20, 0)).axis, (True, False), junction=True)
    assert len(rejoined([met, piece((30, 0), (50, 0))], WIDE, nowhere)) == 2


def test_a_single_point_goes_where_a_line_leads_to_it() -> None:
    lone = Branch(1e-3 * np.array([[35.0, 0.5, 0.0]]), (True, True), junction=False)
    (whole,) = rejoined([piece((0, 0), (20, 0)), lone], WIDE, nowhere)
    assert len(whole.axis) == 6
    beside = Branch(1e-3 * np.array([[15.0, 9.0, 0.0]]), (True, True), junction=False)
    assert len(rejoined([piece((0, 0), (20, 0)), beside], WIDE, nowhere)) == 2
