"""The simulated finger against closed forms of contact and of its noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from hw.errors import FingerError
from hw.finger import Finger
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from hw.simulated.noise_source import NoiseSource, ornstein_uhlenbeck
from mapping.surface import Surface

R = 0.01


def plate(size: float = 0.1) -> Surface:
    corners = np.array([[0, 0, 0], [size, 0, 0], [size, size, 0], [0, size, 0]], dtype=float)
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


def across(y: float = 0.05, low: float = 0.01, high: float = 0.09, **settings: float) -> Move:
    path = np.array([[low, y, 0.98 * R], [high, y, 0.98 * R]])
    return Move(path, np.array([0.0, 0.0, -1.0]), **settings)


def test_without_noise_the_centre_runs_a_tip_radius_above_a_plane() -> None:
    trace = SimulatedFinger(object=plate(), tip_radius=R).execute(across())
    assert np.abs(trace.centers[:, 2] - R).max() < 1e-15
    assert np.allclose(np.diff(trace.t), 1 / 5000, rtol=1e-9)
    assert np.allclose(np.diff(trace.centers[:, 0]), 0.03 / 5000, rtol=1e-9)
    assert len(trace) == int(0.08 / 0.03 * 5000) + 1


def test_a_step_is_climbed_on_an_arc_of_the_tip_radius() -> None:
    low, high, h = plate(), plate(), 0.001
    raised = high.vertices + np.array([0.05, 0.0, h])
    body = Surface(np.concatenate([low.vertices, raised]), np.concatenate([low.faces, high.faces + 4]))
    trace = SimulatedFinger(object=body, tip_radius=R).execute(across())
    beyond = np.clip(0.05 - trace.centers[:, 0], 0.0, np.sqrt(2 * R * h - h * h))
    assert np.abs(trace.centers[:, 2] - np.maximum(R, h + np.sqrt(R * R - beyond**2))).max() < 1e-12


def test_samples_off_the_body_are_left_out() -> None:
    trace = SimulatedFinger(object=plate(), tip_radius=R).execute(across(high=0.15))
    assert 0.1 < trace.centers[:, 0].max() < 0.11
    miss = SimulatedFinger(object=plate(), tip_radius=R).execute(across(y=-0.03))
    assert len(miss) == 0


def test_the_same_seed_feels_the_same_and_another_seed_something_else() -> None:
    first, again, other = (SimulatedFinger(object=plate(), tip_radius=R, white=1e-4, seed=s) for s in (1, 1, 2))
    one, two = first.execute(across()), again.execute(across())
    assert np.array_equal(one.centers, two.centers)
    assert not np.array_equal(one.centers, other.execute(across()).centers)
    assert not np.array_equal(one.centers, first.execute(across()).centers)


def test_every_sweep_has_a_larger_number_and_later_times() -> None:
    finger = SimulatedFinger(object=plate(), tip_radius=R)
    traces = [finger.execute(across(y)) for y in (0.02, 0.05, 0.08)]
    assert [int(trace.sweep[0]) for trace in traces] == [1, 2, 3]
    assert all(a.t[-1] < b.t[0] for a, b in pairwise(traces))


def test_travel_and_retreat_return_no_samples() -> None:
    finger = SimulatedFinger(object=plate(), tip_radius=R)
    assert len(finger.execute(across(purpose="travel"))) == 0
    assert finger.clock == pytest.approx(0.08 / 0.03)


def test_white_noise_has_the_asked_level_on_every_component() -> None:
    clean = SimulatedFinger(object=plate(), tip_radius=R).execute(across())
    noisy = SimulatedFinger(object=plate(), tip_radius=R, white=2e-4).execute(across())
    error = noisy.centers - clean.centers
    # the relative standard error of a standard deviation of 13 000 draws is 0.6 %
    assert np.abs(error.std(axis=0) / 2e-4 - 1).max() < 0.03


def test_correlated_noise_has_the_asked_covariance_at_any_spacing() -> None:
    rng = np.random.default_rng(3)
    for step in (0.006, 0.7):
        paths = ornstein_uhlenbeck(rng, (400, 3000), step, 2.0)
        lag = max(1, round(1.0 / step))
        assert np.var(paths[0]) == pytest.approx(4.0, rel=0.15)
        assert np.mean(paths[-1] * paths[-1 - lag]) == pytest.approx(4.0 * np.exp(-lag * step), rel=0.2)


def test_contact_data_are_unit_normals_tilted_by_the_angle_noise() -> None:
    finger = SimulatedFinger(object=plate(), tip_radius=R, contact_data=True, angle=np.radians(1.0), contact=5e-4)
    trace = finger.execute(across())
    assert trace.normals is not None and trace.contacts is not None
    assert np.allclose(np.linalg.norm(trace.normals, axis=1), 1.0)
    assert trace.normals[:, :2].std() == pytest.approx(np.radians(1.0), rel=0.03)
    assert trace.contacts[:, 2].std() == pytest.approx(5e-4, rel=0.03)


@pytest.mark.parametrize(
    ("move", "message"),
    [
        (across(high=0.5), "workspace"),
        (across(speed=1.0), "m/s"),
        (across(force=1e3), "N"),
    ],
)
def test_a_move_beyond_the_limits_is_refused_with_the_limit(move: Move, message: str) -> None:
    with pytest.raises(FingerError, match=message):
        SimulatedFinger(object=plate(), tip_radius=R).execute(move)


def test_bad_settings_are_refused_by_name() -> None:
    with pytest.raises(FingerError, match="white"):
        SimulatedFinger(object=plate(), tip_radius=R, white=-1.0)
    with pytest.raises(FingerError, match="rate"):
        SimulatedFinger(object=plate(), tip_radius=R, rate=0.0)


def test_it_is_a_finger_and_forgets_nothing_in_its_info() -> None:
    finger = SimulatedFinger(object=plate(), tip_radius=R, seed=5)
    assert isinstance(finger, Finger)
    assert finger.info["kind"] == "simulated" and finger.info["seed"] == 5


def test_a_scaled_world_gives_a_scaled_trace() -> None:
    scale = 2.0**-12
    finger = SimulatedFinger(object=plate(), tip_radius=R)
    small = SimulatedFinger(object=Surface(plate().vertices * scale, plate().faces), tip_radius=R * scale)
    big_move = across()
    move = Move(big_move.path * scale, big_move.approach, speed=0.03 * scale)
    assert np.array_equal(finger.execute(big_move).centers * scale, small.execute(move).centers)


def test_noise_of_nothing_is_nothing() -> None:
    assert NoiseSource(white=1.0, correlated=1.0).of_centers(np.random.default_rng(0), 0, 1e-5).shape == (0, 3)


def test_what_stands_beside_the_way_does_not_hold_a_ball_up_that_fits_under_it() -> None:
    # pressed at 40 degrees from outside a ball would meet the bar first, 0.81 radii too high; it slides in from the end
    into = np.array([np.sin(np.radians(40.0)), 0.0, -np.cos(np.radians(40.0))])
    beside = np.array([np.cos(np.radians(40.0)), 0.0, np.sin(np.radians(40.0))])
    middle = np.array([0.05, 0.06, R]) - R * (0.5 * into + 0.95 * beside)
    corners = middle + 1e-6 * np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    along = np.array([0.0, 0.02, 0.0])
    bar = np.concatenate([corners - along, corners + along])
    sides = [[k, (k + 1) % 4, 4 + (k + 1) % 4] for k in range(4)] + [[k, 4 + (k + 1) % 4, 4 + k] for k in range(4)]
    floor = plate()
    body = Surface(np.concatenate([floor.vertices, bar]), np.concatenate([floor.faces, np.array(sides)[:, ::-1] + 4]))
    path = np.array([[0.05, 0.02, 0.98 * R], [0.05, 0.098, 0.98 * R]])
    trace = SimulatedFinger(object=body, tip_radius=R).execute(Move(path, into))
    assert np.abs(trace.centers[:, 2] - R).max() < 1e-9
