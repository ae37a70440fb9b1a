"""A radius of the tip that is told too large is refuted by all crossings of a line together; the right one is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mapping import FloatArray, Interval, Surface, Trace
from mapping.assembly import assemble
from mapping.base import Base, LaidTrace
from mapping.detection import detect
from mapping.estimate.envelope import RefutedTip, refuted_by_lines, refuted_tip
from mapping.instrument import Noise
from tests.support.reported_wire import ridge

STEP, SWEEPS, PITCH = 0.01, 8, 0.5  # in true radii of the ball


def asked(
    told: float,
    height: float,
    section: float,
    noise: float,
    seed: int,
    tip_sd: float = 0.0,
    shared: bool = False,
    step: float = STEP,
) -> tuple[RefutedTip | None, RefutedTip | None]:
    """What the crossings of a ridge of this height and radius of section say of a told radius, and what bends alone
    say; all in true radii. `shared`: the noise is correlated over a fifth of a radius."""
    rng = np.random.default_rng((41, seed))
    x, lean, large = np.arange(-12.0, 12.0, step), rng.uniform(-0.3, 0.3), 1.0 + section
    rows = []
    for k in range(SWEEPS):
        y = PITCH * (k - 0.5 * SWEEPS)
        away = (x - lean * y) / np.hypot(1.0, lean)
        crest = height - large + np.sqrt(np.maximum(large**2 - away**2, 0.0))
        felt = np.maximum(crest, 0.0) + _errors(rng, len(x), noise, shared)
        rows.append(np.column_stack([x, np.full_like(x, y), felt]))
    corners = np.array([[-50.0, -50, -told], [50, -50, -told], [50, 50, -told], [-50, 50, -told]])
    base = Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    centers = np.concatenate(rows)
    trace = Trace(np.arange(len(centers)) * 1e-3, centers, np.repeat(np.arange(SWEEPS), len(x)), told)
    laid = LaidTrace.of(trace, base)
    found = detect(laid, base)
    keep = np.ones(len(trace), dtype=bool)
    keep[list(found.unfelt)] = False
    left = laid.within(keep)
    found = detect(left, base)
    lines = [each for each in assemble(found, left, base) if each.kind == "ridge"]
    return refuted_by_lines(laid, lines, found.noise, tip_sd), refuted_tip(laid, tip_sd)


def _errors(rng: np.random.Generator, count: int, noise: float, shared: bool) -> FloatArray:
    white = noise * rng.standard_normal(count)
    keep = np.exp(-STEP / 0.2)
    if not shared:
        return white
    kicks = noise * np.sqrt(1.0 - keep**2) * rng.standard_normal(count)
    return np.asarray(0.5 * white + lfilter([1.0], [1.0, -keep], kicks))


@pytest.mark.parametrize(
    ("told", "noise", "shared"),
    [
        (1.2, 5e-3, False),
        pytest.param(2.0, 5e-3, False, marks=pytest.mark.slow),
        (2.0, 2e-2, False),
        (2.0, 5e-3, True),
    ],
)
def test_crossings_refute_together_what_none_refutes_alone(told: float, noise: float, shared: bool) -> None:
    found, alone = asked(told, 0.1, 0.05, noise, seed=1, shared=shared)
    assert found is not None and found.told == told and found.places >= 3
    # the circle over the wire is of 1.05 radii; what noise leaves open is less than what was told
    assert 1.0 < found.largest < told
    assert alone is None or alone.largest > found.largest


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 6))])
def test_a_blade_under_the_right_ball_refutes_nothing(seed: int) -> None:
    """Over a blade the ball turns on a circle of its own radius: no body bends a trace more sharply."""
    assert asked(1.0, (0.03, 0.1, 0.25)[seed % 3], 0.0, 5e-3, seed=10 + seed, shared=seed >= 3)[0] is None


def test_a_doubt_that_covers_the_true_radius_leaves_it() -> None:
    assert asked(1.3, 0.1, 0.05, 5e-3, seed=2)[0] is not None
    assert asked(1.3, 0.1, 0.05, 5e-3, seed=2, tip_sd=0.1)[0] is None


def test_crests_of_a_few_samples_tell_nothing() -> None:
    assert asked(1.0, 0.3, 0.05, 1e-3, seed=3, step=0.25)[0] is None


@pytest.mark.parametrize("told", [1.0, 1.5])
def test_a_sweep_that_turns_beside_the_line_is_asked_for_one_passage(told: float) -> None:
    """Straight over a ring around a rod, and back aslant, all under one number and within a radius of the ring."""
    rod, height, turn, forth = 4.0, 0.1, 0.8, 0.8
    knots = np.arange(12.0)
    at = np.arange(0.0, knots[-1], STEP / (2.0 * turn))
    x = np.interp(at, knots, turn * (-1.0) ** knots)
    azimuth = np.interp(at, knots, forth * np.floor(0.5 * knots))
    far = rod + np.maximum(1.0, np.sqrt((1.0 + height) ** 2 - x**2))
    far += 5e-3 * np.random.default_rng(5).standard_normal(len(x))
    centers = np.column_stack([x, far * np.sin(azimuth), far * np.cos(azimuth)])
    # a rod of 400 flat sides is nowhere further from a round one than 1e-4
    sides = np.linspace(0.0, 2.0 * np.pi, 401)
    rim = np.column_stack([np.full(401, -5.0), rod * np.sin(sides), rod * np.cos(sides)])
    k = np.arange(400)
    quads = np.concatenate([np.column_stack([k, k + 401, k + 1]), np.column_stack([k + 1, k + 401, k + 402])])
    base = Base(Surface(np.concatenate([rim, rim + np.array([10.0, 0.0, 0.0])]), quads))
    laid = LaidTrace.of(Trace(at, centers, np.zeros(len(x), dtype=int), told), base)
    ring = np.linspace(0.0, azimuth[-1], 60)
    up = np.column_stack([0 * ring, np.sin(ring), np.cos(ring)])
    line = replace(ridge(), axis=rod * up, normals=up, height=Interval(height, height, height))
    refuted = refuted_by_lines(laid, [line], Noise(5e-3))
    assert (refuted is not None) == (told > 1.0)


def test_a_trace_without_a_line_is_not_asked() -> None:
    x = np.arange(0.0, 10.0, STEP)
    flat = Trace(x, np.column_stack([x, 0 * x, 0 * x]), np.zeros(len(x), dtype=int), 1.0)
    corners = np.array([[-50.0, -50, -1], [50, -50, -1], [50, 50, -1], [-50, 50, -1]])
    laid = LaidTrace.of(flat, Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]))))
    assert refuted_by_lines(laid, [], Noise(1e-3)) is None
