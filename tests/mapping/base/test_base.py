"""The base: heights over a mesh, and the family that the evidence chooses without one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.base.fit import fit_base
from mapping.errors import TraceError
from mapping.geometry.templates import step_height
from mapping.surface import Surface
from mapping.trace import Trace

TIP, BODY, NOISE = 2e-3, 40e-3, 2e-5

CENTERS: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "plane": lambda u, v: np.column_stack([u, v, TIP + 0 * u]),
    "cylinder": lambda u, v: np.column_stack([v, (BODY + TIP) * np.sin(u / BODY), (BODY + TIP) * np.cos(u / BODY)]),
    "sphere": lambda u, v: (
        (BODY + TIP)
        * np.column_stack(
            [np.sin(v / 0.05) * np.cos(u / 0.05), np.sin(u / 0.05), np.cos(v / 0.05) * np.cos(u / 0.05)],
        )
    ),
    "quadric": lambda u, v: np.column_stack([u, v, TIP + 2 * u**2 - 3 * v**2]),
    "sheet": lambda u, v: np.column_stack([u, v, TIP + 2e-3 * np.sin(u / 0.015) * np.cos(v / 0.02)]),
}


def _sweeps(centers: Callable[[FloatArray, FloatArray], FloatArray], bump: float = 0.0) -> Trace:
    rng = np.random.default_rng(0)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn = turn if turn[2, 2] > 0 else turn @ np.diag([1, 1, -1])
    u = np.linspace(-0.05, 0.05, 1000)
    points = np.concatenate([centers(u, np.full_like(u, v)) for v in np.linspace(-0.05, 0.05, 20)])
    points[:, 2] += bump * np.tile(np.abs(u - 0.01) < 2e-3, 20)
    points = points @ turn.T + NOISE * rng.normal(size=points.shape)
    sweep = np.repeat(np.arange(20), 1000)
    return Trace(np.arange(20000.0), points, sweep, TIP, normals=np.tile(turn[:, 2], (20000, 1)))


@pytest.mark.parametrize("kind", CENTERS)
def test_each_family_is_recognised_and_fits_to_the_noise(kind: str) -> None:
    trace = _sweeps(CENTERS[kind])
    base = fit_base(trace)
    height = base.foot(trace.centers, TIP).height
    assert base.kind == kind
    assert abs(height.mean()) < 0.1 * NOISE
    assert height.std() < 1.1 * NOISE


@pytest.mark.slow
def test_radii_of_fitted_bodies_are_the_truth_less_the_tip() -> None:
    for kind in ("sphere", "cylinder"):
        assert fit_base(_sweeps(CENTERS[kind])).parameters["radius"] == pytest.approx(BODY, abs=2e-5)


@pytest.mark.parametrize(("pitch", "rings"), [(1e-3, 20), (10e-3, 3)])
@pytest.mark.parametrize("inside", [False, True])
def test_rings_about_a_short_cylinder_are_a_cylinder(pitch: float, rings: int, inside: bool) -> None:
    """The axis is the direction that they scatter least in: what tells the noise of a plate tells nothing here."""
    rng, turn = np.random.default_rng(4), np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    radius = (20e-3 + 1e-6 * rng.normal(size=(rings, 1000))).ravel()
    around, level = np.tile(turn, rings), np.repeat(pitch * np.arange(rings), 1000)
    centers = np.column_stack([radius * np.cos(around), radius * np.sin(around), level])
    base = fit_base(Trace(np.arange(len(level)) * 1.0, centers, np.repeat(np.arange(rings), 1000), TIP), inside=inside)
    assert base.kind == "cylinder"
    assert base.parameters["radius"] == pytest.approx(22e-3 if inside else 18e-3, abs=1e-6)


def test_a_feature_does_not_bend_the_fitted_plane() -> None:
    trace = _sweeps(CENTERS["plane"], bump=3e-4)
    height = fit_base(trace).foot(trace.centers, TIP).height
    assert abs(np.median(height)) < 0.2 * NOISE
    assert height.max() == pytest.approx(3e-4, abs=5 * NOISE)


def test_a_plate_whose_details_take_most_of_the_path_is_known_by_the_ends_of_its_sweeps() -> None:
    """Eight studs and what they hold the ball off take 57 % of it: half of it would lie on no base, and a bent sheet
    came nearer than the plane that such a fit finds."""
    rng, tip, noise = np.random.default_rng(0), 3e-3, 5e-6
    x, lines = np.arange(0.0, 40e-3, 60e-6), np.arange(31)
    u, v = (grid.ravel() for grid in np.meshgrid(x, 0.8e-3 * lines))
    studs = [(8e-3 * (1 + i), 8e-3 * (1 + j)) for i in range(4) for j in range(2)]
    away = np.min([np.hypot(u - a, v - b) for a, b in studs], axis=0)
    height = step_height(2.4e-3 - away, 1.8e-3, tip)
    centers = np.column_stack([u, v, tip + 0.01 * u + height]) + rng.normal(0.0, noise, (len(u), 3))
    base = fit_base(Trace(np.arange(len(u)) * 4e-3, centers, np.repeat(lines, len(x)), tip))
    assert base.kind == "plane" and base.known
    over = base.foot(centers, tip).height
    assert np.mean(height == 0.0) == pytest.approx(0.43, abs=0.01)
    assert np.abs(over - height / np.hypot(1.0, 0.01))[height == 0.0].max() < 6.0 * noise


def test_a_wire_does_not_bend_the_base_of_a_short_profile() -> None:
    x = np.arange(-15e-3, 15e-3, 6e-6)
    wire = np.clip(0.65e-3 - x**2 / (2 * 10.325e-3), 0, None)
    trace = Trace.from_profile(x, 0.01 + wire + 2e-4 * np.random.default_rng(0).normal(size=len(x)), 0.01)
    base = fit_base(trace)
    assert base.kind == "profile"
    error = base.foot(trace.centers, 0.01).height - (trace.centers[:, 2] - 0.01)
    assert np.abs(error).max() < 6e-5


def test_the_height_over_a_convex_edge_is_zero_on_the_trace_of_the_edge() -> None:
    roof = Surface([[-1, -1, -1], [-1, 1, -1], [0, -1, 0], [0, 1, 0], [1, -1, -1], [1, 1, -1]], [
        [0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5],
    ])  # fmt: skip
    angle = np.linspace(np.pi / 4, 3 * np.pi / 4, 50)
    centers = 0.1 * np.column_stack([np.cos(angle), np.zeros(50), np.sin(angle)])
    feet = Base(roof).foot(centers, 0.1)
    assert np.abs(feet.height).max() < 1e-15
    assert np.allclose(feet.points, 0, atol=1e-15)


def test_below_the_surface_the_height_is_less_than_minus_the_tip_radius() -> None:
    plate = Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    feet = Base(plate).foot([[0.5, 0.5, -0.2], [0.5, 0.5, 0.0]], 0.01)
    assert feet.height == pytest.approx([-0.21, -0.01])
    assert np.allclose(feet.normals, [[0, 0, 1], [0, 0, 1]])


def test_a_trace_in_one_place_has_no_base() -> None:
    with pytest.raises(TraceError, match="different places"):
        fit_base(Trace.from_profile(np.zeros(5), np.zeros(5), 1e-3))
