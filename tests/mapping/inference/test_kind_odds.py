"""Odds between kinds, on traces whose kind is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from explore3d.bench.posterior.odds import OddsCase, reliability, run_odds
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates.shapes import chain_height
from mapping.inference import as_broken, as_bump, log_evidence, pose_problem
from mapping.inference.families import Surroundings
from mapping.inference.feature_posterior import odds_against_nothing, solve
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, D, NOISE = 10e-3, 0.65e-3, Noise(0.1e-3)
UP = np.array([0.0, 0.0, 1.0])


def traced(chain, seed=0, present=True):
    rng = np.random.default_rng(seed)
    y = np.arange(-10e-3, 10e-3, 20e-6)
    paths = [np.column_stack([np.full(len(y), x), y, np.zeros(len(y))]) for x in (-4e-3, 0.0, 4e-3)]
    feet = np.concatenate(paths)
    height = chain_height(feet, np.tile(UP, (len(feet), 1)), chain, D / 2, TIP) * present
    height = height + NOISE.white * rng.standard_normal(len(feet))
    sweep = np.repeat(np.arange(3), len(y))
    return Trace(np.arange(float(len(feet))), feet + np.outer(TIP + height, UP), sweep, TIP)


def setting(kind):
    corners = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
    axis = np.zeros((1, 3)) if kind == "bump" else np.array([[-4e-3, 0.1e-3, 0], [4e-3, 0, 0]])
    sizes = Interval.normal(D, 0.05e-3), Interval(D, 0.5 * D, 2 * D), Interval.normal(8e-3, 2e-3)
    evidence = Support(50.0, 3)
    feature = Feature(kind, axis, np.tile(UP, (len(axis), 1)), *sizes, evidence, True, 0.1e-3)
    return feature, Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def test_a_ridge_is_told_from_a_bump():
    wire, ball = np.array([[-7e-3, 0, D / 2], [7e-3, 0, D / 2]]), np.array([[0, 0, D / 2]])
    feature, base = setting("ridge")
    odds = []
    for chain in (wire, ball):
        around, rng = Surroundings(traced(chain), base, NOISE), np.random.default_rng(0)
        ridge = pose_problem(feature, around)
        odds.append(log_evidence(ridge, rng) - log_evidence(as_bump(ridge, feature, around), rng))
    assert odds[0] > 10.0 and odds[1] < 0.0


@pytest.mark.slow
def test_something_is_told_from_nothing():
    feature, base = setting("bump")
    ball = np.array([[0, 0, D / 2]])
    present, absent = (
        odds_against_nothing(solve(feature, trace, np.random.default_rng(0), base=base, noise=NOISE, confirm=False))
        for trace in (traced(ball), traced(ball, present=False))
    )
    assert present > 20.0 and absent < 0.0


@pytest.mark.slow
def test_two_ridges_in_line_are_told_from_one():
    y = np.arange(-10e-3, 10e-3, 20e-6)
    paths = [np.column_stack([np.full(len(y), x), y, np.zeros(len(y))]) for x in np.arange(-9e-3, 10e-3, 3e-3)]
    x = np.arange(-14e-3, 14e-3, 20e-6)
    feet = np.concatenate([*paths, np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))])])
    sweep = np.repeat(np.arange(len(paths) + 1), [*(len(path) for path in paths), len(x)])
    up = np.tile(UP, (len(feet), 1))
    lift = np.array([0, 0, D / 2])
    parts = [np.array([[-10e-3, 0, 0], [-3e-3, 0, 0]]) + lift, np.array([[4e-3, 0, 0], [10e-3, 0, 0]]) + lift]
    whole = np.array([[-10e-3, 0, 0], [10e-3, 0, 0]]) + lift
    feature, base = setting("ridge")
    axis = np.array([[-9e-3, 0.1e-3, 0], [9e-3, 0, 0]])
    feature = replace(feature, axis=axis, evidence=Support(50.0, 5))
    odds = []
    for chains in (parts, [whole]):
        height = np.max([chain_height(feet, up, chain, D / 2, TIP) for chain in chains], axis=0)
        height = height + NOISE.white * np.random.default_rng(1).standard_normal(len(feet))
        trace = Trace(np.arange(float(len(feet))), feet + np.outer(TIP + height, UP), sweep, TIP)
        whole_ridge, rng = pose_problem(feature, Surroundings(trace, base, NOISE)), np.random.default_rng(0)
        odds.append(log_evidence(as_broken(whole_ridge), rng) - log_evidence(whole_ridge, rng))
    assert odds[0] > 10.0 and odds[1] < 0.0


@pytest.mark.slow
@pytest.mark.parametrize("pair", ["bump or nothing", "ridge or bump"])
def test_stated_probabilities_come_true(pair):
    cases = [run_odds(pair, seed) for seed in range(60)]
    stated = 1.0 / (1.0 + np.exp(-np.array([case.log_odds for case in cases])))
    first = np.array([case.first for case in cases])
    for group in (stated < 0.5, stated >= 0.5):
        p = stated[group]
        assert abs(first[group].mean() - p.mean()) < 3.5 * np.sqrt((p * (1 - p)).sum()) / len(p) + 0.02
    assert stated[first].mean() > stated[~first].mean() + 0.3


def test_reliability_compares_what_was_stated_with_what_came_true():
    cases = [OddsCase("ridge or bump", k, k % 4 != 0, float(np.log(3.0))) for k in range(40)]
    (row,) = reliability(cases)
    assert (row.low, row.high, row.count) == (0.7, 0.9, 40)
    assert row.stated == pytest.approx(0.75) and row.came_true == pytest.approx(0.75)
