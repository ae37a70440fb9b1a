"""A shape felt by a tip whose radius is a parameter: the quick way through three radii against each row's own."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_features import CROSSINGS, ENDS, GUESS, SLIDES, TIP, WHITE, D, plate, record, wire

import mapping.inference.families.free_tip as free_tip
from mapping.inference.families import Surroundings
from mapping.inference.feature_posterior import pose_problem


@pytest.mark.parametrize("share", [0.01, 0.02, 0.05])
def test_the_heights_of_other_tips_are_those_of_each_row_s_own(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    trace = record(CROSSINGS + SLIDES, wire(ENDS))
    problem = pose_problem(GUESS, Surroundings(trace, plate(), WHITE, (), share * TIP))
    shape = problem.target.shape
    theta = np.repeat(problem.beginnings[:1], 9, axis=0)
    theta[:, -1] = TIP * (1.0 + share * np.linspace(-2.5, 2.5, 9))
    quick = shape.templates(theta)
    monkeypatch.setattr(free_tip, "NARROW_PRIOR", 0.0)
    exact = shape.templates(theta)
    changes = exact - exact[4]
    assert np.abs(changes).max() > 0.1 * share * D  # the radius does change what is felt
    error = quick - exact
    # where a footprint begins the heights are not smooth: few samples, whose error is small against the change
    assert np.sqrt(np.mean(error**2)) < 0.03 * np.sqrt(np.mean(changes**2))
    assert np.abs(error).max() < 0.4 * share * D
