"""Maps in colours: what is unsure is pale, without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.pictures.maps import _without_tears, coloured, faded
from mapping import Surface


def test_a_sure_value_has_its_colour_and_an_unsure_one_none() -> None:
    shares = np.array([0.5, -0.5, 0.5, 0.5, 3.0, 0.0])
    sd = np.array([1e-6, 1e-6, np.nan, 1e6, 1e-6, 0.0])
    np.testing.assert_allclose(faded(shares, sd), [0.5, -0.5, 0.5, 0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(faded(np.array([1.0]), np.array([1.0])), 0.6827, atol=1e-4)  # of a normal, within one sd


def test_no_level_of_certainty_makes_a_jump() -> None:
    sd = np.geomspace(0.01, 100.0, 2001)
    drawn = faded(np.full(2001, 0.8), sd)
    assert np.abs(np.diff(coloured(0.5 + 0.5 * drawn), axis=0)).max() < 0.01
    assert (np.diff(drawn) <= 0.0).all() and drawn[0] > 0.79 and drawn[-1] < 0.01


def test_what_is_twice_as_sure_is_never_paler() -> None:
    shares = np.linspace(-1.5, 1.5, 301)
    for sd in (0.03, 0.3, 3.0):
        assert (np.abs(faded(shares, np.full(301, sd))) >= np.abs(faded(shares, np.full(301, 2.0 * sd)))).all()
        assert (np.diff(faded(shares, np.full(301, sd))) >= 0.0).all()  # order stays order


def test_a_tear_that_the_ball_does_not_pass_is_closed_and_an_opening_is_not() -> None:
    places = 1e-3 * np.array([[x, y, 0.0] for y in range(6) for x in range(6)])
    corner = np.array([6 * y + x for y in range(5) for x in range(5)])
    halves = [np.column_stack([corner, corner + 1, corner + 7]), np.column_stack([corner, corner + 7, corner + 6])]
    faces = np.concatenate(halves)
    middle = (faces == 14).any(axis=1)  # six faces about one vertex: their rim is 4 + 2 sqrt 2 mm long
    torn = Surface(places, faces[~middle])
    closed, rims = _without_tears(torn, 1.1e-3)  # girth 6.91 mm
    assert len(closed.faces) == len(faces) and closed.face_areas.sum() == pytest.approx(25e-6)
    assert (closed.face_normals[:, 2] > 0.99).all() and len(closed.vertices) == 37
    assert [sorted(rim.tolist()) for rim in rims] == [[7, 8, 13, 15, 20, 21]]
    assert len(_without_tears(torn, 1.0e-3)[0].faces) == len(faces) - 6  # girth 6.28 mm


def test_tears_that_meet_each_other_or_the_border_in_a_corner_are_closed_too() -> None:
    places = 1e-3 * np.array([[x, y, 0.0] for y in range(6) for x in range(6)])
    corner = np.array([6 * y + x for y in range(5) for x in range(5)])
    halves = [np.column_stack([corner, corner + 1, corner + 7]), np.column_stack([corner, corner + 7, corner + 6])]
    faces = np.concatenate(halves)
    gone = (faces == 14).any(axis=1)
    for one in ([21, 22, 28], [10, 17, 16]):  # the one touches that tear in place 21, the other the border in 17
        gone |= (faces == one).all(axis=1)
    assert gone.sum() == 8
    closed, rims = _without_tears(Surface(places, faces[~gone]), 1.1e-3)
    assert sorted(len(rim) for rim in rims) == [3, 3, 6]
    assert closed.face_areas.sum() == pytest.approx(25e-6) and (closed.face_normals[:, 2] > 0.99).all()
