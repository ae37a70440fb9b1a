"""Pressing and sliding: the ball rests where it can, starts where it is free, and stays in its hollow."""

from __future__ import annotations

import numpy as np
import pytest
from brute_force_contact import distances
from contact_bodies import box, bump, extruded, flipped, merged, torus

from mapping.errors import ContactError
from mapping.geometry.contact.commanded_path import CommandedPath
from mapping.geometry.contact.first_contact import BallContact
from mapping.surface import Surface

DOWN = np.array([0.0, 0.0, -1.0])


def plate(thickness: float = 1.0) -> Surface:
    return box((-5, -5, -thickness / 2), (5, 5, thickness / 2))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("thickness", [0.1, 1.0])
def test_a_ball_commanded_into_a_plate_rests_on_top_of_it(turned: bool, thickness: float) -> None:
    body = flipped(plate(thickness)) if turned else plate(thickness)
    top = thickness / 2
    depths = np.array([2.0, 0.3, 0.29, 0.1, 0.0, -0.3 * thickness, -0.5 * thickness, -thickness])
    rest = BallContact(body, 0.3).press(np.column_stack([np.zeros((8, 2)), top + depths]), DOWN)
    np.testing.assert_allclose(rest.centers, [[0, 0, top + 0.3]] * 8, atol=1e-15)
    np.testing.assert_allclose(rest.distance, depths - 0.3, atol=2e-15)
    assert (rest.count == 1).all()


def test_a_ball_free_below_the_plate_is_not_lifted_through_it() -> None:
    rest = BallContact(plate(), 0.3).press([[0, 0, -0.81], [0, 0, -3]], DOWN)
    assert rest.count.tolist() == [0, 0]
    assert (rest.distance == np.inf).all()


def test_a_ball_in_the_hole_of_a_torus_stays_there() -> None:
    ball = BallContact(torus(1.0, 0.4, 200), 0.1)
    angle = np.linspace(0.0, 6.0, 40)
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(40)])
    for depth in (0.3, 0.5, 0.55, 0.65):  # the inner side of the tube is at 0.6
        rest = ball.press(depth * outward, outward)
        np.testing.assert_allclose(np.linalg.norm(rest.centers, axis=1), 0.5, atol=1e-3)
        assert (np.einsum("ij,ij->i", rest.normals, outward) < -0.99).all()


def test_a_ball_inside_a_hollow_box_stays_inside() -> None:
    body = merged(box((-2, -2, -2), (2, 2, 2)), flipped(box()))
    rest = BallContact(body, 0.25).press([[0.1, 0.2, 0.3], [0.1, 0.2, -0.9], [0.1, 0.2, -1.5], [0.1, 0.2, 5]], DOWN)
    np.testing.assert_allclose(rest.centers[:, 2], [-0.75, -0.75, -0.75, 2.25], atol=1e-15)


def test_an_open_sheet_is_pressed_from_either_side() -> None:
    ball = BallContact(bump(0.0), 0.25)
    from_above = ball.press([[0.1, 0.2, 1.2], [0.1, 0.2, 0.9], [0.1, 0.2, -7.0]], DOWN)
    np.testing.assert_allclose(from_above.centers[:, 2], 1.25, atol=1e-15)
    from_below = ball.press([[0.1, 0.2, -7.0], [0.1, 0.2, 0.9]], -DOWN)
    np.testing.assert_allclose(from_below.centers[:, 2], 0.75, atol=1e-15)


def test_a_slide_over_the_bump_equals_pressing_from_far_above_wherever_it_is_commanded() -> None:
    body = bump(15.0, 80)
    ball = BallContact(body, 0.1)
    path = np.array([[-0.9, 0.05, 0.0], [0.9, 0.05, 0.0]])
    low = ball.slide(path, DOWN, 0.01)  # up to ten radii inside the bump
    high = ball.first_contact(low.centers * [1, 1, 0] + [0, 0, 9], DOWN)
    np.testing.assert_allclose(low.centers, high.centers, atol=1e-14)
    np.testing.assert_allclose(distances(body.vertices[body.faces], low.centers), 0.1, rtol=1e-12)
    np.testing.assert_allclose(low.distance, -low.centers[:, 2], atol=1e-14)


def test_a_slide_off_the_border_ends_in_no_contact() -> None:
    slide = BallContact(plate(), 0.5).slide([[0, 0, 1], [7, 0, 1]], DOWN, 0.25)
    assert (slide.count > 0).tolist() == (np.linspace(0, 7, 29) < 5.5).tolist()
    assert len(slide) == 29


def test_the_approach_turns_along_the_path() -> None:
    tube = extruded(np.column_stack([-np.cos(t := np.linspace(0, np.pi, 721)), np.sin(t)]), 2.0)
    slide = BallContact(tube, 0.2).slide(
        [[-1.3, 0, 0.1], [0, 0, 1.3], [1.3, 0, 0.1]], [[1, 0, 0], DOWN, [-1, 0, 0]], 0.1
    )
    assert (slide.count >= 1).all()
    np.testing.assert_allclose(np.hypot(slide.centers[:, 0], slide.centers[:, 2]), 1.2, atol=1e-5)


def test_samples_are_evenly_spaced_and_hold_the_corners() -> None:
    path = CommandedPath([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0.25, 0]], DOWN)
    points, way = path.at(path.places(0.3))
    expected = [[0, 0, 0], [0.25, 0, 0], [0.5, 0, 0], [0.75, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0.25, 0]]
    np.testing.assert_allclose(points, expected, atol=1e-15)
    np.testing.assert_array_equal(way, np.tile(DOWN, (7, 1)))
    single = CommandedPath([[1.0, 2.0, 3.0]], DOWN)
    np.testing.assert_array_equal(single.at(single.places(0.1))[0], [[1, 2, 3]])


def test_impossible_paths_are_refused_with_their_reason() -> None:
    ball = BallContact(plate(), 0.3)
    path = [[0, 0, 1], [1, 0, 1]]
    for spacing in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ContactError, match="spacing"):
            ball.slide(path, DOWN, spacing)
    with pytest.raises(ContactError, match="at most 1e8"):
        ball.slide(path, DOWN, 1e-12)
    with pytest.raises(ContactError, match="at least one corner"):
        ball.slide(np.zeros((0, 3)), DOWN, 0.1)
    with pytest.raises(ContactError, match="not zero"):
        ball.slide(path, [DOWN, -DOWN], 0.5)
    with pytest.raises(ContactError, match="finite"):
        ball.slide([[0, 0, np.nan]], DOWN, 0.1)
