"""Odds between kinds, on traces whose kind is known."""

from __future__ import annotations

import numpy as np

from mapping.base import Base
from mapping.feature import Evidence, Feature, Interval
from mapping.kind_odds import bump_or_ridge
from mapping.noise import Noise
from mapping.refine import odds_against_nothing, solve
from mapping.shapes import chain_height
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
    evidence = Evidence(50.0, 3)
    feature = Feature(kind, axis, np.tile(UP, (len(axis), 1)), *sizes, evidence, True, 0.1e-3)
    return feature, Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def test_a_ridge_is_told_from_a_bump():
    wire, ball = np.array([[-7e-3, 0, D / 2], [7e-3, 0, D / 2]]), np.array([[0, 0, D / 2]])
    feature, base = setting("ridge")
    odds = [
        bump_or_ridge(feature, traced(chain), np.random.default_rng(0), base=base, noise=NOISE)
        for chain in (wire, ball)
    ]
    assert odds[0] > 10.0 and odds[1] < 0.0


def test_something_is_told_from_nothing():
    feature, base = setting("bump")
    ball = np.array([[0, 0, D / 2]])
    present, absent = (
        odds_against_nothing(solve(feature, trace, np.random.default_rng(0), base=base, noise=NOISE, confirm=False))
        for trace in (traced(ball), traced(ball, present=False))
    )
    assert present > 20.0 and absent < 0.0
