"""What positions prove of contacts (theory section 4.8): bounds that hold and are sharp, labels that say no more."""

from pathlib import Path

import numpy as np
import pytest

from explore3d.bench.precision.labels import bench_labels, label_raster, plane_proof
from mapping.errors import EnvelopeError
from mapping.estimate.envelope.envelope import BRIDGED, TOUCHED, estimate_surface
from mapping.estimate.envelope.proof import Balls
from mapping.estimate.envelope.proof_kernels import farthest_contact
from mapping.estimate.envelope.sweep_mesh import sweep_faces
from mapping.geometry.contact.first_contact import BallContact
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

SHARED = Path(__file__).parents[5] / "shared" / "data"


def raster(height, pitch=0.1, spacing=0.02, extent=1.0):
    """Sweeps of a ball of radius 1 whose centre is at z = height(x, y)."""
    x, y = np.arange(-extent, extent, spacing) + 0.0013, np.arange(-extent, extent, pitch) + 0.0071
    u, v = (grid.ravel() for grid in np.meshgrid(x, y))
    return Trace(np.arange(len(u)), np.column_stack([u, v, height(u, v)]), np.repeat(np.arange(len(y)), len(x)), 1.0)


def inner(estimate, extent=0.7):
    return (np.abs(estimate.centers[:, :2]) < extent).all(axis=1)


def test_the_farthest_contact_is_the_farthest_of_many_directions():
    rng, contact = np.random.default_rng(3), np.empty(3)
    tried = rng.normal(size=(200_000, 3))
    tried /= np.linalg.norm(tried, axis=1, keepdims=True)
    for _ in range(100):
        axes = rng.normal(size=(5, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        bounds, place = rng.uniform(0.0, 0.6, 5), rng.normal(size=3)
        allowed = (tried @ axes.T <= bounds).all(axis=1)
        found = farthest_contact(place, axes, bounds, 5, contact)
        best = np.linalg.norm(tried[allowed] - place, axis=1).max(initial=0.0)
        assert found >= best - 1e-12
        assert np.isinf(found) or np.linalg.norm(contact - place) == pytest.approx(found)
        if allowed.sum() > 20_000:  # a large patch is tried densely
            assert found <= best + 0.05


def test_no_direction_allowed_proves_nothing():
    axes = np.vstack([np.eye(3), -np.eye(3)])
    assert np.isinf(farthest_contact(np.zeros(3), axes, np.full(6, 0.5), 6, np.empty(3)))


@pytest.mark.parametrize(("pitch", "spacing"), [(0.1, 0.02), (0.2, 0.2)])
def test_a_plane_is_known_to_half_the_diagonal_of_the_sampling(pitch, spacing):
    estimate = estimate_surface(raster(lambda x, y: 0 * x + 1, pitch, spacing), spacing=0.0)
    corner = 0.5 * np.array([spacing, pitch])
    sag = 1 - np.sqrt(1 - corner @ corner)  # the corner lies on the ball, above the plane
    np.testing.assert_allclose(estimate.below[inner(estimate)], np.hypot(np.linalg.norm(corner), sag), rtol=1e-6)
    assert not estimate.above.any()


def test_a_needle_at_every_corner_of_the_patches_gives_the_same_positions():
    # the bound is reached: these needles touch each ball, are in none, and are as far from the points as it says
    pitch = 0.2
    estimate = estimate_surface(raster(lambda x, y: 0 * x + 1, pitch, pitch), spacing=0.0)
    half = 0.5 * pitch
    needles = estimate.centers + np.array([half, half, -np.sqrt(1 - 2 * half**2)])
    away = np.linalg.norm(needles[:, None] - estimate.centers[None], axis=2)
    assert away.min() > 1 - 1e-12
    there = inner(estimate)
    np.testing.assert_allclose(
        np.linalg.norm(needles - estimate.points, axis=1)[there], estimate.below[there], rtol=1e-6
    )


def test_on_an_oblique_plane_needles_at_the_corners_of_the_patches_are_as_far_as_the_bound():
    # contacts lie .04 (1, 0, 1) apart along the sweeps and .2 (0, 1, 2) from one to the next: a rectangle of .04
    # (1, 0, 1) and .2 (-1, 1, 1), whose neighbours across are five samples on in the next sweep
    estimate = estimate_surface(raster(lambda x, y: x + 2 * y + np.sqrt(6), 0.2, 0.04), spacing=0.0, tolerance=0.0)
    corner = 0.02 * np.array([1, 0, 1]) + 0.1 * np.array([-1, 1, 1])
    needles = estimate.centers + corner - np.sqrt(1 - corner @ corner) * np.array([-1, -2, 1]) / np.sqrt(6)
    there = inner(estimate)
    away = np.linalg.norm(needles[there][:, None] - estimate.centers[None], axis=2)
    assert away.min() > 1 - 1e-12
    np.testing.assert_allclose(
        np.linalg.norm(needles - estimate.points, axis=1)[there], estimate.below[there], rtol=1e-6
    )


def test_a_tip_that_many_balls_touch_is_known_without_any_assumption():
    trace = raster(lambda x, y: np.sqrt(1 - x**2 - y**2), 0.05, 0.05, 0.4)
    faces = sweep_faces(trace.centers, trace.sweep, trace.centers)
    balls = Balls(trace.centers, trace.sweep, np.broadcast_to([0.0, 0.0, 1.0], trace.centers.shape), 1.0, 1e-12)
    own = np.arange(len(trace))
    below, above = balls.reach(np.zeros((len(trace), 3)), own[:, None], own, faces, None, 0.0)
    inside = (np.abs(trace.centers[:, :2]) < 0.3).all(axis=1)
    assert inside.sum() > 100
    assert below[inside].max() <= 1e-6
    assert above.max() <= 1e-12


def test_the_flanks_of_a_valley_lie_within_their_intervals_and_contacts_at_its_kink_are_no_samples():
    slope = 0.3
    trace = raster(lambda x, y: 1 / np.cos(slope) + np.abs(x + 0.2 * y) / np.sqrt(1.04) * np.tan(slope))
    estimate = estimate_surface(trace, tolerance=0.1)
    u = np.abs(estimate.points[:, 0] + 0.2 * estimate.points[:, 1]) / np.sqrt(1.04)
    off = (estimate.points[:, 2] - u * np.tan(slope)) * np.cos(slope)
    assert (off <= estimate.below + 1e-9).all()
    assert (off >= -estimate.above - 1e-9).all()
    assert (estimate.labels == BRIDGED).any()
    touched = estimate.labels == TOUCHED
    assert touched.mean() > 0.5
    assert estimate.below[touched].max() <= 0.1


def test_recorded_contacts_are_known():
    trace = raster(lambda x, y: np.sqrt(16 - x**2 - y**2) - 3)
    normals = (trace.centers - [0, 0, -3]) / 4
    recorded = Trace(trace.t, trace.centers, trace.sweep, 1.0, normals=normals)
    estimate = estimate_surface(recorded, "contact", tolerance=1e-9)
    assert (estimate.labels == TOUCHED).all()
    assert estimate.below.max() <= 1e-15


def test_a_finer_tolerance_calls_fewer_points_touched():
    trace = raster(lambda x, y: np.sqrt(16 - x**2 - y**2) - 3)
    shares = [estimate_surface(trace, tolerance=t).fraction(TOUCHED) for t in (1.0, 0.05, 0.03, 0.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.85
    assert shares[-1] == 0.0


def test_sweeps_that_prove_no_more_than_the_ball_does_are_said_to():
    trace = raster(lambda x, y: 0 * x + 1)
    close, far = (estimate_surface(trace, tolerance=t).sentence() for t in (0.5, 1.5))
    assert "comes within 500 mm of what is touched" in close
    assert "comes within" not in far
    assert "too far apart to prove to better than the ball's radius, 1 m, where between them" in far


def test_noise_widens_what_is_proven_and_the_body_stays_within():
    rng = np.random.default_rng(5)
    sigma = 1e-3
    exact = raster(lambda x, y: np.sqrt(16 - x**2 - y**2) - 3, 0.1, 0.002)
    away = (exact.centers - [0, 0, -3]) / 4
    noisy = Trace(exact.t, exact.centers + sigma * rng.standard_normal((len(exact), 1)) * away, exact.sweep, 1.0)
    estimate = estimate_surface(noisy, noise=Noise(sigma), tolerance=0.15)
    off = np.linalg.norm(estimate.points - [0, 0, -3], axis=1) - 3
    there = inner(estimate)
    assert estimate.fraction(TOUCHED) > 0.5
    assert (off <= estimate.below)[there].all()
    assert (off >= -estimate.above)[there].all()
    assert estimate.above.min() >= 4 * estimate.sd


@pytest.mark.parametrize("tolerance", [-1e-3, np.nan, np.inf])
def test_a_tolerance_that_is_no_length_is_refused(tolerance):
    with pytest.raises(EnvelopeError, match="tolerance of touched points"):
        estimate_surface(raster(lambda x, y: 0 * x + 1), tolerance=tolerance)


@pytest.mark.slow
def test_a_part_with_holes_lies_within_its_intervals():
    positions, contacts = bench_labels(["holed_plate"], None, [0.05], [5], directions=1)
    assert positions.outside == contacts.outside == 0
    assert positions.beyond == contacts.beyond == 0
    assert positions.touched > 0.5
    assert contacts.worst <= 1e-6


@pytest.mark.parametrize("lean", [pytest.param(0.0, marks=pytest.mark.slow), 0.7, 1.2])
def test_what_a_plane_allows_to_prove_is_what_is_proven_of_it(lean):
    way = np.array([np.sin(lean) * 0.6, np.sin(lean) * 0.8, -np.cos(lean)])
    half = 4 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    plane = Surface(half, np.array([[0, 1, 2], [0, 2, 3]]))
    trace, away = label_raster(plane, BallContact(plane, 1.0), 0.2, way)
    estimate = estimate_surface(Trace(trace.t, trace.centers, trace.sweep, 1.0), outward=away, spacing=0.0, tolerance=0)
    expected = plane_proof(np.array([[0.0, 0.0, 1.0]]), 0.2, way, 1.0)
    np.testing.assert_allclose(estimate.below[inner(estimate, 1.5)], expected[0], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("body", ["bunny", "fandisk", "spot", "holed_plate"])
def test_bodies_lie_within_their_intervals_and_half_of_what_can_be_proven_is_touched(body):
    if body != "holed_plate" and not SHARED.exists():
        pytest.skip("the shared meshes are not there")
    for each in bench_labels([body], SHARED):
        assert each.outside == 0
        assert each.beyond == 0
        assert each.worst_strict <= 1e-6
        # where faces are so oblique that needles between the samples would give the same positions, none can be
        if each.method == "positions" and each.per_radius == 5:
            assert each.touched_fine >= 0.5
        if each.method == "contacts":
            assert each.worst <= 1e-6
