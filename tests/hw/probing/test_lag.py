"""What of a force sensor's delay is left, learnt from the trace itself, against lags that were put in."""

from __future__ import annotations

import numpy as np
import pytest

from hw.probing.lag import Lag

STIFFNESS = 1e4


def slid(lag: float, chatter: float, rng: np.random.Generator, noise: float = 5e-7):
    """A stage that chatters while it slides over a round crest at 15 mm/s under a sensor that is late by `lag`."""
    t = np.arange(0.0, 2.0, 1e-3)
    walk = np.cumsum(rng.standard_normal(len(t) // 10 + 1)) * 0.3 + rng.standard_normal(len(t) // 10 + 1)
    knots = np.arange(len(walk)) * 10e-3

    def press(at):
        return 1e-4 + chatter * np.interp(at, knots, walk)

    def surface(at):
        return 0.5e-3 * np.exp(-(((15e-3 * (at - 1.0)) / 3e-3) ** 2))

    stage = surface(t) - press(t)
    felt = STIFFNESS * press(t - lag)
    up = np.tile([0.0, 0.0, 1.0], (len(t), 1))
    positions = np.column_stack([15e-3 * t, np.zeros(len(t)), stage])
    rigid = positions + felt[:, None] / STIFFNESS * up
    rigid[:, 2] += noise * rng.standard_normal(len(t))
    return t, positions, rigid, up


@pytest.mark.parametrize("lag", [-4e-4, 0.0, 1.5e-4, 6e-4])
def test_the_lag_is_learnt_from_the_chatter_of_the_stage(lag):
    learnt, rng = Lag(), np.random.default_rng(1)
    for _ in range(4):
        learnt.learn(*slid(lag, 4e-6, rng))
    assert learnt.seconds == pytest.approx(lag, abs=5e-5)


def test_a_still_stage_teaches_nothing():
    learnt = Lag()
    learnt.learn(*slid(5e-4, 1e-9, np.random.default_rng(2)))
    assert abs(learnt.seconds) < 2e-4
    learnt.learn(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    flat = np.arange(100) * 1e-3, np.zeros((100, 3)), np.zeros((100, 3)), np.tile([0.0, 0, 1], (100, 1))
    before = learnt.seconds
    learnt.learn(*flat)
    assert learnt.seconds == before
