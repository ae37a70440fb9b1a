"""Posteriors of features that disturb one another's traces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_features import CROSSINGS, ENDS, SLIDES, D, feature, line, plate, record, wire

from mapping.inference.feature_posterior import refine
from mapping.inference.joint import refine_all
from mapping.instrument.noise import Noise

NOISE = Noise(0.1e-3)
HUB = np.array([0.8e-3, -1.1e-3, 0.0])
WAYS = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians([20.0, 140.0, 260.0])]
ARMS = [np.stack([HUB, HUB + 0.024 * way]) for way in WAYS]


def trace_over_arms():
    """Sweeps across each of three arms, 3 mm apart, and a slide off each of their ends."""
    tops = [wire(arm) for arm in ARMS]
    paths = []
    for way in WAYS:
        across = np.array([-way[1], way[0], 0.0])
        for at in np.arange(6e-3, 24e-3, 3e-3):
            middle = HUB + at * way
            paths.append(line(*(middle[:2] + side * 9e-3 * across[:2] for side in (-1, 1))))
        paths.append(line((HUB + 14e-3 * way)[:2], (HUB + 34e-3 * way)[:2]))
    return record(paths, lambda feet: np.max([top(feet) for top in tops], axis=0), NOISE)


def guesses(off):
    """The arms as they may be detected: with a wrong meeting place."""
    axes = [np.linspace(HUB + off, arm[1], 5) for arm in ARMS]
    return [replace(feature("ridge", axis, D, D, 6, 0.1e-3), junction=True) for axis in axes]


@pytest.mark.slow
def test_arms_that_meet_share_the_place_where_they_do():
    told = []
    found = refine_all(
        guesses(np.array([0.9e-3, 0.7e-3, 0.0])),
        trace_over_arms(),
        0,
        base=plate(),
        noise=NOISE,
        confirm=False,
        progress=told.append,
    )
    assert told == [1 / 3, 2 / 3, 1.0]
    for one, true in zip(found, ARMS, strict=True):
        np.testing.assert_allclose(one.axis[0], HUB, atol=0.1e-3)
        np.testing.assert_allclose(one.axis[-1], true[1], atol=0.15e-3)
        way = (true[1] - true[0]) / np.linalg.norm(true[1] - true[0])
        aside = (one.axis - HUB) @ np.array([-way[1], way[0], 0.0])
        assert np.sqrt(np.mean(aside**2)) < 0.05e-3
    assert np.array_equal(found[0].axis[0], found[1].axis[0]) and np.array_equal(found[0].axis[0], found[2].axis[0])


@pytest.mark.slow
def test_features_far_from_each_other_are_refined_each_for_itself():
    pair = [np.array([[-12e-3, y, 0.0], [12e-3, y, 0.0]]) for y in (-15e-3, 15e-3)]
    tops = [wire(ends) for ends in pair]
    paths = [line((x, -30e-3), (x, 30e-3)) for x in (-8e-3, -3e-3, 3e-3, 8e-3)]
    trace = record(paths, lambda feet: np.max([top(feet) for top in tops], axis=0), NOISE)
    detected = [feature("ridge", ends * [0.7, 1.0, 1.0], D, D) for ends in pair]
    both = refine_all(detected, trace, 3, base=plate(), noise=NOISE, confirm=False)
    alone = refine(
        detected[1],
        trace,
        np.random.default_rng([3, 1]),
        base=plate(),
        noise=NOISE,
        others=both[:1],
        confirm=False,
    )
    assert np.array_equal(both[1].posterior.samples, alone.posterior.samples)


def test_a_false_detail_beyond_the_end_of_a_ridge_takes_nothing_of_it():
    trace = record(CROSSINGS + SLIDES, wire(ENDS), NOISE)
    end = np.array([16e-3, -0.2e-3, 0.0])
    ridge = feature("ridge", [(-15e-3, 0.3e-3, 0.0), end - np.array([1.2e-3, 0.0, 0.0])], D, D, 6)
    false = feature("bump", end + np.array([5e-3, 0.5e-3, 0.0]), 0.2e-3, 3e-3, 1)
    found = refine_all([ridge, false], trace, 0, base=plate(), noise=NOISE, confirm=False)
    np.testing.assert_allclose(found[0].axis[-1], end, atol=0.12e-3)
    assert found[0].evidence.likely and not found[1].evidence.likely


def test_nothing_detected_is_nothing_refined():
    assert refine_all([], trace_over_arms(), 0, base=plate(), noise=NOISE) == ()
