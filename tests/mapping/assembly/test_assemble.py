"""Features assembled from survey sweeps over closed-form ridges, bumps and rings on a plate."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.assemble import assemble, place_spacing
from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.detection.detect import detect
from mapping.geometry.templates.shapes import chain_height, rim_height, step_height
from mapping.surface import Surface
from mapping.trace import Trace

TIP, RADIUS, SPACING = 0.01, 0.325e-3, 3e-5
NORMAL = np.array([0.0, 0.0, 1.0])
SLOW = pytest.mark.slow


def plate() -> Base:
    corners = np.array([[-0.1, -0.075, 0], [0.1, -0.075, 0], [0.1, 0.075, 0], [-0.1, 0.075, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def survey(height, extra=(), pitch: float = 6e-3, seed: int = 0) -> Trace:
    """Sweeps along x, to and fro, and extra ones from point to point; white noise of the apparatus' density."""
    rng = np.random.default_rng(seed)
    lines = [((-0.095, y), (0.095, y)) for y in np.arange(-0.036, 0.037, pitch)]
    parts = []
    for number, (start, stop) in enumerate([*lines, *extra]):
        count = int(np.linalg.norm(np.subtract(stop, start)) / SPACING)
        foot = np.column_stack([np.linspace(start, stop, count), np.zeros(count)])
        noise = 0.2e-3 * np.sqrt(SPACING / 6e-6) ** -1 * rng.standard_normal((count, 3))
        centers = foot + np.outer(TIP + height(foot), NORMAL) + noise
        parts.append(Trace(10.0 * number + SPACING / 0.03 * np.arange(count), centers, np.full(count, number), TIP))
    return Trace.concatenate(parts)


def ridges(*axes):
    def height(foot):
        up = np.tile(NORMAL, (len(foot), 1))
        return np.max([chain_height(foot, up, np.asarray(axis), RADIUS, TIP) for axis in axes], axis=0)

    return height


def features(height, **options):
    trace, base = survey(height, **options), plate()
    return assemble(detect(trace, base), trace, base)


RIDGE = np.array([[-0.02, -0.025, RADIUS], [0.015, 0.03, RADIUS]])


@pytest.mark.parametrize(
    "extra",
    [
        (),
        (((-0.02, -0.025), (0.015, 0.03)),),
        pytest.param((((-0.03, -0.04), (0.025, 0.045)), ((0.01, -0.03), (-0.02, 0.03))), marks=SLOW),
        tuple(((x - 0.01, y + 0.006), (x + 0.01, y - 0.006)) for x, y in np.linspace(RIDGE[0, :2], RIDGE[1, :2], 12)),
    ],
    ids=["survey alone", "along the crest", "askew", "zigzag"],
)
def test_one_ridge_is_one_ridge_however_it_was_crossed(extra):
    (ridge,) = features(ridges(RIDGE), extra=extra)
    assert ridge.kind == "ridge"
    assert not ridge.closed
    assert ridge.curvature_feature
    assert abs(ridge.height.median - 0.65e-3) < 0.05e-3
    assert ridge.length.low - 1e-3 <= 0.0652 <= ridge.length.high
    direction = (RIDGE[1] - RIDGE[0])[:2] / np.linalg.norm(RIDGE[1] - RIDGE[0])
    lateral = (ridge.axis[:, :2] - RIDGE[0, :2]) @ np.array([-direction[1], direction[0]])
    assert np.abs(lateral).max() < 0.5e-3


def test_a_bare_plate_has_no_features():
    assert features(lambda foot: np.zeros(len(foot))) == ()


def test_a_bump_is_a_bump_and_two_are_two():
    (bump,) = features(ridges([[0.001, 0.002, RADIUS]]))
    assert bump.kind == "bump"
    two = features(ridges([[0.001, 0.0005, RADIUS]], [[0.022, 0.012, RADIUS]]))
    assert [f.kind for f in two] == ["bump", "bump"]


@pytest.mark.slow
def test_a_ring_is_one_closed_ridge():
    angle = np.linspace(0, 2 * np.pi, 60)
    ring = np.column_stack([0.03 * np.cos(angle), 0.03 * np.sin(angle), np.full(60, RADIUS)])
    (found,) = features(ridges(ring))
    assert found.kind == "ridge"
    assert found.closed
    assert abs(found.length.median - 2 * np.pi * 0.03) < 0.012


def test_a_ridge_along_the_sweeps_is_not_two_steps():
    (ridge,) = features(ridges([[-0.03, 0.001, RADIUS], [0.03, 0.001, RADIUS]]))
    assert ridge.kind == "ridge"
    assert abs(ridge.length.median - 0.06) < 4e-3


def test_a_step_is_one_step():
    (step,) = features(lambda foot: step_height(foot[:, 0] - 0.01 - 0.2 * foot[:, 1], 0.5e-3, TIP))
    assert step.kind == "step"
    assert abs(step.height.median - 0.5e-3) < 0.05e-3
    assert len(step.axis) >= 10


@pytest.mark.parametrize("pitch", [pytest.param(1e-3, marks=SLOW), pytest.param(2e-3, marks=SLOW), 4e-3])
def test_an_arc_that_a_raster_runs_along_is_one_ridge(pitch):
    turn = np.linspace(0.2, 0.2 + 0.9 * np.pi, 40)
    arc = np.column_stack([0.015 * np.cos(turn), 0.015 * np.sin(turn), 0 * turn + RADIUS])
    (ridge,) = features(ridges(arc), pitch=pitch)
    assert ridge.kind == "ridge" and not ridge.closed
    assert np.abs(np.linalg.norm(ridge.axis[1:-1, :2], axis=1) - 0.015).max() < 0.25 * pitch + 0.5e-3
    # few sweeps tell the ends roughly, until the posterior is sought
    assert ridge.length.median == pytest.approx(0.015 * 0.9 * np.pi, abs=1e-3 + 1.5 * pitch)


@pytest.mark.parametrize("slope", [pytest.param(0.02, marks=SLOW), 0.1, pytest.param(0.2, marks=SLOW)])
def test_a_ridge_at_a_slant_to_a_raster_is_one_ridge_with_its_ends(slope):
    line = np.array([[-0.03, 0.3e-3, RADIUS], [0.03, 0.3e-3 + 0.06 * slope, RADIUS]])
    (ridge,) = features(ridges(line), pitch=2e-3)
    ends = ridge.axis[np.argsort(ridge.axis[:, 0])][[0, -1], :2]
    assert np.linalg.norm(ends - line[:, :2], axis=1).max() < 1.5e-3


@pytest.mark.slow
def test_a_tee_is_a_junction():
    found = features(ridges([[0.01, -0.035, RADIUS], [0.01, 0.035, RADIUS]], [[0.01, 0, RADIUS], [0.05, 0.02, RADIUS]]))
    assert {f.kind for f in found} == {"ridge"}
    assert len(found) >= 2
    assert all("junction" in f.notes for f in found)


def test_a_ridge_beyond_the_inspected_part_is_at_least_as_long_as_what_was_seen():
    (ridge,) = features(ridges([[0.01, -0.06, RADIUS], [0.012, 0.06, RADIUS]]))
    assert ridge.length.censored
    assert 0.06 < ridge.length.low < 0.085
    assert any("at least" in note for note in ridge.notes)


def test_an_end_that_was_seen_is_no_limit():
    (ridge,) = features(ridges(RIDGE))
    assert not ridge.length.censored
    assert ridge.length.low - 1e-3 < 0.0652 < ridge.length.high + 1e-3


def hollow(rim):
    """Height over a hollow of which `rim` (N, 2) -> (N,) is the distance inside its rim."""
    return lambda foot: rim_height(rim(foot[:, :2]), TIP)


def test_a_pit_is_a_pit_and_a_groove_a_groove():
    (pit,) = features(hollow(lambda p: 4e-3 - np.linalg.norm(p - [0.003, 0.004], axis=1)), pitch=4e-3)
    assert pit.kind == "pit"
    np.testing.assert_allclose(pit.axis[0], [0.003, 0.004, 0.0], atol=3e-4)
    half = np.array([0.022, 2.5e-3])
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    (groove,) = features(hollow(lambda p: (half - np.abs(p @ turn.T)).min(axis=1)))
    assert groove.kind == "groove"
    assert groove.length.low - 2e-3 < 0.044 < groove.length.high + 2e-3
    assert abs(groove.height.median + 2.5e-3**2 / (2 * TIP)) < 0.08e-3


def test_a_circuit_on_the_plateau_adds_nothing_to_a_step():
    def height(foot):
        return step_height(foot[:, 0] - 0.01 - 0.2 * foot[:, 1], 0.5e-3, TIP)

    plain = survey(height)
    angle = np.arange(0.0, 2 * np.pi, SPACING / 0.01)
    foot = np.column_stack([0.05 + 0.01 * np.cos(angle), 0.01 * np.sin(angle), 0.0 * angle])
    noise = 0.09e-3 * np.random.default_rng(9).standard_normal(foot.shape)
    t = 1000.0 + SPACING / 0.03 * np.arange(len(foot))
    circle = Trace(t, foot + np.outer(TIP + height(foot), NORMAL) + noise, np.full(len(foot), 99), TIP)
    trace = Trace.concatenate([plain, circle])
    (step,) = assemble(detect(trace, plate()), trace, plate())
    assert step.kind == "step"


@pytest.mark.slow
def test_two_ridges_that_cross_are_two_ridges():
    found = features(
        ridges([[-0.03, -0.02, RADIUS], [0.03, 0.02, RADIUS]], [[-0.01, 0.03, RADIUS], [0.012, -0.03, RADIUS]])
    )
    assert [f.kind for f in found] == ["ridge", "ridge"]
    assert all("junction" in f.notes for f in found)
    lengths = sorted(f.length.median for f in found)
    np.testing.assert_allclose(lengths, [np.hypot(0.022, 0.06), np.hypot(0.06, 0.04)], atol=3e-3)


def test_what_an_exact_trace_shows_of_a_shapes_own_error_says_nothing_of_the_typical_height() -> None:
    def crossing(x: float, height: float) -> Crossing:
        half_width = float(np.sqrt(2.0 * TIP * abs(height)))
        place = np.array([x, 0.0, 0.0])
        return Crossing(0, 0.0, place, NORMAL, np.array([1.0, 0.0, 0.0]), "concave", height, 1e-12, 1e-6, half_width,
                        1.0, 1e6, True, 0, 1)  # fmt: skip

    groove = [crossing(0.004 * k, -1.5e-4) for k in range(5)]
    ripple = [crossing(0.002 + 1e-4 * k, -1e-9) for k in range(12)]
    assert place_spacing([*groove, *ripple], TIP) == place_spacing(groove, TIP)
    # farther than what a groove disturbs they are details of their own
    alone = [crossing(1.0 + 1e-4 * k, -1e-9) for k in range(12)]
    assert place_spacing([*groove, *alone], TIP) < 0.01 * place_spacing(groove, TIP)
