"""The stiff contact against closed forms, against itself at finer tolerance, and at the ends of its range."""

from __future__ import annotations

import numpy as np
import pytest

from hw.errors import FingerError
from hw.simulated.dynamics import Dynamics, refined

V, R, D = 0.03, 0.01, 0.65e-3
ARM = R + D / 2


def wire(times: np.ndarray) -> np.ndarray:
    """Rigid trace over the paper's wire, theory section 4, crossed at 30 mm/s; two kinks of 20.44 degrees."""
    x = np.clip(V * np.asarray(times) - 0.006, -ARM, ARM)
    return np.maximum(D - x**2 / (ARM + np.sqrt((ARM - x) * (ARM + x))), 0.0)


def instants(rate: float = 5000.0, seconds: float = 0.4) -> np.ndarray:
    return np.arange(int(rate * seconds)) / rate


def test_on_a_ramp_the_gap_is_the_force_over_the_stiffness() -> None:
    ride = Dynamics(mass=0.1, stiffness=1e4, gain=0.0).ride(lambda t: 0.2 * t, instants(), 1.0)
    assert np.abs(ride.gap[500:] + 1.0 / 1e4).max() < 1e-12
    assert np.abs(ride.force[500:] - 1.0).max() < 1e-7


def test_a_step_response_is_the_closed_form_of_a_critically_damped_mass() -> None:
    """A ramp that begins sets the tip off at a speed -w: y = -w t e^(-omega t) about its rest."""
    mass, k, slope = 0.5, 2e4, 1e-4
    t = instants()
    ride = Dynamics(mass=mass, stiffness=k, gain=0.0).ride(lambda s: slope * np.maximum(s - 0.1, 0.0), t, 1.0)
    omega, since = np.sqrt(k / mass), np.maximum(t - 0.1, 0.0)
    assert np.abs(ride.gap - (-1.0 / k - slope * since * np.exp(-omega * since))).max() < 1e-15


def test_a_tip_thrown_off_a_kink_flies_on_a_parabola_and_lands_where_it_must() -> None:
    """Down a cliff of slope -g: relative to it the tip leaves at speed g and is pulled back at u/m."""
    mass, drop = 0.1, 0.05
    dynamics = Dynamics(mass=mass, stiffness=1e9, gain=0.0)
    t = instants(rate=20000.0, seconds=0.06)
    ride = dynamics.ride(lambda s: -drop * np.maximum(s - 0.01, 0.0), t, 1.0)
    flight = 2 * drop * mass  # s, until it lands and bounces by e^-2 of its speed, as critical damping lets it
    flying = (ride.force == 0.0) & (t < 0.01 + flight)
    since = t[flying] - 0.01
    assert np.abs(ride.gap[flying] - (drop * since - 0.5 / mass * since**2)).max() < 2e-8
    assert flying.sum() / 20000.0 == pytest.approx(flight, abs=2e-4)
    again = (ride.force == 0.0) & (t > 0.01 + flight)
    assert again.sum() / 20000.0 == pytest.approx(flight * (np.exp(-2.0) + np.exp(-4.0) + np.exp(-6.0)), rel=0.2)


@pytest.mark.parametrize("mass", [1e-3, 3e-2, 1.0])
@pytest.mark.parametrize("rate", [1000.0, 5000.0])
def test_it_is_stable_from_soft_to_stiff_and_converges_to_the_rigid_trace(mass: float, rate: float) -> None:
    t = instants(rate, 2.0)
    error = []
    for k in 10.0 ** np.arange(2, 10):
        ride = Dynamics(mass=mass, stiffness=float(k), gain=0.5).ride(wire, t, 1.0)
        assert np.isfinite(ride.gap).all() and ride.force.min() >= 0.0
        assert ride.force[-1] == pytest.approx(1.0, abs=0.02)
        assert ride.gap[-1] == pytest.approx(-1.0 / k, rel=0.05)
        touching = ride.force > 0
        error.append(float(np.sqrt(np.mean(ride.gap[touching] ** 2))))
    assert (np.diff(error) < 0).all()
    assert error[-1] < 1e-7


@pytest.mark.parametrize("rate", [*(pytest.param(hz, marks=pytest.mark.slow) for hz in (1000.0, 2000.0)), 5000.0])
@pytest.mark.parametrize(
    ("mass", "stiffness"),
    [(1e-3, 1e9), (1.0, 1e2), (1.0, 1e6), pytest.param(1.0, 1e9, marks=pytest.mark.slow), (0.05, 1e6)],
)
def test_the_achieved_error_stays_within_the_tolerance_asked_for(mass: float, stiffness: float, rate: float) -> None:
    t = instants(rate)
    best = Dynamics(mass=mass, stiffness=stiffness, tolerance=1e-12).ride(wire, t, 1.0)
    for tolerance in (1e-6, 1e-8, 1e-10):
        ride = Dynamics(mass=mass, stiffness=stiffness, tolerance=tolerance).ride(wire, t, 1.0)
        assert np.abs(ride.gap - best.gap).max() < tolerance
        assert ride.error <= tolerance


def test_the_corners_gather_at_the_kinks_and_nowhere_else() -> None:
    corners, heights = refined(wire, instants(), 1e-9)
    kinks = (0.006 + np.array([-1, 1]) * np.sqrt(2 * R * D)) / V
    width = np.diff(corners)
    fine = corners[:-1][width < 1e-6]
    assert len(fine) and np.abs(fine[:, None] - kinks).min(axis=1).max() < 1e-4
    assert np.abs(np.interp(kinks, corners, heights)).max() < 1e-8


def test_whether_it_is_needed_follows_the_theory() -> None:
    assert not Dynamics(mass=0.1, stiffness=1e6).needed(0.03, np.radians(20.44), 2e-4)
    assert Dynamics(mass=1.0, stiffness=1e3).needed(0.03, np.radians(20.44), 2e-4)


def test_a_gain_that_cannot_be_stable_is_refused() -> None:
    with pytest.raises(FingerError, match="gain"):
        Dynamics(gain=1.0)


def test_the_dynamic_finger_feels_what_the_rigid_one_feels_when_it_is_stiff_and_light() -> None:
    from hw.move import Move
    from hw.simulated.dynamic_finger import DynamicFinger
    from hw.simulated.finger import SimulatedFinger
    from mapping.surface import Surface

    low = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], dtype=float)
    high = low + np.array([0.05, 0.0, 1e-3])
    body = Surface(np.concatenate([low, high]), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    move = Move(np.array([[0.03, 0.05, R], [0.07, 0.05, R]]), np.array([0.0, 0.0, -1.0]), force=1.0)
    rigid = SimulatedFinger(object=body, tip_radius=R, rate=2000.0).execute(move)
    stiff, soft = (
        DynamicFinger(object=body, tip_radius=R, rate=2000.0, dynamics=Dynamics(mass=m, stiffness=k)).execute(move)
        for m, k in ((1e-3, 1e9), (1.0, 1e4))
    )
    assert len(stiff) > 0.98 * len(rigid)
    at = np.interp(stiff.centers[:, 0], rigid.centers[:, 0], rigid.centers[:, 2])
    assert np.abs(stiff.centers[:, 2] - at).max() < 1e-7
    at = np.interp(soft.centers[:, 0], rigid.centers[:, 0], rigid.centers[:, 2])
    assert np.abs(soft.centers[:, 2] - at).max() > 1e-4
