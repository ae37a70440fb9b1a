"""A crest felt by a worn ball: its plateau is the tip's, which evidence tells from a flat top under a whole ball."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_features import CROSSINGS, ENDS, GUESS, TIP, WHITE, D, plate

from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.inference import refine
from mapping.inference.families import Surroundings, WornTipShape
from mapping.inference.feature_posterior import pose_problem

FLAT = 0.2 * TIP
DEPTH = TIP - np.sqrt(TIP**2 - (0.5 * FLAT) ** 2)


def felt(feet: FloatArray, worn: bool) -> FloatArray:
    """Heights of a ball, worn or whole, over the ground that it feels: the wire's circle dilated by brute force."""
    along = (np.array(ENDS[1]) - ENDS[0])[:2]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    away = np.abs((feet[:, :2] - np.array(ENDS[0])[:2]) @ across)
    x = np.linspace(-0.5 * D, 0.5 * D, 4001)
    top = 0.5 * D + np.sqrt((0.5 * D) ** 2 - x**2)
    table = np.linspace(0.0, 5e-3, 2001)
    below = np.sqrt(TIP**2 - (table[:, None] + x) ** 2)
    rest = TIP - DEPTH if worn else TIP
    heights = (top + np.minimum(below, rest)).max(axis=1) - rest
    return np.interp(away, table, np.maximum(heights, 0.0), right=0.0)


def recorded(worn: bool) -> tuple[Trace, Base]:
    """Crossings of the wire by a ball that stands too low on the ground, and the ground as it was felt."""
    feet = np.concatenate(CROSSINGS)
    height = felt(feet, worn) + WHITE.white * np.random.default_rng(2).standard_normal(len(feet))
    centers = feet + (TIP - DEPTH + height)[:, None] * [0.0, 0.0, 1.0]
    sweep = np.repeat(np.arange(len(CROSSINGS)), [len(path) for path in CROSSINGS])
    return Trace(1e-3 * np.arange(len(feet)), centers, sweep, TIP), replace(plate(), offset=-DEPTH)


def test_the_heights_are_those_of_a_dilation_by_brute_force() -> None:
    trace, base = recorded(worn=True)
    problem = pose_problem(GUESS, Surroundings(trace, base, WHITE))
    shape = WornTipShape(problem.target.shape, DEPTH)
    assert shape.across == pytest.approx(FLAT)
    theta = shape.start.copy()
    theta[:-5] = 0.0
    theta[-2:] = D, np.log(0.5 * D)
    feet = problem.window.feet
    # the course of the guess is not quite that of the wire: places are those over the guess
    axis = GUESS.axis[-1] - GUESS.axis[0]
    across = np.array([-axis[1], axis[0], 0.0]) / np.linalg.norm(axis)
    away = np.abs((feet - GUESS.axis[0]) @ across)
    wire = np.array(ENDS[1]) - ENDS[0]
    there = np.array(ENDS[0]) + away[:, None] * np.array([-wire[1], wire[0], 0.0]) / np.linalg.norm(wire)
    error = shape.templates(theta[None])[0] - felt(there, worn=True)
    assert np.abs(error).max() < 0.01 * D


@pytest.mark.parametrize("worn", [True, False])
@pytest.mark.slow
def test_evidence_tells_a_worn_ball_from_one_that_stands_too_low(worn: bool) -> None:
    trace, base = recorded(worn)
    found = refine(GUESS, trace, np.random.default_rng(1), base=base, noise=WHITE, confirm=False)
    assert any("worn flat" in note for note in found.notes) == worn
    assert found.height.low < D < found.height.high
    assert found.height.high - found.height.low < 0.15 * D
    # what a plateau is of, the flat or the crest, no section tells: a width under a worn ball is a bound
    assert found.width.bounded == worn and found.width.censored == worn and (found.width.low == 0.0) == worn
    assert found.width.high > D
