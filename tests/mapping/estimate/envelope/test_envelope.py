"""The estimated surface and its labels, against bodies whose traces have closed forms (theory section 4)."""

import time
import tracemalloc

import numpy as np
import pytest

from mapping.estimate.envelope import envelope
from mapping.estimate.envelope.envelope import BRIDGED, EXTRAPOLATED, TOUCHED, EnvelopeError, estimate_surface
from mapping.estimate.envelope.estimate import Estimate
from mapping.geometry.contact.first_contact import BallContact
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

R = 0.01  # tip radius, m


def wire(x, height=0.65e-3, r=R):
    """Trace over a wire on a plane."""
    reach = r + height / 2
    cap = height - x**2 / (reach + np.sqrt(np.maximum(reach**2 - x**2, 0.0)))
    return r + np.where(np.abs(x) < reach, np.maximum(cap, 0.0), 0.0)


def groove(x, width=1e-3, r=R):
    """Trace over a deep rectangular groove."""
    arm = np.maximum(width / 2 - np.abs(x), 0.0)
    return np.sqrt((r - arm) * (r + arm))


def step(x, height=2e-3, r=R):
    """Trace up a step at x = 0."""
    arc = height + np.sqrt(np.maximum((r - x) * (r + x), 0.0))
    return np.where(x > 0, height + r, np.maximum(np.where(x > -r, arc, 0.0), r))


def vee(x, slope=0.3, r=R):
    """Trace over a V-groove whose flanks rise by the angle `slope`."""
    return r / np.cos(slope) + np.abs(x) * np.tan(slope)


def wire_distance(p, height=0.65e-3):
    a = height / 2
    return np.minimum(np.abs(np.hypot(p[:, 0], p[:, 2] - a) - a), np.abs(p[:, 2]) + 10 * (np.abs(p[:, 0]) < 1e-9))


CASES = {
    "wire": (wire, wire_distance, [(-3.605551275463989e-3, -1.1349192876763e-4)] * 2),
    "groove": (groove, lambda p: np.abs(p[:, 2]) + 10 * (np.abs(p[:, 0]) < 0.5e-3 - 1e-10), [(-0.5e-3, 0.5e-3)]),
    "step": (
        step,
        lambda p: np.where(p[:, 0] < -1e-10, np.abs(p[:, 2]), np.abs(p[:, 2] - 2e-3)),
        [(-np.sqrt(2 * R * 2e-3 - 2e-3**2), 0.0)],
    ),
    "vee": (
        vee,
        lambda p: np.abs(p[:, 2] - np.abs(p[:, 0]) * np.tan(0.3)) * np.cos(0.3),
        [(-R * np.sin(0.3), R * np.sin(0.3))],
    ),
}


def strips(estimate):
    """Ends along x of every run of bridged points: the contacts that bound it."""
    bridged = np.flatnonzero(np.diff(np.r_[0, estimate.labels == BRIDGED, 0]))
    return [(estimate.points[a - 1, 0], estimate.points[b, 0]) for a, b in bridged.reshape(-1, 2)]


@pytest.mark.parametrize("spacing", [6e-6, 4e-5])
@pytest.mark.parametrize("case", CASES)
def test_touched_points_lie_on_the_body(case, spacing):
    trace_of, distance, _ = CASES[case]
    x = np.arange(-0.012, 0.012, spacing) + 1.234e-6
    estimate = estimate_surface(Trace.from_profile(x, trace_of(x), R))
    touched = estimate.labels == TOUCHED
    assert touched.sum() > 0.9 * len(x)
    assert distance(estimate.points[touched]).max() <= 1e-9 * R


@pytest.mark.parametrize("spacing", [6e-6, 4e-5])
@pytest.mark.parametrize("case", CASES)
def test_bridged_points_cover_exactly_the_unreachable_strips(case, spacing):
    trace_of, _, expected = CASES[case]
    if case == "wire":
        (low, high), _ = expected
        expected = [(low, high), (-high, -low)]
    x = np.arange(-0.012, 0.012, spacing) + 1.234e-6
    found = strips(estimate_surface(Trace.from_profile(x, trace_of(x), R)))
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * R)


@pytest.mark.parametrize("case", ["wire", "groove", "step", "vee"])
def test_no_point_of_the_estimate_lies_inside_a_ball(case):
    trace_of = CASES[case][0]
    x = np.arange(-0.012, 0.012, 2e-5) + 1.234e-6
    trace = Trace.from_profile(x, trace_of(x), R)
    points = estimate_surface(trace).points
    nearest = np.sqrt(((points[:, None, :] - trace.centers[None]) ** 2).sum(-1)).min(axis=1)
    assert nearest.min() >= R * (1 - 1e-9)


def test_a_smooth_dent_gentler_than_the_tip_is_touched_throughout():
    x = np.linspace(-0.01, 0.01, 2001)
    bowl = 1.25 * R  # radius of the bowl; the trace has the radius bowl - R
    trace = Trace.from_profile(x * 0.1, bowl - np.sqrt((0.25 * R) ** 2 - (0.1 * x) ** 2), R)
    estimate = estimate_surface(trace)
    assert (estimate.labels == TOUCHED).all()
    assert np.abs(np.hypot(estimate.points[:, 0], estimate.points[:, 2] - bowl) - bowl).max() < 1e-9 * R


def test_a_kink_that_falls_on_a_sample_is_found():
    x = np.arange(-500, 501) * 2e-5
    found = strips(estimate_surface(Trace.from_profile(x, vee(x), R)))
    np.testing.assert_allclose(found, [(-R * np.sin(0.3), R * np.sin(0.3))], atol=1e-7 * R)


def test_where_the_finger_was_lifted_the_surface_is_extrapolated():
    x = np.r_[np.arange(0.0, 0.01, 1e-5), np.arange(0.02, 0.03, 1e-5)]
    estimate = estimate_surface(Trace.from_profile(x, np.full_like(x, R), R))
    gap = (estimate.points[:, 0] > 0.01) & (estimate.points[:, 0] < 0.02 - 1e-9)
    assert gap.any()
    assert (estimate.labels[gap] == EXTRAPOLATED).all()
    assert (estimate.labels[~gap] == TOUCHED).all()


def test_a_finger_that_stands_still_changes_nothing():
    x = np.arange(-0.01, 0.01, 2e-5) + 1e-6
    once = estimate_surface(Trace.from_profile(x, wire(x), R))
    twice = estimate_surface(Trace.from_profile(np.repeat(x, 2), np.repeat(wire(x), 2), R))
    np.testing.assert_array_equal(once.points, twice.points)
    assert twice.sample.max() == 2 * once.sample.max()


@pytest.mark.parametrize("scale", [2.0**-40, 2.0**30])
def test_the_estimate_scales_exactly_with_powers_of_two(scale):
    x = np.arange(-0.01, 0.01, 2e-5) + 1e-6
    once = estimate_surface(Trace.from_profile(x, wire(x), R))
    scaled = estimate_surface(Trace.from_profile(x * scale, wire(x) * scale, R * scale))
    np.testing.assert_array_equal(scaled.labels, once.labels)
    np.testing.assert_array_equal(scaled.points, once.points * scale)


def test_a_place_far_away_costs_only_the_digits_of_the_place():
    x = np.arange(-0.01, 0.01, 2e-5) + 1e-6
    estimate = estimate_surface(Trace.from_profile(x + 1e6, wire(x), R))
    local = estimate.points - [1e6, 0, 0]
    touched = estimate.labels == TOUCHED
    assert wire_distance(local[touched]).max() < 4 * np.finfo(float).eps * 1e6


def rows(height, pitch=0.1, spacing=0.01, extent=2.0, bend=0.0):
    """Boustrophedon sweeps over the trace z = height(x, y) of a ball of radius 1."""
    x = np.arange(-extent, extent + spacing / 2, spacing) + 0.00123
    parts = []
    for k, y in enumerate(np.arange(-extent, extent + pitch / 2, pitch) + 0.0137):
        along = x if k % 2 == 0 else x[::-1]
        across = y + bend * np.sin(along)
        parts.append(np.column_stack([along, across, height(along, across)]))
    centers = np.vstack(parts)
    return Trace(np.arange(len(centers)), centers, np.repeat(np.arange(len(parts)), len(x)), 1.0)


def sphere(x, y):
    return np.sqrt(16 - x**2 - y**2) - 3


@pytest.mark.slow
@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_sweeps_over_a_sphere_become_a_mesh_on_the_sphere(bend):
    trace = rows(sphere, bend=bend)
    estimate = estimate_surface(trace)
    distance = np.abs(np.linalg.norm(estimate.points - [0, 0, -3], axis=1) - 3)
    inner = (np.abs(estimate.points[:, :2]) < 1.2).all(axis=1)
    touched = estimate.labels == TOUCHED
    assert touched[inner].all()
    assert distance[touched].max() < 1e-9
    # The outermost sweeps have neighbours on one side only and cannot be sure: there, and only there, it says so.
    assert touched.mean() > 0.9
    assert distance.max() < 1e-4
    assert estimate.surface is not None
    np.testing.assert_array_equal(estimate.surface.vertices, estimate.points)
    assert (estimate.surface.face_normals[:, 2] > 0.5).all()


@pytest.mark.slow
def test_slopes_across_the_sweeps_converge_with_the_pitch():
    errors = []
    for pitch in (0.4, 0.2):
        estimate = estimate_surface(rows(sphere, pitch=pitch))
        inner = (np.abs(estimate.points[:, :2]) < 0.8).all(axis=1)
        errors.append(np.abs(np.linalg.norm(estimate.points[inner] - [0, 0, -3], axis=1) - 3).max())
    # Slopes of fourth order move the contact by its square: the eighth power of the pitch, or better.
    assert errors[0] / errors[1] > 2**6


def test_a_wire_across_the_sweeps_is_bridged_on_both_sides_and_touched_elsewhere():
    height = 0.065
    estimate = estimate_surface(rows(lambda x, y: wire(x, height, 1.0)))
    reach, crest = np.sqrt(2 * height), height / 2 / (1 + height / 2) * np.sqrt(2 * height)
    x = np.abs(estimate.points[:, 0])
    strip = (x > crest + 1e-9) & (x < reach - 1e-9)
    np.testing.assert_array_equal(estimate.labels == BRIDGED, strip)
    touched = estimate.labels == TOUCHED
    assert wire_distance(estimate.points[touched], height).max() < 1e-9


def test_a_wire_along_the_sweeps_is_bridged_between_them():
    height = 0.065
    estimate = estimate_surface(rows(lambda x, y: wire(y, height, 1.0)))
    reach, crest = np.sqrt(2 * height), height / 2 / (1 + height / 2) * np.sqrt(2 * height)
    y = np.abs(estimate.points[:, 1])
    bridged = estimate.labels == BRIDGED
    assert bridged.sum() > 100
    assert ((y > crest) & (y < reach))[bridged].all()
    assert not ((y > crest + 1e-3) & (y < reach - 1e-3))[~bridged].any()


@pytest.mark.parametrize("angle", [0.3, 0.6, 0.9, 1.2])
def test_a_wire_oblique_to_the_sweeps_is_touched_only_where_it_was_touched(angle):
    height = 0.065

    def across(x, y):
        return np.cos(angle) * x + np.sin(angle) * y

    estimate = estimate_surface(rows(lambda x, y: wire(across(x, y), height, 1.0)))
    inner = (np.abs(estimate.points[:, :2]) < 1.5).all(axis=1)
    points = estimate.points[inner & (estimate.labels == TOUCHED)]
    error = wire_distance(np.column_stack([across(points[:, 0], points[:, 1]), 0 * points[:, 0], points[:, 2]]), height)
    assert len(points) > 2000
    assert error.max() <= 1e-9


@pytest.mark.parametrize(
    "angle", [pytest.param(0.0, marks=pytest.mark.slow), 0.2, pytest.param(0.4, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    ("trace_of", "low", "high"),
    [
        (lambda u: groove(u, 0.3, 1.0), -0.15, 0.15),
        (lambda u: vee(u, 0.3, 1.0), -np.sin(0.3), np.sin(0.3)),
        (lambda u: step(u, 0.2, 1.0), -0.6, 0.0),
    ],
    ids=["groove", "vee", "step"],
)
def test_strips_that_cross_the_sweeps_are_bridged_from_end_to_end(trace_of, low, high, angle):
    def across(x, y):
        return np.cos(angle) * x + np.sin(angle) * y

    estimate = estimate_surface(rows(lambda x, y: trace_of(across(x, y))))
    errors = []
    for k in np.unique(estimate.sweep)[3:-3]:
        own = np.flatnonzero(estimate.sweep == k)
        own = own[: 1 + int(np.argmax(np.diff(own, append=len(estimate.labels) + 1) > 1))]  # points of faces follow
        bridged = own[estimate.labels[own] == BRIDGED]
        ends = across(*estimate.points[[bridged[0] - 1, bridged[-1] + 1], :2].T)
        errors.append(np.abs(np.sort(ends) - [low, high]).max())
    # Where the slope across changes faster than the rows tell, the sampling decides: never more than two pitches.
    share, limit = (0.9, 1e-7) if angle < 0.4 else (0.5, 1e-4)
    assert np.quantile(errors, share) <= limit
    assert np.max(errors) <= 0.025
    if angle == 0.0:
        assert np.max(errors) <= 1e-9


def slotted_plate(width, depth, size=4.0):
    """A plate at z = 0 with a slot along y, as a mesh."""
    x = np.array([-size, -width / 2, -width / 2, width / 2, width / 2, size])
    z = np.array([0.0, 0.0, -depth, -depth, 0.0, 0.0])
    line = np.column_stack([x, z])
    vertices = np.vstack([np.column_stack([x, np.full(6, y), z]) for y in (-size, size)])
    k = np.arange(len(line) - 1)
    faces = np.vstack([np.column_stack([k, k + 1, k + 7]), np.column_stack([k, k + 7, k + 6])])
    return Surface(vertices, faces)


@pytest.mark.parametrize("method", ["envelope", "contact"])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_slot_in_a_plate_traced_by_exact_contact_is_bridged_from_edge_to_edge(method, angle):
    width, depth = 0.3, 0.5
    centers, normals, sweeps = [], [], []
    contact = BallContact(slotted_plate(width, depth), 1.0)
    x = np.arange(-1.0, 1.0, 0.01) + 1.3e-3
    for k, offset in enumerate(np.arange(-0.5, 0.5, 0.1)):
        start = np.column_stack([x, offset + np.tan(angle) * x, np.full_like(x, 3.0)])
        found = contact.first_contact(start, np.array([0.0, 0.0, -1.0]))
        centers.append(found.centers)
        normals.append(found.normals)
        sweeps.append(np.full(len(x), k))
    trace = Trace(np.arange(sum(map(len, sweeps))), np.vstack(centers), np.concatenate(sweeps), 1.0)
    if method == "contact":
        trace = Trace(trace.t, trace.centers, trace.sweep, 1.0, normals=np.vstack(normals))
    estimate = estimate_surface(trace, method)
    points = estimate.points
    inside = np.abs(points[:, 0]) < width / 2 - 1e-7
    touched = estimate.labels == TOUCHED
    assert touched.mean() > 0.4
    assert not (touched & inside).any()
    assert np.abs(points[touched, 2]).max() <= 1e-9
    assert inside.any()
    assert (points[inside, 2] <= 1e-9).all()
    assert points[inside, 2].min() >= -(1 - np.sqrt(1 - width**2 / 4)) - 1e-9


def test_recorded_normals_give_the_contacts_themselves():
    trace = rows(sphere)
    normals = (trace.centers - [0, 0, -3]) / 4
    with_contact = Trace(trace.t, trace.centers, trace.sweep, 1.0, normals=normals)
    estimate = estimate_surface(with_contact, "contact")
    assert np.abs(np.linalg.norm(estimate.points - [0, 0, -3], axis=1) - 3).max() < 1e-9
    assert (estimate.labels == TOUCHED).all()


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_a_line_swept_twice_leaves_nothing_standing_on_the_plate(seed):
    """Two passes over one line lie nearer to one another than their noise: no slope follows from them."""
    rng, noise, tip = np.random.default_rng(seed), 50e-6, 4e-3
    x = np.arange(-20e-3, 20e-3, 0.03e-3)
    rows = [0.0, 0.0, 2e-3, 4e-3, 6e-3]
    centers = np.concatenate([np.column_stack([x, np.full_like(x, y), np.full_like(x, tip)]) for y in rows])
    centers += noise * rng.standard_normal(centers.shape)
    trace = Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(len(rows)), len(x)), tip)
    estimate = estimate_surface(trace, noise=Noise(noise, 0.0, 0.0))
    assert np.abs(estimate.points[:, 2]).max() < 2 * noise
    assert estimate.normals[:, 2].min() > 0.9


def test_crossing_sweeps_become_one_mesh():
    first = rows(sphere, pitch=0.2, spacing=0.02)
    turned = Trace(first.t, first.centers[:, [1, 0, 2]], first.sweep + 1000, 1.0)
    estimate = estimate_surface(Trace.concatenate([first, turned]))
    inner = (np.abs(estimate.points[:, :2]) < 1.2).all(axis=1)
    assert np.abs(np.linalg.norm(estimate.points[inner] - [0, 0, -3], axis=1) - 3).max() < 1e-4
    assert estimate.surface is not None
    assert (estimate.surface.face_normals[:, 2] > 0).mean() > 0.99


def test_the_papers_equation_12_alone_fills_a_kink_with_points_inside_other_balls():
    x = np.arange(-0.01, 0.01, 2e-5) + 1.1e-6
    trace = Trace.from_profile(x, wire(x), R)
    naive, exact = estimate_surface(trace, "normals"), estimate_surface(trace)
    assert not (naive.labels == BRIDGED).any()
    assert (exact.labels == BRIDGED).any()


@pytest.mark.parametrize("crosswise", [False, True])
def test_sweeps_laid_out_one_by_one_become_the_same_surface_as_all_at_once(crosswise, monkeypatch):
    trace = rows(lambda x, y: wire(x + 0.5 * y, r=1.0, height=0.2), pitch=0.2, spacing=0.02)
    if crosswise:
        trace = Trace.concatenate([trace, Trace(trace.t, trace.centers[:, [1, 0, 2]], trace.sweep + 1000, 1.0)])
    above = trace.centers[1000:1050] * [1.0, 1.0, 0.0] + np.array(
        [0.0, 0.0, 1.6]
    )  # not one of its contacts is possible
    trace = Trace.concatenate([trace, Trace(trace.t[:50], above, np.full(50, 5000), 1.0)])
    at_once = estimate_surface(trace)
    monkeypatch.setattr(envelope, "CONTACTS_AT_ONCE", 1)
    one_by_one = estimate_surface(trace)
    assert at_once.surface is not None and one_by_one.surface is not None
    np.testing.assert_array_equal(one_by_one.surface.vertices, at_once.surface.vertices)
    np.testing.assert_array_equal(one_by_one.surface.faces, at_once.surface.faces)
    np.testing.assert_array_equal(one_by_one.labels, at_once.labels)
    np.testing.assert_array_equal(one_by_one.sample, at_once.sample)
    assert not (one_by_one.sweep == 5000).any()


def test_contacts_of_long_recordings_are_thinned_before_the_next_are_laid_out():
    def sweeps():
        for number in range(16):
            x = np.linspace(0.0, 1.0, 2**15)
            points = np.column_stack([x, np.full_like(x, 0.1 * number), 0 * x])
            up, sample = np.broadcast_to([0.0, 0.0, 1.0], points.shape), np.arange(len(x))
            row = np.zeros(len(x), dtype=np.int8), sample, np.full(len(x), number)
            yield Estimate.unproven(points, up, points + up, *row, up)

    tracemalloc.start()
    points = envelope._possible(sweeps(), lambda at, slack: np.zeros(len(at)), 0.0, envelope._Thinning(0.01, True))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(points.points) == 16 * 101
    assert peak < 50e6  # all of them are 70 MB, and were joined and thinned by a quarter of a million


def test_of_too_many_points_there_remain_as_many_as_anybody_sees(monkeypatch):
    trace = rows(sphere, pitch=0.2, spacing=0.02)
    every = estimate_surface(trace)
    monkeypatch.setattr(envelope, "MOST_POINTS", len(every.points) // 2)
    fewer = estimate_surface(trace)
    assert 0.3 * len(every.points) < len(fewer.points) < 0.6 * len(every.points)
    assert {tuple(point) for point in fewer.points} <= {tuple(point) for point in every.points}


def test_smoothing_by_the_noise_removes_the_bias_of_the_envelope():
    rng = np.random.default_rng(0)
    sigma, x = 2e-4, np.arange(-0.03, 0.03, 6e-6)
    noisy = Trace.from_profile(x, R + sigma * rng.standard_normal(len(x)), R)
    estimate = estimate_surface(noisy, noise=Noise(sigma))
    assert abs(estimate.points[estimate.labels == TOUCHED, 2].mean()) < 0.1 * sigma
    assert estimate.fraction(TOUCHED) > 0.95


@pytest.mark.slow
def test_a_million_samples_are_estimated_in_a_few_seconds():
    x = np.linspace(0, 1, 1_000_000)
    trace = Trace.from_profile(x, 0.01 * np.sin(30 * x), 0.05)
    estimate_surface(trace.select(slice(0, 100)))
    start = time.process_time()
    estimate = estimate_surface(trace)
    assert time.process_time() - start < 4.0
    assert estimate.fraction(TOUCHED) == 1.0


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_very_short_sweeps_are_estimated(count):
    x = np.arange(count) * 1e-4
    estimate = estimate_surface(Trace.from_profile(x, np.full(count, R), R))
    np.testing.assert_allclose(estimate.points, np.column_stack([x, 0 * x, 0 * x]), atol=1e-12 * R)


def test_what_cannot_be_estimated_is_said():
    trace = Trace.from_profile([0.0, 1e-4], [R, R], R)
    with pytest.raises(EnvelopeError, match="possible: envelope, contact, normals"):
        estimate_surface(trace, "magic")
    with pytest.raises(EnvelopeError, match="recorded contact normals"):
        estimate_surface(trace, "contact")
    with pytest.raises(EnvelopeError, match="no samples"):
        estimate_surface(trace.select(slice(0, 0)))
