"""First contacts: exact against every face, edge and vertex, scale-free, and calm on any mesh."""

from __future__ import annotations

import numpy as np
import pytest
from brute_force_contact import distance, distances, first_contact_distance
from contact_bodies import BODIES, box, bump, flipped, merged, slotted_plate, torus

from mapping.errors import ContactError
from mapping.geometry.contact.first_contact import EDGE, FACE, NONE, VERTEX, BallContact, Contacts
from mapping.surface import Surface

DOWN = np.array([0.0, 0.0, -1.0])


def rays(surface: Surface, radius: float, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random rays through the neighbourhood of a body; most start outside."""
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    reach = surface.size + radius
    return surface.bounds.mean(axis=0) - 1.5 * reach * d + 0.4 * reach * rng.normal(size=(count, 3)), d


def above(count: int, seed: int = 0) -> np.ndarray:
    return np.column_stack([np.random.default_rng(seed).uniform(-0.9, 0.9, (count, 2)), np.full(count, 3.0)])


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0])
def test_contact_agrees_with_every_face_edge_and_vertex(name: str, ratio: float) -> None:
    body = BODIES[name]()
    radius, corners = ratio * body.size, body.vertices[body.faces]
    origins, d = rays(body, radius, 25)
    contacts = BallContact(body, radius).first_contact(origins, d)
    inside = distances(corners, origins) < radius
    np.testing.assert_array_equal(contacts.overlap, inside)
    expected = np.array([first_contact_distance(corners, o, w, radius) for o, w in zip(origins, d, strict=True)])
    free = ~inside
    # the reference itself loses (size / radius)^2 digits
    np.testing.assert_allclose(contacts.distance[free], expected[free], rtol=0, atol=1e-9 * radius)
    hit = contacts.count > 0
    assert hit.any()
    np.testing.assert_allclose(distances(corners, contacts.centers[hit]), radius, rtol=1e-12 + 1e-15 / ratio)
    np.testing.assert_allclose(np.linalg.norm(contacts.centers - contacts.points, axis=1)[hit], radius, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0])
def test_no_contact_is_missed_and_nothing_penetrated_in_many_queries(name: str, ratio: float) -> None:
    body = BODIES[name]()
    radius = ratio * body.size
    origins, d = rays(body, radius, 100_000, seed=1)
    contacts = BallContact(body, radius).first_contact(origins, d)
    assert_free_until(body, radius, origins, d, contacts)


def assert_free_until(body: Surface, radius: float, origins: np.ndarray, d: np.ndarray, contacts: Contacts) -> None:
    """March each ball by its distance from the body, which it cannot reach in one step, until its contact."""
    import igl

    middle = body.bounds.mean(axis=0)
    tree, faces = igl.AABB(), np.ascontiguousarray(body.faces)
    vertices = np.ascontiguousarray(body.vertices - middle)
    tree.init(vertices, faces)

    def gap(points: np.ndarray) -> np.ndarray:
        return np.sqrt(tree.squared_distance(vertices, faces, np.ascontiguousarray(points - middle))[0]) - radius

    touching = contacts.count > 0
    np.testing.assert_allclose(gap(contacts.centers[touching]), 0.0, atol=1e-9 * radius)
    free = ~contacts.overlap
    assert (gap(origins[~free]) < 0).all()
    origins, d = origins[free], d[free]
    end = np.minimum(contacts.distance[free], 5.0 * (body.size + radius))
    t = np.zeros(len(end))
    while len(t):
        gaps = gap(origins + t[:, None] * d)
        assert gaps.min() >= -1e-9 * radius
        t = t + np.maximum(gaps, 1e-5 * radius)  # between such steps nothing deeper than 1e-10 radii hides
        left = t < end
        origins, d, end, t = origins[left], d[left], end[left], t[left]


def test_normals_point_from_the_contact_to_the_centre() -> None:
    contacts = BallContact(bump(15.0), 0.1).first_contact(above(200), DOWN)
    np.testing.assert_allclose(contacts.normals, (contacts.centers - contacts.points) / 0.1, atol=1e-14)
    assert (contacts.normals @ DOWN < 0).all()


def test_the_length_of_a_direction_does_not_matter() -> None:
    ball, start = BallContact(bump(15.0), 0.1), above(50)
    expected = ball.first_contact(start, DOWN)
    for length in (1e-300, 0.5, 3.0, 1e300):
        np.testing.assert_array_equal(ball.first_contact(start, length * DOWN).centers, expected.centers)


@pytest.mark.parametrize("exponent", [-300, -40, -7, 3, 30, 300])
def test_powers_of_two_scale_exactly(exponent: int) -> None:
    body, start = bump(15.0), above(100)
    expected = BallContact(body, 0.1).first_contact(start, DOWN)
    scale = 2.0**exponent
    scaled = BallContact(Surface(body.vertices * scale, body.faces), 0.1 * scale).first_contact(start * scale, DOWN)
    for name in ("centers", "points", "distance"):
        np.testing.assert_array_equal(getattr(scaled, name), getattr(expected, name) * scale)
    for name in ("normals", "feature", "count"):
        np.testing.assert_array_equal(getattr(scaled, name), getattr(expected, name))


def test_a_body_far_away_loses_no_more_than_its_coordinates_do() -> None:
    far = np.array([1e6, -2e6, 1e6])
    body, start = bump(15.0), above(100)
    moved = Surface(body.vertices + far, body.faces)
    near = Surface(moved.vertices - far, body.faces)  # the body that float64 has room for, out there
    expected = BallContact(near, 0.1).first_contact(start + far - far, DOWN)
    contacts = BallContact(moved, 0.1).first_contact(start + far, DOWN)
    eps = np.finfo(float).eps * 2e6
    np.testing.assert_allclose(contacts.centers - far, expected.centers, atol=eps)
    np.testing.assert_allclose(contacts.distance, expected.distance, atol=eps)
    np.testing.assert_allclose(contacts.normals, expected.normals, atol=1e-12)


def test_far_origins_cost_no_more_than_their_rounding() -> None:
    ball, start = BallContact(bump(15.0), 0.1), above(100)
    near = ball.first_contact(start, DOWN)
    far = ball.first_contact(start + np.array([0, 0, 1e6]), DOWN)
    np.testing.assert_allclose(far.centers, near.centers, atol=1e-14)
    np.testing.assert_allclose(far.distance, near.distance + 1e6, rtol=4e-16)


def test_rotation_turns_the_answer() -> None:
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    body, start = torus(), above(200)
    plain = BallContact(body, 0.3).first_contact(start, DOWN)
    turned = BallContact(Surface(body.vertices @ turn.T, body.faces), 0.3).first_contact(start @ turn.T, turn @ DOWN)
    np.testing.assert_allclose(turned.distance, plain.distance, atol=1e-13)
    hit = plain.count > 0
    np.testing.assert_allclose(turned.centers[hit], plain.centers[hit] @ turn.T, atol=1e-13)


def test_order_and_number_of_threads_do_not_matter() -> None:
    ball, start = BallContact(bump(15.0, 80), 0.1), above(5000)
    one = ball.first_contact(start, DOWN)
    three = ball.first_contact(start, DOWN, threads=3)
    for name, array in vars(one).items():
        np.testing.assert_array_equal(getattr(three, name), array)
    shuffle = np.random.default_rng(1).permutation(len(start))
    other = ball.first_contact(start[shuffle], DOWN)
    np.testing.assert_allclose(other.centers, one.centers[shuffle], atol=1e-14)
    np.testing.assert_array_equal(other.feature, one.feature[shuffle])


def test_each_part_of_a_cube_is_named() -> None:
    start = [[0.5, 0.25, 5], [1.1, 0.25, 5], [1.1, 1.1, 5], [3, 0, 5]]
    contacts = BallContact(box(), 0.5).first_contact(start, DOWN)
    assert contacts.feature.tolist() == [FACE, EDGE, VERTEX, NONE]
    assert contacts.count.tolist() == [1, 1, 1, 0]
    lift = [1.5, 1 + np.sqrt(0.25 - 0.01), 1 + np.sqrt(0.25 - 0.02)]
    np.testing.assert_allclose(contacts.centers[:3, 2], lift, rtol=1e-15)
    assert np.isnan(contacts.centers[3]).all() and contacts.distance[3] == np.inf


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_faces_are_met_from_both_sides(side: float) -> None:
    for body in (slotted_plate(), flipped(slotted_plate())):
        contacts = BallContact(body, 0.25).first_contact([[0.7, 0.3, 2.0 * side]], -side * -DOWN)
        np.testing.assert_allclose(contacts.centers, [[0.7, 0.3, 0.25 * side]], atol=1e-15)


def test_a_ball_on_a_fine_flat_mesh_or_on_a_shared_vertex_touches_once() -> None:
    flat = bump(0.0)
    contacts = BallContact(flat, 0.3).first_contact([[0.013, 0.021, 5], [0.0, 0.0, 5], [0.05, 0.013, 5]], DOWN)
    assert contacts.count.tolist() == [1, 1, 1]
    assert contacts.feature.tolist() == [FACE, VERTEX, EDGE]


def test_a_ball_in_a_corner_touches_three_planes() -> None:
    contacts = BallContact(box(), 0.25).first_contact([[0.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]])
    assert contacts.count.tolist() == [3]
    assert contacts.interference.all()
    np.testing.assert_allclose(contacts.centers, [[0.75, 0.75, 0.75]], rtol=1e-15)


def test_a_ball_over_a_slot_touches_both_of_its_edges() -> None:
    body = slotted_plate(0.3)
    contacts = BallContact(body, 0.5).first_contact([[0, 0.1, 3], [1e-3, 0.1, 3]], DOWN)
    assert contacts.count.tolist() == [2, 1]
    np.testing.assert_allclose(contacts.centers[0, 2], np.sqrt(0.5**2 - 0.15**2), rtol=1e-15)
    soup = Surface(body.vertices[body.faces].reshape(-1, 3), np.arange(3 * len(body.faces)).reshape(-1, 3))
    assert BallContact(soup, 0.5).first_contact([[0, 0.1, 3]], DOWN).count.tolist() == [2]


def test_a_ball_that_fits_a_bowl_touches_as_many_places_as_are_told_apart() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    posts = [np.array([[np.cos(a), np.sin(a), 0.0]] * 3) for a in angle]
    body = Surface(np.concatenate(posts), np.arange(120).reshape(-1, 3))  # forty points on a circle
    assert BallContact(body, 2.0).first_contact([[0.0, 0.0, 9.0]], DOWN).count.tolist() == [16]


def test_a_ball_that_starts_overlapping_says_so() -> None:
    contacts = BallContact(box(), 0.5).first_contact([[0, 0, 1.4], [0, 0, 1.5], [0, 0, 1.6], [0, 0, 0]], DOWN)
    assert contacts.overlap.tolist() == [True, False, False, False]
    assert contacts.count.tolist() == [0, 1, 1, 1]
    np.testing.assert_allclose(contacts.distance, [0, 0, 0.1, 0.5], atol=1e-15)
    assert np.isnan(contacts.centers[0]).all()


@pytest.mark.slow
def test_a_resting_ball_is_held_when_pressed_and_free_to_leave_or_roll() -> None:
    ball = BallContact(box(), 0.5)
    rest = ball.first_contact(above(50) * [1, 1, 3], DOWN).centers
    for direction, distance_ in ((DOWN, 0.0), (-DOWN, np.inf), ([1.0, 0.0, 0.0], np.inf), ([1, 0, -1e-3], 0.0)):
        contacts = ball.first_contact(rest, direction)
        np.testing.assert_allclose(contacts.distance, distance_, atol=1e-15)
        assert not contacts.overlap.any()
    rest = BallContact(bump(15.0), 0.1).first_contact(above(500), DOWN).centers
    again = BallContact(bump(15.0), 0.1).first_contact(rest, DOWN)
    np.testing.assert_allclose(again.centers, rest, atol=1e-15)
    np.testing.assert_allclose(again.distance, 0.0, atol=1e-15)


def test_a_ball_that_only_grazes_a_wall_falls_past_it_and_touches_it_at_rest() -> None:
    step = slotted_plate(1.0, 0.5)  # walls at x = -0.5 and 0.5, the floor at -0.5
    contacts = BallContact(step, 0.125).first_contact([[0.375, 0.1, 3.0], [0.375 + 1e-6, 0.1, 3.0]], DOWN)
    np.testing.assert_allclose(contacts.centers[:, 2], [-0.375, np.sqrt(0.125**2 - (0.125 - 1e-6) ** 2)], rtol=1e-9)
    assert contacts.count.tolist() == [2, 1]


def test_doubled_faces_unused_vertices_and_slivers_change_nothing() -> None:
    body, start = bump(15.0), above(300)
    plain = BallContact(body, 0.1).first_contact(start, DOWN)
    a, b = body.faces[0, :2]
    slivers = np.array([[a, b, a], [a, a, a], [a, b, b]])
    worse = merged(body, flipped(body), Surface(body.vertices, slivers))
    worse = Surface(np.concatenate([worse.vertices, [[0.0, 0.0, 50.0]]]), worse.faces)
    contacts = BallContact(worse, 0.1).first_contact(start, DOWN)
    np.testing.assert_allclose(contacts.centers, plain.centers, atol=1e-15)
    np.testing.assert_array_equal(contacts.count, plain.count)


def test_a_ball_far_larger_than_the_body_touches_its_top() -> None:
    for ratio in (1e3, 1e6, 1e9):
        contacts = BallContact(bump(15.0), ratio).first_contact([[0.0, 0.0, 2 * ratio]], DOWN)
        np.testing.assert_allclose(contacts.centers[0, 2], 1.0 + ratio, rtol=1e-15)
        assert contacts.count[0] == 1


def test_impossible_input_is_refused_with_its_reason() -> None:
    body = box()
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ContactError, match="tip radius must be a positive length"):
            BallContact(body, radius)
    with pytest.raises(ContactError, match="too small"):
        BallContact(body, 1e-14)
    ball = BallContact(body, 0.1)
    with pytest.raises(ContactError, match="finite; 1 are not, the first is number 1"):
        ball.first_contact([[0, 0, 3], [np.nan, 0, 3]], DOWN)
    with pytest.raises(ContactError, match="shape"):
        ball.first_contact([0.0, 0.0, 3.0], DOWN)
    with pytest.raises(ContactError, match="not zero"):
        ball.first_contact([[0, 0, 3]], [0.0, 0.0, 0.0])
    with pytest.raises(ContactError, match="directions must have shape"):
        ball.first_contact(np.zeros((3, 3)), np.ones((2, 3)))
    with pytest.raises(ContactError, match="threads"):
        ball.first_contact([[0, 0, 3]], DOWN, threads=0)


def test_no_queries_give_no_contacts() -> None:
    contacts = BallContact(box(), 0.1).first_contact(np.zeros((0, 3)), DOWN)
    assert len(contacts) == 0 and contacts.centers.shape == (0, 3)


def test_one_triangle_is_enough() -> None:
    body = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    contacts = BallContact(body, 2.0).first_contact([[0.25, 0.25, 9], [-1, -1, 9]], DOWN)
    np.testing.assert_allclose(contacts.centers[:, 2], [2.0, np.sqrt(2.0)], rtol=1e-15)
    assert contacts.feature.tolist() == [FACE, VERTEX]
    assert distance(body.vertices[body.faces], contacts.centers[1]) == pytest.approx(2.0, rel=1e-15)
